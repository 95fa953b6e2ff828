"""What is a move and what is a rest hangs neither on durations, shapes and dwells nor on noise."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from friso.errors import InputError
from friso.identification.inverse_model import SMOOTHING_BANDWIDTHS, bandwidth_of, inverse_model, motion
from friso.identification.logs.log import Log
from friso.identification.moves import identify_moves
from friso.identification.output_error.problem import moving
from friso.identification.readings.common import record
from friso.identification.stage_file import made_up

STROKE = 0.02


def trapezoid(u: np.ndarray) -> np.ndarray:
    speed = np.minimum(np.minimum(u, 1 - u), 0.25) / 0.1875
    return np.cumsum(speed) / np.sum(speed)


SHAPES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "trapezoid": trapezoid,
    "cubic": lambda u: u * u * (3 - 2 * u),
    "quintic": lambda u: u**3 * (10 - 15 * u + 6 * u * u),
    "S-curve": lambda u: u - np.sin(2 * np.pi * u) / (2 * np.pi),
    "sine": lambda u: (1 - np.cos(np.pi * u)) / 2,
}


def to_and_fro(shape: str, move: float, dwell: float, count: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the position [m] of moves to and fro, and where it moves; `dwell` is relative to the `move` [s]."""
    there = SHAPES[shape](np.linspace(0, 1, round(move / step)))
    rest = np.ones(round(dwell * move / step))
    position = np.concatenate([there, rest, 1 - there, 1 - rest])
    moves = np.concatenate([there >= 0, rest < 0, there >= 0, rest < 0])
    return STROKE * np.tile(position, count), np.tile(moves, count)


MOVES = st.floats(np.log(0.02), np.log(20.0)).map(np.exp).map(float)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from([*SHAPES]), MOVES, st.floats(0, 4), st.sampled_from([3, 12, 50]), st.sampled_from([1e-9, 1e-5]))
@example("quintic", 0.45, 0.1, 50, 1e-9)  # lines of the spectrum with nothing between them
@example("trapezoid", 0.5, 1.0, 50, 1e-5)
@example("quintic", 0.05, 4.0, 50, 1e-5)
@example("cubic", 20.0, 0.0, 12, 1e-5)
def test_moves_of_any_duration_count_as_motion(shape: str, move: float, dwell: float, count: int, blur: float) -> None:
    step = max(move / 200, 2.5e-4)
    position, moves = to_and_fro(shape, move, dwell, count, step)
    position = position + blur * np.random.default_rng(1).standard_normal(len(position))
    band = bandwidth_of(record("moves", step, position=position))
    assert 0.45 < band * move < 40
    smooth = motion(position, step, SMOOTHING_BANDWIDTHS * band).position
    counted, omega = moving(position, smooth, step, band)
    assert counted[moves].mean() > 0.2
    assert 0 < omega <= 2 * np.pi * max(band, 10)
    if dwell * move > 1.5 * max(0.1, move):  # at the end of a long rest nothing counts
        last = np.flatnonzero(np.diff(moves.astype(int)) == 1)
        assert counted[last - round(0.06 * max(1.0, move) / step)].mean() < 0.1


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(["cubic", "quintic", "S-curve"]), st.floats(0.1, 5.0), st.floats(0.05, 1), st.integers(3, 40))
def test_mass_and_friction_follow_from_smooth_moves(shape: str, move: float, dwell: float, count: int) -> None:
    """Mass, viscous and Coulomb friction come back from moves of any duration between rests."""
    step = move / 400
    position, _ = to_and_fro(shape, move, dwell, count, step)
    velocity = np.gradient(position, step)
    acceleration = np.gradient(velocity, step)
    inertia = float(np.abs(acceleration).max())  # a mass of 1 kg; friction of about as much
    viscous = inertia / float(np.abs(velocity).max())
    force = acceleration + viscous * velocity + 0.3 * inertia * np.sign(np.round(velocity, 12))
    model = inverse_model(record("moves", step, position=position, force=force))
    assert model.value("mass") == pytest.approx(1.0, rel=0.1)
    assert model.value("viscous") == pytest.approx(viscous, rel=0.15)
    assert model.value("coulomb") == pytest.approx(0.3 * inertia, rel=0.3)


def driven(
    shape: str,
    move: float,
    dwell: float,
    stroke: float,
    mass: float,
    coulomb: float,
    viscous: float,
    gains: tuple[float, float, float],
    digit: float,
    stribeck: float,
) -> Log:
    """Log of an axis that repeats a move: LuGre friction under a PID controller at 1 kHz, positions rounded to a digit.

    Own equations, with steps of 50 us. The dwell is relative to the move [s], and static friction a third higher.
    """
    step, parts = 1e-3, 20
    h, (kp, ki, kd), stiffness = step / parts, gains, coulomb / 17e-6
    bristle_damping = 0.5 * math.sqrt(stiffness * mass)
    reference = stroke / STROKE * to_and_fro(shape, move, dwell, max(3, round(3 / move / (1 + dwell))), step)[0]
    position, force = np.zeros((2, len(reference)))
    x = v = z = integral = 0.0
    for k, wanted in enumerate(reference.tolist()):
        integral += ki * (wanted - x) * step
        u = kp * (wanted - x) + integral - kd * v
        position[k], force[k] = round(x / digit) * digit, u
        for _ in range(parts):
            fall = math.exp(-((v / stribeck) ** 2))
            grip = stiffness * abs(v) / (coulomb * (1 + fall / 3))
            z = (z + h * v) / (1 + h * grip)
            rate = v - grip * z
            v += h * (u - stiffness * z - bristle_damping * fall * rate - viscous * v) / mass
            x += h * v
    return record("moves", step, reference=reference, position=position, force=force)


