// How are numbers, elements and tables written? Text goes into the page as text, never as markup.

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

// As many decimals as the standard error leaves: two of its digits.
function decimalsOf(se) { return known(se) && se > 0 ? Math.max(0, 1 - Math.floor(Math.log10(se))) : null; }

function to(v, decimals) {
  if (!known(v)) return "–";
  return decimals === null || decimals > 9 || Math.abs(v) >= 1e7 ? num(v) : v.toFixed(decimals);
}

const unitText = (unit) => (unit ? ` [${unit}]` : "");
const percent = (v) => (known(v) ? num(v, 4) + " %" : "–");
const spaced = (code) => code.replaceAll("_", " ");

function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children.flat(Infinity).filter((c) => c !== null && c !== undefined));
  return node;
}

// A head that begins with # is that of a column of numbers; a row may hold cells of its own making.
function table(heads, rows, attributes = {}) {
  const kinds = heads.map((h) => (h.startsWith("#") ? { class: "n" } : {}));
  const cell = (value, i) => (value instanceof HTMLTableCellElement ? value : el("td", kinds[i], value));
  return el("div", { class: "scroll" }, el("table", attributes,
    el("thead", {}, el("tr", {}, heads.map((h, i) => el("th", kinds[i], h.replace("#", ""))))),
    el("tbody", {}, rows.map((row) => el("tr", {}, row.map(cell))))));
}

function figure(title, unit, body, caption) {
  return el("figure", { class: "plot" }, el("div", { class: "title" }, title, el("span", {}, unit || "")), body,
    caption ? el("figcaption", {}, caption) : null);
}

// What the lines of a chart are: [class of the swatch, text] each.
function key(...entries) {
  return el("div", { class: "key" }, entries.filter(Boolean).map(([kind, text]) => el("span", {}, el("i", { class: kind }), text)));
}

function grid(...children) {
  const all = children.flat(Infinity).filter(Boolean);
  return all.length ? el("div", { class: "grid" }, all) : null;
}

const note = (...text) => el("p", { class: "note" }, ...text);

// A section of the page with its link at the top; nothing where there is nothing to show.
function section(id, title, ...children) {
  const all = children.flat(Infinity).filter(Boolean);
  if (all.length === 0) return;
  document.querySelector("nav").append(el("a", { href: "#" + id }, title));
  document.querySelector("main").append(el("section", { id }, el("h2", {}, title), all));
}
