"""Convert a stage to another friction law, and say what could not be kept."""

from friso.interface.question import WHY, Choices, Question


def listed_laws() -> list[tuple[str, str]]:
    """Return the friction laws that a stage can be converted to, with one line on each."""
    from friso.stage.tables import friction_law
    from friso.studies.laws.conversion import convertible

    return [
        (name, (friction_law(name).__doc__ or "").split(":")[0].split("\n")[0].removesuffix("."))
        for name in convertible()
    ]


QUESTION = Question(
    __name__,
    55,
    WHY,
    "convert examples/thesis_rig.toml --friction gms --elements 6 --out gms",
    choices=Choices("Laws", listed_laws),
)
