//! `[study]` and `[requirements]`: which words a word-length study varies, and what the figures may be.

use super::table::{Real, Table, Value};
use super::target::Target;
use super::word::Word;
use crate::error::{InputError, Result};
use std::collections::BTreeMap;

/// `[study]`: what varies, and what is to be small.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyOptions {
    /// `words`: those that vary; `None` = every one that the design has.
    pub words: Option<Vec<Word>>,
    /// `[study.ranges]`: least and largest length by word.
    pub ranges: BTreeMap<Word, (u32, u32)>,
    /// `tied`: words that get longer and shorter together.
    pub tied: Vec<Vec<Word>>,
    /// `targets`: what a design costs is counted for these; a front each.
    pub targets: Vec<String>,
    /// `exhaustive`: a space of at most so many designs is searched whole.
    pub exhaustive: u64,
}

impl Default for StudyOptions {
    fn default() -> Self {
        StudyOptions {
            words: None,
            ranges: BTreeMap::new(),
            tied: Vec::new(),
            targets: vec!["cortex-m4".to_owned(), "fpga".to_owned()],
            exhaustive: 2000,
        }
    }
}

/// A figure that can be required.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LimitName {
    /// What words add to the bias, deg/s.
    Bias,
    /// To the drift over temperature, deg/s.
    Drift,
    /// To the noise density, deg/s/sqrt(Hz).
    Noise,
    /// To the angle random walk, deg/sqrt(h).
    Arw,
    /// To the scale factor, ppm.
    ScaleFactor,
    /// The largest line that they make, deg/s.
    Spur,
    /// Bandwidth at least, Hz.
    Bandwidth,
    /// Tables, bytes.
    RomBytes,
    /// Cycles for a row.
    CyclesPerRow,
}

impl LimitName {
    /// All, in the order of the manual.
    pub const ALL: [LimitName; 9] = [
        LimitName::Bias,
        LimitName::Drift,
        LimitName::Noise,
        LimitName::Arw,
        LimitName::ScaleFactor,
        LimitName::Spur,
        LimitName::Bandwidth,
        LimitName::RomBytes,
        LimitName::CyclesPerRow,
    ];

    /// As `[requirements]` and `--for` spell it.
    pub fn name(self) -> &'static str {
        match self {
            LimitName::Bias => "bias_dps",
            LimitName::Drift => "drift_dps",
            LimitName::Noise => "noise_dps_rthz",
            LimitName::Arw => "arw_deg_rth",
            LimitName::ScaleFactor => "scale_factor_ppm",
            LimitName::Spur => "spur_dps",
            LimitName::Bandwidth => "bandwidth_hz",
            LimitName::RomBytes => "rom_bytes",
            LimitName::CyclesPerRow => "cycles_per_row",
        }
    }

    /// True if more is better.
    pub fn is_least(self) -> bool {
        self == LimitName::Bandwidth
    }

    fn of_name(name: &str) -> Option<LimitName> {
        LimitName::ALL.into_iter().find(|l| l.name() == name)
    }
}

/// A figure and how large (of the bandwidth: how small) it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// Which.
    pub name: LimitName,
    /// In the unit of its name; above 0.
    pub value: f64,
}

/// Limits, each figure once, in the order of [`LimitName`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Limits(Vec<Limit>);

impl Limits {
    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Limit> {
        self.0.iter()
    }

    /// That of a figure.
    pub fn get(&self, name: LimitName) -> Option<f64> {
        self.0.iter().find(|l| l.name == name).map(|l| l.value)
    }

    /// True if nothing is required.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Sets the limit of a figure.
    pub fn set(&mut self, name: LimitName, value: f64) {
        self.0.retain(|l| l.name != name);
        self.0.push(Limit { name, value });
        self.0.sort_by_key(|l| l.name);
    }

