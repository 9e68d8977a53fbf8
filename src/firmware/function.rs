//! The bundle of one function that stands alone: no chain, no state, one word in, one word out.

use super::emitted::EmittedFile;
use super::files;
use super::manifest::{self, Header, Manifest};
use super::recipe::Recipes;
use super::vectors::{self, Checked};
use super::view::View;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::lower::lower;
use crate::emit::views::Language;
use crate::error::Result;
use crate::numeric::trace::ir::Program;
use crate::vectors::model::Model;

/// What is emitted, and where it comes from.
pub struct Standalone<'a> {
    /// Prefix of every name in C, the crate in Rust.
    pub prefix: &'a str,
    /// The recorded block: one function.
    pub program: &'a Program,
    /// Its bit-accurate model.
    pub model: &'a Model,
    /// Lines for the head of the sources: what the function is, in which formats, how accurate.
    pub facts: Vec<String>,
    /// Of the request.
    pub request_sha256: &'a str,
    /// The command that makes it again.
    pub command: &'a str,
    /// From [`vectors()`]: the same in every language.
    pub vectors: &'a [EmittedFile],
    /// From [`every`].
    pub every: Option<Checked>,
}

/// Emits the function in one language, as files in memory.
///
/// # Errors
/// A template that cannot be printed (a fault of the tool).
pub fn emit(what: &Standalone, language: Language) -> Result<Vec<EmittedFile>> {
    let bundle = bundle(what);
    let banner = manifest::banner(manifest::REQUEST, what.request_sha256, what.command);
    let models = std::slice::from_ref(what.model);
    let mut facts = what.facts.clone();
    facts.push("words are two's complement; ranges beside them are proved, not observed".into());
    let mut view = View::new(&bundle, models, &[what.every], language, banner, facts);
    // The input is a number, no sensor's code.
    view.recipes = Recipes::default();
    let mut emitted = files::sources(&view, Part::Compensation, language)?;
    emitted.extend_from_slice(what.vectors);
    emitted.push(vectors::of_tables(&view.tables));
    emitted.push(files::sums(&emitted));
    let header = Header {
        design_sha256: what.request_sha256,
        command: what.command,
        language,
        part: manifest::FUNCTION,
        has_code: true,
        columns: &[],
    };
    let manifest = Manifest::new(&header, &bundle, &view, &emitted);
    emitted.push(EmittedFile {
        path: manifest::NAME.into(),
        text: manifest.to_json(),
    });
    Ok(emitted)
}

/// The program as a bundle of its own.
pub fn bundle(what: &Standalone) -> Bundle {
    Bundle {
        prefix: what.prefix.to_owned(),
        lowered: lower(what.program),
        states: Vec::new(),
        initial: Vec::new(),
        program: what.program.clone(),
        has_chain: false,
        ratio: 1,
        accuracy: Vec::new(),
    }
}

/// Vectors of the function: ends, random words, words that show damage, and words that its limits have to hold.
pub fn vectors(program: &Program, model: &Model) -> Vec<EmittedFile> {
    let position = program.functions.iter().position(|f| f.name == model.name);
    let lowered = lower(program);
    let lowered = position.and_then(|k| lowered.get(k));
    vec![vectors::function(model, lowered, Vec::new())]
}

/// Number and checksum of every input there is, if they have few enough bits. `run` is the model's only output
/// for its only input, computed on `threads` threads.
pub fn every(
    model: &Model,
    run: &(dyn Fn(i128) -> i128 + Sync),
    threads: usize,
) -> Option<Checked> {
    // The last word is the fault, which is none.
    let record = |input: &[i128], to: &mut Vec<i128>| to.extend([run(input[0]), 0]);
    vectors::every(&model.inputs, &record, threads)
}
