// How is a chart drawn? Axes, grid and marks as SVG, coloured by the style sheet alone.

function svgEl(tag, attributes = {}, text) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

// Round numbers from low to high, `most` or fewer, and how to write them: all alike, with the digits
// that tell one from the next.
function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((m) => m * power >= rough * 0.999) * power;
  const at = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) at.push(k * step);
  const finest = Math.floor(Math.log10(step) + 1e-9), largest = Math.max(...at.map(Math.abs));
  const text = largest >= 1e6 || largest < 1e-3
    ? (v) => (v === 0 ? "0" : v.toExponential(Math.max(0, Math.floor(Math.log10(Math.abs(v)) + 1e-9) - finest)).replace("e+", "e"))
    : (v) => v.toFixed(Math.max(0, -finest));
  return { at, text };
}

// The same on an axis of logarithms: whole powers of ten, or where there are not two, round numbers.
function logarithmicTicks(low, high, most) {
  const power = (k) => "10" + String(k).replace(/-/, "⁻").replace(/\d/g, (d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]);
  const at = [], stride = Math.max(1, Math.ceil((high - low) / most));
  for (let k = Math.ceil(low); k <= high; k += stride) at.push(k);
  if (at.length > 1) return { at, text: power };
  return { at: ticks(10 ** low, 10 ** high, most).at.filter((v) => v > 0).map(Math.log10), text: (v) => num(10 ** v, 3) };
}

