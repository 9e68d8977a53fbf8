//! The declared bias and effects that act on it, found together.
//!
//! The columns of such an effect are affine in the bias's coefficients b, and its own coefficients g multiply them:
//! y = D b + sum of g (a + M b) + what else there is. That is linear in b for given g, and in g for given b; least squares
//! of the one and of the other in turn never raise the square. Columns of a bias that was found without the effect
//! have another shape where the effect is strong.
//!
//! Every column of every turn is a combination of the same few: their products are taken once over the rows, and the turns
//! are in small matrices ([`normal`]).

use super::declared;
use crate::statistics::linear::{add_scaled, dots, normal};
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Bias, Candidate, Point};
use nalgebra::{DMatrix, DVector};

/// Most turns, and the share by which the bias still moves in the last.
const TURNS: usize = 20;
const STILL: f64 = 1e-5;

/// What is fitted, and all that is fitted beside an effect that is tried: everything is a combination of a few columns over the
/// rows.
pub(super) struct Settling<'a> {
    c: &'a Channels,
    /// Square roots of the rows' weights; rows of weight 0 may hold anything.
    roots: Vec<f64>,
    /// The columns, weighted: the declared ones, free ones, the signal, those of effects.
    columns: Vec<Vec<f64>>,
    products: DMatrix<f64>,
    /// Declared columns, and declared and free ones.
    order: usize,
    linear: usize,
    effects: Vec<Affine>,
}

/// An effect's column, a + M b, by the places of a and of M's columns among all.
#[derive(Clone)]
struct Affine {
    still: usize,
    by_bias: Vec<usize>,
    is_sized: bool,
}

/// Factors of the columns.
type Combination = DVector<f64>;

/// A bias beside effects.
pub(super) struct Settled {
    /// Its coefficients, deg/s.
    pub bias: Vec<f64>,
    /// Coefficients of the columns of the effect that was tried, beside the declared ones alone.
    pub own: Vec<f64>,
    /// Those columns with this bias, over the record's rows.
    pub columns: Vec<Vec<f64>>,
}

impl<'a> Settling<'a> {
    /// For weighted least squares of `y` (deg/s, every row) by the declared model, `free` columns and effects that act on the
    /// bias.
    pub(super) fn new(
        c: &'a Channels,
        (y, weights): (&[f64], &[f64]),
        acting: &[(&dyn Candidate, &Point)],
        free: &[Vec<f64>],
    ) -> Self {
        let declared = declared(c);
        let order = declared.len();
        let mut out = Settling {
            c,
            roots: weights.iter().map(|w| w.max(0.0).sqrt()).collect(),
            columns: Vec::new(),
            products: DMatrix::zeros(0, 0),
            order,
            linear: order + free.len(),
            effects: Vec::new(),
        };
        let mut columns = declared;
        columns.extend_from_slice(free);
        columns.push(y.to_vec());
        for (candidate, point) in acting {
            let (effects, own) = out.affine(*candidate, point, columns.len());
            out.effects.extend(effects);
            columns.extend(own);
        }
        out.columns = columns.iter().map(|column| out.weighted(column)).collect();
        let count = columns.len();
        let products = dots(&out.columns, &out.columns);
        out.products = DMatrix::from_row_slice(count, count, &products);
        out
    }

    fn weighted(&self, column: &[f64]) -> Vec<f64> {
        let pairs = column.iter().zip(&self.roots);
        pairs
            .map(|(v, root)| if *root > 0.0 { v * root } else { 0.0 })
            .collect()
    }

    /// The columns of a shape, and where they are if they follow `from` others.
    fn affine(
        &self,
        candidate: &dyn Candidate,
        point: &Point,
        from: usize,
    ) -> (Vec<Affine>, Vec<Vec<f64>>) {
        let bias = |coefficients_dps: Vec<f64>| Bias {
            coefficients_dps,
            others_dps: Vec::new(),
        };
        let order = self.order;
        let unit = |j: usize| (0..order).map(|k| f64::from(u8::from(k == j))).collect();
        let mut biases = vec![bias(vec![0.0; order])];
        biases.extend((0..order).map(|j| bias(unit(j))));
        let mut units = candidate.columns_of(self.c, &biases, point);
        let still = units.remove(0);
        let (mut effects, mut columns) = (Vec::new(), Vec::new());
        for (i, still) in still.into_iter().enumerate() {
            let first = from + columns.len();
            for unit in &units {
                let mut column = unit[i].clone();
                add_scaled(&mut column, -1.0, &still);
                columns.push(column);
            }
            effects.push(Affine {
                still: first + order,
                by_bias: (first..first + order).collect(),
                is_sized: candidate.is_sized(point),
            });
            columns.push(still);
        }
        (effects, columns)
    }

