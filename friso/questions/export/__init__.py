"""What to type into the drive: gains in the units of drives, and as a drive's parameters."""

from friso.interface.question import STOPS, Choices, Question


def listed_formats() -> list[tuple[str, str]]:
    """Return the kinds of parameter files, with one line on each."""
    from friso.drives.format import FORMATS

    return [(name, FORMATS.one_line(name)) for name in FORMATS]


QUESTION = Question(
    __name__,
    85,
    STOPS,
    'export gains examples/twincat_cascade.toml --set travel_per_turn="10 mm"',
    takes=("what", "stage"),
    metavars={"what": "gains"},
    choices=Choices("Formats of --to, and of friso init --from", listed_formats),
)
