//! `gyrogen close --self-test`: what the search finds, and what it does not.
//!
//! Effects of several sizes are planted in records, by the physics of [`crate::plant`], and closed like any other
//! record. The experiments are simulated ([`programs`]) or those of the user's own record ([`from_record`]); what is
//! planted is in [`planted`], how rows come about in [`scene`], one record in [`trial`], what the counts say in
//! [`statistics`] and `score`, the result in [`outcome`]. [`controls`] (with [`fakes`]) are those of one closing. Beside the command line this is the only place, with `cosim` and
//! `simulation`, that knows both the plant and what is under test.

pub mod controls;
pub mod fakes;
pub mod from_record;
pub mod outcome;
pub mod planted;
pub mod programs;
pub mod scene;
mod score;
pub mod statistics;
pub mod trial;

use crate::design::{Design, RecordMapping, UserEffect};
use crate::error::{InputError, Result};
use crate::output::name_of;
use crate::record::{ThermalRecord, Warning};
use crate::thermal::close;
use crate::thermal::search::Effort;
use outcome::{NoiseOf, Outcome, SCHEMA};
use planted::{CATALOGUE, COUPLING, Kind};
use programs::Program;
use scene::Scene;
use score::{alarms, failures, scores};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use trial::{Answer, Colour, Mark, Trial};

/// Sizes that are planted, in noises of a row.
pub const SIZES: [f64; 5] = [0.5, 1.0, 2.0, 5.0, 10.0];

/// Experiments that clean records go through.
const CLEAN: [Program; 5] = [
    Program::Thermal,
    Program::Table,
    Program::Drive,
    Program::Quadrature,
    Program::Room,
];

/// What is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Records of each effect and size.
    pub records: usize,
    /// Records of each noise without an effect.
    pub clean: usize,
    /// Rows of a simulated record.
    pub rows: usize,
    /// Of all random numbers.
    pub seed: u64,
    /// That work at the same time; the result does not depend on it.
    pub threads: usize,
    /// Ids of the effects that are planted; empty: all.
    pub only: Vec<String>,
    /// The command, for the result.
    pub command: String,
}

impl Default for Request {
    fn default() -> Self {
        Request {
            records: 4,
            clean: 25,
            rows: 160,
            seed: 1,
            threads: 1,
            only: Vec::new(),
            command: String::new(),
        }
    }
}

/// Done, of how many.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// An effect in its experiment.
struct Case {
    kind: Kind,
    scene: usize,
    remark: String,
}

/// Tests the search as it is.
///
/// # Errors
/// A record that cannot be closed; an effect in [`Request::only`] that cannot be planted.
pub fn run(
    design: &Design,
    record: Option<(&ThermalRecord, &[Warning])>,
    request: &Request,
    progress: Progress<'_>,
) -> Result<Outcome> {
    let judged = match record {
        Some(_) => design.clone(),
        // Simulated records have the contract's columns.
        None => Design {
            record: RecordMapping::default(),
            ..design.clone()
        },
    };
    let answer = |r: &ThermalRecord| close::names(r, &judged, Effort::default());
    run_with(design, record, request, progress, &answer)
}

/// Tests whatever gives names to records.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    design: &Design,
    record: Option<(&ThermalRecord, &[Warning])>,
    request: &Request,
    progress: Progress<'_>,
    answer: Answer<'_>,
) -> Result<Outcome> {
    let mut own_steps = Vec::new();
    let (scenes, mut cases, clean): (Vec<Scene>, Vec<Case>, Vec<usize>) = match record {
        Some((record, warnings)) => {
            let closed = close::close(record, warnings.to_vec(), design, "", Effort::default())?;
            own_steps.extend(closed.closure.steps.iter().map(|s| s.effect.clone()));
            let scene = from_record::scene(&closed);
            let cases = of_record(design, &scene);
            (vec![scene], cases, vec![0])
        }
        None => {
            let scenes: Vec<Scene> = Program::ALL
                .iter()
                .map(|p| programs::scene(design, *p, request.rows))
                .collect();
            let cases = simulated(design, &scenes);
            let at = |p: &Program| Program::ALL.iter().position(|q| q == p);
            let clean = CLEAN.iter().filter_map(at).collect();
            (scenes, cases, clean)
        }
    };
    let known: Vec<String> = cases.iter().map(|c| c.kind.id()).collect();
    if let Some(id) = request.only.iter().find(|id| !known.contains(id)) {
        let names: Vec<&str> = known.iter().map(String::as_str).collect();
        let help = match crate::nearest::nearest(id, &names) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("these can: {}", known.join(", ")),
        };
        return Err(InputError::new(format!("no effect `{id}` can be planted"))
            .help(help)
            .into());
    }
    cases.retain(|c| request.only.is_empty() || request.only.contains(&c.kind.id()));
    let trials = trials(&scenes, &cases, &clean, request);
    let marks = marked(&trials, request, progress, answer)?;
    let noise = scenes.first().map(|s| s.noise).unwrap_or_default();
    let (of_effects, of_clean) = marks.split_at(cases.len() * SIZES.len() * request.records);
    let effects = scores(&scenes, &cases, of_effects, request);
    let false_alarms = alarms(of_clean, request);
    let failures = failures(&effects, &false_alarms);
    Ok(Outcome {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        design_sha256: crate::digest::sha256(design.source.text.as_bytes()),
        command: request.command.clone(),
        record: record.map(|r| name_of(&r.0.source)),
        own_steps,
        rows: scenes.first().map_or(0, Scene::len),
        seed: request.seed,
        noise: NoiseOf {
            white_rms_dps: noise.white_rms_dps,
            flicker_dps: noise.flicker_dps,
            walk_dps_rts: noise.walk_dps_rts,
        },
        effects,
        holds: failures.is_empty(),
        failures,
        false_alarms,
    })
}

