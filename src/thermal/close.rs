//! A thermal record closed: from its rows to `closure.json` (`docs/manual.md`, "Closing the loop").

mod carried;
mod evidence;
mod remarks;

pub use carried::MORE;

use super::baseline::{self, BaselineFit};
use super::channels::Channels;
use super::checks;
use super::effects::{Candidate, user};
use super::intake::{Intake, refused};
use super::rate_steps::RateSteps;
use super::search::{Effort, Found, Model, Search};
use crate::correction::Correction;
use crate::design::Design;
use crate::error::Result;
use crate::record::{ThermalRecord, Warning};
use crate::statistics::blocks::{Role, Split};
use crate::statistics::stats;
use crate::verdict::{Closure, Errors, FirmwareErrors, SCHEMA, Step, Structure, Verdict};
use std::sync::Arc;

/// A closed record, with what a report shows.
pub struct Closed {
    /// `closure.json`.
    pub closure: Closure,
    /// The record as candidates see it, with the output of every row.
    pub channels: Channels,
    /// What each row was for.
    pub split: Split,
    /// Rows that stand out of both models, few and each by itself: no part of any figure.
    pub accidents: Vec<bool>,
    /// The declared model.
    pub before: Model,
    /// With the named terms.
    pub after: Model,
    /// What firmware runs, if it can.
    pub correction: Option<Correction>,
    /// What that leaves of each row, bit for bit, deg/s; NaN without a reading.
    pub firmware_dps: Option<Vec<f64>>,
    /// What a constant, the median of the fitted rows, leaves of the held-out rows that the errors are of, deg/s rms.
    pub constant_rms_dps: f64,
}

/// The effects that the design's user suspects, for a record.
fn own_candidates(
    design: &Design,
    channels: &Channels,
    warnings: &mut Vec<Warning>,
) -> Vec<Arc<dyn Candidate>> {
    let mut out: Vec<Arc<dyn Candidate>> = Vec::new();
    for own in user::all(&design.effects, channels) {
        let remark = own.remarks();
        warnings.extend(remark.map(|(code, said)| Warning::general(code, said)));
        out.push(Arc::new(own));
    }
    out
}

/// A step's name, and what does as well.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    /// Its id.
    pub effect: String,
    /// Ids.
    pub rivals: Vec<String>,
}

/// The names alone that [`close`] gives a record, in the order of the steps.
///
/// # Errors
/// As there.
pub fn names(record: &ThermalRecord, design: &Design, effort: Effort) -> Result<Vec<Named>> {
    let taken = Taken::of(record, design, Vec::new())?;
    let found = taken.search(effort).run();
    let found = found.map_err(|e| refused(record, &design.record, e.to_string()))?;
    let named = |term: super::search::Term| Named {
        effect: term.id(),
        rivals: term.rivals,
    };
    Ok(found.terms.into_iter().map(named).collect())
}

/// A record on its way to a search, the one way of every answer: taken in, its rows split, with the candidates of its design's user.
pub(crate) struct Taken<'a> {
    pub(crate) intake: Intake<'a>,
    own: Vec<Arc<dyn Candidate>>,
}

impl<'a> Taken<'a> {
    /// `warnings` are what was said of the record before.
    ///
    /// # Errors
    /// As [`close`].
    pub(crate) fn of(
        record: &'a ThermalRecord,
        design: &Design,
        warnings: Vec<Warning>,
    ) -> Result<Self> {
        let mut intake = Intake::of(record, design, warnings)?;
        let own = own_candidates(design, &intake.channels, &mut intake.warnings);
        Ok(Taken { intake, own })
    }

    /// The search of its causes.
    pub(crate) fn search(&self, effort: Effort) -> Search<'_> {
        let Intake {
            channels, split, ..
        } = &self.intake;
        Search::new(channels, split, effort, self.own.clone())
    }
}

