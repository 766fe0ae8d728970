// What is in the recordings?

function usedRows() {
  const [from, until] = timeRange();
  return figure("Rows used", "", chart({ x: [from, until], y: [0, 1], height: 84, xLabel: timeLabel, bare: true }, (g) => {
    for (const [a, b] of data.used) g.span(a, b, "fill-accent", 6, 0.6);
    if (heldOut) g.span(data.held_from, until, "fill-contrast", 6, 0.35);
    for (const t of data.joints) g.upright(t, "quiet thin dash");
  }), key(["k-accent", "used"], heldOut && ["k-contrast", "held out"]));
}

function showRecordings() {
  const { recordings } = data, parts = recordings.some((r) => r.held);
  // A recording by its name, and where some of it is held out, by which part of it.
  const heads = parts ? ["recording", "rows are"] : ["recording"];
  const named = (r) => (parts ? [r.name, r.held ? "held out" : "fitted"] : [r.name]);
  const channels = recordings.flatMap((r) => r.channels.map((c) => [...named(r), c.input ? "input" : "output", c.name, c.unit || "–",
    num(c.low, 5), num(c.mean, 5), num(c.high, 5), String(c.missing), percent(100 * c.missing / (r.rows || 1))]));
  const gaps = recordings.flatMap((r) => r.gaps.map((g) => [...named(r), num(g.from, 7), num(g.to, 7), num(g.to - g.from, 4)]));
  section("data", "Data",
    table([...heads, "#rows", "#duration [s]", "#step [s]", "#rate [Hz]", "#longest step [s]", "#gaps"], recordings.map((r) =>
      [...named(r), String(r.rows), num(r.to - r.from, 6), num(r.step, 5), num(1 / r.step, 5), num(r.longest_step, 5), String(r.gap_count)])),
    data.time.length ? usedRows() : null,
    channels.length ? table([...heads, "kind", "channel", "unit", "#least", "#mean", "#largest", "#missing", "#"], channels) : null,
    gaps.length ? [el("h3", {}, "Longest gaps"), table([...heads, "#from [s]", "#to [s]", "#length [s]"], gaps)] : null);
}
