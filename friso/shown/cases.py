"""Name and colour a stage as given, locked and free alike in figures, sentences and tables."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from friso.axis import unit_shown
from friso.hunting import Case
from friso.shown.drawing.palette import BLUE, GREEN, VERMILLION
from friso.shown.loop_words import UNSTABLE_AS_BUILT, after_loop
from friso.shown.motion_words import stick_slip_in_short
from friso.stage import Stage

COLOURS = {"given": BLUE, "locked": VERMILLION, "free": GREEN}
LABELS = {"given": "As given", "locked": "Locked", "free": "Free"}


def band_text(band: float) -> str:
    """Write a settling band [m] in words, such as 10 µm."""
    return f"{1e6 * band:.4g} {unit_shown('µm')}"


def verdict_in_short(case: Case) -> str:
    """Write the verdict as tables, pages and documents show it: how the loop is unstable, then what the stage does."""
    does = "" if swings_by_its_loop(case) else _does(case)
    return after_loop(does, case.unstable, case.unstable_as_built)


def swings_by_its_loop(case: Case) -> bool:
    """Tell whether a stage does not come to rest because its loop is unstable, without a cycle that was found."""
    return bool(case.unstable) and case.verdict in ("transient", "undecided")


def in_doubt(case: Case) -> bool:
    """Tell whether the verdict is not certain for another reason than what the drive does to the loop."""
    hunting = case.judgement.hunting
    return not hunting.certain and hunting.reason != UNSTABLE_AS_BUILT


def _does(case: Case) -> str:
    """Write what a stage does, whatever its loop, and whether that is certain."""
    if case.runs_away:
        return "runs away"
    if case.verdict == "none":
        return (case.stick_slip and stick_slip_in_short(case.stick_slip)) or "no verdict: its reference keeps moving"
    return f"{case.verdict}{' (not certain)' if in_doubt(case) else ''}"


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
