//! `[requirements]` of the design: what each figure is, whether that is shown to be within its limit, and what
//! mends it where it is not.
//!
//! Figures are what the words add, over the runs by which a study verifies its points ([`crate::study::verify`]), with
//! intervals that hold at once for all of them ([`crate::study::certainty`]). A requirement is met where the whole of the
//! interval is within it: a figure that only seems to be is not met, and the text says that this is the case.

use crate::cost;
use crate::cost::price::Objective;
use crate::design::word::Word;
use crate::design::{Design, Limit, LimitName, limits};
use crate::error::Result;
use crate::study::answer::cost_of;
use crate::study::bandwidth::bandwidth_hz;
use crate::study::certainty::{Bounds, Confidence, JOINT, largest};
use crate::study::figures::Figures;
use crate::study::job::cycles_of_a_processor;
use crate::study::retune::with_lengths;
use crate::study::verify::Verifier;
use crate::text::number;
use serde::Serialize;

/// A requirement and what was obtained.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Requirement {
    /// The figure; its name has the unit.
    pub name: &'static str,
    /// Of bytes and cycles: the target.
    pub target: Option<String>,
    /// As required.
    pub limit: f64,
    /// The limit is the least that the figure may be; else the largest.
    pub at_least: bool,
    /// The figure.
    pub obtained: f64,
    /// What it may be, with the check's confidence; null of what is known without a run.
    pub bounds: Option<[f64; 2]>,
    /// Shown to be within the limit.
    pub met: bool,
    /// Where not: what to change.
    pub mend: Option<String>,
}

impl Requirement {
    /// Why it is not met, in a sentence.
    pub fn failure(&self) -> Option<String> {
        if self.met {
            return None;
        }
        let target = self
            .target
            .as_ref()
            .map_or(String::new(), |t| format!(" on {t}"));
        let within = if self.at_least {
            self.obtained >= self.limit
        } else {
            self.obtained.abs() <= self.limit
        };
        let found = match self.most() {
            Some(most) if within => format!(
                "is not shown to be met: {} was computed, but with {:.0} % confidence its magnitude is only known to be at most {}",
                number(self.obtained, 3),
                100.0 * JOINT,
                number(most, 3)
            ),
            _ => format!("is not met: it is {}", number(self.obtained, 5)),
        };
        let mend = self.mend.as_deref().unwrap_or_default();
        Some(format!(
            "requirement {}{target} {} {:e} {found}. What would mend it: {mend}",
            self.limited(),
            self.sign(),
            self.limit
        ))
    }

    /// What is limited: the figure, or its magnitude where it has a sign.
    pub fn limited(&self) -> String {
        let signed = [LimitName::Bias, LimitName::ScaleFactor];
        match signed.iter().any(|name| name.name() == self.name) {
            true => format!("|{}|", self.name),
            false => self.name.to_owned(),
        }
    }

    /// `<=` or `>=`.
    pub fn sign(&self) -> &'static str {
        if self.at_least { ">=" } else { "<=" }
    }

    /// The largest magnitude that the figure may have, with the check's confidence; `None` of what is known without a run.
    pub fn most(&self) -> Option<f64> {
        self.bounds.map(largest)
    }

    /// How far what is judged, [`most`](Self::most) or the figure itself, is inside of the limit, in parts of it; below 0: outside.
    pub fn margin(&self) -> f64 {
        let judged = self.most().unwrap_or(self.obtained);
        let inside = if self.at_least {
            judged - self.limit
        } else {
            self.limit - judged
        };
        inside / self.limit.max(f64::MIN_POSITIVE)
    }
}

/// Bits that a word is made longer, or shorter, in the search of a mend.
const STEPS: u32 = 4;

/// Every requirement of a design, in the order of [`LimitName`], and the confidence of their intervals.
///
/// # Errors
/// Cycles are required of no processor; a phase loop that cannot lock.
pub fn requirements(design: &Design) -> Result<(Vec<Requirement>, Option<Confidence>)> {
    let limits = &design.requirements;
    if limits.is_empty() {
        return Ok((Vec::new(), None));
    }
    cycles_of_a_processor(design, limits)?;
    let of_words = |l: &&Limit| Bounds::default().of(l.name).is_some();
    let intervals = limits.iter().filter(of_words).count();
    let confidence = (intervals > 0).then(|| Confidence::of(intervals));
    let mut all = Vec::new();
    let mut added = None;
    if let Some(confidence) = confidence {
        let verifier = Verifier::new(design)?;
        added = Some(Added {
            design,
            confidence,
            found: verifier.figures_and_errors(&design.without_stops())?,
            verifier,
            tried: std::cell::OnceCell::new(),
        });
    }
    for limit in limits.iter() {
        match limit.name {
            LimitName::Bandwidth => all.push(bandwidth(design, limit.value)),
            LimitName::RomBytes | LimitName::CyclesPerRow => all.extend(costs(design, limit)),
            _ => all.extend(added.as_ref().map(|a| a.requirement(limit))),
        }
    }
    Ok((all, confidence))
}

