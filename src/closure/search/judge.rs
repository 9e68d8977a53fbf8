//! One round: all candidates beside those that are taken, each at its best shape.

use super::acting::Settling;
use super::refine::{self, Bench, Profiled};
use super::{LEVEL, MOST_RIVALS, Model, Search, fast, tones};
use crate::closure::channels::Channels;
use crate::closure::effects::tone::{Pickup, returns};
use crate::closure::effects::{Bias, Candidate, Missing, Point, map};
use crate::closure::likelihood::candidates::Group;
use crate::closure::likelihood::linear::add_scaled;
use crate::closure::likelihood::noise::Shape;
use crate::closure::likelihood::reml::Fit;
use crate::closure::likelihood::score::{self, Scores};
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

/// Sizes from which a shape that moves the bias is climbed where one without a size is the best of those tried.
const SIZES: usize = 2;

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

/// A candidate's best shape.
struct Top {
    point: Point,
    /// The declared bias beside it, where it moves that.
    bias: Option<Bias>,
    /// Gain in log-likelihood of a shape that has its size in it.
    whole: Option<f64>,
}

/// Candidates with their shapes, in order.
type Running = Vec<(Arc<dyn Candidate>, Vec<Point>)>;

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
        let c = self.channels;
        let fit = &model.fit;
        let mut missing = Vec::new();
        let mut running: Running = Vec::new();
        let taken: Vec<String> = model.terms.iter().map(|t| t.id()).collect();
        let beginning = self.beginning.borrow();
        let is_out = |id: String| taken.contains(&id) || beginning.barred.contains(&id);
        for candidate in &self.candidates {
            if is_out(candidate.id()) {
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
        let scores = self.scored(fit, &groups, surrogates);
        let leads = scores.greatest().map(|g| running[g].0.id());
        let grid = match surrogates {
            0 => scores.grid.thinned(),
            _ => scores.grid.clone(),
        };
        let tone = tones::strongest(c, fit, &grid);
        let rest = model.residual(c);
        let fast = fit.decimated.as_ref();
        let fast = fast.and_then(|b| fast::within_blocks(c, &rest, &b.weights, b.rows));
        // What blocks leave of a tone that is in is that tone.
        let fast = fast.filter(|tone| !has_tone(model, tone.frequency_hz, 2.0 / c.span_s()));
        let both = [tone, fast].into_iter().flatten();
        let both = both.map(|tone| tones::unaliased(c, fit, &rest, tone));
        let tone = both.min_by(|a, b| a.p_value.total_cmp(&b.p_value));
        if let Some(tone) = tone {
            let taken = taken.iter().any(|id| id == "periodic_pickup");
            let pickup: Arc<dyn Candidate> = Arc::new(Pickup {
                frequency_hz: tone.frequency_hz,
                further: taken || !returns(c, tone.frequency_hz),
            });
            if !is_out(pickup.id()) {
                let points = pickup.points(c);
                running.push((pickup, points));
            }
        }
        // Two tests, the tones' and all others', share the level.
        let tone_p = tone.map_or(1.0, |t| (2.0 * t.p_value).min(1.0));
        let mut judged = self.refined(model, &running, &scores, tone_p);
        judged.sort_by(|a, b| b.net.total_cmp(&a.net));
        Round {
            judged,
            equal: equal(c),
            missing,
            leads,
        }
    }

    /// The best shape of every group that is near the leader, its non-linear parameters
    /// estimated; `scores` does not know the last one, a tone.
    fn refined(
        &self,
        model: &Model,
        running: &Running,
        scores: &Scores,
        tone_p: f64,
    ) -> Vec<Judged> {
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
                None => (points.first(), fit.at.shape, tone_p, best),
            };
            let Some(point) = point else { continue };
            let near = gain > 0.5 * best - 10.0;
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

impl Search<'_> {
    /// The best shape of a candidate, of its `points` one of which is best at the noise `shape`; roughly, where it is not
    /// `near` the leader.
    fn top(
        &self,
        model: &Model,
        candidate: &dyn Candidate,
        (points, point): (&[Point], &Point),
        shape: Shape,
        near: bool,
    ) -> Top {
        let c = self.channels;
        let fit = &model.fit;
        let acting = candidate.acts_on_bias() && !candidate.is_last();
        let mut top = Top {
            point: point.clone(),
            bias: None,
            whole: None,
        };
        if !(near || acting || candidate.is_whole()) {
            return top;
        }
        // At one noise; the null hypothesis may choose the one that suits it best.
        let mut benches = vec![(shape, Bench::new(model, shape))];
        // A residual with sharp ends looks like a walk without white noise, to which a threshold that is off by a row, or
        // a form that is not quite the one, is no better than none: it is found where the noise is white.
        if near && (acting || candidate.is_whole() || candidate.is_local()) {
            benches.push((WHITE, Bench::new(model, WHITE)));
        }
        let best = |point: &Point, bias: &Option<Bias>| {
            let bias = bias.as_ref().unwrap_or(&model.bias);
            let at = |(shape, bench): &(Shape, Bench<'_>)| {
                let there = refine::gain(bench, candidate, c, bias, point);
                there + fit.problem.evaluate(*shape).loglik - fit.at.loglik
            };
            benches
                .iter()
                .map(at)
                .fold(f64::NEG_INFINITY, |m, v| m.max(v))
        };
        let mut reached = f64::NEG_INFINITY;
        for (k, (_, bench)) in benches.iter().enumerate() {
            let found = match (acting, k) {
                (true, _) => self.admitted(model, candidate, points, bench),
                // Where physics gives the coefficient, the best shape is not that of a free one.
                (false, 0) if !candidate.is_whole() => {
                    let top = refine::refined(bench, candidate, c, &model.bias, point, 0.5);
                    Some((top, None))
                }
                _ => self.sharpened(model, candidate, points, bench),
            };
            let Some((point, bias)) = found else { continue };
            let net = best(&point, &bias) - price(candidate, c, &point);
            if net > reached {
                (reached, top.point, top.bias) = (net, point, bias);
            }
        }
        top.whole = candidate
            .is_sized(&top.point)
            .then(|| best(&top.point, &top.bias));
        top
    }

    /// The best point of a shape with thresholds on a bench.
    fn sharpened(
        &self,
        model: &Model,
        candidate: &dyn Candidate,
        points: &[Point],
        bench: &Bench<'_>,
    ) -> Option<(Point, Option<Bias>)> {
        let c = self.channels;
        let gain = |p: &Point| refine::gain(bench, candidate, c, &model.bias, p);
        let each = points.iter().map(|p| (p, &model.bias));
        let gains = refine::gains(bench, candidate, c, each);
        let each = points.iter().zip(gains);
        let each = each.map(|(p, gain)| (gain - price(candidate, c, p), p));
        let (_, start) = each.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let steps = map(&candidate.spacing(c, start), |s| 0.5 * s);
        Some((refine::climbed(start, steps, gain), None))
    }

    /// The best of `points` whose coefficients physics admits, each with the declared bias that is there beside it: a
    /// strong effect that acts on the bias bends what the declared model finds without it, and would be judged by
    /// a bias that it made itself.
    fn admitted(
        &self,
        model: &Model,
        candidate: &dyn Candidate,
        points: &[Point],
        bench: &Bench<'_>,
    ) -> Option<(Point, Option<Bias>)> {
        let c = self.channels;
        let settling = self.settling_beside(model);
        let start = &model.bias.coefficients_dps;
        // The bias beside a shape, and what the shape costs, if it is admitted.
        let beside = |point: &Point| {
            let settled = settling.beside(candidate, point, start);
            let paid = PRICE * settled.own.len() as f64 + price(candidate, c, point);
            let bias = Bias {
                coefficients_dps: settled.bias,
                ..model.bias.clone()
            };
            candidate
                .admits(point, &settled.own)
                .then_some((bias, paid))
        };
        let net = |point: &Point| {
            let (bias, paid) = beside(point)?;
            Some(refine::gain(bench, candidate, c, &bias, point) - paid)
        };
        let admitted = points.iter().filter_map(|p| Some((p, beside(p)?)));
        let admitted: Vec<(&Point, (Bias, f64))> = admitted.collect();
        let each = admitted.iter().map(|(point, (bias, _))| (*point, bias));
        let gains = refine::gains(bench, candidate, c, each);
        let nets = gains.into_iter().zip(&admitted);
        let mut places: Vec<(f64, &Point)> = nets
            .map(|(gain, (point, (_, paid)))| (gain - paid, *point))
            .collect();
        places.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (_, first) = *places.first()?;
        let mut starts = vec![first];
        if !candidate.is_sized(first) {
            // The bias follows closely: between two sizes the top may be far above both, and above what has no size.
            let sized = places.iter().map(|p| p.1);
            starts.extend(sized.filter(|p| candidate.is_sized(p)).take(SIZES));
        }
        let reached = |p: &Point| net(p).unwrap_or(f64::NEG_INFINITY);
        let tops = starts.into_iter().map(|start| {
            let steps = map(&candidate.spacing(c, start), |s| 0.5 * s);
            let top = refine::climbed(start, steps, reached);
            (reached(&top), top)
        });
        let (_, top) = tops.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let bias = Bias {
            coefficients_dps: settling.beside(candidate, &top, start).bias,
            ..model.bias.clone()
        };
        Some((top, Some(bias)))
    }

    /// For the declared bias with a candidate in, beside what a model has. Ordinary least squares, for the shape alone.
    fn settling_beside(&self, model: &Model) -> Settling<'_> {
        let mut rest = self.channels.error_dps.clone();
        let order = model.bias.coefficients_dps.len();
        for (column, b) in model.columns.iter().zip(&model.beta).skip(order) {
            add_scaled(&mut rest, -b, column);
        }
        Settling::new(self.channels, (&rest, &model.free_weights()), &[], &[])
    }
}

