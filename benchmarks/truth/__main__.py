"""Draw stages, check them, and try to refute every verdict and edge.

Run by `python -m benchmarks.truth`. It prints by class of machine how many verdicts and edges are certain and how many
of these are wrong (their stage files, each with a note, are written to a folder), the CPU time of a check, and why
others are not certain. Attacks are kept in a file, and a run continues where one was stopped; when interrupted, it
prints what there is. `--number` takes single stages of a seed; `--checks` only checks them, and keeps nothing.
"""

import argparse
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import closing
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is loaded

from benchmarks.truth.attack import attack
from benchmarks.truth.draws import SERIES, UNDER_LAWS, draw, numbers_of
from benchmarks.truth.kept import KeptAttacks, Record, dated, is_current
from benchmarks.truth.tally import document, page, print_tally
from friso.engine.kernel import kernels
from friso.hunting import needed_kernels
from friso.platform.system import usable_cores


def main() -> None:
    arguments = _arguments()
    numbers = arguments.number or numbers_of(arguments.series, arguments.first, arguments.stages)
    kept = KeptAttacks(arguments.kept or arguments.out / "attacks.jsonl")
    for line in kept.damaged:
        _tell(f"{kept.file}, line {line}, is damaged: if no other line tells of its stage, that is attacked again")
    if arguments.report:
        records = [*kept.records.values()]
    elif arguments.checks:
        records = []
        _attack_all(arguments, numbers, lambda record: records.append(dated(record)))
    else:
        there = {r["number"] for r in kept.of(arguments.series, arguments.seed, numbers) if _stays(r, arguments.redo)}
        _attack_all(arguments, [number for number in numbers if number not in there], kept.add)
        records = kept.of(arguments.series, arguments.seed, numbers)
    if not records:
        return
    tally = document(records)
    print(json.dumps(tally, indent=1)) if arguments.json else print_tally(records, tally)
    if arguments.table:
        arguments.table.parent.mkdir(parents=True, exist_ok=True)
        arguments.table.write_text(page(records, tally))


def _stays(record: Record, redo: bool) -> bool:
    """Tell whether a stage is not attacked again."""
    return is_current(record) or not redo


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _attack_all(arguments: argparse.Namespace, numbers: Sequence[int], keep: Callable[[Record], object]) -> None:
    """Attack stages until Ctrl-C; each attack is stored and printed as it ends."""
    start, busy = time.perf_counter(), 0.0
    try:
        with closing(_attacked(arguments, numbers)) as records:
            for record in records:
                keep(record)
                busy += record.get("cpu", 0.0) + record.get("attack_cpu", 0.0)
                _tell(_line(record))
    except KeyboardInterrupt:
        _tell("interrupted")
    _tell(f"  {time.perf_counter() - start:.0f} s, in which checks and attacks took {busy:.0f} s of CPU")


def _attacked(arguments: argparse.Namespace, numbers: Sequence[int]) -> Generator[Record]:
    """Yield attacks on stages as they end, several at a time.

    Kernels are compiled ahead and side by side.
    """
    series, seed = arguments.series, arguments.seed
    kernels(set().union(*(needed_kernels(draw(seed, number, series)) for number in numbers)))
    arguments.out.mkdir(parents=True, exist_ok=True)
    tasks = [(seed, n, arguments.scipy_share, arguments.out, arguments.checks, series) for n in numbers]
    if arguments.workers == 1:
        yield from (attack(*task) for task in tasks)
        return
    pool = ProcessPoolExecutor(arguments.workers, initializer=_end_with_parent)
    try:
        for job in as_completed([pool.submit(attack, *task) for task in tasks]):
            yield job.result()
    finally:
        for worker in multiprocessing.active_children():
            worker.terminate()
        pool.shutdown(cancel_futures=True)


def _end_with_parent() -> None:
    """Make a worker leave Ctrl-C to its parent process, and end with the parent, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent

    def end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def _line(record: Record) -> str:
    said = record["error"] or "; ".join(claim["says"] for claim in record["claims"])
    seconds = [record.get(name, 0.0) for name in ("cpu", "attack_cpu")]
    lines = [f"  {record['number']:5d}  {seconds[0]:6.2f} s + {seconds[1]:6.2f} s  {said}"]
    for witness in record["refuted"]:
        word = "WRONG" if witness["sure"] else "wrong, but not certain"
        lines.append(f"      {word}: {witness['case']}, {witness['of']}: {witness['why']}")
    return "\n".join(lines)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.truth", description=__doc__)
    parser.add_argument("--stages", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first stage")
    parser.add_argument("--number", type=int, action="append", help="a single stage; may be repeated")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scipy-share", type=float, default=0.1, help="share of stages that SciPy looks at too")
    parser.add_argument(
        "--series",
        choices=SERIES,
        default="stages",
        help="machines: cascades, transmissions, deadbands; axes: of machine tools, with settings against friction; "
        "drives: axes with friction at the motor; servos: with friction of joints, settings at standstill",
    )
    parser.add_argument(
        "--law",
        dest="series",
        choices=UNDER_LAWS,
        help="series: stages under this law of friction, whose cycles SciPy follows from event to event, too",
    )
    parser.add_argument("--checks", action="store_true", help="check the stages alone, and refute nothing")
    parser.add_argument("--kept", type=Path, help="file of attacks, gone on with; default: attacks.jsonl in --out")
    parser.add_argument("--redo", action="store_true", help="attack stages again that other code was attacked with")
    parser.add_argument("--report", action="store_true", help="attack nothing; report all that the file holds")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")
    parser.add_argument("--table", type=Path, help="write the report to this file, in Markdown")
    parser.add_argument("--workers", type=int, default=usable_cores(), help="processes; default: as many as cores")
    parser.add_argument("--out", type=Path, default=Path("benchmark_results/truth"), help="folder for refuted stages")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
