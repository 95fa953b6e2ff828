"""What an identification found, in words that the terminal and the page share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from friso.identify.response.analysis import Bench
from friso.views.drawing.figure import GREEN, ORANGE, VERMILLION
from friso.views.identify.facts import Part, part_of
from friso.views.identify.numbers import interval_text, name_of, percent, value_text, with_interval, within

if TYPE_CHECKING:
    from friso.identify.estimate import Estimate
    from friso.identify.method import Experiment, Identification, Prediction
    from friso.identify.sources import Given

COLUMNS = ("Quantity", "Value", "95 % interval", "How, or why there is no value")
"""Of the table of estimates."""

LEFT = "not shown"
"""Stands for the value of what the logs do not show."""

NO_STAGE = (
    "No stage file is written: without moves, friso cannot make one up around the logs. One that is given (--stage) "
    "takes over what they show."
)

POOR = 0.5
"""Relative error of the force, or of a response, from which on little of another log is predicted."""


@dataclass(frozen=True)
class Row:
    """A line of the table of estimates: whether the value is shown, and the texts of `COLUMNS`."""

    shown: bool
    texts: tuple[str, ...]


def headline(found: Identification) -> list[tuple[str, str]]:
    """What is shown, what is not and why, and how well other logs are predicted; each with its colour."""
    shown = [each for each in ordered(found.estimates) if each.shown]
    benches = [(GREEN, sentence) for sentence in map(_bench, found.experiments) if sentence]
    said = []
    if shown:
        said.append((GREEN, f"Shown: {'; '.join(f'{within(each.name)} {with_interval(each)}' for each in shown)}."))
    elif not benches:
        said.append((VERMILLION, "No key of the stage file is shown by these logs."))
    said += benches
    if found.stage is None:
        said.append((ORANGE, NO_STAGE))
    if len(shown) < len(found.estimates):
        said.append((ORANGE, f"Not shown: {missing(ordered(found.estimates))}."))
    return said


def _bench(it: Experiment) -> str:
    """The modes of a frequency response, and what its units keep from the stage file."""
    if not isinstance(it.result, Bench):
        return ""
    bench, said = it.result, []
    names = ("total mass", "antiresonance frequency", "resonance frequency")
    if bench.two_masses is not None:
        said = [f"{name} {with_interval(bench.two_masses[name])}" for name in names]
    elif bench.modes is not None:
        said = [f"{each.name} {with_interval(each)}" for each in bench.modes.estimates if each.unit == "Hz"]
    units = bench.driven.channels.input_unit, bench.driven.channels.output_unit
    told = f"Frequency response: {'; '.join(said)}." if said else ""
    if units == ("N", "m"):
        return told
    scale = (
        f"The force stands in {units[0]} and the motion in {units[1]}: only in N and m do masses and stiffness enter "
    )
    return f"{told} {scale}the stage file (--scale).".strip()


def missing(estimates: Sequence[Estimate]) -> str:
    """What is not shown, together with its reason, which several may share."""
    names: dict[str, list[str]] = {}
    for each in estimates:
        if not each.shown:
            names.setdefault(each.reason, []).append(within(each.name))
    return "; ".join(f"{', '.join(group)} ({reason})" for reason, group in names.items())


def prediction(it: Prediction) -> tuple[str, str]:
    """How well another log is predicted."""
    if it.errors is not None:
        worst = it.errors.force
        said = (
            f"{it.log.name}, predicted: relative errors of position {percent(it.errors.position)}, velocity "
            f"{percent(it.errors.velocity)}, acceleration {percent(it.errors.acceleration)}, force "
            f"{percent(it.errors.force)}."
        )
    else:
        worst = max(it.response_errors, default=math.nan)
        said = f"{it.log.name}, predicted: relative error of the response {outputs(it.response_errors)}."
    return (GREEN if worst < POOR else VERMILLION), said


def outputs(errors: Sequence[float]) -> str:
    """Relative errors of the outputs, the driven mass's first."""
    names = ("driven mass", "other mass")
    return ", ".join(f"{percent(error)} ({name})" for name, error in zip(names, errors, strict=False))


def estimate_rows(found: Identification) -> list[Row]:
    """The table of estimates, in words of `COLUMNS`."""
    return [_row(each) for each in ordered(found.estimates)]


def ordered(estimates: Sequence[Estimate]) -> list[Estimate]:
    """The estimates in the order of the stage file's tables; others last."""
    tables = ("masses", "friction", "bias", "joint")
    places = {name: number for number, name in enumerate(tables)}
    return sorted(estimates, key=lambda each: places.get(each.name.split(".")[0], len(tables)))


def _row(it: Estimate) -> Row:
    value = value_text(it) if it.shown else LEFT
    return Row(it.shown, (name_of(it.name), value, interval_text(it), it.reason or it.method))


def parts(found: Identification) -> list[Part]:
    """The experiments, in words."""
    return [part_of(each, label) for each, label in zip(found.experiments, labels(found), strict=True)]


def labels(found: Identification) -> list[str]:
    """A name for every experiment, of which those of its figures are made: its kind, numbered where there are more."""
    kinds = [each.kind for each in found.experiments]
    return [
        kind.replace("-", "_") + (str(kinds[: i + 1].count(kind)) if kinds.count(kind) > 1 else "")
        for i, kind in enumerate(kinds)
    ]


def read_rows(given: Sequence[Given]) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """For every file: what it counts as and why, what was read, and what to know before believing it."""
    return [(_counts_as(each), (*each.source.read, *_kept(each)), _warned(each)) for each in given]


def _counts_as(it: Given) -> str:
    return f"{it.path.name}: {it.kind} ({it.reason})"


def _kept(it: Given) -> tuple[str, ...]:
    return () if it.kept is None else (f"mapping kept in {it.kept.name}",)


def _warned(it: Given) -> tuple[str, ...]:
    return getattr(it.source, "warnings", ())


def answer(found: Identification, given: Sequence[Given], predictions: Sequence[Prediction]) -> list[str]:
    """The lines of the terminal: what was read, what was found, and what to know about it."""
    lines = []
    for title, read, warned in read_rows(given):
        lines += [title, *(f"  {each}" for each in read), *(f"  note: {each}" for each in warned)]
    for part in parts(found):
        lines += ["", part.title, *(f"  {each}" for each in part.sentences)]
        lines += [*(f"  {name}: {text}" for name, text in part.facts), *(f"  note: {each}" for each in part.warnings)]
    rows = estimate_rows(found)
    lines += [*(["", *_aligned(rows)] if rows else []), "", *(sentence for _, sentence in headline(found))]
    lines += [prediction(each)[1] for each in predictions]
    return lines + [f"note: {each}" for each in found.warnings]


def _aligned(rows: Sequence[Row]) -> list[str]:
    """Quantity, value and interval in columns; the reason where there is no value."""
    table = [COLUMNS[:-1], *(row.texts[:-1] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in table]
