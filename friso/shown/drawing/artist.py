"""Draw figures in a process beside a command: ``python -m friso.shown.drawing.artist``.

`friso.shown.drawing.images` asks the process for images of a figure, and it answers with their bytes.
"""

from __future__ import annotations

from collections.abc import Sequence

from friso.axis import AxisKind, speaking_of
from friso.platform.helper_process import answer_questions
from friso.shown.drawing.figure import Figure
from friso.shown.drawing.images import Image
from friso.shown.drawing.matplotlib_renderer import image


def drawn(asked: tuple[Figure, AxisKind, Sequence[Image]]) -> dict[Image, bytes]:
    """Return the images of a figure, in the units of a kind of axis.

    `asked` holds the figure, the kind of axis, and the images that are wanted.
    """
    figure, axis, images = asked
    with speaking_of(axis):
        return {wanted: image(figure, *wanted) for wanted in images}


if __name__ == "__main__":
    answer_questions(drawn, orphaned=False)
