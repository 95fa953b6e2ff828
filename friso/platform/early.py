"""Prepare the command line before the rest of friso is imported.

A signal during the import is remembered. No module is loaded from the current folder, which may belong to someone else.
OpenBLAS, with which NumPy is usually built, computes in one thread unless the environment says otherwise.
The module has no effect if friso is used as a library.
"""

import os
import sys


def _module() -> str:
    """Return the module that Python was started with by -m; "" without one."""
    if sys.argv[:1] != ["-m"]:  # its value until the module itself runs
        return ""
    for word, following in zip(sys.orig_argv[1:], [*sys.orig_argv[2:], ""], strict=True):
        flags, option, name = word.partition("m")
        if option and word.startswith("-") and not flags.strip("-bBdEhiIOPqsSuvVx"):
            return name or following
    return ""


_IS_MODULE = _module() in ("friso", "friso.__main__")
_HOME = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if _IS_MODULE and sys.path[:1] == [os.getcwd()] != [_HOME]:  # python -m adds it, unless started with -P
    del sys.path[0]  # before any import of a module that Python has not loaded yet

import atexit  # noqa: E402
import signal  # noqa: E402
from types import FrameType  # noqa: E402

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]
"""The signals that end a command."""

IS_COMMAND = _IS_MODULE or os.path.splitext(os.path.basename(sys.argv[0]))[0] == "friso"
"""True if this process was started as friso, or as python -m friso."""

came: list[int] = []
"""The signals received so far, in order."""


def _note(number: int, frame: FrameType | None) -> None:
    came.append(number)


def _ignore() -> None:
    """Ignore signals from now on, at the end of a command.

    Python removes its handlers as it exits, and a later signal would kill a command that has finished.
    """
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


if IS_COMMAND:
    if "OMP_NUM_THREADS" not in os.environ:  # read when NumPy is loaded; idle threads wait busily beside the engine's
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # ignored by nohup
            signal.signal(number, _note)
    atexit.register(_ignore)  # registered early, and therefore called late
