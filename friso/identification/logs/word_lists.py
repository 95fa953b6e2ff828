"""Load the word lists by which channels and units are recognised, from the TOML files beside this module."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def read_lists(name: str) -> dict[str, Any]:
    """Return the tables of `NAME.toml`, read once."""
    return tomllib.loads(files("friso.identification.logs").joinpath(f"{name}.toml").read_text("utf-8"))


@cache
def channel_words() -> dict[str, Any]:
    """Return the words in a channel's name that tell what it is, from names.toml.

    Keys are the tables of that file, nested as there. Values are sets of words, all languages together.
    """
    return _joined(read_lists("names"))


def _joined(table: dict[str, Any]) -> dict[str, Any]:
    """Join word lists, one for each language, into one set; nested tables likewise."""
    return {
        key: frozenset(word for words in value.values() for word in words)
        if all(isinstance(words, list) for words in value.values())
        else _joined(value)
        for key, value in table.items()
    }
