// How does the likelihood look around the estimate, and how was it found?

const kDrop95 = 3.84;   // 2 (L max - L) at the ends of a 95 % interval
const kSameOptimum = 1e-6;

function profileOf(p) {
  const profile = data.profiles.find((q) => q.name === p.name);
  const xs = profile ? profile.value : Array.from({ length: 41 }, (_, k) => p.value + (k - 20) * 0.14 * p.se);
  const range = spread(xs, 0.02), fine = Array.from({ length: 81 }, (_, k) => range[0] + k * (range[1] - range[0]) / 80);
  return figure(profile ? "Profile" : "Normal approximation", p.name, chart({ x: range, y: [0, 8], xLabel: p.name + unitText(p.unit), yLabel: "2 (L max − L)" }, (g) => {
    g.level(kDrop95, "quiet thin dash");
    g.upright(p.value, "quiet thin");
    g.path(fine, fine.map((x) => ((x - p.value) / p.se) ** 2), "contrast thin dash");
    if (!profile) return;
    g.path(profile.value, profile.drop, "accent line");
    g.dots(profile.value, profile.drop, "fill-accent", 2, 1);
  }), key(profile && ["k-accent", "likelihood, others re-estimated"], ["k-contrast k-dash", "from the standard error"], ["k-quiet k-dash", "95 %"]));
}

function correlationMatrix({ names, matrix }) {
  const n = names.length, longest = Math.max(...names.map((s) => s.length));
  const margin = Math.min(120, 12 + 6.5 * longest), size = Math.min(46, (360 - margin) / n), width = margin + n * size + 4;
  const root = svgEl("svg", { viewBox: `0 0 ${width} ${n * size + margin + 6}`, style: `max-width:${Math.min(560, width * 1.3)}px`, role: "img", "aria-label": "correlation of the estimates" });
  const add = (tag, attributes, text) => root.append(svgEl(tag, attributes, text));
  matrix.forEach((row, i) => row.forEach((rho, j) => {
    const x = margin + j * size, y = i * size + 2;
    add("rect", { class: "frame", x, y, width: size, height: size });
    if (!known(rho)) return;
    add("rect", { class: rho < 0 ? "fill-contrast" : "fill-accent", opacity: Math.abs(rho) * 0.85, x: x + 0.5, y: y + 0.5, width: size - 1, height: size - 1 });
    if (size >= 26) add("text", { class: "label", x: x + size / 2, y: y + size / 2 + 4, "text-anchor": "middle" }, rho.toFixed(2));
  }));
  names.forEach((name, i) => {
    add("text", { x: margin - 5, y: (i + 0.5) * size + 6, "text-anchor": "end" }, name);
    add("text", { "text-anchor": "end", transform: `translate(${margin + (i + 0.5) * size + 4} ${n * size + 8}) rotate(-90)` }, name);
  });
  return figure("Correlation of the estimates", "", root, key(["k-accent", "positive"], ["k-contrast", "negative"]));
}

// What is to be said of the starts, a line each.
function startTexts(searches) {
  const { log_likelihood_start: start, starts, starts_at_optimum, method } = result.objective, out = [];
  if (starts) out.push(`${starts_at_optimum} of ${starts} starts reached the same optimum.`);
  if (result.tyre_curve && known(start) && Math.abs(start - searches[0][0]) > 1e-3) {
    out.push(`Local searches run from the best of the starts tried; the first begins at ${num(searches[0][0], 7)}, where the values of the model file have ${num(start, 7)}.`);
  }
  if (method === "trajectory") out.push("Local searches of the output-error fit that the trajectory begins with.");
  return out.map((text) => el("div", {}, text));
}

function convergence(searches) {
  const best = Math.max(...searches.flat().filter(known));
  const below = searches.map((s) => s.map((v) => (known(v) ? Math.log10(Math.max(best - v, kSameOptimum)) : null)));
  const longest = Math.max(...searches.map((s) => s.length - 1)), several = searches.length > 1;
  return figure("Convergence", `${searches.length} local ${several ? "searches" : "search"}`, chart({ x: [0, longest], y: spread([...below.flat(), Math.log10(kSameOptimum)]), xLabel: "iteration", yLabel: "log-likelihood below the best", logY: true }, (g) => {
    below.forEach((s, k) => {
      g.path(s.map((_, i) => i), s, k === 0 ? "accent line" : "quiet thin");
      g.dots([s.length - 1], [s[s.length - 1]], k === 0 ? "fill-accent" : "fill-quiet", 2.5, 1);
    });
  }), [key(["k-accent", result.tyre_curve ? "best start" : "first start"], several && ["k-quiet", "others"]), startTexts(searches)]);
}

function showLikelihood() {
  const { names, matrix } = result.correlation, searches = data.searches.filter((s) => s.length > 1);
  const plots = grid(result.parameters.filter((p) => !p.fixed && known(p.se) && p.se > 0).map(profileOf),
    matrix && names.length > 1 ? correlationMatrix({ names, matrix }) : null,
    searches.length ? convergence(searches) : null);
  if (!plots) return;
  section("likelihood", "Likelihood and search",
    data.profiles.length === 0 ? note("No likelihood profiles: the estimator does not maximise a likelihood, or one evaluation takes too long for some twenty of them.") : null,
    result.covariance_kind.includes("sandwich") && data.profiles.length ? note("Profiles take the residuals as white; the standard errors allow for what they are, and are the ones to trust.") : null,
    plots);
}
