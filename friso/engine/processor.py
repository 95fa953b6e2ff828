"""Describe the processor for which code is compiled."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache

import llvmlite.binding as llvm

PROCESSOR_VARIABLE = "FRISO_PROCESSOR"
"""Environment variable with a lesser processor of the same family to compile for, by its LLVM name: x86-64-v3 has AVX2
but not AVX-512. For `python -m benchmarks.processors`, and for a cache that different machines share."""


@dataclass(frozen=True)
class Processor:
    """A processor as LLVM describes it: the platform's triple, a name, and features.

    Features are those beyond what the name implies ("+avx2,-fma").
    """

    triple: str
    name: str
    features: str = ""

    @property
    def lanes(self) -> int:
        """Return the number of float64 in a register.

        It is 8 with AVX-512, 4 with AVX, 2 with SSE2 and NEON. More lanes are no faster, and take longer to compile
        (docs/platforms.md).
        """
        features = self.features.split(",")
        if "+avx512f" in features or self.name == "x86-64-v4":
            return 8
        return 4 if "+avx" in features or self.name == "x86-64-v3" else 2

    def target_machine(self) -> llvm.TargetMachine:
        """Return LLVM's code generator for the processor.

        Raises RuntimeError for a triple that LLVM does not know.
        """
        target = llvm.Target.from_triple(self.triple)
        return target.create_target_machine(self.name, self.features, opt=3, reloc="pic", codemodel="small")


@cache
def processor() -> Processor:
    """Return this machine's processor, or the lesser one named in the environment."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple = loadable(llvm.get_process_triple())
    if name := os.environ.get(PROCESSOR_VARIABLE):
        return Processor(triple, name)
    return Processor(triple, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


def loadable(triple: str) -> str:
    """Return the target triple whose object files LLVM can load on a platform.

    On Windows it is that of Linux files (ELF), because LLVM misplaces the constants of Windows' own format (COFF).
    Numba does the same.
    """
    return f"{triple}-elf" if "windows" in triple else triple
