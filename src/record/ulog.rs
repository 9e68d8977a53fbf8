//! PX4's log format, as far as a thermal record needs it: the gyro's samples and temperature, the
//! accelerometer along the same axis, the supply.
//!
//! Written from the public specification (PX4 guide, "ULog File Format"). The file describes
//! itself: format definitions name the fields of each topic, subscriptions number the topics.

use super::averager::{Averager, Backwards, Channel, STANDARD_GRAVITY};
use super::log_bytes::{Damage, Scalar, Stream};
use super::thermal::ThermalRecord;
use super::ulog_layout::{Definitions, Layout};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::Path;

/// The first bytes of every ULog.
pub(super) const MAGIC: [u8; 7] = [0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35];

/// What a writer puts in from time to time, so that a reader finds its way again.
const SYNC: [u8; 8] = [0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12];

/// The bit of the incompatible flags that says that data was appended.
const APPENDED: u8 = 1;

const GIVE_UP: &str = "the log is damaged where it says what it holds; take another copy of it";

/// How a field becomes a value of the record.
enum Unit {
    /// Times a constant.
    Times(f64),
    /// Times a constant, over a time in us that another field holds (an integral's length).
    Per(f64, &'static str),
}

/// A field of a topic that can become a column.
struct Wanted {
    column: &'static str,
    topic: &'static str,
    field: String,
    unit: Unit,
    /// Its topic has one instance a gyro; a supply is the vehicle's.
    of_gyro: bool,
}

/// The fields of interest, of one column the best first.
///
/// `sensor_gyro` is the driver's own output, averaged by no filter; `vehicle_imu` integrates it,
/// `sensor_combined` is the gyro that was in use at the moment, of whatever instance.
fn wanted(axis: usize) -> Vec<Wanted> {
    let letter = ["x", "y", "z"].get(axis).copied().unwrap_or("z");
    let degrees = 180.0 / std::f64::consts::PI;
    let g = 1.0 / STANDARD_GRAVITY;
    let field = |column, topic, field: String, unit, of_gyro| Wanted {
        column,
        topic,
        field,
        unit,
        of_gyro,
    };
    let times = Unit::Times;
    let (rate, accel) = ("rate_out_dps", "accel_g");
    let angle = Unit::Per(degrees * 1e6, "delta_angle_dt");
    let speed = Unit::Per(g * 1e6, "delta_velocity_dt");
    let at = |name: &str| format!("{name}[{axis}]");
    vec![
        field(rate, "sensor_gyro", letter.into(), times(degrees), true),
        field(rate, "vehicle_imu", at("delta_angle"), angle, true),
        field(
            rate,
            "sensor_combined",
            at("gyro_rad"),
            times(degrees),
            false,
        ),
        field(
            "die_degc",
            "sensor_gyro",
            "temperature".into(),
            times(1.0),
            true,
        ),
        field(
            "die_degc",
            "vehicle_imu_status",
            "temperature_gyro".into(),
            times(1.0),
            true,
        ),
        field(accel, "sensor_accel", letter.into(), times(g), true),
        field(accel, "vehicle_imu", at("delta_velocity"), speed, true),
        field(
            accel,
            "sensor_combined",
            at("accelerometer_m_s2"),
            times(g),
            false,
        ),
        field(
            "supply_v",
            "system_power",
            "voltage5v_v".into(),
            times(1.0),
            false,
        ),
        field(
            "supply_v",
            "battery_status",
            "voltage_v".into(),
            times(1.0),
            false,
        ),
    ]
}

/// What to take from the messages of one subscription.
struct Subscription {
    layout: Layout,
    picks: Vec<Pick>,
}

struct Pick {
    channel: usize,
    offset: usize,
    scalar: Scalar,
    factor: f64,
    /// The field that the value is divided by.
    over: Option<(usize, Scalar)>,
}

impl Pick {
    fn value(&self, data: &[u8]) -> Option<f64> {
        let value = self.scalar.read(data, self.offset)? * self.factor;
        Some(match self.over {
            Some((offset, scalar)) => value / scalar.read(data, offset)?,
            None => value,
        })
    }
}

/// Reads a ULog as a thermal record: rows of `average_s` of the gyro `instance`, axis `axis`.
///
/// # Errors
/// No ULog, a damaged definition, an incompatible version, a clock that runs backwards, no gyro of
/// that instance, too few rows. Damage among the data is left out and told.
pub(super) fn read<R: Read>(
    input: R,
    path: &Path,
    mapping: &RecordMapping,
) -> Result<(ThermalRecord, Vec<Warning>)> {
    let fields = wanted(mapping.axis.index());
    let channels = fields
        .iter()
        .map(|f| Channel {
            column: f.column,
            source: format!("{}.{}", f.topic, f.field),
        })
        .collect();
    let mut reader = Reader {
        stream: Stream::new(path, input),
        definitions: Definitions::default(),
        subscriptions: BTreeMap::new(),
        seen: BTreeSet::new(),
        appended: Vec::new(),
        damage: Damage::default(),
        averager: Averager::new(channels, mapping),
        fields,
        instance: mapping.instance.unwrap_or(0),
    };
    reader.run()?;
    let found = match reader.seen.is_empty() {
        true => "it has no gyro topic at all".to_owned(),
        false => {
            let names: Vec<String> = reader
                .seen
                .iter()
                .map(|(topic, instance)| format!("{topic} {instance}"))
                .collect();
            format!("it has {}", names.join(", "))
        }
    };
    reader.averager.finish(path, mapping, reader.damage, &found)
}

/// Samples that were read and not yet taken: a message of type D.
#[derive(Default)]
struct Waiting {
    /// Where it began.
    start: Option<u64>,
    body: Vec<u8>,
}

struct Reader<'a, R: Read> {
    stream: Stream<'a, R>,
    definitions: Definitions,
    /// By the number that the log gives; `None` for a topic of no interest.
    subscriptions: BTreeMap<u16, Option<Subscription>>,
    /// The gyro topics that the log has, with their instances.
    seen: BTreeSet<(&'static str, u8)>,
    /// Where appended data begin, the nearest last.
    appended: Vec<u64>,
    damage: Damage,
    averager: Averager,
    fields: Vec<Wanted>,
    instance: u32,
}

impl<R: Read> Reader<'_, R> {
    fn run(&mut self) -> Result<()> {
        let mut bytes = Vec::new();
        self.stream.take(&mut bytes, 16)?;
        if bytes.len() < 16 || !bytes.starts_with(&MAGIC) {
            return Err(self.stream.broken(
                0,
                "the log ends within its header, or is no ULog",
                "take another copy of the log",
            ));
        }
        // There is no checksum: samples wait until a message follows them that can be one.
        let mut waiting = Waiting::default();
        loop {
            let start = self.stream.offset;
            self.stream.take(&mut bytes, 3)?;
            let [low, high, kind] = bytes[..] else {
                self.damage.cut |= !bytes.is_empty();
                self.settle(&mut waiting)?;
                return Ok(());
            };
            let size = u16::from_le_bytes([low, high]);
            if self.skipped_to_appended(start, size, &mut bytes)? {
                self.settle(&mut waiting)?;
                continue;
            }
            if !kind.is_ascii_uppercase() {
                let from = waiting.start.take();
                self.find_sync(from.unwrap_or(start))?;
                continue;
            }
            if !self.settle(&mut waiting)? {
                continue;
            }
            self.stream.take(&mut bytes, usize::from(size))?;
            if bytes.len() < usize::from(size) {
                self.damage.cut = true;
                return Ok(());
            }
            if kind == b'D' {
                waiting.start = Some(start);
                std::mem::swap(&mut waiting.body, &mut bytes);
            } else if !self.message(kind, &bytes, start)? {
                self.find_sync(start)?;
            }
        }
    }

