// Which functions do parameters stand for, and how surely?

function curveOf(c) {
  const low = c.value.map((v, i) => (known(c.se[i]) ? v - 1.96 * c.se[i] : null)), high = c.value.map((v, i) => (known(c.se[i]) ? v + 1.96 * c.se[i] : null));
  const reach = spread([...c.value, ...low.filter(known), ...high.filter(known)]);
  const smooth = known(c.freedom) ? `follows the data by ${num(c.freedom, 2)} free numbers` : "";
  const unit = (name, of) => (of ? `${name} [${of}]` : name);
  return figure(c.name, smooth, chart({ x: spread(c.at, 0), y: reach, xLabel: unit(c.axis, c.axis_unit), yLabel: unit(c.name, c.unit) }, (g) => {
    g.level(0, "quiet thin");
    g.envelope(c.at, low, high, "fill-band");
    g.path(c.at, c.value, "accent line");
  }));
}

function showCurves() {
  if (!result.curves.length) return;
  section("curves", "Curves", grid(result.curves.map(curveOf)), key(["k-accent", "estimate, with its 95 % band"]));
}
