// ---- series: what the page's data hold, as numbers ----

// Coded series as src/view/series.rs has them; gaps are NaN.
function decoded(coded) {
  const { count, start, step, order, gaps = [], bits } = coded;
  const values = new Float32Array(count);
  if (!count) return values;
  const text = atob(bits);
  const bytes = new Uint8Array(text.length + 8);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  let at = 0; // the next bit
  const word = () => {
    const byte = at >> 3, off = at & 7;
    const high = ((bytes[byte] << 24) | (bytes[byte + 1] << 16) | (bytes[byte + 2] << 8) | bytes[byte + 3]) >>> 0;
    return off ? ((high << off) | (bytes[byte + 4] >> (8 - off))) >>> 0 : high;
  };
  let first = 0, second = 0;
  for (let from = 0; from < count; from += 32) {
    const k = word() >>> 27;
    at += 5;
    const end = Math.min(from + 32, count);
    for (let i = from; i < end; i++) {
      let code = 0;
      if (k < 31) {
        let ones = 0;
        for (;;) {
          const run = Math.min(Math.clz32(~word()), 32);
          ones += run;
          at += run;
          if (run < 32) break;
        }
        at += 1;
        code = k ? ones * 2 ** k + (word() >>> (32 - k)) : ones;
        at += k;
      }
      const change = code & 1 ? -(code + 1) / 2 : code / 2;
      if (order === 2) { second += change; first += second; } else { first += change; }
      values[i] = start + step * first;
    }
  }
  for (const [begin, length] of gaps) values.fill(NaN, begin, begin + length);
  return values;
}

// A clock: how many samples, when each is, and which one is the last at or before a time.
function clockOf(data) {
  if (!data.times_s) {
    const { rate_hz: rate, count } = data;
    return {
      count, rate,
      time: i => i / rate,
      at: t => Math.max(0, Math.min(count - 1, Math.floor(t * rate + 1e-6))),
    };
  }
  const times = decoded(data.times_s), count = times.length;
  const rate = count > 1 ? (count - 1) / Math.max(1e-9, times[count - 1] - times[0]) : 0;
  const at = t => {
    let low = 0, high = count - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= t + 1e-6) low = middle; else high = middle - 1;
    }
    return low;
  };
  return { count, rate, time: i => times[i], at };
}

// Where a time is between two samples: the one before and how far on to the next.
function between(clock, t) {
  const i = clock.at(t), next = Math.min(i + 1, clock.count - 1);
  const gap = clock.time(next) - clock.time(i);
  return [i, next, gap > 0 ? Math.max(0, Math.min(1, (t - clock.time(i)) / gap)) : 0];
}

const mixed = (values, [i, next, share]) => {
  const a = values[i], b = values[next];
  return Number.isNaN(b) ? a : a + share * (b - a);
};

// Slope and bend of a series: of the parabola that fits 2 * reach + 1 samples best (Savitzky and Golay,
// Analytical Chemistry 36, 1964).
function derived(values, clock, which, reach) {
  const n = values.length, out = new Float32Array(n).fill(NaN);
  let s2 = 0, s4 = 0;
  for (let j = -reach; j <= reach; j++) { s2 += j * j; s4 += j ** 4; }
  const width = 2 * reach + 1, below = width * s4 - s2 * s2;
  for (let i = reach; i < n - reach; i++) {
    const step = (clock.time(i + reach) - clock.time(i - reach)) / (2 * reach);
    let sum = 0;
    for (let j = -reach; j <= reach; j++) {
      sum += values[i + j] * (which === 1 ? j / s2 : (2 * (width * j * j - s2)) / below);
    }
    out[i] = sum / step ** which;
  }
  return out;
}
