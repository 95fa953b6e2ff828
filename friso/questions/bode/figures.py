"""Draw a linear analysis: plant, open loop, Nyquist plot and sensitivity.

Each figure shows the limit cases. Some also show the family: the loop in many states of friction, stuck and sliding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.frequency.bode import COMFORTABLE_MARGIN, Bode, BodeCase, CascadeLoop
from friso.questions.bode.numbers import SERIES, colour, dash, decibels, has_family, has_limiter, label
from friso.shown.drawing.figure import (
    INK,
    LIGHT,
    Array,
    Axis,
    Band,
    Dash,
    Figure,
    Limit,
    Markers,
    Panel,
    Series,
    phases,
    ramp,
)
from friso.shown.text import pretty, with_unit
from friso.stage.tables import moving_mass

QUARTER_TURN = 90.0
"""Distance of ticks on phase axes [deg]: a quarter of a turn."""

LEAST_PHASE = -720.0
"""Lower end of phase axes [deg]; the delay at high frequencies would extend them without end."""

NYQUIST_VIEW = ((-3.0, 1.5), (-1.5, 1.5))
"""Range of the complex plane around -1 that the Nyquist plot shows, real and imaginary."""

DRAWN_LOOP_SIZES = (0.02, 5.0)
"""Range of the loop's size in which members of the family are drawn."""

DRAWN = {True: 40, False: 12}
"""Numbers of family members drawn, of stable (True) and of other loops (False)."""

WIDEST_MAGNITUDES = (-90.0, 90.0)
"""Largest range of open-loop magnitudes [dB] on the axis."""

LEAST_SENSITIVITY = -40.0
"""Lower end of sensitivity axes [dB]."""

WIDTHS = {False: 2.6, True: 1.3}
"""Line widths for a free (False) and a touched limiter (True); both lines are visible where they coincide."""

LOST = "#eeb48f"


def bode_figures(bode: Bode) -> tuple[Figure, ...]:
    """Return all figures in the order in which they are read."""
    return (*first_figures(bode), *_drawn(bode, (_speeds(bode), _nyquist(bode), _sensitivity(bode))))


def first_figures(bode: Bode) -> tuple[Figure, ...]:
    """Return the figures of the limit cases alone, which need less time than all states."""
    return _drawn(bode, (_loop(bode), _plant(bode), *_cascade(bode)))


def _drawn(bode: Bode, figures: tuple[Figure, ...]) -> tuple[Figure, ...]:
    """Write the stage's name on each figure, and drop figures without panels."""
    return tuple(replace(figure, subject=bode.stage.name) for figure in figures if figure.panels)


@dataclass(frozen=True)
class ResponseCurve:
    """A complex frequency response, shape (k,), with the label and the look of its curve."""

    response: np.ndarray
    label: str
    colour: str
    dash: Dash = "solid"
    width: float = 1.4


def magnitude(response: np.ndarray) -> Array:
    """Return the magnitude of a complex response in dB, at each frequency."""
    return 20 * np.log10(np.abs(response))


def _plant(bode: Bode) -> Figure:
    """Draw stage position over actuator force, with lines of pure masses (thesis, Fig. 7)."""
    curves = [_curve(name, case.plant) for name, case in bode.cases.items()]
    sizes = np.concatenate([np.abs(curve.response) for curve in curves])
    axis = Axis("Magnitude", "m/N", (float(sizes.min()) / 2, float(sizes.max()) * 2), log=True, prefixed=False)
    above = _magnitudes(_hertz(bode), curves, axis, np.abs)
    lines = tuple(
        Series(_hertz(bode), 1 / (mass * bode.omega**2), f"mass of {mass:.4g} {pretty('kg')}", INK, style, 0.9)
        for mass, style in zip(_masses(bode), ("dashed", "dotted"), strict=False)
    )
    caption = (
        "Stage position over actuator force for small motions, in the limit cases of Table 1 of the thesis (its Fig. "
        "7), with the mass lines. A stuck cart rests on its bristles, a sliding one sees viscous friction only."
    )
    if has_limiter(bode):
        in_series = any(name.endswith(SERIES) for name in bode.cases)
        dashed = "; dashed: in series, as Table 1 prints it" if in_series else ""
        caption += f" A touched limiter acts in parallel with the joint{dashed}."
    panels = (replace(above, series=(*above.series, *lines)), _phases(_hertz(bode), curves))
    return Figure("bode_plant", "Plant", caption, panels)


