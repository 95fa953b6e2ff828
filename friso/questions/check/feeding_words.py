"""Say whether friction or backlash feeds the hunting of a stage."""

from __future__ import annotations

from friso.hunting import Decline, Feeding
from friso.quantities import percent


def feeding_sentences(feeding: Feeding) -> list[str]:
    """Say whether hunting ends without friction or without backlash, and at which fraction."""
    friction, backlash = feeding.friction, feeding.backlash
    if friction is None:
        feeds = "The backlash feeds it" if backlash.needed else "The backlash does not feed it"
        return [f"{feeds}: there is no dry friction; {_course('backlash', backlash)}.", *_doubt(backlash)]
    feeds = {
        (True, True): "Friction and backlash feed it together, and it ends without either of them",
        (True, False): "Friction feeds it, not the backlash",
        (False, True): "The backlash feeds it, not the friction",
        (False, False): "Either friction or backlash alone would feed it",
    }[friction.needed, backlash.needed]
    return [
        f"{feeds}: {_course('dry friction', friction)}; {_course('backlash', backlash)}.",
        *_doubt(friction, backlash),
    ]


def _course(name: str, decline: Decline) -> str:
    """Say how hunting changes as friction or backlash is scaled down."""
    if decline.gone == 0:
        return f"it shrinks in proportion to the {name}, and is gone without it"
    if decline.gone is None:
        return f"it lasts down to {percent(decline.lasts, 3)} of the {name}"
    return f"it persists at {decline.lasts:.3g} times the {name} and disappears at {decline.gone:.3g} times"


def _doubt(*declines: Decline) -> list[str]:
    """Return a sentence if the result is not certain; an empty list otherwise."""
    certain = all(decline.certain for decline in declines)
    doubt = "That is not certain: some simulations were given up, or swings too small for them to see may last."
    return [] if certain else [doubt]
