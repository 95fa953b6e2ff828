"""Test what a page of `friso app` sends: other types, damaged, or out of range.

Each question must be answered, or refused in one clear message. Nothing is computed.
"""

import json
import random
from pathlib import Path
from typing import Any

from benchmarks.trust.arguments import TEXTS, Computed, assert_clear, nothing_computed
from benchmarks.trust.damage import damaged
from benchmarks.trust.inputs import LEAVES, RIG, ready
from friso.app.machine import Uploads
from friso.app.questions import COMMANDS, QUESTIONS, PageRequest, report
from friso.app.work import Work, frame
from friso.errors import InputError

AXES = {"x": "controller.crossover=2 Hz..16 Hz", "y": "joint.stroke=0.1 mm..1 mm"}
LOGS = {"files": ["1/log.csv"], "map": {"position": "position"}, "unit": {}, "scale": {}, "dt": "1 ms"}
OPTIONS: dict[str, dict[str, Any]] = {
    "map": {**AXES, "metric": "outcome"},
    "boundary": AXES,
    "tune": {"within": "2 um", "settle": "5 s", "force_limit": "20 N", "only": "controller", "keep": ""},
    "logs": LOGS,
    "identify": {**LOGS, "assumed": True},
    "map.zip": AXES,
    "boundary.zip": AXES,
}
"""Valid options of the questions that take any."""

CHANGES = {"controller.crossover": "9 Hz", "joint.locked": True, "masses.stage": None}

VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1.5, 10**400, float("nan"), float("inf"), [], [None], ["x"], {}, {"": ""}, {"x": [1]}),
    *("1/../log.csv", "/etc/passwd", "\ud800", "a\0b"),
)
"""Values of other types, and names of other files."""


def questions(rng: random.Random, folder: Path) -> None:
    """Replace one or two parts of what a page sends."""
    name = rng.choice([*QUESTIONS, *(f"{name}.zip" for name in COMMANDS)])
    stage = Path(LEAVES if name.startswith("flexure") else RIG)
    machine = {"name": stage.name, "text": stage.read_text("utf-8"), "changes": dict(CHANGES)}
    data: dict[str, Any] = {"machine": machine, "options": dict(OPTIONS.get(name, {})), "narrow": rng.random() < 0.5}
    if rng.random() < 0.3:
        data["pinned"] = {**machine, "changes": {}}
    for _ in range(rng.choice((1, 1, 2))):
        _replace(data, rng)
    sent = json.loads(json.dumps(data))
    uploads = Uploads()
    uploads.files["1/log.csv"] = folder / "log.csv"
    command = name.removesuffix(".zip")
    job = QUESTIONS[name] if command == name else (lambda asked, work: report(command, asked, work))
    what = f"{name}: {json.dumps(sent)[:300]}"
    with ready(folder), nothing_computed():
        try:
            for part in job(PageRequest.of(sent, uploads), Work(lambda _: None)):
                frame(part)
        except InputError as error:
            assert_clear(what, str(error))
        except Computed:
            pass
        except Exception as error:
            raise AssertionError(f"{what}: {type(error).__name__}: {str(error)[:200]}") from error
        finally:
            uploads.remove()


def _replace(data: dict[str, Any], rng: random.Random) -> None:
    """Replace an entry at some place of nested tables, or damage a text there."""
    table = data
    while True:
        key = rng.choice([*table, rng.choice(TEXTS)]) if table else rng.choice(TEXTS)
        inner = table.get(key)
        if not (isinstance(inner, dict) and rng.random() < 0.8):
            break
        table = inner
    if isinstance(inner, str) and rng.random() < 0.5:
        table[key] = damaged(inner.encode(), rng).decode("utf-8", "replace")
    else:
        table[key] = rng.choice((*VALUES, *TEXTS))
