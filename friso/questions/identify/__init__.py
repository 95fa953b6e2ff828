"""What is my machine: a stage file with uncertainties from measured logs."""

from friso.interface.question import MACHINE, Choices, Question

QUESTION = Question(
    __name__,
    100,
    MACHINE,
    'identify log.csv --stage stage.toml --map position=ActPos --scale force="35.15 N/V" --out identified',
    takes=("logs",),
    metavars={"logs": "LOG...", "stage": "STAGE.toml"},
    folder="identified",
    details=True,
    choices=Choices.of_registry("Kinds of experiment (--as)", "friso.identification.kinds:KINDS"),
    runner="friso.cli.runs:run_identify",
)
