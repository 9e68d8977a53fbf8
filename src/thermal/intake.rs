//! A record as candidates see it: which column is the thermometer, and what its readings are in degC.

use super::adc_rows;
use super::baseline;
use super::channels::Channels;
use super::holes;
use super::quadrature;
use super::quantised::{self, Course};
use super::repeated;
use crate::design::{Design, Gyro, RecordMapping};
use crate::error::{InputError, Result};
use crate::record::columns::THERMOMETERS;
use crate::record::thermal::ENOUGH_ROWS;
use crate::record::{ThermalRecord, Warning, condensed};
use crate::statistics::blocks::{Role, Split};
use crate::statistics::stats;
use crate::statistics::weights;
use crate::text::number;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The bias model's thermometer in a record, if it has one: the first in the contract's order that has at least half as many
/// readings as any other (a column that is nearly empty is none).
///
/// # Errors
/// The design names one that is not there.
fn thermometer(record: &ThermalRecord, mapping: &RecordMapping) -> Result<Option<String>> {
    match &mapping.thermometer {
        Some(name) if record.column(name).is_none() => {
            let has: Vec<&str> = record.columns.keys().map(String::as_str).collect();
            Err(mapping.lacks_thermometer(name, &record.source, &has).into())
        }
        Some(name) => Ok(Some(name.clone())),
        None => {
            let most = THERMOMETERS.map(|t| record.measured(t)).into_iter().max();
            let enough = |t: &&str| {
                let measured = record.measured(t);
                measured > 0 && 2 * measured >= most.unwrap_or(0)
            };
            Ok(THERMOMETERS.into_iter().find(enough).map(str::to_owned))
        }
    }
}

/// Temperatures that a gyro may have, degC.
const TEMPERATURES_DEGC: (f64, f64) = (-100.0, 250.0);

/// Temperature of the declared gyro at a reading of its phase (rad) or frequency (Hz), degC: the
/// resonance's law linearised at the reference temperature (eq. 1 to 8 of the seed paper), where it
/// stands at `nominal` (-pi/2 rad, or the drive frequency).
fn degc_of(gyro: &Gyro, thermometer: &str, nominal: f64, reading: f64) -> f64 {
    let per_k = gyro.stiffness_tempco_per_k.abs();
    let slope = if thermometer == "freq_hz" {
        -0.5 * per_k * nominal
    } else {
        -gyro.drive_q * per_k + gyro.electronics.phase_slope_rad_per_k
    };
    gyro.reference_temperature_k - 273.15 + (reading - nominal) / slope
}

/// What the thermometer shows at the reference temperature: as the design says, or, if the record is of
/// another gyro, the middle of its readings. The second: whether temperatures are known.
fn nominal(gyro: &Gyro, thermometer: &str, readings: &[f64]) -> (f64, bool) {
    let declared = match thermometer {
        "freq_hz" => gyro.drive_frequency_hz,
        _ => -std::f64::consts::FRAC_PI_2,
    };
    let (low, high) = stats::extremes(readings).unwrap_or((declared, declared));
    let middle = 0.5 * (low + high);
    let (coldest, hottest) = TEMPERATURES_DEGC;
    if (coldest..=hottest).contains(&degc_of(gyro, thermometer, declared, middle)) {
        return (declared, true);
    }
    (middle, false)
}

/// A record that cannot be fitted; in the design, where an `average_s` of it leaves few rows.
pub fn refused(
    record: &ThermalRecord,
    mapping: &RecordMapping,
    why: String,
) -> crate::error::Error {
    let few = record.len() < ENOUGH_ROWS;
    if let (true, Some(average_s), Some(place)) =
        (few, joined(record, mapping), &mapping.average_at)
    {
        let span = record.time_s.first().zip(record.time_s.last());
        let span_s = span.map_or(0.0, |(first, last)| last - first) + average_s;
        return InputError::new(format!(
            "{why}. average_s = {average_s} s leaves {} rows of the record {}, which is about {} s long",
            record.len(),
            record.source.display(),
            number(span_s, 3)
        ))
        .at_position(place)
        .help(format!(
            "average_s = {} or less leaves {ENOUGH_ROWS} rows or more; or record longer",
            number((span_s - average_s) / ENOUGH_ROWS as f64, 2)
        ))
        .into();
    }
    let help = match few {
        true => format!("record {ENOUGH_ROWS} rows or more, or average less"),
        false => "record longer, or average less".to_owned(),
    };
    InputError::new(why)
        .in_file(&record.source)
        .help(help)
        .into()
}

