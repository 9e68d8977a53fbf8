//! Corrections that an autopilot had applied before it logged the rate, as its parameters tell.
//!
//! PX4 subtracts, from what `vehicle_imu` and `sensor_combined` hold, a cubic in the temperature (`TC_Gn_X0` .. `X3`, about
//! `TC_Gn_TREF`, between `TMIN` and `TMAX`) and a learnt offset (`CAL_GYROn_XOFF`). ArduPilot subtracts, from what `IMU`
//! holds, a cubic without a constant (`INS_TCALn_GYR1` .. `GYR3`, in 1e-6 rad/s, about 35 degC), less its value at the
//! temperature at which the offset was learnt (`INS_GYRn_CALTEMP`). Written from the public descriptions of both.

use super::parameters::Parameters;
use super::undo::{Cubic, Undo};
use super::warning::Warning;
use crate::error::{InputError, Result};
use std::path::Path;

/// degC that ArduPilot's cubic counts from.
const ARDUPILOT_REFERENCE_DEGC: f64 = 35.0;

/// A correction that was on for a part of the log.
#[derive(Debug, Clone)]
pub(super) struct Switched {
    /// Whether it was on, from when on: us since power-on.
    on: Vec<(u64, bool)>,
    /// Said of a record that has rows with it, and of one that has none.
    with: Warning,
    without: Warning,
}

impl Switched {
    /// What is to be said of rows with these times, s since power-on.
    pub(super) fn said(&self, since_s: &[f64]) -> Warning {
        let is_on = |s: &f64| {
            let mut before = self.on.iter().filter(|o| o.0 as f64 <= s * 1e6);
            before.next_back().is_some_and(|o| o.1)
        };
        match since_s.iter().any(is_on) {
            true => self.with.clone(),
            false => self.without.clone(),
        }
    }
}

/// What the parameters say of the gyro that was chosen.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub undo: Option<Undo>,
    pub switched: Option<Switched>,
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

/// Whose a numbered family of parameters is.
enum Whose {
    /// The gyro's own, by this number.
    Own(u32),
    /// Of others: the ids that the log has.
    Others(String),
    /// The log does not say which gyro this is: the ids that it has.
    Unknown(String),
}

/// Which number of `TC_G` or `CAL_GYRO` is the gyro's: by its id, and by its number only in a log without any.
fn whose(p: &Parameters, family: &str, of: &Chosen<'_>) -> Whose {
    let name = |n: u32| format!("{family}{n}_ID");
    let ids: Vec<(u32, f64)> = (0..=MOST_OF_FAMILY)
        .filter_map(|n| Some((n, p.last(&name(n))?)))
        .collect();
    let listed = || {
        let each = ids.iter().map(|(n, id)| format!("{} = {id}", name(*n)));
        each.collect::<Vec<_>>().join(", ")
    };
    match (ids.is_empty(), of.id) {
        (true, _) => Whose::Own(of.number),
        (false, None) => Whose::Unknown(listed()),
        (false, Some(id)) => match ids.iter().find(|i| i.1 == f64::from(id)) {
            Some((n, _)) => Whose::Own(*n),
            None => Whose::Others(listed()),
        },
    }
}

/// The highest number in a family of PX4's parameters.
const MOST_OF_FAMILY: u32 = 9;

/// What an autopilot's temperature correction is called.
struct Names<'a> {
    autopilot: &'a str,
    /// The parameter that switches it.
    enable: &'a str,
    /// The beginning of its parameters.
    family: String,
    /// All that make it what it is.
    parts: Vec<String>,
    /// One of them, for messages.
    example: String,
}

