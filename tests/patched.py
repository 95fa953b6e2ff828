"""Sizes of a computation changed for as long as a block lasts."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest


@contextmanager
def patched(sizes: Mapping[Any, Mapping[str, Any]]) -> Iterator[None]:
    """Modules to names to values."""
    with pytest.MonkeyPatch.context() as patch:
        for module, values in sizes.items():
            for name, value in values.items():
                patch.setattr(module, name, value)
        yield
