"""Show what machines drawn from uncertain keys do: in sentences, a table, a figure, and the JSON document."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from friso.hunting import cannot_hunt
from friso.hunting.criteria import ATTRACTED, UNDECIDED, VERDICT_CRITERION, VERDICTS
from friso.identification.estimate import ways_to_show
from friso.quantities import plain_factor
from friso.questions.check.words import speed_text
from friso.shown.drawing.figure import BLUE, GREY, MAUVE, ORANGE, SKY, VERMILLION, Axis, Band, Figure, Panel
from friso.shown.motion_words import case_labels
from friso.shown.text import NOTHING, if_so, length_at_rest, percentage, range_with_unit, share_with_interval, with_unit
from friso.studies.draws import TRIAL_DRAWS, DrawnBandwidths, Draws, Fates

COLOURS = {
    "hunts": VERMILLION,
    "bistable": ORANGE,
    "transient": SKY,
    "settles": BLUE,
    "undecided": MAUVE,
    "failed": GREY,
}

HISTOGRAM_BARS = 24
"""Number of bars in the histogram."""

MOST_LISTED = 4
"""Largest number of keys whose influence on the verdict the table lists."""


def draws_rows(draws: Draws) -> list[tuple[str, list[str]]]:
    """Return the table's rows on machines drawn from uncertain keys.

    A row has its name, and a text for the joint as given, locked and free.
    """
    fates = [draws.fates[name] for name in case_labels(draws.stage)]
    cannot = [bool(_cannot_hunt(name, draws)) for name in case_labels(draws.stage)]

    def shares(words: tuple[str, ...]) -> list[str]:
        return [
            "none: it cannot" if never else share_with_interval(fate.share(words))
            for fate, never in zip(fates, cannot, strict=True)
        ]

    rows = [
        ("Hunts after this move", shares(("hunts",))),
        ("A cycle attracts", shares(ATTRACTED)),
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


def draws_colours(draws: Draws) -> list[str]:
    """Return the colours of the verdicts on the machines drawn, with the joint as given, locked and free."""

    def colour(name: str) -> str:
        hunting = np.isin(draws.fates[name].verdicts, ATTRACTED).any()
        return COLOURS["bistable" if draws.split(name) else "hunts" if hunting else "settles"]

    return [colour(name) for name in case_labels(draws.stage)]


def draws_sentences(draws: Draws) -> list[str]:
    """Say what the machines drawn do, with the joint as given, locked and free, and what cures those that hunt."""
    cut = f"Interrupted: {draws.sample.count} of {draws.asked} stages were drawn so far."
    cases = case_labels(draws.stage).items()
    so = if_so(draws.stage)
    says = [f"{label}{so}: {_verdict(name, draws)}{_at_other_bandwidths(name, draws)}" for name, label in cases]
    return [*([cut] if draws.sample.count < draws.asked else []), *says]


def draws_details(draws: Draws) -> list[str]:
    """Say what would narrow the ranges, and which draws were left out because they are no valid machines."""
    sample = draws.sample
    says = [text for text in [_narrowed(draws)] if text]
    if sample.left_out:
        reasons = [f"{count}: {why}" for why, count in sample.broken.items()]
        beyond = [f"{sample.beyond}: a key beyond its bounds"] if sample.beyond else []
        says.append(f"{sample.left_out} invalid draws were left out ({'; '.join([*beyond, *reasons])}).")
    return says


def _verdict(name: str, draws: Draws) -> str:
    """Say in one sentence whether the machines drawn hunt, and on which key that hangs.

    `name` is the case: "given", "locked" or "free".
    """
    fates, count = draws.fates[name], draws.sample.count
    attracted, after_this = fates.share(ATTRACTED), fates.share(("hunts",))
    lost, open_ones = int(np.count_nonzero(fates.unstable)), sum(fates.counts[word] for word in UNDECIDED)
    loop = f"the loop of {lost} of {count} machines drawn is unstable, whatever the friction; " if lost else ""
    doubt = f", {open_ones} of them not for certain" if open_ones else ""
    if cannot := _cannot_hunt(name, draws):
        return f"{loop}{cannot}."
    if open_ones == count:
        return f"{loop}what {count} machines drawn do is not certain."
    tried = draws.bandwidths.get(name)
    if tried and tried.hunting_reaches and not attracted.probability:
        some, factor = tried.hunting_reaches
        tell = f"{some} of the {len(tried.hunts)} tried at other bandwidths {'does' if some == 1 else 'do'} at"
        return f"{loop}may hunt: none of {count} machines drawn does{doubt}, but {tell} {_bandwidth(tried, factor)}."
    if draws.split(name) and not attracted.probability:
        return f"{loop}none of {count} machines drawn surely hunts{doubt.replace(' of them', '')}."
    if draws.split(name):
        does = f"may hunt: {share_with_interval(attracted)} of {count} machines drawn do{_swings(fates)}{doubt}"
        return f"{loop}{does}.{_hangs_on(fates, draws)}"
    if not attracted.probability:
        rare = f"at most {percentage(attracted.high)} % of all such machines do"
        return f"{loop}does not hunt: none of {count} machines drawn does ({rare}{doubt})."
    always = after_this.probability == attracted.probability
    never = "settles after this move, but another move or a kick makes it hunt"
    does = "hunts" if always else f"can hunt, and {share_with_interval(after_this)} of the machines do after this move"
    does = does if after_this.probability else never
    return f"{loop}{does}{_swings(fates)} (all of {count} machines drawn{doubt})."


def _cannot_hunt(name: str, draws: Draws) -> str:
    """Say why no machine drawn can hunt, and how far off the reference they rest; "" if one may hunt.

    `name` is the case: "given", "locked" or "free".
    """
    fates, count = draws.fates[name], draws.sample.count
    reason = cannot_hunt(draws.stage.variants()[name])
    if not reason or not fates.offsets.size or np.isin(fates.verdicts, (*UNDECIDED, *ATTRACTED)).any():
        return ""
    off, within = fates.offsets[np.isfinite(fates.offsets)], float(draws.stage.flat().get("tolerance.within", 0.0))
    cannot = f"cannot hunt, because {reason}"
    if not off.size:
        return f"{cannot}; none of {count} machines drawn has come to rest at the end of this motion"
    least, most = (length_at_rest(float(end), within) for end in (off.min(), off.max()))
    far = range_with_unit(float(off.min()), float(off.max()), "m") if least[0] != "<" else most
    far = f"up to {far}" if least[0] == "<" != most[0] else far
    drawn = f"{count} machines drawn{f', {count - off.size} of them still moving' if off.size < count else ''}"
    return f"{cannot}; after this motion it rests {far} off its reference ({drawn})"


def _hangs_on(fates: Fates, draws: Draws) -> str:
    """Say which key decides most whether a machine hunts, whether it is unknown, and what would show it; "" if none."""
    keys = fates.separations(draws.sample.keys)
    if not keys:
        return ""
    key, strength = next(iter(keys.items()))
    side = "larger" if strength > 0 else "smaller"
    if key not in draws.stage.unknown_keys and not getattr(draws.stage.uncertain().get(key), "wide", False):
        return f" That depends most on {key}: {side} values hunt."
    ways = ways_to_show(key)
    shown = f" What shows it: {ways}." if ways else ""
    return f" That depends most on {key}, which nobody measured: {side} values hunt.{shown}"


def _swings(fates: Fates) -> str:
    """Write the ranges of amplitude and period of the machines that hunt; "" if none does."""
    amplitudes, periods = (values[np.isfinite(values)] for values in (fates.amplitudes, fates.periods))
    if not amplitudes.size:
        return ""
    far, slow = (
        range_with_unit(float(values.min()), float(values.max()), unit)
        for values, unit in ((2 * amplitudes, "m"), (periods, "s"))
    )
    return f", by {far} peak to peak every {slow}"


def _at_other_bandwidths(name: str, draws: Draws) -> str:
    """Say which bandwidth keeps all machines drawn from hunting, or below which they hunt; "" if it is not known."""
    tried = draws.bandwidths.get(name)
    if tried is None:
        return _freed(name, draws, " Cure: free the joint.")
    count, edge = len(tried.hunts), _ends_of_hunting(tried)
    bandwidth = partial(_bandwidth, tried)
    if np.any(tried.at(1.0) != 0):
        if tried.cure is None:
            top = bandwidth(float(tried.factors[-1]))
            freed = _freed(name, draws, " Cure: free the joint.")
            return f" No bandwidth up to {top} surely keeps 95 % of {count} machines from hunting.{freed}"
        low, high = tried.cure
        freed = _freed(name, draws, ", or free the joint")
        quiet = int(np.count_nonzero(tried.at(low) == 0))
        seen = f"{quiet} of {count} machines surely do not hunt there"
        speed = speed_text(draws.stage.controller, tried.own, low)
        return f" Cure: {speed}, up to {bandwidth(high)} at least ({seen}){freed}."
    if edge is None:
        return f" None of {count} hunts at {bandwidth(float(tried.factors[0]))} either."
    never = int(np.isnan(tried.edges[0]).sum())
    beyond = f" ({never} of {count} at none tried, or not for certain)" if never else ""
    least = plain_factor(edge[0]) if tried.own is None else bandwidth(edge[0])
    return f" Hunting begins below {least} to {bandwidth(edge[1])}{beyond}."


def _freed(name: str, draws: Draws, text: str) -> str:
    """Return a text that advises to free the joint, for a locked joint which no machine drawn needs; "" otherwise."""
    locked = name == "locked" or (name == "given" and draws.stage.joint and draws.stage.joint.locked)
    free = draws.fates.get("free")
    helps = locked and free is not None and not draws.split("free") and not np.isin(free.verdicts, ATTRACTED).any()
    return text if helps else ""


def _bandwidth(tried: DrawnBandwidths, factor: float) -> str:
    """Write a bandwidth by its factor: in Hz, or as a multiple if the controller states none."""
    return f"{plain_factor(factor)} times yours" if tried.own is None else with_unit(factor * tried.own, "Hz", 3)


def _ends_of_hunting(tried: DrawnBandwidths) -> tuple[float, float] | None:
    """Return the factors between which hunting of all machines ends; None if that is known of none."""
    low, high = tried.edges
    return (float(np.nanmin(low)), float(np.nanmax(high))) if np.isfinite(low).any() else None


def _narrowed(draws: Draws) -> str:
    """Say which key should be measured to narrow the ranges most; "" if this is not known.

    The key is the one with which the amplitudes of hunting correlate most.
    """
    fates = draws.fates["given"]
    shown = np.flatnonzero(np.isfinite(fates.amplitudes))
    if len(shown) < TRIAL_DRAWS or not np.ptp(fates.amplitudes[shown]) > 0:
        return ""
    ranks = fates.amplitudes[shown].argsort().argsort()
    follows = {
        key: abs(float(np.corrcoef(values[shown].argsort().argsort(), ranks)[0, 1]))
        for key, values in draws.sample.keys.items()
    }
    key = max(follows, key=lambda name: follows[name])
    ways = ways_to_show(key)
    return f"To narrow these ranges, measure {key}, which the amplitude follows most{f': {ways}' if ways else ''}."


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
        "split": draws.split(case),
        **_bandwidths(draws.bandwidths.get(case)),
    }


def _bandwidths(tried: DrawnBandwidths | None) -> dict[str, Any]:
    """Return where hunting of the machines drawn ends, and at which faster bandwidths none of them hunts."""
    edges = _ends(np.r_[tried.edges]) if tried else None
    cure = list(tried.cure) if tried and tried.cure else None
    own = tried.own if tried else None
    return {
        "tried_at_bandwidths": len(tried.hunts) if tried else 0,
        "edge_factor": edges,
        "edge_hz": [own * end for end in edges] if own and edges else None,
        "cure_factor": cure,
        "cure_hz": [own * end for end in cure] if own and cure else None,
    }


def _ends(values: np.ndarray) -> list[float] | None:
    """Return the least and the largest finite value; None if no value is finite."""
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else None
