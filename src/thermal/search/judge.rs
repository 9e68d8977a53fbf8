//! One round: all candidates beside those that are taken, each at its best shape.

use super::refine::{self, Profiled};
use super::tones::Tone;
use super::{LEVEL, MOST_RIVALS, Model, Search, fast, tones};
use crate::statistics::candidates::{Grid, Group};
use crate::statistics::noise::Shape;
use crate::statistics::reml::Fit;
use crate::statistics::score;
use crate::statistics::score::Scores;
use crate::thermal::channels::Channels;
use crate::thermal::effects::tone::{Pickup, returns};
use crate::thermal::effects::{Candidate, Missing, Point};
use std::sync::Arc;

/// What a coefficient or parameter costs in log-likelihood when explanations are compared.
pub const PRICE: f64 = 2.0;

/// What a shape costs beside its columns.
pub fn price(candidate: &dyn Candidate, c: &Channels, point: &Point) -> f64 {
    let odds = candidate.odds_against(c, point);
    PRICE * point.theta.len() as f64 + candidate.surcharge(c, point) + odds
}

/// Net gain within which two explanations are equally good.
pub const EQUAL: f64 = 4.0;

/// The same where the temperature goes one way: what depends on temperature is then a function of time and
/// the other way round, so that a catalogue's idealised forms differ by less than the truth from each.
const EQUAL_ONE_WAY: f64 = 12.0;

/// No slow noise.
pub(super) const WHITE: Shape = Shape {
    flicker: 0.0,
    walk: 0.0,
};

/// How good two explanations of a record are equal.
pub fn equal(c: &Channels) -> f64 {
    if c.goes_one_way() {
        EQUAL_ONE_WAY
    } else {
        EQUAL
    }
}

/// What a coarse grid may hide of a small gain.
const COARSE: f64 = 20.0;

/// Whether a gain is so near the best one that the candidate's shape is looked at finely.
fn is_near(gain: f64, best: f64) -> bool {
    gain > 0.5 * best - 10.0
}

/// A candidate of one round, judged.
#[derive(Clone)]
pub struct Judged {
    /// Which.
    pub candidate: Arc<dyn Candidate>,
    /// Its best shape.
    pub point: Point,
    /// Gain in log-likelihood.
    pub gain: f64,
    /// The same less the price of its coefficients and parameters.
    pub net: f64,
    /// What odds before the record have in [`Judged::net`].
    pub odds_against: f64,
    /// Probability that the best of all does as well by chance; 1 where that was not asked.
    pub p_value: f64,
}

impl Judged {
    /// Not a shape without a name.
    pub fn is_named(&self) -> bool {
        self.candidate.named()
    }

    /// A name that is beyond chance.
    pub fn is_found(&self) -> bool {
        self.candidate.named() && self.p_value <= LEVEL
    }
}

/// Candidates with their shapes, in order.
type Running = Vec<(Arc<dyn Candidate>, Vec<Point>)>;

/// What the shapes of all candidates gain beside a model, before any is looked at finely.
#[derive(Clone)]
pub(super) struct Scored {
    /// A tone, of which `scores` does not know, is the last.
    running: Running,
    missing: Vec<(Arc<dyn Candidate>, Missing)>,
    scores: Scores,
    /// Probabilities of the leader for which more surrogates would be drawn; `None`: all were that were asked for.
    doubt: Option<Doubt>,
    tone_p: f64,
}

impl Scored {
    /// The same of the candidates that are not `out`; `None` where their leader's probability is not clear by the surrogates
    /// that were drawn. By chance all candidates are as good as they were, those that are out among them: probabilities are
    /// never too small.
    pub fn without(&self, out: &dyn Fn(&dyn Candidate) -> bool) -> Option<Scored> {
        let mut rest = self.clone();
        let is_in: Vec<bool> = self.running.iter().map(|r| !out(r.0.as_ref())).collect();
        let mut running = is_in.iter();
        rest.running.retain(|_| *running.next().unwrap_or(&true));
        let mut groups = is_in.iter();
        let of_groups = &mut rest.scores.groups;
        of_groups.retain(|_| *groups.next().unwrap_or(&true));
        rest.missing
            .retain(|(candidate, _)| !out(candidate.as_ref()));
        let clear = self.doubt.is_none_or(|doubt| rest.scores.is_clear(doubt));
        clear.then_some(rest)
    }
}

/// A round's result.
#[derive(Clone)]
pub struct Round {
    /// The best net gain first.
    pub judged: Vec<Judged>,
    /// Net gain within which two of them are equally good.
    pub equal: f64,
    /// What could not be judged.
    pub missing: Vec<(Arc<dyn Candidate>, Missing)>,
    /// The candidate by whose gain the others were near enough for a fine look, or not.
    pub leads: Option<String>,
}

