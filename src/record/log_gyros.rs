//! Which gyro of a log is read: its rate, and what else is of the same device.
//!
//! PX4 numbers the instances of each topic by themselves; what belongs together has one `device_id`. Where a topic says none,
//! its instance has to do.

use super::averager::Averager;
use super::corrections::Found;
use super::log_bytes::Damage;
use super::log_rows::{self, Choice};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::{InputError, Result};
use crate::statistics::stats;
use std::collections::BTreeMap;
use std::path::Path;

/// A topic's instance as a source of columns.
#[derive(Debug, Clone)]
pub(super) struct Source {
    /// As the log calls it.
    pub topic: &'static str,
    pub instance: u8,
    /// Whether its instances are the log's own numbers of gyros: the topic of a gyro, not of the one in use.
    pub numbers: bool,
    /// Whether its rate is the driver's own, before any correction.
    pub raw: bool,
    /// Its channels, by column.
    pub channels: Vec<(&'static str, usize)>,
    /// `device_id` of the gyro: us since power-on from which it holds, id. Empty where the topic says none.
    pub ids: Vec<(u64, u32)>,
    /// `device_id` of the accelerometer.
    pub accel_id: Option<u32>,
    /// us since power-on at which a counter of calibrations stepped.
    pub recalibrated: Vec<u64>,
}

impl Source {
    fn id(&self) -> Option<u32> {
        self.ids.first().map(|(_, id)| *id)
    }

    /// Notes the id that a message says; 0 is none.
    pub(super) fn note(&mut self, time_us: u64, id: u32) {
        if id != 0 && self.ids.last().is_none_or(|(_, last)| *last != id) {
            self.ids.push((time_us, id));
        }
    }

    fn channel(&self, column: &str) -> Option<usize> {
        self.channels
            .iter()
            .find(|(name, _)| *name == column)
            .map(|c| c.1)
    }

    fn named(&self) -> String {
        format!("{} {}", self.topic, self.instance)
    }
}

/// A gyro of the log, with the sources of each column, the best first.
#[derive(Debug, Clone, Default)]
struct Gyro {
    number: u8,
    id: Option<u32>,
    rate: Vec<usize>,
    heat: Vec<usize>,
    accel: Vec<usize>,
    /// The source that its rate is from.
    lead: usize,
}

/// Chooses the gyro that is asked for, or the first.
///
/// # Errors
/// A gyro that is not there, with those that are.
pub(super) fn choose(
    averager: &Averager,
    sources: &[Source],
    mapping: &RecordMapping,
    path: &Path,
    (nothing, damage): (&str, Damage),
) -> Result<(Choice, Chosen)> {
    let gyros = gyros(averager, sources);
    let listed: Vec<String> = gyros
        .iter()
        .map(|gyro| line(averager, sources, gyro))
        .collect();
    let wanted = match mapping.instance {
        Some(asked) => gyros.iter().find(|g| u32::from(g.number) == asked),
        None => gyros.iter().find(|g| has_samples(averager, g)),
    };
    let Some(gyro) = wanted else {
        return Err(not_there(
            averager,
            sources,
            &listed,
            mapping,
            path,
            (nothing, damage),
        ));
    };
    let lead = sources.get(gyro.lead);
    let mut choice = Choice {
        gyro: match gyro.id {
            Some(id) => format!("gyro {} (device_id {id})", gyro.number),
            None => format!("gyro {}", gyro.number),
        },
        thermometers: thermometers(averager, sources),
        columns: vec![
            ("rate_out_dps", gyro.rate.clone()),
            ("die_degc", gyro.heat.clone()),
            ("accel_g", gyro.accel.clone()),
            ("supply_v", supplies(sources)),
        ],
        ..Choice::default()
    };
    if gyros.len() > 1 && mapping.instance.is_none() {
        choice.warnings.push(Warning::general(
            "gyros_in_log",
            format!(
                "the log has {} gyros: {}. Gyro {} is read; `instance` in [record] chooses another",
                gyros.len(),
                listed.join("; "),
                gyro.number
            ),
        ));
    }
    let heat = sources.iter().filter(|s| s.channel("die_degc").is_some());
    if lead.is_some_and(|s| !s.numbers && s.ids.is_empty()) && heat.count() > 1 {
        choice.warnings.push(Warning::general(
            "gyro_not_identified",
            format!(
                "{} does not say which gyro was in use, and the log has several thermometers ({}): that of gyro {} was taken. \
                 Log sensor_gyro or sensor_selection to be sure",
                lead.map_or("the log", |s| s.topic),
                choice.thermometers,
                gyro.number
            ),
        ));
    }
    if let Some((end_us, said)) = replaced(sources, gyro) {
        choice.ends_us = Some(end_us);
        choice
            .warnings
            .push(Warning::general("gyro_replaced", said));
    }
    let chosen = Chosen {
        number: u32::from(gyro.number),
        id: gyro.id,
        lead: gyro.lead,
    };
    Ok((choice, chosen))
}

/// The gyro that was chosen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chosen {
    pub number: u32,
    pub id: Option<u32>,
    /// The source that its rate is from.
    pub lead: usize,
}

