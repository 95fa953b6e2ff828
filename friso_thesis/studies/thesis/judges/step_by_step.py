"""Judge the steps by which the thesis explains mass, friction gap and alpha (Sec. 4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.equations.controllers.van_dijk import CROSSOVER
from friso.hunting.criteria import COUNTED_AFTER, SWINGS
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import NOTHING_TO_COMPARE, Evidence, Finding, Part, Response, judges
from friso_thesis.studies.thesis.judges.arguments import LIGHT
from friso_thesis.studies.thesis.judges.shares import NARROW, WIDE, Sticking, sticking
from friso_thesis.studies.thesis.maps import trend, trend_text, verdict_table
from friso_thesis.studies.thesis.reading import reading
from friso_thesis.studies.thesis.studies import STUDIES

LOW_ALPHA, HIGH_ALPHA = "alpha 0.1", "alpha 0.2"
"""Names of the responses of the locked rig at both ends of the range of alpha in which it hunts."""

HEAVIEST = "5.1 kg"
"""Name of the response of the locked rig with the heaviest mass of Table 3, with which it no longer hunts."""

_ISOLATED = tuple(name for name in STUDIES if name.startswith("isolator"))

_COUNTED_FOR = 10.0
"""Time [s] in which peaks are counted (Sec. 3.2.2)."""


@dataclass(frozen=True)
class ArguedCycle:
    """A motion after the return, reduced to the quantities of the thesis's arguments.

    `overshoot` [m] is that of the cycle beyond the reference (NaN without a cycle). `build_up` [N/s] is the mean rate
    at which the integral action changes until peaks are counted. `stick` describes the sticks that end in
    break-away.
    """

    overshoot: float
    build_up: float
    stick: Sticking


def cycle_of(response: Response) -> ArguedCycle:
    """Return the cycle of a response.

    Overshoot and sticks are taken after the time from which peaks count.
    """
    trace = response.trace
    time, integral = (np.asarray(trace[name].values) for name in ("time", "force_i"))
    deviation = (trace["position"] - trace["reference"]).values
    moving = np.flatnonzero(np.abs(np.diff(trace["reference"].values)) > 0)
    still = (time > (time[moving[-1] + 1] if moving.size else 0.0)) & (time < COUNTED_AFTER)
    rate = float(np.abs(np.diff(integral[still])).sum() / np.ptp(time[still]))
    sticks = sticking(response)
    late = np.abs(deviation[time >= COUNTED_AFTER])
    return ArguedCycle(float(late.max()) if sticks.both else np.nan, rate, sticks)


def _against(first: float, second: float, unit: str, names: tuple[str, str]) -> str:
    texts = (f"{value:.3g} {unit}" if np.isfinite(value) else "no cycle" for value in (first, second))
    return " against ".join(f"{text} with {name}" for text, name in zip(texts, names, strict=True))


@judges("S41M", figure="Sec. 4.1, mass step by step", needs=(LIGHT, HEAVIEST))
def heavier_mass_step_by_step(evidence: Evidence) -> Finding:
    """Judge whether the integral action builds up more slowly with a heavier mass.

    Also judge whether no peaks are counted with the heavy mass.
    """
    light, heavy = (cycle_of(evidence.responses[name]) for name in (LIGHT, HEAVIEST))
    counted = int(evidence.responses[HEAVIEST].cell["count"])
    return Finding(
        (
            Part(
                "after the return the integral action builds up more slowly with the heavier mass, until peaks count",
                heavy.build_up < light.build_up,
                _against(light.build_up, heavy.build_up, "N/s", (LIGHT, HEAVIEST)),
                why="It does not.",
            ),
            Part(
                "the heavier mass does not break away any more: no peaks are counted",
                counted == 0,
                f"{counted} peaks with {HEAVIEST}, {int(evidence.responses[LIGHT].cell['count'])} with {LIGHT}",
                why="It still breaks away.",
            ),
        )
    )


@judges("S41G", figure="Sec. 4.1, gap and overshoot", needs=(WIDE, NARROW))
def larger_gap_larger_overshoot(evidence: Evidence) -> Finding:
    """Judge whether a wider friction gap gives more overshoot and faster build-up.

    The gap is static minus Coulomb friction; two gaps are compared. What builds up is the integral action.
    """
    wide, narrow = (cycle_of(evidence.responses[name]) for name in (WIDE, NARROW))
    undecided = "" if wide.stick.both and narrow.stick.both else NOTHING_TO_COMPARE
    return Finding(
        (
            Part(
                "the larger gap overshoots the reference more",
                wide.overshoot > narrow.overshoot,
                _against(1e3 * wide.overshoot, 1e3 * narrow.overshoot, "mm", (WIDE, NARROW)),
                why="It overshoots less.",
                undecided=undecided,
            ),
            Part(
                "with the larger gap the integral action builds up faster after the return",
                wide.build_up > narrow.build_up,
                _against(wide.build_up, narrow.build_up, "N/s", (WIDE, NARROW)),
                why="It builds up more slowly.",
                undecided=undecided,
            ),
        )
    )


@judges("S41A", figure="Sec. 4.1, alpha and break-away", needs=(LOW_ALPHA, HIGH_ALPHA))
def larger_alpha_breaks_away_sooner(evidence: Evidence) -> Finding:
    """Judge whether the stage sticks for a shorter time with a larger alpha.

    Both ends of the range of alpha are compared. Also judge whether the integral action then has a smaller fraction of
    the force at break-away.
    """
    low, high = (cycle_of(evidence.responses[name]).stick for name in (LOW_ALPHA, HIGH_ALPHA))
    undecided = "" if low.both and high.both else NOTHING_TO_COMPARE
    return Finding(
        (
            Part(
                "with the larger alpha the stage breaks away after a shorter time",
                high.mean(high.time) < low.mean(low.time),
                f"{high.words(high.time, _seconds)} with {HIGH_ALPHA}, {low.words(low.time, _seconds)} with "
                f"{LOW_ALPHA}",
                why="It sticks longer.",
                undecided=undecided,
            ),
            Part(
                "with the larger alpha the integral action has a smaller share of the force at break-away",
                high.mean(high.integral) < low.mean(low.integral),
                f"{high.words(high.integral, percent)} with {HIGH_ALPHA}, {low.words(low.integral, percent)} with "
                f"{LOW_ALPHA}",
                why="Its share is larger.",
                undecided=undecided,
            ),
        )
    )


def _seconds(time: float) -> str:
    return f"{time:.2f} s"


@judges("F25R", figure="25", needs=("system",), of_runs=True)
def response_time_falls_with_crossover(evidence: Evidence) -> Finding:
    """Judge whether lasting cycles become faster as the crossover rises, on average over masses."""
    words = reading()
    runs = evidence.maps["system"]
    crossover, mass, moving, _ = verdict_table(runs, CROSSOVER, "mass")
    period = runs["period"].transpose(CROSSOVER, "mass").values
    lasting = moving & (runs["outcome"] == SWINGS).transpose(CROSSOVER, "mass").values
    trends = np.array([trend(crossover[cells], period[cells, k]) for k, cells in enumerate(lasting.T)])
    some = np.isfinite(trends)
    mean = float(trends[some].mean()) if some.any() else np.nan
    return Finding(
        (
            Part(
                "with the joint locked, over the map of Fig. 11B, a cycle goes round faster as the crossover rises "
                f"(mean rank correlation of its period over the masses at most {-words.trend:g})",
                mean <= -words.trend,
                f"mean rank correlation {trend_text(mean)}, over {some.sum()} of {len(mass)} masses",
                why="The period does not fall.",
            ),
        )
    )


@judges("S5P", figure="Sec. 5, peaks and cycles", needs=_ISOLATED, of_runs=True)
def more_peaks_than_cycles(evidence: Evidence) -> Finding:
    """Judge whether some isolated runs that swing to their end count more peaks than cycles."""
    swinging, more = 0, 0
    for name in _ISOLATED:
        runs = evidence.maps[name]
        lasting = (runs["outcome"].values == SWINGS) & (runs["peaks"].values > 0) & np.isfinite(runs["period"].values)
        cycles = _COUNTED_FOR / runs["period"].values
        swinging += int(lasting.sum())
        more += int((lasting & (runs["peaks"].values > cycles + 1)).sum())
    return Finding(
        (
            Part(
                "in some isolated runs more peaks are counted than cycles fit into ten seconds, and one",
                more > 0,
                f"{more} of {swinging} runs that swing to their end",
                why="Peaks that count are half a second apart, and the internal mode swings by less than 0.1 mm.",
            ),
        )
    )
