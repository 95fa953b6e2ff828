"""The JSON document."""

from typing import Any

from friso_resting.resting.question import RestingAnswer


def resting_document(answer: RestingAnswer) -> dict[str, Any]:
    """The distance."""
    return {"distance_m": answer.result}
