//! From found effects to the correction that firmware runs; `clock`: its steps beside the record's rows; `trial`:
//! terms tried before one is chosen; [`emitted`]: its C and Rust, built and compared.

mod clock;
pub mod emitted;
mod trial;
mod words;

pub use trial::Trial;
pub use words::{Words, knots, sees};

use super::channels::Channels;
use super::effects::Estimate;
use super::search::Model;
use crate::correction::{Correction, Formats, Plan, Reading, Term, readings};
use crate::error::Result;
use crate::record::ThermalRecord;
use crate::statistics::stats;
use crate::verdict::FirmwareErrors;

/// The correction that a model calls for; `None` if firmware cannot carry it.
pub fn plan(
    c: &Channels,
    model: &Model,
    estimates: &[Estimate],
    full_scale_dps: f64,
) -> Option<Plan> {
    let mut words = Words::new(c, &model.acting, model.fit.noise.white_rms_dps);
    let order = model.bias.coefficients_dps.len();
    let thermometer = words.thermometer();
    if order > 1 && thermometer.is_none() {
        return None;
    }
    let mut terms: Vec<Term> = model
        .bias
        .coefficients_dps
        .iter()
        .enumerate()
        .map(|(k, gain_dps)| Term::Product {
            gain_dps: *gain_dps,
            factors: match (k, thermometer) {
                (1.., Some(u)) => vec![(u, k as u32)],
                _ => Vec::new(),
            },
        })
        .collect();
    for (term, estimate) in model.terms.iter().zip(estimates) {
        terms.extend(term.candidate.correction(c, estimate, &mut words)?);
    }
    if order == 1 && words.thermometer == Some(0) && words.inputs.len() == 1 {
        // A thermometer that did not move is no input.
        words.inputs.clear();
    }
    let remembers = terms.iter().any(Term::remembers);
    Some(Plan {
        period_s: if remembers {
            words.period_s
        } else {
            c.period_s()
        },
        inputs: words.inputs,
        full_scale_dps,
        terms,
    })
}

/// Why firmware cannot carry a model: a reason for each term that it cannot, or for the thermometer; and what to do.
pub fn obstacles(c: &Channels, model: &Model, estimates: &[Estimate]) -> Vec<String> {
    let mut words = Words::new(c, &model.acting, model.fit.noise.white_rms_dps);
    let mut out = Vec::new();
    // Without it `run` has no firmware either.
    let has_thermometer = words.thermometer().is_some();
    if model.bias.coefficients_dps.len() > 1 && !has_thermometer {
        let name = &c.thermometer;
        out.push(format!(
            "firmware does not see {name}, which the polynomial is a function of. If {name} is the gyro's own thermometer, name it \
             die_degc in [record.columns]; else record phase_rad, freq_hz or die_degc beside it. Until then firmware carries no cause, \
             and a formula in [[effects]] changes nothing"
        ));
    }
    for (term, estimate) in model.terms.iter().zip(estimates) {
        if term.candidate.correction(c, estimate, &mut words).is_some() {
            continue;
        }
        let own = term.candidate.obstacle(c, &term.point);
        out.push(own.unwrap_or_else(|| {
            let id = term.id();
            let channels = term.candidate.channels_at(c, &term.point);
            let of_time = channels.iter().any(|name| name == "time_s");
            match (term.candidate.sheet().compensable, of_time) {
                (false, true) => format!(
                    "{id} depends on absolute time, which firmware does not know. If its source can be removed, remove it and record \
                     again"
                ),
                (false, false) => format!("firmware cannot know what {id} adds to a reading"),
                (true, _) => format!(
                    "{id}, as this record has it, needs a column that firmware does not see, or no polynomial that its words \
                     hold comes near to it"
                ),
            }
        }));
    }
    if let (true, Some(last)) = (has_thermometer, out.last_mut()) {
        last.push_str(
            ". For firmware of the polynomial alone use `gyrogen run`, with the same record and design",
        );
    }
    out
}

