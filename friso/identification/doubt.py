"""Define doubts: effects that may be in a log and are not in the model, with the test that detects each.

Each doubt is a row in the table of `friso/identification/doubts/`. It states what it looks at, at which moment of an
analysis, and which measurement would decide it.

Its `find` yields findings. A finding is the cause in words, with its size and its consequence: wider intervals, or
values that are not reported. Consequences are applied here, so that one more effect is one more row.

A fit of moves is judged by its residual against the noise of the record, and gets its possible causes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from operator import itemgetter
from typing import Any, Literal

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.inverse_model import (
    ERROR_OF_A_FINE_MODEL,
    ERROR_OF_A_POOR_MODEL,
    ERROR_SHARE_OF_A_CLEARLY_BETTER_MODEL,
    InverseModel,
    inverse_model,
    passes_once,
    unit_of,
)
from friso.identification.kinds import in_order
from friso.identification.logs.log import Log
from friso.identification.output_error.fit import (
    ExplainedResidual,
    OutputErrorFit,
    beside_all_numbers,
    effects_of,
    explained_by,
    explained_by_forces,
    reaching_over,
)
from friso.identification.output_error.parameters import BRISTLES, CURVE, HIGHEST_FRICTION_RATIO, MASS
from friso.identification.readings.common import deflections, stribeck_curve
from friso.identification.witness import Replay, doubt_of
from friso.progress import Progress, silent
from friso.quantities import percent, plain_factor
from friso.registry import Registry

IMITATED = "what the model lacks would pass for it"
"""Reason for not reporting bristles or friction at low speed: effects that the model lacks may look like them."""

Moment = Literal["record", "fault", "cause", "otherwise", "value", "fit", "curve", "key", "response", "stage"]
"""Moment of an analysis at which a doubt is examined, which decides the argument of `find`.

