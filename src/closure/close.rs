//! A thermal record closed: from its rows to `closure.json` (`docs/manual.md`, "Closing the loop").

use super::channels::Channels;
use super::effects::{Candidate, Missing, user};
use super::firmware;
pub use super::intake::channels_of;
use super::intake::refused;
use super::likelihood::blocks::Split;
use super::search::{Effort, Found, LEVEL, Model, Search};
use super::verdict::{
    Closure, Errors, Evidence, Fate, FirmwareErrors, SCHEMA, Step, Structure, Verdict,
};
use crate::correction::Correction;
use crate::design::Design;
use crate::error::Result;
use crate::record::{ThermalRecord, Warning, condensed, stats};
use std::sync::Arc;

/// A closed record, with what a report shows.
pub struct Closed {
    /// `closure.json`.
    pub closure: Closure,
    /// The record as candidates see it.
    pub channels: Channels,
    /// Which rows were fitted and which judged.
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
}

/// The effects that the design's user suspects, for a record.
pub(crate) fn own_candidates(
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
    let mut warnings = Vec::new();
    let condensed = condensed(record);
    let record = condensed.as_ref().map_or(record, |(short, _)| short);
    let channels = channels_of(record, design, &mut warnings)?;
    let unusable = |e: super::likelihood::Unusable| refused(record, e.to_string());
    let split = channels.split().map_err(unusable)?;
    let own = own_candidates(design, &channels, &mut warnings);
    let found = Search::new(&channels, &split, effort, own)
        .run()
        .map_err(unusable)?;
    let named = |term: super::search::Term| Named {
        effect: term.id(),
        rivals: term.rivals,
    };
    Ok(found.terms.into_iter().map(named).collect())
}

/// Closes a record.
///
/// # Errors
/// A record that cannot be fitted: too few rows, no thermometer of the name that the design gives.
pub fn close(
    record: &ThermalRecord,
    mut warnings: Vec<Warning>,
    design: &Design,
    command: &str,
    effort: Effort,
) -> Result<Closed> {
    let start = std::time::Instant::now();
    let condensed = condensed(record);
    let record = condensed.as_ref().map_or(record, |(short, warning)| {
        warnings.push(warning.clone());
        short
    });
    let channels = channels_of(record, design, &mut warnings)?;
    let refuse = |why: String| refused(record, why);
    let split = channels.split().map_err(|e| refuse(e.to_string()))?;
    let (closure, before, after, accidents, firmware) = {
        let own = own_candidates(design, &channels, &mut warnings);
        let search = Search::new(&channels, &split, effort, own);
        let unusable = |e: super::likelihood::Unusable| refuse(e.to_string());
        let found = search.run().map_err(unusable)?;
        let before = search.model(&[]).map_err(unusable)?;
        let after = search.model(&found.terms).map_err(unusable)?;
        let accidents = search.accidents([&before, &after]);
        let told = Told {
            search: &search,
            found: &found,
            before: &before,
            after: &after,
            judged: JudgedRows::of(&search, &accidents),
        };
        let mut closure = told.closure().map_err(unusable)?;
        told.warn(&mut warnings);
        let firmware = told.firmware(record, &mut warnings);
        closure.firmware = firmware
            .as_ref()
            .map_or_else(FirmwareErrors::default, |f| f.errors);
        closure.warnings = warnings;
        closure.command = command.to_owned();
        closure.design_sha256 = crate::emit::manifest::sha256(design.source.text.as_bytes());
        (closure, before, after, accidents, firmware)
    };
    let (correction, firmware_dps) = firmware.map(|f| (f.correction, f.residual_dps)).unzip();
    let mut closed = Closed {
        closure,
        channels,
        split,
        accidents,
        before,
        after,
        correction,
        firmware_dps,
    };
    closed.closure.seconds = start.elapsed().as_secs_f64();
    Ok(closed)
}

/// The rows that errors are of, and those that stand out alone.
struct JudgedRows {
    train: Vec<bool>,
    heldout: Vec<bool>,
    accidents: Vec<bool>,
}

impl JudgedRows {
    /// Those of a search that are no accidents.
    fn of(search: &Search, accidents: &[bool]) -> Self {
        let usual = |rows: &[bool]| -> Vec<bool> {
            let pairs = rows.iter().zip(accidents);
            pairs.map(|(row, accident)| *row && !accident).collect()
        };
        JudgedRows {
            train: usual(&search.train),
            heldout: usual(&search.heldout),
            accidents: accidents.to_vec(),
        }
    }
}

/// A search put into words.
struct Told<'a> {
    search: &'a Search<'a>,
    found: &'a Found,
    before: &'a Model,
    after: &'a Model,
    judged: JudgedRows,
}

