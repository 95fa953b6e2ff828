"""Draw a map of verdicts as regions with words in them, the edge of hunting, and the way from a stage to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from friso.hunting.criteria import ATTRACTED
from friso.questions.map.cells import CellAxis, Look
from friso.questions.map.settings import map_settings
from friso.shown.drawing.figure import (
    BLACK,
    INK,
    VERMILLION,
    WHITE,
    Area,
    Array,
    Arrow,
    Lettering,
    Map,
    Markers,
    Panel,
    Series,
)
from friso.studies.edges import HUNTS_LEVEL, SETTLES_LEVEL, SLOW_LEVEL, MapEdges, OwnLine, coarse_edges, verdict_levels

HUNTS, KICKED, SLOW, SETTLES = "hunts", "bistable", "transient", "settles"
"""Verdicts with a region. That of stages that hunt after a kick only is a hatched part of the region that hunts."""

GROUNDS = {SETTLES: SETTLES_LEVEL, SLOW: SLOW_LEVEL, HUNTS: HUNTS_LEVEL}
"""Levels from which on each region has its colour, the lowest first: the next one lies on it."""

WRITTEN = {
    KICKED: ("A KICK\nSTARTS IT", WHITE),
    HUNTS: ("HUNTS", WHITE),
    SLOW: ("SLOW", BLACK),
    SETTLES: ("SETTLES", INK),
}
"""Words in the regions, and their colours."""

BEHIND_WORDS = {WHITE: VERMILLION}
"""Colours that cover the hatching behind words, by the colour of the words."""

MapPoint = tuple[float, float]
"""Values [SI] along both axes."""


def is_of_verdicts(x: CellAxis, y: CellAxis, colouring: Look) -> bool:
    """Tell whether cells over two axes have verdicts between which there may be edges."""
    words = {category.label for category in colouring.categories}
    return bool(words & {*ATTRACTED, SETTLES}) and not (x.words or y.words) and min(len(x.places), len(y.places)) > 1


def verdict_panel(
    x: CellAxis, y: CellAxis, colouring: Look, codes: Array, title: str, edges: MapEdges | None, own: Mapping[str, Any]
) -> Panel:
    """Return a map of verdicts over two axes; `codes`, shape (y, x), are indices of its categories.

    Without `edges`, they are drawn half-way between cells. `own` has the values of the swept stage, by key.
    """
    labels = np.array([*(category.label for category in colouring.categories), ""])
    words = labels[np.where(np.isnan(codes), -1, codes).astype(int)].T
    levels = verdict_levels(words)
    drawn = edges or coarse_edges(x.positions, y.positions, (x.log, y.log))
    mesh = (drawn.near + drawn.far) / 2
    colours = {category.label: category.colour for category in colouring.categories}
    colours[HUNTS] = colours.get(HUNTS, colours.get(KICKED, ""))
    areas = [
        _area(levels, levels >= level, mesh[max(level - SLOW_LEVEL, 0)], colours[word])
        for word, level in GROUNDS.items()
        if word in colours and (levels >= level).any()
    ]
    if (words == KICKED).any():
        areas.append(_area(levels, words == KICKED, mesh[-1], WHITE, hatched=True))
    if edges is not None:
        areas += _bands(levels, edges)
    here = _here(x, y, own)
    arrows, beside = _way(here, drawn.own, x.key) if here else ((), ())
    taken = [*([here] if here else []), *(arrow.end for arrow in arrows)]
    lettering = [item for word in WRITTEN if (item := _written(word, words, x, y, taken))]
    written = {KICKED, *(word for word, (text, _) in WRITTEN.items() if any(item.text == text for item in lettering))}
    categories = tuple(
        replace(one, is_written=one.label in written, colour=colours[HUNTS if one.label == KICKED else one.label])
        for one in colouring.categories
    )
    return Panel(
        title,
        x.axis((float(x.positions[0]), float(x.positions[-1]))),
        y.axis((float(y.positions[0]), float(y.positions[-1]))),
        tuple(Series(line[:, 0], line[:, 1], "", INK, width=1.8) for line in _lines(levels, mesh[-1])),
        (Markers(np.array(here[:1]), np.array(here[1:]), "", INK, "target"),) if here else (),
        maps=(Map(x.positions, y.positions, np.full(codes.shape, np.nan), *colouring.scale[:-1], categories, codes),),
        areas=tuple(areas),
        arrows=arrows,
        words=(*lettering, *beside),
    )


def _contours(levels: Array, cells: np.ndarray) -> Any:
    """Return the generator of contours of marked cells, shape (n, m), whose points are indices of cells.

    Cells without a level are left out.
    """
    from contourpy import contour_generator

    marked = np.ma.masked_array(cells.astype(float), np.isnan(levels))
    return contour_generator(z=marked.T, fill_type="OuterOffset")


def _placed(points: Array, mesh: Array) -> Array:
    """Return the places [SI] of points given as indices of cells, whole or half, shape (count, 2)."""
    i, j = np.round(2 * points).astype(int).T
    return mesh[i, j]


def _lines(levels: Array, mesh: Array) -> list[Array]:
    """Return the edges of hunting, each of shape (count, 2) [SI]."""
    return [_placed(line, mesh) for line in _contours(levels, levels >= HUNTS_LEVEL).lines(0.5)]


def _area(levels: Array, cells: np.ndarray, mesh: Array, colour: str, hatched: bool = False) -> Area:
    """Return the area of marked cells, shape (n, m), up to half-way to other cells or their edge on the mesh."""
    rings = []
    for points, offsets in zip(*_contours(levels, cells).filled(0.5, np.inf), strict=True):
        for ring in np.split(points, offsets[1:-1]):
            rings += [_placed(ring, mesh), np.full((1, 2), np.nan)]
    x, y = (np.concatenate(rings[:-1]) if rings else np.zeros((0, 2))).T
    return Area(x, y, colour, hatched)


def _bands(levels: Array, edges: MapEdges) -> list[Area]:
    """Return the areas between the last places inside and the first outside along the edges of hunting."""
    sides = zip(_lines(levels, edges.near[-1]), _lines(levels, edges.far[-1]), strict=True)
    rings = [np.concatenate([near, far[::-1], near[:1]]) for near, far in sides]
    return [Area(ring[:, 0], ring[:, 1], INK) for ring in rings]


def _here(x: CellAxis, y: CellAxis, own: Mapping[str, Any]) -> MapPoint | None:
    """Return the place of the swept stage, None if it is not on the map."""
    values = own.get(x.key), own.get(y.key)
    if not all(isinstance(value, float) for value in values):
        return None
    inside = all(axis.positions[0] <= value <= axis.positions[-1] for axis, value in zip((x, y), values, strict=True))
    return (float(values[0]), float(values[1])) if inside else None  # type: ignore[arg-type]


def nearest_way(ways: Iterable[OwnLine]) -> tuple[OwnLine, float] | None:
    """Return the axis along which the edge of hunting is nearest, and the factor to it; None without an edge."""
    factors = [
        (way, float(way.nearest.mean() / way.own))
        for way in ways
        if way.own > 0 and way.nearest is not None and way.nearest.min() > 0
    ]
    return min(factors, key=lambda pair: abs(np.log(pair[1])), default=None)


def _way(here: MapPoint, ways: tuple[OwnLine, ...], key: str) -> tuple[tuple[Arrow, ...], tuple[Lettering, ...]]:
    """Return the arrow from the stage to the nearest edge of hunting, and its factor beside it.

    `key` is that of the axis to the right.
    """
    nearest = nearest_way(ways)
    if nearest is None:
        return (), ()
    way, factor = nearest
    across = way.key == key
    end = (here[0] * factor, here[1]) if across else (here[0], here[1] * factor)
    colour = WHITE if way.attracts else INK
    ground = BEHIND_WORDS.get(colour, "")
    half = factor**0.5
    middle = (here[0] * half, here[1]) if across else (here[0], here[1] * half)
    words = Lettering(*middle, f"× {factor:.3g}", colour, "above" if across else "right", ground=ground)
    yours = Lettering(*here, "YOURS", colour, "below" if across or factor > 1 else "above", ground=ground)
    return (Arrow(here, end, colour),), (words, yours)


def _room(cells: np.ndarray, steps: list[float]) -> Array:
    """Return how far each cell, shape (n, m), lies from the next one that is not marked, or the side of the map.

    The map ends at the outermost cells. `steps` are the sizes of a cell.
    """
    from scipy import ndimage

    inner = np.zeros(cells.shape, bool)
    inner[1:-1, 1:-1] = cells[1:-1, 1:-1]
    distances: Any = ndimage.distance_transform_edt(inner, sampling=steps)
    return distances


def _written(word: str, words: np.ndarray, x: CellAxis, y: CellAxis, taken: list[MapPoint]) -> Lettering | None:
    """Return the word of a region where it has most room in it; None where it has too little.

    `words` are the verdicts of the cells, shape (n, m), and `taken` places at which something else stands.
    """
    from scipy import ndimage

    cells = np.isin(words, ATTRACTED) if word == HUNTS else words == word
    if not cells.any():
        return None
    text, colour = WRITTEN[word]
    lines = text.splitlines()
    shares = map_settings.letter_width * max(map(len, lines)), map_settings.line_height * len(lines)
    steps = [1 / share / count for share, count in zip(shares, cells.shape, strict=True)]  # [sizes of the words]
    if word == HUNTS:
        labelled: Any = ndimage.label(words == KICKED)
        parts = [labelled[0] == number + 1 for number in range(labelled[1])]
        for part in parts:
            cells &= ~part if _room(part, steps).max() > map_settings.room_of_words else True
    free = cells.copy()
    for place in taken:
        free[_nearest_cell(x, place[0]), _nearest_cell(y, place[1])] = False
    room = _room(free, steps)
    if room.max() < map_settings.room_of_words:
        return None
    at = np.unravel_index(room.argmax(), room.shape)
    place = float(x.positions[at[0]]), float(y.positions[at[1]])
    return Lettering(*place, text, colour, ground=BEHIND_WORDS.get(colour, ""))


def _nearest_cell(axis: CellAxis, value: float) -> int:
    """Return the index of the cell of an axis next to a value [SI]."""
    away = np.log(axis.positions / value) if axis.log else axis.positions - value
    return int(np.abs(away).argmin())
