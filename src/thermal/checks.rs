//! What a user should know before believing a thermal fit.
//!
//! Thermal fits mislead quietly: a whole-degree thermometer (PX4-Autopilot #13551), an end that
//! hardly any row supports (#9266), a soak that outvotes the ramp (#14091), a record that was only
//! heated. Each check is a warning with its figures; none stops the fit.

use super::baseline::BaselineFit;
use super::sweep::Loop;
use crate::record::Warning;
use crate::statistics::folds::Sample;
use crate::statistics::stats;
use crate::statistics::weights::BINS;
use crate::text::{constant, number};

/// A Celsius thermometer that moved by less than this, K, cannot carry a temperature law.
pub const LEAST_SPAN_K: f64 = 5.0;

/// The thermometer's range, in noise standard deviations, below which it carries none either.
pub const LEAST_SPAN_NOISES: f64 = 8.0;

/// How far beyond the calibrated range extrapolation is judged, as a fraction of the range.
pub const BEYOND: f64 = 0.1;

/// What the checks look at.
pub(super) struct Checked<'a> {
    /// The rows.
    pub sample: &'a Sample,
    /// The fit, complete but for its warnings.
    pub fit: &'a BaselineFit,
    /// [`super::sweep::directions`].
    pub directions: &'a [i8],
    /// [`super::sweep::measure_loop`].
    pub sweep_loop: Option<Loop>,
}

/// All warnings.
pub(super) fn all(c: &Checked<'_>) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let small = span(c);
    let is_small = small.is_some();
    warnings.extend(small);
    warnings.extend(few_points(c));
    if !is_small {
        warnings.extend(resolution(c));
        warnings.extend(direction(c));
        warnings.extend(coverage(c));
        warnings.extend(extrapolation(c));
        warnings.extend(dwells(c));
    }
    warnings.extend(loop_warning(c));
    warnings
}

/// A figure short enough to read, exact enough to compare.
fn g(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-3..1e5).contains(&size) {
        let digits = if size == 0.0 {
            0
        } else {
            (3 - size.log10().floor() as i32).clamp(0, 6)
        };
        format!("{value:.*}", digits as usize)
    } else {
        number(value, 3)
    }
}

/// Too small a range for any law in the thermometer.
fn span(c: &Checked<'_>) -> Option<Warning> {
    let (fit, t) = (c.fit, &c.sample.t);
    let (low, high) = fit.range;
    let (span, unit) = (high - low, fit.unit);
    if span == 0.0 {
        return Some(Warning::on(
            "thermometer_constant",
            &fit.thermometer,
            format!(
                "{} is {} {unit} in every row, so that no dependence on temperature can be fitted: the firmware subtracts a constant. \
                 Check that its sensor is not frozen, and record over a range of temperatures",
                fit.thermometer,
                g(low)
            ),
        ));
    }
    let noise = stats::curvature_noise(t);
    let in_noises = noise > 0.0 && span < LEAST_SPAN_NOISES * noise;
    let in_kelvin = unit == "degC" && span < LEAST_SPAN_K;
    (in_noises || in_kelvin).then(|| {
        Warning::on(
            "thermometer_range_small",
            &fit.thermometer,
            format!(
                "{} moves by {} {unit} only ({} to {}; its noise is {} {unit} rms). That is too little \
                 for a law in temperature. Record a wider range",
                fit.thermometer,
                g(span),
                g(low),
                g(high),
                g(noise)
            ),
        )
    })
}

/// Fewer than five rows a coefficient, or hardly more temperatures than coefficients.
fn few_points(c: &Checked<'_>) -> Option<Warning> {
    let terms = c.fit.order + 1;
    let rows = c.sample.t.len();
    let mut visited = [false; BINS];
    for t in &c.sample.t {
        visited[c.sample.bins.index(*t)] = true;
    }
    let places = visited.iter().filter(|v| **v).count();
    let short = rows < 5 * terms || (c.fit.order > 0 && places < terms + 2);
    short.then(|| {
        Warning::general(
            "few_points",
            format!(
                "{terms} coefficients are fitted to {rows} rows, which lie in {places} of {BINS} parts of the thermometer's \
                 range. The fit follows these rows better than new ones: trust the held-out error. Take a lower order, \
                 or record more temperatures"
            ),
        )
    })
}

