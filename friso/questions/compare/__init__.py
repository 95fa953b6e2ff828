"""Isolator or firmware: the same drawn machines with a joint, and with other settings."""

from friso.interface.question import STOPS, Question

QUESTION = Question(
    __name__,
    120,
    STOPS,
    "compare examples/thesis_rig.toml --out compare\ncompare stage.toml tuned/*.toml --out compare",
    details=True,
    answers_interrupted=True,
)