impl Told<'_> {
    fn errors(&self, model: &Model) -> Errors {
        let residual = model.residual(self.search.channels);
        let over = |rows: &[bool]| -> Vec<f64> {
            let pairs = residual.iter().zip(rows).filter(|(_, m)| **m);
            pairs.map(|(r, _)| *r).collect()
        };
        let held = over(&self.judged.heldout);
        Errors {
            train_rms: stats::rms(&over(&self.judged.train)),
            heldout_rms: stats::rms(&held),
            heldout_max_abs: held.iter().fold(0.0, |m, r| m.max(r.abs())),
        }
    }

    fn closure(&self) -> std::result::Result<Closure, super::likelihood::Unusable> {
        let left = self.found.left.is_some();
        let residual = self.after.residual(self.search.channels);
        let rows = residual.iter().zip(&self.judged.accidents);
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
            noise_floor_rms: stats::difference_noise(&usual),
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
            seconds: 0.0,
        })
    }

    /// The steps in their order, each with the held-out error of itself and those before it.
    fn steps(&self) -> std::result::Result<Vec<Step>, super::likelihood::Unusable> {
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

    /// The correction and its errors; none where firmware cannot carry it.
    fn firmware(
        &self,
        record: &ThermalRecord,
        warnings: &mut Vec<Warning>,
    ) -> Option<firmware::Judged> {
        let c = self.search.channels;
        // Rates as they come in, and as they go out.
        let most = |name: &str| {
            let (low, high) =
                stats::extremes(record.column(name).unwrap_or(&[])).unwrap_or_default();
            low.abs().max(high.abs())
        };
        let widest = 1.25 * most("rate_out_dps").max(most("rate_dps")).max(1e-3);
        let estimates = self.search.estimates(self.after);
        let Some(plan) = firmware::plan(c, self.after, &estimates, widest) else {
            let terms = self.after.terms.iter();
            let obstacles = terms.filter_map(|t| t.candidate.obstacle(c, &t.point));
            warnings.extend(obstacles.map(|why| Warning::general("not_compensable", why)));
            return None;
        };
        let noise = self.after.fit.noise.white_rms_dps;
        let judged = |plan: &crate::correction::Plan| {
            firmware::judged(plan, record, c, &self.judged.heldout, noise)
        };
        if plan.keeps() {
            let said = "a lag goes on while the power is off: firmware keeps its state and makes up for the periods \
                        without power (the manual's \"The correction of averaged readings\"), as it did for the figures \
                        here";
            warnings.push(Warning::general("firmware_needs_clock", said));
        }
        let carried = match judged(&plan) {
            Ok(carried) => carried,
            Err(e) => {
                warnings.push(Warning::general("no_firmware", e.to_string()));
                return None;
            }
        };
        // Coefficients that cancel may be a model's; in words they are worse than no step at all.
        let declared = firmware::plan(c, self.before, &[], widest);
        let declared = declared.and_then(|plan| judged(&plan).ok()?.errors.heldout_rms);
        if let (Some(with), Some(without)) = (carried.errors.heldout_rms, declared)
            && !self.after.terms.is_empty()
            && with > 1.02 * without
        {
            let said = format!(
                "the steps' coefficients cancel each other: in firmware's words they leave {with:.3e} deg/s of \
                 held-out rows, the declared model alone {without:.3e}; do the separating experiment"
            );
            warnings.push(Warning::general("no_firmware", said));
            return None;
        }
        Some(carried)
    }

    fn evidence(&self, steps: &[Step]) -> Vec<Evidence> {
        let mut out: Vec<Evidence> = Vec::new();
        let confounded: Vec<&String> = steps
            .iter()
            .flat_map(|s| &s.indistinguishable_from)
            .collect();
        for j in self.found.first.iter().filter(|j| j.candidate.named()) {
            let id = j.candidate.id();
            let (fate, remark) = if steps.iter().any(|s| s.effect == id) {
                (Fate::Taken, "a step".to_owned())
            } else if confounded.contains(&&id) || self.found.undecided.contains(&id) {
                let remark = format!("explains as much; {}", j.candidate.sheet().experiment);
                (Fate::Confounded, remark)
            } else if let Some((_, rms_dps)) = self.found.within_rounding.iter().find(|r| r.0 == id)
            {
                let remark = format!(
                    "its whole contribution, {rms_dps:.2e} deg/s rms, is below twice the {:.2e} deg/s that the ADC's \
                     rounding makes",
                    self.search.channels.rounding_dps
                );
                (Fate::Rejected, remark)
            } else if j.p_value <= LEVEL {
                let remark = match steps.is_empty() {
                    false => "seen alone it helps, but what was taken explains more",
                    true => {
                        "beyond chance, but it does not hold over the whole record, or a shape without a name explains more"
                    }
                };
                (Fate::Rejected, remark.to_owned())
            } else if self.search.is_declared(j) {
                let remark = format!(
                    "goes with the temperature in this record: the declared bias has whatever it does; {}",
                    j.candidate.sheet().experiment
                );
                (Fate::Confounded, remark)
            } else {
                let remark = "chance does as well among so many candidates";
                (Fate::Rejected, remark.to_owned())
            };
            out.push(Evidence {
                effect: id,
                fate,
                p_value: Some(j.p_value),
                gain: Some(j.gain),
                remark,
            });
        }
        for (candidate, why) in self.found.missing.iter().filter(|(c, _)| c.named()) {
            let (fate, remark) = match why {
                Missing::Channel(name) => {
                    (Fate::NoChannel, format!("the record has no column {name}"))
                }
                Missing::Excitation(remark) => (Fate::NotExcited, remark.clone()),
            };
            out.push(without(candidate, fate, remark));
        }
        for term in self.found.terms.iter().filter(|t| t.evident) {
            out.push(Evidence {
                effect: term.id(),
                fate: Fate::Taken,
                p_value: Some(term.p_value),
                gain: None,
                remark:
                    "a step: readings that agree to the last digit at an end of the output's range"
                        .to_owned(),
            });
        }
        out.extend(self.wave(&out));
        let listed: Vec<String> = out.iter().map(|e| e.effect.clone()).collect();
        for candidate in self.search.candidates() {
            if candidate.named() && !listed.contains(&candidate.id()) {
                let remark = "what it does lies within the declared model in this record";
                out.push(without(candidate, Fate::NotExcited, remark.to_owned()));
            }
        }
        out
    }

    /// What is said of `periodic_pickup` where the strongest sinusoid comes back too seldom for its name.
    fn wave(&self, listed: &[Evidence]) -> Option<Evidence> {
        const NAME: &str = "periodic_pickup";
        let mut judged = self.found.first.iter();
        let wave = judged.find(|j| j.candidate.id() == "outside:tone")?;
        let absent = listed.iter().all(|e| e.effect != NAME);
        let remark =
            "the strongest sinusoid has fewer than four periods in this record, as a wander has";
        absent.then(|| Evidence {
            effect: NAME.to_owned(),
            fate: Fate::Rejected,
            p_value: Some(wave.p_value),
            gain: Some(wave.gain),
            remark: remark.to_owned(),
        })
    }

    fn warn(&self, warnings: &mut Vec<Warning>) {
        warnings.extend(self.accidents());
        if !self.found.within_rounding.is_empty() {
            let each = self.found.within_rounding.iter();
            let names: Vec<String> = each.map(|(id, rms)| format!("{id} ({rms:.2e})")).collect();
            warnings.push(Warning::general(
                "within_adc_rounding",
                format!(
                    "not named, as the whole contribution (deg/s rms) is below twice the {:.2e} deg/s that the ADC's \
                     rounding makes: {}",
                    self.search.channels.rounding_dps,
                    names.join(", ")
                ),
            ));
        }
        for id in &self.found.once {
            warnings.push(Warning::general(
                "happens_once",
                format!(
                    "{id}: the record shows its step once, so that it may as well be a change at that moment (no effect \
                     of the catalogue); a second passage of that temperature separates the two"
                ),
            ));
        }
        if !self.found.undecided.is_empty() {
            warnings.push(Warning::general(
                "undecided",
                format!(
                    "the record decides nothing between {}: each explains it as well",
                    self.found.undecided.join(", ")
                ),
            ));
        }
        let hidden: Vec<String> = self.goes_with_temperature();
        if !hidden.is_empty() {
            warnings.push(Warning::general(
                "goes_with_temperature",
                format!(
                    "the declared bias in temperature may be that of {}: in this record these go with the thermometer; \
                     `evidence` says which experiment separates them",
                    hidden.join(", ")
                ),
            ));
        }
    }

    /// What is said of rows that no figure has in it.
    fn accidents(&self) -> Option<Warning> {
        let search = self.search;
        let residual = self.after.residual(search.channels);
        let accidents = self.judged.accidents.iter().enumerate();
        let rows: Vec<usize> = accidents.filter(|(_, a)| **a).map(|(row, _)| row).collect();
        let held = rows.iter().filter(|row| search.heldout[**row]).count();
        let farthest = rows
            .iter()
            .copied()
            .max_by(|a, b| residual[*a].abs().total_cmp(&residual[*b].abs()))?;
        Some(Warning::on(
            "outliers",
            "rate_out_dps",
            format!(
                "{} of {} rows ({} held out) stand out alone by more than six deviations, whatever the model: they are not in \
                 the errors; the farthest, at {} s, is off by {:.3e} deg/s",
                rows.len(),
                residual.len(),
                held,
                search.channels.time_s[farthest],
                residual[farthest]
            ),
        ))
    }

    /// Names of other channels' effects that the declared bias has in it.
    fn goes_with_temperature(&self) -> Vec<String> {
        let search = self.search;
        let named = self.found.first.iter().filter(|j| j.candidate.named());
        let others = named.filter(|j| {
            let channels = j.candidate.channels_at(search.channels, &j.point);
            let first = channels.first();
            first.is_some_and(|c| *c != search.channels.thermometer && c != "time_s")
        });
        // As in `evidence`: what is beyond chance beside the declared model is not in it.
        let hidden = others.filter(|j| j.p_value > LEVEL && search.is_declared(j));
        let taken = |id: &String| self.found.terms.iter().any(|t| t.id() == *id);
        let ids = hidden.map(|j| j.candidate.id());
        ids.filter(|id| !taken(id)).collect()
    }
}

fn without(candidate: &Arc<dyn Candidate>, fate: Fate, remark: String) -> Evidence {
    Evidence {
        effect: candidate.id(),
        fate,
        p_value: None,
        gain: None,
        remark,
    }
}
