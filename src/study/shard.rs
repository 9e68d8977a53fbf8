//! A study in parts: `--shard K/N` runs every N-th design of those that are known beforehand, `--merge` takes the
//! parts over and goes on as if it had run them. What is known beforehand is a function of the design alone: the
//! one-word sweeps, and every design of a space that is searched whole.

use super::bench::{Bench, Trial};
use super::journal;
use super::search::sweeps;
use super::space::{Lengths, Space};
use crate::design::Design;
use crate::error::{InputError, Result, io_error};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The K-th of N parts, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// 1 to N.
    pub number: u32,
    /// N.
    pub of: u32,
}

impl Part {
    /// The file that its results are written to.
    pub fn file_name(self) -> String {
        format!("shard-{}-of-{}.runs", self.number, self.of)
    }
}

impl std::str::FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || format!("`{text}` is no part: write K/N, as 3/8, with K from 1 to N");
        let (number, of) = text.split_once('/').ok_or_else(wrong)?;
        let number = number.parse().map_err(|_| wrong())?;
        let of = of.parse().map_err(|_| wrong())?;
        if (1..=of).contains(&number) && of <= 100_000 {
            Ok(Part { number, of })
        } else {
            Err(wrong())
        }
    }
}

/// What a trial depends on: version, design, words and ranges.
pub fn hash(design: &Design, space: &Space) -> String {
    let mut hasher = Sha256::new();
    hasher.update(env!("CARGO_PKG_VERSION"));
    hasher.update(&design.source.sha256);
    hasher.update(format!("{:?}", space.variables));
    hasher.update(format!("{:?}", super::scenario::Extent::SEARCH));
    let digest = hasher.finalize();
    digest
        .iter()
        .take(16)
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// The designs that are known beforehand.
pub fn planned(bench: &Bench) -> Vec<Lengths> {
    let space = bench.space;
    let mut all: BTreeSet<Lengths> = sweeps(bench).into_iter().collect();
    if space.size() <= u128::from(bench.given.study.exhaustive) {
        all.extend((0..space.size()).map(|k| space.nth(k)));
    }
    all.into_iter().collect()
}

/// Runs a part and writes `shard-K-of-N.runs` into a folder, whole or not at all; the same again gives the same.
///
/// # Errors
/// A file that cannot be written.
pub fn run(bench: &mut Bench, part: Part, hash: &str, folder: &Path) -> Result<PathBuf> {
    let own: Vec<Lengths> = planned(bench)
        .into_iter()
        .enumerate()
        .filter(|(k, _)| k % part.of as usize == part.number as usize - 1)
        .map(|(_, l)| l)
        .collect();
    bench.expect(own.len(), false);
    bench.run(&own)?;
    let mut text = format!(
        "gyrogen.study.shard/1 {hash} {}/{} {}\n",
        part.number,
        part.of,
        own.len()
    );
    for lengths in &own {
        text += &journal::line(lengths, &bench.figures(lengths).copied());
    }
    let path = folder.join(part.file_name());
    crate::output::write_whole(&path, text.as_bytes())?;
    Ok(path)
}

/// Trials of the shards in some folders, which have to be all of one division.
///
/// # Errors
/// A folder without shards, a shard of another design or version, a missing one.
pub fn merged(folders: &[PathBuf], hash: &str) -> Result<BTreeMap<Lengths, Trial>> {
    let mut known = BTreeMap::new();
    let mut parts: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for folder in folders {
        let failed = |e: std::io::Error| io_error(folder, "read", &e);
        let mut any = false;
        let mut paths = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(failed)? {
            paths.push(entry.map_err(failed)?.path());
        }
        paths.sort();
        for path in paths
            .iter()
            .filter(|p| p.extension().is_some_and(|e| e == "runs"))
        {
            any = true;
            let text = std::fs::read_to_string(path).map_err(|e| io_error(path, "read", &e))?;
            let part = read(&text, hash, &mut known).map_err(|what| {
                InputError::new(what)
                    .in_file(path)
                    .help("run this part again with this design and this version of gyrogen")
            })?;
            parts.entry(part.of).or_default().insert(part.number);
        }
        if !any {
            return Err(InputError::new("there is no part of a study here")
                .in_file(folder)
                .help("give the folders that `gyrogen study --shard K/N --out DIR` wrote")
                .into());
        }
    }
    let complete = parts
        .iter()
        .any(|(of, numbers)| numbers.len() == *of as usize);
    if complete {
        return Ok(known);
    }
    let missing: Vec<String> = parts
        .iter()
        .flat_map(|(of, numbers)| {
            (1..=*of)
                .filter(|k| !numbers.contains(k))
                .take(8)
                .map(move |k| format!("{k}/{of}"))
        })
        .collect();
    Err(InputError::new(format!(
        "the study is not complete: {} is missing",
        missing.join(", ")
    ))
    .help("run these parts, and merge again")
    .into())
}

fn read(
    text: &str,
    hash: &str,
    known: &mut BTreeMap<Lengths, Trial>,
) -> std::result::Result<Part, String> {
    let mut lines = text.lines();
    let head = lines.next().unwrap_or_default();
    let fields: Vec<&str> = head.split(' ').collect();
    let ["gyrogen.study.shard/1", found, part, count] = fields[..] else {
        return Err("this is no part of a study".to_owned());
    };
    if found != hash {
        return Err("this part is of another design, other words, or another version".to_owned());
    }
    let part: Part = part.parse()?;
    let mut seen = 0usize;
    for line in lines {
        let (lengths, trial) = journal::read(line).ok_or("a line of this part is broken")?;
        known.insert(lengths, trial);
        seen += 1;
    }
    if count.parse() != Ok(seen) {
        return Err(format!(
            "this part has {seen} designs and should have {count}"
        ));
    }
    Ok(part)
}
