//! The declared bias model, fitted: a polynomial in the thermometer's own reading
//! (`docs/manual.md`, "Thermal records"; eq. 9 of the seed paper where the thermometer is the phase).

use super::checks::{self, Checked};
use super::order::{self, OrderTrial};
use super::rate_steps::RateSteps;
use super::sweep::{self, Loop};
use crate::design::{FitOptions, FitOrder, RecordMapping};
use crate::error::{InputError, Result};
use crate::numeric::polynomial;
use crate::record::columns::{self, THERMOMETERS};
use crate::record::guesses::{guess, mapped, mapped_with_remark};
use crate::record::thermal::{ENOUGH_ROWS, LEAST_ROWS};
use crate::record::{ThermalRecord, Warning};
use crate::statistics::correlation::{NoiseModel, Rows};
use crate::statistics::folds;
use crate::statistics::folds::Sample;
use crate::statistics::stats;
use crate::statistics::weights;
use crate::statistics::weights::{BINS, Bins};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// A fitted bias model with all that is needed to judge it.
#[derive(Debug, Clone, PartialEq)]
pub struct BaselineFit {
    /// The column that the polynomial is in.
    pub thermometer: String,
    /// Its unit.
    pub unit: &'static str,
    /// (least, greatest) reading of the fitted rows, in that unit; the polynomial extrapolates
    /// outside.
    pub range: (f64, f64),
    /// Middle of the range.
    pub centre: f64,
    /// Half of its width; 1 if the thermometer did not move.
    pub half_span: f64,
    /// The polynomial's order.
    pub order: usize,
    /// Lowest first, in powers of the reading itself: deg/s per unit^k. Ill suited to evaluation
    /// where the range is far from 0 (a frequency): use [`BaselineFit::bias_dps`].
    pub coefficients: Vec<f64>,
    /// Lowest first, in powers of x = (T - centre) / half_span, deg/s.
    pub coefficients_scaled: Vec<f64>,
    /// Of `coefficients_scaled`, (deg/s)^2: weighted least squares under noise with the
    /// residuals' own memory ([`crate::statistics::correlation`]).
    pub covariance: DMatrix<f64>,
    /// The noise that the covariance stands for.
    pub noise: NoiseModel,
    /// Residual over all fitted rows, spikes included, each counting once, deg/s.
    pub in_sample_rms_dps: f64,
    /// Held-out error over the same rows, deg/s ([`folds::HeldOut::rms_dps`]).
    pub heldout_rms_dps: f64,
    /// The largest held-out error.
    pub heldout_max_abs_dps: f64,
    /// White noise of the output, deg/s: [`stats::difference_noise`] of what the highest order that is tried by itself
    /// leaves, whatever order was chosen: the floor is the record's. Noise with memory counts in part. Not below the rounding to
    /// [`BaselineFit::rate_steps`].
    pub noise_floor_rms_dps: f64,
    /// The steps of the output, where they are too coarse for its noise.
    pub rate_steps: Option<RateSteps>,
    /// Drift of the bias over the thermometer's range, deg/s, peak to peak: of the mean error
    /// signal in twenty bins of the thermometer with at least three clean rows (of all bins that
    /// have rows, if no two have three), so that noise hardly counts.
    pub drift_before_pp_dps: f64,
    /// The plain figure: greatest minus least reading of the error signal, noise and spikes
    /// included, deg/s.
    pub drift_before_pp_plain_dps: f64,
    /// Error signal minus polynomial for each row of the record, deg/s; NaN where the row was not
    /// used.
    pub residuals: Vec<f64>,
    /// The held-out errors in the same layout.
    pub heldout_errors: Vec<f64>,
    /// The weight of each row of the record in the fit; 0 where it was not used.
    pub weights: Vec<f64>,
    /// The rows of the record that were fitted, in order of time.
    pub rows: Vec<usize>,
    /// The held-out blocks, as ranges into `rows`.
    pub blocks: Vec<Range<usize>>,
    /// All orders that were tried.
    pub orders_tried: Vec<OrderTrial>,
    /// Why this order, in a sentence.
    pub reason: String,
    /// Rows of the record that stand out from their neighbours and hardly count (spikes).
    pub outliers: Vec<usize>,
    /// Heating against cooling; `None` if the record does not have both in enough places.
    pub sweep_loop: Option<Loop>,
    /// What the user should know of.
    pub warnings: Vec<Warning>,
}

