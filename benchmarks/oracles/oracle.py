"""What an oracle is: a fact with its source, and answers of friso beside those of somebody else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass


class NotInstalled(Exception):
    """An oracle needs a package that friso does not."""


@dataclass(frozen=True)
class Finding:
    """One thing that friso and an oracle both answer: what was asked, both answers in words, and whether they agree.

    None stands for neither: friso leaves it open, or the oracle does.
    """

    what: str
    friso: str
    oracle: str
    agrees: bool | None


@dataclass(frozen=True)
class Oracle:
    """A fact that nobody here made: its name, the fact in a sentence, its source, in which sense friso has to agree and
    why (stated before both were compared), and the function that asks friso and the oracle."""

    name: str
    fact: str
    source: str
    sense: str
    ask: Callable[[], Iterator[Finding]]


def number(
    what: str, friso: float, oracle: float, rtol: float = 0.0, atol: float = 0.0, unit: str = "", digits: int = 6
) -> Finding:
    """Two numbers that agree within a share of the oracle's, or within a distance from it."""
    agrees = bool(abs(friso - oracle) <= max(rtol * abs(oracle), atol))
    one, other = (f"{value:.{digits}g} {unit}".strip() for value in (friso, oracle))
    return Finding(what, one, other, agrees)
