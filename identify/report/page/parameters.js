// What are the values, and how sure are they?

const kIdentifiability = {
  ok: "✓ ok", poorly_determined: "! poorly determined", correlated: "! correlated", at_bound: "| at bound",
  unexcited: "✗ unexcited", not_identifiable: "✗ not identifiable", untrusted: "✗ untrusted",
};
const kUndetermined = ["not_identifiable", "unexcited"];

// A vehicle has many that are known to be nothing.
const matters = (p) => known(p.value) && !(p.fixed && p.value === 0);
// Where one end alone is not known there is none.
const interval = ([low, high], decimals) => (known(low) || known(high)
  ? `${known(low) ? to(low, decimals) : "−∞"} … ${known(high) ? to(high, decimals) : "∞"}` : "–");

// The value on its 95 % interval, with the bound, the profile interval and, where it is near, the start.
function uncertaintyBar({ name, value, ci95, profile95, crb_se, start }) {
  const W = 210, H = 22, Y = H / 2;
  const root = svgEl("svg", { viewBox: `0 0 ${W} ${H}`, style: "width:210px;max-width:none", role: "img", "aria-label": `${name} with its uncertainty` });
  const profiled = profile95.every(known), normal = ci95.every(known) ? ci95 : [value, value];
  const all = [...normal, value, ...(profiled ? profile95 : [])];
  let low = Math.min(...all), high = Math.max(...all);
  const width = high - low || Math.abs(value) || 1, near = known(start) && start > low - 1.5 * width && start < high + 1.5 * width;
  if (near) { low = Math.min(low, start); high = Math.max(high, start); }
  const X = (v) => 8 + (v - low) / (high - low || 1) * (W - 16);
  const line = (kind, x1, x2, y1, y2, size) => root.append(svgEl("line", { class: kind, x1, x2, y1, y2, ...(size ? { "stroke-width": size } : {}) }));
  line("grid-line", 0, W, Y, Y);
  if (profiled) for (const v of profile95) line("quiet", X(v), X(v), Y - 6, Y + 6);
  if (normal[1] > normal[0]) line("accent", X(normal[0]), X(normal[1]), Y, Y, 1.5);
  if (known(crb_se)) line("accent", X(Math.max(low, value - crb_se)), X(Math.min(high, value + crb_se)), Y, Y, 5);
  if (near) root.append(svgEl("path", { class: "contrast thin", d: `M${X(start)} ${Y + 5}l-4 6h8z` }));
  root.append(svgEl("circle", { class: "fill-accent", cx: X(value), cy: Y, r: 3.5 }));
  return root;
}

function parameterTable(free) {
  const anyProfile = free.some((p) => known(p.profile95[0]));
  const verdict = (p) => el("td", { class: kUndetermined.includes(p.verdict) ? "fail" : "" },
    (kIdentifiability[p.verdict] || spaced(p.verdict)) + (p.with.length ? " with " + p.with.join(", ") : ""));
  const columns = [
    ["parameter", (p) => p.name], ["unit", (p) => p.unit || "–"],
    ["#value", (p) => to(p.value, decimalsOf(p.se))], ["#std. error", (p) => num(p.se, 3)],
    ["#95 % interval", (p) => interval(p.ci95, decimalsOf(p.se))],
    ...(anyProfile ? [["#profile 95 %", (p) => interval(p.profile95, decimalsOf(p.se))]] : []),
    ["#CR bound", (p) => num(p.crb_se, 3)], ["#start", (p) => num(p.start, 4)],
    ["identifiability", verdict], ["value and uncertainty", uncertaintyBar],
  ];
  return [el("figure", { class: "plot" }, table(columns.map(([head]) => head), free.map((p) => columns.map(([, cell]) => cell(p))), { class: "wide" })),
    key(["k-accent", "95 % interval; thick: Cramér-Rao bound, one standard deviation"], anyProfile && ["k-quiet", "ends of the profile interval"],
      ["k-contrast", "start (triangle), where it is near"])];
}

function lossText({ relative, reason, without }) {
  if (reason) return `The excess mean-square error of the filter that these uncertainties cause is not known: ${reason}.`;
  const share = 100 * relative < 0.001 ? "< 0.001" : num(100 * relative, 2);
  return `These uncertainties cause an excess mean-square error of the filter, over the best there is, of ${share} % of tr P on average` +
    (without.length ? `; without ${without.join(", ")}, which ended at zero.` : ".");
}

function flatDirection({ names, weights }) {
  const sum = names.map((n, i) => `${weights[i] < 0 ? "−" : "+"} ${num(Math.abs(weights[i]), 2)} ${n}`).join(" ");
  return el("p", { class: "fail" }, `The data do not determine the combination ${sum} (relative to the standard error of each).`);
}

function showParameters() {
  const free = result.parameters.filter((p) => !p.fixed), fixed = result.parameters.filter((p) => p.fixed && matters(p));
  const loss = result.noise.excess_mean_square_error, { posterior } = result;
  section("parameters", "Parameters",
    free.length ? parameterTable(free) : null,
    result.covariance_kind ? note(`Standard errors from ${result.covariance_kind}. No unbiased estimator has a standard error below the Cramér-Rao (CR) bound, here at the estimate and for white noise.`) : null,
    fixed.length ? note(`Fixed: ${fixed.map((p) => `${p.name} = ${num(p.value, 6)}${p.unit ? " " + p.unit : ""}`).join(", ")}.`) : null,
    loss ? el("p", {}, lossText(loss)) : null,
    result.identifiability.unidentifiable_directions.map(flatDirection),
    posterior ? [table(["parameter", "#most probable", "prior"], posterior.parameters.filter((p) => known(p.map)).map((p) => [p.name, num(p.map, 5), p.prior])),
      note(`Posterior by ${posterior.method}, ${posterior.points} points; log evidence ${num(posterior.log_evidence, 7)}.`)] : null);
}

function showDerived(id, title) {
  if (!result.derived.length) return;
  section(id, title, derivedTable());
}
function derivedTable() {
  return table(["value", "unit", "#", "#std. error"], result.derived.map((d) => [d.name, d.unit || "–", to(d.value, decimalsOf(d.se)), num(d.se, 3)]));
}
