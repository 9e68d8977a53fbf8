//! ArduPilot's binary log, as far as a thermal record needs it: the gyro's samples and
//! temperature, the accelerometer along the same axis, the supply of the board.
//!
//! Written from the public description of the format (ArduPilot, `AP_Logger`, "LogStructure"):
//! every message begins with A3 95 and its type; messages of type 128 (FMT) say name, length,
//! format and labels of the others.

use super::averager::{Averager, STANDARD_GRAVITY};
use super::corrections;
use super::log_bytes::{Damage, Scalar, Stream};
use super::log_clock::{Message, Sample};
use super::log_gyros::{self, Source};
use super::parameters::Parameters;
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// The first bytes of every message.
pub(super) const MAGIC: [u8; 2] = [0xA3, 0x95];

/// The type of the messages that define the others, and their length.
const FMT: u8 = 128;
const FMT_BYTES: usize = 89;

/// What can be taken from a message: column, and what the source is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Quantity {
    Rate,
    Temperature,
    Acceleration,
    Board,
    Battery,
}

impl Quantity {
    fn column(self) -> &'static str {
        match self {
            Quantity::Rate => "rate_out_dps",
            Quantity::Temperature => "die_degc",
            Quantity::Acceleration => "accel_g",
            Quantity::Board | Quantity::Battery => "supply_v",
        }
    }

    fn source(self, axis: &str) -> String {
        match self {
            Quantity::Rate => format!("IMU.Gyr{axis}"),
            Quantity::Temperature => "IMU.T".to_owned(),
            Quantity::Acceleration => format!("IMU.Acc{axis}"),
            Quantity::Board => "POWR.Vcc".to_owned(),
            Quantity::Battery => "BAT.Volt".to_owned(),
        }
    }
}

/// What a message type holds.
#[derive(Debug, Clone)]
struct Format {
    /// Bytes of a message, head included.
    length: usize,
    /// What to take from it; empty for a message of no interest.
    picks: Vec<Pick>,
    /// The clock: place and type, and us in its unit.
    clock: Option<(usize, Scalar, f64)>,
    /// The number of the sensor: where a message says it, or by the message's name.
    instance: Instance,
    name: String,
    /// A parameter's name and value.
    text: Option<(usize, usize)>,
    value: Option<(usize, Scalar)>,
}

#[derive(Debug, Clone, Copy)]
enum Instance {
    At(usize, Scalar),
    Named(u8),
}

#[derive(Debug, Clone, Copy)]
struct Pick {
    quantity: Quantity,
    offset: usize,
    scalar: Scalar,
    factor: f64,
}

/// Reads a DataFlash log as a thermal record: rows of `average_s` of the gyro `instance`, axis
/// `axis`.
///
/// # Errors
/// A clock that runs backwards, no gyro of that instance, too few rows, a format of a message of
/// interest that is not as long as it says. Damage among the messages is left out and told.
pub(super) fn read<R: Read>(
    input: R,
    path: &Path,
    mapping: &RecordMapping,
) -> Result<(ThermalRecord, Vec<Warning>)> {
    let mut reader = Reader {
        stream: Stream::new(path, input),
        formats: vec![None; 256],
        sensors: BTreeMap::new(),
        parameters: Parameters::default(),
        damage: Damage::default(),
        averager: Averager::new(mapping),
        axis: mapping.axis.name().to_uppercase(),
    };
    reader.run()?;
    reader.averager.seal();
    let mut sources: Vec<Source> = reader.sensors.into_values().map(|s| s.source).collect();
    for source in sources.iter_mut().filter(|s| s.topic == "IMU") {
        let number = match source.instance {
            0 => String::new(),
            n => (u32::from(n) + 1).to_string(),
        };
        let id = reader.parameters.last(&format!("INS_GYR{number}_ID"));
        source.note(0, id.unwrap_or(0.0) as u32);
    }
    let nothing = ("no IMU message", reader.damage);
    let (mut choice, chosen) =
        log_gyros::choose(&reader.averager, &sources, mapping, path, nothing)?;
    let source = log_gyros::source_of_rate(&reader.averager, &sources, &choice, chosen);
    if let Some(source) = source {
        let of = corrections::Chosen {
            number: chosen.number,
            id: chosen.id,
            axis: mapping.axis.index(),
            source: source.topic,
            raw: source.raw,
            undo: mapping.undo_correction,
            path,
        };
        let found = corrections::ardupilot(&reader.parameters, of)?;
        log_gyros::corrected(&reader.averager, &mut choice, found, source);
    }
    reader.averager.finish(path, mapping, reader.damage, choice)
}

/// What one instance of a message type gives.
struct Sensor {
    source: Source,
    /// The averager's number of its clock.
    topic: usize,
    channels: BTreeMap<Quantity, usize>,
}

