//! `gyrogen approx`: a function in fixed point, with its certified error.

use super::alternatives;
use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::approx::form::polynomial::{Monomials, Scheme};
use crate::design::target::Target;
use crate::emit::views::Language;
use crate::error::{Error, InputError, Result};
use crate::firmware::approximation;
use crate::firmware::replace;
use crate::numeric::format::Format;
use crate::tabulate::job;
use crate::tabulate::job::{Asked, Request, Weight};
use crate::tabulate::outcome::{Alternative, Outcome, Search};
use crate::tabulate::selection::Reason;
use crate::text::{at_most, counted, number};
use crate::timing;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

/// Approximate a function in fixed point by a polynomial, table or segments with a proved error, in C and Rust.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The function of x, as a formula: numbers, + - * / ^, pi, sin cos tan asin acos atan sqrt exp log abs.
    #[arg(long, allow_hyphen_values = true)]
    function: String,
    /// Where it is wanted: least and greatest x, numbers or constants (`0,pi/4`).
    #[arg(long, value_name = "A,B", allow_hyphen_values = true)]
    domain: String,
    /// Degree of the polynomial or of the segments; of a table 0 plain, 1 linear, 2
    /// quadratic. This or --bound is needed.
    #[arg(long, value_name = "N")]
    degree: Option<usize>,
    /// Which powers of x the polynomial has; all if left out, and with --bound whatever is cheapest.
    #[arg(long, value_enum)]
    monomials: Option<Monomials>,
    /// Format of the input: Qm.n, signed with m + n bits, n of them fractional, or UQm.n, unsigned.
    #[arg(long, value_name = "FORMAT")]
    input: Format,
    /// Format of the output, as that of the input.
    #[arg(long, value_name = "FORMAT")]
    output: Format,
    /// Format of the coefficients, or one for each of a polynomial's, lowest order first (`Q1.15,Q1.17`). This
    /// or --bound is needed; with --bound it is chosen if left out.
    #[arg(long, value_name = "FORMAT", value_delimiter = ',')]
    coefficients: Vec<Format>,
    /// Format that each step of a polynomial is rounded to; so wide that nothing is lost if left out.
    #[arg(long, value_name = "FORMAT")]
    intermediate: Option<Format>,
    /// The order of a polynomial's multiplications and additions.
    #[arg(long, value_enum, default_value = "horner")]
    evaluation: Scheme,
    /// What stands for the function.
    #[arg(long, value_enum, default_value = "polynomial")]
    form: Asked,
    /// The most that the proved error may be, in the function's unit.
    #[arg(long, value_name = "X", value_parser = super::values::number)]
    bound: Option<f64>,
    /// Which error the coefficients keep small.
    #[arg(long, value_enum, default_value = "absolute")]
    weight: Weight,
    /// A value for a name in the function; may be given more than once.
    #[arg(
        long = "parameter",
        value_name = "NAME=VALUE",
        allow_hyphen_values = true
    )]
    parameters: Vec<String>,
    /// Run every input code where there are up to 2^32 of them; without it, up to 2^24.
    #[arg(long)]
    exhaustive: bool,
    /// The processor whose cycles (an estimate) decide, with the ROM, which form is chosen.
    #[arg(long, value_enum, default_value = "host")]
    target: Target,
    /// Prefix of the emitted names: a C identifier.
    #[arg(long, default_value = "approx")]
    name: String,
    /// Threads, 1 to 1024; as many as the machine has if left out. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = super::values::whole::<u16>(1..=1024))]
    threads: Option<u16>,
    /// Folder for the results; made if it does not exist.
    #[arg(long, value_name = "DIR", default_value = "gyrogen-approx")]
    out: PathBuf,
    #[command(flatten)]
    force: super::common::Force,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// Runs the command.
///
/// # Errors
/// A request that cannot be used (exit 2); a bound that is not met (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("approximating");
    let request = request(arguments)?;
    let planned = ["approx.json", "report.html", timing::NAME];
    let mut results =
        super::common::claim(&arguments.out, &planned, &recorded.inputs, arguments.force)?;
    if !arguments.force.force {
        for folder in ["c", "rust"] {
            replace::refuse(&[], &arguments.out.join(folder))?;
        }
    }
    let done = AtomicU64::new(0);
    let threads = super::threads(arguments.threads);
    let made = job::approximate(&request, &recorded.command, threads, &|total, count| {
        let done = count + done.fetch_add(count, Ordering::Relaxed);
        watch.at(done, Some(total as u64));
    })?;
    watch.stage("emitting");
    let model = crate::vectors::form::model(&made.settled)?;
    let vectors = approximation::vectors(&made.settled, &model);
    let every = approximation::every(&made.settled, &model, threads);
    let emit = |language| {
        approximation::emit(
            &made.settled,
            &model,
            (&vectors, every),
            &made.outcome,
            &request.name,
            language,
        )
    };
    let (c, rust) = (emit(Language::C)?, emit(Language::Rust)?);
    let json = super::json(&made.outcome);
    watch.stage("writing");
    for (files, folder) in [(&c, "c"), (&rust, "rust")] {
        super::common::bundle(files, folder, &mut results, arguments.force.force)?;
    }
    results.write("approx.json", json.as_bytes())?;
    let page = crate::report::approx::html(&made)?;
    results.write("report.html", page.as_bytes())?;
    watch.write(&mut results, &made.outcome.design_sha256, &recorded.command)?;
    let note = super::earlier::note(&arguments.out, "approx.json", "request", &json);
    results.finish()?;
    note.iter().for_each(|note| talk!("{note}"));
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => print(&made.outcome, &arguments.out),
    }
    if made.outcome.holds {
        return Ok(());
    }
    Err(Error::Check(format!(
        "the certified error {} is above the bound",
        at_most(made.outcome.error.certified_max_abs, 3)
    )))
}

