"""Check whether friso works on this computer."""

from friso.interface.question import HELP, Question

QUESTION = Question(__name__, 150, HELP, "doctor", takes=(), writes=False)
