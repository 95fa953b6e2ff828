"""Moves, with a reference or without: mass, friction and constant force, and the joint if it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from friso.axis import axis_shown, unit_shown
from friso.errors import InputError
from friso.identification.combine import Correlated
from friso.identification.doubt import steady_friction
from friso.identification.estimate import Estimate, digits, estimates_in_words, name_of, unit_of, with_interval, within
from friso.identification.estimate_documents import ends_document
from friso.identification.inverse_model import (
    SAMPLES_OF_AN_EDGE,
    SMOOTHING_BANDWIDTHS,
    InverseModel,
    inverse_model,
    motion,
)
from friso.identification.kind import TIME, AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.logs.log import ROLES, Log
from friso.identification.moves import IdentifiedMoves, SimulatedLog, check_roles, identify_moves, simulated_log
from friso.identification.output_error.identifiable import Profile
from friso.identification.output_error.parameters import FitParameter
from friso.identification.output_error.problem import Simulated, why_continuous
from friso.identification.output_error.to_keys import MACHINES_DRAWN
from friso.identification.readings.common import cart, low_pass, on_bearing
from friso.identification.readings.course import Course
from friso.identification.stage_file import made_up
from friso.identification.witness import Replay
from friso.quantities import percent
from friso.shown.documents import entries, unit_suffix
from friso.shown.drawing.figure import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    Array,
    Axis,
    Band,
    Figure,
    Limit,
    Markers,
    Panel,
    Series,
)
from friso.shown.text import range_with_unit
from friso.stage import Stage

WITHOUT_CONTROLLER = (
    "without the machine's own controller the simulated stage follows the logged position; with it (--stage) the "
    "intervals may be narrower, and more may be identified, as far as that loop explains the record"
)

WITHOUT_REFERENCE = (
    "without the logged reference the controller of the stage file cannot be simulated: the simulated stage follows "
    "the logged position"
)

ALIKE = (
    "a play of about {} between motor and load would look like these bristles: their stiffness holds for an axis "
    "without play"
)


UNEQUAL = (
    "{}: friction that is {} higher {} and lower the other way would look like this constant force; a record with the "
    "axis turned round tells them apart"
)


def _in_newtons(log: Log) -> bool:
    """Tell whether the force of a log is in newtons."""
    return log.unit("force") == ROLES["force"]


def _explained(replay: Replay | None) -> str:
    """Say that the controller of the stage file explains the logged force; "" if it does not, or was not replayed."""
    if replay is None or not replay.agrees or replay.refutes:
        return ""
    late = f", {replay.lag * 1e3:.3g} ms after the position" if replay.lag else ""
    if replay.left_by_stamps is not None:
        late += (
            f" (with scattering time stamps it leaves {percent(replay.left_by_stamps)}: the samples are taken as even)"
        )
    return (
        "replayed on the log, the controller of the stage file explains the force to "
        f"{percent(max(abs(replay.slope - 1), replay.left))}{late}: its clock, and the force over the position, fit it"
    )


def _play_that_looks_alike(answers: Sequence[Sequence[Estimate]]) -> list[str]:
    """Return a note on the play that would pass for the identified bristles; none without bristles.

    Its width is about their bend before sliding, Coulomb friction over stiffness: plays of two to four bends of the
    true bristles were fitted to the noise by softer ones (docs/evidence/identify.md). The widest of several is told.
    """
    values = [{one.name: one.value for one in estimates if one.determined} for estimates in answers]
    needed = "friction.coulomb", "friction.bristle_stiffness"
    bends = [one[needed[0]] / one[needed[1]] for one in values if one.keys() >= {*needed}]
    return [ALIKE.format(f"{max(bends) * 1e6:.2g} um")] if bends else []


MOST_ASYMMETRY_OF_FRICTION = 0.3
"""Largest difference of friction by direction, relative to its mean, that bearings show. A constant force beyond
that is no asymmetry."""


def _direction_that_looks_alike(answers: Sequence[Sequence[Estimate]]) -> list[str]:
    """Return a note on friction that differs by direction and would pass for the constant force; none without one."""
    notes = {}
    for estimates in answers:
        values = {one.name: one for one in estimates if one.determined}
        coulomb = values.get("friction.coulomb")
        for name in ("bias.cart", "bias.stage"):
            bias = values.get(name)
            if bias is not None and coulomb is not None and not bias.low <= 0 <= bias.high:
                share = abs(bias.value) / coulomb.value
                if share < MOST_ASYMMETRY_OF_FRICTION:
                    notes[name] = UNEQUAL.format(name, percent(share), "back" if bias.value > 0 else "forward")
    return [*notes.values()]


def _span(log: Log) -> str:
    """Return the time span of a log in words."""
    start, end = (round(float(log.time[k]), 9) + 0.0 for k in (0, -1))  # not -2e-16 s
    return f"{start:.6g} to {end:.6g} s"


FORCE = "force"
"""Name of the figure that opens the page."""

PALE = "#dbe9f4"


def _force(moves: IdentifiedMoves, name: str) -> Figure:
    """Draw measured and simulated force where the stage moves most."""
    stretch = _liveliest(moves)
    log, part = moves.log, moves.part
    time, force = log.time[part][stretch], log["force"][part][stretch]
    if moves.loop is None:
        simulated, word = force - moves.fit.residual[stretch], "needed"
    else:
        extra = log["disturbance"][part][stretch] if "disturbance" in log else 0.0
        simulated, word = moves.simulated.force[stretch] + extra, "simulated"
    caption = "The force as measured and as the identified machine needs it, where the log moves most."
    panel = Panel("", TIME, Axis("Force", moves.force_unit), _both(time, force, simulated, word))
    return Figure(f"{name}_{FORCE}", "Measured and simulated force", caption, (panel,))


PERIODS_OF_A_FORCE_RECORD = 40.0
"""Length of the force record at the head of the page, in periods of the motion's bandwidth."""


