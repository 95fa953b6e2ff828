"""Cases of a campaign: each follows from the seed, the campaign and its number, so that it can be run again alone."""

from __future__ import annotations

import random
import signal
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks.trust.damage import damaged
from benchmarks.trust.readers import READERS
from friso.errors import InputError

PATIENCE = 30
"""How long [s] a refusal may take on a busy machine before it counts as endless."""

Case = Callable[[random.Random, Path], None]
"""One case, which raises what it finds wrong: with its random numbers, in a folder of its own."""


def failure(campaign: str, case: Case, seed: int, number: int) -> str | None:
    """What went wrong in a case, None for nothing."""
    rng = random.Random(f"{seed} {campaign} {number}")
    with tempfile.TemporaryDirectory(prefix="friso-trust-") as folder:
        try:
            case(rng, Path(folder))
        except Exception as error:
            return f"{type(error).__name__}: {str(error)[:300]}"
    return None


def failures(
    campaign: str, case: Case, seed: int, numbers: range, seconds: float = float("inf")
) -> Iterator[tuple[int, str]]:
    """The numbers of the cases that fail, and why, until the time [s] is over."""
    end = time.monotonic() + seconds
    for number in numbers:
        if time.monotonic() > end:
            return
        if (why := failure(campaign, case, seed, number)) is not None:
            yield number, why


def reading(name: str) -> Case:
    """Damaged files of a kind are read, or refused."""
    reader = READERS[name]
    contents = reader.contents()

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
    """Raises TimeoutError where what is within takes too long."""

    def over(number: int, frame: object) -> None:
        raise TimeoutError(f"more than {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, over)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
