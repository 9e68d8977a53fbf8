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

/// Hotter than any die: silicon thermometers read up to 250 degC. No reading in kelvin is below the second.
const NO_DIE_DEGC: f64 = 250.0;
const COLDEST_K: f64 = 150.0;

/// Refuses a thermometer in degC that half of the record's rows put where no die can be: firmware would take its
/// readings for degC. Columns beside it are only warned of ([`temperature`]).
///
/// # Errors
/// Such a column, where its unit is declared: in the design, or in the header.
pub(super) fn refuse(
    record: &ThermalRecord,
    header: Line<'_>,
    roles: &Roles,
    mapping: &RecordMapping,
) -> Result<()> {
    for name in ["die_degc", "chamber_degc"] {
        let sorted = stats::sorted(record.column(name).unwrap_or(&[]));
        let quantile = |p: f64| stats::quantile_sorted(&sorted, p);
        let is_kelvin = !sorted.is_empty()
            && (NO_DIE_DEGC..=450.0).contains(&quantile(0.5))
            && quantile(0.05) > COLDEST_K;
        if !is_kelvin {
            continue;
        }
        let message = format!(
            "{name} runs from {:.2} to {:.2} degC, and no die is at {NO_DIE_DEGC} degC and more in half of the rows: it looks like \
             kelvin (K)",
            quantile(0.0),
            quantile(1.0)
        );
        let help = format!("say the unit: {}", record.unit_in_design(name, "K"));
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
    let celsius = |v: f64| (v - 32.0) / 1.8;
    let (low, high) = (c.quantile(0.05), c.quantile(0.95));
    if high > HOTTEST_DEGC && celsius(high) < 100.0 && celsius(low) > -60.0 {
        return c.warn(
            "temperature_in_fahrenheit",
            format!(
                "{name} runs from {range}, where no gyro is rated beyond 125 degC and few are heated beyond {HOTTEST_DEGC}. It \
                 looks like Fahrenheit ({:.1} to {:.1} degC). {}",
                celsius(c.min()),
                celsius(c.max()),
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
