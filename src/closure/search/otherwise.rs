//! Another beginning where the first one ends with something left.
//!
//! Steps are taken one by one. Beside causes that are not in yet, a narrow resonance may look like the step that is there
//! (both are sudden at one temperature, and slow noise hides the rest), and a curve without a name follows a little of
//! all causes; what comes after mends the wrong model. Without such a shape the steps may lead to names that
//! explain more: then it was not called for. And of two causes the one that comes first is fitted to both, so that the
//! other finds its place taken: what comes second may have to come first.

use super::forward::STRANGER;
use super::judge::{Judged, PRICE, price};
use super::reported::{BEYOND, WANDER};
use super::together::WORTH;
use super::{Found, LEVEL, Model, Search, Term};
use crate::closure::channels::range;
use crate::closure::likelihood::Unusable;
use crate::record::stats;

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
struct Due {
    whole: f64,
    all_but: f64,
    /// Names that the first run took and that did not hold: what they would say beside others leaves something where
    /// it did so there.
    refuted: Vec<String>,
}

impl Due {
    /// The same and so much net log-likelihood more.
    fn more_by(&self, net: f64) -> Due {
        Due {
            whole: self.whole + net,
            all_but: self.all_but + net,
            refuted: self.refuted.clone(),
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
        if found.left.is_none() && (self.missed(&model) || wanders() || riddled()) {
            found.left = Some("time_s".to_owned());
            self.kept_stable(&mut found)?;
        }
        self.with_ties(&mut found)?;
        self.with_thermometers(&mut found);
        let named: Vec<String> = found.terms.iter().map(Term::id).collect();
        for term in &mut found.terms {
            // What is in beside a step is no other name for it.
            term.rivals.retain(|id| !named.contains(id));
        }
        found.once = self.once(&found)?;
        if !found.once.is_empty() {
            found.left = found.left.or_else(|| Some("time_s".to_owned()));
        }
        // A clip that did not hold is of the output, in which no cause is to be looked for.
        if found.left.as_deref() == Some("rate_out_dps") {
            found.left = Some("time_s".to_owned());
        }
        Ok(found)
    }

    /// The first run, or another one that explains more.
    fn run_any(&self) -> Result<Found, Unusable> {
        let (mut first, reached) = self.run_once(false)?;
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
            others.extend(beginnings(&reached.terms, &first));
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
        let Some(given) = self.together(&self.model(&[])?)? else {
            return Ok(None);
        };
        let known = |t: &Term| first.terms.iter().any(|f| f.id() == t.id());
        if given.iter().all(known) {
            return Ok(None);
        }
        self.begin(Beginning {
            given,
            ..Beginning::default()
        });
        self.run_instead(first, model, &due.more_by(WORTH))
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
        if !strange {
            // Names that did not hold are no measure for others.
            let measure = if first.strangers.is_empty() {
                model
            } else {
                reached
            };
            let whole = self.net(measure);
            return Ok(Due {
                whole,
                all_but: whole,
                refuted,
            });
        }
        let worth = self.net(reached);
        // Such a shape has to be better than names by as much here as where it is taken.
        let whole = worth - STRANGER;
        let gained = worth - self.net(&self.model(&[])?);
        Ok(Due {
            whole,
            all_but: whole.min(worth - ALL_BUT * gained),
            refuted,
        })
    }

    /// A run from the beginning that is set, if it is worth what is due. A name that does all but a little of what a shape
    /// without one does is the cause; then the little is left.
    fn run_again(&self, first: &Found, due: &Due) -> Result<Option<Found>, Unusable> {
        let (other, _) = self.run_once(true)?;
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
        if self.net(&model) <= due.all_but || self.clustered(&model) {
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

/// What to do without, one at a time: the shapes of a model without a name, and those at one temperature; then which of
/// the first round's names to begin with instead of its best.
fn beginnings(terms: &[Term], first: &Found) -> Vec<Beginning> {
    let doubted = |t: &&Term| !t.candidate.named() || t.candidate.is_local();
    let without = terms.iter().filter(doubted).take(BEGINNINGS);
    let mut out: Vec<Beginning> = without
        .map(|t| Beginning {
            barred: vec![t.id()],
            ..Beginning::default()
        })
        .collect();
    let names = first.first.iter().filter(|j| Judged::is_found(j));
    let openings = names.map(|j| j.candidate.id()).skip(1).take(OPENINGS);
    out.extend(openings.map(|id| Beginning {
        opening: Some(id),
        ..Beginning::default()
    }));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closure::channels::Channels;
    use crate::closure::search::{Effort, Search};
    use crate::closure::synthetic::{Random, triangle};
    use std::collections::BTreeMap;

    /// Names, and the channel of what is left, of a large effect of the acceleration's square, read with noise.
    fn of_noisy_squares(seed: u64, reading_g: f64) -> (Vec<String>, Option<String>) {
        let (rows, mut random) = (1100, Random::new(seed));
        let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
        // Tumbled, a dozen rows in each position.
        let places = [1.0, 0.0, -1.0, 0.71, -0.71, 0.5];
        let accel = |k: usize| places[k / 12 * 5 % 6];
        let output = (0..rows).map(|k| {
            let bias = 0.3 - 0.002 * degc[k];
            bias - 0.067 * accel(k) * accel(k) + 0.002 * random.normal()
        });
        let output = output.collect();
        let read = (0..rows).map(|k| accel(k) + reading_g * random.normal());
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output),
            ("accel_g".to_owned(), read.collect()),
            ("die_degc".to_owned(), degc),
        ]);
        let time_s: Vec<f64> = (0..rows).map(|k| 8.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        (found.terms.iter().map(Term::id).collect(), found.left)
    }

    #[test]
    fn a_large_effect_of_a_noisy_channel_has_its_name_and_leaves_a_little() {
        let name = || vec!["g_squared_sensitivity".to_owned()];
        for (seed, reading_g) in [(1, 0.03), (2, 0.04), (3, 0.04)] {
            let (names, left) = of_noisy_squares(seed, reading_g);
            assert_eq!(
                (names, left),
                (name(), Some("accel_g".to_owned())),
                "{seed}"
            );
        }
        assert_eq!(of_noisy_squares(4, 0.0), (name(), None));
    }

    #[test]
    fn one_name_that_looks_like_the_sum_of_two_gives_its_place_to_them() {
        let rows = 1600;
        for seed in 0..3 {
            let mut random = Random::new(seed);
            let time_s: Vec<f64> = (0..rows).map(|k| 20.0 * k as f64).collect();
            let turn = std::f64::consts::TAU / 9000.0;
            let degc = |t: f64| 30.0 - 44.0 * (turn * t).cos();
            let output = time_s.iter().map(|t| {
                let rate = 44.0 * turn * (turn * t).sin();
                let ageing = 0.1 * (1.0 + t / 3700.0).ln();
                0.3 - 0.004 * degc(*t) - 0.9 * rate + ageing + 0.0067 * random.normal()
            });
            let columns = BTreeMap::from([
                ("rate_out_dps".to_owned(), output.collect::<Vec<f64>>()),
                (
                    "die_degc".to_owned(),
                    time_s.iter().map(|t| degc(*t)).collect(),
                ),
            ]);
            let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
            let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
            let found = search.run().unwrap();
            let mut names: Vec<String> = found.terms.iter().map(Term::id).collect();
            names.sort();
            assert_eq!(names, ["ageing_drift", "temperature_rate"], "{seed}");
        }
    }

    #[test]
    fn white_noise_is_hardly_ever_as_rough_as_what_is_left() {
        let mut random = Random::new(6);
        for rows in [16, 25, 40, 200] {
            let rough = |random: &mut Random| {
                let noise: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
                stats::rms(&noise) / stats::difference_noise(&noise)
                    > ROUGH.max(rough_by_chance(rows))
            };
            let count = (0..4000).filter(|_| rough(&mut random)).count();
            assert!(count < 20, "{rows}: {count}");
        }
        assert!(rough_by_chance(60) < ROUGH && rough_by_chance(20) > ROUGH);
    }

    #[test]
    fn accidents_stand_alone() {
        let marked = |rows: &[usize]| {
            let mut out = vec![false; 300];
            for row in rows {
                out[*row] = true;
            }
            stand_together(&out)
        };
        assert!(!marked(&[]));
        let alone: Vec<usize> = (0..60).map(|k| 5 * k).collect();
        assert!(!marked(&alone));
        assert!(!marked(&[10, 11, 90, 91, 200, 201]));
        assert!(marked(&[40, 41, 42, 43, 44, 45]));
        // Half of all rows, at random, have neighbours.
        let mut random = crate::closure::synthetic::Random::new(5);
        let half: Vec<usize> = (0..300).filter(|_| random.normal() > 0.0).collect();
        assert!(!marked(&half));
    }
}
