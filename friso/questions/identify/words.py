"""Write an identification in words, figures and blocks, for the terminal and the page.

A stage is also judged against its logs: whether a log contradicts the verdict, and which single change would explain
it.

Figures show all intervals, each experiment, and the logs predicted. Beside the page stand the stage and its
correlations as files.
"""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.axis import KINDS as AXES
from friso.axis import axis_shown, unit_shown
from friso.identification.estimate import (
    Estimate,
    interval_text,
    name_of,
    value_text,
    ways_to_show,
    with_interval,
    within,
)
from friso.identification.estimate_documents import key_document
from friso.identification.kind import Facts, Source
from friso.identification.kinds import KINDS
from friso.identification.logs.log import Log
from friso.identification.method import Experiment, Identification, Prediction, nothing_learnt
from friso.identification.sources import LogFile
from friso.identification.stage_file import with_origins
from friso.quantities import plain_factor
from friso.shown.blocks import AnswerBlock, Content
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import BLUE, GREEN, ORANGE, VERMILLION, Axis, Figure, Markers, Panel, Series, Symbol
from friso.shown.text import listed, swing_with_unit, with_unit
from friso.stage import Stage
from friso.stage.correlations import correlations_file, correlations_text
from friso.studies.contradiction import CHANGES, Contradiction, ExplainingChange, Standing

if TYPE_CHECKING:
    from friso.questions.identify.question import IdentifyAnswer


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
    first, begun = first or identification.interrupted, identification.interrupted and not identification.experiments
    lines = doubts if first else []
    if effects:
        values = "; ".join(f"{within(estimate.name)} {with_interval(estimate)}" for estimate in effects)
        lines.append((GREEN, f"{'At first' if begun else 'Identified'}: {values}."))
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
    if identification.interrupted:
        return "No stage file is written: the analysis was interrupted."
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


MOST_EXPLANATIONS = 3
"""Most changes that an answer names as explanations of a log."""


def against_sentences(name: str, stage: Stage, result: Contradiction) -> list[str]:
    """Say what the log called `name` shows, whether the stage does so, and which change would explain a difference."""
    standing = result.standing
    machine = (
        f"hunts, {_swing(standing)}"
        if standing.hunts
        else f"rests for {with_unit(standing.time, 's')} while its reference stands"
    )
    does = f"hunts, {_swing(result)}" if result.attracts else "does not hunt"
    doubt = "" if result.certain else " (not certain: its values, or what attracts it, are not)"
    if not standing.hunts and not standing.rests:
        return [f"{name} does not tell: the machine neither rests nor swings evenly; the stage {does}{doubt}."]
    if result.open and result.attracts and result.may_rest:
        return [f"{name} does not tell: the machine {machine}; the stage may rest, too, and {does} after other moves."]
    if result.open:
        return [f"{name} does not tell: the machine {machine}, too briefly for that; the stage {does}{doubt}."]
    if result.agrees:
        return [f"{name} agrees with the stage: the machine {machine}; the stage {does}{doubt}."]
    says = f"{name} contradicts the stage: the machine {machine}; the stage {does}{doubt}."
    nearest = result.explanations[:MOST_EXPLANATIONS]
    if not nearest:
        return [says, "No single change of friction, masses or the controller's speed explains that."]
    changes = listed([_change(stage, one) for one in nearest], "or")
    return [says, f"One change would explain that, the smallest first: {changes}."]


def _swing(result: Standing | Contradiction) -> str:
    """Write the size and period of the swing that a log shows, or of that in which a stage hunts."""
    size = swing_with_unit(result.swing or 0.0, result.middle, "m")
    return f"{size} every {with_unit(result.period or 0.0, 's')}"


def _change(stage: Stage, change: ExplainingChange) -> str:
    """Write a change by its factor, and by the value of its key if it has a single one."""
    times = f"{change.name} {plain_factor(change.factor)} times"
    keys, flat = CHANGES[change.name], stage.flat()
    if len(keys) != 1:
        return times
    return f"{times} ({with_unit(change.factor * flat[keys[0]], stage.numeric_keys()[keys[0]].unit)})"


def _numbers(result: Standing | Contradiction) -> dict[str, Any]:
    """Return size, middle and period of the swing that a log shows, or of that in which a stage hunts."""
    return {"swing_m": result.swing, "offset_m": result.middle, "period_s": result.period}


