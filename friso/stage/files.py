"""Stage files: reading, writing, and the KEY=VALUE of the command line."""

import os
import tomllib
from pathlib import Path
from typing import Any

from friso.errors import InputError, StageError
from friso.quantities import quoted
from friso.stage.stage import Stage

_EXPECTED = "a stage file; friso init writes one to start from"
_EXAMPLE = '[masses] and, on the next line, cart = "1.2 kg"'


def load(path: str | os.PathLike[str]) -> Stage:
    """The stage of the TOML file at `path`. Raises StageError."""
    try:
        return loads(text_of(Path(path), _EXPECTED), origin=str(path))
    except InputError as error:
        raise StageError.of(error) from None


def loads(text: str, origin: str = "stage file") -> Stage:
    """The stage of a TOML text; `origin` names it in errors. Raises StageError."""
    try:
        return Stage(**parsed(text, _EXPECTED))
    except InputError as error:
        raise StageError.of(error).found_in(origin) from None


def save(stage: Stage, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write a stage file to `path`, all of it or nothing.

    Raises InputError where there is a file already (unless `overwrite`) or the place cannot be written to.
    """
    write_whole(stage.to_toml(), Path(path), overwrite)


def write_whole(text: str, path: Path, overwrite: bool) -> None:
    """Write a text file, all of it or nothing. Raises InputError as `save` does."""
    if path.exists() and not overwrite:
        raise InputError("", "a file that already exists", "a new file, or permission to overwrite", origin=str(path))
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        draft.write_text(text, encoding="utf-8", newline="\n")
        draft.replace(path)
    except OSError as error:
        raise InputError("", _reason(error), "a writable location", origin=str(path)) from error
    finally:
        draft.unlink(missing_ok=True)


def parse_set(text: str) -> tuple[str, Any]:
    """Key and value of a command line's KEY=VALUE; a value that is no TOML is a text. Raises InputError."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError("", quoted(text), "KEY=VALUE", 'controller.crossover="12 Hz"', origin="--set")
    return key.strip(), _value(value.strip())


def _value(text: str) -> Any:
    """A TOML value, or the text itself; an inline table holds neither comments nor a second line."""
    try:
        document = tomllib.loads(f"line = {{ value = {text} }}")
    except (ValueError, RecursionError):
        return text
    is_one_value = [*document] == ["line"] and [*document["line"]] == ["value"]
    return document["line"]["value"] if is_one_value else text


def text_of(path: Path, expected: str, example: str = _EXAMPLE) -> str:
    """What stands in a text file, which is to be what is `expected`. Raises InputError."""
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = f"byte {error.start + 1} is not UTF-8"
        raise InputError("", text, "a text file saved as UTF-8", _EXAMPLE, str(path)) from None
    except (OSError, ValueError) as error:
        text = "a folder" if path.is_dir() else _reason(error)
        raise InputError("", text, expected, example, str(path)) from None


def _reason(error: OSError | ValueError) -> str:
    return str(getattr(error, "strerror", None) or error).lower()


def parsed(text: str, expected: str, example: str = _EXAMPLE) -> dict[str, Any]:
    """The tables of a TOML text that is to be what is `expected`. Raises InputError."""
    if not text.strip():
        raise InputError("", "an empty file", expected, example)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError("", "tables nested too deeply", expected, example) from None
    except ValueError as error:  # TOMLDecodeError, and Python's own for integers of thousands of digits
        raise InputError("", f"not TOML: {error}", "tables in brackets, then key = value", example) from None
