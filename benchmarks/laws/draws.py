"""Draw stages at random under a friction law, from those of `benchmarks.truth`.

Only the friction is replaced.
"""

from __future__ import annotations

from itertools import count, islice
from typing import Any

import numpy as np

from benchmarks.truth.draws import FORMS, Form, draw
from friso.stage import Stage
from friso.stage.tables import friction_law
from friso.studies.laws import with_friction

JOINTS = (Form("rigid"), Form("free"), Form("locked"))
"""Structures that are taken from `benchmarks.truth`."""

ELEMENTS = {"rigid": 4, "free": 2, "locked": 6}
"""Number of elements of a law with several, one for each structure, because each number needs a kernel."""


def numbers(stages: int) -> list[int]:
    """Return the numbers of the first stages with LuGre friction and van Dijk controller alone."""
    return list(islice((n for n in count() if FORMS[n % len(FORMS)] in JOINTS), stages))


def under(law: str, seed: int, number: int) -> Stage:
    """Return the numbered stage under a law, with a shape before sliding drawn for it."""
    stage, rng = draw(seed, number), np.random.default_rng([seed, number, 11])
    joint = FORMS[number % len(FORMS)].joint
    measured = friction_law("lugre").shown(stage.flat())
    keys = friction_law(law).keeping(measured, ELEMENTS[joint])
    return with_friction(stage, law, keys | _shape(law, keys, rng))


def _shape(law: str, keys: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Draw the keys that decide only on motion before sliding, anywhere within their ranges."""
    if law == "elasto_plastic":
        most = keys["friction.coulomb"] / keys["friction.bristle_stiffness"]
        return {"friction.breakaway_deflection": float(rng.uniform(0.05, 0.95)) * most}
    if law == "rolling":
        return {"friction.rolling_exponent": float(rng.uniform(1.0, 2.5))}
    if law == "gms":
        share = rng.dirichlet(np.full(sum("share" in key for key in keys), 3.0))
        lag = keys["friction.attraction"] * float(np.exp(rng.uniform(-2.3, 2.3)))
        return {f"friction.element_share.{n}": float(value) for n, value in enumerate(share, 1)} | {
            "friction.attraction": lag
        }
    return {}
