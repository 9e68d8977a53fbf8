//! Controls of one closing (`gyrogen close --controls`): columns that mean nothing, which must get no name, and
//! effects that are put into what the closing left, which should.
//!
//! The negative control closes the record again with [`fakes`] among its columns. The positive control takes the
//! effects that came nearest to a name without getting one, finds by the self-test's own trials how large each must be to be
//! found in this record, adds twice that to the measured residual, and closes.

use super::fakes::{self, Fake};
use super::from_record;
use super::outcome::Minimum;
use super::planted::{Draw, Kind};
use super::scene::Scene;
use super::score::{counted, scores};
use super::trial::{Answer, Mark};
use super::{Case, Progress, Request, marked, of_record, trials};
use crate::design::Design;
use crate::error::Result;
use crate::record::{ThermalRecord, condensed};
use crate::thermal::close;
use crate::thermal::close::{Closed, Named, Taken};
use crate::thermal::intake::refused;
use crate::thermal::search::Effort;
use crate::verdict::Fate;
use serde::Serialize;
use std::collections::BTreeMap;

/// Most effects that are planted.
const MOST: usize = 4;

/// Records of each with twice the size that is found; sign and shape are drawn.
const RECORDS: usize = 3;

/// By how much what is planted exceeds the least size that is found.
const EXCESS: f64 = 2.0;

/// Streams of random numbers beyond those of the trials.
const STREAMS: u64 = 1 << 40;

/// What a search says of a record.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Seen {
    /// Its steps.
    pub names: Vec<Named>,
    /// By id: the probability of a candidate alone, before any step.
    pub alone: BTreeMap<String, f64>,
    /// The same beside the steps; steps are not among them.
    pub beside: BTreeMap<String, f64>,
}

/// What looks at a record with fakes.
pub type Look<'a> = &'a dyn Fn(&ThermalRecord) -> Result<Seen>;

/// How far the controls are, for whoever waits.
pub struct Shown<'a> {
    /// What begins now.
    pub stage: &'a dyn Fn(&str),
    /// How much of it is done.
    pub progress: Progress<'a>,
}

/// A column without meaning.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FakeSeen {
    /// Its column.
    pub name: String,
    /// What has its spectrum.
    pub like: String,
    /// A step has its name.
    pub is_named: bool,
    /// A step lists it as indistinguishable.
    pub is_listed: bool,
    /// Chance that the best of all candidates does as well, before any step; `None`: not judged.
    pub p_value: Option<f64>,
    /// The same beside the steps; `None` for a step.
    pub p_value_beside_steps: Option<f64>,
}

/// The negative control.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Negative {
    /// Of the closing without fakes: effect and probability of each step.
    pub steps: Vec<(String, f64)>,
    /// Steps with the fakes in.
    pub steps_with_fakes: Vec<String>,
    /// One by one.
    pub fakes: Vec<FakeSeen>,
    /// How many of them are steps.
    pub named: usize,
    /// How many are listed by a step as indistinguishable: a record that is so regular that a column of the same
    /// spectrum follows what moves it.
    pub listed: usize,
    /// The least of their probabilities before any step.
    pub least_p_value: Option<f64>,
    /// The same beside the steps.
    pub least_p_value_beside_steps: Option<f64>,
}

/// An effect that was planted in what the closing left.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Planted {
    /// Its id.
    pub effect: String,
    /// Its probability in the closing.
    pub p_value: f64,
    /// The least size that is found in nine of ten records of this experiment and noise.
    pub detectable: Option<Minimum>,
    /// What was planted, in noises of a row; `None`: nothing.
    pub times_noise: Option<f64>,
    /// The same in the effect's own unit (geometric mean).
    pub in_own_unit: Option<f64>,
    /// What that is, with the unit.
    pub own_unit: String,
    /// Records.
    pub records: usize,
    /// In how many a step has its name.
    pub named: usize,
    /// In how many a step has another name, and lists it.
    pub only_listed: usize,
    /// Other names, with how often.
    pub wrong_names: Vec<(String, usize)>,
    /// Why nothing was planted; empty: something was.
    pub remark: String,
}

/// What the controls of a closing say.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Controls {
    /// Columns without meaning.
    pub negative: Negative,
    /// Effects that the closing did not name.
    pub positive: Vec<Planted>,
    /// No fake has a name.
    pub holds: bool,
}

