"""Doubt: in a frequency response the motion opposes the force, because one of them has the wrong sign."""

from __future__ import annotations

from collections.abc import Iterator

from friso.identification.doubt import Doubt, RaisedDoubt
from friso.identification.response.analysis import Bench


def find(bench: Bench) -> Iterator[RaisedDoubt]:
    """Check whether the driven mass moves against the force.

    The phase of a mass line is -180 degrees; 0 degrees means a wrong sign.
    """
    model = bench.two_masses
    if not (model.signs[0] < 0 if model is not None else any(line.sign < 0 for line in bench.lines[:1])):
        return
    force, motion = bench.driven.channels.input, bench.driven.channels.output
    yield RaisedDoubt(
        words=f"The {motion} goes against the {force}, which no mass does: one of them has the wrong sign; the values "
        "are those with the sign reversed"
    )


DOUBT = Doubt("response", find, "the phase of the mass line", "reported", "a push by hand with both channels in view")
