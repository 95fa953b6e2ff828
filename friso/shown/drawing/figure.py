"""Describe a figure as plain data, before it is drawn, with its colours and phases.

An analysis answers with a `Figure`, and a renderer draws it. All data are in the unit of their axis, which is an SI
unit when the figure is made. `friso.shown.drawing.drawable` chooses the prefix and thins the lines, once for both
renderers. Both map numbers to colours by one scale.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

# Okabe & Ito, "Color universal design" (2008): distinguishable with any colour vision.
BLUE, VERMILLION, GREEN = "#0072B2", "#D55E00", "#009E73"
SKY, ORANGE, PINK, MAUVE = "#56B4E9", "#E69F00", "#CC79A7", "#8c6d8f"
INK, GREY, LIGHT = "#222222", "#767676", "#c9c9c9"
WHITE, BLACK = "#ffffff", "#111111"
"""Words on coloured ground, which are the same on a dark page."""

QUIET = "#d3e6f3"
"""Ground of what rests: a pale blue, far from the colours of swings and from white and grey."""

DARK = {
    INK: "#e6e7e9",
    GREY: "#9aa0a6",
    LIGHT: "#5a5f66",
    BLUE: "#3d9be0",
    SKY: "#a6d8f7",
    QUIET: "#1f3645",
    "#e3e3e3": "#2f3338",
    "#a9a9a9": "#777d84",
}
"""Colours on a dark page, by those on a light one. Others are the same on both."""


Array = npt.NDArray[np.float64]
Dash = Literal["solid", "dashed", "dotted"]
IMAGE_FORMATS = ("png", "svg", "pdf")
"""Formats of the image of a figure."""

Symbol = Literal["circle", "triangle", "cross", "target", "patch"]


@dataclass(frozen=True)
class SecondScale:
    """A second scale of an axis, on the opposite side: the axis times `factor` is `quantity` [`unit`]."""

    quantity: str
    unit: str
    factor: float

    @property
    def label(self) -> str:
        """Return the text at the scale, e.g. "Crossover [Hz]"."""
        return f"{self.quantity} [{self.unit}]"


@dataclass(frozen=True)
class Axis:
    """One axis: label from `quantity` and `unit`, and `limits` [unit] (None: from the data).

    An axis of words has the positions 0, 1, 2, ..., named by `words`, and no unit. Ticks stand at multiples of `step`
    [unit], if that is given: angles are read in quarters of a turn. The unit has no prefix unless it is `prefixed`.
    """

    quantity: str
    unit: str
    limits: tuple[float, float] | None = None
    log: bool = False
    words: tuple[str, ...] = ()
    step: float | None = None
    prefixed: bool = True
    second: SecondScale | None = None

    @classmethod
    def of_frequency(cls, hertz: Array) -> Axis:
        """Return a logarithmic axis over increasing frequencies [Hz], from the first to the last."""
        return cls("Frequency", "Hz", (float(hertz[0]), float(hertz[-1])), log=True)

    @property
    def label(self) -> str:
        """Return the text at the axis, e.g. "Time [s]"."""
        return f"{self.quantity} [{self.unit}]" if self.unit else self.quantity


@dataclass(frozen=True)
class Series:
    """A line through the points x, y, both of shape (n,); NaN breaks it."""

    x: Array
    y: Array
    label: str
    colour: str
    dash: Dash = "solid"
    width: float = 1.4

    def __post_init__(self) -> None:
        _same_length(self.label, self.x, self.y)


@dataclass(frozen=True)
class Told:
    """What a page tells of a point under the mouse, besides its values: a `text` with {} for the point's own of `each`.

    `each` holds texts in the shape of the points.
    """

    text: str
    each: np.ndarray

    def of(self, points: Any) -> Told:
        """Return what is told of some points, given by a mask or indices."""
        return replace(self, each=self.each[points])


@dataclass(frozen=True)
class Markers:
    """Single points x, y, both (n,), never thinned, such as counted peaks."""

    x: Array
    y: Array
    label: str
    colour: str
    symbol: Symbol = "circle"
    told: Told | None = None

    def __post_init__(self) -> None:
        _same_length(self.label, self.x, self.y)


@dataclass(frozen=True)
class Band:
    """The area between `low` and `high` over x, filled and never thinned.

    All arrays are finite and of shape (n,).
    """

    x: Array
    low: Array
    high: Array
    label: str
    colour: str

    def __post_init__(self) -> None:
        """Check that all arrays are finite and of equal length. Raises ValueError if they are not."""
        _same_length(self.label, self.x, self.low)
        _same_length(self.label, self.x, self.high)
        if not np.isfinite([self.x, self.low, self.high]).all():
            raise ValueError(f"{self.label}: x, low and high are not all finite; a band has no gaps")

    @property
    def outline(self) -> tuple[Array, Array]:
        """Return the closed line around the band, each coordinate of shape (2 n + 1,).

        It runs along the top, and back along the bottom.
        """
        there_and_back = np.concatenate([self.x, self.x[::-1], self.x[:1]])
        return there_and_back, np.concatenate([self.high, self.low[::-1], self.high[:1]])


@dataclass(frozen=True)
class Area:
    """Filled rings with their points x, y, both (n,); NaN stands between two rings, of which one may be a hole.

    A hole runs the other way round than the ring around it. A hatched area has lines in its colour, and no ground.
    """

    x: Array
    y: Array
    colour: str
    hatched: bool = False

    def __post_init__(self) -> None:
        _same_length("area", self.x, self.y)


@dataclass(frozen=True)
class Lettering:
    """Words centred at the point x, y, or beside it at the `side` on which the point does not lie.

    Their `ground` covers what is drawn behind them; without one, it shows.
    """

    x: float
    y: float
    text: str
    colour: str
    side: Literal["", "left", "right", "below", "above"] = ""
    ground: str = ""


@dataclass(frozen=True)
class Arrow:
    """An arrow from the point `start` to the point `end`."""

    start: tuple[float, float]
    end: tuple[float, float]
    colour: str


@dataclass(frozen=True)
class Limit:
    """Horizontal lines at `values` [unit of the y axis] across the panel, under one label."""

    values: tuple[float, ...]
    label: str
    colour: str = GREY
    dash: Dash = "dashed"


@dataclass(frozen=True)
class Category:
    """A word in place of a number, with one flat colour.

    The word is a verdict, or the reason for a missing number. The legend has it unless it is written in the panel.
    """

    label: str
    colour: str
    is_written: bool = False


@dataclass(frozen=True)
class Coloured:
    """Points x, y coloured by the number z [unit] or, where there is one, by a category.

    `limits` [unit] is the range of the colours (None: from z), on a logarithmic scale if `log`. If `colours` are given,
    they are those of the whole numbers 0, 1, 2, ... instead. A `ramp` has other colours from little to much. `codes`,
    of the shape of z, are indices into `categories`; where a code is NaN, z counts. A page tells what is `told`.
    """

    x: Array
    y: Array
    z: Array
    quantity: str
    unit: str
    limits: tuple[float, float] | None = None
    log: bool = False
    colours: tuple[str, ...] = ()
    categories: tuple[Category, ...] = ()
    codes: Array | None = None
    ramp: tuple[str, ...] = ()
    told: Told | None = None

    def __post_init__(self) -> None:
        """Check that codes have the shape of the numbers. Raises ValueError if they have not."""
        if self.codes is not None and np.shape(self.codes) != np.shape(self.z):
            raise ValueError(
                f"map of {self.quantity}: codes have the shape {np.shape(self.codes)}, expected that of z, "
                f"{np.shape(self.z)}"
            )

    @property
    def label(self) -> str:
        """Return the text at the colour bar."""
        return f"{self.quantity} [{self.unit}]" if self.unit else self.quantity

    @property
    def has_numbers(self) -> bool:
        """Tell whether colour stands for a number anywhere; otherwise there is no colour bar."""
        return bool(np.isfinite(self.z).any())


@dataclass(frozen=True)
class Map(Coloured):
    """A field z of shape (len(y), len(x)) over cell centres x and y, ascending.

    Cells that are NaN and have no category stay empty.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.shape(self.z) != (len(self.y), len(self.x)):
            raise ValueError(
                f"map of {self.quantity}: z has the shape {np.shape(self.z)}, expected "
                f"(len(y), len(x)) = {(len(self.y), len(self.x))}"
            )