impl BaselineFit {
    /// The scaled reading, -1..1 within the range.
    pub fn scaled(&self, t: f64) -> f64 {
        (t - self.centre) / self.half_span
    }

    /// The bias at a reading of the thermometer, deg/s. Outside [`BaselineFit::range`] this
    /// extrapolates; limit `t` to the range to clamp.
    pub fn bias_dps(&self, t: f64) -> f64 {
        polynomial::evaluate(&self.coefficients_scaled, self.scaled(t))
    }

    /// Its slope, deg/s per unit of the thermometer.
    pub fn slope_dps(&self, t: f64) -> f64 {
        let derivative: Vec<f64> = self
            .coefficients_scaled
            .iter()
            .enumerate()
            .skip(1)
            .map(|(k, c)| k as f64 * c)
            .collect();
        polynomial::evaluate(&derivative, self.scaled(t)) / self.half_span
    }

    /// The standard deviation of [`BaselineFit::bias_dps`] that noise leaves, deg/s: not that of
    /// a single reading, and without what the order cannot follow.
    pub fn std_dps(&self, t: f64) -> f64 {
        let v = DVector::from_vec(polynomial::powers(self.scaled(t), self.order));
        v.dot(&(&self.covariance * &v)).max(0.0).sqrt()
    }

    /// The largest [`BaselineFit::std_dps`] over the range, deg/s, on 101 points.
    pub fn std_max_dps(&self) -> f64 {
        self.std_dps(self.least_certain())
    }

    /// Where it is: the first of the 101 readings of the thermometer with it.
    pub fn least_certain(&self) -> f64 {
        let readings =
            (0..=100).map(|k| self.centre + self.half_span * (f64::from(k) / 50.0 - 1.0));
        let start = (self.centre - self.half_span, f64::NEG_INFINITY);
        let larger = |best: (f64, f64), t: f64| match self.std_dps(t) {
            std if std > best.1 => (t, std),
            _ => best,
        };
        readings.fold(start, larger).0
    }

    /// The coefficients, lowest first, deg/s, in p = (T - `offset`) / `scale`: what fixed-point
    /// coefficients are made from. Taken from the scaled ones by a Taylor shift, never through
    /// powers of T itself, so nothing cancels for an offset in or near the range. `scale` must
    /// not be 0.
    pub fn scaled_to(&self, offset: f64, scale: f64) -> Vec<f64> {
        polynomial::substitute(
            &self.coefficients_scaled,
            (offset - self.centre) / self.half_span,
            scale / self.half_span,
        )
    }
}

/// The thermometer of the bias model: the one that is named, else the first of
/// [`THERMOMETERS`] that the record has.
///
/// # Errors
/// None there, or none of that name, or fewer than ten rows have it and a rate.
pub fn thermometer<'a>(
    record: &'a ThermalRecord,
    mapping: &'a RecordMapping,
) -> Result<(&'a str, &'a [f64])> {
    let has: Vec<&str> = record.columns.keys().map(String::as_str).collect();
    let refuse = |message: String, help: String| -> crate::error::Error {
        InputError::new(message)
            .in_file(&record.source)
            .help(help)
            .into()
    };
    let name = match &mapping.thermometer {
        Some(name) => name.as_str(),
        None => THERMOMETERS
            .into_iter()
            .find(|t| record.column(t).is_some())
            .ok_or_else(|| {
                refuse(
                    format!(
                        "the record has no thermometer: none of {}",
                        THERMOMETERS.join(", ")
                    ),
                    without_thermometer(record, &has),
                )
            })?,
    };
    let Some(column) = record.column(name) else {
        return Err(mapping.lacks_thermometer(name, &record.source, &has).into());
    };
    let usable = record.column("rate_out_dps").unwrap_or(&[]);
    let both = column
        .iter()
        .zip(usable)
        .filter(|(t, e)| !t.is_nan() && !e.is_nan())
        .count();
    if both < LEAST_ROWS {
        return Err(refuse(
            format!("only {both} rows have both {name} and rate_out_dps"),
            format!(
                "record {ENOUGH_ROWS} such rows or more; `thermometer` in [record] names another column"
            ),
        ));
    }
    Ok((name, column))
}