/// Closes a record.
///
/// # Errors
/// A record that cannot be fitted: too few rows, no thermometer of the name that the design gives.
pub fn close(
    record: &ThermalRecord,
    warnings: Vec<Warning>,
    design: &Design,
    command: &str,
    effort: Effort,
) -> Result<Closed> {
    let taken = Taken::of(record, design, warnings)?;
    let record: &ThermalRecord = &taken.intake.record;
    let refuse = |why: String| refused(record, &design.record, why);
    let mut warnings = taken.intake.warnings.clone();
    let fit = baseline::fit(record, &design.record, &design.fit).ok();
    Warning::add_of_fit(&mut warnings, fit.as_ref().and_then(course));
    let steps = fit.as_ref().and_then(|f| f.rate_steps);
    warnings.extend(steps.map(RateSteps::warning));
    warnings.extend(no_judges(&taken.intake.split));
    let whole = taken.intake.whole();
    let (closure, before, after, accidents, firmware, constant_rms_dps) = {
        let search = taken.search(effort);
        if !search.heldout.contains(&true) {
            let rows = record.len();
            return Err(refuse(format!(
                "no stretch of its {rows} rows can be held out, so that no error could be told"
            )));
        }
        let unusable = |e: crate::statistics::Unusable| refuse(e.to_string());
        let found = search.run().map_err(unusable)?;
        let before = search.model(&[]).map_err(unusable)?;
        let after = search.model(&found.terms).map_err(unusable)?;
        let accidents = accidents(&search, &whole, [&before, &after]);
        let told = Told {
            search: &search,
            whole: &whole,
            found: &found,
            before: &before,
            after: &after,
            rows: Rows::of(&search, &whole, &taken.intake.split, &accidents),
            rounding_dps: steps.map_or(0.0, RateSteps::rounding_rms_dps),
        };
        let mut closure = told.closure().map_err(unusable)?;
        let is_unexplained = closure.verdict == Verdict::Unexplained;
        let sweeps = fit.as_ref().filter(|_| is_unexplained);
        let sweep_loop = sweeps.and_then(checks::unexplained_loop);
        told.warn(sweep_loop, &mut warnings);
        let firmware = told.firmware(record, design, &mut warnings);
        closure.firmware = firmware
            .as_ref()
            .map_or_else(FirmwareErrors::default, |f| f.errors(&told.rows.judging));
        closure.warnings = warnings;
        closure.command = command.to_owned();
        closure.design_sha256 = crate::digest::sha256(design.source.text.as_bytes());
        let constant_rms_dps = told.constant_rms_dps(&told.rows.judging);
        (
            closure,
            before,
            after,
            accidents,
            firmware,
            constant_rms_dps,
        )
    };
    let (mut correction, firmware_dps) = firmware.map(|f| (f.correction, f.residual_dps)).unzip();
    if let Some(correction) = &mut correction {
        // Its bundle says it. A record without any error has none to say.
        let rms = closure.firmware.heldout_rms;
        correction.heldout_rms_dps = rms.filter(|rms| rms.is_finite() && *rms > 0.0);
    }
    Ok(Closed {
        closure,
        channels: whole,
        split: taken.intake.split,
        accidents,
        before,
        after,
        correction,
        firmware_dps,
        constant_rms_dps,
    })
}

/// What `run` says of a record that was heated or cooled alone, where names of effects in time mean less, or not at all.
fn course(fit: &BaselineFit) -> Option<Warning> {
    let mut warnings = fit.warnings.iter();
    let is_meant = |w: &&Warning| ["one_direction", "thermometer_constant"].contains(&w.code);
    warnings.find(is_meant).cloned()
}

/// What is said of a record without rows that do nothing but judge.
fn no_judges(split: &Split) -> Option<Warning> {
    let said = "too few rows to keep some for the error alone: the errors are of the rows that models were chosen by, and may be a \
                little too small; record longer, or average less";
    (!split.roles.contains(&Role::Judge)).then(|| Warning::general("no_rows_to_judge", said))
}

/// Rows that stand out of the models, alone or a few in a row. Rows that the search does not see have no say in whether others do.
fn accidents<const N: usize>(search: &Search, whole: &Channels, models: [&Model; N]) -> Vec<bool> {
    let measured: Vec<bool> = whole.error_dps.iter().map(|e| e.is_finite()).collect();
    let all = search.accidents_among(whole, &measured, models);
    let rows = search.accidents(models).into_iter().zip(all);
    let rows = rows.zip(&search.channels.error_dps);
    rows.map(|((seen, all), error)| seen || error.is_nan() && all)
        .collect()
}

/// The rows that errors are of, without those that stand out.
struct Rows {
    fitted: Vec<bool>,
    choosing: Vec<bool>,
    judging: Vec<bool>,
    accidents: Vec<bool>,
}