def _loop(bode: Bode) -> Figure:
    """Draw the open loop in the limit cases."""
    caption = (
        "The loop cut at the actuator: controller, plant and, if the stage file has one, the drive. The phase margin "
        "is the distance to −180° where the magnitude crosses 0 dB. Points, and numbers beside the names: the last "
        "crossover and its phase margin."
    )
    panels = loop_panels(_hertz(bode), [_loop_of(name, case) for name, case in bode.cases.items()])
    panels = _with_crossings(panels, _hertz(bode), bode)
    return Figure("bode_loop", "Open loop, limit cases", caption, panels)


def _with_crossings(panels: tuple[Panel, ...], hertz: Array, bode: Bode) -> tuple[Panel, ...]:
    """Mark on panels of magnitude and phase the last crossover of every stable case, and its phase margin.

    The legend has the numbers. The phase margin is a line from the loop to the next odd multiple of 180 degrees.
    """
    above, below = panels
    lines, dots, margins = [*above.series], [], []
    for number, (line, case) in enumerate(zip(below.series, bode.cases.values(), strict=True)):
        if not (case.margins.stable and case.margins.crossovers):
            continue
        at = case.margins.crossovers[-1]
        phase = float(np.interp(np.log(at), np.log(hertz), line.y))
        edge = 360.0 * np.round((phase - 180.0) / 360.0) + 180.0
        name = f"{lines[number].label}: {with_unit(at, 'Hz')}, {abs(phase - edge):.0f}°"
        lines[number] = replace(lines[number], label=name)
        dots.append(Markers(np.array([at]), np.zeros(1), "", line.colour))
        margins.append(Series(np.full(2, at), np.array([phase, edge]), "", line.colour, width=2.6))
    return replace(above, series=tuple(lines), markers=tuple(dots)), replace(below, series=(*below.series, *margins))


def _cascade(bode: Bode) -> Iterator[Figure]:
    """Yield the figures of a cascade: the plant of its velocity loop, then each loop opened.

    A drive's own software shows such Bode plots.
    """
    if not bode.cascades:
        return
    from_sliding = sorted(bode.cascades, key=lambda name: name.startswith("stuck"))  # its phase begins at 0
    moved = [_curve(name, bode.cascades[name].plant) for name in from_sliding]
    sizes = np.concatenate([np.abs(curve.response) for curve in moved])
    axis = Axis("Magnitude", "m/(N*s)", (float(sizes.min()) / 2, float(sizes.max()) * 2), log=True, prefixed=False)
    panels = (_magnitudes(_hertz(bode), moved, axis, np.abs), _phases(_hertz(bode), moved))
    caption = (
        "Velocity at its encoder over the force that is commanded, with hold, delay and current loop of the drive."
    )
    yield Figure("bode_velocity_plant", "Current command to velocity", caption, panels)
    opened: dict[CascadeLoop, str] = {
        "velocity": "The velocity loop, cut where the velocity is fed back; the position loop is open.",
        "position": "The position loop, cut where the position is fed back; the velocity loop is closed.",
    }
    for loop, caption in opened.items():
        curves = [
            _marked(_curve(name, loops.loops[loop]), loops.margins[loop].stable)
            for name, loops in bode.cascades.items()
        ]
        panels = loop_panels(_hertz(bode), curves)
        yield Figure(f"bode_{loop}_loop", f"{loop.capitalize()} loop, opened", caption, panels)


def _speeds(bode: Bode) -> Figure:
    """Draw the open loop at prescribed speeds of the cart (thesis, Fig. 8).

    A stage without friction gives a figure without panels.
    """
    caption = (
        "The same while the cart slides at a prescribed speed"
        f"{', limiter free' if has_limiter(bode) else ''} (thesis, Fig. 8): the faster it slides, the sooner the "
        "bristles yield. Where friction falls with speed, the loop may be unstable (dashed)."
    )
    count = len(bode.prescribed)
    styles = zip(ramp(count + 1)[:count], np.linspace(2.6, 1.2, count), strict=True)  # the last shade is light
    curves = [
        _marked(
            ResponseCurve(at.loop, with_unit(at.speed, "m/s", 1) if at.speed else "stuck", shade, width=width),
            at.stable,
        )
        for at, (shade, width) in zip(bode.prescribed, styles, strict=True)
    ]
    return Figure("bode_speeds", "Open loop, prescribed cart speeds", caption, loop_panels(_hertz(bode), curves))


