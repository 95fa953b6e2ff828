"""Moves, with a reference or without: mass, friction and constant force, and the joint if it shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.errors import InputError
from friso.identification.combine import Correlated
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import inverse_model
from friso.identification.kind import AnalysisSettings, ExperimentKind, Predictor, Prior, Source, of_one
from friso.identification.logs.log import ROLES, Log
from friso.identification.moves import IdentifiedMoves, SimulatedLog, check_roles, identify_moves, simulated_log
from friso.identification.output_error.problem import why_continuous
from friso.identification.settings import experiment_settings
from friso.identification.stage_file import made_up
from friso.stage import Stage

WITHOUT_CONTROLLER = (
    "without the machine's own controller the simulated stage follows the logged position; with it (--stage) the "
    "intervals may be narrower, and more may be identified, as far as that loop explains the record"
)

WITHOUT_REFERENCE = (
    "without the logged reference the controller of the stage file cannot be simulated: the simulated stage follows "
    "the logged position"
)

OUT_OF_STEP = (
    "with the controller of the stage file the simulated machine gets out of step with the log, which was therefore "
    "fitted along its position; if the machine does not hunt, its controller may be another (check the gains and the "
    "mass it is tuned for), or noise of its encoder moves it, which is not simulated"
)

ALIKE = (
    "a play of about {} between motor and load would look like these bristles: their stiffness holds for an axis "
    "without play"
)


def _analyse(whole: Log, prior: Prior, settings: AnalysisSettings) -> IdentifiedMoves:
    """Analyse a log of moves, using results of other experiments.

    The machine's own loop is simulated if the user gave the stage and the log has a reference.
    """
    if prior.from_user:
        check_roles(whole, ("force",))
    log = whole.excerpt(experiment_settings.samples_of_moves)
    flat = prior.flat(log) if _in_newtons(log) else made_up(log, inverse_model(log, settings.bandwidth)).flat()
    start = {**flat, **{key: estimate.value for key, estimate in prior.estimates.items() if key in flat}}
    own_loop = prior.from_user and "reference" in log
    return identify_moves(log, start, own_loop, settings.bandwidth, settings.progress, settings.tell)


def _in_newtons(log: Log) -> bool:
    """Tell whether the force of a log is in newtons."""
    return log.unit("force") == ROLES["force"]


def _around(log: Log) -> Stage | None:
    """Make a stage with assumed values for a log; None if its force is not in newtons."""
    part = log.excerpt(experiment_settings.samples_of_moves)
    return made_up(part, inverse_model(part)) if _in_newtons(log) else None


def _estimates(result: IdentifiedMoves, stage: Stage | None) -> tuple[Estimate, ...]:
    """Return estimates of stage-file keys if the force was in newtons, else none."""
    return result.estimates if _in_newtons(result.log) else ()


def _correlated(result: IdentifiedMoves, estimates: Sequence[Estimate]) -> Correlated:
    """Return the determined estimates with their correlation in the fit; none without estimates."""
    return (result.correlated, result.correlation) if estimates else ((), np.zeros((0, 0)))


def _notes(results: Sequence[IdentifiedMoves], stage: Stage | None) -> list[str]:
    """List notes on simplified drives, on loops not simulated, and on logs used only in part."""
    loops = [result for result in results if result.loop] if stage is not None else []
    reasons = [why_continuous(stage.flat(), result.log.sample_time) for result in loops if stage is not None]
    followed = any(result.loop is None for result in results)
    long, count = [result.log for result in results if result.log.is_excerpt], experiment_settings.samples_of_moves
    return [
        *(sentence for sentence in dict.fromkeys(reasons) if sentence),
        *([WITHOUT_CONTROLLER if stage is None else WITHOUT_REFERENCE] if followed else []),
        *(f"{result.log.name}: {OUT_OF_STEP}" for result in loops if not result.fit.problem.closed),
        *_play_that_looks_alike([result.estimates for result in results]),
        *(
            f"{log.name}: of a log this long {count} samples are used, {_span(log)}, where it moves most"
            for log in long
        ),
    ]


def _play_that_looks_alike(answers: Sequence[Sequence[Estimate]]) -> list[str]:
    """Return a note on the play that would pass for the identified bristles; none without bristles.

    Its width is about their bend before sliding, Coulomb friction over stiffness: plays of two to four bends of the
    true bristles were fitted to the noise by softer ones (docs/evidence/identify.md). The widest of several is told.
    """
    values = [{one.name: one.value for one in estimates if one.determined} for estimates in answers]
    needed = "friction.coulomb", "friction.bristle_stiffness"
    bends = [one[needed[0]] / one[needed[1]] for one in values if one.keys() >= {*needed}]
    return [ALIKE.format(f"{max(bends) * 1e6:.2g} um")] if bends else []


def _span(log: Log) -> str:
    """Return the time span of a log in words."""
    start, end = (round(float(log.time[k]), 9) + 0.0 for k in (0, -1))  # not -2e-16 s
    return f"{start:.6g} to {end:.6g} s"


def _predict(result: IdentifiedMoves, log: Log, prior: Prior, settings: AnalysisSettings) -> SimulatedLog | None:
    """Simulate another log; None if it lacks a reference, or the own loop is not simulated."""
    if "reference" not in log or result.loop is None:
        return None
    return simulated_log(result, log, prior.flat(log) or None)


def _check_prediction(logs: Sequence[Source], other: Log, prior: Prior) -> None:
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


KIND = ExperimentKind[IdentifiedMoves](
    of_one(_analyse),
    _estimates,
    _correlated,
    after=("frequency", "steps"),
    claims=lambda course: course.moves,
    foreign=("force", "disturbance"),
    around=_around,
    notes=_notes,
    predictor=Predictor("a log with a reference beside moves", _predict, _check_prediction),
    doubts=lambda result: result.quality.doubts,
    failed=lambda result: result.quality.rejected or result.quality.failed,
)
