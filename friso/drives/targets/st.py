"""Structured text (IEC 61131-3): a function block, as text and for TwinCAT, and a test."""

from __future__ import annotations

import re
import uuid
from collections.abc import Mapping
from typing import Any

from friso.drives.languages import Language, functions
from friso.drives.program import OUTPUT, identifier
from friso.drives.target import CodeTarget, Parcel

_WORDS = """abs acos action and any array asin at atan bool by byte case concat configuration constant continue cos
date deg delete dint div do dt dword else elsif end_case end_for end_if end_repeat end_struct end_type
end_var end_while exit exp expt false find for from function function_block if in initial_step insert int
interface jmp left len limit lint ln log lreal lword max method mid min mod mux namespace not of on or
override pointer program property public real reference repeat replace resource ret retain return right rol ror sel
shl shr sin sint sqrt step string struct super tan task then this time to tod transition true trunc type
udint uint ulint until usint using var when while with word wstring xor active dropped enable manual
output command reset finite"""


def _number(value: float) -> str:
    """Write a number as a literal of the type LREAL."""
    mantissa, _, exponent = repr(value).partition("e")
    return mantissa + ("" if "." in mantissa else ".0") + (f"E{int(exponent)}" if exponent else "")


TEXT = Language(
    both="AND",
    either="OR",
    negation="NOT ",
    functions=functions("ABS", "SQRT", "TRUNC", "EXP"),
    if_="IF {} THEN",
    elif_="ELSIF {} THEN",
    else_="ELSE",
    end="END_IF",
    assign="{name} := {value};",
    power="EXPT",
    number=_number,
)


def _tcpou(parcel: Parcel, unit: str, declaration: str, body: str) -> str:
    """Return a program or function block as TwinCAT keeps it: XML with an identifier that follows from the digest."""
    parts = [re.sub(r"\]\]>", "]]]]><![CDATA[>", text) for text in (declaration, body)]  # ]]> would end a section
    own = uuid.uuid5(uuid.NAMESPACE_OID, f"{parcel.digest} {unit}")
    return parcel.rendered("block.TcPOU", unit_name=unit, identity=f"{{{own}}}", declaration=parts[0], body=parts[1])


TEXT_SAMPLES = 400
"""Samples of the test in structured text, which stand in its source. Editors of PLCs slow down beyond thousands."""


def _files(parcel: Parcel) -> Mapping[str, str]:
    """Return function block, vector, and a program that runs its first samples, one a cycle, by name."""
    rows = parcel.vector.table[: TEXT_SAMPLES + 1]
    columns = dict(zip([*parcel.inputs, "expected"], zip(*rows, strict=True), strict=True))
    values: dict[str, Any] = {"samples": len(rows) - 1, "columns": columns, "text": TEXT, "lreal": _number}
    values["named"] = lambda symbol: "Manual" if symbol == str(OUTPUT) else identifier(symbol)
    texts, pous = {}, {}
    for unit, template, end in (
        (f"FB_{parcel.name}", "block", "END_FUNCTION_BLOCK"),
        (f"PRG_{parcel.name}_test", "block_test", "END_PROGRAM"),
    ):
        declaration, body = (parcel.rendered(f"{template}{part}.st", **values) for part in ("_declaration", ""))
        texts[f"{unit}.st"] = f"{declaration}\n{body}{end}\n"
        pous[f"{unit}.TcPOU"] = _tcpou(parcel, unit, declaration, body)
    return {**texts, **pous, f"{parcel.name}_vector.csv": parcel.vector.text()}


TARGET = CodeTarget("structured text", _files, frozenset(_WORDS.split()), ignores_case=True)