fn request(arguments: &Arguments) -> Result<Request> {
    let ends: Vec<&str> = arguments.domain.split(',').map(str::trim).collect();
    let [low, high] = ends[..] else {
        let help = match ends[..] {
            [a, b, c, d] => format!("the decimal mark is a point: `--domain={a}.{b},{c}.{d}`"),
            [_] => "such as `--domain=-0.9,0.2` or `--domain=0,pi/4`".to_owned(),
            _ => "write decimal marks as points, such as `--domain=-0.9,0.2`".to_owned(),
        };
        return Err(InputError::new(format!(
            "`{}` is no domain: two numbers with a comma between them are wanted",
            arguments.domain
        ))
        .help(help)
        .into());
    };
    let mut parameters = BTreeMap::new();
    for text in &arguments.parameters {
        let refuse = |why: String| {
            InputError::new(format!("`--parameter {text}` gives no value: {why}"))
                .help("such as `--parameter gain=1.25`")
        };
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| refuse("a name, `=` and a number are wanted".to_owned()))?;
        let number = super::values::number(value).map_err(refuse)?;
        if !number.is_finite() {
            return Err(refuse("the number has to be finite".to_owned()).into());
        }
        parameters.insert(name.trim().to_owned(), number);
    }
    Ok(Request {
        function: arguments.function.clone(),
        parameters,
        domain: [low.to_owned(), high.to_owned()],
        degree: arguments.degree,
        monomials: arguments.monomials,
        input: arguments.input,
        output: arguments.output,
        coefficients: arguments.coefficients.clone(),
        evaluation: arguments.evaluation,
        intermediate: arguments.intermediate,
        form: arguments.form,
        bound: arguments.bound,
        weight: arguments.weight,
        exhaustive: arguments.exhaustive,
        target: arguments.target,
        name: arguments.name.clone(),
    })
}

/// The spelling of a choice on the command line.
fn spelled<T: clap::ValueEnum>(value: &T) -> String {
    value
        .to_possible_value()
        .map_or(String::new(), |v| v.get_name().to_owned())
}

fn print(o: &Outcome, out: &std::path::Path) {
    if let Some(listed) = &o.alternatives {
        let table = alternatives::table(&["certified error"], listed.iter().map(alternative));
        super::terminal::show(&table);
        let marked = listed.iter().map(|a| (a.undominated, a.chosen));
        say!("{}", alternatives::marks(marked));
        say!(
            "Certified errors in this table are quick bounds, which are proved but need not be tight. That of the chosen form is computed again \
             below, more closely, and may be smaller."
        );
    }
    if let Some(search) = &o.search {
        let mut table = super::terminal::table(&[
            "coefficients",
            "error, ideal evaluation",
            "error, whole evaluation",
        ]);
        for c in &search.compared {
            let total = c.total_max_abs.map_or("-".into(), |v| number(v, 6));
            table.add_row([c.name.to_owned(), number(c.ideal_max_abs, 6), total]);
        }
        super::terminal::numbers(&mut table, 1..);
        super::terminal::show(&table);
        say!(
            "Ideal evaluation rounds the coefficients alone; whole evaluation rounds every step and the output too, as the emitted \
             code does, and its error is the largest over the input codes that the search ran. Proved bounds are in the table below."
        );
        say!("{}", taken(search));
    }
    say!("{} on {}: {}", o.function, o.domain, o.detail);
    let f = &o.formats;
    let words = |format: &str| match format.starts_with("2^") {
        true => format!("in steps of {format}"),
        false => format.to_owned(),
    };
    let steps = f.intermediate.as_deref();
    say!(
        "input {}, output {}, coefficients {}{}",
        f.input,
        f.output,
        words(&f.coefficients),
        steps.map_or(String::new(), |f| format!(
            ", intermediate results {}",
            words(f)
        ))
    );
    let lsb = f.output.parse::<Format>().map_or(1.0, Format::lsb);
    let mut table = super::terminal::table(&[
        "largest error",
        "value",
        "LSB of the output",
        "of what, and where",
    ]);
    // A bound is rounded up, what was seen to the nearest, as in the table of coefficients.
    let mut row = |what: &str, v: f64, of: String| {
        let shown = if what == "observed" { number } else { at_most };
        table.add_row([what.to_owned(), shown(v, 6), shown(v / lsb, 4), of]);
    };
    row(
        "certified",
        o.error.certified_max_abs,
        "the emitted code, at every input code (proved); rounding x to its code is not in it"
            .to_owned(),
    );
    let at = o.error.at_input_raw;
    match (o.error.exhaustive_max_abs, o.error.sampled_max_abs) {
        (Some(v), _) => row(
            "observed",
            v,
            format!(
                "the emitted code, on all {} input codes, at input {at}",
                o.inputs_checked
            ),
        ),
        (None, Some(v)) => row(
            "observed",
            v,
            format!(
                "the emitted code, on {} of the input codes, at input {at} (`--exhaustive` runs all up to 2^32)",
                o.inputs_checked
            ),
        ),
        (None, None) => {}
    }
    row(
        "of the coefficients alone",
        o.error.coefficients_only_max_abs,
        "the polynomial or table with its rounded coefficients, evaluated exactly, at every x (proved)".to_owned(),
    );
    super::terminal::numbers(&mut table, 1..3);
    super::terminal::show(&table);
    if let Some(ideal) = o.ideal.as_ref().filter(|i| !i.emitted) {
        say!(
            "The coefficients that are best under ideal evaluation{} are `ideal` in approx.json. They are not emitted, for their \
             whole evaluation is not better.",
            if ideal.proved_best { " (proved)" } else { "" }
        );
    }
    say!(
        "{} bytes, {}, {}, about {} cycles on {}",
        o.cost.rom_bytes,
        counted(o.cost.multiplies.into(), "multiplication"),
        counted(o.cost.adds.into(), "addition"),
        o.cost.cycles,
        spelled(&o.target)
    );
    super::common::wrote(out, &["report.html", "c", "rust"]);
}

