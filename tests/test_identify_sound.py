"""Sound logs of an independent simulator, without noise of the force: no doubt is raised, intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.identify_effects import KEYS, Effects, plain, simulated
from friso.identification.doubts import values
from friso.identification.experiments.moves import KIND
from friso.identification.kind import NOTHING_CHOSEN, Prior

HEAVY = {
    "mass": 14.8, "coulomb": 91.2, "static": 159.0, "stribeck": 3.26e-3, "viscous": 241.0, "bristle": 5.93e6,
    "top": 0.1, "crossover": 20.0, "position_noise": 0.0, "force_noise": 0.0,
}  # fmt: skip
"""A machine with much stiction, whose steady friction alone describes its moves badly [SI]."""

LIGHT = {
    **HEAVY, "mass": 2.38, "coulomb": 5.0, "static": 8.11, "stribeck": 1.61e-3, "viscous": 6.86, "bristle": 6.96e5,
    "crossover": 12.0,
}  # fmt: skip


@pytest.mark.cases(slow=1)
@pytest.mark.parametrize(
    ("machine", "digit"), [(HEAVY, 0.0), (HEAVY, 1e-6), (LIGHT, 5e-6), (LIGHT, 1e-5)], ids=["0", "1um", "5um", "10um"]
)
def test_a_sound_log_raises_no_doubt(machine: dict[str, float], digit: float) -> None:
    """Digits of an encoder, and errors within the linearity of sensors, are no effects outside the model."""
    log = simulated(Effects(**machine), np.random.default_rng(1))
    position = np.round(log["position"] / digit) * digit if digit else log["position"]
    log = replace(log, signals={**log.signals, "position": position})
    moves = KIND.analyse([log], Prior(KIND.around(log)), NOTHING_CHOSEN)
    assert not moves.quality.doubts
    assert not moves.quality.rejected
    reported = [estimate for estimate in moves.estimates if estimate.determined and estimate.name in KEYS]
    assert {"masses.cart", "friction.coulomb", "friction.viscous"} <= {estimate.name for estimate in reported}
    assert all(estimate.holds(machine[KEYS[estimate.name]]) for estimate in reported)


@pytest.mark.cases(slow=1)
@pytest.mark.parametrize("seed", [4, 3])
@pytest.mark.parametrize("falls", [1.0, 0.0])
def test_bristles_are_refused_if_their_damping_falls_with_the_speed(seed: int, falls: float) -> None:
    """They would come out too stiff; with constant damping, as in the model, they are told."""
    rng = np.random.default_rng((seed, 56))
    machine = {**plain(rng), "damping_falls": falls}
    log = simulated(Effects(**machine), rng)
    moves = KIND.analyse([log], Prior(KIND.around(log)), NOTHING_CHOSEN)
    (stiffness,) = (estimate for estimate in moves.estimates if estimate.name == "friction.bristle_stiffness")
    assert stiffness.determined == (falls == 0)
    assert stiffness.reason == values.WHY_OF_DECAYING_DAMPING if falls else stiffness.holds(machine["bristle"])


@pytest.mark.slow
@pytest.mark.parametrize("share", [-0.15, 0.12])
def test_friction_that_differs_by_direction_is_no_constant_force(share: float) -> None:
    """A fit takes the difference for a constant force, whose interval must hold the truth: nothing."""
    rng = np.random.default_rng((2, 56))
    machine = plain(rng)
    log = simulated(Effects(**machine, by_direction=share), rng)
    moves = KIND.analyse([log], Prior(KIND.around(log)), NOTHING_CHOSEN)
    (size,) = (one.size for one in moves.quality.findings if one.doubt == "friction-by-direction")
    assert size == pytest.approx(abs(share), rel=0.3)
    (force,) = (one for one in moves.estimates if one.name == "bias.cart")
    assert force.holds(0.0)


@pytest.mark.thorough
def test_a_constant_force_hides_no_effect() -> None:
    """Cogging of an eighth of Coulomb friction shows, though the axis carries 120 times as much."""
    rng = np.random.default_rng((1, 56))
    machine = plain(rng)
    log = simulated(Effects(**machine, cogging=machine["coulomb"] / 8), rng)
    carried = log["force"] + 120 * machine["coulomb"]
    log = replace(log, signals={**log.signals, "force": carried})
    assert KIND.analyse([log], Prior(KIND.around(log)), NOTHING_CHOSEN).quality.doubts
