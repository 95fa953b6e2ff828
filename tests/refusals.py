"""Check refused inputs by key: every refusal says what was given, and what was expected."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from friso.errors import InputError


@contextmanager
def refused(key: str | None = None, kind: type[InputError] = InputError) -> Iterator[pytest.ExceptionInfo[InputError]]:
    """Check that the block ends in an error of this kind, about this key, that is complete and fits a screen."""
    with pytest.raises(kind) as caught:
        yield caught
    error = caught.value
    assert key in (None, error.key)
    assert error.key or error.origin
    assert error.actual
    assert error.expected
    assert str(error).count("\n") < 20


def rows_of(message: str) -> dict[str, str]:
    """Return the rows `given`, `expected` and `example` of a refusal as a command prints it."""
    pairs = (line.strip().partition(":") for line in message.splitlines() if line.startswith("  "))
    rows = {name: text.strip() for name, _, text in pairs}
    assert rows["given"], message
    assert rows["expected"], message
    return rows
