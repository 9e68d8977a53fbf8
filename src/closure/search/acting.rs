//! The declared bias and effects that act on it, found together.
//!
//! The columns of such an effect are affine in the bias's coefficients b, and its own coefficients g multiply them:
//! y = D b + sum of g (a + M b) + what else there is. That is linear in b for given g, and in g for given b; least squares
//! of the one and of the other in turn never raise the square. Columns of a bias that was found without the effect
//! have another shape where the effect is strong.

use super::{declared, weighted};
use crate::closure::channels::Channels;
use crate::closure::effects::{Bias, Candidate, Point};
use crate::closure::likelihood::linear::add_scaled;

/// Most turns, and the share by which the bias still moves in the last.
const TURNS: usize = 20;
const STILL: f64 = 1e-5;

/// An effect's column: a + M b.
struct Affine {
    still: Vec<f64>,
    by_bias: Vec<Vec<f64>>,
}

impl Affine {
    /// Those of a shape, for a bias with `order` coefficients.
    fn of(c: &Channels, candidate: &dyn Candidate, point: &Point, order: usize) -> Vec<Affine> {
        let columns = |coefficients_dps: Vec<f64>| {
            let bias = Bias {
                coefficients_dps,
                others_dps: Vec::new(),
            };
            candidate.columns(c, &bias, point)
        };
        let still = columns(vec![0.0; order]);
        let unit = |j: usize| (0..order).map(|k| f64::from(u8::from(k == j))).collect();
        let units: Vec<Vec<Vec<f64>>> = (0..order).map(|j| columns(unit(j))).collect();
        let each = still.into_iter().enumerate();
        each.map(|(i, still)| {
            let by_bias = units.iter().map(|columns| {
                let mut column = columns[i].clone();
                add_scaled(&mut column, -1.0, &still);
                column
            });
            Affine {
                by_bias: by_bias.collect(),
                still,
            }
        })
        .collect()
    }

    fn at(&self, bias: &[f64]) -> Vec<f64> {
        let mut column = self.still.clone();
        for (b, by) in bias.iter().zip(&self.by_bias) {
            add_scaled(&mut column, *b, by);
        }
        column
    }
}

/// The bias's coefficients, deg/s, beside effects that act on it and `free` columns, by weighted least squares of `y` (deg/s,
/// every row; rows of weight 0 may hold anything). `start`: coefficients to begin with.
pub(super) fn settled(
    c: &Channels,
    (y, weights): (&[f64], &[f64]),
    start: &[f64],
    acting: &[(&dyn Candidate, &Point)],
    free: &[Vec<f64>],
) -> Vec<f64> {
    let declared = declared(c);
    let order = declared.len();
    let mut effects: Vec<Affine> = Vec::new();
    let mut sized: Vec<Affine> = Vec::new();
    for (candidate, point) in acting {
        let own = Affine::of(c, *candidate, point, order);
        match candidate.is_sized(point) {
            true => sized.extend(own),
            false => effects.extend(own),
        }
    }
    let mut bias = start.to_vec();
    for _ in 0..TURNS {
        let mut columns: Vec<Vec<f64>> = effects.iter().map(|e| e.at(&bias)).collect();
        columns.extend(declared.iter().cloned());
        columns.extend(free.iter().cloned());
        let mut rest = y.to_vec();
        for effect in &sized {
            add_scaled(&mut rest, -1.0, &effect.at(&bias));
        }
        let mut gains = weighted(&columns, &rest, weights);
        gains.truncate(effects.len());
        gains.resize(effects.len() + sized.len(), 1.0);
        rest.copy_from_slice(y);
        let mut columns = declared.clone();
        for (gain, effect) in gains.iter().zip(effects.iter().chain(&sized)) {
            add_scaled(&mut rest, -gain, &effect.still);
            for (column, by) in columns.iter_mut().zip(&effect.by_bias) {
                add_scaled(column, *gain, by);
            }
        }
        columns.extend(free.iter().cloned());
        let mut next = weighted(&columns, &rest, weights);
        next.truncate(order);
        if effects.is_empty() {
            // Linear as it stands.
            return next;
        }
        let pairs = next.iter().zip(&bias);
        let moved = pairs.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        let most = next.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
        bias = next;
        if moved <= STILL * most {
            break;
        }
    }
    bias
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closure::channels::lag;
    use crate::closure::search::{Effort, Search};
    use crate::closure::synthetic::{Random, triangle};
    use std::collections::BTreeMap;

    const BIAS: [f64; 3] = [8.0, -3.0, 1.0];
    const TAU_S: f64 = 60.0;

    /// Two unequal heatings; `share` of the bias behind, `supply_dps` of a supply that goes with the time.
    fn channels(share: f64, supply_dps: f64) -> Channels {
        let mut random = Random::new(4);
        let time_s: Vec<f64> = (0..400).map(f64::from).collect();
        let degc = [triangle(100), triangle(300)].concat();
        let bias = |degc: &f64| {
            let u = degc / 35.0 - 1.0;
            BIAS[0] + BIAS[1] * u + BIAS[2] * u * u
        };
        let now: Vec<f64> = degc.iter().map(bias).collect();
        let late = lag(&time_s, &now, TAU_S);
        let supply: Vec<f64> = (0..400).map(|k| f64::from(u8::from(k % 90 < 40))).collect();
        let output = (0..400).map(|k| {
            now[k] + share * (now[k] - late[k]) + supply_dps * supply[k] + 0.01 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
            ("supply_v".to_owned(), supply),
        ]);
        Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
    }

    #[test]
    fn the_bias_beside_a_lag_larger_than_itself_is_the_true_one() {
        for (share, supply_dps) in [(0.3, 0.0), (1.7, 0.5), (4.0, 0.5)] {
            let c = channels(share, supply_dps);
            let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
            let is_lag = |k: &&std::sync::Arc<dyn Candidate>| k.id() == "thermal_lag";
            let candidate = search.candidates().iter().find(is_lag).unwrap();
            let point = Point::at(0, &[TAU_S.ln()]);
            let free = [c.column("supply_v").unwrap().to_vec()];
            let off = |bias: &[f64]| {
                let pairs = bias.iter().zip(BIAS);
                // The supply may be anywhere: its mean is the constant's.
                pairs
                    .skip(1)
                    .fold(0.0, |m: f64, (b, due)| m.max((b - due).abs()))
            };
            let start = search.model(&[]).unwrap().bias.coefficients_dps;
            let acting = [(candidate.as_ref(), &point)];
            let found = settled(&c, (&c.error_dps, &[1.0; 400]), &start, &acting, &free);
            let (before, after) = (off(&start), off(&found));
            assert!(after < 0.02 * (1.0 + share.abs()), "{share}: {after}");
            assert!(before > 10.0 * after, "{share}: {before} before, {after}");
        }
    }
}