def _liveliest(moves: IdentifiedMoves) -> slice:
    """Return the samples of the stretch of a log with the most motion, a few periods long."""
    position = moves.log["position"][moves.part]
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(position)))])
    length = min(
        len(position),
        max(
            2,
            round(PERIODS_OF_A_FORCE_RECORD / (moves.inverse.bandwidth * moves.log.sample_time)),
        ),
    )
    first = int(np.argmax(way[length - 1 :] - way[: len(way) - length + 1]))
    return slice(first, first + length)


def _traces(moves: IdentifiedMoves, name: str) -> Figure:
    """Draw the record as measured and simulated over time."""
    if moves.loop is not None:
        caption = "The identified machine in closed loop on the logged reference; the measured motion does not enter."
        caption += "" if moves.fit.problem.closed else " Its values were fitted along the logged position instead."
        panels = record_panels(moves.log, moves.part, moves.simulated)
        return Figure(f"{name}_traces", "Measured and simulated", caption, panels)
    time, force = moves.log.time[moves.part], moves.log["force"][moves.part]
    caption = (
        "The force that the identified machine needs to move as measured, and its difference from the measured force."
    )
    panels = (
        Panel("", TIME, Axis("Force", moves.force_unit), _both(time, force, force - moves.fit.residual, "needed")),
        _difference(time, moves.fit.residual, moves.force_unit),
    )
    return Figure(f"{name}_traces", "Measured and simulated force", caption, panels)


def record_panels(log: Log, part: slice, simulated: Simulated) -> tuple[Panel, ...]:
    """Draw position, force and the residuals of both, as measured and as simulated.

    `part` selects samples of the log, and `simulated` is their simulation in closed loop.
    """
    time, position, force = log.time[part], log["position"][part], log["force"][part]
    expected = simulated.force + (log["disturbance"][part] if "disturbance" in log else 0.0)
    apart = Series(time, position - simulated.position, "", VERMILLION, width=1.0)
    return (
        Panel("", TIME, Axis("Position", "m"), _both(time, position, simulated.position, "simulated")),
        Panel("", TIME, Axis("Measured − simulated", "m"), (apart,)),
        Panel("", TIME, Axis("Force", log.unit("force")), _both(time, force, expected, "simulated")),
        _difference(time, force - expected, log.unit("force")),
    )


