//! Names that do not hold lose them: what the record cannot tell from chance, from a wander or from an accident.

use super::judge::Judged;
use super::reported::BEYOND;
use super::structure::has_two_levels;
use super::{Found, LEVEL, Model, Search, Term, declared};
use crate::statistics::Unusable;
use crate::statistics::linear::Basis;
use crate::thermal::effects::tone;
use crate::thermal::effects::tone::Pickup;
use std::sync::Arc;

/// Slow noise, in units of white noise over the record, from which on a single step is no evidence.
const SLOW: f64 = 2.0;

/// Probability from which on a step stands that the held-out rows do not show, and the share of its square that
/// is none.
const CERTAIN: f64 = 1e-8;
const UNSEEN: f64 = 0.01;

/// Fitted rows below which a shape at one temperature has to show in the held-out ones as well: a few readings that are off by
/// a little, where the bias is steep, make one of any width.
const FEW_ROWS: f64 = 30.0;

/// Sum of squares, in units of the noise's variance, from which on what a term says of the held-out rows can be told
/// from its contrary (half of it by two deviations), and how much more mean square is none.
const SAYS: f64 = 16.0;
const WITHIN: f64 = 1.03;

/// A sinusoid beside which another one of this share of its gain is needed is none: a drifting tone, or
/// something else that repeats.
const OVERTONE: f64 = 0.1;

/// Periods over the record by which a drifting tone's neighbours are off, and a line from where it belongs.
const SKIRT: f64 = 12.0;
const SAME_LINE: f64 = 1.0;

/// Share of a shape's square that a single row may hold: what shows in one row, anything may have made.
const ONE_ROW: f64 = 0.8;

/// Probability and share of its gain from which on an effect's gain is not one.
pub(super) const UNSTEADY: f64 = 1e-3;
const UNSTEADY_SHARE: f64 = 0.05;

/// Least selection frequency of a local shape (Meinshausen & Buhlmann 2010 take 0.6 to 0.9), of one that is beyond chance and
/// leaves nothing, and of any other shape.
const STABLE: f64 = 0.7;
const HALF: f64 = 0.5;
const EVER: f64 = 0.1;

/// Share of the net gain of a name that does not hold with which a law takes its place.
const AS_GOOD: f64 = 0.85;

