"""Identify a machine from measured logs: a stage file with uncertainties."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from collections.abc import Mapping as Keyed
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from friso.axis import LINEAR, speak_of
from friso.errors import InputError
from friso.identification.kind import AnalysisSettings
from friso.identification.logs.log import Log
from friso.identification.logs.roles import Mapping
from friso.identification.method import (
    Identification,
    Prediction,
    around,
    axis_of_all,
    check_predictions,
    nothing_learnt,
)
from friso.identification.sources import LogFile, per_unit_of_force, read_all, read_merged, read_usable
from friso.identification.stage_file import TOLD_BY_LOGS, completed
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import (
    LOGGER,
    Changes,
    ChannelUnits,
    FrequencyLike,
    KindName,
    Roles,
    RoleScales,
    StageLike,
    TimeLike,
)
from friso.platform.system import shell_word
from friso.progress import Progress, silent
from friso.quantities import Quantity, positive
from friso.questions.logs.question import LogFiles, options_of, paths_of
from friso.stage import Stage
from friso.stage.stage import axis_written, changed

if TYPE_CHECKING:
    from friso.identification.estimate import Estimate
    from friso.questions.check.question import CheckAnswer
    from friso.shown.pages import Report
    from friso.studies.contradiction import Contradiction

_HERTZ = Quantity("Hz", positive, "20 Hz")

MappingKeeper = Callable[[dict[Path, Mapping]], object]
"""A function that stores what the user said of logs for the next time."""


class IdentifyAnswer(Answer):
    """The machine that logs show.

    `result` is an `Identification` with the estimates, and with a `stage` if the logs describe a whole machine.
    `inputs` are the files read, and `predictions` the predictions of other logs. `checked` is the answer of `friso
    check` on the stage; None unless that was asked for. `compared` has, by log, whether it contradicts the stage
    `suspect`, if that was asked for.
    """

    inputs: Sequence[LogFile]
    predictions: Sequence[Prediction]
    checked: CheckAnswer | None
    compared: Keyed[str, Contradiction] = MappingProxyType({})
    suspect: Stage | None = None

    @property
    def condition(self) -> str:
        """Return "": estimates rest on the logs."""
        return ""

    @property
    def failure(self) -> str:
        """Say that a model does not describe its log; empty if all do."""
        return "a model does not describe its log" if self.result.failed else ""

    @property
    def interrupted(self) -> bool:
        """Tell whether Ctrl-C ended the analysis, so that logs are left out."""
        return self.result.interrupted

    @property
    def subject(self) -> IdentifyAnswer:
        """Return the answer itself, which has the logs and the predictions."""
        return self

    def page(self) -> Report:
        """Return the page, named after the logs if there is no stage."""
        page = super().page()
        return page if self.result.stage else replace(page, name=", ".join(file.path.name for file in self.inputs))

    def next_steps(self, files: Sequence[Path]) -> Sequence[str]:
        """Return the command that checks the identified stage.

        There is none without a stage file, or if the stage was checked already.
        """
        if self.result.stage is None or not files or self.checked is not None:
            return []
        draws = " --draws 1000" if self.result.stage.uncertain() else ""
        return [f"friso check {shell_word(str(files[0]))}{draws}"]


@question
def identify(
    logs: LogFiles,
    *,
    stage: StageLike | None = None,
    set: Changes = None,
    as_: KindName | None = None,
    map: Roles = None,
    unit: ChannelUnits = None,
    scale: RoleScales = None,
    dt: TimeLike | None = None,
    axis: KindName | None = None,
    merge: bool = False,
    predict: LogFiles = (),
    bandwidth: FrequencyLike | None = None,
    check: bool = False,
    against: StageLike | None = None,
    folder: Path = Path(),
    keep: MappingKeeper | None = None,
    progress: Progress = silent,
) -> IdentifyAnswer:
    """A stage with uncertainties from measured logs: mass, friction, stiffness, and what the logs cannot show.

    The exit status is 1 where a model does not describe its log.

    Parameters
    ----------
    stage : Stage, path or dict, optional
        What is known beforehand: structure, controller, drive. Masses, friction and motion may be left out: where it
        has no such tables, a log of moves tells them.
    as_ : str, optional
        Kind of experiment; moves and frequency responses are recognised. friso identify --help lists the kinds.
    merge : bool
        The two logs are of one run, by two clocks (drive and DAQ): they are aligned by the motion that both have, and
        analysed as one log.
    predict : path or list of paths, optional
        Other logs, simulated with the identified stage.
    bandwidth : str or float, optional
        Bandwidth of the moves, "20 Hz" or a number [Hz], for the filters.
    check : bool
        Also say whether the identified stage hunts, as friso check does of the stage file that is written.
    against : Stage, path or dict, optional
        A stage whose verdict the logs may contradict: do they hunt as it does, and which change would explain it.
        Without `stage`, it is also what is known beforehand.
    folder : Path
        Where what was said of channels is looked for, if not beside the logs.
    keep : callable, optional
        Called with what was said of the channels of each file, to keep it, if the logs showed anything.

    Returns
    -------
    IdentifyAnswer
        The estimates with 95 % intervals, ``answer.stage`` and ``answer.estimates``.

    Raises
    ------
    InputError
        For a log that cannot be read or leaves something open, and for options that are not usable.

    Examples
    --------
    >>> import friso
    >>> friso.identify("log.csv", stage="my_stage.toml", scale={"force": "35.15 N/V"})  # doctest: +SKIP
    """
    if stage is None and set:
        first = next(iter(f"{key}={value}" for key, value in set.items()) if isinstance(set, Keyed) else iter(set))
        wanted = "a stage whose keys to override"
        raise InputError("set", str(first), wanted, "--stage stage.toml (in Python stage=...)")
    stage = against if stage is None else stage
    tables = {} if stage is None else inputs.tables_of(stage)
    lacking = [name for name in TOLD_BY_LOGS if name not in tables] if "controller" in tables else []
    assumed = None if stage is None or lacking else inputs.stage_of(stage, set)
    beside = None if stage is None else axis_written(tables)
    if axis is None and beside is not None and beside != LINEAR:
        axis = beside.name
    settings, options = _settings(bandwidth), options_of(map, unit, scale, dt, as_, axis)
    paths, other_paths = paths_of(logs), paths_of(predict)
    held, unusable = (
        ([read_merged(paths, options, folder)], []) if merge else read_usable(paths, options, folder, other_paths)
    )
    predicted_files = [per_unit_of_force(file, beside) for file in read_all(other_paths, options, folder)]
    held = [per_unit_of_force(file, beside) for file in held]
    sources = [(file.source, file.kind) for file in held]
    held = [*held, *predicted_files]
    made_up: list[str] = []
    if stage is not None and lacking:
        made = around(sources)
        assumed = inputs.stage_of(stage, set) if made is None else _whole(stage, tables, made, set)
        made_up = [] if made is None else _made_up(lacking, made, set)
    axis_kind = axis_of_all([file.source for file in held], assumed)
    speak_of(axis_kind)
    others = _logs_to_predict(predicted_files)
    check_predictions(sources, others, assumed)
    from friso.identification.method import identify as identification
    from friso.identification.method import predict as predicted

    result = identification(sources, assumed, settings, progress, made_up)
    reused = [file.reused for file in held if file.reused]
    left_out = [f"left out: {_in_one_line(error)}" for error in unusable]
    result = replace(result, warnings=(*left_out, *reused, *_taken_from_logs(made_up), *result.warnings))
    rest = others if not result.interrupted else []
    predictions = [predicted(result, log, settings, assumed) for log in rest]
    if (
        keep is not None
        and not merge
        and not result.interrupted
        and not result.failed
        and not nothing_learnt(result.estimates, False)
    ):
        keep({file.path: _worth_keeping(file, result) for file in held})
    checked = None
    if check and result.stage is not None and not result.interrupted:
        from friso.questions.check.question import checked_stage

        checked = checked_stage(result.stage, result.correlations, progress=progress)
    suspect = None if against is None else inputs.stage_of(against, None)
    compared = {} if suspect is None else _compared(suspect, [log for log, _ in sources if isinstance(log, Log)])
    return IdentifyAnswer(
        result,
        inputs=held,
        predictions=predictions,
        axis_kind=axis_kind,
        checked=checked,
        compared=compared,
        suspect=suspect,
    )


def _compared(stage: Stage, logs: Sequence[Log]) -> dict[str, Contradiction]:
    """Compare what the logs show at rest with the verdict on a stage, by the names of the logs.

    Raises InputError if no log has position and reference.
    """
    from friso.studies.contradiction import contradiction, standing_of

    usable = [log for log in logs if "reference" in log and "position" in log]
    if not usable:
        raise InputError("against", "no log with position and reference", "one of both", "--map reference=CHANNEL")
    return {log.name: contradiction(stage, standing_of(log)) for log in usable}


def _worth_keeping(file: LogFile, result: Identification) -> Mapping:
    """Return what the user said of a log, without a kind of experiment that determined or bounded no key of it."""
    useless = any(
        nothing_learnt(experiment.estimates, False)
        for experiment in result.experiments
        if file.kind == experiment.kind and any(log.name == file.source.name for log in experiment.logs)
    )
    return replace(file.mapping, experiment=None) if useless else file.mapping


def _in_one_line(error: InputError) -> str:
    """Return what is wrong with a file in one line."""
    return f"{error.origin}: {error.key or 'log'}: {error.actual}; expected {error.expected}"


def _whole(source: StageLike, tables: Keyed[str, Any], made: Stage, changes: Changes) -> Stage:
    """Complete a stage file that lacks tables, from a stage `made` with assumed values.

    The user's `changes` are made last. Raises InputError if the file or the changes make no usable stage.
    """
    try:
        return changed(completed(tables, made), inputs.changes_of(changes))
    except InputError as error:
        raise error if isinstance(source, Stage | Keyed) else error.found_in(str(source)) from None


def _made_up(lacking: Sequence[str], made: Stage, changes: Changes) -> list[str]:
    """List the keys that a stage `made` from logs has in tables that a stage file lacks.

    `lacking` names these tables. Keys that the user sets are left out.
    """
    keys_set = inputs.changes_of(changes)
    keys = [f"{name}.{key}" for name in lacking for key in made.as_written()[name]]
    return [key for key in keys if key not in keys_set]


def _taken_from_logs(made_up: Sequence[str]) -> list[str]:
    """Say which tables the stage file lacks, and that a log or assumed values fill them.

    `made_up` lists their keys; without any, nothing is said.
    """
    if not made_up:
        return []
    listed = ", ".join(dict.fromkeys(f"[{key.partition('.')[0]}]" for key in made_up))
    return [f"the stage file has no {listed}: begun from the log, and our choice where that does not tell"]


def _settings(bandwidth: FrequencyLike | None) -> AnalysisSettings:
    """Return the user's choice for the analyses, in SI.

    Raises InputError for a text or number that is not usable.
    """
    try:
        hertz = None if bandwidth is None else float(_HERTZ.read(inputs.text_of(bandwidth, _HERTZ.unit)))
    except InputError as error:
        raise error.found_in("--bandwidth") from None
    return AnalysisSettings(hertz, tell=mention_first_estimates)


def mention_first_estimates(name: str, estimates: Sequence[Estimate]) -> None:
    """Log the first estimates of a log of moves, while the whole model is still fitted.

    The message goes to the logger "friso", at the level INFO. Nothing is logged if no estimate has a value.
    """
    from friso.identification.estimate import with_interval

    shown = [f"{one.name} {with_interval(one)}" for one in estimates if one.determined and one.name != "offset"]
    if shown:
        LOGGER.info(f"{name}: at first {', '.join(shown)}, by the inverse model", extra={"meanwhile": True})


def _logs_to_predict(held: Sequence[LogFile]) -> list[Log]:
    """Return the logs to be predicted.

    Raises InputError if one of the files holds a frequency response instead.
    """
    logs = [item.source for item in held if isinstance(item.source, Log)]
    if len(logs) < len(held):
        raise InputError("predict", "a measured frequency response", "a log over time", "predict=other.mat")
    return logs
