//! Another beginning where the first one ends with something left.
//!
//! Steps are taken one by one. Beside causes that are not in yet, a narrow resonance may look like the step that is there
//! (both are sudden at one temperature, and slow noise hides the rest), and a curve without a name follows a little of
//! all causes; what comes after mends the wrong model. Without such a shape the steps may lead to names that
//! explain more: then it was not called for. And of two causes the one that comes first is fitted to both, so that the
//! other finds its place taken: what comes second may have to come first.

use super::forward::STRANGER;
use super::judge::{Judged, PRICE, Round, price};
use super::reported::{BEYOND, WANDER};
use super::together::{HOPE, WORTH};
use super::{Found, LEVEL, Model, Search, Term, Visited};
use crate::statistics::Unusable;
use crate::statistics::stats;
use crate::thermal::channels::range;

/// Most other beginnings without a shape, and most with another name first.
const BEGINNINGS: usize = 3;
const OPENINGS: usize = 2;

/// Neighbouring rows that both stand out: so many pairs may be accidents, and so many times what is expected of
/// rows that stand out independently of each other.
const PAIRS: f64 = 4.0;

/// The share of the fitted rows that are nearer to the model than what is usual, and how much farther is far: a normal
/// deviate exceeds the first once in ten rows (1.64 deviations), and four times that never.
const USUAL: f64 = 0.9;
const FAR: f64 = 4.0;

/// Share of what a model with shapes without a name gains that names may be short of: a channel's own noise, or a law that
/// is not quite the catalogue's, shows in a large effect.
const ALL_BUT: f64 = 0.02;

/// Share of the error's range that is nothing.
const NOTHING: f64 = 1e-4;

/// Log-likelihood that the shapes of two names gain at most by being found again side by side.
const UNPOLISHED: f64 = 60.0;

/// Log-likelihood that a step gains at most above what it does before other steps are in.
const UNSEEN: f64 = 15.0;

/// Log-likelihood by which the same terms have to be better to be in another place.
const BETTER: f64 = 1.0;

/// Slow noise, in units of the white, from which on two names are tried in place of one.
const SOME: f64 = 0.3;

/// Slow noise, in units of the white, from which on it is said that something is left: a walk of the rate, or a cause that
/// wanders as one.
const MUCH: f64 = 3.0;

/// The same of all that is left, in units of what it differs by from row to row: what nobody knows may look like slow
/// noise. Of white noise it is 1, with 1/f noise of a third of its strength per decade 1.2 to 1.3.
const ROUGH: f64 = 1.5;

/// Deviations by which the ratio of few rows has to be beyond what white noise makes it.
const BY_CHANCE: f64 = 3.5;

/// What another run has to be worth, log-likelihood less the price of the terms: to explain as much as the first, and all
/// but a little of it.
#[derive(Clone)]
pub(super) struct Due {
    whole: f64,
    all_but: f64,
    /// The names of the first run, where they explain everything to it.
    names: Vec<String>,
    /// Names that the first run took and that did not hold: what they would say beside others leaves something where
    /// it did so there.
    refuted: Vec<String>,
    /// What the first run came by.
    visited: Vec<Visited>,
}

impl Due {
    /// The same and so much net log-likelihood more.
    fn more_by(&self, net: f64) -> Due {
        Due {
            whole: self.whole + net,
            all_but: self.all_but + net,
            ..self.clone()
        }
    }
}

/// How a search begins.
#[derive(Clone, Default)]
pub(super) struct Beginning {
    /// Never candidates: what was taken and did not hold, or what this run does without.
    pub barred: Vec<String>,
    /// The first step, if it is beyond chance.
    pub opening: Option<String>,
    /// Terms that are in from the beginning.
    pub given: Vec<Term>,
}

