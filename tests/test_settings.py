"""Settings: every tuning number is a field with its unit and reason, other values can be given for a block of code."""

import copy
import pickle
from dataclasses import dataclass

import pytest

from friso.settings import Settings, setting, settings_classes

SHORTEST_REASON = 20
"""Characters of a reason that says anything."""


@dataclass(frozen=True)
class RunSettings(Settings):
    """Settings of a room that is made up."""

    longest_run: float = setting(2.0, "s")
    """Longer runs show nothing new; shorter ones miss the third swing."""


def test_other_values_hold_for_the_block_alone() -> None:
    assert RunSettings.current().longest_run == 2.0
    with RunSettings(longest_run=1.0).in_use(), RunSettings(longest_run=3.0).in_use():
        assert RunSettings.current().longest_run == 3.0
    assert RunSettings.current().longest_run == 2.0


def test_an_object_of_settings_reads_the_values_in_use_and_can_be_copied() -> None:
    live = RunSettings.live()
    for one in (live, copy.deepcopy(live), pickle.loads(pickle.dumps(live))):
        assert one.longest_run == 2.0
        with RunSettings(longest_run=1.0).in_use():
            assert one.longest_run == 1.0


@pytest.mark.parametrize("settings", settings_classes(), ids=lambda settings: settings.__name__)
def test_every_setting_has_a_reason(settings: type[Settings]) -> None:
    rows = settings.rows()
    assert rows
    assert [row.name for row in rows if len(row.reason) < SHORTEST_REASON] == []
    assert [row.name for row in rows if "_" not in row.name] == []
