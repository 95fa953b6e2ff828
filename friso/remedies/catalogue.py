"""The remedies that there are: what each changes, from the least change to the greatest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design_method.isolator import isolated
from friso.equations.breakaway import breakaway, least_breakaway
from friso.equations.motion import pieces
from friso.equations.settings import SETTINGS
from friso.errors import InputError
from friso.quantities import exactly
from friso.remedies import variables
from friso.remedies.goal import Goal
from friso.remedies.variables import Variable, bandwidth_factor, of_key
from friso.stage import Stage, numeric_keys
from friso.stage.controllers import FILTERS_KEY, controller_of
from friso.stage.standstill import settings_of

WIDTHS, DEPTH = (0.1, 1.5), 0.9
"""Range of the width of a notch, as a share of its frequency, and its depth."""


@dataclass(frozen=True)
class Remedy:
    """A remedy by its `name`, the stage it begins with, and its variables, which are applied in this order; whether it
    changes the controller alone, or a joint is needed (`buys_joint`); and the name of the remedy whose joint it `makes`
    of leaf springs, if it does."""

    name: str
    stage: Stage
    variables: tuple[Variable, ...]
    buys_joint: bool = False
    makes: str = ""

    def changes(self, shares: np.ndarray) -> dict[str, Any]:
        """The keys that change at shares of the ranges, (points, variables), to arrays of shape (points,)."""
        flat, changed = self.stage.flat(), dict[str, Any]()
        for variable, share in zip(self.variables, shares.T, strict=True):
            change = variable.change({**flat, **changed}, variable.at(share))
            changed |= change
        return changed

    @property
    def verifiable(self) -> bool:
        """Whether cycles can verify it: not where a dither keeps the stage from coming to rest."""
        return not settings_of(self.stage.flat()).dither

    @property
    def of_setting(self) -> bool:
        """Whether it is a setting against friction alone, with the present gains."""
        return self.name in {setting.name for setting in SETTINGS.values()}

    @classmethod
    def settled_on(cls, name: str, stage: Stage, buys_joint: bool = False) -> Remedy:
        """A stage as it is, with nothing to vary."""
        return cls(name, stage, (), buys_joint)

    def tuned(self, shares: np.ndarray) -> Stage:
        """The stage at shares of the ranges, (variables,), its numbers rounded to four digits but where they are the
        present ones."""
        numbers = {key: float(values[0]) for key, values in self.changes(shares[None]).items()}
        present = {variable.name: variable.present for variable in self.variables}
        return self.stage.with_numbers(
            {key: value if value == present.get(key) else float(f"{value:.4g}") for key, value in numbers.items()}
        )


def remedies(stage: Stage, goal: Goal) -> list[Remedy]:
    """The remedies that a goal allows, those that change least first."""
    listed: list[Remedy] = []
    if goal.controller:
        listed += [Remedy("bandwidth", stage, (bandwidth_factor(),)), *_gains("gains", stage)]
        listed += [*_notch(stage), *_against_friction(stage, goal), *_structures(stage)]
    if goal.joint and least_breakaway(stage.flat()) > 0:
        listed += _isolators(stage, goal)
    return listed


def with_bandwidth(remedy: Remedy) -> Remedy:
    """A remedy together with the bandwidth."""
    return Remedy(f"{remedy.name}, and bandwidth", remedy.stage, (*remedy.variables, bandwidth_factor()))


def _gains(name: str, stage: Stage, first: tuple[Variable, ...] = (), buys_joint: bool = False) -> list[Remedy]:
    """All gains, where there are more than the bandwidth tells."""
    several = (*first, *variables.gains(stage))
    return [Remedy(name, stage, several, buys_joint)] if len(several) > 1 else []


def _notch(stage: Stage) -> Iterator[Remedy]:
    """A notch at the parasitic mode, with which the bandwidth can be higher."""
    flat = stage.flat()
    if "parasitic.frequency" not in flat:
        return
    frequency = flat["parasitic.frequency"]
    filters = [*stage.as_written()["controller"].get("filters", [])]
    notch = {
        "kind": "notch",
        "frequency": exactly(frequency, "Hz"),
        "width": exactly(frequency / 2, "Hz"),
        "depth": DEPTH,
    }
    try:
        with_notch = stage.replace({FILTERS_KEY: [*filters, notch]})
    except InputError:  # as many filters as there may be
        return
    key = f"{FILTERS_KEY}.{len(filters) + 1}.width"
    width = of_key(key, WIDTHS[0] * frequency, WIDTHS[1] * frequency)
    yield Remedy("notch at the parasitic mode, and bandwidth", with_notch, (width, bandwidth_factor()))


def _structures(stage: Stage) -> Iterator[Remedy]:
    """The other structures that the controller of the stage can have, each with all its gains."""
    flat = stage.flat()
    stands = not pieces(flat, 1)[..., 2:].any()  # the reference jumps, or the stage is released
    for name, changes in controller_of(flat).structures(flat).items():
        if stands and all(key.endswith("_feedforward") for key in changes):
            continue
        try:
            other = _restructured(stage, changes)
        except InputError:  # an uncertain key, for instance, that the other one has not
            continue
        yield from _gains(name, other)


def _restructured(stage: Stage, changes: Mapping[str, Any]) -> Stage:
    """A stage with keys of its controller changed: numbers [SI], texts, or None for those that go."""
    numbers = {key: value for key, value in changes.items() if isinstance(value, float)}
    keys = numeric_keys({key: value for key, value in {**stage.flat(), **changes}.items() if value is not None})
    texts = {key: exactly(value, keys[key].unit) if keys[key].unit else value for key, value in numbers.items()}
    return stage.replace({**changes, **texts})


def _against_friction(stage: Stage, goal: Goal) -> Iterator[Remedy]:
    """Each setting against friction that is tuned and that the stage has not got, by itself."""
    flat = stage.flat()
    if breakaway(flat) <= 0:
        return
    integrates = controller_of(flat).integrates(flat)
    for setting in SETTINGS.values():
        ranges = setting.ranges(flat, goal.within) if integrates or not setting.integral else {}
        if ranges and not any(key in flat for key in ranges):
            numbers = {key: float(np.sqrt(low * high)) for key, (low, high) in ranges.items()}
            keys = tuple(of_key(key, *ends) for key, ends in ranges.items())
            yield Remedy(setting.name, stage.with_numbers(numbers), keys)


def _isolators(stage: Stage, goal: Goal) -> Iterator[Remedy]:
    """An isolator, alone and with the gains; leaf springs of the file give way to a joint stated by its numbers."""
    try:
        free = isolated(stage)
    except InputError:
        return
    flat = free.flat()
    if free.flexure:
        kept = {key: flat[key] for key in flat if key.startswith(("joint.stiffness", "parasitic."))}
        free = free.with_numbers(kept, without=("flexure",))
    joint = variables.joint_variables(float(least_breakaway(flat)))
    yield Remedy("isolator", free, joint, True)
    if goal.controller:
        yield from _gains("isolator and gains", free, joint, True)