- record: a `RecordCase`, of any log of moves, before the fit;
- fault: a `RecordCase`, where a mass with friction does not describe the log: faults of the log;
- cause: a `RecordCase`, at that time: effects that would explain the residual;
- otherwise: a `RecordCase`, where no such effect explains it;
- value: a `ValueCase`, the plausibility of the inverse model's values;
- fit: a `FitCase`, each in turn, with the fit as changed by earlier doubts;
- curve: a `KeyCase`, whether fitted parameters can be trusted;
- key: a `KeyCase`, each in turn, with the estimates as changed by earlier doubts;
- response: a `Bench`, the analysis of a frequency response;
- stage: the identified stage with all estimates.
"""


@dataclass(frozen=True)
class RecordCase:
    """A log of moves with its inverse model, a least-squares fit of mass, friction and offset.

    `cart_share` is the fraction of the mass that moves with a measured cart; 0 if none is measured. `replay` compares
    the force with that of the given controller; None without one.
    """

    log: Log
    inverse: InverseModel
    cart_share: float = 0.0
    replay: Replay | None = None

    @property
    def commanded(self) -> bool:
        """Tell whether the given controller explains the force, without a feedforward that it lacks."""
        return self.replay is not None and self.replay.agrees and not self.replay.mass

    @property
    def unit(self) -> str:
        """Return the unit of the force."""
        return self.log.unit("force")

    @property
    def passes_once(self) -> bool:
        """Tell whether the record passes its way only once."""
        return passes_once(self.log["position"][self.log.longest])

    def largest(self, unit: str) -> float:
        """Return the size in a unit that nothing in the record exceeds; infinite for a unit of nothing in it.

        A force that differs with place or time differs by no more than the whole force does; a length is at most the
        travel, a time the duration; a mass or a viscous friction that takes the largest force at the usual acceleration
        or speed is the largest.
        """
        axes, position = (unit_of("kg", self.log), unit_of("N*s/m", self.log)), self.log["position"][self.log.longest]
        whole = np.append(self.log["force"][self.log.longest], 0.0)
        force, step = float(np.ptp(whole)), self.log.sample_time
        if unit in axes:
            usual = float(np.sqrt(np.mean(self.inverse.columns[:, axes.index(unit)] ** 2)))
            return force / usual if usual > 0 else np.inf
        speed, duration = float(np.abs(np.diff(position)).max()) / step, step * len(self.log.time)
        sizes = {f"{self.unit}/s": 2 * force / step, "m": float(np.ptp(position)), "m/s": speed, "s": duration}
        return {self.unit: force, **sizes}.get(unit, np.inf)

    def modelled(self, log: Log, **options: Any) -> InverseModel:
        """Return the inverse model of a log changed for an effect, with further `options` of `inverse_model`."""
        inverse = self.inverse
        return inverse_model(log, inverse.bandwidth, False, self.cart_share, slowest=inverse.slowest, **options)


@dataclass(frozen=True)
class ValueCase(RecordCase):
    """A log of moves whose inverse model is checked for implausible values.

    `lacks` is true if the residual of the whole model is clearly above the noise; `poor` is true if the inverse model
    does not describe the log.
    """

    lacks: bool = False
    poor: bool = False


@dataclass(frozen=True)
class TriedForces:
    """Forces, shape (n,) each, by which an effect outside the model may explain a residual.

    A force [N] belongs to an effect of size 1, and is simulated at the small size in `units`. `label` is a number of
    the effect, such as the width of a play [m]. If several numbers were tried for the same forces, `searched` says how
    many: the best of many explains more by chance. If no fitted size reaches `least`, another effect is the cause.
    """

    forces: Sequence[np.ndarray]
    units: Sequence[float]
    label: float = np.nan
    searched: int = 1
    least: float = -np.inf


@dataclass(frozen=True, kw_only=True)
class FittedCase(RecordCase):
    """A log of moves with the whole model, a simulated stage that is fitted to it.

    `flat` has the stage before the fit, as keys such as friction.static with SI values. `velocity` [m/s], shape (n,),
    is smoothed over the fitted part of the log.
    """

    flat: Mapping[str, Any]
    fit: OutputErrorFit
    velocity: np.ndarray

    def bristles(self) -> FollowedBristles | None:
        """Return the fitted bristles as they follow the log; None if the fit has no such bristles."""
        fit = self.fit
        if not {*BRISTLES, *CURVE, MASS, "friction.coulomb"} <= {*fit.problem.names}:
            return None
        position = self.log["position"][self.log.longest] if fit.problem.closed else fit.problem.inputs.reference
        speed = np.abs(np.gradient(position, self.log.sample_time))
        coulomb, (ratio, velocity, exponent) = fit.value("friction.coulomb"), (fit.value(name) for name in CURVE)
        level = stribeck_curve(speed, coulomb, ratio * coulomb, velocity, exponent)
        bend = deflections(np.diff(position), level[1:] / fit.value(BRISTLES[0]))
        return FollowedBristles(bend, np.gradient(bend, self.log.sample_time), level, speed / velocity)


@dataclass(frozen=True)
class FollowedBristles:
    """Bristles under a body that follows a log, at n samples, shape (n,) each.

    `bend` [m] and its `rate` [m/s] are their deflection, `level` [N] is friction at a steady speed without its viscous
    part, and `speed` is in Stribeck velocities.
    """

    bend: np.ndarray
    rate: np.ndarray
    level: np.ndarray
    speed: np.ndarray


REACH_OF_AN_EFFECT = 2.0
"""Factor by which intervals exceed the shift of the fit by an effect. One linear step recovered at most 60 % of an
error of 1.5 % by a coupling, and half (in the logarithm) of the damping that three samples of delay doubled."""

FORCE_SHARE_OF_A_TOLD_EFFECT = 0.015
"""Fraction of the force's standard deviation below which a force along the way only widens intervals, unnamed.
Sound logs showed up to 0.014; a tenth of the friction is at least 0.02."""


@dataclass(frozen=True, kw_only=True)
class FitCase(FittedCase):
    """A log of moves with its fit, and the quality of the fit.

    `leading` is the effect whose forces explain most of the residual; None if no effect explains enough of it.
    """

    quality: Quality
    leading: LeadingEffect | None = None
    progress: Progress = silent

    @property
    def refused(self) -> dict[str, str]:
        """Return why keys of the stage file are not reported, by key: the first reason given."""
        last_first = reversed(self.quality.findings)
        return {key: why for finding in last_first for key, why in finding.refuses.items()}

    @property
    def has_cause(self) -> bool:
        """Tell whether a cause of the residual was named already, which may imitate others."""
        explaining = any(finding.explains for finding in self.quality.findings)
        return explaining or self.quality.spoilt or bool(self.quality.without)

    def may_name(self, doubt: str) -> bool:
        """Tell whether a doubt may name its effect as the cause of the residual.

        A doubt may if its effect explains most of the residual. If no effect does, it may if the residual is more than
        noise, and no other cause has been named.
        """
        if self.leading is not None:
            return self.leading.doubt == doubt
        return self.quality.ratio > 1 and not self.has_cause

    @property
    def describes(self) -> bool:
        """Tell whether the fit describes the log: it neither failed nor was rejected."""
        return not (self.quality.failed or self.quality.rejected)

    def led_by(self, doubt: str) -> LeadingEffect | None:
        """Return the effect that explains most of the residual if it is the doubt's; else None.

        The result is None, too, if the fit does not describe the log.
        """
        return self.leading if self.describes and self.leading is not None and self.leading.doubt == doubt else None

    def explained(
        self, forces: Callable[[FittedCase], Iterable[TriedForces]]
    ) -> Iterator[tuple[TriedForces, ExplainedResidual]]:
        """Yield an effect's forces that explain part of the fit's residual, with what they explain.

        `forces` returns the forces to try. Nothing is yielded if the fit does not describe the log.
        """
        for tried in forces(self) if self.describes else ():
            explained = explained_by_forces(self.fit, tried.forces, tried.units)
            if explained is not None:
                yield tried, explained

    def reaching(self, moved: np.ndarray, further: Mapping[str, float] | None = None) -> OutputErrorFit:
        """Return the fit with intervals widened by the shift that an effect causes.

        `moved` is the shift of the fitted numbers, shape (free,); it is multiplied by a setting, `reach_of_an_effect`.
        `further` widens the intervals of some parameters more, by name.
        """
        reach = REACH_OF_AN_EFFECT * np.abs(moved)
        return reaching_over(self.fit, reach + [(further or {}).get(name, 0.0) for name in self.fit.fitted])

    def named(
        self, effect: LeadingEffect, words: str, size: float, unit: str, further: Mapping[str, float] | None = None
    ) -> RaisedDoubt:
        """Return a finding that names an effect as the cause of the residual.

        The finding widens intervals by the shift that the effect causes. It withholds the estimates of the bristles,
        which the effect can imitate. `words` name the effect, and `size` is in `unit`. `further` widens the intervals
        of some parameters more, by name.
        """
        refuses: dict[str, str] = dict.fromkeys(BRISTLES, IMITATED)
        wider = self.reaching(effect.explained.moved, further)
        return RaisedDoubt(words=words, size=size, unit=unit, fit=wider, refuses=refuses, explains=True)

    def named_along(
        self, effect: LeadingEffect, words: str, size: float, further: Mapping[str, float] | None = None
    ) -> RaisedDoubt:
        """Return a finding on a force that varies along the way.

        A force that is small against the whole force is not named: it only widens intervals. `words` name the effect;
        `size` is in the unit of the force. `further` widens the intervals of some parameters more, by name.
        """
        finding = self.named(effect, words, size, self.unit, further)
        force = self.log["force"][self.log.longest]
        small = size < FORCE_SHARE_OF_A_TOLD_EFFECT * float(np.std(force))
        return RaisedDoubt(fit=finding.fit) if small else finding

    def with_finding(self, finding: RaisedDoubt) -> FitCase:
        """Return the case with a finding added, and its consequences for the fit applied."""
        before = self.quality
        quality = replace(before, findings=(*before.findings, finding), spoilt=before.spoilt or finding.spoils)
        return replace(self, fit=finding.fit or self.fit, inverse=finding.inverse or self.inverse, quality=quality)


@dataclass(frozen=True)
class LeadingEffect:
    """The effect whose forces explain most of the residual of a fit, with its doubt's name."""

    doubt: str
    tried: TriedForces
    explained: ExplainedResidual