/// Steps of the thermometer that make an error of their own.
fn resolution(c: &Checked<'_>) -> Option<Warning> {
    let fit = c.fit;
    let step = stats::lattice_step(&c.sample.t)?;
    // A clean ramp makes one step a row, always: a programme, not a coarse thermometer.
    let moves = c.sample.t.windows(2).map(|w| (w[1] - w[0]).abs() / step);
    let single = moves.filter(|m| (m - 1.0).abs() < 0.1).count();
    if single as f64 > 0.9 * (c.sample.t.len() - 1) as f64 {
        return None;
    }
    let (low, high) = fit.range;
    let steepest = (0..=50)
        .map(|k| low + (high - low) * f64::from(k) / 50.0)
        .map(|t| fit.slope_dps(t).abs())
        .fold(0.0, f64::max);
    // A reading is off by up to half a step, evenly spread.
    let error = steepest * step / 12f64.sqrt();
    let steps = (high - low) / step;
    let coarse = error > 0.3 * fit.noise_floor_rms_dps || steps < 10.0;
    coarse.then(|| {
        Warning::on(
            "thermometer_resolution_coarse",
            &fit.thermometer,
            format!(
                "{} comes in steps of {} {} ({} values over the range). Where the bias is steepest, that makes an error of {} \
                 deg/s rms, beside a noise of {} deg/s. Read the thermometer with more bits, or average it",
                fit.thermometer,
                g(step),
                fit.unit,
                stats::distinct(&c.sample.t),
                g(error),
                g(fit.noise_floor_rms_dps)
            ),
        )
    })
}

/// Only one direction: lag, warm-up and ageing then hide in the polynomial.
fn direction(c: &Checked<'_>) -> Option<Warning> {
    let (up, down) = super::sweep::places(&c.sample.t, c.sample.bins, c.directions);
    // A few rows of the other direction at one end (a heater switched off) tell nothing.
    if (up > BINS / 5) == (down > BINS / 5) {
        return None;
    }
    let up = up > down;
    let celsius = c.fit.unit == "degC";
    let (is, lacks) = match (celsius, up) {
        (true, true) => ("heating", "cooling"),
        (true, false) => ("cooling", "heating"),
        (false, true) => ("rising readings", "falling ones"),
        (false, false) => ("falling readings", "rising ones"),
    };
    Some(Warning::on(
        "one_direction",
        &c.fit.thermometer,
        format!(
            "the record has {is} and hardly any {lacks}. A thermal lag, a warm-up or a drift in time looks like a part of \
             the polynomial then, and is fitted as one. Record both directions"
        ),
    ))
}

