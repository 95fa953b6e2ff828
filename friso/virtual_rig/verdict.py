"""Judge a stage as built: its drive samples, waits and counts, and its surroundings act.

The stage runs its own motion, the same motion to places all over one count of its encoder, in both directions, and
kicks. Each run is followed until it rests, or surely does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.equations import motion
from friso.errors import InputError
from friso.hunting import Case, LoopState, least_breakaway_force
from friso.hunting.criteria import ATTRACTED, Verdict
from friso.hunting.measures import bands_of
from friso.shown.text import lost_as_built
from friso.stage.controllers import FORCE_LIMIT
from friso.stage.rig import Floor, is_as_built
from friso.virtual_rig.followed import Bounds, Fate, FollowedRuns, follow, runs_to_their_end, size_of_rest
from friso.virtual_rig.run import as_built_keys, with_complete_drive
from friso.virtual_rig.task import MoveTask, motion_task


@dataclass(frozen=True)
class Built:
    """The verdict on a stage as built, and the runs behind it.

    - `verdict`: "hunts", "bistable", "toggles" (it swings by at most a count), "settles", "undecided" or "failed" (its
      run did, or it runs away).
    - `certain`: every run was followed until it rested, or surely did not, and none rests of a stage that "hunts".
    - `amplitude` [m], `period` [s]: least and largest of the runs that swing, (2,) each; None if none does.
    - `moves`, `kicks`: how many of the runs have each `Fate`.
    - `smallest_kick`, `runs_away_after` [m]: smallest displacement tried that starts hunting, or after which the stage
      runs away (None: none).
    - `rest_error` [m], `settled_after` [s]: the largest of moves that rest or toggle: error in the end, and time after
      the motion until it stays within the stage's tolerance (inf: it does not). None if none rests.
    - `followed` [s]: the longest time after the last corner of the reference.
    - `slips_after` [s]: time at which a winding integral would break a resting stage away (None: it does not wind).
    - `because`: what alone makes the verdict differ from the continuous machine's, in words.
    - `differs`: whether it does.
    - `unstable`: states in which samples and delays make the loop unstable, whatever the friction.
    """

    verdict: Verdict | Literal["toggles"]
    certain: bool
    amplitude: tuple[float, float] | None
    period: tuple[float, float] | None
    moves: Mapping[Fate, int]
    kicks: Mapping[Fate, int]
    smallest_kick: float | None
    runs_away_after: float | None
    rest_error: float | None
    settled_after: float | None
    followed: float
    slips_after: float | None
    differs: bool = False
    because: tuple[str, ...] = ()
    unstable: tuple[LoopState, ...] = ()


PLACES = 16
"""Places in a count to which the motion leads. Between fewer of them a stage that hunts at some may be missed."""

KICKS = 8
"""Kicks from rest at the motion's end, in turn to either side."""

KICK_RANGE = (4.0, 128.0)  # [smallest swing that is told from rest]
"""Smallest and largest kick, unless the motion is longer: its size then is the largest."""


def judge_as_built(case: Case) -> Built | None:
    """Judge the stage of a `case` of the check as built.

    Returns None for a stage whose file describes no drive and no surroundings, and for a reference that keeps moving.
    """
    stage = case.stage
    if not is_as_built(stage) or case.verdict == "none":
        return None
    flat = as_built_keys(stage)
    swing = case.judgement.swing.amplitude if case.judgement.swing else 0.0
    task, kicks, bounds = tried(flat, stage.floor, swing)
    runs = follow(flat, task, bounds)
    built = replace(seen(runs, kicks, stage.doubt), unstable=lost_as_built(stage))
    attracted = case.verdict in ATTRACTED
    if built.verdict in ("undecided", "failed") or (built.verdict in ATTRACTED) == attracted:
        return built
    unlike = np.flatnonzero((runs.fate == "hunts") != attracted)
    if case.verdict == "bistable" and swing:
        far = np.abs(np.log(np.abs(kicks) / swing))
        unlike = PLACES + np.argsort(far)
    one = replace(task.of_runs(unlike[:1]), duration=float(task.pieces[0, -1, 0] + runs.followed[unlike[0]]))
    hunting = swing if attracted and swing else float(runs.swing[unlike[0]]) / 2
    because = _reasons(flat, one, bounds, int(unlike[0]), QUIET_SHARE * hunting, attracted)
    return replace(built, differs=True, because=because)