@dataclass(frozen=True, kw_only=True)
class KeyCase(FitCase):
    """A log of moves with an estimate for each key of the stage file, and their `correlation`.

    `acceleration` [m/s^2], shape (n,), is smooth; `unexplained` [N] is the RMS residual beyond noise.
    """

    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    acceleration: np.ndarray = field(default_factory=lambda: np.zeros(1))
    unexplained: float = 0.0

    @property
    def determined(self) -> dict[str, Estimate]:
        """Return the determined estimates, by key."""
        return {estimate.name: estimate for estimate in self.estimates if estimate.determined}

    def with_answers(self, finding: RaisedDoubt) -> KeyCase:
        """Return the case with estimates that a finding replaces, or leaves without a value."""
        answers = {**finding.answers, **refused(self.estimates, finding.refuses)}
        estimates = tuple(answers.get(estimate.name, estimate) for estimate in self.estimates)
        pairs = zip(self.estimates, estimates, strict=True)
        kept = [after.determined for before, after in pairs if before.determined]
        return replace(self, estimates=estimates, correlation=self.correlation[np.ix_(kept, kept)])


@dataclass(frozen=True, kw_only=True)
class RaisedDoubt:
    """What a doubt found in a log: the cause in `words`, its `size` in `unit`, and what follows.

    `words` are "" if estimates state the cause themselves. `without` is the inverse model corrected for the effect;
    intervals are extended to its values. `reaches` has further ranges to cover, by quantity of the inverse model. `fit`
    and `inverse` are the fits with intervals that allow for the effect. `answers` replace estimates of the same key,
    and `refuses` has the reason for each key that is not reported.

    If `spoils` is true, the effect can be mistaken for friction at low speed. If `explains` is true, no other
    explanation of the residual is named. `doubt` is the doubt's name.
    """

    words: str = ""
    size: float = np.nan
    unit: str = ""
    without: InverseModel | None = None
    reaches: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fit: OutputErrorFit | None = None
    inverse: InverseModel | None = None
    answers: Mapping[str, Estimate] = field(default_factory=dict)
    refuses: Mapping[str, str] = field(default_factory=dict)
    spoils: bool = False
    explains: bool = False
    doubt: str = ""


