"""Measure what lesser processors cost, and compare their answers: `python -m benchmarks.processors`.

It runs two maps of the thesis rig, on one core, with code for each processor that this machine can imitate, in
turns. Times are ratios to this machine's own; the fraction of runs with equal outcome is printed as well.

With `--answers 40`, so many stages drawn from the series of `benchmarks.truth` are checked, followed (`boundary`),
mapped, tuned, and identified from logs of their own instead, with code for this machine, AVX2 and SSE2. Words and
numbers of the answers are compared. Slow questions get fewer stages. `--kept FOLDER` keeps the answers of each
processor, one file for a question and stage, so that a run continues where one was stopped.
"""

import argparse
import base64
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import friso
from benchmarks.report import print_table
from benchmarks.truth.draws import SERIES, draw
from friso.engine.machine_code import PROCESSOR_VARIABLE, processor
from friso.studies.study import Request, Study
from friso.studies.sweep import local_crew, run_in_memory

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from snapshots import NUMBER, words

LEVELS = {"": "this machine", "x86-64-v4": "AVX-512", "x86-64-v3": "AVX2", "x86-64-v2": "SSE4.2", "x86-64": "SSE2"}
"""Processors by LLVM's name, most able first, and their usual names."""

ANSWERING = ("", "x86-64-v3", "x86-64")
"""Processors whose answers are compared, with the first."""

SEED = 9101
NEAR = 1e-3
"""Relative difference up to which numbers count as equal."""


def _check(stage: friso.Stage, folder: Path) -> Any:
    return friso.check(stage)


def _boundary(stage: friso.Stage, folder: Path) -> Any:
    key = next(key for key in ("controller.crossover", "friction.static") if key in stage.flat())
    value, unit = stage.flat()[key], "Hz" if "crossover" in key else "N"
    return friso.boundary(stage, {key: f"{value / 3} {unit}..{3 * value} {unit}"})


def _map(stage: friso.Stage, folder: Path) -> Any:
    static, mass = stage.flat()["friction.static"], stage.flat()["masses.stage"]
    ranges = {
        "friction.static": (static * np.geomspace(0.5, 2, 9), "N"),
        "masses.stage": (mass * np.geomspace(0.8, 1.25, 9), "kg"),
    }
    outcomes = friso.sweep(stage, ranges).outcome.values
    return " ".join(f"{(outcomes == name).sum()} {name}" for name in np.unique(outcomes))


def _tune(stage: friso.Stage, folder: Path) -> Any:
    return friso.tune(stage)


def _identify(stage: friso.Stage, folder: Path) -> Any:
    run = friso.simulate(stage).data
    noise = np.random.default_rng(1).normal(size=(2, run.time.size))
    columns = [run.time.values, run.position.values + 2e-8 * noise[0], run.force.values + 0.02 * noise[1]]
    log, file = folder / "log.csv", folder / "stage.toml"
    np.savetxt(log, np.transpose(columns), delimiter=",", header="time [s],position [m],force [N]", comments="")
    friso.save(stage, file)
    return friso.identify(log, stage=file)


QUESTIONS: dict[str, tuple[int, Callable[[friso.Stage, Path], Any]]] = {
    "check": (1, _check),
    "boundary": (5, _boundary),
    "map": (5, _map),
    "tune": (21, _tune),
    "identify": (11, _identify),
}
"""Questions: each has the number of stages per question, and the function that asks."""