/// What helps a record without a thermometer; `has` are its columns.
fn without_thermometer(record: &ThermalRecord, has: &[&str]) -> String {
    let each = has.iter().map(|name| match record.renamed.get(*name) {
        Some(own) if own != name => format!("{own} (read as {name})"),
        _ => (*name).to_owned(),
    });
    let columns = each.collect::<Vec<_>>().join(", ");
    if record.is_of_log() {
        return format!(
            "the log gives: {columns}. Log the gyro's temperature beside it (PX4: sensor_gyro or vehicle_imu_status; ArduPilot: \
             IMU with its T), or `gyrogen close --record` it, which does without"
        );
    }
    let said = match record.renamed.is_empty() {
        true => {
            "say in the design (these lines are a whole one) which one is the thermometer:\n    [record.columns]\n    "
        }
        false => "add to [record.columns] of the design which one is the thermometer: ",
    };
    format!(
        "the file has: {columns}\n  {said}{}\n  a record without a thermometer: `gyrogen close --record` does without",
        mapped_with_remark(
            "die_degc",
            guess("die_degc", has).unwrap_or("NAME_IN_THE_FILE")
        )
    )
}

/// The line of `[record.columns]` that makes the column a thermometer that is named like one; `None`: none of `has` is.
pub fn line_of_thermometer(has: &[&str]) -> Option<String> {
    guess("die_degc", has).map(|column| mapped("die_degc", column))
}

/// Fits the bias model.
///
/// # Errors
/// No thermometer, or fewer than ten rows with a thermometer and a rate.
pub fn fit(
    record: &ThermalRecord,
    mapping: &RecordMapping,
    options: &FitOptions,
) -> Result<BaselineFit> {
    fit_with(record, mapping, options, true)
}

