"""What to type into the drive: gains in the units of drives, and as a drive's parameters."""

from friso.interface.question import STOPS, Choices, Question

QUESTION = Question(
    __name__,
    85,
    STOPS,
    'export gains examples/twincat_cascade.toml --set travel_per_turn="10 mm"',
    takes=("what", "stage"),
    metavars={"what": "gains"},
    choices=Choices.of_registry("Formats of --to, and of friso init --from", "friso.drives.format:FORMATS"),
)
