"""The reference pages that are made of what friso declares: the stage file, the specification, the commands.

`python docs/generate.py FOLDER` writes them; `docs/conf.py` does so before the site is built.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

import friso
from friso.cli.app import COMMANDS, command_line
from friso.identification.doubt import DOUBTS
from friso.interface.question import TOPICS

WIDTH = 100
"""Columns of the help of a command."""


def write_reference(folder: Path) -> None:
    """Write all pages into a folder, where their texts have changed."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "stage_file": schema_page("stage"),
        "specification": schema_page("specification"),
        "commands": commands_page(),
        "doubts": doubts_page(),
    }
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def doubts_page() -> str:
    """Every doubt about logs: the effect, what is looked at, what follows, and what would decide it."""
    lines = ["| effect | looked at | consequence | decided by |", "|---|---|---|---|"]
    for name, doubt in DOUBTS.items():
        lines.append(f"| {DOUBTS.one_line(name)} | {doubt.looks_at} | {doubt.consequence} | {doubt.decided_by} |")
    return "\n".join(lines)


def schema_page(of: str) -> str:
    """Every key with what it takes, from the schema."""
    return "\n".join(_table_lines(friso.schema(of), ""))


def _table_lines(node: Mapping[str, Any], place: str) -> Iterator[str]:
    keys = {key: value for key, value in node["properties"].items() if not _is_table(value)}
    tables = {key: value for key, value in node["properties"].items() if _is_table(value)}
    if keys:
        yield from ("| key | what it takes | example |", "|---|---|---|")
        for key, value in keys.items():
            needed = " **Required.**" if key in node.get("required", ()) else ""
            yield f"| `{key}` | {_cell(value.get('description', ''))}{needed} {_words(value)} | {_example(value)} |"
        yield ""
    for key, value in tables.items():
        path = f"{place}.{key}".lstrip(".")
        array = value.get("type") == "array"
        inner = value["items"] if array else value
        yield f"## `{'[[' if array else '['}{path}{']]' if array else ']'}`\n"
        yield f"{_cell(value.get('description') or inner.get('description', ''))}\n"
        for form in inner.get("anyOf", [inner]):
            if "anyOf" in inner:
                yield f"### {_title(form)}\n\n{_cell(form.get('description', ''))}\n"
            yield from _table_lines(form, path)


def _is_table(node: Mapping[str, Any]) -> bool:
    items = node.get("items", {})
    return node.get("type") == "object" or (
        node.get("type") == "array" and ("properties" in items or ("anyOf" in items and items.get("type") == "object"))
    )


def _title(form: Mapping[str, Any]) -> str:
    tag = next((key for key in ("model", "kind") if key in form["properties"]), "")
    word = next(iter(form["properties"].get(tag, {}).get("enum", [])), "")
    own = [key for key in form["properties"] if key != tag][:2]
    return f'`{tag} = "{word}"` ({", ".join(own)}, ...)' if own else f'`{tag} = "{word}"`'


def _words(node: Mapping[str, Any]) -> str:
    return f"One of {', '.join(f'`{word}`' for word in node['enum'])}." if "enum" in node else ""


def _example(node: Mapping[str, Any]) -> str:
    if not node.get("examples"):
        return "`true`" if node.get("type") == "boolean" else ""
    value = node["examples"][0]
    return f"`{value}`" if not isinstance(value, str) else f'`"{value}"`'


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").split())


def commands_page() -> str:
    """The help of every command, by question."""
    os.environ["COLUMNS"] = str(WIDTH)
    group = typer.main.get_command(command_line())
    assert isinstance(group, TyperGroup)
    lines = []
    for topic in TOPICS:
        lines.append(f"## {topic}\n")
        for name in group.commands:
            if COMMANDS[name].topic == topic:
                lines += [f"### friso {name}\n", "```text", _help(group, name), "```\n"]
    return "\n".join(lines)


def _help(group: TyperGroup, name: str) -> str:
    with typer.Context(group, info_name="friso", max_content_width=WIDTH) as above:  # type: ignore[arg-type]
        command = group.commands[name]
        context = command.context_class(command, info_name=name, parent=above, max_content_width=WIDTH)
        return command.get_help(context).strip()


if __name__ == "__main__":
    write_reference(Path(sys.argv[1]))
