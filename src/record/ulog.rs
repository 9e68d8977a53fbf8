//! PX4's log format, as far as a thermal record needs it: the gyro's samples and temperature, the
//! accelerometer along the same axis, the supply.
//!
//! Written from the public specification (PX4 guide, "ULog File Format"). The file describes
//! itself: format definitions name the fields of each topic, subscriptions number the topics.

use super::averager::Averager;
use super::corrections;
use super::log_bytes::{Damage, Scalar, Stream};
use super::log_clock::Message;
use super::log_gyros::{self, Source};
use super::parameters::Parameters;
use super::thermal::ThermalRecord;
use super::ulog_fields::{Pick, Wanted, pick, wanted};
use super::ulog_layout::{Definitions, Layout};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// The first bytes of every ULog.
pub(super) const MAGIC: [u8; 7] = [0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35];

/// What a writer puts in from time to time, so that a reader finds its way again.
const SYNC: [u8; 8] = [0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12];

/// The bit of the incompatible flags that says that data was appended.
const APPENDED: u8 = 1;

const GIVE_UP: &str = "the log is damaged where it says what it holds; take another copy of it";

/// The topic that says which gyro is in use.
const SELECTION: &str = "sensor_selection";

/// The topic of that gyro.
const IN_USE: &str = "sensor_combined";

/// Fields in which a topic says whose it is.
const IDS: [&str; 2] = ["gyro_device_id", "device_id"];

/// What to take from the messages of one subscription.
struct Subscription {
    layout: Layout,
    picks: Vec<Pick>,
    /// In the sources and the averager's topics.
    source: usize,
    topic: usize,
    id: Option<(usize, Scalar)>,
    /// The number of calibrations so far.
    calibrations: Option<(usize, Scalar)>,
    calibrated: Option<f64>,
}

/// Reads a ULog as a thermal record: rows of `average_s` of the gyro `instance`, axis `axis`.
///
/// # Errors
/// No ULog, a damaged definition, an incompatible version, a clock of the gyro's that runs backwards, no gyro of
/// that instance, too few rows. Damage among the data is left out and told.
pub(super) fn read<R: Read>(
    input: R,
    path: &Path,
    mapping: &RecordMapping,
) -> Result<(ThermalRecord, Vec<Warning>)> {
    let mut reader = Reader {
        stream: Stream::new(path, input),
        definitions: Definitions::default(),
        subscriptions: BTreeMap::new(),
        sources: Vec::new(),
        in_use: Vec::new(),
        parameters: Parameters::default(),
        unsettled: Vec::new(),
        now_us: 0,
        appended: Vec::new(),
        damage: Damage::default(),
        averager: Averager::new(mapping),
        fields: wanted(mapping.axis.index()),
    };
    reader.run()?;
    dated(&mut reader.unsettled, &mut reader.parameters, u64::MAX);
    let Reader {
        mut sources,
        mut averager,
        ..
    } = reader;
    averager.seal();
    for source in sources.iter_mut().filter(|s| s.topic == IN_USE) {
        source.ids.clone_from(&reader.in_use);
    }
    // Sources stand in the order of the fields, not of the log.
    let order = |s: &Source| reader.fields.iter().position(|f| f.topic == s.topic);
    sources.sort_by_key(|s| (order(s), s.instance));
    let nothing = ("no gyro topic", reader.damage);
    let (mut choice, chosen) = log_gyros::choose(&averager, &sources, mapping, path, nothing)?;
    let source = log_gyros::source_of_rate(&averager, &sources, &choice, chosen);
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
        let found = corrections::px4(&reader.parameters, of)?;
        log_gyros::corrected(&averager, &mut choice, found, source);
    }
    averager.finish(path, mapping, reader.damage, choice)
}