def _marked(curve: ResponseCurve, stable: bool) -> ResponseCurve:
    """Return the curve of a loop; if the loop is not `stable`, dash it and say so in its label."""
    return curve if stable else replace(curve, label=f"{curve.label} (unstable)", dash="dashed")


def _nyquist(bode: Bode) -> Figure:
    """Draw the open loop near -1: the limit cases, with all states of friction behind them."""
    family = [
        *_family(bode, True, "stable states of the family", LIGHT),
        *_family(bode, False, "unstable states of the family", LOST),
    ]
    cases = [
        Series(np.real(curve.response), np.imag(curve.response), curve.label, curve.colour, curve.dash, curve.width)
        for curve in (_loop_of(name, case) for name, case in bode.cases.items())
    ]
    turn = np.linspace(0, 2 * np.pi, 181)
    name = f"modulus margin {COMFORTABLE_MARGIN:g}"
    circle = Series(-1 + COMFORTABLE_MARGIN * np.cos(turn), COMFORTABLE_MARGIN * np.sin(turn), name, INK, "dashed", 1.0)
    point = Markers(np.array([-1.0]), np.array([0.0]), "−1", INK, "cross")
    x, y = (
        Axis(f"{part} part of L", "", limits) for part, limits in zip(("Real", "Imaginary"), NYQUIST_VIEW, strict=True)
    )
    panel = Panel("", x, y, (*family, *cases, circle), (point,), equal=True)
    caption = (
        "The loop for positive frequencies. Its smallest distance from −1 is the modulus margin: above 0.5 the loop "
        "stays outside the circle."
    )
    if family:
        caption += " Light lines: a selection of the family, stuck under bias forces and sliding at all speeds."
    return Figure("bode_nyquist", "Nyquist plot", caption, (panel,))


def _family(bode: Bode, stable: bool, name: str, shade: str) -> list[Series]:
    """Return Nyquist curves of some states of friction: of stable ones, or of unstable ones.

    `stable` decides which; a few states are picked evenly. Only the parts near -1 are kept. The first curve is called
    `name` in the legend; all have the colour `shade`.
    """
    numbers = np.flatnonzero(bode.scan.stable == stable) if has_family(bode) else np.empty(0, int)
    picked = numbers[np.linspace(0, len(numbers) - 1, min(DRAWN[stable], len(numbers))).round().astype(int)]
    lines = []
    for k, loop in enumerate(bode.loops[picked]):
        near = (np.abs(loop) > DRAWN_LOOP_SIZES[0]) & (np.abs(loop) < DRAWN_LOOP_SIZES[1])
        visible = np.where(near, loop, np.nan)[np.convolve(near, np.ones(3), "same") > 0]
        lines.append(Series(np.real(visible), np.imag(visible), "" if k else name, shade, width=0.9))
    return lines


def _sensitivity(bode: Bode) -> Figure:
    """Draw the sensitivity of the stable limit cases, and the band of all stable states behind."""
    stable = bode.scan.stable
    lines = tuple(
        Series(_hertz(bode), -magnitude(1 + curve.response), curve.label, curve.colour, curve.dash, curve.width)
        for curve in (_loop_of(name, case) for name, case in bode.cases.items() if case.margins.stable)
    )
    bands = ()
    if stable.any() and has_family(bode):
        all_ = -magnitude(1 + bode.loops[stable])
        name = "stable states of the family"
        bands = (Band(_hertz(bode), all_.min(axis=0), all_.max(axis=0), name, LIGHT),)
    if not (lines or bands):
        return Figure("bode_sensitivity", "", "", ())
    largest = max(float(np.max(part)) for part in (*(line.y for line in lines), *(band.high for band in bands)))
    limit = Limit(
        (-decibels(COMFORTABLE_MARGIN),),
        f"{-decibels(COMFORTABLE_MARGIN):.0f} dB: modulus margin {COMFORTABLE_MARGIN:g}",
        INK,
    )
    axis = Axis("|1/(1 + L)|", "dB", (LEAST_SENSITIVITY, max(10.0, 1.08 * largest)))
    caption = "How much of a disturbance remains: above 0 dB the controller amplifies it."
    excluded = f"; {(~stable).sum()} unstable ones are left out; near them the sensitivity is unbounded"
    note = (
        f"Band: smallest to largest of {stable.sum()} stable states{'' if stable.all() else excluded}." if bands else ""
    )
    panel = Panel("", Axis.of_frequency(_hertz(bode)), axis, lines, limits=(limit,), bands=bands)
    return Figure("bode_sensitivity", "Sensitivity", caption, (panel,), note=note)


