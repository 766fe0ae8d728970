// Are innovations or residuals white and normal?

const afterAndBefore = (before, ...more) => key(["k-accent", "after"], before.length && ["k-contrast", "before"], ...more);
// Holds 95 % of the correlations of white noise.
const whiteLimit = ({ samples }) => 1.96 / Math.sqrt(samples || 1);

function correlogram(channel, after, before) {
  const lags = after.autocorrelation.map((_, k) => k + 1), limit = whiteLimit(after);
  const bound = Math.min(1, Math.max(limit, ...[...after.autocorrelation, ...before.autocorrelation].filter(known).map(Math.abs)) * 1.1);
  return figure("Correlogram", channel, chart({ x: [0, lags.length + 1], y: [-bound, bound], xLabel: "lag [samples]", yLabel: "autocorrelation" }, (g) => {
    g.band(-limit, limit);
    g.level(0, "quiet thin");
    g.dots(lags, before.autocorrelation, "contrast thin", 2.2, 1);
    g.stems(lags, after.autocorrelation, "accent", 2.4);
  }), afterAndBefore(before.autocorrelation));
}

function correlationWithInput(channel, after, input) {
  const r = after.from_input[input], half = (r.length - 1) / 2, limit = whiteLimit(after);
  const bound = Math.min(1, Math.max(limit, ...r.filter(known).map(Math.abs)) * 1.1);
  const name = data.inputs[input] ? data.inputs[input].name : input + 1;
  return figure("Correlation with input", `${channel} with ${name}`, chart({ x: [-half - 1, half + 1], y: [-bound, bound], xLabel: "lag [samples]; right: input earlier", yLabel: "correlation" }, (g) => {
    g.band(-limit, limit);
    g.level(0, "quiet thin");
    g.upright(0, "quiet thin dash");
    g.stems(r.map((_, k) => k - half), r, "accent", 2);
  }));
}

function quantiles(channel, after, before) {
  const reach = Math.max(3, ...after.normal.map(Math.abs), ...after.seen.map(Math.abs)) * 1.05;
  return figure("Quantiles", channel, chart({ x: [-reach, reach], y: [-reach, reach], xLabel: "normal quantile", yLabel: `${leftover} / σ` }, (g) => {
    g.path([-reach, reach], [-reach, reach], "quiet thin dash");
    g.dots(before.normal, before.seen, "fill-contrast", 1.5, 0.5);
    g.dots(after.normal, after.seen, "fill-accent", 2);
  }), afterAndBefore(before.normal, ["k-quiet k-dash", "normal"]));
}

function histogram(channel, { edges, count, samples, mean, sd, outside }) {
  const share = count.map((n) => n / (samples * (edges[1] - edges[0]))), normal = (x) => Math.exp(-x * x / 2) / Math.sqrt(2 * Math.PI);
  return figure("Histogram", `${channel} · mean ${num(mean, 3)}, sd ${num(sd, 3)}`, chart({ x: [edges[0], edges[edges.length - 1]], y: [0, Math.max(0.42, ...share) * 1.06], xLabel: `${leftover} / σ`, yLabel: "density" }, (g) => {
    share.forEach((s, k) => s > 0 && g.bar(edges[k], edges[k + 1], s, "fill-accent", 0.55));
    const xs = Array.from({ length: 91 }, (_, k) => -4.5 + k * 0.1);
    g.path(xs, xs.map(normal), "ink line");
  }), outside ? `${outside} of ${samples} lie outside.` : null);
}

function spectrum(channel, after, before) {
  const log = (v) => (v > 0 ? Math.log10(v) : null);
  const level = after.level.map(log), old = before.level.map(log), [low, high] = data.level_band.map(log);
  return figure("Spectrum", channel, chart({ x: [0, data.frequency[data.frequency.length - 1]], y: spread([...level, ...old, low, high, -0.3, 0.3]), xLabel: "frequency [Hz]", yLabel: "power over white", logY: true }, (g) => {
    if (known(low) && known(high)) g.band(low, high);
    g.level(0, "ink thin dash");
    g.path(data.frequency, old, "contrast thin");
    g.path(data.frequency, level, "accent line");
  }), afterAndBefore(old, ["k-quiet k-dash", "white; band 95 %"]));
}

function whitenessOf({ name, innovations_after: after, innovations_before: before }) {
  return grid(after.autocorrelation.length ? correlogram(name, after, before) : null,
    after.from_input.map((_, input) => correlationWithInput(name, after, input)),
    after.normal.length ? [quantiles(name, after, before), histogram(name, after)] : null,
    after.level.length ? spectrum(name, after, before) : null);
}

function testTable() {
  return table(["test", "channel", "#value", "#accepted", "#p", ""], result.tests.map((t) => [spaced(t.id), t.channel || "all", num(t.value, 4),
    known(t.interval[0]) ? `${num(t.interval[0], 4)} … ${num(t.interval[1], 4)}` : "–", num(t.p, 2),
    el("td", { class: t.pass ? "" : "fail" }, t.pass ? "✓ pass" : "✗ FAIL")]));
}

function showWhiteness() {
  const channels = data.channels.filter((c) => c.after);
  if (!channels.length) return;
  const spectra = data.segments > 1 ? ` Spectra are means over ${data.segments} segments of ${data.segment} rows.`
    : data.segments === 0 ? " Too few rows for a spectrum." : "";
  section("whiteness", "White and normal?",
    note(`White ${leftover}s are correlated neither with themselves nor with the inputs, and their spectrum is flat. Bands hold 95 % of white noise; correlations are scaled to the same variance at every lag.${spectra}`),
    channels.map(whitenessOf),
    result.tests.length ? [el("h3", {}, "Tests"), testTable()] : null);
}

function showShaping() {
  const { shaping } = result;
  if (!shaping || shaping.candidates.length < 2) return;
  section("shaping", "Shaping filters",
    table(["noise", "channels", "#poles", "#zeros", "#log-likelihood", "#BIC"], shaping.candidates.map((c) =>
      [c.noise_source, c.channels, c.order || "", c.order ? c.zeros : "", num(c.log_likelihood, 8), num(c.bic, 8)])),
    shaping.predictions.length ? [el("h3", {}, "Held out: rms error of predictions"),
      table(["channel", "#steps", "#white", "#shaped"], shaping.predictions.map((p) => [p.channel + unitText(p.unit), p.steps, num(p.rmse_without, 4), num(p.rmse_with, 4)]))] : null);
}
