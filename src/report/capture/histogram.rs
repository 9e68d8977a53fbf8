//! Codes counted, and what a model expects: its signal's own distribution, spread by the noise.

use crate::capture::columns::Model;
use crate::statistics::normal;

/// Bars at most.
const BARS: i64 = 240;
/// Fine cells of a bar, in which the signal is counted.
const FINE: usize = 16;

/// Counts of bars of whole codes.
#[derive(Debug, Clone, Default)]
pub struct Histogram {
    /// Lowest code of the first bar.
    pub first: i64,
    /// Codes of a bar.
    pub width: i64,
    /// Rows in each bar.
    pub counted: Vec<f64>,
    /// Rows that the model expects there.
    pub expected: Vec<f64>,
    /// Rows by the signal before noise and rounding.
    fine: Vec<f64>,
}

impl Histogram {
    /// Bars for these codes, empty.
    pub fn new(codes: impl Iterator<Item = i32>) -> Self {
        let range = codes.map(i64::from).fold(None, |range, code| match range {
            None => Some((code, code)),
            Some((low, high)) => Some((code.min(low), code.max(high))),
        });
        let (low, high) = range.unwrap_or((0, 0));
        let width = (high - low + 1).div_euclid(BARS) + 1;
        // Two more on each side, for what is expected beyond.
        let bars = ((high - low) / width + 5) as usize;
        Histogram {
            first: low - 2 * width,
            width,
            counted: vec![0.0; bars],
            expected: Vec::new(),
            fine: vec![0.0; bars * FINE],
        }
    }

    /// Counts a row.
    pub fn add(&mut self, code: f64, signal: f64) {
        let from = self.first as f64;
        let bar = ((code - from) / self.width as f64).max(0.0) as usize;
        if let Some(count) = self.counted.get_mut(bar) {
            *count += 1.0;
        }
        let last = self.fine.len().saturating_sub(1);
        let place = (signal + 0.5 - from) / self.width as f64 * FINE as f64;
        if let Some(count) = self.fine.get_mut((place.max(0.0) as usize).min(last)) {
            *count += 1.0;
        }
    }

    /// Middle of a bar, codes.
    pub fn middle(&self, bar: usize) -> f64 {
        self.first as f64 + (bar as f64 + 0.5) * self.width as f64 - 0.5
    }

    /// Fills [`Histogram::expected`]: the signal in a channel with the model's noise, limits and missing codes.
    pub fn expect(&mut self, model: &Model, channel: usize) {
        let variance = model.variance.base[channel] - 1.0 / 12.0;
        let cell = self.width as f64 / FINE as f64;
        let sigma = variance.max(0.0025).sqrt() / cell;
        // Noise that is wider than all bars reaches all of them.
        let reach = ((4.0 * sigma).ceil() as usize).min(self.fine.len()) + 1;
        let share: Vec<f64> = (0..=reach)
            .map(|k| {
                let k = k as f64;
                normal::below((k + 0.5) / sigma) - normal::below((k - 0.5) / sigma)
            })
            .collect();
        let mut expected = vec![0.0; self.counted.len()];
        let last = expected.len().saturating_sub(1);
        let limits = model.limits[channel];
        let bar_of = |code: f64| ((code + 0.5 - self.first as f64) / self.width as f64).max(0.0);
        let highest = if limits.high.is_finite() {
            bar_of(limits.high) as usize
        } else {
            last
        };
        let lowest = if limits.low.is_finite() {
            bar_of(limits.low) as usize
        } else {
            0
        };
        for (k, rows) in self.fine.iter().enumerate().filter(|f| *f.1 > 0.0) {
            for at in k.saturating_sub(reach)..=k + reach {
                let Some(share) = share.get(k.abs_diff(at)) else {
                    continue;
                };
                let bar = (at / FINE).min(highest.min(last)).max(lowest);
                if let Some(sum) = expected.get_mut(bar) {
                    *sum += rows * share;
                }
            }
        }
        self.expected = expected;
        self.move_missing(model, channel);
    }

    /// What a missing code should count goes to its neighbour; in wider bars that is the same bar, nearly.
    fn move_missing(&mut self, model: &Model, channel: usize) {
        let missing = &model.missing[channel];
        if self.width > 1 {
            return;
        }
        for (code, by) in missing.codes.iter().zip(&missing.moves) {
            let bar = i64::from(*code) - self.first;
            let to = usize::try_from(bar + *by as i64);
            let (Ok(bar), Ok(to)) = (usize::try_from(bar), to) else {
                continue;
            };
            let moved = self.expected.get_mut(bar).map_or(0.0, std::mem::take);
            if let Some(sum) = self.expected.get_mut(to) {
                *sum += moved;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_hold_all_codes_whatever_their_range() {
        for codes in [vec![-3, 5], vec![-32768, 32767], vec![0], vec![-120, 119]] {
            let mut h = Histogram::new(codes.iter().copied());
            for code in &codes {
                h.add(f64::from(*code), f64::from(*code));
            }
            assert_eq!(h.counted.iter().sum::<f64>(), codes.len() as f64);
            assert!(h.counted.len() <= BARS as usize + 5);
            // The lowest code is in the third bar, whose middle is near it.
            assert!(h.counted[2] > 0.0);
            let off = (h.middle(2) - f64::from(*codes.iter().min().unwrap())).abs();
            assert!(off <= 0.5 * h.width as f64, "{off}");
        }
    }
}
