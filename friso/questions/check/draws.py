"""Show what machines drawn from uncertain keys do: in sentences, a table, a figure, and the JSON document."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from friso.hunting.criteria import ATTRACTED, UNDECIDED, VERDICT_CRITERION, VERDICTS
from friso.identification.ways import ways_to_show
from friso.shown.cases import case_labels
from friso.shown.drawing.figure import Axis, Band, Figure, Panel
from friso.shown.drawing.palette import BLUE, GREY, MAUVE, ORANGE, SKY, VERMILLION
from friso.shown.drawing.prefixes import NOTHING, listed, percentage, range_with_unit, share_with_interval
from friso.shown.unknown import if_so
from friso.studies.draws import Draws, Fates
from friso.studies.settings import settings

COLOURS = {
    "hunts": VERMILLION,
    "bistable": ORANGE,
    "transient": SKY,
    "settles": BLUE,
    "undecided": MAUVE,
    "failed": GREY,
}

OPEN = {
    "undecided": "undecided (what attracts them, or how their motion ends, is not certain)",
    "failed": "failed (their motion was not simulated to its end)",
}
"""What is said of draws with an open verdict."""

HISTOGRAM_BARS = 24
"""Number of bars in the histogram."""

MOST_LISTED = 4
"""Largest number of keys whose influence on the verdict the table lists."""


def draws_rows(draws: Draws) -> list[tuple[str, list[str]]]:
    """Return the table's rows on machines drawn from uncertain keys.

    A row has its name, and a text for the joint as given, locked and free.
    """
    fates = [draws.fates[name] for name in case_labels(draws.stage)]
    rows = [
        ("Hunts after this move", [share_with_interval(fate.share(("hunts",))) for fate in fates]),
        ("A cycle attracts", [share_with_interval(fate.share(ATTRACTED)) for fate in fates]),
        *((f"Verdict {word}", [str(fate.counts[word]) for fate in fates]) for word in VERDICTS),
    ]
    separations = [fate.separations(draws.sample.keys) for fate in fates]
    strength = {
        key: max((abs(separation[key]) for separation in separations if separation), default=0.0)
        for key in draws.sample.keys
    }
    strongest = sorted(strength, key=lambda key: -strength[key])[:MOST_LISTED]
    rows += [
        (f"Decided by {key}", [f"{separation[key]:+.2f}" if separation else NOTHING for separation in separations])
        for key in strongest
    ]
    return rows


def draws_sentences(draws: Draws) -> list[str]:
    """Say what the machines drawn do, with the joint as given, locked and free.

    If invalid draws were left out, the last sentence says how many and why.
    """
    sample = draws.sample
    cut = [f"Interrupted: {sample.count} of {draws.asked} stages were drawn so far."] * (sample.count < draws.asked)
    cases = case_labels(draws.stage).items()
    over = f"{if_so(draws.stage)}, over the uncertain values"
    sentences = [*cut, *(f"{label}{over}: {_sentence(name, draws)}" for name, label in cases)]
    sentences += [text for text in [_narrowed(draws)] if text]
    if sample.left_out:
        reasons = [f"{count}: {why}" for why, count in sample.broken.items()]
        beyond = [f"{sample.beyond}: a key beyond its bounds"] if sample.beyond else []
        sentences.append(f"{sample.left_out} invalid draws were left out ({'; '.join([*beyond, *reasons])}).")
    return sentences


def _swings(fates: Fates) -> str:
    """Write the ranges of amplitude and period of the machines that hunt; "" if none does."""
    amplitudes, periods = (values[np.isfinite(values)] for values in (fates.amplitudes, fates.periods))
    if not amplitudes.size:
        return ""
    far, slow = (
        range_with_unit(float(values.min()), float(values.max()), unit)
        for values, unit in ((amplitudes, "m"), (periods, "s"))
    )
    return f": by ± {far}, every {slow}"


def _edge(draws: Draws) -> str:
    """Write in which range of bandwidths hunting of the machines drawn ends; "" if not known."""
    drawn_edges = draws.edges
    if drawn_edges is None or not np.isfinite(drawn_edges.low).any():
        return ""
    span = range_with_unit(float(np.nanmin(drawn_edges.low)), float(np.nanmax(drawn_edges.high)), "Hz")
    beyond = int(np.isnan(drawn_edges.low).sum())
    out = f" ({beyond} of {len(drawn_edges.low)} have it farther away, nowhere or not for certain)" if beyond else ""
    return f"; the edge of hunting roughly at {span}{out}"


def _narrowed(draws: Draws) -> str:
    """Say which key should be measured to narrow the ranges most; "" if this is not known.

    The key is the one with which the amplitudes of hunting correlate most.
    """
    fates = draws.fates["given"]
    shown = np.flatnonzero(np.isfinite(fates.amplitudes))
    if len(shown) < settings.trial_draws or not np.ptp(fates.amplitudes[shown]) > 0:
        return ""
    ranks = fates.amplitudes[shown].argsort().argsort()
    follows = {
        key: abs(float(np.corrcoef(values[shown].argsort().argsort(), ranks)[0, 1]))
        for key, values in draws.sample.keys.items()
    }
    key = max(follows, key=lambda name: follows[name])
    ways = ways_to_show(key)
    return f"To narrow these ranges, measure {key}, which the amplitude follows most{f': {ways}' if ways else ''}."


def _sentence(name: str, draws: Draws) -> str:
    """Say how probable hunting is, with its amplitude and period, and which key matters most.

    `name` is the case: "given", "locked" or "free". For the stage as given, the edge of hunting is added.
    """
    fates = draws.fates[name]
    open_ones = {word: fates.counts[word] for word in UNDECIDED if fates.counts[word]}
    keys = fates.separations(draws.sample.keys)
    lost = int(np.count_nonzero(fates.unstable))
    sentences = (
        [f"the loop of {lost} of {draws.sample.count} draws is unstable, whatever the friction;"] if lost else []
    )
    hunting, attracted = (share_with_interval(fates.share(words)) for words in (("hunts",), ATTRACTED))
    none = "none hunts, and none has a cycle that attracts (fewer than {} % of all, with 95 % confidence)"
    probable, variants = fates.share(ATTRACTED), draws.stage.variants()
    edge = _edge(draws) if variants[name] == variants["given"] else ""
    sentences += [
        f"what {draws.sample.count} draws do is not certain."
        if sum(open_ones.values()) == draws.sample.count
        else f"of {draws.sample.count} draws, hunts with a probability of {hunting}, has a cycle that attracts with "
        f"{attracted}{_swings(fates)}{edge}."
        if probable.probability
        else f"of {draws.sample.count} draws, {none.format(percentage(probable.high))}{edge}."
    ]
    if open_ones:
        counts = listed([f"{count} {OPEN[word]}" for word, count in open_ones.items()], "and")
        sentences.append(f"{counts}; the intervals cover both outcomes for these.")
    if keys:
        key, separation = next(iter(keys.items()))
        sentences.append(
            f"{key} matters most ({separation:+.2f}): {'larger' if separation > 0 else 'smaller'} values hunt."
        )
    return " ".join(sentences)


def draws_figure(draws: Draws) -> Figure:
    """Draw stacked bars of the verdicts on machines over the most influential key.

    There is a panel for each state of the joint.
    """
    panels = [_panel(label, draws.fates[name], draws) for name, label in case_labels(draws.stage).items()]
    caption = (
        f"{draws.sample.count} stages drawn from the uncertain keys (seed {draws.seed}), by the key that best "
        "separates those with an attracting cycle from the others; all other uncertain keys vary too."
    )
    return Figure("draws", "What if the parameters are wrong?", caption, tuple(panels), min(2, len(panels)))


def _panel(label: str, fates: Fates, draws: Draws) -> Panel:
    """Draw stacked bars of the verdicts on machines over the key that best separates them.

    The key is one of the uncertain keys from which machines were drawn.
    """
    keys = draws.sample.keys
    key = next(iter(fates.separations(keys) or keys))
    edges = np.histogram_bin_edges(keys[key], HISTOGRAM_BARS)
    x, bands, below = np.repeat(edges, 2)[1:-1], [], np.zeros(2 * HISTOGRAM_BARS)
    for word in VERDICTS:
        counts = np.repeat(np.histogram(keys[key][fates.verdicts == word], edges)[0], 2).astype(float)
        if counts.any():
            bands.append(Band(x, below, below + counts, word, COLOURS[word]))
            below = below + counts
    limits = (0.0, 1.05 * float(below.max()))
    x_axis = Axis(key, draws.unit(key), (float(edges[0]), float(edges[-1])))
    title = f"{label}: all {bands[0].label}" if len(bands) == 1 else label  # a single band has no legend
    return Panel(title, x_axis, Axis("Draws", "", limits), bands=tuple(bands))


def draws_document(draws: Draws, case: str) -> dict[str, Any]:
    """Return the verdicts on the stages drawn, with the joint as given, locked or free."""
    fates = draws.fates[case]
    return {
        "count": draws.sample.count,
        "seed": draws.seed,
        "left_out": draws.sample.left_out,
        "hunts": asdict(fates.share(("hunts",))),
        "attracting_cycle": asdict(fates.share(ATTRACTED)),
        "criterion": VERDICT_CRITERION,
        "verdicts": fates.counts,
        "loop_unstable": int(fates.unstable.sum()),
        "separation": fates.separations(draws.sample.keys),
        "amplitude_m": _ends(fates.amplitudes),
        "period_s": _ends(fates.periods),
        "edge_hz": _ends(np.r_[draws.edges.low, draws.edges.high]) if draws.edges and case == "given" else None,
    }


def _ends(values: np.ndarray) -> list[float] | None:
    """Return the least and the largest finite value; None if no value is finite."""
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else None