def seen(runs: FollowedRuns, kicks: np.ndarray, doubt: str = "") -> Built:
    """Return the verdict that follows from runs: of moves, the own one first, and of kicks [m], (KICKS,).

    It is not certain of a stage in `doubt`.
    """
    moves, kicked = runs.fate[:PLACES], runs.fate[PLACES:]
    swings = runs.fate == ("hunts" if "hunts" in runs.fate else "toggles")
    winding = runs.slips_after[(runs.fate == "rests") & np.isfinite(runs.slips_after)]
    followed = not (np.isin(runs.fate, ("open", "failed")).any() or winding.size)
    sure = (moves == "hunts").all() or (followed and moves[0] != "hunts")
    rests = np.isin(moves, ("rests", "toggles"))
    return Built(
        verdict=_verdict(moves, kicked),
        certain=not doubt and bool(sure),
        amplitude=_ends(runs.swing[swings] / 2),
        period=_ends(runs.period[swings]),
        moves=_counted(moves),
        kicks=_counted(kicked),
        smallest_kick=_smallest(kicks[kicked == "hunts"]),
        runs_away_after=_smallest(kicks[kicked == "runs away"]),
        rest_error=_largest(runs.error[:PLACES][rests]),
        settled_after=_largest(runs.settled[:PLACES][rests]),
        followed=float(np.nanmax(runs.followed, initial=0.0)),
        slips_after=_smallest(winding),
    )


def _largest_force(flat: Mapping[str, Any]) -> float:
    """Return the largest force [N] that the motor exerts, wherever it stands; inf without a limit."""
    motor = flat["drive.motor_constant_ratio"] * (1 + abs(flat.get("drive.ripple", 0.0)))
    return float(flat.get(FORCE_LIMIT, np.inf) * motor)


def tried(flat: Mapping[str, Any], floor: Floor | None, swing: float = 0.0) -> tuple[MoveTask, np.ndarray, Bounds]:
    """Return the moves and kicks that are run, the kicks' sizes [m], (KICKS,), and what tells the runs apart.

    `flat` has the complete keys of a machine on a `floor`, which may hunt with an amplitude of `swing` [m]. A move that
    leads to another place in a count also begins there: it is the whole motion that lies elsewhere on the encoder.
    """
    size, least = size_of_rest(flat), least_breakaway_force(dict(flat))
    bounds = Bounds(floor, size, least if _largest_force(flat) >= least else np.inf, bands_of(flat)[0])
    task = motion_task(flat, 1)
    one = task.pieces.reshape(-1, *task.pieces.shape[-2:])[0]
    pieces = np.repeat(one[None], PLACES + KICKS, axis=0)
    sides = np.where(np.arange(PLACES) % 2, -1.0, 1.0) if not task.form.tones else np.ones(PLACES)
    pieces[:PLACES, :, 1 : 2 + task.form.degree] *= sides[:, None, None]
    places = np.arange(PLACES) / PLACES * flat["drive.encoder_resolution"]
    pieces[:PLACES, :, 1] += places[:, None]
    pieces[PLACES:, :, 1:] = one[-1, 1:]
    largest = max(KICK_RANGE[1] * size, float(np.max(motion.size(flat))), 2 * swing)
    kicks = np.geomspace(KICK_RANGE[0] * size, largest, KICKS) * np.where(np.arange(KICKS) % 2, -1.0, 1.0)
    displacements = np.concatenate([sides * float(np.max(task.displacement)), kicks])
    return replace(task, pieces=pieces, displacement=displacements), kicks, bounds


def _verdict(moves: np.ndarray, kicks: np.ndarray) -> Verdict | Literal["toggles"]:
    """Return the verdict that follows from the fates of moves, the own one first, and of kicks."""
    own = moves[0]
    if own in ("hunts", "failed", "runs away"):
        return "hunts" if own == "hunts" else "failed"
    if own != "open" and ("hunts" in moves or "hunts" in kicks):
        return "bistable"
    if own == "open" or np.count_nonzero(moves == "open") >= len(moves) / 2:
        return "undecided"
    return "toggles" if "toggles" in moves else "settles"


