"""Compare the check with the search alone, without return maps.

Run by `python -m benchmarks.return_map`. Stages are drawn from three series, or come from the tests' book of machines
(`--series hard`), or are the thesis rig (`--series rig`). Both methods answer each case. Answers are kept in a file, a
line each, and a run continues where one was stopped. `--table` writes the page [The check against the search
alone](return-map.md).
"""

import argparse
import json
import os
import sys
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is loaded

import numpy as np

import friso
from benchmarks.return_map.answers import checked
from benchmarks.return_map.brute_force import decided
from benchmarks.return_map.compared import page
from benchmarks.truth.classes import classes_of
from benchmarks.truth.draws import SERIES, draw
from friso.engine.kernel import kernels
from friso.hunting import ReturnMapSettings, needed_kernels
from friso.stage import Stage

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from book import BOOK, knowing


def main() -> None:
    arguments = _arguments()
    records = _read(arguments.kept)
    answered = {_key(record): record for record in records}
    for number in range(arguments.first, arguments.first + arguments.stages)[:: arguments.every]:
        for record in _cases(arguments.series, arguments.seed, number):
            before = answered.get(_key(record[0]))
            if before is None or arguments.redo:
                _keep(arguments.kept, _answered(*record, before))
    if arguments.decide:
        for record in {_key(record): record for record in _read(arguments.kept)}.values():
            stage = _stage(*_key(record)[:3])
            if stage and (words := decided(record, stage.variants()[record["case"]])):
                _keep(arguments.kept, record | {"decided": words})
    if arguments.table:
        arguments.table.write_text(page([*{_key(record): record for record in _read(arguments.kept)}.values()]))


def _cases(series: str, seed: int, number: int) -> Iterator[tuple[dict[str, Any], Stage]]:
    """Yield the distinct cases of a stage."""
    stage, seen = _stage(series, seed, number), []
    if stage is None:
        return
    for name, variant in stage.variants().items():
        if variant not in seen:
            seen.append(variant)
            yield {"series": series, "seed": seed, "number": number, "case": name}, variant


def _stage(series: str, seed: int, number: int) -> Stage | None:
    if series in SERIES:
        return draw(seed, number, series)
    if series == "rig":
        return friso.load(friso.example("thesis_rig")) if number == 0 else None
    names = knowing("attracts")
    return BOOK[names[number]] if number < len(names) else None


def _answered(record: dict[str, Any], stage: Stage, before: dict[str, Any] | None) -> dict[str, Any]:
    """Return both answers on a case; an answer of the search from `before` is reused."""
    kernels(needed_kernels(stage))
    with np.errstate(all="ignore"):
        by_map = checked(stage)
        with ReturnMapSettings(maps_decide=False).in_use():
            by_search = before["searched"] if before else checked(stage)
    print(f"{_key(record)}: {by_search['work'] / 1e6:.0f}e6 and {by_map['work'] / 1e6:.0f}e6", file=sys.stderr)
    day = date.today().isoformat()
    return record | {"classes": classes_of(stage.flat()), "searched": by_search, "mapped": by_map, "day": day}


def _key(record: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(record[name] for name in ("series", "seed", "number", "case"))


def _read(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def _keep(file: Path, record: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a") as stream:
        stream.write(json.dumps(record) + "\n")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.return_map", description=__doc__)
    parser.add_argument("--series", choices=[*SERIES, "hard", "rig"], default="stages")
    parser.add_argument("--seed", type=int, default=7001)
    parser.add_argument("--stages", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first stage")
    parser.add_argument("--every", type=int, default=1, help="one stage in so many")
    parser.add_argument("--decide", action="store_true", help="follow starts from everywhere where answers differ")
    parser.add_argument("--redo", action="store_true", help="answer by the map again what was answered before")
    parser.add_argument("--kept", type=Path, default=Path("benchmark_results/return_map.jsonl"), help="file of answers")
    parser.add_argument("--table", type=Path, help="write the comparison to this file, in Markdown")
    return parser.parse_args()


if __name__ == "__main__":
    main()