REPEATED = {
    "wide smears": ("quintic", 0.42, 1.4, 0.02, 2.6, 5.2, 25.0, (7e3, 5e4, 200.0), 1e-7, 2e-3),
    "rests": ("quintic", 0.38, 1.6, 0.03, 4.0, 8.0, 12.0, (9e3, 7e4, 260.0), 1e-7, 2e-3),
    "brief dwells": ("trapezoid", 0.2, 0.35, 0.06, 1.5, 16.0, 10.0, (8e3, 7e4, 160.0), 1e-8, 3e-3),
    "slow": ("sine", 0.9, 0.3, 0.012, 8.0, 2.0, 60.0, (2.4e4, 2e5, 600.0), 5e-7, 2e-3),
    "much friction": ("S-curve", 0.25, 0.8, 0.02, 2.0, 12.0, 30.0, (1.2e4, 1e5, 220.0), 1e-6, 2e-3),
}
"""Moves whose rests and first micrometres a wide filter, or a threshold that is too low, would take for sliding."""


@pytest.mark.parametrize("case", [*REPEATED])
def test_rest_and_bending_bristles_are_no_sliding(case: str) -> None:
    """Mass and Coulomb friction come back to a few per cent, and the interval holds the mass."""
    _, _, _, _, mass, coulomb, *_ = REPEATED[case]
    model = inverse_model(driven(*REPEATED[case]))
    assert model.value("mass") == pytest.approx(mass, rel=0.02)
    assert model.value("coulomb") == pytest.approx(coulomb, rel=0.05)
    assert model.estimate("mass").holds(mass)
    assert model.error < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("case", ["wide smears", "rests"])
def test_the_whole_model_of_repeated_moves_holds_the_truth(case: str) -> None:
    log, (mass, coulomb, viscous) = driven(*REPEATED[case]), REPEATED[case][4:7]
    moves = identify_moves(log, made_up(log, inverse_model(log)).flat(), own_loop=False)
    found = {estimate.name: estimate for estimate in moves.estimates}
    for key, truth, error in (
        ("masses.cart", mass, 0.02),
        ("friction.coulomb", coulomb, 0.02),
        ("friction.viscous", viscous, 0.1),
    ):
        assert found[key].holds(truth)
        assert found[key].value == pytest.approx(truth, rel=error)
    assert not moves.quality.doubts


def test_a_force_that_is_held_up_to_the_next_sample_is_in_the_interval() -> None:
    """Half a sample of delay looks like viscous friction: of a brisk mass as much as of the oil."""
    step, mass, viscous = 1e-3, 5.0, 2.0
    time, rates, shares = np.arange(10_000) * step, 2 * np.pi * np.array([[3.0], [5.0]]), np.array([[0.01], [0.006]])
    position = np.sum(shares * np.sin(rates * time), axis=0)
    speed = np.sum(shares * rates * np.cos(rates * (time + step / 2)), axis=0)
    force = -mass * np.sum(shares * rates**2 * np.sin(rates * (time + step / 2)), axis=0) + viscous * speed
    model = inverse_model(record("held", step, position=position, force=force), 5.0)
    assert abs(model.value("viscous") / viscous - 1) > 0.5
    assert model.estimate("viscous").holds(viscous)


def test_noise_alone_is_no_move() -> None:
    noise = 1e-6 * np.random.default_rng(3).standard_normal(4000)
    counted, _ = moving(noise, 0 * noise, 1e-3, 5.0)
    assert not counted.any()
    with pytest.raises(InputError):
        bandwidth_of(record("rest", 1e-3, position=np.zeros(4000)))


@pytest.mark.parametrize("hum", [30.0, 50.0, 120.0])
def test_hum_beyond_the_moves_is_no_motion(hum: float) -> None:
    position, _ = to_and_fro("quintic", 0.5, 0.5, 12, 1e-3)
    time = 1e-3 * np.arange(len(position))
    noisy = position + 1e-6 * np.random.default_rng(4).standard_normal(len(position))
    quiet, humming = (
        bandwidth_of(record("moves", 1e-3, position=x)) for x in (noisy, noisy + 3e-6 * np.sin(2 * np.pi * hum * time))
    )
    assert humming == pytest.approx(quiet, rel=0.5)
