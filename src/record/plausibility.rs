//! What can be read but is unlikely to be what the column's name says: wrong units, wrong sign.
//!
//! Each check looks for one mistake that people make, and warns; none refuses, because none can
//! be certain. Channels that do not move are looked for in `frozen`; the scale of the output in
//! `scale`, the clock in `timing`.

use super::columns;
use super::temperature::temperature;
use super::thermal::ThermalRecord;
use super::warning::Warning;
use super::{scale, timing};
use crate::design::units;
use crate::statistics::stats;
use crate::text::number;
use std::f64::consts::{PI, TAU};

/// Adds a warning for each column whose values are unlikely.
///
/// `says_rate` tells whether the design states the unit of the output's column.
pub(super) fn check(record: &ThermalRecord, says_rate: bool, warnings: &mut Vec<Warning>) {
    for (name, values) in &record.columns {
        let column = Column {
            name,
            values,
            sorted: stats::sorted(values),
            record,
        };
        let found = match name.as_str() {
            "phase_rad" => phase(&column),
            "rate_out_dps" => rate(&column)
                .or_else(|| at_rest(&column))
                .or_else(|| counts(&column, says_rate))
                .or_else(|| not_given(&column)),
            "rate_dps" | "quad_dps" => rate(&column),
            "freq_hz" => frequency(&column),
            "agc" => gain(&column),
            "supply_v" => supply(&column),
            "accel_g" => acceleration(&column),
            _ if columns::unit_of(name) == "degC" => temperature(&column),
            _ => None,
        };
        warnings.extend(found);
    }
    warnings.extend(scale::check(record));
    warnings.extend(timing::check(record));
}

/// A column under test; `sorted` has at least one value, since empty columns were left out.
pub(super) struct Column<'a> {
    pub(super) name: &'a str,
    values: &'a [f64],
    sorted: Vec<f64>,
    pub(super) record: &'a ThermalRecord,
}

impl Column<'_> {
    /// How mdeg/s or deg/h is said in the design, of a rate whose values are too large for deg/s.
    fn in_smaller_unit(&self) -> String {
        let said = self.record.unit_in_design(self.name, "mdps");
        match self.record.unit_in_file(self.name, "dph") {
            Some(unit) => format!("{said}; if deg/h, with unit = \"{unit}\""),
            None => said,
        }
    }

    pub(super) fn quantile(&self, p: f64) -> f64 {
        stats::quantile_sorted(&self.sorted, p)
    }

    pub(super) fn median(&self) -> f64 {
        self.quantile(0.5)
    }

    pub(super) fn min(&self) -> f64 {
        self.quantile(0.0)
    }

    pub(super) fn max(&self) -> f64 {
        self.quantile(1.0)
    }

    /// Count of the values for which `bad` holds, and where the first is: "on line 5".
    pub(super) fn count(&self, bad: impl Fn(f64) -> bool) -> (usize, String) {
        let mut hits = (0..self.values.len()).filter(|i| bad(self.values[*i]));
        let first = hits.next();
        (
            usize::from(first.is_some()) + hits.count(),
            first.map_or(String::new(), |row| self.record.at_place(row)),
        )
    }

    pub(super) fn warn(&self, code: &'static str, message: String) -> Option<Warning> {
        Some(Warning::on(code, self.name, message))
    }
}