fn has_samples(averager: &Averager, gyro: &Gyro) -> bool {
    let of = |c: &usize| averager.channels.get(*c).is_some_and(|c| c.samples > 0);
    gyro.rate.iter().any(of)
}

/// The gyros that have a rate, by number; a topic without a sample is none, where others have some.
fn gyros(averager: &Averager, sources: &[Source]) -> Vec<Gyro> {
    let samples = |s: &Source| {
        let channel = averager.channels.get(s.channel("rate_out_dps")?)?;
        Some(channel.samples)
    };
    let any = sources.iter().any(|s| samples(s) > Some(0));
    let rates = || {
        let all = sources.iter().enumerate();
        all.filter(|(_, s)| samples(s).is_some_and(|n| n > 0 || !any))
    };
    let mut leads: BTreeMap<u8, usize> = BTreeMap::new();
    for (i, source) in rates().filter(|(_, s)| s.numbers) {
        leads.entry(source.instance).or_insert(i);
    }
    if leads.is_empty() {
        // The one in use alone: its number is that of the topic that has its id.
        for (i, source) in rates() {
            let same = sources
                .iter()
                .find(|s| source.id().is_some() && s.numbers && s.id() == source.id());
            leads.entry(same.map_or(0, |s| s.instance)).or_insert(i);
        }
    }
    leads
        .into_iter()
        .map(|(number, lead)| gyro(sources, number, lead))
        .collect()
}

fn gyro(sources: &[Source], number: u8, lead: usize) -> Gyro {
    // What the topics of that number say joins them, though the gyro in use may be another.
    let numbered = sources
        .iter()
        .filter(|s| s.numbers && s.instance == number)
        .find_map(Source::id);
    let first = sources.get(lead);
    let id = first.and_then(Source::id).or(numbered);
    let belongs = |s: &Source| match (id, s.id()) {
        (Some(a), Some(b)) => a == b,
        _ if s.numbers => s.instance == number,
        _ => number == 0,
    };
    let all = || {
        let first = sources.get(lead).into_iter();
        let others = sources.iter().enumerate().filter(|(i, _)| *i != lead);
        first.chain(others.map(|o| o.1).filter(|s| belongs(s)))
    };
    let of = |column: &str| -> Vec<usize> { all().filter_map(|s| s.channel(column)).collect() };
    let accel_id = all().find_map(|s| s.accel_id);
    let accels = sources.iter().filter(|s| s.topic == "sensor_accel");
    let accels = accels.filter(|s| match (accel_id, s.accel_id) {
        (Some(a), Some(b)) => a == b,
        _ => s.instance == number,
    });
    let own = accels.filter_map(|s| s.channel("accel_g"));
    let of_gyro = all().filter(|s| s.topic != "sensor_accel");
    Gyro {
        number,
        id: id.filter(|_| first.is_some_and(|s| s.numbers || !s.ids.is_empty())),
        rate: of("rate_out_dps"),
        heat: of("die_degc"),
        accel: own
            .chain(of_gyro.filter_map(|s| s.channel("accel_g")))
            .collect(),
        lead,
    }
}

/// The supply is the vehicle's.
fn supplies(sources: &[Source]) -> Vec<usize> {
    let of_vehicle = sources.iter().filter(|s| s.instance == 0);
    of_vehicle.filter_map(|s| s.channel("supply_v")).collect()
}

/// A gyro in a line: rows, samples, range of temperature, id.
fn line(averager: &Averager, sources: &[Source], gyro: &Gyro) -> String {
    let rate = gyro.rate.first().copied();
    let rows = rate.map_or(0, |c| averager.rows_of(c).count());
    let samples = rate
        .and_then(|c| averager.channels.get(c))
        .map_or(0, |c| c.samples);
    let degc = gyro.heat.iter().find_map(|c| range(averager, *c));
    let degc = degc.map_or("no temperature".to_owned(), |(low, high)| {
        format!("{low:.1} to {high:.1} degC")
    });
    let id = gyro
        .id
        .map_or(String::new(), |id| format!(", device_id {id}"));
    let source = sources.get(gyro.lead).map_or("", |s| s.topic);
    format!(
        "{} ({source}, {rows} rows, {samples} samples, {degc}{id})",
        gyro.number
    )
}

fn range(averager: &Averager, channel: usize) -> Option<(f64, f64)> {
    let means: Vec<f64> = averager.rows_of(channel).map(|(_, s)| s.mean()).collect();
    stats::extremes(&means)
}

/// The thermometers of the log, for messages.
fn thermometers(averager: &Averager, sources: &[Source]) -> String {
    let mut said = Vec::new();
    for source in sources {
        let Some(channel) = source.channel("die_degc") else {
            continue;
        };
        let id = source
            .id()
            .map_or(String::new(), |id| format!(", device_id {id}"));
        let degc = match range(averager, channel) {
            Some((low, high)) => format!("{low:.1} to {high:.1} degC"),
            None => "not one reading (NaN)".to_owned(),
        };
        said.push(format!("{} ({degc}{id})", source.named()));
    }
    match said.is_empty() {
        true => "it has no thermometer of a gyro at all".to_owned(),
        false => format!("it has {}", said.join(", ")),
    }
}

