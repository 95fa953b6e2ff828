"""Turn the words of the thesis into numbers.

They are “about”, “far”, “few”, “the same”, “trend”, “large”, and other words.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import cast

from friso.quantities import percent
from friso_thesis.studies.rig.measured_cycles import AS_SLOW, SIMILAR_SWING


@dataclass(frozen=True)
class WordReading:
    """Numbers behind the thesis's words.

    - The factor within which a number is `about` another. The factor within which it is `of the order` of another, and
      beyond which it is far below it.
    - The fraction of a map's cells up to which they are `few`.
    - The rank correlation (Spearman) from which there is a `trend`.
    - The share within which numbers are the `same`, and within which they are `close`, as far as one reads them off a
      figure.
    - The damping [N s/m] from which that of the limiter is `large`: the upper two of the six decades studied.
    - The fraction that is at least `half` or “most” of them, and the fraction of the range of strokes from which they
      are `long`.
    - For cycles on the rig: the factor from which one is nearly `twice` as long as another, that within which swings
      are `similar`, and that from which their two sides are `unequal`.
    - The scatter of the period over its mean from which a cycle is less regular, `uneven`.
    """

    about: float = 1.5
    order: float = 10**0.5
    few: float = 0.05
    trend: float = 0.5
    same: float = 0.15
    close: float = 0.1
    large: float = 1e2
    half: float = 0.5
    long: float = 0.5
    twice: float = AS_SLOW
    similar: float = SIMILAR_SWING
    unequal: float = 1.1
    uneven: float = 0.05


OWN = WordReading()
"""The reading of words that friso uses by default."""

_READ: ContextVar[WordReading] = ContextVar("reading", default=OWN)


def reading() -> WordReading:
    """Return the reading by which claims are judged now."""
    return _READ.get()


class _WordsNow:
    """The words by which claims are judged now, read one by one."""

    def __getattr__(self, word: str) -> float:
        return getattr(reading(), word)


words = cast("WordReading", _WordsNow())
"""The reading by which claims are judged when a word of it is read."""


@contextmanager
def read_as(other: WordReading) -> Iterator[None]:
    """Judge claims by the reading `other` of the thesis's words within the block."""
    before = _READ.set(other)
    try:
        yield
    finally:
        _READ.reset(before)


@contextmanager
def words_read() -> Iterator[set[str]]:
    """Record the words that are read within the block.

    Judgements there do not depend on the reading of any other word.
    """
    noted = _NotedReading(reading())
    with read_as(cast("WordReading", noted)):
        yield noted.words


class _NotedReading:
    """A reading that records which of its words are used."""

    def __init__(self, own: WordReading) -> None:
        self._own, self.words = own, set[str]()

    def __getattr__(self, word: str) -> float:
        self.words.add(word)
        return getattr(self._own, word)


_OTHER_VALUES: Mapping[str, tuple[str, tuple[float, float]]] = {
    "about": ("“about” as within a factor of {value:g}", (1.25, 2.0)),
    "order": ("“of the order of” as within a factor of {value:g}", (2.0, 10.0)),
    "similar": ("“similar” as within a factor of {value:g}", (1.25, 2.0)),
    "few": ("“few” as at most {share}", (0.02, 0.1)),
    "same": ("“the same” as within {share}", (0.1, 0.25)),
    "close": ("“close” as within {share}", (0.05, 0.2)),
    "twice": ("“nearly twice” as at least {value:g} times", (1.5, 1.9)),
    "unequal": ("“unequal” as at least {value:g} times", (1.05, 1.25)),
    "half": ("“half” as {share}", (0.3, 0.7)),
    "long": ("“long” as the upper {rest}", (0.25, 0.75)),
    "uneven": ("“less regular” from a scatter of {share} on", (0.02, 0.1)),
    "trend": ("“trend” as a rank correlation of {value:g}", (0.3, 0.7)),
    "large": ("“large” as {value:g} N s/m and more", (10.0, 1e3)),
}
"""Words of WordReading to how another reading of them is called, and its two values.

In the text `share` is the value in percent, and `rest` what it leaves of the whole.
"""

OTHERWISE: Mapping[str, WordReading] = MappingProxyType(
    {
        text.format(value=value, share=percent(value), rest=percent(1 - value)): replace(OWN, **{word: value})
        for word, (text, values) in _OTHER_VALUES.items()
        for value in values
    }
)
"""Other reasonable readings, by the change. Each differs in one word, upward or downward."""


def others_of(words: Set[str]) -> dict[str, WordReading]:
    """Return the other readings, by description, that give one of these words another number."""
    return {
        name: other
        for name, other in OTHERWISE.items()
        if any(getattr(other, item.name) != getattr(OWN, item.name) for item in fields(OWN) if item.name in words)
    }


def about(value: float, expected: float, factor: float | None = None) -> bool:
    """Tell whether a positive number is within a factor of what is expected; NaN is not.

    By default it is the factor of “about”.
    """
    within = words.about if factor is None else factor
    return expected / within <= value <= expected * within


CONVENTIONS = (
    f"Words have the same meaning in all claims: “about” is within a factor of {OWN.about:g}, “of the order of” within "
    f"a factor of {OWN.order:.2g} (half a decade) and “far” beyond it, “few” cells are at most {percent(OWN.few)} of a "
    f"map, “the same” is within {percent(OWN.same)}, “close” within {percent(OWN.close)}, a “trend” is a rank "
    f"correlation of at least {OWN.trend:g}, a “large” limiter damping is {OWN.large:g} N s/m and more (the upper two "
    f"of the six decades studied), “most” and “half” are {percent(OWN.half)}, “long” strokes the upper "
    f"{percent(1 - OWN.long)} of the range, “similar” swings are within a factor of {OWN.similar:g}, “nearly twice” is "
    f"at least {OWN.twice:g} times, sides are “unequal” from a factor of {OWN.unequal:g} on, and a period is “less "
    f"regular” from a scatter of {percent(OWN.uneven)} on. Every claim is judged by other readings too: "
    f"{', '.join(OTHERWISE)}; where one of them turns a criterion, its dependence says so. Whether a cell of a map "
    "“keeps moving” or “comes to rest” is judged by the thesis's count, where at least one peak is counted (Sec. "
    "3.2.2). What attracts the stages, whatever the move, is told beside it and does not decide. A “limit” lies "
    "between the last cell that keeps moving and the next, where the swing, interpolated in its logarithm, falls below "
    "what counts, or halfway where nothing is left of it; none beyond it keeps moving. A criterion whose number lies "
    "beside its threshold within its error is undecided, and so is one that no simulation can decide; neither counts."
)
"""Note on the reading of words that all criteria share."""
