//! `gyrogen study`: what each bit of the circuit buys.

mod points;

use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::design::{Design, Limits};
use crate::error::{Error, InputError, Result, io_error};
use crate::output::Results;
use crate::study::job::{self, Request};
use crate::study::journal;
use crate::study::outcome::Study;
use crate::study::progress::{Progress, Step};
use crate::study::reporting::{DESIGNS, RESOLUTION};
use crate::study::shard::Part;
use crate::text::number;
use crate::timing;
use points::{Marks, all_points, is_within_by_estimate_alone, points};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// Study the word lengths: the cheapest design for each size of error, verified bit for bit, and the effect of each bit.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// The most that the word lengths may add to each error, all limits in one text, such as "bias_dps<=0.01 arw_deg_rth<=0.01";
    /// replaces the design's `[requirements]`.
    #[arg(long = "for", value_name = "LIMITS")]
    limits: Option<String>,
    /// Run only part K of N of those designs that are known before the search, and write their results for `--merge`.
    #[arg(long, value_name = "K/N", conflicts_with_all = ["merge", "limits"])]
    shard: Option<Part>,
    /// Folders with the results of all parts (`--shard`) of a study: search from there.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    merge: Vec<PathBuf>,
    /// Threads, 1 to 1024; as many as the machine has if left out. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = super::values::whole::<u16>(1..=1024))]
    threads: Option<u16>,
    /// Folder for the results; made if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: super::common::Force,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// What it writes beside the designs; the journal while it runs.
const PLANNED: [&str; 4] = ["study.json", "report.html", timing::NAME, journal::NAME];

/// Runs the command.
///
/// # Errors
/// An unusable design, words that it does not have, an incomplete study (exit 2); a design that overflows, a
/// requirement that cannot be met (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("searching and verifying");
    if let Some(path) = arguments.design.path() {
        refuse_limit(path, arguments.limits.as_deref())?;
    }
    let design = arguments.design.read()?;
    let limits = match &arguments.limits {
        Some(text) => Limits::parse(text)?,
        None => design.requirements.clone(),
    };
    let was_there = arguments.out.exists();
    let planned = match arguments.shard {
        Some(part) => vec![part.file_name()],
        None => {
            let always = PLANNED.map(str::to_owned);
            always
                .into_iter()
                .chain(earlier_designs(&arguments.out))
                .collect()
        }
    };
    let planned: Vec<&str> = planned.iter().map(String::as_str).collect();
    // What cannot be written is said as of any command.
    drop(super::common::claim(
        &arguments.out,
        &planned,
        &recorded.inputs,
        arguments.force,
    )?);
    // The journal of a study that was stopped stands in the folder itself.
    std::fs::create_dir_all(&arguments.out)
        .map_err(|e| io_error(&arguments.out, "make the folder", &e))?;
    let forced = arguments.force.force;
    let done = Results::claim_forced(&arguments.out, &planned, &recorded.inputs, forced)
        .and_then(|results| into_folder(arguments, recorded, &design, limits, (results, watch)));
    if done.is_err() && !was_there {
        // Only what is empty can be removed so: a journal stays.
        let _ = std::fs::remove_dir(&arguments.out);
    }
    done
}

/// Refuses a limit in the place of the design: with blanks around it `--for` takes the first one alone.
fn refuse_limit(path: &Path, limits: Option<&str>) -> Result<()> {
    let text = path.to_string_lossy();
    if !["<=", ">="].iter().any(|sign| text.contains(sign)) || path.exists() {
        return Ok(());
    }
    let all: Vec<&str> = limits.into_iter().chain([text.as_ref()]).collect();
    Err(InputError::new(format!(
        "`{text}` is a limit and stands in the place of the design"
    ))
    .help(format!(
        "give all limits in one `--for`: --for \"{}\"",
        all.join(" ")
    ))
    .into())
}

/// The points' designs that are in a folder: a study replaces those of an earlier one, and how many it makes is known at
/// its end.
fn earlier_designs(out: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(out.join(DESIGNS)).into_iter().flatten();
    let names = entries
        .flatten()
        .filter_map(|e| e.file_name().into_string().ok());
    let mut points: Vec<String> = names
        .filter(|name| name.starts_with("point-") && name.ends_with(".toml"))
        .map(|name| format!("{DESIGNS}/{name}"))
        .collect();
    points.sort();
    points
}

/// The study, written into a folder that is there.
fn into_folder(
    arguments: &Arguments,
    recorded: &Recorded,
    design: &Design,
    limits: Limits,
    (mut results, watch): (Results, Stages),
) -> Result<()> {
    let threads = super::threads(arguments.threads);
    let begun: Mutex<Option<(Step, Instant)>> = Mutex::new(None);
    let said = |progress: Progress| {
        if progress.step == Step::Answering {
            // Nothing of it is counted: a stage with its clock.
            watch.stage(progress.step.name());
        } else if let Ok(mut begun) = begun.lock() {
            let since = match *begun {
                Some((step, since)) if step == progress.step => since,
                _ => begun.insert((progress.step, Instant::now())).1,
            };
            watch.says(&progress.line(since.elapsed().as_secs_f64()));
        }
    };
    if let Some(part) = arguments.shard {
        let path = job::part(design, part, threads, &arguments.out, &said)?;
        super::terminal::give(&path.display().to_string());
        return Ok(());
    }
    let request = Request {
        limits,
        command: &recorded.command,
        threads,
        folder: Some(&arguments.out),
        merged: &arguments.merge,
        heuristic: false,
    };
    let done = job::study(design, &request, &said)?;
    let json = super::json(&done.study);
    let html = crate::report::study::html(&done.study)?;
    let files = done
        .files
        .iter()
        .map(|(name, text)| (name, text.as_bytes()));
    results.write_all(files)?;
    results.write(PLANNED[0], json.as_bytes())?;
    results.write(PLANNED[1], html.as_bytes())?;
    watch.write(&mut results, &done.study.design_sha256, &recorded.command)?;
    let note = super::earlier::note(&arguments.out, PLANNED[0], "design or limits", &json);
    results.replaces(DESIGNS);
    results.finish()?;
    note.iter().for_each(|note| talk!("{note}"));
    journal::remove(&arguments.out)?;
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => {
            print(&done.study);
            super::common::wrote(&arguments.out, &["report.html", DESIGNS]);
        }
    }
    let unmet = unmet(&done.study);
    if !request.limits.is_empty() && !unmet.is_empty() {
        return Err(Error::Check(unmet.join("; ")));
    }
    Ok(())
}

