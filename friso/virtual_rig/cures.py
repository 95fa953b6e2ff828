"""Find what stops the hunting of a stage as built, and where it ends, by runs with the drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from friso.equations.bandwidth import faster, least_static_factor, static_frictions, with_static_friction
from friso.hunting import AttractionEnd, Case, ParameterMargin
from friso.hunting.criteria import ATTRACTED
from friso.hunting.measures import bands_of
from friso.stage import Stage
from friso.stage.controllers import controller_of
from friso.stage.rig import Floor
from friso.virtual_rig.followed import follow
from friso.virtual_rig.run import as_built_keys
from friso.virtual_rig.verdict import Built, seen, tried


def judged(stage: Stage) -> Built:
    """Judge a stage as built by its runs alone."""
    return _judged(as_built_keys(stage), stage.floor, 0.0, stage.doubt)


def _judged(flat: Mapping[str, Any], floor: Floor | None, swing: float, doubt: str) -> Built:
    """Judge a machine given by complete keys, which may hunt with an amplitude of `swing` [m]."""
    task, kicks, bounds = tried(flat, floor, swing)
    return seen(follow(flat, task, bounds), kicks, doubt)


def is_quiet(built: Built) -> bool | None:
    """Tell whether a machine as built surely comes to rest, or toggles; None if that is not certain."""
    if built.verdict in ATTRACTED:
        return False
    return True if built.certain and built.verdict in ("settles", "toggles") else None


@dataclass(frozen=True)
class Cure:
    """The least change of one `kind` with which a stage does not hunt as built: the changed stage, and its verdict."""

    kind: str
    stage: Stage
    built: Built


MOST_COUNTS = 4
"""Largest dead band of an integral that is tried, in counts of the encoder."""

FINER = (2, 4, 8, 16, 32, 64)
"""Factors by which an encoder is finer. With more, the next better kind would be bought."""

TYPED_DIGITS = 4
"""Significant digits of changed numbers, in the units of the file."""

LESS_DELAY = (0.5, 0.25, 0.0)
"""Shares of the delay that are tried."""


def cures(stage: Stage) -> Iterator[Cure]:
    """Yield of each kind the least change of the drive with which a stage surely does not hunt as built."""
    for kind, steps in _kinds(stage).items():
        for numbers in steps:
            changed = stage.with_rounded({f"drive.{key}": value for key, value in numbers.items()}, TYPED_DIGITS)
            built = judged(changed)
            if is_quiet(built):
                yield Cure(kind, changed, built)
                break


def _kinds(stage: Stage) -> dict[str, list[dict[str, float]]]:
    """Return the changes that are tried, by kind, smallest first, as keys of the drive with SI numbers.

    A finer encoder is tried alone, then with a dead band of one of its counts: a target between two counts keeps an
    integral at work with any encoder.
    """
    flat, dead = as_built_keys(stage), "integrator_deadband"
    count, delay, present = (flat[f"drive.{key}"] for key in ("encoder_resolution", "delay", dead))
    integrates, band = controller_of(stage.flat()).integrates(stage.flat()), bands_of(stage.flat())[0]
    counts = [number * count for number in range(1, MOST_COUNTS + 1)] if count else []
    finer = [count / factor for factor in FINER] if count else []
    banded = integrates and not present
    encoders = [{"encoder_resolution": size} | more for size in finer for more in ({}, {dead: size})[: 1 + banded]]
    return {
        "a dead band of its integral": [{dead: size} for size in counts if size > present] if integrates else [],
        "an integral that stops in position": [{dead: band}] if integrates and band > max([present, *counts]) else [],
        "a finer encoder": encoders,
        "less delay": [{"delay": share * delay} for share in LESS_DELAY] if delay else [],
    }


FARTHEST, STEP = 4.0, 2**0.5
"""Largest factor on a parameter that is tried, and the factor between those that are tried first."""

WIDTH = 1.02
"""Ratio of an edge's ends, at most, unless runs between them stay open."""


def edges(case: Case) -> dict[str, ParameterMargin]:
    """Return how far a stage does the same as built, over factors on its bandwidth and its static friction.

    Coulomb friction is held. Between the factors that are tried, hunting may begin and end unnoticed. The result is
    empty for a stage of which it is open what it does.
    """
    stage = case.stage
    flat, swing = as_built_keys(stage), case.judgement.swing.amplitude if case.judgement.swing else 0.0
    machines: dict[str, tuple[Callable[..., dict[str, Any]], float]] = {"bandwidth": (faster, 1 / FARTHEST)}
    if static_frictions(flat):
        machines["static friction"] = with_static_friction, max(least_static_factor(flat), 1 / FARTHEST)

    def quiet(machine: Callable[..., dict[str, Any]], factor: float) -> bool | None:
        return is_quiet(_judged(machine(flat, factor), stage.floor, swing, ""))

    own = quiet(faster, 1.0)
    if own is None:
        return {}
    margins = {}
    for parameter, (machine, low) in machines.items():
        found = [_edge(partial(quiet, machine), own, end) for end in (low, FARTHEST)]
        (below, low_open), (above, high_open) = found
        open_sides = tuple(side for side, is_open in ((-1, low_open), (1, high_open)) if is_open)
        margins[parameter] = ParameterMargin(not own, below, above, (low, FARTHEST), open_sides, not stage.doubt)
    return margins


def _edge(quiet: Callable[[float], bool | None], own: bool, end: float) -> tuple[AttractionEnd | None, bool]:
    """Return where a machine changes what it does, None if it does not; and whether that stays open.

    `quiet` says whether it comes to rest at a factor, None if that is open; at 1 it is `own`. The last factor is `end`.
    """
    same, other, undecided = 1.0, None, False
    for factor in np.geomspace(1.0, end, 1 + round(abs(np.log(end)) / np.log(STEP) + 0.49))[1:].tolist():
        does = quiet(factor)
        if does is not None and does != own:
            other = factor
            break
        same, undecided = (same, True) if does is None else (factor, False)
    if other is None:
        return None, undecided
    while max(other / same, same / other) > WIDTH:
        does = quiet(middle := float(np.sqrt(same * other)))
        if does is None:
            break
        same, other = (middle, other) if does == own else (same, middle)
    certain = max(other / same, same / other) <= WIDTH
    return AttractionEnd(*((other, same) if own else (same, other)), certain), False
