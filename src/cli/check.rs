//! `gyrogen check`: what is proved of a design, what it costs, what could be better.

use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::check::outcome::{Check, NodeCheck, Overflows};
use crate::check::remarks::Remark;
use crate::check::{self, SAMPLES};
use crate::error::{Error, Result};
use crate::output::Results;
use crate::text::{counted, number};
use crate::timing;
use std::path::PathBuf;

/// Prove the range of every word of a design, say what overflows, what each rounding and each part costs.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// ADC samples of the design's own gyro that are run, 1000 to 100000000; 1000000 if left out.
    #[arg(long, value_name = "N", value_parser = super::values::whole::<u64>(1_000..=100_000_000))]
    samples: Option<u64>,
    /// Folder for check.json; made if it does not exist. Nothing is written if left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// What it writes.
const PLANNED: [&str; 2] = ["check.json", timing::NAME];

/// Runs the command.
///
/// # Errors
/// An unusable design (exit 2); a word that overflows for certain, a requirement that is not met (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("proving and running");
    let design = arguments.design.read()?;
    let claim = |out: &PathBuf| Results::claim(out, &PLANNED, &recorded.inputs);
    let results = arguments.out.as_ref().map(claim).transpose()?;
    let samples = arguments.samples.map_or(SAMPLES, |n| n as usize);
    let check = check::check(&design, &recorded.command, samples)?;
    let json = super::json(&check);
    if let Some(mut results) = results {
        results.write(PLANNED[0], json.as_bytes())?;
        watch.write(&mut results, &check.design_sha256, &recorded.command)?;
        results.finish()?;
    }
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => print(&check),
    }
    if check.holds {
        return Ok(());
    }
    Err(Error::Check(check.reasons.join("; ")))
}

fn print(check: &Check) {
    for reason in &check.reasons {
        say!("{reason}");
    }
    let mut table = super::terminal::table(&[
        "word",
        "format",
        "proved range, raw",
        "headroom, bits",
        "overflow",
        "own rounding, LSB rms",
        "adds to the rate, deg/s rms",
        "mean, deg/s",
    ]);
    for node in &check.nodes {
        table.add_row(row(node));
    }
    super::terminal::numbers(&mut table, 2..);
    super::terminal::show(&table);
    for (name, what) in NAMED_BY_KEY {
        if check.nodes.iter().any(|n| n.name == name) {
            say!("{name}: {what}");
        }
    }
    let open = || {
        let nodes = check.nodes.iter();
        nodes.filter(|n| n.overflow == Overflows::Possible)
    };
    for node in open() {
        say!(
            "{} is not proved to fit: its value is within {} (proved), and {} holds {}. Beyond that it would {}. Words that an \
             overflow would change: {}.",
            node.name,
            node.in_units(node.proved),
            node.format,
            node.in_units(node.limits),
            node.mode,
            node.path.get(1..).unwrap_or_default().join(", ")
        );
    }
    // Words of a compensation whose thermometer is none of the circuit's are not run, and there is no rate then.
    let is_run =
        |n: &&NodeCheck| check.rate_rms_dps.is_some() || !n.name.starts_with("compensation.");
    let (run, not_run): (Vec<_>, Vec<_>) = open().partition(is_run);
    if !run.is_empty() {
        say!(
            "None of these overflows happened in the {} samples of the design's own gyro. The check fails only where one did, or where \
             it is certain.",
            check.samples
        );
    }
    for node in not_run {
        say!(
            "{} was not run, as the thermometer is not a word of the circuit: whether it overflows is untested.",
            node.name
        );
    }
    if let Some(rms) = check.rate_rms_dps {
        let predicted = check.predicted_rate_rms_dps;
        let predicted = predicted.map_or("no prediction".to_owned(), |v| {
            format!("predicted {v}", v = number(v, 3))
        });
        say!(
            "The rate in fixed point differs from that in floating point by {rms} deg/s rms over {} samples ({predicted}).",
            check.samples,
            rms = number(rms, 3)
        );
    }
    let mut table = super::terminal::table(&[
        "processor",
        "instructions a row",
        "cycles a row",
        "code, bytes",
        "tables, bytes",
        "state, bytes",
    ]);
    for cost in &check.costs {
        let numbers = [
            cost.instructions_per_row,
            cost.cycles_per_row,
            cost.code_bytes,
            cost.rom_bytes,
            cost.ram_bytes,
        ];
        let mut row = vec![cost.target.name().to_owned()];
        row.extend(numbers.map(|n| n.to_string()));
        table.add_row(row);
    }
    super::terminal::numbers(&mut table, 1..);
    super::terminal::show(&table);
    if let Some(cost) = check.costs.first() {
        let f = &cost.fabric;
        say!(
            "FPGA: {} multipliers of 25 x 18 bits, {} adder bits, {} bits of selections and shifters, {} register \
             bits, {} bits of tables",
            f.multiplier_tiles,
            f.adder_bits,
            f.logic_bits,
            f.register_bits,
            f.rom_bits
        );
    }
    requirements(check);
    let mut rest = check.remarks.as_slice();
    while let Some(remark) = rest.first() {
        let key = |r: &Remark| r.node.split(' ').next().unwrap_or_default().to_owned();
        let is_like = |r: &&Remark| {
            (r.code, key(r), &r.message, &r.mend)
                == (remark.code, key(remark), &remark.message, &remark.mend)
        };
        let (like, others) = rest.split_at(rest.iter().take_while(is_like).count());
        let node = match like.len() {
            1 => remark.node.clone(),
            count => format!("{} ({count} words)", key(remark)),
        };
        say!(
            "{node}: {}. Suggestion: {} [{}]",
            remark.message,
            remark.mend,
            remark.code
        );
        rest = others;
    }
    say!("{}", verdict(check.holds, open().count()));
}

