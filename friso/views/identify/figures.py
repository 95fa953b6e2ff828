"""The figures of an identification: of all intervals, of each experiment, and of the logs predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friso.identify.logs.log import Log
from friso.identify.method import Experiment, Identification, Prediction
from friso.identify.moves import Moves
from friso.identify.response.analysis import Bench
from friso.views.drawing.figure import BLUE, ORANGE, Axis, Figure, Markers, Panel, Series, Symbol
from friso.views.identify.friction_figures import friction_figures
from friso.views.identify.moves_figures import moves_figures, record_panels
from friso.views.identify.numbers import percent
from friso.views.identify.response_figures import response_figures
from friso.views.identify.words import labels, ordered

SHORT = {
    "masses.cart": "cart",
    "masses.stage": "stage",
    "friction.coulomb": "Coulomb",
    "friction.viscous_asymmetry": "asymm.",
    "friction.stribeck_velocity": "Stribeck",
    "friction.bristle_stiffness": "bristle k",
    "friction.bristle_damping": "bristle d",
    "bias.cart": "constant",
    "bias.stage": "constant",
    "joint.stiffness": "joint k",
    "joint.damping": "joint d",
}
"""Keys of the stage file in the room that there is beside an axis."""


def identify_figures(found: Identification, predictions: Sequence[Prediction]) -> list[Figure]:
    """All figures, in the order in which they are read."""
    figures, subject = _intervals(found), found.stage.name if found.stage else ""
    for each, label in zip(found.experiments, labels(found), strict=True):
        figures += _of(each, label)
    figures += [figure for number, each in enumerate(predictions, 1) for figure in _prediction(each, number)]
    return [replace(figure, subject=subject) for figure in figures]


def _of(it: Experiment, label: str) -> list[Figure]:
    """The figures of one experiment."""
    log = it.logs[0]
    if isinstance(it.result, Moves):
        return moves_figures(it.result, label)
    if isinstance(it.result, Bench):
        return response_figures(it.result, label)
    return friction_figures(it.result, log, label) if isinstance(log, Log) else []


def _intervals(found: Identification) -> list[Figure]:
    """How well every key is known: half its interval over the middle of it."""
    known = [
        each for each in ordered(found.estimates) if np.isfinite([each.low, each.high]).all() and each.high > each.low
    ]
    if len(known) < 2:
        return []
    known = known[::-1]  # the first on top
    half = np.array([each.half_width for each in known])
    middle = np.array([abs(each.value) if each.shown else (each.low + each.high) / 2 for each in known])
    share = 100 * half / np.maximum(np.abs(middle), 1e-3 * half)
    shown = np.array([each.shown for each in known])
    places = np.arange(len(known), dtype=float)
    left = 0.5 * float(share.min())
    stems = [
        Series(np.array([left, x]), np.full(2, y), "", BLUE if ok else ORANGE, width=2.0)
        for x, y, ok in zip(share, places, shown, strict=True)
    ]
    kinds: tuple[tuple[np.ndarray, str, str, Symbol], ...] = (
        (shown, "shown", BLUE, "circle"),
        (~shown, "not shown: the range left", ORANGE, "triangle"),
    )
    points = [
        Markers(share[chosen], places[chosen], label, colour, symbol)
        for chosen, label, colour, symbol in kinds
        if chosen.any()
    ]
    x = Axis("Half the interval, in % of the value", "", (left, 2 * float(share.max())), log=True)
    y = Axis(
        "", "", (-0.6, len(known) - 0.4), words=tuple(SHORT.get(each.name, each.name.split(".")[-1]) for each in known)
    )
    caption = "The shorter, the better known; 100 % and more: not even its sign or its order of magnitude."
    panel = Panel("", x, y, tuple(stems), tuple(points))
    return [Figure("identify_intervals", "How well each quantity is known", caption, (panel,))]


def _prediction(it: Prediction, number: int) -> list[Figure]:
    """Another log simulated; a response has no trace."""
    if it.simulated is None or it.part is None or it.errors is None:
        return []
    caption = (
        f"{it.log.name}: simulated with what was found in the other logs; relative error of the position "
        f"{percent(it.errors.position)}, of the force {percent(it.errors.force)}."
    )
    panels = record_panels(it.log, it.part, it.simulated)
    return [Figure(f"identify_prediction{number}", f"Predicted: {it.log.name}", caption, panels)]