    /// Takes the samples that waited; false, and the reader behind the next mark, if they are
    /// damaged.
    fn settle(&mut self, waiting: &mut Waiting) -> Result<bool> {
        let Some(start) = waiting.start.take() else {
            return Ok(true);
        };
        let sound = self.data(&waiting.body, start)?;
        if !sound {
            self.find_sync(start)?;
        }
        Ok(sound)
    }

    /// One message; false if it cannot be what it says.
    fn message(&mut self, kind: u8, body: &[u8], start: u64) -> Result<bool> {
        match kind {
            b'B' => self.flags(body, start)?,
            b'F' if !self.definitions.define(body) => {
                return Err(self.stream.broken(
                    start,
                    "a format definition cannot be read",
                    GIVE_UP,
                ));
            }
            b'A' => return self.subscribe(body, start),
            // Information, parameters, text, marks: nothing that a record holds.
            _ => {}
        }
        Ok(true)
    }

    /// Flags that say whether this reader may read on, and where data were appended.
    fn flags(&mut self, body: &[u8], start: u64) -> Result<()> {
        let Some(incompatible) = body.get(8..16) else {
            return Err(self
                .stream
                .broken(start, "the flags are cut short", GIVE_UP));
        };
        let known = incompatible.iter().enumerate().all(|(i, byte)| {
            let allowed = if i == 0 { APPENDED } else { 0 };
            byte & !allowed == 0
        });
        if !known {
            return Err(self.stream.broken(
                start,
                "the log says that readers of this version of ULog cannot read it",
                "convert it with the tools of the autopilot that wrote it",
            ));
        }
        if incompatible.first().is_some_and(|b| b & APPENDED != 0) {
            let offsets = body.get(16..40).unwrap_or(&[]);
            let (chunks, _) = offsets.as_chunks::<8>();
            self.appended = chunks.iter().map(|c| u64::from_le_bytes(*c)).collect();
            self.appended.retain(|offset| *offset > start);
            self.appended.sort_unstable();
            self.appended.reverse();
        }
        Ok(())
    }

