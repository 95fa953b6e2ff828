"""Compare answers by the level of the processor: `python -m benchmarks.levels`.

Stages drawn from the series of `benchmarks.truth` are checked, followed (`boundary`), mapped, tuned, and identified
from logs of their own, with code for AVX-512 (or this machine's best), AVX2 and SSE2. Words and numbers of the answers
are compared. `--stages 40` sets the number; slow questions get fewer stages. `--kept FOLDER` keeps the answers of each
level, one file for a question and stage, so that a run continues where one was stopped.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import friso
from benchmarks.report import print_table
from benchmarks.truth.draws import SERIES, draw

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from snapshots import NUMBER, words

LEVELS = {"": "own", "x86-64-v3": "AVX2", "x86-64": "SSE2"}
"""Levels by LLVM's name ("": this machine's own), and their usual names."""

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


def main() -> None:
    """Compute the answers of each level, and print what differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", type=int, default=40)
    parser.add_argument("--kept", type=Path)
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        return answer(options.kept, options.stages)
    with TemporaryDirectory() as work:
        kept = options.kept or Path(work)
        for level, name in LEVELS.items():
            (kept / name).mkdir(parents=True, exist_ok=True)
            command = [sys.executable, "-m", "benchmarks.levels", "--child", "--stages", str(options.stages)]
            at_level = [".ci/at_processor", level] if level else []
            subprocess.run([*at_level, *command, "--kept", str(kept / name)], check=True)
        print_table(("question", "level", "answers", "same words", f"numbers within {NEAR:g}", "worst"), _rows(kept))


def _rows(kept: Path) -> list[list[str]]:
    """Return a row for each question and level; print answers that differ on the way."""
    rows = []
    for question in QUESTIONS:
        own = {file.name: file.read_text("utf-8") for file in sorted((kept / "own").glob(f"{question}-*.txt"))}
        for level in [*LEVELS.values()][1:]:
            pairs = {file: compared(text, (kept / level / file).read_text("utf-8")) for file, text in own.items()}
            for file, (same, off) in pairs.items():
                if off > NEAR:
                    print(f"{file} at {level}: {f'numbers differ by {off:.2g}' if same else 'other words'}")
            same_words, near = (sum(same for same, _ in pairs.values()), sum(off <= NEAR for _, off in pairs.values()))
            worst = max((off for _, off in pairs.values()), default=0.0)
            rows.append([question, level, str(len(own)), str(same_words), str(near), f"{worst:.2g}"])
    return rows


if __name__ == "__main__":
    main()
