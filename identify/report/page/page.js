// Draws the report from the two JSON blocks of the page: `result` as the program prints it, `data`
// what is drawn beyond it. Text goes into the page as text, never as markup.
"use strict";
(() => {
const block = (id) => JSON.parse(document.getElementById(id).textContent);
const result = block("result"), data = block("data"), versions = block("versions");

// Seconds since 1970 and the like are counted from the first row.
let timeLabel = "time [s]";
if (data.time.length && Math.abs(data.time[0]) > 20 * (data.time[data.time.length - 1] - data.time[0])) {
  const origin = data.time[0], since = (t) => t - origin;
  timeLabel = `time since ${origin} s [s]`;
  data.time = data.time.map(since);
  data.nis.time = data.nis.time.map(since);
  data.joints = data.joints.map(since);
  if (data.held_from !== null) data.held_from -= origin;
  data.forecasts = data.forecasts.map((run) => run.map(since));
  data.used = data.used.map((run) => run.map(since));
}

// --- numbers ---
const known = (v) => v !== null && v !== undefined && Number.isFinite(v);
function num(v, digits = 5) {
  if (!known(v)) return "–";
  if (v === 0) return "0";
  const size = Math.abs(v);
  if (size >= 1e6 || size < 1e-4) return v.toExponential(digits - 2).replace("e+", "e").replace(/\.?0+e/, "e");
  const text = v.toPrecision(digits);
  const plain = text.includes("e") ? String(Number(text)) : text;
  return plain.includes(".") ? plain.replace(/\.?0+$/, "") : plain;
}
// As many decimals as the error leaves: two of its digits.
function decimalsOf(se) { return known(se) && se > 0 ? Math.max(0, 1 - Math.floor(Math.log10(se))) : null; }
function to(v, decimals) {
  if (!known(v)) return "–";
  return decimals === null || decimals > 9 || Math.abs(v) >= 1e7 ? num(v) : v.toFixed(decimals);
}
const unitText = (unit) => (unit ? ` [${unit}]` : "");
const percent = (v) => (known(v) ? num(v, 4) + " %" : "–");

// --- elements ---
function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") node.className = value;
    else node.setAttribute(key, value);
  }
  node.append(...children.flat(Infinity).filter((c) => c !== null && c !== undefined));
  return node;
}
function svgEl(tag, attributes = {}, text) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  return node;
}
function table(heads, rows, attributes = {}) {
  const isNumber = heads.map((h) => h.startsWith("#"));
  const cell = (value, i) =>
    value instanceof HTMLTableCellElement ? value : el("td", { class: isNumber[i] ? "n" : "" }, value);
  return el("div", { class: "scroll" }, el("table", attributes,
    el("thead", {}, el("tr", {}, heads.map((h, i) => el("th", { class: isNumber[i] ? "n" : "" }, h.replace("#", ""))))),
    el("tbody", {}, rows.map((row) => el("tr", {}, row.map(cell))))));
}
const main = document.querySelector("main"), nav = document.querySelector("nav");
function section(id, title, ...children) {
  const all = children.flat(Infinity).filter(Boolean);
  if (all.length === 0) return null;
  nav.append(el("a", { href: "#" + id }, title));
  const node = el("section", { id }, el("h2", {}, title), all);
  main.append(node);
  return node;
}
function figure(title, unit, body, caption) {
  return el("figure", { class: "plot" }, el("div", { class: "title" }, title, el("span", {}, unit || "")), body,
    caption ? el("figcaption", {}, caption) : null);
}
function key(...entries) {
  return el("div", { class: "key" }, entries.filter(Boolean).map(([kind, text]) => el("span", {}, el("i", { class: kind }), text)));
}
const grid = (...children) => { const all = children.flat(Infinity).filter(Boolean); return all.length ? el("div", { class: "grid" }, all) : null; };
const note = (...text) => el("p", { class: "note" }, ...text);

// --- static plots: SVG ---
function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((m) => m * power >= rough * 0.999) * power;
  const out = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) out.push(k * step);
  return { at: out, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}
function tickText(v, decimals) {
  const size = Math.abs(v);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) return v.toExponential(1).replace("e+", "e").replace(".0e", "e");
  return v.toFixed(Math.min(decimals, 8));
}
const power = (k) => "10" + String(k).replace(/-/, "⁻").replace(/\d/g, (d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]);

