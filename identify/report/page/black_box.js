// What is a model from data alone? Order, poles, responses over time and frequency.

function orderCurve(box) {
  const kinds = [...new Set(box.candidates.map((c) => c.refinement))];
  const drawn = (title, key_, yLabel) => {
    const all = box.candidates.filter((c) => known(c[key_]));
    if (all.length < 2) return null;
    return figure(title, "", chart({ x: spread(all.map((c) => c.order)), y: spread(all.map((c) => c[key_])), xLabel: "states", yLabel }, (g) => {
      g.upright(box.order, "quiet thin dash");
      for (const kind of kinds) {
        const of = all.filter((c) => c.refinement === kind), own = kind === box.refinement;
        if (of.length > 1) g.path(of.map((c) => c.order), of.map((c) => c[key_]), own ? "accent line" : "contrast thin");
        g.dots(of.map((c) => c.order), of.map((c) => c[key_]), own ? "fill-accent" : "fill-contrast", 3, 1);
      }
    }));
  };
  return [drawn("Order", "bic", "BIC"), drawn("Held-out rows, simulated", "simulation_fit", "fit [%]"),
    drawn("Held-out rows, one step ahead", "prediction_fit", "fit [%]"), drawn(`Held-out rows, 1 to ${box.horizon} ahead`, "control_fit", "fit [%]")];
}

// Poles in the plane of q with 95 % intervals of both parts; the mirrored ones too.
function poleMap({ poles }) {
  const circle = Array.from({ length: 181 }, (_, k) => k * Math.PI / 90);
  const far = Math.max(1.08, ...poles.map((p) => 1.05 * Math.hypot(p.real, p.imaginary)));
  return figure("Poles", "q", chart({ x: [-far, far], y: [-far, far], equal: true, xLabel: "real part", yLabel: "imaginary part" }, (g) => {
    g.path(circle.map(Math.cos), circle.map(Math.sin), "quiet thin");
    for (const p of poles) {
      for (const imaginary of p.imaginary > 0 ? [p.imaginary, -p.imaginary] : [0]) {
        if (known(p.real_se) && p.imaginary > 0 && known(p.imaginary_se)) {
          g.path(circle.map((a) => p.real + 2.45 * p.real_se * Math.cos(a)), circle.map((a) => imaginary + 2.45 * p.imaginary_se * Math.sin(a)), "contrast thin");
        } else if (known(p.real_se)) {
          g.path([p.real - 1.96 * p.real_se, p.real + 1.96 * p.real_se], [imaginary, imaginary], "contrast thin");
        }
        g.dots([p.real], [imaginary], "fill-accent", 3, 1);
      }
    }
  }));
}

const around = (value, se, k) => value.map((v, i) => (known(v) && known(se[i]) ? v + k * 1.96 * se[i] : null));
const nameOfResponse = (r) => `${r.output} / ${r.input}`;

// The model over the estimate without a model, 95 % each.
function bodeOf(r) {
  const x = r.frequency.map(Math.log10);
  const drawn = (name, unit, value, se, spectral, spectralSe, toAxis, more) => {
    const low = around(value, se, -1).map(toAxis), high = around(value, se, 1).map(toAxis), middle = value.map(toAxis);
    const from = around(spectral, spectralSe, -1).map(toAxis), until = around(spectral, spectralSe, 1).map(toAxis);
    const reach = spread([...middle, ...spectral.map(toAxis)]);
    return figure(`${name} ${nameOfResponse(r)}`, "", chart({ x: spread(x, 0), y: reach, xLabel: "frequency [rad/s]", yLabel: unit, logX: true, ...more }, (g) => {
      g.envelope(x, low, high, "fill-band");
      x.forEach((v, i) => { if (known(from[i]) && known(until[i])) g.path([v, v], [from[i], until[i]], "contrast thin"); });
      g.dots(x, spectral.map(toAxis), "fill-contrast", 1.8, 0.9);
      g.path(x, middle, "accent line");
    }));
  };
  const log = (v) => (known(v) && v > 0 ? Math.log10(v) : null), same = (v) => v;
  return [drawn("Gain", "gain", r.gain, r.gain_se, r.spectral_gain, r.spectral_gain_se, log, { logY: true }),
    drawn("Phase", "phase [deg]", r.phase, r.phase_se, r.spectral_phase, r.spectral_phase_se, same, {})];
}

function overRows(title, r, kind) {
  const rows = r.value.map((_, k) => k), low = around(r.value, r.se, -1), high = around(r.value, r.se, 1);
  return figure(`${title} ${nameOfResponse(r)}`, r.kernel ? `kernel ${r.kernel}` : "", chart({ x: [0, rows.length - 1], y: spread([...r.value, 0]), xLabel: "rows", yLabel: "SI" }, (g) => {
    g.level(0, "quiet thin");
    g.envelope(rows, low, high, "fill-band");
    g.path(rows, r.value, `${kind} line`);
  }));
}

// A(q) and the like as a table of coefficients.
function polynomialTable({ polynomials, output_names: outputs }) {
  if (!polynomials.length) return null;
  const rows = polynomials.flatMap((p) => p.value.map((v, k) => (p.se[k] === 0 ? null : [p.name + (p.input ? ` of ${p.input}` : "") + (outputs.length > 1 ? ` to ${p.output}` : ""),
    `q^-${p.delay + k}`, num(v), known(p.se[k]) ? num(p.se[k], 2) : "–"])).filter(Boolean));
  return table(["polynomial", "power", "#coefficient", "#standard error"], rows);
}

// Curves that a linear model has not.
function nonlinearityTable({ nonlinearities }) {
  if (!nonlinearities.length) return null;
  const places = { input: "in its place", output: "where it is measured" };
  const share = (v) => (known(v) ? num(100 * v, 3) : "–");
  return table(["curve", "where", "#of the innovations' squares [%]", "#of the simulation's [%]", "#p"], nonlinearities.slice(0, 8).map((c) => [
    `${c.shape} of ${c.place === "input" ? c.input : c.output}`, places[c.place] ?? `acting like ${c.input}`, share(c.of_innovations), share(c.of_simulation), num(c.p, 2)]));
}

function showBlackBox() {
  const box = result.black_box;
  if (!box) return;
  section("order", "Order", grid(orderCurve(box)), key(["k-accent", `found by ${spaced(box.refinement)}`], ["k-contrast", "the other candidates"], ["k-quiet k-dash", "chosen"]));
  const curves = nonlinearityTable(box);
  if (curves) section("linearity", "What a linear model lacks", curves);
  section("poles", "Poles", grid(poleMap(box)), polynomialTable(box), key(["k-accent", "poles of the model"], ["k-contrast", "95 % regions"]));
  section("responses", "Responses", grid(box.step_responses.map((r) => overRows("Step", r, "accent")), box.impulse_responses.map((r) => overRows("Impulse without a model", r, "contrast"))),
    box.step_responses.length ? key(["k-accent", "model, with its 95 % band"], ["k-contrast", "by regularised least squares, with its 95 % band"]) : null);
  section("frequency", "Frequency response", grid(box.frequency_responses.map(bodeOf)),
    box.frequency_responses.length ? key(["k-accent", "model, with its 95 % band"], ["k-contrast", "spectral analysis, with 95 % intervals"]) : null);
}
