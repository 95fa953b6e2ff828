"""Define a kind of experiment: its logs, their analysis, what that says of a stage, and how it is shown."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Generic, TypeVar

import numpy as np

from friso.errors import InputError
from friso.identification.combine import Correlated, determined
from friso.identification.estimate import Estimate, name_of, with_interval
from friso.identification.logs.log import Log, join_alike
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.readings.course import Course
from friso.progress import Progress, silent
from friso.shown.drawing.figure import BLUE, INK, ORANGE, Axis, Figure, Panel, Series
from friso.stage import Stage, parse_set
from friso.stage.controllers import CONTROLLER

Source = Log | MeasuredResponse
"""Contents of a file: signals over time, or a frequency response from another instrument."""

Facts = tuple[tuple[str, str], ...]
"""Values in words, with their names."""

AREA = "#cfdfee"
WAYS: Mapping[str, str] = MappingProxyType({"forward": BLUE, "backward": ORANGE})
TIME = Axis("Time", "s")

Result = TypeVar("Result")

FirstEstimates = Callable[[str, Sequence[Estimate]], object]
"""Function that receives the name of a log and its first estimates."""


@dataclass(frozen=True)
class AnalysisSettings:
    """The user's choices for an analysis; None if friso is to choose.

    `bandwidth` [Hz] is the moves' bandwidth for the inverse model. `progress` receives the progress of an analysis, and
    `tell` the first estimates of a log, by name, which a longer analysis then improves.
    """

    bandwidth: float | None = None
    progress: Progress = silent
    tell: FirstEstimates = lambda name, estimates: None


NOTHING_CHOSEN = AnalysisSettings()


@dataclass(frozen=True)
class Prior:
    """Prior knowledge of the machine for the analysis of an experiment.

    `stage` may be None. `from_user` tells whether the user gave the stage, so that its controller is the machine's.
    `estimates` are results of experiments of earlier kinds, by key. `made_up` are the keys of the stage that were made
    up for a log, because the file lacks their tables.
    """

    stage: Stage | None = None
    from_user: bool = False
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    made_up: Collection[str] = ()

    def flat(self, log: Log) -> dict[str, Any]:
        """Return the stage for a log as flat keys such as friction.static, with SI values.

        Changes that the log's [setup] states are included. Returns {} without a stage. Raises InputError for changes
        that the stage does not allow.
        """
        return {} if self.stage is None else as_set_up(self.stage, log)

    def user_told(self, key: str, log: Log) -> bool:
        """Tell whether the user stated a key, in the stage file or in the log's [setup].

        Raises InputError if the [setup] makes a change that the stage does not allow.
        """
        return self.from_user and key not in self.made_up and key in self.flat(log)

    def believed(self, log: Log) -> dict[str, Any]:
        """Return the stage for a log as flat keys, with the values that other experiments gave.

        Raises InputError if the log's [setup] makes a change that the stage does not allow.
        """
        return {**self.flat(log), **{key: estimate.value for key, estimate in self.estimates.items()}}

    def masses(self, log: Log) -> tuple[float, float]:
        """Return the assumed mass [kg] of the cart and of the stage, 0 if not known.

        Estimates from earlier experiments replace the stage's values. Raises InputError if the log's [setup] makes a
        change that the stage does not allow.
        """
        believed = self.believed(log)
        return float(believed.get("masses.cart", 0.0)), float(believed.get("masses.stage", 0.0))


def as_set_up(stage: Stage, log: Log) -> dict[str, Any]:
    """Return a stage with the changes that a log's [setup] states, as flat keys with SI values.

    Keys that the stage does not have are left out (`left_out`), except for a controller of another form, which replaces
    the stage's. Raises InputError for changes that the stage does not allow.
    """
    setup = {key: text for key, text in log.setup.items() if key not in left_out(stage, log)}
    changes: dict[str, Any] = dict(parse_set(f"{key}={text}") for key, text in setup.items())
    try:
        return stage.replace(changes).flat()
    except InputError as error:
        raise error.found_in(f"{log.name}, [setup]") from None


def left_out(stage: Stage, log: Log) -> list[str]:
    """List the keys in the [setup] of a log that the stage does not have."""
    return [key for key in log.setup if key not in stage.flat() and not key.startswith(f"{CONTROLLER}.")]


def by_rows(result: Any, estimates: Sequence[Estimate], row: Callable[[Estimate], int]) -> Correlated:
    """Return the estimates that have a value, with their part of the `correlation` of a result.

    `row` gives the row of the correlation that belongs to an estimate.
    """
    certain = determined(estimates)
    rows = [row(estimate) for estimate in certain]
    return certain, result.correlation[np.ix_(rows, rows)]


def log_figure(log: Log, roles: Sequence[str], name: str) -> Figure:
    """Draw some signals of a log, by role, over time."""
    panels = tuple(
        Panel(
            "", TIME, Axis(role.replace("_", " ").capitalize(), log.unit(role)), (Series(log.time, log[role], "", INK),)
        )
        for role in roles
    )
    return Figure(name, log.name, "As logged.", panels)


class ExperimentKind(Generic[Result]):
    """A kind of experiment, named by its module, which is also its word on the command line.

    A subclass overrides what its kind does otherwise, above all the analysis. `title` names its results. `after` names
    the kinds whose results it uses.

    `roles` are the channels that a log needs; of alternatives separated by |, the first that is mapped, or the last.
    `si` is true if channels must be in SI units, except for the `foreign` roles (a force in volts). `per_unit` is true
    if the analysis works in any unit of force, with results such as kg per volt. `together` is true if all logs are
    realisations of one experiment, `responses` if frequency responses from another instrument are accepted. `longest`
    is true if only the longest stretch of a log without gaps is analysed, `stamped` if samples need no even clock.

    A kind claims logs `instead_of` other kinds that would claim them too. `makes_stage` is true if a stage can be made
    up around a log. `predicts` says which logs the kind predicts from its results, empty if none. `opening` is the last
    part of the name of the figure that opens the page, or empty. Methods raise InputError for logs that cannot be used.
    """

    title: str
    after: tuple[str, ...] = ()
    roles: tuple[str, ...] = ("position", "force")
    si: bool = True
    foreign: tuple[str, ...] = ()
    per_unit: bool = False
    together: bool = False
    responses: bool = False
    longest: bool = False
    stamped: bool = False
    instead_of: tuple[str, ...] = ()
    makes_stage: bool = False
    predicts: str = ""
    opening: str = ""

    def analyse(self, logs: Sequence[Source], prior: Prior, settings: AnalysisSettings) -> Result:
        """Return the result of a group of logs, of a class of the kind's own."""
        (log,) = logs
        assert isinstance(log, Log)
        return self.analyse_log(log, prior, settings)

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> Result:
        """Return the result of one log, for kinds that analyse each by itself."""
        raise NotImplementedError

    def estimates(self, result: Result, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return what a result says of keys of the stage file; nothing by default."""
        return ()

    def correlated(self, result: Result, estimates: Sequence[Estimate]) -> Correlated:
        """Return the estimates that have a value, with their correlations: of 0 by default."""
        certain = determined(estimates)
        return certain, np.eye(len(certain))

    def partial(self, log: Log) -> bool:
        """Tell whether a log shows too little by itself, such as one event; such logs are joined to one with gaps."""
        return False

    def claims(self, course: Course) -> str | None:
        """Return why a log without a stated kind may be of this kind; None if it may not."""
        return self.claims_together([course])

    def claims_together(self, courses: Sequence[Course]) -> str | None:
        """Return why several logs without a stated kind may be one experiment of this kind; None if they may not."""
        return None

    def around(self, log: Log) -> Stage | None:
        """Make a stage with assumed values for a log if none is given; None if that cannot be done."""
        return None

    def notes(self, results: Sequence[Result], stage: Stage | None) -> Sequence[str]:
        """List remarks on results for the engineer, with or without a stage."""
        return ()

    def doubts(self, result: Result) -> Sequence[str]:
        """List sentences against trusting a result."""
        return ()

    def contradicted(self, result: Result) -> Sequence[str]:
        """Return the tables of the stage file that a result contradicts, so that nobody knows them."""
        return ()

    def failed(self, result: Result) -> bool:
        """Tell whether the analysis failed, even if parts of the result hold."""
        return False

    def check_prediction(self, logs: Sequence[Source], other: Log, prior: Prior) -> None:
        """Check before any fit that logs can predict another log. Raises InputError if not."""

    def predict(self, result: Result, log: Log, prior: Prior, settings: AnalysisSettings) -> Any:
        """Return the prediction of another log, or None for one that cannot be predicted."""
        return None

    def prediction_error(self, prediction: Any) -> float:
        """Return the largest relative error of a prediction."""
        raise NotImplementedError

    def prediction_sentence(self, prediction: Any) -> str:
        """Describe the errors of a prediction."""
        raise NotImplementedError

    def prediction_numbers(self, prediction: Any) -> dict[str, Any]:
        """Return a prediction for the JSON document."""
        raise NotImplementedError

    def prediction_figures(self, log: Log, prediction: Any, number: int) -> list[Figure]:
        """Draw a prediction of a log; `number` is that of the log, for the figures' names."""
        return []

    def facts(self, result: Result) -> Facts:
        """List values of a result in words: by default its estimates with their intervals."""
        return tuple((name_of(one.name), with_interval(one)) for one in self.estimates(result, None))

    def sentences(self, result: Result) -> tuple[str, ...]:
        """Say what is not among the facts."""
        return ()

    def warnings(self, result: Result) -> tuple[str, ...]:
        """Return the warnings of a result, if its class has any."""
        return getattr(result, "warnings", ())

    def headline(self, result: Result) -> str:
        """Write a sentence at the head of the page, beside the estimates of keys; it may be empty."""
        return ""

    def numbers(self, result: Result) -> dict[str, Any]:
        """Return a result for the JSON document, in SI with the unit in the key or beside it."""
        return {}

    def figures(self, result: Result, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw a result: by default, for each log, the signals that this kind needs.

        The names of the figures begin with `name`.
        """
        records = [log for log in logs if isinstance(log, Log)]
        return [log_figure(log, self.needed(log.signals), f"{name}_{i}") for i, log in enumerate(records, 1)]

    def needed(self, mapped: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the roles that a log needs, such as position, given the roles that it has.

        Of alternatives, the first that the log has is returned, or else the last.
        """
        choices = [channels.split("|") for channels in self.roles]
        return tuple(next((role for role in roles if role in mapped), roles[-1]) for roles in choices)

    def groups(self, sources: Sequence[Source]) -> list[tuple[Source, ...]]:
        """Group the logs of this kind by experiment.

        Logs are one group each, unless the kind analyses them `together`. Logs that show too little by themselves are
        joined. Responses from another instrument are one group each, and left out if the kind does not accept them.
        """
        times = tuple(source for source in sources if isinstance(source, Log))
        responses = [(source,) for source in sources if not isinstance(source, Log)] if self.responses else []
        if self.together:
            return [*([times] if times else []), *responses]
        partial = [log for log in times if len(times) > 1 and self.partial(log)]
        complete = [log for log in times if log not in partial]
        return [*((log,) for log in (*complete, *join_alike(partial))), *responses]