/// A resonator's drive phase moves within half a turn; a phase in radians lies within a turn.
/// The quantiles keep a single glitch from passing for a wrong unit.
fn phase(c: &Column<'_>) -> Option<Warning> {
    let range = format!("{:.6} to {:.6}", c.min(), c.max());
    let largest = c.quantile(0.95).abs().max(c.quantile(0.05).abs());
    let steps = c.values.windows(2).map(|w| (w[1] - w[0]).abs());
    let wraps = steps.filter(|d| (*d - TAU).abs() < 0.25 * TAU).count();
    let span = c.quantile(0.95) - c.quantile(0.05);
    let said = |unit: &'static str| {
        format!(
            "If it is, say so: {}",
            c.record.unit_in_design("phase_rad", unit)
        )
    };
    if largest > TAU {
        return c.warn(
            "phase_in_degrees",
            format!(
                "phase_rad runs from {range}, and a full turn is 6.283 rad. It looks like degrees. {}",
                said("deg")
            ),
        );
    }
    if wraps > 0 && span > PI && c.max() - c.min() > 0.75 * TAU {
        return c.warn(
            "phase_wraps",
            format!(
                "phase_rad runs from {range} and jumps by a full turn {wraps} times. One temperature has two phases then, which \
                 no polynomial can follow. Unwrap the phase"
            ),
        );
    }
    if span > PI {
        return c.warn(
            "phase_in_degrees",
            format!(
                "phase_rad runs from {range}, and a resonator's phase moves by half a turn (3.142 rad) at most. It looks like \
                 degrees. {}",
                said("deg")
            ),
        );
    }
    let (beyond, place) = c.count(|v| v.abs() > TAU);
    if beyond > 0 {
        return c.warn(
            "phase_out_of_range",
            format!(
                "{beyond} values of phase_rad lie beyond a full turn (6.283 rad), the first {place}. Glitches bend the \
                 fit. Leave their cells empty"
            ),
        );
    }
    None
}

/// No gyro turns faster than 20 000 deg/s; 16-bit codes and millidegrees do.
fn rate(c: &Column<'_>) -> Option<Warning> {
    let name = c.name;
    let (beyond, place) = c.count(|v| v.abs() > 20_000.0);
    if beyond > 0 && 10 * beyond <= c.sorted.len() && c.quantile(0.5).abs() < LARGEST_BIAS_DPS {
        return c.warn(
            "rate_out_of_range",
            format!(
                "{beyond} values of {name} lie beyond +-20000 deg/s (range {:.1} to {:.1}), the first {place}, and no gyro turns \
                 so fast; the others are usual ones. Glitches bend the fit. Leave their cells empty",
                c.min(),
                c.max()
            ),
        );
    }
    (beyond > 0).then(|| {
        Warning::on(
            "rate_out_of_range",
            name,
            format!(
                "{beyond} values of {name} lie beyond +-20000 deg/s (range {:.1} to {:.1}), the first {place}, and no \
                 gyro turns so fast. They look like mdeg/s, deg/h or raw codes. If they are mdeg/s, say so: {}. Multiply raw codes by \
                 the gyro's scale first",
                c.min(),
                c.max(),
                c.in_smaller_unit()
            ),
        )
    })
}

/// Beyond this no gyro's bias is, deg/s: parts that are sold are specified to 60, bare ones in a laboratory reach 200.
const LARGEST_BIAS_DPS: f64 = 500.0;

/// Noise that no gyro has, deg/s/sqrt(Hz): the worst parts are specified to 0.1.
const NOISIEST_DPS_RTHZ: f64 = 3.0;

/// Differences of rows that are further apart than this are of the bias as much as of the noise, s (convention).
const LONGEST_ROW_S: f64 = 10.0;

/// No gyro that is made in silicon is quieter, deg/s/sqrt(Hz): the best are specified to ten times as much.
const QUIETEST_DPS_RTHZ: f64 = 2e-4;

/// What is quieter than this has no noise at all: a table of a formula.
const NO_NOISE_DPS_RTHZ: f64 = 3e-6;

/// Full scales of gyros, deg/s: a code of 16 bits is this over 2^15.
const FULL_SCALES_DPS: [f64; 8] = [125.0, 250.0, 300.0, 450.0, 500.0, 1000.0, 2000.0, 4000.0];

