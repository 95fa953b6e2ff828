"""Say which experiments show a key of the stage file."""

from __future__ import annotations

from collections.abc import Set

_OF_BRISTLES = (("presliding",), "small motion before sliding (--as presliding; rehearsed by friso rig presliding)")
_OF_SLOW_SLIDING = (("slow-sliding",), "slow sliding (--as slow-sliding; rehearsed by friso rig constant-speed)")

SHOWN_BY: dict[str, tuple[tuple[tuple[str, ...], str], ...]] = {
    "masses": ((("frequency",), "a frequency response (--as frequency; rehearsed by friso rig frf)"),),
    "friction.coulomb": ((("moves", "constant-speed"), "moves in both directions at several speeds"),),
    "friction.viscous": (
        (("constant-speed",), "constant speeds (--as constant-speed; rehearsed by friso rig constant-speed)"),
    ),
    "friction.static": (
        (("break-away",), "force ramps from rest (--as break-away)"),
        (("stick-slip",), "slow motion that sticks and slips (--as stick-slip; rehearsed by friso rig stiction)"),
    ),
    "friction.stribeck_velocity": (_OF_SLOW_SLIDING,),
    "friction.bristle_stiffness": (_OF_BRISTLES,),
    "friction.bristle_damping": (_OF_BRISTLES,),
    "joint.stiffness": ((("steps",), "steps with the cart fixed (--as steps; rehearsed by friso rig stiffness)"),),
}
"""Experiments that show a key, or a table's keys: the kinds that such a log may have, and what to do."""


def ways_to_show(key: str, done: Set[str] = frozenset()) -> str:
    """Describe the experiments that would show a key, except for `done` kinds; "" if none."""
    ways = SHOWN_BY.get(key) or SHOWN_BY.get(key.split(".")[0]) or ()
    return " or ".join(text for kinds, text in ways if not {*kinds} & done)
