// Does the vehicle behave as the model says: its axle forces, its track?

const kManyDots = 400;  // overlap, so that they are drawn faint

function axleForce({ name, slip, force, curve_slip, curve_force }) {
  const degrees = (values) => values.map((v) => v * 180 / Math.PI), kilo = (values) => values.map((v) => v / 1000);
  const xs = degrees(curve_slip), ys = kilo(curve_force);
  return figure("Axle force", name, chart({ x: spread(xs, 0.02), y: spread([...ys, ...kilo(force)]), xLabel: "slip angle [deg], signed as the force", yLabel: "side force [kN]" }, (g) => {
    g.level(0, "quiet thin");
    g.upright(0, "quiet thin");
    g.dots(degrees(slip), kilo(force), "fill-quiet", 1.8, slip.length > kManyDots ? 0.35 : 0.7);
    g.path(xs, ys, "accent line");
  }), key(["k-accent", "fitted"], slip.length && ["k-quiet k-dots", `from the recording, means of 0.1 s${data.high_pass_filtered ? ", high-pass filtered (only ay was measured)" : ""}`]));
}

// As driven, and where that is nearly a straight line also with the sides stretched.
function tracks() {
  const all = (k) => data.tracks.flatMap((t) => t[k]), reach = (k) => Math.max(...all(k).map(Math.abs)) || 1;
  const drawn = (equal) => chart({ x: spread(all("X")), y: spread(all("Y")), xLabel: "X [m]", yLabel: "Y, to the left [m]", equal }, (g) => {
    for (const t of data.tracks) g.path(t.X, t.Y, t.name === "simulated" ? "accent line" : "quiet line dash");
  });
  const several = data.tracks.length > 1;
  return [
    figure("Track", several ? "longest segment" : "longest segment, simulated", drawn(true),
      key(["k-accent", "simulated"], several && ["k-quiet k-dash", "from measured yaw rate and sideslip"])),
    reach("Y") < 0.25 * reach("X") ? figure("Track, sides stretched", "the same, each axis with its own scale", drawn(false)) : null,
  ];
}

function showVehicle() {
  if (!data.axles.length && !data.tracks.length) return showDerived("derived", "Derived values");
  section("car", "The vehicle",
    note("Axle forces: the dots come from force and moment balances of the recording alone, without a tyre model; the line is the fitted axle."),
    grid(data.axles.map(axleForce), data.tracks.length ? tracks() : null),
    result.derived.length ? [el("h3", {}, "Characteristic values"), derivedTable()] : null);
}
