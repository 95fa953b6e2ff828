"""What `friso rig hunting` shows: Fig. 24 and 25 of the thesis, and the share of rails that hunts."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.hunting import COUNTED_ABOVE
from friso.studies.draws import Share
from friso.studies.rig.experiments.hunting import HuntingResult, Trace
from friso.studies.rig.hunted import Hunted
from friso.studies.rig.outcome import Outcome
from friso.views.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Axis,
    Band,
    Figure,
    Limit,
    Panel,
    Series,
)
from friso.views.drawing.prefixes import with_unit
from friso.views.rig.outcome_view import OutcomeView

TIME = Axis("Time", "s")
COLOURS = {"locked": VERMILLION, "free": BLUE}
AREAS = {"locked": "#f6dccb", "free": "#cfdfee"}
LINES = (GREY, GREEN, VERMILLION, ORANGE, PINK, SKY, BLUE, INK, GREY)
AFTERWARDS = 5.0
"""From where on [s] what is left of the move decides the height of a panel."""


def share_text(share: Share, count: int) -> str:
    """A share of rails with its interval, in words."""
    return f"{round(share.probability * count)} of {count} rails ({share.low:.0%} to {share.high:.0%})"


def sentences(outcome: Outcome) -> list[str]:
    """What hunts at which crossover, on the stage's own rail and on repeated ones."""
    it: HuntingResult = outcome.result
    own = it.shown[0]
    count = len(it.rails)
    return [
        f"A move of {with_unit(it.distance, 'm')} at {it.crossovers[own]:.3g} Hz hunts with the joint locked on "
        f"{share_text(it.shares('locked')[own], count)}, with it free on {share_text(it.shares('free')[own], count)} "
        "(95 % intervals).",
        _cycle(it),
        f"Joint locked: {_limit(it, 'locked')} Joint free: {_limit(it, 'free')}",
        *_started(it),
    ]


def _cycle(it: HuntingResult) -> str:
    """The cycle at the stage's own crossover with the joint locked."""
    runs = it.cases["locked"]
    lives = runs.lives[it.shown[0]]
    hunting = int((runs.peaks[it.shown[0]] > 0).sum())
    if not lives.any():
        return "With the joint locked no rail is in a cycle when the run ends."
    swing, period = runs.swing[it.shown[0]][lives], runs.period[it.shown[0]][lives]
    return (
        f"Of the {hunting} locked ones that hunt by the thesis's metric, {int(lives.sum())} still do when the run "
        f"ends, swinging by {with_unit(float(np.median(swing)), 'm')} from peak to peak with a period "
        f"of {with_unit(float(np.median(period)), 's')} (medians)."
    )


def _limit(it: HuntingResult, case: str) -> str:
    """Where hunting ends, on any rail and on the one shown."""
    last, shown = it.limit(case), it.limit(case, it.rail)
    if np.isnan(last):
        return f"no rail hunts from {it.crossovers[0]:.3g} to {it.crossovers[-1]:.3g} Hz."
    above = it.crossovers[it.crossovers > last]
    bound = it.shares(case)[-1].high
    beyond = f"none from {above[0]:.3g} Hz on (at most {bound:.0%} of all rails)" if len(above) else "none tried above"
    name = f"rail {it.rails[it.rail]:.0f}" if len(it.rails) > 1 else "it"
    own = f"{name} hunts up to {shown:.3g} Hz" if np.isfinite(shown) else f"{name} does not hunt"
    return f"some rails hunt up to {last:.3g} Hz, {beyond}; {own}."


def _started(it: HuntingResult) -> list[str]:
    """What a release starts that the move does not."""
    counts = [
        f"{int((it.cases['locked'].peaks[row] > 0).sum())} and {int(it.can_start[row].sum())} of {len(it.rails)} at "
        f"{it.crossovers[row]:.3g} Hz"
        for row in it.shown
    ]
    listed = ", ".join(with_unit(each, "m") for each in it.displacements)
    found = [f"Rails that hunt locked after the move, and after it or a release from {listed}: {'; '.join(counts)}."]
    if it.startable is not None:
        found.append(
            f"At {it.startable.crossover:.3g} Hz rail {it.rails[it.startable.rail]:.0f} settles after the move and "
            f"hunts until the end once released from {with_unit(it.startable.displacement, 'm')}: a run without "
            "hunting does not show that there is none."
        )
    return found


def figures(outcome: Outcome) -> list[Figure]:
    """Fig. 24, Fig. 25, a start by release, and the share of rails over the crossover."""
    it: HuntingResult = outcome.result
    made = [_locked_and_free(it), _crossovers(it), _shares(it)]
    return [*made, _startable(it)] if it.startable is not None else made


