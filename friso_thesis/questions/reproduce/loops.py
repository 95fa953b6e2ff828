"""Draw the thesis's figures of plants and open loops over frequency, from a reproduction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from friso.questions.bode.figures import ResponseCurve, bode_figures, magnitude, phases
from friso.shown.drawing.colours import ramp
from friso.shown.drawing.figure import Axis, Figure, Limit, Panel, Series
from friso.shown.drawing.palette import INK
from friso_thesis.studies.thesis.experiments import BUILT

if TYPE_CHECKING:
    from friso.studies.rig.experiments.frf import MeasuredLoop
    from friso_thesis.studies.thesis import Reproduction
    from friso_thesis.studies.thesis.linear import CrossoverLoops

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
"""Figures of the linear analysis that are also figures of the thesis: name, title and caption by the thesis's
number."""


def loop_figures(reproduction: Reproduction) -> dict[str, Figure]:
    """Return the figures by their number in the thesis; none without a linear analysis."""
    if reproduction.linear is None or reproduction.bode is None:
        return {}
    by_name = {figure.name: figure for figure in bode_figures(reproduction.bode)}
    figures = {
        number: replace(
            by_name[name], name=f"figure-{number}", title=f"Figure {number}: {title}", caption=caption, subject=""
        )
        for number, (name, title, caption) in _SHOWN.items()
    }
    experiments = reproduction.experiments
    built = experiments.rig_loops if experiments and BUILT in reproduction.experimented else None
    return figures | {
        "22": _locked_loops(reproduction.linear.locked, built.locked if built else ()),
        "23": _free(reproduction.linear.free, (built.free,) if built else ()),
    }


def _locked_loops(loops: CrossoverLoops, measured: tuple[MeasuredLoop, ...]) -> Figure:
    caption = "The loop of the model with its joint locked, sliding, at the crossovers at which the thesis measured it."
    return _of_loops("22", "open loop, joint locked, at several crossovers", caption, loops, measured)


def _free(loops: CrossoverLoops, measured: tuple[MeasuredLoop, ...]) -> Figure:
    caption = "The loop of the model with its joint free, sliding, the controller tuned for the whole mass."
    return _of_loops("23", "open loop, joint free, tuned to 8 Hz", caption, loops, measured)


def _of_loops(
    number: str, title: str, caption: str, loops: CrossoverLoops, measured: tuple[MeasuredLoop, ...]
) -> Figure:
    """Draw magnitude and phase of the loops at every crossover, for model and measured rig."""
    ends = loops.omega[0] / (2 * np.pi), loops.omega[-1] / (2 * np.pi)
    of_model = [ResponseCurve(response, f"tuned to {tuned:g} Hz", "") for tuned, response in loops.curves.items()]
    columns = [_panels("model", ends, [(loops.omega / (2 * np.pi), curve) for curve in of_model])]
    seen = [loop for loop in measured if loop.measured]
    if seen:
        caption += MEASURED_CAPTION
        of_rig = [ResponseCurve(loop.response.response, f"tuned to {loop.tuned:.3g} Hz", "") for loop in seen]
        lines = [loop.response.frequency for loop in seen]
        columns.append(_panels("rig as built", ends, list(zip(lines, of_rig, strict=True))))
    panels = tuple(panel for row in zip(*columns, strict=True) for panel in row)
    return Figure(f"figure-{number}", f"Figure {number}: {title}", caption, panels, len(columns))


MEASURED_CAPTION = (
    " Beside it as measured on the virtual rig as built, with sampling, delay, noise and friction: a multisine is "
    "added to the force while the loop is closed."
)


def _panels(title: str, ends: tuple[float, float], curves: Sequence[tuple[np.ndarray, ResponseCurve]]) -> list[Panel]:
    """Return panels of magnitude and phase of curves between the `ends` [Hz].

    All curves have the same number of frequencies [Hz].
    """
    x = Axis("Frequency", "Hz", (float(ends[0]), float(ends[1])), log=True)
    shades = ramp(len(curves) + 1)  # leave out its last shade, which is light
    responses = [curve.response for _, curve in curves]
    above, below = [], []
    for (hertz, curve), turn, shade in zip(curves, phases(responses), shades, strict=False):
        above.append(Series(hertz, magnitude(curve.response), curve.label, shade))
        below.append(Series(hertz, turn, "", shade))
    return [
        Panel(title, x, Axis("Magnitude", "dB", step=30.0), tuple(above), limits=(Limit((0.0,), "", INK),)),
        Panel("", x, Axis("Phase", "°", step=90.0), tuple(below), limits=(Limit((-180.0,), "", INK),)),
    ]
