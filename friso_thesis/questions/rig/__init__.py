"""A rehearsal: an experiment on the machine as built, its logs, and the truth behind them."""

from friso.interface.question import MACHINE, Choices, Question

QUESTION = Question(
    __name__,
    110,
    MACHINE,
    "rig stiffness examples/thesis_drive.toml --out rig",
    takes=("experiment", "stage"),
    details=True,
    files=("truth/stage.toml",),
    choices=Choices.of_registry("Experiments", "friso_thesis.studies.rig.experiments:RIG_EXPERIMENTS"),
)
