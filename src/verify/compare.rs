//! Runs emitted code beside the model and finds the first difference.

use super::toolchain::Harness;
use crate::design::Design;
use crate::emit::bundle::Bundle;
use crate::emit::views::{self, Language};
use crate::error::Result;
use crate::firmware::manifest::{EveryEntry, LongEntry};
use crate::numeric::rows::WordRows;
use crate::parallel::in_parallel;
use crate::vectors::chain;
use crate::vectors::model;
use crate::vectors::model::Model;
use crate::vectors::search;
use crate::vectors::stimulus::{self, EXHAUSTIVE_BITS, SEED};
use serde::Serialize;

/// Random inputs of a function that is not compared exhaustively.
const RANDOM_INPUTS: usize = 1 << 18;
/// Random states and inputs of a function that remembers something.
const RANDOM_STATES: usize = 1 << 13;
/// ADC samples of the chain's comparison.
pub const CHAIN_SAMPLES: usize = 1 << 20;

/// The outcome for one table, function or chain.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Compared {
    /// `c` or `rust`.
    pub language: &'static str,
    /// Name without prefix.
    pub name: String,
    /// Inputs (ADC samples of a chain, entries of a table).
    pub inputs: u64,
    /// Every input there is.
    pub exhaustive: bool,
    /// Output words that were compared.
    pub compared: u64,
    /// Inputs (rows of a chain) with a difference.
    pub mismatches: u64,
    /// The first difference, in words.
    pub first: Option<String>,
}

/// Compares everything that a bundle holds with the model of `design`, by the drivers of the languages that it was
/// built in, on so many threads; one list a driver. What is due is made once for all.
///
/// # Errors
/// A test driver that cannot be run.
pub fn with_model(
    design: &Design,
    bundle: &Bundle,
    drivers: &[(Language, &Harness)],
    threads: usize,
) -> Result<Vec<Vec<Compared>>> {
    let each = |compare: &Comparison| -> Result<Vec<Compared>> {
        let compared = in_parallel(drivers, threads, &|_| {}, |(l, h)| compare(*l, h));
        compared.into_iter().collect()
    };
    let mut all = vec![Vec::new(); drivers.len()];
    for ((language, harness), all) in drivers.iter().zip(&mut all) {
        for table in views::tables(bundle, *language) {
            all.push(self::table(
                *language,
                harness,
                &table.name,
                &table.entries,
            )?);
        }
    }
    let mut take = |compared: Vec<Compared>| {
        for (all, one) in all.iter_mut().zip(compared) {
            all.push(one);
        }
    };
    for model in model::models(design, &bundle.program) {
        let due = Due::of(&model);
        take(each(&|language, harness| {
            function(language, harness, &model, &due)
        })?);
    }
    if bundle.has_chain {
        let ratio = bundle.ratio as usize;
        let samples = CHAIN_SAMPLES.div_ceil(ratio) * ratio;
        let (drive, sense) = stimulus::capture(design, samples, SEED + 2);
        take(chain(design, drivers, threads, &drive, &sense)?);
    }
    Ok(all)
}

/// A comparison by one driver.
type Comparison<'a> = dyn Fn(Language, &Harness) -> Result<Compared> + Sync + 'a;

/// The language's name in results.
pub fn language_name(language: Language) -> &'static str {
    match language {
        Language::C => "c",
        Language::Rust => "rust",
    }
}

/// Notes a difference and keeps the first.
struct Tally {
    outcome: Compared,
}

impl Tally {
    fn new(language: Language, name: &str) -> Self {
        Tally {
            outcome: Compared {
                language: language_name(language),
                name: name.to_owned(),
                inputs: 0,
                exhaustive: false,
                compared: 0,
                mismatches: 0,
                first: None,
            },
        }
    }

    fn note(&mut self, got: &[u64], expected: &[i64], place: impl FnOnce() -> String) {
        self.outcome.inputs += 1;
        self.outcome.compared += expected.len() as u64;
        if !got
            .iter()
            .map(|word| *word as i64)
            .eq(expected.iter().copied())
        {
            self.outcome.mismatches += 1;
            if self.outcome.first.is_none() {
                let got: Vec<i64> = got.iter().map(|w| *w as i64).collect();
                self.outcome.first =
                    Some(format!("{}: emitted {got:?}, model {expected:?}", place()));
            }
        }
    }

    /// `count` inputs were due; what is missing is a difference.
    fn finish(mut self, count: u64) -> Compared {
        if self.outcome.inputs < count {
            self.outcome.mismatches += count - self.outcome.inputs;
            let seen = self.outcome.inputs;
            let missing = || format!("the emitted code stopped after {seen} of {count}");
            self.outcome.first.get_or_insert_with(missing);
            self.outcome.inputs = count;
        }
        self.outcome
    }
}