/// As [`fit`]; `limit_dwells = false` lets every row count alike (but for spikes), to see what
/// the limit does.
///
/// # Errors
/// As [`fit`].
pub fn fit_with(
    record: &ThermalRecord,
    mapping: &RecordMapping,
    options: &FitOptions,
    limit_dwells: bool,
) -> Result<BaselineFit> {
    let (name, column) = thermometer(record, mapping)?;
    let mut warnings = Vec::new();
    let error = record.error_dps();
    let rows = usable_rows(record, name, column, &error, &mut warnings);
    let t: Vec<f64> = rows.iter().map(|i| column[*i]).collect();
    let range = stats::extremes(&t).unwrap_or((0.0, 0.0));
    let centre = range.0 + (range.1 - range.0) / 2.0;
    let half = (range.1 - range.0) / 2.0;
    let half_span = if half > 0.0 { half } else { 1.0 };
    let x: Vec<f64> = t.iter().map(|t| (t - centre) / half_span).collect();
    let e: Vec<f64> = rows.iter().map(|i| error[*i]).collect();
    drop(error);
    let sample = Sample {
        spike: weights::spike(&x, &e),
        bins: Bins::new(range),
        limit_dwells,
        t,
        x,
        e,
    };
    let blocks = folds::blocks(rows.len(), options.heldout_blocks);
    let most = most_order(&sample, options.order);
    let choice = order::choose(&sample, options.order, most, &blocks);
    let row_weights = sample.weights(|_| true);
    let coefficients_scaled = sample
        .problem(choice.order, |_| true)
        .coefficients(choice.order);
    let order = coefficients_scaled.len() - 1;
    if let FitOrder::Fixed(wanted) = options.order
        && (wanted as usize) > order
    {
        warnings.push(Warning::general(
            "order_lowered",
            format!(
                "order {wanted} was asked for; the record's temperatures determine order {order} \
                 at most, so that is what was fitted"
            ),
        ));
    }
    let residuals = sample.residuals(&coefficients_scaled);
    let noise = NoiseModel::of_residuals(residuals.clone(), &sample.spike, order + 1);
    let powers = Rows {
        count: sample.x.len(),
        columns: order + 1,
        row: |i: usize, row: &mut [f64]| polynomial::fill_powers(sample.x[i], row),
    };
    let covariance = powers.covariance(&row_weights, &noise);
    let drift = drift(&sample);
    let threshold = (0.1 * (range.1 - range.0)).max(6.0 * stats::curvature_noise(&sample.t));
    let directions = sweep::directions(&sample.t, threshold);
    let sweep_loop = sweep::measure_loop(&sample, &residuals, order, &directions);
    let outliers: Vec<usize> = rows
        .iter()
        .zip(&sample.spike)
        .filter(|(_, w)| **w < 0.5)
        .map(|(i, _)| *i)
        .collect();
    warnings.extend(outlier_warning(record, &outliers, rows.len()));
    let rest = residuals_of_most(&sample);
    let rate_steps = RateSteps::of(record, &rows, &rest);
    let rounding = rate_steps.map_or(0.0, RateSteps::rounding_rms_dps);
    warnings.extend(rate_steps.map(RateSteps::warning));
    // A long record is not copied where every row is usable.
    let spread_out = |values: Vec<f64>, missing: f64| -> Vec<f64> {
        if values.len() == record.len() {
            return values;
        }
        let mut out = vec![missing; record.len()];
        for (i, v) in rows.iter().zip(values) {
            out[*i] = v;
        }
        out
    };
    let mut fit = BaselineFit {
        thermometer: name.to_owned(),
        unit: columns::unit_of(name),
        range,
        centre,
        half_span,
        order,
        coefficients: polynomial::substitute(
            &coefficients_scaled,
            -centre / half_span,
            1.0 / half_span,
        ),
        coefficients_scaled,
        covariance,
        noise,
        in_sample_rms_dps: stats::rms(&residuals),
        heldout_rms_dps: choice.heldout.rms_dps,
        heldout_max_abs_dps: choice.heldout.max_abs_dps,
        noise_floor_rms_dps: stats::difference_noise(&rest).max(rounding),
        rate_steps,
        drift_before_pp_dps: drift,
        drift_before_pp_plain_dps: stats::extremes(&sample.e).map_or(0.0, |(a, b)| b - a),
        residuals: spread_out(residuals, f64::NAN),
        heldout_errors: spread_out(choice.heldout.errors(&sample, &blocks), f64::NAN),
        weights: spread_out(row_weights, 0.0),
        rows,
        blocks,
        orders_tried: choice.trials,
        reason: choice.reason,
        outliers,
        sweep_loop,
        warnings: Vec::new(),
    };
    warnings.extend(checks::all(&Checked {
        sample: &sample,
        fit: &fit,
        directions: &directions,
        sweep_loop,
    }));
    fit.warnings = warnings;
    Ok(fit)
}