impl Search<'_> {
    /// Runs the search.
    ///
    /// # Errors
    /// Too few rows to fit anything.
    pub fn run(&self) -> Result<Found, Unusable> {
        let mut found = self.run_any()?;
        let model = self.model(&found.terms)?;
        // Alone, noise that a filter made is noise; beside names it may be a part of what these are of.
        let filtered = || found.terms.is_empty() && self.forgets(&model);
        let used = self.used.iter().filter(|u| **u).count();
        let rough = || self.roughly(&model) > ROUGH.max(rough_by_chance(used)) && !filtered();
        let wanders = || self.wander(&model) > MUCH || rough();
        let riddled = || self.riddled(&model).is_some();
        if found.left.is_none() {
            let in_time = self.missed(&model) || wanders() || riddled();
            let along = || self.structured(&model);
            found.left = in_time.then(|| "time_s".to_owned()).or_else(along);
            self.kept_stable(&mut found)?;
        }
        // What a law's bend leaves shows in time as well.
        found.left = match (found.left, found.bent.take()) {
            (Some(left), bent) if left != "time_s" || bent.is_none() => Some(left),
            (_, bent) => bent,
        };
        self.with_ties(&mut found)?;
        self.with_thermometers(&mut found);
        let named: Vec<String> = found.terms.iter().map(Term::id).collect();
        let excluded = self.candidates.iter();
        let excluded: Vec<String> = excluded
            .filter(|k| self.is_excluded_at_rest(k.as_ref()))
            .map(|k| k.id())
            .collect();
        for term in &mut found.terms {
            // What is in beside a step is no other name for it, nor is what the record excludes.
            let is_other = |id: &String| !named.contains(id) && !excluded.contains(id);
            term.rivals.retain(is_other);
        }
        found.once = self.once(&found)?;
        if !found.once.is_empty() {
            found.left = found.left.or_else(|| Some("time_s".to_owned()));
        }
        found.scale_ppm = self.bare_scale(&found)?;
        if found.scale_ppm.is_some() {
            found.left = found.left.or_else(|| Some("rate_dps".to_owned()));
        }
        // A clip that did not hold is of the output, in which no cause is to be looked for.
        if found.left.as_deref() == Some("rate_out_dps") {
            found.left = Some("time_s".to_owned());
        }
        Ok(found)
    }

    /// The first run, or another one that explains more.
    fn run_any(&self) -> Result<Found, Unusable> {
        let (mut first, reached) = self.run_once(None)?;
        let model = self.model(&first.terms)?;
        let clustered = self.clustered(&model);
        // Names that leave a wander may be the wrong ones, or not all.
        let wanders = self.wander(&model) > WANDER;
        let clean = first.left.is_none() && !clustered && !wanders;
        if !first.undecided.is_empty() {
            return Ok(first);
        }
        let due = self.due(&first, &model, &reached)?;
        let barred = self.begin(Beginning::default());
        if let Some(found) = self.as_two(&first, &model, &due)? {
            return Ok(found);
        }
        if clean {
            self.begin(barred);
            return Ok(first);
        }
        let mut others = Vec::new();
        if wanders {
            let given = self.together(&model)?;
            others.extend(given.map(|given| Beginning {
                given,
                ..Beginning::default()
            }));
        }
        let doubted = first.left.is_some() || clustered;
        if doubted || !first.terms.is_empty() {
            others.extend(beginnings(&reached.terms, &first, &due));
        }
        for beginning in others {
            self.begin(beginning);
            let other = match doubted {
                true => self.run_again(&first, &due)?,
                false => self.run_instead(&first, &model, &due)?,
            };
            if let Some(found) = other {
                return Ok(found);
            }
        }
        self.begin(barred);
        if clustered {
            first.left = first.left.or_else(|| Some("time_s".to_owned()));
        }
        Ok(first)
    }

    /// A run that begins with two slow names in place of all that the first one took, if these leave slow noise and the two are
    /// clearly worth more: one name may look like the sum of two others.
    fn as_two(&self, first: &Found, model: &Model, due: &Due) -> Result<Option<Found>, Unusable> {
        if first.terms.is_empty() || self.wander(model) <= SOME {
            return Ok(None);
        }
        let due = due.more_by(WORTH);
        let none = self.model(&[])?;
        let least = due.all_but - self.net(&none) - UNPOLISHED;
        let names: Vec<String> = first.terms.iter().map(Term::id).collect();
        let other = |set: &[String], worth: f64| {
            worth >= least && set.iter().any(|name| !names.contains(name))
        };
        let Some(two) = self.worthier(&none, &other)? else {
            return Ok(None);
        };
        if self.is_beyond(&two, &due) {
            return Ok(None);
        }
        let Some(given) = self.beyond_chance(&none, two)? else {
            return Ok(None);
        };
        if self.has_mend(&given)? {
            return Ok(None);
        }
        self.begin(Beginning {
            given,
            ..Beginning::default()
        });
        self.run_instead(first, model, &due)
    }

    /// As [`Search::run_again`], in place of names whose model is given: no farther from the rows that no estimate used.
    fn run_instead(
        &self,
        first: &Found,
        model: &Model,
        due: &Due,
    ) -> Result<Option<Found>, Unusable> {
        let Some(found) = self.run_again(first, due)? else {
            return Ok(None);
        };
        let [own, other] = self.heldout_squares([model, &self.model(&found.terms)?]);
        if other > own {
            self.begin(Beginning::default());
            return Ok(None);
        }
        Ok(Some(found))
    }

    /// What another run has to be worth, given the first one, the model of its names and what it came to with all its
    /// shapes.
    fn due(&self, first: &Found, model: &Model, reached: &Model) -> Result<Due, Unusable> {
        let strange = reached.terms.iter().any(|t| !t.candidate.named());
        let stands = |id: &String| first.terms.iter().any(|t| t.id() == *id);
        let taken = reached.terms.iter().filter(|t| t.candidate.named());
        let refuted = taken.map(Term::id).filter(|id| !stands(id)).collect();
        let explained = first.left.is_none() && first.strangers.is_empty();
        let names = first.terms.iter().filter(|_| explained);
        let names = names.map(Term::id).collect();
        let (whole, all_but) = if strange {
            let worth = self.net(reached);
            // Such a shape has to be better than names by as much here as where it is taken.
            let whole = worth - STRANGER;
            let gained = worth - self.net(&self.model(&[])?);
            (whole, whole.min(worth - ALL_BUT * gained))
        } else {
            // Names that did not hold are no measure for others.
            let measure = if first.strangers.is_empty() {
                model
            } else {
                reached
            };
            let whole = self.net(measure);
            (whole, whole)
        };
        Ok(Due {
            whole,
            all_but,
            names,
            refuted,
            visited: first.visited.clone(),
        })
    }

    /// A run from the beginning that is set, if it is worth what is due. A name that does all but a little of what a shape
    /// without one does is the cause; then the little is left.
    fn run_again(&self, first: &Found, due: &Due) -> Result<Option<Found>, Unusable> {
        let (other, _) = self.run_once(Some(due))?;
        let own = self.begin(Beginning::default());
        let Some(mut found) = self.better(other, due)? else {
            return Ok(None);
        };
        if self.net(&self.model(&found.terms)?) <= due.whole {
            found.left = found.left.or_else(|| first.left.clone());
            self.kept_alone(&mut found)?;
            if found.terms.is_empty() {
                return Ok(None);
            }
        }
        self.begin(own);
        Ok(Some(Found {
            first: first.first.clone(),
            missing: first.missing.clone(),
            ..found
        }))
    }

    /// Whether a run with these names came back to those of the first run, beside which what it began with was judged there.
    pub(super) fn is_back(&self, names: &[String], due: &Due) -> bool {
        let opened = self.beginning.borrow().opening.is_some();
        opened && !due.names.is_empty() && due.names.iter().all(|name| names.contains(name))
    }

    /// Whether what is due is out of reach of a model and the best that there is beside it.
    fn is_beyond(&self, model: &Model, due: &Due) -> bool {
        let round = self.round(model, 0);
        let best = round.judged.first().map_or(0.0, |j| j.net.max(0.0));
        self.net(model) + best + HOPE < due.all_but
    }

    /// A model's place in a search.
    pub(super) fn visited(&self, model: &Model) -> Visited {
        let mut ids: Vec<String> = model.terms.iter().map(Term::id).collect();
        ids.sort();
        Visited {
            ids,
            net: self.net(model),
        }
    }

    /// Whether a run that was opened is where the first run was, and no better: what follows did, and was not enough.
    pub(super) fn was_there(&self, here: &Visited, due: &Due) -> bool {
        let opened = self.beginning.borrow().opening.is_some();
        let same = |there: &Visited| there.ids == here.ids && here.net < there.net + BETTER;
        opened && !here.ids.is_empty() && due.visited.iter().any(same)
    }

    /// Whether a run will not come to what is due with steps that gain no more than the best name beside a model; in place of names
    /// that explain everything, with one name more than these at most.
    pub(super) fn falls_short(&self, model: &Model, round: &Round, due: &Due) -> bool {
        let most = match due.names.len() {
            0 => self.effort.steps,
            names => self.effort.steps.min(names + 1),
        };
        let steps = most.saturating_sub(model.terms.len());
        let name = round.judged.iter().find(|j| j.is_named());
        let best = name.map_or(0.0, |j| j.net.max(0.0));
        self.net(model) + steps as f64 * (best + UNSEEN) < due.all_but
    }

    /// Whether the rows that stand out of a model stand together: accidents do not.
    fn clustered(&self, model: &Model) -> bool {
        let rows = model.fit.row_weights.iter().zip(&self.used);
        let out: Vec<bool> = rows.filter(|(_, u)| **u).map(|(w, _)| *w < 0.5).collect();
        stand_together(&out)
    }

    /// Whether held-out rows that stand together are far from a model that fits the others: a threshold that no fitted row
    /// shows, a clip that lies in the wrong stretch.
    fn missed(&self, model: &Model) -> bool {
        let rest = model.residual(self.channels);
        let of = |rows: &[bool]| -> Vec<f64> {
            let pairs = rest
                .iter()
                .zip(rows)
                .filter(|(r, row)| **row && r.is_finite());
            pairs.map(|(r, _)| r.abs()).collect()
        };
        let mut fitted = of(&self.used);
        fitted.sort_by(f64::total_cmp);
        let usual = fitted.get((USUAL * fitted.len() as f64) as usize);
        // A record without noise has none that is usual.
        let far_dps = (FAR * usual.copied().unwrap_or(f64::INFINITY)).max(self.nothing_dps());
        let out: Vec<bool> = of(&self.heldout).iter().map(|r| *r > far_dps).collect();
        stand_together(&out)
    }

    /// What a model leaves of the fitted rows, in units of what it differs by from row to row, accidents apart: noise with a
    /// memory as well, of which nobody knows whether it is noise.
    pub(super) fn roughly(&self, model: &Model) -> f64 {
        let rest = model.residual(self.channels);
        let rows = rest.iter().zip(&model.fit.row_weights).zip(&self.used);
        let usual = rows.filter(|((r, w), used)| **used && **w >= 0.5 && r.is_finite());
        let usual: Vec<f64> = usual.map(|((r, _), _)| *r).collect();
        stats::rms(&usual) / stats::difference_noise(&usual).max(self.nothing_dps())
    }

    /// An error that is nothing beside what there is of it.
    pub(super) fn nothing_dps(&self) -> f64 {
        let (low, high) = range(&self.channels.error_dps);
        NOTHING * (high - low)
    }

    /// Never again a candidate: it was taken and did not hold.
    pub(super) fn bar(&self, id: String) {
        self.beginning.borrow_mut().barred.push(id);
    }

    /// How the next run begins; how the last one did. The report's rounds do without what the accepted run did
    /// without: else a name that was taken without it competes with it again.
    fn begin(&self, how: Beginning) -> Beginning {
        self.beginning.replace(how)
    }

    /// A run's names, if they explained everything to it and are worth all but a little of what is due. What that run did
    /// without may have something to say beside them: then that is left.
    fn better(&self, mut found: Found, due: &Due) -> Result<Option<Found>, Unusable> {
        if found.left.is_some() || found.terms.is_empty() || !found.undecided.is_empty() {
            return Ok(None);
        }
        let model = self.model(&found.terms)?;
        let worth = self.net(&model) > due.all_but;
        if !worth || self.clustered(&model) || self.has_mend(&found.terms)? {
            return Ok(None);
        }
        let round = self.round(&model, self.effort.surrogates);
        let says = |j: &&Judged| match due.refuted.contains(&j.candidate.id()) {
            true => j.p_value <= BEYOND,
            false => j.p_value <= LEVEL,
        };
        if let Some(more) = round.judged.iter().find(says) {
            found.left = self.channel(&Term::of(more, Vec::new()));
            self.kept_alone(&mut found)?;
        }
        Ok((!found.terms.is_empty()).then_some(found))
    }

    /// Log-likelihood less the price of the terms.
    pub(super) fn net(&self, model: &Model) -> f64 {
        let c = self.channels;
        let terms = model.terms.iter();
        let paid = terms.map(|t| price(t.candidate.as_ref(), c, &t.point));
        model.value - paid.sum::<f64>() - PRICE * model.beta.len() as f64
    }
}

