"""Keeps all lanes busy: loads runs, answers the lanes that want attention, refills a lane as its run ends.

This file is the second half of every generated kernel module: its functions are copied there, compiled, with the
names below the line `GENERATED` bound to those of the model at hand. It is never run from here.
"""


# GENERATED: np, LANES, STATES, KINKS, CONSTANTS, INPUTS, HELD, DENSE, ROWS, row numbers such as X, OLD, TIME; CLOCKED,
# and what a clock's tables are looked up over; step, locate, update


def between(B, lane, i, theta):
    """State i of a lane at the fraction theta of the step last tried."""
    inner = 0.0
    for m in range(DENSE - 1, -1, -1):
        inner = B[(D0 + m * STATES + i) * LANES + lane] + theta * inner
    x, end = B[(OLD + i) * LANES + lane], B[(END + i) * LANES + lane]
    return x + theta * (end - x + (1.0 - theta) * inner)


def deviation(B, lane, theta):
    """Position minus reference [m] at the fraction theta of the step last tried."""
    t = B[OLD_TIME * LANES + lane] + theta * B[TAKEN * LANES + lane]
    r, v, a = B[REF * LANES + lane], B[(REF + 1) * LANES + lane], B[(REF + 2) * LANES + lane]
    return between(B, lane, POSITION, theta) - (r + t * (v + 0.5 * a * t))


def deviation_rate(B, lane, theta):
    """Velocity minus that of the reference [m/s] at the fraction theta of the step last tried."""
    t = B[OLD_TIME * LANES + lane] + theta * B[TAKEN * LANES + lane]
    v, a = B[(REF + 1) * LANES + lane], B[(REF + 2) * LANES + lane]
    return between(B, lane, VELOCITY, theta) - (v + a * t)


def find_turn(B, lane, high):
    """The fraction in (0, high) at which the deviation turns: bisection sped up by the secant (Illinois)."""
    low, f_low, f_high = 0.0, deviation_rate(B, lane, 0.0), deviation_rate(B, lane, high)
    theta, side = high, 0
    for _ in range(30):
        if f_low == f_high:
            break
        theta = (low * f_high - high * f_low) / (f_high - f_low)
        f = deviation_rate(B, lane, theta)
        if f == 0.0 or high - low < 1e-10:
            break
        if (f > 0.0) == (f_high > 0.0):
            high, f_high = theta, f
            f_low, side = (f_low * 0.5 if side == 1 else f_low), 1
        else:
            low, f_low = theta, f
            f_high, side = (f_high * 0.5 if side == -1 else f_high), -1
    return theta


def find_entry(B, lane, high, band):
    """The fraction of the step at which the deviation enters the band, by bisection."""
    low = 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if abs(deviation(B, lane, middle)) > band:
            low = middle
        else:
            high = middle
    return high


def note_entry(B, lane, row, fraction, start, end, band):
    """Refine the moment at which the deviation last left the band (row), where it came back between start and end."""
    if abs(start) > band and abs(end) <= band:
        theta = find_entry(B, lane, fraction, band)
        B[row * LANES + lane] = moment(B, lane, theta)


def moment(B, lane, theta):
    """Time since the start of the run [s] at the fraction theta of the step last tried."""
    return B[START * LANES + lane] + B[OLD_TIME * LANES + lane] + theta * B[TAKEN * LANES + lane]


def note_turn(B, lane, fraction, settings, times, values, count):
    """Look at the turning point of the deviation inside the step, if there is one; the new count of those kept."""
    before, after = deviation_rate(B, lane, 0.0), deviation_rate(B, lane, fraction)
    if not ((before > 0.0 and after <= 0.0) or (before < 0.0 and after >= 0.0)):
        return count
    kind = 1.0 if before > 0.0 else -1.0
    theta = find_turn(B, lane, fraction)
    value = deviation(B, lane, theta)
    time = moment(B, lane, theta)
    B[DEVIATION_MAX * LANES + lane] = max(B[DEVIATION_MAX * LANES + lane], value)
    B[DEVIATION_MIN * LANES + lane] = min(B[DEVIATION_MIN * LANES + lane], value)
    if abs(value) > settings.inner:
        B[INNER_EXIT * LANES + lane] = max(B[INNER_EXIT * LANES + lane], time)
    if abs(value) > settings.outer:
        B[OUTER_EXIT * LANES + lane] = max(B[OUTER_EXIT * LANES + lane], time)
    if time < B[RECORD_FROM * LANES + lane]:
        return count
    return keep_turn(B, lane, kind, time, value, settings.least_swing, times, values, count)


