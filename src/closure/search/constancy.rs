//! Does an effect hold over the whole record with one and the same gain? A law does. What only resembles it
//! (the course of a hidden channel, a walk) does so for a while.

use super::{Model, Search, Term};
use crate::closure::likelihood::linear::{Basis, dot};
use crate::closure::likelihood::tail::chi_square_surprise;
use crate::closure::likelihood::whiten::Whitener;

/// Stretches of equal information, each with a gain of its own.
const STRETCHES: usize = 4;

/// What gains of its own in every stretch explain beyond one gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constancy {
    /// Probability of that, were the gain one.
    pub p_value: f64,
    /// As a share of what the effect explains.
    pub share: f64,
}

impl Search<'_> {
    /// The constancy of a term of a model (Chow's test of stability over stretches, whitened; the other
    /// terms being in); `None` where physics gives the gain, or nothing is left to test.
    pub fn constancy(&self, model: &Model, term: &Term) -> Option<Constancy> {
        if term.candidate.is_whole() {
            return None;
        }
        let c = self.channels;
        let fit = &model.fit;
        let whitener = Whitener::new(&fit.problem.line, fit.at.shape);
        let columns = term.candidate.columns(c, &model.bias, &term.point);
        let own: Vec<Vec<f64>> = columns.iter().map(|c| fit.reduce(c)).collect();
        let white = whitener.apply_all(&own);
        // All other regressors.
        let others: Vec<Vec<f64>> = fit
            .problem
            .columns
            .iter()
            .filter(|column| !own.contains(column))
            .cloned()
            .collect();
        let mut basis = Basis::new(&whitener.apply_all(&others));
        let mut rest = whitener.apply(&fit.problem.y);
        basis.project_off(&mut rest);
        let without = dot(&rest, &rest);
        let mut projected = white.clone();
        for column in &mut projected {
            basis.project_off(column);
        }
        for column in &white {
            basis.push(column);
        }
        basis.project_off(&mut rest);
        let with = dot(&rest, &rest);
        let rank = basis.rank();
        for stretch in stretches(&projected).iter().skip(1) {
            for column in &own {
                let masked: Vec<f64> = column
                    .iter()
                    .enumerate()
                    .map(|(i, v)| if stretch.contains(&i) { *v } else { 0.0 })
                    .collect();
                let mut masked = whitener.apply(&masked);
                let before = dot(&masked, &masked).sqrt();
                let mut left = masked.clone();
                basis.project_off(&mut left);
                if dot(&left, &left).sqrt() > 1e-3 * before {
                    basis.push(&masked);
                }
                masked.clear();
            }
        }
        basis.project_off(&mut rest);
        let free = dot(&rest, &rest);
        let degrees = basis.rank() - rank;
        let contrasts = fit.problem.y.len().saturating_sub(basis.rank());
        if degrees == 0 || contrasts < 10 || without <= with {
            return None;
        }
        let statistic = contrasts as f64 * (with / free.max(f64::MIN_POSITIVE)).ln();
        Some(Constancy {
            p_value: (-chi_square_surprise(degrees, statistic)).exp(),
            share: (with - free) / (without - with),
        })
    }
}

/// Ranges of rows with equal sums of squares of the columns.
fn stretches(columns: &[Vec<f64>]) -> Vec<std::ops::Range<usize>> {
    let rows = columns.first().map_or(0, Vec::len);
    let square = |i: usize| columns.iter().map(|c| c[i] * c[i]).sum::<f64>();
    let total: f64 = (0..rows).map(square).sum();
    let mut out = Vec::new();
    let (mut sum, mut from) = (0.0, 0);
    for i in 0..rows {
        sum += square(i);
        if sum * STRETCHES as f64 >= total * (out.len() + 1) as f64 && out.len() + 1 < STRETCHES {
            out.push(from..i + 1);
            from = i + 1;
        }
    }
    out.push(from..rows);
    out
}
