//! Is what is left noise? Tests of the whitened residual that need no candidate.

use super::{Model, Search};
use crate::statistics::memory;
use crate::statistics::memory::Memory;
use crate::statistics::noise::Shape;
use crate::statistics::whiten::Whitener;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Probability below which a whitened residual is not white.
pub const COLOURED: f64 = 1e-3;

/// Periodogram ordinates that are added up to a band.
const BANDS: [usize; 3] = [4, 10, 24];

/// Probability that the greatest band of a white residual's periodogram is as great: narrow-band
/// structure (a drifting tone, a relaxation that repeats) has no shape in time that a candidate
/// could have, and no spectrum that 1/f noise has.
pub fn band_p_value(whitened: &[f64]) -> f64 {
    let n = whitened.len();
    if n < 64 {
        return 1.0;
    }
    let mut buffer: Vec<Complex<f64>> = whitened.iter().map(|v| Complex::new(*v, 0.0)).collect();
    FftPlanner::new().plan_fft_forward(n).process(&mut buffer);
    let power: Vec<f64> = buffer[1..n / 2].iter().map(|c| c.norm_sqr()).collect();
    let total: f64 = power.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mean = total / power.len() as f64;
    let mut least = 1.0f64;
    for width in BANDS {
        if 3 * width > power.len() {
            continue;
        }
        let tests = 2.0 * power.len() as f64 / width as f64;
        let mut sum: f64 = power[..width].iter().sum();
        let mut greatest = sum;
        for k in width..power.len() {
            sum += power[k] - power[k - width];
            greatest = greatest.max(sum);
        }
        // Twice a sum of exponentials over their mean: chi-square with two degrees each.
        let surprise =
            crate::statistics::tail::chi_square_surprise(2 * width, 2.0 * greatest / mean);
        least = least.min(tests * BANDS.len() as f64 * (-surprise).exp());
    }
    least.min(1.0)
}

/// Slow noise that is not looked into.
const LITTLE: f64 = 1.0;

/// Log-likelihood by which a short memory has to be better than 1/f noise and a walk.
const BETTER: f64 = 3.0;

/// The rms of slow noise over a record, in units of the white one.
fn slowness(shape: Shape, rows: usize) -> f64 {
    let n = rows.max(2) as f64;
    (shape.flicker * n.ln() + shape.walk * n / 6.0).sqrt()
}

/// How many times what rows differ by from one to the next a white residual may be: one that is more jumps to and fro between
/// levels.
const SCATTERED: f64 = 3.0;

/// Share of the standard deviation that is left about two levels below which values have them (of a normal deviate three
/// fifths are left, of a sinusoid more than four tenths), and the least share of the values on each.
const TWO_LEVELS: f64 = 0.3;
const ON_EACH: f64 = 0.05;

/// Whether values lie on two levels: a load that comes and goes, a relay.
pub(super) fn has_two_levels(values: &[f64]) -> bool {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    let least = ((ON_EACH * n as f64) as usize).max(2);
    if n < 2 * least {
        return false;
    }
    let mean = sorted.iter().sum::<f64>() / n as f64;
    let mut below = 0.0;
    let mut between = 0.0f64;
    let square: f64 = sorted.iter().map(|v| (v - mean).powi(2)).sum();
    for (k, v) in sorted.iter().enumerate() {
        below += v - mean;
        let (low, high) = ((k + 1) as f64, (n - k - 1) as f64);
        if (least..=n - least).contains(&(k + 1)) {
            between = between.max(below * below * (1.0 / low + 1.0 / high));
        }
    }
    square - between < TWO_LEVELS.powi(2) * square
}

/// The same probability of a whitened residual with its accidents cut.
fn cut_p_value(whitened: impl Iterator<Item = f64>) -> f64 {
    let white: Vec<f64> = whitened.map(|v| v.clamp(-4.0, 4.0)).collect();
    band_p_value(&white)
}

fn is_coloured(whitened: &[f64]) -> bool {
    cut_p_value(whitened.iter().copied()) < COLOURED
}

/// The probability of a white residual's greatest band with the rows in the order of a channel.
fn p_value_along(white: &[f64], channel: &[f64]) -> f64 {
    let pairs = channel.iter().zip(white).filter(|(_, w)| **w != 0.0);
    let mut rows: Vec<(f64, f64)> = pairs.map(|(along, w)| (*along, *w)).collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    cut_p_value(rows.into_iter().map(|(_, w)| w))
}

