"""Write the page of oracles: a table of all, and a section for each."""

import re
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path

from benchmarks.code_digest import code_digest
from benchmarks.oracles.oracle import Finding, Oracle
from benchmarks.truth.kept import CHECKED
from benchmarks.truth.tally import markdown

HEADING = "\n## "

WORDS = {True: "yes", False: "**no**", None: "-"}


def page(written: Mapping[str, str]) -> str:
    """Return the page from its sections, by the names of their oracles."""
    rows = [[f"[{name}](#{name})", *_summary(text)] for name, text in written.items()]
    lines = [
        "# Oracles",
        "",
        "Written by `python -m benchmarks.oracles --table docs/evidence/oracles.md`.",
        "",
        "Facts that nobody here made, and what friso answers. Each section states the fact, its source, and the sense "
        "in which friso has to agree; what was changed after a first comparison is said there. A dash "
        "marks what counts for neither: friso leaves it open, or an oracle speaks alone.",
        "",
        *markdown(["oracle", "agrees", "asked on", "code of friso"], rows),
    ]
    return "\n".join(lines) + "\n" + "".join(f"{HEADING}{name}\n\n{text}" for name, text in written.items())


def section(oracle: Oracle, findings: Sequence[Finding]) -> str:
    """Return the section of an oracle."""
    counted = [finding.agrees for finding in findings if finding.agrees is not None]
    rows = [[finding.what, finding.friso, finding.oracle, WORDS[finding.agrees]] for finding in findings]
    lines = [
        oracle.fact,
        "",
        f"- Source: {oracle.source}.",
        f"- Agreement: {oracle.sense}",
        f"- Agrees: {sum(counted)} of {len(counted)}; {date.today().isoformat()}, code `{code_digest(CHECKED)}`.",
        "",
        *markdown(["asked", "friso", "oracle", "agrees"], rows),
    ]
    return "\n".join(lines) + "\n"


def sections(file: Path) -> dict[str, str]:
    """Return the sections of an existing page, by the names of their oracles."""
    parts = file.read_text().split(HEADING)[1:] if file.exists() else []
    return dict(part.split("\n\n", 1) for part in parts)


def _summary(text: str) -> list[str]:
    """Return a summary of a section: how much agrees, the day, and the code."""
    stated = re.search(r"- Agrees: (\d+) of (\d+); (\S+), code (`\w+`)", text)
    assert stated
    share, whole, day, code = stated.groups()
    return [f"{'yes' if share == whole else '**no**'}, {share} of {whole}", day, code]
