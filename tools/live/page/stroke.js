// The few places on the way that stand for a drawn stroke.

// The points between which straight lines stay within `tolerance` of all points (Douglas and Peucker, 1973).
function corners(points, tolerance) {
  const kept = new Set([0, points.length - 1]), spans = [[0, points.length - 1]];
  while (spans.length) {
    const [from, to] = spans.pop(), [ax, ay] = points[from], [bx, by] = points[to];
    const length = Math.hypot(bx - ax, by - ay);
    let worst = tolerance, at = -1;
    for (let k = from + 1; k < to; ++k) {
      const [x, y] = points[k];
      const off =
          length > 0 ? Math.abs((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / length : Math.hypot(x - ax, y - ay);
      if (off > worst) [worst, at] = [off, k];
    }
    if (at < 0) continue;
    kept.add(at);
    spans.push([from, at], [at, to]);
  }
  return [...kept].sort((a, b) => a - b).map((k) => points[k]);
}

// At most `most` of the points [x, y], the last among them: its corners, as fine as they may be but no finer than
// `tolerance`. Where the stroke begins within `near` of `ball`, the ball is there already.
export function placesOf(points, {most, tolerance, ball, near}) {
  const beginsAtBall = points.length > 1 && Math.hypot(points[0][0] - ball[0], points[0][1] - ball[1]) < near;
  const whole = beginsAtBall ? [ball, ...points.slice(1)] : points, skipped = beginsAtBall ? 1 : 0;
  let found = corners(whole, tolerance);
  for (let coarser = 1.3 * tolerance; found.length - skipped > most; coarser *= 1.3) found = corners(whole, coarser);
  return found.slice(skipped);
}
