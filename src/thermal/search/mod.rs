//! The search: which effects a record calls for.
//!
//! Forward steps over the whole catalogue and over shapes without a name ([`super::effects`]), each
//! against the noise that the record itself shows ([`crate::statistics`]): a step must be beyond what
//! chance makes of the best of all candidates ([`judge`]) and may have at most four rivals that do as
//! well; sinusoids have a search of their own ([`tones`], and `fast` within blocks of rows). Rows that stand
//! out are spikes, unless a candidate explains them ([`forward`]). At the end every
//! step is tried again with the others in, against all other names ([`sweep`]), must hold ([`validate`]) and lower the error of
//! held-out rows ([`heldout`]). Where a shape without a name wins, it is kept as what is left; a step that happens once may
//! be one of time, and a scale factor may be off by the same everywhere; that is said beside the name (`once`, `bare_scale`).

mod acting;
mod bare_scale;
mod clip;
pub mod constancy;
mod declared;
pub mod estimate;
mod evident;
mod fast;
pub mod forward;
pub mod halves;
pub mod heldout;
pub mod judge;
mod laws;
mod memo;
mod model;
mod once;
mod otherwise;
mod pairs;
mod polish;
mod proven;
pub mod reading;
pub mod refine;
mod reported;
mod rounding;
mod rounds;
pub mod stairs;
pub mod structure;
pub mod sweep;
mod ties;
mod together;
pub mod tones;
mod top;
pub mod unclipped;
mod undone;
pub mod validate;

use super::channels::Channels;
pub use super::declared_bias::{declared, declared_by, powers, weighted};
use super::effects::{self, Bias, Candidate, Missing, Point};
use super::rails::{self, Rails};
use crate::statistics::Unusable;
use crate::statistics::blocks::{Role, Split};
use crate::statistics::linear::add_scaled;
use crate::statistics::reml::{self, Fit};
use crate::statistics::robust::ACCIDENT;
use crate::statistics::tail::Tail;
use acting::Settling;
use clip::{Kind, clip};
use judge::Judged;
use memo::Memo;
pub use model::Model;
use otherwise::Beginning;
use rounds::Known;
use std::cell::RefCell;
use std::sync::Arc;

/// How hard to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Rows that the noise is estimated on.
    pub rows: usize,
    /// Surrogate records of a test.
    pub surrogates: usize,
    /// Most named steps.
    pub steps: usize,
}

impl Default for Effort {
    fn default() -> Self {
        Effort {
            rows: 700,
            surrogates: 100,
            steps: 5,
        }
    }
}

/// Family-wise probability below which a step is taken.
pub const LEVEL: f64 = 0.01;

/// Most rivals of a step.
pub const MOST_RIVALS: usize = 4;

/// An effect in the model.
#[derive(Clone)]
pub struct Term {
    /// Which.
    pub candidate: Arc<dyn Candidate>,
    /// Its shape.
    pub point: Point,
    /// Probability at its step.
    pub p_value: f64,
    /// The shape that it had there.
    pub found_at: Point,
    /// What does as well, best first.
    pub rivals: Vec<String>,
    /// Gain in log-likelihood with all other terms in.
    pub gain: f64,
    /// What the probability is beside: the ids of the terms that were in.
    pub beside: Vec<String>,
    /// The probability is that of a pair with another such term (`search/pairs.rs`).
    pub paired: bool,
    /// The record shows it without a fit ([`crate::thermal::rails`]): its shape stands, and no comparison decides on it.
    pub evident: bool,
}

impl Term {
    /// A shape of which nothing is known yet.
    pub fn new(candidate: Arc<dyn Candidate>, point: Point) -> Self {
        Term {
            candidate,
            found_at: point.clone(),
            point,
            p_value: 0.0,
            rivals: Vec::new(),
            gain: 0.0,
            beside: Vec::new(),
            paired: false,
            evident: false,
        }
    }

    /// From a round's judgement.
    pub fn of(judged: &Judged, rivals: Vec<String>) -> Self {
        Term {
            p_value: judged.p_value,
            gain: judged.gain,
            rivals,
            ..Term::new(judged.candidate.clone(), judged.point.clone())
        }
    }

    /// Its id.
    pub fn id(&self) -> String {
        self.candidate.id()
    }
}