/// Surrogates of a first look, and probabilities at which it decides: far from the level, more
/// surrogates change nothing.
const FIRST_LOOK: usize = 30;
const CLEAR: (f64, f64) = (1e-4, 0.12);

/// The same with the surrogates of another round of the record: by chance the best of a dictionary is as good beside other
/// terms as beside these, nearly.
const BEYOND_DOUBT: (f64, f64) = (1e-8, 0.5);

impl Search<'_> {
    /// Scores with as many surrogates as it takes, `surrogates` at most.
    fn scored(&self, fit: &Fit, groups: &[Group], surrogates: usize) -> Scores {
        let with = |surrogates: usize| {
            let options = score::Options {
                surrogates,
                seed: 1,
            };
            score::score(fit, groups, &options)
        };
        if surrogates == 0 {
            return with(0);
        }
        let known = self.by_chance.borrow().clone();
        if let Some(tail) = known {
            let scores = with(0).judged_by(&tail);
            if scores.is_clear(BEYOND_DOUBT) {
                return scores;
            }
        }
        let mut scores = with(surrogates.min(FIRST_LOOK));
        if surrogates > FIRST_LOOK && !scores.is_clear(CLEAR) {
            scores = with(surrogates);
        }
        self.by_chance.replace(scores.by_chance.clone());
        scores
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
