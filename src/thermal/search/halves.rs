//! How often a term is chosen again when the record is halved.

use super::judge::{EQUAL, Judged, PRICE};
use super::{Model, Search, Term, declared};
use crate::statistics::Unusable;
use crate::statistics::linear::{Basis, add_scaled, dot};
use crate::statistics::random::Stream;
use crate::statistics::whiten::Whitener;
use crate::thermal::effects::{Candidate, Point};
use crate::thermal::rails;
use crate::thermal::rails::Rails;

/// Pairs of complementary halves.
const PAIRS: usize = 15;

impl Search<'_> {
    /// [`Search::selection_frequency`] against everything that is judged beside the other terms, `but` some.
    ///
    /// # Errors
    /// Too few rows.
    pub fn selected_beside(
        &self,
        model: &Model,
        term: usize,
        but: &[String],
    ) -> Result<f64, Unusable> {
        if model.terms[term].evident {
            return Ok(self.rails_again());
        }
        let mut others = model.terms.clone();
        others.remove(term);
        let without = self.model(&others)?;
        let round = self.round(&without, 0);
        let against = round.judged.iter();
        let against = against.filter(|j| !but.contains(&j.candidate.id()));
        Ok(self.selection_frequency(model, term, &without, against))
    }

    /// Share of the halves of the training rows that show the same rails.
    fn rails_again(&self) -> f64 {
        let levels = |r: &Rails| (r.lower_dps, r.upper_dps);
        let whole = self.rails.as_ref().map(levels);
        let shows = |k: usize| {
            let side = half(self.train.len(), k / 2);
            let own = self.train.iter().zip(side);
            let own: Vec<bool> = own.map(|(t, s)| *t && s == k.is_multiple_of(2)).collect();
            rails::of(self.channels, &own).as_ref().map(levels) == whole
        };
        (0..2 * PAIRS).filter(|k| shows(*k)).count() as f64 / (2 * PAIRS) as f64
    }

    /// Share of the halves of the record (whole segments, complementary pairs; Meinshausen & Buhlmann 2010,
    /// Shah & Samworth 2013) in which the term explains as much as every one of its competitors, the
    /// other terms being in, and more than its price. `competitors`: what was judged beside `without`, the model of
    /// the other terms, best first: a clip acts on what that makes of the output.
    pub fn selection_frequency<'j>(
        &self,
        model: &Model,
        term: usize,
        without: &Model,
        competitors: impl IntoIterator<Item = &'j Judged>,
    ) -> f64 {
        let c = self.channels;
        let fit = &model.fit;
        let reduce = |columns: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
            columns.iter().map(|c| fit.reduce(c)).collect()
        };
        let of = |t: &Term| reduce(t.candidate.columns(c, &model.acting, &t.point));
        let mut base = reduce(declared(c));
        base.extend(self.blur.iter().map(|c| fit.reduce(c)));
        for (k, other) in model.terms.iter().enumerate() {
            if k != term {
                base.extend(of(other));
            }
        }
        let own = &model.terms[term];
        let kind = |t: &dyn Candidate, p: &Point| (p.theta.len(), t.is_sized(p));
        let mut contenders = vec![(of(own), kind(own.candidate.as_ref(), &own.point))];
        let competitors = competitors.into_iter();
        for j in competitors.filter(|j| j.candidate.named()).take(6) {
            if j.candidate.id() != own.id() {
                let columns = reduce(j.candidate.columns(c, &without.bias, &j.point));
                contenders.push((columns, kind(j.candidate.as_ref(), &j.point)));
            }
        }
        let whitener = Whitener::new(&fit.problem.line, fit.at.shape);
        let base = whitener.apply_all(&base);
        for (columns, _) in &mut contenders {
            *columns = whitener.apply_all(columns);
        }
        let signal = whitener.apply(&fit.reduce(&c.error_dps));
        let rows = signal.len();
        let variance = fit.at.white_variance().max(f64::MIN_POSITIVE);
        // A half may not have what tells a law from a simpler one, that of a lag's first hour from a rate's; a shape that chance
        // finds at some temperature has to be the best.
        let slack = if own.candidate.is_local() { 0.0 } else { EQUAL };
        let mut chosen = 0usize;
        for pair in 0..PAIRS {
            let first = half(rows, pair);
            for side in [true, false] {
                let take = |column: &Vec<f64>| -> Vec<f64> {
                    let pairs = column.iter().zip(&first);
                    pairs
                        .filter(|(_, f)| **f == side)
                        .map(|(v, _)| *v)
                        .collect()
                };
                let declared = Basis::new(&base.iter().map(take).collect::<Vec<_>>());
                let mut y = take(&signal);
                declared.project_off(&mut y);
                let gain = |(columns, (theta, sized)): &(Vec<Vec<f64>>, (usize, bool))| {
                    let mut basis = Basis::default();
                    let mut rest = y.clone();
                    for mut column in columns.iter().map(take) {
                        declared.project_off(&mut column);
                        add_scaled(&mut rest, -f64::from(u8::from(*sized)), &column);
                        basis.push(&column);
                    }
                    if !sized {
                        basis.project_off(&mut rest);
                    }
                    let explained = dot(&y, &y) - dot(&rest, &rest);
                    0.5 * explained / variance - PRICE * (basis.rank() + theta) as f64
                };
                let gains: Vec<f64> = contenders.iter().map(gain).collect();
                let best = gains.iter().skip(1).fold(0.0, |m: f64, g| m.max(*g));
                chosen += usize::from(gains[0] >= best - slack && gains[0] > 0.0);
            }
        }
        chosen as f64 / (2 * PAIRS) as f64
    }
}

/// Which rows are in the first half: half of sixteen stretches, drawn by the pair's number.
fn half(rows: usize, pair: usize) -> Vec<bool> {
    const SEGMENTS: usize = 16;
    let stream = Stream::new(77, pair as u64);
    let mut order: Vec<(f64, usize)> = (0..SEGMENTS)
        .map(|s| (stream.uniform(s as u64), s))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut first = [false; SEGMENTS];
    for (_, s) in order.iter().take(SEGMENTS / 2) {
        first[*s] = true;
    }
    (0..rows)
        .map(|i| first[i * SEGMENTS / rows.max(1)])
        .collect()
}
