//! Non-linear parameters of the terms of a model, each again with the others in.

use super::acting::Settling;
use super::judge::{PRICE, WHITE, price};
use super::refine::{self, Bench};
use super::reported::WANDER;
use super::{Model, Search, Term, stairs};
use crate::statistics::Unusable;
use crate::statistics::linear::add_scaled;
use crate::statistics::noise::Shape;
use crate::statistics::reml::Fit;
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Candidate, Point, map};

/// Most turns of a polish.
const POLISHES: usize = 3;

/// Places from which a shape that moves the bias is climbed.
const CLIMBS: usize = 4;

/// What a shape gains in log-likelihood, and the same less what it costs: a form that costs more has to be worth it.
#[derive(Clone, Copy)]
struct Worth {
    gain: f64,
    net: f64,
}

/// The best place of every form.
fn best_of_forms(places: &[(Point, Worth)]) -> Vec<&Point> {
    let mut best: Vec<(&Point, f64)> = Vec::new();
    for (point, Worth { net, .. }) in places {
        let kind = |p: &Point| (p.form, p.theta.len());
        match best.iter_mut().find(|b| kind(b.0) == kind(point)) {
            Some(b) if *net > b.1 => *b = (point, *net),
            Some(_) => {}
            None => best.push((point, *net)),
        }
    }
    best.into_iter().map(|b| b.0).collect()
}

/// A shape in the other forms of its candidate, of which `points` has examples: with its own parameters where the form
/// has as many, else all examples. What was the best form beside other terms need not be the best beside these.
fn in_other_forms(points: &[Point], own: &Point) -> Vec<Point> {
    let mut out: Vec<Point> = Vec::new();
    for point in points.iter().filter(|p| p.form != own.form) {
        let same = point.theta.len() == own.theta.len();
        if same && out.iter().any(|p| p.form == point.form) {
            continue;
        }
        let theta = if same { &own.theta } else { &point.theta };
        out.push(Point::at(point.form, theta));
    }
    out
}

/// Whether a term is a clip whose levels are sought.
fn is_loose(term: &Term) -> bool {
    term.candidate.is_last() && !term.evident
}

/// One term's place among the others of a model, under one noise.
struct Place<'a> {
    c: &'a Channels,
    model: &'a Model,
    candidate: &'a dyn Candidate,
    bench: Bench<'a>,
    /// Where the term moves the bias: each of its shapes is judged by the bias that is there beside it.
    settling: Option<Settling<'a>>,
}

impl Place<'_> {
    /// The term's columns in a shape, and whether their coefficient is 1.
    fn columns(&self, point: &Point) -> (Vec<Vec<f64>>, bool) {
        let columns = match &self.settling {
            Some(settling) => {
                let from = &self.model.acting.coefficients_dps;
                settling.beside(self.candidate, point, from).columns
            }
            None => self.candidate.columns(self.c, &self.model.bias, point),
        };
        (columns, self.candidate.is_sized(point))
    }

    fn gain(&self, point: &Point) -> f64 {
        let gains = refine::gains(&self.bench, [self.columns(point)]);
        gains.first().copied().unwrap_or(0.0)
    }

    fn gains(&self, points: &[Point]) -> Vec<f64> {
        refine::gains(&self.bench, points.iter().map(|p| self.columns(p)))
    }

    fn worths(&self, points: &[Point]) -> Vec<Worth> {
        let mut paid = Vec::with_capacity(points.len());
        let shapes = points.iter().map(|point| {
            let shape = self.columns(point);
            paid.push(price(self.candidate, self.c, point) + PRICE * shape.0.len() as f64);
            shape
        });
        let gains = refine::gains(&self.bench, shapes);
        let pairs = gains.iter().zip(&paid);
        pairs
            .map(|(gain, paid)| Worth {
                gain: *gain,
                net: gain - paid,
            })
            .collect()
    }

    fn net(&self, point: &Point) -> f64 {
        let worths = self.worths(std::slice::from_ref(point));
        worths.first().map_or(f64::NEG_INFINITY, |w| w.net)
    }

    fn with_worths(&self, points: Vec<Point>) -> Vec<(Point, Worth)> {
        let worths = self.worths(&points);
        points.into_iter().zip(worths).collect()
    }

    fn climbed(&self, start: &Point) -> Point {
        let steps = self.candidate.spacing(self.c, start);
        refine::climbed(start, map(&steps, |s| 0.5 * s), |p| self.gain(p))
    }

    /// The shapes next to a term's own among which its top may lie.
    fn fine(&self, own: &Point, used: &[bool]) -> Vec<(Point, Worth)> {
        let mut fine = self.with_worths(self.candidate.fine(self.c, own, used));
        if self.settling.is_none() {
            return fine;
        }
        // The bias follows closely: tops are narrow beside the distance of these places.
        fine.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
        let mut places = 0;
        fine.retain(|(point, _)| {
            places += usize::from(!point.theta.is_empty());
            point.theta.is_empty() || places <= CLIMBS
        });
        let climbed = fine.iter().map(|(point, _)| self.climbed(point));
        self.with_worths(climbed.collect())
    }

    /// The best shape in another form than that of a top.
    fn in_another_form(&self, top: &Point) -> Option<Point> {
        let mut points = self.candidate.points(self.c);
        points.extend(self.candidate.beside(self.c, top));
        let each = self.with_worths(in_other_forms(&points, top)).into_iter();
        let best = each.max_by(|a, b| a.1.net.total_cmp(&b.1.net));
        best.map(|(point, _)| point)
    }

    /// The best shape near a term's own or from one of the finer ones, thresholds in the middle of their stairs.
    fn best(&self, own: &Point, used: &[bool]) -> Point {
        let fine = self.fine(own, used);
        let mut top = self.climbed(own);
        let mut best = self.net(&top);
        let other = match fine.is_empty() {
            true => self.in_another_form(&top),
            false => None,
        };
        for start in best_of_forms(&fine).into_iter().chain(&other) {
            // Between the places of another form its top may be far above them all.
            let point = self.climbed(start);
            let there = self.net(&point);
            if there > best {
                (top, best) = (point, there);
            }
        }
        let gains: Vec<(Point, f64)> = fine.into_iter().map(|(p, w)| (p, w.gain)).collect();
        stairs::settled(self.candidate, self.c, &top, &gains, |p| self.gains(p))
    }
}

