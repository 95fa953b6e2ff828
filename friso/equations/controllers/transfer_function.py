"""A controller given by its coefficients, by its zeros and poles, or by its sections."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from friso.equations.controllers.rational import RationalController, TransferRoots, polynomial_roots
from friso.errors import InputError, StageError
from friso.stage import Rule, register_controller
from friso.stage.controllers import FILTER_ARRAY
from friso.stage.section import (
    Coefficients,
    OneTable,
    Rows,
    TableArray,
    UncertainSection,
    Values,
    element_keys,
    row_keys,
)

WAYS = ("denominator", "poles", "sections")
"""Keys of which each selects one way to give a transfer function."""


class TransferSection(UncertainSection):
    """A section of the transfer function: a quotient of polynomials, their highest powers first."""

    numerator: Annotated[Values, Coefficients((1.0, 120.0, 3600.0))]
    denominator: Annotated[Values, Coefficients((1.0, 300.0, 0.0))]


_SECTIONS = TableArray(
    OneTable(TransferSection), "[[controller.sections]] numerator = [1, 20], denominator = [1, 400]", FILTER_ARRAY.most
)


def _ways(flat: Mapping[str, Any]) -> int:
    """Return in how many ways the transfer function is given."""
    return sum(any(key.startswith(f"controller.{way}.") for key in flat) for way in WAYS)


@register_controller
class TransferFunction(RationalController):
    """Force over error as a transfer function in s, or with a sample_time in z; in SI.

    It is given in one of three ways.
    """

    kind: Literal["transfer_function"]
    numerator: Annotated[Values | None, Coefficients((2e3, 8e4, 4e5))] = None
    denominator: Annotated[Values | None, Coefficients((1.0, 400.0, 0.0))] = None
    """Coefficients of the denominator, the highest power first."""
    zeros: Annotated[Values | None, Coefficients((-6.0, "-30+10j"), roots=True)] = None
    poles: Annotated[Values | None, Coefficients((0.0, -400.0), roots=True)] = None
    """Poles in 1/s, or in z; a complex pole includes its conjugate, and `gain` multiplies the whole."""
    sections: Annotated[Rows, _SECTIONS] = Rows()
    """Sections whose product is the transfer function."""

    rules: ClassVar[tuple[Rule, ...]] = RationalController.rules

    @model_validator(mode="after")
    def _roots_have_a_gain(self) -> Self:
        if self.poles is not None and self.denominator is None and "gain" not in self.model_fields_set:
            raise StageError("gain", "nothing", "the gain before the product of zeros over poles, in SI", "gain = 2e3")
        return self

    @classmethod
    def roots(cls, flat: Mapping[str, Any]) -> TransferRoots:
        """Return zeros, poles and gain, whichever way the file gives them.

        Raises InputError if the file gives them in none of the three ways, in several, or as a quotient that is not
        proper.
        """
        if _ways(flat) != 1:
            actual = "none of them" if not _ways(flat) else "several of them"
            expected = "one of numerator and denominator, zeros and poles, or [[controller.sections]]"
            raise InputError("controller", actual, expected, "numerator = [2e3, 8e4, 4e5], denominator = [1, 400, 0]")
        if row_keys(flat, cls.key("sections")):
            parts = [_quotient(flat, place) for place in row_keys(flat, cls.key("sections"))]
            zeros, poles, gains = zip(*parts, strict=True)
            return TransferRoots(np.concatenate(zeros), np.concatenate(poles), float(np.prod(gains)))
        if element_keys(flat, cls.key("poles")):
            zeros, poles = (_roots(flat, cls.key(name)) for name in ("zeros", "poles"))
            return TransferRoots(zeros, poles, 1.0)
        return _quotient(flat, "controller")


def _quotient(flat: Mapping[str, Any], place: str) -> TransferRoots:
    """Return the roots of numerator and denominator in the table `place` of a stage file."""
    numerator, denominator = (
        [flat[key] for key in element_keys(flat, f"{place}.{name}")] for name in ("numerator", "denominator")
    )
    return polynomial_roots(numerator or [1.0], denominator)


def _roots(flat: Mapping[str, Any], key: str) -> np.ndarray:
    """Return the complex roots listed under a key, (n,); conjugates of complex ones are added."""
    roots = [complex(flat[name]) for name in element_keys(flat, key)]
    return np.array([one for root in roots for one in ((root, root.conjugate()) if root.imag else (root,))])