/// What the search found.
#[derive(Default)]
pub struct Found {
    /// Named effects, in the order of their steps.
    pub terms: Vec<Term>,
    /// Shapes without a name that the record calls for.
    pub strangers: Vec<Term>,
    /// Something is left, with the channel of the best try.
    pub left: Option<String>,
    /// The channel of a law that is not quite the catalogue's.
    pub bent: Option<String>,
    /// The first round's candidates.
    pub first: Vec<Judged>,
    /// Candidates that could not be judged.
    pub missing: Vec<(Arc<dyn Candidate>, Missing)>,
    /// More than four explanations of one thing: no step.
    pub undecided: Vec<String>,
    /// Names whose whole contribution the circuit's own rounding may be, with its rms, deg/s: no steps.
    pub within_rounding: Vec<(String, f64)>,
    /// Names of steps that may as well be changes at one moment.
    pub once: Vec<String>,
    /// An error of the scale factor, parts per million with its standard deviation, that is the same everywhere.
    pub scale_ppm: Option<(f64, f64)>,
    /// What the search came by.
    visited: Vec<Visited>,
}

/// Terms, in order of their ids, that were in before a step, and what they were worth, log-likelihood less the price.
#[derive(Debug, Clone)]
struct Visited {
    ids: Vec<String>,
    net: f64,
}

/// A search over one record.
pub struct Search<'a> {
    /// The record.
    pub channels: &'a Channels,
    /// Rows to fit on: those of the training blocks that do not stand at a rail.
    pub used: Vec<bool>,
    /// Rows of the training blocks.
    pub train: Vec<bool>,
    /// Rows that no fit is of, to choose between models by.
    pub heldout: Vec<bool>,
    /// How hard.
    pub effort: Effort,
    /// Levels at which the output stands.
    pub rails: Option<Rails>,
    /// Regressors of every fit that are no part of a model: what the thermometer's readings err by.
    blur: Vec<Vec<f64>>,
    candidates: Vec<Arc<dyn Candidate>>,
    models: Memo<Arc<Model>>,
    rounds: Memo<Known>,
    /// The same with every row at full weight.
    plain_rounds: Memo<Known>,
    by_chance: RefCell<Option<Tail>>,
    polishes: Memo<Vec<Point>>,
    beginning: RefCell<Beginning>,
}

impl<'a> Search<'a> {
    /// Over a record, with `extra` candidates beside the catalogue.
    pub fn new(
        channels: &'a Channels,
        split: &Split,
        effort: Effort,
        extra: Vec<Arc<dyn Candidate>>,
    ) -> Self {
        let finite: Vec<bool> = channels.error_dps.iter().map(|e| e.is_finite()).collect();
        let both = |rows: &[bool]| rows.iter().zip(&finite).map(|(a, b)| *a && *b).collect();
        // The user's own come first: among equals they are preferred.
        let mut candidates = extra;
        candidates.extend(effects::catalogue(channels).into_iter().map(Arc::from));
        candidates.extend(effects::outside::all(channels).into_iter().map(Arc::from));
        let train: Vec<bool> = both(&split.rows(Role::Fit));
        // Rows that choose must not say what readings err by, nor which rows stand at a rail.
        let seen = channels.seen(&train);
        let rails = rails::of(&seen, &train);
        let free = |(i, row): (usize, &bool)| *row && !rails.as_ref().is_some_and(|r| r.rows[i]);
        let mut search = Search {
            channels,
            used: train.iter().enumerate().map(free).collect(),
            train,
            heldout: both(&split.rows(Role::Choose)),
            effort,
            rails,
            blur: reading::errors_of(&seen),
            candidates,
            models: Memo::default(),
            rounds: Memo::of(memo::SOME),
            plain_rounds: Memo::of(memo::SOME),
            by_chance: RefCell::default(),
            polishes: Memo::of(memo::MANY),
            beginning: RefCell::default(),
        };
        search.effort.rows = search.fitted_rows();
        search
    }

