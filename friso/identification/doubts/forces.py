"""Doubts about forces that the model leaves out: by place, direction, load, time, couplings, play."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from friso.errors import InputError
from friso.identification.doubt import (
    IMITATED,
    POWER_LEFT_BY_AN_EFFECT,
    Doubt,
    FitCase,
    FittedCase,
    RaisedDoubt,
    RecordCase,
    TriedForces,
    way_of,
)
from friso.identification.inverse_model import SMOOTHING_BANDWIDTHS, InverseModel, least_squares, motion
from friso.identification.logs.checks import runs
from friso.identification.output_error.fit import (
    ExplainedResidual,
    OutputErrorFit,
    explained_by,
    explained_by_forces,
    is_sure_beside_all,
    reaching_over,
)
from friso.identification.output_error.parameters import BRISTLES, MASS, is_free
from friso.identification.readings.common import digit_of
from friso.quantities import percent


def find_cogging(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name a force that varies along the way, with its pitch, if it explains most of the residual."""
    effect = case.led_by("cogging")
    if effect is None:
        return
    parts = zip(effect.explained.sizes, effect.tried.forces, strict=True)
    size = float(np.ptp(sum(share * force for share, force in parts)))
    pitch = effect.tried.label
    every = f", every {pitch * 1e3:.3g} mm, as cogging does" if np.isfinite(pitch) else ""
    words = (
        f"A force along the way differs from place to place by {size:.2g} {case.unit}{every}: no stage file has one, "
        "and the intervals allow for it; slow passes to and fro over the same way would show it"
    )
    yield case.named_along(effect, words, size)


FRICTION_SHARE_OF_A_TRIED_FORCE = 0.05
"""Size of a tried force, relative to Coulomb friction."""

TRAVELS_OF_A_PITCH = (2.0, 60.0)
"""Least and largest number of cogging periods along the travel that are tried."""

PITCHES_FOR_EACH_TRAVEL = 4
"""Number of pitches tried per additional period along the travel. Between two of them the phase slips by a quarter
turn."""


def forces_of_cogging(case: FittedCase) -> Iterator[TriedForces]:
    """Yield forces at several places along the way, then one sine with the best-fitting pitch."""
    problem = case.fit.problem
    position, counted = case.log["position"][case.log.longest], problem.counted > 0
    travel = float(np.ptp(position))
    unit = FRICTION_SHARE_OF_A_TRIED_FORCE * float(np.std(case.log["force"][case.log.longest]))
    along = places_along(position)
    yield TriedForces(along, [unit] * len(along))
    rest = case.fit.residual[counted]
    low, high = TRAVELS_OF_A_PITCH
    pitches = travel / np.linspace(low, high, 1 + round(PITCHES_FOR_EACH_TRAVEL * (high - low)))
    explained = [_explained_by(position[counted], pitch, rest) for pitch in pitches]
    pitch = float(pitches[int(np.argmax(explained))])
    yield TriedForces(_waves(position, pitch), [unit] * 2, pitch, len(pitches))


PLACES_OF_A_FORCE_ALONG = 12
"""Number of places along the way with a separate force or friction; each takes a simulated run."""


def places_along(position: np.ndarray) -> list[np.ndarray]:
    """Return a triangular function of position for each of several places, (n,), minus its mean.

    `position` [m] has the shape (n,). A function is 1 at its place, and 0 from the neighbouring places on. The first
    place has none.
    """
    nodes = np.linspace(position.min(), position.max(), PLACES_OF_A_FORCE_ALONG)
    near = np.maximum(1 - np.abs(position - nodes[:, None]) / (nodes[1] - nodes[0]), 0.0)
    return [column - column.mean() for column in near[1:]]


def _waves(position: np.ndarray, pitch: float) -> list[np.ndarray]:
    """Return sine and cosine of a position [m] with a pitch [m], each of shape (n,)."""
    angle = 2 * np.pi * position / pitch
    return [np.sin(angle), np.cos(angle)]


def _explained_by(position: np.ndarray, pitch: float, rest: np.ndarray) -> float:
    """Return the power [N^2] of a residual force that a sine with a pitch [m] explains.

    `position` [m] and the residual `rest` [N] have the shape (n,). The constant part of the force does not count.
    """
    columns = np.stack([*_waves(position, pitch), np.ones(len(rest))], axis=1)
    solution = np.linalg.lstsq(columns, rest, rcond=None)[0]
    return float(np.var(columns @ solution))