/// Why targets have no point, each reason once with all targets that have it.
fn unmet(s: &Study) -> Vec<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for c in s.chosen.iter().filter(|c| c.point.is_none()) {
        match reasons.iter_mut().find(|(reason, _)| *reason == c.reason) {
            Some((_, targets)) => targets.push(&c.target),
            None => reasons.push((&c.reason, vec![&c.target])),
        }
    }
    let told = reasons.iter();
    told.map(|(reason, targets)| format!("{}: {reason}", targets.join(", ")))
        .collect()
}

fn print(s: &Study) {
    say!("what the word lengths add to the gyro's own errors; costs in % of the given design's");
    super::terminal::show(&points(s));
    say!(
        "*: on that target's front: of the designs whose error after power-on is within the limit, nothing cheaper has so small a merit"
    );
    if s.chosen.iter().any(|c| c.point.is_some()) {
        say!(">: the point that is chosen for that target; why is said below the second table");
    }
    if let Some(said) = Marks::of(s).beyond() {
        say!("{said}");
    }
    if s.chosen.iter().any(|c| c.nearest.is_some()) {
        say!(
            "! before a point's number: the verified design that is nearest to what is required; it does NOT meet it"
        );
    }
    say!(
        "limit: {}",
        match s.limits_from {
            "requirements" => "as required",
            _ =>
                "what the given design's words add themselves, and beside it what makes a figure of the gyro and its words together one \
                 percent worse. So the given design's merit is below 1",
        }
    );
    say!(
        "merit: the largest ratio of a column to its limit (`by`: which column), by the estimates; smaller is better"
    );
    if all_points(s).any(is_within_by_estimate_alone) {
        say!(
            "?: the estimates are within the limits, the whole of their {:.0} % intervals (study.json) is not. No such point is chosen.",
            100.0 * s.confidence.joint
        );
    }
    say!("angle random walk in deg/rth: noise * 60 / sqrt(2), as the noise is a one-sided density");
    if let Some(hz) = s.conditions.detuned_hz {
        say!(
            "spur: the largest line of the error's spectrum, at rest or with the oscillator off by {} Hz; `equiv` runs at the design's own frequency alone",
            number(hz, 3)
        );
    }
    say!(
        "{} designs considered, {} run bit for bit ({}), {} points verified",
        s.designs_considered,
        s.designs_simulated,
        s.method,
        s.front.len()
    );
    let mut words =
        super::terminal::table(&["word", "given", "first that hurts", "last that helps"]);
    let shown = |l: Option<u32>| l.map_or("-".to_owned(), |l| l.to_string());
    for (sweep, parameter) in s.sweeps.iter().zip(&s.parameters) {
        words.add_row([
            sweep.name.to_owned(),
            parameter.given.to_string(),
            shown(sweep.first_that_hurts),
            shown(sweep.last_that_helps),
        ]);
    }
    super::terminal::show(&words);
    let percent = 100.0 * RESOLUTION;
    say!(
        "one word changed, the others as given. first that hurts: the longest length below the given one that raises the \
         search's merit by more than {percent:.0} %; last that helps: the longest above it whose last bit lowers it by more \
         than {percent:.0} %; -: none in the range"
    );
    for chosen in &s.chosen {
        if let Some(point) = chosen.point {
            say!("{}: point {point}, {}", chosen.target, chosen.reason);
        }
    }
    // Where something is required the failed check says this.
    if s.required.is_empty() {
        for reason in unmet(s) {
            say!("{reason}");
        }
    }
    say!(
        "bounds of every figure in study.json: {} intervals that hold at once with {:.0} % confidence ({}: each by itself \
         with {:.3} %, {:.2} standard errors)",
        s.confidence.intervals,
        100.0 * s.confidence.joint,
        s.confidence.correction,
        100.0 * s.confidence.each,
        s.confidence.standard_errors
    );
    for line in crate::report::study::none_a_quarter_less(&s.quarter_less) {
        say!("{line}");
    }
    for note in &s.notes {
        say!("note: {note}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_in_the_place_of_the_design_is_told_where_it_belongs() {
        let told = |path: &str, limits| {
            refuse_limit(Path::new(path), limits)
                .unwrap_err()
                .to_string()
        };
        let second = told("rom_bytes<=4000", Some("bias_dps<=0.01"));
        assert!(
            second.contains("--for \"bias_dps<=0.01 rom_bytes<=4000\""),
            "{second}"
        );
        let alone = told("bandwidth_hz>=40", None);
        assert!(alone.contains("--for \"bandwidth_hz>=40\""), "{alone}");
        assert!(refuse_limit(Path::new("gyro.toml"), None).is_ok());
    }
}