impl Controls {
    /// What does not hold, in a sentence; `None`: everything does.
    pub fn failure(&self) -> Option<String> {
        let named: Vec<String> = self
            .negative
            .fakes
            .iter()
            .filter(|f| f.is_named)
            .map(|f| format!("covariate:{} (spectrum of: {})", f.name, f.like))
            .collect();
        (!named.is_empty()).then(|| {
            format!(
                "negative control: {} of {} columns without meaning get a name, {}: chance does that in about one record of 100; otherwise a name is no evidence in this one",
                named.len(),
                self.negative.fakes.len(),
                named.join(", ")
            )
        })
    }
}

/// Controls of a closed record. `threads` work at the same time; the result does not depend on it.
///
/// # Errors
/// A record that cannot be closed.
pub fn run(
    closed: &Closed,
    record: &ThermalRecord,
    design: &Design,
    threads: usize,
    shown: &Shown<'_>,
) -> Result<Controls> {
    (shown.stage)("closing with columns that mean nothing");
    let negative = negative(closed, record, &|r| look(r, design, Effort::default()))?;
    let answer = |r: &ThermalRecord| close::names(r, design, Effort::default());
    let positive = positive(closed, design, threads, shown, &answer)?;
    Ok(Controls {
        holds: negative.named == 0,
        negative,
        positive,
    })
}

/// What [`close::close`] would say of a record, with the probabilities of what it does not name.
///
/// # Errors
/// As there.
pub fn look(record: &ThermalRecord, design: &Design, effort: Effort) -> Result<Seen> {
    let taken = Taken::of(record, design, Vec::new())?;
    let unusable = |e: crate::statistics::Unusable| refused(record, &design.record, e.to_string());
    let search = taken.search(effort);
    let found = search.run().map_err(unusable)?;
    let model = search.model(&found.terms).map_err(unusable)?;
    let last = search.judge(&model, effort.surrogates);
    let probabilities = |judged: &[crate::thermal::search::judge::Judged]| {
        let each = judged.iter().filter(|j| j.candidate.named());
        each.map(|j| (j.candidate.id(), j.p_value)).collect()
    };
    Ok(Seen {
        alone: probabilities(&found.first),
        beside: probabilities(&last.judged),
        names: found
            .terms
            .into_iter()
            .map(|term| Named {
                effect: term.id(),
                rivals: term.rivals,
            })
            .collect(),
    })
}

/// The record again, with fakes among its columns.
///
/// # Errors
/// A record that cannot be closed.
pub fn negative(closed: &Closed, record: &ThermalRecord, look: Look<'_>) -> Result<Negative> {
    let short = condensed(record);
    let mut record = short.map_or_else(|| record.clone(), |(short, _)| short);
    let fakes = fakes::of(closed);
    for fake in &fakes {
        record
            .columns
            .insert(fake.name.clone(), fake.values.clone());
    }
    let seen = look(&record)?;
    let fakes: Vec<FakeSeen> = fakes.into_iter().map(|fake| of_fake(fake, &seen)).collect();
    let least = |p: fn(&FakeSeen) -> Option<f64>| fakes.iter().filter_map(p).reduce(f64::min);
    let steps = closed.closure.steps.iter();
    Ok(Negative {
        steps: steps.map(|s| (s.effect.clone(), s.p_value)).collect(),
        steps_with_fakes: seen.names.iter().map(|n| n.effect.clone()).collect(),
        named: fakes.iter().filter(|f| f.is_named).count(),
        listed: fakes.iter().filter(|f| f.is_listed).count(),
        least_p_value: least(|f| f.p_value),
        least_p_value_beside_steps: least(|f| f.p_value_beside_steps),
        fakes,
    })
}

fn of_fake(fake: Fake, seen: &Seen) -> FakeSeen {
    let id = format!("covariate:{}", fake.name);
    FakeSeen {
        is_named: seen.names.iter().any(|n| n.effect == id),
        is_listed: seen.names.iter().any(|n| n.rivals.contains(&id)),
        p_value: seen.alone.get(&id).copied(),
        p_value_beside_steps: seen.beside.get(&id).copied(),
        name: fake.name,
        like: fake.like,
    }
}

