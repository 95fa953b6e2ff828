"""One record in many variants is read at once and right, or asks, or is refused: never misread."""

from pathlib import Path

import pytest

from benchmarks.log_variants import ASKS, MISREAD, REFUSED, RIGHT, table

pytestmark = pytest.mark.slow


def test_no_variant_of_a_record_is_misread(tmp_path: Path) -> None:
    rows = {name: (how, remark) for name, how, remark in table(tmp_path)}
    assert len(rows) >= 60
    assert not [name for name, (how, _) in rows.items() if how == MISREAD]
    assert sum(how == RIGHT for how, _ in rows.values()) >= 50
    assert not [name for name, (how, remark) in rows.items() if how in (ASKS, REFUSED) and not remark]
