// How does the vehicle handle, by its log and by its model? The engineer's sheet.

const kDirections = { r: "Yaw rate", ay: "Lateral acceleration", beta: "Sideslip" };

// The value with its standard error; without one of them, the reason stands where the mouse rests.
function handlingCell({ value, se, why }) {
  const text = known(value) ? to(value, known(se) ? decimalsOf(se) : null) + (known(se) ? ` ± ${num(se, 2)}` : "") : "–";
  return el("td", { class: "n", ...(why ? { title: why } : {}) }, text);
}

function handlingTable({ figures }) {
  if (!figures.length) return null;
  const reasons = figures.flatMap(({ log, model }) => [log.why, model.why]).filter(Boolean);
  return [table(["figure", "unit", "#log", "#model"], figures.map((f) => [f.name, f.unit || "–", handlingCell(f.log), handlingCell(f.model)])),
    reasons.length ? note("Where a number or its standard error is missing: " + [...new Set(reasons)].join(" ")) : null];
}

// Means of the log with their 95 % intervals over the model's line and band. side(point): [log, model].
function logOverModel(points, at, side, axes) {
  const xs = points.map(at), log = points.map((p) => side(p)[0]), model = points.map((p) => side(p)[1]);
  const ends = (values, k) => values.map((v) => v.ci95[k]), middle = (values) => values.map((v) => v.value);
  const all = [...middle(log), ...middle(model), ...[0, 1].flatMap((k) => [...ends(log, k), ...ends(model, k)])];
  return chart({ x: spread(xs), y: spread(all), ...axes }, (g) => {
    g.envelope(xs, ends(model, 0), ends(model, 1), "fill-band");
    g.path(xs, middle(model), "accent line");
    xs.forEach((x, i) => { if (known(log[i].ci95[0])) g.path([x, x], log[i].ci95, "contrast thin"); });
    g.dots(xs, middle(log), "fill-contrast", 2.5, 1);
  });
}

function characteristicCurve({ curve, steering }) {
  if (curve.length < 2) return null;
  const drawn = (title, log, model, yLabel) => {
    if (!curve.some((p) => known(p[log].value))) return null;
    return figure(title, "ISO 4138", logOverModel(curve, (p) => p.ay, (p) => [p[log], p[model]], { xLabel: "lateral acceleration vx r [m/s²]", yLabel }));
  };
  return [drawn("Characteristic curve", "angle_log", "angle_model", `angle of the ${steering} [deg]`),
    drawn("Sideslip", "sideslip_log", "sideslip_model", "sideslip angle [deg]")];
}

function frequencyResponse({ output, unit, points }) {
  const x = { xLabel: "frequency [Hz]" }, name = kDirections[output] || output;
  return [
    figure(`${name}, gain`, "ISO 7401", logOverModel(points, (p) => p.frequency, (p) => [p.gain_log, p.gain_model], { ...x, yLabel: `gain${unit === "-" ? "" : unitText(unit)}` })),
    figure(`${name}, phase`, "ISO 7401", logOverModel(points, (p) => p.frequency, (p) => [p.phase_log, p.phase_model], { ...x, yLabel: "phase [deg]" })),
  ];
}

function showHandling() {
  const sheet = result.handling;
  if (!sheet) return;
  for (const part of sheet.sections) {
    const plots = part.standard === "ISO 4138" ? characteristicCurve(sheet) : part.standard === "ISO 7401" ? sheet.responses.map(frequencyResponse) : null;
    section(part.standard.toLowerCase().replace(" ", "-"), `${part.standard}: ${part.title}`, handlingTable(part),
      part.remarks.map((text) => note(text)), plots ? grid(plots) : null,
      plots && plots.length ? key(["k-accent", "model, with its 95 % band where it has errors"], ["k-contrast", "log, with 95 % intervals"]) : null);
  }
  section("handling-remarks", "Log and model", sheet.remarks.map((text) => note(text)));
}
