//! `gyrogen check`: what is proved of a design, what it costs, what could be better.

mod meaning;

use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::check::outcome::{Check, NodeCheck, Overflows};
use crate::check::remarks::Remark;
use crate::check::requirements::Requirement;
use crate::check::{self, SAMPLES};
use crate::error::{Error, Result};
use crate::numeric::trace::ir::Interval;
use crate::text::{constant, counted, number};
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
    #[command(flatten)]
    force: super::common::Force,
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
    if let Some(samples) = arguments.samples {
        super::equiv::enough(&design, samples, None)?;
    }
    let claim =
        |out: &PathBuf| super::common::claim(out, &PLANNED, &recorded.inputs, arguments.force);
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
        OutputFormat::Text => {
            super::common::say_what_is_emitted(&design);
            if let Some(note) = meaning::foreign(&design, arguments.design.path().is_some()) {
                talk!("note: {note}");
            }
            print(&check);
            if let Some(out) = &arguments.out {
                super::common::wrote(out, &PLANNED[..1]);
            }
        }
    }
    if check.holds {
        return Ok(());
    }
    Err(Error::Check(check.reasons.join("; ")))
}

fn print(check: &Check) {
    // What is required has a table of its own, with what would mend it.
    let of_requirements: Vec<String> = check
        .requirements
        .iter()
        .filter_map(Requirement::failure)
        .collect();
    let others = check.reasons.iter();
    for reason in others.filter(|reason| !of_requirements.contains(reason)) {
        say!("{reason}");
    }
    // In two tables: one of all columns is too wide for a terminal.
    let mut ranges = super::terminal::table(&["word", "what it is", "proved range, raw"]);
    let mut bits = super::terminal::table(&["word", "format", "has", "needs", "spare", "overflow"]);
    for node in &check.nodes {
        let [word, what, format, range, has, needs, spare, overflow] = row(node);
        ranges.add_row([word.clone(), what, range]);
        bits.add_row([word, format, has, needs, spare, overflow]);
    }
    super::terminal::numbers(&mut ranges, 2..);
    super::terminal::numbers(&mut bits, 2..);
    super::terminal::show(&ranges);
    say!(
        "proved range: of the value before the word saturates or wraps, for every ADC code and state. Of a word that wraps or limits by design: \
         after that."
    );
    super::terminal::show(&bits);
    say!(
        "has: the bits of the word. needs: the bits that hold its proved range. spare: has less needs; below 0 the word can overflow. -: \
         does not apply."
    );
    for meaning in meaning::entries(&check.nodes) {
        say!("{meaning}");
    }
    roundings(&check.nodes);
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
        say!("{}", meaning::unseen(check));
    }
    for node in &not_run {
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
    say!(
        "{}",
        verdict(check.holds, [run.len(), not_run.len()], check.samples)
    );
}

/// What each word's rounding makes, as a table beside that of the ranges: both in one are too wide for a terminal.
fn roundings(nodes: &[NodeCheck]) {
    let mut table = super::terminal::table(&[
        "word",
        "own rounding, LSB rms",
        "rate, deg/s rms",
        "rate, deg/s mean",
    ]);
    let some = |v: Option<f64>| v.map_or("-".to_owned(), |v| number(v, 3));
    for node in nodes {
        let Some(line) = &node.budget else { continue };
        let rms = line.predicted_rms_lsb.or(line.measured_rms_lsb);
        table.add_row([
            named(&node.name).0.to_owned(),
            rms.map_or("-".to_owned(), |v| format!("{v:.3} {}", line.source)),
            some(line.rate_rms_dps),
            some(line.rate_mean_dps),
        ]);
    }
    if table.row_count() == 0 {
        return;
    }
    super::terminal::numbers(&mut table, 1..);
    super::terminal::show(&table);
    say!(
        "own rounding: the error that the word's rounding makes by itself. rate: what that adds to the rate, rms and mean. \
         Sine table, CORDIC and the compensation's input are not in this table; the whole error of the rate, below, has them too."
    );
}

/// The verdict on a run of so many ADC samples; so many words that were run, and that were not, are not proved to hold every
/// value.
fn verdict(holds: bool, [run, not_run]: [usize; 2], samples: u64) -> String {
    if !holds {
        return "does not hold".to_owned();
    }
    let words = |count: usize| counted(count as u64, "word");
    let of_run = match run {
        0 => String::new(),
        _ => format!(
            ": no overflow in {samples} samples; {} could overflow for inputs that did not occur",
            words(run)
        ),
    };
    match not_run {
        0 => format!("holds{of_run}"),
        _ => format!(
            "holds for the words that were run{of_run}; {} not run could overflow",
            words(not_run)
        ),
    }
}

