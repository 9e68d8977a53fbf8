//! Temperatures that are unlikely to be in degC: other units, raw codes.

use super::cells;
use super::columns::{self, Line, Roles};
use super::plausibility::Column;
use super::thermal_record::ThermalRecord;
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use crate::statistics::stats;

/// Hotter than a gyro is, as a rule, degC: industrial parts end at 85, and heat themselves by some kelvin.
const HOTTEST_DEGC: f64 = 105.0;

/// No die of a gyro is hotter for long, degC: parts are rated to 125 at most, and heat themselves by less than 15 K.
const NO_GYRO_DEGC: f64 = 140.0;

/// Hotter than any die: silicon thermometers read up to 250 degC. No reading in kelvin is below the second.
const NO_DIE_DEGC: f64 = 250.0;
const COLDEST_K: f64 = 150.0;

/// Refuses a thermometer in degC whose readings put the gyro where none works and are usual ones in another unit:
/// firmware would take them for degC. Where the design states the unit, and of columns beside it, there is a warning
/// ([`temperature`]).
///
/// # Errors
/// Such a column, where it is declared: in the design, or in the header.
pub(super) fn refuse(
    record: &ThermalRecord,
    header: Line<'_>,
    roles: &Roles,
    mapping: &RecordMapping,
) -> Result<()> {
    for name in ["die_degc", "chamber_degc"] {
        let sorted = stats::sorted(record.column(name).unwrap_or(&[]));
        if sorted.is_empty() || mapping.units.contains_key(name) {
            continue;
        }
        let quantile = |p: f64| stats::quantile_sorted(&sorted, p);
        let (low, high) = (quantile(0.05), quantile(0.95));
        let (why, like, unit) = if (NO_DIE_DEGC..=450.0).contains(&quantile(0.5)) && low > COLDEST_K
        {
            let why = format!("no die is at {NO_DIE_DEGC} degC and more in half of the rows");
            (why, "kelvin (K)", "K")
        } else if high > NO_GYRO_DEGC && is_fahrenheit(low, high) {
            let why = format!("no gyro works above {NO_GYRO_DEGC} degC in a twentieth of the rows");
            (why, "Fahrenheit (degF)", "degF")
        } else {
            continue;
        };
        let message = format!(
            "{name} runs from {:.2} to {:.2} degC, and {why}: it looks like {like}",
            quantile(0.0),
            quantile(1.0)
        );
        let help = format!(
            "say the unit: {}; if it is degC all the same, state that: {}",
            record.unit_in_design(name, unit),
            record.unit_in_design(name, "degC")
        );
        if mapping.places.contains_key(name) {
            return Err(columns::in_design(header, mapping, name, message, help).into());
        }
        let cells = cells::split(header.text).unwrap_or_default();
        let cell = roles.index_of(name).and_then(|k| cells.get(k));
        return Err(header
            .error(cell.map_or(1, |c| c.column), message, help)
            .into());
    }
    Ok(())
}

fn celsius_of_fahrenheit(v: f64) -> f64 {
    (v - 32.0) / 1.8
}

/// Whether readings between these are a gyro's in Fahrenheit, and too hot for one, as a rule, in degC.
fn is_fahrenheit(low: f64, high: f64) -> bool {
    let celsius = celsius_of_fahrenheit;
    high > HOTTEST_DEGC && celsius(high) < 100.0 && celsius(low) > -60.0
}

/// Temperatures in Celsius: a median of 200 to 450 is a Kelvin reading of -73 to 177 degC; no
/// silicon thermometer reads outside -100 to 250 degC.
pub(super) fn temperature(c: &Column<'_>) -> Option<Warning> {
    let name = c.name;
    let range = format!("{:.2} to {:.2}", c.min(), c.max());
    let said =
        |unit: &'static str| format!("If it is, say so: {}", c.record.unit_in_design(name, unit));
    if (200.0..=450.0).contains(&c.median()) && c.quantile(0.05) > 150.0 {
        return c.warn(
            "temperature_in_kelvin",
            format!(
                "{name} runs from {range}. It looks like kelvin. {}",
                said("K")
            ),
        );
    }
    let (low, high) = (c.quantile(0.05), c.quantile(0.95));
    if is_fahrenheit(low, high) {
        return c.warn(
            "temperature_in_fahrenheit",
            format!(
                "{name} runs from {range}, where no gyro is rated beyond 125 degC and few are heated beyond {HOTTEST_DEGC}. It \
                 looks like Fahrenheit ({:.1} to {:.1} degC). {}",
                celsius_of_fahrenheit(c.min()),
                celsius_of_fahrenheit(c.max()),
                said("degF")
            ),
        );
    }
    let (beyond, place) = c.count(|v| !v.is_nan() && !(-100.0..=250.0).contains(&v));
    // Most of them: whole hundredths or thousandths of a degree, that a gyro may have.
    let scaled = [(100.0, "cdegC"), (1000.0, "mdegC")]
        .into_iter()
        .find(|(times, _)| {
            let (low, high) = (low / times, high / times);
            -60.0 < low && high < HOTTEST_DEGC && high - low < 150.0 && high > 15.0
        });
    if let Some((times, unit)) = scaled.filter(|_| c.median().abs() > 250.0) {
        return c.warn(
            "temperature_out_of_range",
            format!(
                "{name} runs from {range}. It looks like degrees times {times} ({:.1} to {:.1} degC). {}. Convert raw codes by \
                 the thermometer's law first",
                c.min() / times,
                c.max() / times,
                said(unit)
            ),
        );
    }
    if beyond > 0 {
        return c.warn(
            "temperature_out_of_range",
            format!(
                "{beyond} values of {name} lie outside -100 to 250 degC (range {range}), the first {place}. They are \
                 glitches, or raw codes, or in another unit. Leave cells of glitches empty, or say the unit in \
                 [record.columns]"
            ),
        );
    }
    None
}
