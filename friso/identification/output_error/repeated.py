"""How far off a fit that follows a log comes out: repeated on simulated logs of the machine it made, whose truth is
known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from friso.identification.logs.log import Log
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.output_error.problem import Problem, blur_of, tracking
from friso.identification.output_error.refine import refine_fit
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.readings.common import digit_of
from friso.identification.spread import CONFIDENCE
from friso.intervals import COVERAGE
from friso.progress import Progress


def as_far_off_as_repeated(
    once: OutputErrorFit, log: Log, part: slice, bandwidth: float, noise: float, progress: Progress
) -> OutputErrorFit:
    """Widen a fit to a log to what fits to simulated logs of the fitted machine are off by.

    The stage followed `part` of the log; `noise` [N] is that of its force, and `bandwidth` [Hz] that of its motion.
    Noise of the position blurs where a stage breaks away, and noise of the force breaks it away early or late: what the
    stage that follows makes of that is no error about the fitted values that a Jacobian could tell, but one to one side
    (parametric bootstrap: Efron, Tibshirani 1993, chapter 6).

    A fit that leaves more than those to the simulated logs do is off by as much more than they are: noise that has led
    it away, as that of a force in coarse digits does, moves the machine it made less than it moved the true one.
    """
    settings = OutputErrorSettings.current()
    free = np.isin(np.arange(len(once.inner)), once.free)
    again = [
        refine_fit(
            [problem],
            once.inner[None],
            free[None],
            settings.iterations_of_a_repetition,
            settings.cost_share_of_refinement,
        )
        for problem in _simulated_logs(once, log, part, bandwidth, noise, progress)
    ]
    off = np.sqrt(np.mean([(fit.inner[0] - once.inner)[free] ** 2 for fit in again], axis=0))
    off = off * float(student.ppf(CONFIDENCE, settings.repetitions_of_a_fit)) / COVERAGE
    usual = float(np.mean([fit.cost[0] for fit in again]))
    off *= np.sqrt(max(1.0, once.cost / usual)) if 0 < usual < np.inf else 1.0
    return once.with_deviations(np.maximum(off, once.deviation))


def late_by_a_sample(fit: OutputErrorFit) -> OutputErrorFit:
    """Widen the damping of the bristles by what one sample of delay does to it.

    That is for a stage that followed a log which it does not explain to its noise: what holds it to the log knows no
    better when it breaks away, and a delay passes for damping, times the stiffness.
    """
    names = [parameter.name for parameter in fit.problem.parameters]
    places = {names[number]: place for place, number in enumerate(fit.free)}
    if not {"friction.bristle_stiffness", "friction.bristle_damping"} <= places.keys():
        return fit
    late = fit.value("friction.bristle_stiffness") * fit.problem.inputs.sample_time
    covariance = fit.covariance.copy()
    place = places["friction.bristle_damping"]
    covariance[place, place] += (late / fit.value("friction.bristle_damping") / COVERAGE) ** 2
    return replace(fit, covariance=covariance)


def _simulated_logs(
    once: OutputErrorFit, log: Log, part: slice, bandwidth: float, noise: float, progress: Progress
) -> Iterator[Problem]:
    """Yield problems like that of a fit, of simulated logs whose truth is the fitted machine.

    Their force is that of the log and of the controller that held the stage to it, their position is the stage's own,
    and either has the log's noise; a force in digits coarser than its noise is rounded to these.
    """
    settings = OutputErrorSettings.current()
    problem = once.problem
    record, rng = problem.record(once.inner), np.random.default_rng(settings.seed_of_repetitions)
    measured = log["position"][part]
    blur, digit = blur_of(measured, problem.inputs.reference), digit_of(log["force"][part])
    for number in range(settings.repetitions_of_a_fit):
        progress(number, settings.repetitions_of_a_fit, "moves: the same fit of simulated logs")
        signals = {role: values.copy() for role, values in log.signals.items()}
        signals["position"][part] = record.position + blur * rng.standard_normal(len(measured))
        force = problem.inputs.force + record.force
        rounded = 0 < noise <= digit / np.sqrt(12)
        signals["force"][part] = (
            np.round(force / digit) * digit if rounded else force + noise * rng.standard_normal(len(measured))
        )
        like = tracking(problem.flat, replace(log, signals=signals), part, problem.parameters, bandwidth)
        level = len(like.sharper) - len(problem.sharper)
        like = like.held_to(level - 1) if level else like
        yield replace(like, inputs=replace(like.inputs, held=problem.inputs.held))
