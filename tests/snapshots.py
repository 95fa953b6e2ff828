"""Compare what commands say with stored texts: words and layout exactly, numbers as processors agree.

A file holds the texts of one command by name. `pytest --refresh-snapshots` writes those that differ. Folders, times,
versions and numerical errors are masked. Numbers are compared to 2 %, or to their last decimal; white space and the
length of lines of a table are not compared.
"""

import math
import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from tempfile import gettempdir

from filelock import FileLock

import friso

FOLDER = Path(__file__).parent / "snapshots"
TOLERANCE = 0.02

HEAD = re.compile(r"^==== (.+) ====\n", re.MULTILINE)

NUMBER = re.compile(r"(\d+(?:\.\d+)?(?:e[-+]?\d+)?)")

RULES = str.maketrans({**dict.fromkeys("─━═╌┄-", "─"), **dict.fromkeys("│┃║|", "│")})
"""Lines of a table look alike, however long they are."""

MASKED = (
    (re.compile(r"/\S*/pytest-of-\w+/pytest-\d+(?:/popen-gw\d+)?/[\w.\[\]-]+"), "FOLDER"),
    (re.compile(r"(?:FOLDER|(?<![\w.]))/(?:[\w.+-]+/)+(?=[\w.+-]*)"), "FOLDER/"),
    (re.compile(r"[\x00-\x09\x0b-\x1f\x7f]"), lambda match: repr(match.group())[1:-1]),
    (re.compile(re.escape(friso.__version__)), "VERSION"),
    (re.compile(r"\d{4}-\d\d-\d\d(?:[ T]\d\d:\d\d(?::\d\d)?)?"), "DATE"),
    (re.compile(r"\([0-9a-f]{12}\)"), "(DIGEST)"),
    (re.compile(r"127\.0\.0\.1:\d{4,}"), "ADDRESS"),
    (re.compile(r"\b(took|takes) \d+(?:\.\d+)? ?(?:ms|s|min|h)\b"), r"\1 TIME"),
    (re.compile(r"\b\d+(?:\.\d+)?(?:e[-+]?\d+)? (?=(?:minutes|hours) on )"), "TIME "),
    (re.compile(r"(?<=VERSION) with (?:controller|friction law) [^)]*\)(?: and friction law [^)]*\))*"), ""),
    (re.compile(r'(?<="transfer_function"), "[\w-]+"'), ""),
    (re.compile(r"(?<=\d ± )\d+(?:\.\d+)?(?:e-?\d+)?"), "ERROR"),
)


def masked(text: str) -> str:
    """A text without what differs from run to run."""
    for pattern, mask in MASKED:
        text = pattern.sub(mask, text)
    return "\n".join(line.rstrip() for line in text.strip().splitlines()) + "\n"


def words(text: str) -> list[str]:
    """Words and numbers of a text."""
    result: list[str] = []
    for k, part in enumerate(NUMBER.split(text)):
        result += [part] if k % 2 else re.sub("─+", "─", part.translate(RULES)).split()
    return result


def alike(one: str, other: str) -> bool:
    """Whether texts say the same, their numbers up to what processors differ by."""
    return all(a == b or _near(a or "", b or "") for a, b in zip_longest(words(one), words(other)))


def _near(one: str, other: str) -> bool:
    """Whether these are numbers that differ by rounding: of a value in decimals the last digit may be another."""
    if not (NUMBER.fullmatch(one) and NUMBER.fullmatch(other)):
        return False
    decimals = max(len(text.partition("e")[0].partition(".")[2]) for text in (one, other))
    digit = 1.01 * 10.0**-decimals if decimals else 0.0
    return math.isclose(float(one), float(other), rel_tol=TOLERANCE, abs_tol=digit if "e" not in one else 0.0)


def read(path: Path) -> dict[str, str]:
    """The texts in a file by name."""
    parts = HEAD.split(path.read_text(encoding="utf-8")) if path.exists() else [""]
    return {name: text.strip("\n") + "\n" for name, text in zip(parts[1::2], parts[2::2], strict=True)}


@dataclass(frozen=True)
class Snapshots:
    """The texts that are kept, or, to `refresh`, written where they differ."""

    refresh: bool = False

    def check(self, command: str, name: str, text: str) -> None:
        """Compare what a command says with the text stored under a name."""
        path, now = FOLDER / f"{command}.txt", masked(text)
        kept = read(path).get(name, "")
        if alike(kept, now):
            return
        if not self.refresh:
            raise AssertionError(_difference(kept, now) + f"\n{path.name}, {name}: as kept, or --refresh-snapshots")
        with FileLock(Path(gettempdir()) / "friso-snapshots.lock"):
            texts = {**read(path), name: now}
            rows = (f"==== {item} ====\n{texts[item]}" for item in sorted(texts))
            path.write_text("\n".join(rows), encoding="utf-8")


def _difference(kept: str, now: str) -> str:
    """The first words that differ, with those before."""
    one, other = words(kept), words(now)
    place = next(k for k, (a, b) in enumerate(zip_longest(one, other)) if not alike(a or "", b or ""))
    part = slice(max(0, place - 8), place + 12)
    was, is_ = (" ".join(item[part]) for item in (one, other))
    return f"was: {was}\nnow: {is_}"