@dataclass(frozen=True)
class Doubt:
    """An effect that may be in a log and is not in the model, named by its module (`DOUBTS`).

    `find` yields findings from the case at its `moment`. The docs list what it `looks_at`, its `consequence`, and by
    which measurement it is decided (`decided_by`). `after` names doubts that are examined earlier. `forces` returns
    forces that the effect would add, to be fitted to the residual. The doubt whose forces explain most leads, and no
    other doubt names a cause. An effect of `places` shows in a record only that passes its way more than once, because
    a single pass does not tell a place from a time. One that is a matter of form (`of_form`) is another form of what
    the model has: it may be there beside any other effect, and never leads.
    """

    moment: Moment
    find: Callable[[Any], Iterable[RaisedDoubt]]
    looks_at: str
    consequence: str
    decided_by: str
    after: tuple[str, ...] = ()
    forces: Callable[[FittedCase], Iterable[TriedForces]] | None = None
    places: bool = False
    of_form: bool = False


DOUBTS: Registry[Doubt] = Registry("friso.identification.doubts", "DOUBT")
"""All doubts, in the table of `friso/identification/doubts/`."""


def raised(moment: Moment, case: Any) -> Iterator[RaisedDoubt]:
    """Yield the findings of all doubts that are examined at a moment of the analysis, in order.

    `case` is what the `find` of these doubts takes, such as a FitCase.
    """
    for name in _at(moment):
        yield from _named(name, case)


def words_of(moment: Moment, case: Any) -> tuple[str, ...]:
    """Return, in words, the causes that the doubts of a moment of the analysis find, in order.

    `case` is what the `find` of these doubts takes, such as a FitCase.
    """
    return tuple(finding.words for finding in raised(moment, case))


