"""Define an oracle: a fact with its source, and friso's answers beside those of others."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any


class NotInstalled(Exception):
    """Error: an oracle needs a package that friso does not."""


@dataclass(frozen=True)
class Finding:
    """An answer of friso beside an oracle's: question, both in words, whether they agree.

    None stands for neither: friso or the oracle leaves it open.
    """

    what: str
    friso: str
    oracle: str
    agrees: bool | None


@dataclass(frozen=True)
class Oracle:
    """A fact that others have established.

    It has a name, the fact in a sentence, its source, the sense in which friso has to agree and why (stated before the
    comparison), and the function that asks friso and the oracle.
    """

    name: str
    fact: str
    source: str
    sense: str
    ask: Callable[[], Iterator[Finding]]


def number(
    what: str, friso: float, oracle: float, rtol: float = 0.0, atol: float = 0.0, unit: str = "", digits: int = 6
) -> Finding:
    """Compare two numbers, which may differ by a fraction of the oracle's, or by a distance."""
    agrees = bool(abs(friso - oracle) <= max(rtol * abs(oracle), atol))
    one, other = (f"{value:.{digits}g} {unit}".strip() for value in (friso, oracle))
    return Finding(what, one, other, agrees)


def lugre(
    static: float, coulomb: float, stribeck: float, stiffness: float, damping: float, viscous: float, **others: Any
) -> dict[str, Any]:
    """Return a table of LuGre friction, or of a law with its keys, from SI values of a linear axis."""
    return {
        "model": "lugre",
        "static": f"{static!r} N",
        "coulomb": f"{coulomb!r} N",
        "stribeck_velocity": f"{stribeck!r} m/s",
        "stribeck_exponent": 2,
        "bristle_stiffness": f"{stiffness!r} N/m",
        "bristle_damping": f"{damping!r} N*s/m",
        "viscous": f"{viscous!r} N*s/m",
        **others,
    }
