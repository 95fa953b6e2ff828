"""Structured text (IEC 61131-3): a function block, as text and for TwinCAT, and a test."""

from __future__ import annotations

import re
import uuid
from collections.abc import Iterable, Mapping

from friso.drives.languages import Language, functions
from friso.drives.program import OUTPUT, identifier
from friso.drives.settings import settings
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


def _comment(lines: Iterable[str]) -> list[str]:
    """Return lines as a comment; what would end it is broken up."""
    return ["(*", *(f"  {line.replace('(*', '( *').replace('*)', '* )')}".rstrip() for line in lines), "*)"]


def _variable(name: str, comment: str = "", value: str = "", kind: str = "LREAL") -> str:
    """Return the declaration of a variable."""
    begin, note = f" := {value}" if value else "", f" (* {comment} *)" if comment else ""
    return f"    {name} : {kind}{begin};{note}"


def _declaration(parcel: Parcel) -> str:
    """Return the interface of the function block, with all its variables."""
    program, keys = parcel.program, {identifier(str(one)): str(one) for one in parcel.program.parameters}
    usage = [
        *parcel.header,
        "",
        f"Call it every {program.period!r} s, in a task of that cycle time. With Enable it controls. The cycle in",
        "which it begins still gives Manual, the output so far, and the next one goes on from there; so does Reset.",
        "Without Enable the output is Manual. Parameters act when it begins. A sample whose results are not finite",
        "changes nothing: the output stays, and Dropped counts it.",
    ]
    steps = [identifier(str(symbol)) for symbol, _ in (*program.prepared, *program.begins, *program.steps)]
    kept = [identifier(str(one)) for one in program.memories]
    return "\n".join(
        [
            *_comment(usage),
            f"FUNCTION_BLOCK FB_{parcel.name}",
            "VAR_INPUT",
            _variable("Enable", kind="BOOL"),
            _variable("Reset", kind="BOOL"),
            _variable("Manual", f"[{parcel.unit}] output without Enable, and from which it begins"),
            *(_variable(one, meaning) for one, meaning in parcel.meanings.items()),
            *(
                _variable(one, f"[{unit}] {keys[one]}", _number(value))
                for one, (value, unit) in parcel.parameters.items()
            ),
            "END_VAR",
            "VAR_OUTPUT",
            _variable("Output", f"[{parcel.unit}]"),
            _variable("Active", kind="BOOL"),
            _variable("Dropped", kind="UDINT"),
            "END_VAR",
            "VAR",
            *(_variable(one) for one in (*kept, *(f"next_{one}" for one in kept), "command", *steps)),
            _variable("finite", kind="BOOL"),
            "END_VAR",
            "",
        ]
    )


def _implementation(parcel: Parcel) -> str:
    """Return the body of the function block."""
    program = parcel.program

    def name(symbol: str) -> str:
        return "Manual" if symbol == str(OUTPUT) else identifier(symbol)

    kept = [identifier(str(one)) for one in program.memories]
    checked = [*(f"next_{one}" for one in kept), "command", *(one for one in parcel.inputs if one in program.read)]
    begin = [
        *TEXT.lines((*program.prepared, *program.begins), name),
        *(f"{one} := {TEXT.expression(value, name)};" for one, value in zip(kept, program.started, strict=True)),
        "Output := Manual;",
        "Active := TRUE;",
    ]
    sample = [
        *TEXT.lines(program.steps, name),
        *(f"next_{one} := {TEXT.expression(value, name)};" for one, value in zip(kept, program.updates, strict=True)),
        f"command := {TEXT.expression(program.command, name)};",
        "finite := TRUE;",
        *(f"finite := finite AND (({one} - {one}) = 0.0);" for one in checked),
        "IF finite THEN",
        *(f"    {one} := next_{one};" for one in kept),
        "    Output := command;",
        "ELSE",
        "    Dropped := Dropped + 1;",
        "END_IF",
    ]
    return "\n".join(
        [
            "IF NOT Enable THEN",
            "    Active := FALSE;",
            "    Output := Manual;",
            "ELSIF Reset OR NOT Active THEN",
            *(f"    {line}" for line in begin),
            "ELSE",
            *(f"    {line}" for line in sample),
            "END_IF",
            "",
        ]
    )


def _test(parcel: Parcel) -> tuple[str, str]:
    """Return declaration and body of a program that runs the first samples of the vector, one a cycle."""
    start, *samples = parcel.vector.table[: settings.text_samples + 1]
    columns = [*parcel.inputs, "expected"]
    arrays = [
        f"    {name}_at : ARRAY[0..{len(samples)}] OF LREAL := [{', '.join(map(_number, values))}];"
        for name, values in zip(columns, zip(start, *samples, strict=True), strict=True)
    ]
    arguments = ", ".join(f"{one} := {one}_at[k]" for one in parcel.inputs)
    declaration = [
        *_comment([*parcel.header, "", "One sample of the test vector a cycle; Passed tells when all are through."]),
        f"PROGRAM PRG_{parcel.name}_test",
        "VAR",
        f"    controller : FB_{parcel.name};",
        _variable("k", kind="DINT"),
        _variable("Worst", f"[{parcel.unit}] largest difference"),
        _variable("Passed", kind="BOOL"),
        *arrays,
        "END_VAR",
        "",
    ]
    body = [
        f"IF k <= {len(samples)} THEN",
        f"    controller(Enable := TRUE, Manual := expected_at[0], {arguments});",
        "    IF ABS(controller.Output - expected_at[k]) > Worst THEN",
        "        Worst := ABS(controller.Output - expected_at[k]);",
        "    END_IF",
        "    k := k + 1;",
        "ELSE",
        f"    Passed := Worst <= {_number(parcel.tolerance)};",
        "END_IF",
        "",
    ]
    return "\n".join(declaration), "\n".join(body)


def _tcpou(name: str, declaration: str, implementation: str, digest: str) -> str:
    """Return a program or function block as TwinCAT keeps it: XML with an identifier that follows from the digest."""
    own = uuid.uuid5(uuid.NAMESPACE_OID, f"{digest} {name}")
    return "\n".join(
        [
            '<?xml version="1.0" encoding="utf-8"?>',
            '<TcPlcObject Version="1.1.0.1" ProductVersion="3.1.4024.0">',
            f'  <POU Name="{name}" Id="{{{own}}}" SpecialFunc="None">',
            f"    <Declaration><![CDATA[{_inside(declaration)}]]></Declaration>",
            "    <Implementation>",
            f"      <ST><![CDATA[{_inside(implementation)}]]></ST>",
            "    </Implementation>",
            "  </POU>",
            "</TcPlcObject>",
            "",
        ]
    )


def _inside(text: str) -> str:
    """Return a text for a CDATA section, with what would end the section split over two."""
    return re.sub(r"\]\]>", "]]]]><![CDATA[>", text)


def _files(parcel: Parcel) -> Mapping[str, str]:
    """Return function block, program of the test, and vector by name."""
    block, program = f"FB_{parcel.name}", f"PRG_{parcel.name}_test"
    units = {
        block: (_declaration(parcel), _implementation(parcel), "END_FUNCTION_BLOCK\n"),
        program: (*_test(parcel), "END_PROGRAM\n"),
    }
    files = {f"{name}.st": "\n".join(parts[:2]) + parts[2] for name, parts in units.items()}
    files |= {f"{name}.TcPOU": _tcpou(name, *parts[:2], parcel.digest) for name, parts in units.items()}
    return files | {f"{parcel.name}_vector.csv": parcel.vector.text()}


TARGET = CodeTarget("structured text", _files, frozenset(_WORDS.split()), ignores_case=True)
