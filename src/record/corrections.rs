//! Corrections that an autopilot had applied before it logged the rate, as its parameters tell.
//!
//! PX4 subtracts, from what `vehicle_imu` and `sensor_combined` hold, a cubic in the temperature (`TC_Gn_X0` .. `X3`, about
//! `TC_Gn_TREF`, between `TMIN` and `TMAX`) and a learnt offset (`CAL_GYROn_XOFF`). ArduPilot subtracts, from what `IMU`
//! holds, a cubic without a constant (`INS_TCALn_GYR1` .. `GYR3`, in 1e-6 rad/s, about 35 degC), less its value at the
//! temperature at which the offset was learnt (`INS_GYRn_CALTEMP`). Written from the public descriptions of both.

use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::error::{InputError, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// degC that ArduPilot's cubic counts from.
const ARDUPILOT_REFERENCE_DEGC: f64 = 35.0;

/// Beginnings of the names that are kept.
const KEPT: [&str; 6] = [
    "TC_G",
    "CAL_GYRO",
    "IMU_GYRO_CAL_EN",
    "SENS_BOARD_ROT",
    "INS_TCAL",
    "INS_GYR",
];

/// Parameters of a log, each with its values in their order.
#[derive(Debug, Default)]
pub(super) struct Parameters {
    /// (us since power-on, value); only changes.
    values: BTreeMap<String, Vec<(u64, f64)>>,
}

impl Parameters {
    /// Takes a parameter that a message says.
    pub(super) fn set(&mut self, name: &str, time_us: u64, value: f64) {
        if !KEPT.iter().any(|k| name.starts_with(k)) || !value.is_finite() {
            return;
        }
        let values = self.values.entry(name.to_owned()).or_default();
        if values.last().is_none_or(|(_, last)| *last != value) {
            values.push((time_us, value));
        }
    }

    /// The value that it had last.
    pub(super) fn last(&self, name: &str) -> Option<f64> {
        Some(self.values.get(name)?.last()?.1)
    }

    fn all(&self, name: &str) -> &[(u64, f64)] {
        self.values.get(name).map_or(&[], Vec::as_slice)
    }

    /// "NAME = 1 (from the start)", if it ever was one of these values.
    fn on(&self, name: &str, values: &[f64]) -> Option<String> {
        let (time_us, value) = self.all(name).iter().find(|(_, v)| values.contains(v))?;
        let first = self.all(name).first() == Some(&(*time_us, *value));
        let when = match first {
            true => "from the start".to_owned(),
            false => format!("from {:.1} s since power-on", *time_us as f64 * 1e-6),
        };
        Some(format!("{name} = {value} ({when})"))
    }

    /// Where it changes: us since power-on, before and after.
    fn changes(&self, name: &str) -> impl Iterator<Item = (u64, f64, f64)> + '_ {
        let values = self.all(name).windows(2);
        values.map(|w| (w[1].0, w[0].1, w[1].1))
    }
}

/// A cubic in the temperature that was subtracted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Undo {
    /// deg/s per K^k, lowest first.
    coefficients_dps: [f64; 4],
    reference_degc: f64,
    range_degc: (f64, f64),
    /// deg/s that were added beside it.
    added_dps: f64,
    /// The parameters that it is from.
    name: String,
}

impl Undo {
    fn at(&self, degc: f64) -> f64 {
        let limited = degc.max(self.range_degc.0).min(self.range_degc.1);
        let t = limited - self.reference_degc;
        let [a, b, c, d] = self.coefficients_dps;
        a + (b + (c + d * t) * t) * t
    }

