"""Draw stages from all that the schema of the stage file allows.

Tables, kinds and keys are random, with the values of the schema's examples. Contradictions are mended as the error
says, or left out. Every function must accept such a stage, or refuse it in one clear message.
"""

import random
import re
import signal
import tomllib
import warnings
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import friso
from benchmarks.trust.arguments import CALLS, Computed, assert_clear, nothing_computed
from benchmarks.trust.inputs import ready
from friso.axis import ROTARY, AxisKind
from friso.design_method.method import NoDesign
from friso.errors import InputError, StageError
from friso.interface.answer import Answer
from friso.stage import Stage
from friso_thesis.studies.rig.experiments import RIG_EXPERIMENTS

ALWAYS = ("masses", "friction", "controller", "motion")
STEEL = "stainless 1.4310"
"""Material of leaf springs, the only free text."""

TABLES, KEYS, OFTEN = 0.2, 0.25, {"joint": 0.5, "transmission": 0.4, "drive": 0.4}
"""Probability of an optional table, and of an optional key, and higher ones for some tables."""

MENDED = 20
"""Most mistakes of a drawn stage that are mended."""


ASKED = [name for name, sound in CALLS.items() if "stage" in sound and name != "save"]
"""Functions that take a stage."""


COMPUTED = 20.0
"""CPU time [s] for which a function may compute the answer about a drawn stage."""


def stages(rng: random.Random, folder: Path) -> None:
    """Pass a drawn stage to a function, with a range of one of its keys if needed. Nothing is computed."""
    _ask_about(next(drawn_stages(rng)), rng, folder, nothing_computed())


def computed_stages(rng: random.Random, folder: Path) -> None:
    """Have a function compute its answer about a drawn stage, with warnings as errors, for `COMPUTED` seconds."""
    _ask_about(next(drawn_stages(rng)), rng, folder, _computed_for(COMPUTED))


def _ask_about(stage: Stage, rng: random.Random, folder: Path, within: AbstractContextManager[None]) -> None:
    """Pass a stage to a function, until `within` raises Computed.

    Raises AssertionError for a traceback, an unclear refusal, or a number that is missing in an answer.
    """
    name = rng.choice(ASKED)
    sound = {key: value for key, value in CALLS[name].items() if key != "stage"}
    if "x" in sound:
        sound["x"] = _range_of(stage, rng)
    if name == "rig":
        sound["experiment"] = rng.choice([*RIG_EXPERIMENTS])
    what = f"{name}({sound}) of\n{stage.to_toml()}"
    with ready(folder), redirect_stdout(StringIO()):
        try:
            with within:
                answer = getattr(friso, name)(stage=stage, **sound)
                if isinstance(answer, Answer):
                    _assert_complete(answer)
        except InputError as error:
            assert_clear(what, str(error))
            if isinstance(error, StageError) and error.actual.startswith("nothing"):
                raise AssertionError(f"a stage that was taken lacks {error.key}: {what}") from error
        except (Computed, NoDesign):
            pass
        except Exception as error:
            raise AssertionError(f"{type(error).__name__}: {str(error)[:200]}: {what}") from error


@contextmanager
def _computed_for(seconds: float) -> Iterator[None]:
    """Raise Computed once the block has used some CPU time [s], and raise every warning as an error."""

    def over(number: int, frame: object) -> None:
        raise Computed

    before = signal.signal(signal.SIGPROF, over)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            signal.setitimer(signal.ITIMER_PROF, seconds)
            yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def _assert_complete(answer: Answer) -> None:
    """Raise AssertionError if the words of an answer lack a number; write its tables and its document."""
    for sentence in answer.sentences():
        assert not re.search(r"(?<![\w.])(nan|inf)(?!\w)", sentence), f"a number is missing: {sentence}"
    list(answer.tables())
    answer.to_dict()


def _range_of(stage: Stage, rng: random.Random) -> str:
    """Return a numeric key of a stage with a range of a tenth of its value."""
    flat, fields = stage.flat(), stage.numeric_keys()
    key = rng.choice([key for key in fields if flat.get(key)])
    ends = (f"{share * float(flat[key])!r} {fields[key].unit}".strip() for share in (1.0, 1.1))
    return f"{key}={'..'.join(ends)}:3"


def drawn_stages(drawn: random.Random) -> Iterator[Stage]:
    """Yield stages that friso accepts, without end."""
    schema = friso.schema()["properties"]
    while True:
        if stage := _stage(_tables(schema, drawn)):
            yield stage


def _stage(tables: dict[str, Any]) -> Stage | None:
    """Build the stage of some tables, mended where friso refuses them; None if that fails."""
    for _ in range(MENDED):
        try:
            return Stage(**tables)
        except friso.InputError as error:
            if not _mend(tables, error):
                return None
    return None


def _mend(tables: dict[str, Any], error: friso.InputError) -> bool:
    """Set what the error's example sets, or leave out what is wrong; tell if either worked."""
    name, _, key = error.key.partition(",")[0].partition(".")
    table = tables.get(name)
    if not isinstance(table, dict):
        return False
    before = dict(table)
    table |= _set_in(error.example)
    if table != before:
        return True
    if key.partition(".")[0] in table:
        del table[key.partition(".")[0]]
    else:
        del tables[name]
    return True


def _set_in(example: str) -> dict[str, Any]:
    """Return the keys that an error's example sets; none if it is more than that."""
    try:
        values = tomllib.loads(example.replace(", ", "\n").partition(" or ")[0])
    except tomllib.TOMLDecodeError:
        return {}
    return {name: value for name, value in values.items() if not isinstance(value, dict)}


def _tables(schema: Mapping[str, Any], drawn: random.Random) -> dict[str, Any]:
    nodes = {name: node for name, node in schema.items() if "properties" in node or "anyOf" in node}
    tables = {
        name: _table(node, drawn)
        for name, node in nodes.items()
        if name in ALWAYS or drawn.random() < OFTEN.get(name, TABLES)
    }
    return _on(ROTARY, tables) if tables.get("axis", {}).get("kind") == ROTARY.name else tables


def _on(kind: AxisKind, entry: Any) -> Any:
    """Convert values of examples, which belong to a linear axis, to the units of another."""
    if isinstance(entry, dict):
        return {key: _on(kind, value) for key, value in entry.items()}
    if isinstance(entry, list):
        return [_on(kind, value) for value in entry]
    number, _, unit = entry.partition(" ") if isinstance(entry, str) else ("", "", "")
    return f"{number} {kind.unit(unit)}" if number[:1].isdigit() and unit else entry


def _table(node: Mapping[str, Any], drawn: random.Random) -> dict[str, Any]:
    """Draw a table of one of its kinds: all required keys, and some optional ones."""
    form = drawn.choice(node["anyOf"]) if "anyOf" in node else node
    keys = [key for key in form["properties"] if key in form["required"] or drawn.random() < KEYS]
    return {key: _value(form["properties"][key], drawn) for key in keys}


def _value(node: Mapping[str, Any], drawn: random.Random) -> Any:
    if "enum" in node:
        return drawn.choice(node["enum"])
    if node.get("type") == "boolean":
        return drawn.random() < 0.5
    if node.get("type") == "array" and "examples" not in node:
        return [_table(node["items"], drawn) for _ in range(drawn.randint(0, 2))]
    return drawn.choice(node.get("examples", [STEEL]))