impl Search<'_> {
    /// Slow noise of a model, rms over the record, in units of the white; none where what the model leaves has but a short
    /// memory.
    pub fn wander(&self, model: &Model) -> f64 {
        let slow = slowness(model.fit.at.shape, model.fit.problem.line.used());
        match slow > LITTLE && self.forgets(model) {
            true => 0.0,
            false => slow,
        }
    }

    /// Whether a model leaves structure in time that no candidate has.
    pub fn coloured(&self, model: &Model) -> bool {
        is_coloured(&model.fit.residual_whitened) && !self.forgets(model)
    }

    /// The channel along which what a model leaves has structure, or time: a residual that is white in time is white in any other
    /// order of its rows, unless something goes with what they are ordered by.
    pub fn structured(&self, model: &Model) -> Option<String> {
        let c = self.channels;
        let jumps = self.roughly(model) > SCATTERED * self.wander(model).hypot(1.0);
        let rest = self.of_used(&model.residual(c));
        if jumps || self.coloured(model) || has_two_levels(&rest) {
            return Some("time_s".to_owned());
        }
        let memory = self.memory(model);
        let white = memory.map_or_else(|| model.fit.residual_whitened.clone(), |m| m.whitened);
        let moving = c.columns.keys().filter(|name| c.moving(name).is_some());
        let columns = moving.map(|name| (name, c.columns[name].as_slice()));
        let along: Vec<(&String, &[f64])> =
            columns.chain([(&c.thermometer, c.u.as_slice())]).collect();
        let each = along.iter().map(|(name, column)| {
            let p_value = p_value_along(&white, &model.fit.reduce(column));
            (p_value * along.len() as f64, *name)
        });
        let least = each.min_by(|a, b| a.0.total_cmp(&b.0));
        let found = least.filter(|(p_value, _)| *p_value < COLOURED);
        found.map(|(_, name)| name.clone())
    }

    /// Whether what a model leaves is noise with a short memory: that explains it better than 1/f noise and a walk do, and
    /// all of it, and its innovations are normal.
    pub(super) fn forgets(&self, model: &Model) -> bool {
        self.memory(model).is_some()
    }

    /// What a model leaves under a short memory, if it forgets.
    fn memory(&self, model: &Model) -> Option<Memory> {
        let fit = &model.fit;
        let rest = fit.reduce(&model.residual(self.channels));
        let line = &fit.problem.line;
        let whitener = Whitener::new(line, fit.at.shape);
        let slow = memory::loglik(&whitener.apply(&rest), whitener.used, whitener.log_det);
        let memory = memory::short_memory(line, &rest);
        memory.filter(|m| m.loglik > slow + BETTER && !is_coloured(&m.whitened) && m.is_normal())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::channels::Channels;
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::Random;
    use std::collections::BTreeMap;

    const ROWS: usize = 600;

    /// Where there is structure beside the declared bias in white noise of one, with the temperature and a supply all over the
    /// place.
    fn found(seed: u64, error: impl Fn(usize, f64, f64) -> f64) -> Option<String> {
        let mut random = Random::new(seed);
        let mut any = || -> Vec<f64> { (0..ROWS).map(|_| random.uniform()).collect() };
        let (degc, supply) = (any(), any());
        let mut random = Random::new(seed + 1000);
        let each = (0..ROWS).map(|k| error(k, degc[k], supply[k]) + random.normal());
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), each.collect()),
            ("die_degc".to_owned(), degc.clone()),
            ("supply_v".to_owned(), supply.clone()),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        search.structured(&search.model(&[]).unwrap())
    }

    #[test]
    fn fringes_along_a_channel_are_structure_and_white_noise_is_none() {
        for seed in 1..=40 {
            assert_eq!(found(seed, |_, _, _| 0.0), None, "{seed}");
        }
        let fringe = |x: f64| (50.0 * x).sin();
        for seed in 1..=3 {
            let in_degc = found(seed, |_, degc, _| fringe(degc));
            assert_eq!(in_degc.as_deref(), Some("die_degc"), "{seed}");
            let in_supply = found(seed, |_, _, supply| fringe(supply));
            assert_eq!(in_supply.as_deref(), Some("supply_v"), "{seed}");
        }
    }

    #[test]
    fn two_levels_are_seen_in_noise_and_a_sinusoid_has_none() {
        let mut random = Random::new(3);
        let mut levels = |share: f64, of: f64, noise: f64| {
            let each = (0..400).map(|_| {
                let on = f64::from(u8::from(random.uniform() < share));
                of * on + noise * random.normal()
            });
            has_two_levels(&each.collect::<Vec<f64>>())
        };
        assert!(levels(0.5, 1.0, 0.1) && levels(0.2, 1.0, 0.08) && levels(0.9, -1.0, 0.05));
        // In as much noise, of too few values, and none.
        assert!(!levels(0.5, 1.0, 0.3) && !levels(0.01, 1.0, 0.01) && !levels(0.0, 1.0, 1.0));
        let sinusoid: Vec<f64> = (0..400).map(|k| (0.37 * f64::from(k)).sin()).collect();
        assert!(!has_two_levels(&sinusoid));
        assert!(!has_two_levels(&[0.0; 50]) && !has_two_levels(&[0.0, 1.0]));
    }

    #[test]
    fn a_level_that_jumps_from_row_to_row_is_structure_although_it_is_white() {
        let mut random = Random::new(5);
        let jumps: Vec<bool> = (0..ROWS).map(|_| random.uniform() < 0.2).collect();
        let jumping = |by: f64| found(7, |k, _, _| if jumps[k] { by } else { 0.0 });
        assert_eq!(jumping(30.0).as_deref(), Some("time_s"));
        assert_eq!(jumping(2.0), None);
    }
}
