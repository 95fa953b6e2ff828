"""Draw the figures of the thesis in its own arrangement, from a reproduction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from friso.hunting.criteria import COUNTED_ABOVE, COUNTED_AFTER, PEAK_RULE, counted_peaks
from friso.quantities import percent
from friso.questions.bode.figures import ResponseCurve, bode_figures, magnitude
from friso.questions.check.figures import SHARES
from friso.questions.map.figures import map_panel
from friso.questions.map.findings import statement
from friso.shown.drawing.figure import GREY, INK, VERMILLION, Axis, Figure, Limit, Markers, Panel, Series, phases, ramp
from friso_thesis.questions.reproduce.rig_figures import rig_figures
from friso_thesis.studies.thesis.experiments import BUILT
from friso_thesis.studies.thesis.judges.shares import NARROW, WIDE
from friso_thesis.studies.thesis.studies import STUDIES, ThesisStudy

if TYPE_CHECKING:
    import xarray as xr

    from friso_thesis.studies.rig.experiments.frf import MeasuredLoop
    from friso_thesis.studies.thesis.linear.loops import CrossoverLoops
    from friso_thesis.studies.thesis.reproduce import Reproduction

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


_TITLES = {
    "11": "Path; crossover and mass (joint locked)",
    "12": "Friction forces; alpha and beta (joint locked)",
    "14": "Isolator: stiffness and limiter damping, each with the stroke",
    "15": "Isolator: masses; friction forces",
    "16": "Isolator: crossover and stroke at two stiffnesses",
}
MARKER = (
    "The marker is friso's evaluation point: crossover, friction, stiffness and masses as the thesis prints them; "
    "alpha, beta, path, stroke and limiter damping by friso's choice, since its own markers are not printed in numbers."
)
"""Note below each map."""

_SHOWN_FROM = 6.0  # [s] the return move of Fig. 5 and 13 is over by then


def reproduction_figures(reproduction: Reproduction) -> dict[str, Figure]:
    """Return the figures whose studies were run, by their number in the thesis and in its order."""
    figures = {**_in_time(reproduction), **loop_figures(reproduction)}
    if reproduction.experiments is not None:
        figures |= rig_figures(reproduction.experiments, reproduction.experimented)
    figures |= {number: _maps(reproduction, number) for number in _TITLES}
    return {number: figures[number] for number in sorted(figures, key=int) if figures[number].panels}


def _maps(reproduction: Reproduction, number: str) -> Figure:
    """Return the maps of one figure side by side, each with its evaluation point."""
    panels, statements, zeros = [], [], []
    for study in STUDIES.values():
        if study.panel[:-1] != number or study.name not in reproduction.maps:
            continue
        letter = study.panel[-1]
        for title, runs in _runs_shown(reproduction, study, letter).items():
            panels.append(_with_edges(map_panel(runs, "peaks", study.marker, title), reproduction, study))
            statements.append(f"{title}. {statement(runs, 'peaks')}".replace("\n", " "))
        zeros += [f"{letter}: {study.zeros}"] if study.zeros else []
    zeros.append(MARKER)
    if number == "14" and reproduction.tolerances:
        verdicts, counts = reproduction.changed
        zeros.append(
            f"B: at the thesis's relative tolerance {percent(verdicts, 3)} of the cells have counted peaks where the "
            f"tight one has none, or the other way round, and {percent(counts, 3)} another count."
        )
    return Figure(
        f"figure-{number}",
        f"Figure {number}: {_TITLES[number]}",
        " ".join((*statements, *zeros)),
        tuple(panels),
        2,
        note="\n".join(statements),
    )


def _with_edges(panel: Panel, reproduction: Reproduction, study: ThesisStudy) -> Panel:
    """Return the map with the curves on which hunting ends."""
    figures = reproduction.cycles.get(study.name)
    if figures is None:
        return panel
    lines = tuple(Series(edge.x, edge.y, "edge of hunting", VERMILLION, width=2.2) for edge in figures.edges)
    return replace(panel, series=(*panel.series, *lines))


def _runs_shown(reproduction: Reproduction, study: ThesisStudy, letter: str) -> Mapping[str, xr.Dataset]:
    """Return the maps of a study by title, which begins with the `letter` of their panel.

    A study has one map, but that of Fig. 14B has one for each tolerance.
    """
    if study.panel == "14B":
        return {f"{letter}: {study.title}, rtol {rtol:g}": runs for rtol, runs in reproduction.tolerances.items()}
    return {f"{letter}: {study.title}": reproduction.maps[study.name]}


def _in_time(reproduction: Reproduction) -> dict[str, Figure]:
    """Return the figures of single runs over time (Fig. 5, 13) that were made, by number."""
    made = reproduction.responses.keys()
    figures = {"5": _response(reproduction)} if "locked" in made else {}
    return figures | ({"13": _shares(reproduction)} if {WIDE, NARROW} <= made else {})


def _response(reproduction: Reproduction) -> Figure:
    """Draw the position of the locked rig after the return move, with the counted peaks."""
    response = reproduction.responses["locked"]
    trace = response.trace
    time = trace["time"].values
    late = time >= _SHOWN_FROM
    deviation = (trace["position"] - trace["reference"]).values
    turns = [trace[name].values for name in ("turning_time", "turning_deviation")]
    (peaks,) = counted_peaks(turns[0][None], turns[1][None], np.array([turns[0].size]))
    markers = ()
    if peaks.any():
        markers = (Markers(turns[0][peaks], turns[1][peaks], f"counted peaks: {peaks.sum()}", INK, "triangle"),)
    panel = Panel(
        "Position after the return move",
        Axis("Time", "s", (_SHOWN_FROM, float(time[-1]))),
        Axis("Position", "m"),
        (Series(time[late], deviation[late], "joint locked", VERMILLION),),
        markers,
        (Limit((COUNTED_ABOVE,), "peaks count above", GREY, "dotted"),),
    )
    caption = f"The rig with its joint locked. Peaks count {PEAK_RULE}."
    return Figure("figure-5", "Figure 5: position of the locked rig after the return move", caption, (panel,))


def _shares(reproduction: Reproduction) -> Figure:
    """Draw the P, I and D terms of the locked rig's force, at a wide and a narrow friction gap.

    The gap is static minus Coulomb friction.
    """
    panels = []
    for name in (WIDE, NARROW):
        trace = reproduction.responses[name].trace
        time = trace["time"].values
        late = time >= COUNTED_AFTER
        lines = [(key, *look, 1.8) for key, look in SHARES.items()] + [("force", "total", INK, 0.9)]
        series = tuple(
            Series(time[late], trace[key].values[late], label, colour, width=width)
            for key, label, colour, width in lines
        )
        panels.append(Panel(f"F_s 4 N, {name}", Axis("Time", "s"), Axis("Force", "N"), series))
    caption = f"Shares of the controller's force from {COUNTED_AFTER:g} s on, joint locked."
    return Figure("figure-13", "Figure 13: PID actions at two gaps of the friction forces", caption, tuple(panels))
