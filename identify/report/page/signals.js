// What was measured, what does the model make of it, and what is left over?

const over = timePlots({
  whole: timeRange(), joints: data.joints,
  shades: heldOut ? [[data.held_from, timeRange()[1]]] : data.forecasts,
});
const thinning = data.rows > data.columns
  ? ` ${data.rows} rows are drawn in ${data.columns} columns: from the least to the largest of each, so that no peak is lost; zooming shows the same columns.` : "";
const overTime = (...facts) => [...facts.filter(Boolean), timeLabel].join(" · ");

function predictionNote() {
  const what = ["Drag to zoom, all plots over time together; double-click shows all."];
  if (heldOut) what.push("Shaded: held out for validation, the fit did not see it.");
  else if (data.forecasts.length) what.push("Shaded: simulation, predicted without any correction from there on, with two standard deviations either way" + (result.verb === "check" ? "." : "; the fit did see these rows."));
  if (data.joints.length) what.push(`Recordings${heldOut ? ", and what is held out behind them," : ""} are laid end to end; a dashed line is where the next begins.`);
  return note(what.join(" ") + thinning);
}

// How much of a channel is explained, by kind of prediction.
function fitText(channel) {
  const kinds = [["one step", "one_step"], ["simulation", "simulation"], ["held out", "hold_out"], ["held out, one step", "hold_out_one_step"]];
  const fits = kinds.map(([name, kind]) => [name, result.fit[kind][channel]]).filter(([, f]) => f && known(f.fit_percent));
  return fits.length ? "fit " + fits.map(([name, f]) => `${name} ${num(f.fit_percent, 4)} %`).join(", ") : "";
}

function showPredictions() {
  if (!data.channels.length) return;
  const reset = el("button", { type: "button", class: "reset" }, "Show all");
  reset.addEventListener("click", over.zoomOut);
  section("predictions", "Measured and predicted", reset, predictionNote(),
    data.channels.map((c) => over.timePlot(c.name, overTime(c.unit && `[${c.unit}]`, fitText(c.name)), {
      times: data.time, height: 220,
      lines: [{ label: "measured", line: c.measured, kind: "quiet", points: true }, { label: "one step", line: c.one_step, kind: "accent" },
        { label: "simulation", line: c.simulation, kind: "contrast" }],
      extent: { low: c.forecast_low, high: c.forecast_high, label: "±2 sd" } })),
    data.inputs.length ? el("h3", {}, "Inputs") : null,
    data.inputs.map((u) => over.timePlot(u.name, overTime(u.unit && `[${u.unit}]`), {
      times: data.time, height: 140, lines: [{ label: u.name, line: u.line, kind: "accent" }] })));
}

function changesTable({ names, changes }) {
  return table(["#since [s]", "#found [s]", "change"], changes.map((c) =>
    [num(c.since, 6), num(c.found, 6), names.map((n, i) => `${n} ${num(c.before[i], 4)} → ${num(c.after[i], 4)}`).join(", ")]));
}

function showTimeHistory() {
  if (!data.time_history.length) return;
  section("course", "Estimates over time", note("Mean and two standard deviations either way." + thinning),
    data.time_history.map((c) => over.timePlot(c.name, overTime(c.unit && `[${c.unit}]`), {
      times: data.time, height: 170, lines: [{ label: c.name, line: c.mean, kind: "accent" }], extent: { low: c.low, high: c.high, label: "±2 sd" } })),
    data.log_alarm ? over.timePlot("test for a change", overTime("log statistic"), {
      times: data.time, height: 140, lines: [{ label: "statistic", line: data.log_alarm, kind: "contrast" }],
      levels: known(data.log_threshold) ? [data.log_threshold] : [] }) : null,
    result.time_history && result.time_history.changes.length ? changesTable(result.time_history) : null);
}

function showInnovations() {
  const channels = data.channels.filter((c) => c.after), anyBefore = channels.some((c) => c.before);
  if (!channels.length) return;
  const before = !anyBefore ? "" : leavesResiduals
    ? " Before: the same with the parameters of the model file, over the standard deviation after."
    : " Before: the filter with the noise of the model file, by its own standard deviation.";
  const scaled = (c, when, line, kind) => over.timePlot(c.name, overTime(`${leftover} / σ` + (anyBefore ? `, ${when}` : "")), {
    times: data.time, height: 150, lines: [{ label: when, line, kind }], levels: [-2, 2], least: [-3, 3] });
  section("innovations", leavesResiduals ? "Residuals" : "Innovations",
    note(`Each ${leftover} over its standard deviation; dashed ±2, which 95 % of a good filter's stay within.${before}${thinning}`),
    channels.map((c) => [scaled(c, "after", c.after, "accent"), scaled(c, "before", c.before, "contrast")]),
    data.nis.time.length ? over.timePlot("NIS", overTime(`normalised ${leftover} squared / degrees of freedom`), {
      times: data.nis.time, height: 150, lines: [{ label: "NIS", line: { y: data.nis.value }, kind: "accent" }],
      extent: { low: { y: data.nis.low }, high: { y: data.nis.high }, label: "95 %" }, levels: [1],
      caption: `Means over ${data.nis.block} rows. 19 of 20 should lie in the band.` }) : null);
}