def against_document(name: str, result: Contradiction) -> dict[str, Any]:
    """Return what a log shows, what the stage does, and the changes that explain a difference."""
    changes: Sequence[dict[str, Any]] = [
        {"change": one.name, "factor": one.factor, "swing_m": one.swing, "period_s": one.period}
        for one in result.explanations
    ]
    standing = result.standing
    return {
        "log": name,
        "machine": {"hunts": standing.hunts, **_numbers(standing)},
        "stands_s": standing.time,
        "stage": {"hunts": result.attracts, "certain": result.certain, **_numbers(result)},
        "agrees": result.agrees,
        "explanations": changes,
    }


SHORT = {
    "masses.cart": "cart",
    "masses.stage": "stage",
    "friction.coulomb": "Coulomb",
    "friction.viscous_asymmetry": "asymm.",
    "friction.stribeck_velocity": "Stribeck v",
    "friction.stribeck_exponent": "exponent",
    "friction.bristle_stiffness": "bristle k",
    "friction.bristle_damping": "bristle d",
    "bias.cart": "constant",
    "bias.stage": "constant",
    "joint.stiffness": "joint k",
    "joint.damping": "joint d",
}
"""Short names of keys for the limited room beside an axis."""


def identify_figures(identification: Identification, predictions: Sequence[Prediction]) -> list[Figure]:
    """Return all figures, in the order in which they are read."""
    figures, subject = _intervals(identification), identification.stage.name if identification.stage else ""
    for experiment, label in zip(identification.experiments, labels(identification), strict=True):
        figures += KINDS[experiment.kind].figures(experiment.result, experiment.logs, f"identify_{label}")
    for number, prediction in enumerate(predictions, 1):
        figures += KINDS[prediction.kind].prediction_figures(prediction.log, prediction.result, number)
    return [replace(figure, subject=subject) for figure in figures]


def _intervals(identification: Identification) -> list[Figure]:
    """Draw the half-width of every key's interval, relative to its value.

    For a key without a value, the half-width is relative to the middle of the interval.
    """
    bounded = [
        estimate
        for estimate in ordered(identification.estimates)
        if np.isfinite([estimate.low, estimate.high]).all() and estimate.high > estimate.low
    ]
    if len(bounded) < 2:
        return []
    bounded = bounded[::-1]  # the first on top
    half = np.array([estimate.half_width for estimate in bounded])
    middle = np.array(
        [abs(estimate.value) if estimate.determined else (estimate.low + estimate.high) / 2 for estimate in bounded]
    )
    share = np.minimum(100 * half / np.maximum(np.abs(middle), 1e-3 * half), 100.0)
    determined, lost = np.array([estimate.determined for estimate in bounded]), share >= 100
    visible = determined & ~lost
    places = np.arange(len(bounded), dtype=float)
    left = 0.5 * float(share.min())
    stems = [
        Series(np.array([left, x]), np.full(2, y), "", BLUE if ok else ORANGE, width=2.0)
        for x, y, ok in zip(share[~lost], places[~lost], visible[~lost], strict=True)
    ]
    kinds: tuple[tuple[np.ndarray, str, str, Symbol], ...] = (
        (visible, "shown", BLUE, "circle"),
        (~determined & ~lost, "not shown: the range left", ORANGE, "triangle"),
        (lost, "none found", ORANGE, "cross"),
    )
    points = [
        Markers(share[chosen], places[chosen], label, colour, symbol)
        for chosen, label, colour, symbol in kinds
        if chosen.any()
    ]
    x = Axis("Half the interval, in % of the value", "", (left, 150.0), log=True)
    y = Axis(
        "",
        "",
        (-0.6, len(bounded) - 0.4),
        words=tuple(SHORT.get(estimate.name, estimate.name.partition(".")[2]) for estimate in bounded),
    )
    caption = "Shorter is better known. A cross at 100 %: not even the sign or order of magnitude is."
    panel = Panel("", x, y, tuple(stems), tuple(points))
    return [Figure("identify_intervals", "How well each quantity is known", caption, (panel,))]


STAGE = "identified.toml"


def blocks(answer: IdentifyAnswer) -> list[AnswerBlock]:
    """Return the blocks: what was identified, and the verdict on the stage if that was asked for."""
    result, inputs, predictions, checked = answer.result, answer.inputs, answer.predictions, answer.checked
    identified = AnswerBlock(
        sentences=sentences(result, predictions),
        columns=COLUMNS[1:],
        rows=[(first, rest) for first, *rest in (row.texts for row in estimate_rows(result))],
        details=details(result, inputs),
        draw=lambda: identify_figures(result, predictions),
        numbers=lambda: identify_document(result, inputs, predictions),
    )
    besides = AnswerBlock(
        sentences=_compared_words(answer),
        numbers=lambda: plain_json({"against": [against_document(name, one) for name, one in answer.compared.items()]}),
    )
    against = [besides] if answer.suspect is not None else []
    if checked is None:
        return [*against, identified]
    verdict = AnswerBlock(sentences=checked.sentences(), numbers=lambda: {"check": checked.document()})
    tables = [
        AnswerBlock(title=table.title, columns=table.columns, rows=table.rows, behind=table.behind)
        for table in checked.tables()
    ]
    return [*against, verdict, identified, *tables]