struct Reader<'a, R: Read> {
    stream: Stream<'a, R>,
    /// By type.
    formats: Vec<Option<Format>>,
    /// By kind and instance.
    sensors: BTreeMap<(&'static str, u8), Sensor>,
    parameters: Parameters,
    damage: Damage,
    averager: Averager,
    /// `X`, `Y` or `Z`.
    axis: String,
}

impl<R: Read> Reader<'_, R> {
    fn run(&mut self) -> Result<()> {
        let (mut bytes, mut body) = (Vec::new(), Vec::new());
        let mut at = self.stream.offset;
        self.stream.take(&mut bytes, 3)?;
        while let [a, b, kind] = bytes[..] {
            let length = match kind {
                _ if [a, b] != MAGIC => None,
                FMT => Some(FMT_BYTES),
                _ => self.format(kind).map(|f| f.length),
            };
            let Some(length) = length else {
                if !self.resume(&mut bytes, at)? {
                    return Ok(());
                }
                at = self.stream.offset - 3;
                continue;
            };
            self.stream.take(&mut body, length - 3)?;
            if body.len() < length - 3 {
                self.damage.cut = true;
                return Ok(());
            }
            let next = self.stream.offset;
            self.stream.take(&mut bytes, 3)?;
            // There is no checksum: what no message follows may be damaged itself.
            if !MAGIC.starts_with(bytes.get(..2).unwrap_or(&bytes)) && !is_erased(&bytes) {
                self.damage.note(at, next);
            } else if kind == FMT {
                self.define(&body, at)?;
            } else {
                self.message(kind, &body, at);
            }
            at = next;
        }
        self.damage.cut |= !bytes.is_empty();
        Ok(())
    }

    fn format(&self, kind: u8) -> Option<&Format> {
        self.formats.get(usize::from(kind))?.as_ref()
    }

    /// Moves `head`, the three bytes that begin no message, on to the next that do. False at the
    /// file's end. Zeros and ones up to there are an erased sector, no damage.
    fn resume(&mut self, head: &mut [u8], at: u64) -> Result<bool> {
        let mut erased = is_erased(head);
        while let Some(byte) = self.stream.byte()? {
            erased &= is_erased(&[byte]);
            head.rotate_left(1);
            if let Some(last) = head.last_mut() {
                *last = byte;
            }
            let known = byte == FMT || self.format(byte).is_some();
            if head.starts_with(&MAGIC) && known {
                self.damage.note(at, self.stream.offset - 3);
                return Ok(true);
            }
        }
        if !erased {
            self.damage.note(at, self.stream.offset);
        }
        Ok(false)
    }

    /// An FMT message: type, length, name of 4, format of 16, labels of 64 characters.
    fn define(&mut self, body: &[u8], at: u64) -> Result<()> {
        let text = |from: usize, to: usize| -> String {
            let bytes = body.get(from..to).unwrap_or(&[]);
            let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
            String::from_utf8_lossy(bytes.get(..end).unwrap_or(&[])).into_owned()
        };
        let (Some(kind), Some(length)) = (body.first(), body.get(1)) else {
            return Ok(());
        };
        let (name, format, labels) = (text(2, 6), text(6, 22), text(22, 86));
        if *length < 3 {
            self.damage.note(at, self.stream.offset);
            return Ok(());
        }
        let mut new = Format {
            length: usize::from(*length),
            picks: Vec::new(),
            clock: None,
            instance: Instance::Named(0),
            name,
            text: None,
            value: None,
        };
        if !self.fill(&mut new, &format, &labels) {
            return Err(self.stream.broken(
                at,
                &format!(
                    "message {} is said to be of format {format:?} and of {length} bytes, which do \
                     not agree",
                    new.name
                ),
                "the log is damaged where it says what it holds; take another copy of it",
            ));
        }
        if let Some(slot) = self.formats.get_mut(usize::from(*kind)) {
            *slot = Some(new);
        }
        Ok(())
    }

    /// Finds what to take from a message of interest; false if its format cannot be right.
    fn fill(&self, new: &mut Format, format: &str, labels: &str) -> bool {
        let number = match new.name.as_str() {
            "IMU" | "POWR" | "BAT" | "PARM" => 0,
            "IMU2" => 1,
            "IMU3" => 2,
            _ => return true,
        };
        new.instance = Instance::Named(number);
        let degrees = 180.0 / std::f64::consts::PI;
        let mut offset = 0;
        let mut names = labels.split(',');
        for letter in format.chars() {
            let Some((size, number)) = width(letter) else {
                return false;
            };
            let label = names.next().unwrap_or("");
            if let Some((scalar, unit)) = number {
                let mut take = |quantity, factor: f64| {
                    new.picks.push(Pick {
                        quantity,
                        offset,
                        scalar,
                        factor: factor * unit,
                    });
                };
                let imu = new.name.starts_with("IMU");
                match (label, label.strip_suffix(self.axis.as_str())) {
                    (_, Some("Gyr")) if imu => take(Quantity::Rate, degrees),
                    (_, Some("Acc")) if imu => take(Quantity::Acceleration, 1.0 / STANDARD_GRAVITY),
                    ("T" | "Temp", _) if imu => take(Quantity::Temperature, 1.0),
                    // An integer without a unit of its own is in mV, as the oldest logs have it.
                    ("Vcc", _) if new.name == "POWR" => {
                        let plain = matches!(letter, 'h' | 'H' | 'i' | 'I');
                        take(Quantity::Board, if plain { 1e-3 } else { 1.0 });
                    }
                    ("Volt", _) if new.name == "BAT" => take(Quantity::Battery, 1.0),
                    ("TimeUS", _) => new.clock = Some((offset, scalar, 1.0)),
                    ("TimeMS", _) => new.clock = Some((offset, scalar, 1e3)),
                    ("Value", _) if new.name == "PARM" => new.value = Some((offset, scalar)),
                    ("I" | "Inst" | "Instance", _) => new.instance = Instance::At(offset, scalar),
                    _ => {}
                }
            } else if label == "Name" && new.name == "PARM" {
                new.text = Some((offset, size));
            }
            offset += size;
        }
        offset + 3 == new.length
    }

    /// The samples of a message, or a parameter.
    fn message(&mut self, kind: u8, body: &[u8], at: u64) {
        let Some(format) = self.formats.get(usize::from(kind)).and_then(Option::as_ref) else {
            return;
        };
        let Some((offset, scalar, us)) = format.clock else {
            return;
        };
        let time_us = (scalar.read(body, offset).unwrap_or(0.0) * us) as u64;
        if let (Some((from, size)), Some((offset, scalar))) = (format.text, format.value) {
            let bytes = body.get(from..from + size).unwrap_or(&[]);
            let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
            let name = std::str::from_utf8(bytes.get(..end).unwrap_or(&[]));
            if let (Ok(name), Some(value)) = (name, scalar.read(body, offset)) {
                self.parameters.set(name, time_us, value);
            }
            return;
        }
        if format.picks.is_empty() {
            return;
        }
        let instance = match format.instance {
            Instance::Named(number) => number,
            Instance::At(offset, scalar) => scalar.read(body, offset).unwrap_or(0.0) as u8,
        };
        let topic = match format.name.as_str() {
            "POWR" => "POWR",
            "BAT" => "BAT",
            _ => "IMU",
        };
        let averager = &mut self.averager;
        let new = || Sensor {
            source: Source {
                topic,
                instance,
                numbers: topic == "IMU",
                raw: false,
                channels: Vec::new(),
                ids: Vec::new(),
                accel_id: None,
                recalibrated: Vec::new(),
            },
            topic: averager.topic(format!("{topic} {instance}")),
            channels: BTreeMap::new(),
        };
        let sensor = self.sensors.entry((topic, instance)).or_insert_with(new);
        let mut samples = Vec::with_capacity(format.picks.len());
        for pick in &format.picks {
            let value = pick.scalar.read(body, pick.offset).unwrap_or(f64::NAN) * pick.factor;
            let channel = *sensor.channels.entry(pick.quantity).or_insert_with(|| {
                let column = pick.quantity.column();
                let text = pick.quantity.source(&self.axis);
                let channel = self.averager.channel(sensor.topic, column, text);
                sensor.source.channels.push((column, channel));
                channel
            });
            samples.push(Sample {
                channel,
                value,
                back_us: 0,
            });
        }
        let message = Message {
            time_us,
            at,
            samples,
        };
        self.averager.take(sensor.topic, message);
    }
}