fn bandwidth(design: &Design, limit: f64) -> Requirement {
    let obtained = bandwidth_hz(design);
    let met = obtained >= limit;
    Requirement {
        name: LimitName::Bandwidth.name(),
        target: None,
        limit,
        at_least: true,
        obtained,
        bounds: None,
        met,
        mend: (!met).then(|| {
            let mut other = design.clone();
            for ratio in (2..design.circuit.decimator.ratio).rev() {
                other.circuit.decimator.ratio = ratio;
                let hz = bandwidth_hz(&other);
                if hz >= limit && limits::check(&other).is_ok() {
                    return format!(
                        "`circuit.decimator.ratio = {ratio}` has {hz} Hz",
                        hz = number(hz, 5)
                    );
                }
            }
            "raise `circuit.sample_rate_hz`: no ratio has so much".to_owned()
        }),
    }
}

/// Of a limit on bytes or cycles, by target.
fn costs(design: &Design, limit: &Limit) -> Vec<Requirement> {
    let targets = design.study.targets.iter();
    let of = |name: &String| {
        let objective = Objective::of_name(name)?;
        let value = |d: &Design| {
            let cost = cost::of_design(d, objective.target);
            cost_of(&cost, name == "fpga", limit.name)
        };
        let obtained = value(design)?;
        let met = obtained <= limit.value;
        Some(Requirement {
            name: limit.name.name(),
            target: Some(name.clone()),
            limit: limit.value,
            at_least: false,
            obtained,
            bounds: None,
            met,
            mend: (!met).then(|| {
                let steps = shorter(design);
                let tried = steps
                    .iter()
                    .filter_map(|(w, l, d)| Some((*w, *l, value(d)?)));
                mend(tried, obtained, limit, "", |v| v <= limit.value)
            }),
        })
    };
    targets.filter_map(of).collect()
}

/// Designs with one word shorter.
fn shorter(design: &Design) -> Vec<(Word, u32, Design)> {
    changed(design, &|given, by| given.checked_sub(by))
}

/// Designs with one word changed, those with one bit first.
fn changed(design: &Design, to: &dyn Fn(u32, u32) -> Option<u32>) -> Vec<(Word, u32, Design)> {
    let mut out = Vec::new();
    for by in 1..=STEPS {
        for word in Word::ALL {
            let length = word.length(design).and_then(|given| to(given, by));
            let other = length.and_then(|l| Some((l, with_lengths(design, &[(word, l)]).ok()?)));
            out.extend(other.map(|(l, d)| (word, l, d)));
        }
    }
    out
}

/// The first change that is enough, or the one that does most. `most` stands before a value that is an upper bound.
fn mend(
    tried: impl Iterator<Item = (Word, u32, f64)>,
    obtained: f64,
    limit: &Limit,
    most: &str,
    enough: impl Fn(f64) -> bool,
) -> String {
    let mut best: Option<(Word, u32, f64)> = None;
    let mut first: Option<(Word, u32, f64)> = None;
    for (word, length, value) in tried {
        if enough(value) && first.is_none() {
            first = Some((word, length, value));
        }
        if value < obtained && best.is_none_or(|(_, _, v)| value < v) {
            best = Some((word, length, value));
        }
    }
    let name = limit.name.name();
    match (first, best) {
        (Some((word, length, value)), _) => format!(
            "`{}` of {length} {} makes it {most}{value}",
            word.key(),
            word.counts(),
            value = number(value, 3)
        ),
        (None, Some((word, length, value))) => format!(
            "no single word length is enough. Of all changes of one word by up to {STEPS} bits `{}` of {length} {} helps most: it makes \
             it {most}{value}. `gyrogen study DESIGN --for \"{name}<={:e}\"` tries several words together (DESIGN: the design's file)",
            word.key(),
            word.counts(),
            limit.value,
            value = number(value, 3)
        ),
        (None, None) => format!(
            "no single word length that is changed by up to {STEPS} bits improves it. Raise the limit, or see with `gyrogen study DESIGN` \
             what several words do together (DESIGN: the design's file)"
        ),
    }
}

/// What is needed of figures that words make worse.
struct Added<'a> {
    design: &'a Design,
    verifier: Verifier<'a>,
    confidence: Confidence,
    found: (Figures, crate::study::certainty::Errors),
    /// Figures with one word longer, when they are wanted.
    tried: std::cell::OnceCell<Vec<(Word, u32, Bounds)>>,
}

impl Added<'_> {
    fn requirement(&self, limit: &Limit) -> Requirement {
        let (figures, errors) = &self.found;
        let bounds = Bounds::new(figures, errors, None, &self.confidence);
        let interval = bounds.of(limit.name).unwrap_or_default();
        let met = largest(interval) <= limit.value;
        Requirement {
            name: limit.name.name(),
            target: None,
            limit: limit.value,
            at_least: false,
            obtained: figures.of(limit.name).unwrap_or_default(),
            bounds: Some(interval),
            met,
            mend: (!met).then(|| {
                let tried = self.tried.get_or_init(|| self.longer()).iter();
                let most = |b: &Bounds| b.of(limit.name).map(largest);
                let tried = tried.filter_map(|(w, l, b)| Some((*w, *l, most(b)?)));
                mend(tried, largest(interval), limit, "at most ", |v| {
                    v <= limit.value
                })
            }),
        }
    }

    fn longer(&self) -> Vec<(Word, u32, Bounds)> {
        let designs = changed(self.design, &|given, by| Some(given + by));
        let mut out = Vec::new();
        for (word, length, design) in designs {
            if let Ok((f, e)) = self.verifier.figures_and_errors(&design.without_stops()) {
                out.push((word, length, Bounds::new(&f, &e, None, &self.confidence)));
            }
        }
        out
    }
}
