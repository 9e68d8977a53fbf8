//! A corpus of 600 thermal records that judges builds of gyrogen, and compares two of them record by record.
//!
//! ```text
//! cargo run --release --example corpus -- check
//! cargo run --release --example corpus -- score tune BINARY --save old.json [-- OPTION ...]
//! cargo run --release --example corpus -- compare old.json new.json
//! cargo run --release --example corpus -- write tune FOLDER
//! ```
//!
//! `score` runs `BINARY close OPTION ...` on every record of a split (`tune`, `validate` or `locked`); `compare` tests the
//! difference in names by McNemar's exact test and prints the paired ratio of errors; `write` puts a split's records into a folder,
//! the truth beside them. The records are those of `tests/all/blind`; a third has noise like that of the series in the folder
//! `GYROGEN_SERIES` (../shared/data), or, without it, of a stated family. `GYROGEN_CORPUS_ONLY=TEXT` keeps records with it in
//! their names. `docs/closure-corpus.md` says what is in the corpus and how builds did.

#[allow(dead_code)] // A part of it is used.
#[path = "../../tests/all/blind/mod.rs"]
mod blind;
mod compare;
mod donors;
mod plan;
#[allow(dead_code)]
#[path = "../../tests/all/rng.rs"]
mod rng;
mod run;
mod sheet;

use plan::Split;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const USAGE: &str = "usage: corpus check | score SPLIT BINARY [--save FILE] [-- OPTION ...] | compare FILE FILE | \
                     write SPLIT FOLDER; SPLIT: tune, validate, locked";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match command(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::from(2)
        }
    }
}

/// Runs what was asked for.
fn command(arguments: &[String]) -> Result<(), String> {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["check"] => check(),
        ["write", split, folder] => write(Split::of(split)?, Path::new(folder)),
        ["compare", a, b] => {
            let (a, b) = (sheet::load(Path::new(a))?, sheet::load(Path::new(b))?);
            println!("{}", compare::report(&a, &b)?);
            Ok(())
        }
        ["score", split, binary, rest @ ..] => {
            let (save, options) = match rest {
                ["--save", file, "--", options @ ..] => (Some(PathBuf::from(file)), options),
                ["--save", file] => (Some(PathBuf::from(file)), &[][..]),
                ["--", options @ ..] => (None, options),
                [] => (None, &[][..]),
                _ => return Err(USAGE.to_owned()),
            };
            let split = Split::of(split)?;
            let marks = run::score(split, Path::new(binary), options)?;
            println!("{}", sheet::table(&marks));
            if split != Split::Locked {
                println!("{}", sheet::misses(&marks));
            }
            save.map_or(Ok(()), |file| sheet::save(&file, split, &marks))
        }
        _ => Err(USAGE.to_owned()),
    }
}

/// Makes every record of every split, and looks at none.
fn check() -> Result<(), String> {
    let donors = donors::all();
    println!("noise of {} series", donors.len());
    for d in &donors {
        println!(
            "  {}: {:.1} times the short-term noise at its lowest frequency, {} lines, {:.4} spikes and {:.4} steps a row",
            d.name,
            d.density[0].1.sqrt(),
            d.lines.len(),
            d.spikes.0,
            d.steps.0
        );
    }
    for split in [Split::Tune, Split::Validate, Split::Locked] {
        let all = plan::records(split, &donors);
        let rows: usize = run::each(&all, |_, e| blind::make(&e.scenario).truth.reading.len())
            .iter()
            .sum();
        println!("{split:?}: {} records, {rows} rows", all.len());
    }
    Ok(())
}

/// Writes a split's records and truths.
fn write(split: Split, folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    for entry in plan::records(split, &donors::all()) {
        let record = blind::make(&entry.scenario);
        let truth = blind::dump::truth_json(&record.truth).to_string();
        for (end, text) in [("csv", record.csv), ("truth.json", truth)] {
            std::fs::write(folder.join(format!("{}.{end}", entry.name)), text)
                .map_err(|e| e.to_string())?;
        }
    }
    Ok(())
}
