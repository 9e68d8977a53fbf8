//! The choice of effects where the quantiser's steps show: every set is judged with the steps where its own
//! signal puts them.
//!
//! Sums of products with the steps at one common signal (as in [`super::search`]) favour whatever explains that
//! these are a little misplaced. Here the sums only propose; a proposal is fitted until its steps are its own,
//! and its likelihood counts.
//!
//! A coherent tone has few phases, each with its own error of the quantiser in every period: what is left of it by
//! steps that are a little off does not average out with the rows. Each phase therefore has a random value of its
//! own, the variance of which is fitted to every set (a random effect, as in an analysis of variance): what goes with
//! the phase is judged by the number of phases, not of rows.

use super::candidates::Variant;
use super::columns::{Model, Rows, chunks};
use super::exact_steps;
use super::gram::{Combo, Detail, Gram, Summed, solve, spread};
use super::input::{Capture, Part};
use super::search::{Search, combos_of};
use std::collections::BTreeMap;

/// Training rows that are looked at, at most (about).
const ROWS: usize = 24_000;
/// Fits of a set until its steps are its own.
const FITS: usize = 3;
/// Proposals a step that are fitted.
const PROPOSALS: usize = 6;
/// Variants of an effect among them.
const VARIANTS: usize = 3;
/// A proposal may be this much worse than what it is to replace, by the sums.
const SLACK: f64 = 10.0;
/// Less than this is no improvement.
const LEAST: f64 = 0.05;
/// Steps at most.
const STEPS: usize = 12;
/// Rows of a phase from which on the phases are few.
const ROWS_OF_A_PHASE: usize = 4;

/// A set fitted with its own steps.
#[derive(Debug, Clone)]
pub struct Own {
    /// Its coefficients, by channel and column.
    pub coefficients: [Vec<f64>; 2],
    /// Log-likelihood less costs.
    pub objective: f64,
}

/// The search.
pub struct OwnSteps<'a> {
    capture: &'a Capture,
    model: &'a Model,
    base: &'a [Combo],
    nuisance: &'a [(Combo, f64)],
    variants: &'a [Variant],
    stride: usize,
    phases: Option<Phases>,
    done: BTreeMap<Vec<usize>, Own>,
}

impl<'a> OwnSteps<'a> {
    /// Around a model with its lines and its noise.
    pub fn new(
        capture: &'a Capture,
        model: &'a Model,
        base: &'a [Combo],
        nuisance: &'a [(Combo, f64)],
        variants: &'a [Variant],
    ) -> Self {
        let rows = capture.training_rows();
        let stride = rows.div_ceil(ROWS).max(1);
        OwnSteps {
            capture,
            model,
            base,
            nuisance,
            variants,
            stride,
            phases: Phases::of(model, rows / stride),
            done: BTreeMap::new(),
        }
    }

    /// Whether small effects need more rows than were looked at, and the rows are not a few phases again and again.
    pub fn wants_all_rows(&self) -> bool {
        self.stride > 1 && self.phases.is_none()
    }

    /// The lines that more rows than were looked at tell better, however few the tone's phases are: those that pass
    /// all of them.
    pub fn free_lines(&self) -> Vec<usize> {
        if self.stride == 1 {
            return Vec::new();
        }
        let lines = self.model.lines.iter().enumerate();
        let is_free = |turns: f64| match &self.phases {
            Some(phases) => {
                let places = turns * f64::powi(2.0, 32 - phases.shift as i32);
                let apart = (places - places.round()).abs();
                apart * self.capture.rows() as f64 > f64::powi(2.0, 32 - phases.shift as i32)
            }
            None => true,
        };
        lines
            .filter(|(_, turns)| is_free(**turns))
            .map(|(i, _)| i)
            .collect()
    }

    fn combos(&self, set: &[usize]) -> (Vec<&'a Combo>, Vec<f64>) {
        combos_of(self.base, self.nuisance, self.variants, set)
    }

    /// Fits a set from the steps of another one.
    fn fit(&mut self, set: &[usize], from: &[Vec<f64>; 2]) -> Own {
        let mut key = set.to_vec();
        key.sort_unstable();
        // A set that was fitted before gets the steps of the present one too: all are judged from equally good ones.
        let own = self.fit_from(&key, Some(from));
        let other = match self.done.get(&key) {
            Some(done) => done.clone(),
            None => self.fit_from(&key, None),
        };
        let own = match other.objective > own.objective {
            true => other,
            false => own,
        };
        let own = self.exact(set, own);
        self.done.insert(key, own.clone());
        own
    }

    /// A fit with its steps exactly where the codes say, if that makes them likelier.
    fn exact(&self, set: &[usize], own: Own) -> Own {
        // A coherent tone tells its steps by few phases, whose errors have a variance of their own.
        if self.phases.is_some() {
            return own;
        }
        // What the slow noise takes stays: its price is not asked again.
        let (combos, _) = combos_of(self.base, &[], self.variants, set);
        let at = |coefficients: &[Vec<f64>; 2]| Model {
            coefficients: coefficients.clone(),
            neutral: coefficients.clone(),
            ..self.model.clone()
        };
        let model = at(&own.coefficients);
        let Some(moved) = exact_steps::moved(self.capture, &model, &combos, self.stride) else {
            return own;
        };
        let gained = self.likelihood(&at(&moved)) - self.likelihood(&model);
        match gained > 0.0 {
            true => Own {
                objective: own.objective + gained,
                coefficients: moved,
            },
            false => own,
        }
    }

