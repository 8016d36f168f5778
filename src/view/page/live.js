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
  // What is kept together: times, and all that was read at them.
  const kept = [[times, joints.list.flatMap(joint => [joint.goal, joint.present])]];
  for (const joint of joints.list) for (const { clock, values } of joint.others) kept.push([clock.times, [values]]);
  const forget = first => kept.forEach(([when, series]) => {
    const at = when.findIndex(t => t >= first), count = at < 0 ? when.length : at;
    [when, ...series].forEach(values => values.splice(0, count));
  });
  if (frame.time_s < last) forget(Infinity);
  times.push(frame.time_s);
  joints.list.forEach((joint, n) => {
    joint.goal.push(frame.goal_rad[n] ?? NaN);
    joint.present.push(frame.present_rad[n] ?? NaN);
    // What is read in turn has a time of its own where it was read, and is no gap in between.
    for (const { name, unit, values: read } of frame.others || []) {
      if (read[n] === null) continue;
      let known = joint.others.find(other => other.name === name);
      if (!known) joint.others.push(known = { name, unit, clock: growing(), values: [] });
      known.clock.times.push(frame.time_s);
      known.values.push(read[n]);
    }
  });
  if (times[0] < frame.time_s - 1.25 * KEPT_S) forget(frame.time_s - KEPT_S);
  return true;
}
