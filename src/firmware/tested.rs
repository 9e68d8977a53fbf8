//! How the emitted self-test and harness call each function: inputs and state from words, outputs and state
//! to words. Every function of a bundle is called so, whatever it remembers.

use crate::emit::bundle::Bundle;
use crate::emit::machine::{Lowered, Type, Typed, Width, residue_type, word_type};
use crate::emit::views::{Language, word_64};
use crate::emit::{c, rust};
use crate::numeric::trace::ir::{Interval, SlotKind};
use crate::vectors::interpreter::Interpreter;
use crate::vectors::model::Model;
use crate::vectors::state::StateWord;

/// A function as self-test and harness call it.
#[derive(Debug, Clone)]
pub struct TestView {
    /// Name without the prefix.
    pub name: String,
    /// Type of its state without prefix (C) or as a Rust type; empty = none.
    pub state: String,
    /// It may note a fault.
    pub faults: bool,
    /// Type of the result; empty = none.
    pub result: String,
    /// 64-bit words that it takes: inputs, then state.
    pub inputs: usize,
    /// 64-bit words that it gives, with the fault.
    pub outputs: usize,
    /// Arguments of the call in the harness, after the state.
    pub arguments: String,
    /// Assignments of the state's words in the harness.
    pub set: Vec<String>,
    /// Outputs and state as unsigned 64-bit words.
    pub words: Vec<String>,
    /// What the self-test draws: target (`a0`, `s.integrator`), its declaration's type (empty for a state's), low
    /// end, span, type to convert to.
    pub drawn: Vec<Drawn>,
    /// Arguments of the call in the self-test, after the state.
    pub drawn_arguments: String,
    /// The self-test calls it; else it is part of a chain or sequence that the self-test runs.
    pub alone: bool,
    /// Number in the self-test.
    pub number: u32,
    /// FNV-1a of outputs and state over the self-test's draws.
    pub checksum: String,
    /// Low end and span of each word, where every input there is is compared.
    pub domain: Vec<[String; 2]>,
    /// FNV-1a of all records over every input there is; empty = too many.
    pub every: String,
    /// How many these are.
    pub every_count: u64,
}

/// A word that the self-test draws.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// What is assigned.
    pub target: String,
    /// Type of the word.
    pub ty: String,
    /// A new variable, not a part of the state.
    pub declared: bool,
    /// Lower end.
    pub low: String,
    /// Width of the range.
    pub span: String,
}

/// What [`view`] needs beside the bundle.
pub struct Tested<'a> {
    /// The function's model.
    pub model: &'a Model,
    /// Number in the self-test.
    pub number: u32,
    /// Of the self-test.
    pub checksum: u64,
    /// Number and checksum of all inputs, if they are few enough.
    pub every: Option<(u64, u64)>,
}

/// The view of function `k` of the bundle.
pub fn view(
    bundle: &Bundle,
    program: &Interpreter,
    k: usize,
    of: &Tested,
    language: Language,
) -> TestView {
    let (function, lowered) = (&bundle.program.functions[k], &bundle.lowered[k]);
    let p = &bundle.prefix;
    let type_name = |ty: Type| match language {
        Language::C => c::type_name(p, ty),
        Language::Rust => rust::type_name(ty).to_owned(),
    };
    let mut place = 0;
    let mut arguments = Vec::new();
    for ty in &lowered.inputs {
        arguments.push(from_words(*ty, &mut place, &type_name(*ty), p, language));
    }
    let state = program.state(k);
    let set = state.iter().map(|word| {
        let ty = type_of(word);
        let value = from_words(ty, &mut place, &type_name(ty), p, language);
        format!("s.{} = {value}", word.name())
    });
    let set: Vec<String> = set.collect();
    let mut words = outputs(lowered, language);
    words.extend(
        state
            .iter()
            .flat_map(|word| state_words(word, "s", language)),
    );
    let ranges = function.inputs.iter().map(|(_, range)| *range);
    let mut drawn: Vec<Drawn> = ranges
        .zip(&lowered.inputs)
        .enumerate()
        .map(|(k, (range, ty))| draw(format!("a{k}"), true, range, type_name(*ty), language))
        .collect();
    drawn.extend(state.iter().map(|word| {
        let target = format!("s.{}", word.name());
        draw(
            target,
            false,
            word.range(),
            type_name(type_of(word)),
            language,
        )
    }));
    let fault = match (lowered.may_fault, language) {
        (false, _) => None,
        (true, Language::C) => Some("&fault".to_owned()),
        (true, Language::Rust) => Some("&mut fault".to_owned()),
    };
    let drawn_arguments = (0..lowered.inputs.len()).map(|k| format!("a{k}"));
    let has_state = !function.state.is_empty();
    let first = has_state.then(|| match language {
        Language::C => "&s".to_owned(),
        Language::Rust => "&mut s".to_owned(),
    });
    let join = |arguments: &mut dyn Iterator<Item = String>| {
        let all = first.iter().cloned().chain(arguments).chain(fault.clone());
        all.collect::<Vec<_>>().join(", ")
    };
    TestView {
        name: function.name.clone(),
        state: match language {
            _ if !has_state => String::new(),
            Language::C => function.state.to_owned(),
            Language::Rust => rust::camel(function.state),
        },
        faults: lowered.may_fault,
        result: match lowered.outputs.as_slice() {
            [] => String::new(),
            [(_, v)] => type_name(v.ty),
            _ => format!("{p}_{}_out_t", function.name),
        },
        inputs: place,
        outputs: words.len() + 1,
        arguments: join(&mut arguments.into_iter()),
        set,
        words,
        drawn,
        drawn_arguments: join(&mut drawn_arguments.into_iter()),
        alone: of.model.stands_alone(),
        number: of.number,
        checksum: format!("{:#x}", of.checksum),
        domain: match of.every {
            None => Vec::new(),
            Some(_) => of.model.inputs.iter().map(|r| ends(*r, language)).collect(),
        },
        every: of.every.map_or(String::new(), |(_, h)| format!("{h:#x}")),
        every_count: of.every.map_or(0, |(count, _)| count),
    }
}

