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
        let bias = |coefficients_dps: Vec<f64>| Bias {
            coefficients_dps,
            others_dps: Vec::new(),
        };
        let unit = |j: usize| (0..order).map(|k| f64::from(u8::from(k == j))).collect();
        let mut biases = vec![bias(vec![0.0; order])];
        biases.extend((0..order).map(|j| bias(unit(j))));
        let mut units = candidate.columns_of(c, &biases, point);
        let still = units.remove(0);
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
    use crate::closure::search::{Effort, Search};
    use crate::closure::synthetic::Pull;

    /// How far the bias is from the true one, without the pull and beside it; `sized`: the shape has its size in it.
    fn off(pull: &Pull, sized: bool) -> (f64, f64) {
        let pulled = pull.made();
        let c = &pulled.channels;
        let search = Search::new(c, &c.split().unwrap(), Effort::default(), Vec::new());
        let mut all = search.candidates().iter();
        let candidate = all.find(|k| k.id() == "amplitude_phase_coupling").unwrap();
        let form = pull.power as usize - 1;
        let point = match sized {
            true => Point::at(form, &[pulled.most_u]),
            false => Point::form(form),
        };
        assert_eq!(candidate.is_sized(&point), sized);
        let free = [c.column("supply_v").unwrap().to_vec()];
        let off = |bias: &[f64]| {
            let pairs = bias.iter().zip(Pull::BIAS_DPS);
            pairs.fold(0.0, |m: f64, (b, due)| m.max((b - due).abs()))
        };
        let start = search.model(&[]).unwrap().bias.coefficients_dps;
        let acting = [(candidate.as_ref(), &point)];
        let data = (c.error_dps.as_slice(), [1.0; 400].as_slice());
        let found = settled(c, data, &start, &acting, &free);
        (off(&start), off(&found))
    }

    #[test]
    fn the_bias_beside_a_pull_along_its_slope_is_the_true_one() {
        for (pull_rad, power, supply_dps) in [(0.05, 1, 0.0), (-0.05, 2, 0.5), (0.15, 1, 0.5)] {
            let pull = Pull {
                pull_rad,
                power,
                supply_dps,
                along_slope: true,
            };
            let (before, after) = off(&pull, false);
            assert!(after < 0.02, "{pull_rad}: {after}");
            assert!(
                before > 10.0 * after,
                "{pull_rad}: {before} before, {after}"
            );
        }
    }

    #[test]
    fn the_bias_beside_a_large_pull_of_known_size_is_the_true_one() {
        for (pull_rad, power, supply_dps) in [(0.1, 1, 0.0), (0.3, 2, 0.5), (-0.3, 2, 0.5)] {
            let pull = Pull {
                pull_rad,
                power,
                supply_dps,
                along_slope: false,
            };
            let (before, after) = off(&pull, true);
            assert!(after < 0.02, "{pull_rad}: {after}");
            assert!(
                before > 20.0 * after,
                "{pull_rad}: {before} before, {after}"
            );
        }
    }
}
