//! What a bundle is compared with: vectors of each function, of its tables and of the chain, and checksums
//! where all inputs or a long run are compared.

use super::calibrated;
use super::emitted::EmittedFile;
use super::outside;
use crate::design::Design;
use crate::emit::bundle::Bundle;
use crate::emit::machine::Lowered;
use crate::emit::views::{self, TableView, mix};
use crate::numeric::trace::ir::{Function, Interval};
use crate::vectors::chain::{self, ChainModel};
use crate::vectors::model::{self, Model};
use crate::vectors::search;
use crate::vectors::stimulus::{self, EXHAUSTIVE_BITS, LongRun, SEED};

/// Least number of decimation periods in the vectors.
pub const PERIODS: usize = 64;
/// ADC samples of the chain's vectors, where the number of periods allows it.
const VECTOR_SAMPLES: usize = 1 << 14;
/// Most decimation periods in the vectors.
const MOST_PERIODS: usize = 512;
/// Words among which the vectors at ties and limits are searched.
const CANDIDATES: usize = 1 << 16;
/// Random inputs among which those are searched that show a coefficient's last bit.
const SEARCHED: usize = 1 << 19;
/// Inputs that share a checksum where every input is compared.
pub const BLOCK: u64 = 1 << 12;
/// Samples or calls of a long run, up to the end of its last decimation period.
pub const LONG: u64 = 1_000_000;

/// Number and checksum: of every input there is, or of a long run.
pub type Checked = (u64, u64);

/// Integers between commas, as a line.
pub fn csv_line<T: ToString>(words: &[T]) -> String {
    let words: Vec<String> = words.iter().map(T::to_string).collect();
    words.join(",") + "\n"
}

/// Vectors of a function, with words outside its inputs' ranges where `lowered` limits these. `more`: further inputs
/// to those that are searched.
pub fn function(model: &Model, lowered: Option<&Lowered>, more: Vec<Vec<i128>>) -> EmittedFile {
    let mut inputs = search::vectors(model, SEED);
    if model.state == 0 {
        let candidates: Vec<_> = stimulus::inputs(&model.inputs, CANDIDATES, SEED + 4).collect();
        inputs.extend(model.near_ties(&candidates));
        inputs.extend(model.fault_edges(&candidates));
    }
    inputs.extend(more);
    let (columns, _) = model.columns();
    let mut text = columns.join(",") + "\n";
    let beside = lowered.map_or(Vec::new(), |lowered| outside::rows(lowered, model, &inputs));
    let inside = inputs.into_iter().map(|input| [input.clone(), input]);
    for [given, due] in inside.chain(beside) {
        let mut line = model.input_words(&given);
        model.record(&due, &mut line);
        text += &csv_line(&line);
    }
    EmittedFile {
        path: format!("vectors/{}.csv", model.name),
        text,
    }
}

/// Vectors of all functions of a design's bundle, and of its chain.
pub fn of_design(design: &Design, bundle: &Bundle, models: &[Model]) -> Vec<EmittedFile> {
    let one = |model: &Model| {
        let mut more = calibrated::about_the_ends(design, model);
        if model.name == "bias" {
            let candidates = stimulus::inputs(&model.inputs, SEARCHED, SEED + 1);
            let candidates: Vec<i128> = candidates.flatten().collect();
            let sensitive = model::sensitive_inputs(design, &candidates);
            more.extend(sensitive.into_iter().map(|x| vec![x]));
        }
        let position = |f: &Function| f.name == model.name;
        let lowered = bundle.program.functions.iter().position(position);
        function(model, lowered.map(|k| &bundle.lowered[k]), more)
    };
    let mut files: Vec<EmittedFile> = models.iter().map(one).collect();
    if bundle.has_chain {
        files.extend(of_chain(design, bundle));
    }
    files
}

/// Decimation periods of the chain's vectors: enough for the loops to reach their limits, where the periods
/// are short.
pub fn periods(design: &Design) -> usize {
    let ratio = design.circuit.decimator.ratio as usize;
    (VECTOR_SAMPLES / ratio).clamp(PERIODS, MOST_PERIODS)
}