/// A word as the table names it, and what it is.
fn named(name: &str) -> (&str, &'static str) {
    let (key, part) = name.split_once(' ').unwrap_or((name, ""));
    let what = match (key, part) {
        ("circuit.nco.phase_bits", _) => "phase of the oscillator",
        ("circuit.nco.table", _) => "entry of the sine table",
        ("circuit.demodulator.product", _) => "ADC code times table entry",
        ("circuit.decimator", _) => "sums of the CIC decimator",
        ("circuit.decimator.output", _) => "decimated sample",
        ("circuit.cordic.width", _) => "CORDIC's x and y",
        ("circuit.cordic", _) => "drive phase",
        ("circuit.cordic.gain_bits", _) => return ("circuit.cordic magnitude", "drive magnitude"),
        ("compensation.accumulator", _) => "sums of the polynomial",
        ("compensation.output", "bias") => "bias by the polynomial",
        ("compensation.output", "rate") => "compensated rate",
        ("circuit.phase_loop.integrator_bits", _) => "integrator of the loop",
        ("circuit.phase_loop", _) => "tuning word with the loop's",
        ("circuit.amplitude_loop", "integrator") => "integrator of the loop",
        ("circuit.amplitude_loop", _) => "drive gain",
        _ => "",
    };
    (name, what)
}

/// What is required: a table, what its columns are, and what would mend each row that fails.
fn requirements(check: &Check) {
    if check.requirements.is_empty() {
        return;
    }
    let percent = check.confidence.map(|c| 100.0 * c.joint);
    let at_most = match percent {
        Some(percent) => format!("at most\nwith {percent:.0} %"),
        None => "at most".to_owned(),
    };
    let mut table = super::terminal::table(&[
        "required", "limit", "on", "computed", &at_most, "margin", "result",
    ]);
    for r in &check.requirements {
        table.add_row(requirement(r));
    }
    super::terminal::numbers(&mut table, 1..2);
    super::terminal::numbers(&mut table, 3..6);
    super::terminal::show(&table);
    let has_sign = |r: &Requirement| r.limited() != r.name;
    if check.requirements.iter().any(has_sign) {
        say!("|x|: the magnitude of x, which may be above or below 0");
    }
    if let (Some(c), Some(percent)) = (&check.confidence, percent) {
        say!(
            "computed: from one run with noise. at most: the largest magnitude that the figure may have with other noise"
        );
        say!(
            "{percent:.0} %: the confidence that {} together ({}: {:.2} % for each by itself)",
            match c.intervals {
                1 => "this bound holds".to_owned(),
                count => format!("all {count} of these bounds hold"),
            },
            c.correction,
            100.0 * c.each
        );
    }
    say!(
        "margin: how far the bound (without one, the computed figure) is inside of the limit, in % of the limit; below 0 it is outside"
    );
    for r in check.requirements.iter().filter(|r| !r.met) {
        let on = r
            .target
            .as_ref()
            .map_or(String::new(), |t| format!(" on {t}"));
        let mend = r.mend.as_deref().unwrap_or_default();
        say!("what would mend {}{on}: {mend}", r.limited());
    }
}

/// A requirement's row.
fn requirement(r: &Requirement) -> [String; 7] {
    [
        r.limited(),
        format!("{} {}", r.sign(), constant(r.limit, 4)),
        r.target.clone().unwrap_or("-".to_owned()),
        number(r.obtained, 4),
        r.most().map_or("-".to_owned(), |most| number(most, 3)),
        format!("{} %", number(100.0 * r.margin(), 3)),
        if r.met { "pass" } else { "FAIL" }.to_owned(),
    ]
}

/// Bits that a word has and bits that its proved range needs; `None` where wrapping or limiting is its function.
fn bits(n: &NodeCheck) -> Option<[u32; 2]> {
    let is_unsigned = n.limits[0] >= 0;
    let count = |[low, high]: [i128; 2]| match n.mode {
        _ if is_unsigned && low >= 0 => Interval::new(low, high).bits() - 1,
        // A symmetric format lacks the least word.
        "saturate_symmetric" => Interval::new(-1 - high.max(-low), high).bits(),
        _ => Interval::new(low, high).bits(),
    };
    if n.overflow == Overflows::ByDesign {
        return None;
    }
    let (has, needs) = (count(n.limits), count(n.proved));
    let has_no_sign = is_unsigned && n.proved[0] < 0;
    Some([
        has,
        if has_no_sign {
            needs.max(has + 1)
        } else {
            needs
        },
    ])
}

