"""Write an identification in words for the terminal and the page."""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from friso.axis import KINDS as AXES
from friso.axis import axis_shown, unit_shown
from friso.identification.estimate_words import interval_text, name_of, value_text, with_interval, within
from friso.identification.kinds import KINDS
from friso.identification.logs.log import Log
from friso.identification.method import Experiment, Identification, Prediction, nothing_learnt
from friso.identification.ways import ways_to_show
from friso.shown.drawing.figure import GREEN, ORANGE, VERMILLION

if TYPE_CHECKING:
    from friso.identification.estimate import Estimate
    from friso.identification.kind import Facts, Source
    from friso.identification.sources import LogFile

COLUMNS = ("Quantity", "Value", "95 % interval", "Method, or reason")
"""Columns of the table of estimates."""

LEFT = "not identified"
"""Text in place of a value that the logs do not show."""

NO_STAGE = (
    "No stage file is written: these logs do not describe a whole machine. Give the rest with --stage; the identified "
    "values replace those in it."
)

SPEEDS_UP = "If this log often speeds up, it shows a whole machine as moves (--as moves)."
"""Sentence for logs of constant speeds without a stage."""

NO_NEWTONS = "No stage file is written: its keys need the force in {}."
"""Sentence for moves whose force is in another unit than newtons."""

NOTHING_HOLDS = "No stage file is written, since nothing in it would be identified."

POOR_PREDICTION = 0.5
"""Relative error of force or response above which the prediction of another log is called poor."""


@dataclass(frozen=True)
class ExperimentSummary:
    """An experiment in words.

    Fields are a `label`, from which its figures are named, a title, sentences, numbers by name, and warnings.
    """

    label: str
    title: str
    sentences: tuple[str, ...]
    facts: Facts
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class EstimateRow:
    """A row of the table of estimates: whether the value is shown, and the texts of `COLUMNS`."""

    determined: bool
    texts: tuple[str, ...]


def headline(identification: Identification) -> list[tuple[str, str]]:
    """Say what is identified, what is not, and why; each sentence has a colour."""
    return [(colour, axis_shown().text(sentence)) for colour, sentence in _headline(identification)]


def _headline(identification: Identification) -> list[tuple[str, str]]:
    """Say what is identified, with doubts, and what is not; each sentence has a colour."""
    estimates = ordered(identification.estimates)
    visible = [estimate for estimate in estimates if estimate.determined]
    effects = [estimate for estimate in visible if not estimate.low <= 0 <= estimate.high]
    headlines = [KINDS[experiment.kind].headline(experiment.result) for experiment in identification.experiments]
    headlines = [sentence for sentence in headlines if sentence]
    bounded = [one for one in estimates if not one.determined and 0 < one.low < one.high < np.inf]
    doubts = [(VERMILLION if identification.failed else ORANGE, f"{doubt}.") for doubt in identification.doubts]
    first = identification.failed and not (effects and len(identification.experiments) > 1)
    lines = doubts if first else []
    if effects:
        values = "; ".join(f"{within(estimate.name)} {with_interval(estimate)}" for estimate in effects)
        lines.append((GREEN, f"Identified: {values}."))
    elif bounded:
        bounds = ", ".join(f"{within(one.name)} ({interval_text(one)})" for one in bounded)
        lines.append((ORANGE, f"Known to lie in an interval too wide for a value: {bounds}."))
    elif not headlines:
        lines.append((VERMILLION, "These logs determine no key of the stage file."))
    lines += [(GREEN, sentence) for sentence in headlines]
    lines += [] if first else doubts
    nothing = [estimate for estimate in visible if estimate not in effects]
    for colour, words, absent in ((GREEN, "None found", True), (ORANGE, "Not told from zero", False)):
        some = [f"{within(one.name)} ({interval_text(one)})" for one in nothing if (one.name in ABSENT) == absent]
        lines += [(colour, f"{words}: {', '.join(some)}.")] if some else []
    if identification.stage is None and (estimates or not headlines):
        lines.append((ORANGE, _why_no_stage(identification)))
    if len(visible) < len(estimates):
        lines.append((ORANGE, f"Not identified: {missing(estimates)}."))
        done = {experiment.kind for experiment in identification.experiments}
        lines += [(ORANGE, f"What would show it: {ways}.") for ways in [_ways(estimates, done)] if ways]
    return lines


def _why_no_stage(identification: Identification) -> str:
    """Say why no stage file is written."""
    if identification.failed or nothing_learnt(identification.estimates, False):
        return NOTHING_HOLDS
    shown = axis_shown()
    if shown != AXES[shown.name]:
        newtons = AXES[shown.name].force
        return f'{NO_NEWTONS.format(newtons)} --scale force="NUMBER {newtons}/{shown.force}" tells it.'
    logs = [log for experiment in identification.experiments for log in experiment.logs if isinstance(log, Log)]
    around = any(KINDS[experiment.kind].makes_stage for experiment in identification.experiments)
    if around and any("force" in log.units for log in logs):
        return NO_NEWTONS.format(unit_shown("N"))
    speeds = {experiment.kind for experiment in identification.experiments} == {"constant-speed"}
    return f"{NO_STAGE} {SPEEDS_UP}" if speeds else NO_STAGE


ABSENT = ("bias.cart", "bias.stage", "friction.viscous_asymmetry")
"""Keys that are usually 0; an interval that contains 0 shows no effect."""


