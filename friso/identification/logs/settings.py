"""Settings of reading logs."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class LogSettings(Settings):
    """Settings of reading logs, and of the checks of their signals."""

    memory_of_reading: int = 1 << 30  # [B]
    """Memory limit of the reading process, besides a multiple of the file's size. Libraries need it to start."""

    time_of_reading: float = 10.0  # [s]
    """Limit on processor time for reading, besides the time for the file's size. Libraries start slowly."""

    patience_with_a_busy_machine: float = 10.0
    """Ratio of the limit on elapsed time to the limit on processor time, for busy machines and slow disks."""

    bytes_unpacked: int = 64 << 20  # [B]
    """Size to which any packed file may unpack."""

    bytes_unpacked_per_byte: int = 300
    """Further bytes that a byte of a packed file may unpack to. Texts of numbers shrink to a hundredth at most."""


settings = LogSettings.live()
