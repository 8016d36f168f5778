// ---- live: what comes while somebody looks on ----

// So much is kept, and so much of it is seen in a plot, s.
const KEPT_S = 120, SEEN_S = 10;

// A clock whose samples come one after the other.
function growing() {
  const times = [];
  return {
    times,
    get count() { return times.length; },
    get rate() { return times.length > 1 ? (times.length - 1) / Math.max(1e-9, times[times.length - 1] - times[0]) : 0; },
    time: i => times[Math.max(0, Math.min(times.length - 1, i))] ?? 0,
    at: t => {
      let low = 0, high = Math.max(0, times.length - 1);
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (times[middle] <= t + 1e-6) low = middle; else high = middle - 1;
      }
      return low;
    },
  };
}

// Takes a frame into series that grow; false if it says nothing new. A clock that begins anew is another run.
function taken(joints, frame) {
  const { times } = joints.clock, last = times[times.length - 1];
  if (frame.time_s === last) return false;
  const series = joints.list.flatMap(joint => [joint.goal, joint.present]);
  const forget = count => [times, ...series].forEach(values => values.splice(0, count));
  if (frame.time_s < last) forget(times.length);
  times.push(frame.time_s);
  joints.list.forEach((joint, n) => {
    joint.goal.push(frame.goal_rad[n] ?? NaN);
    joint.present.push(frame.present_rad[n] ?? NaN);
  });
  if (times[0] < frame.time_s - 1.25 * KEPT_S) forget(times.findIndex(t => t >= frame.time_s - KEPT_S));
  return true;
}