/// The design's `average_s`, if it joined rows of the file.
fn joined(record: &ThermalRecord, mapping: &RecordMapping) -> Option<f64> {
    let lines = record.lines.first().zip(record.lines.last());
    let lines = lines.map_or(0, |(first, last)| last - first);
    // A row stands for two lines or more. A log has no lines.
    let is_joined = record.is_of_log() || lines + 2 >= 2 * record.len();
    mapping.average_s.filter(|_| is_joined)
}

/// The record without readings of a thermometer that are glitches, with what is said of them; `None`: it has none. One such
/// reading sets the range that the declared bias is scaled to, and looks like whatever is narrow in temperature.
fn without_glitches(record: &ThermalRecord) -> Option<(ThermalRecord, Vec<Warning>)> {
    let mut out: Option<(ThermalRecord, Vec<Warning>)> = None;
    for name in THERMOMETERS {
        let Some(column) = record.column(name) else {
            continue;
        };
        let measured: Vec<usize> = (0..column.len())
            .filter(|i| column[*i].is_finite())
            .collect();
        let readings: Vec<f64> = measured.iter().map(|i| column[*i]).collect();
        let marks = weights::thermometer_glitches(&readings);
        let marked = measured.iter().zip(marks).filter(|(_, glitch)| *glitch);
        let rows: Vec<usize> = marked.map(|(row, _)| *row).collect();
        if rows.is_empty() {
            continue;
        }
        let (cleaned, said) = out.get_or_insert_with(|| (record.clone(), Vec::new()));
        if let Some(column) = cleaned.columns.get_mut(name) {
            rows.iter().for_each(|row| column[*row] = f64::NAN);
        }
        said.push(baseline::glitches(record, name, &rows));
    }
    out
}

/// A record taken in: shortened where it is long, without glitches of its thermometer, as channels.
pub struct Intake<'a> {
    /// The rows that are closed.
    pub record: Cow<'a, ThermalRecord>,
    /// As the search and all that comes before it see them: without the output of the rows that judge.
    pub channels: Channels,
    /// What each row is for.
    pub split: Split,
    /// Output less applied rate of every row, deg/s, NaN where not measured: for the error of the answer alone.
    pub error_dps: Vec<f64>,
    /// What is said of the record, in order.
    pub warnings: Vec<Warning>,
}

impl<'a> Intake<'a> {
    /// Takes a record in; `warnings` are what its reader said of it.
    ///
    /// # Errors
    /// No thermometer of the name that the design gives; a column without a reading; too few rows.
    pub fn of(
        record: &'a ThermalRecord,
        design: &Design,
        mut warnings: Vec<Warning>,
    ) -> Result<Self> {
        let mut record = Cow::Borrowed(record);
        if let Some((short, said)) = condensed(&record) {
            warnings.push(said);
            record = Cow::Owned(short);
        }
        if let Some((cleaned, said)) = without_glitches(&record) {
            warnings.extend(said);
            record = Cow::Owned(cleaned);
        }
        let (channels, split, error_dps) = channels_of(&record, design, &mut warnings)?;
        Ok(Intake {
            record,
            channels,
            split,
            error_dps,
            warnings,
        })
    }

    /// The channels with the output of the rows that judge as well.
    pub fn whole(&self) -> Channels {
        Channels {
            error_dps: self.error_dps.clone(),
            ..self.channels.clone()
        }
    }
}

/// Takes the output out of the rows that judge. What it was in every row, and what each row is for, which the output has no say in.
fn hide_judges(columns: &mut BTreeMap<String, Vec<f64>>, split: Split) -> (Vec<f64>, Split) {
    let whole = columns.get("rate_out_dps").cloned().unwrap_or_default();
    let rows = whole.iter().zip(&split.roles);
    let split = match rows
        .clone()
        .any(|(o, r)| *r == Role::Judge && o.is_finite())
    {
        true => split,
        false => split.without_judges(),
    };
    let output = columns.get_mut("rate_out_dps").into_iter().flatten();
    let judging = output.zip(&split.roles).filter(|(_, r)| **r == Role::Judge);
    judging.for_each(|(o, _)| *o = f64::NAN);
    (whole, split)
}