def _compared_words(answer: IdentifyAnswer) -> list[str]:
    """Say of each log whether it contradicts the verdict on the suspected stage; nothing without one."""
    stage = answer.suspect
    if stage is None:
        return []
    return [text for name, one in answer.compared.items() for text in against_sentences(name, stage, one)]


def _asked_besides(answer: IdentifyAnswer) -> list[str]:
    """Return what the answer says besides the estimates: the comparison with a stage, and the verdict."""
    return [*_compared_words(answer), *(answer.checked.sentences() if answer.checked else [])]


def page_values(answer: IdentifyAnswer) -> dict[str, Any]:
    """Return what the page shows beside the figures: estimates, experiments, predictions, and logs as read."""
    identification = answer.result
    several = zip(identification.experiments, labels(identification), strict=True)
    return {
        "verdicts": [*((ORANGE, text) for text in _asked_besides(answer)), *headline(identification)],
        "columns": COLUMNS,
        "rows": estimate_rows(identification),
        "files": read_rows(answer.inputs),
        "parts": summaries(identification),
        "predicted": [prediction_line(prediction) for prediction in answer.predictions],
        "warnings": [axis_shown().text(warning) for warning in identification.warnings],
        "opening": [f"identify_{label}_{KINDS[experiment.kind].opening}" for experiment, label in several],
    }


def further_files(answer: IdentifyAnswer) -> dict[str, Content]:
    """Return the stage file, and the correlations of its keys.

    Those of an earlier run are removed if this run has none.
    """
    identification, stage, correlations = answer.result, answer.result.stage, None
    if stage is not None and identification.correlations.keys:
        correlations = correlations_text(identification.correlations, stage)
    return {
        STAGE: None if stage is None else with_origins(stage.to_toml(), identification.origins),
        correlations_file(Path(STAGE)).name: correlations,
    }


def identify_document(
    identification: Identification, files: Sequence[LogFile], predictions: Sequence[Prediction]
) -> dict[str, Any]:
    """Return the JSON document of an identification, without the files written.

    It has the conclusion, the logs, the experiments with their numbers, all estimates, and predictions of other logs.
    """
    document = {
        "conclusion": headline(identification)[0][1],
        "stage": identification.stage.name if identification.stage else None,
        "logs": [_log(file) for file in files],
        "estimates": [key_document(estimate) for estimate in identification.estimates],
        "experiments": [_experiment(experiment) for experiment in identification.experiments],
        "predictions": [
            {"log": prediction.log.name, **KINDS[prediction.kind].prediction_numbers(prediction.result)}
            for prediction in predictions
        ],
        **entries(identification, "failed", "interrupted"),
        "doubts": [axis_shown().text(doubt) for doubt in identification.doubts],
        "warnings": [axis_shown().text(warning) for warning in identification.warnings],
    }
    return plain_json(document)


def _log(file: LogFile) -> dict[str, Any]:
    """Return for the document which kind of log a file holds and why, and what was read."""
    return {
        "file": str(file.path),
        **entries(file, "kind", "reason"),
        "mapping_file": None if file.mapping_file is None else str(file.mapping_file),
        **_content(file.source),
        **entries(file.source, "read"),
    }


def _content(source: Source) -> dict[str, Any]:
    """Return what a file holds: signals over time, or a response."""
    if not isinstance(source, Log):
        return {"roles": {}, "lines": len(source.frequency), "unit": source.unit, "warnings": []}
    return {
        "roles": {role: unit_shown(source.unit(role)) for role in source.signals},
        "samples": len(source.time),
        **entries(source, "sample_time_s", "warnings"),
        "segments": len(source.segments),
    }


def _experiment(experiment: Experiment) -> dict[str, Any]:
    """Return an experiment with its numbers and estimates, for the document."""
    return {
        "kind": experiment.kind,
        "logs": [log.name for log in experiment.logs],
        **KINDS[experiment.kind].numbers(experiment.result),
        "estimates": [key_document(estimate) for estimate in experiment.estimates],
    }
