"""How the cases of a check are named and coloured: the same in every figure, sentence and table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from friso.hunting import BANDS as SETTLING_BANDS
from friso.views.drawing.figure import BLUE, GREEN, VERMILLION

if TYPE_CHECKING:
    from friso.hunting import Case

COLOURS = {"given": BLUE, "locked": VERMILLION, "free": GREEN}
LABELS = {"given": "As given", "locked": "Locked", "free": "Free"}
BANDS = dict(zip(SETTLING_BANDS, ("1 µm", "10 µm"), strict=True))


@dataclass(frozen=True)
class Shown:
    """One case as the figures and the report show it: always under this label, in this colour."""

    key: str
    label: str
    colour: str
    case: Case


def shown_cases(cases: Mapping[str, Case]) -> tuple[Shown, ...]:
    """The cases, each once: where "given" repeats the locked or the free case, that one says "(as given)"."""
    twin = _twin(cases)
    keys = [key for key in COLOURS if key in cases and not (key == "given" and twin)]
    labels = {key: LABELS[key] + (" (as given)" if key == twin else "") for key in keys}
    return tuple(Shown(key, labels[key], COLOURS[key], cases[key]) for key in keys)


def _twin(cases: Mapping[str, Case]) -> str | None:
    """The key of the case that "given" repeats, if any."""
    joint = cases["given"].stage.joint if "given" in cases else None
    key = None if joint is None else ("locked" if joint.locked else "free")
    return key if key in cases else None
