"""Write the table of leaf springs: the name of each quantity, and its text for each model."""

from __future__ import annotations

import math
from collections.abc import Callable

from friso.leaf_springs.beams import BothModels
from friso.leaf_springs.mechanism import Evaluation, Mode
from friso.quantities import percent
from friso.shown.text import NOTHING, with_unit

INTERFERES = "interferes"
"""Label of a mode that disturbs control: both actuator and sensor couple to it."""

UNKNOWN = "unknown"
"""Text in place of an unknown property of the material."""


def rows(flexure: BothModels) -> list[tuple[str, list[str]]]:
    """Return the rows: stiffnesses, eigenfrequencies, and the loads that the leaves can bear."""
    models = list(flexure.models.values())
    above, below = (
        [(name, [text(evaluation) for evaluation in models]) for name, text in part.items()]
        for part in (_STIFF, _BORNE)
    )
    return [*above, *_modes(flexure), *below]


def newtons_per(value: float, length: str) -> str:
    """Write a stiffness [N/m] per `length`: "mm" for drives or "µm" for supports, as is usual."""
    return f"{_plain(value / {'mm': 1e3, 'µm': 1e6}[length])} N/{length}"


def megapascals(value: float) -> str:
    """Write a stress [Pa] in MPa."""
    return f"{_plain(value / 1e6)} MPa" if math.isfinite(value) else UNKNOWN


def margin_factor(value: float) -> str:
    """Write a margin as a factor: "2.5 times"; unknown if it is not finite."""
    return f"{_plain(value)} times" if math.isfinite(value) else UNKNOWN


def _plain(value: float) -> str:
    """Write a number to three digits without a unit."""
    return with_unit(value, "").strip()


def _modes(flexure: BothModels) -> list[tuple[str, list[str]]]:
    """Return a row for each mode that a model knows, in the order of frequency.

    The drive mode comes first: the stage moves along the direction in which it is driven.
    """
    named = [(evaluation, evaluation.named_modes) for evaluation in flexure.models.values()]
    frequencies: dict[str, float] = {}
    for _, modes in named:
        frequencies = {name: mode.frequency for name, mode in modes.items()} | frequencies
    drive = next(iter(named[0][1]))
    names = [drive, *sorted(frequencies.keys() - {drive}, key=frequencies.__getitem__)]
    return [(f"Mode: {name}", [_mode(evaluation, modes.get(name)) for evaluation, modes in named]) for name in names]


def _mode(evaluation: Evaluation, mode: Mode | None) -> str:
    """Write the frequency of a mode, and whether it interferes with control."""
    if mode is None:
        return NOTHING
    return with_unit(mode.frequency, "Hz") + (f" ({INTERFERES})" if evaluation.interferes(mode) else "")


_STIFF: dict[str, Callable[[Evaluation], str]] = {
    "Drive stiffness": lambda evaluation: newtons_per(evaluation.drive[0], "mm"),
    "Drive stiffness under the load": lambda evaluation: newtons_per(evaluation.loaded_drive, "mm"),
    "Deviation from linear over the stroke": lambda evaluation: percent(evaluation.nonlinearity),
    "Support stiffness x, straight": lambda evaluation: newtons_per(evaluation.support_x[0], "µm"),
    "Support stiffness x, at full stroke": lambda evaluation: newtons_per(evaluation.support_x[-1], "µm"),
    "Support stiffness y, straight": lambda evaluation: newtons_per(evaluation.support_y[0], "µm"),
    "Support stiffness y, at full stroke": lambda evaluation: newtons_per(evaluation.support_y[-1], "µm"),
}
_BORNE: dict[str, Callable[[Evaluation], str]] = {
    "Largest stress at full stroke": lambda evaluation: megapascals(evaluation.stress),
    "Concentration factor at the clamp": lambda evaluation: f"{evaluation.mechanism.stress_concentration:g}",
    "Stress at the clamp": lambda evaluation: megapascals(evaluation.clamp_stress),
    "Margin to yield": lambda evaluation: margin_factor(evaluation.yield_margin),
    "Margin to fatigue": lambda evaluation: margin_factor(evaluation.fatigue_margin),
    "Shortening at full stroke": lambda evaluation: with_unit(evaluation.shortening, "m"),
    "Buckling load": lambda evaluation: with_unit(evaluation.buckling, "N"),
    "Buckling load over the load": lambda evaluation: margin_factor(evaluation.buckling_margin),
}