fn row(n: &NodeCheck) -> [String; 8] {
    let overflow = match n.overflow {
        Overflows::Impossible => "impossible (proved)".to_owned(),
        Overflows::Possible => format!("possible ({})", n.mode),
        Overflows::Certain => match n.follows_from {
            Some(key) => format!("follows from {key}"),
            None => format!("CERTAIN ({})", n.mode),
        },
        // Why stands in check.json.
        Overflows::ByDesign => {
            let what = n.mode.split(':').next().unwrap_or_default();
            format!("{what} by design")
        }
    };
    let (name, what) = named(&n.name);
    let [has, needs, spare] = match bits(n) {
        Some([has, needs]) => [has.into(), needs.into(), i64::from(has) - i64::from(needs)]
            .map(|v: i64| v.to_string()),
        None => ["-"; 3].map(str::to_owned),
    };
    let format = match n.name == name {
        true => n.format.clone(),
        // The engine's own, which no key sets.
        false => "internal".to_owned(),
    };
    [
        name.to_owned(),
        what.to_owned(),
        format,
        format!("{} .. {}", n.proved[0], n.proved[1]),
        has,
        needs,
        spare,
        overflow,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{reader, template};

    pub(super) fn checked(changes: &[(&str, &str)]) -> Check {
        let mut text = template::DEFAULT.to_owned();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        check::check(&reader::parse(&text, None).unwrap(), "test", 20_000).unwrap()
    }

    #[test]
    fn every_row_says_what_it_is_and_its_bits_agree_with_what_is_proved() {
        let changes: [&[(&str, &str)]; 3] = [
            &[],
            &[("width = 32", "width = 29")],
            &[
                ("#[circuit.phase_loop]", "[circuit.phase_loop]"),
                ("#setpoint_raw = -4194304", "setpoint_raw = -4194304"),
                ("#proportional =", "proportional ="),
                ("#integral =", "integral ="),
                ("#integrator_bits =", "integrator_bits ="),
            ],
        ];
        for changes in changes {
            let check = checked(changes);
            for n in &check.nodes {
                assert!(!named(&n.name).1.is_empty(), "{}", n.name);
                if let Some([has, needs]) = bits(n) {
                    let fits = n.overflow == Overflows::Impossible;
                    assert_eq!(needs <= has, fits, "{n:?}");
                }
            }
        }
    }

    #[test]
    fn the_magnitude_is_called_so_and_has_no_format_of_a_key() {
        let check = checked(&[]);
        let of = |name: &str| row(check.nodes.iter().find(|n| n.name == name).unwrap());
        let magnitude = of("circuit.cordic.gain_bits");
        let due = ["circuit.cordic magnitude", "drive magnitude", "internal"];
        assert_eq!(magnitude[..3], due);
        assert_eq!(magnitude[4..7], ["64", "24", "40"]);
        assert_eq!(of("circuit.cordic.width")[4..7], ["32", "31", "1"]);
        let bias = of("compensation.output bias");
        let due = ["24", "25", "-1", "possible (saturate)"];
        assert_eq!(bias[4..8], due);
        assert_eq!(
            of("circuit.cordic phase")[4..8],
            ["-", "-", "-", "wraps by design"]
        );
    }

    #[test]
    fn the_verdict_says_what_is_not_proved() {
        assert_eq!(verdict(true, [0, 0], 1000), "holds");
        assert_eq!(verdict(false, [2, 0], 1000), "does not hold");
        for (open, words) in [(1, "1 word"), (2, "2 words")] {
            let due = format!(
                "holds: no overflow in 1000 samples; {words} could overflow for inputs that did not occur"
            );
            assert_eq!(verdict(true, [open, 0], 1000), due);
        }
        assert_eq!(
            verdict(true, [0, 1], 1000),
            "holds for the words that were run; 1 word not run could overflow"
        );
        assert_eq!(
            verdict(true, [1, 2], 1000),
            "holds for the words that were run: no overflow in 1000 samples; 1 word could overflow for inputs that did not occur; \
             2 words not run could overflow"
        );
    }
}
