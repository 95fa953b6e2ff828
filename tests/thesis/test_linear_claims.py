"""The claims of the thesis that linear analysis decides: verdicts on the rig, and on rigs changed to get others."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp

from friso.frequency.bode import bode
from friso.frequency.margins import spectral_abscissa
from friso.frequency.system import Members, limit_cases
from friso_thesis.studies.thesis.claims import Evidence, Finding, registered
from friso_thesis.studies.thesis.judges.control_law import (
    PRINTED_SENSITIVITY,
    PRINTED_STIFFNESS,
    in_the_plant,
    judged_formulas,
)
from friso_thesis.studies.thesis.linear import FREE, LOCKED_LOOP, NEEDS, PLANT, Linear, analysed
from friso_thesis.studies.thesis.linear.plants import LowLines, Springs, abscissa_with_bristles
from friso_thesis.studies.thesis.space import OPEN
from friso_thesis.studies.thesis.studies import thesis_rig


@pytest.fixture(scope="module")
def linear() -> Linear:
    return analysed(thesis_rig())


def judged(claim: str, linear: Linear) -> Finding:
    return registered()[claim].judge(Evidence({}, {}, linear))


def changed(changes: Mapping[str, Any]) -> Linear:
    return analysed(thesis_rig().replace(dict(changes)))


# --- what is found of the rig -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("claim", "holds"),
    [
        ("E1", (True, True, True, True)),
        ("F7", (True, True, True, True, False, True)),
        ("F7L", (True, True, True)),
        ("F8", (True, True, False)),
        ("F22", (True, None, None)),
        ("F23", (True, None)),
    ],
)
def test_the_rig(linear: Linear, claim: str, holds: tuple[bool, ...]) -> None:
    finding = judged(claim, linear)
    assert finding.pattern == holds, finding
    assert all(part.holds or part.why or part.open for part in finding.parts)
    assert not re.search(r"\bnan\b", " ".join(part.number + part.why for part in finding.parts))


HOLDS: Mapping[str, Mapping[str, Any]] = {
    "F7": {"joint.limiter_stiffness": "7e6 N/m", "parasitic.mass": "0.05 kg"},
    "F8": {"parasitic.damping_ratio": 0.05},
    "F22": {"joint.limiter_stiffness": "2.9e6 N/m", "joint.limiter_damping": "1 N*s/m"},
    "F23": {"joint.damping": "0.05 N*s/m"},
}
"""Rigs that are as the thesis says, in all parts of the claim."""

FAILS: Mapping[str, Mapping[str, Any]] = {
    "F7": {"joint.stiffness": "24 N/mm", "parasitic.frequency": "600 Hz", "joint.limiter_damping": "1e4 N*s/m"},
    "F8": {"friction.viscous": "200 N*s/m", "parasitic.damping_ratio": 0.0005},
    "F22": {"controller.tuned_mass": "5 kg", "parasitic.damping_ratio": 0.05},
    "F23": {"controller.tuned_mass": "10 kg", "joint.damping": "0.005 N*s/m"},
}
"""Rigs that are not, in more parts than ours."""


@pytest.mark.cases(slow=2)
@pytest.mark.parametrize("claim", HOLDS)
def test_judges_recognise_what_holds_and_what_does_not(linear: Linear, claim: str) -> None:
    holds, fails = (judged(claim, changed(rigs[claim])) for rigs in (HOLDS, FAILS))
    assert all(part.holds for part in holds.parts), holds
    met, own = (sum(part.holds for part in one.parts) for one in (fails, judged(claim, linear)))
    assert met < own, fails


def test_parts_of_made_evidence(linear: Linear) -> None:
    """Single numbers, made otherwise, turn the parts that they decide."""
    shaky = replace(linear, speeds=replace(linear.speeds, undeflected=linear.speeds.unstable, slow=1.5))
    assert judged("F8", shaky).pattern == (False, False, False)
    assert judged("F8", replace(linear, free=replace(linear.free, single=None))).pattern == (True, True, True)
    sliding = linear.plants["sliding"]
    made = {
        "sliding": replace(sliding, antiresonances=sliding.antiresonances[1:], mass=1.7),
        "stuck": replace(linear.plants["stuck"], resonances=()),
    }
    other = replace(linear, plants={**linear.plants, **made})
    assert judged("F7", other).pattern == (False, False, False, True, False, False)
    lines = {"stuck": (1e5, 0.5, 0.5), "sliding": (0.0, 2e3, 0.5)}  # the bristles alone; the stage alone, and damped
    low = {name: replace(linear.plants[name], low=LowLines(*line)) for name, line in lines.items()}
    assert judged("F7L", replace(linear, plants={**linear.plants, **low})).pattern == (False, False, False)
    limited = replace(linear, free=replace(linear.free, unsampled=50.0))
    assert all(part.holds for part in judged("F23", limited).parts)


# --- Eq. 1 and 2 ------------------------------------------------------------------------------------------------------


def test_printed_formulas() -> None:
    for stiffness, sensitivity, holds in (
        (PRINTED_STIFFNESS, PRINTED_SENSITIVITY, [True, True, True]),
        (PRINTED_STIFFNESS, sp.sqrt(PRINTED_SENSITIVITY), [True, False, True]),
        (2 * PRINTED_STIFFNESS, 1 + PRINTED_SENSITIVITY, [False, False, False]),
    ):
        assert [part.holds for part in judged_formulas(stiffness, sensitivity)] == holds


def test_the_plant_against_eq_1(linear: Linear) -> None:
    springs = linear.springs
    assert springs.both == pytest.approx(1 / (1 / 2.4e3 + 1 / 1e5), rel=1e-12)
    assert in_the_plant(PRINTED_STIFFNESS, springs).holds
    assert not in_the_plant(PRINTED_STIFFNESS, Springs(springs.joint, springs.bristles, springs.joint)).holds


# --- the evidence -----------------------------------------------------------------------------------------------------


def test_limit_cases_against_closed_forms(linear: Linear) -> None:
    """Two masses on the joint, the parasitic mode far above; cart and stage on the limiter, far above that."""
    plants = linear.plants
    assert plants["sliding"].antiresonances[0] == pytest.approx(np.sqrt(2.4e3 / 1.2) / (2 * np.pi), rel=1e-3)
    assert plants["sliding"].first == pytest.approx(13.12, rel=1e-3)
    assert plants["stuck"].first == pytest.approx(np.sqrt(2343.75 / 0.5) / (2 * np.pi), rel=2e-3)
    pair = plants["sliding-touched"].pair_above
    assert pair[0] == pytest.approx(np.sqrt(2e7 / 1.2) / (2 * np.pi), rel=1e-3)
    assert pair[1] == pytest.approx(np.sqrt(2e7 * (1 / 1.2 + 1 / 0.25)) / (2 * np.pi), rel=0.01)
    for case in ("stuck-touched", "sliding-touched"):
        assert plants[f"{case}-series"].pair_above is None


def test_unstable_speeds_are_those_of_the_analysis(linear: Linear) -> None:
    free, touched = bode(thesis_rig()).unstable
    assert linear.speeds.unstable[0] == pytest.approx((free.low, free.high), rel=1e-5)
    assert linear.speeds.unstable_touched[0] == pytest.approx((touched.low, touched.high), rel=1e-5)


def test_bristles_in_steady_state_are_the_family() -> None:
    """Friction put on the frictionless loop by hand, its bristles where they belong, gives the family's poles."""
    flat = thesis_rig().flat()
    speed = np.array([1e-5, 1e-3, 1e-1])
    sliding = Members(speed, np.zeros(3), np.zeros(3, bool), np.ones(3, bool))
    assert abscissa_with_bristles(flat, speed, 1.0) == pytest.approx(spectral_abscissa(flat, sliding), rel=1e-6)
    assert (abscissa_with_bristles(flat, speed, 0.0) < 0).all()


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("joint", ["free", "locked"])
def test_the_edges_of_stability(linear: Linear, joint: str) -> None:
    """The rig is stable just below the delay or the crossover of the edge, and unstable just above."""
    loops = linear.locked if joint == "locked" else linear.free

    def rightmost(crossover: float, delay: float) -> float:
        changes = {"drive.sample_time": "50 us", "drive.delay": f"{delay!r} s", "joint.locked": joint == "locked"}
        flat = thesis_rig().replace({**changes, "controller.crossover": f"{crossover!r} Hz"}).flat()
        return float(spectral_abscissa(flat, Members.joined(limit_cases(flat).values())).max())

    for crossover, delay in loops.delay_at.items():
        assert rightmost(crossover, 0.99 * delay) < 0 < rightmost(crossover, 1.01 * delay)
    for delay, crossover in loops.sampled.items():
        assert rightmost(0.999 * crossover, delay) < 0 < rightmost(1.001 * crossover, delay)


