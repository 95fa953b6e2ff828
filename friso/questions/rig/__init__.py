"""A rehearsal: an experiment on the machine as built, its logs, and the truth behind them."""

from friso.interface.question import MACHINE, Choices, Question


def listed_experiments() -> list[tuple[str, str]]:
    """Return the experiments of the rig, with one line on each."""
    from friso.studies.rig.experiments import RIG_EXPERIMENTS

    return [(name, RIG_EXPERIMENTS.one_line(name)) for name in RIG_EXPERIMENTS]


QUESTION = Question(
    __name__,
    110,
    MACHINE,
    "rig stiffness examples/thesis_drive.toml --out rig",
    takes=("experiment", "stage"),
    details=True,
    files=("truth/stage.toml",),
    choices=Choices("Experiments", listed_experiments),
)
