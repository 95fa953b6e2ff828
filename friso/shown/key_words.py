"""Write keys of a stage file in words."""

from __future__ import annotations

from friso.stage.controllers import CONTROLLER, CONTROLLERS, FORCE_LIMIT
from friso.stage.tables import friction_laws

_QUANTITIES = {
    FORCE_LIMIT: "Force limit",
    "joint.limiter_damping": "Limiter damping",
    "joint.limiter_stiffness": "Limiter stiffness",
    "joint.locked": "Joint",
    "masses.cart": "Cart mass",
    "masses.stage": "Stage mass",
}


def key_in_words(key: str) -> str:
    """Return a key in words: "joint.stroke" is "Joint stroke"; a free name stays as it is."""
    of_laws = {f"friction.{key}": word for law in friction_laws().values() for key, word in law.words.items()}
    quantities = _QUANTITIES | of_laws | CONTROLLERS.words
    if key in quantities:
        return quantities[key]
    for table in (f"{CONTROLLER}.", "friction.", "motion."):
        key = key.removeprefix(table)
    words = key.replace("_", " ").replace(".", " ")
    return words[:1].upper() + words[1:]