    /// Adds what was subtracted to every row.
    ///
    /// # Errors
    /// A record without a temperature.
    pub(super) fn take_off(&self, record: &mut ThermalRecord, path: &Path) -> Result<Warning> {
        let Some(degc) = record.column("die_degc").map(<[f64]>::to_vec) else {
            return Err(InputError::new(format!(
                "the correction by {} cannot be taken off: the log has no temperature of its gyro",
                self.name
            ))
            .in_file(path)
            .help("leave --undo-correction out, or log the temperature")
            .into());
        };
        let mut largest = 0.0f64;
        if let Some(rate) = record.columns.get_mut("rate_out_dps") {
            for (rate, degc) in rate.iter_mut().zip(degc) {
                let off = self.at(degc) - self.added_dps;
                *rate += off;
                largest = largest.max(off.abs());
            }
        }
        Ok(Warning::on(
            "correction_undone",
            "rate_out_dps",
            format!(
                "the temperature correction of {} was taken off again: up to {largest:.4} deg/s",
                self.name
            ),
        ))
    }
}

/// What the parameters say of the gyro that was chosen.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub undo: Option<Undo>,
    /// Offsets that were learnt anew: us since power-on, why, and by what the output then changes, deg/s.
    pub cuts: Vec<(u64, String, f64)>,
    pub warnings: Vec<Warning>,
}

/// The gyro and the source that a record is of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chosen<'a> {
    /// Its number in the log.
    pub number: u32,
    /// PX4's `device_id`.
    pub id: Option<u32>,
    /// 0, 1 or 2.
    pub axis: usize,
    /// What the rate is taken from.
    pub source: &'a str,
    /// Whether that is what the driver gave, before any correction.
    pub raw: bool,
    /// Whether a correction is to be taken off.
    pub undo: bool,
    pub path: &'a Path,
}

impl Chosen<'_> {
    fn refuse(&self, what: String) -> crate::error::Error {
        InputError::new(what)
            .in_file(self.path)
            .help("leave --undo-correction out, or calibrate from a log that was recorded with the correction off")
            .into()
    }

    fn letter(&self) -> &'static str {
        ["X", "Y", "Z"].get(self.axis).copied().unwrap_or("Z")
    }
}

/// What is fitted where a correction was on.
const AFTER: &str = "what is fitted is what that left, not the gyro's own bias";

/// PX4's corrections.
///
/// # Errors
/// A correction that is to be taken off and cannot be.
pub(super) fn px4(p: &Parameters, of: Chosen<'_>) -> Result<Found> {
    let mut found = Found::default();
    let said = |what: &str| match of.raw {
        true => format!(
            "{what}; {} is the driver's own output, before it",
            of.source
        ),
        false => format!("{what}, and {} is after it: {AFTER}", of.source),
    };
    let own = of.id.and_then(|id| {
        let is_own = |n: &u32| p.last(&format!("TC_G{n}_ID")) == Some(f64::from(id));
        (0..4).find(is_own)
    });
    let n = own.unwrap_or(of.number);
    if let Some(on) = p.on("TC_G_ENABLE", &[1.0]) {
        let undo = px4_cubic(p, n, of.axis).filter(|_| !of.raw);
        let hint = match (&undo, of.raw, of.undo) {
            (Some(_), _, false) => {
                format!(". TC_G{n}_* stand in the log: --undo-correction takes it off")
            }
            (None, false, _) => {
                ". The log does not hold its coefficients (TC_Gn_X0_0 and the like)".to_owned()
            }
            _ => String::new(),
        };
        if of.undo && !of.raw {
            let turned = ["SENS_BOARD_ROT".to_owned(), format!("CAL_GYRO{n}_ROT")];
            let turned = turned.iter().find(|r| p.last(r).is_some_and(|v| v > 0.0));
            if let Some(name) = turned {
                return Err(of.refuse(format!(
                    "the correction TC_G{n} is of the sensor's own axes, and the log's axes are turned ({name})"
                )));
            }
            if undo.is_none() {
                return Err(of.refuse(format!(
                    "{on}, and the log does not hold the coefficients of gyro {n}: the correction cannot be taken off"
                )));
            }
            found.undo = undo;
        }
        found.warnings.push(Warning::on(
            "correction_on",
            "rate_out_dps",
            said(&format!("{on}: PX4 corrected the gyro by its temperature")) + &hint,
        ));
    }
    if let Some(on) = p.on("IMU_GYRO_CAL_EN", &[1.0]) {
        found.warnings.push(Warning::on(
            "correction_on",
            "rate_out_dps",
            said(&format!(
                "{on}: PX4 learns the gyro's offset anew whenever the vehicle rests"
            )),
        ));
    }
    let calibrated = of.id.and_then(|id| {
        let is_own = |n: &u32| p.last(&format!("CAL_GYRO{n}_ID")) == Some(f64::from(id));
        (0..4).find(is_own)
    });
    let name = format!(
        "CAL_GYRO{}_{}OFF",
        calibrated.unwrap_or(of.number),
        of.letter()
    );
    found.cuts.extend(learnt(p, &name, 1.0));
    Ok(found)
}

