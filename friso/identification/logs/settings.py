"""Settings of reading logs."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class LogSettings(Settings):
    """How logs are read, and what makes a signal doubtful."""

    # Length of a log.
    samples_of_a_log: int = setting(50, "")
    """Fewer samples are refused: no interval on anything would be worth its name (our choice)."""

    # What makes a signal doubtful.
    share_of_clipped_samples: float = setting(1e-3, "")
    """Share of samples in flat tops above which a signal is clipped; noise has none."""

    share_of_repeated_values: float = setting(0.01, "")
    """Share of repeated values up to which a signal hardly ever repeats one."""

    ratio_of_a_jump: float = setting(10.0, "")
    """A step so many times the twentieth largest is no motion."""

    number_of_large_steps: int = setting(20, "")
    """The step with which a jump is compared, by rank: fewer may be jumps themselves."""

    slowest_sampling: int = setting(20, "")
    """Times slower than the log that a signal may have been sampled: beyond, it is one of steps."""

    share_of_all_bends: float = setting(0.999, "")
    """Share of its bends that count as all of an interpolated signal: the rest is rounding."""

    # Binary files, read in a process of their own within bounds.
    memory_of_reading: int = setting(1 << 30, "B")
    """Memory that reading may take, besides a multiple of the file: libraries need it to start."""

    memory_per_byte: int = setting(12, "")
    """Memory for each byte of the file: packed files grow."""

    time_of_reading: float = setting(10.0, "s")
    """Time of a processor that reading may take, besides that for the size: libraries start slowly."""

    speed_of_reading: float = setting(5e6, "B/s")
    """Speed of reading, much below that of any sound file."""

    patience_with_a_busy_machine: float = setting(10.0, "")
    """Times as long is waited: a busy machine or a slow disk takes longer."""

    # Delays between two instruments.
    blocks_of_a_delay: int = setting(8, "")
    """Parts of the record whose separate estimates give the interval of a delay."""

    longest_delay_samples: int = setting(20, "")
    """Longest delay looked for: longer ones are no delays of instruments."""

    shortest_delay_samples: float = setting(0.25, "")
    """Shortest delay told: derivatives are smoothed more than what they are compared with."""

    share_left_by_a_delay: float = setting(1 / 3, "")
    """Share of the rest without a delay that one leaves at most: sticking looks late too, and leaves half."""

    samples_of_a_derivative: int = setting(11, "")
    """Samples over which derivatives are smoothed (Savitzky-Golay, no delay of its own)."""

    # MATLAB files.
    columns_of_a_matrix: int = setting(64, "")
    """A matrix with more columns is no set of channels (an image, a response matrix)."""

    # Channels that are alike.
    correlation_of_a_pair: float = setting(0.99, "")
    """Channels that correlate by more may be what was wanted and what was measured of it."""

    samples_of_a_pair: int = setting(20, "")
    """Samples at least to say so."""

    # Channels read by mechanics.
    samples_of_a_reading: int = setting(64, "")
    """Samples of a record, or of a coarser one of its means, from which on it is read: fewer fit any four columns."""

    samples_of_a_scale: float = setting(2.0, "")
    """Width over which each time scale is smoothed before it is differentiated: narrower, noise counts."""

    rows_of_a_scale: int = setting(4000, "")
    """Rows that are fitted of each scale: more change nothing and take time."""

    speed_share_of_a_rest: float = setting(0.03, "")
    """Share of the highest speed below which a body may rest, where friction is not known."""

    share_left_by_a_reading: float = setting(0.5, "")
    """Share of a force that its reading leaves at most: with more, mechanics tells nothing."""

    ratio_of_rival_readings: float = setting(2.0, "")
    """A reading that leaves so many times the share of the best one is none of two that may both be right."""

    range_share_off_a_clock: float = setting(0.01, "")
    """Share of its range by which a clock is off a straight line at most: gaps and jitter are smaller."""

    # Logs joined to one.
    sample_time_tolerance: float = setting(1e-3, "")
    """Share by which the sample times of logs that are joined may differ, as clocks do."""

    # Mappings kept beside logs.
    bytes_of_a_log_name: int = setting(150, "B")
    """Bytes of a log's name in that of its mapping elsewhere: file systems take 255."""

    # Lines above a table.
    characters_of_an_amount: int = setting(100, "")
    """Characters of a value that is looked at: an amount with its unit is shorter."""

    # Files.
    bytes_of_a_log: int = setting(2 << 30, "B")
    """Largest file that is read: all its channels are held in memory at once."""

    # Values.
    largest_value: float = setting(1e30, "")
    """No instrument measures more in any unit; beyond it, squares of squares overflow."""

    # How a text file is written, found in its first lines.
    bytes_of_a_head: int = setting(1 << 18, "B")
    """How much of a file is looked at to find how it is written."""

    lines_of_a_head: int = setting(1000, "")
    """Lines of it that are tried with each delimiter."""

    columns_of_a_table: int = setting(10_000, "")
    """Columns of a table at most: reading that many takes seconds."""

    # One even time base.
    sample_times_of_a_gap: float = setting(1.5, "")
    """A longer step of time is a gap: at least one sample is missing (one missing makes 2)."""

    samples_bridged: int = setting(3, "")
    """Samples lost in a row that are bridged: longer gaps split a record."""

    share_of_gaps: float = setting(0.1, "")
    """More gaps than this share of the samples is no even sampling."""

    scatter_of_even_stamps: float = setting(0.01, "")
    """Stamps that scatter by less than this share of a sample time are even: signals change by 1 % of a step."""

    steps_averaged: int = setting(5, "")
    """Steps in a row whose mean is the usual step: one of coarse stamps is longer or shorter."""

    error_of_a_whole_gap: float = setting(0.25, "")
    """Share of a sample time by which a gap may be off a whole number of samples."""

    deviations_of_a_gap: float = setting(4.0, "")
    """Deviations of the other steps by which a gap may differ from whole sample times."""

    samples_of_a_segment: int = setting(10, "")
    """Segments of fewer samples are left out: no filter settles within."""

    # Units.
    characters_of_a_unit: int = setting(100, "")
    """Characters of a unit at most."""