def _locked_and_free(it: HuntingResult) -> Figure:
    row = it.shown[0]
    lines = tuple(
        Series(t.time, t.deviation + it.distance, f"joint {case}", COLOURS[case])
        for case, t in ((case, it.traces[case, row]) for case in COLOURS)
    )
    reach = _reach([it.traces[case, row] for case in COLOURS])
    zoom = (it.distance - reach, it.distance + reach)
    return Figure(
        "hunting_locked_and_free",
        f"Move of {with_unit(it.distance, 'm')} at {it.crossovers[row]:.3g} Hz{_on(it)}",
        "The position that the drive logs (Fig. 24).",
        (
            Panel("A: position", TIME, Axis("Position", "m"), lines),
            Panel("B: about its end", TIME, Axis("Position", "m", zoom), lines, limits=(_end(it.distance),)),
        ),
        columns=2,
    )


def _end(place: float) -> Limit:
    return Limit((place,), "reference", INK, "dotted")


def _on(it: HuntingResult) -> str:
    return f", rail {it.rails[it.rail]:.0f}" if len(it.rails) > 1 else ""


def _reach(traces: list[Trace]) -> float:
    """Half the height [m] of a panel that shows what remains after the move."""
    late = [np.abs(t.deviation[t.time >= AFTERWARDS]).max() for t in traces]
    return 1.6 * max(float(np.nanmax(late)), 2 * COUNTED_ABOVE)


def _crossovers(it: HuntingResult) -> Figure:
    """One panel for each case, a line for each crossover of the thesis and the one beyond which none hunts."""
    panels = []
    reach = _reach([it.traces["locked", row] for row in it.shown])
    for case in COLOURS:
        lines = tuple(
            Series(t.time, t.deviation, f"{it.crossovers[row]:.3g} Hz", LINES[number + 1])
            for number, row in enumerate(it.shown)
            for t in (it.traces[case, row],)
        )
        axis = Axis("Position minus reference", "m", (-reach, reach))
        panels.append(Panel(f"joint {case}", TIME, axis, lines))
    return Figure(
        "hunting_crossovers",
        f"The same move at other crossovers{_on(it)}",
        "The error that remains after the move (Fig. 25 shows the joint locked).",
        tuple(panels),
        columns=2,
    )


def _shares(it: HuntingResult) -> Figure:
    bands, lines = [], []
    for case, colour in COLOURS.items():
        found = it.shares(case)
        low, high = (np.array([getattr(each, end) for each in found]) for end in ("low", "high"))
        share = np.array([each.probability for each in found])
        bands.append(Band(it.crossovers, low, high, f"95 % interval, {case}", AREAS[case]))
        lines.append(Series(it.crossovers, share, f"joint {case}", colour))
    lasting = it.cases["locked"].lives.mean(axis=1)
    lines.append(Series(it.crossovers, lasting, "locked, still swinging at the end", VERMILLION, "dashed"))
    lines.append(Series(it.crossovers, it.can_start.mean(axis=1), "locked, after it or a release", INK, "dotted"))
    panel = Panel("", Axis("Crossover", "Hz"), Axis("Share of rails", "", (-0.03, 1.03)), tuple(lines))
    return Figure(
        "hunting_shares",
        f"Share of {len(it.rails)} rails that hunts after the move",
        "By the thesis's metric: peaks after 10 s, higher than 0.1 mm.",
        (Panel(panel.title, panel.x, panel.y, panel.series, bands=tuple(bands[:1])),),
    )


def _startable(it: HuntingResult) -> Figure:
    found = it.startable
    assert found is not None
    both = (
        (found.after_move, "after the move", BLUE),
        (found.after_release, f"released from {with_unit(found.displacement, 'm')}", VERMILLION),
    )
    lines = tuple(Series(t.time, t.deviation, label, colour) for t, label, colour in both)
    reach = _reach([found.after_move, found.after_release])
    return Figure(
        "hunting_started",
        f"{found.crossover:.3g} Hz, joint locked, rail {it.rails[found.rail]:.0f}: hunting once started",
        "The same machine twice.",
        (Panel("", TIME, Axis("Position minus reference", "m", (-reach, reach)), lines),),
    )


def runs_document(runs: Hunted) -> dict[str, Any]:
    """What became of runs, as a document: arrays of the shape of the runs."""
    return {
        "peaks": runs.peaks.tolist(),
        "peak_to_peak_m": runs.swing,
        "period_s": runs.period,
        "lives": runs.lives,
        "failed": runs.failed,
    }


def share_document(share: Share) -> dict[str, float]:
    """A share and its 95 % interval."""
    return {"share": share.probability, "low": share.low, "high": share.high}


def numbers(outcome: Outcome) -> dict[str, Any]:
    """All that was found."""
    it: HuntingResult = outcome.result
    cases = {
        case: {**runs_document(runs), "hunts": [share_document(each) for each in it.shares(case)]}
        for case, runs in it.cases.items()
    }
    started = {"displacements_m": it.displacements}
    return {
        "distance_m": it.distance,
        "crossovers_hz": it.crossovers,
        "rail_seeds": it.rails,
        "cases": cases,
        "releases": started | runs_document(it.started),
    }


VIEW = OutcomeView(sentences, figures, numbers)