/// A gyro at rest shows its bias and its noise alone; both have a size.
fn at_rest(c: &Column<'_>) -> Option<Warning> {
    if c.record.is_of_log() || has_applied_rate(c.record) {
        return None;
    }
    let middle = c.median();
    let steps: Vec<f64> = c.record.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let period_s = stats::median(&steps);
    let noise_dps = stats::difference_noise(c.values);
    let density = noise_dps * period_s.min(1.0).sqrt();
    // Between readings that are far apart in time the bias moves as well.
    let is_noisy = period_s <= LONGEST_ROW_S && density > NOISIEST_DPS_RTHZ;
    if middle.abs() > LARGEST_BIAS_DPS || is_noisy {
        return c.warn(
            "rate_in_millidegrees",
            format!(
                "{} is about {middle:.1} deg/s with a noise of {noise_dps:.2} deg/s at rest, and no gyro has such. It looks \
                 like mdeg/s, deg/h or raw codes. If it is mdeg/s, say so: {}. Multiply raw codes by the gyro's scale first. If the \
                 gyro was turning, give the rate in rate_dps",
                c.name,
                c.in_smaller_unit()
            ),
        );
    }
    let lsb = stats::lattice_step(c.values);
    let of_gyro = |step: f64| {
        let steps = FULL_SCALES_DPS.iter().map(|fs| fs / 32_768.0);
        let near = |s: f64| (step / s - 1.0).abs() < 2e-3;
        steps.clone().any(near) || steps.map(|s| s * 1.146_88).any(near)
    };
    let by_lsb = lsb.is_some_and(|s| !of_gyro(s) && of_gyro(s.to_degrees()));
    if by_lsb || (NO_NOISE_DPS_RTHZ..QUIETEST_DPS_RTHZ).contains(&density) {
        let why = match (by_lsb, lsb) {
            (true, Some(step)) => format!(
                "moves in steps of {step}, which is a gyro's LSB in rad/s and not in deg/s",
                step = number(step, 5)
            ),
            _ => format!(
                "has a noise of {noise_dps} deg/s at rows {period_s} s apart, less than any gyro in silicon",
                noise_dps = number(noise_dps, 3)
            ),
        };
        return c.warn(
            "rate_in_radians",
            format!(
                "{} {why}. It looks like rad/s. If it is, say so: {}",
                c.name,
                c.record.unit_in_design(c.name, "rad/s")
            ),
        );
    }
    None
}

/// Whether the gyro was turned at a rate that the record has.
fn has_applied_rate(record: &ThermalRecord) -> bool {
    let applied = record.column("rate_dps").unwrap_or(&[]);
    applied.iter().any(|r| !r.is_nan() && *r != 0.0)
}

/// Rows below which whole numbers may be chance (convention).
const LEAST_COUNTED: usize = 20;

/// Whole numbers that are mostly smaller than this, deg/s, may be rates that were rounded to 1 deg/s (convention).
const LEAST_COUNT: f64 = 100.0;

/// Whole numbers of hundreds and more, none with a fraction: an output that nobody has scaled. With an applied rate the scale is
/// judged by that. Where neither the design nor the column's name states a unit, smaller whole numbers are doubted too.
fn counts(c: &Column<'_>, says_rate: bool) -> Option<Warning> {
    let named = c.record.renamed.get(c.name).filter(|_| !says_rate);
    let is_unstated = named.is_some_and(|n| units::stated(n, c.name).is_none());
    let sizes: Vec<f64> = c.sorted.iter().map(|v| v.abs()).collect();
    let is_whole = c.sorted.iter().all(|v| v.fract() == 0.0);
    let moves = c.max() > c.min();
    let is_large = match is_unstated {
        true => sizes.iter().any(|s| *s > 1.0),
        false => stats::median(&sizes) >= LEAST_COUNT,
    };
    if !(is_whole && moves && is_large && sizes.len() >= LEAST_COUNTED)
        || c.record.is_of_log()
        || has_applied_rate(c.record)
    {
        return None;
    }
    c.warn(
        "rate_in_counts",
        format!(
            "{} has whole numbers only, from {} to {}. It looks like raw counts and not like deg/s. Multiply raw counts by the gyro's \
             scale (deg/s per LSB) first. If it is mdeg/s, say so: {}{}",
            c.name,
            c.min(),
            c.max(),
            c.in_smaller_unit(),
            match is_unstated {
                true => "; if it is deg/s, unit = \"dps\"",
                false => "",
            }
        ),
    )
}

/// Smaller outputs may be bias, deg/s (convention): a zero-rate offset is some tens of deg/s at most.
const LEAST_TURNING_DPS: f64 = 100.0;