/// A state's words, in the order of the manifest, as expressions of unsigned 64-bit words.
pub fn state_words(word: &StateWord, state: &str, language: Language) -> Vec<String> {
    let name = format!("{state}.{}", word.name());
    let ty = type_of(word);
    match word.kind {
        SlotKind::Residue(bits) if !word.is_wide() => {
            let value = word_64(&name, ty, language);
            let mask = u64::MAX >> (64 - bits);
            match (bits, language) {
                (64, _) => vec![value],
                (_, Language::C) => vec![format!("({value} & UINT64_C({mask}))")],
                (_, Language::Rust) => vec![format!("({value}) & {mask}_u64")],
            }
        }
        SlotKind::Residue(bits) => {
            let mask = u64::MAX >> (128 - bits);
            match language {
                Language::C => vec![
                    format!("{name}.lo"),
                    format!("({name}.hi & UINT64_C({mask}))"),
                ],
                Language::Rust => vec![
                    format!("{name} as u64"),
                    format!("(({name} >> 64) as u64) & {mask}_u64"),
                ],
            }
        }
        SlotKind::Word(_) => value_words(&name, ty, language),
    }
}

fn value_words(name: &str, ty: Type, language: Language) -> Vec<String> {
    let wide = matches!(ty, Type::Signed(Width::W128) | Type::Unsigned(Width::W128));
    match language {
        _ if !wide => vec![word_64(name, ty, language)],
        Language::C => vec![format!("{name}.lo"), format!("{name}.hi")],
        Language::Rust => vec![format!("{name} as u64"), format!("({name} >> 64) as u64")],
    }
}

fn outputs(lowered: &Lowered, language: Language) -> Vec<String> {
    let one = |name: String, v: &Typed| value_words(&name, v.ty, language);
    match lowered.outputs.as_slice() {
        [(_, v)] => one("r".to_owned(), v),
        several => several
            .iter()
            .flat_map(|(name, v)| one(format!("r.{name}"), v))
            .collect(),
    }
}

fn type_of(word: &StateWord) -> Type {
    match word.kind {
        SlotKind::Word(range) => word_type(range),
        SlotKind::Residue(bits) => residue_type(bits),
    }
}

/// A value from the harness's words `in` (C) or `a` (Rust) at `place`, which moves on.
fn from_words(ty: Type, place: &mut usize, name: &str, p: &str, language: Language) -> String {
    let k = *place;
    let wide = matches!(ty, Type::Signed(Width::W128) | Type::Unsigned(Width::W128));
    *place += if wide { 2 } else { 1 };
    match (language, wide) {
        (Language::C, false) => format!("({name})in[{k}]"),
        (Language::C, true) => format!("{p}_w128_make((uint64_t)in[{}], (uint64_t)in[{k}])", k + 1),
        (Language::Rust, false) => format!("a[{k}] as {name}"),
        (Language::Rust, true) => format!(
            "((i128::from(a[{}]) << 64) | i128::from(a[{k}] as u64)) as {name}",
            k + 1
        ),
    }
}

fn ends(range: Interval, language: Language) -> [String; 2] {
    let span = range.high.wrapping_sub(range.low) as u64;
    // A residue's upper half as the word of the same bits.
    let low = Type::Signed(Width::W64);
    match language {
        Language::C => [c::constant("", range.low, low), format!("UINT64_C({span})")],
        Language::Rust => [rust::constant(range.low, low), format!("{span}_u64")],
    }
}

fn draw(target: String, declared: bool, range: Interval, ty: String, language: Language) -> Drawn {
    let [low, span] = ends(range, language);
    Drawn {
        target,
        ty,
        declared,
        low,
        span,
    }
}
