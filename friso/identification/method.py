"""Identify one stage from logs of several experiments: analyse each, and combine the results."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np

from friso.axis import LINEAR, AxisKind
from friso.engine.side_by_side import side_by_side
from friso.errors import InputError
from friso.identification.combine import combined, correlations
from friso.identification.doubt import words_of
from friso.identification.estimate import Estimate
from friso.identification.kind import NOTHING_CHOSEN, AnalysisSettings, Prior, Source, left_out
from friso.identification.kinds import KINDS, in_order
from friso.identification.logs.log import Log
from friso.identification.stage_file import Fitting, fitting, identified_stage, origins, with_unknown
from friso.progress import Progress, silent, together
from friso.stage import Stage
from friso.stage.correlations import Correlations


@dataclass(frozen=True)
class Experiment:
    """An experiment of a kind: its logs, its result, and its estimates of stage-file keys."""

    kind: str
    logs: tuple[Source, ...]
    result: Any
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True)
class Identification:
    """Result of identification from logs of several experiments.

    `stage` has uncertain keys; it is None if no stage was given or could be made up, or nothing was identified.
    `correlations` are between the stage's keys, `estimates` are the combined estimates (one per key), and `warnings`
    are for the engineer.

    `doubts` are sentences against trusting the result, and `failed` tells whether an analysis failed, even if parts of
    it hold. `origins` has the origin of each key of the stage. `interrupted` tells whether Ctrl-C ended the analysis:
    of logs that were not analysed to the end, there are the first estimates alone, and none of these in the stage.
    """

    stage: Stage | None
    correlations: Correlations
    experiments: tuple[Experiment, ...]
    estimates: tuple[Estimate, ...]
    warnings: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    failed: bool = False
    origins: Mapping[str, str] = field(default_factory=dict)
    interrupted: bool = False


@dataclass(frozen=True)
class Prediction:
    """The prediction of another log by an experiment; the kind defines what `result` is."""

    log: Log
    kind: str
    result: Any


def identify(
    logs: Sequence[tuple[Source, str]],
    base: Stage | None = None,
    settings: AnalysisSettings = NOTHING_CHOSEN,
    progress: Progress = silent,
    made_up: Collection[str] = (),
) -> Identification:
    """Identify the stage from logs, each with its kind of experiment.

    `base` is the prior stage; `made_up` lists its keys with assumed values. If the base has the machine's own
    controller, moves with a reference are simulated in closed loop. Raises InputError for logs that cannot be used, and
    KeyboardInterrupt at Ctrl-C, if there is no estimate yet.
    """
    if base is not None and base.conditions is not None:
        expected = "none: what a log shows of friction holds for the conditions under which it was recorded"
        raise InputError("conditions", "a stage with [conditions]", expected, "the stage file without [conditions]")
    kinds = _groups(logs)
    stage = base or around(logs)
    experiments: list[Experiment] = []
    pieces = iter(together(progress, sum(map(len, kinds.values()))))
    told: dict[str, Sequence[Estimate]] = {}

    def tell(name: str, estimates: Sequence[Estimate]) -> None:
        told[name] = estimates
        settings.tell(name, estimates)

    first: list[Estimate] = []
    cut: tuple[str, ...] = ()
    try:
        for kind, groups in kinds.items():
            best = combined(_every_estimate(experiments))[0]
            shown = {estimate.name: estimate for estimate in best if estimate.determined}
            prior = Prior(stage, base is not None, shown, made_up)
            analysed = partial(_analysed, kind, prior, replace(settings, tell=tell))
            results = side_by_side([partial(analysed, group, next(pieces)) for group in groups])
            estimates = (KINDS[kind].estimates(result, stage) for result in results)
            experiments += map(Experiment, repeat(kind), groups, results, estimates)
    except KeyboardInterrupt:
        if not experiments and not told:
            raise
        done = {log.name for one in experiments for log in one.logs}
        left = [log.name for log, _ in logs if log.name not in done]
        cut = (f"Interrupted: {', '.join(left)} not analysed to the end; values of the inverse model are not examined",)
        first = combined([one for name in left for one in told.get(name, ()) if one.name != "offset"])[0]
    estimates, warnings = combined(_every_estimate(experiments))
    doubts = (*cut, *_doubts(experiments))
    failed = any(KINDS[experiment.kind].failed(experiment.result) for experiment in experiments)
    useless = (cut and not experiments) or nothing_learnt(estimates, failed)
    if stage is None or useless or (base is None and not _shows_a_mass(estimates)):
        shown = (tuple(experiments), (*estimates, *first), tuple(warnings))
        return Identification(None, Correlations(), *shown, doubts, failed, interrupted=bool(cut))
    warnings += [*_notes(experiments, base), *_set_up([log for log, _ in logs], stage)]
    fits = fitting(stage, estimates)
    fitted = identified_stage(stage, fits.estimates, [log.name for log, _ in logs])
    doubts += words_of("stage", (fitted, estimates))
    sources = origins(fitted, fits.estimates, fits.follows, None if base is None else made_up)
    contradicted = {table for one in experiments for table in KINDS[one.kind].contradicted(one.result)}
    fitted = with_unknown(fitted, sources, (*fits.left, *contradicted), estimates)
    unknown = _unknown(fitted)
    shown = (tuple(experiments), (*estimates, *first), (*warnings, *fits.notes, *unknown))
    correlated = _correlations(experiments, estimates, fits, fitted)
    return Identification(fitted, correlated, *shown, doubts, failed, sources, bool(cut))


def _unknown(stage: Stage) -> list[str]:
    """Say which values of the identified stage nobody knows: those with the range of similar machines, and others."""
    ranges, assumed = stage.uncertain(), stage.assumed_keys
    usual = [f"{key} {ranges[key].text}" for key in stage.unknown_keys if key in ranges]
    similar = "; state your own, or the contact ([friction] guess)"
    says = (
        [f"not shown, so the stage file has the range of similar machines: {', '.join(usual)}{similar}"]
        if usual
        else []
    )
    return [*says, f"the stage file lists as unknown: {', '.join(assumed)}"] if assumed else says


def nothing_learnt(estimates: Sequence[Estimate], failed: bool) -> bool:
    """Tell whether estimates say nothing: none has a value or a finite bound.

    If an analysis `failed`, bounds do not count. Without any estimate the result is false unless an analysis failed.
    """
    ends = [end for estimate in estimates for end in (estimate.low, estimate.high)]
    none_determined = not any(estimate.determined for estimate in estimates)
    return none_determined and (failed or (bool(estimates) and not np.isfinite(ends).any()))


def _shows_a_mass(estimates: Sequence[Estimate]) -> bool:
    """Tell whether logs determine or bound a mass, without which a stage made up around them describes no machine."""
    masses = [estimate for estimate in estimates if estimate.name.startswith("masses.")]
    return any(np.isfinite([mass.low, mass.high]).all() for mass in masses)


def axis_of_all(sources: Sequence[Source], base: Stage | None) -> AxisKind:
    """Return the kind of axis of the logs and the prior stage.

    Raises InputError if they differ.
    """
    kinds = {source.name: source.axis for source in sources if isinstance(source, Log)}
    if base is not None:
        kinds = {base.name: base.axis_kind, **kinds}
    first = next(iter(kinds.values()), LINEAR)
    for name, kind in kinds.items():
        if kind.force != first.force and kind.length == first.length:
            example = f'--scale force="NUMBER {first.force}/{kind.force}"'
            raise InputError("force", f"a force in {kind.force}", f"one in {first.force}, as beside it", example, name)
        if kind != first:
            actual = f"a {kind.name} axis, beside a {first.name} one"
            raise InputError("--axis", actual, "one kind of axis throughout", f"--axis {first.name}", name)
    return first


def check_predictions(logs: Sequence[tuple[Source, str]], others: Sequence[Log], base: Stage | None) -> None:
    """Check before any fit that the logs, each with its kind, can predict the others.

    Raises InputError for a log that no given log can predict.
    """
    prior = Prior(base, base is not None)
    predictors = [kind for kind in dict.fromkeys(kind for _, kind in logs) if KINDS[kind].predicts]
    for other in others:
        reasons: list[InputError] = []
        for kind in predictors:
            try:
                KINDS[kind].check_prediction([log for log, name in logs if name == kind], other, prior)
            except InputError as error:
                reasons.append(error)
        if not predictors:
            raise _unpredictable(other)
        if len(reasons) == len(predictors):
            raise reasons[0]


def predict(
    identification: Identification, log: Log, settings: AnalysisSettings, base: Stage | None = None
) -> Prediction:
    """Predict another log of the machine by the first experiment that can.

    Kinds that use results of other kinds come first. The prediction uses the stage of this one experiment, not of all
    combined, so that errors are from one record to another. The controller is taken from `base`, or from the log's own
    [setup]. Raises InputError if no experiment can.
    """
    prior = Prior(base, base is not None)
    for kind in reversed(in_order()):
        for experiment in identification.experiments:
            if experiment.kind == kind:
                result = KINDS[kind].predict(experiment.result, log, prior, settings)
                if result is not None:
                    return Prediction(log, kind, result)
    raise _unpredictable(log)


def _unpredictable(log: Log) -> InputError:
    """Return the error for a log that no available kind of experiment can predict."""
    expected = ", or ".join(filter(None, (KINDS[name].predicts for name in reversed(in_order()))))
    return InputError("--predict", f"a log with {', '.join(log.signals)}", expected, "--map reference=SetPos", log.name)


def _doubts(experiments: Sequence[Experiment]) -> tuple[str, ...]:
    """List the doubts about the results in sentences; with several experiments, by their logs."""
    doubts_by_log = [KINDS[experiment.kind].doubts(experiment.result) for experiment in experiments]
    if len(experiments) == 1:
        return tuple(doubts_by_log[0])
    named = [", ".join(log.name for log in experiment.logs) for experiment in experiments]
    return tuple(f"{name}: {'; '.join(doubts)}" for name, doubts in zip(named, doubts_by_log, strict=True) if doubts)


def _set_up(logs: Sequence[Source], stage: Stage) -> list[str]:
    """Write, for each log, which keys of its [setup] the stage does not have."""
    return [
        f"{log.name}: [setup] has {', '.join(keys)}, which the stage does not have: left out"
        for log in logs
        if isinstance(log, Log) and (keys := left_out(stage, log))
    ]


def _groups(logs: Sequence[tuple[Source, str]]) -> dict[str, list[tuple[Source, ...]]]:
    """Return the logs of each experiment by kind, the kinds in the order of analysis."""
    by_kind = {name: KINDS[name].groups([log for log, kind in logs if kind == name]) for name in in_order()}
    return {name: groups for name, groups in by_kind.items() if groups}


def _analysed(kind: str, prior: Prior, settings: AnalysisSettings, group: Sequence[Source], progress: Progress) -> Any:
    """Analyse the logs of one experiment, and return the result of its kind.

    `prior` has the stage and the estimates from experiments of the kinds before.
    """
    label = f"{kind}: {', '.join(log.name for log in group)}"
    progress(0, 0, label)
    result = KINDS[kind].analyse(group, prior, replace(settings, progress=progress))
    progress(1, 1, label)
    return result


def around(logs: Sequence[tuple[Source, str]]) -> Stage | None:
    """Make a stage with assumed values for the first log that suffices; None without one."""
    for log, kind in logs:
        if isinstance(log, Log) and (stage := KINDS[kind].around(log)) is not None:
            return stage
    return None


def _every_estimate(experiments: Sequence[Experiment]) -> list[Estimate]:
    """List the estimates of all experiments."""
    return [estimate for experiment in experiments for estimate in experiment.estimates]


def _notes(experiments: Sequence[Experiment], base: Stage | None) -> list[str]:
    """List what each kind of experiment notes on its own results, for the engineer.

    `base` is the prior stage, if the user gave one.
    """
    results: dict[str, list[Any]] = {}
    for experiment in experiments:
        results.setdefault(experiment.kind, []).append(experiment.result)
    return [note for kind, several in results.items() for note in KINDS[kind].notes(several, base)]


def _correlations(
    experiments: Sequence[Experiment], estimates: Sequence[Estimate], fits: Fitting, stage: Stage
) -> Correlations:
    """Return the correlations between uncertain keys of the identified stage.

    A key whose value follows that of another key has the other key's correlations. Keys that are correlated with no
    other are left out.
    """
    groups = [KINDS[one.kind].correlated(one.result, one.estimates) for one in experiments]
    keys, matrix = correlations(_every_estimate(experiments), groups)
    uncertain = stage.uncertain()
    own = [estimate.name for estimate in fits.estimates if estimate.name in keys and estimate in estimates]
    leads = {**dict(zip(own, own, strict=True)), **fits.follows}
    leading = [key for key, lead in leads.items() if key in uncertain and lead in keys]
    places = [keys.index(leads[key]) for key in leading]
    part = matrix[np.ix_(places, places)]
    alone = np.abs(part - np.eye(len(leading))).max(axis=1, initial=0.0) == 0
    together = [key for key, single in zip(leading, alone, strict=True) if not single]
    return Correlations(tuple(leading), part).among(together)
