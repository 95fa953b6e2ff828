"""Draw hunting cycles: the return map that shows whether one exists, and the cycle itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.equations.motion import last_corner
from friso.hunting import Cycle
from friso.questions.check.traces import common_range, samples, subject, trace_of
from friso.shown.cases import ShownCase
from friso.shown.drawing.figure import Array, Axis, Band, Dash, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import GREY, INK

_VIEW = 2.2  # reach of a return map's axes, relative to the largest cycle
_STARTS, _FOLLOWED = 401, 300  # number of distances followed by a return map, and number of swings followed
_BASIN = "#fbe3d6"  # a pale vermillion, the colour of hunting
_LEAST_DRAWN = 0.01  # smallest return, and difference of cart and stage, that is drawn, relative to the swing
_DASHES: dict[bool, Dash] = {True: "solid", False: "dashed"}
_WORDS = {True: "attracts", False: "repels"}


def return_map_figure(cases: list[ShownCase]) -> Figure:
    """Draw how far each swing reaches against the one before, in one panel per case.

    A thin line shows the swings of the stage's own motion. A case whose swings were not followed has no panel.
    """
    panels = tuple(panel for item in cases for panel in _return_map(item))
    caption = (
        "Each turning point of a stage that sticks and then swings past its target (curve: from the positive side), "
        "against the one before: where the curve crosses the dashed diagonal lies a hunting cycle, which attracts if "
        "the curve is less steep there than the diagonal. The thin line is this motion after its last move, off the "
        "curve while it turns without sticking. Shaded are the distances from which swings end in hunting."
    )
    hunting = [(item.label, item.case.judgement.hunting) for item in cases]
    without = [(label, search.reason) for label, search in hunting if search.reason and not search.cycles]
    caption += "".join(f" {label}: no cycle, as {reason}." for label, reason in without)
    uneven = [label for label, search in hunting if search.attracting and not _mirrored(search.cycles)]
    caption += "".join(
        f" {label}: nothing is shaded, as swings to one side differ from those to the other." for label in uneven
    )
    return Figure("return-map", "Does the next swing reach as far?", caption, panels, 2, subject(cases))


def _return_map(item: ShownCase) -> list[Panel]:
    """Return the panel of a stage's return map; none if swings were not followed.

    The panel shows the map, the diagonal, the swings of the stage's own motion, the cycles, and the basin of hunting.
    """
    hunting = item.case.judgement.hunting
    if hunting.returns is None:
        return []
    distances, returns = hunting.returns.distances[0], hunting.returns.returns[0]
    beyond = returns > _LEAST_DRAWN * distances
    if not beyond.any():
        return []
    largest = max([cycle.amplitude for cycle in hunting.cycles], default=np.max(distances[beyond]) / _VIEW)
    reach = _VIEW * float(largest)
    swings = np.repeat(_swings(item), 2)
    series = [
        Series(np.array([0.0, reach]), np.array([0.0, reach]), "", GREY, "dashed"),
        Series(distances, np.where(beyond, returns, np.nan), "next swing", item.colour, width=2.2),
    ]
    if swings.size > 2:
        series.append(Series(swings[1:-1], swings[2:], "this motion", INK, width=0.8))
    x, y = Axis("This swing", "m", (0.0, reach)), Axis("Next swing", "m", (0.0, reach))
    basins = _basins(distances, returns, reach) if hunting.attracting and _mirrored(hunting.cycles) else ()
    return [Panel(item.label, x, y, tuple(series), _fixed_points(hunting.cycles), bands=basins)]


def _mirrored(cycles: Sequence[Cycle]) -> bool:
    """Tell whether swings to both sides are alike, as a symmetric cycle shows: one curve is then enough for both."""
    return any(cycle.symmetric for cycle in cycles)


def _basins(distances: Array, returns: Array, reach: float) -> tuple[Band, ...]:
    """Return strips of distances, up to `reach` [m], from which a stage ends in hunting.

    A stage that sticks at one of the `distances` [m] from its reference sticks next at one of the `returns` [m] on the
    other side. Both sides must behave alike. Many swings are followed in this way; a stage that still swings then is
    hunting.
    """
    starts = np.linspace(0.0, reach, _STARTS)
    at = starts
    for _ in range(_FOLLOWED):
        at = np.interp(at, distances, np.maximum(returns, 0.0), left=0.0, right=0.0)
    ends = np.flatnonzero(np.diff((at > 0).astype(int), prepend=0, append=0))
    floor, top = np.zeros(2), np.full(2, reach)
    strips = [starts[[first, after - 1]] for first, after in zip(ends[::2], ends[1::2], strict=True)]
    labels = ["ends in hunting", *[""] * len(strips)]
    return tuple(Band(strip, floor, top, label, _BASIN) for strip, label in zip(strips, labels, strict=False))


def _swings(item: ShownCase) -> Array:
    """Return the sizes of successive swings [m], each to the other side, shape (swings,).

    Only swings after the last corner of the reference count.
    """
    trace = trace_of(item)
    late = samples(trace, "turning_time") > last_corner(item.case.stage.flat())
    turns = samples(trace, "turning_deviation")[late]
    sides = np.split(turns, np.flatnonzero(np.diff(np.sign(turns))) + 1)
    return np.array([np.abs(side).max() for side in sides if side.size])


def _fixed_points(cycles: tuple[Cycle, ...]) -> tuple[Markers, ...]:
    """Return markers of the cycles at their two turning points, attracting ones apart from others.

    If a cycle is symmetric, mirror images are marked as well.
    """
    mirrored = _mirrored(cycles)
    markers = []
    for attracts, label in _WORDS.items():
        position = [samples(cycle.trace, "position") for cycle in cycles if cycle.attracts == attracts]
        x, y = (np.array([np.max(side * array) for array in position]) for side in (1, -1))
        if mirrored:
            x, y = np.concatenate((x, y)), np.concatenate((y, x))
        if x.size:
            markers.append(Markers(x, y, label, INK, "target" if attracts else "cross"))
    return tuple(markers)


def cycle_figure(cases: list[ShownCase]) -> Figure:
    """Draw one period of every cycle over time, and as a loop of velocity over position."""
    panels = tuple(panel for item in cases if item.case.judgement.hunting.cycles for panel in _cycle_panels(item))
    caption = (
        "One period: the stage sticks off its target while the integral action winds up the actuator force, breaks "
        "away, overshoots and sticks on the other side. Motions near a solid cycle end in it; motions near a dashed "
        "one leave it."
    )
    return Figure("cycle", "The hunting cycle", caption, panels, 3, subject(cases))


def _cycle_panels(item: ShownCase) -> list[Panel]:
    """Return panels of a stage's cycles: position and force over time, velocity over position."""
    cycles = item.case.judgement.hunting.cycles
    time = Axis("Time", "s", (0.0, max(cycle.period for cycle in cycles)))
    names = ["stage"] if len(cycles) == 1 else [_WORDS[cycle.attracts] for cycle in cycles]
    lines = [line for cycle, name in zip(cycles, names, strict=True) for line in _positions(cycle, name, item.colour)]
    forces = [_line(cycle, "time", "force", "", item.colour) for cycle in cycles]
    loops = [_line(cycle, "position", "velocity", "", item.colour) for cycle in cycles]
    size = Axis("Position", "m", common_range([line.y for line in lines]))
    return [
        Panel(f"{item.label}: position", time, size, tuple(lines)),
        Panel("Actuator force", time, Axis("Force", "N"), tuple(forces)),
        Panel("Velocity over position", size, Axis("Velocity", "m/s"), tuple(loops)),
    ]


def _positions(cycle: Cycle, label: str, colour: str) -> list[Series]:
    """Return the stage's position, and the cart's where it visibly differs."""
    lines = [_line(cycle, "time", "position", label, colour)]
    if "cart_position" in cycle.trace:
        cart = _line(cycle, "time", "cart_position", "cart", INK)
        if np.max(np.abs(cart.y - lines[0].y)) > _LEAST_DRAWN * cycle.amplitude:
            lines.append(cart)
    return lines


def _line(cycle: Cycle, x: str, y: str, label: str, colour: str) -> Series:
    """Return one signal of a cycle over another, solid if the cycle attracts, dashed if it repels."""
    return Series(samples(cycle.trace, x), samples(cycle.trace, y), label, colour, _DASHES[cycle.attracts])