/// A hole in the range that is bridged by nothing but the polynomial.
fn coverage(c: &Checked<'_>) -> Option<Warning> {
    let t = stats::sorted(&c.sample.t);
    let (low, high) = c.fit.range;
    let (at, gap) = t
        .windows(2)
        .map(|w| (w[0], w[1] - w[0]))
        .fold((low, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    // Set points lie apart by design: a fifth of the range and more is a hole all the same.
    (gap > 0.25 * (high - low)).then(|| {
        Warning::on(
            "coverage_gap",
            &c.fit.thermometer,
            format!(
                "no row has {} between {} and {} {} ({:.0} % of the range). There the bias is interpolated, not measured. \
                 Record rows in this gap",
                c.fit.thermometer,
                g(at),
                g(at + gap),
                c.fit.unit,
                100.0 * gap / (high - low)
            ),
        )
    })
}

/// How fast the polynomial leaves what was measured.
fn extrapolation(c: &Checked<'_>) -> Option<Warning> {
    let fit = c.fit;
    let (low, high) = fit.range;
    let by = BEYOND * (high - low);
    let drift = fit.drift_before_pp_dps;
    let worst = [(low, low - by), (high, high + by)]
        .into_iter()
        .map(|(edge, t)| {
            let change = (fit.bias_dps(t) - fit.bias_dps(edge)).abs();
            (t, change, fit.std_dps(t))
        })
        .fold((low, 0.0, 0.0), |a: (f64, f64, f64), b| {
            if b.1.max(b.2) > a.1.max(a.2) { b } else { a }
        });
    let (t, change, std) = worst;
    let wild = change > 0.75 * drift.max(3.0 * fit.noise_floor_rms_dps);
    let unsure = std > 0.25 * drift.max(4.0 * fit.noise_floor_rms_dps);
    // A constant goes nowhere.
    (fit.order > 0 && (wild || unsure)).then(|| {
        Warning::on(
            "extrapolation",
            &fit.thermometer,
            format!(
                "nothing was measured beyond {} .. {} {unit}, and the polynomial is no guide there. A tenth of this range beyond its end, at \
                 {} {unit}, the polynomial is {} deg/s from its value at the end, with a standard deviation of {} deg/s",
                constant(low, 5),
                constant(high, 5),
                constant(t, 5),
                g(change),
                g(std),
                unit = fit.unit
            ),
        )
    })
}

/// Heating against cooling in figures.
fn seen(fit: &BaselineFit, l: Loop) -> String {
    format!(
        "at the same reading of {} the error differs by {} deg/s rms between rising and falling sweeps ({} places compared). \
         Noise with the rms and autocorrelation of the residuals would make {} deg/s rms",
        fit.thermometer,
        g(l.rms_dps),
        l.bins,
        g(l.noise_dps)
    )
}

/// What tells the two apart that make heating differ from cooling; a sentence without its full stop.
pub const LOOP_EXPERIMENT: &str = "To tell a lag from a hysteresis, reverse the chamber's course at several temperatures, and at \
     two ramp rates: the difference that a lag makes grows with the rate, that of a hysteresis does not";

/// The loop of a record that no known effect explains, if it is more than noise.
pub(super) fn unexplained_loop(fit: &BaselineFit) -> Option<Warning> {
    let l = fit.sweep_loop.filter(|l| l.significant)?;
    let said = format!(
        "{}. No function of the thermometer can follow such a difference, and none of the known effects makes it. Nor can a formula of \
         [[effects]], which has the columns of one row. {LOOP_EXPERIMENT}",
        seen(fit, l)
    );
    Some(Warning::on("heating_cooling_loop", &fit.thermometer, said))
}

/// The loop, if it is more than noise, or larger than noise makes it on the whole.
fn loop_warning(c: &Checked<'_>) -> Option<Warning> {
    let l = c.sweep_loop?;
    let seen = seen(c.fit, l);
    if l.significant {
        Some(Warning::on(
            "heating_cooling_loop",
            &c.fit.thermometer,
            format!(
                "{seen}. No function of the thermometer can follow such a difference, but a lag, a gradient or a drift in time can. \
                 `gyrogen close`, with the same record and design, looks for them"
            ),
        ))
    } else if l.is_undecided(c.fit.noise_floor_rms_dps) {
        Some(Warning::on(
            "loop_or_slow_noise",
            &c.fit.thermometer,
            format!(
                "{seen}. The difference is not significant all the same: with this autocorrelation the {} rows are worth {:.0} \
                 independent ones. Try `gyrogen close`, with the same record and design. If it names no cause, record more \
                 cycles of heating and cooling",
                c.sample.t.len(),
                l.effective_rows
            ),
        ))
    } else {
        None
    }
}

/// Says so where dwells were held back.
fn dwells(c: &Checked<'_>) -> Option<Warning> {
    let t = &c.sample.t;
    let share = crate::statistics::weights::dwell(t.iter().copied(), c.sample.bins);
    let weights: Vec<f64> = t.iter().map(|t| share(*t)).collect();
    let held = weights.iter().filter(|w| **w < 1.0).count();
    let share = held as f64 / weights.len().max(1) as f64;
    let left: f64 = weights.iter().filter(|w| **w < 1.0).sum();
    (c.sample.limit_dwells && share > 0.5).then(|| {
        Warning::general(
            "dwell_dominates",
            format!(
                "{:.0} % of the rows lie at few temperatures. They were given {:.0} % of the weight, so that the rest of the \
                 range counts. Shorter dwells would say as much",
                100.0 * share,
                100.0 * left / weights.iter().sum::<f64>().max(f64::MIN_POSITIVE)
            ),
        )
    })
}
