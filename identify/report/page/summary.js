// What came of the job? Its title, its status, and what speaks against it.

const kVerbs = {
  tune: "Kalman filter tuning", check: "Kalman filter check", fit: "Parameter estimation",
  shape: "Coloured noise", track: "Recursive estimation", handling: "Handling of a vehicle",
};
const kStatus = {
  ok: ["good", "✓ Usable"], rejected: ["bad", "✗ Rejected"], untrusted: ["bad", "✗ Not to be trusted"],
  not_converged: ["doubt", "! Not converged"],
};
const kSeverity = { serious: "bad", warning: "doubt", note: "good" };

function showHeader() {
  const { model, verb, objective, inputs } = result;
  document.title = `${model || verb} – Identikal`;
  const method = objective.method && objective.method !== verb ? ` · ${spaced(objective.method)}` : "";
  document.querySelector(".kind").textContent = `Identikal · ${kVerbs[verb] || verb}${method}`;
  document.querySelector("h1").textContent = model || "(a model without name)";
  document.querySelector(".facts").textContent = inputs.length > 3
    ? `${inputs.length} recordings, ${inputs.reduce((n, i) => n + i.used, 0)} rows used`
    : inputs.map((i) => `${i.path}: ${i.rows} rows, ${i.used} used`).join(" · ");
}

function objectiveFacts(failed) {
  const o = result.objective, tests = result.tests.length, out = [];
  if (known(o.log_likelihood)) out.push(`log-likelihood ${num(o.log_likelihood, 9)}` + (known(o.log_likelihood_start) ? ` (start ${num(o.log_likelihood_start, 9)})` : ""));
  if (known(o.aic)) out.push(`AIC ${num(o.aic, 7)}, BIC ${num(o.bic, 7)}`);
  if (o.starts > 0) out.push(`${o.starts_at_optimum} of ${o.starts} starts reached the same optimum`);
  if (tests) out.push(failed ? `${failed} of ${tests} tests fail` : `${tests} of ${tests} tests pass`);
  return out;
}

function warningItem({ severity, code, text, remedy }) {
  const level = severity in kSeverity ? severity : "note";
  return el("li", { class: `tone-${kSeverity[level]}` }, el("span", { class: "mark" }, `${level}: ${spaced(code)}. `), text,
    remedy ? el("span", { class: "note" }, ` → ${remedy}`) : null);
}

function showStatus() {
  const { code, message } = result.status, failed = result.tests.filter((t) => !t.pass).length;
  let [tone, title] = kStatus[code] || ["doubt", spaced(code)];
  // The search ended well and the data determine the values; what the tests say of the model the warnings explain.
  if (failed && code === "ok") [tone, title] = ["doubt", `! Usable, but ${failed} of ${result.tests.length} tests fail`];
  const facts = objectiveFacts(failed), order = Object.keys(kSeverity);
  const warnings = [...result.warnings].sort((a, b) => order.indexOf(a.severity) - order.indexOf(b.severity));
  document.querySelector("main").append(el("div", { class: `verdict tone-${tone}`, id: "verdict" },
    el("strong", {}, title), el("p", {}, message),
    facts.length ? el("p", { class: "note" }, facts.join(" · ")) : null,
    warnings.length ? el("ul", {}, warnings.map(warningItem)) : null));
}

// What `identikal export` prints.
function showExports() {
  const blocks = block("paste").map(({ language, text }) => {
    const copy = el("button", { type: "button" }, "Copy"), pre = el("pre", {}, text);
    copy.addEventListener("click", () => {
      getSelection().selectAllChildren(pre);
      document.execCommand("copy");
      copy.textContent = "Copied";
      setTimeout(() => { copy.textContent = "Copy"; }, 1500);
    });
    return el("details", {}, el("summary", {}, language), el("div", { class: "code" }, pre, copy));
  });
  if (!blocks.length) return;
  section("paste", "Export", blocks);
  addEventListener("beforeprint", () => { blocks[0].open = true; });
}

function showNotes() {
  section("remarks", "Remarks", result.notes.length ? el("div", { class: "code" }, el("pre", {}, result.notes.join("\n"))) : null);
}

function showOrigin() {
  const { command, model_path, model_sha256 } = data.provenance;
  const files = [...result.inputs.map((i) => [i.path, i.sha256]), [model_path, model_sha256]];
  const versions = Object.entries(block("versions")).map(([name, version]) => `${name} ${version}`).join(", ");
  const took = known(result.timing_s) ? `. The job took ${num(result.timing_s, 3)} s.` : ".";
  section("origin", "Reproduce",
    el("div", { class: "code" }, el("pre", {}, command)),
    table(["file", "SHA-256"], files.map(([path, digest]) => [path, el("td", { class: "long" }, el("code", {}, digest))])),
    note(`${versions}${took} Same command, same files, same version: same numbers.`));
}
