//! The emitted form: sources in C and Rust with vectors that show damage.

use crate::approx::form::Settled;
use crate::emit::views::Language;
use crate::error::Result;
use crate::firmware::files::EmittedFile;
use crate::firmware::function;
use crate::firmware::function::Standalone;
use crate::firmware::vectors::Checked;
use crate::tabulate::outcome::Outcome;
use crate::vectors::model::Model;

/// What both languages' bundles are tested with.
pub fn vectors(settled: &Settled, model: &Model) -> Vec<EmittedFile> {
    function::vectors(&settled.program, model)
}

/// Number and checksum of every input, where these are few enough.
pub fn every(settled: &Settled, model: &Model, threads: usize) -> Option<Checked> {
    function::every(model, &|x| settled.run(x), threads)
}

/// The bundle in one language, as files in memory.
///
/// # Errors
/// As [`function::emit`].
pub fn emit(
    settled: &Settled,
    model: &Model,
    (vectors, every): (&[EmittedFile], Option<Checked>),
    outcome: &Outcome,
    prefix: &str,
    language: Language,
) -> Result<Vec<EmittedFile>> {
    let standalone = Standalone {
        prefix,
        program: &settled.program,
        model,
        facts: facts(outcome),
        request_sha256: &outcome.design_sha256,
        command: &outcome.command,
        vectors,
        every,
    };
    function::emit(&standalone, language)
}

fn facts(outcome: &Outcome) -> Vec<String> {
    let f = &outcome.formats;
    let e = &outcome.error;
    let observed = match (e.exhaustive_max_abs, e.sampled_max_abs) {
        (Some(v), _) => format!("over all {} input codes {v:e}", outcome.inputs_checked),
        (None, Some(v)) => format!("over {} sampled codes {v:e}", outcome.inputs_checked),
        (None, None) => String::new(),
    };
    vec![
        format!(
            "f(x) = {} for x from {}",
            outcome.function,
            outcome.domain.replace(',', " to ")
        ),
        outcome.detail.clone(),
        format!(
            "input {}, output {}, coefficients {}, intermediate {}",
            f.input,
            f.output,
            f.coefficients,
            f.intermediate.as_deref().unwrap_or("none")
        ),
        format!(
            "error at most {:e} (proved); {observed}, at input {}",
            e.certified_max_abs, e.at_input_raw
        ),
        format!(
            "domain: words {} .. {}; of the input's other words each gives the result at the nearer end",
            outcome.input_codes[0], outcome.input_codes[1]
        ),
    ]
}