    /// Reads `bias_dps<=0.01 arw_deg_rth<=0.01`, with blanks or commas between the limits.
    ///
    /// # Errors
    /// What is no such limit, with the limits that there are.
    pub fn parse(text: &str) -> Result<Limits> {
        let names = LimitName::ALL.map(LimitName::name).join(", ");
        let mut limits = Limits::default();
        // A blank on either side of the sign is no end.
        let text = text
            .replace("<=", " <= ")
            .replace(">=", " >= ")
            .replace(',', " ");
        let mut words = text.split_whitespace();
        while let Some(word) = words.next() {
            let refused = |what: String, help: String| -> crate::error::Error {
                InputError::new(format!("`--for`: {what}"))
                    .help(help)
                    .into()
            };
            let Some(name) = LimitName::of_name(word) else {
                let all = LimitName::ALL.map(LimitName::name);
                // `bias_dps=0.01` has no sign of an inequality.
                let (figure, rest) = word.split_once(['=', '<', '>']).unwrap_or((word, ""));
                let near = crate::nearest::nearest(figure, &all);
                let known = LimitName::of_name(figure);
                let what = if known.is_some() { "limit" } else { "figure" };
                let help = match known.map(|f| f.is_least()) {
                    Some(true) => format!("write `{figure}>={rest}`"),
                    Some(false) => format!("write `{figure}<={rest}`"),
                    None => near.map_or_else(
                        || {
                            format!(
                                "name one of {names}, as in \"bias_dps<=0.01 arw_deg_rth<=0.01\""
                            )
                        },
                        |near| format!("did you mean `{near}`?"),
                    ),
                };
                return Err(refused(format!("`{word}` is no {what}"), help));
            };
            let (sign, other) = if name.is_least() {
                (">=", "<=")
            } else {
                ("<=", ">=")
            };
            let found = words.next().unwrap_or("nothing");
            if found != sign {
                let what = if found == other {
                    format!("`{word}` takes {sign}, found {found}")
                } else {
                    format!("after `{word}` stands {found}, not {sign}")
                };
                return Err(refused(what, format!("write `{word}{sign}NUMBER`")));
            }
            let number = words.next().unwrap_or("nothing");
            let value = number
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite() && *v > 0.0);
            let Some(value) = value else {
                let what = format!("the limit of `{word}` is {number}");
                return Err(refused(
                    what,
                    "give a number above 0, with a point as its decimal mark".to_owned(),
                ));
            };
            if limits.get(name).is_some() {
                let help = "give each figure once".to_owned();
                return Err(refused(format!("`{word}` is limited twice"), help));
            }
            limits.set(name, value);
        }
        if limits.is_empty() {
            return Err(InputError::new("`--for` names no figure")
                .help(format!("name at least one of {names}"))
                .into());
        }
        Ok(limits)
    }
}

/// Reads `[requirements]`.
pub(super) fn requirements(t: &Table) -> Result<Limits> {
    let mut limits = Limits::default();
    for name in LimitName::ALL {
        if let Some(value) = t.get(name.name()) {
            let meaning = "how large the figure may be";
            limits.set(name, value.real(Real::Positive, meaning)?);
        }
    }
    Ok(limits)
}

/// Reads `[study]`; what is left out is the default's.
pub(super) fn study(t: &Table) -> Result<StudyOptions> {
    let base = StudyOptions::default();
    let words = match t.get("words") {
        Some(value) => Some(words(&value)?),
        None => None,
    };
    let mut tied = Vec::new();
    if let Some(value) = t.get("tied") {
        for group in value.array(TIED)? {
            tied.push(self::words(&group)?);
        }
        let mut all: Vec<Word> = tied.iter().flatten().copied().collect();
        let count = all.len();
        all.sort();
        all.dedup();
        if all.len() != count {
            let e = value.error("names a word twice");
            return Err(e.help("each word moves with one group at most").into());
        }
    }
    let mut ranges = BTreeMap::new();
    let section = t.section("ranges")?;
    for word in Word::ALL {
        let Some(value) = section.get(word.key()) else {
            continue;
        };
        let (least, most) = word.limits();
        let ends = value.array("[10, 16]")?;
        let range = i128::from(least)..=i128::from(most);
        let read = |k: usize| match ends.get(k) {
            Some(end) => end.integer::<u32>(range.clone(), word.counts()),
            None => Err(value
                .error("has fewer than two ends")
                .help("write `[10, 16]`")
                .into()),
        };
        let (low, high) = (read(0)?, read(1)?);
        if low > high || ends.len() > 2 {
            let e = value.error("is no range");
            return Err(e
                .help("write the least and the largest length, as `[10, 16]`")
                .into());
        }
        ranges.insert(word, (low, high));
    }
    let targets = match t.get("targets") {
        Some(value) => {
            let named = Target::named().map(|(name, t)| (name, t.name()));
            let options: Vec<(&str, &str)> = named.chain([("fpga", "fpga")]).collect();
            let mut targets = Vec::new();
            for name in value.array("[\"cortex-m4\", \"fpga\"]")? {
                let target = name.choice(&options)?.to_owned();
                if !targets.contains(&target) {
                    targets.push(target);
                }
            }
            if targets.is_empty() {
                let e = value.error("names no target");
                return Err(e.help("name at least one, as `[\"cortex-m4\"]`").into());
            }
            targets
        }
        None => base.targets,
    };
    let exhaustive = t.take("exhaustive", Some(base.exhaustive), |v| {
        v.integer(0..=1_000_000, "designs; 0 = never")
    })?;
    Ok(StudyOptions {
        words,
        ranges,
        tied,
        targets,
        exhaustive,
    })
}

const TIED: &str = "[[\"circuit.demodulator.product\", \"circuit.decimator.output\"]]";

fn words(value: &Value) -> Result<Vec<Word>> {
    let keys = Word::ALL.map(|w| (w.key(), w));
    let mut words = Vec::new();
    for key in value.array("[\"circuit.adc.format\", \"circuit.nco.table\"]")? {
        let word = key.choice(&keys)?;
        if words.contains(&word) {
            return Err(key
                .error("is named twice")
                .help("name each word once")
                .into());
        }
        words.push(word);
    }
    words.sort();
    if words.is_empty() {
        let e = value.error("names no word");
        return Err(e.help("name at least one, or leave the key out").into());
    }
    Ok(words)
}
