"""Answer with the thesis's figures and claims, computed again and judged."""

from friso.interface.question import WHY, Question

QUESTION = Question(
    __name__,
    130,
    WHY,
    "reproduce --points 21 --draws 12 --out reproduction\nOne claim: friso reproduce --only F15B",
    takes=("names",),
    metavars={"names": "[STUDY]..."},
    details=True,
    runner="friso_thesis.commands.reproduce:run",
)