def _counted(fates: np.ndarray) -> dict[Fate, int]:
    return {fate: int(np.count_nonzero(fates == fate)) for fate in dict.fromkeys(fates)}


def _smallest(values: np.ndarray) -> float | None:
    """Return the smallest of some values, whatever their signs; None if there are none."""
    return float(np.abs(values).min()) if values.size else None


def _largest(values: np.ndarray) -> float | None:
    """Return the largest of some values; None if there are none."""
    return float(values.max()) if values.size else None


def _ends(values: np.ndarray) -> tuple[float, float] | None:
    """Return the least and the largest of values; None if there are none."""
    return (float(np.nanmin(values)), float(np.nanmax(values))) if np.isfinite(values).any() else None


LEFT_OUT: Mapping[str, Mapping[str, float]] = {
    "the counts of its encoder": {"drive.encoder_resolution": 0.0},
    "the steps of its force": {"drive.force_resolution": 0.0},
    "the noise of its encoder": {"drive.encoder_noise": 0.0},
    "the dead band of its integral": {"drive.integrator_deadband": 0.0},
    "the reset of its integral": {"drive.integrator_reset": 0.0},
    "its feedforward": {f"drive.feedforward_{part}": 0.0 for part in ("mass", "coulomb", "viscous")},
    "its motor constant": {"drive.motor_constant_ratio": 1.0},
    "the ripple of its force": {"drive.ripple": 0.0},
    "its cable": {"cable.stiffness": 0.0, "cable.drag": 0.0},
    "its rail": {
        f"rail.{part}": 0.0
        for part in (
            "offset",
            "static_deviation",
            "coulomb_deviation",
            "first_harmonic",
            "second_harmonic",
            "third_harmonic",
        )
    },
}
"""What a continuous machine lacks, with the keys [SI] of a machine without it."""

FASTER, FAST_LOOP = 8, 100
"""Factors by which a drive samples faster, and has a faster current loop, that nearly has neither."""


def _without(flat: Mapping[str, Any]) -> Iterator[dict[str, Mapping[str, float]]]:
    """Yield what can be left out of a machine, in words, with the keys of the machine without it.

    Each group of machines runs together; those of later groups have equations of their own.
    """
    parts = {
        words: keys
        for words, keys in LEFT_OUT.items()
        if any(flat.get(key, value) != value for key, value in keys.items())
    }
    if "drive.current_bandwidth" in flat:
        parts["its current loop"] = {"drive.current_bandwidth": FAST_LOOP * flat["drive.current_bandwidth"]}
    if parts:
        yield parts
    if flat["drive.delay"]:
        yield {"its delay": {"drive.delay": 0.0}}
    times = [key for key in flat if key.startswith("drive.") and key.endswith("sample_time")]
    faster = {key: flat[key] / FASTER for key in times}
    yield {"its sample time": faster | {"drive.velocity_samples": FASTER * flat.get("drive.velocity_samples", 1.0)}}


QUIET_SHARE = 0.2
"""Largest swing, peak to peak, of a machine that no longer hunts, in amplitudes of hunting."""


def _reasons(
    flat: Mapping[str, Any], task: MoveTask, bounds: Bounds, seed: int, quiet: float, attracted: bool
) -> tuple[str, ...]:
    """Return what alone makes a run differ from the continuous machine's, which is `attracted` to hunting or not.

    The run has a `task` of its own, as long as it had to be followed, and a `seed`. It does not hunt if it swings by at
    most `quiet` [m], peak to peak.
    """
    for parts in _without(flat):
        changed = {key: np.full(len(parts), flat[key]) for keys in parts.values() for key in keys if key in flat}
        for number, keys in enumerate(parts.values()):
            for key, value in keys.items():
                changed.setdefault(key, np.full(len(parts), value))[number] = value
        timing = {key: value[0] for key, value in changed.items() if key.endswith(("sample_time", "_samples", "delay"))}
        machines = with_complete_drive({**flat, **changed, **timing})
        copies = task.of_runs(np.zeros(len(parts), int))
        try:
            runs = runs_to_their_end(machines, copies, bounds, np.full(len(parts), seed))
        except InputError:  # a delay of more samples than a machine may have
            continue
        alike = runs.fate == "hunts" if attracted else runs.swing <= quiet
        if alike.any():
            return tuple(words for words, so in zip(parts, alike, strict=True) if so)
    return ()
