"""Identification against known truth: `python -m benchmarks.identify [--machines 100] [--moves 20]`.

Machines drawn at random (tests/machines.py) are simulated, their logs get noise and digits, and are identified again.
Per method and quantity: how often the 95 % interval holds the truth, how wide it is, and how often the log was said not
to show the quantity (and the range that is left holds the truth). Fits of moves take minutes per machine, the other
experiments a second: `--moves` is the number of machines whose moves are fitted.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.report import Goal, print_goals, print_table
from friso.errors import InputError
from friso.identify.estimate import Estimate
from friso.identify.experiments.break_away import static_from_ramps
from friso.identify.experiments.moves import identify_moves
from friso.identify.experiments.steps import stiffness_from_steps
from friso.identify.experiments.stick_slip import static_from_stick_slip
from friso.identify.readings.friction_velocity import friction_velocity
from friso.identify.response.analysis import analyse

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from machines import Machine, break_aways, creeping, drawn, moves, shaken, speeds, steps

WANTED = 0.9
"""Share of the shown quantities whose intervals have to hold the truth."""

GOALS = ("masses.cart", "friction.coulomb", "friction.static", "joint.stiffness")
"""Quantities that the goal is about."""

Answer = tuple[str, Estimate, float]
"""Method, what it found, and the truth."""


@dataclass
class Count:
    """How often a quantity was held or missed, its half-widths over the truth, and how often it was not shown and its
    range was right."""

    held: int = 0
    missed: int = 0
    widths: list[float] = field(default_factory=list)
    unshown: int = 0
    right: int = 0

    def add(self, estimate: Estimate, truth: float) -> None:
        if not estimate.determined:
            self.unshown += 1
            self.right += estimate.holds(truth)
            return
        self.held += estimate.holds(truth)
        self.missed += not estimate.holds(truth)
        self.widths.append(estimate.half_width / abs(truth) if truth else estimate.half_width)


def mass_of(flat: dict) -> float:
    return sum(flat[key] for key in ("masses.cart", "masses.stage") if key in flat)


def of_rigid(machine: Machine) -> Iterator[Answer]:
    """Break-away, constant speeds, and the frequency response of a machine without joint."""
    flat = machine.flat
    mass = mass_of(flat)
    yield "break-away", static_from_ramps(break_aways(machine), mass).static, flat["friction.static"]
    both = friction_velocity(speeds(machine), mass).both
    for estimate in (both.coulomb, both.viscous, both.static):
        yield "constant speed", estimate, flat[estimate.name]
    lines = analyse([shaken(machine)]).lines
    if lines:
        value = lines[0].value
        yield "frequency", Estimate("masses.cart", "kg", value.value, value.low, value.high, value.method), mass


def of_jointed(machine: Machine) -> Iterator[Answer]:
    """Steps with the cart held, and slow motion that sticks and slips, with the stiffness that these gave."""
    flat = machine.flat
    stiffness = stiffness_from_steps(steps(machine)).stiffness
    yield "steps", stiffness, flat["joint.stiffness"]
    if stiffness.determined:
        slips = static_from_stick_slip(creeping(machine), stiffness, flat["masses.stage"], flat["joint.stroke"])
        yield "stick-slip", slips.static, flat["friction.static"]


def of_moves(machine: Machine) -> Iterator[Answer]:
    """Moves, with and without the machine's own controller."""
    flat, log = machine.flat, moves(machine)
    for controller_known, words in ((True, "moves, controller known"), (False, "moves, controller unknown")):
        for estimate in identify_moves(log, machine.guess.flat(), controller_known).estimates:
            yield words, estimate, flat.get(estimate.name, 0.0)


def run(first: int, machines: int, fitted: int) -> dict[tuple[str, str], Count]:
    counts: dict[tuple[str, str], Count] = defaultdict(Count)
    for seed in range(first, first + machines):
        begin = time.perf_counter()
        tasks = [of_rigid(drawn(seed, False)), of_jointed(drawn(seed, True))]
        if seed < first + fitted:
            tasks.append(of_moves(drawn(seed, False)))
        for task in tasks:
            try:
                for method, estimate, truth in task:
                    counts[method, estimate.name].add(estimate, truth)
                    if not estimate.holds(truth):
                        remark = "" if estimate.determined else " (not shown)"
                        span = f"{estimate.low:.4g} to {estimate.high:.4g}{remark}"
                        print(f"  machine {seed}, {method}: {estimate.name} {span}, true {truth:.4g}")
            except InputError as error:
                print(f"  machine {seed}: refused: {' '.join(str(error).split())}")
        print(f"machine {seed}: {time.perf_counter() - begin:.0f} s", flush=True)
    return counts


def rows(counts: dict[tuple[str, str], Count]) -> list[list[str]]:
    table = []
    for (method, name), count in sorted(counts.items()):
        width = f"{np.median(count.widths):.2g}" if count.widths else "-"
        reported = count.held + count.missed
        table.append([f"{method}: {name}", f"{count.held} of {reported}", width, f"{count.right} of {count.unshown}"])
    return table


def goals(counts: dict[tuple[str, str], Count]) -> list[Goal]:
    """Of each quantity that the goal is about, by each method that shows it."""
    reached = []
    for (method, name), count in sorted(counts.items(), key=lambda item: item[0][::-1]):
        reported = count.held + count.missed
        if name in GOALS and reported:
            about = f"{name} by {method}: 95 % intervals hold the truth"
            reached.append(Goal(about, ">= 90 %", f"{count.held} of {reported}", count.held >= WANTED * reported))
    return reached


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--moves", type=int, default=None, help="machines whose moves are fitted (default: all)")
    parser.add_argument("--first", type=int, default=0, help="number of the first machine")
    arguments = parser.parse_args()
    counts = run(
        arguments.first, arguments.machines, arguments.machines if arguments.moves is None else arguments.moves
    )
    head = ("method: quantity", "held of shown", "median half-width / truth", "range right of not shown")
    print_table(head, rows(counts))
    print_goals(goals(counts), "Goals")


if __name__ == "__main__":
    main()
