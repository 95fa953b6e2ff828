"""Test that no pattern of friso takes much longer for a longer text: others wrote the files that it reads.

A matcher that tries as Python's does counts its steps, so that nothing depends on how quick a machine is.
"""

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from re import _constants as sre  # type: ignore[attr-defined]
from re import _parser as parser  # type: ignore[attr-defined]
from typing import Any

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
METHODS = "fullmatch|match|search|findall|finditer|sub|subn|split|extract|contains"
REPEATS = (sre.MAX_REPEAT, sre.MIN_REPEAT, sre.POSSESSIVE_REPEAT)
LONG, TAILS = 40, ("", "!", "( !", "y")
MUCH, FEW = 2.9, 200
"""Steps for a text twice as long: 2 times as many where each character counts once, 4 times where pairs do."""

LIMITED = {
    r"(?<![^\[\]()])[^\[\]()]+[\[(][^\])]*[\])]": "its text ends with a bracket that closes",
    r"ch([0-7])[ \t]*->[ \t]*([\w.\[\]]{1,40})[ \t]*=(?!=)[ \t]*+([^;\n]{0,100});": "100 characters are the most",
}
"""Patterns that take long for some short texts, with what limits that."""


class Steps:
    """Match as Python's `re` does, and count how often an element of the pattern is tried."""

    def __init__(self, text: str, ignoring_case: bool) -> None:
        self.text, self.ignoring_case, self.count = text, ignoring_case, 0
        self.groups: dict[int, str] = {}

    def ends(self, items: Any, k: int, at: int) -> Iterator[int]:
        """Yield where items from k on can end that begin at a place, in the order of trying."""
        if k == len(items):
            yield at
            return
        for end in self.of_one(items[k], at):
            yield from self.ends(items, k + 1, end)

    def of_one(self, item: tuple[Any, Any], at: int) -> Iterator[int]:
        kind, value = item
        self.count += 1
        if is_character(kind):
            if at < len(self.text) and self.fits(kind, value, self.text[at]):
                yield at + 1
        elif kind in REPEATS:
            yield from self.of_repeat(kind, value, at)
        elif kind is sre.BRANCH:
            for branch in value[1]:
                yield from self.ends(branch, 0, at)
        elif kind is sre.SUBPATTERN:
            for end in self.ends(value[3], 0, at):
                self.groups[value[0]] = self.text[at:end]
                yield end
        elif kind is sre.ATOMIC_GROUP:
            yield from first(self.ends(value, 0, at))
        elif kind in (sre.ASSERT, sre.ASSERT_NOT):
            begin = at if value[0] > 0 else at - value[1].getwidth()[0]
            held = begin >= 0 and bool(first(self.ends(value[1], 0, begin)))
            if held == (kind is sre.ASSERT):
                yield at
        elif kind is sre.GROUPREF:
            if self.text.startswith(self.groups.get(value, "\0"), at):
                yield at + len(self.groups[value])
        elif self.stands(value, at):
            yield at

    def of_repeat(self, kind: Any, repeat: tuple[int, Any, Any], at: int) -> Iterator[int]:
        least, most, body = repeat
        if len(body) == 1 and is_character(body[0][0]):
            ends = [at]
            while len(ends) <= most and (end := first(self.of_one(body[0], ends[-1]))):
                ends += end
            ends = ends[least:]
        elif kind is sre.POSSESSIVE_REPEAT:
            ends, times = [at], 0
            while times < most and (end := first(self.ends(body, 0, ends[-1]))) and end != ends[-1:]:
                ends, times = end, times + 1
            ends = ends if times >= least else []
        else:
            yield from self.again(kind, least, most, body, at)
            return
        for end in ends if kind is sre.MIN_REPEAT else ends[-1:] if kind is sre.POSSESSIVE_REPEAT else ends[::-1]:
            self.count += 1
            yield end

    def again(self, kind: Any, least: int, most: Any, body: Any, at: int) -> Iterator[int]:
        if least <= 0 and kind is sre.MIN_REPEAT:
            yield at
        if most > 0:
            for end in self.ends(body, 0, at):
                if end > at or least > 0:
                    yield from self.again(kind, least - 1, most - 1, body, end)
        if least <= 0 and kind is sre.MAX_REPEAT:
            yield at

    def fits(self, kind: Any, value: Any, character: str) -> bool:
        if self.ignoring_case:
            return fits(kind, value, character.lower()) or fits(kind, value, character.upper())
        return fits(kind, value, character)

    def stands(self, where: Any, at: int) -> bool:
        """Tell whether a place is one of a pattern such as ^ or a border of a word; every line is taken for its own."""
        before, after = self.text[at - 1 : at] if at else "", self.text[at : at + 1]
        if where in (sre.AT_BEGINNING, sre.AT_BEGINNING_STRING):
            return not before
        if where in (sre.AT_END, sre.AT_END_STRING):
            return not after
        border = bool(re.match(r"\w", before)) != bool(re.match(r"\w", after))
        return border == (where is sre.AT_BOUNDARY)


def first(ends: Iterator[int]) -> list[int]:
    return [end for end in (next(ends, None),) if end is not None]


def is_character(kind: Any) -> bool:
    return kind in (sre.LITERAL, sre.NOT_LITERAL, sre.ANY, sre.IN)