def drawn(number: int) -> friso.Stage:
    """Return a drawn stage; series take turns."""
    series = [*SERIES]
    return draw(SEED, number // len(series), series[number % len(series)])


def answer(folder: Path, count: int) -> None:
    """Compute the answers on `count` stages in this process, and keep them in a folder.

    Answers that are there already are not computed again.
    """
    for question, (every, ask) in QUESTIONS.items():
        for number in range(0, count, every):
            if not (place := folder / f"{question}-{number}.txt").exists():
                with TemporaryDirectory() as work:
                    try:
                        said = ask(drawn(number), Path(work))
                    except friso.InputError as error:
                        said = f"refused: {error}"
                place.write_text(said if isinstance(said, str) else "\n".join(said.sentences()), encoding="utf-8")


def compared(own: str, other: str) -> tuple[bool, float]:
    """Tell whether two texts have equal words, and their numbers' largest relative difference.

    It is infinite if the words differ.
    """
    first, second = words(own), words(other)
    numbers = [(a, b) for a, b in zip(first, second, strict=False) if NUMBER.fullmatch(a) and NUMBER.fullmatch(b)]
    same = len(first) == len(second) and all(a == b or (a, b) in numbers for a, b in zip(first, second, strict=True))
    off = (abs(float(a) - float(b)) / max(abs(float(a)), abs(float(b)), 1e-300) for a, b in numbers)
    return same, max(off, default=0.0) if same else np.inf


def maps(rtol: float) -> dict[str, Study]:
    """Return two maps of the thesis rig over crossover: of the cart's mass, joint locked, and of stroke, joint free."""
    stage = friso.load(friso.example("thesis_rig"))
    locked = {"controller.crossover": "1 Hz..40 Hz:41", "masses.cart": "0.1 kg..5 kg:41"}
    free = {"controller.crossover": "1 Hz..16 Hz:41", "joint.stroke": "1 um..1 mm:41"}
    return {
        "locked, crossover x mass": Request(stage.replace({"joint.locked": True}), locked).study(rtol=rtol),
        "free, crossover x stroke": Request(stage, free).study(rtol=rtol),
    }


def measure(rtol: float, repetitions: int) -> dict[str, list[float | str]]:
    """Return the least time [s] of each map on one core, and which of its runs swing, packed.

    This runs in the present process.
    """
    result: dict[str, list[float | str]] = {}
    with local_crew(1) as crew:
        for name, study in maps(rtol).items():
            times, peaks = [], np.zeros(0)
            for _ in range(repetitions + 1):  # the first run warms up
                start = time.process_time()
                (data,) = run_in_memory([study], crew)
                peaks = np.asarray(data["peaks"]).ravel()
                times.append(time.process_time() - start)
            swings = np.packbits(peaks > 0).tobytes()
            result[name] = [min(times[1:]), base64.b64encode(swings).decode("ascii")]
    return result


def measured_on(name: str, rtol: float, repetitions: int) -> dict[str, tuple[float, np.ndarray]]:
    """Time the maps in a process of its own, with code for the named processor."""
    command = [sys.executable, "-m", "benchmarks.processors", "--child", repr(rtol), str(repetitions)]
    done = subprocess.run(command, env={**os.environ, PROCESSOR_VARIABLE: name}, stdout=subprocess.PIPE, check=True)
    maps = json.loads(done.stdout)
    return {case: (seconds, _unpacked(bits)) for case, (seconds, bits) in maps.items()}


def _unpacked(bits: str) -> np.ndarray:
    return np.unpackbits(np.frombuffer(base64.b64decode(bits), np.uint8))


def run_answers(stages: int, folder: Path) -> None:
    """Compute the answers of each processor in a process of its own, and print what differs."""
    for level in ANSWERING:
        kept = folder / LEVELS[level]
        kept.mkdir(parents=True, exist_ok=True)
        command = [
            sys.executable,
            "-m",
            "benchmarks.processors",
            "--answers",
            str(stages),
            "--kept",
            str(kept),
            "--here",
        ]
        subprocess.run([*([".ci/at_processor", level] if level else []), *command], check=True)
    print_table(("question", "processor", "answers", "same words", f"numbers within {NEAR:g}", "worst"), _rows(folder))


def _rows(kept: Path) -> list[list[str]]:
    """Return a row for each question and level; print answers that differ on the way."""
    rows = []
    for question in QUESTIONS:
        own = {file.name: file.read_text("utf-8") for file in sorted((kept / LEVELS[""]).glob(f"{question}-*.txt"))}
        for level in (LEVELS[name] for name in ANSWERING[1:]):
            pairs = {file: compared(text, (kept / level / file).read_text("utf-8")) for file, text in own.items()}
            for file, (same, off) in pairs.items():
                if off > NEAR:
                    print(f"{file} at {level}: {f'numbers differ by {off:.2g}' if same else 'other words'}")
            same_words, near = (sum(same for same, _ in pairs.values()), sum(off <= NEAR for _, off in pairs.values()))
            worst = max((off for _, off in pairs.values()), default=0.0)
            rows.append([question, level, str(len(own)), str(same_words), str(near), f"{worst:.2g}"])
    return rows


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rtol", type=float, default=1e-6)
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--answers", type=int, metavar="STAGES", help="compare answers on so many stages instead")
    parser.add_argument("--kept", type=Path, help="folder of answers")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        print(json.dumps(measure(float(options.child[0]), int(options.child[1]))))
        return
    if options.answers and options.here:
        return answer(options.kept, options.answers)
    if options.answers:
        with TemporaryDirectory() as work:
            run_answers(options.answers, options.kept or Path(work))
        return
    measured = {name: measured_on(name, options.rtol, options.repetitions) for name in LEVELS}
    own = measured[""]
    rows = []
    for name, known_for in LEVELS.items():
        for case, (seconds, swings) in measured[name].items():
            ratio, agreement = seconds / own[case][0], np.mean(swings == own[case][1])
            called = f"{known_for} ({name or processor().name})"
            rows.append([called, case, f"{seconds:.2f}", f"{ratio:.2f}", f"{100 * agreement:.2f} %"])
    print(f"\n41 x 41 runs of 20 s, one core, rtol {options.rtol:g}")
    print_table(("processor", "map", "CPU time [s]", "ratio", "same outcome"), rows)


if __name__ == "__main__":
    main()