    /// What each member of a set gains in log-likelihood beyond the others, each set with its own steps.
    pub fn gains(&mut self, set: &[usize], own: &Own) -> BTreeMap<usize, f64> {
        let without = |k: usize| set.iter().copied().filter(|s| *s != k).collect::<Vec<_>>();
        let of = |search: &mut Self, k: usize| {
            let cost = search.variants.get(k).map_or(0.0, |v| v.cost);
            let fewer = search.fit(&without(k), &own.coefficients);
            (k, own.objective - fewer.objective + cost)
        };
        set.iter().map(|k| of(self, *k)).collect()
    }

    /// Fits on from a set's own fit: the fewer rows are on the wrong side of a step, the better the next fit.
    fn polish(&mut self, set: &[usize], own: Own) -> Own {
        let mut key = set.to_vec();
        key.sort_unstable();
        let further = self.fit_from(&key, Some(&own.coefficients));
        let own = match further.objective > own.objective {
            true => further,
            false => own,
        };
        self.done.insert(key, own.clone());
        own
    }

    /// Fits with the steps first at a given signal, or at first without steps: those of a signal that is off by half
    /// a code would mislead.
    fn fit_from(&self, set: &[usize], from: Option<&[Vec<f64>; 2]>) -> Own {
        let (combos, ridge) = self.combos(set);
        let summed = Summed::of(&combos, self.stride);
        let mut model = self.model.clone();
        if let Some(from) = from {
            model.coefficients.clone_from(from);
            model.neutral.clone_from(from);
        }
        let mut prior = 0.0;
        for turn in 0..FITS {
            let gram = Gram::over(self.capture, &model, &summed);
            let is_step = |c: &&Combo| matches!(c.name.as_str(), "saw" | "wave");
            let smooth = from.is_none() && turn == 0;
            let used = combos.iter().zip(&ridge);
            let used = used.filter(|(c, _)| !(smooth && is_step(c)));
            let (used, ridge): (Vec<&Combo>, Vec<f64>) = used.map(|(c, r)| (*c, *r)).unzip();
            let solved = solve(gram.all(), &used, &ridge, Detail::All);
            model.coefficients = spread(&used, &solved);
            model.neutral.clone_from(&model.coefficients);
            // What the wander takes has its price, or it would stand for every offset and gain error.
            let terms = ridge.iter().zip(&solved.coefficients);
            prior = terms.map(|(r, c)| 0.5 * r * c * c).sum();
        }
        let chosen = set.iter().filter_map(|k| self.variants.get(*k));
        let costs: f64 = chosen.map(|v| v.cost).sum();
        Own {
            objective: self.likelihood(&model) - prior - costs,
            coefficients: model.coefficients,
        }
    }

    /// Log-likelihood of the residuals, up to a constant.
    fn likelihood(&self, model: &Model) -> f64 {
        let mut rows = Rows::new();
        let mut chi = 0.0;
        let mut sums = self.phases.as_ref().map(Phases::sums);
        for segment in &self.capture.segments {
            if segment.part == Part::HeldOut {
                continue;
            }
            for chunk in chunks(segment.rows.clone()).step_by(self.stride) {
                let (start, n) = (chunk.start, chunk.len());
                rows.fill(self.capture, model, chunk);
                for channel in 0..2 {
                    let coefficients = &model.coefficients[channel];
                    for i in (0..n).filter(|i| rows.weight[channel][*i] > 0.0) {
                        let weight = rows.weight[channel][i];
                        let e = rows.target[channel][i] - rows.value(channel, i, coefficients);
                        chi += weight * e * e;
                        if let (Some(sums), Some(phases)) = (&mut sums, &self.phases)
                            && let Some(sum) = sums[channel].get_mut(phases.at(start + i))
                        {
                            sum[0] += weight;
                            sum[1] += weight * e;
                        }
                    }
                }
            }
        }
        let locked = sums.map_or(0.0, |s| s.iter().map(|s| Phases::gain(s)).sum());
        locked - 0.5 * chi
    }

    /// The best set that the moves find, with its fit.
    pub fn best(&mut self) -> (Vec<usize>, Own) {
        let mut set: Vec<usize> = Vec::new();
        let start = self.model.neutral.clone();
        let mut own = self.fit(&set, &start);
        own = self.polish(&set, own);
        for _ in 0..STEPS {
            match self.better(&set, &own) {
                Some((next, fitted)) => (set, own) = (next, fitted),
                None => break,
            }
        }
        (self.cheaper(set), own)
    }