/// A correction by temperature as the parameters say it: when it was on, what it took off, where it changed.
///
/// # Errors
/// One that is to be taken off and cannot be.
fn by_temperature(
    p: &Parameters,
    of: &Chosen<'_>,
    names: &Names<'_>,
    cubic: impl Fn(u64) -> Option<Cubic>,
    found: &mut Found,
) -> Result<()> {
    let on = p.switched(names.enable);
    if !on.iter().any(|o| o.1) {
        return Ok(());
    }
    let course = p.course(names.enable);
    let changes: Vec<(u64, String)> = std::iter::once(names.enable)
        .chain(names.parts.iter().map(String::as_str))
        .flat_map(|name| p.changes(name).map(move |c| (name, c)))
        .filter(|(name, (time, ..))| {
            // Coefficients of a correction that is off change nothing.
            *name == names.enable || p.at(names.enable, *time) == Some(1.0)
        })
        .map(|(name, (time, from, to))| {
            let s = time as f64 * 1e-6;
            (
                time,
                format!("{name} changes from {from} to {to} at {s:.1} s since power-on"),
            )
        })
        .collect();
    let starts = || {
        let all = on.iter().map(|o| o.0).chain(changes.iter().map(|c| c.0));
        let mut all: Vec<u64> = all.collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let is_on = |time: u64| p.at(names.enable, time) == Some(1.0);
    let pieces: Vec<(u64, Option<Cubic>)> = starts()
        .into_iter()
        .map(|t| (t, cubic(t).filter(|_| is_on(t))))
        .collect();
    let whole = pieces.iter().all(|(t, c)| c.is_some() || !is_on(*t));
    let hint = match (whole, of.raw, of.undo) {
        (true, false, false) => format!(
            ". {} stand in the log: --undo-correction takes it off",
            names.example
        ),
        (false, false, _) => format!(
            ". The log does not hold its coefficients ({})",
            names.example
        ),
        _ => String::new(),
    };
    if of.undo && !of.raw {
        if !whole {
            return Err(of.refuse(format!(
                "{course}, and the log does not hold {}: the correction of {} cannot be taken off",
                names.example, names.family
            )));
        }
        found.undo = Some(Undo {
            pieces,
            name: names.family.clone(),
        });
    }
    let (autopilot, source) = (names.autopilot, of.source);
    let with = match of.raw {
        true => format!(
            "{course}: {autopilot} corrected the gyro by its temperature; {source} is the driver's own output, before it"
        ),
        false => format!(
            "{course}: {autopilot} corrected the gyro by its temperature while it is 1, and {source} is after it: {}{hint}",
            match found.undo {
                Some(_) => "--undo-correction takes it off again",
                None => AFTER,
            }
        ),
    };
    let undo = match of.undo {
        true => ". --undo-correction changes nothing",
        false => "",
    };
    let without = format!(
        "{course}: {autopilot} corrected the gyro by its temperature while it is 1, and the rows that were taken are all of times \
         when it is not: they are the gyro's own{undo}"
    );
    found.switched = Some(Switched {
        on,
        with: Warning::on("correction_on", "rate_out_dps", with),
        without: Warning::on("correction_off", "rate_out_dps", without),
    });
    let cuts = changes
        .into_iter()
        .map(|(time, said)| (time, said, f64::NAN));
    found.cuts.extend(cuts);
    Ok(())
}

/// PX4's corrections.
///
/// # Errors
/// A correction that is to be taken off and cannot be.
pub(super) fn px4(p: &Parameters, of: Chosen<'_>) -> Result<Found> {
    let mut found = Found::default();
    let enable = "TC_G_ENABLE";
    let calibrated = whose(p, "CAL_GYRO", &of);
    let remark = |what: String| Warning::on("correction_on", "rate_out_dps", what);
    let id = of.id.unwrap_or(0);
    let was_on = p.switched(enable).iter().any(|o| o.1);
    match whose(p, "TC_G", &of) {
        Whose::Own(n) => {
            let part = |name: &str| format!("TC_G{n}_{name}");
            let names = Names {
                autopilot: "PX4",
                enable,
                family: format!("TC_G{n}"),
                parts: (0..4)
                    .map(|k| part(&format!("X{k}_{}", of.axis)))
                    .chain(["TREF", "TMIN", "TMAX"].map(part))
                    .collect(),
                example: format!("TC_G{n}_X0_{} and the like", of.axis),
            };
            let cubic = |time: u64| px4_cubic(p, n, of.axis, time);
            by_temperature(p, &of, &names, cubic, &mut found)?;
            let turned = [
                Some("SENS_BOARD_ROT".to_owned()),
                match &calibrated {
                    Whose::Own(c) => Some(format!("CAL_GYRO{c}_ROT")),
                    _ => None,
                },
            ];
            let mut turned = turned.iter().flatten();
            let turned = turned.find(|r| p.last(r).is_some_and(|v| v > 0.0));
            if let (Some(_), Some(name)) = (&found.undo, turned) {
                return Err(of.refuse(format!(
                    "the correction TC_G{n} is of the sensor's own axes, and the log's axes are turned ({name})"
                )));
            }
        }
        Whose::Others(ids) if was_on => {
            let undo = match of.undo {
                true => ". --undo-correction has nothing to take off",
                false => "",
            };
            found.warnings.push(Warning::on(
                "correction_off",
                "rate_out_dps",
                format!(
                    "{}, and no TC_Gn_ID of the log is this gyro's device_id {id} ({ids}): by the ids PX4 has no temperature \
                     correction of this gyro{undo}",
                    p.course(enable)
                ),
            ));
        }
        Whose::Unknown(ids) if was_on => {
            let what = format!(
                "{}, and the log does not say which gyro {} is of (its ids: {ids})",
                p.course(enable),
                of.source
            );
            if of.undo && !of.raw {
                return Err(of.refuse(format!(
                    "{what}: whose correction is to be taken off cannot be told"
                )));
            }
            found.warnings.push(remark(format!(
                "{what}: PX4 corrected the gyro by its temperature if one of them is its own"
            )));
            let changes = p.changes(enable);
            found.cuts.extend(changes.map(|(time, from, to)| {
                let s = time as f64 * 1e-6;
                let said =
                    format!("{enable} changes from {from} to {to} at {s:.1} s since power-on");
                (time, said, f64::NAN)
            }));
        }
        Whose::Others(_) | Whose::Unknown(_) => {}
    }
    if let Some(on) = p.on("IMU_GYRO_CAL_EN", &[1.0]) {
        let what = format!("{on}: PX4 learns the gyro's offset anew whenever the vehicle rests");
        found.warnings.push(remark(match of.raw {
            true => format!(
                "{what}; {} is the driver's own output, before it",
                of.source
            ),
            false => format!("{what}, and {} is after it: {AFTER}", of.source),
        }));
    }
    let offset = |n: u32| format!("CAL_GYRO{n}_{}OFF", of.letter());
    match calibrated {
        Whose::Own(n) => found.cuts.extend(learnt(p, &offset(n), 1.0)),
        Whose::Unknown(_) => found.cuts.extend(learnt(p, &offset(of.number), 1.0)),
        Whose::Others(ids) => {
            let others = (0..=MOST_OF_FAMILY).find_map(|n| learnt(p, &offset(n), 1.0).next());
            found.warnings.extend(others.map(|(_, said, _)| {
                Warning::on(
                    "correction_off",
                    "rate_out_dps",
                    format!(
                        "{said}: by the ids that is another gyro's (this one's device_id is {id}; {ids}), and the record goes on"
                    ),
                )
            }));
        }
    }
    nothing_to_undo(&of, enable, &mut found);
    Ok(found)
}

/// Says that a correction that is to be taken off never was on, where nothing else says so.
fn nothing_to_undo(of: &Chosen<'_>, enable: &str, found: &mut Found) {
    let said = found.switched.is_some()
        || found
            .warnings
            .iter()
            .any(|w| w.message.contains("--undo-correction"));
    if of.undo && !said {
        found.warnings.push(Warning::on(
            "correction_off",
            "rate_out_dps",
            format!("by the log's parameters no temperature correction was on ({enable}): --undo-correction has nothing to take off"),
        ));
    }
}

fn px4_cubic(p: &Parameters, n: u32, axis: usize, time_us: u64) -> Option<Cubic> {
    let value = |name: &str| p.at(&format!("TC_G{n}_{name}"), time_us);
    let of = |k: usize| value(&format!("X{k}_{axis}"));
    if (0..4).all(|k| of(k).is_none()) {
        return None;
    }
    let degrees = |k: usize| of(k).unwrap_or(0.0).to_degrees();
    Some(Cubic {
        coefficients_dps: [degrees(0), degrees(1), degrees(2), degrees(3)],
        reference_degc: value("TREF").unwrap_or(25.0),
        range_degc: (value("TMIN").unwrap_or(0.0), value("TMAX").unwrap_or(100.0)),
        added_dps: 0.0,
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
    let letter = of.letter();
    let names = Names {
        autopilot: "ArduPilot",
        enable: &enable,
        family: tcal.clone(),
        parts: (1..=3)
            .map(|k| format!("{tcal}_GYR{k}_{letter}"))
            .chain(["TMIN", "TMAX"].map(|t| format!("{tcal}_{t}")))
            .chain([format!("INS_GYR{n}_CALTEMP")])
            .collect(),
        example: format!("{tcal}_GYR1_{letter} and the like"),
    };
    let cubic = |time: u64| ardupilot_cubic(p, &tcal, n, letter, time);
    by_temperature(p, &of, &names, cubic, &mut found)?;
    let number = if n == 1 { String::new() } else { n.to_string() };
    let name = format!("INS_GYR{number}OFFS_{letter}");
    found.cuts.extend(learnt(p, &name, 1.0));
    nothing_to_undo(&of, &enable, &mut found);
    Ok(found)
}

fn ardupilot_cubic(
    p: &Parameters,
    tcal: &str,
    n: u32,
    letter: &str,
    time_us: u64,
) -> Option<Cubic> {
    let at = |name: &str| p.at(name, time_us);
    let of = |k: usize| at(&format!("{tcal}_GYR{k}_{letter}"));
    if (1..=3).all(|k| of(k).is_none()) {
        return None;
    }
    let degrees = |k: usize| (1e-6 * of(k).unwrap_or(0.0)).to_degrees();
    let mut cubic = Cubic {
        coefficients_dps: [0.0, degrees(1), degrees(2), degrees(3)],
        reference_degc: ARDUPILOT_REFERENCE_DEGC,
        range_degc: (
            at(&format!("{tcal}_TMIN")).unwrap_or(0.0),
            at(&format!("{tcal}_TMAX")).unwrap_or(70.0),
        ),
        added_dps: 0.0,
    };
    cubic.added_dps = at(&format!("INS_GYR{n}_CALTEMP")).map_or(0.0, |degc| cubic.at(degc));
    Some(cubic)
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
#[path = "corrections_tests.rs"]
mod tests;