def keep_turn(B, lane, kind, time, value, least, times, values, count):
    """Keep a maximum (kind 1) or minimum (-1) of a zigzag whose legs are at least `least`; the new count.

    One that follows another of its kind, smaller swings between them not being kept, replaces it if it goes beyond.
    """
    last = count - 1
    if count > 0 and B[LAST_KIND * LANES + lane] == kind:
        if last < times.size and kind * (value - values[last]) > 0.0:
            times[last], values[last] = time, value
        return count
    if count > 0 and last < times.size and kind * (value - values[last]) < least:
        return count
    if count < times.size:
        times[count], values[count] = time, value
    B[LAST_KIND * LANES + lane] = kind
    return count + 1


def note_samples(B, lane, fraction, interval, samples):
    """Write the states at the sampling instants inside the step, from the dense output."""
    if B[NEXT_SAMPLE * LANES + lane] == np.inf:
        return
    start, h = moment(B, lane, 0.0), B[TAKEN * LANES + lane]
    end = moment(B, lane, fraction)
    last = samples.shape[0] - 1
    k = int(B[NEXT_SAMPLE * LANES + lane] / interval + 0.5)
    while k <= last and k * interval <= end + 1e-12 * end:
        theta = min((k * interval - start) / h, 1.0)
        for i in range(STATES):
            samples[k, i] = between(B, lane, i, theta)
        for i in range(HELD):
            samples[k, STATES + i] = B[(REF + INPUTS + i) * LANES + lane]
        k += 1
    B[NEXT_SAMPLE * LANES + lane] = k * interval if k <= last else np.inf


def enter_segment(B, lane, segments, segment, window, first_step):
    """Start the next segment of the reference that lasts; its number, or the number of segments at the end.

    Segment `window` begins the window over which the extremes of the deviation are taken.
    """
    count = segments.shape[0] - 1
    while segment < count and segments[segment + 1, 0] - segments[segment, 0] <= 1e-15 * segments[count, 0]:
        segment += 1
    if segment >= count:
        return count
    if CLOCKED:
        B[PIECE_BEFORE * LANES + lane] = segments[segment, 0] - B[START * LANES + lane]
        for i in range(INPUTS):
            B[(PIECE_BEFORE + 1 + i) * LANES + lane] = B[(REF + i) * LANES + lane]
    B[DUE * LANES + lane] += B[START * LANES + lane] - segments[segment, 0]
    B[START * LANES + lane] = segments[segment, 0]
    B[STOP * LANES + lane] = segments[segment + 1, 0] - segments[segment, 0]
    B[TIME * LANES + lane] = 0.0
    for i in range(INPUTS):
        B[(REF + i) * LANES + lane] = segments[segment, 1 + i]
    if not CLOCKED:
        B[TICKED * LANES + lane] = 1.0
    if segment == window:
        away = B[(X + POSITION) * LANES + lane] - segments[segment, 1]
        B[DEVIATION_MAX * LANES + lane] = away
        B[DEVIATION_MIN * LANES + lane] = away
    else:
        B[TRIAL * LANES + lane] = min(B[TRIAL * LANES + lane], first_step)
    return segment


def pieces(batch, j):
    """The pieces of the reference of run j; all runs may share those of one."""
    return batch.segments[min(j, batch.segments.shape[0] - 1)]


def walk(B, lane, w):
    """Where a lane is on the way that tables are looked up over, in their points: a state's, or the time's."""
    timed = w == PLACE_STATES.size
    axis = AXIS + (AXIS_ROWS if timed else 0)
    where = B[TICK * LANES + lane] * B[PERIOD * LANES + lane] if timed else B[(X + PLACE_STATES[w]) * LANES + lane]
    place = (where - B[axis * LANES + lane]) * B[(axis + 1) * LANES + lane]
    return min(max(place, 0.0), B[(axis + 2) * LANES + lane])


def look_up(B, lane, j, tables):
    """Look up the cells that a lane has come to, those it has not left excepted."""
    for w in range(PLACE_STATES.size + 1):
        place, cell = walk(B, lane, w), B[(CELL + w) * LANES + lane]
        if place >= cell and place <= cell + 1.0:
            continue
        axis = AXIS + (AXIS_ROWS if w == PLACE_STATES.size else 0)
        point = min(int(place), int(B[(axis + 2) * LANES + lane]) - 1)
        B[(CELL + w) * LANES + lane] = point
        for i in range(TABLES):
            if WALKED[i] == w:
                points = tables.places if i < PLACES else tables.times
                run, table = min(j, points.shape[0] - 1), i if i < PLACES else i - PLACES
                base = points[run, table, point]
                B[(BASE + i) * LANES + lane] = base
                B[(SLOPE + i) * LANES + lane] = points[run, table, point + 1] - base