    /// Where data were appended, the message before may be cut short: skips to what was appended.
    fn skipped_to_appended(&mut self, start: u64, size: u16, bytes: &mut Vec<u8>) -> Result<bool> {
        let Some(next) = self.appended.last().copied() else {
            return Ok(false);
        };
        if start + 3 + u64::from(size) <= next {
            return Ok(false);
        }
        self.appended.pop();
        if start >= next {
            return Ok(false);
        }
        self.damage.note(start, next);
        let rest = next.saturating_sub(self.stream.offset) as usize;
        self.stream.take(bytes, rest)?;
        Ok(true)
    }

    /// Reads on behind the next synchronisation mark; what lies between is lost.
    fn find_sync(&mut self, start: u64) -> Result<()> {
        if self.subscriptions.is_empty() {
            return Err(self
                .stream
                .broken(start, "the log's definitions cannot be read", GIVE_UP));
        }
        let mut last = [0u8; SYNC.len()];
        while let Some(byte) = self.stream.byte()? {
            last.rotate_left(1);
            if let Some(end) = last.last_mut() {
                *end = byte;
            }
            if last == SYNC {
                break;
            }
        }
        self.damage.note(start, self.stream.offset);
        Ok(())
    }

    /// Decides what to take from a topic; false if the message is damaged.
    fn subscribe(&mut self, body: &[u8], start: u64) -> Result<bool> {
        let Some(([instance, low, high], name)) = body.split_first_chunk::<3>() else {
            return Ok(false);
        };
        let (instance, number) = (*instance, u16::from_le_bytes([*low, *high]));
        let Ok(name) = std::str::from_utf8(name) else {
            return Ok(false);
        };
        let mut picks = Vec::new();
        let layout = self.definitions.layout(name);
        let taken = self.fields.iter().enumerate();
        for (channel, field) in taken.filter(|(_, f)| f.topic == name) {
            if field.column == "rate_out_dps" {
                self.seen.insert((field.topic, instance));
            }
            let asked = if field.of_gyro { self.instance } else { 0 };
            let Some(layout) = layout.as_ref().filter(|_| u32::from(instance) == asked) else {
                continue;
            };
            let Some((offset, scalar)) = layout.field(&field.field) else {
                continue;
            };
            let (factor, over) = match field.unit {
                Unit::Times(factor) => (factor, None),
                Unit::Per(factor, time) => match layout.field(time) {
                    Some(time) => (factor, Some(time)),
                    None => continue,
                },
            };
            picks.push(Pick {
                channel,
                offset,
                scalar,
                factor,
                over,
            });
        }
        if layout.is_none() && self.fields.iter().any(|f| f.topic == name) {
            return Err(self.stream.broken(
                start,
                &format!("the log has topic {name} without a usable definition of it"),
                GIVE_UP,
            ));
        }
        let subscription = layout
            .filter(|_| !picks.is_empty())
            .map(|layout| Subscription { layout, picks });
        self.subscriptions.insert(number, subscription);
        Ok(true)
    }

    /// Samples; false if the message is damaged.
    fn data(&mut self, body: &[u8], start: u64) -> Result<bool> {
        let Some((number, data)) = body.split_first_chunk::<2>() else {
            return Ok(false);
        };
        let Some(subscription) = self.subscriptions.get(&u16::from_le_bytes(*number)) else {
            return Ok(false);
        };
        let Some(subscription) = subscription else {
            return Ok(true);
        };
        let time = subscription.layout.time_us(data);
        let (true, Some(time)) = (data.len() == subscription.layout.logged_bytes, time) else {
            return Ok(false);
        };
        for pick in &subscription.picks {
            let value = pick.value(data).unwrap_or(f64::NAN);
            if let Err(Backwards(from, to)) = self.averager.add(pick.channel, time, value) {
                return Err(self.stream.broken(
                    start,
                    &format!("the log's clock runs backwards, from {from:.3} s to {to:.3} s"),
                    "a record is one stretch from one power-on: cut the log there, or take another \
                     copy of it",
                ));
            }
        }
        Ok(true)
    }
}