    /// Most rows of a fit that keep a fast tone in the means of blocks.
    fn fitted_rows(&self) -> usize {
        let used = self.used.iter().filter(|u| **u).count();
        let most = self.effort.rows.max(16);
        let mut rest = self.channels.error_dps.clone();
        let columns = declared(self.channels);
        for (b, column) in self.plain_bias().coefficients_dps.iter().zip(&columns) {
            add_scaled(&mut rest, -b, column);
        }
        let size = used.div_ceil(most);
        match fast::block_rows(self.channels, &rest, &self.used, size) {
            longer if longer > size => used.div_ceil(longer),
            _ => self.effort.rows,
        }
    }

    /// All candidates but tones, named or not.
    pub fn candidates(&self) -> &[Arc<dyn Candidate>] {
        &self.candidates
    }

    /// The model with terms. Effects that act on the declared bias see the bias that is there beside them
    /// (`search/acting.rs`).
    ///
    /// # Errors
    /// Too few rows.
    pub fn model(&self, terms: &[Term]) -> Result<Model, Unusable> {
        if let Some(known) = self.models.get(terms) {
            return Ok(Model {
                terms: terms.to_vec(),
                ..(*known).clone()
            });
        }
        let model = self.model_with(terms, &self.options())?;
        self.models.keep(terms, Arc::new(model.clone()));
        Ok(model)
    }

    /// The model of terms on the rows that a model with more terms keeps, if that puts more rows out than it does itself: under the
    /// slow noise that has a missing term in it, a few odd rows are none.
    ///
    /// # Errors
    /// As [`Search::model`].
    pub(super) fn keeping(&self, terms: &[Term], with: &Model) -> Result<Option<Model>, Unusable> {
        if self.spikes(&with.fit) <= self.spikes(&self.model(terms)?.fit) {
            return Ok(None);
        }
        let out: Vec<bool> = with.fit.row_weights.iter().map(|w| *w < 0.5).collect();
        let options = reml::Options {
            out: &out,
            ..self.options()
        };
        self.model_with(terms, &options).map(Some)
    }