fn alternative(a: &Alternative) -> alternatives::Line<'_> {
    alternatives::Line {
        detail: &a.detail,
        cost: a.cost,
        errors: vec![at_most(a.certified_max_abs, 5)],
        undominated: a.undominated,
        chosen: a.chosen,
    }
}

/// Why the coefficients were taken and what that gains.
fn taken(search: &Search) -> String {
    let part = match search.rounding_part {
        part if part < 0.001 => "less than 0.1 %".to_owned(),
        part if part < 1.0 => format!("{} %", at_most(100.0 * part, 2)),
        // A bound of the rounding, beside an error that was found.
        _ => "all".to_owned(),
    };
    let why = match search.reason {
        Reason::RoundingNegligible => format!(
            "rounding of steps and output makes at most {part} of the error, so the coefficients decide. Those were taken \
             whose polynomial is nearest to the function"
        ),
        Reason::RoundingSmall => format!(
            "rounding of steps and output makes at most {part} of the error. The coefficients whose polynomial is nearest \
             to the function were taken, as with rounding they are ahead of the other choices too"
        ),
        Reason::LeastTotal => format!(
            "rounding of steps and output may make {part} of the error, so the nearest polynomial need not give the nearest \
             results. Those coefficients were taken whose results, rounding included, have the least error"
        ),
    };
    let gain = search
        .gain_over_nearest_plane_percent
        .filter(|g| *g >= 0.005);
    let gain = gain.map(|g| format!("{} % less than with lattice rounding", number(g, 2)));
    let best = match search.compared.last() {
        Some(c) if c.proved => Some("proved to be the least for these formats"),
        _ if search.proved_best => {
            Some("the least error found is proved to be the least for these formats")
        }
        _ => None,
    };
    let said: Vec<String> = gain.into_iter().chain(best.map(str::to_owned)).collect();
    let error = match said.is_empty() {
        true => String::new(),
        false => format!(" Their error: {}.", said.join("; ")),
    };
    format!("choice of coefficients (row \"taken\"): {why}.{error}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tabulate::outcome::Compared;

    #[test]
    fn what_the_choice_gains_and_what_is_proved_of_it_is_said_in_one_sentence() {
        let mut search = Search {
            minimax_error: 1e-4,
            reason: Reason::LeastTotal,
            rounding_part: 0.5,
            least_total: 2e-4,
            proved_best: true,
            coefficients_proved_best: true,
            gain_over_nearest_plane_percent: Some(10.0),
            evaluations: 1,
            compared: vec![Compared {
                name: "taken",
                raw: vec![1],
                ideal_max_abs: 1e-4,
                total_max_abs: Some(2e-4),
                proved: true,
            }],
        };
        let said = taken(&search);
        assert!(
            said.ends_with(
                " % less than with lattice rounding; proved to be the least for these formats."
            ),
            "{said}"
        );
        search.gain_over_nearest_plane_percent = None;
        (search.proved_best, search.compared[0].proved) = (false, false);
        let said = taken(&search);
        assert!(!said.contains("Their error"), "{said}");
    }
}