impl Search<'_> {
    /// The non-linear parameters of every term again, with the other terms' columns in: with spikes at
    /// their weights, and with every row at full weight (a threshold that is off makes spikes of
    /// the very rows that would move it); the better model stays.
    ///
    /// # Errors
    /// Too few rows.
    pub fn polished(&self, model: Model) -> Result<Model, Unusable> {
        let polished = self.polished_to(model.clone(), f64::NEG_INFINITY)?;
        Ok(polished.unwrap_or(model))
    }

    /// The same, if its net log-likelihood is at least what is due.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn polished_to(&self, model: Model, due: f64) -> Result<Option<Model>, Unusable> {
        let mut terms = model.terms.clone();
        let polished = if let Some(points) = self.polishes.get(&terms) {
            for (term, point) in terms.iter_mut().zip(points) {
                term.point = point;
            }
            self.model(&terms)?
        } else {
            let Some(turned) = self.turned(model, due)? else {
                return Ok(None);
            };
            let polished = self.levelled(self.model(&turned.terms)?)?;
            let points = polished.terms.iter().map(|t| t.point.clone());
            self.polishes.keep(&terms, points.collect());
            polished
        };
        Ok((self.net(&polished) >= due).then_some(polished))
    }

    /// One term after the other: once, or, as what acts on the bias and the bias move each other, until all stay where they are.
    /// `None` where a turn over all terms has gained so little that the model will not come to a net
    /// log-likelihood of `due`.
    fn turned(&self, mut model: Model, due: f64) -> Result<Option<Model>, Unusable> {
        let count = model.terms.len();
        let acting = model.terms.iter().any(|t| t.candidate.acts_on_bias());
        let mut staying = 0;
        for turn in 0..POLISHES {
            let before = self.net(&model);
            for k in 0..count {
                let from = model.terms[k].point.clone();
                model = self.polished_at(model, k)?;
                let stays = model.terms[k].point == from;
                staying = if stays { staying + 1 } else { 0 };
                // The one that moved last need not be asked.
                if turn > 0 && staying + 1 >= count {
                    return Ok(Some(model));
                }
            }
            if !acting || staying == count {
                break;
            }
            let reached = self.net(&model);
            let turns_left = (POLISHES - 1 - turn) as f64;
            if reached + turns_left * (reached - before) < due {
                return Ok(None);
            }
        }
        Ok(Some(model))
    }

    /// A clip's levels where its rows lie: what all clipped rows have in common is a constant beside the model,
    /// which no likelihood tells from other levels, and what tells the two sides apart is a few rows.
    fn levelled(&self, model: Model) -> Result<Model, Unusable> {
        let most = |off_dps: [Option<f64>; 2]| {
            off_dps
                .iter()
                .flatten()
                .fold(0.0, |m: f64, v| m.max(v.abs()))
        };
        let mut terms = model.terms.clone();
        let mut away_dps = 0.0;
        for term in terms.iter_mut().filter(|t| is_loose(t)) {
            let off_dps = self.off_levels(&model, term);
            if let Some(point) = term.candidate.moved(&term.point, off_dps) {
                term.point = point;
                away_dps = most(off_dps);
            }
        }
        if away_dps == 0.0 {
            return Ok(model);
        }
        let levelled = self.model(&terms)?;
        let mut clips = levelled.terms.iter().filter(|t| is_loose(t));
        let nearer = clips.all(|t| most(self.off_levels(&levelled, t)) < 0.5 * away_dps);
        Ok(if nearer { levelled } else { model })
    }

    /// How far the fitted rows that a clip holds at its upper and at its lower level lie from there on average, deg/s;
    /// nothing where none does.
    pub(super) fn off_levels(&self, model: &Model, term: &Term) -> [Option<f64>; 2] {
        let c = self.channels;
        let columns = term.candidate.columns(c, &model.acting, &term.point);
        let residual = model.residual(c);
        let mean = |at_side: &dyn Fn(f64) -> bool| {
            let (mut sum, mut weight) = (0.0, 0.0);
            for i in (0..c.len()).filter(|i| self.used[*i] && at_side(columns[0][*i])) {
                sum += model.fit.row_weights[i] * residual[i];
                weight += model.fit.row_weights[i];
            }
            (weight > 0.0).then(|| sum / weight)
        };
        [mean(&|by| by < 0.0), mean(&|by| by > 0.0)]
    }

    /// A quick polish of the terms from the given one on: what they are worth beside the others.
    ///
    /// # Errors
    /// Too few rows.
    pub fn tried(&self, terms: &[Term], from: usize) -> Result<Model, Unusable> {
        let mut model = self.model(terms)?;
        for k in from..terms.len() {
            model = self.polished_at(model, k)?;
        }
        self.levelled(self.model(&model.terms)?)
    }

    fn polished_at(&self, mut model: Model, k: usize) -> Result<Model, Unusable> {
        if model.terms[k].evident {
            return Ok(model);
        }
        let mut ways = vec![(model.fit.clone(), model.fit.at.shape)];
        if self.spikes(&model.fit) > 0 {
            let full = model.fit.unspiked(&self.channels.time_s, &self.used)?;
            ways.push((full, model.fit.at.shape));
        }
        if self.wander(&model) > WANDER {
            // A shape that is off makes the very wander under which it seems to be right.
            ways.push((model.fit.clone(), WHITE));
        }
        for (fit, shape) in ways {
            let point = self.repolished(&model, k, (&fit, shape));
            if point == model.terms[k].point {
                continue;
            }
            let mut terms = model.terms.clone();
            terms[k].point = point;
            let options = match shape == WHITE {
                true => self.options(),
                false => self.near(&model),
            };
            let next = self.model_with(&terms, &options)?;
            if self.net(&next) > self.net(&model) && next.admits(self.channels, k) {
                model = next;
            }
        }
        Ok(model)
    }

    /// The best point of one term on a fit's rows and weights under a noise, the others held.
    fn repolished(&self, model: &Model, k: usize, (fit, shape): (&Fit, Shape)) -> Point {
        let c = self.channels;
        let mut others = model.terms.clone();
        let own = others.remove(k);
        let mut problem = fit.problem.clone();
        problem.y = fit.reduce(&c.error_dps);
        let declared = super::declared(c);
        let beside = declared.iter().chain(&self.blur);
        problem.columns = beside.map(|c| fit.reduce(c)).collect();
        for other in &others {
            for column in other.candidate.columns(c, &model.acting, &other.point) {
                let column = fit.reduce(&column);
                if other.candidate.is_sized(&other.point) {
                    add_scaled(&mut problem.y, -1.0, &column);
                } else {
                    problem.columns.push(column);
                }
            }
        }
        let candidate = own.candidate.as_ref();
        let moves = candidate.acts_on_bias() && !candidate.is_last();
        let weights = &model.fit.row_weights;
        let place = Place {
            c,
            model,
            candidate,
            bench: Bench::of_problem(fit, &problem, shape),
            settling: moves.then(|| self.settling(&others, &model.acting, weights)),
        };
        place.best(&own.point, &self.used)
    }
}
