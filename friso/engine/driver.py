"""Run a model's code: load runs, record what happens in them, replace a run as it ends.

A vector register has several lanes, each of which computes one run. The numbers of all lanes are in a buffer, B, from
which the model's step reads and to which it writes. This code is compiled once per machine (`friso.engine.scalar_code`)
for models of any size. Sizes and row numbers of a model are in its `layout`, with the addresses of its step
(`friso.engine.machine_code.Layout`).
"""

from math import pi

import numpy as np

from friso.engine.arrays import STATISTICS, Status
from friso.engine.machine_code import AXES, ROW
from friso.engine.scalar_code import call_at, take_next
from friso.engine.simd_math import sine
from friso.equations.motion import TONE

NOT_RUN, DONE, BUDGET = int(Status.NOT_RUN), int(Status.DONE), int(Status.BUDGET)
UNDERFLOW, DIVERGED = int(Status.UNDERFLOW), int(Status.DIVERGED)
AXIS_ROWS = len(AXES)
TONE_ROWS, TURN = len(TONE), 2 * pi
FOLLOWED = STATISTICS.index("attempted")
"""Number of statistics that the step itself updates, in rows from `force_peak` on."""


def between(B, layout, lane, i, theta):
    """Return state number `i` of the run in a lane, at the fraction `theta` of its last step."""
    inner = 0.0
    for m in range(layout.dense_terms - 1, -1, -1):
        inner = B[(layout.dense + m * layout.states + i) * layout.lanes + lane] + theta * inner
    x, end = B[(layout.old + i) * layout.lanes + lane], B[(layout.end + i) * layout.lanes + lane]
    return x + theta * (end - x + (1.0 - theta) * inner)


def reference_at(B, layout, lane, t, order):
    """Return the reference [m] of the run in a lane, at a time `t` [s] after its last corner.

    With `order` 1, return its velocity [m/s].
    """
    total, k = 0.0, layout.degree
    while k >= order:
        total = total * t / (k - order + 1) + B[(layout.reference + k) * layout.lanes + lane]
        k -= 1
    for number in range(layout.tones):
        row = layout.reference + layout.degree + 2 + TONE_ROWS * number
        amplitude, turns = B[row * layout.lanes + lane], B[(row + 1) * layout.lanes + lane]
        frequency, sweep = B[(row + 2) * layout.lanes + lane], B[(row + 3) * layout.lanes + lane]
        turns += (frequency + 0.5 * sweep * t) * t
        if order == 0:
            total += amplitude * sine(turns)
        else:
            total += amplitude * TURN * (frequency + sweep * t) * sine(turns + 0.25)
    return total


def deviation(B, layout, lane, theta):
    """Return position minus reference [m] of the run in a lane.

    It is taken at the fraction `theta` of the last step.
    """
    t = B[ROW.old_time * layout.lanes + lane] + theta * B[ROW.taken * layout.lanes + lane]
    return between(B, layout, lane, layout.position, theta) - reference_at(B, layout, lane, t, 0)


def deviation_rate(B, layout, lane, theta):
    """Return the rate [m/s] of position minus reference of the run in a lane.

    It is taken at the fraction `theta` of the last step.
    """
    t = B[ROW.old_time * layout.lanes + lane] + theta * B[ROW.taken * layout.lanes + lane]
    return between(B, layout, lane, layout.velocity, theta) - reference_at(B, layout, lane, t, 1)


def find_turn(B, layout, lane, high):
    """Return the fraction of a run's last step, up to `high`, at which the deviation turns.

    Bisection finds it, sped up by the secant (Illinois). The run is the one in `lane`.
    """
    low, f_low, f_high = 0.0, deviation_rate(B, layout, lane, 0.0), deviation_rate(B, layout, lane, high)
    theta, side = high, 0
    for _ in range(30):
        if f_low == f_high:
            break
        theta = (low * f_high - high * f_low) / (f_high - f_low)
        f = deviation_rate(B, layout, lane, theta)
        if f == 0.0 or high - low < 1e-10:
            break
        if (f > 0.0) == (f_high > 0.0):
            high, f_high = theta, f
            f_low, side = (f_low * 0.5 if side == 1 else f_low), 1
        else:
            low, f_low = theta, f
            f_high, side = (f_high * 0.5 if side == -1 else f_high), -1
    return theta


