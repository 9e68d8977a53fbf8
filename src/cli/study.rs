//! `gyrogen study`: what each bit of the circuit buys.

use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::design::{Design, Limits};
use crate::error::{Error, Result, io_error};
use crate::output::Results;
use crate::study::job::{self, Request};
use crate::study::journal;
use crate::study::outcome::{Point, Study};
use crate::study::progress::{Progress, Step};
use crate::study::shard::Part;
use crate::text::number;
use crate::timing;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

/// Study the word lengths: the cheapest design for each size of error, verified bit for bit, and the effect of each bit.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// The most that the word lengths may add to each error, such as "bias_dps<=0.01 arw_deg_rth<=0.01"; replaces the design's
    /// `[requirements]`.
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
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// What it writes beside the designs.
const PLANNED: [&str; 3] = ["study.json", "report.html", timing::NAME];

/// Runs the command.
///
/// # Errors
/// An unusable design, words that it does not have, an incomplete study (exit 2); a design that overflows, a
/// requirement that cannot be met (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("searching and verifying");
    let design = arguments.design.read()?;
    let limits = match &arguments.limits {
        Some(text) => Limits::parse(text)?,
        None => design.requirements.clone(),
    };
    let was_there = arguments.out.exists();
    // What cannot be written is said as of any command.
    drop(Results::claim(&arguments.out, &PLANNED, &recorded.inputs)?);
    // The journal of a study that was stopped stands in the folder itself.
    std::fs::create_dir_all(&arguments.out)
        .map_err(|e| io_error(&arguments.out, "make the folder", &e))?;
    let done = into_folder(arguments, recorded, &design, limits, watch);
    if done.is_err() && !was_there {
        // Only what is empty can be removed so: a journal stays.
        let _ = std::fs::remove_dir(&arguments.out);
    }
    done
}

/// The study, written into a folder that is there.
fn into_folder(
    arguments: &Arguments,
    recorded: &Recorded,
    design: &Design,
    limits: Limits,
    watch: Stages,
) -> Result<()> {
    let threads = super::threads(arguments.threads);
    let mut results = Results::claim(&arguments.out, &PLANNED, &recorded.inputs)?;
    let begun: Mutex<Option<(Step, Instant)>> = Mutex::new(None);
    let said = |progress: Progress| {
        if let Ok(mut begun) = begun.lock() {
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
    results.finish()?;
    journal::remove(&arguments.out)?;
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => {
            print(&done.study);
            super::common::wrote(&arguments.out, &["report.html", "designs"]);
        }
    }
    let unmet = done.study.chosen.iter().filter(|c| c.point.is_none());
    let unmet: Vec<String> = unmet
        .map(|c| format!("{}: {}", c.target, c.reason))
        .collect();
    if !request.limits.is_empty() && !unmet.is_empty() {
        return Err(Error::Check(unmet.join("; ")));
    }
    Ok(())
}

fn print(s: &Study) {
    let mut header = vec!["point", "on the front of"];
    let targets: Vec<String> = s.reference.price.keys().cloned().collect();
    let titles: Vec<String> = targets.iter().map(|t| format!("{t}, %")).collect();
    header.extend(titles.iter().map(String::as_str));
    header.extend([
        "bias, deg/s",
        "drift, deg/s",
        "noise, deg/s/rtHz",
        "ARW, deg/rth",
        "SF, ppm",
        "line, deg/s",
        "merit",
        "by",
    ]);
    let mut table = super::terminal::table(&header);
    for p in std::iter::once(&s.reference).chain(&s.front) {
        table.add_row(row(p, &targets));
    }
    super::terminal::numbers(&mut table, 2..);
    super::terminal::show(&table);
    say!(
        "merit 1: {}; {} designs considered, {} run bit for bit ({}), {} points verified",
        s.limits_from,
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
    for chosen in &s.chosen {
        match chosen.point {
            Some(point) => say!("{}: point {point}, {}", chosen.target, chosen.reason),
            None => say!("{}: {}", chosen.target, chosen.reason),
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
    for line in crate::report::study::quarter_less(s) {
        say!("{line}");
    }
    for note in &s.notes {
        say!("note: {note}");
    }
}

fn row(p: &Point, targets: &[String]) -> Vec<String> {
    let mut row = vec![
        if p.number == 0 {
            "given".to_owned()
        } else {
            p.number.to_string()
        },
        p.targets.join(", "),
    ];
    for target in targets {
        let part = p.price_of_given.get(target).copied().unwrap_or(f64::NAN);
        row.push(format!("{:.1}", 100.0 * part));
    }
    row.extend([
        number(p.bias_error_dps, 3),
        number(p.drift_residual_dps, 3),
        number(p.noise_dps_rthz, 3),
        number(p.arw_deg_rth, 3),
        format!("{:.1}", p.scale_factor_ppm),
        number(p.spur_dps, 3),
        format!("{:.3}", p.merit),
        p.limited_by.to_owned(),
    ]);
    row
}