    /// The usual way to fit.
    pub fn options(&self) -> reml::Options<'static> {
        reml::Options {
            rows: self.effort.rows,
            ..reml::Options::default()
        }
    }

    /// As [`Search::model`], in another way.
    ///
    /// # Errors
    /// As there.
    pub fn model_with(
        &self,
        terms: &[Term],
        options: &reml::Options<'_>,
    ) -> Result<Model, Unusable> {
        let mut bias = self.plain_bias();
        let acts = |t: &Term| t.candidate.acts_on_bias();
        if !terms.iter().any(acts) {
            return self.model_once(terms, &bias, options);
        }
        if terms.iter().any(|t| t.candidate.is_last()) {
            // Which rows are clipped depends on everything: the bias of one fit after the other.
            bias = self.unclipped(terms, &bias).unwrap_or(bias);
            let passes = if terms.len() == 1 { 2 } else { 3 };
            let mut passing = *options;
            for _ in 0..passes {
                let pass = self.model_once(terms, &bias, &passing)?;
                passing.near = passing.near.or(Some(pass.fit.at.shape));
                bias = pass.bias;
            }
            return self.model_once(terms, &bias, options);
        }
        let settling = self.settling(terms, &bias, &self.weights());
        bias.coefficients_dps = settling.settled(&bias.coefficients_dps);
        // Again with the rows out that stand out from that.
        let pass = self.model_once(terms, &bias, options)?;
        let settling = self.settling(terms, &bias, &pass.fit.row_weights);
        bias.coefficients_dps = settling.settled(&bias.coefficients_dps);
        let near = reml::Options {
            near: options.near.or(Some(pass.fit.at.shape)),
            ..*options
        };
        self.model_once(terms, &bias, &near)
    }

    /// For the bias's coefficients beside terms some of which act on it.
    fn settling(&self, terms: &[Term], bias: &Bias, weights: &[f64]) -> Settling<'a> {
        let c = self.channels;
        let mut y = c.error_dps.clone();
        let mut free = Vec::new();
        let mut acting: Vec<(&dyn Candidate, &Point)> = Vec::new();
        for term in terms {
            if term.candidate.acts_on_bias() {
                acting.push((term.candidate.as_ref(), &term.point));
                continue;
            }
            for column in term.candidate.columns(c, bias, &term.point) {
                match term.candidate.is_sized(&term.point) {
                    true => add_scaled(&mut y, -1.0, &column),
                    false => free.push(column),
                }
            }
        }
        Settling::new(c, (&y, weights), &acting, &free)
    }

    /// 1 for rows of the fit.
    fn weights(&self) -> Vec<f64> {
        self.used.iter().map(|u| f64::from(u8::from(*u))).collect()
    }

    fn model_once(
        &self,
        terms: &[Term],
        acting: &Bias,
        options: &reml::Options<'_>,
    ) -> Result<Model, Unusable> {
        let c = self.channels;
        // Rows at a rail are left out where the clip is in the model.
        let railed = terms.iter().any(|t| t.evident);
        let used = [&self.train, &self.used][usize::from(railed)];
        let mut columns = declared(c);
        let order = columns.len();
        let mut kinds = vec![Kind::Free; order];
        for term in terms {
            let kind = match (
                term.candidate.is_last(),
                term.candidate.is_sized(&term.point),
            ) {
                (true, _) => Kind::Last,
                (_, true) => Kind::Whole,
                _ => Kind::Free,
            };
            for column in term.candidate.columns(c, acting, &term.point) {
                columns.push(column);
                kinds.push(kind);
            }
        }
        let unclipped = columns.clone();
        // A fitted row is not clipped at a rail, whatever the model says.
        let rails = self.rails.as_ref().filter(|_| railed);
        let spared = |row: usize, by_dps| used[row] && rails.is_some_and(|r| r.is_at(by_dps));
        let clipped = clip(c, acting, (&mut columns, &kinds), spared);
        let mut y = c.error_dps.clone();
        let mut free = Vec::new();
        for (column, kind) in columns.iter().zip(&kinds) {
            match kind {
                Kind::Free => free.push(column.clone()),
                _ => add_scaled(&mut y, -1.0, column),
            }
        }
        let clips = clipped.contains(&1.0);
        let held = match clips {
            true => clipped.iter().map(|c| *c > 0.0).collect(),
            false => Vec::new(),
        };
        for column in &self.blur {
            let off = |(v, held): (&f64, &f64)| v * (1.0 - held);
            free.push(column.iter().zip(&clipped).map(off).collect());
        }
        if clips {
            // The noise needs a constant over all rows, clipped ones too.
            free.push(clipped);
        }
        let fit = reml::fit(&c.time_s, &y, &free, used, options)?;
        let mut given = fit.beta.iter();
        let mut beta: Vec<f64> = kinds
            .iter()
            .map(|kind| match kind {
                Kind::Free => given.next().copied().unwrap_or(0.0),
                _ => 1.0,
            })
            .collect();
        let mut rest = c.error_dps.clone();
        let mut others = vec![0.0; c.len()];
        for k in order..columns.len() {
            add_scaled(&mut rest, -beta[k], &columns[k]);
            if kinds[k] != Kind::Last {
                add_scaled(&mut others, beta[k], &unclipped[k]);
            }
        }
        let declared = weighted(&columns[..order], &rest, &fit.row_weights);
        beta[..order].copy_from_slice(&declared);
        let bias = Bias {
            coefficients_dps: declared,
            others_dps: others,
        };
        let spikes = self.spikes(&fit);
        let accident = -ACCIDENT - fit.noise.white_rms_dps.max(f64::MIN_POSITIVE).ln();
        Ok(Model {
            terms: terms.to_vec(),
            value: fit.loglik_ml + spikes as f64 * accident,
            fit,
            acting: acting.clone(),
            bias,
            beta,
            columns,
            clipped: held,
        })
    }

    /// Ordinary least squares, for a start.
    fn plain_bias(&self) -> Bias {
        let columns = declared(self.channels);
        Bias {
            coefficients_dps: weighted(&columns, &self.channels.error_dps, &self.weights()),
            others_dps: Vec::new(),
        }
    }

    /// Rows that stand out from a fit: those of less than half weight.
    pub fn spikes(&self, fit: &Fit) -> usize {
        let pairs = fit.row_weights.iter().zip(&self.used);
        pairs.filter(|(w, u)| **u && **w < 0.5).count()
    }

    /// The channel that stands for a term.
    pub fn channel(&self, term: &Term) -> Option<String> {
        let channels = term.candidate.channels_at(self.channels, &term.point);
        channels.into_iter().next()
    }
}