/// Effects that were judged and not named, planted in what the closing left.
///
/// # Errors
/// A record that cannot be closed.
pub fn positive(
    closed: &Closed,
    design: &Design,
    threads: usize,
    shown: &Shown<'_>,
    answer: Answer<'_>,
) -> Result<Vec<Planted>> {
    let scenes = [from_record::scene(closed)];
    let [scene] = &scenes;
    let (cases, p_values) = nearest(closed, design, scene);
    let request = Request {
        records: 2,
        clean: 0,
        threads,
        ..Request::default()
    };
    (shown.stage)("finding how large an effect must be to be named");
    let marks = marked(
        &trials(&scenes, &cases, &[], &request),
        &request,
        shown.progress,
        answer,
    )?;
    let sizes = scores(&scenes, &cases, &marks, &request);
    let residual = closed.after.residual(&closed.channels);
    (shown.stage)("closing with planted effects");
    let mut out = Vec::new();
    for ((case, p_value), score) in cases.iter().zip(p_values).zip(sizes) {
        let mut planted = Planted {
            effect: score.effect,
            p_value,
            detectable: score.minimum_detectable,
            times_noise: None,
            in_own_unit: None,
            own_unit: score.own_unit,
            records: 0,
            named: 0,
            only_listed: 0,
            wrong_names: Vec::new(),
            remark: score.remark,
        };
        match &planted.detectable {
            Some(least) if least.relation != "above" => {
                let times = EXCESS * least.times_noise;
                let stream = STREAMS + (out.len() * RECORDS) as u64;
                let marks = in_residual(scene, &residual, &case.kind, times, stream, answer)?;
                planted.count(times, &marks);
            }
            Some(least) => {
                planted.remark = format!("not found at {} noises of a row", least.times_noise);
            }
            None => {}
        }
        out.push(planted);
        (shown.progress)(out.len(), cases.len());
    }
    Ok(out)
}

impl Planted {
    fn count(&mut self, times: f64, marks: &[Mark]) {
        let mut logarithms = 0.0;
        for mark in marks {
            let Mark::Closed {
                is_named,
                is_listed,
                size,
                ..
            } = mark
            else {
                continue;
            };
            self.records += 1;
            self.named += usize::from(*is_named);
            self.only_listed += usize::from(*is_listed && !is_named);
            logarithms += size.ln();
        }
        self.wrong_names = counted(marks);
        if self.records == 0 {
            self.remark = "the record cannot show so much of it".to_owned();
            return;
        }
        self.times_noise = Some(times);
        self.in_own_unit = Some((logarithms / self.records as f64).exp());
    }
}

/// Effects of the catalogue that came nearest to a name without being one or listed by one, the least
/// probability first; their probabilities.
fn nearest(closed: &Closed, design: &Design, scene: &Scene) -> (Vec<Case>, Vec<f64>) {
    let mut rejected: Vec<(&str, f64, f64)> = closed
        .closure
        .evidence
        .iter()
        .filter(|e| e.fate == Fate::Rejected)
        .filter_map(|e| Some((e.effect.as_str(), e.p_value?, e.gain?)))
        .collect();
    rejected.sort_by(|a, b| a.1.total_cmp(&b.1).then(b.2.total_cmp(&a.2)));
    let mut cases = of_record(design, scene);
    cases.retain(|c| {
        let is_shown = || {
            let draw = Draw::new(0, STREAMS);
            c.kind
                .sized(scene, &draw, scene.noise.white_rms_dps)
                .is_some()
        };
        let is_excluded = rejected.iter().any(|(id, ..)| *id == c.kind.id());
        matches!(c.kind, Kind::Catalogue(_)) && c.remark.is_empty() && is_excluded && is_shown()
    });
    let place = |c: &Case| rejected.iter().position(|(id, ..)| *id == c.kind.id());
    cases.sort_by_key(place);
    cases.truncate(MOST);
    let p_values = cases
        .iter()
        .filter_map(|c| rejected.get(place(c)?).map(|r| r.1))
        .collect();
    (cases, p_values)
}

/// Records with the measured residual in place of noise.
fn in_residual(
    scene: &Scene,
    residual_dps: &[f64],
    kind: &Kind,
    times: f64,
    stream: u64,
    answer: Answer<'_>,
) -> Result<Vec<Mark>> {
    let mut out = Vec::new();
    for k in 0..RECORDS as u64 {
        let draw = Draw::new(Request::default().seed, stream + k);
        let target_dps = times * scene.noise.white_rms_dps;
        let Some((plant, size)) = kind.sized(scene, &draw, target_dps) else {
            out.push(Mark::NotShown);
            continue;
        };
        let mut taken = scene.take(&plant);
        for (v, r) in taken.rate_out_dps.iter_mut().zip(residual_dps) {
            *v += r;
        }
        taken
            .columns
            .insert("rate_out_dps".to_owned(), taken.rate_out_dps);
        let names = answer(&scene.record(taken.columns))?;
        out.push(Mark::of(Some(kind.id()), &names, size));
    }
    Ok(out)
}
