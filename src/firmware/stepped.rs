//! The bundle of one function with a state that is called once a reading: no chain.
//!
//! Its first input restarts the state where it is 1. The state starts at zeros.

use super::files::{self, EmittedFile, View, csv_line};
use super::manifest::{self, Header, Manifest};
use super::outside;
use crate::emit::bundle::{Bundle, Part, states};
use crate::emit::lower::lower;
use crate::emit::views;
use crate::emit::views::{FunctionView, Language, mix};
use crate::error::{Error, Result};
use crate::numeric::trace::ir::{Interval, Program};
use crate::vectors::stimulus::{Lcg, SEED};

/// Calls of the self-test, and of each of the three parts of the vectors.
const CALLS: usize = 1024;
/// A restart so often.
const RESTART: usize = 512;

/// What is emitted, and where it comes from.
pub struct Stepped<'a> {
    /// Prefix of every name in C, the crate in Rust.
    pub prefix: &'a str,
    /// The recorded block: one function with a state, one output.
    pub program: &'a Program,
    /// Its bit-accurate model: the output of each call, from the state at zeros.
    pub model: &'a dyn Fn(&[Vec<i128>]) -> Vec<i128>,
    /// `part` in the manifest.
    pub part: &'static str,
    /// Lines for the head of the sources.
    pub facts: Vec<String>,
    /// Of the request.
    pub request_sha256: &'a str,
    /// The command that makes it again.
    pub command: &'a str,
}

/// What the templates show beside the function.
#[derive(Debug, Clone)]
pub struct StreamView {
    /// The function.
    pub function: FunctionView,
    /// The state's name.
    pub state: String,
    /// As a Rust type.
    pub camel: String,
    /// Number in the self-test.
    pub number: u32,
    /// Calls in the self-test.
    pub count: usize,
    /// A restart so often.
    pub restart: usize,
    /// FNV-1a of the outputs.
    pub checksum: String,
}

/// The program as a bundle.
pub fn bundle(prefix: &str, program: &Program) -> Bundle {
    Bundle {
        prefix: prefix.to_owned(),
        lowered: lower(program),
        states: states(program),
        initial: Vec::new(),
        program: program.clone(),
        has_chain: false,
        ratio: 1,
        accuracy: Vec::new(),
    }
}

/// Emits the function in one language, as files in memory.
///
/// # Errors
/// A program without the function (a fault of the tool).
pub fn emit(what: &Stepped, language: Language) -> Result<Vec<EmittedFile>> {
    let bundle = bundle(what.prefix, what.program);
    let internal = || Error::Check("internal: nothing was traced".into());
    let function = what.program.functions.last().ok_or_else(internal)?;
    let ranges: Vec<Interval> = function.inputs.iter().map(|(_, range)| *range).collect();
    let banner = manifest::banner(what.request_sha256, what.command);
    let mut facts = what.facts.clone();
    facts.push("words are two's complement; ranges beside them are proved, not observed".into());
    let mut view = View::new(&bundle, &[], language, banner, facts);
    let shown = views::functions(&bundle, language).pop();
    view.stimulated = true;
    view.stream = Some(StreamView {
        function: shown.ok_or_else(internal)?,
        state: function.state.to_owned(),
        camel: crate::emit::rust::camel(function.state),
        number: view.tables.len() as u32 + 1,
        count: CALLS,
        restart: RESTART,
        checksum: format!("{:#x}", checksum(what.model, &ranges)),
    });
    let mut emitted = files::sources(&view, Part::Compensation, language)?;
    let names = function.inputs.iter().map(|(port, _)| port.name);
    let names = names.chain(function.outputs.iter().map(|(port, _)| port.name));
    let beside = bundle
        .lowered
        .last()
        .map_or(Vec::new(), |l| outside::rows(l, &ranges));
    emitted.push(vectors(what.model, &ranges, beside, &function.name, names));
    emitted.push(files::table_vectors(&view.tables));
    let header = Header {
        design_sha256: what.request_sha256,
        command: what.command,
        language,
        part: what.part,
        has_code: true,
        columns: &[],
    };
    let mut manifest = Manifest::new(&header, &bundle, &view.tables, &view.functions, &emitted);
    manifest.stream = Some(manifest::FunctionEntry {
        number: view.tables.len() as u32 + 1,
        name: function.name.clone(),
        inputs: function.inputs.len(),
        outputs: function.outputs.len(),
        every_input: None,
    });
    emitted.push(EmittedFile {
        path: manifest::NAME.into(),
        text: manifest.to_json(),
    });
    Ok(emitted)
}

/// Of the model's outputs on the self-test's stimulus.
fn checksum(model: &dyn Fn(&[Vec<i128>]) -> Vec<i128>, ranges: &[Interval]) -> u64 {
    let mut lcg = Lcg(SEED);
    let calls = (0..CALLS).map(|n| random(&mut lcg, ranges, n % RESTART == 0));
    let outputs = model(&calls.collect::<Vec<_>>());
    outputs
        .iter()
        .fold(views::BASIS, |h, word| mix(h, *word as u64))
}

fn random(lcg: &mut Lcg, ranges: &[Interval], restart: bool) -> Vec<i128> {
    let mut words = vec![i128::from(restart)];
    words.extend(ranges.iter().skip(1).map(|range| lcg.word(*range)));
    words
}

/// Calls with the model's outputs: slow triangles over each range (as temperatures move), ends and zeros,
/// random words.
fn vectors<'a>(
    model: &dyn Fn(&[Vec<i128>]) -> Vec<i128>,
    ranges: &[Interval],
    beside: Vec<[Vec<i128>; 2]>,
    name: &str,
    names: impl Iterator<Item = &'a str>,
) -> EmittedFile {
    let mut lcg = Lcg(SEED + 5);
    let triangle = |n: usize, k: usize, range: &Interval| {
        let span = range.high - range.low;
        // 2, 3, 4, ... times up and down.
        let place = n as i128 * 2 * span * (k as i128 + 2) / CALLS as i128 % (2 * span).max(1);
        range.low
            + if place > span {
                2 * span - place
            } else {
                place
            }
    };
    let mut calls = Vec::with_capacity(3 * CALLS);
    for n in 0..CALLS {
        let mut words = vec![i128::from(n == 0)];
        let inputs = ranges.iter().enumerate().skip(1);
        words.extend(inputs.map(|(k, range)| triangle(n, k, range)));
        calls.push(words);
    }
    for n in 0..CALLS {
        let mut words = vec![i128::from(n % RESTART == 0)];
        words.extend(ranges.iter().skip(1).map(|range| {
            let ends = [range.low, range.high, 0, -1, 1];
            let pick = (lcg.draw() >> 33) as usize % ends.len();
            ends.get(pick).copied().unwrap_or(0)
        }));
        calls.push(words);
    }
    calls.extend((0..CALLS).map(|n| random(&mut lcg, ranges, n % RESTART == 0)));
    let (more, due): (Vec<_>, Vec<_>) = beside.into_iter().map(|[given, due]| (given, due)).unzip();
    let given: Vec<Vec<i128>> = calls.iter().cloned().chain(more).collect();
    calls.extend(due);
    let mut text = names.chain(["fault"]).collect::<Vec<_>>().join(",") + "\n";
    for (mut line, word) in given.into_iter().zip(model(&calls)) {
        line.extend([word, 0]);
        text += &csv_line(&line);
    }
    EmittedFile {
        path: format!("vectors/{name}.csv"),
        text,
    }
}