def test_the_crossover_from_which_a_mode_reaches_0_db(linear: Linear) -> None:
    settings = {f: len(cases["sliding"].crossovers) for f, cases in linear.locked.margins.items()}
    assert all((count == 1) == (f < linear.locked.single) for f, count in settings.items())
    assert linear.free.single == pytest.approx(linear.locked.single, rel=1e-3)


def test_curves_are_the_loops_of_the_margins(linear: Linear) -> None:
    for loops in (linear.free, linear.locked):
        for setting, curve in loops.curves.items():
            size = np.interp(loops.margins[setting]["sliding"].crossovers, loops.omega / (2 * np.pi), np.abs(curve))
            assert size == pytest.approx(1.0, rel=0.02)


def test_what_open_values_touch() -> None:
    touches = {(v.name, name) for v in OPEN for name in NEEDS if v.touches_part(NEEDS[name])}
    every = {"limiter damping", "parasitic mass over stage mass", "parasitic damping ratio", "stroke", "mass"}
    joint, control = {"joint damping", "limiter cannot pull"}, {"alpha", "beta", "low-pass on the derivative alone"}
    assert {parameter for parameter, name in touches if name == PLANT} == every | joint
    assert {parameter for parameter, name in touches if name == FREE} == every | joint | control
    assert {parameter for parameter, name in touches if name == LOCKED_LOOP} == every | control
