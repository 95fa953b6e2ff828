"""Test identification against known truth.

`python -m benchmarks.identify [--machines 20] [--moves 10] [--kept FILE]` simulates machines drawn at random
(tests/machines.py) in closed loop. Their logs get noise of force, position and time, and finite digits, and are
identified. Moves are identified with the machine's own controller known, and not known. For each method and quantity it
prints, among machines whose motion shows the quantity, how many report it, how many of the 95 % intervals hold the
truth, and how wide they are; and for how many other machines the remaining range holds the truth.

A motion shows a quantity if the best unbiased estimate from its noise, in closed loop, would be better than 30 %
(Cramer-Rao bound). `--moves` is the number of machines whose moves are fitted (two fits each, about half a minute); the
other experiments take a second (`--machines 0` leaves them out). With `--kept`, the answers on each machine are
appended to that file as they come, and are not computed again: a long study runs in pieces, and `--first 100 --moves
100 --kept FILE` then prints the table of all.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Goal, Task, each, numbered, print_goals, print_table
from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.experiments.break_away import static_from_ramps
from friso.identification.logs.log import Log
from friso.identification.moves import identify_moves
from friso.identification.output_error.parameters import EXPONENT, MASS, RATIO, fit_parameters
from friso.identification.output_error.problem import loop_problem
from friso.identification.readings.friction_velocity import friction_velocity
from friso.identification.response.analysis import analyse
from friso.intervals import NORMAL_COVERAGE
from friso_thesis.studies.identification.steps import stiffness_from_steps
from friso_thesis.studies.identification.stick_slip import static_from_stick_slip

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from machines import Machine, break_aways, creeping, drawn, moves, shaken, speeds, steps

WANTED, REPORTED = 0.9, 0.5
"""Fraction of the shown quantities whose intervals must hold the truth, and fraction of the machines whose motion shows
a quantity that must report it."""

GOALS = ("masses.cart", "friction.coulomb", "friction.viscous", "friction.static", "joint.stiffness")
SLOW = (
    "friction.static",
    "friction.stribeck_velocity",
    "friction.bristle_stiffness",
    "friction.bristle_damping",
)
"""Quantities in the goal for intervals, and quantities in the goal for reporting."""

VISIBLE = 0.3
"""Half of the best 95 % interval over the value, below which a motion counts as showing a quantity."""

TIMING = 1e-6
"""Standard deviation [s] of the sampling instants of a log."""


@dataclass(frozen=True)
class Answer:
    """Answer of a method on a quantity of a machine.

    It has the 95 % interval or, if not `reported`, the remaining range; the truth; and whether the motion shows the
    quantity (`visible`).
    """

    method: str
    name: str
    low: float
    high: float
    reported: bool
    truth: float
    visible: bool = True

    @classmethod
    def of(cls, method: str, estimate: Estimate, truth: float, visible: bool = True) -> Answer:
        return cls(
            method, estimate.name, float(estimate.low), float(estimate.high), estimate.determined, float(truth), visible
        )

    @property
    def holds(self) -> bool:
        return self.low <= self.truth <= self.high

    @property
    def miss(self) -> str:
        """Return the interval and the truth that it misses, as text."""
        span = f"{self.low:.4g} to {self.high:.4g}{'' if self.reported else ' (not shown)'}"
        return f"{self.method}: {self.name} {span}, true {self.truth:.4g}"


@dataclass
class Count:
    """Counts for a quantity: how often it was held or missed, with relative half-widths.

    Further, how often it was not reported and its range was right, how often the motion shows it, and how often it was
    then reported.
    """

    held: int = 0
    missed: int = 0
    widths: list[float] = field(default_factory=list)
    unshown: int = 0
    right: int = 0
    visible: int = 0
    seen: int = 0

    @property
    def reported(self) -> int:
        return self.held + self.missed

    def add(self, answer: Answer) -> None:
        self.visible += answer.visible
        self.seen += answer.visible and answer.reported
        if not answer.reported:
            self.unshown += 1
            self.right += answer.holds
            return
        self.held += answer.holds
        self.missed += not answer.holds
        self.widths.append((answer.high - answer.low) / 2 / (abs(answer.truth) or 1.0))


def mass_of(flat: dict) -> float:
    return sum(flat[key] for key in ("masses.cart", "masses.stage") if key in flat)


def of_rigid(machine: Machine) -> Iterator[Answer]:
    """Yield answers on a machine without joint: break-away, speeds, frequency response."""
    flat = machine.flat
    mass = mass_of(flat)
    yield Answer.of("break-away", static_from_ramps(break_aways(machine), mass).static, flat["friction.static"])
    both = friction_velocity(speeds(machine), mass).both
    for estimate in (both.coulomb, both.viscous, both.static):
        yield Answer.of("constant speed", estimate, flat[estimate.name])
    lines = analyse([shaken(machine)]).lines
    if lines:
        value = lines[0].value
        line = Estimate("masses.cart", "kg", value.value, value.low, value.high, value.method)
        yield Answer.of("frequency", line, mass)


def of_jointed(machine: Machine) -> Iterator[Answer]:
    """Yield answers on a machine with a joint.

    They come from steps with the cart held, and from slow motion that sticks and slips, with the stiffness of the
    steps.
    """
    flat = machine.flat
    stiffness = stiffness_from_steps(steps(machine)).stiffness
    yield Answer.of("steps", stiffness, flat["joint.stiffness"])
    if stiffness.determined:
        slips = static_from_stick_slip(creeping(machine), stiffness, flat["masses.stage"], flat["joint.stroke"])
        yield Answer.of("stick-slip", slips.static, flat["friction.static"])


def of_moves(machine: Machine) -> Iterator[Answer]:
    """Yield answers from moves, with and without the machine's own controller.

    A refused log reports nothing.
    """
    log = sampled_in_time(moves(machine), machine)
    flat, visible = machine.flat, shown_by(log, machine)
    for controller_known, method in ((True, "moves, controller known"), (False, "moves, controller unknown")):
        try:
            estimates = identify_moves(log, machine.guess.flat(), controller_known).estimates
        except InputError as error:
            print(f"  {log.name}, {method}: refused: {' '.join(str(error).split())}")
            estimates = tuple(Estimate.unknown(name, "", method, "refused") for name in sorted(visible))
        for estimate in estimates:
            yield Answer.of(method, estimate, flat.get(estimate.name, 0.0), estimate.name in visible)


def sampled_in_time(log: Log, machine: Machine) -> Log:
    """Return the log sampled at instants that are slightly off."""
    late = TIMING * machine.rng.standard_normal(len(log.time))
    speed = np.gradient(log["reference"], log.sample_time)
    return replace(log, signals={**log.signals, "position": log["position"] + late * speed})


def shown_by(log: Log, machine: Machine) -> set[str]:
    """Return the keys that the motion of a log shows.

    The Cramer-Rao bound for the noise of its force, in closed loop, decides.
    """
    flat = {**machine.flat, "friction.viscous_asymmetry": 1e-6}  # not 0: it is one of the equations
    levels = {name: flat[f"friction.{name}"] for name in ("coulomb", "viscous")}
    levels |= {"mass": mass_of(flat), "offset": -flat["bias.cart"]}
    top = flat["motion.acceleration"] * flat["motion.acceleration_time"]
    parameters = fit_parameters(flat, levels, top, float(np.ptp(log["position"])), True)
    flat |= {parameter.name: parameter.start for parameter in parameters if parameter.name == EXPONENT}
    problem = loop_problem(flat, log, log.longest, parameters)
    truth = np.array([parameter.inner(parameter.start) for parameter in parameters])
    names = [parameter.name for parameter in parameters]
    truth[names.index(RATIO)] = flat["friction.static"] / flat["friction.coulomb"]
    (slopes,) = problem.jacobians(truth[None], np.ones((1, len(truth)), bool), problem.residuals(truth[None]))
    noise = np.hypot(machine.force_noise, machine.force_digit / np.sqrt(12))
    size = np.linalg.norm(slopes, axis=0)
    spread = noise * np.sqrt(np.diag(np.linalg.pinv((slopes / size).T @ (slopes / size)))) / size
    scale = np.array([1.0 if p.logarithmic else max(abs(t), 1e-12) for p, t in zip(parameters, truth, strict=True)])
    keys = {MASS: "masses.cart", RATIO: "friction.static"}
    good = NORMAL_COVERAGE * spread < VISIBLE * scale
    return {keys.get(name, name) for name, fine in zip(names, good, strict=True) if fine}


TASKS: Mapping[str, Callable[[int], Iterable[Answer]]] = {
    "rigid": lambda seed: of_rigid(drawn(seed, False)),
    "jointed": lambda seed: of_jointed(drawn(seed, True)),
    "moves": lambda seed: of_moves(drawn(seed, False)),
}


def run(tasks: Iterable[Task], kept: Path | None = None) -> list[Answer]:
    """Return the answers on machines by group of experiments and number; the file `kept` keeps them."""
    return [Answer(**answer) for _, answers in each(tasks, _answers, kept) for answer in answers]


def _answers(task: Task) -> list[dict[str, Any]]:
    kind, seed = str(task[0]), int(task[1])
    begin, answers = time.perf_counter(), list[Answer]()
    try:
        answers = list(TASKS[kind](seed))
    except InputError as error:
        print(f"  machine {seed}, {kind}: refused: {' '.join(str(error).split())}")
    for answer in answers:
        if not answer.holds:
            print(f"  machine {seed}, {answer.miss}")
    print(f"machine {seed}, {kind}: {time.perf_counter() - begin:.0f} s", flush=True)
    return [asdict(answer) for answer in answers]


def counted(answers: Iterable[Answer]) -> dict[tuple[str, str], Count]:
    """Return the counts by method and quantity."""
    counts: dict[tuple[str, str], Count] = defaultdict(Count)
    for answer in answers:
        counts[answer.method, answer.name].add(answer)
    return counts


HEAD = (
    "method: quantity",
    "reported of visible",
    "held of reported",
    "median half-width / truth",
    "range right of not reported",
)


def rows(counts: dict[tuple[str, str], Count]) -> list[list[str]]:
    table = []
    for (method, name), count in sorted(counts.items()):
        width = f"{np.median(count.widths):.2g}" if count.widths else "-"
        seen, held = f"{count.seen} of {count.visible}", f"{count.held} of {count.reported}"
        table.append([f"{method}: {name}", seen, held, width, f"{count.right} of {count.unshown}"])
    return table


def goals(counts: dict[tuple[str, str], Count]) -> list[Goal]:
    """Return the goals on each of their quantities, for each method that shows it."""
    reached = []
    for (method, name), count in sorted(counts.items(), key=lambda item: item[0][::-1]):
        if name in GOALS and count.reported:
            about = f"{name} by {method}: 95 % intervals hold the truth"
            enough = count.held >= WANTED * count.reported
            reached.append(Goal(about, ">= 90 %", f"{count.held} of {count.reported}", enough))
        if name in SLOW and method.startswith("moves") and count.visible:
            about = f"{name} by {method}: reported where the motion shows it"
            enough = count.seen >= REPORTED * count.visible
            reached.append(Goal(about, ">= 50 %", f"{count.seen} of {count.visible}", enough))
    return reached


def main() -> None:
    parser = numbered(__doc__, 20)
    parser.add_argument("--moves", type=int, default=10, help="machines whose moves are fitted")
    arguments = parser.parse_args()
    numbers = {"rigid": arguments.machines, "jointed": arguments.machines, "moves": arguments.moves}
    tasks = [(kind, seed) for kind, n in numbers.items() for seed in range(arguments.first, arguments.first + n)]
    counts = counted(run(tasks, arguments.kept))
    print_table(HEAD, rows(counts))
    print_goals(goals(counts), "Goals")


if __name__ == "__main__":
    main()
