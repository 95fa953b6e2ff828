"""Say in which part of a map the stage swings or hunts, in words and in the JSON document of `friso map`."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from friso.axis import axis_shown
from friso.equations.bandwidth import bandwidth
from friso.hunting.criteria import ATTRACTED, CREEPS, PEAK_RULE, RESTS, SWINGS
from friso.questions.map import words as map_words
from friso.questions.map.cells import SAMPLE, CellAxis, axes_of, dims_of, machine_of
from friso.questions.map.words import failures, grouped, text_counts, word_counts
from friso.shown.documents import plain_json
from friso.shown.drawing.figure import SecondScale
from friso.shown.text import listed, range_with_unit, unstable_loop
from friso.stage import Stage
from friso.stage.contacts import followed
from friso.studies.axes import SCALINGS
from friso.studies.edges import EDGE_PRECISION, HUNTS_LEVEL, MapEdges, OwnLine, verdict_levels
from friso.studies.metric import MapFinding, metrics, worded
from friso.studies.study import Study

_NO_RESULT = {"failed": "the run was not completed", "invalid": "these values are not a valid stage"}

_QUIET = ("transient", "settles")

_SHARP = 2 * EDGE_PRECISION
"""Width of a change, as a share of its value, that three digits do not show."""

MOST_SENTENCES = 3
"""Number of sentences above the files of a map."""


def headline(runs: xr.Dataset, name: str) -> str:
    """Return all statements on a map as one text, such as in which fraction of it stages hunt."""
    return " ".join(statements(runs, name))


def statements(runs: xr.Dataset, name: str) -> list[str]:
    """Return what is stated on a map, such as in which fraction of it stages hunt, and doubts.

    The metric declares what is stated (`Metric.findings`). The result is empty if the runs have no outcome.
    """
    every = metrics()
    asked = name if name in runs and name in every and every[name].findings else ""
    asked = asked or (every[name].answered_by if name in every else "outcome")
    asked = asked if asked in runs else "outcome"
    if asked not in runs:
        return []
    counts = {} if every[asked].counts else map_words.text_counts(runs, asked)
    findings = [one for one in every[asked].findings if not one.if_any or any(map(counts.get, one.words))]
    word, sentence = every[asked].doubt or ("", "")
    doubts = []
    if word and (cells := counts.get(word, 0)):
        doubts = [sentence.format(count=grouped(cells), share=_percent(cells, runs[asked].size))]
    return [*(_answer(runs, asked, finding) for finding in findings), *doubts]


def _answer(runs: xr.Dataset, name: str, finding: MapFinding) -> str:
    """Say in which fraction of the map a finding holds, and in which range of each axis."""
    holds, completed = _flags(runs, name, finding.words)
    open_words = _open_words(name) & {*map_words.text_counts(runs, name)} if finding.words else set()
    if not completed.any():
        return f"No cell of the map has a {'certain ' * bool(open_words)}result."
    if not holds.any() or np.array_equal(holds, completed):
        every = "cell of the map" if completed.all() else "cell with a result"
        cell = "cell with a certain result" if open_words else every
        return f"{finding.clause} in {'every' if holds.any() else 'no'} {cell}."
    share = f"{finding.clause} in {_percent(holds.sum(), completed.sum())} of the map"
    axes, inside = axes_of(runs), completed.copy()
    where = []
    for k, axis in enumerate(axes):
        dim = dims_of(runs).index(SAMPLE) if SAMPLE in runs.dims else k
        line = np.asarray(holds.any(axis=tuple(other for other in range(holds.ndim) if other != dim)))
        box = _box(axis, line[axis.places])
        where += [_range(in_its_unit(axis, runs), box)] if not box.all() else []
        along = np.zeros(len(line), bool)
        along[axis.places] = box
        inside &= along.reshape([-1 if other == dim else 1 for other in range(holds.ndim)])
    if not where:
        return f"{share}, over the whole range of {'the axis' if len(axes) == 1 else 'every axis'}."
    part = f"{_percent(holds.sum(), inside.sum())} of the cells in that range"
    filled = "all cells in that range" if np.array_equal(inside, holds) else part
    return f"{share}: at {listed(where, 'and')} ({filled})."


def _open_words(name: str) -> set[str]:
    """Return the words of a metric that say that a cell's result is not certain."""
    return {word.text for word in metrics()[name].words if word.is_open}


