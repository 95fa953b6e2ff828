"""Define plausible ranges of values that the thesis does not state, and sample them jointly."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.equations.controllers.pid import ALPHA, BETA, LOW_PASS, TUNED_MASS
from friso.equations.motions import CRUISE
from friso_thesis.studies.thesis.studies import STUDIES, ThesisStudy

if TYPE_CHECKING:
    from friso_thesis.studies.thesis.linear import PartNeeded

FORCE_NOISE = "force noise over that of rounding"
"""Name of the noise of the drive's force, which is no key of the stage file."""

LIMITER_PULLS = "joint.limiter_pulls"

DRAW_SEED = 1
"""Seed of the draws. Seed and number determine a draw, whatever the total number."""

_OPEN_JOINT_KEYS = frozenset({"joint.damping", LIMITER_PULLS})


@dataclass(frozen=True)
class OpenValue:
    """A value that the thesis leaves open, from `low` to `high` [unit].

    `scale` tells how it is sampled: evenly, in its logarithm, or as one of the two ends. Stored as well are the keys of
    the stage file that the value sets, and why it may lie anywhere in the range. `baseline` is friso's own choice. A
    value `only_in` one experiment sets no key, and matters for no other.
    """

    name: str
    low: float
    high: float
    unit: str
    scale: str
    keys: frozenset[str]
    reason: str
    baseline: float
    only_in: str = ""

    def at(self, share: float) -> float:
        """Return the value at a fraction of the way through its range."""
        if self.scale == "either":
            return self.low if share < 0.5 else self.high
        if self.scale == "log":
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)

    def touches(self, study: ThesisStudy) -> bool:
        """Tell whether changing the value may change a study's map: the study must not set its keys."""
        return self.decides(study.sets, bool(study.changes.get("joint.locked")))

    def decides(self, fixed: Set[str], locked: bool) -> bool:
        """Tell whether the value matters if the keys `fixed` are set by something else.

        It does unless all its keys are fixed. With a `locked` joint, the joint's own damping does not matter either.
        """
        return not self.keys <= (fixed | _OPEN_JOINT_KEYS if locked else fixed)

    def touches_part(self, need: PartNeeded) -> bool:
        """Tell whether the value may change a part of the linear analysis, or an experiment.

        The noise of the force is asked for by name, see `enters`.
        """
        return self.decides({key for key in self.keys if key.startswith(need.outside)}, need.locked)


def _value(
    name: str,
    low: float,
    high: float,
    unit: str,
    scale: str,
    keys: tuple[str, ...],
    baseline: float,
    reason: str,
    only_in: str = "",
) -> OpenValue:
    return OpenValue(name, low, high, unit, scale, frozenset(keys), reason, baseline, only_in)


_TIMES = ("motion.acceleration", "motion.acceleration_time")
_MASSES = ("masses.cart", "masses.stage", "parasitic.mass", TUNED_MASS)

OPEN: tuple[OpenValue, ...] = (
    _value("alpha", 0.1, 0.3, "", "even", (ALPHA,), 0.1, "Sec. 3.2.4: often chosen between 0.1 and 0.3"),
    _value("beta", 1.0, 3.0, "", "even", (BETA,), 2.0, "Table 3: studied from 1 to 3"),
    _value(
        "joint damping", 0.05, 5.0, "N*s/m", "log", ("joint.damping",), 0.5,
        "damping ratios of 0.07 % (bare steel leaf springs) to 7 % (cables, air) at 11 Hz",
    ),
    _value(
        "limiter damping", 1.0, 1e4, "N*s/m", "log", ("joint.limiter_damping",), 100.0,
        "Table 3: studied up to 1e4 N s/m; steel on steel loses at least 0.02 %",
    ),
    _value(
        "parasitic mass over stage mass", 0.1, 0.8, "", "even", ("parasitic.mass",), 0.5,
        "a third mass is in Fig. 3, its size is not: from a tenth to most of the stage",
    ),
    _value(
        "parasitic damping ratio", 0.001, 0.05, "", "log", ("parasitic.damping_ratio",), 0.01,
        "bare metal to bolted joints",
    ),
    _value(
        "acceleration", 10.0, 100.0, "m/s^2", "log", _TIMES, 100.0,
        "Sec. 4.3.2 prescribes 100 m/s^2 to the rig; for the simulations none is printed, and slower starts are usual",
    ),
    _value(
        "distance", 0.01, 0.16, "m", "log", _TIMES, 0.09,
        "Sec. 3.5: about 160 mm of travel; Sec. 4.3.2 moves 100 mm; for the simulations none is printed, and moves of "
        "10 mm are usual too",
    ),
    _value(
        "cruise over acceleration time", 0.0, 1.0, "", "either", (*_TIMES, CRUISE), 0.0,
        "Sec. 3.2.2 says trapezoidal steps, Sec. 4.1 that acceleration and its time give the length: without or with "
        "a phase at constant speed",
    ),
    _value(
        "stroke", 0.3e-3, 1e-3, "m", "even", ("joint.stroke",), 1e-3,
        "Sec. 3.4.1 starts from 1 mm, Sec. 6 finds 0.3 mm sufficient; the marker of the figures is not printed",
    ),
    _value(
        "mass", 1.7, 2.5, "kg", "either", _MASSES, 1.7,
        "Sec. 4.2.1: 1.7 kg weighed, 2.5 kg identified; cart and stage in the same proportion",
    ),
    _value(
        "low-pass on the derivative alone", 0.0, 1.0, "", "either", (LOW_PASS,), 0.0,
        "Eq. 6 has it there, as Simulink's PID block; Eq. 7 has it before all terms",
    ),
    _value(
        "limiter cannot pull", 0.0, 1.0, "", "either", (LIMITER_PULLS,), 0.0,
        "Sec. 3.5: a bolt and a locking nut, which touch without being joined; Fig. 3 draws a spring and a damper",
    ),
    _value(
        FORCE_NOISE, 0.1, 10.0, "", "log", (), 1.0,
        "for Fig. 28 none is printed: from a filtered current to an amplifier with ten times the noise of rounding to "
        "14 bits",
        only_in="standstill",
    ),
)  # fmt: skip
"""All values that the thesis leaves open."""