fn not_there(
    averager: &Averager,
    sources: &[Source],
    listed: &[String],
    mapping: &RecordMapping,
    path: &Path,
    (nothing, damage): (&str, Damage),
) -> crate::error::Error {
    let topics: Vec<String> = sources
        .iter()
        .filter(|s| s.channel("rate_out_dps").is_some())
        .map(Source::named)
        .collect();
    let found = match topics.is_empty() {
        true => format!("it has {nothing} at all"),
        false => format!("it has {}", topics.join(", ")),
    };
    let there = match listed.is_empty() {
        true => String::new(),
        false => format!(
            "; the gyros that are there: {}. Of thermometers {}",
            listed.join("; "),
            thermometers(averager, sources)
        ),
    };
    let noticed = log_rows::damage_warnings(damage);
    let noticed = noticed
        .first()
        .map_or(String::new(), |w| format!("; {}", w.message));
    let said = format!(
        "has no samples of gyro {}: {found}{there}{noticed}",
        mapping.instance.unwrap_or(0)
    );
    let error = match &mapping.instance_at {
        Some(place) => {
            InputError::new(format!("the log {} {said}", path.display())).at_position(place)
        }
        None => InputError::new(format!("the log {said}")).in_file(path),
    };
    error.help(
        "choose another `instance` in [record], or log the gyro (PX4: sensor_gyro or sensor_gyro_fifo; ArduPilot: IMU)",
    )
    .into()
}

/// Where a source of the gyro goes over to another device: us, and what is said.
fn replaced(sources: &[Source], gyro: &Gyro) -> Option<(u64, String)> {
    let used = |s: &&Source| {
        let channels = [gyro.rate.first(), gyro.heat.first()];
        let mut own = channels.into_iter().flatten();
        own.any(|c| s.channels.iter().any(|(_, channel)| channel == c))
    };
    let changes = sources.iter().filter(used).filter_map(|s| {
        let (time_us, to) = *s.ids.get(1)?;
        Some((time_us, s.named(), s.id()?, to))
    });
    let (time_us, topic, from, to) = changes.min_by_key(|c| c.0)?;
    let said = format!(
        "{topic} goes over from device_id {from} to {to} at {:.1} s since power-on: another gyro. The record ends there",
        time_us as f64 * 1e-6
    );
    Some((time_us, said))
}

/// Rows beside a change of an offset that tell whether the output has it.
const BESIDE: usize = 5;

/// The source that the rate is from in the end: a faster one than the leading one may be taken.
pub(super) fn source_of_rate<'a>(
    averager: &Averager,
    sources: &'a [Source],
    choice: &Choice,
    chosen: Chosen,
) -> Option<&'a Source> {
    let rate = log_rows::rate(averager, choice);
    let gives = |s: &&Source| s.channel("rate_out_dps").is_some_and(|c| Some(c) == rate);
    sources.iter().find(gives).or(sources.get(chosen.lead))
}

/// Adds what the parameters say. An offset that was learnt anew splits the record, unless the output is the driver's own and
/// does not step by it.
pub(super) fn corrected(averager: &Averager, choice: &mut Choice, found: Found, source: &Source) {
    choice.undo = found.undo;
    choice.switched = found.switched;
    choice.warnings.extend(found.warnings);
    for (time_us, said, step_dps) in found.cuts {
        let rate = source.channel("rate_out_dps");
        if source.raw && !rate.is_some_and(|c| steps(averager, c, time_us, step_dps)) {
            choice.warnings.push(Warning::on(
                "correction_on",
                "rate_out_dps",
                format!(
                    "{said}: {} is the driver's own output, before it",
                    source.topic
                ),
            ));
        } else {
            choice.cuts.push((time_us, said));
        }
    }
    let near = |a: u64, b: u64| a.abs_diff(b) < 2_000_000;
    for time_us in &source.recalibrated {
        if !choice.cuts.iter().any(|c| near(c.0, *time_us)) {
            let said = format!(
                "{} counts a new calibration of the gyro at {:.1} s since power-on",
                source.topic,
                *time_us as f64 * 1e-6
            );
            choice.cuts.push((*time_us, said));
        }
    }
    choice.cuts.sort_by_key(|c| c.0);
}

/// Whether a channel steps at a time by what is expected, to within half of it.
fn steps(averager: &Averager, channel: usize, time_us: u64, expected: f64) -> bool {
    let row = time_us / averager.period_us;
    let before = averager.rows_of(channel).filter(|(n, _)| *n < row);
    let before: Vec<f64> = before.map(|(_, s)| s.mean()).collect();
    let after = averager.rows_of(channel).filter(|(n, _)| *n > row);
    let after: Vec<f64> = after.take(BESIDE).map(|(_, s)| s.mean()).collect();
    let before = before
        .get(before.len().saturating_sub(BESIDE)..)
        .unwrap_or(&[]);
    let step = stats::median(&after) - stats::median(before);
    (step - expected).abs() < 0.5 * expected.abs()
}
