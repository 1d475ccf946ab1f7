// What has come of each estimator, for as long as it is drawn.

const MAX_POINTS = 12000;
const LEAST_STEPS = 20;

export class History {
  constructor() {
    this.points = new Map(); // by estimator, in the order of steps
  }

  add(estimate) {
    const points = this.points.get(estimate.name) ?? [];
    this.points.set(estimate.name, points);
    const last = points.at(-1);
    if (last && estimate.boot !== last.boot && estimate.step < last.step) points.length = 0; // the mesh began again
    const at = place(points, estimate.step);
    const known = points[at];
    if (known?.step === estimate.step) {
      if (known.boot !== estimate.boot || known.revision <= estimate.revision) points[at] = estimate;
    } else if (at === points.length) {
      points.push(estimate);
    } else if (at > 0) {
      points.splice(at, 0, estimate);
    }
    if (points.length > MAX_POINTS * 1.1) points.splice(0, points.length - MAX_POINTS);
  }

  of(name) {
    return this.points.get(name) ?? [];
  }

  newest(name) {
    return this.of(name).at(-1);
  }

  // The newest step of these estimators; those of a mesh that ended before the present one began do not count.
  newestStep(names) {
    const newest = names.map((name) => this.newest(name)).filter(Boolean);
    const latest = Math.max(0, ...newest.map((one) => Number(one.sent_ns) / 1e6));
    return Math.max(0, ...newest.filter((one) => latest - Number(one.sent_ns) / 1e6 < 5000).map((one) => one.step));
  }
}

// The first of the last `count` steps, or the first that there is where fewer have come.
export function firstStep(series, to, count) {
  const first = Math.min(to, ...series.filter((one) => one.points.length).map((one) => one.points[0].step));
  return Math.min(Math.max(to - count, first), to - LEAST_STEPS);
}

// Runs of points without a hole: where steps are missing, no band is drawn.
export function runs(points, from, to) {
  const shown = points.filter((one) => one.step >= from && one.step <= to);
  const gaps = shown.slice(1).map((one, i) => one.step - shown[i].step);
  const usual = gaps.length ? [...gaps].sort((a, b) => a - b)[gaps.length >> 1] : 1;
  const found = [];
  shown.forEach((one, i) => {
    if (i === 0 || gaps[i - 1] > Math.max(4 * usual, 2)) found.push([]);
    found.at(-1).push(one);
  });
  return found;
}

// Where a step is, or belongs, in points in the order of steps.
function place(points, step) {
  let low = 0;
  let high = points.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (points[middle].step < step) low = middle + 1;
    else high = middle;
  }
  return low;
}