/// The rows with a thermometer and an error signal, without glitches of the thermometer.
fn usable_rows(
    record: &ThermalRecord,
    name: &str,
    column: &[f64],
    error: &[f64],
    warnings: &mut Vec<Warning>,
) -> Vec<usize> {
    let measured: Vec<usize> = (0..record.len())
        .filter(|i| !column[*i].is_nan() && !error[*i].is_nan())
        .collect();
    let with_rate = error.iter().filter(|e| !e.is_nan()).count();
    if measured.len() < with_rate {
        warnings.push(Warning::on(
            "rows_without_thermometer",
            name,
            format!(
                "{} of {with_rate} rows have no {name}; the fit does without them",
                with_rate - measured.len()
            ),
        ));
    }
    let t: Vec<f64> = measured.iter().map(|i| column[*i]).collect();
    let glitch = weights::thermometer_glitches(&t);
    let found: Vec<usize> = measured
        .iter()
        .zip(&glitch)
        .filter(|(_, g)| **g)
        .map(|(i, _)| *i)
        .collect();
    if !found.is_empty() {
        warnings.push(glitches(record, name, &found));
    }
    let rows = measured.into_iter().zip(glitch);
    let mut rows: Vec<usize> = rows.filter(|(_, g)| !g).map(|(i, _)| i).collect();
    // Grown by doubling, and kept as long as the fit.
    rows.shrink_to_fit();
    rows
}

/// What is said of a thermometer's readings that [`weights::thermometer_glitches`] marks.
pub(super) fn glitches(record: &ThermalRecord, name: &str, rows: &[usize]) -> Warning {
    Warning::on(
        "thermometer_glitch",
        name,
        format!(
            "{} readings of {name} lie apart from their neighbours by more than half of the \
             range and are left out ({})",
            rows.len(),
            record.places(rows)
        ),
    )
}

fn outlier_warning(record: &ThermalRecord, outliers: &[usize], rows: usize) -> Option<Warning> {
    if outliers.is_empty() {
        return None;
    }
    let share = outliers.len() as f64 / rows.max(1) as f64;
    let many = if share > 0.1 {
        "; that is many: is the output disturbed, or an applied rate missing from rate_dps?"
    } else {
        ""
    };
    Some(Warning::on(
        "outliers",
        "rate_out_dps",
        format!(
            "{} of {rows} rows stand out from their neighbours and hardly count in the fit ({}); \
             held-out and in-sample errors include them{many}",
            outliers.len(),
            record.places(outliers)
        ),
    ))
}

/// The highest order that the rows determine: below the number of different readings, and, when
/// the order is to be chosen, with two readings and five rows a coefficient.
fn most_order(sample: &Sample, wanted: FitOrder) -> usize {
    let clean = sample
        .t
        .iter()
        .zip(&sample.spike)
        .filter(|(_, w)| **w > 0.0);
    let t: Vec<f64> = clean.map(|(t, _)| *t).collect();
    let different = stats::distinct(&t);
    match wanted {
        FitOrder::Fixed(_) => different.saturating_sub(1),
        FitOrder::Auto | FitOrder::ByRecord => (different / 2).min(t.len() / 5).saturating_sub(1),
    }
}

/// What the highest order that is tried by itself leaves.
fn residuals_of_most(sample: &Sample) -> Vec<f64> {
    let order = most_order(sample, FitOrder::Auto).min(order::HIGHEST_AUTO);
    let coefficients = sample.problem(order, |_| true).coefficients(order);
    sample.residuals(&coefficients)
}

/// See [`BaselineFit::drift_before_pp_dps`].
fn drift(sample: &Sample) -> f64 {
    let mut sums = [(0.0, 0.0, 0usize); BINS];
    for ((t, e), w) in sample.t.iter().zip(&sample.e).zip(&sample.spike) {
        let bin = &mut sums[sample.bins.index(*t)];
        bin.0 += w * e;
        bin.1 += w;
        bin.2 += usize::from(*w >= 0.5);
    }
    let means = |least: usize| -> Vec<f64> {
        let bins = sums.iter().filter(|b| b.2 >= least);
        bins.map(|b| b.0 / b.1).collect()
    };
    let mut chosen = means(3);
    if chosen.len() < 2 {
        chosen = means(1);
    }
    stats::extremes(&chosen).map_or(0.0, |(low, high)| high - low)
}