/// Compares a table entry by entry.
///
/// # Errors
/// A test driver that cannot be run.
pub fn table(
    language: Language,
    harness: &Harness,
    name: &str,
    expected: &[i64],
) -> Result<Compared> {
    let mut tally = Tally::new(language, name);
    tally.outcome.exhaustive = true;
    let mut k = 0;
    let arguments = ["table".to_owned(), name.to_owned()];
    harness.run(
        &arguments,
        Vec::new(),
        (1, expected.len() as u64),
        &mut |words| {
            tally.note(words, expected.get(k..=k).unwrap_or(&[]), || {
                format!("entry {k}")
            });
            k += 1;
        },
    )?;
    Ok(tally.finish(expected.len() as u64))
}

/// What a function has to give.
enum Due {
    /// At every input, which is called when it is compared: the first and their number.
    Every(i128, u64),
    /// At these inputs, each as 64-bit words: outputs, state and fault.
    These(WordRows, WordRows),
}

impl Due {
    /// All inputs of a function with one input of at most [`EXHAUSTIVE_BITS`] bits, else corners and random words.
    fn of(model: &Model) -> Self {
        if let [range] = model.inputs.as_slice()
            && model.state == 0
            && range.high - range.low < 1 << EXHAUSTIVE_BITS
        {
            return Due::Every(range.low, (range.high - range.low + 1) as u64);
        }
        let count = match model.state {
            0 => RANDOM_INPUTS,
            _ => RANDOM_STATES,
        };
        let (columns, given) = model.columns();
        let mut inputs = WordRows::new(given);
        let mut expected = WordRows::new(columns.len() - given);
        let mut record = Vec::new();
        let mut take = |input: &[i128]| {
            inputs.push(model.input_words(input));
            record.clear();
            model.record(input, &mut record);
            expected.push(record.iter().copied());
        };
        for mut input in stimulus::inputs(&model.inputs, count, SEED + 3) {
            model.repair(&mut input);
            take(&input);
        }
        if model.state > 0 {
            let vectors = search::vectors(model, SEED + 3);
            vectors.iter().for_each(|input| take(input));
        }
        Due::These(inputs, expected)
    }
}

/// Compares a function with what is due.
fn function(language: Language, harness: &Harness, model: &Model, due: &Due) -> Result<Compared> {
    let (low, count) = match due {
        Due::These(inputs, expected) => {
            return calls(language, harness, &model.name, inputs, expected);
        }
        Due::Every(low, count) => (*low, *count),
    };
    let arguments = [
        "range".to_owned(),
        model.name.clone(),
        low.to_string(),
        count.to_string(),
    ];
    let mut tally = Tally::new(language, &model.name);
    tally.outcome.exhaustive = true;
    let mut input = low;
    let mut outputs = vec![0; model.outputs];
    let mut expected = Vec::new();
    harness.run(
        &arguments,
        Vec::new(),
        (model.outputs + 1, count),
        &mut |words| {
            let fault = i64::from(model.call(&[input], &mut outputs));
            expected.clear();
            expected.extend(outputs.iter().map(|word| *word as i64).chain([fault]));
            tally.note(words, &expected, || format!("input {input}"));
            input += 1;
        },
    )?;
    Ok(tally.finish(count))
}

/// Compares a function on given inputs; the last expected word is the fault.
///
/// # Errors
/// A test driver that cannot be run.
pub fn calls(
    language: Language,
    harness: &Harness,
    name: &str,
    inputs: &WordRows,
    expected: &WordRows,
) -> Result<Compared> {
    records(language, harness, "call", name, inputs, expected)
}

/// Compares the calls in order of a function with a state, once a reading, on given inputs from its state at zeros; the
/// last expected word is the fault.
///
/// # Errors
/// A test driver that cannot be run.
pub fn sequence(
    language: Language,
    harness: &Harness,
    name: &str,
    inputs: &WordRows,
    expected: &WordRows,
) -> Result<Compared> {
    records(language, harness, "sequence", name, inputs, expected)
}

fn records(
    language: Language,
    harness: &Harness,
    mode: &str,
    name: &str,
    inputs: &WordRows,
    expected: &WordRows,
) -> Result<Compared> {
    let mut tally = Tally::new(language, name);
    let mut k = 0;
    harness.run(
        &[mode.to_owned(), name.to_owned()],
        inputs.to_bytes(),
        (expected.columns(), expected.len() as u64),
        &mut |words| {
            tally.note(words, expected.row(k), || {
                let words: Vec<String> = inputs.row(k).iter().map(i64::to_string).collect();
                format!("input {}", words.join(", "))
            });
            k += 1;
        },
    )?;
    Ok(tally.finish(expected.len() as u64))
}