COGGING = Doubt(
    "fit",
    find_cogging,
    "a force at places along the way, and one that repeats along it",
    "intervals widen; bristles are refused",
    "slow passes to and fro over the same way",
    after=("friction-by-direction",),
    forces=forces_of_cogging,
    places=True,
)


def find_friction_by_place(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name the variation of friction along the way if it explains most of the residual."""
    effect = case.led_by("friction-by-place")
    if effect is None:
        return
    columns = places_along(case.log["position"][case.log.longest])
    friction = sum(share * column for share, column in zip(effect.explained.sizes, columns, strict=True))
    size, reach = float(np.ptp(friction)), float(np.abs(friction).max())
    words = (
        f"Friction differs along the way by {size:.2g} {case.unit}: the intervals reach from its least to its largest; "
        "slow passes to and fro over the same way would show it"
    )
    yield case.named_along(effect, words, size, {"friction.coulomb": reach / case.fit.value("friction.coulomb")})


def forces_of_friction_by_place(case: FittedCase) -> Iterator[TriedForces]:
    """Yield friction that is larger at one place, for each of several places along the way."""
    if "friction.coulomb" not in case.fit.problem.names:
        return
    along = [-column * way_of(case.velocity) for column in places_along(case.log["position"][case.log.longest])]
    unit = FRICTION_SHARE_OF_A_TRIED_FORCE * case.fit.value("friction.coulomb")
    yield TriedForces(along, [unit] * len(along))


FRICTION_BY_PLACE = Doubt(
    "fit",
    find_friction_by_place,
    "friction of its own at places along the way",
    "intervals reach from the least to the largest friction; bristles are refused",
    "slow passes to and fro over the same way",
    after=("friction-by-direction",),
    forces=forces_of_friction_by_place,
    places=True,
)
"""The doubt divides the way into the places of `cogging`; a force that changes sign with direction is friction."""


def find_force_by_place(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Fit the inverse model with a separate force at each of several places along the way."""
    places = _places(case.log["position"], len(case.inverse.measured))
    with suppress(InputError):
        if places:
            model = case.modelled(case.log, extra=places)
            size = _size(case.inverse, model)
            words = f"a force that varies with position, by {size:.2g} {case.unit}, accounts for most of it"
            yield RaisedDoubt(words=words, size=size, unit=case.unit, without=model, spoils=True)


def _size(without: InverseModel, model: InverseModel) -> float:
    """Return by how much a force differs from place to place, beyond what a mass and friction could do as well.

    The models are without and with the force. In a sine, the force of a spring is that of a mass.
    """
    along = without.measured - model.measured
    return float(np.ptp(least_squares(without.columns, along)[1]))


PLACES_OF_A_FORCE = 40
"""Number of places along the way with a separate force. Fewer miss cogging; more take longer."""

ROWS_FOR_EACH_PLACE = 20
"""Fewest rows of the inverse model for each place with a separate force. With fewer, a place fits noise."""


def _places(position: np.ndarray, rows: int) -> dict[str, np.ndarray]:
    """Return a triangular function of position, (n,), for each of several places, by name.

    A function is 1 at its place, and 0 from the neighbouring places on. The first place has none. The result is {} for
    a log with few `rows`.
    """
    count = min(PLACES_OF_A_FORCE, rows // ROWS_FOR_EACH_PLACE)
    if count < 3:
        return {}
    nodes = np.linspace(position.min(), position.max(), count)
    near = 1 - np.abs(position - nodes[:, None]) / (nodes[1] - nodes[0])
    return {f"place {i}": np.maximum(row, 0.0) for i, row in enumerate(near) if i}


FORCE_BY_PLACE = Doubt(
    "cause",
    find_force_by_place,
    "the fit of the inverse model with a force that depends on position",
    "intervals reach to the values without it; friction at low speed is refused",
    "slow passes to and fro over the same way",
    after=("drifting-force",),
    places=True,
)


WHAT = ("Dry friction", "What static friction has beyond Coulomb friction")
"""What differs, by the label of the tried forces."""


def find_friction_by_direction(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name friction that differs by direction if it explains most of the residual.

    A constant force takes most of the difference in the fit. Its interval reaches to what it would be without, also
    where the difference is sure and explains little.
    """
    effect = case.led_by("friction-by-direction")
    if effect is None:
        for _, explained in case.explained(forces_of_friction_by_direction):
            if explained.sure(case.fit)[0]:
                yield RaisedDoubt(fit=case.reaching(explained.moved))
        return
    (share,) = effect.explained.sizes
    what, way = WHAT[int(effect.tried.label)], "forward" if share > 0 else "backward"
    words = (
        f"{what} is about {percent(abs(float(share)))} higher {way} and lower the other way: the stage file has one "
        "for both, and the intervals allow for it; slow passes to and fro would show it"
    )
    yield RaisedDoubt(words=words, size=abs(float(share)), fit=case.reaching(effect.explained.moved), spoils=True)


def forces_of_friction_by_direction(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force of bristles that are stronger forward, and that of a Stribeck effect that is."""
    bristles = case.bristles()
    if bristles is None:
        return
    coulomb, force = case.fit.value("friction.coulomb"), np.abs(case.fit.value(BRISTLES[0]) * bristles.bend)
    for label, against in enumerate((force, force * (1 - coulomb / bristles.level))):
        yield TriedForces([-against], [FRICTION_SHARE_OF_A_TRIED_FORCE], label)


FRICTION_BY_DIRECTION = Doubt(
    "fit",
    find_friction_by_direction,
    "Coulomb friction and a Stribeck effect that are stronger in one direction",
    "intervals widen, also that of the constant force; friction at low speed is refused",
    "slow passes to and fro",
    forces=forces_of_friction_by_direction,
)


@dataclass(frozen=True)
class RecordDrift:
    """How friction and a constant force change during a record, and what that shifts.

    `moved`, shape (free,), is the shift of the fitted numbers. `friction` and `constant` [N] are the changes over the
    record. `friction_reach` and `constant_reach` [N] are the largest deviations from the mean over the record. The
    changes are not `sure` if each of them may be 0, so that friction and constant force cannot be told apart.
    """

    moved: np.ndarray
    friction: float
    constant: float
    friction_reach: float
    constant_reach: float
    sure: bool = field(default=True, kw_only=True)


FRICTION_SHARE_OF_A_CHANGE = 0.1
"""Smallest reported change of friction or constant force, relative to Coulomb friction."""


def find_changing_friction(case: FitCase) -> Iterator[RaisedDoubt]:
    """Fit changes of friction and of the constant force to the residual force.

    Intervals reach over all changes; sure ones are named.
    """
    inverse, quality = case.inverse, case.quality
    changes = None
    if not quality.failed:
        changes = changes_beside(inverse) if quality.rejected else _changes_of_fit(case.fit, case.velocity)
    if changes is None or max(changes.friction_reach, changes.constant_reach) > case.largest(case.unit):
        return
    if quality.rejected:
        yield RaisedDoubt(inverse=inverse_reaching(inverse, changes))
    else:
        yield RaisedDoubt(fit=_reaching(case.fit, changes))
    for what, size, cause in (
        ("Friction", changes.friction, "warming up?" if not case.passes_once else "warming up, or a place on the way?"),
        ("The constant force", changes.constant, "a drift of the force?"),
    ):
        if changes.sure and size > FRICTION_SHARE_OF_A_CHANGE * case.inverse.value("coulomb"):
            words = f"{what} changes by {size:.2g} {case.unit} during the record ({cause})"
            yield RaisedDoubt(
                words=f"{words}: intervals reach from its least to its largest", size=size, unit=case.unit
            )


def _changes_of_fit(fit: OutputErrorFit, velocity: np.ndarray) -> RecordDrift | None:
    """Return the changes during a record, from its smooth `velocity` [m/s], shape (n,).

    The changes are fitted together with the parameters, starting from the fit. Returns None if nothing clearly changes,
    and for a fit without Coulomb friction.
    """
    if "friction.coulomb" not in fit.problem.names:
        return None
    forces, units, bends = changing_forces(fit, velocity)
    explained = explained_by_forces(fit, forces, units)
    drift = _drift(explained, bends)
    return drift and replace(drift, sure=explained is not None and bool(explained.sure(fit).any()))


def changing_forces(
    fit: OutputErrorFit, velocity: np.ndarray
) -> tuple[list[np.ndarray], list[float], list[np.ndarray]]:
    """Build the forces by which friction and a constant force could change along a record.

    `velocity` [m/s] is the record's. Each force, shape (n,), changes along a straight line in either half of the
    record. Also returns the sizes [N] at which the forces are simulated, and the two shapes of change, (n,) each.
    """
    unit = FRICTION_SHARE_OF_A_TRIED_FORCE * fit.value("friction.coulomb")
    bends = _bends(np.linspace(0.0, 1.0, len(velocity)), fit.problem.counted)
    forces = [base * bend for base in (-way_of(velocity), np.ones(len(velocity))) for bend in bends]
    return forces, [unit] * len(forces), bends


def changes_beside(inverse: InverseModel) -> RecordDrift | None:
    """Return how friction and constant force change during the record of an inverse model.

    The inverse model has equal friction both ways. Returns None if nothing clearly changes.
    """
    share = (inverse.time - inverse.time[0]) / np.ptp(inverse.time)
    counted = np.ones(len(share))
    bends = _bends(share, counted)
    effects = [-base * bend for base in (inverse.columns[:, 2], counted) for bend in bends]
    return _drift(explained_by(-inverse.columns, inverse.measured - inverse.fitted, effects, counted), bends)


def _bends(share: np.ndarray, counted: np.ndarray) -> list[np.ndarray]:
    """Return two shapes of change along a record, without their means, shape (n,) each.

    `share` is the fraction of the record's time. One shape rises to 1 in the middle and falls again; the other rises to
    1 from the middle to the end. `counted` weights the samples in the means.
    """
    shapes = 1 - np.abs(2 * share - 1), np.maximum(2 * share - 1, 0.0)
    return [shape - np.average(shape, weights=counted) for shape in shapes]


def _drift(explained: ExplainedResidual | None, bends: Sequence[np.ndarray]) -> RecordDrift | None:
    """Compute changes of friction and constant force from the fitted sizes of their shapes.

    `bends` are the shapes, (n,) each. Returns None if the changes explained nothing.
    """
    if explained is None:
        return None
    friction, constant = (part @ np.stack(bends) for part in np.split(explained.sizes, 2))
    reaches = (float(np.abs(line).max()) for line in (friction, constant))
    return RecordDrift(explained.moved, float(np.ptp(friction)), float(np.ptp(constant)), *reaches)


def _reaching(fit: OutputErrorFit, changes: RecordDrift) -> OutputErrorFit:
    """Widen the fit's deviations by a drift of friction and constant force, and what it shifts.

    Coulomb friction and the constant force get their largest drift from the mean. All fitted numbers get the shift that
    the drift causes.
    """
    further = np.abs(changes.moved)
    for i, name in enumerate(fit.fitted):
        if name == "friction.coulomb":
            further[i] += changes.friction_reach / fit.value(name)
        elif name.startswith("bias."):
            further[i] += changes.constant_reach
    return reaching_over(fit, further)


def inverse_reaching(inverse: InverseModel, changes: RecordDrift) -> InverseModel:
    """Widen the inverse model's intervals by changes during the record and the shifts they cause."""
    over = {"coulomb": changes.friction_reach, "offset": changes.constant_reach}
    answers = tuple(
        one.widened(moved + over.get(one.name, 0.0)) if one.determined else one
        for one, moved in zip(inverse.estimates, np.abs(changes.moved), strict=True)
    )
    return replace(inverse, estimates=answers)


def forces_of_changing_friction(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the forces by which friction and a constant force could change along the record."""
    if "friction.coulomb" in case.fit.problem.names:
        yield TriedForces(*changing_forces(case.fit, case.velocity)[:2])


CHANGING_FRICTION = Doubt(
    "fit",
    find_changing_friction,
    "forces along and against the motion that change with time",
    "intervals reach over the change",
    "the same moves again, after the machine has warmed up",
    after=("delay",),
    forces=forces_of_changing_friction,
)


POWER_LEFT_BY_A_LOAD = 0.7
"""Largest fraction of the residual's power left by load-dependent friction if it is named. It was 0.02 to 0.26 on
drawn logs with a ratio of 0.1, and at least 0.92 on sound logs."""

SHARES_OF_A_LOAD = (0.02, 0.5)
"""Smallest and largest plausible ratio of load-dependent friction to the motor's force. It was below 0.009 on sound
logs; above 0.5 a transmission locks itself."""


def find_load_friction(case: FitCase) -> Iterator[RaisedDoubt]:
    """Look for friction in proportion to the motor's force.

    Such friction makes a mass seem heavier while the motor accelerates it than while it brakes, but the model has one
    mass and one Coulomb friction for both. Without this doubt, a machine of 3 kg and 5 N with a tenth of the force as
    friction was identified as 3.13 to 3.36 kg and 5.44 to 5.60 N. The effect is named if it explains much of the
    residual, and more than a coupling, a delay, or friction that changes with time.
    """
    effect = case.leading
    if effect is None or effect.doubt != "load-friction":
        return
    share = float(effect.explained.sizes[0])
    if effect.explained.left > POWER_LEFT_BY_A_LOAD or share > SHARES_OF_A_LOAD[1]:
        return
    words = (
        f"Friction grows with the force of the motor, by {percent(share)} of it, as that of worm gears, belts and "
        "preloaded screws does: no friction of the stage file does so, and the intervals allow for it; constant speeds "
        "with and without a load would show it"
    )
    yield RaisedDoubt(words=words, size=share, fit=case.reaching(effect.explained.moved), explains=True)


SHARE_OF_A_TRIED_LOAD = 0.02
"""Size of tried load-dependent friction, relative to the motor's force."""


def forces_of_load_friction(case: FittedCase) -> Iterator[TriedForces]:
    """Yield a force against the motion, in proportion to the motor's force."""
    force = case.log["force"][case.log.longest]
    against, least = -np.abs(force) * way_of(case.velocity), SHARES_OF_A_LOAD[0]
    yield TriedForces([against], [SHARE_OF_A_TRIED_LOAD], least=least)


LOAD_FRICTION = Doubt(
    "fit",
    find_load_friction,
    "a force against the motion in proportion to the motor's force",
    "intervals widen; a coupling and a delay are not named beside it",
    "constant speeds with and without a load",
    after=("friction-by-direction",),
    forces=forces_of_load_friction,
)


def find_coupling(case: FitCase) -> Iterator[RaisedDoubt]:
    """Look for a load on a coupling, by the second derivative of the acceleration.

    If the motor's position is measured, a load m on a coupling of natural frequency w seems to weigh m / (1 + s^2 /
    w^2) in motion exp(s t): well below w, its force lacks m / w^2 times the second derivative of the acceleration. If
    the position of the load is measured, the force that moves a mass M before the coupling is greater by M / w^2 times
    that derivative. At the reversals of a slow motion, friction may do the same: no coupling is named then, nor if it
    explains little.
    """
    fit = case.fit
    for tried, explained in case.explained(forces_of_coupling) if not is_free(case.flat) else ():
        lighter, further = -float(explained.moved[fit.fitted.index(MASS)]), case.reaching(explained.moved)
        if lighter * explained.sizes[0] <= 0 or not is_sure_beside_all(fit, tried.forces, tried.units):
            yield RaisedDoubt(fit=further)
            return
        share = -float(np.expm1(-lighter))
        clear = case.leading is not None or explained.left <= POWER_LEFT_BY_AN_EFFECT
        words = _sentence(share) if clear and case.may_name("coupling") else ""  # averaged motion looks like that, too
        yield RaisedDoubt(words=words, size=share, fit=further, refuses=dict.fromkeys(BRISTLES, IMITATED))


BANDWIDTHS_OF_A_COUPLING = 2.0
"""Cut-off of the motion in tests for a coupling, relative to its bandwidth. For 3 kg with a third behind 40 Hz, 2
and 3 correct a mass 1.3 % too large; 5 corrects half of the error."""

MASS_SHARE_OF_A_TRIED_COUPLING = 0.05
"""Force of a tried coupling, relative to inertia. Larger forces are not linear."""


def forces_of_coupling(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that a coupling would add, scaled to the inertia, if a mass is fitted."""
    fit, step = case.fit, case.log.sample_time
    if MASS not in fit.fitted:
        return
    cutoff = BANDWIDTHS_OF_A_COUPLING * case.inverse.bandwidth
    acceleration = motion(case.log["position"][case.log.longest], step, cutoff).acceleration
    force = np.gradient(np.gradient(acceleration, step), step)
    size = float(np.std(force))
    if size > 0:
        force *= fit.value(MASS) * float(np.std(acceleration)) / size
        yield TriedForces([force], [MASS_SHARE_OF_A_TRIED_COUPLING])


def _sentence(share: float) -> str:
    """Write the sentence on a coupling that changes the identified mass by the fraction `share`."""
    where, way = (
        ("a part of the load moved on a coupling behind the measured position", "smaller")
        if share > 0
        else ("the position were measured behind a coupling", "larger")
    )
    return (
        f"The force goes with the motion as if {where}: the mass may be {percent(abs(share))} {way}, for which the "
        "intervals allow; a frequency response would show the coupling"
    )


COUPLING = Doubt(
    "fit",
    find_coupling,
    "a force that goes with the second derivative of the acceleration",
    "intervals widen; bristles are refused",
    "a frequency response",
    after=("load-friction", "play", "cogging", "friction-by-place", "drifting-delay"),
    forces=forces_of_coupling,
)


MOST_OF_A_PLAY = 1.5
"""Largest plausible fitted fraction of mass or friction behind a play. Much more than 1 shows another effect."""

PLAYS_TRIED = (8e-6, 1e-3)  # [m]
"""Smallest and largest width of play that is tried. Narrower play passes within a few samples; wider play is
obvious."""

RATIO_OF_PLAYS = 1.4
"""Ratio of successive tried widths of play. A width wrong by a factor of 1.5 explains half of the effect."""

DIGITS_OF_A_PLAY = 5.0
"""Smallest width of a play that can be named, in steps of the position."""


def find_play(case: FitCase) -> Iterator[RaisedDoubt]:
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
    if share > MOST_OF_A_PLAY:
        return
    what = "mass" if share == shares[0] else "friction"
    words = (
        f"Play of about {width * 1e6:.2g} um, to a factor of three, between motor and load: the force lacks that of "
        f"{percent(share)} of the {what} while the load crosses it; it passes for soft bristles, which are refused, "
        "and the intervals of the rest allow for it; a dial gauge on the load while the motor turns to and fro shows it"
    )
    named, digit = case.named(effect, words, width, "m"), digit_of(case.log["position"][case.log.longest])
    low, high = PLAYS_TRIED
    near = RATIO_OF_PLAYS**1.5  # the ends of the tried widths, and those next to them
    inside = max(near * low, DIGITS_OF_A_PLAY * digit) < width < high / near
    yield named if inside else replace(named, words="", explains=False)


BANDWIDTHS_OF_A_PLAY = 4.0
"""Bandwidth of the motion in tests for play, relative to the usual bandwidth. At 1 a gap that is crossed in 5 ms is
blurred; at 16 noise dominates."""

MASS_SHARE_OF_A_LOOSE_LOAD = 0.5
"""Assumed mass of a loose load that friction slows down, relative to the total mass."""

SAMPLES_OF_A_CROSSING = 5.0
"""Fewest samples, on average, in which a load crosses a tried play. With 2, reversals of a sound sine at 500 Hz
looked like play; with 10, plays of 20 um would be missed at 1 kHz."""

MASS_SHARE_OF_A_TRIED_PLAY = 0.05
"""Tried loose fraction of the mass. Play acts in proportion to it."""

MASS_SHARE_OF_A_PLAY = 0.1
"""Smallest loose fraction of the mass for which play is reported. It was 0.03 to 0.08 on 4 of 40 drawn sound logs,
and at least 0.12 on 8 with play."""


def forces_of_play(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that the motor does not need while its load is loose, by width of play.

    The whole mass is taken as load, once without friction, and once with friction that slows it down while it is loose.
    Widths that the load crosses within a few samples are not tried, because motion between samples would look like
    play.
    """
    fit, step = case.fit, case.log.sample_time
    if not {MASS, "friction.coulomb"} <= {*fit.problem.names}:
        return
    cutoff = BANDWIDTHS_OF_A_PLAY * SMOOTHING_BANDWIDTHS
    moved = motion(case.log["position"][case.log.longest], step, cutoff * case.inverse.bandwidth)
    mass, friction = fit.value(MASS), fit.value("friction.coulomb")
    low, high = PLAYS_TRIED
    widths = np.geomspace(low, high, 1 + round(np.log(high / low) / np.log(RATIO_OF_PLAYS)))
    slowings = np.repeat([0.0, friction / (MASS_SHARE_OF_A_LOOSE_LOAD * mass)], len(widths))
    both = np.tile(widths, 2)
    speeds = loose_loads(moved.position, moved.velocity, step, both, slowings)
    for width, slowing, speed in zip(both, slowings, speeds, strict=True):
        loose = runs(speed != moved.velocity)
        if sum(one.stop - one.start for one in loose) < SAMPLES_OF_A_CROSSING * len(loose):
            continue
        acceleration = np.diff(speed, prepend=speed[0]) / step
        lacking = [mass * (moved.acceleration - acceleration)]
        lacking += [friction * (np.sign(moved.velocity) - np.sign(speed))] if slowing else []
        sizes, least = [MASS_SHARE_OF_A_TRIED_PLAY] * len(lacking), MASS_SHARE_OF_A_PLAY
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


PLAY = Doubt(
    "fit",
    find_play,
    "the force of a load that is loose by a gap, of several widths",
    "intervals widen; bristles are refused",
    "a dial gauge on the load while the motor turns to and fro",
    after=("friction-by-direction",),
    forces=forces_of_play,
    places=True,
)
