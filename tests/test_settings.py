"""Settings: other values of a number can be given for a block of code."""

import copy
import pickle
from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class RunSettings(Settings):
    """Settings of a room that is made up."""

    longest_run: float = 2.0  # [s]
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