def fits(kind: Any, value: Any, character: str) -> bool:
    if kind is sre.ANY:
        return True
    if kind is not sre.IN:
        return (ord(character) == value) == (kind is sre.LITERAL)
    found, negated = False, False
    for part, what in value:
        match part:
            case sre.NEGATE:
                negated = True
            case sre.LITERAL:
                found |= ord(character) == what
            case sre.RANGE:
                found |= what[0] <= ord(character) <= what[1]
            case _:
                word = str(what).rpartition("_")[2]
                holds = {"DIGIT": str.isdigit, "SPACE": str.isspace}.get(word, lambda one: one.isalnum() or one == "_")
                found |= holds(character) != ("_NOT_" in str(what))
    return found != negated


def sample(items: Any, full: bool) -> str:
    """A text that items fit, with their optional parts or without."""
    return "".join(sample_of_one(item, full) for item in items)


def sample_of_one(item: tuple[Any, Any], full: bool) -> str:
    kind, value = item
    if is_character(kind):
        usual = "".join(map(chr, range(32, 127)))
        return next((one for one in f"a 0A\t{usual}\0µ" if fits(kind, value, one)), "?")
    if kind is sre.BRANCH:
        return sample(value[1][0], full)
    if kind is sre.SUBPATTERN:
        return sample(value[3], full)
    if kind in REPEATS:
        return sample(value[2], full) * max(value[0], int(full))
    return sample(value, full) if kind is sre.ATOMIC_GROUP else ""


def repeated(items: Any, before: str, full: bool) -> Iterator[tuple[str, str]]:
    """What stands before each repeat of a pattern, and what is repeated."""
    for kind, value in items:
        if kind in REPEATS:
            yield before, sample(value[2], full) or "a"
            yield from repeated(value[2], before, full)
        elif kind is sre.BRANCH:
            for branch in value[1]:
                yield from repeated(branch, before, full)
        elif kind in (sre.SUBPATTERN, sre.ASSERT, sre.ASSERT_NOT):
            yield from repeated(value[3 if kind is sre.SUBPATTERN else 1], before, full)
        before += sample_of_one((kind, value), full)


def hostile(items: Any) -> Iterator[tuple[str, str]]:
    """Beginnings of texts, and what goes on and on behind them."""
    found = {one for full in (False, True) for one in repeated(items, "", full)}
    whole = {"".join(one) for one in found} | {before for before, _ in found if before}
    pumps = {pump for _, pump in found} | {" ", "a", "0", "_"}
    yield from sorted({(before, pump) for before, _ in found for pump in pumps} | {("", pump) for pump in whole})


def steps(items: Any, flags: int, methods: frozenset[str], text: str) -> int:
    """How many steps a pattern takes over a text, in the methods of `re` by which friso uses it."""
    matching, at = Steps(text, bool(flags & re.IGNORECASE)), 0
    while at <= len(text):
        end = first(matching.ends(items, 0, at))
        if methods <= {"fullmatch", "match"} or (end and methods <= {"fullmatch", "match", "search"}):
            break
        at = max(end[0], at + 1) if end else at + 1
    return matching.count


def patterns() -> dict[tuple[Any, int, frozenset[str]], str]:
    """Every pattern of friso with its flags, and the methods of `re` by which it is used; with its place."""
    found = {}
    for path in sorted((*ROOT.glob("friso/**/*.py"), *ROOT.glob("friso_thesis/**/*.py"))):
        source = path.read_text(encoding="utf-8")
        for call in ast.walk(ast.parse(source)):
            match call:
                case ast.Call(ast.Attribute(ast.Name("re"), method), [pattern, *others], keywords) if (
                    method != "escape"
                ):
                    flags = [ast.unparse(one) for one in (*others, *(one.value for one in keywords))]
                case ast.Call(
                    ast.Attribute(ast.Attribute(attr="str"), "extract" | "contains" as method), [pattern], []
                ):
                    flags = []
                case _:
                    continue
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
            try:
                text = eval(ast.unparse(pattern), dict(vars(importlib.import_module(name))))
            except NameError:  # words that are known at work alone, escaped
                continue
            methods = {method}
            if method == "compile":
                assigned = re.escape(source.splitlines()[call.lineno - 1].split()[0])
                used = re.findall(rf"\b{assigned}\.({METHODS})\b", source)
                methods = {*(used or re.findall(rf"\.({METHODS})\b", source))}
            value = sum(getattr(re, one[3:]) for one in flags if re.fullmatch(r"re\.[A-Z]+", one))
            found[text, value, frozenset(methods)] = f"{path.relative_to(ROOT)}:{call.lineno}"
    return found


@pytest.mark.slow
def test_a_text_twice_as_long_takes_no_pattern_much_longer() -> None:
    found, slow = patterns(), {}
    assert len(found) > 100
    for (pattern, flags, methods), place in found.items():
        items = [*parser.parse(pattern, flags), *([(sre.AT, sre.AT_END_STRING)] if methods == {"fullmatch"} else [])]
        for before, pump in () if pattern in LIMITED else hostile(items):
            for tail in TAILS:
                texts = [before + pump * (n // len(pump)) + tail for n in (LONG, 2 * LONG)]
                short, long = (steps(items, flags, methods, text) for text in texts)
                if long > MUCH * short + FEW:
                    slow[place, pattern] = (before, pump, tail, short, long)
    assert not slow