    /// The bias from a start.
    pub(super) fn settled(&self, start: &[f64]) -> Vec<f64> {
        self.turned(&self.products, &self.effects, start)
    }

    /// The bias with one effect more, from a start.
    pub(super) fn beside(
        &self,
        candidate: &dyn Candidate,
        point: &Point,
        start: &[f64],
    ) -> Settled {
        let known = self.columns.len();
        let (own, plain) = self.affine(candidate, point, known);
        let columns: Vec<Vec<f64>> = plain.iter().map(|c| self.weighted(c)).collect();
        let all = known + columns.len();
        let mixed = dots(&columns, &self.columns);
        let further = dots(&columns, &columns);
        let product = |i: usize, j: usize| match (i.checked_sub(known), j.checked_sub(known)) {
            (None, None) => self.products[(i, j)],
            (Some(i), None) => mixed[i * known + j],
            (None, Some(j)) => mixed[j * known + i],
            (Some(i), Some(j)) => further[i * columns.len() + j],
        };
        let products = DMatrix::from_fn(all, all, product);
        let effects = [self.effects.as_slice(), own.as_slice()].concat();
        let bias = self.turned(&products, &effects, start);
        let declared = (0..self.order).map(|k| unit(k, all));
        let beside: Vec<Combination> = declared
            .chain(own.iter().map(|e| e.at(&bias, all)))
            .collect();
        let fitted = fitted(&products, &beside, &unit(self.linear, all));
        let with_bias = own.iter().map(|effect| {
            let mut column = plain[effect.still - known].clone();
            for (k, b) in effect.by_bias.iter().zip(&bias) {
                add_scaled(&mut column, *b, &plain[k - known]);
            }
            column
        });
        Settled {
            columns: with_bias.collect(),
            own: fitted.get(self.order..).unwrap_or_default().to_vec(),
            bias,
        }
    }

    /// Turns of least squares, the bias held and the effects held.
    fn turned(&self, products: &DMatrix<f64>, effects: &[Affine], start: &[f64]) -> Vec<f64> {
        let all = products.nrows();
        let y = unit(self.linear, all);
        let linear = || (0..self.linear).map(|k| unit(k, all));
        let (sized, free): (Vec<&Affine>, Vec<&Affine>) = effects.iter().partition(|e| e.is_sized);
        let mut bias = start.to_vec();
        for _ in 0..TURNS {
            let rest = sized.iter().fold(y.clone(), |y, e| y - e.at(&bias, all));
            let columns: Vec<Combination> = free
                .iter()
                .map(|e| e.at(&bias, all))
                .chain(linear())
                .collect();
            let mut gains = fitted(products, &columns, &rest);
            gains.truncate(free.len());
            gains.resize(effects.len(), 1.0);
            let mut rest = y.clone();
            let mut columns: Vec<Combination> = linear().collect();
            for (gain, effect) in gains.iter().zip(free.iter().chain(&sized)) {
                rest[effect.still] -= gain;
                for (column, by) in columns.iter_mut().zip(&effect.by_bias) {
                    column[*by] += gain;
                }
            }
            let mut next = fitted(products, &columns, &rest);
            next.truncate(self.order);
            if free.is_empty() {
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
}

impl Affine {
    /// The column for a bias, of so many factors.
    fn at(&self, bias: &[f64], count: usize) -> Combination {
        let mut out = unit(self.still, count);
        for (k, b) in self.by_bias.iter().zip(bias) {
            out[*k] += b;
        }
        out
    }
}

/// One column of so many.
fn unit(k: usize, count: usize) -> Combination {
    Combination::from_fn(count, |i, _| f64::from(u8::from(i == k)))
}

/// Least squares of a combination by others.
fn fitted(products: &DMatrix<f64>, columns: &[Combination], of: &Combination) -> Vec<f64> {
    let columns = DMatrix::from_columns(columns);
    let along = columns.transpose() * products;
    normal(&(&along * &columns), &(along * of))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::search::{Effort, Search};
    use crate::thermal::synthetic::Pull;

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
        let found = Settling::new(c, data, &acting, &free).settled(&start);
        // The same with the effect tried.
        let none = Settling::new(c, data, &[], &free);
        let tried = none.beside(candidate.as_ref(), &point, &start).bias;
        for (a, b) in tried.iter().zip(&found) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
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