fn px4_cubic(p: &Parameters, n: u32, axis: usize) -> Option<Undo> {
    let value = |name: &str| p.last(&format!("TC_G{n}_{name}"));
    let of = |k: usize| value(&format!("X{k}_{axis}"));
    if (0..4).all(|k| of(k).is_none()) {
        return None;
    }
    let degrees = |k: usize| of(k).unwrap_or(0.0).to_degrees();
    Some(Undo {
        coefficients_dps: [degrees(0), degrees(1), degrees(2), degrees(3)],
        reference_degc: value("TREF").unwrap_or(25.0),
        range_degc: (value("TMIN").unwrap_or(0.0), value("TMAX").unwrap_or(100.0)),
        added_dps: 0.0,
        name: format!("TC_G{n}"),
    })
}

/// ArduPilot's corrections.
///
/// # Errors
/// A correction that is to be taken off and cannot be.
pub(super) fn ardupilot(p: &Parameters, of: Chosen<'_>) -> Result<Found> {
    let mut found = Found::default();
    let n = of.number + 1;
    let tcal = match n {
        ..=3 => format!("INS_TCAL{n}"),
        _ => format!("INS{n}_TCAL"),
    };
    let enable = format!("{tcal}_ENABLE");
    if let Some(on) = p.on(&enable, &[1.0]) {
        let undo = ardupilot_cubic(p, &tcal, n, of.letter());
        if of.undo && undo.is_none() {
            return Err(of.refuse(format!(
                "{on}, and the log does not hold {tcal}_GYR1_{}: the correction cannot be taken off",
                of.letter()
            )));
        }
        let hint = match (&undo, of.undo) {
            (Some(_), false) => format!(
                ". {tcal}_GYR1_{} and the like stand in the log: --undo-correction takes it off",
                of.letter()
            ),
            (None, _) => format!(
                ". The log does not hold its coefficients ({tcal}_GYR1_{})",
                of.letter()
            ),
            _ => String::new(),
        };
        found.undo = undo.filter(|_| of.undo);
        found.warnings.push(Warning::on(
            "correction_on",
            "rate_out_dps",
            format!(
                "{on}: ArduPilot corrected the gyro by its temperature, and {} is after it: {AFTER}{hint}",
                of.source
            ),
        ));
    }
    let changes = p.changes(&enable);
    found.cuts.extend(changes.map(|(time, from, to)| {
        (
            time,
            format!(
                "{enable} changes from {from} to {to} at {:.1} s",
                time as f64 * 1e-6
            ),
            f64::NAN,
        )
    }));
    let number = if n == 1 { String::new() } else { n.to_string() };
    let name = format!("INS_GYR{number}OFFS_{}", of.letter());
    found.cuts.extend(learnt(p, &name, 1.0));
    Ok(found)
}