    /// The best of the sets next to one, if it is better.
    fn better(&mut self, set: &[usize], own: &Own) -> Option<(Vec<usize>, Own)> {
        let mut better: Option<(Vec<usize>, Own)> = None;
        for candidate in self.proposals(set, own) {
            let next = self.fit(&candidate, &own.coefficients);
            let least = better.as_ref().map_or(own.objective, |b| b.1.objective);
            if next.objective > least + LEAST {
                better = Some((candidate, next));
            }
        }
        let (next, fitted) = better?;
        let polished = self.polish(&next, fitted);
        Some((next, polished))
    }

    /// The same columns by the effect that costs least.
    fn cheaper(&self, mut set: Vec<usize>) -> Vec<usize> {
        for at in 0..set.len() {
            let others: Vec<_> = set.iter().filter_map(|k| self.variants.get(*k)).collect();
            let Some(own) = others.get(at) else { continue };
            let is_free =
                |v: &Variant| v.effect == own.effect || others.iter().all(|o| o.effect != v.effect);
            let parts = |v: &Variant| -> Vec<Vec<(usize, usize, f64)>> {
                v.combos.iter().map(|c| c.parts.clone()).collect()
            };
            let same = self.variants.iter().enumerate();
            let same = same.filter(|(_, v)| is_free(v) && parts(v) == parts(own));
            let least = same.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
            if let (Some((k, _)), Some(place)) = (least, set.get_mut(at)) {
                *place = k;
            }
        }
        set
    }

    /// Sets that differ by an effect, added, removed or exchanged, the likeliest by the sums at a set's own steps.
    fn proposals(&self, set: &[usize], own: &Own) -> Vec<Vec<usize>> {
        let mut model = self.model.clone();
        model.coefficients.clone_from(&own.coefficients);
        model.neutral.clone_from(&own.coefficients);
        let gram = Gram::over(self.capture, &model, &Summed::all(&model, self.stride));
        let mut search = Search::new(gram.all(), self.base, self.nuisance, self.variants);
        let here = search.objective(set);
        let mut offers: Vec<(f64, Vec<usize>)> = Vec::new();
        let mut fewer: Vec<Vec<usize>> = Vec::new();
        let mut starts = vec![set.to_vec()];
        for k in 0..set.len() {
            let mut rest = set.to_vec();
            rest.remove(k);
            fewer.push(rest.clone());
            starts.push(rest);
        }
        // One effect for all: a bend for offset, gain and harmonics.
        if set.len() > 2 {
            starts.push(Vec::new());
        }
        for start in starts {
            // The best variants of each effect.
            let mut by_effect: BTreeMap<_, Vec<(f64, Vec<usize>)>> = BTreeMap::new();
            for other in search.others(&start) {
                let Some(variant) = self.variants.get(other) else {
                    continue;
                };
                let mut candidate = start.clone();
                candidate.push(other);
                let value = search.objective(&candidate);
                let best = by_effect.entry(variant.effect).or_default();
                best.push((value, candidate));
                best.sort_by(|a, b| b.0.total_cmp(&a.0));
                best.truncate(VARIANTS);
            }
            offers.extend(by_effect.into_values().flatten());
        }
        let straight = search.straightened(set).into_iter();
        let straight = straight.map(|candidate| (search.objective(&candidate), candidate));
        offers.extend(straight.max_by(|a, b| a.0.total_cmp(&b.0)));
        offers.retain(|(value, _)| *value > here - SLACK);
        offers.sort_by(|a, b| b.0.total_cmp(&a.0));
        offers.truncate(PROPOSALS);
        offers.into_iter().map(|o| o.1).chain(fewer).collect()
    }
}

/// The distinct phases of a coherent tone.
struct Phases {
    word: u32,
    shift: u32,
}

impl Phases {
    /// `None` where a phase has few of the rows, or the tuning word is not known.
    fn of(model: &Model, rows: usize) -> Option<Self> {
        let word = model.tone.word?;
        let shift = word.trailing_zeros().min(31);
        let count = 1usize << (32 - shift);
        (count * ROWS_OF_A_PHASE <= rows).then_some(Phases { word, shift })
    }

    fn at(&self, row: usize) -> usize {
        (self.word.wrapping_mul(row as u32) >> self.shift) as usize
    }

    /// Room for weight and weighted residual of each phase, by channel.
    fn sums(&self) -> [Vec<[f64; 2]>; 2] {
        let one = || vec![[0.0; 2]; 1 << (32 - self.shift)];
        [one(), one()]
    }

    /// What a random value of each phase gains in log-likelihood, its variance at the likeliest.
    fn gain(sums: &[[f64; 2]]) -> f64 {
        let at = |variance: f64| -> f64 {
            let term = |[w, we]: &[f64; 2]| {
                let more = w * variance;
                0.5 * (we * we * variance / (1.0 + more) - more.ln_1p())
            };
            sums.iter().map(term).sum()
        };
        (0..48)
            .map(|k| at(1e-6 * f64::powf(10.0, 0.125 * f64::from(k))))
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
#[path = "own_steps_tests.rs"]
mod tests;
