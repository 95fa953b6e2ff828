"""Test what holds for every friction law, and the invariants of LuGre (Astrom & Canudas de Wit 2008)."""

import ast
from pathlib import Path
from typing import Any

import maxwell_slip
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from variants import VARIANTS, maxwell, release, stage, van_dijk

import friso
from benchmarks import by_hand as plain
from friso.engine.arrays import Results, Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.frequency.system import steady_force
from friso.hunting import Ensemble, find_attractors
from friso.stage.tables import FRICTION

LAWS = Path(friso.__file__).parent / "equations" / "friction"
GROUND = ("cases", "component", "conditions", "friction")
STEADY = settings(max_examples=25)


@pytest.mark.parametrize("law", FRICTION.classes)
def test_every_law_is_among_the_common_variants(law: str) -> None:
    assert any(variant.flat()["friction.model"] == law for variant in VARIANTS.values())


@pytest.mark.cases(first=9)
@pytest.mark.parametrize("file", [*sorted(LAWS.glob("*.py")), Path(maxwell_slip.__file__)], ids=lambda file: file.stem)
def test_a_law_mentions_no_solver(file: Path) -> None:
    """A law is one file, which imports only units, the stage's tables and the basis of the equations."""
    nodes = [node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.ImportFrom)]
    ours = {node.module for node in nodes if node.module and node.module.startswith("friso")}
    allowed = tuple(f"friso.{name}" for name in ("quantities", "stage", *map("equations.{}".format, GROUND)))
    assert all(name.startswith(allowed) for name in ours)


@pytest.mark.cases(first=16)
@pytest.mark.parametrize("name", VARIANTS)
def test_friction_in_a_steady_motion_is_that_of_the_linear_systems(name: str) -> None:
    flat = VARIANTS[name].flat()
    speeds = np.geomspace(1e-7, 1.0, 30)
    friction = Ensemble.held(flat, 60).steady_friction(np.concatenate([speeds, -speeds]))
    forward, backward = (steady_force(flat, speeds, way) for way in (True, False))
    assert friction == pytest.approx(np.concatenate([forward, -backward]), rel=1e-12)


@pytest.mark.parametrize(("share", "certain"), [(0.9995, False), (0.6, True)])
def test_cycles_too_small_to_be_looked_for_are_possible_with_any_law_that_falls_a_little(
    share: float, certain: bool
) -> None:
    fast = stage(release(), friction=maxwell(share, viscous="0 N*s/m"), controller=van_dijk("40 Hz"))
    found = find_attractors(fast.flat(), 1)
    assert (found.attracts.tolist(), found.decided.tolist(), found.certain.tolist()) == ([False], [True], [certain])


@pytest.mark.parametrize(("play", "certain"), [("20 um", True), ("100 nm", False)])
def test_what_a_backlash_deflects_the_loop_by_is_no_friction_that_falls(play: str, certain: bool) -> None:
    """Friction falls by two thirds at speeds far above those of small swings.

    In a backlash below a thousandth of the loop's deflection, cycles may be smaller than the search covers.
    """
    screw = {"mass": "2 kg", "stiffness": "20 N/um", "damping": "400 N*s/m", "backlash": play}
    tables = {"transmission": screw, "encoder": {"position": "load", "velocity": "load"}}
    found = find_attractors(VARIANTS["rigid"].replace({**tables, "controller.crossover": "20 Hz"}).flat(), 1)
    assert (found.attracts.tolist(), found.decided.tolist(), found.certain.tolist()) == ([False], [True], [certain])


def run(changes: dict[str, Any], rtol: float = 1e-8, interval: float = 1e-3) -> Results:
    """A rigid mass with LuGre friction and a van Dijk controller, released."""
    flat = VARIANTS["rigid"].flat() | changes
    (runs,) = run_chunks(kernel(structure(VARIANTS["rigid"].flat())), flat, 1, RunOptions(rtol=rtol, interval=interval))
    assert runs.results.statuses[0] == Status.DONE
    return runs.results


def friction_keys(**values: float) -> dict[str, float]:
    return {f"friction.{name}": value for name, value in values.items()}