def _flags(runs: xr.Dataset, name: str, words: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return in which cells a metric has one of some words, and which cells have a result.

    Without words, cells with a count above 0 are marked. Both arrays have the shape of the runs; a large store is read
    in parts.
    """
    values = runs[name]
    holds, completed = np.zeros(values.shape, bool), np.zeros(values.shape, bool)
    rows = max(1, map_words.AT_ONCE // max(1, int(np.prod(values.shape[1:]))))
    without = ["", *_NO_RESULT, *_open_words(name)]
    for first in range(0, len(values), rows):
        part = np.asarray(values[first : first + rows].values)
        texts = part.astype(str)
        ran = ~np.isin(texts, without) if words else np.isfinite(part)
        completed[first : first + rows] = ran
        holds[first : first + rows] = ran & (np.isin(texts, words) if words else part.astype(float) > 0)
    return holds, completed


def _box(axis: CellAxis, cells: np.ndarray) -> np.ndarray:
    """Mark the cells of an axis in the range in which a finding holds, shape (n,).

    The range lasts from the first of the `cells` in which it holds to the last. On an axis of words, only words at
    which it holds are marked.
    """
    held = axis.positions[cells]
    if axis.words:
        return np.isin(axis.positions, held)
    return (axis.positions >= held.min()) & (axis.positions <= held.max())


def _range(axis: CellAxis, box: np.ndarray) -> str:
    """Write in words the range of an axis that is marked in `box`."""
    name, inside = axis.quantity, axis.positions[box]
    if axis.words:
        return f"{name} {listed([axis.words[int(k)] for k in np.unique(inside)], 'or')}"
    low, high = (axis.value(int(np.flatnonzero(axis.positions == end)[0])) for end in (inside.min(), inside.max()))
    if inside.min() == inside.max():
        return f"{name} {low}"
    if inside.min() == axis.positions.min():
        return f"{name} up to {high}"
    return f"{name} from {low}" if inside.max() == axis.positions.max() else f"{name} from {low} to {high}"


def _percent(part: int, total: int) -> str:
    """Write `part` of `total` in percent; only exactly none or all is shown as 0 or 100 %."""
    share = 100 * part / total
    if 1 <= share <= 99:
        return f"{share:.0f} %"
    return f"{share:.2g} %" if share < 1 else f"{np.floor(share * 10) / 10:g} %"


def own_values(runs: xr.Dataset) -> dict[str, Any]:
    """Return the values [SI] of the swept stage, by key, and 1 for factors on several keys; empty if it is unknown."""
    machine = machine_of(runs)
    return {} if machine is None else {**dict.fromkeys(SCALINGS, 1.0), **machine.flat()}


def subject_of(runs: xr.Dataset) -> str:
    """Return the name of the swept stage, and whether its joint is locked, for the title of a figure."""
    name, machine = str(runs.attrs.get("name", "")), machine_of(runs)
    locked = machine is not None and machine.flat().get("joint.locked") and "joint.locked" not in runs.coords
    return f"{name}, joint locked" if name and locked else name


def second_scale(axis: CellAxis, runs: xr.Dataset) -> SecondScale | None:
    """Return the scale of what an axis of factors multiplies, in Hz or N; None for other axes."""
    values = _multiplied(axis, runs)
    if values is None:
        return None
    name, own, unit, _ = values
    if own is None:
        return None
    return SecondScale(f"{name[0].upper()}{name[1:]}".partition(" (")[0], unit, own)


def message(runs: xr.Dataset, metric: str, edges: MapEdges | None) -> str:
    """Say on which side of the edge stages hunt, and from which value to which at the stage's own value of one axis.

    The result is empty for a map that is not over two axes of numbers, or has no verdicts. The side holds over the
    whole map: in every row or column of its cells.
    """
    if metric not in worded(verdicts=True) or metric == "outcome" or metric not in runs or SAMPLE in runs.dims:
        return ""
    axes = axes_of(runs)
    if len(axes) != 2 or any(axis.words for axis in axes):
        return ""
    words = np.asarray(runs[metric].transpose(*(axis.key for axis in axes)).values).astype(str)
    levels = verdict_levels(words[axes[0].places][:, axes[1].places])
    if np.isnan(levels).all():
        return ""
    hunts, decided = levels == HUNTS_LEVEL, ~np.isnan(levels)
    answered = ~np.isin(words, ["", *_NO_RESULT, *_open_words(metric)])
    share = "" if answered.all() else _percent(answered.sum(), answered.size)
    if not hunts.any() or hunts[decided].all():
        where = f"in the {share} of this map that has an answer" if share else "on this map"
        return f"Hunts {'everywhere' if hunts.any() else 'nowhere'} {where}"
    side, number = next(
        (
            (name, axis)
            for axis, names in enumerate((("left of", "right of"), ("below", "above")))
            for name, ways in zip(names, (hunts, np.flip(hunts, axis)), strict=True)
            if (np.diff(ways.astype(int), axis=axis) <= 0).all()
        ),
        ("inside", 0),
    )
    text = f"Hunts {side} the line"
    lines = {line.key: line for line in edges.own} if edges else {}
    if axes[number].key in lines:
        text += f", at your {_short(axes[1 - number])} {_where(lines[axes[number].key], axes[number], runs)}"
    return f"{text}; {share} of this map has an answer" if share else text


def _short(axis: CellAxis) -> str:
    """Return the shortest name of an axis: "friction", "speed" or a key in words."""
    return axis.key if axis.key in SCALINGS else map_words.in_sentence(axis.key)


def _where(line: OwnLine, axis: CellAxis, runs: xr.Dataset) -> str:
    """Say in which ranges along a line through the stage hunting attracts: "below 9.75 Hz"."""
    ends = [_change(line, axis, runs, change) for change in range(len(line.changes))]
    if not ends:
        return f"at any {_short(axis)} shown" if line.begins else f"at no {_short(axis)} shown"
    parts = [f"below {ends[0]}"] if line.begins else []
    inner = ends[1:] if line.begins else ends
    parts += [f"from {low} to {high}" for low, high in zip(inner[::2], inner[1::2], strict=False)]
    return listed([*parts, *([f"above {inner[-1]}"] if len(inner) % 2 else [])], "and")


def _change(line: OwnLine, axis: CellAxis, runs: xr.Dataset, number: int) -> str:
    """Write between which values a change of a line lies, as one where both have equal digits: "9.75 Hz"."""
    values = _multiplied(axis, runs)
    scale, unit = (1.0, axis.unit) if values is None else (values[1] or 1.0, values[2] if values[1] else "times yours")
    low, high = (line.changes[number] * scale).tolist()
    middle = (low + high) / 2
    return range_with_unit(middle, middle, unit) if high - low < _SHARP * middle else range_with_unit(low, high, unit)


def statement(runs: xr.Dataset, metric: str) -> str:
    """Return the note on every figure of a map: its headline, and its number of runs."""
    caveat = " ".join(caveats(runs, metric))
    return "\n".join(text for text in (hatching(runs, metric), headline(runs, metric), _extent(runs), caveat) if text)


def hatching(runs: xr.Dataset, metric: str) -> str:
    """Say what the hatching of a map of verdicts means; empty for a map without it."""
    if not message(runs, metric, None) or "bistable" not in map_words.text_counts(runs, metric):
        return ""
    return "Hatched: this motion comes to rest there, but a kick or another move starts hunting."


def meanings(runs: xr.Dataset) -> list[tuple[str, str]]:
    """Return the meaning of each word that occurs in a map."""
    texts = {name: {word.text: word.meaning for word in metrics()[name].words} for name in map_words.tallied()}
    return [
        (word, axis_shown().text(text))
        for name, meanings_ in texts.items()
        for word in map_words.word_counts(runs, name)
        if (text := (meanings_ | _NO_RESULT).get(word))
    ]


def caveats(runs: xr.Dataset, name: str) -> list[str]:
    """Say in how many cells peak counts or verdicts disagree with the end of the run.

    The list is empty if there are no such cells, or if the runs lack the variables to compare.
    """
    if name in worded(verdicts=True) and name != "outcome" and {name, "outcome"} <= set(runs.data_vars):
        hidden = int(((runs[name].values == "hunts") & np.isin(runs["outcome"].values, (RESTS, CREEPS))).sum())
        text = (
            f"In {grouped(hidden)} of the cells that hunt the run does not show it: the cycle lasts longer than the "
            "run, or begins after it. A longer motion.duration shows it."
        )
        return [text] if hidden else []
    if name not in metrics() or not metrics()[name].counts or not {name, "outcome"} <= set(runs.data_vars):
        return []
    counted, outcome = runs[name].values, runs["outcome"].values
    over = int(((counted > 0) & (outcome == RESTS)).sum())
    missed = int(((counted == 0) & (outcome == SWINGS)).sum())
    over_text = [f"In {grouped(over)} of the cells with counted peaks the run rests at its end."] if over else []
    return over_text + ([f"In {grouped(missed)} of the cells without any the run swings."] if missed else [])


def _extent(runs: xr.Dataset) -> str:
    """Say how many runs were made at which tolerance, and with which results."""
    cells = int(np.prod(list(runs.sizes.values())))
    words = map_words.word_counts(runs, "outcome")
    idle = sum(words.get(category.label, 0) for category in (map_words.INVALID, map_words.NOT_RUN))
    text = f"{grouped(cells - idle)} runs at rtol {float(runs.attrs['rtol']):g}"
    listing = "; ".join(filter(None, (map_words.tally(runs, name) for name in map_words.tallied())))
    return f"{text}: {listing}." if listing else f"{text}."


def sentences(runs: xr.Dataset, study: Study, metric: str, edges: MapEdges | None = None) -> list[str]:
    """Say in at most three sentences where on a map stages swing or hunt, and where your own stage is."""
    return _all_sentences(runs, study, metric, edges)[:MOST_SENTENCES]


def details(runs: xr.Dataset, study: Study, metric: str, edges: MapEdges | None = None) -> list[str]:
    """Return further statements on a map."""
    shares = statements(runs, metric)[0 if message(runs, metric, edges) else 1 :]
    return [*shares, *_all_sentences(runs, study, metric, edges)[MOST_SENTENCES:], *caveats(runs, metric)]


def facts(runs: xr.Dataset, metric: str) -> list[tuple[str, list[str]]]:
    """Return the table of a map: what was varied, how accurately, the cells with every word, and what words mean."""
    rows = [("Stage", name)] if (name := str(runs.attrs.get("name", ""))) else []
    rows += [(axis.quantity, f"{axis.span()} ({axis.key})") for axis in axes_of(runs)]
    rows.append(("Relative tolerance", f"{float(runs.attrs['rtol']):g}"))
    for name in map_words.tallied():
        rows += [(map_words.variable(name), words)] if (words := map_words.tally(runs, name)) else []
    rows += meanings(runs)
    judged = metric in map_words.tallied()
    rows += [("Criterion", text)] if (text := runs[metric].attrs.get("criterion")) and not judged else []
    links = json.loads(runs.attrs.get("links", "{}"))
    rows += [("Links", "; ".join(f"{key} = {text}" for key, text in links.items()))] if links else []
    rows += [(f"Without result: {grouped(number)}", reason) for reason, number in failures(runs).items()]
    return [(label, [text]) for label, text in rows]


def basis(runs: xr.Dataset) -> str:
    """Say how the runs were made, and by which rules they are judged."""
    counted = "peaks" in runs and bool((runs["peaks"] > 0).any())
    beside = f", and peaks are maxima of the position {PEAK_RULE} (Fix, Univ. of Twente, Sec. 3.2.2)" * counted
    return (
        f", relative tolerance {float(runs.attrs['rtol']):g}. Outcomes tell what each run does at its end, verdicts "
        f"are on the stage by what attracts it, from fewer starts than friso check tries{beside}"
    )


def _all_sentences(runs: xr.Dataset, study: Study, metric: str, edges: MapEdges | None) -> list[str]:
    """Return the sentences on a map, the most important first."""
    reasons = [f"{count} cells have no result: {reason}." for reason, count in failures(runs).items()]
    return [*loop_first(study.stage), *answers(runs, metric, edges), *reasons]


def answers(runs: xr.Dataset, metric: str, edges: MapEdges | None = None) -> list[str]:
    """Return what a map says first: its message or, without one, its first statement; and where the stage itself is."""
    says = message(runs, metric, edges)
    subject = subject_of(runs) or "The stage"
    first = [f"{subject}: {says[0].lower()}{says[1:]}."] if says else statements(runs, metric)[:1]
    return [*first, *own_place(runs, metric, edges)]


def own_place(runs: xr.Dataset, metric: str, edges: MapEdges | None = None) -> list[str]:
    """Say how far the stage as given is from the next edge of hunting along each axis.

    With `edges`, the distance is that of the edge itself, and not of cells next to it. Nothing is said for a stage that
    is not on the map, or a map without verdicts.
    """
    machine = machine_of(runs)
    if (
        metric == "outcome"
        or metric not in worded(verdicts=True)
        or metric not in runs
        or machine is None
        or SAMPLE in runs.dims
    ):
        return []
    axes, flat = axes_of(runs), {**dict.fromkeys(SCALINGS, 1.0), **machine.flat()}
    own = [flat[axis.key] for axis in axes if axis.key in flat and _spans(axis, flat[axis.key])]
    if len(own) < len(axes):
        return []
    words = np.asarray(runs[metric].transpose(*(axis.key for axis in axes)).values).astype(str)
    words = words[np.ix_(*(axis.places for axis in axes))]
    at = tuple(int(np.abs(np.log(axis.positions / value)).argmin()) for axis, value in zip(axes, own, strict=True))
    verdict = words[at]
    if edges and edges.verdict:
        verdict = edges.verdict
    if verdict not in (*ATTRACTED, *_QUIET):
        return []
    lines = [words[(*at[:k], slice(None), *at[k + 1 :])] for k in range(len(axes))]
    shown = [in_its_unit(axis, runs) for axis in axes]
    ways = [
        way for axis, line, own_cell in zip(shown, lines, at, strict=True) for way in _changes(axis, line, own_cell)
    ]
    if edges and len(edges.own) == len(axes):
        ways = [
            f"{axis.quantity} {_change(line, plain, runs, change)}"
            for axis, plain, line in zip(shown, axes, edges.own, strict=True)
            for change in line.beside
        ]
    exact = bool(edges and edges.verdict) or all(
        np.isclose(axis.positions[k], value, rtol=1e-3) for axis, value, k in zip(axes, own, at, strict=True)
    )
    subject = "Your stage" if exact else "The cell nearest to your stage"
    verb = verdict if verdict in ("hunts", "settles") else f"is {verdict}"
    by = f" {basis}" if (basis := metrics()[metric].basis) else ""
    does = "begins" if verdict in _QUIET else "ends"
    nowhere = "; no cell in line with it hunts" if all(np.isin(line, _QUIET).all() for line in lines) else ""
    where = f"; hunting {does} at {listed(ways, 'or')}" if ways else nowhere
    return [f"{subject} {verb}{by}{where}."]


def _spans(axis: CellAxis, value: float) -> bool:
    """Tell whether a value lies within an axis of numbers."""
    return bool(not axis.words and 0 < axis.positions.min() <= value <= axis.positions.max())


def _changes(axis: CellAxis, words: np.ndarray, at: int) -> list[str]:
    """Say between which cells along an axis hunting begins or ends, next to the cell `at`.

    `words` are the verdicts of the cells, shape (n,). A side gives no text if a cell without a verdict comes first
    there.
    """
    attracted = np.isin(words, ATTRACTED)
    differ = np.flatnonzero((attracted != attracted[at]) | ~np.isin(words, (*ATTRACTED, *_QUIET)))
    ends = [(k, k + 1) for k in differ[differ < at][-1:] if words[k] in (*ATTRACTED, *_QUIET)]
    ends += [(k - 1, k) for k in differ[differ > at][:1] if words[k] in (*ATTRACTED, *_QUIET)]
    values = axis.positions.tolist()
    return [f"{axis.quantity} {range_with_unit(values[low], values[high], axis.unit, 4)}" for low, high in ends]


def in_its_unit(axis: CellAxis, runs: xr.Dataset) -> CellAxis:
    """Return an axis as sentences name it: factors as values in Hz and N, and which friction an axis of friction is."""
    links = json.loads(runs.attrs.get("links", "{}"))
    machine, varied = machine_of(runs), {*map(str, runs.coords), *links}
    varied |= {*followed(machine, dict.fromkeys(varied, 1.0))} if machine else set()
    held = map_words.friction_held(axis.key, varied)
    values = _multiplied(axis, runs)
    if values is None:
        return replace(axis, quantity=f"{map_words.in_sentence(axis.key)}{held}")
    name, own, unit, factor = values
    if own is None:
        return replace(axis, quantity=factor, unit="times yours")
    return replace(axis, quantity=name, unit=unit, positions=own * axis.positions)


def _multiplied(axis: CellAxis, runs: xr.Dataset) -> tuple[str, float | None, str, str] | None:
    """Return what an axis of factors multiplies: its name, the stage's own value, its unit, and the factor's name.

    The value is None for a stage without such a number; the result is None for an axis of a key.
    """
    machine = machine_of(runs)
    if machine is None or axis.key not in SCALINGS:
        return None
    flat = machine.flat()
    return {
        "speed": (machine.controller.bandwidth_name, bandwidth(flat), "Hz", "controller speed"),
        "friction": ("static friction (all friction scaled)", flat.get(map_words.STATIC), "N", "all friction"),
    }[axis.key]


def loop_first(stage: Stage) -> list[str]:
    """Say that the loop of the stage as given is unstable, if it is."""
    from friso.hunting import unstable  # imported here, because looking at a map needs no engine

    return unstable_loop(unstable(stage))


def map_document(
    runs: xr.Dataset, study: Study, store: Path | None, metric: str, edges: MapEdges | None = None
) -> dict[str, Any]:
    """Return the axes and the results."""
    criteria = {name: text for name in map(str, runs.data_vars) if (text := runs[name].attrs.get("criterion"))}
    document = {
        "stage": study.stage.name,
        "store": str(store) if store else None,
        "axes": {
            axis.name: {
                "points": len(axis.values),
                "unit": axis.unit,
                "first": axis.values[0].item(),
                "last": axis.values[-1].item(),
            }
            for axis in study.axes
        },
        "cells": study.cells,
        "rtol": study.rtol,
        "conclusion": " ".join([*loop_first(study.stage), *answers(runs, metric, edges), *statements(runs, metric)]),
        "edges": [] if edges is None else [_own_line(line) for line in edges.own],
        "outcomes": word_counts(runs, "outcome"),
        "verdicts": word_counts(runs, "verdict") or None,
        "sketched_verdicts": word_counts(runs, "sketch") or None,
        "attractors": text_counts(runs, "attractor") or None,
        "criteria": criteria,
    }
    return plain_json(document)


def _own_line(line: OwnLine) -> dict[str, Any]:
    """Return where hunting begins and ends along an axis, at the stage's own value of the other: values in SI."""
    return {"axis": line.key, "own": line.own, "hunts": line.attracts, "changes": line.changes.tolist()}