impl Search<'_> {
    /// Drops terms that do not lower the held-out error, and tones that are none.
    ///
    /// # Errors
    /// Too few rows.
    pub fn validated(&self, mut model: Model, found: &mut Found) -> Result<Model, Unusable> {
        let mut terms = model.terms.clone();
        let of = |id: &str| terms.iter().find(|t| t.id() == id);
        if let (Some(own), Some(further)) = (of(tone::NAMED), of(tone::FURTHER))
            && further.gain > OVERTONE * own.gain
            && self.go_together(own, further)
        {
            terms.retain(|t| t.id() != tone::NAMED);
            found.left = Some("time_s".to_owned());
            model = self.model(&terms)?;
        }
        model = self.without_waves(model, found)?;
        model = self.without_likenesses(model)?;
        model = self.without_accidents(model, found)?;
        model = self.without_chance(model, found)?;
        model = self.modest(model)?;
        let mut k = 0;
        while k < model.terms.len() {
            let term = model.terms[k].clone();
            if !term.candidate.named() || term.evident {
                k += 1;
                continue;
            }
            let mut others = model.terms.clone();
            others.remove(k);
            let without = self.model(&others)?;
            let surprise = |m: &Model| self.surprise(m, &model);
            let [with, less] = self.heldout_squares([&model, &without]);
            let silent = term.p_value <= CERTAIN
                && !(term.candidate.is_local() && self.rows_of(&model, &without) < FEW_ROWS)
                && (self.unseen(&model, &without)
                    || with < WITHIN * less && self.said(&model, &without, &model) < SAYS);
            if !silent && surprise(&model) >= surprise(&without) && with >= less {
                self.leaves(found, &term);
                model = without;
            } else {
                k += 1;
            }
        }
        Ok(model)
    }

    /// Whether two tones are one cause's: a tone that drifts has neighbours, what repeats has harmonics.
    fn go_together(&self, own: &Term, further: &Term) -> bool {
        let periods = |t: &Term| t.point.theta[0] * self.channels.span_s();
        let (own, further) = (periods(own), periods(further));
        let multiple = |of: f64, base: f64| (of - base * (of / base).round()).abs() < SAME_LINE;
        (own - further).abs() < SKIRT || multiple(own, further) || multiple(further, own)
    }

    /// Shapes that fitted rows leave open where held-out ones contradict them: the one of the ends of what is open that errs
    /// least there. In the middle of it a threshold errs least in the mean; it may err there where nothing said that the
    /// effect is.
    fn modest(&self, mut model: Model) -> Result<Model, Unusable> {
        for k in 0..model.terms.len() {
            if model.terms[k].evident {
                continue;
            }
            let mut others = model.terms.clone();
            let term = others.remove(k);
            let without = self.model(&others)?;
            let [of_own, of_none] = self.heldout_squares([&model, &without]);
            if of_own <= of_none {
                continue;
            }
            let own = model.clone();
            for point in term.candidate.open(self.channels, &term.point, &self.used) {
                let mut terms = model.terms.clone();
                terms[k].point = point;
                let other = self.model(&terms)?;
                let [of_own, of_model, of_other, of_none] =
                    self.heldout_squares([&own, &model, &other, &without]);
                if of_own > of_none && of_model > of_other {
                    model = other;
                }
            }
        }
        Ok(model)
    }

    /// Fitted rows that a term is seen in: of what two models differ by, the square of the sum of squares over the sum of
    /// fourth powers.
    fn rows_of(&self, with: &Model, without: &Model) -> f64 {
        let c = self.channels;
        let (with, without) = (with.residual(c), without.residual(c));
        let apart: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a - b).collect();
        let squares = self.of_used(&apart).into_iter().map(|d| d * d);
        let (sum, fourth) = squares.fold((0.0, 0.0), |(s, f), q| (s + q, f + q * q));
        if fourth > 0.0 {
            sum * sum / fourth
        } else {
            0.0
        }
    }

    /// Whether a model with and one without a term say next to the same of the held-out rows, so that these say nothing of
    /// it: a clip of a few rows, a warm-up that is over before the first of them, a step that all of them lie above.
    fn unseen(&self, with: &Model, without: &Model) -> bool {
        let c = self.channels;
        let (with, without) = (with.residual(c), without.residual(c));
        let square = |rows: &[bool]| -> f64 {
            let apart = with.iter().zip(&without).map(|(a, b)| a - b);
            let pairs = apart.zip(rows).filter(|(d, row)| **row && d.is_finite());
            pairs.map(|(d, _)| d * d).sum()
        };
        let held = square(&self.heldout);
        held <= UNSEEN * (held + square(&self.used))
    }

    /// Tones that are another channel's keep their shape and lose their name, as does what repeats, but not as a sinusoid.
    fn without_waves(&self, model: Model, found: &mut Found) -> Result<Model, Unusable> {
        let mut terms = model.terms.clone();
        let mut waves = None;
        // What has no name as it is, is another channel's all the same.
        let nameless = terms.iter().filter(|t| t.id() == tone::FURTHER);
        let channels = nameless.filter_map(|t| self.another_channels(*t.point.theta.first()?));
        found.left = found.left.take().or_else(|| channels.last());
        for (k, term) in terms.iter_mut().enumerate() {
            if term.id() != tone::NAMED {
                continue;
            }
            let frequency_hz = term.point.theta.first().copied().unwrap_or(0.0);
            let overtones = || {
                let has = self.has_overtones(&model, frequency_hz);
                has.then(|| "time_s".to_owned())
            };
            // What comes and goes has a sinusoid that fits it best.
            let levels = || {
                self.is_of_two_levels(&model, k)
                    .then(|| "time_s".to_owned())
            };
            let others = self.another_channels(frequency_hz);
            let others = others.filter(|_| !self.is_apart(&model, k));
            if let Some(channel) = others.or_else(overtones).or_else(levels) {
                waves = Some(channel);
                term.candidate = Arc::new(Pickup {
                    frequency_hz,
                    further: true,
                });
            }
        }
        if waves.is_none() {
            return Ok(model);
        }
        found.left = found.left.take().or(waves);
        self.model(&terms)
    }

    /// Whether a term and what its model leaves lie on two levels together.
    fn is_of_two_levels(&self, model: &Model, own: usize) -> bool {
        let rest = model.residual(self.channels);
        let part = &model.contributions(self.channels)[own];
        let both: Vec<f64> = rest.iter().zip(part).map(|(r, p)| r + p).collect();
        has_two_levels(&self.of_used(&both))
    }

    /// Without names that a nameless shape in the same channel, which came before and explains more, has left over.
    fn without_likenesses(&self, model: Model) -> Result<Model, Unusable> {
        let mut strangers: Vec<(Option<String>, f64)> = Vec::new();
        let mut terms = model.terms.clone();
        terms.retain(|t| {
            let channel = self.channel(t);
            if !t.candidate.named() {
                strangers.push((channel, t.gain));
                return true;
            }
            !strangers.iter().any(|(c, g)| *c == channel && *g > t.gain)
        });
        if terms.len() == model.terms.len() {
            return Ok(model);
        }
        self.model(&terms)
    }

    /// Without shapes of a single row. Without steps that happen once: they are no law of temperature unless
    /// everything else is clean, for anything may happen once.
    fn without_accidents(&self, model: Model, found: &mut Found) -> Result<Model, Unusable> {
        let slow = self.wander(&model);
        let more = model.terms.iter().any(|t| !t.candidate.named()) || self.coloured(&model);
        let mut terms = model.terms.clone();
        terms.retain(|t| {
            if !t.candidate.named() {
                return true;
            }
            // A rail is seen without a fit, also where the model's total hardly passes it.
            if !t.evident && self.shows_once(t, &model) {
                return false;
            }
            let single = t.id() == "stress_jump" && self.switches(t, &model) < 2;
            let accident = single && (more || slow > SLOW);
            if accident {
                self.leaves(found, t);
            }
            !accident
        });
        if terms.len() == model.terms.len() {
            return Ok(model);
        }
        self.model(&terms)
    }

    /// Without names that do not hold: with one gain over the whole record, in some halves of it, or, for a shape
    /// that chance finds at some temperature, in most of them. They leave their place to a law of the whole
    /// record that explains as much: the more supple of the two came first.
    fn without_chance(&self, model: Model, found: &mut Found) -> Result<Model, Unusable> {
        let mut terms = model.terms.clone();
        let mut k = 0;
        let mut changed = false;
        for (own, term) in model.terms.iter().enumerate() {
            if !term.candidate.named() || (self.lasts(&model, term) && self.recurs(&model, own)?) {
                k += 1;
                continue;
            }
            changed = true;
            let mut others = terms.clone();
            others.remove(k);
            let law = self.law_instead(&others, term)?;
            if law.as_ref().is_none_or(|(_, good)| !good) {
                self.leaves(found, term);
            }
            match law {
                Some((law, _)) => {
                    terms[k] = law;
                    k += 1;
                }
                None => terms = others,
            }
        }
        if !changed {
            return Ok(model);
        }
        self.polished(self.model(&terms)?)
    }

    /// A name that is dropped leaves something, unless it was no more than chance makes in many records.
    fn leaves(&self, found: &mut Found, term: &Term) {
        if term.p_value <= BEYOND {
            found.left = found.left.take().or_else(|| self.channel(term));
        }
    }

    /// Whether a term has one gain.
    fn lasts(&self, model: &Model, term: &Term) -> bool {
        self.constancy(model, term)
            .is_none_or(|c| c.p_value > UNSTEADY || c.share < UNSTEADY_SHARE)
    }

    /// The best law in place of a name that does not hold, and whether it is as good: if not, something is left, and
    /// it has to be beyond what that may look like.
    fn law_instead(&self, others: &[Term], own: &Term) -> Result<Option<(Term, bool)>, Unusable> {
        let without = self.model(others)?;
        let round = self.round(&without, self.effort.surrogates);
        let is_own = |j: &&Judged| j.candidate.id() == own.id();
        let same = round.judged.iter().find(is_own);
        let mut laws = round.judged.iter().filter(|j| !is_own(j));
        let laws = laws.find(|j| j.candidate.named() && !j.candidate.is_local());
        let (Some(law), Some(same)) = (laws, same) else {
            return Ok(None);
        };
        let good = law.net >= AS_GOOD * same.net;
        if law.p_value > if good { LEVEL } else { BEYOND } {
            return Ok(None);
        }
        let mut term = Term::of(law, round.rivals(law));
        term.beside = others.iter().map(Term::id).collect();
        let mut terms = others.to_vec();
        terms.push(term.clone());
        let model = self.model(&terms)?;
        let holds = self.lasts(&model, &term) && (good || self.recurs(&model, others.len())?);
        Ok(holds.then_some((term, good)))
    }

    /// Whether enough halves of the record select a term beside the other terms. A local shape competes with laws
    /// alone: of two shapes at one temperature each takes halves from the other, and whatever is there
    /// stays. Nor does what is as good and listed count against a name.
    fn recurs(&self, model: &Model, own: usize) -> Result<bool, Unusable> {
        let candidate = &model.terms[own].candidate;
        if candidate.is_whole() {
            return Ok(true);
        }
        let local = candidate.is_local();
        let mut others = model.terms.clone();
        others.remove(own);
        let without = self.model(&others)?;
        let round = self.round(&without, 0);
        let rivals = &model.terms[own].rivals;
        let counts = |j: &&Judged| {
            let listed = rivals.contains(&j.candidate.id());
            !(listed || local && j.candidate.is_local())
        };
        let against = round.judged.iter().filter(counts);
        let often = self.selection_frequency(model, own, &without, against);
        let certain = || model.terms[own].p_value <= BEYOND && self.is_clean(model);
        Ok(often >= if local { STABLE } else { EVER } || local && often >= HALF && certain())
    }

    /// Whether nothing is left of a record beside a model: no wander, no colour, nothing beyond chance.
    pub(super) fn is_clean(&self, model: &Model) -> bool {
        if self.wander(model) > SLOW || self.coloured(model) {
            return false;
        }
        let round = self.round(model, self.effort.surrogates);
        round.judged.iter().all(|j| j.p_value > LEVEL)
    }

    /// Whether one row of the fit holds a term's shape. Of a clip's or a dead band's rows, which are as far off as it
    /// happens, the number counts: of those off by more than the noise, or by half of the most.
    fn shows_once(&self, term: &Term, model: &Model) -> bool {
        if term.candidate.is_whole() {
            let own = model.terms.iter().position(|t| t.id() == term.id());
            let all = model.contributions(self.channels);
            let rows = own.map_or(&[][..], |k| &all[k]).iter().zip(&self.train);
            let off_dps: Vec<f64> = rows.filter(|(_, t)| **t).map(|(v, _)| v.abs()).collect();
            let most_dps = off_dps.iter().fold(0.0, |m: f64, v| m.max(*v));
            let least_dps = model.fit.noise.white_rms_dps.min(0.5 * most_dps);
            return off_dps.iter().filter(|v| **v > least_dps).count() < 2;
        }
        let of_used = |column: &Vec<f64>| self.of_used(column);
        // A step after the first row is that row's accident and a constant.
        let declared: Vec<Vec<f64>> = declared(self.channels).iter().map(of_used).collect();
        let declared = Basis::new(&declared);
        let most_of_one = |column: &[f64]| {
            let squares = column.iter().map(|v| v * v);
            let (sum, most) = squares.fold((0.0, 0.0_f64), |(s, m), v| (s + v, m.max(v)));
            most > ONE_ROW * sum
        };
        let once = |column: &Vec<f64>| {
            let column = of_used(column);
            let mut beyond = column.clone();
            declared.project_off(&mut beyond);
            most_of_one(&column) || most_of_one(&beyond)
        };
        let columns = term
            .candidate
            .columns(self.channels, &model.acting, &term.point);
        !columns.is_empty() && columns.iter().all(once)
    }

    /// How often a term's column switches between 0 and 1, at once or by and by.
    pub(super) fn switches(&self, term: &Term, model: &Model) -> usize {
        let columns = term
            .candidate
            .columns(self.channels, &model.acting, &term.point);
        let count = |c: &Vec<f64>| {
            c.windows(2)
                .filter(|w| (w[0] > 0.5) != (w[1] > 0.5))
                .count()
        };
        columns.iter().map(count).max().unwrap_or(0)
    }
}

#[cfg(test)]
#[path = "validate_tests.rs"]
mod tests;
