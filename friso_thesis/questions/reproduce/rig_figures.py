"""Draw the thesis's figures of its rig in its own arrangement, from friso's virtual rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from friso.questions.map.words import QUIET
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    VERMILLION,
    Axis,
    Figure,
    Limit,
    Map,
    Panel,
    Series,
    phases,
)
from friso_thesis.studies.identification.steps import LOW_PASS_OF_STEPS
from friso_thesis.studies.thesis.experiments import (
    BUILT,
    GRID,
    LINE,
    MOVES,
    ON_RAILS,
    RESPONSE_FREQUENCIES,
    SLIPS,
    SPEEDY,
    STANDSTILL,
    STATIC_RANGE,
    STEPPED,
    Experiments,
)

_TIME = Axis("Time", "s")
_COLOURS = (BLUE, VERMILLION, GREEN, ORANGE, PINK)
WEIGHED_MASS, FITTED_MASS = 1.7, 2.5
ZOOM_RANGE = 2e-3  # [m] about the end of the move, Fig. 24B


def rig_figures(experiments: Experiments, made: frozenset[str]) -> dict[str, Figure]:
    """Return the figures of the experiments that were `made`, by their number in the thesis."""
    drawn: dict[str, Figure] = {}
    for need, draw in _DRAWN.items():
        if need in made:
            drawn |= draw(experiments)
    return drawn


def _mass_lines(experiments: Experiments) -> dict[str, Figure]:
    """Draw the plant with the joint locked, at several friction levels, with two mass lines.

    The mass lines are those of the mass weighed, and of the one that the thesis reads off.
    """
    hertz = np.array(RESPONSE_FREQUENCIES)
    omega = 2 * np.pi * hertz
    line = experiments.locked_line
    places = line.magnitude / (WEIGHED_MASS * omega**2)
    turns = np.degrees(line.phase) - 180

    def mass_line(mass: float, colour: str) -> Series:
        return Series(hertz, 1 / (mass * omega**2), f"mass line, {mass:g} kg", colour, "dashed")

    average = Series(hertz, np.nanmean(places, axis=0), "average of the places", INK, width=2.0)
    average_turn = Series(hertz, np.nanmean(turns, axis=0), "", INK, width=2.0)
    colours = [_COLOURS[number % len(_COLOURS)] for number in range(len(places))]
    static = np.linspace(*STATIC_RANGE, len(places))
    single, single_turns = (
        tuple(Series(hertz, row, name.format(f), c) for row, f, c in zip(rows, static, colours, strict=True))
        for rows, name in ((places, "static friction {:.2g} N"), (turns, ""))
    )
    lines = mass_line(WEIGHED_MASS, BLUE), mass_line(FITTED_MASS, VERMILLION)
    caption = (
        "Position over force of the simulated rig, joint locked, with friction, by sines of one force; the mass "
        "weighed and the one that the thesis reads off its own."
    )
    return {
        "17": Figure(
            "figure-17", "Figure 17: plant, joint locked", caption, _plant(hertz, (average, *lines), (average_turn,))
        ),
        "29": Figure(
            "figure-29",
            "Figure 29: plant, joint locked, at several places",
            "The same, place by place, which differ in their friction; the thesis shows ten identifications.",
            _plant(hertz, single, single_turns),
        ),
    }


def _plant(hertz: np.ndarray, above: tuple[Series, ...], below: tuple[Series, ...]) -> tuple[Panel, Panel]:
    """Return panels of magnitude and phase of position over force, with curves to draw."""
    axis = Axis.of_frequency(hertz)
    return (
        Panel("", axis, Axis("Magnitude", "m/N", log=True, prefixed=False), above),
        Panel("", axis, Axis("Phase", "°"), below, limits=(Limit((-180.0,), "", INK),)),
    )


def _free_plant(experiments: Experiments) -> dict[str, Figure]:
    """Draw the measured plant with its joint free, with the fitted line of its mass."""
    plant = experiments.rig_loops.plant
    response = plant.averaged
    hertz = response.frequency
    between = np.geomspace(*plant.band, 2)
    lines = (
        Series(hertz, np.abs(response.response), "position over force", BLUE),
        Series(
            between,
            1 / (plant.mass.value * (2 * np.pi * between) ** 2),
            f"mass line, {plant.mass.value:.2g} kg",
            VERMILLION,
            "dashed",
        ),
    )
    (turn,) = phases([response.response])
    caption = (
        "Position over force of the virtual rig as built, joint free, from one excitation of the closed loop; its "
        f"first mode is at {plant.first_mode:.3g} Hz, the mass line is read between its modes."
    )
    panels = _plant(hertz, lines, (Series(hertz, turn, "", BLUE),))
    return {"18": Figure("figure-18", "Figure 18: plant, joint free", caption, panels)}


def _steps(experiments: Experiments) -> dict[str, Figure]:
    """Draw position, reference and force over time in the experiment with steps of the joint."""
    log, read = experiments.joint_steps.log, experiments.joint_steps.result
    place = (
        Series(log.time, log["position"], "position", BLUE),
        Series(log.time, log["reference"], "reference", INK, "dotted"),
    )
    force = (
        Series(log.time, log["force"], "force", VERMILLION, width=0.8),
        Series(read.time, read.force, f"low-passed at {LOW_PASS_OF_STEPS:g} Hz", INK),
    )
    panels = Panel("", _TIME, Axis("Position", "m"), place), Panel("", _TIME, Axis("Force", "N"), force)
    caption = "Steps of 0.3 mm of the simulated rig, its cart fixed: the position is the deflection of the joint."
    return {"19": Figure("figure-19", "Figure 19: stiffness of the joint", caption, panels)}


def _slow(experiments: Experiments) -> dict[str, Figure]:
    """Draw a slow motion over time: position, deflection of the joint, and velocity of the cart."""
    run = experiments.slow_motion[len(experiments.slow_motion) // 2]
    log = run.log
    cart = log["cart_position"]
    velocity = np.gradient(cart, log.time)
    panels = (
        Panel(
            "",
            _TIME,
            Axis("Position", "m"),
            (
                Series(log.time, log["position"], "position", BLUE),
                Series(log.time, log["reference"], "reference", INK, "dotted"),
            ),
        ),
        Panel(
            "",
            _TIME,
            Axis("Relative position", "m"),
            (Series(log.time, log["position"] - cart, "stage over cart", GREEN),),
        ),
        Panel("", _TIME, Axis("Velocity of the cart", "m/s"), (Series(log.time, velocity, "cart", VERMILLION),)),
    )
    caption = f"Slow motion of the simulated rig at {run.speed * 1e3:g} mm/s, the joint free: it sticks and slips."
    return {"20": Figure("figure-20", "Figure 20: static friction", caption, panels)}


def _speeds(experiments: Experiments) -> dict[str, Figure]:
    """Draw the force over position at constant speeds, with the joint free and locked."""
    panels = []
    for title, runs in zip(("joint free", "joint locked"), experiments.constant_speed, strict=True):
        log = runs.log
        lines = tuple(
            Series(log["reference"][part], log["force"][part], f"{velocity * 1e3:.3g} mm/s", colour, width=0.8)
            for velocity, part, colour in zip(runs.velocities, log.segments, _COLOURS, strict=False)
        )
        panels.append(Panel(title, Axis("Position", "m"), Axis("Force", "N"), lines))
    caption = "Force of the rig as built at constant speed over 150 mm, there and back: friction varies along its rail."
    return {"21": Figure("figure-21", "Figure 21: force at constant speed", caption, tuple(panels), 2)}


def _moves(experiments: Experiments) -> dict[str, Figure]:
    """Draw the position over time in single moves, with the joint locked and free."""
    traces = experiments.traces
    crossovers = sorted({crossover for _, crossover in traces.moves})
    first = crossovers[0]
    lines = tuple(
        Series(traces.time, traces.moves[joint, first] + traces.distance, f"joint {joint}", colour)
        for joint, colour in (("locked", VERMILLION), ("free", BLUE))
    )
    zoom = traces.distance - ZOOM_RANGE, traces.distance + ZOOM_RANGE
    reference = (Limit((traces.distance,), "reference", INK, "dotted"),)
    several = tuple(
        Series(traces.time, traces.moves["locked", crossover], f"{crossover:.3g} Hz", colour)
        for crossover, colour in zip(crossovers, _COLOURS, strict=False)
    )
    near = Axis("Position minus reference", "m", (-ZOOM_RANGE, ZOOM_RANGE))
    return {
        "24": Figure(
            "figure-24",
            f"Figure 24: move at {first:g} Hz",
            "One move of the virtual rig, on one rail: the position that the drive logs, and the same about its end.",
            (
                Panel("A: position", _TIME, Axis("Position", "m"), lines),
                Panel("B: about its end", _TIME, Axis("Position", "m", zoom), lines, limits=reference),
            ),
            2,
        ),
        "25": Figure(
            "figure-25",
            "Figure 25: moves at several crossovers, joint locked",
            "The same move of the virtual rig on the same rail: what remains after it.",
            (Panel("", _TIME, near, several),),
        ),
    }


def _grid(experiments: Experiments) -> dict[str, Figure]:
    grid = experiments.grid
    hunts = np.where(np.isfinite(grid.share), grid.share > 0, np.nan).T
    field = Map(
        grid.strokes,
        grid.crossovers,
        hunts,
        "Counted peaks on some rail (1) or on none (0)",
        "",
        colours=(QUIET, VERMILLION),
    )
    panel = Panel("", Axis("Stroke", "m", log=True), Axis("Crossover", "Hz"), (), maps=(field,))
    caption = (
        f"Moves of the virtual rig, joint free, each cell on up to {len(grid.rails)} rails, until one has counted "
        "peaks. Crossovers are tried from the highest down to the limit, and at the lowest. The thesis shows counts "
        "of one rail."
    )
    note = "White cells were not tried: what they show cannot move the limit."
    return {"26": Figure("figure-26", "Figure 26: stroke and crossover on the rig", caption, (panel,), note=note)}


def _cycles(experiments: Experiments) -> dict[str, Figure]:
    """Draw hunting cycles with the joint locked, on an even rail and on one that varies."""
    traces = experiments.traces
    late = traces.time >= traces.time[-1] / 2
    lines = tuple(
        Series(traces.time[late], position[late], name, colour)
        for (name, position), colour in zip(traces.rails.items(), (BLUE, VERMILLION), strict=True)
    )
    panel = Panel("", _TIME, Axis("Position minus reference", "m"), lines)
    caption = "Cycles at 8 Hz, joint locked: on an even rail, as the thesis simulates, and on one that varies."
    return {"27": Figure("figure-27", "Figure 27: cycles on an even and on a varied rail", caption, (panel,))}


def _standstill(experiments: Experiments) -> dict[str, Figure]:
    """Draw the position at a standstill over time, with the joint free and locked."""
    result = experiments.standstill
    lines = tuple(
        Series(*result.traces[case], f"joint {case}", colour, width=0.8)
        for case, colour in (("free", BLUE), ("locked", VERMILLION))
        if case in result.traces
    )
    panel = Panel("", _TIME, Axis("Position minus reference", "m"), lines, limits=(Limit((0.0,), "", GREY),))
    caption = "The true position of the virtual rig at a standstill, all disturbances; these are friso's assumption."
    title = f"Figure 28: standstill at {result.crossover:.3g} Hz"
    return {"28": Figure("figure-28", title, caption, (panel,))}


_DRAWN: Mapping[str, Callable[[Experiments], dict[str, Figure]]] = {
    LINE: _mass_lines,
    BUILT: _free_plant,
    STEPPED: _steps,
    SLIPS: _slow,
    SPEEDY: _speeds,
    MOVES: _moves,
    GRID: _grid,
    ON_RAILS: _cycles,
    STANDSTILL: _standstill,
}
"""Functions that draw an experiment, by its name."""
