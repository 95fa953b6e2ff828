"""What comes first where friso is a command, in a module that needs next to nothing: a signal that comes while the rest
is imported is noted, and nothing of that is looked for in the current folder, which may be someone else's.

Nothing is done where friso is used as a library.
"""

import atexit
import os
import signal
import sys
from types import FrameType

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]
"""The signals that end a command."""

_IS_MODULE = ("-m", "friso") in zip(sys.orig_argv, sys.orig_argv[1:], strict=False)
IS_COMMAND = _IS_MODULE or os.path.splitext(os.path.basename(sys.argv[0]))[0] == "friso"
"""Whether this process was started as friso, or as python -m friso."""

came: list[int] = []
"""The signals that came, in their order."""


def _note(number: int, frame: FrameType | None) -> None:
    came.append(number)


def _ignore() -> None:
    """Ignore the signals from now on: when Python takes its handlers away they would end a command that is done."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


_HOME = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if _IS_MODULE and sys.path[:1] == [os.getcwd()] != [_HOME]:  # python -m puts it there, but for -P
    del sys.path[0]

if IS_COMMAND:
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # nohup
            signal.signal(number, _note)
    atexit.register(_ignore)  # among the first, and so among the last that are called
