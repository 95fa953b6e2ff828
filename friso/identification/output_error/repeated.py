"""Estimate the error of a fit by repeating it on simulated logs of the fitted machine, whose true values are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from friso.identification.logs.log import Log
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.output_error.parameters import BRISTLES
from friso.identification.output_error.problem import Problem, blur_of, tracking
from friso.identification.output_error.refine import refine_fit
from friso.identification.output_error.settings import settings
from friso.identification.readings.common import digit_of, noise_of
from friso.identification.settings import identification_settings
from friso.identification.spread import UPPER_PROBABILITY, binned
from friso.intervals import NORMAL_COVERAGE
from friso.progress import Progress


def as_far_off_as_repeated(
    once: OutputErrorFit, log: Log, part: slice, bandwidth: float, noise: float, progress: Progress
) -> OutputErrorFit:
    """Widen a fit to a log by the errors of fits to simulated logs of the fitted machine.

    The stage followed `part` of the log; `noise` [N] is that of its force, and `bandwidth` [Hz] that of its motion.
    Noise of position and force shifts break-aways, which biases the fit to one side in a way that a Jacobian does not
    show (parametric bootstrap: Efron, Tibshirani 1993, chapter 6).

    If the residual of the log exceeds the residuals of the simulated logs, errors are scaled up by the ratio.
    """
    free, rng = np.isin(np.arange(len(once.inner)), once.free), np.random.default_rng(settings.seed_of_repetitions)
    again = []
    for number in range(settings.repetitions_of_a_fit):
        progress(number, settings.repetitions_of_a_fit, "moves: the same fit of simulated logs")
        like = simulated_log(once.problem, once.inner, log, part, bandwidth, noise, rng)
        until = settings.iterations_of_a_repetition, settings.cost_share_of_refinement
        again.append(refine_fit([like], once.inner[None], free, *until, slopes=once.slopes))
    off = np.sqrt(np.mean([(fit.inner[0] - once.inner)[free] ** 2 for fit in again], axis=0))
    off = off * float(student.ppf(UPPER_PROBABILITY, settings.repetitions_of_a_fit)) / NORMAL_COVERAGE
    usual = float(np.mean([fit.cost[0] for fit in again]))
    off *= np.sqrt(max(1.0, once.cost / usual)) if 0 < usual < np.inf else 1.0
    return once.with_deviations(np.maximum(off, once.deviation))


def late_by_a_sample(fit: OutputErrorFit) -> OutputErrorFit:
    """Widen the damping of the bristles by the effect of one sample of delay.

    A delay looks like bristle damping of delay times bristle stiffness. The widening is for a stage that followed a log
    without explaining it to its noise. A fit without both bristle parameters stays as it is.
    """
    if not {*BRISTLES} <= {*fit.fitted}:
        return fit
    late = fit.value("friction.bristle_stiffness") * fit.problem.inputs.sample_time
    covariance = fit.covariance.copy()
    place = fit.fitted.index("friction.bristle_damping")
    covariance[place, place] += (late / fit.value("friction.bristle_damping") / NORMAL_COVERAGE) ** 2
    return fit.with_covariance(covariance)


def simulated_log(
    problem: Problem, inner: np.ndarray, log: Log, part: slice, bandwidth: float, noise: float, rng: np.random.Generator
) -> Problem:
    """Return the problem of fitting a simulated log of a machine with the fitted numbers `inner`.

    The simulated log has the logged force plus the guiding controller's, and the stage's own position, both with the
    errors of the logged ones in `part` of the log. `noise` [N] is the force's; a force whose resolution is coarser than
    its noise has errors of rounding instead. `bandwidth` [Hz] is the motion's.
    """
    record, speed = problem.record(inner), np.abs(problem.inputs.velocity)
    digit = digit_of(log["force"][part])
    signals = {role: values.copy() for role, values in log.signals.items()}
    signals["position"][part] = _measured(record.position, log, part, problem, rng)
    force = problem.inputs.force + record.force
    rounded = 0 < noise <= digit / np.sqrt(12)
    rough = _rounding(log["force"][part], speed, digit, rng) if rounded else noise * rng.standard_normal(len(force))
    signals["force"][part] = force + rough
    like = tracking(problem.flat, replace(log, signals=signals), part, problem.parameters, bandwidth)
    level = len(like.sharper) - len(problem.sharper)
    like = like.held_to(level - 1) if level else like
    return replace(like, inputs=replace(like.inputs, held=problem.inputs.held))


def _measured(position: np.ndarray, log: Log, part: slice, problem: Problem, rng: np.random.Generator) -> np.ndarray:
    """Return simulated positions [m], (n,), as the sensor of a log would measure them.

    Digits coarser than the noise round them, as an encoder does. Otherwise errors are white; those of a position that
    was integrated from a velocity are the integral of the velocity's.
    """
    logged, white = log["position"][part], rng.standard_normal(len(position))
    digit = digit_of(logged)
    if log.is_integrated:
        return position + np.cumsum(noise_of(log["velocity"][part]) * white) * log.sample_time
    if digit > 0 and noise_of(logged) <= digit / np.sqrt(12):
        return logged[0] + digit * np.rint((position - logged[0]) / digit)
    return position + blur_of(logged, problem.inputs.reference) * white


def _rounding(force: np.ndarray, speed: np.ndarray, digit: float, rng: np.random.Generator) -> np.ndarray:
    """Sample errors of rounding [N], (n,), of a force that was logged in coarse digits [N].

    Forces at one level and one `speed` [m/s] are rounded alike, in both directions, so that errors last as long as a
    motion is steady and do not average out as noise does. Rounding the force of the fit again would not show them: its
    levels are those that the rounded log has.
    """
    levels = np.stack([np.rint(np.abs(force) / digit), binned(speed, identification_settings.bins_of_place_and_speed)])
    alike = np.unique(levels, axis=1, return_inverse=True)[1].ravel()
    return digit * np.sign(force) * (rng.random(alike.max() + 1) - 0.5)[alike]
