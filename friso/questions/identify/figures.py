"""Draw an identification: all intervals, each experiment, and the logs predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friso.identification.kinds import KINDS
from friso.identification.method import Identification, Prediction
from friso.questions.identify.words import labels, ordered
from friso.shown.drawing.figure import BLUE, ORANGE, Axis, Figure, Markers, Panel, Series, Symbol

SHORT = {
    "masses.cart": "cart",
    "masses.stage": "stage",
    "friction.coulomb": "Coulomb",
    "friction.viscous_asymmetry": "asymm.",
    "friction.stribeck_velocity": "Stribeck v",
    "friction.stribeck_exponent": "exponent",
    "friction.bristle_stiffness": "bristle k",
    "friction.bristle_damping": "bristle d",
    "bias.cart": "constant",
    "bias.stage": "constant",
    "joint.stiffness": "joint k",
    "joint.damping": "joint d",
}
"""Short names of keys for the limited room beside an axis."""


def identify_figures(identification: Identification, predictions: Sequence[Prediction]) -> list[Figure]:
    """Return all figures, in the order in which they are read."""
    figures, subject = _intervals(identification), identification.stage.name if identification.stage else ""
    for experiment, label in zip(identification.experiments, labels(identification), strict=True):
        figures += KINDS[experiment.kind].figures(experiment.result, experiment.logs, f"identify_{label}")
    for number, prediction in enumerate(predictions, 1):
        figures += KINDS[prediction.kind].prediction_figures(prediction.log, prediction.result, number)
    return [replace(figure, subject=subject) for figure in figures]


def _intervals(identification: Identification) -> list[Figure]:
    """Draw the half-width of every key's interval, relative to its value.

    For a key without a value, the half-width is relative to the middle of the interval.
    """
    bounded = [
        estimate
        for estimate in ordered(identification.estimates)
        if np.isfinite([estimate.low, estimate.high]).all() and estimate.high > estimate.low
    ]
    if len(bounded) < 2:
        return []
    bounded = bounded[::-1]  # the first on top
    half = np.array([estimate.half_width for estimate in bounded])
    middle = np.array(
        [abs(estimate.value) if estimate.determined else (estimate.low + estimate.high) / 2 for estimate in bounded]
    )
    share = np.minimum(100 * half / np.maximum(np.abs(middle), 1e-3 * half), 100.0)
    determined, lost = np.array([estimate.determined for estimate in bounded]), share >= 100
    visible = determined & ~lost
    places = np.arange(len(bounded), dtype=float)
    left = 0.5 * float(share.min())
    stems = [
        Series(np.array([left, x]), np.full(2, y), "", BLUE if ok else ORANGE, width=2.0)
        for x, y, ok in zip(share[~lost], places[~lost], visible[~lost], strict=True)
    ]
    kinds: tuple[tuple[np.ndarray, str, str, Symbol], ...] = (
        (visible, "shown", BLUE, "circle"),
        (~determined & ~lost, "not shown: the range left", ORANGE, "triangle"),
        (lost, "none found", ORANGE, "cross"),
    )
    points = [
        Markers(share[chosen], places[chosen], label, colour, symbol)
        for chosen, label, colour, symbol in kinds
        if chosen.any()
    ]
    x = Axis("Half the interval, in % of the value", "", (left, 150.0), log=True)
    y = Axis(
        "",
        "",
        (-0.6, len(bounded) - 0.4),
        words=tuple(SHORT.get(estimate.name, estimate.name.partition(".")[2]) for estimate in bounded),
    )
    caption = "Shorter is better known. A cross at 100 %: not even the sign or order of magnitude is."
    panel = Panel("", x, y, tuple(stems), tuple(points))
    return [Figure("identify_intervals", "How well each quantity is known", caption, (panel,))]
