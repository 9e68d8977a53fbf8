//! `gyrogen close --self-test`: what the search finds, and what its silence means.

use super::close::Arguments;
use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::design::Design;
use crate::error::{Error, Result};
use crate::report::text::significant;
use crate::selftest::outcome::{EffectScore, Minimum, Outcome};
use crate::selftest::{self, Request};
use crate::text::counted;
use crate::timing;
use std::path::PathBuf;

/// Of a self-test.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Self-test")]
pub struct Options {
    /// Simulated records for each effect and size, 1 to 1000.
    #[arg(long, value_name = "N", default_value_t = 4, requires = "self_test",
          value_parser = super::values::whole::<u16>(1..=1000))]
    records: u16,
    /// Simulated records without an effect, for each of four kinds of noise, 0 to 10000.
    #[arg(long, value_name = "N", default_value_t = 25, requires = "self_test",
          value_parser = super::values::whole::<u16>(0..=10000))]
    clean: u16,
    /// Plant this effect only, by its name in the manual's catalogue; may be given more than once.
    #[arg(long, value_name = "ID", requires = "self_test")]
    effect: Vec<String>,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "self_test",
          value_parser = super::values::whole::<u64>(0..=u64::MAX))]
    seed: u64,
    /// Threads, 1 to 1024; as many as the machine has if left out. The result does not depend on it.
    #[arg(long, value_name = "N", requires = "self_test", value_parser = super::values::whole::<u16>(1..=1024))]
    threads: Option<u16>,
}

/// Records of one size that show, all found, a probability of 0.9 with 90 % confidence: the least n with 0.9^n < 0.1.
const RECORDS_FOR_90: usize = 22;

/// Runs the self-test.
///
/// # Errors
/// An unusable record or an effect that is not planted (exit 2); too many false alarms or a large effect that
/// is not found (exit 1).
pub fn run(
    arguments: &Arguments,
    design: &Design,
    recorded: &Recorded,
    watch: &Stages,
) -> Result<()> {
    let options = &arguments.test;
    let planned = ["selftest.json", "selftest.html", timing::NAME];
    let claim =
        |out: &PathBuf| super::common::claim(out, &planned, &recorded.inputs, arguments.force);
    let results = arguments.out.as_ref().map(claim).transpose()?;
    let read = match &arguments.record {
        Some(path) => Some(crate::record::read_any(path, &design.record)?),
        None => None,
    };
    let request = Request {
        records: usize::from(options.records),
        clean: usize::from(options.clean),
        seed: options.seed,
        threads: super::threads(options.threads),
        only: options.effect.clone(),
        command: recorded.command.clone(),
        ..Request::default()
    };
    watch.stage("planting and searching");
    let record = read.as_ref().map(|(r, w)| (r, w.as_slice()));
    let progress = |done: usize, of: usize| watch.at(done as u64, Some(of as u64));
    let outcome = selftest::run(design, record, &request, &progress)?;
    watch.stage("writing");
    let json = super::json(&outcome);
    if let Some(mut results) = results {
        let page = crate::report::selftest::html(&outcome)?;
        results.write("selftest.json", json.as_bytes())?;
        results.write("selftest.html", page.as_bytes())?;
        watch.write(&mut results, &outcome.design_sha256, &recorded.command)?;
        results.finish()?;
    }
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => print(&outcome),
    }
    if let (Some(out), OutputFormat::Text) = (&arguments.out, arguments.format) {
        super::common::wrote(out, &["selftest.html"]);
    }
    if outcome.holds {
        return Ok(());
    }
    Err(Error::Check(outcome.failures.join("; ")))
}

fn print(o: &Outcome) {
    let sizes = o.effects.first().map_or(&[][..], |e| &e.by_size);
    let mut header: Vec<String> = vec!["effect".to_owned()];
    header.extend(sizes.iter().map(|s| format!("{} x", s.times_noise)));
    header.extend(["wrong names", "90 % found from", "which is"].map(str::to_owned));
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = super::terminal::table(&header);
    for e in &o.effects {
        table.add_row(row(e));
    }
    super::terminal::show(&table);
    say!(
        "found: named, or listed as indistinguishable, of records with an effect that leaves so many times the noise \
         of a row ({} deg/s) beyond the polynomial",
        significant(o.noise.white_rms_dps, 3)
    );
    let sizes = o.effects.iter().flat_map(|e| &e.by_size);
    let records = sizes.map(|s| s.records).max().unwrap_or(0);
    say!(
        "90 % found from: where a logistic curve through the counts of all sizes reaches 90 %.{}",
        match records < RECORDS_FOR_90 {
            true => format!(
                " With {} of each size it is a rough figure: it takes {RECORDS_FOR_90} records of each size, all found, to show 90 % \
                 with 90 % confidence (--records {RECORDS_FOR_90}).",
                counted(records as u64, "record")
            ),
            false => String::new(),
        }
    );
    say!(
        "wrong names: records with a name that neither is the effect nor lists it; which is: the size of `90 % found from` in the effect's \
         own unit, or why there is none; -: none"
    );
    for e in o.effects.iter().filter(|e| !e.wrong_names.is_empty()) {
        say!("{}: wrongly {}", e.effect, listed(&e.wrong_names));
    }
    if !o.own_steps.is_empty() {
        say!("taken off before: {}", o.own_steps.join(", "));
    }
    let a = &o.false_alarms;
    if a.records == 0 {
        return;
    }
    let kinds: Vec<String> = a
        .by_noise
        .iter()
        .map(|c| format!("{} {} of {}", c.noise, c.alarms, c.records))
        .collect();
    say!(
        "false alarms: {} of {} records without an effect ({}); with 95 % confidence below {:.1} %",
        a.alarms,
        a.records,
        kinds.join(", "),
        100.0 * a.upper_limit_95
    );
    if !a.names.is_empty() {
        say!("their names: {}", listed(&a.names));
    }
}

fn listed(names: &[(String, usize)]) -> String {
    let each = names.iter().map(|(name, count)| match count {
        1 => name.clone(),
        count => format!("{name} ({count})"),
    });
    each.collect::<Vec<_>>().join(", ")
}

fn row(e: &EffectScore) -> Vec<String> {
    let mut row = vec![e.effect.clone()];
    row.extend(e.by_size.iter().map(|s| match s.records {
        0 => "-".to_owned(),
        records => format!("{}/{records}", s.detected),
    }));
    let wrong: usize = e.by_size.iter().map(|s| s.wrong).sum();
    row.push(if wrong == 0 {
        "-".to_owned()
    } else {
        wrong.to_string()
    });
    match &e.minimum_detectable {
        Some(m) => row.extend([
            format!("{}{:.1} x", relation(m), m.times_noise),
            format!(
                "{}{} {}",
                relation(m),
                significant(m.in_own_unit, 2),
                e.own_unit
            ),
        ]),
        None => row.extend(["-".to_owned(), e.remark.clone()]),
    }
    row
}

fn relation(m: &Minimum) -> &'static str {
    match m.relation {
        "below" => "< ",
        "above" => "> ",
        _ => "",
    }
}
