"""What a check found, in words: the sentence per case, the conclusion and the table."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from friso.views.cases import BANDS, Shown
from friso.views.prefixes import with_unit

if TYPE_CHECKING:
    from friso.hunting import Case

_MICRON, _TEN_MICRON = BANDS


def verdict_sentence(item: Shown) -> str:
    """What the case does, in a sentence for the engineer who decides."""
    case = item.case
    size = f"{_amplitude(case)} peak to peak"
    if case.verdict == "hunts":
        every = f" every {with_unit(case.period, 's')}" if case.period and math.isfinite(case.period) else ""
        counted = f" ({case.peaks} peaks counted)" if case.peaks else ""
        return f"hunts, {size}{every}{counted}."
    if case.verdict == "bistable":
        return "settles after this move, but another move or a push can start hunting."
    if case.verdict == "transient":
        return f"has no counted peaks, but is not settled at the end of the run (still {size})."
    if case.verdict == "settles":
        return _settling(item, size)
    return f"{case.verdict} (solver: {case.solver.status})."


def conclusion(cases: Mapping[str, Case]) -> str | None:
    """What the joint does to the hunting, where both of its cases were run to a known verdict."""
    hunts = {key: cases[key].verdict == "hunts" for key in ("locked", "free") if key in cases}
    known = all(cases[key].verdict in ("hunts", "settles", "bistable", "transient") for key in hunts)
    if len(hunts) < 2 or not known:
        return None
    if hunts["locked"]:
        return "The free joint does not stop the hunting." if hunts["free"] else "The free joint stops the hunting."
    return "The stage hunts only with its joint free." if hunts["free"] else None


def _settling(item: Shown, size: str) -> str:
    times = item.case.settling_time
    fine, coarse = times.get(_MICRON), times.get(_TEN_MICRON)
    if fine is not None:
        return f"settles to within {BANDS[_MICRON]} in {with_unit(fine, 's')}."
    if coarse is not None:
        within = f"settles to within {BANDS[_TEN_MICRON]} in {with_unit(coarse, 's')}"
        return f"{within}, but does not stay within {BANDS[_MICRON]}."
    return f"settles by the peak count, but does not stay within {BANDS[_TEN_MICRON]} ({size} at the end)."


def rows(shown: tuple[Shown, ...]) -> list[tuple[str, list[str]]]:
    """The table: what is named, and its text for each case."""
    columns: dict[str, Callable[[Case], str]] = {
        "Verdict": lambda case: case.verdict,
        "Counted peaks": lambda case: str(case.peaks),
        "Peak to peak, last quarter": _amplitude,
        "Period, last quarter": lambda case: with_unit(case.period, "s"),
        **{f"Settling time into {text}": _settled_within(band) for band, text in BANDS.items()},
        "Largest actuator force": lambda case: with_unit(case.largest_force, "N"),
        "Solver status": lambda case: case.solver.status,
        "Steps (rejected)": lambda case: f"{case.solver.steps} ({case.solver.rejected})",
    }
    return [(name, [text(item.case) for item in shown]) for name, text in columns.items()]


def _amplitude(case: Case) -> str:
    """Peak to peak; below a nanometre the digits would be those of the solver, not of the stage."""
    return "< 1 nm" if case.peak_to_peak < 1e-9 else with_unit(case.peak_to_peak, "m")


def _settled_within(band: float) -> Callable[[Case], str]:
    def text(case: Case) -> str:
        time = case.settling_time.get(band)
        return "never" if time is None else with_unit(time, "s")

    return text