def find_entry(B, layout, lane, high, band):
    """Return the fraction of a run's last step at which the deviation enters a band [m].

    Bisection finds it, up to the fraction `high`. The run is the one in `lane`.
    """
    low = 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if abs(deviation(B, layout, lane, middle)) > band:
            low = middle
        else:
            high = middle
    return high


def moment(B, layout, lane, theta):
    """Return the time since the start of a run [s], at the fraction `theta` of its last step.

    The run is the one in `lane`.
    """
    start = B[ROW.start * layout.lanes + lane] + B[ROW.old_time * layout.lanes + lane]
    return start + theta * B[ROW.taken * layout.lanes + lane]


def note_entry(B, layout, lane, row, fraction, start, end, band):
    """Refine the time at which a run's deviation last entered a band [m], within its last step.

    `row` is where the time is stored. Over the step, up to the `fraction` that counts, the deviation goes from `start`
    to `end` [m]. Nothing changes if it did not enter.
    """
    if abs(start) > band and abs(end) <= band:
        theta = find_entry(B, layout, lane, fraction, band)
        B[row * layout.lanes + lane] = moment(B, layout, lane, theta)


def note_turn(B, layout, lane, fraction, batch, settings, results):
    """Record the turning point of a run's deviation inside its last step, if there is one.

    The turning point counts for the extremes, for the last times outside both bands, and among the points to be stored.
    Only the `fraction` of the step that was accepted counts. The run is the one in `lane`.
    """
    before, after = deviation_rate(B, layout, lane, 0.0), deviation_rate(B, layout, lane, fraction)
    if not ((before > 0.0 and after <= 0.0) or (before < 0.0 and after >= 0.0)):
        return
    kind = 1.0 if before > 0.0 else -1.0
    theta = find_turn(B, layout, lane, fraction)
    value = deviation(B, layout, lane, theta)
    time = moment(B, layout, lane, theta)
    most, lowest = ROW.deviation_max * layout.lanes + lane, ROW.deviation_min * layout.lanes + lane
    B[most], B[lowest] = max(B[most], value), min(B[lowest], value)
    if abs(value) > settings.inner:
        inner = ROW.inner_exit * layout.lanes + lane
        B[inner] = max(B[inner], time)
    if abs(value) > settings.outer:
        outer = ROW.outer_exit * layout.lanes + lane
        B[outer] = max(B[outer], time)
    if time >= B[ROW.record_from * layout.lanes + lane]:
        least = batch.least_swings[int(B[ROW.run * layout.lanes + lane])]
        keep_turn(B, layout, lane, kind, time, value, least, results)


def keep_turn(B, layout, lane, kind, time, value, least, results):
    """Store a run's turning point: a maximum (`kind` 1) or minimum (-1) of a zigzag.

    Legs of the zigzag are at least `least` [m] long. If the point follows another one of its kind, with only smaller
    swings in between, it replaces that one if it goes beyond. Points without room are only counted.
    """
    j, count = int(B[ROW.run * layout.lanes + lane]), int(B[ROW.turns * layout.lanes + lane])
    times, values, last = results.turn_times[j], results.turn_values[j], count - 1
    if count > 0 and B[ROW.last_kind * layout.lanes + lane] == kind:
        if last < times.size and kind * (value - values[last]) > 0.0:
            times[last], values[last] = time, value
        return
    if count > 0 and last < times.size and kind * (value - values[last]) < least:
        return
    if count < times.size:
        times[count], values[count] = time, value
    B[ROW.last_kind * layout.lanes + lane] = kind
    B[ROW.turns * layout.lanes + lane] = count + 1


def write_held(B, layout, lane, row):
    """Write a run's numbers held between samples into `row`, behind the states."""
    for i in range(layout.held):
        row[layout.states + i] = B[(layout.reference + layout.inputs + i) * layout.lanes + lane]


def write_states(B, layout, lane, row):
    """Write a run's present states and the numbers held between samples into `row`."""
    for i in range(layout.states):
        row[i] = B[(layout.x + i) * layout.lanes + lane]
    write_held(B, layout, lane, row)


