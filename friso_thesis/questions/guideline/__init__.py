"""Answer with the design guideline: two formulas for the crossover at which hunting ends."""

from friso.interface.question import WHERE, Question

QUESTION = Question(
    __name__,
    140,
    WHERE,
    "guideline --out guideline\nA quick try: friso guideline --samples 64 --out guideline",
    takes=(),
    folder="guideline",
    answers_interrupted=True,
    runner="friso_thesis.commands.guideline:run",
)
