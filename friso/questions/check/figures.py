"""Draw the figures of `friso check` and `friso simulate` as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import xarray as xr

from friso.axis import axis_shown
from friso.equations.motion import last_corner
from friso.hunting import Case, Cycle
from friso.hunting.criteria import COUNTED_ABOVE, COUNTED_AFTER, PEAK_RULE
from friso.hunting.measures import BANDS
from friso.shown.drawing.figure import (
    BLUE,
    GREY,
    INK,
    LIGHT,
    ORANGE,
    PINK,
    SKY,
    Array,
    Axis,
    Band,
    Dash,
    Figure,
    Limit,
    Markers,
    Panel,
    Series,
)
from friso.shown.motion_words import ShownCase, band_text, shown_cases


def trace_of(item: ShownCase) -> xr.Dataset:
    """Return the time response of a case that was run."""
    assert item.case.trace is not None  # check_figures let no other through
    return item.case.trace


def samples(trace: xr.Dataset, name: str) -> Array:
    """Return a variable of a time response as an array of numbers, in its own unit."""
    return np.asarray(trace[name].values, dtype=float)


def common_range(arrays: Sequence[Array], least: float = 0.0) -> tuple[float, float] | None:
    """Return a range that holds all finite data with a margin, at least `least` wide.

    Returns None if the range would be empty.
    """
    gathered = np.concatenate([np.empty(0), *arrays])
    finite = gathered[np.isfinite(gathered)]
    if finite.size == 0 or max(np.ptp(finite), least) == 0:
        return None
    low, high = float(finite.min()), float(finite.max())
    margin = max(0.06 * (high - low), (least - (high - low)) / 2)
    return low - margin, high + margin


def subject(cases: Sequence[ShownCase]) -> str:
    """Return the name of the stage, as figures show it."""
    return str(cases[0].case.stage.name)


SHARES = {"force_p": ("P", SKY), "force_i": ("I", ORANGE), "force_d": ("D", PINK)}

LEAST_DEVIATION = 1e-9  # [m] lower end of the logarithmic settling panel: below any sensor of such a stage
SHOWN_PERIODS = 4  # number of hunting periods that the figure of force terms shows


def check_figures(cases: Mapping[str, Case]) -> tuple[Figure, ...]:
    """Return every figure for which a check has data, the most telling first.

    Without time responses, there are none.
    """
    with_trace = [item for item in shown_cases(cases) if item.case.trace is not None]
    if not with_trace:
        return ()
    motion = (_overview(with_trace), _shares(with_trace), _joint(with_trace), _friction(with_trace))
    cycles = return_map_figure(with_trace), cycle_figure(with_trace)
    return tuple(figure for figure in (_settling_figure(with_trace), *cycles, *motion) if figure.panels)


def response_figure(trace: xr.Dataset) -> Figure:
    """Draw error, position, force and joint deflection over one whole run; the error shows hunting."""
    time = samples(trace, "time")
    reference = Series(time, samples(trace, "reference"), "reference", GREY, "dashed")
    position = Series(time, samples(trace, "position"), "position", BLUE)
    moved = Panel("Position", _TIME, Axis("Position", "m"), (reference, position))
    panels: list[Panel] = []
    stands = _at_stand(trace)
    for name, title in (
        ("error", "Error"),
        ("force", "Actuator force"),
        ("joint_deflection", "Joint deflection"),
    ):
        if name in trace:
            values = samples(trace, name)
            line = Series(time, values, title.lower(), BLUE)
            view = common_range([values[stands]], least=2 * min(BANDS)) if name == "error" else None
            panels.append(Panel(title, _TIME, Axis(title, str(trace[name].attrs["units"]), view), (line,)))
    panels.insert(1, moved)
    caption = (
        "The whole run; the error is the reference minus the position, at the scale of what follows the move: the move "
        "itself is cut off."
    )
    return Figure("response", "Time response", caption, tuple(panels), subject=str(trace.attrs.get("name", "")))


def _at_stand(trace: xr.Dataset) -> np.ndarray:
    """Mark the later half of each standstill of the reference, shape (n,).

    Standstills shorter than a tenth of the run are left out. Without any, the later half of the run is marked.
    """
    reference = samples(trace, "reference")
    count = len(reference)
    corners = np.unique(np.concatenate([[0], np.flatnonzero(np.diff(reference)) + 1, [count]]))
    late = np.zeros(count, bool)
    for begin, end in pairwise(corners.tolist()):
        if end - begin >= 0.1 * count:
            late[(begin + end) // 2 : end] = True
    return late if late.any() else np.arange(count) >= count // 2


_TIME = Axis("Time", "s")


def _settling_figure(cases: list[ShownCase]) -> Figure:
    """Draw the deviation after the move with its counted peaks, and how it settles.

    The figure is like Fig. 5 of the thesis.
    """
    start, end = _window(cases)
    lines, peaks = [], []
    for item in cases:
        time, deviation = _cut(item, _deviation(item), start, end)
        lines.append(Series(time, deviation, item.label, item.colour))
        if len(item.case.peak_times):
            label = f"counted peaks, {item.label.lower()}: {item.case.peaks}"
            peaks.append(Markers(item.case.peak_times, item.case.peak_heights, label, item.colour, "triangle"))
    limits = (Limit((COUNTED_ABOVE,), "peaks count above", GREY, "dotted"),) if peaks else ()
    # A stage that stays within the finest band shows as a line, not as a screenful of solver noise.
    view = common_range([line.y for line in lines], least=2 * min(BANDS))
    zoom = Panel(
        f"From {start:.4g} s on: deviation from the reference",
        Axis("Time", "s", (start, end)),
        Axis("Deviation", "m", view),
        tuple(lines),
        tuple(peaks),
        limits,
    )
    counted = f" Peaks are counted as in the thesis (Sec. 3.2.2): {PEAK_RULE}." if peaks else ""
    caption = (
        f"Hunting appears as a deviation that keeps coming back; so does a long transient, for a while.{counted} "
        "Below: the size of the deviation over the whole run, on a logarithmic scale that ends at 1 nm; a stage that "
        "hunts never stays under the lines."
    )
    caption = axis_shown().text(caption)
    return Figure("settled", "Does it hunt?", caption, (zoom, _settling(cases)), subject=subject(cases))


def _settling(cases: list[ShownCase]) -> Panel:
    """Draw the size of the deviation over the whole run with the settling bands.

    The scale is logarithmic, so that both the move and the standstill are seen.
    """
    lines = []
    for item in cases:
        size = np.maximum(np.abs(_deviation(item)), LEAST_DEVIATION)
        lines.append(Series(samples(trace_of(item), "time"), size, item.label, item.colour))
    largest = max(
        (float(np.max(line.y[np.isfinite(line.y)], initial=LEAST_DEVIATION)) for line in lines), default=LEAST_DEVIATION
    )
    dashes: tuple[Dash, ...] = ("dotted", "dashed")
    own = zip(dict.fromkeys(cases[0].case.bands), dashes, strict=False)
    bands = tuple(Limit((band,), band_text(band), INK, dash) for band, dash in own)
    axis = Axis("|Deviation|", "m", (LEAST_DEVIATION, max(2 * largest, 1e-3)), log=True)
    return Panel("Whole run: size of the deviation", _TIME, axis, tuple(lines), limits=bands)


def _overview(cases: list[ShownCase]) -> Figure:
    """Draw reference, position and actuator force over the whole run.

    The joint as given, locked and free stand side by side.
    """
    view = common_range([samples(trace_of(item), "position") for item in cases], least=2 * min(BANDS))
    panels = []
    for item in cases:
        time = samples(trace_of(item), "time")
        series = (
            Series(time, samples(trace_of(item), "reference"), "reference", LIGHT, width=4.0),
            Series(time, samples(trace_of(item), "position"), "position", item.colour),
        )
        panels.append(Panel(f"{item.label}: reference and position", _TIME, Axis("Position", "m", view), series))
    bounds = _force_limit(cases)
    arrays = [samples(trace_of(item), "force") for item in cases]
    view = common_range([*arrays, *(np.array(bound.values) for bound in bounds)])
    for item, force in zip(cases, arrays, strict=True):
        series = (Series(samples(trace_of(item), "time"), force, "force", item.colour),)
        title = f"{item.label}: actuator force"
        panels.append(Panel(title, _TIME, Axis("Force", "N", view), series, limits=bounds))
    caption = "The whole run. On this scale cases that differ by millimetres may look the same."
    return Figure("overview", "The motion", caption, tuple(panels), len(cases), subject(cases))


def _force_limit(cases: list[ShownCase]) -> tuple[Limit, ...]:
    """Return the controller's force limit if a run takes more than half of it; empty otherwise.

    A distant limit would flatten all curves.
    """
    bound = cases[0].case.stage.controller.force_limit
    forces = np.abs(np.concatenate([samples(trace_of(item), "force") for item in cases]))
    if bound is None or not np.any(forces[np.isfinite(forces)] > bound / 2):
        return ()
    return (Limit((-float(bound), float(bound)), "force limit"),)


def _shares(cases: list[ShownCase]) -> Figure:
    """Draw the P, I and D terms of the actuator force after the move (thesis, Fig. 13).

    All panels have one scale.
    """
    start, end = _window(cases)
    periods = [item.case.period for item in cases if item.case.period and np.isfinite(item.case.period)]
    if periods:
        start = max(start, end - SHOWN_PERIODS * max(periods))
    panels = []
    for item in cases:
        trace = trace_of(item)
        named = [(name, *SHARES[name]) for name in SHARES if name in trace and np.any(samples(trace, name))]
        lines = [(*share, 1.8) for share in named] + ([("force", "total", INK, 0.9)] if named else [])
        series = tuple(
            Series(*_cut(item, samples(trace_of(item), name), start, end), label, colour, width=width)
            for name, label, colour, width in lines
        )
        if series:
            panels.append(Panel(item.label, Axis("Time", "s", (start, end)), Axis("Force", "N"), series))
    limits = common_range([line.y for panel in panels for line in panel.series])
    panels = [Panel(panel.title, panel.x, Axis("Force", "N", limits), panel.series) for panel in panels]
    caption = (
        "While the stage sticks, the integral share grows until the friction breaks away; the others follow "
        "the error. A share that is zero throughout is left out."
    )
    return Figure("shares", "What the controller does", caption, tuple(panels), subject=subject(cases))


def _joint(cases: list[ShownCase]) -> Figure:
    """Draw the joint's deflection with its stroke limits, where the joint is free."""
    start, end = _window(cases)
    panels = []
    for item in cases:
        joint = item.case.stage.joint
        if joint is None or joint.stroke is None or joint.locked or "joint_deflection" not in trace_of(item):
            continue
        stroke, deflection = float(joint.stroke), samples(trace_of(item), "joint_deflection")
        limits = (Limit((-stroke, stroke), "limiter touches"),)
        time = samples(trace_of(item), "time")
        axis = Axis("Joint deflection", "m")
        trace = Series(time, deflection, item.label, item.colour)
        after = Series(*_cut(item, deflection, start, end), item.label, item.colour)
        panels += [
            Panel("Whole run", _TIME, axis, (trace,), limits=limits),
            Panel(f"From {start:.4g} s on", Axis("Time", "s", (start, end)), axis, (after,), limits=limits),
        ]
    caption = "Deflection of the stage against the cart. Beyond the dashed lines the stroke limiter carries load."
    return Figure("joint", "The joint", caption, tuple(panels), columns=2, subject=subject(cases))


