// What does the page have to show? `result` as the program prints it, `data` what is drawn beyond it.

const block = (id) => JSON.parse(document.getElementById(id).textContent);
const result = block("result"), data = block("data");

// Seconds since 1970 and the like are counted from the first row.
function countFromFirstRow() {
  const [first] = data.time, last = data.time[data.time.length - 1];
  if (!data.time.length || Math.abs(first) <= 20 * (last - first)) return "time [s]";
  const since = (t) => t - first;
  data.time = data.time.map(since);
  data.nis.time = data.nis.time.map(since);
  data.joints = data.joints.map(since);
  if (data.held_from !== null) data.held_from -= first;
  data.forecasts = data.forecasts.map((span) => span.map(since));
  data.used = data.used.map((span) => span.map(since));
  return `time since ${first} s [s]`;
}
const timeLabel = countFromFirstRow();

function timeRange() {
  const [first = 0] = data.time, last = data.time[data.time.length - 1];
  return [first, last > first ? last : first + 1];
}

const heldOut = data.held_from !== null;
// A fit of a simulation leaves residuals, a filter innovations.
const leavesResiduals = data.axles.length > 0 && !data.channels.some((c) => c.one_step);
const leftover = leavesResiduals ? "residual" : "innovation";