def loop_panels(hertz: Array, curves: Sequence[ResponseCurve]) -> tuple[Panel, ...]:
    """Return panels of magnitude [dB] and phase [deg] of loops over frequencies (k,) [Hz].

    Lines mark 0 dB and odd multiples of 180 degrees. Without loops there are no panels.
    """
    if not curves:
        return ()
    sizes = np.concatenate([magnitude(curve.response) for curve in curves])
    view = max(float(sizes.min()) - 5, WIDEST_MAGNITUDES[0]), min(float(sizes.max()) + 5, WIDEST_MAGNITUDES[1])
    above = _magnitudes(hertz, curves, Axis("Magnitude", "dB", view, step=30.0), magnitude)
    below = _phases(hertz, curves)
    low, high = below.y.limits or (-180.0, 180.0)
    halves = tuple(turn for turn in (-540.0, -180.0, 180.0) if low < turn < high)
    return replace(above, limits=(Limit((0.0,), "", INK),)), replace(below, limits=(Limit(halves, "", INK),))


def _magnitudes(hertz: Array, curves: Sequence[ResponseCurve], axis: Axis, of: Callable[[np.ndarray], Array]) -> Panel:
    """Return the panel of what `of` computes from responses, such as dB, over frequencies [Hz]."""
    lines = (Series(hertz, of(curve.response), curve.label, curve.colour, curve.dash, curve.width) for curve in curves)
    return Panel("", Axis.of_frequency(hertz), axis, tuple(lines))


def _phases(hertz: Array, curves: Sequence[ResponseCurve]) -> Panel:
    """Return the panel of phases over frequencies (k,) [Hz], without labels.

    The labels stand in the panel of magnitudes above.
    """
    angles = zip(curves, phases([curve.response for curve in curves]), strict=True)
    lines = tuple(Series(hertz, y, "", curve.colour, curve.dash, curve.width) for curve, y in angles)
    least = QUARTER_TURN * np.floor((min(line.y.min() for line in lines) + 1) / QUARTER_TURN)
    most = QUARTER_TURN * np.ceil((max(line.y.max() for line in lines) - 1) / QUARTER_TURN)
    if most == least:
        least, most = least - QUARTER_TURN, most + QUARTER_TURN
    view = max(float(least), LEAST_PHASE) - 10, float(most) + 10
    step = QUARTER_TURN if view[1] - view[0] < 6 * QUARTER_TURN else 2 * QUARTER_TURN
    return Panel("", Axis.of_frequency(hertz), Axis("Phase", "°", view, step=step), lines)


def _curve(name: str, response: np.ndarray) -> ResponseCurve:
    """Return the response of a limit case in its colour and style."""
    return ResponseCurve(response, label(name), colour(name), dash(name), WIDTHS["touched" in name])


def _loop_of(name: str, case: BodeCase) -> ResponseCurve:
    """Return the open loop of a limit case, marked if it is unstable."""
    return _marked(_curve(name, case.loop), case.margins.stable)


def _masses(bode: Bode) -> list[float]:
    """Return the moving masses [kg]: all that moves, and the part that moves without the cart.

    Only a free joint lets the actuator move without the cart.
    """
    flat = bode.stage.flat()
    free = "joint.locked" in flat and not flat["joint.locked"]
    return [float(moving_mass(flat)), *([float(moving_mass({**flat, "masses.cart": 0.0}))] if free else [])]


def _hertz(bode: Bode) -> Array:
    """Return the frequencies of the analysis [Hz], shape (k,)."""
    return bode.omega / (2 * np.pi)