def _friction(with_trace: list[ShownCase]) -> Figure:
    """Draw friction against velocity and displacement of the cart.

    If a stage hunts, only the settled part of the runs is drawn; otherwise the whole runs.
    """
    cases = [item for item in with_trace if "friction_force" in trace_of(item)]
    hunting = any(item.case.peaks for item in cases)
    start, end = _window(with_trace) if hunting else (-np.inf, np.inf)
    part = f"From {start:.4g} s on." if hunting else "The whole run."
    caption = f"{part} The friction force opposes the velocity of the cart. A case at rest is a single point."
    along = "Cart position from the target" if hunting else "Cart position"
    panels = []
    for title, quantity, unit, name in (
        ("Against velocity", "Cart velocity", "m/s", "cart_velocity"),
        ("Against displacement", along, "m", "cart_position"),
    ):
        lines = []
        for item in cases:
            values = samples(trace_of(item), name)
            if hunting and name == "cart_position":
                values = values - samples(trace_of(item), "reference")[-1]
            force = _cut(item, samples(trace_of(item), "friction_force"), start, end)[1]
            lines.append(Series(_cut(item, values, start, end)[1], force, item.label, item.colour, width=1.2))
        if lines:
            panels.append(_loops(title, Axis(quantity, unit), Axis("Friction force", "N"), lines))
    return Figure("friction", "The friction", caption, tuple(panels), columns=2, subject=subject(with_trace))