// axes: {x: [low, high], y: [low, high], xLabel, yLabel, logX, logY, equal}; on a logarithmic axis the
// range is that of log10. `draw` gets add(tag, attributes, text) and the scales.
let charts = 0;
function chart(axes, draw) {
  const W = 360, H = axes.height || 236, left = 56, right = 10, top = 8, bottom = 40;
  let [x0, x1] = axes.x, [y0, y1] = axes.y;
  if (!(x1 > x0)) { x0 -= 0.5; x1 = x0 + 1; }
  if (!(y1 > y0)) { y0 -= 0.5; y1 = y0 + 1; }
  if (axes.equal) {
    const ratio = (W - left - right) / (H - top - bottom);
    const spanX = Math.max(x1 - x0, (y1 - y0) * ratio), spanY = spanX / ratio;
    [x0, x1] = [(x0 + x1 - spanX) / 2, (x0 + x1 + spanX) / 2];
    [y0, y1] = [(y0 + y1 - spanY) / 2, (y0 + y1 + spanY) / 2];
  }
  const root = svgEl("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `${axes.yLabel} over ${axes.xLabel}` });
  const X = (v) => left + (v - x0) / (x1 - x0) * (W - left - right);
  const Y = (v) => H - bottom - (v - y0) / (y1 - y0) * (H - top - bottom);
  const along = (low, high, log, most) => {
    if (!log) return ticks(low, high, most);
    const whole = [];
    const stride = Math.max(1, Math.ceil((high - low) / most));
    for (let k = Math.ceil(low); k <= high; k += stride) whole.push(k);
    return whole.length > 1 ? { at: whole, log: true } : { ...ticks(low, high, most), tenTo: true };
  };
  const text = (t, v) => (t.log ? power(v) : t.tenTo ? num(10 ** v, 2) : tickText(v, t.decimals));
  const tx = along(x0, x1, axes.logX, 5), ty = along(y0, y1, axes.logY, 5);
  for (const v of tx.at) {
    root.append(svgEl("line", { class: "grid-line", x1: X(v), x2: X(v), y1: top, y2: H - bottom }));
    root.append(svgEl("text", { x: X(v), y: H - bottom + 14, "text-anchor": "middle" }, text(tx, v)));
  }
  for (const v of ty.at) {
    root.append(svgEl("line", { class: "grid-line", x1: left, x2: W - right, y1: Y(v), y2: Y(v) }));
    root.append(svgEl("text", { x: left - 5, y: Y(v) + 4, "text-anchor": "end" }, text(ty, v)));
  }
  const id = `clip${++charts}`;
  const clip = svgEl("clipPath", { id });
  clip.append(svgEl("rect", { x: left, y: top, width: W - left - right, height: H - top - bottom }));
  root.append(clip, svgEl("rect", { class: "frame", x: left, y: top, width: W - left - right, height: H - top - bottom }));
  root.append(svgEl("text", { class: "label", x: (left + W - right) / 2, y: H - 6, "text-anchor": "middle" }, axes.xLabel));
  root.append(svgEl("text", { class: "label", "text-anchor": "middle", transform: `translate(12 ${(top + H - bottom) / 2}) rotate(-90)` }, axes.yLabel));
  const inside = svgEl("g", { "clip-path": `url(#${id})` });
  root.append(inside);
  const add = (tag, attributes, words) => inside.append(svgEl(tag, attributes, words));
  const path = (xs, ys, kind) => {
    let d = "", pen = false;
    for (let i = 0; i < xs.length; ++i) {
      if (!known(xs[i]) || !known(ys[i])) { pen = false; continue; }
      d += `${pen ? "L" : "M"}${X(xs[i]).toFixed(1)} ${Y(ys[i]).toFixed(1)}`;
      pen = true;
    }
    add("path", { class: kind, d });
  };
  const dots = (xs, ys, kind, r = 2, opacity = 0.8) => {
    for (let i = 0; i < xs.length; ++i) {
      if (known(xs[i]) && known(ys[i])) add("circle", { class: kind, cx: X(xs[i]).toFixed(1), cy: Y(ys[i]).toFixed(1), r, opacity });
    }
  };
  const level = (v, kind) => add("line", { class: kind, x1: left, x2: W - right, y1: Y(v), y2: Y(v) });
  const upright = (v, kind) => add("line", { class: kind, x1: X(v), x2: X(v), y1: top, y2: H - bottom });
  const band = (low, high) => add("rect", { class: "fill-band", x: left, width: W - left - right, y: Y(high), height: Math.max(0, Y(low) - Y(high)) });
  draw({ add, X, Y, path, dots, level, upright, band, bottom: Y(y0), top: Y(y1) });
  return root;
}
function spread(values, pad = 0.06) {
  let low = Infinity, high = -Infinity;
  for (const v of values) if (known(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(high >= low)) return [0, 1];
  const more = high > low ? (high - low) * pad : Math.abs(high) * 0.1 + 1e-12;
  return [low - more, high + more];
}

// --- plots over time: uPlot, zoomed together ---
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const timePlots = [], waiting = [];
let passing = false;
function zoomed(plot, scale) {
  if (scale !== "x" || passing) return;
  passing = true;
  const { min, max } = plot.scales.x;
  for (const other of timePlots) if (other !== plot) other.setScale("x", { min, max });
  passing = false;
  const whole = timeRange(), slack = (whole[1] - whole[0]) * 1e-6;
  document.documentElement.classList.toggle("zoomed", min > whole[0] + slack || max < whole[1] - slack);
}
function timeRange() {
  const t = data.time;
  return [t[0], t[t.length - 1] > t[0] ? t[t.length - 1] : t[0] + 1];
}
// lines: [{label, line: {y} or {lo, hi}, colour, points, dash}], extent: {low, high, colour} a filled band;
// levels: dashed horizontals; least: a range of y that is always shown.
function timePlot(title, unit, { times = data.time, lines, extent, levels = [], least, caption, height = 190 }) {
  const series = [{ label: "t", value: (u, v) => (known(v) ? num(v, 6) + " s" : "") }], values = [times], bands = [];
  for (const { label, line, colour: name, points, dash } of lines) {
    if (!line) continue;
    const first = values.length, high = line.hi;
    const look = { stroke: () => colour(name), width: 1.3, dash, spanGaps: false, points: { show: Boolean(points && times.length <= 400), size: 4, width: 0, fill: () => colour(name), stroke: () => colour(name) } };
    if (points && times.length <= 400) look.width = 0;
    values.push(high ? line.lo : line.y);
    series.push({ ...look, width: high ? 0.8 : look.width, label, value: (u, v, s, i) => (i === null || !known(v) ? "–" : high && high[i] !== v ? `${num(v, 4)} … ${num(high[i], 4)}` : num(v, 5)) });
    if (high) {
      values.push(high);
      series.push({ ...look, width: 0.8, label: "", class: "part" });
      bands.push({ series: [first + 1, first], fill: () => colour(name) });
    }
  }
  if (extent && extent.low && extent.high) {
    const first = values.length;
    const look = { stroke: "transparent", width: 0, points: { show: false } };
    values.push(extent.low.y || extent.low.lo, extent.high.y || extent.high.hi);
    series.push({ ...look, label: extent.label, class: extent.label ? "extent" : "part", stroke: () => colour("--band"), value: (u, v, s, i) => (i === null || !known(v) ? "–" : `${num(v, 4)} … ${num(values[first + 1][i], 4)}`) }, { ...look, label: "", class: "part" });
    bands.push({ series: [first + 1, first], fill: () => colour("--band") });
  }
  if (values.length < 2) return null;
  const inside = (paint) => (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip();
    paint(u, ctx, bbox, (v) => u.valToPos(v, "x", true));
    ctx.restore();
  };
  const shade = inside((u, ctx, bbox, across) => {
    ctx.fillStyle = colour("--shade");
    const shades = data.held_from !== null ? [[data.held_from, timeRange()[1]]] : data.forecasts;
    for (const [from, until] of shades) ctx.fillRect(across(from), bbox.top, across(until) - across(from), bbox.height);
  });
  const marks = inside((u, ctx, bbox, across) => {
    ctx.strokeStyle = colour("--ink"); ctx.lineWidth = devicePixelRatio; ctx.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const t of data.joints) { ctx.beginPath(); ctx.moveTo(across(t), bbox.top); ctx.lineTo(across(t), bbox.top + bbox.height); ctx.stroke(); }
    for (const v of levels) { const y = u.valToPos(v, "y", true); ctx.beginPath(); ctx.moveTo(bbox.left, y); ctx.lineTo(bbox.left + bbox.width, y); ctx.stroke(); }
  });
  const axis = { stroke: () => colour("--muted"), font: "11px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif", grid: { stroke: () => colour("--grid"), width: 1 }, ticks: { stroke: () => colour("--grid"), width: 1, size: 4 }, gap: 4 };
  const host = el("div");
  waiting.push(() => {
    const plot = new uPlot({
      width: Math.max(200, host.clientWidth), height, series, bands,
      scales: { x: { time: false, range: (u, low, high) => (known(low) ? [low, high] : timeRange()) },
        y: { range: (u, low, high) => { if (!known(low)) return [0, 1]; const [a, b] = least ? [Math.min(low, least[0]), Math.max(high, least[1])] : [low, high]; const pad = (b - a || Math.abs(b) || 1) * 0.06; return [a - pad, b + pad]; } } },
      axes: [{ ...axis, size: 22, space: 60 }, { ...axis, size: 56, values: (u, at) => at.map((v) => num(v, 4)) }],
      legend: { live: true, markers: { width: 0, fill: (u, i) => (typeof series[i].stroke === "function" ? series[i].stroke() : null) } },
      cursor: { y: false, drag: { x: true, y: false, setScale: true }, sync: { key: "time", setSeries: false, filters: { pub: (type) => type === "mousemove" || type === "mouseleave", sub: () => true } } },
      hooks: { drawClear: [shade], draw: [marks], setScale: [zoomed] },
    }, values, host);
    plot.setScale("x", { min: timeRange()[0], max: timeRange()[1] });
    plot.over.addEventListener("dblclick", (event) => { event.stopImmediatePropagation(); plot.setScale("x", { min: timeRange()[0], max: timeRange()[1] }); }, true);
    timePlots.push(plot);
    new ResizeObserver(() => { const width = Math.max(200, host.clientWidth); if (width !== plot.width) plot.setSize({ width, height }); }).observe(host);
  });
  return figure(title, unit, host, caption);
}
function redraw() {
  for (const plot of timePlots) plot.redraw(false, true);
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
addEventListener("beforeprint", () => { document.documentElement.classList.add("printing"); redraw(); });
addEventListener("afterprint", () => { document.documentElement.classList.remove("printing"); redraw(); });

// --- header and verdict ---
const verbs = { tune: "Kalman filter noise, tuned", check: "Kalman filter, checked", fit: "Parameters, fitted", shape: "Coloured noise, shaped", track: "Estimates along the recording" };
document.title = `${result.model || result.verb} – Identikal`;
document.querySelector(".kind").textContent = "Identikal · " + (verbs[result.verb] || result.verb) + (result.objective.method && result.objective.method !== result.verb ? ` · ${result.objective.method.replaceAll("_", " ")}` : "");
document.querySelector("h1").textContent = result.model || "(a model without name)";
const rowsUsed = result.inputs.map((i) => `${i.path}: ${i.rows} rows, ${i.used} used`);
document.querySelector(".facts").textContent = rowsUsed.length > 3 ? `${rowsUsed.length} recordings, ${result.inputs.reduce((n, i) => n + i.used, 0)} rows used` : rowsUsed.join(" · ");

const tones = { ok: ["good", "✓ Usable"], answer_no: ["bad", "✗ The answer is no"], untrusted: ["bad", "✗ Not to be trusted"], not_converged: ["doubt", "! Not converged"] };
const severe = { serious: ["bad", "serious"], warning: ["doubt", "warning"], note: ["good", "note"] };
(() => {
  let [tone, words] = tones[result.status.code] || ["doubt", result.status.code];
  const o = result.objective, facts = [];
  if (known(o.log_likelihood)) facts.push(`log-likelihood ${num(o.log_likelihood, 9)}` + (known(o.log_likelihood_start) ? ` (start ${num(o.log_likelihood_start, 9)})` : ""));
  if (known(o.aic)) facts.push(`AIC ${num(o.aic, 7)}, BIC ${num(o.bic, 7)}`);
  if (o.starts > 0) facts.push(`${o.starts_agree} of ${o.starts} starts agree`);
  const failed = result.tests.filter((t) => !t.pass).length;
  if (result.tests.length) facts.push(failed ? `${failed} of ${result.tests.length} tests fail` : `${result.tests.length} of ${result.tests.length} tests pass`);
  // The search ended well and the data determine the values; what the tests say of the model the warnings explain.
  if (failed && result.status.code === "ok") [tone, words] = ["doubt", `! Usable, but ${failed} of ${result.tests.length} tests fail`];
  const order = ["serious", "warning", "note"];
  const warnings = [...result.warnings].sort((a, b) => order.indexOf(a.severity) - order.indexOf(b.severity));
  main.append(el("div", { class: `verdict tone-${tone}`, id: "verdict" }, el("strong", {}, words), el("p", {}, result.status.message),
    facts.length ? el("p", { class: "note" }, facts.join(" · ")) : null,
    warnings.length ? el("ul", {}, warnings.map((w) => el("li", { class: `tone-${(severe[w.severity] || severe.note)[0]}` },
      el("span", { class: "mark" }, `${(severe[w.severity] || severe.note)[1]}: ${w.code.replaceAll("_", " ")}. `), w.text, w.do ? el("span", { class: "note" }, ` → ${w.do}`) : null))) : null));
})();

// --- parameters ---
// A vehicle has many that are known to be nothing.
const matters = (p) => known(p.value) && !(p.fixed && p.value === 0);
const verdictMarks = { ok: "✓ ok", weak: "! weak", correlated: "! correlated", at_bound: "| at bound", unexcited: "✗ unexcited", flat: "✗ not determined" };
function errorBar(p) {
  const W = 210, H = 22, Y = H / 2;
  const root = svgEl("svg", { viewBox: `0 0 ${W} ${H}`, style: "width:210px;max-width:none", role: "img", "aria-label": `${p.name} with its error` });
  const interval = p.ci95.every(known) ? p.ci95 : [p.value, p.value];
  let [low, high] = [Math.min(...interval, p.value), Math.max(...interval, p.value)];
  if (known(p.profile95[0]) && known(p.profile95[1])) { low = Math.min(low, p.profile95[0]); high = Math.max(high, p.profile95[1]); }
  const width = high - low || Math.abs(p.value) || 1;
  if (known(p.start) && p.start > low - 1.5 * width && p.start < high + 1.5 * width) { low = Math.min(low, p.start); high = Math.max(high, p.start); }
  const X = (v) => 8 + (v - low) / (high - low || 1) * (W - 16);
  root.append(svgEl("line", { class: "grid-line", x1: 0, x2: W, y1: Y, y2: Y }));
  const bar = (a, b, kind, size) => root.append(svgEl("line", { class: kind, x1: X(a), x2: X(b), y1: Y, y2: Y, "stroke-width": size }));
  if (known(p.profile95[0]) && known(p.profile95[1])) for (const v of p.profile95) root.append(svgEl("line", { class: "quiet", x1: X(v), x2: X(v), y1: Y - 6, y2: Y + 6 }));
  if (interval[1] > interval[0]) bar(interval[0], interval[1], "accent", 1.5);
  if (known(p.crb_se)) bar(Math.max(low, p.value - p.crb_se), Math.min(high, p.value + p.crb_se), "accent", 5);
  if (known(p.start) && p.start >= low && p.start <= high) root.append(svgEl("path", { class: "contrast thin", d: `M${X(p.start)} ${Y + 9}l-4 6h8z`, transform: `translate(0 -4)` }));
  root.append(svgEl("circle", { class: "fill-accent", cx: X(p.value), cy: Y, r: 3.5 }));
  return root;
}
(() => {
  const free = result.parameters.filter((p) => !p.fixed), fixed = result.parameters.filter((p) => p.fixed);
  const children = [];
  if (free.length) {
    const rows = free.map((p) => {
      const d = decimalsOf(p.se);
      const bad = p.verdict === "flat" || p.verdict === "unexcited";
      return [p.name, p.unit || "–", to(p.value, d), num(p.se, 3), known(p.ci95[0]) ? `${to(p.ci95[0], d)} … ${to(p.ci95[1], d)}` : "–",
        known(p.profile95[0]) ? `${to(p.profile95[0], d)} … ${to(p.profile95[1], d)}` : "–", num(p.crb_se, 3), num(p.start, 4),
        el("td", { class: bad ? "fail" : "" }, (verdictMarks[p.verdict] || p.verdict) + (p.with.length ? " with " + p.with.join(", ") : "")), errorBar(p)];
    });
    const anyProfile = free.some((p) => known(p.profile95[0]));
    const heads = ["parameter", "unit", "#value", "#std. error", "#95 % interval", "#profile 95 %", "#bound", "#start", "verdict", "value and errors"];
    const columns = heads.map((_, i) => i).filter((i) => i !== 5 || anyProfile);
    const shown = table(columns.map((i) => heads[i]), rows.map((row) => columns.map((i) => row[i])), { class: "wide" });
    const plot = el("figure", { class: "plot" }, shown);
    children.push(plot, key(["k-accent", "95 % interval; thick: Cramér-Rao bound, one standard deviation"], anyProfile && ["k-quiet", "ends of the profile interval"], ["k-contrast", "start (triangle), where it is near"]));
  }
  if (result.covariance_kind) children.push(note(`Standard errors from ${result.covariance_kind}. The bound is what no unbiased estimator can go below, at the estimate, white noise assumed.`));
  const read = fixed.filter(matters);
  if (read.length) children.push(note(`Known: ${read.map((p) => `${p.name} = ${num(p.value, 6)}${p.unit ? " " + p.unit : ""}`).join(", ")}.`));
  const loss = result.noise.expected_loss;
  if (loss) children.push(el("p", {}, loss.reason ? `What these errors cost the filter is not known: ${loss.reason}.` : `These errors cost the filter ${100 * loss.relative < 0.001 ? "< 0.001" : num(100 * loss.relative, 2)} % of tr P in the mean, beside the best filter there is${loss.without.length ? `; without ${loss.without.join(", ")}, which ended at zero` : ""}.`));
  for (const d of result.identifiability.flat_directions) children.push(el("p", { class: "fail" }, "The data do not determine the combination " + d.names.map((n, i) => `${d.weights[i] < 0 ? "−" : "+"} ${num(Math.abs(d.weights[i]), 2)} ${n}`).join(" ") + " (relative to each one's own error)."));
  if (result.posterior) children.push(table(["parameter", "#most probable", "prior"], result.posterior.parameters.filter((p) => known(p.map)).map((p) => [p.name, num(p.map, 5), p.prior])),
    note(`Posterior by ${result.posterior.method}, ${result.posterior.points} points; log evidence ${num(result.posterior.log_evidence, 7)}.`));
  section("parameters", "Parameters", children);
})();

// --- paste: what `identikal export` prints ---
(() => {
  const blocks = block("paste").map(({ language, text }) => {
    const copy = el("button", { type: "button" }, "Copy");
    const pre = el("pre", {}, text);
    copy.addEventListener("click", () => {
      const selection = getSelection();
      selection.selectAllChildren(pre);
      document.execCommand("copy");
      copy.textContent = "Copied";
      setTimeout(() => { copy.textContent = "Copy"; }, 1500);
    });
    return el("details", {}, el("summary", {}, language), el("div", { class: "code" }, pre, copy));
  });
  if (!blocks.length) return;
  section("paste", "To paste", blocks);
  addEventListener("beforeprint", () => { blocks[0].open = true; });
})();

// --- predictions ---
const thinned = data.rows > data.columns;
const thinning = thinned ? ` ${data.rows} rows are drawn in ${data.columns} columns: from the least to the largest of each, so that no peak is lost; zooming shows the same columns.` : "";
const fitOf = (kind, channel) => { const f = result.fit[kind][channel]; return f && known(f.fit_percent) ? `${num(f.fit_percent, 4)} %` : null; };
if (data.channels.length) {
  const reset = el("button", { type: "button", class: "reset" }, "Show all");
  reset.addEventListener("click", () => { const [min, max] = timeRange(); timePlots[0].setScale("x", { min, max }); });
  const what = [];
  if (data.held_from !== null) what.push("Shaded: held out, the fit did not see it.");
  else if (data.forecasts.length) what.push("Shaded: free run, predicted without any correction from there on, with two standard deviations either way" + (result.verb === "check" ? "." : "; the fit did see these rows."));
  if (data.joints.length) what.push(`Recordings${data.held_from !== null ? ", and what is held out behind them," : ""} are laid end to end; a dashed line is where the next begins.`);
  section("predictions", "Measured and predicted", reset,
    note("Drag to zoom, all plots over time together; double-click shows all. " + what.join(" ") + thinning),
    data.channels.map((c) => {
      const fits = [["one step", fitOf("one_step", c.name)], ["free run", fitOf("simulation", c.name)], ["held out", fitOf("hold_out", c.name)], ["held out, one step", fitOf("hold_out_one_step", c.name)]].filter(([, f]) => f).map(([kind, f]) => `${kind} ${f}`);
      return timePlot(c.name, [c.unit ? `[${c.unit}]` : "", fits.length ? "fit " + fits.join(", ") : ""].filter(Boolean).join(" · ") + " · " + timeLabel, {
        lines: [{ label: "measured", line: c.measured, colour: "--muted", points: true }, { label: "one step", line: c.one_step, colour: "--accent" }, { label: "free run", line: c.free_run, colour: "--contrast" }],
        extent: c.forecast_low && { low: c.forecast_low, high: c.forecast_high, label: "±2 sd" }, height: 220 });
    }),
    data.inputs.length ? el("h3", {}, "Inputs") : null,
    data.inputs.map((u) => timePlot(u.name, (u.unit ? `[${u.unit}] · ` : "") + timeLabel, { lines: [{ label: u.name, line: u.line, colour: "--accent" }], height: 130 })));
}

// --- estimates along the recording ---
if (data.course.length) {
  section("course", "Estimates along the recording", note("Mean and two standard deviations either way." + thinning),
    data.course.map((c) => timePlot(c.name, (c.unit ? `[${c.unit}] · ` : "") + timeLabel, { lines: [{ label: c.name, line: c.mean, colour: "--accent" }], extent: { low: c.low, high: c.high, label: "±2 sd" }, height: 170 })),
    data.log_alarm ? timePlot("test for a change", "log statistic · " + timeLabel, { lines: [{ label: "statistic", line: data.log_alarm, colour: "--contrast" }], levels: known(data.log_threshold) ? [data.log_threshold] : [], height: 130 }) : null,
    result.course && result.course.changes.length ? table(["#since [s]", "#found [s]", "change"], result.course.changes.map((c) => [num(c.since, 6), num(c.found, 6), result.course.names.map((n, i) => `${n} ${num(c.before[i], 4)} → ${num(c.after[i], 4)}`).join(", ")])) : null);
}

// --- innovations ---
const resultIsResidual = data.axles.length > 0 && !data.channels.some((c) => c.one_step);
const word = resultIsResidual ? "residual" : "innovation";
const withInnovations = data.channels.filter((c) => c.after);
if (withInnovations.length) {
  const anyBefore = withInnovations.some((c) => c.before);
  section("innovations", resultIsResidual ? "Residuals" : "Innovations",
    note(`Each ${word} over its standard deviation; dashed ±2, which 95 % of a good filter's stay within. ` + (anyBefore ? (resultIsResidual ? "Before: the same with the parameters of the model file, over the standard deviation after." : "Before: the filter with the noise of the model file, by its own standard deviation.") : "") + thinning),
    withInnovations.map((c) => [
      timePlot(c.name, `${word} / σ${anyBefore ? ", after" : ""} · ${timeLabel}`, { lines: [{ label: "after", line: c.after, colour: "--accent" }], levels: [-2, 2], least: [-3, 3], height: 150 }),
      c.before ? timePlot(c.name, `${word} / σ, before · ${timeLabel}`, { lines: [{ label: "before", line: c.before, colour: "--contrast" }], levels: [-2, 2], least: [-3, 3], height: 150 }) : null]),
    data.nis.time.length ? timePlot("NIS", `normalised ${word} squared / degrees of freedom · ${timeLabel}`, {
      times: data.nis.time, lines: [{ label: "NIS", line: { y: data.nis.value }, colour: "--accent" }], extent: { low: { y: data.nis.low }, high: { y: data.nis.high }, label: "95 %" }, levels: [1], height: 150,
      caption: `Means over ${data.nis.block} rows. 19 of 20 should lie in the band.` }) : null);

  const rows = [];
  for (const c of withInnovations) {
    const after = c.innovations_after, before = c.innovations_before, lags = after.autocorrelation.map((_, k) => k + 1);
    const limit = 1.96 / Math.sqrt(after.samples || 1), unit = `${c.name}`;
    const plots = [];
    if (lags.length) {
      const values = [...after.autocorrelation, ...before.autocorrelation, limit, -limit];
      const bound = Math.min(1, Math.max(...values.filter(known).map(Math.abs)) * 1.1);
      plots.push(figure("Correlogram", unit, chart({ x: [0, lags.length + 1], y: [-bound, bound], xLabel: "lag [samples]", yLabel: "autocorrelation" }, (g) => {
        g.band(-limit, limit); g.level(0, "quiet thin");
        if (before.autocorrelation.length) g.dots(lags, before.autocorrelation, "contrast thin", 2.2, 1);
        after.autocorrelation.forEach((r, k) => known(r) && g.add("line", { class: "accent", "stroke-width": 2.4, x1: g.X(k + 1), x2: g.X(k + 1), y1: g.Y(0), y2: g.Y(r) }));
      }), key(["k-accent", "after"], before.autocorrelation.length && ["k-contrast", "before"])));
    }
    after.from_input.forEach((r, j) => {
      const half = (r.length - 1) / 2, bound = Math.min(1, Math.max(limit, ...r.filter(known).map(Math.abs)) * 1.1);
      plots.push(figure("Correlation with input", `${c.name} with ${data.inputs[j] ? data.inputs[j].name : j + 1}`, chart({ x: [-half - 1, half + 1], y: [-bound, bound], xLabel: "lag [samples]; right: input earlier", yLabel: "correlation" }, (g) => {
        g.band(-limit, limit); g.level(0, "quiet thin"); g.upright(0, "quiet thin dash");
        r.forEach((v, k) => known(v) && g.add("line", { class: "accent", "stroke-width": 2, x1: g.X(k - half), x2: g.X(k - half), y1: g.Y(0), y2: g.Y(v) }));
      })));
    });
    if (after.normal.length) {
      const reach = Math.max(3, ...after.normal.map(Math.abs), ...after.seen.map(Math.abs)) * 1.05;
      plots.push(figure("Quantiles", unit, chart({ x: [-reach, reach], y: [-reach, reach], xLabel: "normal quantile", yLabel: `${word} / σ` }, (g) => {
        g.path([-reach, reach], [-reach, reach], "quiet thin dash");
        if (before.normal.length) g.dots(before.normal, before.seen, "fill-contrast", 1.5, 0.5);
        g.dots(after.normal, after.seen, "fill-accent", 2);
      }), key(["k-accent", "after"], before.normal.length && ["k-contrast", "before"], ["k-quiet k-dash", "normal"])));
      const wide = after.edges[1] - after.edges[0], share = after.count.map((n) => n / (after.samples * wide)), density = (x) => Math.exp(-x * x / 2) / Math.sqrt(2 * Math.PI);
      plots.push(figure("Histogram", `${c.name} · mean ${num(after.mean, 3)}, sd ${num(after.sd, 3)}`, chart({ x: [after.edges[0], after.edges[after.edges.length - 1]], y: [0, Math.max(0.42, ...share) * 1.06], xLabel: `${word} / σ`, yLabel: "density" }, (g) => {
        share.forEach((s, k) => s > 0 && g.add("rect", { class: "fill-accent", opacity: 0.55, x: g.X(after.edges[k]) + 0.5, width: Math.max(0.5, g.X(after.edges[k + 1]) - g.X(after.edges[k]) - 1), y: g.Y(s), height: g.bottom - g.Y(s) }));
        const xs = Array.from({ length: 91 }, (_, k) => -4.5 + k * 0.1);
        g.path(xs, xs.map(density), "ink line");
      }), after.outside ? `${after.outside} of ${after.samples} lie outside.` : null));
    }
    if (after.level.length) {
      const log = (v) => (v > 0 ? Math.log10(v) : null), levels = after.level.map(log), old = before.level.map(log), band = data.level_band.map(log);
      plots.push(figure("Spectrum", unit, chart({ x: [0, data.frequency[data.frequency.length - 1]], y: spread([...levels, ...old, ...band, -0.3, 0.3]), xLabel: "frequency [Hz]", yLabel: "power over white", logY: true }, (g) => {
        g.band(band[0], band[1]); g.level(0, "ink thin dash");
        if (old.length) g.path(data.frequency, old, "contrast thin");
        g.path(data.frequency, levels, "accent line");
      }), key(["k-accent", "after"], old.length && ["k-contrast", "before"], ["k-quiet k-dash", "white; band 95 %"])));
    }
    rows.push(grid(plots));
  }
  section("whiteness", "White and normal?", note(`What is left over should not repeat itself, know the inputs, or lean to a frequency. Bands hold 95 % of white noise; correlations are scaled to the same variance at every lag.${data.segments > 1 ? ` Spectra are means over ${data.segments} stretches of ${data.segment} rows.` : data.segments === 0 ? " Too few rows for a spectrum." : ""}`), rows,
    result.tests.length ? el("h3", {}, "Tests") : null,
    result.tests.length ? table(["test", "channel", "#value", "#passes inside", "#p", ""], result.tests.map((t) => [t.id.replaceAll("_", " "), t.channel || "all", num(t.value, 4), known(t.interval[0]) ? `${num(t.interval[0], 4)} … ${num(t.interval[1], 4)}` : "–", num(t.p, 2), el("td", { class: t.pass ? "" : "fail" }, t.pass ? "✓ pass" : "✗ FAIL")])) : null);
}

// --- coloured noise ---
if (result.shaping && result.shaping.candidates.length > 1) {
  section("shaping", "Shaping filters", table(["noise", "channels", "#poles", "#zeros", "#log-likelihood", "#BIC"], result.shaping.candidates.map((c) => [c.place, c.channels, c.order || "", c.order ? c.zeros : "", num(c.log_likelihood, 8), num(c.bic, 8)])),
    result.shaping.predictions.length ? el("h3", {}, "Held out: rms error of predictions") : null,
    result.shaping.predictions.length ? table(["channel", "#steps", "#white", "#shaped"], result.shaping.predictions.map((p) => [p.channel + unitText(p.unit), p.steps, num(p.rmse_without, 4), num(p.rmse_with, 4)])) : null);
}

// --- the car ---
if (data.axles.length || (result.derived.length && data.tracks.length)) {
  const plots = data.axles.map((axle) => {
    const degree = (v) => v * 180 / Math.PI, kilo = (v) => v / 1000;
    const xs = axle.curve_slip.map(degree), ys = axle.curve_force.map(kilo);
    return figure("Axle force", axle.name, chart({ x: spread(xs, 0.02), y: spread([...ys, ...axle.force.map(kilo)]), xLabel: "slip angle [deg], signed as the force", yLabel: "side force [kN]" }, (g) => {
      g.level(0, "quiet thin"); g.upright(0, "quiet thin");
      g.dots(axle.slip.map(degree), axle.force.map(kilo), "fill-quiet", 1.8, axle.slip.length > 400 ? 0.35 : 0.7);
      g.path(xs, ys, "accent line");
    }), key(["k-accent", "fitted"], axle.slip.length && ["k-quiet", `from the recording, means of 0.1 s${data.washed_out ? ", slow motion filtered out (only ay was measured)" : ""}`]));
  });
  if (data.tracks.length) {
    const all = (k) => data.tracks.flatMap((t) => t[k]);
    plots.push(figure("Track", data.tracks.length > 1 ? "longest stretch" : "longest stretch, simulated", chart({ x: spread(all("X")), y: spread(all("Y")), xLabel: "X [m]", yLabel: "Y, to the left [m]", equal: true }, (g) => {
      data.tracks.forEach((t) => g.path(t.X, t.Y, t.name === "simulated" ? "accent line" : "quiet line dash"));
    }), key(["k-accent", "simulated"], data.tracks.length > 1 && ["k-quiet k-dash", "from measured yaw rate and sideslip"])));
    const aside = Math.max(...all("Y").map(Math.abs)) || 1, ahead = Math.max(...all("X").map(Math.abs)) || 1;
    if (aside < 0.25 * ahead) plots.push(figure("Track, sideways stretched", "same, axes apart", chart({ x: spread(all("X")), y: spread(all("Y")), xLabel: "X [m]", yLabel: "Y, to the left [m]" }, (g) => {
      data.tracks.forEach((t) => g.path(t.X, t.Y, t.name === "simulated" ? "accent line" : "quiet line dash"));
    })));
  }
  section("car", "The car", note("Axle forces: the dots come from force and moment balances of the recording alone, without a tyre; the line is the fitted axle."), grid(plots),
    result.derived.length ? el("h3", {}, "Characteristic values") : null,
    result.derived.length ? table(["value", "unit", "#", "#std. error"], result.derived.map((d) => [d.name, d.unit || "–", to(d.value, decimalsOf(d.se)), num(d.se, 3)])) : null);
} else if (result.derived.length) {
  section("derived", "Derived values", table(["value", "unit", "#", "#std. error"], result.derived.map((d) => [d.name, d.unit || "–", to(d.value, decimalsOf(d.se)), num(d.se, 3)])));
}

// --- likelihood ---
(() => {
  const plots = [];
  for (const p of result.parameters.filter((q) => !q.fixed && known(q.se) && q.se > 0)) {
    const profile = data.profiles.find((q) => q.name === p.name);
    const xs = profile ? profile.value : Array.from({ length: 41 }, (_, k) => p.value + (k - 20) * 0.14 * p.se);
    const range = spread(xs, 0.02), fine = Array.from({ length: 81 }, (_, k) => range[0] + k * (range[1] - range[0]) / 80);
    plots.push(figure(profile ? "Profile" : "Normal approximation", p.name, chart({ x: range, y: [0, 8], xLabel: p.name + unitText(p.unit), yLabel: "2 (L max − L)" }, (g) => {
      g.level(3.84, "quiet thin dash"); g.upright(p.value, "quiet thin");
      g.path(fine, fine.map((x) => ((x - p.value) / p.se) ** 2), "contrast thin dash");
      if (profile) { g.path(profile.value, profile.drop, "accent line"); g.dots(profile.value, profile.drop, "fill-accent", 2, 1); }
    }), key(profile && ["k-accent", "likelihood, others sought anew"], ["k-contrast k-dash", "from the standard error"], ["k-quiet k-dash", "95 %"])));
  }
  const names = result.correlation.names, M = result.correlation.matrix;
  if (M && names.length > 1) {
    const n = names.length, longest = Math.max(...names.map((s) => s.length)), margin = Math.min(120, 12 + 6.5 * longest), size = Math.min(46, (360 - margin) / n);
    const root = svgEl("svg", { viewBox: `0 0 ${margin + n * size + 4} ${n * size + margin + 6}`, style: `max-width:${Math.min(560, (margin + n * size + 4) * 1.3)}px`, role: "img", "aria-label": "correlation of the estimates" });
    M.forEach((row, i) => row.forEach((rho, j) => {
      root.append(svgEl("rect", { class: "frame", x: margin + j * size, y: i * size + 2, width: size, height: size }));
      if (!known(rho)) return;
      root.append(svgEl("rect", { class: rho < 0 ? "fill-contrast" : "fill-accent", opacity: Math.abs(rho) * 0.85, x: margin + j * size + 0.5, y: i * size + 2.5, width: size - 1, height: size - 1 }));
      if (size >= 26) root.append(svgEl("text", { class: "label", x: margin + (j + 0.5) * size, y: (i + 0.5) * size + 6, "text-anchor": "middle" }, rho.toFixed(2)));
    }));
    names.forEach((name, i) => {
      root.append(svgEl("text", { x: margin - 5, y: (i + 0.5) * size + 6, "text-anchor": "end" }, name));
      root.append(svgEl("text", { "text-anchor": "end", transform: `translate(${margin + (i + 0.5) * size + 4} ${n * size + 8}) rotate(-90)` }, name));
    });
    plots.push(figure("Correlation of the estimates", "", root, key(["k-accent", "positive"], ["k-contrast", "negative"])));
  }
  const searches = data.searches.filter((s) => s.length > 1);
  if (searches.length) {
    const vehicle = Boolean(result.tyre_curve), start = result.objective.log_likelihood_start;
    const aside = vehicle && known(start) && Math.abs(start - searches[0][0]) > 1e-3
      ? `The best of the starts tried climb; the first begins at ${num(searches[0][0], 7)}, where the values of the model file have ${num(start, 7)}.` : null;
    const whose = result.objective.method === "trajectory" ? "Climbs of the simulation that the trajectory begins with." : null;
    const best = Math.max(...searches.flat().filter(known)), floor = 1e-6;
    const below = searches.map((s) => s.map((v) => (known(v) ? Math.log10(Math.max(best - v, floor)) : null)));
    plots.push(figure("Convergence", `${searches.length} ${searches.length > 1 ? "climbs" : "climb"}`, chart({ x: [0, Math.max(...searches.map((s) => s.length - 1))], y: spread([...below.flat(), -6]), xLabel: "iteration", yLabel: "log-likelihood below the best", logY: true }, (g) => {
      below.forEach((s, k) => { g.path(s.map((_, i) => i), s, k === 0 ? "accent line" : "quiet thin"); g.dots([s.length - 1], [s[s.length - 1]], k === 0 ? "fill-accent" : "fill-quiet", 2.5, 1); });
    }), [key(["k-accent", vehicle ? "best start" : "first start"], searches.length > 1 && ["k-quiet", "others"]), result.objective.starts ? `${result.objective.starts_agree} of ${result.objective.starts} starts end at the best value.` : null, aside, whose].filter(Boolean).map((words) => (typeof words === "string" ? el("div", {}, words) : words))));
  }
  if (plots.length) section("likelihood", "Likelihood and search", data.profiles.length === 0 && plots.length ? note("No likelihood profiles: the search was not by likelihood, or an evaluation is too long for some twenty of them.") : null,
    result.covariance_kind.includes("sandwich") && data.profiles.length ? note("Profiles take the residuals as white; the standard errors allow for what they are, and are the ones to trust.") : null, grid(plots));
})();

// --- remarks ---
section("remarks", "Remarks", result.notes.length ? el("div", { class: "code" }, el("pre", {}, result.notes.join("\n"))) : null);

// --- data ---
(() => {
  const anyHeld = data.recordings.some((r) => r.held), partHead = anyHeld ? ["rows are"] : [];
  const part = (r) => (anyHeld ? [r.held ? "held out" : "fitted"] : []);
  const channels = data.recordings.flatMap((r) => r.channels.map((c) => [r.name, ...part(r), c.input ? "input" : "output", c.name, c.unit || "–", num(c.low, 5), num(c.mean, 5), num(c.high, 5), String(c.missing), percent(100 * c.missing / (r.rows || 1))]));
  const [from, until] = data.time.length ? timeRange() : [0, 1];
  const strip = data.time.length ? figure("Rows that went in", "", chart({ x: [from, until], y: [0, 1], height: 84, xLabel: timeLabel, yLabel: "" }, (g) => {
    for (const [a, b] of data.used) g.add("rect", { class: "fill-accent", opacity: 0.6, x: g.X(a), width: Math.max(0.7, g.X(b) - g.X(a)), y: g.top + 6, height: g.bottom - g.top - 12 });
    if (data.held_from !== null) g.add("rect", { class: "fill-contrast", opacity: 0.35, x: g.X(data.held_from), width: g.X(until) - g.X(data.held_from), y: g.top + 6, height: g.bottom - g.top - 12 });
    for (const t of data.joints) g.upright(t, "quiet thin dash");
  }), key(["k-accent", "used"], data.held_from !== null && ["k-contrast", "held out"])) : null;
  if (strip) for (const old of strip.querySelectorAll("svg > text[text-anchor=end]")) old.remove();
  section("data", "Data",
    table(["recording", ...partHead, "#rows", "#duration [s]", "#step [s]", "#rate [Hz]", "#longest step [s]", "#gaps"], data.recordings.map((r) => [r.name, ...part(r), String(r.rows), num(r.to - r.from, 6), num(r.step, 5), num(1 / r.step, 5), num(r.longest_step, 5), String(r.gap_count)])),
    strip, channels.length ? table(["recording", ...partHead, "kind", "channel", "unit", "#least", "#mean", "#largest", "#missing", "#"], channels) : null,
    data.recordings.some((r) => r.gaps.length) ? [el("h3", {}, "Longest gaps"), table(["recording", ...partHead, "#from [s]", "#to [s]", "#length [s]"], data.recordings.flatMap((r) => r.gaps.map((g) => [r.name, ...part(r), num(g.from, 7), num(g.to, 7), num(g.to - g.from, 4)])))].flat() : null);
})();

// --- reproducibility ---
section("origin", "To do it again",
  el("div", { class: "code" }, el("pre", {}, data.provenance.command)),
  table(["file", "SHA-256"], [...result.inputs.map((i) => [i.path, el("td", { class: "long" }, el("code", {}, i.sha256))]), [data.provenance.model_path, el("td", { class: "long" }, el("code", {}, data.provenance.model_sha256))]]),
  note(Object.entries(versions).map(([name, version]) => `${name} ${version}`).join(", ") + (known(result.timing_s) ? `. The job took ${num(result.timing_s, 3)} s.` : ".") + " Same command, same files, same version: same numbers."));

for (const draw of waiting) draw();
for (const plot of document.querySelectorAll(".plot")) {
  if (plot.querySelector("canvas, svg")) plot.dataset.drawn = "";
}
document.documentElement.dataset.ready = "";
})();
