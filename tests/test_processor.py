"""Code for processors and systems other than this one: it can be written, and needs nothing that is not there."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import llvmlite.binding as llvm
import pytest
from llvmlite import ir
from variants import VARIANTS

import friso
from friso.engine import driver, scalar_code, vector_code
from friso.engine.kernel import driver_kinds, kernel
from friso.engine.machine_code import FUNCTIONS, PROCESSOR_VARIABLE, Processor, loadable, optimised, processor
from friso.equations.structure import structure

STICK_SLIP = Path(__file__).parent.parent / "examples" / "lugre_stick_slip.toml"

PLATFORMS = {
    Processor(loadable("x86_64-pc-windows-msvc"), "x86-64-v3"): {"__chkstk"},  # of ntdll, in every process
    Processor("arm64-apple-darwin", "apple-m1"): set(),
    Processor("aarch64-linux-gnu", "cortex-a72"): set(),
}
"""Processors with systems, and what code for these takes from the process that it is loaded into."""


@pytest.mark.slow
@pytest.mark.parametrize("platform", PLATFORMS, ids=lambda platform: platform.triple)
def test_code_for_other_platforms_needs_nothing_else(platform: Processor) -> None:
    """The code needs neither a mathematics library nor a compiler's runtime; LLVM resolves all other symbols itself."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = platform.target_machine()
    module = kernel(structure(VARIANTS["free"].flat()), lanes=platform.lanes).module
    functions = {name: getattr(module, name) for name in FUNCTIONS if hasattr(module, name)}
    loops = scalar_code.scalar_llvm(driver.run, driver_kinds())
    for written in (vector_code.vector_llvm(functions, platform.lanes), loops):
        assert missing_symbols(machine, written) <= PLATFORMS[platform]


def missing_symbols(machine: llvm.TargetMachine, module: ir.Module) -> set[str]:
    """Return the undefined symbols of a module's object file, in ELF or Mach-O format."""
    code = machine.emit_object(optimised(module, machine))
    return _elf(code) if code.startswith(b"\x7fELF") else _mach_o(code)


def _elf(code: bytes) -> set[str]:
    first, size, count = (struct.unpack_from("<Q", code, 40)[0], *struct.unpack_from("<HH", code, 58))
    sections = [struct.unpack_from("<IIQQQQIIQQ", code, first + k * size) for k in range(count)]
    missing = set()
    for section in (section for section in sections if section[1] == 2):  # tables of symbols
        names = sections[section[6]][4]
        for place in range(section[4] + 24, section[4] + section[5], 24):
            name, _, _, where = struct.unpack_from("<IBBH", code, place)
            if where == 0:
                missing.add(_text(code, names + name))
    return missing


def _mach_o(code: bytes) -> set[str]:
    magic, *_, count, _, _, _ = struct.unpack_from("<IiiIIIII", code)
    assert magic == 0xFEEDFACF
    missing, place = set(), 32
    for _ in range(count):
        kind, size = struct.unpack_from("<II", code, place)
        if kind == 2:  # table of symbols
            symbols, number, names, _ = struct.unpack_from("<IIII", code, place + 8)
            for k in range(number):
                name, type_, _, _, _ = struct.unpack_from("<IBBHQ", code, symbols + 16 * k)
                if type_ & 0x0E == 0:
                    missing.add(_text(code, names + name))
        place += size
    return missing


def _text(code: bytes, place: int) -> str:
    return code[place : code.index(b"\0", place)].decode("ascii")


def test_undefined_symbols_are_seen() -> None:
    module = ir.Module()
    kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()])
    sine, code = ir.Function(module, kind, "sin"), ir.Function(module, kind, "f")
    builder = ir.IRBuilder(code.append_basic_block())
    builder.ret(builder.call(sine, code.args))
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    assert missing_symbols(Processor("aarch64-linux-gnu", "cortex-a72").target_machine(), module) == {"sin"}
    assert missing_symbols(Processor("arm64-apple-darwin", "apple-m1").target_machine(), module) == {"_sin"}


def test_lanes_fill_a_register() -> None:
    assert [Processor("", name).lanes for name in ("x86-64-v4", "x86-64-v3", "x86-64", "apple-m1")] == [8, 4, 2, 2]
    assert Processor("", "znver4", "+avx,+avx512f").lanes == 8
    assert Processor("", "haswell", "+avx,-avx512f").lanes == 4


@pytest.mark.slow
@pytest.mark.skipif("x86_64" not in processor().triple, reason="names processors of this family")
def test_a_lesser_processor_comes_to_the_same_result(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "friso", "simulate", str(STICK_SLIP), "--json"]
    environ = {**os.environ, PROCESSOR_VARIABLE: "x86-64"}
    done = subprocess.run(command, env=environ, cwd=tmp_path, capture_output=True, text=True, check=True)
    one, other = friso.simulate(STICK_SLIP).to_dict(), json.loads(done.stdout)
    assert one["outcome"] == other["outcome"]
    assert one["peak_to_peak_m"] == pytest.approx(other["peak_to_peak_m"], rel=1e-3)
