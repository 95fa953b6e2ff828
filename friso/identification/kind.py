"""Define what a kind of experiment declares: its logs, their analysis, and the keys of a stage that it determines."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np

from friso.errors import InputError
from friso.identification.combine import Correlated, determined
from friso.identification.estimate import Estimate
from friso.identification.logs.log import Log, join_alike
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.readings.course import Course
from friso.progress import Progress, silent
from friso.stage import Stage, parse_set
from friso.stage.controllers import CONTROLLER

Source = Log | MeasuredResponse
"""Contents of a file: signals over time, or a frequency response from another instrument."""

Result = TypeVar("Result")

FirstEstimates = Callable[[str, Sequence[Estimate]], object]
"""Function that receives the name of a log and its first estimates."""


@dataclass(frozen=True)
class AnalysisSettings:
    """The user's choices for an analysis; None if friso is to choose.

    `bandwidth` [Hz] is the moves' bandwidth for the inverse model; `band` [Hz] and `period` [s] apply to frequency
    responses. `progress` receives the progress of an analysis, and `tell` the first estimates of a log, by name, which
    a longer analysis then improves.
    """

    bandwidth: float | None = None
    band: tuple[float, float] | None = None
    period: float | None = None
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


def of_one(
    analyse: Callable[[Log, Prior, AnalysisSettings], Result],
) -> Callable[[Sequence[Source], Prior, AnalysisSettings], Result]:
    """Return the analysis of an experiment that consists of one log, from that of the log."""

    def of_group(logs: Sequence[Source], prior: Prior, settings: AnalysisSettings) -> Result:
        (log,) = logs
        assert isinstance(log, Log)
        return analyse(log, prior, settings)

    return of_group


def nothing(result: Any, stage: Stage | None) -> tuple[Estimate, ...]:
    """Return no estimates, for experiments that determine no key of a stage."""
    return ()


def by_rows(result: Any, estimates: Sequence[Estimate], row: Callable[[Estimate], int]) -> Correlated:
    """Return the estimates that have a value, with their part of the `correlation` of a result.

    `row` gives the row of the correlation that belongs to an estimate.
    """
    certain = determined(estimates)
    rows = [row(estimate) for estimate in certain]
    return certain, result.correlation[np.ix_(rows, rows)]


def independent(result: Any, estimates: Sequence[Estimate]) -> Correlated:
    """Return the estimates that have a value, as independent of one another: correlations of 0."""
    certain = determined(estimates)
    return certain, np.eye(len(certain))


@dataclass(frozen=True)
class Predictor(Generic[Result]):
    """How a kind of experiment predicts another log from its result and the prior knowledge.

    `predict` returns the prediction, or None for a log that it cannot predict. `needs` states the requirements in
    words. `check` raises InputError, before any fit, if logs will not meet them.
    """

    needs: str
    predict: Callable[[Result, Log, Prior, AnalysisSettings], Any]
    check: Callable[[Sequence[Source], Log, Prior], None] = lambda logs, other, prior: None


@dataclass(frozen=True)
class ExperimentKind(Generic[Result]):
    """A kind of experiment, named by its module, which is also its word on the command line.

    `analyse` returns the result of a group of logs, of a class of the kind's own; `estimates` gives keys of the stage
    file from the result, and `correlated` their correlation. `after` names the kinds whose results it uses.

    `roles` are the channels that a log needs; of alternatives separated by |, the first that is mapped, or the last.
    `si` is true if channels must be in SI units, except for the `foreign` roles (a force in volts). `per_unit` is true
    if the analysis works in any unit of force, with results such as kg per volt. `partial` returns true for a log that
    shows too little by itself, such as one event; such logs are joined to one log with gaps. `together` is true if all
    logs are realisations of one experiment, `responses` if frequency responses from another instrument are accepted.

    `claims` returns why a log without a stated kind may be of this kind, or None; `claims_together` does so for several
    logs together, and for one if there are no `claims`. A kind claims logs `instead_of` other kinds that would claim
    them too. `around` makes a stage with assumed values for a log if none is given. `notes` are remarks on results for
    the engineer, with or without a stage; `doubts` are sentences against trusting a result. `failed` returns true if
    the analysis failed, even if parts of the result hold. Functions raise InputError for logs that cannot be used.
    """

    analyse: Callable[[Sequence[Source], Prior, AnalysisSettings], Result]
    estimates: Callable[[Result, Stage | None], tuple[Estimate, ...]] = nothing
    correlated: Callable[[Result, Sequence[Estimate]], Correlated] = independent
    after: tuple[str, ...] = ()
    roles: tuple[str, ...] = ("position", "force")
    si: bool = True
    foreign: tuple[str, ...] = ()
    per_unit: bool = False
    partial: Callable[[Log], bool] = lambda log: False
    together: bool = False
    responses: bool = False
    claims: Callable[[Course], str | None] | None = None
    claims_together: Callable[[Sequence[Course]], str | None] | None = None
    instead_of: tuple[str, ...] = ()
    around: Callable[[Log], Stage | None] | None = None
    notes: Callable[[Sequence[Result], Stage | None], Sequence[str]] = lambda results, stage: ()
    predictor: Predictor[Result] | None = None
    doubts: Callable[[Result], Sequence[str]] = lambda result: ()
    failed: Callable[[Result], bool] = lambda result: False

    def claimed(self, course: Course) -> str | None:
        """Return why a log without a stated kind may be of this kind; None if it may not."""
        if self.claims is not None:
            return self.claims(course)
        return self.claims_together([course]) if self.claims_together is not None else None

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