/// The verdict; `open` words are not proved to hold every value.
fn verdict(holds: bool, open: usize) -> String {
    match (holds, open) {
        (false, _) => "does not hold".to_owned(),
        (true, 0) => "holds".to_owned(),
        (true, _) => {
            let words = counted(open as u64, "word");
            let are = if open == 1 { "is" } else { "are" };
            format!("holds: no overflow occurred, but {words} {are} not proved free of overflow")
        }
    }
}

/// Words of the table that are called by a key of the design, and what they are.
const NAMED_BY_KEY: [(&str, &str); 2] = [
    (
        "circuit.cordic.width",
        "the CORDIC's x and y, over all iterations",
    ),
    (
        "circuit.cordic.gain_bits",
        "the CORDIC's magnitude, x times a gain constant of gain_bits bits, rounded",
    ),
];

fn requirements(check: &Check) {
    if check.requirements.is_empty() {
        return;
    }
    let mut table =
        super::terminal::table(&["required", "on", "limit", "obtained", "between", "met"]);
    for r in &check.requirements {
        let sign = if r.at_least { ">=" } else { "<=" };
        let between = r.bounds.map_or("-".to_owned(), |[low, high]| {
            format!(
                "{low} and {high}",
                low = number(low, 3),
                high = number(high, 3)
            )
        });
        table.add_row([
            r.name.to_owned(),
            r.target.clone().unwrap_or("-".to_owned()),
            format!("{sign} {:e}", r.limit),
            number(r.obtained, 5),
            between,
            if r.met { "yes" } else { "NO" }.to_owned(),
        ]);
    }
    super::terminal::numbers(&mut table, 2..);
    super::terminal::show(&table);
    if let Some(c) = &check.confidence {
        say!(
            "the {} intervals hold at once with {:.0} % confidence ({}: each by itself with {:.2} %)",
            c.intervals,
            100.0 * c.joint,
            c.correction,
            100.0 * c.each
        );
    }
}

/// Bits of headroom, rounded down: a lack of them is never shown as none.
fn headroom(bits: f64) -> String {
    match bits < 0.0 {
        true => format!("{:.2}", (100.0 * bits).floor() / 100.0),
        false => format!("{bits:.2}"),
    }
}

fn row(n: &NodeCheck) -> Vec<String> {
    let overflow = match n.overflow {
        Overflows::Impossible => "impossible (proved)".to_owned(),
        Overflows::Possible => format!("not excluded ({})", n.mode),
        Overflows::Certain => format!("CERTAIN ({})", n.mode),
        Overflows::ByDesign => n.mode.to_owned(),
    };
    let some = |v: Option<f64>| v.map_or("-".to_owned(), |v| number(v, 3));
    let line = n.budget.as_ref();
    vec![
        n.name.clone(),
        n.format.clone(),
        format!("{} .. {}", n.proved[0], n.proved[1]),
        n.headroom_bits.map_or("-".to_owned(), headroom),
        overflow,
        line.map_or("-".to_owned(), |l| {
            let rms = l.predicted_rms_lsb.or(l.measured_rms_lsb);
            rms.map_or("-".to_owned(), |v| format!("{v:.3} {}", l.source))
        }),
        some(line.and_then(|l| l.rate_rms_dps)),
        some(line.and_then(|l| l.rate_mean_dps)),
    ]
}

#[cfg(test)]
mod tests {
    use super::verdict;

    #[test]
    fn the_verdict_says_what_is_not_proved() {
        assert_eq!(verdict(true, 0), "holds");
        assert_eq!(verdict(false, 2), "does not hold");
        for (open, words) in [(1, "1 word is"), (2, "2 words are")] {
            let due =
                format!("holds: no overflow occurred, but {words} not proved free of overflow");
            assert_eq!(verdict(true, open), due);
        }
    }
}
