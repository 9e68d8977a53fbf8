//! The emitted form: sources in C and Rust with vectors that show damage.

use crate::approx::form::polynomial::Polynomial;
use crate::approx::form::{Form, Settled};
use crate::tabulate::outcome::Outcome;
use crate::firmware::files::EmittedFile;
use crate::firmware::function;
use crate::firmware::function::Standalone;
use crate::emit::views::Language;
use crate::error::{Error, Result};
use crate::vectors::model::Model;

/// The bit-accurate model of a form, with copies in which a rounding constant or a coefficient is off by one.
///
/// # Errors
/// A program without the function: an error of this program.
pub fn model(settled: &Settled) -> Result<Model> {
    let function = settled.program.function("evaluate");
    let function = function.ok_or_else(|| Error::Check("internal: nothing was traced".into()))?;
    let narrow = settled.bits <= 64;
    let model = Model::new::<1, 1, Form>(function, settled.form.clone(), narrow);
    Ok(model.with_damage::<1, 1, Form>(damaged(&settled.form), narrow))
}

/// Copies in which a rounding constant or a coefficient is off by one; tables are compared entry by entry.
pub(crate) fn damaged(form: &Form) -> Vec<Form> {
    let mut all = form.with_nudged_casts();
    if let Form::Polynomial(p) = form {
        for order in p.monomials.exponents(p.coefficients.len() - 1) {
            for step in [-1, 1] {
                let mut raw = p.coefficients.clone();
                raw[order] += step;
                let moved = Polynomial::new(p.formats, p.monomials, raw);
                all.extend(moved.ok().map(|p| Form::Polynomial(Box::new(p))));
            }
        }
    }
    all
}

/// What both languages' bundles are tested with.
pub fn vectors(settled: &Settled, model: &Model, threads: usize) -> Vec<EmittedFile> {
    function::vectors(&settled.program, model, &|x| settled.run(x), threads)
}

/// The bundle in one language, as files in memory.
///
/// # Errors
/// As [`function::emit`].
pub fn emit(
    settled: &Settled,
    model: &Model,
    vectors: &[EmittedFile],
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
            "inputs outside {} .. {} are limited to them",
            outcome.input_codes[0], outcome.input_codes[1]
        ),
    ]
}
