"""What is my machine: a stage file with uncertainties from measured logs."""

from friso.interface.question import MACHINE, Choices, Question


def listed_kinds() -> list[tuple[str, str]]:
    """Return the kinds of experiment that `--as` takes, with one line on each."""
    from friso.identification.kinds import KINDS

    return [(name, KINDS.one_line(name)) for name in KINDS]


QUESTION = Question(
    __name__,
    100,
    MACHINE,
    'identify log.csv --stage stage.toml --map position=ActPos --scale force="35.15 N/V" --out identified',
    takes=("logs",),
    metavars={"logs": "LOG...", "stage": "STAGE.toml"},
    folder="identified",
    details=True,
    choices=Choices("Kinds of experiment (--as)", listed_kinds),
    runner="friso.cli.runs.identify",
)