def draw_name(number: int) -> str:
    """Return the name of a random choice of the open values.

    Names count from 1, numbers from 0.
    """
    return f"draw {number + 1}"


@dataclass(frozen=True)
class Draw:
    """One random choice of all open values: its number, and its values by name, as in `OPEN`."""

    number: int
    values: Mapping[str, float]

    @property
    def name(self) -> str:
        return draw_name(self.number)

    @property
    def changes(self) -> dict[str, Any]:
        """Return the keys that these values set in the rig's stage file, with their new values."""
        v = self.values
        ratio, mass = v["cruise over acceleration time"], v["mass"]
        time = np.sqrt(v["distance"] / (v["acceleration"] * (1 + ratio)))
        stage = 0.5 / 1.7 * mass
        changes: dict[str, Any] = {
            ALPHA: v["alpha"],
            BETA: v["beta"],
            "joint.damping": f"{v['joint damping']!r} N*s/m",
            "joint.limiter_damping": f"{v['limiter damping']!r} N*s/m",
            "parasitic.damping_ratio": v["parasitic damping ratio"],
            "motion.acceleration": f"{v['acceleration']!r} m/s^2",
            "motion.acceleration_time": f"{float(time)!r} s",
            "joint.stroke": f"{v['stroke']!r} m",
            "masses.cart": f"{mass - stage!r} kg",
            "masses.stage": f"{stage!r} kg",
            "parasitic.mass": f"{v['parasitic mass over stage mass'] * stage!r} kg",
            TUNED_MASS: f"{mass!r} kg",
        }
        changes |= {CRUISE: ratio} if ratio else {}
        changes |= {LIMITER_PULLS: False} if v["limiter cannot pull"] else {}
        return changes | ({LOW_PASS: "derivative"} if v["low-pass on the derivative alone"] else {})


def draw(number: int) -> Draw:
    """Return one random choice of all open values, identified by a number from 0 on.

    The values are independent of each other, and of choices with other numbers.
    """
    shares = np.random.default_rng([DRAW_SEED, number]).random(len(OPEN))
    return Draw(number, {value.name: value.at(float(share)) for value, share in zip(OPEN, shares, strict=True)})


def baseline() -> Draw:
    """Return friso's own choice of all open values."""
    return Draw(-1, {value.name: value.baseline for value in OPEN})


def enters(value: OpenValue, needs: frozenset[str], responses: Mapping[str, Mapping[str, object]],
           parts: Mapping[str, PartNeeded]) -> bool:  # fmt: skip
    """Tell whether a value can change anything that a judge `needs`.

    Needs are names of maps, responses and parts of the analysis. `responses` says what each response changes in the
    rig.
    """
    if value.only_in:
        return value.only_in in needs
    for name in needs:
        if name in STUDIES:
            touched = value.touches(STUDIES[name])
        elif name in parts:
            touched = value.touches_part(parts[name])
        else:
            own = responses[name]
            touched = value.decides(own.keys(), bool(own.get("joint.locked")))
        if touched:
            return True
    return False