/// A record as candidates see it, what each row is for, and output less applied rate of every row, deg/s.
///
/// # Errors
/// No thermometer of the name that the design gives; a column that is needed and holds no value; too few rows.
fn channels_of(
    record: &ThermalRecord,
    design: &Design,
    warnings: &mut Vec<Warning>,
) -> Result<(Channels, Split, Vec<f64>)> {
    let name = thermometer(record, &design.record)?;
    let mut columns = record.columns.clone();
    let name = name.unwrap_or_else(|| {
        let has: Vec<&str> = record.columns.keys().map(String::as_str).collect();
        let line = baseline::line_of_thermometer(&has).filter(|_| !record.is_of_log());
        let help = match line {
            Some(line) => {
                format!(". If this column is one, add to [record.columns] of the design: {line}")
            }
            None if record.is_of_log() => String::new(),
            None => ". If one of its columns is one, add to [record.columns] of the design: die_degc = { column = \"NAME_IN_THE_FILE\", \
                     unit = \"degC\" }"
                .to_owned(),
        };
        let said = format!(
            "the record has no thermometer: the polynomial is a constant, and effects of temperature cannot be seen{help}"
        );
        warnings.push(Warning::general("no_thermometer", said));
        columns.insert(NONE.to_owned(), vec![0.0; record.len()]);
        NONE.to_owned()
    });
    warnings.extend(holes::take(record, &mut columns, &name));
    let readings = columns.get(&name).map_or(&[][..], Vec::as_slice);
    let (nominal, known) = nominal(&design.gyro, &name, readings);
    let told_in_degc = ["die_degc", "chamber_degc"].map(|t| columns.contains_key(t));
    if !known && !told_in_degc.contains(&true) && ["phase_rad", "freq_hz"].contains(&name.as_str())
    {
        let degc = design.gyro.reference_temperature_k - 273.15;
        warnings.push(Warning::general(
            "temperature_unknown",
            format!(
                "{name} around {nominal} is not that of the design's gyro: temperatures are counted from there \
                 as if it were {degc:.2} degC; name the gyro's drive frequency and law in the design"
            ),
        ));
    }
    let degc = |reading: f64| degc_of(&design.gyro, &name, nominal, reading);
    let seen = |columns: &BTreeMap<String, Vec<f64>>| {
        let made = Channels::new(&record.time_s, columns, &name, degc);
        made.map_err(|missing| {
            refused(
                record,
                &design.record,
                format!("column {missing} holds no measured value"),
            )
        })
    };
    let split = seen(&columns)?.split();
    let split = split.map_err(|e| refused(record, &design.record, e.to_string()))?;
    let (mut whole, split) = hide_judges(&mut columns, split);
    let mut channels = seen(&columns)?;
    let step_u = quantised::step_u(&channels);
    if let Some(course) = repeated::course(&channels) {
        warnings.push(behind(&name, &course));
        columns.insert(name.clone(), course.reading);
        channels = seen(&columns)?;
    } else if let Some(course) = quantised::course(&channels, design) {
        warnings.push(rounding(design, &name, &course));
        columns.insert(name.clone(), course.reading);
        channels = seen(&columns)?;
    }
    let mut rounding_dps = 0.0;
    if let Some(undithered) = adc_rows::found((&columns, &whole), &channels, design, seen)? {
        warnings.push(undithered.warning(design));
        rounding_dps = undithered.left_dps();
        if let Some(removed) = undithered.removed {
            channels = seen(&removed.columns)?;
            (columns, whole) = (removed.columns, removed.output_dps);
        }
    }
    if let Some(said) = quadrature::contains_output(&channels) {
        warnings.push(said);
        columns.remove(quadrature::NAME);
        channels = seen(&columns)?;
    }
    columns.insert("rate_out_dps".to_owned(), whole);
    let error_dps = seen(&columns)?.error_dps;
    let channels = Channels {
        rounding_dps,
        step_u,
        ..channels
    };
    Ok((channels, split, error_dps))
}

/// What is said of a thermometer that is read less often than the output.
fn behind(thermometer: &str, course: &repeated::Course) -> Warning {
    let said = format!(
        "{thermometer} has a new reading every {:.1} rows and repeats it in between. What the repeated ones are behind by \
         makes {} deg/s rms of the polynomial. It is taken out before and after (causes are sought along straight lines \
         between new readings), but the firmware's error contains it. Read the thermometer as often as the output",
        course.rows,
        number(course.artefact_rms_dps, 3)
    );
    Warning::on("thermometer_repeats", thermometer, said)
}

/// What is said of a thermometer that is read in coarse steps.
fn rounding(design: &Design, thermometer: &str, course: &Course) -> Warning {
    let of_circuit = match quantised::predicted(design, thermometer) {
        Some(step) if quantised::LIKE.contains(&(course.step / step)) => {
            format!(
                ", as the design's circuit predicts ({step})",
                step = number(step, 3)
            )
        }
        _ => String::new(),
    };
    let said = format!(
        "{thermometer} is read in steps of {}{of_circuit}: their rounding makes {} deg/s rms of the \
         polynomial. It is taken out before and after (causes are sought along the course between the steps); the \
         firmware's error contains it: read the thermometer with more bits",
        number(course.step, 3),
        number(course.artefact_rms_dps, 3)
    );
    Warning::on("thermometer_quantised", thermometer, said)
}

/// Stands for the thermometer where there is none.
const NONE: &str = "no_thermometer";
