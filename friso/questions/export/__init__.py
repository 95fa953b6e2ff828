"""What to take to the drive: gains in its units, its parameters, or the controller as code."""

from friso.interface.question import STOPS, Choices, Question

QUESTION = Question(
    __name__,
    85,
    STOPS,
    'export examples/twincat_cascade.toml --set travel_per_turn="10 mm"\n'
    "The controller in C: friso export examples/twincat_cascade.toml --to c --out axis",
    choices=Choices.of_registry(
        "What --to may be; drives also for friso init --from",
        "friso.drives.drive:FORMATS",
        "friso.drives.target:TARGETS",
    ),
)
