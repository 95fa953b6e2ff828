"""Settings of reading logs."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class LogSettings(Settings):
    """Settings of reading logs, and of the checks of their signals."""

    # Length of a log.
    samples_of_a_log: int = setting(50, "")
    """Fewest samples of a log; no interval from fewer would be meaningful (friso's choice)."""

    # What makes a signal doubtful.
    share_of_clipped_samples: float = setting(1e-3, "")
    """Fraction of samples in flat tops above which a signal is clipped. Noise has none."""

    share_of_repeated_values: float = setting(0.01, "")
    """Fraction of repeated values up to which a signal hardly ever repeats a value."""

    ratio_of_a_jump: float = setting(10.0, "")
    """Ratio of a step to the twentieth largest above which it is a jump, not motion."""

    number_of_large_steps: int = setting(20, "")
    """Rank of the step with which a jump is compared. Larger ones may be jumps themselves."""

    slowest_sampling: int = setting(20, "")
    """Largest ratio of sample times of a signal that was held. Beyond it the signal consists of steps."""

    share_of_all_bends: float = setting(0.999, "")
    """Fraction of its bends that must fall on a grid for a signal to be interpolated. The rest is rounding."""

    # Binary files, read in a process of their own within bounds.
    memory_of_reading: int = setting(1 << 30, "B")
    """Memory for reading, besides a multiple of the file. Libraries need it to start."""

    memory_per_byte: int = setting(12, "")
    """Memory for each byte of the file, because compressed files grow."""

    time_of_reading: float = setting(10.0, "s")
    """Processor time for reading, besides that for the size. Libraries start slowly."""

    speed_of_reading: float = setting(5e6, "B/s")
    """Reading speed assumed, much below that of any sound file."""

    patience_with_a_busy_machine: float = setting(10.0, "")
    """Factor on the time limit on a busy machine or a slow disk."""

    # Delays between two instruments.
    blocks_of_a_delay: int = setting(8, "")
    """Parts of the record whose separate estimates give the interval of a delay."""

    longest_delay_samples: int = setting(20, "")
    """Longest delay that is looked for. Longer ones do not come from instruments."""

    shortest_delay_samples: float = setting(0.25, "")
    """Shortest delay that is reported. Smoothing of derivatives hides shorter ones."""

    share_left_by_a_delay: float = setting(1 / 3, "")
    """Largest residual with a delay over that without. Sticking looks like a delay too, but leaves half."""

    samples_of_a_derivative: int = setting(11, "")
    """Samples over which derivatives are smoothed (Savitzky-Golay, without delay)."""

    # MATLAB files.
    columns_of_a_matrix: int = setting(64, "")
    """Most columns of a matrix that is a set of channels, not an image or a response matrix."""

    # Channels that are alike.
    correlation_of_a_pair: float = setting(0.99, "")
    """Correlation above which two channels may be the commanded and the measured one."""

    samples_of_a_pair: int = setting(20, "")
    """Fewest samples of such a pair."""

    # Channels read by mechanics.
    samples_of_a_reading: int = setting(64, "")
    """Fewest samples of a record, or of its means on a coarser scale, to be read by mechanics. Fewer fit any four
    columns."""

    samples_of_a_scale: float = setting(2.0, "")
    """Width of smoothing before differentiation on each time scale. With less, noise dominates."""

    rows_of_a_scale: int = setting(4000, "")
    """Rows that are fitted on each scale. More change nothing."""

    speed_share_of_a_rest: float = setting(0.03, "")
    """Fraction of the highest speed below which a body may rest, with unknown friction."""

    share_left_by_a_reading: float = setting(0.5, "")
    """Largest fraction of a force that a useful reading by mechanics leaves."""

    ratio_of_rival_readings: float = setting(2.0, "")
    """Ratio of residuals beyond which a reading is no rival of the best one."""

    range_share_off_a_clock: float = setting(0.01, "")
    """Largest deviation of a clock from a straight line, over its range."""

    # Logs joined to one.
    sample_time_tolerance: float = setting(1e-3, "")
    """Largest relative difference between the sample times of joined logs."""

    # Mappings kept beside logs.
    bytes_of_a_log_name: int = setting(150, "B")
    """Longest part of a log's name in that of its mapping file. File systems take 255 bytes."""

    # Lines above a table.
    characters_of_an_amount: int = setting(100, "")
    """Longest text that is read as an amount with its unit."""

    # Files.
    bytes_of_a_log: int = setting(2 << 30, "B")
    """Largest file that is read, because all its channels are in memory at once."""

    # Values.
    largest_value: float = setting(1e30, "")
    """Largest number of an instrument. Beyond it, squares of squares overflow."""

    # How a text file is written, found in its first lines.
    bytes_of_a_head: int = setting(1 << 18, "B")
    """Size of the head of a file that is examined to find its layout."""

    lines_of_a_head: int = setting(1000, "")
    """Lines of the head that are tried with each delimiter."""

    columns_of_a_table: int = setting(10_000, "")
    """Most columns of a table. Reading more takes seconds."""

    # One even time base.
    sample_times_of_a_gap: float = setting(1.5, "")
    """Time step, in sample times, above which it is a gap. One missing sample makes 2."""

    samples_bridged: int = setting(3, "")
    """Most lost samples in a row that are interpolated. Longer gaps split a record."""

    share_of_gaps: float = setting(0.1, "")
    """Number of gaps over samples above which sampling is not even."""

    scatter_of_even_stamps: float = setting(0.01, "")
    """Scatter of time stamps, over the sample time, below which they are even."""

    steps_averaged: int = setting(5, "")
    """Steps in a row whose mean is the usual step, because single coarse stamps scatter."""

    error_of_a_whole_gap: float = setting(0.25, "")
    """Largest deviation of a gap from a whole number of samples, over the sample time."""

    deviations_of_a_gap: float = setting(4.0, "")
    """Deviation of a gap from whole sample times, in standard deviations of the other steps."""

    samples_of_a_segment: int = setting(10, "")
    """Fewest samples of a segment. No filter settles within fewer."""

    # Units.
    characters_of_a_unit: int = setting(100, "")
    """Longest text of a unit."""