def note_samples(B, layout, lane, fraction, interval, samples):
    """Write a run's states at the sampling instants inside its last step into `samples`.

    Instants follow one another every `interval` [s], and states are interpolated between the step's ends. `fraction` is
    the part of the step that counts.
    """
    next_sample = ROW.next_sample * layout.lanes + lane
    if B[next_sample] == np.inf:
        return
    start, h = moment(B, layout, lane, 0.0), B[ROW.taken * layout.lanes + lane]
    end = moment(B, layout, lane, fraction)
    last = samples.shape[0] - 1
    k = int(B[next_sample] / interval + 0.5)
    while k <= last and k * interval <= end + 1e-12 * end:
        theta = min((k * interval - start) / h, 1.0)
        for i in range(layout.states):
            samples[k, i] = between(B, layout, lane, i, theta)
        write_held(B, layout, lane, samples[k])
        k += 1
    B[next_sample] = k * interval if k <= last else np.inf


def reference_of(batch, j):
    """Return the row of the reference of run `j`; it is 0 if all runs share one."""
    return min(j, batch.segments.shape[0] - 1)


def enter_segment(B, layout, lane, j, segment, batch):
    """Start the piece of a run's reference with the number `segment`; the last one ends the run.

    Pieces without a duration are passed over. One piece opens the window over which the extremes of the deviation are
    taken.
    """
    segments = batch.segments[reference_of(batch, j)]
    count = segments.shape[0] - 1
    while segment < count and segments[segment + 1, 0] - segments[segment, 0] <= 1e-15 * segments[count, 0]:
        segment += 1
    B[ROW.segment * layout.lanes + lane] = segment
    if segment >= count:
        return
    start, reference = ROW.start * layout.lanes + lane, layout.reference * layout.lanes + lane
    if layout.clocked:
        before = layout.piece_before * layout.lanes + lane
        B[before] = segments[segment, 0] - B[start]
        for i in range(layout.inputs):
            B[before + (1 + i) * layout.lanes] = B[reference + i * layout.lanes]
    B[ROW.due * layout.lanes + lane] += B[start] - segments[segment, 0]
    B[start] = segments[segment, 0]
    B[ROW.stop * layout.lanes + lane] = segments[segment + 1, 0] - segments[segment, 0]
    B[ROW.time * layout.lanes + lane] = 0.0
    for i in range(layout.inputs):
        B[reference + i * layout.lanes] = segments[segment, 1 + i]
    if not layout.clocked:
        B[ROW.ticked * layout.lanes + lane] = 1.0
    if segment == batch.windows[j]:
        away = B[(layout.x + layout.position) * layout.lanes + lane] - reference_at(B, layout, lane, 0.0, 0)
        B[ROW.deviation_max * layout.lanes + lane] = away
        B[ROW.deviation_min * layout.lanes + lane] = away
    else:
        trial = ROW.trial * layout.lanes + lane
        B[trial] = min(B[trial], batch.first_steps[j])


def walk(B, layout, lane, w):
    """Return how far a run is along the axis of some of its tables, in points of the tables.

    `w` numbers the quantities over which tables are looked up: some states, and then time. Before the first point the
    result is 0, and it does not go beyond the last cell.
    """
    timed = w == layout.place_states.size
    axis = (layout.axis + (AXIS_ROWS if timed else 0)) * layout.lanes + lane
    if timed:
        where = B[ROW.tick * layout.lanes + lane] * B[ROW.period * layout.lanes + lane]
    else:
        where = B[(layout.x + layout.place_states[w]) * layout.lanes + lane]
    place = (where - B[axis]) * B[axis + layout.lanes]
    return min(max(place, 0.0), B[axis + 2 * layout.lanes])


def look_up(B, layout, lane, j, tables):
    """Look up tables at the present position and time of run `j`, which is in a lane.

    A cell is the interval between two points of a table. Nothing is looked up anew while the run is in the same cell.
    """
    for w in range(layout.place_states.size + 1):
        place, cell = walk(B, layout, lane, w), (layout.cell + w) * layout.lanes + lane
        if place >= B[cell] and place <= B[cell] + 1.0:
            continue
        axis = layout.axis + (AXIS_ROWS if w == layout.place_states.size else 0)
        point = min(int(place), int(B[(axis + 2) * layout.lanes + lane]) - 1)
        B[cell] = point
        for i in range(layout.walked.size):
            if layout.walked[i] == w:
                base, slope = (layout.base + i) * layout.lanes + lane, (layout.slope + i) * layout.lanes + lane
                B[base] = looked_up(layout, j, i, point, tables)
                B[slope] = looked_up(layout, j, i, point + 1, tables) - B[base]


