"""Damaged files, kills, interrupts, full disks: `python -m benchmarks.trust [CAMPAIGN ...]`.

Every failure is printed with what runs it again alone: the campaign, its seed, and the number of the case. Bounded in
count (`--cases` of each campaign of files, a thousandth of it of those of commands) and time (`--minutes` in all).
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from pathlib import Path

from benchmarks.report import print_table
from benchmarks.trust.campaign import Case, failures, reading
from benchmarks.trust.commands import COMMANDS
from benchmarks.trust.readers import READERS

SLOW = {"binary-logs": 50, **dict.fromkeys(COMMANDS, 1000)}
"""By how much fewer the cases of a campaign are that starts processes."""


def main() -> int:
    """Run the campaigns; 1 where a case failed."""
    arguments = _arguments()
    names = arguments.campaigns or [*READERS, *COMMANDS]
    end = time.monotonic() + 60 * arguments.minutes
    rows, failed = [], 0
    for k, name in enumerate(names):
        case: Case = COMMANDS[name] if name in COMMANDS else reading(name)
        numbers = range(max(1, arguments.cases // SLOW.get(name, 1)))
        if arguments.number is not None:
            numbers = range(arguments.number, arguments.number + 1)
        start, wrong = time.monotonic(), 0
        share = (end - start) / (len(names) - k)
        counted = _Counted(case)
        for number, why in failures(name, counted, arguments.seed, numbers, share):
            wrong += 1
            print(f"FAILED {name} {number}: {why}")
            print(f"  again: python -m benchmarks.trust {name} --seed {arguments.seed} --number {number}", flush=True)
        failed += wrong
        rows.append((name, str(counted.count), str(wrong), f"{time.monotonic() - start:.0f}"))
    print_table(("campaign", "cases", "failed", "time [s]"), rows)
    return 1 if failed else 0


class _Counted:
    """A case that counts how often it was run."""

    def __init__(self, case: Case) -> None:
        self.case, self.count = case, 0

    def __call__(self, rng: random.Random, folder: Path) -> None:
        self.count += 1
        self.case(rng, folder)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trust", description=__doc__)
    parser.add_argument("campaigns", nargs="*", metavar="CAMPAIGN", help=f"of {', '.join([*READERS, *COMMANDS])}")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=16_000, help="of each campaign of files")
    parser.add_argument("--minutes", type=float, default=10.0, help="in all")
    parser.add_argument("--number", type=int, help="this case alone")
    arguments = parser.parse_args()
    if strange := {*arguments.campaigns} - {*READERS, *COMMANDS}:
        parser.error(f"no such campaign: {', '.join(strange)}")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
