"""Test settings of `friso tune` on fresh machines by independent equations.

`python -m benchmarks.eight_machines FILE` tunes eight kinds of machine. Each setting that works is tried on machines
for which nothing was tuned, by the equations of `tests/plain.py` (this module has the observer of disturbance rejection
and the screw with its play) and by SciPy's LSODA. A row for each machine and move goes to FILE as one line of JSON, so
that a run may be continued; the table by size of move is printed at the end. `--only NAME ...` chooses machines,
`--machines N` sets how many are tried.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from math import pi
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.report import print_table
from friso.equations.model import assemble
from friso.equations.structure import structure
from friso.questions.tune.words import changes
from friso.remedies.goal import Goal
from friso.remedies.machines import draw_fleet
from friso.remedies.method import tune
from friso.stage import Stage, load
from friso.stage.correlations import Correlations

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))
import plain  # noqa: E402

FRESH_SEED, MOST, LIMIT = 9001, 100, 25.0
"""Seed and number of the fresh machines, and the limit of the bandwidth [Hz] for machines without another limit."""

SIZES = (0.0, 1e-4, 1e-3, np.inf)
"""Edges of the classes of moves [m, rad]."""

Rates = Callable[[float, Any], Any]


def machines() -> Iterator[tuple[str, Stage, Goal]]:
    """Yield the eight machines by name, each with its goal."""
    rig = load(ROOT / "examples" / "thesis_rig.toml")
    locked = rig.replace({"joint.locked": True})
    goal = Goal(bandwidth_limit=LIMIT)
    yield "PID", locked, goal
    cascade = load(ROOT / "examples" / "twincat_cascade.toml").replace({"joint.locked": True})
    yield "cascade", cascade, Goal(bandwidth_limit=40.0)
    yield "ADRC", locked.replace({"controller": {"kind": "adrc", "bandwidth": "3 Hz"}}), goal
    yield "ball screw", load(ROOT / "examples" / "ball_screw_axis.toml"), Goal(bandwidth_limit=40.0)
    yield "rotary", Stage(**ROTARY), Goal(within=1e-5, bandwidth_limit=LIMIT)
    yield "vertical", locked.replace({"bias": {"stage": "-5 N"}}), goal
    gms = load(ROOT / "examples" / "thesis_rig_gms.toml").replace({"joint.locked": True})
    yield "GMS", gms, goal
    yield "force limit", locked.replace({"controller.force_limit": "60 N", "motion.acceleration": "25 m/s^2"}), goal


ROTARY: dict[str, Any] = {
    "axis": {"kind": "rotary"},
    "masses": {"stage": "0.02 kg*m^2"},
    "friction": {
        "model": "lugre",
        "static": "0.6 N*m",
        "coulomb": "0.3 N*m",
        "stribeck_velocity": "0.01 rad/s",
        "stribeck_exponent": 2,
        "bristle_stiffness": "2000 N*m/rad",
        "bristle_damping": "5 N*m*s/rad",
        "viscous": "0.02 N*m*s/rad",
    },
    "controller": {"kind": "pid", "crossover": "8 Hz", "alpha": 0.1, "beta": 2},
    "motion": {
        "kind": "there_and_back",
        "acceleration": "50 rad/s^2",
        "acceleration_time": "0.1 s",
        "return_at": "3 s",
        "duration": "10 s",
    },
}


def by_hand(flat: Mapping[str, Any]) -> tuple[np.ndarray, Rates, int]:
    """Return the state at rest, the rates, and the place of the position among the states."""
    if "transmission.mass" in flat:
        return np.zeros(7), _screw(flat), 0
    names = [str(state.symbol) for state in assemble(structure(dict(flat))).states]
    if flat["controller.kind"] == "adrc":
        machine = [name for name in names if name not in ("filtered_observer", "filtered_observer_rate", "integral")]
        return np.zeros(len(machine) + 3), _observer(flat, machine), machine.index("position")
    rest = np.zeros(len(names))
    if load_force := flat.get("bias.stage", 0.0) + flat.get("bias.cart", 0.0):
        demand = plain.control(flat, dict.fromkeys(names, 0.0) | {"integral": 1.0}, 0.0, 0.0, 0.0, 0.0, 0.0)[0]
        rest[names.index("integral")] = -load_force / demand
    return rest, plain.rates(flat, names), names.index("position")


def _observer(flat: Mapping[str, Any], names: list[str]) -> Rates:
    """Return the rates of a machine under Gao's extended state observer of the error.

    The observer has three states of its own.
    """
    feedback = 2 * pi * flat["controller.bandwidth"]
    observer, mass = flat["controller.observer_ratio"] * feedback, flat["controller.tuned_mass"]
    machine = plain.rates({**flat, "controller.kind": "pid", **NO_GAINS}, [*names, "integral"])

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        estimate, rate, disturbance = x[-3:]
        force = mass * (feedback**2 * estimate + 2 * feedback * rate + disturbance)
        miss = plain.reference(flat, t)[0] - x[names.index("position")] - estimate
        slopes = machine(t, [*x[:-3], 0.0])[:-1]
        body = flat["masses.stage"] - flat.get("parasitic.mass", 0.0) if "cart_position" in names else _mass(flat)
        slopes[names.index("velocity")] += force / body
        return np.array([
            *slopes,
            rate + 3 * observer * miss,
            disturbance - force / mass + 3 * observer**2 * miss,
            observer**3 * miss,
        ])  # fmt: skip

    return rates


NO_GAINS = dict.fromkeys((f"controller.{name}" for name in ("kp", "ki", "kd", "tau")), 0.0) | {
    "controller.derivative_on": "measurement"
}


def _mass(flat: Mapping[str, Any]) -> float:
    return float(flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0))


def _screw(flat: Mapping[str, Any]) -> Rates:
    """Return the rates of motor and load with play between them, under a PID controller.

    Its derivative is that of the motor or of the load.
    """
    key = {name: flat[f"transmission.{name}"] for name in ("mass", "stiffness", "damping")}
    half, load_mass = flat.get("transmission.backlash", 0.0) / 2, _mass(flat)
    kp, ki, kd, tau = (flat[f"controller.{name}"] for name in ("kp", "ki", "kd", "tau"))
    assert tau == 0.0
    assert flat["controller.derivative_on"] == "measurement"
    of_motor = {name.replace("motor_friction", "friction"): value for name, value in flat.items() if "motor_f" in name}
    in_motor = [flat[f"encoder.{what}"] == "motor" for what in ("position", "velocity")]

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        y, v, motor, motor_v, motor_z, z, integral = x
        stretch, opening = motor - y, motor_v - v
        pull = 0.0
        if abs(stretch) > half:
            pull = key["stiffness"] * (stretch - np.sign(stretch) * half) + key["damping"] * opening
        error = plain.reference(flat, t)[0] - (motor if in_motor[0] else y)
        force = kp * error + ki * integral - kd * (motor_v if in_motor[1] else v)
        drag, z_rate = plain.friction(flat, v, z)
        motor_drag, motor_rate = plain.friction(of_motor, motor_v, motor_z)
        return np.array([
            v, (pull - drag) / load_mass, motor_v, (force - pull - motor_drag) / key["mass"], motor_rate, z_rate, error,
        ])  # fmt: skip

    return rates


def settling(flat: Mapping[str, Any], within: float) -> float:
    """Return the longer settling time [s] of a move there and back.

    It is infinite if the stage stays out of the band, and NaN if the run failed.
    """
    ramp, back, duration = (flat[f"motion.{name}"] for name in ("acceleration_time", "return_at", "duration"))
    state, rates, place = by_hand(flat)
    longest = 0.0
    corners = [0.0, ramp, 2 * ramp, back, back + ramp, back + 2 * ramp, duration]
    for low, high in pairwise(corners):
        times = np.linspace(low, high, max(50, int((high - low) / 1e-3)))
        step = min(1e-2, (high - low) / 4)
        run = solve_ivp(rates, (low, high), state, "LSODA", times, rtol=1e-7, atol=1e-12, max_step=step)
        if not run.success:
            return np.nan
        state = run.y[:, -1]
        if low in (2 * ramp, back + 2 * ramp):
            target = plain.reference(flat, (low + high) / 2)[0]
            out = np.flatnonzero(np.abs(run.y[place] - target) > within)
            if out.size:
                longest = np.inf if out[-1] == times.size - 1 else max(longest, times[out[-1] + 1] - low)
        if np.isinf(longest):
            return longest
    return float(longest)


def tried(name: str, stage: Stage, goal: Goal, count: int, file: Path) -> None:
    """Tune a machine, try working settings on fresh machines, and append lines to the file."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    if not any(row["machine"] == name and "told" in row for row in rows):
        begun = process_time()
        advice = tune(stage, goal)
        seconds = process_time() - begun
        with file.open("a") as written:
            for outcome in advice.outcomes:
                if outcome.certainty not in ("works", "large moves") or outcome.remedy.makes:
                    continue
                assert outcome.stage is not None
                assert outcome.measured is not None
                share = outcome.measured.share(advice.goal)
                fleet = draw_fleet(outcome.stage, Correlations(), MOST, FRESH_SEED, advice.goal.moves)
                row = {
                    "machine": name,
                    "setting": outcome.remedy.name,
                    "certainty": outcome.certainty,
                    "changes": str(changes(advice.stage, outcome.stage)),
                    "told": [share.probability, share.low, share.high],
                    "slowest": [outcome.measured.slowest(advice.goal), *outcome.measured.slowest_interval(advice.goal)],
                    "moves_from": outcome.moves_from,
                    "within": advice.goal.within,
                    "seconds": seconds,
                    "flat": {
                        k: v.tolist() if np.ndim(v) else v for k, v in fleet.laid_over(outcome.stage, {}, 1).items()
                    },
                    "sizes": fleet.sizes.tolist(),
                }
                print(name, outcome.remedy.name, row["told"], row["slowest"], f"{seconds:.0f} s", flush=True)
                written.write(json.dumps(row, default=float) + "\n")
            if not any(outcome.certainty == "works" for outcome in advice.outcomes):
                written.write(json.dumps({"machine": name, "told": None, "seconds": seconds}) + "\n")
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    done = {(row["setting"], row["number"]) for row in rows if row["machine"] == name and "number" in row}
    for row in (row for row in rows if row["machine"] == name and row.get("told")):
        for number in range(count):
            if (row["setting"], number) in done:
                continue
            flat = {key: value[number] if isinstance(value, list) else value for key, value in row["flat"].items()}
            result = {"machine": name, "setting": row["setting"], "number": number, "size": row["sizes"][number]}
            with file.open("a") as written:
                written.write(json.dumps(result | {"settling": settling(flat, row["within"])}) + "\n")