def note_tick(B, lane, settings, samples):
    """Write states, and what is held from now on, of a sample of the drive's clock."""
    k = int(B[NEXT_SAMPLE * LANES + lane] / settings.interval + 0.5)
    for i in range(STATES):
        samples[k, i] = B[(X + i) * LANES + lane]
    for i in range(HELD):
        samples[k, STATES + i] = B[(REF + INPUTS + i) * LANES + lane]
    B[NEXT_SAMPLE * LANES + lane] = (k + 1) * settings.interval if k + 1 < samples.shape[0] else np.inf


def take_samples(B, who, batch, settings, results):
    """Let the lanes that have arrived at one take their sample."""
    if CLOCKED:
        locate(B)
        for lane in range(LANES):
            if B[LEFT * LANES + lane] > 0.0:
                look_up(B, lane, who[lane], batch.tables)
    update(B)
    if CLOCKED:
        for lane in range(LANES):
            if B[NOTED * LANES + lane] > 0.0:
                note_tick(B, lane, settings, results.samples[who[lane]])


def load_run(B, lane, j, batch, settings):
    """Put run j at its start into a lane; the segment of the reference it starts in."""
    for row in range(ROWS):
        B[row * LANES + lane] = 0.0
    for i in range(CONSTANTS):
        B[(CONSTANT + i) * LANES + lane] = batch.constants[j, i]
    for i in range(STATES):
        B[(X + i) * LANES + lane] = batch.starts[j, i]
        B[(TOLERANCE + i) * LANES + lane] = batch.tolerances[j, i]
    for i in range(HELD):
        B[(REF + INPUTS + i) * LANES + lane] = batch.starts[j, STATES + i]
    for k in range(KINKS):
        B[(MODE + k) * LANES + lane] = batch.modes[j, k]
    if CLOCKED:
        start_clock(B, lane, j, batch)
    B[TRIAL * LANES + lane] = batch.first_steps[j]
    B[LONGEST * LANES + lane] = batch.longest[j]
    B[RECORD_FROM * LANES + lane] = min(settings.record_from, 0.5 * pieces(batch, j)[-1, 0])
    return enter_segment(B, lane, pieces(batch, j), 0, batch.windows[j], batch.first_steps[j])


def start_clock(B, lane, j, batch):
    """The first sample is taken at the start; what follows from it acts at once, or a little later."""
    period, late = batch.clocks[j]
    B[PERIOD * LANES + lane] = period
    B[DUE * LANES + lane] = late
    B[TICKED * LANES + lane] = 1.0 if late == 0.0 else 0.0
    for i in range(SEEN_STATES.size):
        B[(SEEN + i) * LANES + lane] = batch.starts[j, SEEN_STATES[i]]
    tables = batch.tables
    first, density = tables.grid[min(j, tables.grid.shape[0] - 1)]
    axes = (first, density, tables.places.shape[2] - 1.0, 0.0, tables.per_second[0], tables.times.shape[2] - 1.0)
    for i in range(2 * AXIS_ROWS):
        B[(AXIS + i) * LANES + lane] = axes[i]
    for w in range(PLACE_STATES.size + 1):
        B[(CELL + w) * LANES + lane] = -2.0
    look_up(B, lane, j, tables)
    for i in range(TABLES):
        off = walk(B, lane, WALKED[i]) - B[(CELL + WALKED[i]) * LANES + lane]
        B[(REF + TABLED + i) * LANES + lane] = B[(BASE + i) * LANES + lane] + off * B[(SLOPE + i) * LANES + lane]


def start_run(B, lane, j, batch, settings, results):
    """Load run j and write its first sample; the segment it starts in."""
    segment = load_run(B, lane, j, batch, settings)
    B[NEXT_SAMPLE * LANES + lane] = np.inf
    if results.samples.shape[1] > 0:
        for i in range(STATES + HELD):
            results.samples[j, 0, i] = batch.starts[j, i]
        B[NEXT_SAMPLE * LANES + lane] = 0.0 if CLOCKED else settings.interval
    return segment


def aligned_buffer():
    """Room for all rows, on a boundary of 64 bytes: a register that straddles two cache lines takes twice as long."""
    room = np.zeros(ROWS * LANES + 8)
    first = (64 - room.ctypes.data % 64) % 64 // 8
    return room[first : first + ROWS * LANES]