ERROR_SHARE_OF_A_CAUSE = 0.7
"""Largest ratio of model errors with and without a cause for the cause to count. Nearer 1, chance finds causes."""

ERROR_RATIO_OF_RIVAL_CAUSES = 1.5
"""Largest ratio of a cause's error to the best cause's error for both to count."""


def causes(case: RecordCase) -> list[RaisedDoubt]:
    """List findings on why a mass with friction does not describe a log.

    Faults of the log come first. Effects follow with which the inverse model fits much better, best first, without
    those that fit much worse than the best; then causes that no inverse model tests. Doubts of the moment "otherwise"
    are examined only if no effect fits much better. Returns [] if nothing explains the log.
    """
    every = list(raised("cause", case))
    enough = ERROR_SHARE_OF_A_CAUSE * case.inverse.error
    errors = [(finding.without.error, finding) for finding in every if finding.without]
    better = sorted((pair for pair in errors if pair[0] < enough), key=itemgetter(0))
    most = ERROR_RATIO_OF_RIVAL_CAUSES * (better[0][0] if better else 0.0)
    rivals = [finding for error, finding in better if error <= most]
    plain = [finding for finding in every if finding.without is None]
    return [*raised("fault", case), *rivals, *plain, *(() if rivals else raised("otherwise", case))]


SPEED_SHARE_OF_CREEPING = 0.01
"""Speed up to which friction has no direction, relative to the highest."""


def way_of(velocity: np.ndarray) -> np.ndarray:
    """Return the direction, -1 to 1, of a velocity [m/s], (n,); it turns gradually near 0."""
    return np.clip(velocity / (SPEED_SHARE_OF_CREEPING * np.abs(velocity).max()), -1.0, 1.0)


POWER_LEFT_BY_AN_EFFECT = 0.85
"""Largest fraction of the residual's power that an effect leaves if it is named. On 45 drawn logs with effects of a
tenth of the friction and more, the right effect left 0.01 to 0.84; on sound logs no effect explained anything."""


def leading_effect(case: FittedCase) -> LeadingEffect | None:
    """Return the effect whose forces explain most of a fit's residual, and surely; None if none does.

    Effects are examined beside those that are a matter of form, as far as these are sure.
    """
    names = [name for name in _at("fit") if _may_show(name, case)]
    every = [(name, tried) for name in names if (tries := DOUBTS[name].forces) is not None for tried in tries(case)]
    forces = [force for _, tried in every for force in tried.forces]
    if not forces:
        return None
    effects = iter(effects_of(forces, [unit for _, tried in every for unit in tried.units], case.fit))
    columns = [(name, tried, [*islice(effects, len(tried.forces))]) for name, tried in every]
    power, further = float(case.fit.residual @ case.fit.residual), []
    for _, tried, own in (one for one in columns if DOUBTS[one[0]].of_form):
        explained = explained_by(case.fit.linearised[1], case.fit.linearised[0], own, case.fit.problem.counted)
        if explained is not None and explained.sizes[0] > tried.least and explained.sure(case.fit)[0]:
            power, further = float(explained.rest @ explained.rest), [*further, *own]
    rest, slopes = beside_all_numbers(case.fit, further)
    of_all, largest, led = float(rest @ rest) / power, case.largest(case.unit), []
    for name, tried, own in (one for one in columns if not DOUBTS[one[0]].of_form):
        explained = explained_by(slopes, rest, own, case.fit.problem.counted, tried.searched)
        if explained is None or explained.sizes.max() < tried.least:
            continue
        if np.sqrt(np.mean((explained.sizes @ np.stack([*tried.forces])) ** 2)) > largest:
            continue  # no record contains it; a delay may exceed the force at its steps, for some samples
        left = 1 - of_all * (1 - explained.left)
        if left <= POWER_LEFT_BY_AN_EFFECT:
            led.append(LeadingEffect(name, tried, replace(explained, left=left)))
    for effect in sorted(led, key=lambda effect: effect.explained.left):
        if effect.explained.sure(case.fit).any():
            moved = effect.explained.moved[[*case.fit.free]]
            return replace(effect, explained=replace(effect.explained, moved=moved))
    return None