fn ardupilot_cubic(p: &Parameters, tcal: &str, n: u32, letter: &str) -> Option<Undo> {
    let of = |k: usize| p.last(&format!("{tcal}_GYR{k}_{letter}"));
    if (1..=3).all(|k| of(k).is_none()) {
        return None;
    }
    let degrees = |k: usize| (1e-6 * of(k).unwrap_or(0.0)).to_degrees();
    let mut undo = Undo {
        coefficients_dps: [0.0, degrees(1), degrees(2), degrees(3)],
        reference_degc: ARDUPILOT_REFERENCE_DEGC,
        range_degc: (
            p.last(&format!("{tcal}_TMIN")).unwrap_or(0.0),
            p.last(&format!("{tcal}_TMAX")).unwrap_or(70.0),
        ),
        added_dps: 0.0,
        name: tcal.to_owned(),
    };
    undo.added_dps = p
        .last(&format!("INS_GYR{n}_CALTEMP"))
        .map_or(0.0, |degc| undo.at(degc));
    Some(undo)
}

/// Where an offset in rad/s was learnt anew.
fn learnt<'a>(
    p: &'a Parameters,
    name: &'a str,
    sign: f64,
) -> impl Iterator<Item = (u64, String, f64)> + 'a {
    p.changes(name).map(move |(time, from, to)| {
        let said = format!(
            "{name} changes from {from} to {to} rad/s at {:.1} s since power-on",
            time as f64 * 1e-6
        );
        (time, said, -sign * (to - from).to_degrees())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_those_of_the_autopilots() {
        let mut p = Parameters::default();
        for (name, value) in [
            ("TC_G1_X0_2", 0.01),
            ("TC_G1_X1_2", 1e-4),
            ("TC_G1_X3_2", 1e-7),
            ("TC_G1_TREF", 40.0),
            ("TC_G1_TMIN", 10.0),
            ("TC_G1_TMAX", 60.0),
            ("INS_TCAL2_GYR1_X", 123.0),
            ("INS_TCAL2_GYR2_X", -4.0),
            ("INS_TCAL2_TMIN", 0.0),
            ("INS_TCAL2_TMAX", 70.0),
            ("INS_GYR2_CALTEMP", 30.0),
        ] {
            p.set(name, 0, value);
        }
        let px4 = px4_cubic(&p, 1, 2).unwrap();
        let expected = |t: f64| (0.01 + 1e-4 * t + 1e-7 * t * t * t).to_degrees();
        for (degc, t) in [(50.0, 10.0), (80.0, 20.0), (-5.0, -30.0)] {
            assert!((px4.at(degc) - expected(t)).abs() < 1e-12);
        }
        assert!(px4_cubic(&p, 1, 0).is_none() && px4_cubic(&p, 0, 2).is_none());
        let of = ardupilot_cubic(&p, "INS_TCAL2", 2, "X").unwrap();
        let expected = |t: f64| (1e-6 * (123.0 * t - 4.0 * t * t)).to_degrees();
        assert!((of.at(55.0) - expected(20.0)).abs() < 1e-12);
        assert!((of.added_dps - expected(-5.0)).abs() < 1e-12);
    }

    #[test]
    fn only_changes_count_and_say_when() {
        let mut p = Parameters::default();
        for (time, value) in [(5, 0.01), (9, 0.01), (2_000_000, 0.02)] {
            p.set("INS_GYROFFS_Z", time, value);
        }
        p.set("BAT_CAPACITY", 5, 1.0);
        assert_eq!(p.last("BAT_CAPACITY"), None);
        let cuts: Vec<_> = learnt(&p, "INS_GYROFFS_Z", 1.0).collect();
        let [(time, said, step)] = &cuts[..] else {
            panic!("{cuts:?}")
        };
        assert_eq!(*time, 2_000_000);
        assert!(
            said.contains("from 0.01 to 0.02") && said.contains("2.0 s"),
            "{said}"
        );
        assert!((step + 0.01f64.to_degrees()).abs() < 1e-12);
        p.set("TC_G_ENABLE", 7, 0.0);
        p.set("TC_G_ENABLE", 3_000_000, 1.0);
        let on = p.on("TC_G_ENABLE", &[1.0]).unwrap();
        assert!(
            on.contains("TC_G_ENABLE = 1") && on.contains("3.0 s"),
            "{on}"
        );
    }
}
