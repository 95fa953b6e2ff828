"""Doubt: the records support other friction laws than the stage's."""

from __future__ import annotations

from collections.abc import Iterator

from friso.identification.doubt import Doubt, RaisedDoubt
from friso.identification.laws.comparison import LawComparison
from friso.stage import Stage


def find(case: tuple[LawComparison, Stage]) -> Iterator[RaisedDoubt]:
    """Check whether the records support the stage's friction law.

    `case` has the comparison of the laws, and the stage.
    """
    laws, stage = case
    model, supported = stage.flat()["friction.model"], [law.law for law in laws.supported]
    if supported and model not in supported and model in (law.law for law in laws.predictions):
        yield RaisedDoubt(
            f"The record does not support {model}, the law of the stage: what is told of bristles is what {model} "
            "comes nearest with"
        )


DOUBT = Doubt(
    "laws", find, "what each friction law predicts of records left out", "reported", "a record before sliding"
)
