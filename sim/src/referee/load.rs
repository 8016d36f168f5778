//! How busy a line is.

/// Share of any second the line may be busy.
const LINE_LOAD_MAX: f64 = 0.9;
const BIN_NS: u64 = 10_000_000;
const BINS: usize = 100;

/// Busy time of one line over the last second, in bins of 10 ms.
#[derive(Clone, Debug, Default)]
pub(super) struct Load {
    bins: Vec<u64>,
    newest: u64,
    total_ns: u64,
    pub peak: f64,
    pub over: bool,
}

impl Load {
    pub fn share(&self) -> f64 {
        self.total_ns as f64 / (BINS as u64 * BIN_NS) as f64
    }

    pub fn add(&mut self, start_ns: u64, end_ns: u64) {
        self.bins.resize(BINS, 0);
        let mut at_ns = start_ns;
        while at_ns < end_ns {
            let bin = at_ns / BIN_NS;
            let until_ns = end_ns.min((bin + 1) * BIN_NS);
            self.put(bin, until_ns - at_ns);
            at_ns = until_ns;
        }
    }

    fn put(&mut self, bin: u64, busy_ns: u64) {
        if bin >= self.newest + BINS as u64 {
            self.bins.fill(0);
            self.total_ns = 0;
            self.newest = bin;
        }
        while self.newest < bin {
            self.newest += 1;
            let slot = (self.newest % BINS as u64) as usize;
            self.total_ns -= std::mem::take(&mut self.bins[slot]);
        }
        if bin + (BINS as u64) > self.newest {
            self.bins[(bin % BINS as u64) as usize] += busy_ns;
            self.total_ns += busy_ns;
        }
        self.peak = self.peak.max(self.share());
        self.over = self.share() > LINE_LOAD_MAX;
    }
}