@dataclass(frozen=True)
class Cloud(Coloured):
    """Single places x, y with their z, all of shape (n,)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _same_length(self.quantity, self.x, self.y)
        _same_length(self.quantity, self.x, self.z)


@dataclass(frozen=True)
class Panel:
    """One pair of axes with maps and clouds lowest, then areas, bands, limits, lines, arrows, markers and words.

    With `equal`, a unit is as long on the one axis as on the other, and both have limits.
    """

    title: str
    x: Axis
    y: Axis
    series: tuple[Series, ...] = ()
    markers: tuple[Markers, ...] = ()
    limits: tuple[Limit, ...] = ()
    maps: tuple[Map, ...] = ()
    clouds: tuple[Cloud, ...] = ()
    bands: tuple[Band, ...] = ()
    equal: bool = False
    areas: tuple[Area, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    words: tuple[Lettering, ...] = ()

    @property
    def coloured(self) -> tuple[Coloured, ...]:
        """Return maps and clouds, which need a colour bar or a legend of colours."""
        return (*self.maps, *self.clouds)


@dataclass(frozen=True)
class Figure:
    """Panels in `columns` columns, row by row; `name` for its file, `subject` for its stage.

    The caption stands next to the figure on a page; the note is part of the figure itself.
    """

    name: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = 1
    subject: str = ""
    note: str = ""

    @property
    def rows(self) -> int:
        """Return the number of rows of panels."""
        return -(-len(self.panels) // self.columns)


def _same_length(label: str, x: Sequence[float] | Array, y: Sequence[float] | Array) -> None:
    """Check that x and y have one length. Raises ValueError if they have not."""
    if np.ndim(x) != 1 or np.shape(x) != np.shape(y):
        raise ValueError(f"{label}: x has the shape {np.shape(x)}, y {np.shape(y)}; expected one length")


FIRST_TURN_FROM = -315.0
"""Lower end [deg] of the turn in which the first phase is plotted.

