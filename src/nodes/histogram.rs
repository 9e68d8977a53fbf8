//! Errors counted in bins whose width doubles when an error lies beyond them.

/// Bins on each side of 0.
const SIDE: usize = 64;

/// How often an error lay in each of 128 bins around 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Width of a bin, in the unit of the errors: a power of two.
    width: f64,
    /// One over the width.
    per_width: f64,
    counts: [u64; 2 * SIDE],
}

impl Default for Histogram {
    fn default() -> Self {
        Histogram::new(1.0)
    }
}

impl Histogram {
    /// Empty, from -`reach` to `reach`, which is a power of two.
    pub fn new(reach: f64) -> Self {
        Histogram {
            width: reach / SIDE as f64,
            per_width: SIDE as f64 / reach,
            counts: [0; 2 * SIDE],
        }
    }

    /// Counts an error; what is no number is not counted.
    #[inline(always)]
    pub fn add(&mut self, error: f64) {
        // Written so that a NaN is beyond.
        let reach = self.width * SIDE as f64;
        if !(error >= -reach && error < reach) {
            if !error.is_finite() {
                return;
            }
            self.widen(error);
        }
        let place = error * self.per_width;
        let toward_zero = place as i64;
        let floor = toward_zero - i64::from(toward_zero as f64 > place);
        if let Some(count) = self.counts.get_mut((floor + SIDE as i64) as usize) {
            *count += 1;
        }
    }

    /// Joins bins two by two until `error` lies within.
    #[cold]
    fn widen(&mut self, error: f64) {
        while error.abs() >= self.width * SIDE as f64 {
            let mut joined = [0; 2 * SIDE];
            for (pair, out) in self.counts.chunks(2).zip(joined.iter_mut().skip(SIDE / 2)) {
                *out = pair.iter().sum();
            }
            (self.counts, self.width, self.per_width) =
                (joined, 2.0 * self.width, 0.5 * self.per_width);
        }
    }

    /// Width of a bin, in the unit of the errors.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Middle of each bin between the outermost with errors, and the count.
    pub fn bins(&self) -> Vec<(f64, u64)> {
        let first = self.counts.iter().position(|c| *c > 0).unwrap_or(0);
        let last = self.counts.iter().rposition(|c| *c > 0).unwrap_or(0);
        let middle = |k: usize| (k as f64 - SIDE as f64 + 0.5) * self.width;
        let filled = self.counts.iter().enumerate().take(last + 1).skip(first);
        filled.map(|(k, count)| (middle(k), *count)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_is_counted_whatever_the_order() {
        let errors: Vec<f64> = (0..1000)
            .map(|i| f64::from(i * 37 % 1000) - 500.0)
            .collect();
        let of = |errors: &mut dyn Iterator<Item = &f64>| {
            let mut h = Histogram::new(1.0);
            errors.for_each(|e| h.add(*e));
            h
        };
        let (forward, back) = (of(&mut errors.iter()), of(&mut errors.iter().rev()));
        assert_eq!(forward, back);
        let bins = forward.bins();
        assert_eq!(bins.iter().map(|b| b.1).sum::<u64>(), 1000);
        assert_eq!(forward.width(), 8.0);
        assert!(
            bins.iter()
                .all(|(middle, count)| *count == 8 || middle.abs() > 490.0)
        );
        let mut odd = Histogram::new(1.0);
        odd.add(f64::NAN);
        odd.add(f64::INFINITY);
        assert!(odd.bins().iter().all(|b| b.1 == 0));
    }
}