/// A bias so large moves with the temperature by more than this part of it; a constant rate does not (convention).
const STEADY_PART: f64 = 0.5;

/// A steady output that is large for a bias, in a record that does not say how the gyro was turned.
fn not_given(c: &Column<'_>) -> Option<Warning> {
    let middle = c.median().abs();
    let span = c.quantile(0.95) - c.quantile(0.05);
    let looks_turned = middle >= LEAST_TURNING_DPS && span <= STEADY_PART * middle;
    let is_given = c.record.column("rate_dps").is_some();
    if !looks_turned || is_given || c.record.is_of_log() {
        return None;
    }
    c.warn(
        "rate_not_given",
        format!(
            "no rate_dps: the gyro is taken to be at rest, and all of its output, {:.1} deg/s (median), for bias. If it was turned, \
             give the applied rate as rate_dps",
            c.median()
        ),
    )
}

/// Drive resonances lie between 1 and 200 kHz.
fn frequency(c: &Column<'_>) -> Option<Warning> {
    let (low, place) = c.count(|v| v <= 0.0);
    if low > 0 {
        return c.warn(
            "frequency_out_of_range",
            format!(
                "{low} values of freq_hz are not positive, the first {place}. No frequency is. Leave cells empty that \
                 were not measured"
            ),
        );
    }
    (c.median() < 200.0).then(|| {
        Warning::on(
            "frequency_in_kilohertz",
            c.name,
            format!(
                "freq_hz is about {:.6}, and no gyro resonates so low. It looks like kHz, or like an offset from a reference. \
                 If it is kHz, say so: {}. Add the reference to an offset",
                c.median(),
                c.record.unit_in_design(c.name, "kHz")
            ),
        )
    })
}

/// The drive gain is relative to nominal, so it is about 1; percent and codes are not.
fn gain(c: &Column<'_>) -> Option<Warning> {
    (!(0.1..=10.0).contains(&c.median())).then(|| {
        Warning::on(
            "agc_not_relative",
            c.name,
            format!(
                "agc is about {:.6}. It is the drive gain relative to its nominal value, so that about 1 is expected. Divide it \
                 by the nominal value",
                c.median()
            ),
        )
    })
}

/// Supplies are volts, below 100.
fn supply(c: &Column<'_>) -> Option<Warning> {
    let (beyond, place) = c.count(|v| !v.is_nan() && !(0.0..=100.0).contains(&v));
    (beyond > 0).then(|| {
        Warning::on(
            "supply_out_of_range",
            c.name,
            format!(
                "{beyond} values of supply_v lie outside 0 to 100 V (range {:.3} to {:.3}), the first {place}. They look \
                 like mV. If they are, say so: {}",
                c.min(),
                c.max(),
                c.record.unit_in_design(c.name, "mV")
            ),
        )
    })
}

/// Gravity in m/s^2 is 9.8, in whatever positions the gyro was put; no value lies far above it. A
/// gyro under more than 20 000 g is no gyro any more.
fn acceleration(c: &Column<'_>) -> Option<Warning> {
    let measured = c.sorted.len();
    let (gravity, _) = c.count(|v| (9.6..=10.0).contains(&v.abs()));
    let (above, _) = c.count(|v| v.abs() > 10.3);
    if 5 * gravity >= measured && 100 * above <= measured {
        return c.warn(
            "acceleration_in_m_per_s2",
            format!(
                "accel_g is about 9.8 in {gravity} of {measured} rows and hardly ever more. It looks like gravity in m/s^2. If \
                 it is, say so: {}",
                c.record.unit_in_design(c.name, "m/s^2")
            ),
        );
    }
    let (beyond, place) = c.count(|v| v.abs() > 20_000.0);
    (beyond > 0).then(|| {
        Warning::on(
            "acceleration_out_of_range",
            c.name,
            format!(
                "{beyond} values of accel_g lie beyond 20000 g, the first {place}. No gyro survives that. Check the \
                 unit, and leave cells of glitches empty"
            ),
        )
    })
}

#[cfg(test)]
#[path = "plausibility_tests.rs"]
mod tests;