def looked_up(layout, j, i, point, tables):
    """Return the value of table `i` for run `j` at one of its points.

    Tables are over position or over time, and all runs may share one set.
    """
    if i < layout.places:
        return tables.places[min(j, tables.places.shape[0] - 1), i, point]
    return tables.times[min(j, tables.times.shape[0] - 1), i - layout.places, point]


def note_instant(B, layout, lane, settings, results):
    """Write a run as it was at the instant of its drive's sample.

    The numbers held at that instant follow from earlier samples; the results of this one act later.
    """
    k = int(B[ROW.next_sample * layout.lanes + lane] / settings.interval + 0.5)
    row = results.samples[int(B[ROW.run * layout.lanes + lane])][k]
    write_held(B, layout, lane, row)
    for i in range(layout.states):
        row[i] = B[(layout.seen + i) * layout.lanes + lane]
    for i in range(layout.modes):
        mode = layout.states + layout.held - layout.modes + i
        row[mode] = B[(layout.seen + layout.states + i) * layout.lanes + lane]


def note_results(B, layout, lane, batch, settings, results):
    """Write the numbers that a run's drive has computed from its sample, behind the run at that instant.

    If they act at once, they belong to the run at that instant, too.
    """
    next_sample, samples = ROW.next_sample * layout.lanes + lane, results.samples
    j, k = int(B[ROW.run * layout.lanes + lane]), int(B[next_sample] / settings.interval + 0.5)
    row, first = samples[j][k], layout.states + layout.held
    if batch.clocks[j, 1] == 0.0:
        write_states(B, layout, lane, row)
    for i in range(layout.held):
        row[first + i] = B[(layout.reference + layout.inputs + i) * layout.lanes + lane]
    B[next_sample] = (k + 1) * settings.interval if k + 1 < samples.shape[1] else np.inf


def take_samples(B, layout, batch, settings, results):
    """Let the drives of all runs in the buffer take a sample, where one is due.

    Tables are looked up before. What is to be recorded is written before it and after it: the run at the instant of
    the sample, and what the drive computed from that.
    """
    wanting = call_at(layout.locate, B) if layout.clocked else 0
    if wanting:
        for lane in range(layout.lanes):
            if B[ROW.left * layout.lanes + lane] > 0.0:
                look_up(B, layout, lane, int(B[ROW.run * layout.lanes + lane]), batch.tables)
            if B[ROW.noted * layout.lanes + lane] > 0.0:
                note_instant(B, layout, lane, settings, results)
    call_at(layout.update, B)
    if wanting:
        for lane in range(layout.lanes):
            if B[ROW.noted * layout.lanes + lane] > 0.0:
                note_results(B, layout, lane, batch, settings, results)


def load_run(B, layout, lane, j, batch, settings):
    """Load run `j` into a lane of the buffer, at its start."""
    for row in range(layout.rows):
        B[row * layout.lanes + lane] = 0.0
    B[ROW.run * layout.lanes + lane] = j
    for i in range(layout.constants):
        B[(layout.constant + i) * layout.lanes + lane] = batch.constants[j, i]
    for i in range(layout.states):
        B[(layout.x + i) * layout.lanes + lane] = batch.starts[j, i]
        B[(layout.tolerance + i) * layout.lanes + lane] = batch.tolerances[j, i]
    for i in range(layout.held):
        B[(layout.reference + layout.inputs + i) * layout.lanes + lane] = batch.starts[j, layout.states + i]
    for k in range(layout.kinks):
        B[(layout.mode + k) * layout.lanes + lane] = batch.modes[j, k]
    if layout.clocked:
        start_clock(B, layout, lane, j, batch)
    B[ROW.trial * layout.lanes + lane] = batch.first_steps[j]
    B[ROW.longest * layout.lanes + lane] = batch.longest[j]
    end = batch.segments[reference_of(batch, j), batch.segments.shape[1] - 1, 0]
    asked = batch.windows[j] >= 0
    B[ROW.record_from * layout.lanes + lane] = min(settings.record_from, 0.5 * end) if asked else np.inf
    enter_segment(B, layout, lane, j, 0, batch)