/// One of the six segments has codes beyond the converter's, where the emitted code limits these.
fn of_chain(design: &Design, bundle: &Bundle) -> [EmittedFile; 2] {
    let ratio = design.circuit.decimator.ratio as usize;
    let samples = periods(design) * ratio;
    let segment = periods(design).div_ceil(6) * ratio;
    let (drive, sense) = stimulus::segments(design, samples, segment, SEED);
    let mut input = String::from("drive_code,sense_code\n");
    let range = codes(design);
    let sample = |f: &Function| f.name == "sample";
    let sample = bundle.program.functions.iter().position(sample);
    let is_limited = sample.is_some_and(|k| bundle.lowered[k].guarded);
    let given = |n: usize, code: i32| match i128::from(code) {
        word if !is_limited || (n / segment) % 6 != stimulus::SQUARES => word,
        word if word == range.high => word + 1,
        word if word == range.low => word - 1,
        word => word,
    };
    for (n, (d, s)) in drive.iter().zip(&sense).enumerate() {
        input += &format!("{},{}\n", given(n, *d), given(n, *s));
    }
    let mut output = chain::columns(design).join(",") + ",fault\n";
    for row in chain::rows(design, &drive, &sense).iter() {
        output += &csv_line(row);
    }
    [
        EmittedFile {
            path: "vectors/chain_input.csv".into(),
            text: input,
        },
        EmittedFile {
            path: "vectors/chain_output.csv".into(),
            text: output,
        },
    ]
}

/// Every entry of every table.
pub fn of_tables(tables: &[TableView]) -> EmittedFile {
    let mut text = String::from("table,entry,value\n");
    for table in tables {
        for (k, v) in table.entries.iter().enumerate() {
            text += &format!("{},{k},{v}\n", table.name);
        }
    }
    EmittedFile {
        path: "vectors/tables.csv".into(),
        text,
    }
}

/// The ADC codes of a design.
fn codes(design: &Design) -> Interval {
    let format = design.circuit.adc.format;
    Interval::new(format.min_raw(), format.max_raw())
}

/// What the chain's part of the self-test has to find: all words of all rows, then the state.
pub fn selftest_of_chain(design: &Design) -> u64 {
    let code = codes(design);
    let mut lcg = stimulus::Lcg(SEED);
    let mut draw = || [lcg.word(code), lcg.word(code)];
    let count = PERIODS as u64 * u64::from(design.circuit.decimator.ratio);
    let codes = (0..count).map(|_| draw());
    checksum_of_chain(views::BASIS, chain::chain(design).as_mut(), codes, design)
}

/// What a function's part of the self-test has to find: outputs and state of every draw, then the first fault.
pub fn selftest_of_function(model: &Model, may_fault: bool, draws: u32) -> u64 {
    let mut lcg = stimulus::Lcg(SEED);
    let (mut h, mut first) = (views::BASIS, 0);
    let (mut inputs, mut record) = (Vec::new(), Vec::new());
    for _ in 0..draws {
        inputs.clear();
        inputs.extend(model.inputs.iter().map(|range| lcg.word(*range)));
        record.clear();
        model.record(&inputs, &mut record);
        let (fault, words) = record.split_last().unwrap_or((&0, &[]));
        h = words.iter().fold(h, |h, word| mix(h, *word as u64));
        if first == 0 {
            first = *fault;
        }
    }
    if may_fault { mix(h, first as u64) } else { h }
}

/// The words that a long run of the chain draws: each with its steps through 2^32 a sample.
pub fn long_words_of_chain(design: &Design) -> Vec<(Interval, u32)> {
    let nco = &design.circuit.nco;
    let modulus = 1i128 << nco.phase_bits;
    let turn = i128::from(nco.tuning_word).rem_euclid(modulus);
    let rate = if nco.phase_bits >= 32 {
        turn >> (nco.phase_bits - 32)
    } else {
        turn << (32 - nco.phase_bits)
    };
    vec![(codes(design), rate as u32); 2]
}

