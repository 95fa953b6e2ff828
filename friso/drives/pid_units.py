"""Convert the gains of PID loops whose output is a force, between a drive's units and those of a stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose
from typing import Any

from friso.axis import KINDS, LINEAR, AxisKind
from friso.drives.format import AxisParameters, FlatStage, Parameters, lacks, si
from friso.drives.questions import OpenQuestion, UserAnswers
from friso.errors import InputError
from friso.quantities import Quantity, positive

FORCE, LENGTH = "force_per_output", "length_per_unit"
"""Keys of the user's answers: what an output of 1 exerts at the load, and how far a position of 1 is there."""

FORCE_FIELD = Quantity("N", positive, "20 N")
LENGTHS = {LINEAR: Quantity("m", positive, "1 um"), KINDS["rotary"]: Quantity("rad", positive, "0.01 deg")}

GAINS = {
    "kp": ("N/m", 1, -1, 0),
    "ki": ("N/(m*s)", 1, -1, -1),
    "kd": ("N*s/m", 1, -1, 1),
    "force_limit": ("N", 1, 0, 0),
    "integral_limit": ("N", 1, 0, 0),
    "error_deadband": ("m", 0, 1, 0),
}
"""Keys of [controller] with their unit on a linear axis, and their powers of output, position and time."""


@dataclass(frozen=True)
class PidUnits:
    """Units of a drive whose output is a force.

    They are the `force` of an output of 1 [N or N m], the `length` of a position of 1 [m or rad], and the `time` in
    which the drive counts [s].
    """

    kind: AxisKind
    force: float
    length: float
    time: float = 1.0

    def size(self, key: str) -> float:
        """Return what a 1 of the drive is in SI for a key of [controller]."""
        _, force, length, time = GAINS[key]
        return float(self.force**force * self.length**length * self.time**time)

    def table(self, axis: AxisParameters, names: Mapping[str, str]) -> dict[str, Any]:
        """Return the table [controller] of an axis, whose parameters have `names` by key of [controller].

        The derivative is that of the error: of the measurement, with the derivative gain on the reference's velocity,
        too. Raises InputError for a gain below 0, and if neither kp nor ki is greater.
        """
        table: dict[str, Any] = {"kind": "pid", "derivative_on": "measurement"}
        for key, name in names.items():
            if key in ("kp", "ki", "kd") and axis.number(name, 0.0) < 0:
                raise InputError(name, f"{axis.number(name):g}", "a gain of 0 or more", f"{name} = 10")
            if axis.is_set(name):
                table[key] = si(axis.number(name) * self.size(key), self.kind.unit(GAINS[key][0]))
        if not table.keys() & {"kp", "ki"}:
            raise InputError(names["kp"], "no gain greater than 0", "a loop that controls the position", "10")
        if "kd" in table:
            table["viscous_feedforward"] = table["kd"]
        if "ki" not in table:
            table.pop("integral_limit", None)
        return table

    def parameters(self, flat: FlatStage, names: Mapping[str, str]) -> Parameters:
        """Compute the parameters of a drive with `names` by key of [controller].

        Raises InputError for a controller other than a PID by its gains, and for one whose derivative is not that of
        the error.
        """
        if flat["controller.kind"] != "pid" or "controller.crossover" in flat:
            raise lacks(f'kind = "{flat["controller.kind"]}", or tuning rules', "a PID by its gains", 'kp = "3 N/m"')
        if flat.get("controller.tau", 0.0) > 0:
            raise lacks("a filter of the derivative", "no filter (tau = 0), which this drive has not")
        gain, ahead = flat.get("controller.kd", 0.0), flat.get("controller.viscous_feedforward", 0.0)
        if gain and flat["controller.derivative_on"] == "measurement" and not isclose(gain, ahead, rel_tol=1e-6):
            raise lacks("a derivative of the measurement alone", "viscous_feedforward = kd, as this drive has it")
        limits = {key for key in names if not GAINS[key][2]}
        values = {
            name: flat.get(f"controller.{key}", 0.0) / self.size(key)
            for key, name in names.items()
            if key not in limits or f"controller.{key}" in flat
        }
        return Parameters(values, frozenset({*names, "viscous_feedforward"}))


def kind_of_length(answers: UserAnswers) -> tuple[AxisKind, float]:
    """Return the kind of axis and the length of a position of 1 [m or rad], as the user answers.

    Raises InputError for another unit.
    """
    return answers.kind_of(LENGTH, LENGTHS)


def open_units(answers: UserAnswers, kind: AxisKind, output: str, position: str = "") -> list[OpenQuestion]:
    """List what is open of the units: what an `output` of 1 exerts, and what a `position` of 1 is, unless it is ""."""
    asked = open_length(answers, position, '"0.5 um"') if position else []
    if FORCE not in answers:
        asked.append(OpenQuestion(FORCE, f"what {output} exerts at the load", FORCE_FIELD.on(kind).written_example))
    return asked


def open_length(answers: UserAnswers, position: str, example: str) -> list[OpenQuestion]:
    """Ask how far a `position` of 1 is unless it is answered."""
    what = f"how far {position} moves the load; an angle on a rotary axis"
    return [] if LENGTH in answers else [OpenQuestion(LENGTH, what, example)]


BEYOND, REDUCED, WHOLE = "error_beyond_deadband", "reduced", "whole"
"""Key of the user's answer on what is left of an error beyond a deadband, and the two answers."""


def open_beyond(answers: UserAnswers, band: str) -> list[OpenQuestion]:
    """Ask what is left of an error beyond the parameter `band` unless it is answered."""
    what = f"what is left of an error beyond {band}: {REDUCED}, by what is lost within, or {WHOLE}"
    return [] if BEYOND in answers else [OpenQuestion(BEYOND, what, REDUCED)]


def deadband_of(answers: UserAnswers, band: str) -> dict[str, Any]:
    """Return the keys of [controller] for a deadband, a length with its unit, as the user answers."""
    whole = answers.choice(BEYOND, (REDUCED, WHOLE)) == WHOLE
    return {"error_deadband": band, **({"error_deadband_exit": band} if whole else {})}


def deadband_back(flat: FlatStage) -> tuple[float, frozenset[str]] | None:
    """Return the size of a deadband without memory [m], and the names of its keys; None without one."""
    key = "controller.error_deadband"
    if key not in flat or f"{key}_time" in flat or flat.get(f"{key}_exit", flat[key]) != flat[key]:
        return None
    return float(flat[key]), frozenset({"error_deadband", "error_deadband_exit"})


def force_of(answers: UserAnswers, kind: AxisKind) -> float:
    """Return what an output of 1 exerts at the load [N or N m], as the user answers."""
    return answers.value(FORCE, FORCE_FIELD.on(kind))


SAMPLE_TIME = "drive.sample_time"
"""Key of the stage file that a drive's file may leave open."""


def open_period(answers: UserAnswers, example: str) -> list[OpenQuestion]:
    """Ask for the period of the drive's loop unless it is answered."""
    return [] if SAMPLE_TIME in answers else [OpenQuestion(SAMPLE_TIME, "period of the drive's loop", example)]
