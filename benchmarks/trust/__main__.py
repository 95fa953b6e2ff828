"""Test damaged files, kills, interrupts, full disks.

Run by `python -m benchmarks.trust [CAMPAIGN ...]`. Every failure is printed with what repeats it alone: the campaign,
its seed, and the number of the case. The work is bounded in count (`--cases` for each campaign of light cases, a
fraction of it for heavier ones) and in time (`--minutes` in all).
"""

import argparse
import sys
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from benchmarks.report import print_table
from benchmarks.trust.campaign import BINARY_LOGS, COMMANDS, HEAVY, NAMES, Part, run_part

SHARE = 6
"""Time of a campaign of light cases over that of a campaign of heavy ones. The next campaign gets the time left
over."""

PART = {name: 1 if name in COMMANDS else 10 for name in HEAVY}
"""Number of cases run in one go, for heavy campaigns; light ones run 100."""


GROUPS = {
    "light": [name for name in NAMES if name not in COMMANDS],
    "heavy": [*COMMANDS],
    "binary-logs": BINARY_LOGS,
}
"""Groups of campaigns with a common name: within this process, commands as processes, binary logs."""


def main() -> int:
    """Run the campaigns; return 1 if a case failed."""
    arguments = _arguments()
    names = [name for group in arguments.campaigns or [*GROUPS] for name in GROUPS.get(group, [group])]
    end = time.monotonic() + 60 * arguments.minutes
    rows, failed = [], 0
    shares = [1 if name in HEAVY else SHARE for name in names]
    for k, name in enumerate(names):
        start, wrong, count, left = time.monotonic(), 0, 0, []
        cases = max(2, arguments.cases // HEAVY.get(name, 1))
        numbers = range(cases) if arguments.number is None else range(arguments.number, arguments.number + 1)
        until = start + (end - start) * shares[k] / sum(shares[k:])
        for part in _parts(name, arguments.seed, numbers, arguments.jobs, until):
            count += part.count
            wrong += len(part.failures)
            left += part.left_out
            for number, why in part.failures:
                print(f"FAILED {name} {number}: {why}")
                print(
                    f"  again: python -m benchmarks.trust {name} --seed {arguments.seed} --number {number}", flush=True
                )
        failed += wrong
        seconds = time.monotonic() - start
        rows.append((name, str(count), str(wrong), f"{seconds:.0f}", f"{count / seconds:.3g}"))
        reasons = f", {len(left)} left out ({', '.join({*left})})" if left else ""
        print(f"{name}: {count} cases, {wrong} failed{reasons}, {seconds:.0f} s", flush=True)
    print_table(("campaign", "cases", "failed", "time [s]", "cases per s"), rows)
    print(f"seed {arguments.seed}, {sum(int(row[1]) for row in rows)} cases, {failed} failed")
    return 1 if failed else 0


def _parts(name: str, seed: int, numbers: range, jobs: int, end: float) -> Iterator[Part]:
    """Yield the cases in parts, side by side in processes, until the time is over."""
    size = PART.get(name, 100)
    upcoming = iter([numbers[k : k + size] for k in range(0, len(numbers), size)])
    with ProcessPoolExecutor(jobs) as pool:
        flying = {}
        while True:
            while len(flying) < jobs and time.monotonic() < end and (part := next(upcoming, None)):
                flying[pool.submit(run_part, name, seed, part, end)] = part
            if not flying:
                return
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                part = flying.pop(future)
                try:
                    yield future.result()
                except BrokenProcessPool:
                    yield Part(len(part), [(part[0], f"a case from here to {part[-1]} ended the process")])
                    return


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trust", description=__doc__)
    parser.add_argument(
        "campaigns", nargs="*", metavar="CAMPAIGN", help=f"{', '.join(GROUPS)}, or of {', '.join(NAMES)}"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=16_000, help="of each campaign of light cases")
    parser.add_argument("--minutes", type=float, default=10.0, help="in all")
    parser.add_argument("--jobs", type=int, default=2, help="processes side by side")
    parser.add_argument("--number", type=int, help="this case alone")
    arguments = parser.parse_args()
    if strange := {*arguments.campaigns} - {*NAMES, *GROUPS}:
        parser.error(f"no such campaign: {', '.join(strange)}")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
