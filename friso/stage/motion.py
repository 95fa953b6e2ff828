"""Declare what every motion of the reference has: the table [motion].

Each kind of motion is one file in `friso/equations/motions/`, or comes from a package.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, cast

from friso.quantities import Quantity, positive
from friso.stage.section import UncertainSection, Variants

KIND, DURATION = "motion.kind", "motion.duration"
"""Keys that every motion has."""


class ReferenceForm(NamedTuple):
    """What a reference consists of: polynomials of a `degree`, 2 to 4, and sinusoids.

    `tones` is the number of sinusoids.
    """

    degree: int = 2
    tones: int = 0

    @property
    def inputs(self) -> int:
        """Return how many numbers describe a piece of the reference.

        They are derivatives, direction, and four for each sinusoid.
        """
        return 1 + self.degree + (1 + 4 * self.tones if self.tones else 0)


QUADRATIC = ReferenceForm()
"""Reference of parabolic pieces. It fits any motion with bounded acceleration, and rest."""


class Tone(NamedTuple):
    """A sinusoid of the reference: amplitude [m], phase [turns], frequency [Hz], rise [Hz/s].

    The rise is that of the frequency; phase and frequency are those at the start.
    """

    amplitude: Any
    turns: Any
    frequency: Any
    sweep: Any = 0.0


class Stand(NamedTuple):
    """A place where the reference stands still.

    The reference stops there at `corner` [s] and leaves at `until` [s], or stays to the end of the run.
    """

    corner: Any
    until: Any


class Lowered(NamedTuple):
    """A limit that a move is too short to reach.

    It has the move's distance [m], the limit's name, unit and value, and the peak that is reached [SI].
    """

    distance: float
    name: str
    limit: float
    reached: float
    unit: str


Piece = tuple[Any, ...]
"""Start time [s] of a piece, and position [m], velocity [m/s] and acceleration [m/s^2] there. Jerk and snap follow if
the reference has them."""


class Motion(UncertainSection):
    """Base of the motions: each kind declares its keys and its reference.

    A reference consists of polynomial pieces, sinusoids ("tones"), or both. The functions take the stage's keys with SI
    numbers, or arrays with one entry per run.
    """

    kind: Any
    duration: Annotated[Any, Quantity("s", positive, "20 s")]

    rests: ClassVar[bool] = True
    """Whether the reference stands still in the end, so that the stage can hunt."""

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say what the reference consists of: polynomials of a degree, and sinusoids."""
        return QUADRATIC

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the pieces of the polynomial part, from time 0; the last one lasts to the end."""
        return [(0.0, 0.0, 0.0, 0.0)]

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoids that are added to the polynomials."""
        return ()

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the length of the motion [m]; 0 where the reference never moves."""
        return 0.0

    @staticmethod
    def initial_displacement(flat: Mapping[str, Any]) -> Any:
        """Return the position of all masses at the start [m]."""
        return 0.0

    @classmethod
    def stands(cls, flat: Mapping[str, Any]) -> Sequence[Stand]:
        """Return the places where the reference stands still.

        A reference that never stands has one, from its last corner on.
        """
        return [Stand(cls.pieces(flat)[-1][0], flat[DURATION])]

    @staticmethod
    def period(flat: Mapping[str, Any]) -> float | None:
        """Return the period [s] of a reference that repeats for ever; None for any other."""
        return None

    @staticmethod
    def lowered(flat: Mapping[str, Any]) -> Sequence[Lowered]:
        """Return the limits that moves of a stage are too short to reach."""
        return ()

    @staticmethod
    def with_defaults(flat: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return values for keys that the stage file may lack, because they follow from others."""
        return {}

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the keys that change when a move becomes longer by a factor, with new values [SI].

        There are none without a move.
        """
        return {}

    @staticmethod
    def varied(flat: Mapping[str, Any], shares: tuple[float, float]) -> Mapping[str, tuple[float, float]]:
        """Return ranges [SI] of two keys for moves around the present one; none if it is no move.

        `shares` are the ends of both ranges, as multiples of the present values.
        """
        return {}


MOTION = Variants("kind", "friso.motions")
register_motion = MOTION.register


def motion_of(flat: Mapping[str, Any]) -> type[Motion]:
    """Return the class of a stage's motion; `flat` has the stage's keys."""
    return cast(type[Motion], MOTION.named(flat[KIND]))
