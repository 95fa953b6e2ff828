"""Say for which friction a stage would hunt whose stage file states none."""

from __future__ import annotations

from typing import Any

from friso.shown.text import range_with_unit, with_unit
from friso.studies.draws import FrictionLevels
from friso.studies.settings import settings


def levels_sentence(levels: FrictionLevels) -> str:
    """Say from which Coulomb friction on machines with similar contacts hunt, and what shows one's own."""
    some, half = map(levels.ends, settings.shares_of_levels)
    if some is None:
        tried = range_with_unit(float(levels.coulomb[0]), float(levels.coulomb[-1]), "N")
        return f"The stage file has no [friction]: with usual bearings, {tried} of Coulomb friction, it would not hunt."
    also = f", and half from {with_unit(half[0], 'N')} on" if half else ""
    return (
        "The stage file has no [friction]: with usual bearings some such machines hunt from "
        f"{with_unit(some[0], 'N')} of Coulomb friction on{also}. A log of moves in both directions shows how much "
        "yours has (friso identify)."
    )


def levels_document(levels: FrictionLevels) -> dict[str, Any]:
    """Return the levels of Coulomb friction, and the share of machines that hunt at each."""
    return {"coulomb_n": levels.coulomb, "share_that_hunts": levels.shares, "machines": len(levels.hunts)}
