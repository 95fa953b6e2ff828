"""Doubt: play between motor and load passes for soft bristles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.inverse_model import motion
from friso.identification.logs.checks import runs
from friso.identification.output_error.parameters import MASS
from friso.identification.readings.common import digit_of
from friso.identification.settings import doubt_settings, identification_settings
from friso.quantities import percent


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name the width of the play if a load with play explains most of the residual.

    If one of the two widest plays that are tried explains most, something slower is the cause; if one of the two
    narrowest does, something quicker, such as bristles. If the play is hardly wider than the steps of the position,
    they may be it. No play is named then, but the intervals are widened.
    """
    effect = case.led_by("play")
    if effect is None:
        return
    shares, width = effect.explained.sizes, effect.tried.label
    share = float(shares.max())
    if share > doubt_settings.most_of_a_play:
        return
    what = "mass" if share == shares[0] else "friction"
    words = (
        f"Play of about {width * 1e6:.2g} um, to a factor of three, between motor and load: the force lacks that of "
        f"{percent(share)} of the {what} while the load crosses it; it passes for soft bristles, which are refused, "
        "and the intervals of the rest allow for it; a dial gauge on the load while the motor turns to and fro shows it"
    )
    named, digit = case.named(effect, words, width, "m"), digit_of(case.log["position"][case.log.longest])
    low, high = doubt_settings.plays_tried
    near = doubt_settings.ratio_of_plays**1.5  # the ends of the tried widths, and those next to them
    inside = max(near * low, doubt_settings.digits_of_a_play * digit) < width < high / near
    yield named if inside else replace(named, words="", explains=False)


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that the motor does not need while its load is loose, by width of play.

    The whole mass is taken as load, once without friction, and once with friction that slows it down while it is loose.
    Widths that the load crosses within a few samples are not tried, because motion between samples would look like
    play.
    """
    fit, step = case.fit, case.log.sample_time
    if not {MASS, "friction.coulomb"} <= {*fit.problem.names}:
        return
    cutoff = doubt_settings.bandwidths_of_a_play * identification_settings.smoothing_bandwidths
    moved = motion(case.log["position"][case.log.longest], step, cutoff * case.inverse.bandwidth)
    mass, friction = fit.value(MASS), fit.value("friction.coulomb")
    low, high = doubt_settings.plays_tried
    widths = np.geomspace(low, high, 1 + round(np.log(high / low) / np.log(doubt_settings.ratio_of_plays)))
    slowings = np.repeat([0.0, friction / (doubt_settings.mass_share_of_a_loose_load * mass)], len(widths))
    both = np.tile(widths, 2)
    speeds = loose_loads(moved.position, moved.velocity, step, both, slowings)
    for width, slowing, speed in zip(both, slowings, speeds, strict=True):
        loose = runs(speed != moved.velocity)
        if sum(one.stop - one.start for one in loose) < doubt_settings.samples_of_a_crossing * len(loose):
            continue
        acceleration = np.diff(speed, prepend=speed[0]) / step
        lacking = [mass * (moved.acceleration - acceleration)]
        lacking += [friction * (np.sign(moved.velocity) - np.sign(speed))] if slowing else []
        sizes, least = [doubt_settings.mass_share_of_a_tried_play] * len(lacking), doubt_settings.mass_share_of_a_play
        yield TriedForces(lacking, sizes, float(width), 2 * len(widths), least)


def loose_loads(
    position: np.ndarray, velocity: np.ndarray, step: float, widths: np.ndarray, slowings: np.ndarray
) -> np.ndarray:
    """Return velocities [m/s] of loads that a motor drives through play, shape (loads, n).

    The motor's `position` [m] and `velocity` have the shape (n,), sampled every `step` [s]. Each load, (loads,), has a
    width of play [m] and is slowed down by `slowings` [m/s^2] while loose; at a flank it continues with the motor,
    without a bounce.
    """
    half, less = widths / 2, slowings * step
    place, speed = np.full(len(widths), position[0]), np.full(len(widths), velocity[0])
    speeds = np.empty((len(position), len(widths)))
    for k, (motor, goes) in enumerate(zip(position.tolist(), velocity.tolist(), strict=True)):
        before, speed = speed, np.copysign(np.maximum(np.abs(speed) - less, 0.0), speed)
        place = place + step / 2 * (before + speed)
        low, high = motor - half, motor + half
        speed = np.where(place > high, np.minimum(speed, goes), np.where(place < low, np.maximum(speed, goes), speed))
        place = np.minimum(np.maximum(place, low), high)
        speeds[k] = speed
    return speeds.T


DOUBT = Doubt(
    "fit",
    find,
    "the force of a load that is loose by a gap, of several widths",
    "intervals widen; bristles are refused",
    "a dial gauge on the load while the motor turns to and fro",
    after=("friction-by-direction",),
    forces=forces,
    places=True,
)