/// What so many rows of white noise are in units of what they differ by, at most: half of the mean square difference over
/// the variance is 1 with a standard deviation of 1 / sqrt(rows) (von Neumann 1941).
fn rough_by_chance(rows: usize) -> f64 {
    let least = 1.0 - BY_CHANCE / (rows as f64).sqrt();
    if least > 0.0 {
        (1.0 / least).sqrt()
    } else {
        f64::INFINITY
    }
}

/// Whether marked rows have more marked neighbours than chance gives them.
pub(super) fn stand_together(out: &[bool]) -> bool {
    let count = out.iter().filter(|o| **o).count() as f64;
    let pairs = out.windows(2).filter(|w| w[0] && w[1]).count() as f64;
    pairs > PAIRS * (1.0 + count * count / out.len().max(1) as f64)
}

/// What to do without, one at a time: the shapes of a model without a name, and those at one temperature (where a shape without a
/// name came first, that one alone: without another it comes first again); then which of the first round's names to begin with
/// instead of its best. Beside one that is in, where nothing is left, all others have been
/// tried in the best one's place ([`super::sweep`]).
fn beginnings(terms: &[Term], first: &Found, due: &Due) -> Vec<Beginning> {
    let doubted = |t: &&Term| !t.candidate.named() || t.candidate.is_local();
    let is_first = |t: &&Term| !t.candidate.named() && t.beside.is_empty();
    let strange = terms.iter().any(|t| is_first(&t));
    let without = terms.iter().filter(doubted);
    let without = without.filter(|t| !strange || is_first(t)).take(BEGINNINGS);
    let mut out: Vec<Beginning> = without
        .map(|t| Beginning {
            barred: vec![t.id()],
            ..Beginning::default()
        })
        .collect();
    let names = first.first.iter().filter(|j| Judged::is_found(j));
    let openings = names.map(|j| j.candidate.id()).skip(1).take(OPENINGS);
    let openings = openings.filter(|id| !due.names.contains(id));
    out.extend(openings.map(|id| Beginning {
        opening: Some(id),
        ..Beginning::default()
    }));
    out
}

#[cfg(test)]
#[path = "otherwise_tests.rs"]
mod tests;
