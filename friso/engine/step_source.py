"""Write one Rosenbrock step of a model as code without branches, for one run.

`friso.engine.vector_code` compiles it for several runs at once, one in each lane of a register. Kinks are where
derivatives jump. Modes (on which side of each kink) are held during a step, so that the right-hand side is smooth. A
step that crosses a kink is accepted up to the crossing, which the dense output locates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import sympy as sp

from friso.engine.machine_code import AXES, ROW, SCALARS, Layout
from friso.engine.printing import Constants, Rename, eliminate, print_scalar, reciprocals
from friso.engine.tableaus import Tableau
from friso.equations.component import TICK, TIME
from friso.equations.model import Model

THIRDS_OF_A_STEP = (1 / 3, 2 / 3)
"""Fractions of a step at which kinks (where derivatives jump) are evaluated.

With both ends they fix a cubic.
"""


POINTS = ("near", "third", "far", "last")
"""Names of the values of a kink's surface at the start, the thirds and the end of a step.

At a kink derivatives jump.
"""


UNCHANGED = ("stop", "start", "longest", "next_sample", "record_from", "turns", "last_kind")
"""Rows that the step does not change."""

UNWATCHED = ("old_time", "taken", "deviation_max", "deviation_min", "inner_exit", "outer_exit")
"""Rows that a model with a clock does not use, because its samples are examined instead."""

INSIDE = "good & (entered | turned)"
"""Condition under which the loops around the step must look inside the step of a run."""


class Block:
    """Expressions that are evaluated together, with common subexpressions computed once."""

    def __init__(self, named: Mapping[str, Any], constants: Constants) -> None:
        hoisted = [reciprocals(constants.hoist(sp.sympify(e))) for e in named.values()]
        self._shared, reduced = sp.cse(hoisted, symbols=sp.numbered_symbols("w_"), order="none")
        self._named = dict(zip(named, reduced, strict=True))

    def code(self, suffix: str, rename: Rename) -> list[str]:
        """Write assignments of the expressions to their names, each followed by the suffix."""
        inner = {symbol: f"{symbol}{suffix}" for symbol, _ in self._shared}

        def named(symbol: sp.Symbol) -> str:
            return inner.get(symbol) or rename(symbol)

        lines = [f"{inner[symbol]} = {print_scalar(expr, named)}" for symbol, expr in self._shared]
        return lines + [f"{name}{suffix} = {print_scalar(e, named)}" for name, e in self._named.items()]


KINK_HYSTERESIS = 3e-3  # [of the tolerance]
"""Distance beyond a kink at which it counts as crossed. A run that has crossed a kink is then clear of it, and
rounding noise crosses nothing."""

SURFACE_ROUNDING = 2e-15  # [of the terms of a surface]
"""Least hysteresis: nine units in the last place of the terms. With less, rounding noise crosses kinks."""

STEP_AFTER_KINK = 0.25  # [of the proposed step]
"""Step after a kink, behind which the motion may be much faster."""

NARROW_PEAK_WIDTHS = 3.0  # [widths of the narrow peak about a kink]
"""Distance of a step's start from a kink from which it may pass over the peak, because all of its stages may lie
beyond. Such a step is repeated up to the kink if it crosses the kink and ends beyond the peak, or on this side
again."""

STEP_SAFETY = 0.77
"""Factor on the step that the error estimate would allow. Larger values reject more steps than they save."""

DIVERGED_DEVIATION = 1e6  # [length scales of the motion]
"""Deviation at which a run ends as diverged. A smaller one would end runs that come back."""

LEAST_TURNING_RATE = 1e-6  # [of the velocity's tolerance]
"""Rate below which a deviation turns only by rounding."""


class StepWriter:
    """Writer of the code of one model's step, by one method."""

    def __init__(self, model: Model, tableau: Tableau) -> None:
        self.model, self.tableau = model, tableau
        self.size, self.kinks = len(model.states), len(model.kinks)
        self.constants = Constants(model.parameters)
        self._index = {symbol: i for i, symbol in enumerate(model.symbols)}
        self._position, self._velocity = self._index[model.stage.position], self._index[model.stage.velocity]
        self._fixed_names = [f"given{i}" for i in range(len(model.fixed))]
        self._fixed = dict(zip(model.fixed, self._fixed_names, strict=True))
        self._fixed |= {kink.beyond: f"mode{k}" for k, kink in enumerate(model.kinks)}
        self._jacobian = self._nonzero_jacobian()
        self._drift = {i: d for i, f in enumerate(model.rhs) if (d := sp.diff(f, TIME)) != 0}
        force = model.outputs["force"].expression if "force" in model.outputs else sp.S.Zero
        rates = {f"f{i}_": f for i, f in enumerate(model.rhs)}
        surfaces = {f"g{k}_": kink.surface for k, kink in enumerate(model.kinks)}
        follow = {"deviation": model.deviation, "turning": model.deviation_rate}
        entries = {f"j_{i}_{j}_": e for (i, j), e in self._jacobian.items()}
        drifts = {f"drift{i}_": e for i, e in self._drift.items()}
        sizes = {f"size{k}_": self._size(kink.surface) for k, kink in enumerate(model.kinks)}
        sizes |= {f"terms{k}_": self._rounding(kink.surface) for k, kink in enumerate(model.kinks)}
        sizes |= {f"narrow{k}_": kink.narrow for k, kink in enumerate(model.kinks) if kink.narrow != 0}
        watched: dict[str, Any] = surfaces if model.clock else surfaces | {"force": force}
        start = rates | entries | drifts | surfaces | {"force": force} | sizes
        self._start = Block(start if model.clock else start | follow, self.constants)
        self._rates = Block(rates, self.constants)
        self._watched = Block(watched, self.constants)
        self._followed = Block({"deviation": model.deviation} if model.clock else follow, self.constants)
        self._jumps = [self._jumping(model.jumps.get(kink, {})) for kink in model.kinks]
        free: set[Any] = set().union(*(sp.sympify(e).free_symbols for e in watched.values()))
        self._watched_states = sorted(self._index[s] for s in free & set(self._index))
        self._updates = Block({f"held{i}_": held.update for i, held in enumerate(model.held)}, self.constants)
        clock = {"period_": model.clock.period, "late_": model.clock.late} if model.clock else {}
        self._clock = Block(clock, self.constants)
        self._walks = [*dict.fromkeys(model.clock.places.values()), TICK] if model.clock else []
        sizes_of = (self.size, len(tableau.dense), len(self.constants.index), self.kinks, len(self._fixed_names))
        looked_up = (self.size + len(model.switches), len(model.clock.tabled)) if model.clock else (0, 0)
        self.layout = Layout(*sizes_of, *looked_up, len(self._walks), len(model.inputs))
        self._rows = ROW._asdict() | self.layout.first_rows

    def _jumping(self, jumps: Mapping[sp.Symbol, sp.Expr]) -> tuple[Block, list[int]]:
        """Return a block that computes the jumps of states at a kink, and the states' indices.

        At a kink derivatives jump, or states.
        """
        named = {f"jump{self._index[x]}_": jump for x, jump in jumps.items()}
        return Block(named, self.constants), [self._index[x] for x in jumps]

    def _size(self, surface: sp.Expr) -> sp.Expr:
        """Return the magnitude of a kink's surface while states have their usual magnitudes.

        At a kink derivatives jump; its surface is a function that is 0 there.
        """
        sizes = (sp.Abs(sp.diff(surface, state.symbol)) * state.scale for state in self.model.states)
        return sum(sizes, start=sp.S.Zero)

    def _rounding(self, surface: sp.Expr) -> sp.Expr:
        """Return the magnitude of the terms of a kink's surface, which decides its rounding error.

        At a kink derivatives jump; its surface is a function that is 0 there.
        """
        terms = (sp.Abs(sp.diff(surface, x)) * sp.Abs(x) for x in self.model.symbols)
        return sum(terms, start=sp.S.Zero)

    def _nonzero_jacobian(self) -> dict[tuple[int, int], sp.Expr]:
        entries = {}
        for i, f in enumerate(self.model.rhs):
            for j, x in enumerate(self.model.symbols):
                entry = sp.diff(f, x)
                if entry != 0:
                    entries[i, j] = entry
        return entries

    def _rename(self, states: str, time: str) -> Rename:
        def name(symbol: sp.Symbol) -> str:
            if symbol in self._index:
                return f"{states}{self._index[symbol]}"
            return time if symbol == TIME else self._fixed.get(symbol, str(symbol))

        return name

    @property
    def switches(self) -> tuple[int, ...]:
        """Return the numbers of the kinks, where derivatives jump, that are modes with memory."""
        return tuple(map(self.model.kinks.index, self.model.switches))

    def source(self) -> str:
        """Write the function `step(B, rtol, inner, outer, budget)` for one run.

        The function returns true if something happened in the step that the loops around it must record.
        """
        body = [
            *self._load(),
            *self._choose_step(),
            *self._start.code("_s", self._rename("x", "t")),
            *self._stages(),
            *self._error(),
            *self._dense(),
            *self._crossings(),
            *self._accept(),
            *self._statistics(),
            *self._seen(),
            *self._store(),
            "return event > 0.0",
        ]
        return _function("step", "B, rtol, inner, outer, budget", body)

    @property
    def walked(self) -> list[int]:
        """Return for each table the index of the quantity over which it is looked up."""
        clock = self.model.clock
        return [self._walks.index(x) for x in (*clock.places.values(), *(TICK for _ in clock.times))] if clock else []

    def locate_source(self) -> str:
        """Write the function `locate(B)` for one run; "" for a model without a clock.

        The function sets the flag `left` if the run has left a table cell, and the flag `noted` if a sample is to be
        noted, because the drive has `ticked`. It returns true for either.
        """
        if not self.model.clock:
            return ""
        lines = [*self._clock.code("", self._in_buffer()), *self._offsets(), f"ticked = {self._row('ticked')} > 0.0"]
        outside = (f"(off{w} < 0.0) | (off{w} > 1.0)" for w in range(len(self._walks)))
        lines += [
            f"left = ticked & ({' | '.join(outside)})",
            f"noted = ticked & ({self._row('tick')} * period_ >= {self._row('next_sample')} * (1.0 - 1e-12))",
            f"{self._row('left')} = 1.0 if left else 0.0",
            f"{self._row('noted')} = 1.0 if noted else 0.0",
            "return left | noted",
        ]
        return _function("locate", "B", lines)

    def _offsets(self) -> list[str]:
        """Write how far each quantity is from the beginning of its cell in a table, in cells."""
        lines = []
        for w, x in enumerate(self._walks):
            first, density, last = (self._row("axis", i + (len(AXES) if x == TICK else 0)) for i in range(len(AXES)))
            where = f"{self._row('tick')} * period_" if x == TICK else self._row("x", self._index[x])
            lines.append(f"off{w} = min(max(({where} - {first}) * {density}, 0.0), {last}) - {self._row('cell', w)}")
        return lines

    def update_source(self) -> str:
        """Write the function `update(B)` for one run.

        The function looks up tables and, if the drive has `ticked`, sets the held numbers from the last sample, and the
        time of the next tick. Modes with memory stay as at the beginning of the step.
        """
        clock, name = self.model.clock, self._in_buffer()
        lines = [f"ticked, tick = {self._row('ticked')}, {self._row('tick')}", "instant = 0.0"]
        if clock:
            lines += [*self._clock.code("", name), f"instant = tick * period_ - {self._row('start')}"]
            lines += [*self._piece_of_sample(), *self._offsets()]
        for i, w in enumerate(self.walked):
            lines.append(f"table{i} = {self._row('base', i)} + off{w} * {self._row('slope', i)}")
        lines += self._updates.code("", name)
        held = {number.symbol: f"held{i}_" for i, number in enumerate(self.model.held)}
        held |= {x: f"table{i}" for i, x in enumerate(clock.tabled if clock else ())}
        for symbol, value in held.items():
            row = self._row("reference", self.model.fixed.index(symbol))
            lines.append(f"{row} = {value} if ticked > 0.0 else {row}")
        for k, switch in zip(self.switches, self.model.switches, strict=True):
            lines.append(f"{self._row('reference', self.model.fixed.index(switch.beyond))} = {self._row('mode', k)}")
        lines.append(f"{self._row('tick')} = tick + ticked")
        if clock:
            due = self._row("due")
            lines.append(f"{due} = ((tick + 1.0) * period_ + late_) - {self._row('start')} if ticked > 0.0 else {due}")
        return _function("update", "B", [*lines, f"{self._row('ticked')} = 0.0"])

    def _piece_of_sample(self) -> list[str]:
        """Write the code that finds the piece of the reference in which the sample was taken.

        The piece is the previous one if a corner came in between.
        """
        length, *before = (self._row("piece_before", i) for i in range(1 + len(self.model.inputs)))
        lines = ["earlier = instant < -1e-6 * period_", f"instant = instant + {length} if earlier else instant"]
        now = (self._row("reference", i) for i in range(len(before)))
        return lines + [f"input{i} = {b} if earlier else {n}" for i, (b, n) in enumerate(zip(before, now, strict=True))]

    def _in_buffer(self) -> Rename:
        """Return a function that gives the name in the code of a symbol on which a sample depends.

        Most of these names are places in the buffer.
        """
        clock = self.model.clock
        names = {x: self._row("x", i) for x, i in self._index.items()}
        names |= {x: self._row("reference", i) for i, x in enumerate(self.model.fixed)}
        names |= {x: f"input{i}" for i, x in enumerate(self.model.inputs if clock else ())}
        names |= {c: self._row("constant", i) for c, i in self.constants.index.items()}
        names |= {x: self._row("seen", self._index[state]) for x, state in (clock.seen if clock else {}).items()}
        names |= {x: f"table{i}" for i, x in enumerate(clock.tabled if clock else ())}
        names |= {TICK: self._row("tick"), TIME: "instant"}
        return names.__getitem__

    def _row(self, block: str, i: int = 0) -> str:
        return f"B[{self._rows[block] + i}]"

    def _load(self) -> list[str]:
        """Write the code that loads a run's states, modes and constants from the buffer."""
        named = {
            "x": [f"x{i}" for i in range(self.size)],
            "tolerance": [f"tol{i}" for i in range(self.size)],
            "constant": [str(c) for c in self.constants.index],
            "mode": [f"mode{k}" for k in range(self.kinks)],
            "reference": self._fixed_names,
            "seen": [f"seen{i}" for i in range(self.layout.seen)],
        }
        lines = [f"{name} = {self._row(b, i)}" for b, names in named.items() for i, name in enumerate(names)]
        return lines + [f"{'t' if name == 'time' else name} = {self._row(name)}" for name in (*SCALARS, "due")]

    def _choose_step(self) -> list[str]:
        """Write the choice of the next step, at most to the reference's corner or the next tick.

        The last two steps before that point are made equal.
        """
        return [
            *self._edge(),
            "rest = edge - t",
            "wanted = min(trial, longest)",
            "last = wanted >= rest * 0.999999999",
            "half = 0.5 * rest",
            "h = rest if last else (half if wanted > half else wanted)",
            "per_h = 1.0 / h",
        ]

    def _edge(self) -> list[str]:
        """Write the latest possible end of the step.

        A corner and a tick coincide if they are equal within rounding.
        """
        if not self.model.clock:
            return ["edge = stop"]
        lines = [*self._clock.code("", self._rename("x", "t")), "together = abs(stop - due) < 1e-6 * period_"]
        return [*lines, "edge = stop if together else min(stop, due)"]

    def _stages(self) -> list[str]:
        """Write the stages of the Rosenbrock step: linear solves, and the states in between."""
        method = self.tableau
        lines = [f"diagonal, inverse = {1 / method.gamma!r} * per_h, {method.gamma!r} * h"]
        for i in range(self.size):
            own_term = f" - j_{i}_{i}__s" if (i, i) in self._jacobian else ""
            lines.append(f"A_{i}_{i} = diagonal{own_term}")
        lines += [f"A_{i}_{j} = -j_{i}_{j}__s" for i, j in self._jacobian if i != j]
        diagonals = {i for i, j in self._jacobian if i == j}
        elimination = eliminate(self.size, set(self._jacobian), diagonals, method.stages)
        lines += elimination.code
        for stage in range(method.stages):
            lines += self._stage_rates(stage)
            for i in range(self.size):
                terms = [f"f{i}__{stage}" if stage else f"f{i}__s"]
                if method.rate[stage] and i in self._drift:
                    terms.append(f"{method.rate[stage]!r} * h * drift{i}__s")
                if stage:
                    terms.append(f"per_h * ({self._sum(method.c[stage - 1], i)})")
                lines.append(f"k{stage}_{i} = {' + '.join(terms)}")
            lines += elimination.solve(f"k{stage}_")
        return lines

    def _stage_rates(self, stage: int) -> list[str]:
        """Write the state at a stage of the method, and the right-hand side there."""
        if stage == 0:
            return []
        row, before = self.tableau.a[stage - 1], self.tableau.a[stage - 2] if stage > 1 else ()
        if row[:-1] == before and row[-1] == 1.0:
            lines = [f"y{i} = y{i} + k{stage - 1}_{i}" for i in range(self.size)]
        else:
            lines = [f"y{i} = x{i} + {self._sum(row, i)}" for i in range(self.size)]
        lines.append(f"t{stage} = t + {self.tableau.time[stage]!r} * h")
        return lines + self._rates.code(f"_{stage}", self._rename("y", f"t{stage}"))

    @staticmethod
    def _sum(weights: Iterable[float], i: int) -> str:
        return " + ".join(f"{w!r} * k{j}_{i}" for j, w in enumerate(weights) if w)

    def _error(self) -> list[str]:
        """Write the end of the step, and the mean square of its error over the tolerance."""
        last = self.tableau.stages - 1
        lines = [f"end{i} = y{i} + k{last}_{i}" for i in range(self.size)] + ["square = 0.0"]
        controlled = [i for i, state in enumerate(self.model.states) if state.controlled]
        for i in controlled:
            lines += [
                f"ratio = k{last}_{i} / (tol{i} + rtol * max(abs(x{i}), abs(end{i})))",
                "square = square + ratio * ratio",
            ]
        return [*lines, f"square = square * {1 / len(controlled)!r}"]

    def _dense(self) -> list[str]:
        rows = enumerate(self.tableau.dense)
        return [f"d{m}_{i} = {self._sum(row, i)}" for m, row in rows for i in range(self.size)]

    def _between(self, i: int, theta: str) -> str:
        """Write state `i` at the fraction `theta` of the step."""
        inner = f"d{len(self.tableau.dense) - 1}_{i}"
        for m in range(len(self.tableau.dense) - 2, -1, -1):
            inner = f"d{m}_{i} + {theta} * ({inner})"
        return f"x{i} + {theta} * (end{i} - x{i} + (1.0 - {theta}) * ({inner}))"

    def _crossings(self) -> list[str]:
        """Write the search for the first crossing of a kink (where derivatives jump) in the step.

        The code sets `fraction` to the fraction of the step at which it lies, or 1 if there is none. It sets `astray`
        to true if a run is on the other side of a kink than its mode says.
        """
        clear, rounding = KINK_HYSTERESIS, SURFACE_ROUNDING
        lines = []
        for point, theta in enumerate(THIRDS_OF_A_STEP):
            states = [f"p{point}_{i} = {self._between(i, repr(theta))}" for i in self._watched_states]
            lines += [*states, f"t_p{point} = t + {theta!r} * h"]
            lines += self._watched.code(f"_p{point}", self._rename(f"p{point}_", f"t_p{point}"))
        lines += ["t_e = t + h", *self._watched.code("_e", self._rename("end", "t_e"))]
        lines += ["earliest = 1.0", "astray = False"]
        for k in range(self.kinks):
            points = zip(POINTS, ("s", "p0", "p1", "e"), strict=True)
            lines += [
                f"side{k} = 2.0 * mode{k} - 1.0",
                f"band{k} = {clear!r} * rtol * size{k}__s + {rounding!r} * terms{k}__s",
            ]
            lines += [f"{point}{k} = side{k} * g{k}__{where} + band{k}" for point, where in points]
            lines += [
                f"astray{k} = near{k} < 0.0",
                f"astray = astray | astray{k}",
                f"guess{k} = first_guess({', '.join(f'{point}{k}' for point in POINTS)})",
                f"earliest = min(earliest, guess{k})",
            ]
        if not self.kinks:
            return [*lines, "fraction = 1.0"]
        for point in POINTS:
            lines.append(f"first_{point} = {point}0")
            lines += [
                f"first_{point} = {point}{k} if guess{k} <= earliest else first_{point}" for k in range(1, self.kinks)
            ]
        call = f"crossing({', '.join(f'first_{point}' for point in POINTS)}, earliest)"
        return [*lines, f"fraction = {call}", "fraction = fraction if earliest < 1.0 else 1.0"]

    def _accept(self) -> list[str]:
        """Write acceptance or rejection, new state and modes, and the next step."""
        n = self.size
        lines = [
            "precise = square <= 1.0",
            *self._passed_over(),
            "good = precise & (not (astray | passed_over))",
            "cut = fraction < 1.0",
        ]
        for i in range(n):
            lines.append(f"cut{i} = {self._between(i, 'fraction')}")
            lines.append(f"n{i} = (cut{i} if cut else end{i}) if good else x{i}")
        for k in range(self.kinks):
            lines += [
                f"there{k} = cubic({', '.join(f'{point}{k}' for point in POINTS)}, fraction)",
                f"beyond{k} = (guess{k} <= earliest) | (there{k} < 0.0)",
                f"flip{k} = astray{k} | (good & cut & beyond{k})",
            ]
        lines += [
            "arrived = good & last & ((not cut) | (1.0 - fraction < 1e-9))",
            "t_n = edge if arrived else (t + fraction * h if good else t)",
            *self._jump(),
        ]
        return [
            *lines,
            *self._step_factor(),
            "factor = factor if factor > 0.2 else 0.2",
            "factor = factor if factor < 6.0 else 6.0",
            "factor = min(factor, 1.0) if rejected_last > 0.0 else factor",
            "proposed = h * factor",
            "proposed = min(proposed, 0.5 * h) if astray else proposed",
            "proposed = min(proposed, fraction * h) if passed_over else proposed",
            f"proposed = {STEP_AFTER_KINK!r} * proposed if good & cut else proposed",
            "trial = max(proposed, trial) if good & (factor >= 1.0) else proposed",
        ]

    def _passed_over(self) -> list[str]:
        """Write the test for whether the step may have `passed_over` a narrow peak.

        Such a peak may lie about a kink, where derivatives jump.
        """
        lines = ["passed_over = False"]
        for k, kink in enumerate(self.model.kinks):
            if kink.narrow != 0:
                far = f"(guess{k} <= earliest) & (near{k} > {NARROW_PEAK_WIDTHS!r} * narrow{k}__s)"
                within = f"(last{k} >= -narrow{k}__s) & (last{k} <= 0.0)"
                lines.append(f"passed_over = passed_over | ({far} & (not ({within})))")
        return lines

    def _jump(self) -> list[str]:
        """Write the jumps of states and modes at the kinks just crossed, where derivatives jump.

        Modes with memory change one after the other, because several may change at one instant: the result of the first
        is the input of the second.
        """
        lines: list[str] = []
        flips = [f"mode{k} = 1.0 - mode{k} if flip{k} else mode{k}" for k in range(self.kinks)]
        for k, (block, jumping) in enumerate(self._jumps):
            lines += block.code(f"_k{k}", self._rename("n", "t_n"))
            lines += [f"n{i} = n{i} + jump{i}__k{k} if flip{k} else n{i}" for i in jumping]
            lines += flips[k : k + 1] if self.model.switches else []
        return lines if self.model.switches else lines + flips

    def _step_factor(self) -> list[str]:
        """Write the factor on the step, step_safety / error^(1/order), from the mean square error.

        It uses roots alone: the exponent 3/32 stands for 1/10.
        """
        lines = ["root8 = sqrt(sqrt(sqrt(square + 1e-20)))"]
        if self.tableau.order == 4:
            return [*lines, f"factor = {STEP_SAFETY!r} / root8"]
        return [
            *lines,
            "root16 = sqrt(root8)",
            f"factor = {STEP_SAFETY!r} / (root16 * sqrt(root16))",
        ]

    def _statistics(self) -> list[str]:
        """Write the largest force, and whether something happened that must be recorded."""
        return [
            *self._followed.code("_n", self._rename("n", "t_n")),
            "force_peak = max(force_peak, abs(force_s))",
            *([] if self.model.clock else self._between_samples()),
            "attempted = attempted + 1.0",
            "rejected_last = 0.0 if good else 1.0",
            "rejected = rejected + rejected_last",
            f"happened = good & ({'' if self.model.clock else '(now >= next_sample) | '}(t_n >= stop))",
            f"within = {'False' if self.model.clock else INSIDE}",
            "failed = (attempted >= budget) | ((not good) & (not (trial >= 1e-15)))",
            f"diverged = abs(deviation_n) * rtol > {DIVERGED_DEVIATION!r} * tol{self._position}",
            "event = 2.0 if within else (1.0 if happened | failed else 0.0)",
            "event = 3.0 if diverged else event",
            "fraction = fraction if good else 0.0",
        ]

    def _between_samples(self) -> list[str]:
        """Write the statistics inside a step.

        They are the largest force, the extremes of the deviation, the last exits from the two bands, and turning
        points.
        """
        lines = ["now = start + t_n"]
        for where, theta in zip(("p0", "p1", "e"), (*THIRDS_OF_A_STEP, 1.0), strict=True):
            reached = f"good & (fraction >= {theta!r})"
            lines.append(f"force_peak = max(force_peak, abs(force_{where})) if {reached} else force_peak")
        return [
            *lines,
            "deviation_max = max(deviation_max, deviation_n)",
            "deviation_min = min(deviation_min, deviation_n)",
            "was, off = abs(deviation_s), abs(deviation_n)",
            "inner_exit = now if off > inner else inner_exit",
            "outer_exit = now if off > outer else outer_exit",
            "entered = ((was > inner) & (off <= inner)) | ((was > outer) & (off <= outer))",
            "turned = ((turning_s > 0.0) & (turning_n <= 0.0)) | ((turning_s < 0.0) & (turning_n >= 0.0))",
            f"least = {LEAST_TURNING_RATE!r} * tol{self._velocity}",
            "swing = max(abs(turning_s), abs(turning_n)) > least",
            # other turning points change no result
            "turned = turned & swing & ((now >= record_from) | (off <= outer))",
        ]

    def _seen(self) -> list[str]:
        """Write the code that stores the states and modes at the drive's sample, maybe inside the step."""
        clock = self.model.clock
        if not clock:
            return []
        lines = [
            "ticked = 1.0 if good & ((t_n >= due) | (together & arrived)) else 0.0",
            "part = ((due - late_) - t) * per_h",
            "inside = good & (part >= -1e-9) & ((part <= fraction + 1e-9) | (ticked > 0.0))",
        ]
        at_sample = [self._between(i, "part") for i in range(self.size)]
        at_sample += [self._row("mode", k) for k in self.switches]  # still those of the step's beginning
        lines += [f"seen{i} = {value} if inside else seen{i}" for i, value in enumerate(at_sample)]
        stored = [f"{self._row('seen', i)} = seen{i}" for i in range(self.layout.seen)]
        return [*lines, *stored, f"{self._row('ticked')} = ticked"]

    def _store(self) -> list[str]:
        lines = [] if self.model.clock else self._store_step()
        lines += [f"{self._row('x', i)} = n{i}" for i in range(self.size)]
        lines += [f"{self._row('mode', k)} = mode{k}" for k in range(self.kinks)]
        lines += ["time, old_time, taken = t_n, t, h"]
        unwritten = UNCHANGED + UNWATCHED if self.model.clock else UNCHANGED
        return lines + [f"{self._row(name)} = {name}" for name in SCALARS if name not in unwritten]

    def _store_step(self) -> list[str]:
        """Write the storage of the step's ends and dense output, for interpolation inside it."""
        lines = [f"{self._row('old', i)} = x{i}" for i in range(self.size)]
        lines += [f"{self._row('end', i)} = end{i}" for i in range(self.size)]
        for m in range(len(self.tableau.dense)):
            lines += [f"{self._row('dense', m * self.size + i)} = d{m}_{i}" for i in range(self.size)]
        return lines


def _function(name: str, arguments: str, lines: list[str]) -> str:
    """Return the source of a function for one run, with these argument names and lines.

    Its argument B is the run's column of the buffer.
    """
    body = "".join(f"    {line}\n" for line in lines)
    return f"def {name}({arguments}):\n{body}"