impl Round {
    /// The net gain that a candidate has at most: of one that is far from the best only the places of a coarse grid are known,
    /// of one that was not judged nothing.
    pub fn at_most(&self, judged: Option<&Judged>) -> f64 {
        let Some(judged) = judged else {
            return COARSE;
        };
        let best = self.judged.iter().map(|j| j.gain).fold(0.0, f64::max);
        match is_near(judged.gain, best) {
            true => judged.net,
            false => judged.net + judged.gain.max(COARSE),
        }
    }

    /// Names that do as well as the given one, best first; of those that do so only because the
    /// temperature goes one way, no more than a step may have.
    pub fn rivals(&self, chosen: &Judged) -> Vec<String> {
        let id = chosen.candidate.id();
        let others = || {
            let named = self.judged.iter().filter(|j| j.candidate.named());
            named.filter(|j| j.candidate.id() != id)
        };
        let within =
            |margin: f64| others().filter(move |j| j.net + j.odds_against > chosen.net - margin);
        let strict = within(EQUAL).count();
        within(self.equal.max(EQUAL))
            .take(strict.max(MOST_RIVALS))
            .map(|j| j.candidate.id())
            .collect()
    }
}

impl Search<'_> {
    /// Judges all candidates that are not among the model's terms. `surrogates` = 0: gains alone.
    pub fn judge(&self, model: &Model, surrogates: usize) -> Round {
        self.judge_among(model, surrogates, &|_| true)
    }

    /// Gains of some candidates alone.
    pub fn gains_of(&self, model: &Model, are: &dyn Fn(&dyn Candidate) -> bool) -> Round {
        self.judge_among(model, 0, are)
    }

    /// What all candidates gain that are not among the model's terms.
    pub(super) fn scored(&self, model: &Model, surrogates: usize) -> Scored {
        self.scored_among(model, surrogates, &|_| true)
    }

    fn judge_among(
        &self,
        model: &Model,
        surrogates: usize,
        are: &dyn Fn(&dyn Candidate) -> bool,
    ) -> Round {
        self.judged(model, &self.scored_among(model, surrogates, are))
    }

    /// Candidates at their best shapes.
    pub(super) fn judged(&self, model: &Model, scored: &Scored) -> Round {
        let leads = scored.scores.greatest();
        let mut judged = self.refined(model, scored);
        judged.sort_by(|a, b| b.net.total_cmp(&a.net));
        Round {
            judged,
            equal: equal(self.channels),
            missing: scored.missing.clone(),
            leads: leads.map(|g| scored.running[g].0.id()),
        }
    }

    fn scored_among(
        &self,
        model: &Model,
        surrogates: usize,
        are: &dyn Fn(&dyn Candidate) -> bool,
    ) -> Scored {
        let c = self.channels;
        let fit = &model.fit;
        let mut missing = Vec::new();
        let mut running: Running = Vec::new();
        let taken: Vec<String> = model.terms.iter().map(|t| t.id()).collect();
        let beginning = self.beginning.borrow();
        let is_out = |candidate: &dyn Candidate| {
            let id = candidate.id();
            taken.contains(&id) || beginning.barred.contains(&id) || !are(candidate)
        };
        for candidate in &self.candidates {
            if is_out(candidate.as_ref()) {
                continue;
            }
            match candidate.channels(c) {
                Ok(_) => running.push((candidate.clone(), candidate.points(c))),
                Err(why) => missing.push((candidate.clone(), why)),
            }
        }
        let groups: Vec<Group> = running
            .iter()
            .map(|(candidate, points)| Group {
                points: points
                    .iter()
                    .map(|p| reduced(self, model, candidate.as_ref(), p))
                    .collect(),
            })
            .collect();
        let (scores, doubt) = self.scores(fit, &groups, surrogates);
        let grid = match surrogates {
            0 => scores.grid.thinned(),
            _ => scores.grid.clone(),
        };
        let taken = taken.iter().any(|id| id == "periodic_pickup");
        let pickup = |frequency_hz: f64| Pickup {
            frequency_hz,
            further: taken || !returns(c, frequency_hz),
        };
        let tone = are(&pickup(0.0)).then(|| self.tone(model, &grid)).flatten();
        if let Some(tone) = tone {
            let pickup = pickup(tone.frequency_hz);
            if !is_out(&pickup) {
                let points = pickup.points(c);
                running.push((Arc::new(pickup), points));
            }
        }
        Scored {
            running,
            missing,
            scores,
            doubt,
            // Two tests, the tones' and all others', share the level.
            tone_p: tone.map_or(1.0, |t| (2.0 * t.p_value).min(1.0)),
        }
    }

    /// The likeliest tone beside a model, between the rows of its blocks as well.
    fn tone(&self, model: &Model, grid: &Grid) -> Option<Tone> {
        let c = self.channels;
        let fit = &model.fit;
        let slow = tones::strongest(c, fit, grid);
        let rest = model.residual(c);
        let fast = fit.decimated.as_ref();
        let fast = fast.and_then(|b| fast::within_blocks(c, &rest, &b.weights, b.rows));
        // What blocks leave of a tone that is in is that tone.
        let fast = fast.filter(|tone| !has_tone(model, tone.frequency_hz, 2.0 / c.span_s()));
        let both = [slow, fast].into_iter().flatten();
        let both = both.map(|tone| tones::unaliased(c, fit, &rest, tone));
        both.min_by(|a, b| a.p_value.total_cmp(&b.p_value))
    }

    /// The best shape of every group that is near the leader, its non-linear parameters
    /// estimated.
    fn refined(&self, model: &Model, scored: &Scored) -> Vec<Judged> {
        let Scored {
            running, scores, ..
        } = scored;
        let c = self.channels;
        let fit = &model.fit;
        let best = scores.groups.iter().map(|g| g.gain).fold(0.0, f64::max);
        let mut starts = Vec::new();
        let mut wholes = Vec::new();
        let mut biases = Vec::new();
        for (k, (candidate, points)) in running.iter().enumerate() {
            let (point, shape, p_value, gain) = match scores.groups.get(k) {
                Some(g) => {
                    let point = g.point.and_then(|p| points.get(p));
                    (point, g.shape, g.p_bootstrap.unwrap_or(1.0), g.gain)
                }
                None => (points.first(), fit.at.shape, scored.tone_p, best),
            };
            let Some(point) = point else { continue };
            let near = is_near(gain, best);
            let top = self.top(model, candidate.as_ref(), (points, point), shape, near);
            starts.push((candidate.clone(), top.point, p_value));
            wholes.push(top.whole);
            biases.push(top.bias);
        }
        let columns: Vec<Vec<Vec<f64>>> = starts
            .iter()
            .zip(&biases)
            .map(|((candidate, point, _), bias)| {
                model.shown(candidate.columns(c, bias.as_ref().unwrap_or(&model.bias), point))
            })
            .collect();
        let gains = refine::profiled(fit, &scores.grid, &columns);
        starts
            .into_iter()
            .zip(gains)
            .zip(wholes)
            .filter(|((_, g), _)| g.columns > 0)
            .map(
                |(((candidate, point, p_value), Profiled { gain, columns, .. }), whole)| {
                    let gain = whole.unwrap_or(gain);
                    let paid = PRICE * columns as f64 + price(candidate.as_ref(), c, &point);
                    Judged {
                        net: gain - paid,
                        odds_against: candidate.odds_against(c, &point),
                        candidate,
                        point,
                        gain,
                        p_value,
                    }
                },
            )
            .collect()
    }
}