def judged_fit(case: FitCase) -> FitCase:
    """Examine all doubts about a fit in turn, each with the fit changed by earlier doubts."""
    for name in _at("fit"):
        for finding in _named(name, case):
            case = case.with_finding(finding)
    return case


def judged_keys(case: KeyCase) -> KeyCase:
    """Examine all doubts about estimates in turn, each with estimates changed by earlier doubts."""
    for name in _at("key"):
        for finding in _named(name, case):
            case = case.with_answers(finding)
    return case


BRISTLES_FITTED_TOO_STIFF = 3.0
"""Largest ratio of imitated stiffness or damping of bristles to the true one. None above 1 was seen."""

BRISTLES_FITTED_TOO_SOFT = 10.0
"""Largest ratio of the true stiffness or damping of bristles to one that missing effects imitate. With play it was
8.5."""


def refused(estimates: Iterable[Estimate], reasons: Mapping[str, str]) -> dict[str, Estimate]:
    """Return the withheld estimates by key, each with its reason in place of the value.

    `reasons` are by key; an estimate without a reason is left out. The range left to Coulomb friction reaches down to
    its lower end divided by the highest ratio of static to Coulomb friction, that of imitated bristles as far as known
    effects have moved them.
    """
    softer, stiffer = BRISTLES_FITTED_TOO_STIFF, BRISTLES_FITTED_TOO_SOFT
    by_key = {"friction.coulomb": (1 / HIGHEST_FRICTION_RATIO, 1.0)}
    by_key |= {key: (1 / softer, stiffer) for key in BRISTLES if reasons.get(key) == IMITATED}
    ranges = {
        one.name: (one.low * by_key[one.name][0], one.high * by_key[one.name][1])
        for one in estimates
        if one.name in by_key and one.low > 0
    }
    return {
        one.name: one.withheld(reasons[one.name], *ranges.get(one.name, ()))
        for one in estimates
        if one.determined and one.name in reasons
    }


def _at(moment: Moment) -> list[str]:
    """Return the names of the doubts that are examined at a moment of the analysis, in order."""
    return [name for name in in_order(DOUBTS) if DOUBTS[name].moment == moment]


def _named(name: str, case: Any) -> Iterator[RaisedDoubt]:
    """Yield the findings of the doubt `name`, each with this name in its field `doubt`.

    An effect larger than the record can contain is left out, and the size of another finding is bounded by it.
    """
    if not isinstance(case, RecordCase):
        yield from (replace(finding, doubt=name) for finding in DOUBTS[name].find(case))
        return
    for finding in DOUBTS[name].find(case) if _may_show(name, case) else ():
        most = np.inf if np.isnan(finding.size) else case.largest(finding.unit)
        if abs(finding.size) > most and DOUBTS[name].moment in ("cause", "fit"):
            continue
        bounded = float(np.clip(finding.size, -most, most))
        yield replace(finding, size=bounded, doubt=name)


def _may_show(name: str, case: RecordCase) -> bool:
    """Tell whether the way of a record is passed often enough for a doubt."""
    return not DOUBTS[name].places or not case.passes_once


UNKNOWN = (
    "a delay, a filter, a constant force, one that drifts or varies with position, a missing feedforward and a mode in "
    "the band were considered, and none explains it: check --scale, including its sign, and which channel is which"
)
"""Clause of a message if no cause of a large residual is found."""

WITHOUT_FRICTION = ". The stage file says that there is no friction: with a table [friction], friction is identified"
"""Advice added to a message if the stage file has no friction."""


NOISE_RATIO_OF_A_LACKING_MODEL = 5.0
"""Ratio of residual to noise above which the model lacks something. It was at most 2.6 on 12 drawn sound logs, and
8 on two logs with play."""

