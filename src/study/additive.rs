//! What one-word sweeps say of any design: squares of errors and costs add up.
//!
//! True of white noise from independent roundings, and nothing more: errors also come as lines, cancel, and repeat.
//! The sums only say which designs are worth a run; nothing that they say is reported.

use super::bench::Bench;
use super::figures::Figures;
use super::merit::Scale;
use super::space::Lengths;

/// Figures that add up.
const FIGURES: usize = 5;

/// In squares of parts of the limits, the bias with its sign.
type Squares = [f64; FIGURES];

/// What each length of each variable adds to the given design.
pub struct Additive {
    scale: Scale,
    lows: Vec<u32>,
    /// By variable and length: errors; `None` = cannot be.
    errors: Vec<Vec<Option<Squares>>>,
    /// By objective, variable, length.
    costs: Vec<Vec<Vec<f64>>>,
}

impl Additive {
    /// From a bench whose sweeps have run and are priced.
    pub fn new(bench: &Bench, scale: &Scale) -> Self {
        let given = bench.space.given();
        let zero = bench.figures(&given).map(|f| squares(scale, f));
        let at = |k: usize, length: u32| {
            let mut lengths = given.clone();
            lengths[k] = length;
            lengths
        };
        let variables = bench.space.variables.iter().enumerate();
        let ranges: Vec<(usize, u32, u32)> = variables.map(|(k, v)| (k, v.low, v.high)).collect();
        let errors = ranges.iter().map(|(k, low, high)| {
            let of = |length| {
                let f = bench.figures(&at(*k, length))?;
                let (own, zero) = (squares(scale, f), zero?);
                Some(std::array::from_fn(|i| own[i] - zero[i]))
            };
            (*low..=*high).map(of).collect()
        });
        let costs = (0..bench.objectives.len()).map(|o| {
            let base = bench.cost(o, &given);
            let of = |(k, low, high): &(usize, u32, u32)| {
                (*low..=*high)
                    .map(|l| bench.cost(o, &at(*k, l)) - base)
                    .collect()
            };
            ranges.iter().map(of).collect()
        });
        Additive {
            scale: *scale,
            lows: ranges.iter().map(|(_, low, _)| *low).collect(),
            errors: errors.collect(),
            costs: costs.collect(),
        }
    }

    /// For weights from tiny to huge: the design with the least cost plus weight times squares, word by word.
    pub fn ladder(&self, objective: usize, steps: usize, unit: f64) -> Vec<Lengths> {
        let mut out: Vec<Lengths> = Vec::new();
        for step in 0..steps {
            let weight = unit * 10f64.powf(-7.0 + 11.0 * step as f64 / steps as f64);
            let lengths: Lengths = (0..self.lows.len())
                .map(|k| self.cheapest(objective, k, weight))
                .collect();
            if out.last() != Some(&lengths) {
                out.push(lengths);
            }
        }
        out
    }

    fn cheapest(&self, objective: usize, variable: usize, weight: f64) -> u32 {
        let costs = &self.costs[objective][variable];
        let mut best = (f64::INFINITY, 0);
        for (k, errors) in self.errors[variable].iter().enumerate() {
            let Some(errors) = errors else { continue };
            let [bias, rest @ ..] = errors;
            let sum = bias * bias + rest.iter().sum::<f64>();
            let total = costs[k] + weight * sum;
            // Of equals the longer: errors that the sweep does not show grow toward the shorter.
            if total <= best.0 {
                best = (total, k as u32);
            }
        }
        self.lows[variable] + best.1
    }

    /// The merit and the cost that a design would have, by how it differs from one that has run.
    pub fn moved(
        &self,
        from: (&[u32], &Figures),
        cost: f64,
        objective: usize,
        to: &[u32],
    ) -> Option<(f64, f64)> {
        let mut sum = squares(&self.scale, from.1);
        let mut cost = cost;
        for (k, (new, old)) in to.iter().zip(from.0).enumerate() {
            if new == old {
                continue;
            }
            let place = |length: u32| (length - self.lows[k]) as usize;
            let (old, new) = (place(*old), place(*new));
            let errors = &self.errors[k];
            let (before, after) = (errors.get(old)?.as_ref()?, errors.get(new)?.as_ref()?);
            for i in 0..FIGURES {
                sum[i] += after[i] - before[i];
            }
            let costs = &self.costs[objective][k];
            cost += costs.get(new)? - costs.get(old)?;
        }
        let [bias, rest @ ..] = sum;
        let largest = rest.iter().fold(bias * bias, |a, b| a.max(*b));
        Some((largest.max(0.0).sqrt(), cost))
    }
}

fn squares(scale: &Scale, f: &Figures) -> Squares {
    let [_, drift, noise, factor, spur] = scale.parts(f).map(|(_, part)| part * part);
    let bias = scale.bias_dps.map_or(0.0, |l| f.bias_dps / l);
    [bias, drift, noise, factor, spur]
}
