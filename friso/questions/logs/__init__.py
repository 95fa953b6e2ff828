"""What files of logs hold, before anything is identified."""

from friso.interface.question import MACHINE, Choices, Question


def listed_formats() -> list[tuple[str, str]]:
    """Return the formats of logs that friso reads, with one line on each."""
    from friso.identification.logs.format import FORMATS

    return [(FORMATS[name].title, FORMATS.one_line(name)) for name in FORMATS]


QUESTION = Question(
    __name__,
    90,
    MACHINE,
    "logs log.csv --out logs",
    takes=("logs",),
    metavars={"logs": "LOG..."},
    during="reading",
    choices=Choices("Formats", listed_formats),
    runner="friso.cli.runs:run_logs",
)