NOISE_RATIO_OF_IMITATED_BRISTLES = 3.0
"""Ratio of residual to noise above which missing effects may look like bristles. With play, a fit that left 8 times
the noise gave 31 to 96 kN/m instead of 262 kN/m."""


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Quality of a fit of moves, with reasons against trusting it.

    `noise` [N] is the noise of the record's force; `left` [N] the RMS residual over counted samples, and `noise_left`
    [N] the residual expected of noise, and of sensors that are not quite linear. `inverse_error` and `whole_error` are
    relative errors of the force: by the inverse model, and by steady friction and mass of the whole model on the
    samples of the inverse model. `findings` are the doubts raised. The whole model may be `rejected`, or nothing holds
    at all (`failed`). `without` has inverse models of the log corrected for a cause. A record is `spoilt` if its fault
    passes for friction at low speed, and `unsettled` if a large residual has no known cause. `seen` is true if the
    samples themselves show a cause, such as clipping; no other effect is named then.
    """

    noise: float
    left: float
    noise_left: float
    inverse_error: float
    whole_error: float
    findings: tuple[RaisedDoubt, ...] = ()
    rejected: bool = False
    failed: bool = False
    without: tuple[InverseModel, ...] = ()
    spoilt: bool = False
    unsettled: bool = False
    seen: bool = False

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return sentences against trusting the fit."""
        return tuple(finding.words for finding in self.findings if finding.words)

    @property
    def ratio(self) -> float:
        """Return the ratio of the residual to the residual of the sensors' errors alone."""
        return self.left / self.noise_left if self.noise_left > 0 else np.inf

    @property
    def lacks_something(self) -> bool:
        """Tell whether the fit leaves clearly more than noise."""
        return self.ratio > NOISE_RATIO_OF_A_LACKING_MODEL

    @property
    def may_imitate_bristles(self) -> bool:
        """Tell whether the residual is so large that missing effects may look like bristles."""
        return self.ratio > NOISE_RATIO_OF_IMITATED_BRISTLES

    @property
    def lacking(self) -> float:
        """Return the fraction of the RMS residual that is not noise, from 0 to 1."""
        return float(np.sqrt(max(0.0, 1 - 1 / self.ratio**2))) if self.ratio > 1 else 0.0


ERROR_OF_AN_UNSETTLED_RECORD = 0.1
"""Residual, relative to the force, of both the fit and the best cause above which intervals are widened."""

ERROR_RATIO_OF_A_CONTRADICTION = 1.5
"""Ratio of the whole model's error to the inverse model's above which it contradicts the log."""


def quality_of(
    log: Log,
    inverse: InverseModel,
    fit: OutputErrorFit,
    noise: float,
    cart_share: float,
    led: bool = False,
    replay: Replay | None = None,
) -> Quality:
    """Judge a fit of moves, and name in sentences what is wrong with it.

    `noise` [N] is the force's, and `cart_share` the fraction of the mass that moves with a measured cart. If the fit is
    `led` by an effect that explains the residual, this effect is named instead of the inverse model's causes.

    The whole model may describe a record that the inverse model, which has no sticking, does not. A cause then raises
    no doubt if the whole model is clearly better than the inverse model corrected for the cause.
    """
    case = RecordCase(log, inverse, cart_share, replay)
    flat, left, passed = fit.stage, fit.left, fit.problem.noise_left(noise)
    findings = list(raised("record", case))
    if replay is not None and (said := doubt_of(replay, log)):
        findings.insert(0, RaisedDoubt(words=said, size=replay.slope, doubt="controller"))
    plain = Quality(
        noise=noise,
        left=left,
        noise_left=passed,
        inverse_error=inverse.error,
        whole_error=whole_error(flat, inverse),
        findings=tuple(findings),
    )
    if fit.problem.closed and fit.explains(noise):
        return plain
    force = float(np.sqrt(np.mean(log["force"][log.longest][fit.problem.counted > 0] ** 2)))
    roughly = inverse.error > ERROR_OF_A_POOR_MODEL
    beyond = roughly and left < ERROR_OF_AN_UNSETTLED_RECORD * force
    poor = roughly and not beyond
    reasons = causes(case) if plain.lacks_something or poor else []
    better = ERROR_SHARE_OF_A_CLEARLY_BETTER_MODEL * force
    if beyond:
        reasons = [cause for cause in reasons if cause.without is None or better * cause.without.error < left]
    worse = max(ERROR_RATIO_OF_A_CONTRADICTION * inverse.error, ERROR_OF_A_FINE_MODEL)
    contradicts = plain.whole_error > worse and left > better * inverse.error
    rejected = plain.lacks_something and contradicts and not (beyond or poor)
    seen = any(cause.without is None and DOUBTS[cause.doubt].moment == "cause" for cause in reasons)
    named = [] if led and not (poor or seen) else reasons
    words = _verdict(plain, named, case.unit, poor, rejected, flat["friction.model"] == "none")
    findings += [RaisedDoubt(words=words, size=plain.ratio, doubt="model")] if words else []
    findings += raised("value", ValueCase(log, inverse, cart_share, replay, lacks=plain.lacks_something, poor=poor))
    without = tuple(cause.without for cause in reasons if cause.without)
    best = min([inverse.error, *(model.error for model in without)])
    unsettled = plain.lacks_something and min(left / force, best) > ERROR_OF_AN_UNSETTLED_RECORD
    return replace(
        plain,
        findings=tuple(findings),
        rejected=rejected,
        failed=poor and plain.whole_error > ERROR_OF_A_POOR_MODEL,
        without=without,
        spoilt=unsettled or any(one.spoils for one in (*reasons, *findings)),
        unsettled=unsettled,
        seen=seen,
    )


