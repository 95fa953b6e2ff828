"""Run the cases of a campaign.

Each case follows from the seed, the campaign and its number, so that it can be repeated alone.
"""

import io
import logging
import random
import signal
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.trust.arguments import ARGUMENTS
from benchmarks.trust.commands import COMMANDS, LeftOut
from benchmarks.trust.damage import damaged
from benchmarks.trust.questions import questions
from benchmarks.trust.readers import BINARY, READERS
from benchmarks.trust.stages import computed_stages, stages
from benchmarks.trust.writing import WRITING
from friso.errors import InputError

PATIENCE = 30
"""Time [s] that a refusal may take on a busy machine before it counts as endless."""

Case = Callable[[random.Random, Path], None]
"""A case: a function of its random numbers and its folder, which raises what it finds wrong."""


CASES: dict[str, Case] = {
    **ARGUMENTS,
    "drawn-stages": stages,
    "computed-stages": computed_stages,
    "app": questions,
    **WRITING,
    **COMMANDS,
}
"""Campaigns besides those of `READERS`."""

NAMES = (*READERS, *CASES)
"""All campaigns."""

BINARY_LOGS = [f"{kind}-logs" for kind in BINARY]
"""Campaigns of binary logs."""

HEAVY = {**dict.fromkeys(BINARY_LOGS, 8), "arguments": 8, "drawn-stages": 8, "computed-stages": 64, "options": 32,
         "app": 8, "stores": 16, "store-faults": 32, "store-exchanges": 32, "store-versions": 8,
         **dict.fromkeys(COMMANDS, 500)}  # fmt: skip
"""Factor by which campaigns with slow cases have fewer cases."""


@dataclass(frozen=True)
class Part:
    """Results of cases: number run, failed ones with reasons, and why others were not run."""

    count: int
    failures: list[tuple[int, str]]
    left_out: list[str] = field(default_factory=list)


def run_part(name: str, seed: int, numbers: range, end: float = float("inf")) -> Part:
    """Run cases of a campaign, until a time of the monotonic clock [s]."""
    case, count, wrong, left = case_of(name), 0, [], []
    for number in numbers:
        if (count or left) and time.monotonic() > end:
            break
        try:
            why = failure(name, case, seed, number)
        except LeftOut as reason:
            left.append(str(reason))
            continue
        count += 1
        if why is not None:
            wrong.append((number, why))
    return Part(count, wrong, left)


@cache
def case_of(name: str) -> Case:
    """Return the case of a campaign."""
    return CASES.get(name) or reading(name)


def failure(campaign: str, case: Case, seed: int, number: int) -> str | None:
    """Return what went wrong in a case, or None.

    Raises LeftOut if it cannot be run here.
    """
    rng = random.Random(f"{seed} {campaign} {number}")
    with tempfile.TemporaryDirectory(prefix="friso-trust-") as folder:
        try:
            with redirect_stderr(io.StringIO()), _silent_log():
                case(rng, Path(folder))
        except LeftOut:
            raise
        except Exception as error:
            return f"{type(error).__name__}: {str(error)[:300]}"
    return None


@contextmanager
def _silent_log() -> Iterator[None]:
    """Suppress friso's messages about damage."""
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)


def reading(name: str) -> Case:
    """Return a case that reads a damaged file of a kind.

    The file must be read, or refused; the intact one must be read.
    """
    reader = READERS[name]
    contents = reader.contents()
    for content in contents:
        with tempfile.TemporaryDirectory(prefix="friso-trust-") as folder, _silent_log(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            path = Path(folder) / reader.file
            path.write_bytes(content)
            reader.read(path)

    def case(rng: random.Random, folder: Path) -> None:
        path = folder / reader.file
        path.write_bytes(damaged(rng.choice(contents), rng))
        with _patience(), warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                reader.read(path)
            except InputError as error:
                if not str(error).strip():
                    raise AssertionError("a refusal without words") from None

    return case


@contextmanager
def _patience() -> Iterator[None]:
    """Raise TimeoutError if the block takes too long."""

    def over(number: int, frame: object) -> None:
        raise TimeoutError(f"more than {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, over)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
