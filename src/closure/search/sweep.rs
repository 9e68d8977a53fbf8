//! After the forward steps: every term again, with the others in.

use super::judge::{EQUAL, Judged, PRICE, WHITE, price};
use super::refine::{self, Bench};
use super::reported::WANDER;
use super::{MOST_RIVALS, Model, Search, Term, stairs};
use crate::closure::effects::{Bias, Point, map};
use crate::closure::likelihood::Unusable;
use crate::closure::likelihood::linear::add_scaled;
use crate::closure::likelihood::noise::Shape;
use crate::closure::likelihood::reml::Fit;
use std::borrow::Cow;

/// Net gain by which another candidate takes a term's place.
pub(super) const BETTER: f64 = 1.5;

/// Most turns of a polish.
const POLISHES: usize = 3;

/// Places from which a shape that moves the bias is climbed.
const CLIMBS: usize = 4;

/// Passes over all terms.
const SWEEPS: usize = 2;

/// The best place of every form.
fn best_of_forms(places: &[(Point, f64)], net: impl Fn(&Point, f64) -> f64) -> Vec<&Point> {
    let mut best: Vec<(&Point, f64)> = Vec::new();
    for (point, there) in places {
        let there = net(point, *there);
        let kind = |p: &Point| (p.form, p.theta.len());
        match best.iter_mut().find(|b| kind(b.0) == kind(point)) {
            Some(b) if there > b.1 => *b = (point, there),
            Some(_) => {}
            None => best.push((point, there)),
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

impl Search<'_> {
    /// The non-linear parameters of every term again, with the other terms' columns in: with spikes at
    /// their weights, and with every row at full weight (a threshold that is off makes spikes of
    /// the very rows that would move it); the better model stays.
    ///
    /// # Errors
    /// Too few rows.
    pub fn polished(&self, model: Model) -> Result<Model, Unusable> {
        let given = model.terms.clone();
        if let Some(points) = self.polishes.get(&given) {
            let mut terms = given;
            for (term, point) in terms.iter_mut().zip(points) {
                term.point = point;
            }
            return self.model(&terms);
        }
        match self.turned(model, f64::NEG_INFINITY)? {
            Some(turned) => self.kept(&given, turned),
            None => self.model(&given),
        }
    }

    /// The polished model of some terms, if its net log-likelihood is at least what is due.
    fn polished_to(&self, terms: &[Term], due: f64) -> Result<Option<Model>, Unusable> {
        let model = self.model(terms)?;
        let polished = match self.polishes.get(terms) {
            Some(_) => self.polished(model)?,
            None => match self.turned(model, due)? {
                Some(turned) => self.kept(terms, turned)?,
                None => return Ok(None),
            },
        };
        Ok((self.net(&polished) >= due).then_some(polished))
    }

    /// The model of turned terms, kept as the polish of the given ones.
    fn kept(&self, given: &[Term], turned: Model) -> Result<Model, Unusable> {
        let polished = self.levelled(self.model(&turned.terms)?)?;
        let points = polished.terms.iter().map(|t| t.point.clone());
        self.polishes.keep(given, points.collect());
        Ok(polished)
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
        let mut terms = model.terms.clone();
        let mut away_dps = 0.0;
        for term in terms.iter_mut().filter(|t| is_loose(t)) {
            let off_dps = self.off_levels(&model, term);
            if let Some(point) = term.candidate.moved(&term.point, off_dps) {
                term.point = point;
                away_dps = off_dps[0].abs().max(off_dps[1].abs());
            }
        }
        if away_dps == 0.0 {
            return Ok(model);
        }
        let levelled = self.model(&terms)?;
        let mut clips = levelled.terms.iter().filter(|t| is_loose(t));
        let nearer = clips.all(|t| {
            let off_dps = self.off_levels(&levelled, t);
            off_dps[0].abs().max(off_dps[1].abs()) < 0.5 * away_dps
        });
        Ok(if nearer { levelled } else { model })
    }

    /// How far the fitted rows that a clip holds at its upper and at its lower level lie from there on average, deg/s;
    /// 0 where none does.
    pub(super) fn off_levels(&self, model: &Model, term: &Term) -> [f64; 2] {
        let c = self.channels;
        let columns = term.candidate.columns(c, &model.acting, &term.point);
        let residual = model.residual(c);
        let mean = |at_side: &dyn Fn(f64) -> bool| {
            let (mut sum, mut weight) = (0.0, 0.0);
            for i in (0..c.len()).filter(|i| self.used[*i] && at_side(columns[0][*i])) {
                sum += model.fit.row_weights[i] * residual[i];
                weight += model.fit.row_weights[i];
            }
            if weight > 0.0 { sum / weight } else { 0.0 }
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
        let mut problem = fit.problem.clone();
        problem.y = fit.reduce(&c.error_dps);
        let declared = super::declared(c);
        let beside = declared.iter().chain(&self.blur);
        problem.columns = beside.map(|c| fit.reduce(c)).collect();
        for (j, other) in model.terms.iter().enumerate() {
            if j == k {
                continue;
            }
            for column in other.candidate.columns(c, &model.acting, &other.point) {
                let column = fit.reduce(&column);
                if other.candidate.is_sized(&other.point) {
                    add_scaled(&mut problem.y, -1.0, &column);
                } else {
                    problem.columns.push(column);
                }
            }
        }
        let bench = Bench::of_problem(fit, &problem, shape);
        let term = &model.terms[k];
        let candidate = term.candidate.as_ref();
        // A shape that acts on the bias moves it: each is judged by the bias that is there beside it.
        let moves = candidate.acts_on_bias() && !candidate.is_last();
        let settling = moves.then(|| {
            let mut others = model.terms.clone();
            others.remove(k);
            self.settling(&others, &model.acting, &model.fit.row_weights)
        });
        let start = &model.acting.coefficients_dps;
        let bias = |p: &Point| match &settling {
            Some(settling) => Cow::Owned(Bias {
                coefficients_dps: settling.beside(candidate, p, start).bias,
                ..model.acting.clone()
            }),
            None => Cow::Borrowed(&model.bias),
        };
        let gains = |points: &[Point]| {
            let each = points.iter().map(|p| (p, bias(p)));
            refine::gains(&bench, candidate, c, each)
        };
        let gain = |p: &Point| refine::gain(&bench, candidate, c, &bias(p), p);
        let climbed = |start: &Point| {
            let steps = candidate.spacing(c, start);
            refine::climbed(start, map(&steps, |s| 0.5 * s), gain)
        };
        let with_gains = |points: Vec<Point>| -> Vec<(Point, f64)> {
            let gains = gains(&points);
            points.into_iter().zip(gains).collect()
        };
        let mut fine = with_gains(candidate.fine(c, &term.point, &self.used));
        if moves {
            // The bias follows closely: tops are narrow beside the distance of these places.
            fine.sort_by(|a, b| b.1.total_cmp(&a.1));
            let mut places = 0;
            fine.retain(|(point, _)| {
                places += usize::from(!point.theta.is_empty());
                point.theta.is_empty() || places <= CLIMBS
            });
            for (point, there) in &mut fine {
                *point = climbed(point);
                *there = gain(point);
            }
        }
        // A form that costs more has to be worth it.
        let net = |p: &Point, there: f64| {
            let columns = candidate.columns(c, &model.bias, p).len();
            there - price(candidate, c, p) - PRICE * columns as f64
        };
        let mut top = climbed(&term.point);
        let mut best = net(&top, gain(&top));
        let others: Vec<(Point, f64)> = match fine.is_empty() {
            true => with_gains(in_other_forms(&candidate.points(c), &top)),
            false => Vec::new(),
        };
        let other = others
            .iter()
            .max_by(|a, b| net(&a.0, a.1).total_cmp(&net(&b.0, b.1)));
        let starts = best_of_forms(&fine, net).into_iter();
        for start in starts.chain(other.map(|o| &o.0)) {
            // Between the places of another form its top may be far above them all.
            let point = climbed(start);
            let there = net(&point, gain(&point));
            if there > best {
                (top, best) = (point, there);
            }
        }
        stairs::settled(candidate, c, &top, &fine, gains)
    }

    /// Every term against all other candidates, the other terms being in: it is replaced by a better
    /// one, dropped where it is not needed, and its rivals are those of the whole model.
    ///
    /// # Errors
    /// Too few rows.
    pub fn swept(&self, mut model: Model) -> Result<Model, Unusable> {
        if model.terms.len() < 2 {
            return Ok(model);
        }
        for _ in 0..SWEEPS {
            let mut changed = false;
            let mut k = 0;
            while k < model.terms.len() {
                if model.terms[k].evident {
                    k += 1;
                    continue;
                }
                let mut others = model.terms.clone();
                let own = others.remove(k);
                let own_spikes = self.spikes(&model.fit);
                let ag = self.again((&others, k), &own, own_spikes)?;
                match ag {
                    Some(term) => {
                        changed |= term.id() != own.id();
                        others.insert(k, term);
                        k += 1;
                    }
                    None => changed = true,
                }
                model = self.model(&others)?;
            }
            if !changed {
                break;
            }
            model = self.polished(model)?;
        }
        Ok(model)
    }

    /// Without names that the others, in the shapes that suit them best, do as well without: such a name mended
    /// what another one's shape was off when it came.
    ///
    /// # Errors
    /// Too few rows.
    pub fn spared(&self, mut model: Model) -> Result<Model, Unusable> {
        let mut k = 0;
        while k < model.terms.len() && model.terms.len() > 1 {
            let own = &model.terms[k];
            let mut others = model.terms.clone();
            others.remove(k);
            let doubted = own.candidate.named() && !own.evident;
            if doubted && others.iter().any(|t| t.candidate.named()) {
                let due = self.net(&model) - EQUAL;
                if let Some(without) = self.polished_to(&others, due)? {
                    model = without;
                    k = 0;
                    continue;
                }
            }
            k += 1;
        }
        Ok(model)
    }

    /// Two names that the same third one would do for, each beside the other, give their place to it where it is worth as much
    /// as both: a shape that is not quite the one that is there needs a second one for what it is off.
    ///
    /// # Errors
    /// Too few rows.
    pub fn united(&self, model: Model) -> Result<Model, Unusable> {
        let named = |k: &usize| model.terms[*k].candidate.named() && !model.terms[*k].evident;
        let names: Vec<usize> = (0..model.terms.len()).filter(named).collect();
        for (i, first) in names.iter().enumerate() {
            for second in &names[i + 1..] {
                let (a, b) = (&model.terms[*first], &model.terms[*second]);
                let common = a.rivals.iter().filter(|r| b.rivals.contains(r));
                for id in common {
                    let mut terms = model.terms.clone();
                    terms.remove(*second);
                    terms.remove(*first);
                    if let Some(united) = self.with_instead(terms, id)?
                        && self.net(&united) >= self.net(&model)
                    {
                        return Ok(united);
                    }
                }
            }
        }
        Ok(model)
    }

    /// The model with a name more, if it is called for.
    fn with_instead(&self, mut terms: Vec<Term>, id: &str) -> Result<Option<Model>, Unusable> {
        let others = self.model(&terms)?;
        let round = self.round(&others, self.effort.surrogates);
        let same = round.judged.iter().find(|j| j.candidate.id() == *id);
        let Some(name) = same.filter(|j| j.is_found()) else {
            return Ok(None);
        };
        let mut term = Term::of(name, round.rivals(name));
        term.beside = terms.iter().map(Term::id).collect();
        terms.push(term);
        Ok(Some(self.polished(self.model(&terms)?)?))
    }

    /// What takes a term's place beside the others; `None`: nothing is needed.
    fn again(
        &self,
        (others, k): (&[Term], usize),
        own: &Term,
        own_spikes: usize,
    ) -> Result<Option<Term>, Unusable> {
        let without = self.model(others)?;
        let round = self.round(&without, 0);
        let same = round.judged.iter().find(|j| j.candidate.id() == own.id());
        let kept = |j: &Judged| {
            let mut term = Term::of(j, round.rivals(j));
            term.p_value = own.p_value;
            term.beside.clone_from(&own.beside);
            if term.id() == own.id() {
                term.found_at.clone_from(&own.found_at);
            } else {
                // The probability is that of another name.
                term.beside.push(own.id());
            }
            if term.rivals.len() > MOST_RIVALS {
                term.rivals.truncate(MOST_RIVALS);
            }
            term
        };
        let needed = |j: &Judged| j.net > PRICE;
        // A tone that is another channel's will have no name: it takes no name's place.
        let stays = |j: &&Judged| {
            j.candidate.named() && !self.is_another_channels(&j.candidate.id(), &j.point)
        };
        let best_name = round.judged.iter().find(stays);
        let explains_spikes = self.spikes(&without.fit) > own_spikes + 1;
        let Some(same) = same else {
            if explains_spikes {
                // All that it explains is out: there is nothing to judge it by but those rows.
                return Ok(Some(own.clone()));
            }
            return Ok(best_name.filter(|j| needed(j)).map(kept));
        };
        if let Some(name) = best_name
            && name.candidate.id() != own.id()
            && name.net > same.net + BETTER
            && needed(name)
            && !explains_spikes
        {
            return Ok(Some(kept(name)));
        }
        if needed(same) || explains_spikes {
            let mut term = kept(same);
            // Judged with the rows out that only it explains, it may have lost its shape.
            if term.point != own.point
                && self.value_of((others, k), own)? > self.value_of((others, k), &term)?
            {
                term.point = own.point.clone();
            }
            if explains_spikes {
                term.rivals = own.rivals.clone();
            }
            return Ok(Some(term));
        }
        Ok(None)
    }

    /// Log-likelihood with one term more, at its place among the others: that model is known, or needed next.
    fn value_of(&self, (others, k): (&[Term], usize), term: &Term) -> Result<f64, Unusable> {
        let mut terms = others.to_vec();
        terms.insert(k, term.clone());
        Ok(self.model(&terms)?.value)
    }
}

#[cfg(test)]
#[path = "sweep_tests.rs"]
mod tests;