def _verdict(
    plain: Quality, reasons: list[RaisedDoubt], unit: str, poor: bool, rejected: bool, frictionless: bool
) -> str:
    """Write how much the fit leaves unexplained, and why; "" if nothing is missing in the model.

    `reasons` are findings that explain what is left. The inverse model may be `poor`, or the whole model `rejected`;
    `frictionless` is true if the stage file says that there is no friction.
    """
    why = "".join(f"; {cause.words}" for cause in reasons)
    if poor:
        left = f"A mass with friction leaves {percent(plain.inverse_error, 3)} of the force unexplained"
        return f"{left}: {why.removeprefix('; ') or UNKNOWN}"
    if rejected:
        return (
            f"The whole model contradicts the record: on the moves it leaves {percent(plain.whole_error, 3)} of the "
            f"force, a plain mass with friction {percent(plain.inverse_error, 3)}. What follows is from the latter "
            f"alone{why}{WITHOUT_FRICTION if frictionless else ''}"
        )
    if plain.lacks_something:
        return (
            f"The fit leaves {plain.left:.3g} {unit} unexplained, {plain_factor(plain.ratio)} times what the noise of "
            f"the record would leave: the model lacks something, for which the intervals allow{why}"
        )
    return ""


def steady_friction(flat: Mapping[str, Any], velocity: np.ndarray) -> np.ndarray:
    """Return friction [N] of a stage at steady velocities [m/s], without its constant force.

    Velocities and friction have the shape (n,).
    """
    return _by_direction(flat, np.abs(velocity), np.sign(velocity))


def whole_error(flat: Mapping[str, Any], inverse: InverseModel) -> float:
    """Return the relative force error of a stage's mass and steady friction.

    The error is taken on the samples of the inverse model. Dry friction changes sign as gradually as the inverse
    model's filtered direction.
    """
    mass = sum(flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage"))
    acceleration, velocity, sign, _ = inverse.columns.T
    dry = {**flat, "friction.viscous": 0.0}
    wet = steady_friction(flat, velocity) - steady_friction(dry, velocity)
    left = inverse.measured - mass * acceleration - wet - _by_direction(dry, np.abs(velocity), sign)
    return float(np.linalg.norm(left) / np.linalg.norm(inverse.measured))


def _by_direction(flat: Mapping[str, Any], speed: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Return friction [N] at speeds [m/s] in directions from -1 to 1, each of shape (n,).

    Friction changes gradually from one direction to the other; the constant force is left out.
    """
    from friso.frequency.system import steady_force  # imports SymPy, which is slow

    forward, backward = (steady_force(flat, speed, forwards) for forwards in (True, False))
    constant = flat.get("bias.cart", 0.0) + flat.get("bias.stage", 0.0)
    return forward * (1 + sign) / 2 - backward * (1 - sign) / 2 - constant