def start_clock(B, layout, lane, j, batch):
    """Let the drive of run `j` take its first sample, with results at once or after the delay."""
    late, tables = batch.clocks[j, 1], batch.tables
    B[ROW.period * layout.lanes + lane] = batch.clocks[j, 0]
    B[ROW.due * layout.lanes + lane] = late
    B[ROW.ticked * layout.lanes + lane] = 1.0 if late == 0.0 else 0.0
    for i in range(layout.states):
        B[(layout.seen + i) * layout.lanes + lane] = batch.starts[j, i]
    for i in range(layout.modes):
        mode = batch.starts[j, layout.states + layout.held - layout.modes + i]
        B[(layout.seen + layout.states + i) * layout.lanes + lane] = mode
    grid = tables.grid[min(j, tables.grid.shape[0] - 1)]
    last_place, last_time, row = tables.places.shape[2] - 1, tables.times.shape[2] - 1, layout.axis
    for number in (grid[0], grid[1], last_place, 0.0, tables.per_second[0], last_time):
        B[row * layout.lanes + lane] = number
        row += 1
    for w in range(layout.place_states.size + 1):
        B[(layout.cell + w) * layout.lanes + lane] = -2.0
    look_up(B, layout, lane, j, tables)
    for i in range(layout.walked.size):
        gap = walk(B, layout, lane, layout.walked[i]) - B[(layout.cell + layout.walked[i]) * layout.lanes + lane]
        value = B[(layout.base + i) * layout.lanes + lane] + gap * B[(layout.slope + i) * layout.lanes + lane]
        B[(layout.reference + layout.tabled + i) * layout.lanes + lane] = value


def start_run(B, layout, lane, j, batch, settings, results):
    """Load run `j` into a lane, and write its first sample."""
    load_run(B, layout, lane, j, batch, settings)
    next_sample = ROW.next_sample * layout.lanes + lane
    B[next_sample] = np.inf
    if results.samples.shape[1] > 0:
        for i in range(layout.states + layout.held):
            results.samples[j, 0, i] = batch.starts[j, i]
        B[next_sample] = 0.0 if layout.clocked else settings.interval


def idle(B, layout, lane):
    """Keep a lane that has no run at rest, while the other lanes go on."""
    B[ROW.run * layout.lanes + lane] = -1.0
    B[ROW.stop * layout.lanes + lane] = np.inf
    B[ROW.record_from * layout.lanes + lane] = np.inf
    B[ROW.next_sample * layout.lanes + lane] = np.inf
    B[ROW.due * layout.lanes + lane] = np.inf
    B[ROW.ticked * layout.lanes + lane] = 0.0
    for i in range(layout.states):
        B[(layout.x + i) * layout.lanes + lane] = 0.0


def answer(B, layout, lane, batch, settings, results):
    """Record the last step of the run in a lane.

    At the end of a piece of the reference, the run goes on to the next.
    """
    fraction, j = B[ROW.fraction * layout.lanes + lane], int(B[ROW.run * layout.lanes + lane])
    if fraction == 0.0:
        return
    at_stop = B[ROW.time * layout.lanes + lane] >= B[ROW.stop * layout.lanes + lane]
    if not layout.clocked:
        if B[ROW.event * layout.lanes + lane] >= 2.0:
            look_inside(B, layout, lane, fraction, batch, settings, results)
        if at_stop or moment(B, layout, lane, fraction) >= B[ROW.next_sample * layout.lanes + lane]:
            note_samples(B, layout, lane, fraction, settings.interval, results.samples[j])
    if at_stop:
        next_segment(B, layout, lane, j, batch)


def next_segment(B, layout, lane, j, batch):
    """Let the run in a lane go to the next piece of its reference.

    If the reference leaves a place at which it stood, the time that the run took to settle there may be stored: the
    longest such time is kept.
    """
    stood, now = stands(B, layout, lane), B[ROW.start * layout.lanes + lane] + B[ROW.time * layout.lanes + lane]
    enter_segment(B, layout, lane, j, int(B[ROW.segment * layout.lanes + lane]) + 1, batch)
    stands_now, since = stands(B, layout, lane), layout.stands_since * layout.lanes + lane
    if stood and not stands_now:
        for band in range(2):
            last = B[(ROW.inner_exit + band) * layout.lanes + lane]
            before = (ROW.inner_before + band) * layout.lanes + lane
            B[before] = max(B[before], last - B[since] if last < now else np.inf)
    if stands_now and not stood:
        B[since] = B[ROW.start * layout.lanes + lane]