def _loops(title: str, x: Axis, y: Axis, lines: list[Series]) -> Panel:
    """Return a panel of lines; a line far narrower in x than the widest becomes a point."""
    spans = [_span(line.x) for line in lines]
    rest = [span <= 0.01 * max(spans) for span in spans]
    points = [
        Markers(line.x[-1:], line.y[-1:], f"{line.label}: at rest", line.colour)
        for line, resting in zip(lines, rest, strict=True)
        if resting
    ]
    moving = [line for line, resting in zip(lines, rest, strict=True) if not resting]
    return Panel(title, x, y, tuple(moving), tuple(points))


def _window(cases: list[ShownCase]) -> tuple[float, float]:
    """Return begin and end [s] of the settled part of the runs.

    The settled part begins where peaks are counted, or half-way through a shorter run.
    """
    end = max(float(samples(trace_of(item), "time")[-1]) for item in cases)
    return (COUNTED_AFTER if end > COUNTED_AFTER else end / 2), end


def _deviation(item: ShownCase) -> Array:
    """Return position minus reference [m] over the run of a case, shape (n,)."""
    return samples(trace_of(item), "position") - samples(trace_of(item), "reference")


def _cut(item: ShownCase, values: Array, start: float, end: float) -> tuple[Array, Array]:
    """Return the times [s] between start and end [s] of a case's run, and the `values` at them."""
    time = samples(trace_of(item), "time")
    inside = (time >= start) & (time <= end)
    return time[inside], values[inside]


def _span(values: Array) -> float:
    """Return the largest minus the smallest finite value; 0 if there is none."""
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else 0.0


VIEW_FACTOR = 2.2  # reach of a return map's axes, relative to the largest cycle
MAP_STARTS, FOLLOWED_LANDINGS = 401, 300  # number of distances followed by a return map, and number of swings followed
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
    largest = max([cycle.amplitude for cycle in hunting.cycles], default=np.max(distances[beyond]) / VIEW_FACTOR)
    reach = VIEW_FACTOR * float(largest)
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
    starts = np.linspace(0.0, reach, MAP_STARTS)
    at = starts
    for _ in range(FOLLOWED_LANDINGS):
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