/// The record with the gaps of the plan's inputs filled as the model sees them: what the logger missed, the
/// firmware in the gyro has read.
fn logged(record: &ThermalRecord, c: &Channels, plan: &Plan) -> ThermalRecord {
    let mut out = record.clone();
    for input in &plan.inputs {
        let filled = if input.column == c.thermometer {
            // Firmware sees the reading itself, not its course between coarse steps.
            let read = record.column(&input.column).unwrap_or(&[]);
            let course = c.u.iter().map(|u| c.centre + c.half * u).enumerate();
            let reading = |(i, course): (usize, f64)| {
                let own = read.get(i).copied().filter(|r| r.is_finite());
                own.unwrap_or(course)
            };
            Some(course.map(reading).collect())
        } else {
            c.column(&input.column).map(<[f64]>::to_vec)
        };
        if let Some(filled) = filled {
            out.columns.insert(input.column.clone(), filled);
        }
    }
    if out.columns.contains_key("time_since_power_on_s") {
        let on_s = c.on_s.clone();
        out.columns.insert("time_since_power_on_s".to_owned(), on_s);
    }
    out
}

/// What a plan's firmware reads of a record, and where the record's rows are among it.
///
/// # Errors
/// An input that the record lacks.
fn stream(plan: &Plan, record: &ThermalRecord, c: &Channels) -> Result<(Vec<Reading>, Vec<usize>)> {
    let readings = readings(plan, &logged(record, c, plan))?;
    if plan.terms.iter().any(Term::remembers) {
        return Ok(clock::with_between(plan.period_s, &readings, plan.keeps()));
    }
    let places = (0..readings.len()).collect();
    Ok((readings, places))
}

/// A plan's firmware beside a record.
pub struct Judged {
    /// What runs.
    pub correction: Correction,
    /// What it leaves of each row, bit for bit, deg/s; NaN without a reading.
    pub residual_dps: Vec<f64>,
    /// The same of the block without quantisation.
    unrounded_dps: Vec<f64>,
}

impl Judged {
    /// Its errors over some rows.
    pub fn errors(&self, rows: &[bool]) -> FirmwareErrors {
        let errors = of_rows(&self.residual_dps, rows);
        FirmwareErrors {
            compensable: true,
            heldout_rms: Some(stats::rms(&errors)),
            heldout_max_abs: Some(errors.iter().fold(0.0, |m: f64, e| m.max(e.abs()))),
        }
    }

    /// What the same block without quantisation leaves of some rows, deg/s rms.
    pub fn unrounded_rms_dps(&self, rows: &[bool]) -> f64 {
        stats::rms(&of_rows(&self.unrounded_dps, rows))
    }
}

/// What is left of the rows that are meant and have a reading.
fn of_rows(residual_dps: &[f64], rows: &[bool]) -> Vec<f64> {
    let rows = residual_dps.iter().zip(rows);
    let rows = rows.filter(|(r, row)| **row && r.is_finite());
    rows.map(|(r, _)| *r).collect()
}

/// The correction of a plan, its words chosen for the record's noise, beside the record, bit for bit.
///
/// # Errors
/// A plan that cannot become firmware, with the rule.
pub fn judged(plan: &Plan, record: &ThermalRecord, c: &Channels, noise_dps: f64) -> Result<Judged> {
    plan.check()?;
    let formats = Formats::choose(plan, noise_dps)?;
    let correction = Correction::new(plan, &formats)?;
    let (all, places) = stream(plan, record, c)?;
    let applied = record.column("rate_dps");
    let left = |corrected: Vec<f64>| -> Vec<f64> {
        let of_row = |(i, place): (usize, &usize)| {
            let rate = applied.map_or(0.0, |a| if a[i].is_nan() { 0.0 } else { a[i] });
            corrected[*place] - rate
        };
        places.iter().enumerate().map(of_row).collect()
    };
    Ok(Judged {
        residual_dps: left(correction.run(&all)),
        unrounded_dps: left(correction.run_float(&all)),
        correction,
    })
}