// The range of all values and a little more.
function spread(values, pad = 0.06) {
  let low = Infinity, high = -Infinity;
  for (const v of values) if (known(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(high >= low)) return [0, 1];
  const more = high > low ? (high - low) * pad : Math.abs(high) * 0.1 + 1e-12;
  return [low - more, high + more];
}

// Stretches the shorter side until a metre is as long across as upwards.
function equalScales([x0, x1], [y0, y1], ratio) {
  const spanX = Math.max(x1 - x0, (y1 - y0) * ratio), spanY = spanX / ratio;
  return { x: [(x0 + x1 - spanX) / 2, (x0 + x1 + spanX) / 2], y: [(y0 + y1 - spanY) / 2, (y0 + y1 + spanY) / 2] };
}

// Runs of indices whose values are all known.
function unbroken(...rows) {
  const runs = [];
  let run = null;
  for (let i = 0; i < rows[0].length; ++i) {
    if (!rows.every((values) => known(values[i]))) run = null;
    else if (run) run.push(i);
    else runs.push(run = [i]);
  }
  return runs;
}

// What a chart can show, in the units of its axes; `area` is its rectangle in the drawing. A kind is
// a class of the style sheet.
function pen(root, clip, X, Y, area) {
  const add = (tag, attributes) => root.append(svgEl(tag, { "clip-path": clip, ...attributes }));
  const shows = (x, y) => x > area.left - 0.1 && x < area.right + 0.1 && y > area.top - 0.1 && y < area.bottom + 0.1;
  const spot = (x, y) => `${X(x).toFixed(1)} ${Y(y).toFixed(1)}`;
  const rect = (kind, left, right, top, bottom, more = {}) =>
    add("rect", { class: kind, x: left, width: Math.max(0, right - left), y: top, height: Math.max(0, bottom - top), ...more });
  return {
    ...area, X, Y,
    // Broken where a value is missing; what stands alone between two gaps is a dot.
    path: (xs, ys, kind) => add("path", { class: kind, d: unbroken(xs, ys)
      .map((run) => "M" + run.map((i) => spot(xs[i], ys[i])).join("L") + (run.length > 1 ? "" : "h0")).join("") }),
    // From the lower values to the higher ones.
    envelope: (xs, low, high, kind) => add("path", { class: kind, d: unbroken(xs, low, high)
      .map((run) => "M" + [...run.map((i) => spot(xs[i], low[i])), ...run.reverse().map((i) => spot(xs[i], high[i]))].join("L") + "Z").join("") }),
    // Whole also on the edge.
    dots: (xs, ys, kind, r = 2, opacity = 0.8) => {
      for (const i of unbroken(xs, ys).flat().filter((k) => shows(X(xs[k]), Y(ys[k])))) {
        root.append(svgEl("circle", { class: kind, cx: X(xs[i]).toFixed(1), cy: Y(ys[i]).toFixed(1), r, opacity }));
      }
    },
    stems: (xs, ys, kind, width) => {
      for (const i of unbroken(xs, ys).flat()) {
        add("line", { class: kind, "stroke-width": width, x1: X(xs[i]), x2: X(xs[i]), y1: Y(0), y2: Y(ys[i]) });
      }
    },
    bar: (from, until, height, kind, opacity) => rect(kind, X(from) + 0.5, Math.max(X(from) + 1, X(until) - 0.5), Y(height), area.bottom, { opacity }),
    level: (v, kind) => add("line", { class: kind, x1: area.left, x2: area.right, y1: Y(v), y2: Y(v) }),
    upright: (v, kind) => add("line", { class: kind, x1: X(v), x2: X(v), y1: area.top, y2: area.bottom }),
    band: (low, high) => rect("fill-band", area.left, area.right, Y(high), Y(low)),
    span: (from, until, kind, margin = 0, opacity = 1) => rect(kind, X(from), Math.max(X(from) + 0.7, X(until)), area.top + margin, area.bottom - margin, { opacity }),
  };
}

// axes: {x: [low, high], y: [low, high], xLabel, yLabel, logX, logY, equal, bare, width, height}. On a
// logarithmic axis the range is that of log10; `bare` leaves out the numbers of y. Calls draw(pen).
let charts = 0;
function chart(axes, draw) {
  const W = axes.width || 360, H = axes.height || 236;
  const area = { left: 56, right: W - 10, top: 8, bottom: H - (axes.xLabel ? 40 : 22) };
  const across = area.right - area.left, upwards = area.bottom - area.top;
  let [x0, x1] = axes.x, [y0, y1] = axes.y;
  if (!(x1 > x0)) { x0 -= 0.5; x1 = x0 + 1; }
  if (!(y1 > y0)) { y0 -= 0.5; y1 = y0 + 1; }
  if (axes.equal) ({ x: [x0, x1], y: [y0, y1] } = equalScales([x0, x1], [y0, y1], across / upwards));
  const X = (v) => area.left + (v - x0) / (x1 - x0) * across, Y = (v) => area.bottom - (v - y0) / (y1 - y0) * upwards;

  const name = [axes.yLabel, axes.xLabel].filter(Boolean).join(" over ");
  const root = svgEl("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", ...(name ? { "aria-label": name } : {}) });
  const place = (tag, attributes, text) => root.append(svgEl(tag, attributes, text));
  const tx = (axes.logX ? logarithmicTicks : ticks)(x0, x1, Math.max(2, Math.floor(across / 58)));
  const ty = axes.bare ? { at: [] } : (axes.logY ? logarithmicTicks : ticks)(y0, y1, Math.max(2, Math.floor(upwards / 28)));
  for (const v of tx.at) {
    place("line", { class: "grid-line", x1: X(v), x2: X(v), y1: area.top, y2: area.bottom });
    place("text", { x: X(v), y: area.bottom + 14, "text-anchor": "middle" }, tx.text(v));
  }
  for (const v of ty.at) {
    place("line", { class: "grid-line", x1: area.left, x2: area.right, y1: Y(v), y2: Y(v) });
    place("text", { x: area.left - 5, y: Y(v) + 4, "text-anchor": "end" }, ty.text(v));
  }
  const box = { x: area.left, y: area.top, width: across, height: upwards };
  const clip = svgEl("clipPath", { id: `clip${++charts}` });
  clip.append(svgEl("rect", box));
  root.append(clip);
  place("rect", { class: "frame", ...box });
  if (axes.xLabel) place("text", { class: "label", x: (area.left + area.right) / 2, y: H - 6, "text-anchor": "middle" }, axes.xLabel);
  if (axes.yLabel) place("text", { class: "label", "text-anchor": "middle", transform: `translate(12 ${(area.top + area.bottom) / 2}) rotate(-90)` }, axes.yLabel);
  draw(pen(root, `url(#clip${charts})`, X, Y, area));
  return root;
}
