"""Decide how much to smooth a log's position, and how its force ran between samples.

The force was either held or interpolated. Each choice is the one with which the model fits the log better.
"""

from __future__ import annotations

from dataclasses import replace

from scipy.stats import chi2

from friso.identification.output_error.fit import OutputErrorFit, polished_again
from friso.identification.output_error.settings import settings


def with_smoothness_settled(fit: OutputErrorFit) -> OutputErrorFit:
    """Refit with the position of a log smoothed less and less, as long as the fit improves.

    Smoothing blurs the instants of break-away: for stick-slip motion without noise, a Stribeck exponent of 2 was fitted
    as 1.47 and the bristles a fifth too soft. Too little smoothing passes the noise of the position on to the force.
    """
    while fit.problem.sharper:
        sharper = polished_again(fit, fit.problem.held_to(0))
        if sharper.cost >= fit.cost:
            break
        fit = sharper
    return fit


def with_force_settled(fit: OutputErrorFit, noise: float) -> OutputErrorFit:
    """Fit the force of a log as held and as interpolated between samples; return the better fit.

    A held force acts half a sample later, which shifts bristle damping by half a sample times the bristle stiffness.
    The worse fit is ruled out if it is clearly worse, and the better one explains the force to its `noise` [N].
    Otherwise both stay possible, and intervals allow for both.
    """
    problem = fit.problem
    other = next((inputs for inputs in problem.unsettled if inputs.held != problem.inputs.held), None)
    if other is None:
        return fit
    sharper = tuple(inputs for inputs in problem.unsettled if inputs is not other)
    turned = tuple(replace(inputs, held=other.held) for inputs in sharper)
    swapped = polished_again(fit, replace(problem, inputs=other, unsettled=(problem.inputs, *turned)))
    better, worse = sorted((fit, swapped), key=lambda one: one.cost)
    if better.left > settings.noise_ratio_of_a_closed_fit * problem.noise_left(noise) or worse.cost < better.cost * (
        1 + chi2.ppf(settings.probability_of_an_effect, 1) / better.independent
    ):
        return better
    return polished_again(better, replace(better.problem, unsettled=turned if better is swapped else sharper))