The end lies between the phases of whole numbers of integrations.
"""


def phases(responses: Sequence[np.ndarray]) -> list[Array]:
    """Return phases [deg] of complex responses (k,) without jumps of 360 degrees.

    The first phase begins between -315 and 45 degrees. The others are shifted by whole turns until they agree with the
    first at high frequencies, where all loops behave alike.
    """
    angles = [np.angle(response) for response in responses]
    lagging = [np.where(angle > np.pi - 1e-9, angle - 2 * np.pi, angle) for angle in angles]  # half a turn is a lag
    first, *others = [np.degrees(np.unwrap(angle)) for angle in lagging]
    first = first - 360 * np.floor((first[0] - FIRST_TURN_FROM) / 360)
    high = slice(len(first) // 2, None)
    return [first, *(phase + 360 * np.round(np.median(first[high] - phase[high]) / 360) for phase in others)]


# viridis (van der Walt & Smith, 2015), every 28th or so of its colours: even in lightness, for any colour vision.
VIRIDIS = (
    "#440154",
    "#482878",
    "#3e4989",
    "#31688e",
    "#26828e",
    "#1f9e89",
    "#35b779",
    "#6ece58",
    "#b5de2b",
    "#fde725",
)

MORE = VIRIDIS[::-1]
"""Colours from little to much. Little is as light as the cells that rest, which lie beside it."""


@dataclass(frozen=True)
class ColourScale:
    """Colours of the drawn numbers from `low` to `high`.

    With `steps`, each colour fills an equal part of the range; otherwise the colours blend into each other. `ticks`
    (drawn numbers) and `texts` are written at the colour bar; without them the renderer chooses.
    """

    low: float
    high: float
    colours: tuple[str, ...]
    steps: bool = False
    ticks: tuple[float, ...] = ()
    texts: tuple[str, ...] = ()

    @property
    def stops(self) -> list[tuple[float, str]]:
        """Return the colours with their places between 0 and 1; a step has two places."""
        count = len(self.colours)
        if self.steps:
            return [((i + end) / count, colour) for i, colour in enumerate(self.colours) for end in (0, 1)]
        return [(i / (count - 1), colour) for i, colour in enumerate(self.colours)]


def painted(field: Coloured) -> Array:
    """Return the numbers of a map or cloud to which the colours belong.

    These are z, or on a logarithmic scale log10(z), with z raised to the lower limit.
    """
    if not field.log:
        return field.z
    low, _ = _limits(field)
    return np.log10(np.maximum(field.z, low))


def scale(field: Coloured) -> ColourScale:
    """Return the colour scale of a map or cloud."""
    if field.colours:
        count = len(field.colours)
        ticks = tuple(range(0, count, -(-count // 12)))
        return ColourScale(-0.5, count - 0.5, field.colours, True, ticks, tuple(map(str, ticks)))
    low, high = _limits(field)
    if not field.log:
        return ColourScale(low, high, field.ramp or MORE)
    low, high = math.log10(low), math.log10(high)
    step = max(1, math.ceil((high - low) / 6))
    decades = range(math.ceil(low + 0.3), math.floor(high + 1e-9) + 1, step)
    # `painted` raises lower numbers to the limit
    texts = (f"≤ {10.0**low:.2g}", *(f"{10.0**decade:g}" for decade in decades))
    return ColourScale(low, high, field.ramp or MORE, False, (low, *decades), texts)


def ramp(count: int) -> tuple[str, ...]:
    """Return `count` colours evenly along viridis, without its darkest and lightest parts."""
    table = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in VIRIDIS])
    places = np.linspace(0.5, len(VIRIDIS) - 1.2, count)
    mixed = [np.interp(places, np.arange(len(VIRIDIS)), table[:, i]).round().astype(int) for i in range(3)]
    return tuple(f"#{r:02x}{g:02x}{b:02x}" for r, g, b in zip(*mixed, strict=True))


def _limits(field: Coloured) -> tuple[float, float]:
    """Return the range of the colours [unit], which is never empty."""
    if field.limits is not None:
        low, high = field.limits
    else:
        finite = field.z[np.isfinite(field.z)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if high > low:
        return low, high
    return (low / 2, high * 2) if field.log else (low - (abs(low) / 2 or 0.5), high + (abs(high) / 2 or 0.5))