def _both(time: Array, measured: Array, simulated: Array, word: str) -> tuple[Series, ...]:
    """Draw a signal over time as measured and as simulated; `word` names the simulated one."""
    return Series(time, measured, "measured", GREY, width=2.0), Series(time, simulated, word, VERMILLION, width=0.8)


def _difference(time: Array, left: Array, unit: str) -> Panel:
    """Draw the residual `left` of a signal, measured minus simulated [unit], over time [s]."""
    return Panel("", TIME, Axis("Measured − simulated", unit), (Series(time, left, "", VERMILLION, width=0.9),))


def _residual(moves: IdentifiedMoves, name: str) -> Figure:
    """Draw the residual force over position and speed."""
    moved = motion(
        moves.log["position"][moves.part],
        moves.log.sample_time,
        SMOOTHING_BANDWIDTHS * moves.inverse.bandwidth,
    )
    left, axis = moves.fit.residual, Axis("Residual force", moves.force_unit)
    panels = (
        Panel("", Axis("Position", "m"), axis, (Series(moved.position, left, "", VERMILLION, width=0.5),)),
        Panel("", Axis("Velocity", "m/s"), axis, (Series(moved.velocity, left, "", VERMILLION, width=0.5),)),
    )
    caption = (
        "Measured minus simulated force. A pattern over position comes from the rail or the screw (cogging, pitch), "
        "one over velocity from friction that the model lacks."
    )
    return Figure(f"{name}_residual", "Residual force", caption, panels, columns=2)


