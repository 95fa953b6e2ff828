"""Leaf springs, stroke, crossover and gains from a specification, tried in simulated moves."""

from friso.interface.question import STOPS, Question

QUESTION = Question(
    __name__,
    80,
    STOPS,
    "design examples/thesis_rig.toml examples/specs/thesis.toml --out design",
    takes=("stage", "spec"),
    folder="design",
    details=True,
    files=("design.toml", "worst.toml", "design-not-verified.toml"),
    answers_interrupted=True,
    runner="friso.cli.runs:run_design",
)
