"""Compare verdicts on stages with windows against friction with brute force: `python -m benchmarks.windows`.

Stages are drawn: a PID on a rigid mass with LuGre friction, and a window of each kind in turn. Equations by hand
(`benchmarks.by_hand`) follow each from many starts for 25 s of the stage's time, in fixed steps. A sure
verdict is wrong if a start swings on although nothing is said to attract, or if all come to rest although hunting is
sure. A sure edge in bandwidth is wrong if no start swings on a tenth below it, or one does a tenth above. A swing
above that is gone 6 % to either side lies in a window narrower than the steps of the search, of which *certain* does
not speak (docs/hunting.md); it is counted by itself.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.by_hand import relaxed, trace
from friso.equations.bandwidth import faster
from friso.hunting import Hunting, find_margin, hunting
from friso.stage import Stage, loads

MASS, STEP, LONG = 1.7, 3e-5, 25.0
"""Moving mass [kg], step [s] and duration [s] of the runs by hand."""

LONGER = 4 * LONG
"""Duration [s] of runs above an edge in which a swing is left after 25 s: beside a cycle that repels it dies out
slowly."""

LATE, SWINGS = 10.0, 0.02
"""Last seconds that are judged, and the swing there, peak to peak over the deflection at break-away, that lasts."""

BESIDE = 1.06
"""Factor of bandwidth to either side at which a swing above the edge is gone, if it lies in a narrow window."""

STARTS = np.geomspace(0.05, 3.0, 5)
"""Displacements of the starts, in deflections at break-away."""


@dataclass(frozen=True)
class Drawn:
    """A stage that was drawn, and the kind of its window."""

    kind: str
    stage: Stage


def drawn(number: int, seed: int = 87) -> Drawn:
    """Return the stage with this number."""
    rng = np.random.default_rng((seed, number))

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    static, omega, damping = log(1.0, 6.0), log(15.0, 60.0), log(0.15, 0.7)
    kp = MASS * omega**2
    length = static / kp
    near = length * log(0.005, 0.6)
    far, stay = near * log(1.2, 4.0), log(1e-3, 0.1)
    windows: dict[str, dict[str, Any]] = {
        "deadband with exit": {"error_deadband": near, "error_deadband_exit": far},
        "deadband with time": {"error_deadband": near, "error_deadband_exit": far, "error_deadband_time": stay},
        "deadband with gain": {"error_deadband": near, "error_deadband_gain": log(0.05, 0.8)},
        "pause and decay": {
            **{"integral_deadband": near, "integral_deadband_exit": far},
            **{"integral_deadband_time": stay, "integral_deadband_decay": log(0.05, 1.0)},
        },
        "inner gains": {
            **{"standstill_window": near, "standstill_window_exit": far, "standstill_window_time": stay},
            **{"standstill_factor": log(0.2, 1.5), "standstill_integral_factor": log(0.1, 3.0)},
        },
        "schedule": {"schedule_error": [near, far], "schedule_factor": [log(0.1, 0.9), log(0.8, 1.3)]},
        "freeze": {"freeze_window": near, "freeze_window_exit": far},
        "freeze with time": {"freeze_window": near, "freeze_window_exit": far, "freeze_window_time": stay},
    }
    kind = [*windows][number % len(windows)]
    lines = [f"{name} = {_written(name, value)}" for name, value in windows[kind].items()]
    table = f"""
