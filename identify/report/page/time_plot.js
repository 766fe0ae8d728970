// How do signals look over time? All plots show one range of time and are read off under one cursor.

const kMostDots = 400;     // samples of a recording that are drawn one by one
const kPaperWidth = 700;   // that of a sheet between its margins
const kLeastDrag = 5;      // less is a click

// What a plot draws: a line from y, or from the least to the largest of thinned samples; a band.
function curvesOf(lines, extent, count) {
  const curves = lines.filter(({ line }) => line).map(({ label, kind, line, points }) =>
    ({ label, kind, low: line.hi ? line.lo : line.y, high: line.hi, dots: points && count <= kMostDots }));
  if (extent && extent.low && extent.high) {
    curves.push({ label: extent.label, kind: "band", low: extent.low.y || extent.low.lo, high: extent.high.y || extent.high.hi });
  }
  return curves;
}

function drawCurve(g, times, { kind, low, high, dots }) {
  if (dots) g.dots(times, low, `fill-${kind}`, 2, 1);
  else if (kind === "band") g.envelope(times, low, high, "fill-band");
  else if (high) g.envelope(times, low, high, `fill-${kind} ${kind} hair`);
  else g.path(times, low, `${kind} line`);
}

// What the curves are, and their values under the cursor.
function legendOf(curves) {
  const values = curves.map(() => el("b")), instant = el("b");
  const node = el("div", { class: "key" },
    curves.map(({ kind, dots, label }, k) => el("span", {}, el("i", { class: `k-${kind}${dots ? " k-dots" : ""}` }), label, values[k])),
    el("span", {}, instant));
  const show = (times, i) => {
    instant.textContent = i < 0 ? "" : `at ${num(times[i], 7)} s`;
    curves.forEach(({ low, high }, k) => {
      values[k].textContent = i < 0 ? "" : high && high[i] !== low[i] ? `${num(low[i], 4)} … ${num(high[i], 4)}` : num(low[i]);
    });
  };
  return { node, show };
}

function nearest(times, t) {
  let best = times.length ? 0 : -1;
  for (let i = 1; i < times.length; ++i) if (Math.abs(times[i] - t) < Math.abs(times[best] - t)) best = i;
  return best;
}

// whole: [from, until] of all recordings; shades: spans to be set off; joints: where a recording begins
// behind another. Gives timePlot(), which makes one, and what moves all: zoom(from, until), zoomOut().
function timePlots({ whole, shades, joints }) {
  const plots = [];
  let range = whole, printing = false;
  const drawAll = () => plots.forEach((plot) => plot.draw());
  const readAll = (t) => plots.forEach((plot) => plot.read(t));

  function zoom(from, until) {
    range = [Math.max(whole[0], from), Math.min(whole[1], until)];
    document.documentElement.classList.toggle("zoomed", range[0] > whole[0] || range[1] < whole[1]);
    drawAll();
  }
  const zoomOut = () => zoom(...whole);

  // lines: [{label, kind, line: {y} or {lo, hi}, points}], without a line for what is not there;
  // extent: {label, low, high}, a band between two lines; levels: dashed horizontals; least: a range of
  // y that is always shown.
  function timePlot(title, unit, { times, lines, extent, levels = [], least = [], caption, height = 190 }) {
    const curves = curvesOf(lines, extent, times.length);
    if (curves.length === 0) return null;
    const legend = legendOf(curves), plot = { host: el("div", { class: "time-plot" }), width: 0 };
    const behind = [...curves].sort((a, b) => (b.kind === "band") - (a.kind === "band"));

    plot.draw = () => {
      plot.width = plot.host.clientWidth;
      const from = times.filter((t) => t < range[0]).length, until = times.filter((t) => t <= range[1]).length;
      const seen = curves.flatMap(({ low, high }) => [low, high || []]).flatMap((v) => v.slice(from, until));
      // One more on either side, so that lines run on to the edge.
      const part = (v) => v && v.slice(Math.max(0, from - 1), until + 1);
      plot.svg = chart({ x: range, y: spread([...seen, ...least]), height, width: printing ? kPaperWidth : Math.max(240, plot.width) }, (g) => {
        plot.g = g;
        for (const [a, b] of shades) g.span(a, b, "fill-shade");
        for (const v of levels) g.level(v, "ink thin dash");
        for (const t of joints) g.upright(t, "ink thin dash");
        for (const curve of behind) drawCurve(g, part(times), { ...curve, low: part(curve.low), high: part(curve.high) });
      });
      plot.svg.setAttribute("aria-label", `${title} over time`);
      plot.cursor = svgEl("g");
      plot.svg.append(plot.cursor);
      plot.host.replaceChildren(plot.svg);
      legend.show(times, -1);
    };
    plot.read = (t) => {
      const { g, cursor } = plot, found = t === null ? -1 : nearest(times, t);
      const i = times[found] >= range[0] && times[found] <= range[1] ? found : -1;
      legend.show(times, i);
      cursor.replaceChildren();
      if (i < 0) return;
      cursor.append(svgEl("line", { class: "quiet thin", x1: g.X(times[i]), x2: g.X(times[i]), y1: g.top, y2: g.bottom }));
      for (const { kind, low, high } of curves.filter((c) => c.kind !== "band" && known(c.low[i]))) {
        for (const v of new Set([low[i], high ? high[i] : low[i]])) cursor.append(svgEl("circle", { class: `fill-${kind}`, cx: g.X(times[i]), cy: g.Y(v), r: 3 }));
      }
    };
    followPointer(plot);
    new ResizeObserver(() => { if (plot.host.clientWidth !== plot.width) plot.draw(); }).observe(plot.host);
    plots.push(plot);
    return figure(title, unit, [plot.host, legend.node], caption);
  }

  // Moving reads, dragging zooms.
  function followPointer(plot) {
    const { host } = plot;
    let drag = null;
    const under = ({ clientX }) => {  // across the drawing, and the time there
      const { left, width } = plot.svg.getBoundingClientRect(), { g, svg } = plot;
      const x = Math.min(g.right, Math.max(g.left, (clientX - left) / width * svg.viewBox.baseVal.width));
      return { x, t: range[0] + (x - g.left) / (g.right - g.left) * (range[1] - range[0]) };
    };
    const end = () => { if (drag) drag.box.remove(); drag = null; };
    host.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      host.setPointerCapture(event.pointerId);
      const { top, bottom } = plot.g;
      drag = { from: under(event), box: svgEl("rect", { class: "fill-band", y: top, height: bottom - top }) };
      readAll(drag.from.t);
    });
    host.addEventListener("pointermove", (event) => {
      const at = under(event);
      readAll(at.t);
      if (!drag) return;
      drag.box.setAttribute("x", Math.min(at.x, drag.from.x));
      drag.box.setAttribute("width", Math.abs(at.x - drag.from.x));
      plot.svg.insertBefore(drag.box, plot.cursor);
    });
    host.addEventListener("pointerup", (event) => {
      if (!drag) return;
      const a = drag.from, b = under(event);
      end();
      if (Math.abs(b.x - a.x) > kLeastDrag) zoom(Math.min(a.t, b.t), Math.max(a.t, b.t));
    });
    host.addEventListener("pointercancel", end);
    // A finger leaves as it is lifted, which is when one reads.
    host.addEventListener("pointerleave", ({ pointerType }) => { if (pointerType !== "touch") readAll(null); });
    host.addEventListener("dblclick", zoomOut);
  }

  addEventListener("beforeprint", () => { printing = true; drawAll(); });
  addEventListener("afterprint", () => { printing = false; drawAll(); });
  return { timePlot, zoom, zoomOut, drawAll };
}