/// Every effect in the simulated experiment that shows it.
fn simulated(design: &Design, scenes: &[Scene]) -> Vec<Case> {
    let case = |kind: Kind, program: Program| {
        let scene = Program::ALL.iter().position(|p| *p == program).unwrap_or(0);
        Case {
            remark: scenes.get(scene).map_or(String::new(), |s| lack(&kind, s)),
            kind,
            scene,
        }
    };
    let mut out: Vec<Case> = CATALOGUE
        .iter()
        .chain([&COUPLING])
        .map(|p| case(Kind::Catalogue(p), p.program))
        .collect();
    out.push(case(
        Kind::Covariate("humidity_pct".to_owned()),
        Program::Room,
    ));
    for effect in &design.effects {
        out.push(of_user(effect, scenes));
    }
    out
}

/// An effect of the user's in the simulated experiment that shows most of it.
fn of_user(effect: &UserEffect, scenes: &[Scene]) -> Case {
    let kind = Kind::User(effect.clone());
    let has_all = |s: &&(usize, &Scene)| kind.lacks(s.1).is_none();
    let numbered: Vec<(usize, &Scene)> = scenes.iter().enumerate().collect();
    let moves = |s: &Scene| {
        let moving = |name: &str| {
            let column = s.columns.get(name).map_or(&s.time_s, |c| c);
            let (low, high) = crate::thermal::channels::range(column);
            high > low
        };
        effect.columns().filter(|n| moving(n)).count()
    };
    let best = numbered
        .iter()
        .filter(has_all)
        .max_by_key(|(at, s)| (moves(s), std::cmp::Reverse(*at)));
    match best {
        Some((scene, _)) => Case {
            kind,
            scene: *scene,
            remark: String::new(),
        },
        None => Case {
            remark: format!(
                "no simulated experiment has all of its columns ({}): give a record of your own",
                effect.columns().collect::<Vec<_>>().join(", ")
            ),
            kind,
            scene: 0,
        },
    }
}

/// Every effect in the experiment of a record.
fn of_record(design: &Design, scene: &Scene) -> Vec<Case> {
    let known = crate::record::columns::is_known;
    let auxiliary = scene.columns.keys().filter(|name| !known(name));
    let mut kinds: Vec<Kind> = CATALOGUE.iter().map(Kind::Catalogue).collect();
    if scene.thermometer == "phase_rad" {
        kinds.push(Kind::Catalogue(&COUPLING));
    }
    kinds.extend(auxiliary.map(|name| Kind::Covariate(name.clone())));
    kinds.extend(design.effects.iter().map(|e| Kind::User(e.clone())));
    let case = |kind: Kind| Case {
        remark: lack(&kind, scene),
        kind,
        scene: 0,
    };
    kinds.into_iter().map(case).collect()
}

/// Which column is missing, in words; empty: none.
fn lack(kind: &Kind, scene: &Scene) -> String {
    let name = kind.lacks(scene);
    name.map_or(String::new(), |name| format!("there is no column {name}"))
}

/// All records, those of the effects first: effect by effect, size by size.
fn trials<'a>(
    scenes: &'a [Scene],
    cases: &'a [Case],
    clean: &[usize],
    request: &Request,
) -> Vec<Option<Trial<'a>>> {
    let mut out = Vec::new();
    for case in cases {
        for size in SIZES {
            for _ in 0..request.records {
                let stream = out.len() as u64 + 1;
                let scene = scenes.get(case.scene).filter(|_| case.remark.is_empty());
                out.push(scene.map(|scene| Trial {
                    scene,
                    planted: Some((&case.kind, size)),
                    colour: Colour::Own,
                    stream,
                }));
            }
        }
    }
    // Other streams than any number of effects has.
    let mut stream = 1 << 32;
    for colour in Colour::ALL {
        for k in 0..request.clean {
            stream += 1;
            let scene = clean
                .get(k % clean.len().max(1))
                .and_then(|s| scenes.get(*s));
            out.push(scene.map(|scene| Trial {
                scene,
                planted: None,
                colour,
                stream,
            }));
        }
    }
    out
}

/// Runs all records; what comes out does not depend on who ran what.
fn marked(
    trials: &[Option<Trial<'_>>],
    request: &Request,
    progress: Progress<'_>,
    answer: Answer<'_>,
) -> Result<Vec<Mark>> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Mutex<Vec<(usize, Result<Mark>)>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..request.threads.clamp(1, trials.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(trial) = trials.get(at) else { break };
                    let mark = match trial {
                        Some(trial) => trial.run(request.seed, answer),
                        None => Ok(Mark::NotShown),
                    };
                    if let Ok(mut results) = results.lock() {
                        results.push((at, mark));
                    }
                    progress(done.fetch_add(1, Ordering::Relaxed) + 1, trials.len());
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_default();
    results.sort_by_key(|r| r.0);
    results.into_iter().map(|(_, mark)| mark).collect()
}