def _friction(moves: IdentifiedMoves, name: str) -> Figure:
    """Draw the force without the inertial force over velocity, and the identified friction."""
    flat = moves.flat
    masses = [flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage")]
    step, cutoff = moves.log.sample_time, SMOOTHING_BANDWIDTHS * moves.inverse.bandwidth
    moved, stage = (
        motion(position[moves.part], step, cutoff) for position in (on_bearing(moves.log), moves.log["position"])
    )
    force = low_pass(moves.log["force"][moves.part], step, cutoff)
    friction = force - masses[0] * moved.acceleration - masses[1] * stage.acceleration
    inner = slice(SAMPLES_OF_AN_EDGE, -SAMPLES_OF_AN_EDGE)  # the filter has transients at the ends of a record
    loops = Series(moved.velocity[inner], friction[inner], "measured force less inertia", GREY, width=0.6)
    top = float(np.abs(moved.velocity).max())
    reach = 1.1 * float(np.percentile(np.abs(friction), 99.5))
    low, high = moves.covered.gap
    sides = [(low, min(high, top)), (-min(high, top), -low)] if moves.covered.steady.size else []
    bands = tuple(
        Band(np.array(ends), np.full(2, -reach), np.full(2, reach), "no steady motion" if i == 0 else "", PALE)
        for i, ends in enumerate(sides)
    )
    speeds = np.concatenate([-np.geomspace(top, top / 1e4, 200), [np.nan], np.geomspace(top / 1e4, top, 200)])
    curve = Series(speeds, steady_friction(flat, speeds), "identified", BLUE, width=1.8)
    axes = Axis("Velocity", "m/s", (-1.05 * top, 1.05 * top)), Axis("Friction", moves.force_unit, (-reach, reach))
    unshown = any(estimate.name == "friction.static" and not estimate.determined for estimate in moves.estimates)
    caption = (
        f"Loops: measured force less mass times acceleration, both below {digits(cutoff, 'Hz')}; they open where the "
        "motion reverses."
    )
    if sides:
        caption += f" Shaded: {range_with_unit(low, high, 'm/s')}, without steady motion"
        caption += ", where a Stribeck effect would not show." if unshown else "."
    panel = Panel("", *axes, (loops, curve), bands=bands)
    return Figure(f"{name}_friction", "Friction over velocity", caption, (panel,))


MISFIT_AT_THE_TOP = 5.0
"""Upper end of the axis of a profile, in units of the misfit at the ends of the 95 % interval."""


def _profiles(moves: IdentifiedMoves, name: str) -> list[Figure]:
    """Draw how much worse the fit becomes as one parameter is varied.

    The list is empty if that was not computed.
    """
    best = moves.fit.cost
    parameters = {parameter.name: parameter for parameter in moves.fit.problem.parameters}
    fitted = {moves.fit.problem.parameters[number].name for number in moves.fit.free}
    if not moves.profiles:
        return []
    panels = tuple(_profile(profile, parameters[key], best, key in fitted) for key, profile in moves.profiles.items())
    caption = (
        "How much worse the best fit gets with one parameter held and the others refitted; 1 is the end of "
        f"the 95 % interval (shaded), drawn up to {MISFIT_AT_THE_TOP:g}. Where a curve stays "
        "below 1 to the end of its range, the record does not determine the parameter."
    )
    if any((profile.cost < best - (profile.limit - best)).any() for profile in moves.profiles.values()):
        caption += (
            " Below 0 the fit is better than the one chosen: the parameter has no effect of its own in this motion and "
            "makes up for other errors of the model."
        )
    return [Figure(f"{name}_profiles", "Profiles of the fit", caption, panels, columns=2)]


RATIO_OF_A_LOGARITHMIC_AXIS = 8.0
"""Ratio of its ends above which a profile has a logarithmic axis."""


def _profile(profile: Profile, parameter: FitParameter, best: float, fitted: bool) -> Panel:
    """Draw how much worse the fit becomes as one parameter is varied; 1 is the limit accepted.

    The interval of the parameter is shaded. `best` is the cost of the best fit. `fitted` is true if the fit could
    determine the parameter, which sets the colour.
    """
    worse = (profile.cost - best) / (profile.limit - best)
    log = parameter.logarithmic and profile.values[-1] > RATIO_OF_A_LOGARITHMIC_AXIS * profile.values[0]
    lowest = min(-0.2, 1.2 * float(worse[np.isfinite(worse)].min(initial=0.0)))
    y = Axis("Worse by", "", (lowest, MISFIT_AT_THE_TOP))
    unit = unit_of(parameter.unit)
    ends = (float(profile.values[0]), float(profile.values[-1]))
    x = Axis(name_of(profile.name), unit, ends, log=log, prefixed=log or unit.startswith("m"))
    interval = np.array([profile.low, profile.high])  # it may be open
    shade = Band(
        np.clip(np.where(np.isnan(interval), ends, interval), *ends),
        np.full(2, lowest),
        np.full(2, MISFIT_AT_THE_TOP),
        "",
        PALE,
    )
    colour = BLUE if fitted else ORANGE
    line = Series(profile.values, np.where(np.isfinite(worse), worse, np.nan), "", colour)
    points = Markers(profile.values, np.where(worse <= MISFIT_AT_THE_TOP, worse, np.nan), "", colour)
    return Panel("", x, y, (line,), (points,), (Limit((1.0,), "", INK),), bands=(shade,))


FALLING = "viscous friction below zero: friction falls as the speed rises (Stribeck effect), which this model lacks"
"""Meaning of a negative viscous friction of the inverse model."""


def _errors(moves: IdentifiedMoves) -> str:
    """Write the relative errors of the simulated record.

    If the model followed the logged position, only the error of the force has a meaning.
    """
    errors = moves.errors
    if moves.loop is None:
        return f"force {percent(errors.force, 3)}"
    return (
        f"position {percent(errors.position, 3)}, velocity {percent(errors.velocity, 3)}, acceleration "
        f"{percent(errors.acceleration, 3)}, force {percent(errors.force, 3)}"
    )


def _inverse_text(model: InverseModel) -> str:
    """Write the estimates of an inverse model, which computes the force from the motion."""
    text = f"{estimates_in_words(model.estimates)}; force error {percent(model.error, 3)}"
    falling = any(one.name.startswith("viscous") and one.high < 0 for one in model.estimates)
    return f"{text}; {FALLING}" if falling else text


def _inverse_numbers(model: InverseModel) -> dict[str, Any]:
    """Return an inverse model, which computes the force from the motion, for the document."""
    named = {
        f"{estimate.name.replace(' ', '_')}{unit_suffix(estimate.unit)}": ends_document(estimate)
        for estimate in model.estimates
    }
    return {**named, "force_error": model.error, "bandwidth_hz": model.bandwidth}


def _residual_numbers(moves: IdentifiedMoves) -> dict[str, Any]:
    """Return the residual force, for the document."""
    residual = moves.residual
    return {
        **entries(residual, "rms_n", "mean_n", "correlation_time_s", "white"),
        "explained_by_position": residual.by_position,
        "explained_by_velocity": residual.by_velocity,
    }


def _profile_numbers(profile: Profile) -> dict[str, Any]:
    """Return how much worse the fit becomes as one parameter is varied, for the document."""
    ends = entries(profile, "low", "high", "open_low", "open_high", "values")
    return {**ends, "mean_squares_n2": profile.cost, "limit_n2": profile.limit}


SAMPLES_OF_MOVES = 40_000
"""Largest number of samples of moves that are used (friso's choice)."""


class MovesKind(ExperimentKind[IdentifiedMoves]):
    """Moves, which show mass, friction and constant force, and the joint if it shows."""

    title = "Moves"
    after = ("frequency", "steps")
    foreign = ("force", "disturbance")
    longest = True
    makes_stage = True
    predicts = "a log with a reference beside moves"
    opening = FORCE

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> IdentifiedMoves:
        """Analyse a log of moves, using results of other experiments.

        The machine's own loop is simulated if the user gave the stage and the log has a reference.
        """
        if prior.from_user:
            check_roles(log, ("force",))
        log = log.excerpt(SAMPLES_OF_MOVES)
        flat = prior.flat(log) if _in_newtons(log) else made_up(log, inverse_model(log, settings.bandwidth)).flat()
        start = {**flat, **{key: estimate.value for key, estimate in prior.estimates.items() if key in flat}}
        own_loop = prior.from_user and "reference" in log
        return identify_moves(log, start, own_loop, settings.bandwidth, settings.progress, settings.tell)

    def estimates(self, result: IdentifiedMoves, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return estimates of stage-file keys if the force was in newtons, else none."""
        return result.estimates if _in_newtons(result.log) else ()

    def correlated(self, result: IdentifiedMoves, estimates: Sequence[Estimate]) -> Correlated:
        """Return the determined estimates with their correlation in the fit; none without estimates."""
        return (result.correlated, result.correlation) if estimates else ((), np.zeros((0, 0)))

    def around(self, log: Log) -> Stage | None:
        """Make a stage with assumed values for a log; None if its force is not in newtons."""
        part = log.excerpt(SAMPLES_OF_MOVES)
        return made_up(part, inverse_model(part)) if _in_newtons(log) else None

    def notes(self, results: Sequence[IdentifiedMoves], stage: Stage | None) -> list[str]:
        """List notes on simplified drives, on loops not simulated, and on logs used only in part."""
        loops = [result for result in results if result.loop] if stage is not None else []
        reasons = [why_continuous(stage.flat(), result.log.sample_time) for result in loops if stage is not None]
        followed = any(result.loop is None for result in results)
        long, count = [result.log for result in results if result.log.is_excerpt], SAMPLES_OF_MOVES
        return [
            *(sentence for sentence in dict.fromkeys(reasons) if sentence),
            *([WITHOUT_CONTROLLER if stage is None else WITHOUT_REFERENCE] if followed else []),
            *(f"{one.log.name}: {explained}" for one in loops if (explained := _explained(one.replay))),
            *_play_that_looks_alike([result.estimates for result in results]),
            *_direction_that_looks_alike([result.estimates for result in results]),
            *(
                f"{log.name}: of a log this long {count} samples are used, {_span(log)}, where it moves most"
                for log in long
            ),
        ]

    def check_prediction(self, logs: Sequence[Source], other: Log, prior: Prior) -> None:
        """Check that logs can be identified in the machine's loop, and another log simulated.

        The user must have given the stage. One of the logs needs a reference, and the other log position, force and
        reference. Raises InputError otherwise.
        """
        check_roles(other, ("position", "force", "reference"))
        prior.flat(other)
        if not prior.from_user:
            expected = "the machine's own controller, with which another record can be simulated"
            raise InputError("--predict", "no stage file", expected, "--stage examples/emps_axis.toml", other.name)
        if not any(isinstance(log, Log) and "reference" in log for log in logs):
            actual = f"{', '.join(log.name for log in logs)}, without a reference"
            expected = "a log of moves with its reference, in whose loop the machine is identified"
            raise InputError("--predict", actual, expected, "--map reference=SetPos", other.name)

    def predict(
        self, result: IdentifiedMoves, log: Log, prior: Prior, settings: AnalysisSettings
    ) -> SimulatedLog | None:
        """Simulate another log; None if it lacks a reference, or the own loop is not simulated."""
        if "reference" not in log or result.loop is None:
            return None
        return simulated_log(result, log, prior.flat(log) or None)

    def facts(self, result: IdentifiedMoves) -> Facts:
        """List fits of the inverse model, errors of the simulation, and the residual force.

        The inverse model computes the force from the motion, for both directions together and for each.
        """
        residual = result.residual
        correlation = (
            "uncorrelated from sample to sample"
            if residual.white
            else f"correlated over {digits(residual.correlation_time, 's')}"
        )
        return (
            ("Inverse model", _inverse_text(result.inverse)),
            ("Inverse model, per direction", _inverse_text(result.by_direction)),
            ("Bandwidth of the motion", digits(result.inverse.bandwidth, "Hz")),
            ("Relative errors of the simulation", _errors(result)),
            ("Residual force", f"{digits(residual.rms, result.force_unit)} RMS, {correlation}"),
            ("Share of its power explained", f"{percent(residual.by_position, 3)} by position along the rail, "
             f"{percent(residual.by_velocity, 3)} by speed"),
        )  # fmt: skip

    def sentences(self, result: IdentifiedMoves) -> tuple[str, ...]:
        """Say how a log of moves was fitted, and what its motion covers."""
        low, high = result.covered.gap
        along = "the machine was simulated along the logged position, and the forces were compared."
        if result.fit.problem.closed:
            method = "The machine was simulated in closed loop on the logged reference."
        elif result.loop is not None:
            method = f"In closed loop the simulated machine gets out of step with the log: {along}"
        else:
            method = f"{along[0].upper()}{along[1:]}"
        if not result.covered.steady.size:
            return method, "No part of the motion is steady for long enough to show friction at a speed."
        gap = range_with_unit(low, high, "m/s")
        return (
            method,
            f"The widest gap in the steady speeds is {gap}: the record does not show friction there.",
        )

    def headline(self, result: IdentifiedMoves) -> str:
        """Say what is identified from a log whose force is not in newtons; empty for newtons.

        Values are in units of that force. A stage file needs newtons, so the sentence says how to give the scale of the
        force.
        """
        if result.force_unit == "N":
            return ""
        values = "; ".join(f"{within(estimate.name)} {with_interval(estimate)}" for estimate in result.correlated)
        return (
            f"Identified, the force being in {result.force_unit}: {values}. A stage file needs "
            f'--scale force="NUMBER {unit_shown("N")}/{result.force_unit}".'
        )

    def numbers(self, result: IdentifiedMoves) -> dict[str, Any]:
        """Return the inverse model and the simulated model of a log of moves, for the document."""
        low, high = result.covered.gap
        parameters = {
            parameter.name: {"unit": unit_shown(parameter.unit), "value": result.fit.value(parameter.name)}
            for parameter in result.fit.problem.parameters
        }
        fitted = [result.fit.problem.parameters[number].name for number in result.fit.free]
        return {
            "inverse_model": _inverse_numbers(result.inverse),
            "inverse_model_by_direction": _inverse_numbers(result.by_direction),
            "output_error": {
                "loop": "follows the log" if result.loop is None else "closed",
                "fitted_in_loop": result.fit.problem.closed,
                "errors": asdict(result.errors),
                "residual": _residual_numbers(result),
                "parameters": parameters,
                "fitted": fitted,
                "profiles": {name: _profile_numbers(profile) for name, profile in result.profiles.items()},
            },
            "not_shown": [
                {"key": estimate.name, "reason": axis_shown().text(estimate.reason)}
                for estimate in result.estimates
                if not estimate.determined
            ],
            "no_steady_motion_m_per_s": [low, high],
            "samples_used": result.part.stop - result.part.start,
        }

    def figures(self, result: IdentifiedMoves, logs: Sequence[Source], name: str) -> list[Figure]:
        """Return all figures of one log of moves; their names begin with `name`."""
        flat = result.fit.problem.flat
        apart = "joint.stiffness" in flat and not flat["joint.locked"]  # a separate cart, whose speed must be measured
        friction = [_friction(result, name)] if not apart or cart(result.log) is not None else []
        return [
            _force(result, name),
            _traces(result, name),
            _residual(result, name),
            *friction,
            *_profiles(result, name),
        ]

    def prediction_sentence(self, prediction: SimulatedLog) -> str:
        """Say how well another log is predicted, by relative errors of its signals.

        The sentence also says how far the simulation of machines drawn from the estimates lies apart.
        """
        errors, apart = prediction.errors, prediction.apart
        farthest = f"differs from it by {percent(apart)} of the position" if np.isfinite(apart) else "runs away"
        return (
            f"relative errors of position {percent(errors.position, 3)}, velocity {percent(errors.velocity, 3)}, "
            f"acceleration {percent(errors.acceleration, 3)}, force {percent(errors.force, 3)}; of "
            f"{MACHINES_DRAWN} machines drawn from the intervals, and from the ranges of what is not "
            f"identified, the farthest {farthest}."
        )

    def prediction_figures(self, log: Log, prediction: SimulatedLog, number: int) -> list[Figure]:
        """Draw another log as measured and as simulated; `number` is that of the log."""
        caption = (
            f"{log.name}: simulated with the values identified from the other logs; relative error of the position "
            f"{percent(prediction.errors.position, 3)}, of the force {percent(prediction.errors.force, 3)}."
        )
        panels = record_panels(log, prediction.part, prediction.simulated)
        return [Figure(f"identify_prediction{number}", f"Predicted: {log.name}", caption, panels)]

    def claims(self, course: Course) -> str | None:
        """Return why a log holds moves; None if it does not."""
        return course.moves

    def doubts(self, result: IdentifiedMoves) -> Sequence[str]:
        """List the doubts about the log and its fit."""
        return result.quality.doubts

    def contradicted(self, result: IdentifiedMoves) -> Sequence[str]:
        """Return the tables of the stage file that a log contradicts: the controller if its force is another."""
        return ["controller"] if result.replay is not None and result.replay.refutes else []

    def failed(self, result: IdentifiedMoves) -> bool:
        """Tell whether the model does not explain the log."""
        return result.quality.rejected or result.quality.failed

    def warnings(self, result: IdentifiedMoves) -> tuple[str, ...]:
        """Return no warnings: doubts say more."""
        return ()

    def prediction_error(self, prediction: SimulatedLog) -> float:
        """Return the relative error of the force."""
        return prediction.errors.force

    def prediction_numbers(self, prediction: SimulatedLog) -> dict[str, Any]:
        """Return the errors of a simulated log for the document, with how far drawn machines lie apart."""
        return {"errors": asdict(prediction.errors), "machines_within_intervals": prediction.apart}


KIND = MovesKind()
