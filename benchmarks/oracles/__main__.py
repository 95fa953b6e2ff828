"""Ask friso for facts that others have established: `python -m benchmarks.oracles`.

Every oracle states a fact, its source, and the sense in which friso has to agree, and prints both answers. `--only`
asks one oracle. `--table` writes the page [Oracles](oracles.md), and keeps the sections of oracles that were not asked.
`--grow` adds stages to the set with edges by brute force, for some seconds; it continues where it stopped.
"""

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is loaded

from benchmarks.oracles import cycles, dcmotor, drift, independent, servo, switch
from benchmarks.oracles.edges import grow
from benchmarks.oracles.oracle import Finding, NotInstalled
from benchmarks.oracles.page import page, section, sections

ORACLES = {
    oracle.name: oracle for module in (servo, switch, drift, dcmotor, cycles, independent) for oracle in module.ORACLES
}


def main() -> None:
    arguments = _arguments()
    if arguments.grow:
        grow(arguments.grow)
        return
    written = sections(arguments.table) if arguments.table else {}
    for name in arguments.only or ORACLES:
        oracle, findings = ORACLES[name], list[Finding]()
        print(f"{name}: {oracle.fact}", flush=True)
        try:
            for finding in oracle.ask():
                findings.append(finding)
                print(f"  {_word(finding.agrees)}  {finding.what}: {finding.friso} | {finding.oracle}", flush=True)
        except NotInstalled as missing:
            print(f"  skipped: {missing}", flush=True)
            continue
        written[name] = section(oracle, findings)
        if arguments.table:
            arguments.table.parent.mkdir(parents=True, exist_ok=True)
            arguments.table.write_text(page({key: written[key] for key in ORACLES if key in written}))


def _word(agrees: bool | None) -> str:
    return {True: "yes", False: "NO ", None: "-  "}[agrees]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.oracles", description=__doc__)
    parser.add_argument("--only", choices=list(ORACLES), action="append", help="one oracle; may be repeated")
    parser.add_argument("--table", type=Path, help="write the page to this file, in Markdown")
    parser.add_argument("--grow", type=float, metavar="SECONDS", help="add stages with edges by brute force instead")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
