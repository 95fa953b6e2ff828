"""Check messages, such as those of refused inputs by key, against tests/snapshots/messages.txt."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import pytest
from snapshots import Snapshots, masked

from friso.errors import InputError

Wording = Callable[[str], None]
"""Function that compares the next text of a test with the stored one."""


@dataclass
class Refused:
    """The refusals of one test; they are kept under its name, the later ones numbered."""

    test: str
    snapshots: Snapshots
    count: int = 0

    @contextmanager
    def __call__(
        self, key: str | None = None, kind: type[InputError] = InputError
    ) -> Iterator[pytest.ExceptionInfo[InputError]]:
        """Check that the block ends in an error of this kind, about this key."""
        with pytest.raises(kind) as caught:
            yield caught
        assert key in (None, caught.value.key)
        self.says(str(caught.value))

    def says(self, message: str) -> None:
        """Compare the next message with the stored one."""
        self.count += 1
        number = f" ({self.count})" if self.count > 1 else ""
        self.snapshots.check("messages", masked(self.test).strip() + number, message)