def table(file: Path) -> None:
    """Print the settings with two fractions: by friso's statement, and by these equations.

    The latter is printed for each class of moves.
    """
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    listed = []
    for row in (row for row in rows if row.get("told")):
        runs = [one for one in rows if "number" in one and all(one[k] == row[k] for k in ("machine", "setting"))]
        times, sizes = (np.array([one[k] for one in runs]) for k in ("settling", "size"))
        if not runs:
            continue
        settled = np.isfinite(times)
        by_size = []
        for low, high in pairwise(SIZES):
            some = (sizes >= max(low, row["moves_from"] or 0.0)) & (sizes < high)
            by_size.append(f"{settled[some].sum()} of {some.sum()}")
        in_time = f"{np.count_nonzero(times <= row['slowest'][2])} of {len(runs)}"
        shares = "{:.1%} ({:.1%} to {:.1%})".format(*row["told"])
        slowest = "{:.3g} s ({:.3g} to {:.3g} s)".format(*row["slowest"])
        parts = (row["machine"], row["setting"], row["certainty"], shares, f"{settled.sum()} of {len(runs)}", *by_size)
        listed.append((*parts, slowest, in_time, f"{row['seconds']:.0f} s"))
    edges = ["up to 0.1 mm", "to 1 mm", "larger"]
    print_table(
        ("machine", "setting", "", "told", "own", *edges, "95 % within, told", "own within its upper end", "CPU"),
        listed,
    )


def main() -> None:
    """Tune the machines, try the settings on fresh machines, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--machines", type=int, default=MOST)
    options = parser.parse_args()
    for name, stage, goal in machines():
        if options.only is None or name in options.only:
            tried(name, stage, goal, options.machines, options.file)
    table(options.file)


if __name__ == "__main__":
    main()
