//! All of `gyrogen study`: search, verification, answers.

use super::bench::Bench;
use super::certainty::Confidence;
use super::journal::Journal;
use super::merit::Scale;
use super::outcome::Done;
use super::progress::Progress;
use super::reporting::{Method, Reporting};
use super::search::{self, Effort};
use super::space::Space;
use super::verify::Verifier;
use super::{overflow, quarter, shard};
use crate::design::{Design, LimitName, Limits};
use crate::error::{InputError, Result};
use std::path::Path;

/// What is asked.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// `--for`; the design's `[requirements]` without it.
    pub limits: Limits,
    /// Written into the result.
    pub command: &'a str,
    /// Threads; the result does not depend on it.
    pub threads: usize,
    /// Where the journal is kept; `None` = nowhere.
    pub folder: Option<&'a Path>,
    /// Folders of shards whose runs are taken over.
    pub merged: &'a [std::path::PathBuf],
    /// Never search the whole space.
    pub heuristic: bool,
}

/// Runs a study. `said` is told how far it is.
///
/// # Errors
/// A design that overflows (exit 1); words that it does not have, a phase loop that cannot lock, a journal that
/// cannot be written.
pub fn study(design: &Design, request: &Request, said: &(dyn Fn(Progress) + Sync)) -> Result<Done> {
    if design.compensation.is_none() && design.bound.is_some() {
        return Err(
            InputError::new("the compensation's formats are not chosen yet")
                .help("run `gyrogen run` first, and study the design.toml that it writes")
                .into(),
        );
    }
    cycles_of_a_processor(design, &request.limits)?;
    overflow::refuse(design)?;
    let space = Space::new(design)?;
    let mut bench = Bench::new(design, &space, request.threads, said)?;
    let hash = shard::hash(design, &space);
    if !request.merged.is_empty() {
        bench.know(shard::merged(request.merged, &hash)?);
    }
    if let Some(folder) = request.folder {
        let (journal, known) = Journal::open(folder, &hash)?;
        bench = bench.with_journal(journal, known);
    }
    let bandwidth_hz = super::bandwidth::bandwidth_hz(design);
    let verifier = Verifier::new(design)?;
    let verified = verifier.verify(&design.without_stops())?;
    let own = verified.figures;
    let alone = Scale::of_instrument(design, &bench.whole, bandwidth_hz);
    let instrument = alone.beside(&own);
    let asked = Scale::of_limits(&request.limits);
    // A search compares what it has run itself: the given design with its noise and its lengths of runs.
    let given = space.given();
    bench.run(std::slice::from_ref(&given))?;
    let searched = bench
        .figures(&given)
        .map_or(instrument, |f| alone.beside(f));
    let (scale, searched, limits_from) = if asked.is_empty() {
        (
            instrument,
            searched,
            "no figure of the data sheet more than one percent worse than the given design's",
        )
    } else {
        let start = [
            asked.bias_dps.or(instrument.bias_dps),
            verified.startup_dps.map(|[_, error]| error),
        ];
        (
            asked,
            asked.that_can_be_shown(&own, &verified.errors, start),
            "requirements",
        )
    };
    let exhaustive = !request.heuristic && space.size() <= u128::from(design.study.exhaustive);
    let (mut fronts, method) = if exhaustive {
        (search::exhaust(&mut bench, &searched)?, "exhaustive")
    } else {
        (
            search::search(&mut bench, &searched, Effort::STUDY)?,
            "search",
        )
    };
    let mut tried = Vec::new();
    if asked.is_empty() && !exhaustive {
        for objective in 0..bench.objectives.len() {
            tried.push(quarter::look(&mut bench, &searched, objective)?);
        }
        fronts = search::fronts(&bench, &searched, search::worst_merit(&bench, &searched));
    }
    let mut wanted: Vec<_> = fronts.iter().flatten().map(|p| p.lengths.clone()).collect();
    wanted.extend(super::answer::beside_the_fronts(
        &bench,
        &searched,
        &request.limits,
    ));
    wanted.extend(tried.iter().flatten().flat_map(|t| t.near.clone()));
    wanted.push(space.given());
    wanted.sort();
    wanted.dedup();
    let work = Reporting {
        design,
        space: &space,
        bench: &bench,
        verifier: &verifier,
        scale: &scale,
        searched: &searched,
        instrument: &instrument,
        own: &own,
        limits: &request.limits,
        bandwidth_hz,
        confidence: Confidence::of(super::certainty::FIGURES * wanted.len()),
        said,
    };
    let how = Method {
        method,
        limits_from,
        command: request.command,
        tried,
    };
    work.report(&wanted, &how)
}

/// Cycles are required, and no processor is among the targets.
///
/// # Errors
/// That.
pub fn cycles_of_a_processor(design: &Design, limits: &Limits) -> Result<()> {
    let cycles = limits.get(LimitName::CyclesPerRow).is_some();
    if cycles && design.study.targets.iter().all(|t| t == "fpga") {
        let what = "`cycles_per_row` is required, and `[study] targets` names no processor";
        return Err(InputError::new(what)
            .help("add one, as `targets = [\"cortex-m4\", \"fpga\"]`, or take the requirement out")
            .into());
    }
    Ok(())
}

/// Runs a part of a study into a folder.
///
/// # Errors
/// As [`study`].
pub fn part(
    design: &Design,
    part: shard::Part,
    threads: usize,
    folder: &Path,
    said: &(dyn Fn(Progress) + Sync),
) -> Result<std::path::PathBuf> {
    overflow::refuse(design)?;
    let space = Space::new(design)?;
    let mut bench = Bench::new(design, &space, threads, said)?;
    shard::run(&mut bench, part, &shard::hash(design, &space), folder)
}