def _ways(estimates: Sequence[Estimate], done: AbstractSet[str]) -> str:
    """Name the experiments that would show the quantities that are not identified.

    Kinds of experiment in `done` are left out: why their logs were not enough is said elsewhere.
    """
    names: dict[str, list[str]] = {}
    for estimate in estimates:
        left = ways_to_show(estimate.name, done)
        if left and not estimate.determined:
            names.setdefault(left, []).append(within(estimate.name))
    return "; ".join(f"{', '.join(group)}: {way}" for way, group in names.items())


def missing(estimates: Sequence[Estimate]) -> str:
    """Say what is not identified; keys with one reason are listed together."""
    names: dict[str, list[str]] = {}
    for estimate in estimates:
        if not estimate.determined:
            names.setdefault(estimate.reason, []).append(within(estimate.name))
    return "; ".join(f"{', '.join(group)} ({reason})" for reason, group in names.items())


def prediction_line(prediction: Prediction) -> tuple[str, str]:
    """Say how well another log is predicted, with the colour of the sentence."""
    kind, result = KINDS[prediction.kind], prediction.result
    colour = GREEN if kind.prediction_error(result) < POOR_PREDICTION else VERMILLION
    return colour, f"Prediction of {prediction.log.name}: {kind.prediction_sentence(result)}"


def estimate_rows(identification: Identification) -> list[EstimateRow]:
    """Return the table of estimates, in words of `COLUMNS`."""
    return [_row(estimate) for estimate in ordered(identification.estimates)]


def ordered(estimates: Sequence[Estimate]) -> list[Estimate]:
    """Return the estimates in the order of the stage file's tables; others last."""
    tables = ("masses", "friction", "bias", "joint")
    places = {name: number for number, name in enumerate(tables)}
    return sorted(estimates, key=lambda estimate: places.get(estimate.name.split(".")[0], len(tables)))


def _row(estimate: Estimate) -> EstimateRow:
    """Write an estimate as a line of the table."""
    value = value_text(estimate) if estimate.determined else LEFT
    why = axis_shown().text(estimate.reason or estimate.method)
    return EstimateRow(estimate.determined, (name_of(estimate.name), value, interval_text(estimate), why))


def summaries(identification: Identification) -> list[ExperimentSummary]:
    """Return each experiment in words."""
    several = zip(identification.experiments, labels(identification), strict=True)
    return [_summary(experiment, label) for experiment, label in several]


def _summary(experiment: Experiment, label: str) -> ExperimentSummary:
    """Write an experiment in words, with the `label` from which its figures are named."""
    kind, result, axis = KINDS[experiment.kind], experiment.result, axis_shown()
    facts = tuple((name, axis.text(fact)) for name, fact in kind.facts(result))
    return ExperimentSummary(
        label,
        f"{kind.title}: {', '.join(log.name for log in experiment.logs)}",
        tuple(map(axis.text, kind.sentences(result))),
        (*facts, *(_used(experiment.logs) if kind.longest else ())),
        tuple(map(axis.text, kind.warnings(result))),
    )


def _used(logs: Sequence[Source]) -> Facts:
    """Return a row on how many samples were used, for logs with gaps; empty if no log has any.

    Only the longest stretch without a gap is used.
    """
    gapped = [log for log in logs if isinstance(log, Log) and len(log.segments) > 1]
    if not gapped:
        return ()
    longest = [max(part.stop - part.start for part in log.segments) for log in gapped]
    texts = [f"{most} of {len(log.time)}" for most, log in zip(longest, gapped, strict=True)]
    return (("Samples used (longest stretch without gaps)", ", ".join(texts)),)


def labels(identification: Identification) -> list[str]:
    """Return for every experiment a short label, with which the names of its figures begin.

    The label is the kind of experiment, with a number if several are of one kind.
    """
    kinds = [experiment.kind for experiment in identification.experiments]
    return [
        kind.replace("-", "_") + (str(kinds[: i + 1].count(kind)) if kinds.count(kind) > 1 else "")
        for i, kind in enumerate(kinds)
    ]


def read_rows(files: Sequence[LogFile]) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Return for each file its kind with the reason, what was read, and warnings."""
    rows = []
    for file in files:
        read = file.source.read
        if file.mapping_file is not None:
            read = (*read, f"mapping kept in {file.mapping_file.name}")
        rows.append((f"{file.path.name}: {file.kind} ({file.reason})", read, getattr(file.source, "warnings", ())))
    return rows


def sentences(identification: Identification, predictions: Sequence[Prediction]) -> list[str]:
    """Return the answer, how well other logs are predicted, and notes."""
    lines = [sentence for _, sentence in headline(identification)]
    lines += [prediction_line(prediction)[1] for prediction in predictions]
    lines += [identification.stage.note] if identification.stage and identification.stage.note else []
    return lines + [f"note: {axis_shown().text(warning)}" for warning in identification.warnings]


def details(identification: Identification, files: Sequence[LogFile]) -> list[str]:
    """Return the experiments behind the estimates, and what was read, line by line."""
    lines = []
    for part in summaries(identification):
        lines += ["", part.title, *(f"  {sentence}" for sentence in part.sentences)]
        lines += [f"  {name}: {text}" for name, text in part.facts]
        lines += [f"  note: {warning}" for warning in part.warnings]
    for title, read, warned in read_rows(files):
        lines += ["", title, *(f"  {text}" for text in read), *(f"  note: {text}" for text in warned)]
    return lines