/// Surrogates of a first look, and probabilities at which it decides: far from the level, more
/// surrogates change nothing.
const FIRST_LOOK: usize = 30;
const CLEAR: Doubt = (1e-4, 0.12);

/// Probabilities between which more surrogates may decide otherwise.
type Doubt = (f64, f64);

/// The same with the surrogates of another round of the record: by chance the best of a dictionary is nearly as good beside other
/// terms as beside these.
const BEYOND_DOUBT: Doubt = (1e-3, 0.05);

impl Search<'_> {
    /// Scores with as many surrogates as it takes, `surrogates` at most, and the probabilities at which it would take more.
    fn scores(&self, fit: &Fit, groups: &[Group], surrogates: usize) -> (Scores, Option<Doubt>) {
        let with = |surrogates: usize, is_thin: bool| {
            let options = score::Options {
                surrogates,
                is_thin,
                seed: 1,
            };
            score::score(fit, groups, &options)
        };
        if surrogates == 0 {
            return (with(0, true), None);
        }
        let known = self.by_chance.borrow().clone();
        if let Some(tail) = known {
            let scores = with(0, true).judged_by(&tail);
            if scores.is_below(BEYOND_DOUBT.0) {
                return (scores, Some(BEYOND_DOUBT));
            }
            let scores = with(0, false).judged_by(&tail);
            if scores.is_clear(BEYOND_DOUBT) {
                return (scores, Some(BEYOND_DOUBT));
            }
        }
        let mut scores = with(surrogates.min(FIRST_LOOK), false);
        let mut doubt = (surrogates > FIRST_LOOK).then_some(CLEAR);
        if doubt.is_some_and(|doubt| !scores.is_clear(doubt)) {
            scores = with(surrogates, false);
            doubt = None;
        }
        self.by_chance.replace(scores.by_chance.clone());
        (scores, doubt)
    }
}

/// Columns of a shape in the rows of the fit's problem.
fn reduced(
    search: &Search<'_>,
    model: &Model,
    candidate: &dyn Candidate,
    point: &Point,
) -> Vec<Vec<f64>> {
    let columns = candidate.columns(search.channels, &model.bias, point);
    let columns = model.shown(columns);
    columns.iter().map(|c| model.fit.reduce(c)).collect()
}

/// Whether a model has a tone of a frequency, to `within_hz`.
fn has_tone(model: &Model, frequency_hz: f64, within_hz: f64) -> bool {
    let mut tones = model.terms.iter().filter(|t| {
        let id = t.id();
        id == "periodic_pickup" || id == "outside:tone"
    });
    tones.any(|t| (t.point.theta[0] - frequency_hz).abs() < within_hz)
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;