/// Samples and checksum of the chain's long run: of the first state, all rows and the last state.
pub fn long_of_chain(design: &Design) -> Checked {
    let ratio = u64::from(design.circuit.decimator.ratio);
    let steps = LONG.div_ceil(ratio) * ratio;
    let mut run = LongRun::new(long_words_of_chain(design), SEED);
    let codes = (0..steps).map(|_| {
        let words = run.draw();
        [words[0], words[1]]
    });
    let mut chain = chain::chain(design);
    let first = with_state(views::BASIS, &chain.state(), &chain::state_is_wide(design));
    (
        steps,
        checksum_of_chain(first, chain.as_mut(), codes, design),
    )
}

/// Of the rows of a chain, from the checksum `h` on, and of its state then.
fn checksum_of_chain(
    mut h: u64,
    chain: &mut dyn ChainModel,
    codes: impl Iterator<Item = [i128; 2]>,
    design: &Design,
) -> u64 {
    for [drive, sense] in codes {
        if let Some(row) = chain.push(drive as i32, sense as i32) {
            h = row.iter().fold(h, |h, word| mix(h, *word as u64));
        }
    }
    with_state(h, &chain.state(), &chain::state_is_wide(design))
}

/// With the words of a state, of a wide one both halves.
pub fn with_state(h: u64, state: &[i128], wide: &[bool]) -> u64 {
    state.iter().zip(wide).fold(h, |h, (word, wide)| {
        let h = mix(h, *word as u64);
        if *wide {
            mix(h, (*word >> 64) as u64)
        } else {
            h
        }
    })
}

/// Number of inputs and checksum of the records of every input there is, if they have few enough bits: counted
/// through with the last input fastest, a checksum for each [`BLOCK`] of them, and one of these. `record` appends
/// an input's record: outputs, then the fault.
pub fn every(
    ranges: &[Interval],
    record: &(dyn Fn(&[i128], &mut Vec<i128>) + Sync),
    threads: usize,
) -> Option<Checked> {
    let mut count: i128 = 1;
    for range in ranges {
        count = count.checked_mul(range.high - range.low + 1)?;
    }
    if ranges.is_empty() || count > 1 << EXHAUSTIVE_BITS {
        return None;
    }
    let input = |mut index: i128| {
        let mut words = vec![0; ranges.len()];
        for (word, range) in words.iter_mut().zip(ranges).rev() {
            let span = range.high - range.low + 1;
            *word = range.low + index % span;
            index /= span;
        }
        words
    };
    let advance = |words: &mut [i128]| {
        for (word, range) in words.iter_mut().zip(ranges).rev() {
            if *word < range.high {
                *word += 1;
                return;
            }
            *word = range.low;
        }
    };
    let block = |start: u64| {
        let end = (start + BLOCK).min(count as u64);
        let (mut words, mut due) = (input(i128::from(start)), Vec::new());
        (start..end).fold(views::BASIS, |h, _| {
            due.clear();
            record(&words, &mut due);
            advance(&mut words);
            due.iter().fold(h, |h, word| mix(h, *word as u64))
        })
    };
    let starts: Vec<u64> = (0..count as u64).step_by(BLOCK as usize).collect();
    let share = starts.len().div_ceil(threads.max(1)).max(1);
    let blocks = std::thread::scope(|scope| {
        let parts = starts
            .chunks(share)
            .map(|part| scope.spawn(move || part.iter().map(|s| block(*s)).collect::<Vec<u64>>()));
        let parts: Vec<_> = parts.collect();
        let joined: Option<Vec<Vec<u64>>> = parts.into_iter().map(|p| p.join().ok()).collect();
        joined
    })?;
    let whole = blocks.concat().into_iter().fold(views::BASIS, mix);
    Some((count as u64, whole))
}

/// [`every`] of a function without a state.
pub fn every_of(model: &Model) -> Option<Checked> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let record = |input: &[i128], to: &mut Vec<i128>| model.record(input, to);
    if model.state > 0 {
        return None;
    }
    every(&model.inputs, &record, threads)
}
