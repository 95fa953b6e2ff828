"""Test the way from rig to stage file.

Run by `python -m benchmarks.rig_loop [--machines 100] [--first 0]`. Machines drawn at random with their real drives
(tests/rig_machines.py) go through the experiments of `friso rig`: frequency responses with the joint locked and free,
steps, slow motion, and with the joint locked many speeds, slow sliding and small motion before sliding. Their logs are
written as text, read back as `friso identify` does, and identified with what an owner knows as `--stage`. All but the
free response make one stage file; the free response is identified separately, because a machine can be on one bench at
a time.

For each experiment and quantity it prints how often the 95 % interval holds the truth; and how often `friso check` on
the identified stage gives the machine's verdict. A machine has one rail. For an experiment, the true static and Coulomb
friction are means along the stretches where its cart went; in the stage file and for the verdict, they are means along
the travel of the machine's own motion. All other true values are the machine's own.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.identify import HEAD, Answer, Count, goals, rows
from benchmarks.report import Goal, print_goals, print_table
from friso.equations.rail import friction_factors
from friso.errors import InputError
from friso.hunting import check
from friso.identification.method import Identification, identify
from friso.stage import Stage, load, save
from friso_thesis.studies.rig.experiments.frf import plant_log
from friso_thesis.studies.rig.experiments.presliding import presliding_log
from friso_thesis.studies.rig.experiments.stiction import slow_legs
from friso_thesis.studies.rig.experiments.stiffness import steps
from friso_thesis.studies.rig.many_speeds import many_speeds_logs, slow_sliding_logs
from friso_thesis.studies.rig.outcome import RigLog, freed, locked_stage, travel

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from rig_machines import Machine, built, mean_level, sources, through_files

PLACES, POINTS = 3, 1000
"""Numbers of places for the frequency responses and the motion before sliding, and of points along the travel for its
mean friction."""

SAME = 0.95
"""Fraction of the verdicts that must equal those of the machines."""

LEVELS = ("friction.static", "friction.coulomb")

Verdicts = dict[str, Counter[tuple[str, str]]]
"""For each case, how often each verdict on the machine became which verdict on the identified stage."""


def benches(machine: Machine, seed: int) -> list[list[RigLog]]:
    """Return the groups of logs that are identified together."""
    stage, noise = machine.truth, 1000 * (seed + 1)
    low, high = travel(stage)
    places = [low + (high - low) * number / (PLACES - 1) for number in range(PLACES)]

    def shaken(machine_stage: Stage, name: str) -> list[RigLog]:
        return [plant_log(machine_stage, f"{name}_{n + 1}", place, noise + n) for n, place in enumerate(places)]

    slow = slow_legs(stage, noise, 1)
    small = [
        presliding_log(locked_stage(stage), f"presliding_{n + 1}", place, noise + n) for n, place in enumerate(places)
    ]
    passes = many_speeds_logs(locked_stage(stage), noise)
    sliding = slow_sliding_logs(locked_stage(stage), passes, noise)
    return [
        [*shaken(locked_stage(stage), "locked"), steps(stage, noise), *slow, *small, *passes, *sliding],
        shaken(freed(stage), "free"),
    ]


def found_in(logs: list[RigLog], machine: Machine) -> tuple[Identification, Stage]:
    """Identify files of logs; return the result and its stage file.

    The owner states the stroke of the fixtures.
    """
    wide = {"joint.stroke": freed(machine.truth).flat()["joint.stroke"]}
    with tempfile.TemporaryDirectory() as folder:
        recorded = through_files(logs, Path(folder))
        identified = identify(sources(recorded), machine.guess.with_numbers(wide))
        assert identified.stage is not None
        file = Path(folder) / "identified.toml"
        save(identified.stage, file)
        return identified, load(file).with_numbers({"joint.stroke": machine.flat["joint.stroke"]})


def on_its_rail(machine: Machine) -> Stage:
    """Return the machine on an even rail with the mean friction of its own rail."""
    factors = friction_factors(machine.flat, np.linspace(*travel(machine.truth), POINTS)).mean(axis=1)
    return machine.truth.with_numbers({key: machine.flat[key] * by for key, by in zip(LEVELS, factors, strict=True)})


def answers(identified: Identification, logs: list[RigLog], machine: Machine) -> Iterator[Answer]:
    """Yield the answers of each experiment, and of all together, with the truth."""
    flat, travelled = machine.flat, on_its_rail(machine).flat()
    for experiment in identified.experiments:
        matching = [log for log in logs if log.name in {source.name.removesuffix(".csv") for source in experiment.logs}]
        words = f"{experiment.kind}, free" if matching[0].name.startswith("free") else experiment.kind
        for estimate in experiment.estimates:
            truth = mean_level(matching, estimate.name) if estimate.name in LEVELS else flat[estimate.name]
            yield Answer.of(words, estimate, truth)
    if len(identified.experiments) > 1:
        for estimate in identified.estimates:
            yield Answer.of("stage file", estimate, travelled[estimate.name])


def run(first: int, machines: int) -> tuple[dict[tuple[str, str], Count], Verdicts]:
    counts: dict[tuple[str, str], Count] = defaultdict(Count)
    verdicts: Verdicts = defaultdict(Counter)
    for seed in range(first, first + machines):
        begin, machine = time.perf_counter(), built(seed)
        for number, logs in enumerate(benches(machine, seed)):
            for log in logs:
                if log.failure:
                    print(f"  machine {seed}: {log.name} stopped {log.failure}")
            try:
                identified, stage = found_in(logs, machine)
            except InputError as error:
                print(f"  machine {seed}: refused: {' '.join(str(error).split())}")
                continue
            for answer in answers(identified, logs, machine):
                counts[answer.method, answer.name].add(answer)
                if not answer.holds:
                    print(f"  machine {seed}, {answer.miss}")
            if number == 0:
                _compare(machine, stage, verdicts, seed)
        print(f"machine {seed}: {time.perf_counter() - begin:.0f} s", flush=True)
    return counts, verdicts


def _compare(machine: Machine, stage: Stage, verdicts: Verdicts, seed: int) -> None:
    """Count verdicts on the identified stage against those on the machine, on an even rail."""
    true, identified = check(on_its_rail(machine)), check(stage)
    for case, true_case in true.items():
        pair = true_case.verdict, identified[case].verdict
        verdicts[case][pair] += 1
        if pair[0] != pair[1]:
            print(f"  machine {seed}, {case}: {pair[0]}, identified {pair[1]}")


def same(verdicts: Verdicts) -> list[Goal]:
    """Return the goals about the verdicts."""
    reached = []
    for case, pairs in verdicts.items():
        right, total = sum(n for (true, back), n in pairs.items() if true == back), pairs.total()
        reached.append(Goal(f"verdict, {case}", ">= 95 %", f"{right} of {total}", right >= SAME * total))
    return reached


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first machine")
    arguments = parser.parse_args()
    counts, verdicts = run(arguments.first, arguments.machines)
    print_table(HEAD, rows(counts))
    pairs = [[case, *pair, n] for case, table in verdicts.items() for pair, n in sorted(table.items())]
    print_table(("case", "verdict of the machine", "identified", "machines"), pairs)
    print_goals([*goals(counts), *same(verdicts)], "Goals")


if __name__ == "__main__":
    main()