def idle(B, lane):
    """Let a lane without a run stand still beside the others."""
    B[STOP * LANES + lane] = np.inf
    B[RECORD_FROM * LANES + lane] = np.inf
    B[NEXT_SAMPLE * LANES + lane] = np.inf
    B[DUE * LANES + lane] = np.inf
    B[TICKED * LANES + lane] = 0.0
    for i in range(STATES):
        B[(X + i) * LANES + lane] = 0.0


def answer(B, lane, j, segment, batch, settings, results):
    """Record what happened in the lane's last step; the segment of the reference that comes next."""
    fraction = B[FRACTION * LANES + lane]
    if fraction == 0.0:
        return segment
    if not CLOCKED:
        look_inside(B, lane, j, fraction, settings, results)
    at_stop = B[TIME * LANES + lane] >= B[STOP * LANES + lane]
    if not CLOCKED and (at_stop or moment(B, lane, fraction) >= B[NEXT_SAMPLE * LANES + lane]):
        note_samples(B, lane, fraction, settings.interval, results.samples[j])
    if not at_stop:
        return segment
    return enter_segment(B, lane, pieces(batch, j), segment + 1, batch.windows[j], batch.first_steps[j])


def look_inside(B, lane, j, fraction, settings, results):
    """Record entries into the bands and turning points in the lane's last step."""
    start, end = deviation(B, lane, 0.0), deviation(B, lane, fraction)
    note_entry(B, lane, INNER_EXIT, fraction, start, end, settings.inner)
    note_entry(B, lane, OUTER_EXIT, fraction, start, end, settings.outer)
    times, values = results.turn_times[j], results.turn_values[j]
    count = note_turn(B, lane, fraction, settings, times, values, int(B[TURNS * LANES + lane]))
    B[TURNS * LANES + lane] = count


def finish(B, lane, j, segment, batch, settings, results):
    """Hand over what run j has gathered, if it has ended; whether it has."""
    if segment >= batch.segments.shape[1] - 1:
        results.statuses[j] = DONE
    elif B[ATTEMPTED * LANES + lane] >= settings.budget:
        results.statuses[j] = BUDGET
    elif B[EVENT * LANES + lane] == 2.0:
        results.statuses[j] = DIVERGED
    elif B[FRACTION * LANES + lane] == 0.0:
        results.statuses[j] = UNDERFLOW
    else:
        return False
    results.turn_counts[j] = int(B[TURNS * LANES + lane])
    for i in range(STATES):
        results.ends[j, i] = B[(X + i) * LANES + lane]
    for i in range(HELD):
        results.ends[j, STATES + i] = B[(REF + INPUTS + i) * LANES + lane]
    statistics = results.statistics[j]
    for i in range(5):
        statistics[i] = B[(FORCE_PEAK + i) * LANES + lane] if i == 0 or not CLOCKED else np.nan
    statistics[5] = B[ATTEMPTED * LANES + lane]
    statistics[6] = B[REJECTED * LANES + lane]
    statistics[7] = B[START * LANES + lane] + B[TIME * LANES + lane]
    return True


def run(queue, batch, settings, results):
    """Run the runs of the batch that this thread gets from the queue, each in a lane of its own; write the results."""
    B = aligned_buffer()
    last = batch.starts.shape[0]
    who = np.full(LANES, -1)
    segment = np.zeros(LANES, np.int64)
    busy = 0
    for lane in range(LANES):
        j = take_next(queue) if settings.cancel[0] == 0 else last
        if j < last:
            segment[lane] = start_run(B, lane, j, batch, settings, results)
            who[lane], busy = j, busy + 1
        else:
            load_run(B, lane, 0, batch, settings)
            idle(B, lane)
    while busy > 0:
        if HELD > 0:
            take_samples(B, who, batch, settings, results)
        step(B, settings.rtol, settings.inner, settings.outer, settings.budget)
        for lane in range(LANES):
            j = who[lane]
            if B[EVENT * LANES + lane] == 0.0 or j < 0:
                continue
            segment[lane] = answer(B, lane, j, segment[lane], batch, settings, results)
            if not finish(B, lane, j, segment[lane], batch, settings, results):
                continue
            j = take_next(queue) if settings.cancel[0] == 0 else last
            if j < last:
                segment[lane] = start_run(B, lane, j, batch, settings, results)
                who[lane] = j
            else:
                idle(B, lane)
                who[lane], busy = -1, busy - 1