def stands(B, layout, lane):
    """Tell whether the reference of the run in a lane stands still at present."""
    for k in range(1, layout.degree + 1):
        if B[(layout.reference + k) * layout.lanes + lane] != 0.0:
            return False
    for number in range(layout.tones):
        if B[(layout.reference + layout.degree + 2 + TONE_ROWS * number) * layout.lanes + lane] != 0.0:
            return False
    return True


def look_inside(B, layout, lane, fraction, batch, settings, results):
    """Record when the run in a lane entered a band, or turned, in its last step.

    Only the `fraction` of the step that was accepted counts.
    """
    start, end = deviation(B, layout, lane, 0.0), deviation(B, layout, lane, fraction)
    note_entry(B, layout, lane, ROW.inner_exit, fraction, start, end, settings.inner)
    note_entry(B, layout, lane, ROW.outer_exit, fraction, start, end, settings.outer)
    note_turn(B, layout, lane, fraction, batch, settings, results)


def outcome(B, layout, lane, batch, settings):
    """Return how the run in a lane has ended (see `Status`), or that it continues."""
    if B[ROW.segment * layout.lanes + lane] >= batch.segments.shape[1] - 1:
        return DONE
    if B[ROW.attempted * layout.lanes + lane] >= settings.budget:
        return BUDGET
    if B[ROW.event * layout.lanes + lane] == 3.0:
        return DIVERGED
    if B[ROW.fraction * layout.lanes + lane] == 0.0:
        return UNDERFLOW
    return NOT_RUN


def hand_over(B, layout, lane, results):
    """Write the statistics and the final states of the run in a lane into the results."""
    j = int(B[ROW.run * layout.lanes + lane])
    results.turn_counts[j] = int(B[ROW.turns * layout.lanes + lane])
    write_states(B, layout, lane, results.ends[j])
    statistics = results.statistics[j]
    for i in range(FOLLOWED):
        followed = B[(ROW.force_peak + i) * layout.lanes + lane]
        statistics[i] = np.nan if i > 0 and layout.clocked else followed
    statistics[FOLLOWED] = B[ROW.attempted * layout.lanes + lane]
    statistics[FOLLOWED + 1] = B[ROW.rejected * layout.lanes + lane]
    statistics[FOLLOWED + 2] = B[ROW.start * layout.lanes + lane] + B[ROW.time * layout.lanes + lane]
    for i in range(2):
        before = B[(ROW.inner_before + i) * layout.lanes + lane]
        statistics[FOLLOWED + 3 + i] = np.nan if layout.clocked else before


def refill(B, layout, lane, queue, batch, settings, results):
    """Begin the next run of the queue in a lane; tell whether there was one."""
    runs = batch.starts.shape[0]
    j = take_next(queue) if settings.cancel[0] == 0 else runs
    if j >= runs:
        return False
    start_run(B, layout, lane, j, batch, settings, results)
    return True


def run(B, layout, queue, batch, settings, results):
    """Compute runs of the queue, several at once, until it is empty; write the results.

    This is one thread's share of a batch.
    """
    busy = 0
    for lane in range(layout.lanes):
        if refill(B, layout, lane, queue, batch, settings, results):
            busy += 1
        else:
            load_run(B, layout, lane, 0, batch, settings)
            idle(B, layout, lane)
    while busy > 0:
        if layout.held > 0:
            take_samples(B, layout, batch, settings, results)
        wanting = call_at(layout.step, B, settings.rtol, settings.inner, settings.outer, settings.budget)
        lane = -1
        while wanting:
            lane += 1
            wanted, wanting = wanting & 1, wanting >> 1
            if not wanted or B[ROW.run * layout.lanes + lane] < 0.0:
                continue
            answer(B, layout, lane, batch, settings, results)
            status = outcome(B, layout, lane, batch, settings)
            if status == NOT_RUN:
                continue
            results.statuses[int(B[ROW.run * layout.lanes + lane])] = status
            hand_over(B, layout, lane, results)
            if not refill(B, layout, lane, queue, batch, settings, results):
                idle(B, layout, lane)
                busy -= 1