@STEADY
@given(
    st.floats(0.5, 5), st.floats(0.2, 1), st.floats(1e-4, 1e-2), st.floats(0, 1000), st.floats(2, 15), st.floats(0.5, 5)
)
def test_bristles_never_deflect_further_than_static_friction(
    static: float, share: float, speed: float, damping: float, crossover: float, displacement: float
) -> None:
    """abs(z) <= F_s / sigma_0, once inside."""
    keys = friction_keys(static=static, coulomb=share * static, stribeck_velocity=speed, bristle_damping=damping)
    move = {"controller.crossover": crossover, "motion.displacement": displacement * 1e-3, "motion.duration": 2.0}
    z = run(keys | move).samples[0, :, 2]
    assert np.max(np.abs(z)) <= static / 1e5 * (1 + 1e-6)
    assert np.max(np.abs(z)) > 0.01 * share * static / 1e5


def energy_loss(flat: dict[str, Any], samples: np.ndarray) -> np.ndarray:
    """Return the power lost in friction [W] at every sample: F v less what bristles store, sigma_0 z z'."""
    losses = []
    for v, z in samples[:, 1:3]:
        force, z_rate = plain.friction(flat, v, z)
        losses.append(force * v - flat["friction.bristle_stiffness"] * z * z_rate)
    return np.array(losses)


@STEADY
@given(st.floats(1, 4), st.floats(0.5, 1), st.floats(1, 300), st.floats(1.01, 2), st.floats(2, 15))
def test_friction_creates_no_energy_where_it_is_passive(
    static: float, share: float, damping: float, more: float, crossover: float
) -> None:
    """sigma_2 > sigma_1 (F_s - F_c) / F_c."""
    viscous = more * damping * (1 - share) / share
    keys = friction_keys(static=static, coulomb=share * static, bristle_damping=damping, viscous=viscous)
    flat = VARIANTS["rigid"].flat() | keys | {"controller.crossover": crossover}
    losses = energy_loss(flat, run(flat).samples[0])
    assert np.min(losses) >= -1e-12 * np.max(losses)
    assert np.max(losses) > 0


def swing_heights(results: Results) -> np.ndarray:
    """Return distinct turning points, without the ringing at a stop."""
    values = results.turn_values[0, : results.turn_counts[0]]
    sides = np.split(values, np.flatnonzero(np.diff(np.sign(values))) + 1)
    farthest = [part[np.argmax(np.abs(part))] for part in sides]
    return np.array([value for value in farthest if abs(value) > 1e-2 * np.max(np.abs(values))])


def turns(results: Results) -> np.ndarray:
    """Return turning points, without rounding noise about a rest at zero."""
    values = results.turn_values[0, : results.turn_counts[0]]
    return values[np.abs(values) > 1e-14]


CASES = given(st.floats(0.3, 3), st.floats(3, 12), st.floats(1.2, 4), st.floats(0.5, 1.1))


@STEADY
@CASES
def test_mirror(displacement: float, crossover: float, static: float, coulomb: float) -> None:
    keys = friction_keys(static=static, coulomb=coulomb) | {"controller.crossover": crossover, "motion.duration": 4.0}
    one, other = (run(keys | {"motion.displacement": side * displacement * 1e-3}, 1e-9) for side in (1, -1))
    assert turns(one).size == turns(other).size
    assert turns(one) == pytest.approx(-turns(other), rel=1e-6, abs=1e-12)
    assert swing_heights(one) == pytest.approx(-swing_heights(other), rel=1e-6)
    assert one.statistics[0, 0] == pytest.approx(other.statistics[0, 0], rel=1e-6)  # as finely as steps are looked at


@STEADY
@CASES
def test_units(displacement: float, crossover: float, static: float, coulomb: float) -> None:
    """Length in 30 um, force in 7 mN, time in 0.2 s: the same run in other numbers."""
    length, force, time = 1 / 3e-5, 1 / 7e-3, 5.0
    base = VARIANTS["rigid"].flat() | friction_keys(static=static, coulomb=coulomb)
    base |= {"controller.crossover": crossover, "motion.displacement": displacement * 1e-3, "motion.duration": 4.0}
    mass = force * time**2 / length
    factors = {
        "masses.cart": mass,
        "masses.stage": mass,
        "controller.tuned_mass": mass,
        "controller.crossover": 1 / time,
        "friction.static": force,
        "friction.coulomb": force,
        "friction.stribeck_velocity": length / time,
        "friction.bristle_stiffness": force / length,
        "friction.bristle_damping": force * time / length,
        "friction.viscous": force * time / length,
        "motion.displacement": length,
        "motion.duration": time,
    }
    one = run(base)
    other = run(base | {key: base[key] * factor for key, factor in factors.items()}, interval=1e-3 * time)
    assert swing_heights(other) == pytest.approx(length * swing_heights(one), rel=1e-6)
    assert other.statistics[0, 0] == pytest.approx(force * one.statistics[0, 0], rel=1e-9)
