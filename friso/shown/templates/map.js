"use strict";
(async () => {
  const data = JSON.parse(await unpacked(document.getElementById("data")));
  const NONE = 255; // no kind: the number counts; no height: the run has ended
  const HIGHEST = 250; // heights from half a range below it to half a range above
  const GREY = "#767676", INK = "#222222";
  const NARROW = 640; // [px]
  const coloured = (part) => themed(part, data.dark);
  const plot = document.getElementById("plot");

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  for (const item of data.variables) {
    item.codes = bytes(item.codes);
    item.numbers = new Float32Array(bytes(item.numbers).buffer);
  }
  for (const item of data.texts) item.codes = new Uint32Array(bytes(item.codes).buffer);
  if (data.lines) {
    data.lines.heights = bytes(data.lines.heights);
    for (const end of ["low", "high"]) data.lines[end] = new Float32Array(bytes(data.lines[end]).buffer);
  }

  // Axes: of a map two, then those with a control; points (samples, or a single axis) stand by themselves.
  const points = data.sampled || data.axes.length === 1;
  const [across, up, ...further] = data.order;
  const sizes = data.indices.map((places) => places.length);
  const at = sizes.map(() => 0); // the slice, and where the selected cell is
  let selected = false;
  let shown = data.variables.find((item) => item.name === data.metric);

  const cellOf = (where) => where.reduce((cell, place, i) => cell * sizes[i] + place, 0);
  const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const labelled = (item) => (item.unit ? `${item.label} [${item.unit}]` : item.label);
  const rounded = (value) => String(Number(value.toPrecision(4)));
  const withUnit = (value, unit) => (unit ? `${rounded(value)} ${unit}` : rounded(value));
  const valueAt = (axis, place) =>
    axis.words.length ? axis.words[axis.values[place]] : withUnit(axis.values[place], axis.unit);

  function element(name, parent, text = "") {
    const made = document.createElement(name);
    made.textContent = text;
    parent.append(made);
    return made;
  }

  // ------------------------------------------------------------------ drawing

  const span = (values) => values.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);

  // Decades; between them 2 and 5, or more, where they are too few; where even these are, about five round numbers.
  function logTicks(values) {
    const [least, most] = span(values);
    const [low, high] = [Math.log10(least), Math.log10(most)];
    if (high - low >= 2) return { dtick: 1 };
    const steps = high - low >= 1 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 7];
    const exponents = Array.from({ length: Math.ceil(high) - Math.floor(low) + 1 }, (_, i) => Math.floor(low) + i);
    let ticks = exponents.flatMap((exponent) => steps.map((step) => step * 10 ** exponent));
    if (most > least && ticks.filter((value) => value >= least && value <= most).length < 2) {
      const unit = 10 ** Math.floor(Math.log10((most - least) / 4));
      const step = unit * ([5, 2].find((size) => size * unit <= (most - least) / 4) ?? 1);
      const first = Math.ceil(least / step);
      ticks = Array.from({ length: Math.floor(most / step) - first + 1 }, (_, i) => (first + i) * step);
    }
    return { tickmode: "array", tickvals: ticks, ticktext: ticks.map((value) => String(Number(value.toPrecision(10)))) };
  }

  function plotAxis(axis) {
    const style = { title: { text: escaped(labelled(axis)), standoff: 8 }, showline: true, linecolor: GREY,
      ticks: "outside", tickcolor: GREY, zeroline: false, showgrid: points, gridcolor: "#e3e3e3",
      type: axis.log ? "log" : "linear", exponentformat: axis.log ? "power" : "none" };
    if (axis.log) Object.assign(style, logTicks(axis.values));
    if (axis.words.length) {
      const every = Math.ceil(axis.words.length / 12);
      const ticks = axis.words.map((_, i) => i).filter((i) => i % every === 0);
      Object.assign(style, { tickmode: "array", tickvals: ticks, ticktext: ticks.map((i) => escaped(axis.words[i])) });
    }
    return style;
  }

  // plotly finds the edges between cell centres itself, but makes a single cell one unit wide
  function cells(axis) {
    const values = axis.values;
    if (values.length > 1) return values;
    const half = Math.abs(values[0]) / 2 || 0.5;
    return axis.log ? [values[0] / 2, values[0] * 2] : [values[0] - half, values[0] + half];
  }

  function scaled(item) {
    const bar = { thickness: 14, outlinewidth: 0, title: { text: escaped(labelled(item)), side: "right" } };
    if (item.ticks.length) Object.assign(bar, { tickmode: "array", tickvals: item.ticks, ticktext: item.texts });
    return { colorscale: item.stops, low: item.low, high: item.high, bar };
  }

  function kindScale(item) {
    const count = item.kinds.length;
    const stops = item.kinds.flatMap((kind, i) => [[i / count, kind.colour], [(i + 1) / count, kind.colour]]);
    return { colorscale: stops, low: -0.5, high: count - 0.5 };
  }

  const drawn = (item, value) => (item.log ? Math.max(Math.log10(value), item.low) : value);

  function mapTraces() {
    const [x, y] = [data.axes[across], data.axes[up]];
    const where = at.slice();
    const grid = (tell) => y.values.map((_, row) => x.values.map((_, column) => {
      where[across] = column;
      where[up] = row;
      return tell(cellOf(where));
    }));
    const counts = (cell) => shown.codes[cell] === NONE;
    const kind = (cell) => (counts(cell) ? "" : escaped(shown.kinds[shown.codes[cell]].label));
    const spots = `${place("x", x)}, ${place("y", y)}`;
    const layer = (scale, z, customdata) => ({ type: "heatmap", x: cells(x), y: cells(y), z, customdata,
      colorscale: scale.colorscale, zmin: scale.low, zmax: scale.high, showscale: Boolean(scale.bar),
      colorbar: scale.bar, hoverongaps: false, hovertemplate: `${spots}: %{customdata}<extra></extra>` });
    const traces = [];
    if (shown.codes.includes(NONE)) {
      traces.push(layer(scaled(shown), grid((cell) => (counts(cell) ? drawn(shown, shown.numbers[cell]) : null)),
        grid((cell) => escaped(withUnit(shown.numbers[cell], shown.unit)))));
    }
    if (shown.kinds.length) {
      traces.push(layer(kindScale(shown), grid((cell) => (counts(cell) ? null : shown.codes[cell])), grid(kind)));
    }
    return traces;
  }

  const place = (name, axis) => (axis.words.length ? `%{${name}}` : `%{${name}:.5~g} ${escaped(axis.unit)}`);

  // Points: samples over their first two keys, or one variable over a single axis; kinds stand under the numbers.
  function pointTraces() {
    const x = data.axes[across].values;
    const numbers = Array.from(shown.numbers);
    const finite = numbers.filter((value, cell) => shown.codes[cell] === NONE);
    const [low, high] = finite.length ? span(finite) : [0, 0];
    const under = shown.log ? low / 2 : low - 0.08 * (high - low || Math.abs(high) || 1);
    const height = (cell) => {
      if (data.sampled) return data.axes[up].values[cell];
      if (!finite.length) return shown.codes[cell];
      return shown.codes[cell] === NONE ? numbers[cell] : under;
    };
    const layer = (members, marker, tell, mode) => ({ type: "scatter", mode, x: members.map((cell) => x[cell]),
      y: members.map(height), customdata: members, text: members.map(tell), marker, showlegend: false,
      line: { color: "#0072B2", width: 1.4 }, hovertemplate: "%{text}<extra></extra>" });
    const spot = (cell) => (data.sampled ? [across, up] : [across])
      .map((number) => escaped(valueAt(data.axes[number], cell))).join(", ");
    const all = numbers.map((_, cell) => cell);
    const traces = [];
    const run = all.filter((cell) => shown.codes[cell] === NONE);
    if (run.length) {
      const scale = scaled(shown);
      const marker = data.sampled
        ? { color: run.map((cell) => drawn(shown, numbers[cell])), colorscale: scale.colorscale, cmin: scale.low,
            cmax: scale.high, showscale: true, colorbar: scale.bar, size: 8, line: { color: GREY, width: 0.6 } }
        : { color: "#0072B2", size: 7 };
      const gaps = data.sampled ? run : all;
      const trace = layer(gaps, marker, (cell) => `${spot(cell)}: ${withUnit(numbers[cell], shown.unit)}`, data.sampled ? "markers" : "lines+markers");
      if (!data.sampled) trace.y = gaps.map((cell) => (shown.codes[cell] === NONE ? numbers[cell] : null));
      traces.push(trace);
    }
    shown.kinds.forEach((kind, code) => {
      const members = all.filter((cell) => shown.codes[cell] === code);
      const marker = { color: kind.colour, symbol: "square", size: 9, line: { color: GREY, width: 1 } };
      if (members.length) traces.push(layer(members, marker, (cell) => `${spot(cell)}: ${escaped(kind.label)}`, "markers"));
    });
    return [traces, height];
  }

  function draw() {
    let traces, height;
    if (points) [traces, height] = pointTraces();
    else traces = mapTraces();
    const layout = { template: "none", margin: { l: 72, r: 14, t: 30, b: 54 }, hovermode: "closest",
      font: { family: "system-ui, sans-serif", size: 12, color: INK }, showlegend: false, hoverlabel: { bgcolor: "#444444", font: { color: "white" } },
      xaxis: plotAxis(data.axes[across]), yaxis: plotAxis(yAxis()), uirevision: "kept" };
    const asDrawn = isPicture();
    if (asDrawn) {
      const narrow = plot.clientWidth < NARROW;
      traces = data.picture.data.slice();
      Object.assign(layout, narrow ? data.picture.narrow : data.picture.layout);
      plot.style.height = `${layout.height}px`;
    } else {
      plot.style.height = "";
      if (isHere()) traces.push(machine(layout));
    }
    if (selected) traces.push(ring(height));
    const config = { displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "",
      modeBarButtons: [["toImage"], ["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]] };
    Plotly.react(plot, coloured(traces), coloured({ ...layout, ...CLEAR }), config);
    drawKey();
  }

  // The map of verdicts that the page is about is shown as in its files.
  const isPicture = () => Boolean(data.picture) && shown.name === data.metric;

  function yAxis() {
    if (data.sampled || !points) return data.axes[up];
    const numbers = shown.codes.includes(NONE);
    return { label: shown.label, unit: shown.unit, log: shown.log && numbers,
      values: Array.from(shown.numbers).filter((value) => value > 0),
      words: numbers ? [] : shown.kinds.map((kind) => kind.label) };
  }

  // The machine that was swept: a point over two axes, a line over one; of further axes, in the slice next to it.
  const isNear = (axis, i) => axis.values.every((value) => Math.abs(axis.values[at[i]] - axis.machine) <= Math.abs(value - axis.machine));
  const shownAxes = points && !data.sampled ? [across] : [across, up];
  const isHere = () => shownAxes.every((i) => data.axes[i].machine !== null)
    && (data.sampled || further.every((i) => data.axes[i].machine === null || isNear(data.axes[i], i)));

  function machine(layout) {
    const [x, y] = shownAxes.map((i) => data.axes[i].machine);
    const line = { color: INK, width: 1.4, dash: "dot" };
    if (y === undefined) layout.shapes = [{ type: "line", x0: x, x1: x, y0: 0, y1: 1, yref: "paper", line }];
    const marker = { symbol: "circle", size: 12, color: INK, line: { color: "white", width: 2 } };
    return { type: "scatter", mode: "markers", x: [x], y: [y ?? null], marker, showlegend: false, hoverinfo: "skip" };
  }

  function ring(height) {
    const cell = data.sampled ? at[0] : cellOf(at);
    const x = data.axes[across].values[data.sampled ? cell : at[across]];
    const y = points ? height(cell) : data.axes[up].values[at[up]];
    const marker = { symbol: "circle", size: 11, color: "white", line: { color: INK, width: 3 } };
    return { type: "scatter", mode: "markers", x: [x], y: [y], marker, hoverinfo: "skip", showlegend: false };
  }

  function drawKey() {
    const key = document.getElementById("key");
    key.replaceChildren();
    if (isPicture()) return;
    shown.kinds.forEach((kind, code) => {
      if (!shown.codes.includes(code)) return;
      const entry = element("li", key);
      const swatch = element("span", entry);
      swatch.className = "swatch";
      swatch.style.background = coloured(kind.colour);
      entry.append(kind.label);
    });
    if (!isHere()) return;
    const entry = element("li", key);
    const mark = element("span", entry);
    mark.className = "swatch machine";
    mark.style.background = coloured(INK);
    entry.append(`${data.machine}: ${shownAxes.map((i) => withUnit(data.axes[i].machine, data.axes[i].unit)).join(", ")}`);
  }

  // ------------------------------------------------------------------ the selected cell

  function describe() {
    const section = document.getElementById("cell");
    section.querySelectorAll(".js-plotly-plot").forEach((old) => Plotly.purge(old));
    section.replaceChildren();
    const cell = data.sampled ? at[0] : cellOf(at);
    const indices = data.indices.map((places, i) => places[at[i]]);
    element("h2", section, data.sampled ? `Sample ${indices[0]}` : `Cell ${indices.join(" ")}`);
    drawRun(section, cell);
    const body = element("tbody", element("table", section));
    const row = (name, text) => {
      const line = element("tr", body);
      element("th", line, name).scope = "row";
      element("td", line, text);
    };
    data.axes.forEach((axis, i) => row(axis.label, valueAt(axis, data.sampled ? cell : at[i])));
    for (const item of data.texts) row(item.label, item.words[item.codes[cell]] || "–");
    for (const item of data.variables) {
      if (data.texts.some((texts) => texts.name === item.name)) continue;
      const value = item.numbers[cell];
      const kind = item.codes[cell] === NONE ? "" : item.kinds[item.codes[cell]].label;
      row(item.label, Number.isFinite(value) ? withUnit(value, item.unit) : kind);
    }
    showRerun(section, data.rerun.split("{indices}").join(indices.join(" ")));
  }

  // The run of a cell over the whole of it, at the scale of what it does at its end.
  function drawRun(section, cell) {
    const lines = data.lines;
    const count = lines ? lines.heights.length / lines.low.length : 0;
    const heights = lines ? lines.heights.subarray(cell * count, (cell + 1) * count) : [];
    if (heights.every((height) => height === NONE)) return;
    const [low, high] = [lines.low[cell], lines.high[cell]];
    const [factor, prefix] = [[1e9, "n"], [1e6, "\u00b5"], [1e3, "m"], [1, ""]].find(([f]) => Math.max(Math.abs(low), Math.abs(high)) * f < 1000) || [1, ""];
    const y = Array.from(heights, (height) => (height === NONE ? null : factor * (low + (2 * height / HIGHEST - 0.5) * (high - low))));
    const x = y.map((_, i) => (lines.duration * (i + 0.5)) / count);
    const style = { showline: true, linecolor: GREY, ticks: "outside", tickcolor: GREY, zerolinecolor: GREY, gridcolor: "#e3e3e3" };
    const layout = { template: "none", margin: { l: 72, r: 14, t: 10, b: 44 }, height: 230, showlegend: false,
      font: { family: "system-ui, sans-serif", size: 12, color: INK },
      xaxis: { ...style, title: { text: "Time [s]", standoff: 6 }, range: [0, lines.duration] },
      yaxis: { ...style, title: { text: `Deviation [${prefix}${lines.unit}]`, standoff: 8 }, range: [factor * low, factor * high] } };
    const line = { type: "scatter", mode: "lines", x, y, line: { color: "#0072B2", width: 1.4 }, hoverinfo: "skip" };
    const picture = element("div", element("figure", section));
    Plotly.newPlot(picture, coloured([line]), coloured({ ...layout, ...CLEAR }), { displayModeBar: false, responsive: true });
    element("p", section, "The deviation of the position from its reference, at the scale of what the run does at its end; the move itself is cut off.").className = "caption";
  }

  function showRerun(section, command) {
    const line = element("p", section);
    line.className = "rerun";
    const code = element("code", line, command);
    const button = element("button", line, "Copy");
    button.type = "button";
    button.addEventListener("click", () => {
      const marked = () => {
        getSelection().selectAllChildren(code);
        button.textContent = document.execCommand("copy") ? "Copied" : "Press Ctrl+C";
      };
      if (!navigator.clipboard) return marked();
      navigator.clipboard.writeText(command).then(() => { button.textContent = "Copied"; }, marked);
    });
  }

  function select() {
    selected = true;
    describe();
    draw();
  }

  function clicked(event) {
    plot.focus({ preventScroll: true }); // so that arrow keys go on from here
    const hit = event.points[0];
    if (points && hit.customdata === undefined) return;
    if (hit.data.type !== "heatmap" && !points) return;
    if (points) at[0] = hit.customdata;
    else [at[up], at[across]] = hit.pointIndex;
    select();
  }

  function moved(event) {
    const steps = { ArrowLeft: [across, -1], ArrowRight: [across, 1], ArrowDown: [up, -1], ArrowUp: [up, 1] };
    const step = steps[event.key];
    if (!step || event.target !== plot) return;
    const axis = points ? 0 : step[0];
    if (selected) at[axis] = Math.min(Math.max(at[axis] + step[1], 0), sizes[axis] - 1);
    event.preventDefault();
    select();
  }

  // ------------------------------------------------------------------ controls

  function choice(controls, title, options, chosen, act) {
    const menu = element("select", element("label", controls, title));
    options.forEach((text, i) => { element("option", menu, text).value = i; });
    menu.value = chosen;
    menu.addEventListener("change", () => act(Number(menu.value)));
  }

  function slider(controls, axis, act) {
    const label = element("label", controls, axis.label);
    const input = element("input", label);
    const valueShown = element("output", label, valueAt(axis, 0));
    Object.assign(input, { type: "range", min: 0, max: axis.values.length - 1, step: 1, value: 0 });
    input.addEventListener("input", () => {
      valueShown.textContent = valueAt(axis, Number(input.value));
      act(Number(input.value));
    });
  }

  function addControls() {
    const controls = document.getElementById("controls");
    const names = data.variables.map((item) => item.label);
    choice(controls, "Shown", names, data.variables.indexOf(shown), (i) => {
      shown = data.variables[i];
      draw();
    });
    for (const number of points ? [] : further) {
      const axis = data.axes[number];
      const act = (place) => {
        at[number] = place;
        if (selected) describe();
        draw();
      };
      if (axis.words.length) choice(controls, axis.label, axis.values.map((_, i) => valueAt(axis, i)), 0, act);
      else slider(controls, axis, act);
    }
  }

  await plotly;
  addControls();
  draw();
  darkness.addEventListener("change", draw);
  window.addEventListener("resize", () => data.picture && draw());
  plot.on("plotly_click", clicked);
  plot.addEventListener("keydown", moved);
})();
