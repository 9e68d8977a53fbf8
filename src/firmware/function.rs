//! The bundle of one function that stands alone: no chain, no state, one word in, one word out.

use super::files::{self, EmittedFile, View, csv_line};
use super::manifest::{self, Header, Manifest};
use super::outside;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::lower::lower;
use crate::emit::views;
use crate::emit::views::{Language, mix};
use crate::error::Result;
use crate::numeric::trace::ir::{Interval, Program};
use crate::vectors::model::Model;
use crate::vectors::stimulus::EXHAUSTIVE_BITS;
use crate::vectors::stimulus::{self, SEED};

/// Random vectors.
const VECTORS: usize = 1024;
/// Words among which the vectors that show damage are searched.
const CANDIDATES: usize = 1 << 16;
/// Inputs that share a checksum where every input is compared.
const BLOCK: u64 = 1 << 12;

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
    /// From [`vectors`]: the same in every language.
    pub vectors: &'a [EmittedFile],
}

/// Emits the function in one language, as files in memory.
///
/// # Errors
/// A template that cannot be printed (a fault of the tool).
pub fn emit(what: &Standalone, language: Language) -> Result<Vec<EmittedFile>> {
    let bundle = bundle(what);
    let banner = manifest::banner(what.request_sha256, what.command);
    let models = std::slice::from_ref(what.model);
    let mut facts = what.facts.clone();
    facts.push("words are two's complement; ranges beside them are proved, not observed".into());
    let view = View::new(&bundle, models, language, banner, facts);
    let mut emitted = files::sources(&view, Part::Compensation, language)?;
    emitted.extend_from_slice(what.vectors);
    emitted.push(files::table_vectors(&view.tables));
    let header = Header {
        design_sha256: what.request_sha256,
        command: what.command,
        language,
        part: "function",
        has_code: true,
        columns: &[],
    };
    let manifest = Manifest::new(&header, &bundle, &view.tables, &view.functions, &emitted);
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

/// Vectors, and checksums over every input there is if these have few enough bits. `run` is the model's
/// only output for its only input, computed on `threads` threads.
pub fn vectors(
    program: &Program,
    model: &Model,
    run: &(dyn Fn(i128) -> i128 + Sync),
    threads: usize,
) -> Vec<EmittedFile> {
    let mut all = vec![chosen(program, model)];
    all.extend(every_input(model, run, threads));
    all
}

/// Inputs with the model's outputs: corners, random words, and words that show a rounding constant or a
/// coefficient that is off by one.
fn chosen(program: &Program, model: &Model) -> EmittedFile {
    let mut text = String::new();
    if let Some(f) = program.function(&model.name) {
        let names = f.inputs.iter().map(|(port, _)| port.name);
        let names = names.chain(f.outputs.iter().map(|(port, _)| port.name));
        text = names.chain(["fault"]).collect::<Vec<_>>().join(",") + "\n";
    }
    let mut inputs = stimulus::inputs(&model.inputs, VECTORS, SEED);
    let candidates = stimulus::inputs(&model.inputs, CANDIDATES, SEED + 4);
    inputs.extend(model.near_ties(&candidates));
    let mut outputs = vec![0; model.outputs];
    let position = program.functions.iter().position(|f| f.name == model.name);
    let beside = position.and_then(|k| Some(outside::rows(lower(program).get(k)?, &model.inputs)));
    let inside = inputs.into_iter().map(|input| [input.clone(), input]);
    for [given, due] in inside.chain(beside.unwrap_or_default()) {
        let fault = model.call(&due, &mut outputs);
        let mut line = given;
        line.extend(&outputs);
        line.push(i128::from(fault));
        text += &csv_line(&line);
    }
    EmittedFile {
        path: format!("vectors/{}.csv", model.name),
        text,
    }
}

/// Checksums of the outputs over every input there is, block by block, if it has few enough bits.
fn every_input(
    model: &Model,
    run: &(dyn Fn(i128) -> i128 + Sync),
    threads: usize,
) -> Option<EmittedFile> {
    let [range] = model.inputs.as_slice() else {
        return None;
    };
    if range.high - range.low >= 1 << EXHAUSTIVE_BITS {
        return None;
    }
    // Of the output and of the fault, which is none.
    let checksum = |block: &Interval| {
        let inputs = block.low..=block.high;
        let h = inputs.fold(views::BASIS, |h, x| mix(mix(h, run(x) as u64), 0));
        [block.low, block.high - block.low + 1, i128::from(h)]
    };
    let blocks: Vec<Interval> = blocks(*range).collect();
    let share = blocks.len().div_ceil(threads.max(1)).max(1);
    let lines = std::thread::scope(|scope| {
        let parts = blocks.chunks(share).map(|part| {
            scope.spawn(move || part.iter().map(checksum).map(|l| csv_line(&l)).collect())
        });
        let parts: Vec<_> = parts.collect();
        let joined: Option<Vec<String>> = parts.into_iter().map(|p| p.join().ok()).collect();
        joined
    })?;
    Some(EmittedFile {
        path: format!("vectors/{}.every.csv", model.name),
        text: "low,count,checksum\n".to_owned() + &lines.concat(),
    })
}

/// The range in blocks of at most [`BLOCK`] inputs.
fn blocks(range: Interval) -> impl Iterator<Item = Interval> {
    (range.low..=range.high)
        .step_by(BLOCK as usize)
        .map(move |low| Interval::new(low, (low + BLOCK as i128 - 1).min(range.high)))
}
