//! The bundle of one function with a state that is called once a reading: no chain.
//!
//! Its first input restarts the state where it is 1. The state starts at zeros.

use super::emitted::EmittedFile;
use super::files;
use super::manifest::{self, Header, Manifest};
use super::tested;
use super::vectors::{self, csv_line};
use super::view::{StreamView, View};
use crate::correction::Calls;
use crate::emit::bundle::{Bundle, Part, states};
use crate::emit::lower::lower;
use crate::emit::views;
use crate::emit::views::{Language, mix};
use crate::error::{Error, Result};
use crate::numeric::trace::ir::{Interval, Program};
use crate::vectors::interpreter::Interpreter;
use crate::vectors::model::Model;
use crate::vectors::stimulus::{Lcg, LongRun, SEED};

/// Calls of the self-test, and of each of the three parts of the vectors.
const CALLS: usize = 1024;
/// A restart so often.
const RESTART: usize = 512;

/// What vectors and manifest call the calls in order.
pub const SEQUENCE: &str = "sequence";
/// Steps through 2^32 a call of the long run's first word, half of which are those of the second, and so on.
const RATE: u32 = 1 << 23;

/// What is emitted, and where it comes from.
pub struct Stepped<'a> {
    /// Prefix of every name in C, the crate in Rust.
    pub prefix: &'a str,
    /// The recorded block: one function with a state.
    pub program: &'a Program,
    /// Its bit-accurate model from the state at zeros.
    pub model: &'a dyn Fn() -> Box<dyn Calls + 'a>,
    /// Calls between restarts of the long run.
    pub long_restart: u64,
    /// `part` in the manifest.
    pub part: &'static str,
    /// When the function is called, for the README: `once a reading`.
    pub called: &'static str,
    /// What its first parameter, `restart`, is, for the README: a predicate.
    pub restart: &'static str,
    /// Lines for the head of the sources.
    pub facts: Vec<String>,
    /// Of the text of the design that it is emitted from.
    pub design_sha256: &'a str,
    /// The command that makes it again.
    pub command: &'a str,
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
    let banner = manifest::banner(manifest::DESIGN, what.design_sha256, what.command);
    let mut facts = what.facts.clone();
    facts.push("words are two's complement; ranges beside them are proved, not observed".into());
    let program = Interpreter::new(what.program);
    let last = what.program.functions.len() - 1;
    let models: Vec<Model> = (0..=last).map(|k| Model::recorded(&program, k)).collect();
    let every: Vec<_> = models.iter().map(vectors::every_of).collect();
    let mut view = View::new(&bundle, &models, &every, language, banner, facts);
    let shown = views::functions(&bundle, language).pop();
    let result = shown.as_ref().map_or("", |f| f.result.as_str());
    view.example = super::example::example(&bundle, result, language, |inputs| {
        let mut outputs = Vec::new();
        (what.model)().call(inputs, &mut outputs);
        outputs
    });
    let words = program.state(last).iter();
    let wide: Vec<bool> = words.clone().map(|word| word.is_wide()).collect();
    view.stream = Some(StreamView {
        function: shown.ok_or_else(internal)?,
        language,
        name: SEQUENCE,
        final_state: words
            .flat_map(|word| tested::state_words(word, "s", language))
            .collect(),
        state: function.state.to_owned(),
        camel: crate::emit::rust::camel(function.state),
        number: view.chain_number,
        count: CALLS,
        restart: RESTART,
        called: what.called,
        restarts: what.restart,
        checksum: format!("{:#x}", checksum(what.model, &ranges, &wide)),
    });
    let rates = ranges.iter().skip(1).enumerate();
    let drawn: Vec<(Interval, u32)> = rates
        .map(|(k, range)| (*range, RATE / (k as u32 + 2)))
        .collect();
    let long = long(what, drawn.clone(), &wide);
    view.with_long(drawn, (vectors::LONG, long), language);
    view.long_restart = what.long_restart;
    let mut emitted = files::sources(&view, Part::Compensation, language)?;
    let names = function.inputs.iter().map(|(port, _)| port.name);
    let names = names.chain(function.outputs.iter().map(|(port, _)| port.name));
    emitted.extend(
        models
            .iter()
            .zip(&bundle.lowered)
            .map(|(model, lowered)| vectors::function(model, Some(lowered), Vec::new())),
    );
    emitted.push(in_order(what.model, &ranges, names));
    emitted.push(vectors::of_tables(&view.tables));
    emitted.push(files::sums(&emitted));
    let header = Header {
        design_sha256: what.design_sha256,
        command: what.command,
        language,
        part: what.part,
        has_code: true,
        columns: &[],
    };
    let mut manifest = Manifest::new(&header, &bundle, &view, &emitted);
    manifest.sequence = Some(manifest::FunctionEntry {
        number: view.chain_number,
        name: SEQUENCE.to_owned(),
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

/// Of the model's outputs on the self-test's stimulus, and of its state then.
fn checksum<'a>(
    model: &dyn Fn() -> Box<dyn Calls + 'a>,
    ranges: &[Interval],
    wide: &[bool],
) -> u64 {
    let mut lcg = Lcg(SEED);
    let mut calls = model();
    let mut outputs = Vec::new();
    for n in 0..CALLS {
        calls.call(&random(&mut lcg, ranges, n % RESTART == 0), &mut outputs);
    }
    let h = outputs
        .iter()
        .fold(views::BASIS, |h, word| mix(h, *word as u64));
    vectors::with_state(h, &calls.state(), wide)
}

/// Of the model's first state, its records over a long run, and its state then.
fn long(what: &Stepped, drawn: Vec<(Interval, u32)>, wide: &[bool]) -> u64 {
    let mut run = LongRun::new(drawn, SEED);
    let mut calls = (what.model)();
    let mut h = vectors::with_state(views::BASIS, &calls.state(), wide);
    let (mut words, mut outputs) = (Vec::new(), Vec::new());
    for n in 0..vectors::LONG {
        words.clear();
        words.push(i128::from(n % what.long_restart == 0));
        words.extend(run.draw());
        outputs.clear();
        calls.call(&words, &mut outputs);
        // The record ends with the fault, which is none.
        outputs.push(0);
        h = outputs.iter().fold(h, |h, word| mix(h, *word as u64));
    }
    vectors::with_state(h, &calls.state(), wide)
}

fn random(lcg: &mut Lcg, ranges: &[Interval], restart: bool) -> Vec<i128> {
    let mut words = vec![i128::from(restart)];
    words.extend(ranges.iter().skip(1).map(|range| lcg.word(*range)));
    words
}

/// Calls in order with the model's outputs: slow triangles over each range (as temperatures move), ends and zeros,
/// random words.
fn in_order<'a, 'm>(
    model: &dyn Fn() -> Box<dyn Calls + 'm>,
    ranges: &[Interval],
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
        // The first call restarts by itself.
        let mut words = vec![i128::from(n == CALLS / 2)];
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
    let mut text = names.chain(["fault"]).collect::<Vec<_>>().join(",") + "\n";
    let mut model = model();
    for mut line in calls {
        let mut record = Vec::new();
        model.call(&line, &mut record);
        line.extend(record.into_iter().chain([0]));
        text += &csv_line(&line);
    }
    EmittedFile {
        path: format!("vectors/{SEQUENCE}.csv"),
        text,
    }
}