impl Rows {
    fn of(search: &Search, whole: &Channels, split: &Split, accidents: &[bool]) -> Self {
        let usual = |rows: &[bool]| -> Vec<bool> {
            let rows = rows.iter().zip(accidents).zip(&whole.error_dps);
            rows.map(|((row, accident), error)| *row && !accident && error.is_finite())
                .collect()
        };
        Rows {
            fitted: usual(&search.train),
            choosing: usual(&search.heldout),
            judging: usual(&split.judging()),
            accidents: accidents.to_vec(),
        }
    }
}

/// A search put into words.
struct Told<'a> {
    search: &'a Search<'a>,
    /// The record with the output of every row.
    whole: &'a Channels,
    found: &'a Found,
    before: &'a Model,
    after: &'a Model,
    rows: Rows,
    /// Of an output in steps that are too coarse for its noise, rms, deg/s; else 0.
    rounding_dps: f64,
}

/// rms of the rows that are meant.
fn rms_of(residual: &[f64], rows: &[bool]) -> f64 {
    let rows = residual.iter().zip(rows).filter(|(_, row)| **row);
    stats::rms(&rows.map(|(r, _)| *r).collect::<Vec<f64>>())
}

impl Told<'_> {
    fn errors(&self, model: &Model) -> Errors {
        let residual = model.residual(self.whole);
        let judging = residual.iter().zip(&self.rows.judging);
        let judging = judging.filter(|(_, row)| **row);
        Errors {
            train_rms: rms_of(&residual, &self.rows.fitted),
            heldout_rms: rms_of(&residual, &self.rows.judging),
            heldout_max_abs: judging.fold(0.0, |m, (r, _)| m.max(r.abs())),
        }
    }

    /// rms over the rows that choose, deg/s.
    fn choosing_rms(&self, model: &Model) -> f64 {
        rms_of(&model.residual(self.whole), &self.rows.choosing)
    }

    fn closure(&self) -> std::result::Result<Closure, crate::statistics::Unusable> {
        let left = self.found.left.is_some();
        let residual = self.after.residual(self.search.channels);
        let rows = residual.iter().zip(&self.rows.accidents);
        let usual = rows.filter(|(r, accident)| r.is_finite() && !**accident);
        let usual: Vec<f64> = usual.map(|(r, _)| *r).collect();
        let steps = self.steps()?;
        Ok(Closure {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            design_sha256: String::new(),
            command: String::new(),
            verdict: Verdict::of(steps.len(), left),
            unit: "deg/s",
            noise_floor_rms: stats::difference_noise(&usual).max(self.rounding_dps),
            before: self.errors(self.before),
            after: self.errors(self.after),
            firmware: FirmwareErrors::default(),
            residual_structure: Structure {
                left,
                strongest_channel: self.found.left.clone(),
            },
            evidence: self.evidence(&steps),
            steps,
            warnings: Vec::new(),
        })
    }

    /// The steps in their order, each with the error of itself and those before it.
    fn steps(&self) -> std::result::Result<Vec<Step>, crate::statistics::Unusable> {
        let terms = &self.found.terms;
        let estimates = self.search.estimates(self.after);
        let mut out = Vec::new();
        for (k, (term, estimate)) in terms.iter().zip(&estimates).enumerate() {
            let model = if k + 1 == terms.len() {
                self.errors(self.after)
            } else {
                self.errors(&self.search.model(&terms[..=k])?)
            };
            let reported = term.candidate.report(self.search.channels, estimate);
            out.push(Step {
                effect: term.id(),
                channels: term
                    .candidate
                    .channels_at(self.search.channels, &term.point),
                parameters: reported.iter().map(|(n, v)| (n.clone(), v.0)).collect(),
                parameter_std: reported.iter().map(|(n, v)| (n.clone(), v.1)).collect(),
                heldout_rms: model.heldout_rms,
                p_value: term.p_value.clamp(1e-300, 1.0),
                selection_frequency: self.search.selected_beside(self.after, k, &[])?,
                indistinguishable_from: term.rivals.clone(),
                separating_experiment: (!term.rivals.is_empty())
                    .then(|| term.candidate.sheet().experiment.to_owned()),
            });
        }
        Ok(out)
    }
}