[masses]
stage = "{MASS} kg"
[friction]
model = "lugre"
static = "{static!r} N"
coulomb = "{static * log(0.2, 0.8)!r} N"
stribeck_velocity = "{log(5e-4, 1e-2)!r} m/s"
stribeck_exponent = 2
bristle_stiffness = "1e5 N/m"
bristle_damping = "300 N*s/m"
viscous = "{log(0.1, 3.0)!r} N*s/m"
[controller]
kind = "pid"
kp = "{kp!r} N/m"
ki = "{kp * 2 * damping * omega * log(0.1, 0.6)!r} N/(m*s)"
kd = "{2 * damping * MASS * omega!r} N*s/m"
derivative_on = "measurement"
{chr(10).join(lines)}
[motion]
kind = "release"
displacement = "{2 * length!r} m"
duration = "{LONG} s"
"""
    return Drawn(kind, loads(table))


def _written(name: str, value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_written(name, one) for one in value)}]"
    unit = "s" if name.endswith(("time", "decay")) else "m"
    return repr(value) if name.endswith(("gain", "factor")) else f'"{value!r} {unit}"'


def swings(flat: Mapping[str, Any], claimed: Sequence[float] = (), long: float = LONG) -> list[float]:
    """Return the late swings, peak to peak over the deflection at break-away, of starts that swing on after `long` [s].

    Stages start displaced, also by the `claimed` distances [m] at which a cycle is said to stick, with an empty
    integral and with one that takes all force away.
    """
    length = flat["friction.static"] / flat["controller.kp"]
    times = np.concatenate([[0.0], np.arange(long - LATE, long, 2e-3)])
    lasting = []
    for displacement in (*(STARTS * length), *claimed):
        for integral in (0.0, relaxed(flat, displacement)):
            late = trace(flat, np.array([displacement, 0.0, 0.0, integral]), times, STEP)[1:]
            swing = float(np.ptp(late)) / length
            if swing > SWINGS and np.ptp(late[len(late) // 2 :]) > SWINGS * length:
                lasting.append(swing)
    return lasting


def sticking(said: Hunting) -> list[float]:
    """Return the distances [m] at which the cycles that are said to attract stick."""
    return [abs(float(cycle.signals["error"][1][0])) for cycle in said.attracting]


@dataclass(frozen=True)
class Compared:
    """What friso says of a drawn stage, and what brute force shows.

    `lasting` starts swing on. `edge` is what becomes of a sure edge: "right", "wrong", "window", or "" without one.
    """

    number: int
    kind: str
    sure: bool
    attracts: bool
    lasting: int
    edge: str = ""

    @property
    def wrong(self) -> bool:
        """Tell whether a sure verdict is refuted."""
        return self.sure and self.attracts != (self.lasting > 0)


def compared(number: int, seed: int = 87) -> Compared:
    """Compare the verdict on a drawn stage, and its edge in bandwidth if it hunts, with brute force."""
    one, edge = drawn(number, seed), ""
    said = hunting(one.stage)
    attracts, lasting = bool(said.attracting or said.observed), len(swings(one.stage.flat(), sticking(said)))
    margin = find_margin(one.stage, True) if attracts else None
    if margin and margin.certain:
        below, above = (faster(one.stage.flat(), factor) for factor in (0.9 * margin.factor, 1.1 * margin.quiet))
        slower = one.stage.with_numbers(
            {key: below[key] for key in ("controller.kp", "controller.ki", "controller.kd")}
        )
        edge = "right" if swings(below, sticking(hunting(slower))) else "wrong"
        if swings(above) and swings(above, long=LONGER):
            beside = (faster(above, factor) for factor in (1 / BESIDE, BESIDE))
            edge = "wrong" if any(swings(flat, long=LONGER) for flat in beside) else "window"
    return Compared(number, one.kind, said.certain, attracts, lasting, edge)


def table(every: list[Compared], seed: int) -> str:
    """Return a page with the comparison, by kind of window."""
    rows = []
    for kind in [*dict.fromkeys(one.kind for one in every), "all"]:
        of = [one for one in every if kind in (one.kind, "all")]
        edges = [one.edge for one in of if one.edge]
        numbers = (len(of), sum(one.sure for one in of), sum(one.lasting > 0 for one in of), sum(o.wrong for o in of))
        rows.append(
            f"| {kind} | {' | '.join(map(str, (*numbers, len(edges), *map(edges.count, ('wrong', 'window')))))} |"
        )
    return f"""# Windows against friction, by brute force

Written by `python -m benchmarks.windows --table docs/evidence/windows.md` on {date.today():%d %B %Y}; seed {seed}. Each
drawn stage is followed from {2 * len(STARTS)} starts, and from where cycles are said to stick, for {LONG:g} s in steps
of {STEP * 1e6:g} us by equations written by hand; a stage that hunts also {0.1:.0%} below and above its edge in
bandwidth, where a swing that is left after {LONG:g} s is followed for {LONGER:g} s.

| window | stages | sure | hunt | sure and wrong | sure edges | of these wrong | with a narrow window above |
|---|---|---|---|---|---|---|---|
{chr(10).join(rows)}

A narrow window above an edge is one narrower than the steps of the search, of which *certain* does not speak
([hunting](../hunting.md)).
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", type=int, default=24)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=87)
    parser.add_argument("--table", type=Path, help="file that the table is written to")
    arguments = parser.parse_args()
    every = []
    for number in range(arguments.first, arguments.first + arguments.stages):
        every.append(compared(number, arguments.seed))
        print(every[-1], "WRONG" if every[-1].wrong or every[-1].edge == "wrong" else "", flush=True)
        if arguments.table:
            arguments.table.write_text(table(every, arguments.seed))


if __name__ == "__main__":
    main()
