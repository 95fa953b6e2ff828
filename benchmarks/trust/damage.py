"""Damage files at random, as disks, editors and hostile people do."""

import random
from collections.abc import Callable
from pathlib import Path

_TOKENS = (
    b"\x00", b"\xff\xfe", b"\x1b[2J", b"\xe2\x80\xae", b"\r", b"\n", b'"', b"'", b"[", b"]", b"{", b"}", b"=", b"#",
    b",", b"nan", b"inf", b"-1", b"0", b"1e308", b"1e-308", b"1e400", b"-0.0", b"true", b"kg", b"m/s^9", b"hz",
    b"..", b"+/-", b"9" * 400, b"9" * 5000, b"[" * 500, b"a." * 400,
    b"1" * 50_000, b"*" * 50_000, b"a" * 50_000, b" " * 50_000,
    b"\xed\xa0\x80", b"=1+1", b":log", b":0", b":1000000000",
)  # fmt: skip


def flip(file: Path, place: float) -> None:
    """Change one bit of a file, at a share of its length."""
    content = bytearray(file.read_bytes())
    content[min(int(place * len(content)), len(content) - 1)] ^= 0x10
    file.write_bytes(content)


def exchange(first: Path, second: Path) -> None:
    """Give two files each other's contents."""
    one, other = first.read_bytes(), second.read_bytes()
    first.write_bytes(other)
    second.write_bytes(one)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Return the content after one to four changes."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        content = rng.choice(_CHANGES)(content, rng)
    return content


def _bit(content: bytes, rng: random.Random) -> bytes:
    if not content:
        return content
    place = rng.randrange(len(content))
    return content[:place] + bytes([content[place] ^ 1 << rng.randrange(8)]) + content[place + 1 :]


def _cut(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _gap(content: bytes, rng: random.Random) -> bytes:
    first = rng.randrange(len(content) + 1)
    return content[:first] + content[first + rng.randrange(1, 40) :]


def _insert(content: bytes, rng: random.Random) -> bytes:
    place = rng.randrange(len(content) + 1)
    return content[:place] + rng.choice(_TOKENS) + content[place:]


def _repeat(content: bytes, rng: random.Random) -> bytes:
    first = rng.randrange(len(content) + 1)
    part = content[first : first + rng.randrange(1, 80)]
    return content[:first] + part * rng.choice((2, 2, 50)) + content[first:]


def _number(content: bytes, rng: random.Random) -> bytes:
    """Replace one number by another."""
    places = [k for k, sign in enumerate(content) if 48 <= sign <= 57]
    if not places:
        return content
    place = rng.choice(places)
    return content[:place] + rng.choice(_TOKENS) + content[place + 1 :]


def _lines(content: bytes, rng: random.Random) -> bytes:
    """Exchange two lines, or lose one."""
    lines = content.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines[: rng.choice((len(lines), len(lines) - 1))])


_CHANGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (_bit, _cut, _gap, _insert, _repeat, _number, _lines)