/// Zeros and ones, as memory that was not written holds them.
fn is_erased(bytes: &[u8]) -> bool {
    bytes.iter().all(|b| matches!(b, 0 | 0xFF))
}

/// Bytes of a format's letter; type and unit where it is a number.
fn width(letter: char) -> Option<(usize, Option<(Scalar, f64)>)> {
    let number = |scalar: Scalar, unit: f64| Some((scalar.size(), Some((scalar, unit))));
    match letter {
        'b' => number(Scalar::I8, 1.0),
        'B' | 'M' => number(Scalar::U8, 1.0),
        'h' => number(Scalar::I16, 1.0),
        'H' => number(Scalar::U16, 1.0),
        'i' => number(Scalar::I32, 1.0),
        'I' => number(Scalar::U32, 1.0),
        'q' => number(Scalar::I64, 1.0),
        'Q' => number(Scalar::U64, 1.0),
        'f' => number(Scalar::F32, 1.0),
        'd' => number(Scalar::F64, 1.0),
        'c' => number(Scalar::I16, 0.01),
        'C' => number(Scalar::U16, 0.01),
        'e' => number(Scalar::I32, 0.01),
        'E' => number(Scalar::U32, 0.01),
        'L' => number(Scalar::I32, 1e-7),
        'n' => Some((4, None)),
        'N' => Some((16, None)),
        'Z' | 'a' => Some((64, None)),
        // Half precision, which no message of interest has.
        'g' => Some((2, None)),
        _ => None,
    }
}
