"""Play between motor and load: a part of the mass is loose by a gap, and passes for soft bristles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.doubts.coupling import IMITATED
from friso.identification.inverse_model import motion
from friso.identification.output_error.effects import reaching_over
from friso.identification.output_error.parameters import BRISTLES, MASS
from friso.identification.settings import DoubtSettings, IdentificationSettings
from friso.quantities import percent


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name the width of play between motor and load, if it explains most of what the fit leaves."""
    settings, effect = DoubtSettings.current(), case.leading
    if effect is None or effect.doubt != "play" or case.quality.failed or case.quality.rejected:
        return
    shares, width = effect.explained.sizes, effect.tried.label
    share = float(shares.max())
    if not settings.mass_share_of_a_play <= share <= settings.most_of_a_play:
        return
    what = "mass" if share == shares[0] else "friction"
    words = (
        f"Play of about {width * 1e6:.2g} um, to a factor of three, between motor and load: the force lacks that of "
        f"{percent(share)} of the {what} while the load crosses it; it passes for soft bristles, which are refused, "
        "and the intervals of the rest allow for it; a dial gauge on the load while the motor turns to and fro shows it"
    )
    wider = reaching_over(case.fit, settings.reach_of_an_effect * np.abs(effect.explained.moved))
    yield RaisedDoubt(words, width, "m", fit=wider, refuses=dict.fromkeys(BRISTLES, IMITATED), explains=True)


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that the motor saves while the load is loose, for each width of play.

    All of the mass is taken as load. The load carries the friction or not: with friction it slows down while it is
    loose.
    """
    settings, fit, step = DoubtSettings.current(), case.fit, case.log.sample_time
    names = [parameter.name for parameter in fit.problem.parameters]
    if MASS not in names or "friction.coulomb" not in names:
        return
    cutoff = settings.bandwidths_of_a_play * IdentificationSettings.current().smoothing_bandwidths
    moved = motion(case.log["position"][case.log.longest], step, cutoff * case.inverse.bandwidth)
    mass, friction = fit.value(MASS), fit.value("friction.coulomb")
    low, high = settings.plays_tried
    widths = np.geomspace(low, high, 1 + round(np.log(high / low) / np.log(settings.ratio_of_plays)))
    for slowing in (0.0, friction / (settings.mass_share_of_a_loose_load * mass)):
        for width in widths:
            speed, acceleration = loose_load(moved.position, moved.velocity, step, float(width), slowing)
            lacking = [mass * (moved.acceleration - acceleration)]
            lacking += [friction * (np.sign(moved.velocity) - np.sign(speed))] if slowing else []
            yield TriedForces(
                lacking, [settings.mass_share_of_a_tried_play] * len(lacking), float(width), 2 * len(widths)
            )


def loose_load(
    position: np.ndarray, velocity: np.ndarray, step: float, width: float, slowing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity [m/s] and acceleration [m/s^2] of a load driven through play, (n,) each.

    The motor's `position` [m] and `velocity` have the shape (n,), every `step` [s]. While the load is loose it is
    slowed down by `slowing` [m/s^2]; where it meets a flank it goes on with the motor, without a bounce.
    """
    place, speed, half = float(position[0]), float(velocity[0]), width / 2
    speeds = np.empty(len(position))
    for k, (motor, goes) in enumerate(zip(position.tolist(), velocity.tolist(), strict=True)):
        less = max(abs(speed) - slowing * step, 0.0)
        before, speed = speed, less if speed > 0 else -less
        place += step * (before + speed) / 2
        if place > motor + half:
            place, speed = motor + half, min(speed, goes)
        elif place < motor - half:
            place, speed = motor - half, max(speed, goes)
        speeds[k] = speed
    return speeds, np.diff(speeds, prepend=speeds[0]) / step


DOUBT = Doubt(
    "fit",
    find,
    "the force of a load that is loose by a gap, of several widths",
    "intervals widen; bristles are refused",
    "a dial gauge on the load while the motor turns to and fro",
    after=("friction-by-direction",),
    forces=forces,
)