/// Sets parameters that were read, each (name, us, value): none later than the message that follows, by which a wild time
/// before them is told.
fn dated(unsettled: &mut Vec<(String, u64, f64)>, parameters: &mut Parameters, next_us: u64) {
    for (name, time_us, value) in unsettled.drain(..) {
        parameters.set(&name, time_us.min(next_us), value);
    }
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
    /// The topics of interest that the log has, by instance.
    sources: Vec<Source>,
    /// The gyro in use: us since power-on, `device_id`.
    in_use: Vec<(u64, u32)>,
    parameters: Parameters,
    /// Parameters that no message with a time has followed yet.
    unsettled: Vec<(String, u64, f64)>,
    /// The time of the message that was read last, us.
    now_us: u64,
    /// Where appended data begin, the nearest last.
    appended: Vec<u64>,
    damage: Damage,
    averager: Averager,
    fields: Vec<Wanted>,
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
            b'P' => self.parameter(body),
            // Information, text, marks: nothing that a record holds.
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

    /// A parameter: a length, `type NAME`, four bytes.
    fn parameter(&mut self, body: &[u8]) {
        let Some((length, rest)) = body.split_first() else {
            return;
        };
        let Some((key, value)) = rest.split_at_checked(usize::from(*length)) else {
            return;
        };
        let key = std::str::from_utf8(key)
            .ok()
            .and_then(|k| k.split_once(' '));
        let value = match key {
            Some(("float", _)) => Scalar::F32.read(value, 0),
            Some(("int32_t", _)) => Scalar::I32.read(value, 0),
            _ => None,
        };
        if let Some(((_, name), value)) = key.zip(value) {
            // The averager's time lags: there messages wait for others to agree with theirs.
            let time_us = self.now_us.max(self.averager.now_us);
            self.unsettled.push((name.to_owned(), time_us, value));
        }
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
        let topic = self
            .fields
            .iter()
            .find(|f| f.topic == name)
            .map(|f| f.topic);
        let Some(topic) = topic.or((name == SELECTION).then_some(SELECTION)) else {
            self.subscriptions.insert(number, None);
            return Ok(true);
        };
        let Some(layout) = self.definitions.layout(name) else {
            return Err(self.stream.broken(
                start,
                &format!("the log has topic {name} without a usable definition of it"),
                GIVE_UP,
            ));
        };
        let source = self.source(topic, instance, &layout);
        let of = self.averager.topic(format!("{topic} {instance}"));
        let mut picks = Vec::new();
        for field in self.fields.iter().filter(|f| f.topic == name) {
            let Some(mut pick) = pick(&layout, field) else {
                continue;
            };
            let text = format!("{topic}.{}", field.field);
            pick.channel = self.averager.channel(of, field.column, text);
            if let Some(source) = self.sources.get_mut(source) {
                source.channels.push((field.column, pick.channel));
            }
            picks.push(pick);
        }
        let subscription = Subscription {
            id: IDS.iter().find_map(|id| layout.field(id)),
            calibrations: layout.field("gyro_calibration_count"),
            calibrated: None,
            layout,
            picks,
            source,
            topic: of,
        };
        self.subscriptions.insert(number, Some(subscription));
        Ok(true)
    }

    /// The source of a topic's instance, a new one where there is none.
    fn source(&mut self, topic: &'static str, instance: u8, layout: &Layout) -> usize {
        let same = |s: &Source| s.topic == topic && s.instance == instance;
        if let Some(found) = self.sources.iter().position(same) {
            return found;
        }
        // Drivers of old versions took the learnt offset off themselves.
        let old = layout.field("scaling").is_some();
        self.sources.push(Source {
            topic,
            instance,
            numbers: topic != IN_USE && topic != SELECTION,
            raw: topic.starts_with("sensor_gyro") && !old,
            channels: Vec::new(),
            ids: Vec::new(),
            accel_id: None,
            recalibrated: Vec::new(),
        });
        self.sources.len() - 1
    }

    /// Samples; false if the message is damaged.
    fn data(&mut self, body: &[u8], start: u64) -> Result<bool> {
        let Some((number, data)) = body.split_first_chunk::<2>() else {
            return Ok(false);
        };
        let Some(subscription) = self.subscriptions.get_mut(&u16::from_le_bytes(*number)) else {
            return Ok(false);
        };
        let Some(subscription) = subscription else {
            return Ok(true);
        };
        let time = subscription.layout.time_us(data);
        let (true, Some(time_us)) = (data.len() == subscription.layout.logged_bytes, time) else {
            return Ok(false);
        };
        self.now_us = time_us;
        let next_us = time_us.max(self.averager.now_us);
        dated(&mut self.unsettled, &mut self.parameters, next_us);
        let read = |place: Option<(usize, Scalar)>| place.and_then(|(o, s)| s.read(data, o));
        if let (Some(id), Some(source)) = (
            read(subscription.id),
            self.sources.get_mut(subscription.source),
        ) {
            match source.topic {
                SELECTION => {
                    let id = id as u32;
                    if id != 0 && self.in_use.last().is_none_or(|(_, last)| *last != id) {
                        self.in_use.push((time_us, id));
                    }
                }
                "sensor_accel" => source.accel_id = source.accel_id.or(Some(id as u32)),
                _ => source.note(time_us, id as u32),
            }
            if let Some((offset, scalar)) = subscription.layout.field("accel_device_id") {
                let id = scalar.read(data, offset).map(|id| id as u32);
                source.accel_id = source.accel_id.or(id.filter(|id| *id != 0));
            }
            if let Some(count) = read(subscription.calibrations) {
                if subscription
                    .calibrated
                    .is_some_and(|before| before != count)
                {
                    source.recalibrated.push(time_us);
                }
                subscription.calibrated = Some(count);
            }
        }
        let mut message = Message {
            time_us,
            at: start,
            samples: Vec::with_capacity(subscription.picks.len()),
        };
        for pick in &subscription.picks {
            pick.take(data, &mut message.samples);
        }
        if !message.samples.is_empty() {
            self.averager.take(subscription.topic, message);
        }
        Ok(true)
    }
}
