"""Say how a stage follows its reference, and which limits moves do not reach.

A stage as given, locked and free has one name and one colour in figures, sentences and tables.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from friso.axis import axis_shown, unit_shown
from friso.equations.motion import initial_displacement, reference, rests
from friso.hunting import MORE_WORK, Case, Dwell, StickSlipSpeeds, Tracking
from friso.shown.drawing.figure import BLUE, GREEN, VERMILLION
from friso.shown.text import after_loop, listed, with_unit
from friso.stage import Stage
from friso.stage.rig import motion_of


def following_sentence(tracking: Tracking) -> str:
    """Say how far a stage is off a reference that keeps moving."""
    if not tracking.closed:
        why = " (no response of the period of its reference was closed)" if tracking.period else ""
        return f"{off_its_reference(tracking.largest, tracking.rms)}{why}."
    size = f"{with_unit(tracking.largest, 'm')} (RMS {with_unit(tracking.rms, 'm')})"
    says = f"follows its reference with an error of up to {size} that repeats every {with_unit(tracking.period, 's')}"
    if tracking.reversals:
        worst = max(tracking.reversals, key=lambda reversal: reversal.error)
        says += f", at most {with_unit(worst.error, 'm')} behind a reversal"
    ends = "" if tracking.attracts else ". Other motions do not come to this response: it repels"
    return f"{says}{ends}."


def stick_slip_in_short(speeds: StickSlipSpeeds) -> str:
    """Say what a stage does at a constant speed; empty if that was not decided."""
    if speeds.lasts is None:
        return ""
    if not speeds.lasts:
        return "slides smoothly"
    return "sticks and slips" if speeds.sticks else "swings about its reference"


def stick_slip_sentences(speeds: StickSlipSpeeds, speed: float) -> list[str]:
    """Say whether a stage slides smoothly at the constant `speed` [m/s] of its reference, and at which others."""
    at, does = f"at {with_unit(speed, 'm/s')}", stick_slip_in_short(speeds)
    if not does:
        stopped = "the run was stopped" if np.isnan(speeds.swing) else "its error still changes after the longest run"
        first = f"{at}, whether it slides smoothly was not decided: {stopped}"
    elif not speeds.lasts:
        first = f"{does} {at}"
    else:
        often = f" every {with_unit(speeds.period, 's')}" if speeds.period else ""
        first = f"{does} {at}, by {with_unit(speeds.swing, 'm')} peak to peak{often}"
    left = [f"It was not decided at {speeds.open_speeds} of the speeds tried."] if speeds.open_speeds else []
    low, high = (with_unit(value, "m/s") for value in speeds.tried)
    if speeds.tried[0] == speeds.tried[1]:
        return [f"{first}; other speeds take {MORE_WORK}."]
    if not speeds.ranges:
        return [f"{first}{'' if left else f'; no stick-slip from {low} to {high}'}.", *left]
    texts = [f"from {with_unit(one.slowest, 'm/s')} to {with_unit(one.fastest, 'm/s')}" for one in speeds.ranges]
    quiet = speeds.ranges[-1].quiet_above
    smooth = f"; smooth from {with_unit(quiet, 'm/s')} on" if quiet and not left else ""
    return [f"{first}. Started from rest, its error keeps swinging {listed(texts, 'and')}{smooth}.", *left]


def off_its_reference(largest: float, rms: float) -> str:
    """Say how far a stage ends off its reference [m], at most and as root mean square."""
    size = f"{with_unit(largest, 'm')} (RMS {with_unit(rms, 'm')})"
    return f"is off its reference, which keeps moving, by up to {size} in the last quarter of the run"


def dwell_sentences(dwells: Sequence[Dwell]) -> list[str]:
    """Say how a stage settles at each place where its reference stands, the slowest first.

    Returns [] for a reference that never stands.
    """
    if not dwells:
        return []
    texts = [f"{_place(dwell)} {_settling(dwell)}" for dwell in dwells]
    band = with_unit(dwells[0].bands[1], "m")
    return [f"Where its reference stands it is within {band}, the slowest first, {listed(texts, 'and')}."]


def _place(dwell: Dwell) -> str:
    """Name a place where the reference stands."""
    return f"at {with_unit(dwell.position, 'm')} (move {dwell.number})"


def _settling(dwell: Dwell) -> str:
    """Say how long a stage takes to settle at a place."""
    fine, coarse = (dwell.settling[band] for band in dwell.bands)
    if coarse is None:
        return "not before it leaves"
    finer = f" ({with_unit(dwell.bands[0], 'm')}: {with_unit(fine, 's')})" if fine is not None else ""
    return f"after {with_unit(coarse, 's')}{finer}"


def motion_sentences(stage: Stage) -> list[str]:
    """Say if the reference begins with a jump, and which motion limits short moves do not reach.

    The result is empty if neither applies.
    """
    flat, kind = stage.flat(), axis_shown()
    jump = float(reference(flat, np.zeros(1))[0]) - float(initial_displacement(flat))
    jumps = [f"The reference begins with a jump of {with_unit(jump, 'm')}."] if jump and not rests(flat) else []
    by_move: dict[float, list[str]] = {}
    for peak in motion_of(flat).lowered(flat):
        unit = kind.unit(peak.unit)
        text = f"{with_unit(peak.reached, unit)} instead of {with_unit(peak.limit, unit)}"
        by_move.setdefault(abs(peak.distance), [])
        if text not in by_move[abs(peak.distance)]:
            by_move[abs(peak.distance)].append(text)
    moves = [f"one of {with_unit(distance, 'm')} reaches {listed(texts, 'and')}" for distance, texts in by_move.items()]
    return [*jumps, *([f"Moves are too short for their limits: {'; '.join(moves)}."] if moves else [])]


COLOURS = {"given": BLUE, "locked": VERMILLION, "free": GREEN}
LABELS = {"given": "As given", "locked": "Locked", "free": "Free"}


def band_text(band: float) -> str:
    """Write a settling band [m] in words, such as 10 µm."""
    return f"{1e6 * band:.4g} {unit_shown('µm')}"


def verdict_in_short(case: Case) -> str:
    """Write the verdict as tables, pages and documents show it: how the loop is unstable, then what the stage does."""
    does = "" if swings_by_its_loop(case) else _does(case)
    return after_loop(does, case.unstable)


def swings_by_its_loop(case: Case) -> bool:
    """Tell whether a stage does not come to rest because its loop is unstable, without a cycle that was found."""
    return bool(case.unstable) and case.verdict in ("transient", "undecided")


def _does(case: Case) -> str:
    """Write what a stage does, whatever its loop, and whether that is certain."""
    if case.runs_away:
        return "runs away"
    if case.verdict == "none":
        return (case.stick_slip and stick_slip_in_short(case.stick_slip)) or "no verdict: its reference keeps moving"
    return f"{case.verdict}{'' if case.judgement.hunting.certain else ' (not certain)'}"


@dataclass(frozen=True)
class ShownCase:
    """A stage as given, with its joint locked, or free: what was checked, its label and colour."""

    key: str
    label: str
    colour: str
    case: Case


def shown_cases(cases: Mapping[str, Case]) -> tuple[ShownCase, ...]:
    """Return the checked cases to show, each once: as given, locked, free.

    If the case "given" equals the locked or the free case, that case is labelled "(as given)".
    """
    labels = _labels([*cases], cases["given"].stage if "given" in cases else None)
    return tuple(ShownCase(key, label, COLOURS[key], cases[key]) for key, label in labels.items())


def case_labels(stage: Stage) -> dict[str, str]:
    """Return the labels of the cases of a stage that are shown, by name: given, locked, free."""
    return _labels([*stage.variants()], stage)


def _labels(names: Collection[str], stage: Stage | None) -> dict[str, str]:
    """Return the labels of cases by name, without a case that equals another one.

    The label of the case that equals the stage as given says so.
    """
    joint = stage.joint if stage else None
    variant = "locked" if joint and joint.locked else "free"
    twin = variant if joint and variant in names else None
    listed = [name for name in COLOURS if name in names and not (name == "given" and twin)]
    return {name: LABELS[name] + (" (as given)" if name == twin else "") for name in listed}
