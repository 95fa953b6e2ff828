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

    # Checks that make a signal doubtful.
    share_of_clipped_samples: float = setting(1e-3, "")
    """Fraction of samples in flat tops above which a signal counts as clipped. Noise has no flat tops."""

    share_of_repeated_values: float = setting(0.01, "")
    """Fraction of repeated values up to which a signal hardly ever repeats a value."""

    ratio_of_a_jump: float = setting(10.0, "")
    """Ratio of a step to the twentieth largest above which it is a jump, not motion."""

    number_of_large_steps: int = setting(20, "")
    """Rank, by size, of the step with which a jump is compared. Larger steps may be jumps themselves."""

    slowest_sampling: int = setting(20, "")
    """Largest number of samples for which a slower signal is held. Beyond it the signal consists of steps."""

    share_of_all_bends: float = setting(0.999, "")
    """Fraction of a signal's bends that must fall on a grid for it to count as interpolated. The rest is rounding."""

    # Binary files, read in a process of their own within bounds.
    memory_of_reading: int = setting(1 << 30, "B")
    """Memory limit of the reading process, besides a multiple of the file's size. Libraries need it to start."""

    memory_per_byte: int = setting(12, "")
    """Memory limit per byte of the file, because compressed files grow."""

    time_of_reading: float = setting(10.0, "s")
    """Limit on processor time for reading, besides the time for the file's size. Libraries start slowly."""

    speed_of_reading: float = setting(5e6, "B/s")
    """Reading speed from which the time limit follows. Sound files are read much faster."""

    patience_with_a_busy_machine: float = setting(10.0, "")
    """Ratio of the limit on elapsed time to the limit on processor time, for busy machines and slow disks."""

    # Delays between two instruments.
    blocks_of_a_delay: int = setting(8, "")
    """Number of parts of a record whose separate estimates give the interval of a delay."""

    samples_of_a_block: int = setting(16384, "")
    """Largest number of samples of a part of a record for its delay. Longer ones take seconds and change nothing."""

    longest_delay_samples: int = setting(20, "")
    """Longest delay that is searched, in samples. Longer delays do not come from instruments."""

    shortest_delay_samples: float = setting(0.25, "")
    """Shortest delay that is reported, in samples. Smoothing of derivatives hides shorter delays."""

    share_left_by_a_delay: float = setting(1 / 3, "")
    """Largest ratio of the residuals with and without a delay. Sticking looks like a delay too, but leaves half."""

    samples_of_a_derivative: int = setting(11, "")
    """Number of samples over which derivatives are smoothed (Savitzky-Golay, without delay)."""

    # MATLAB files.
    columns_of_a_matrix: int = setting(64, "")
    """Largest number of columns of a matrix that is read as channels. Larger ones are images or response matrices."""

    largest_travel_in_whole_units: float = setting(1000.0, "")
    """Largest travel of whole numbers without a unit that is no counter. A travel of more is at least in um."""

    share_of_a_stated_step: float = setting(0.01, "")
    """Largest difference of a header's time step from that of its time column, relative to it."""

    # Pairs of commanded and measured channels.
    correlation_of_a_pair: float = setting(0.99, "")
    """Correlation above which two channels may be the commanded and the measured one."""

    samples_of_a_pair: int = setting(20, "")
    """Fewest samples from which the correlation of two channels is judged."""

    # Channels read by mechanics.
    samples_of_a_reading: int = setting(64, "")
    """Fewest samples from which channels are recognised by mechanics (force, acceleration). Fewer fit by chance."""

    pairs_of_a_reading: int = setting(1000, "")
    """Largest number of pairs of a force and a motion that are tried. More take minutes, and one fits by chance."""

    samples_of_a_scale: float = setting(2.0, "")
    """Width of smoothing before differentiation on each time scale, in samples. With less, noise dominates."""

    rows_of_a_scale: int = setting(4000, "")
    """Largest number of rows fitted on each time scale. More change nothing."""

    speed_share_of_a_rest: float = setting(0.03, "")
    """Fraction of the highest speed below which a body may rest, with unknown friction."""

    share_left_by_a_reading: float = setting(0.5, "")
    """Largest fraction of a force that a useful reading by mechanics leaves."""

    ratio_of_rival_readings: float = setting(2.0, "")
    """Ratio of residuals beyond which a reading is no rival of the best one."""

    range_share_off_a_clock: float = setting(0.01, "")
    """Largest deviation of a clock from a straight line, over its range."""

    # Two files of one run, merged by their motion.
    difference_of_clocks: float = setting(5e-3, "")
    """Largest relative difference of two clocks that is searched. Clocks of computers differ by less than 1e-3."""

    share_of_an_overlap: float = setting(0.25, "")
    """Least share of the motion of one of two records that must overlap with the other."""

    samples_of_a_correlation: float = setting(32768.0, "")
    """Number of samples of a record by which it is aligned at first. More change nothing."""

    ratios_of_a_merge: int = setting(100, "")
    """Largest number of ratios of clocks that are tried on either side of 1. More take seconds."""

    places_of_a_merge: int = setting(4, "")
    """Number of places at which an alignment is begun."""

    rows_of_a_merge: int = setting(50_000, "")
    """Largest number of samples from which an alignment is fitted. More change little."""

    steps_of_a_merge: int = setting(30, "")
    """Largest number of steps of Gauss and Newton to an alignment. Most take five."""

    precision_of_a_merge: float = setting(1e-9, "")
    """Change of an alignment, relative to the record, below which it is final."""

    parts_of_a_merge: int = setting(24, "")
    """Number of stretches of a record whose scores give the intervals of an alignment."""

    widths_of_a_merge: tuple[float, ...] = setting((2.0, 8.0, 32.0), "")
    """Widths of smoothing that are tried, in samples of the slower file: noise asks for wide ones."""

    share_of_a_width: float = setting(0.01, "")
    """Largest width of smoothing, relative to the shorter record."""

    share_left_by_a_merge: float = setting(0.5, "")
    """Largest share of a motion (RMS) that an alignment may leave. Noise, and another point of the axis, leave less."""

    share_left_by_rounding: float = setting(1e-3, "")
    """Share of a motion up to which what alignments leave is the rounding of the files."""

    ratio_of_rival_merges: float = setting(2.0, "")
    """Ratio of what two alignments leave up to which both count: then the motion repeats."""

    # Logs joined to one.
    sample_time_tolerance: float = setting(1e-3, "")
    """Largest relative difference between the sample times of joined logs."""

    # Mappings kept beside logs.
    bytes_of_a_log_name: int = setting(150, "B")
    """Longest part of a log's name that is used in its mapping file's name. File systems allow 255 bytes."""

    # Lines above a table.
    characters_of_an_amount: int = setting(100, "")
    """Longest text that is read as an amount with its unit."""

    # Files.
    bytes_of_a_log: int = setting(2 << 30, "B")
    """Largest file that is read, because all its channels are in memory at once."""

    bytes_unpacked: int = setting(64 << 20, "B")
    """Size to which any packed file may unpack."""

    bytes_unpacked_per_byte: int = setting(300, "")
    """Further bytes that a byte of a packed file may unpack to. Texts of numbers shrink to a hundredth at most."""

    # A look at a large file, before it is analysed.
    bytes_of_a_part: int = setting(1 << 19, "B")
    """Size of the beginning, the middle and the end of a text of which a sample is read. Smaller texts are read as a
    whole: that takes a second."""

    samples_of_a_look: int = setting(100_000, "")
    """Number of first samples from which `friso logs` recognises the kind of experiment."""

    # Values.
    largest_value: float = setting(1e30, "")
    """Largest number of an instrument. Beyond it, squares of squares overflow."""

    # Layout of a text file, found in its first lines.
    bytes_of_a_head: int = setting(1 << 18, "B")
    """Size of the beginning of a text file that is examined to find its layout."""

    lines_of_a_head: int = setting(1000, "")
    """Number of first lines of a text file that are tried with each delimiter."""

    rows_of_a_table_begun: int = setting(50, "")
    """Number of rows within which another one has the length of the first row of a table."""

    columns_of_a_table: int = setting(2000, "")
    """Largest number of columns of a table. Asking more for their roles takes ten seconds."""

    share_of_cells_of_other_topics: float = setting(0.25, "")
    """Share of empty cells above which rows belong to several topics with instants of their own. Two topics of equal
    rates leave half of the cells empty."""

    steps_of_a_topic: float = setting(10.0, "")
    """Longest step between samples of a topic in rows of several, in its usual steps. A longer one is a hole."""

    # One even time base.
    sample_times_of_a_gap: float = setting(1.5, "")
    """Smallest time step that is a gap, in sample times. One missing sample makes 2."""

    samples_bridged: int = setting(3, "")
    """Largest number of lost samples in a row that are interpolated. Longer gaps split a record."""

    share_of_gaps: float = setting(0.1, "")
    """Ratio of gaps to samples above which sampling counts as uneven. Gaps between even time stamps
    that are filled do not count."""

    difference_of_a_contradiction: float = setting(0.05, "")
    """Relative difference of a specified sample time from that of the time stamps, above which it is mentioned."""

    scatter_of_even_stamps: float = setting(0.01, "")
    """Scatter of time stamps below which they count as even, relative to the sample time."""

    scatter_of_uneven_stamps: float = setting(0.15, "")
    """RMS deviation of the steps from whole numbers of the usual step, relative to it, above which a log has no even
    clock. Interpolation onto one then loses more than the motion's corners; steps at random have 0.29."""

    shortest_sample_time: float = setting(1e-5, "s")
    """Sample time up to which the unit of the time is doubted. Drives sample at 62.5 us and more slowly."""

    steps_averaged: int = setting(5, "")
    """Number of steps in a row that are averaged for the usual step, because coarse stamps scatter."""

    error_of_a_whole_gap: float = setting(0.25, "")
    """Largest deviation of a gap from a whole number of sample times, relative to the sample time."""

    deviations_of_a_gap: float = setting(4.0, "")
    """Deviation of a gap from whole sample times that scatter explains, in standard deviations of other steps."""

    samples_of_a_segment: int = setting(10, "")
    """Fewest samples of a segment. No filter settles within fewer."""

    # Units.
    characters_of_a_unit: int = setting(100, "")
    """Longest text of a unit."""


settings = LogSettings.live()
