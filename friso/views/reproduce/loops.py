"""The figures of the thesis that show plants and open loops over the frequency, from a reproduction to plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from friso.views.bode.figures import ResponseCurve, bode_figures, phases, size
from friso.views.drawing.colours import ramp
from friso.views.drawing.figure import INK, Axis, Figure, Limit, Panel, Series

if TYPE_CHECKING:
    from friso.studies.thesis import Reproduction
    from friso.studies.thesis.linear import CrossoverLoops

_SHOWN = {
    "7": (
        "bode_plant",
        "plant in the four limit cases",
        "Stage position over actuator force in the limit cases of Table 1, and mass lines. A touched limiter acts "
        "beside the joint; dashed: one behind the other, as Table 1 prints it.",
    ),
    "8": (
        "bode_speeds",
        "open loop at prescribed speeds of the cart",
        "The loop tuned to 8 Hz while the cart slides at a prescribed speed, limiter free. Dashed: not stable.",
    ),
}
"""Figures of the linear analysis that are figures of the thesis, by its number: name, title and caption."""


def loop_figures(reproduction: Reproduction) -> dict[str, Figure]:
    """The figures by their number in the thesis; none where no linear analysis was made."""
    if reproduction.linear is None or reproduction.bode is None:
        return {}
    by_name = {figure.name: figure for figure in bode_figures(reproduction.bode)}
    figures = {
        number: replace(
            by_name[name], name=f"figure-{number}", title=f"Figure {number}: {title}", caption=caption, subject=""
        )
        for number, (name, title, caption) in _SHOWN.items()
    }
    return figures | {"22": _locked_loops(reproduction.linear.locked), "23": _free(reproduction.linear.free)}


def _locked_loops(loops: CrossoverLoops) -> Figure:
    caption = "The loop of the model with its joint locked, sliding, at the crossovers at which the thesis measured it."
    return _of_loops("22", "open loop, joint locked, at several crossovers", caption, loops)


def _free(loops: CrossoverLoops) -> Figure:
    caption = "The loop of the model with its joint free, sliding, the controller tuned for the whole mass."
    return _of_loops("23", "open loop, joint free, tuned to 8 Hz", caption, loops)


def _of_loops(number: str, title: str, caption: str, loops: CrossoverLoops) -> Figure:
    """Magnitude and phase of the loops at every crossover."""
    shades = ramp(len(loops.curves) + 1)  # its last shade is light
    curves = [
        ResponseCurve(response, f"tuned to {crossover:g} Hz", shade)
        for (crossover, response), shade in zip(loops.curves.items(), shades, strict=False)
    ]
    panels = _panels(loops.omega / (2 * np.pi), curves)
    return Figure(f"figure-{number}", f"Figure {number}: {title}", caption, panels)


def _panels(hertz: np.ndarray, curves: Sequence[ResponseCurve]) -> tuple[Panel, Panel]:
    x = Axis("Frequency", "Hz", (float(hertz[0]), float(hertz[-1])), log=True)
    above = tuple(Series(hertz, size(curve.response), curve.label, curve.colour) for curve in curves)
    turns = zip(curves, phases([curve.response for curve in curves]), strict=True)
    below = tuple(Series(hertz, turn, "", curve.colour) for curve, turn in turns)
    return (
        Panel("", x, Axis("Magnitude", "dB", step=30.0), above, limits=(Limit((0.0,), "", INK),)),
        Panel("", x, Axis("Phase", "°", step=90.0), below, limits=(Limit((-180.0,), "", INK),)),
    )
