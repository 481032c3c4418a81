//! Removal of the jitter of time stamps (thesis, figure 3.6).

/// Residual above which the clock has jumped, in ns.
const JUMP_NS: f64 = 100e6;

/// Line through the time stamps of a sensor with a constant rate, over the numbers of its packets. The mean delay of the
/// stamps stays; the calibration estimates it with the clocks.
#[derive(Debug, Clone, Default)]
pub(crate) struct StampLine {
    /// Number and stamp of the first packet.
    first: (u64, u64),
    count: f64,
    /// Means of numbers and stamps (in ns), relative to the first packet.
    mean: [f64; 2],
    /// Sum of squared deviations of the numbers, and of their products with those of the stamps.
    sums: [f64; 2],
}

impl StampLine {
    /// Takes the stamp of a packet and returns the time of the packet on the line, in ns. Restarts after a jump of the
    /// clock or the numbers.
    pub fn time(&mut self, number: u64, stamp_ns: u64) -> u64 {
        if self.count > 0.0 {
            let known =
                self.count < 3.0 || (self.at(number) - self.since(stamp_ns)).abs() < JUMP_NS;
            if number <= self.first.0 || stamp_ns <= self.first.1 || !known {
                *self = Self::default();
            }
        }
        if self.count == 0.0 {
            self.first = (number, stamp_ns);
        }
        let here = [(number - self.first.0) as f64, self.since(stamp_ns)];
        self.count += 1.0;
        let from_mean = here[0] - self.mean[0];
        for (mean, here) in self.mean.iter_mut().zip(here) {
            *mean += (here - *mean) / self.count;
        }
        self.sums[0] += from_mean * (here[0] - self.mean[0]);
        self.sums[1] += from_mean * (here[1] - self.mean[1]);
        if self.count < 3.0 {
            return stamp_ns;
        }
        (self.first.1 as f64 + self.at(number)).round() as u64
    }

    fn since(&self, stamp_ns: u64) -> f64 {
        stamp_ns as f64 - self.first.1 as f64
    }

    /// Returns the line at a number, in ns since the first stamp.
    fn at(&self, number: u64) -> f64 {
        let ahead = (number as f64 - self.first.0 as f64) - self.mean[0];
        self.mean[1] + self.sums[1] / self.sums[0] * ahead
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const PERIOD_NS: f64 = 40e6;
    const JITTER_NS: f64 = 3e6;

    /// Returns the root mean square of the errors of stamps, and of times on the line, in ns, without their means.
    fn errors(mut number_of: impl FnMut(u64) -> u64) -> [f64; 2] {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut line = StampLine::default();
        let (mut stamps, mut times) = (Vec::new(), Vec::new());
        for packet in 0..3000 {
            let number = number_of(packet);
            let exact = 5e9 + number as f64 * PERIOD_NS;
            let stamp = exact - JITTER_NS * rng.random::<f64>().max(1e-9).ln();
            let time = line.time(number, stamp as u64);
            if packet >= 100 {
                stamps.push(stamp - exact);
                times.push(time as f64 - exact);
            }
        }
        [stamps, times].map(|of| {
            let mean = of.iter().sum::<f64>() / of.len() as f64;
            // The mean delay of exponential jitter is its scale; of 2900 packets it is known to 2 %.
            assert!((mean - JITTER_NS).abs() < 0.08 * JITTER_NS, "{mean}");
            (of.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / of.len() as f64).sqrt()
        })
    }

    #[test]
    fn jitter_is_removed_also_where_packets_are_missing() {
        for numbers in [|packet| packet, |packet| packet + packet / 7 * 3] {
            let [stamps, times] = errors(numbers);
            assert!((stamps / JITTER_NS - 1.0).abs() < 0.1, "{stamps}");
            // The end of a line through n points has a standard error of 2 sigma / sqrt(n): 7 % as the root mean square
            // from 100 to 3000 points. Errors are correlated, so the limit is twice that.
            assert!(times < 0.14 * JITTER_NS, "{times}");
        }
    }

    #[test]
    fn exact_stamps_stay_and_jumps_restart_the_line() {
        let mut line = StampLine::default();
        for number in 0..500 {
            let stamp = 1_000_000_000_000 + number * 40_000_000;
            assert!(line.time(number, stamp).abs_diff(stamp) <= 1);
        }
        // The clock jumps by an hour, then the sensor restarts.
        for number in [500, 501, 502] {
            let stamp = 4_600_000_000_000 + number * 40_000_000;
            assert!(line.time(number, stamp).abs_diff(stamp) <= 1);
        }
        assert_eq!(line.time(0, 4_700_000_000_000), 4_700_000_000_000);
    }
}