/// Compares a function over every input there is, by a checksum of all records.
///
/// # Errors
/// A test driver that cannot be run.
pub fn every_input(
    language: Language,
    harness: &Harness,
    name: &str,
    words: usize,
    due: &EveryEntry,
) -> Result<Compared> {
    let of = (due.inputs, words as u64, due.checksum.as_str());
    let mut compared = checksum(language, harness, &["every", name], name, of)?;
    compared.exhaustive = true;
    Ok(compared)
}

/// Compares the chain, or the calls of a function with a state, over a long stimulus that the harness makes, by a
/// checksum of all rows and of the last state.
///
/// # Errors
/// A test driver that cannot be run.
pub fn long_run(
    language: Language,
    harness: &Harness,
    words: usize,
    due: &LongEntry,
) -> Result<Compared> {
    let of = (due.steps, words as u64, due.checksum.as_str());
    checksum(language, harness, &["long"], "long run", of)
}

fn checksum(
    language: Language,
    harness: &Harness,
    arguments: &[&str],
    name: &str,
    (inputs, words, due): (u64, u64, &str),
) -> Result<Compared> {
    let mut tally = Tally::new(language, name);
    let model = due;
    let due = due
        .strip_prefix("0x")
        .map(|hex| u64::from_str_radix(hex, 16));
    let arguments: Vec<String> = arguments.iter().map(|&a| a.to_owned()).collect();
    let mut found = None;
    harness.run(&arguments, Vec::new(), (1, 1), &mut |word| {
        found = word.first().copied()
    })?;
    tally.outcome.inputs = inputs;
    tally.outcome.compared = inputs.saturating_mul(words);
    if found.map(Ok) != due {
        tally.outcome.mismatches = 1;
        tally.outcome.first = Some(match found {
            Some(word) => {
                format!("checksum over {inputs} inputs: emitted {word:#x}, model {model}")
            }
            None => "the emitted code gave no checksum".to_owned(),
        });
    }
    Ok(tally.outcome)
}

impl Compared {
    /// The mismatches in a table. A checksum that differs says of no word which it is.
    pub fn shown_mismatches(&self) -> String {
        match self.is_of_checksum() {
            true => "checksum differs".to_owned(),
            false => self.mismatches.to_string(),
        }
    }

    fn is_of_checksum(&self) -> bool {
        self.first
            .as_deref()
            .is_some_and(|first| first.contains("checksum"))
    }

    /// A function that differs and where it does, in words.
    pub fn sentence(&self) -> String {
        let first = self.first.as_deref().unwrap_or("");
        let at = match self.is_of_checksum() {
            true => "",
            false => "first difference at ",
        };
        format!("{} ({}): {at}{first}", self.name, self.language)
    }
}

/// Compares the chain row by row on captured codes, by each driver, on so many threads.
///
/// # Errors
/// A test driver that cannot be run.
pub fn chain(
    design: &Design,
    drivers: &[(Language, &Harness)],
    threads: usize,
    drive: &[i32],
    sense: &[i32],
) -> Result<Vec<Compared>> {
    let rows = chain::rows(design, drive, sense);
    let compared = in_parallel(drivers, threads, &|_| {}, |(language, harness)| {
        let mut compared = chain_rows(*language, harness, drive, sense, &rows)?;
        compared.inputs = drive.len() as u64;
        Ok(compared)
    });
    compared.into_iter().collect()
}

/// Compares the chain with given rows, each with the fault as its last word.
///
/// # Errors
/// A test driver that cannot be run.
pub fn chain_rows(
    language: Language,
    harness: &Harness,
    drive: &[i32],
    sense: &[i32],
    rows: &WordRows,
) -> Result<Compared> {
    let pairs = drive.iter().zip(sense);
    let bytes: Vec<u8> = pairs
        .flat_map(|(d, s)| [d.to_ne_bytes(), s.to_ne_bytes()])
        .flatten()
        .collect();
    let mut tally = Tally::new(language, "chain");
    let mut k = 0;
    let size = (rows.columns(), rows.len() as u64);
    harness.run(&["chain".to_owned()], bytes, size, &mut |words| {
        tally.note(words, rows.row(k), || format!("row {k}"));
        k += 1;
    })?;
    Ok(tally.finish(rows.len() as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_that_differs_is_told_with_that_of_the_model() {
        let of = |first: &str| {
            let mut compared = Tally::new(Language::C, "long run").outcome;
            compared.first = Some(first.to_owned());
            compared.sentence()
        };
        assert_eq!(
            of("checksum over 10 inputs: emitted 0x1, model 0x2"),
            "long run (c): checksum over 10 inputs: emitted 0x1, model 0x2"
        );
        assert_eq!(of("row 3"), "long run (c): first difference at row 3");
    }
}
