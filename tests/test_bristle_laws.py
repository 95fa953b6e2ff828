"""Elasto-plastic and rolling friction: laws of one bristle that differ from LuGre in how it gives way."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from variants import (
    FULL,
    HOLD,
    MICRO_DAMPING,
    VARIANTS,
    elasto_plastic,
    gains,
    gms,
    maxwell,
    release,
    rolling,
    stage,
    there_and_back,
    van_dijk,
)

import friso
from benchmarks import by_hand as plain
from friso.engine.batch import Inputs, run_driven
from friso.engine.kernel import kernel
from friso.equations.imposed import Driven
from friso.equations.structure import structure
from friso.errors import InputError
from friso.frequency.loops import plant
from friso.frequency.system import member
from friso.identification.output_error.parameters import fit_parameters
from friso.stage.tables import friction_law
from friso.virtual_rig.run import failures, run
from friso.virtual_rig.task import own_motion
from friso_thesis.studies.describing.function import describing
from friso_thesis.studies.describing.multi import OneStateLaw

LAWS = {"elasto_plastic": elasto_plastic(), "rolling": rolling()}

HUNTING = {name: stage(release("1 mm", "1 s"), friction=law, controller=van_dijk("3 Hz")) for name, law in LAWS.items()}


def drift(friction: str, periods: int) -> float:
    """Return how far [m] a body drifts from the tenth to the last period of a load of 0.4 N +/- 0.25 N at 20 Hz."""
    held = stage(HOLD, friction=friction, controller=gains(1e-6))
    shape, frequency, per = kernel(Driven(structure(held.flat()))), 20.0, 40
    t = np.arange(periods * per + 1) / per / frequency
    force = (0.4 + 0.25 * np.sin(2 * np.pi * frequency * t)) * np.minimum(1, t * frequency / 4)
    inputs = Inputs(np.zeros(len(t)), force, 1 / per / frequency, held=False)
    (runs,) = run_driven(shape, held.flat(), 1, inputs, np.zeros((1, shape.initial_size)), 1e-8)
    position = runs.states[0, :, shape.position]
    return float(position[-per - 1 : -1].mean() - position[10 * per : 11 * per].mean())


def test_a_load_below_break_away_makes_nothing_drift() -> None:
    """docs/friction.md tells by how much LuGre does."""
    assert abs(drift(elasto_plastic(), 200)) < 1e-12


def test_up_to_break_away_it_is_a_spring_and_a_damper() -> None:
    """The describing function is sigma_0 + i omega (sigma_1 + sigma_2) exactly, not in the limit alone."""
    one = VARIANTS["rigid, elasto-plastic"]
    table = describing(one, [1e-7, 5e-6], [10.0])
    assert table.stiffness.values[:, 0] == pytest.approx([1e5 + 2j * np.pi * 10 * (316.2277660168379 + 0.5)] * 2)
    beyond = describing(one, [2e-5], [10.0]).stiffness.values[0, 0]
    assert beyond.real < 0.95e5
    assert beyond.imag > 1.2 * table.stiffness.values[0, 0].imag


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_small_motions(law: str) -> None:
    """Stuck on the bristles; sliding on the Stribeck curve."""
    flat = HUNTING[law].flat()
    stuck, sliding = plant(flat, member()), plant(flat, member(2e-3))
    assert stuck.a[0, 1, :2] == pytest.approx([-1e5 / 1.7, -(316.2277660168379 + 0.5) / 1.7], rel=1e-12)
    gives_way = sliding.a[0, sliding.states.index("bristle_deflection"), sliding.states.index("bristle_deflection")]
    level = 1 + 2 * np.exp(-((2 / 1.6) ** 2))
    softer = {"elasto_plastic": 1.0, "rolling": 1e-4**0.5}[law]  # where nothing is lacking, rounded
    assert gives_way == pytest.approx(-2e-3 * 1e5 / level * softer, rel=1e-6)


@settings(max_examples=50)
@given(st.sampled_from([*LAWS]), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(1.0, 4.0), st.floats(0.3, 1.0))
def test_passive_laws_create_no_energy(law: str, speed: float, bent: float, exponent: float, share: float) -> None:
    """F v is no less than what the bristles store, wherever the law says that it is passive; and where it is not, there
    are states in which it is less."""
    flat = {**HUNTING[law].flat(), "friction.coulomb": 3 * share, "friction.rolling_exponent": exponent}
    flat["friction.breakaway_deflection"] = 0.5 * flat["friction.coulomb"] / 1e5
    over, more = 1 / share - 1, exponent - 1
    softer = np.hypot(over, 1e-4) ** more / np.hypot(1, 1e-4) ** more if law == "rolling" else 1.0
    least = 316.2277660168379 * over * softer
    assert bool(friction_law(law).active({**flat, "friction.viscous": 0.999 * least})) == (least > 0)
    passive = {**flat, "friction.viscous": least * (1 + 1e-9)}
    assert not friction_law(law).active(passive)
    v, z = 0.01 * speed**3, bent * 3.0 / 1e5
    force, rate = plain.friction(passive, v, z)
    assert force * v - 1e5 * z * rate >= -1e-12


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("asymmetry", [0.5, -0.5])
def test_a_law_is_passive_only_if_it_is_in_both_directions(law: str, asymmetry: float) -> None:
    """If viscous damping is half as large in one direction, twice as much is needed."""
    flat = {**HUNTING[law].flat(), "friction.coulomb": 1.5, "friction.viscous_asymmetry": asymmetry}
    flat["friction.rolling_exponent"], least = 1.0, 2 * 316.2277660168379 * (3 / 1.5 - 1)
    assert friction_law(law).active({**flat, "friction.viscous": 0.999 * least})
    assert not friction_law(law).active({**flat, "friction.viscous": 1.001 * least})


@pytest.mark.parametrize("law", LAWS)
def test_an_active_law_gives_energy_back_somewhere(law: str) -> None:
    flat = HUNTING[law].flat()
    assert friction_law(law).active(flat)
    force, rate = plain.friction(flat, 0.05, 2.99e-5)
    assert force * 0.05 - 1e5 * 2.99e-5 * rate < 0


@pytest.mark.parametrize("friction", [elasto_plastic(), gms(damping=MICRO_DAMPING), maxwell()])
def test_the_drive_as_built(friction: str) -> None:
    """A quick drive without imperfections moves the stage as the continuous loop does."""
    moves = stage(there_and_back("0.4 s", "0.15 s", "1 m/s^2"), friction=friction, controller=gains(**FULL, tau=1e-3))
    built = moves.replace({"drive": {"sample_time": "20 us"}})
    (recorded,) = run(built, own_motion(built), [0], 1e-3)
    assert not failures(recorded)
    response = friso.simulate(moves, 1e-8, 1e-3)
    position = recorded.true["position"][0]
    assert np.ptp(position) > 1e-5
    assert np.abs(position - response.position.values[: len(position)]).max() < 0.05 * np.ptp(position)


@pytest.mark.parametrize(
    ("name", "why"),
    [("rigid, elasto-plastic", "kinks of its own"), ("rigid, Maxwell slip, PID", "modes that remember")],
)
def test_harmonic_balance_refuses_laws_of_more_than_a_state(name: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        OneStateLaw.of(VARIANTS[name].flat())


def test_what_of_them_is_fitted() -> None:
    """Rolling friction is fitted in the keys of LuGre, with its exponent as given.

    Elasto-plastic friction is refused, not ignored: its stiffness is bounded by its break-away deflection. So is a law
    from outside friso.
    """
    levels = {"mass": 1.7, "coulomb": 1.0, "viscous": 0.5, "offset": 0.0}
    names = {item.name for item in fit_parameters(HUNTING["rolling"].flat(), levels, 0.1, 0.1, True)}
    assert {"friction.bristle_stiffness", "friction.bristle_damping", "friction.stribeck_velocity"} <= names
    for law, name in (("elasto_plastic", "rigid, elasto-plastic"), ("maxwell_slip", "rigid, Maxwell slip, PID")):
        with pytest.raises(InputError, match=law) as refused:
            fit_parameters(VARIANTS[name].flat(), levels, 0.1, 0.1, True)
        assert all(known in str(refused.value) for known in ("lugre", "dahl", "stribeck", "rolling"))
