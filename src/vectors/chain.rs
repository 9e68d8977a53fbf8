//! The bit-accurate chain one sample at a time, with all that the emitted chain puts out and remembers:
//! the columns of `replay`, the bias that stands behind the rate, and the state.

use super::interpreter::Interpreter;
use super::state::StateWord;
use crate::circuit::chain::{Chain, FastState, SlowState};
use crate::circuit::decimator::Decimate;
use crate::circuit::engine;
use crate::design::Design;
use crate::numeric::arithmetic::Block;
use crate::numeric::fixed::{Fixed, Words};
use crate::numeric::rows::WordRows;

type Wide = Fixed<i128, i128>;

/// A chain at some instant.
pub trait ChainModel {
    /// One sample of both channels; after the last of a decimation period the row: the words of
    /// [`columns`], then the number of the first overflow where the design says `error` (0 = none).
    fn push(&mut self, drive: i32, sense: i32) -> Option<Vec<i128>>;
    /// The state, word by word as [`Interpreter::state`] names the words of `period`'s.
    fn state(&mut self) -> Vec<i128>;
}

/// The words of a row before its fault: the columns of `replay`, then `bias` where there is one.
pub fn columns(design: &Design) -> Vec<&'static str> {
    let mut columns = engine::columns(design);
    if columns.contains(&"rate") {
        columns.push("bias");
    }
    columns
}

/// The chain before its first sample.
pub fn chain(design: &Design) -> Box<dyn ChainModel> {
    match design.circuit.decimator.stages {
        1 => of_stages::<1>(design),
        2 => of_stages::<2>(design),
        3 => of_stages::<3>(design),
        4 => of_stages::<4>(design),
        5 => of_stages::<5>(design),
        _ => of_stages::<6>(design),
    }
}

/// The rows of whole periods.
pub fn rows(design: &Design, drive: &[i32], sense: &[i32]) -> WordRows {
    let mut chain = chain(design);
    let mut rows = WordRows::new(columns(design).len() + 1);
    let pairs = drive.iter().zip(sense);
    pairs
        .filter_map(|(d, s)| chain.push(*d, *s))
        .for_each(|row| rows.push(row));
    rows
}

/// True for each word of [`ChainModel::state`] that takes two 64-bit words.
pub fn state_is_wide(design: &Design) -> Vec<bool> {
    let interpreter = Interpreter::new(&engine::trace(design));
    let functions = &interpreter.program().functions;
    let period = functions.iter().position(|f| f.name == "period");
    let words = period.map_or(&[][..], |k| interpreter.state(k));
    words.iter().map(StateWord::is_wide).collect()
}

fn of_stages<const N: usize>(design: &Design) -> Box<dyn ChainModel> {
    let chain = Chain::<N>::new(design);
    let interpreter = Interpreter::new(&chain.trace());
    let functions = &interpreter.program().functions;
    let period = functions.iter().position(|f| f.name == "period");
    let words = period.map_or(&[][..], |k| interpreter.state(k));
    let mut members: Vec<&'static str> = words
        .iter()
        .filter_map(|w| w.path.first().copied())
        .collect();
    members.dedup();
    let ar = Wide::new();
    Box::new(Running {
        fast: chain.start_fast(&ar),
        slow: chain.start_slow(&ar),
        ratio: design.circuit.decimator.ratio,
        phase_mask: (1 << design.circuit.nco.phase_bits) - 1,
        columns: columns(design),
        count: 0,
        members,
        chain,
        ar,
    })
}

struct Running<const N: usize> {
    chain: Chain<N>,
    ar: Wide,
    fast: FastState<i128, N>,
    slow: SlowState<i128>,
    ratio: u32,
    phase_mask: i128,
    columns: Vec<&'static str>,
    count: u32,
    members: Vec<&'static str>,
}

impl<const N: usize> ChainModel for Running<N> {
    fn push(&mut self, drive: i32, sense: i32) -> Option<Vec<i128>> {
        let codes = [drive, sense].map(i128::from);
        self.chain.sample(&self.ar, &mut self.fast, codes);
        self.count += 1;
        if self.count < self.ratio {
            return None;
        }
        self.count = 0;
        let row = self.chain.period(&self.ar, &mut self.fast, &mut self.slow);
        let word = |name: &&str| match *name {
            "drive_i" => row.channels[0],
            "drive_q" => row.channels[1],
            "sense_i" => row.channels[2],
            "sense_q" => row.channels[3],
            "phase" => row.phase,
            "magnitude" => row.magnitude,
            "tuning_word" => self.fast.oscillator.tuning & self.phase_mask,
            "gain" => row.gain.unwrap_or(0),
            "in_range" => row.in_range.unwrap_or(0),
            "bias" => row.compensation.map_or(0, |[bias, _]| bias),
            _ => row.compensation.map_or(0, |[_, rate]| rate),
        };
        let fault = self.ar.overflowed().map_or(0, |o| o.cast as i128 + 1);
        Some(self.columns.iter().map(word).chain([fault]).collect())
    }

    fn state(&mut self) -> Vec<i128> {
        let mut words = Words(Vec::new());
        for member in &self.members {
            match *member {
                "nco" => visit::<0, 2, _>(&self.chain.nco, &mut self.fast.oscillator, &mut words),
                "phase_loop" => {
                    if let (Some(block), Some(state)) =
                        (&self.chain.phase_loop, &mut self.slow.phase_loop)
                    {
                        visit::<1, 1, _>(block, state, &mut words);
                    }
                }
                "amplitude_loop" => {
                    if let (Some(block), Some(state)) =
                        (&self.chain.amplitude_loop, &mut self.slow.amplitude_loop)
                    {
                        visit::<1, 1, _>(block, state, &mut words);
                    }
                }
                _ => {
                    let channel = crate::circuit::CHANNELS.iter();
                    let k = channel.into_iter().position(|c| member.ends_with(c));
                    let k = k.unwrap_or(0);
                    let block = Decimate(&self.chain.cics[k]);
                    visit::<0, 1, _>(&block, &mut self.fast.cics[k], &mut words);
                }
            }
        }
        words.0
    }
}

fn visit<const I: usize, const O: usize, B: Block<Wide, I, O>>(
    block: &B,
    state: &mut B::State,
    words: &mut Words,
) {
    block.visit(state, words);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::engine::ArithmeticKind;
    use crate::vectors::stimulus;

    /// The default, and the default with everything closed and coarse.
    fn designs() -> Vec<Design> {
        let default = crate::design::reader::read(None).expect("the default design");
        let mut closed = default.clone();
        closed.circuit.phase_loop = Some(crate::design::PhaseLoop {
            setpoint_raw: -3_000_000,
            proportional: crate::design::LoopGain { raw: 9, shift: 4 },
            integral: crate::design::LoopGain { raw: -5, shift: 9 },
            integrator_bits: 27,
        });
        vec![default, closed]
    }

    #[test]
    fn rows_are_those_of_the_engine() {
        for design in designs() {
            let (drive, sense) = stimulus::segments(&design, 32 * 200, 32 * 30, 3);
            let mut engine = engine::engine(&design, ArithmeticKind::Fixed);
            let mut due = engine.no_rows();
            engine
                .process(&drive, &sense, &mut due)
                .expect("no overflow");
            let due = due.raw().expect("integers");
            let columns = engine::columns(&design).len();
            let found = rows(&design, &drive, &sense);
            assert_eq!(found.len(), due.len() / columns);
            for (found, due) in found.iter().zip(due.chunks_exact(columns)) {
                let found = found[..columns].iter().map(|word| i128::from(*word));
                assert!(found.eq(due.iter().copied()));
            }
        }
    }

    /// The recorded program, sample by sample and period by period, is the chain: every word of every row and of
    /// the state.
    #[test]
    fn the_interpreter_says_what_the_chain_says() {
        for design in designs() {
            let program = Interpreter::new(&engine::trace(&design));
            let functions = &program.program().functions;
            let number = |name: &str| {
                functions
                    .iter()
                    .position(|f| f.name == name)
                    .expect("a function")
            };
            let (sample, period) = (number("sample"), number("period"));
            let (drive, sense) = stimulus::segments(&design, 32 * 100, 32 * 15, 4);
            let mut model = chain(&design);
            let mut state = model.state();
            assert_eq!(state.len(), program.state(period).len());
            let mut rows = 0;
            for (d, s) in drive.iter().zip(&sense) {
                let inputs = [i128::from(*d), i128::from(*s)];
                program.call(sample, &inputs, &mut state, &mut Vec::new());
                if let Some(row) = model.push(*d, *s) {
                    let mut outputs = Vec::new();
                    program.call(period, &[], &mut state, &mut outputs);
                    let named = functions[period].outputs.iter().zip(&outputs);
                    for (name, due) in columns(&design).iter().zip(&row) {
                        let found = named.clone().find(|((port, _), _)| port.name == *name);
                        if let Some((_, found)) = found {
                            assert_eq!(found, due, "{name} of row {rows}");
                        }
                    }
                    assert_eq!(state, model.state(), "row {rows}");
                    rows += 1;
                }
            }
            assert_eq!(rows, 100);
        }
    }

    /// Vectors tell every damage of a loop's operations that shows anywhere in a dense search.
    #[test]
    fn vectors_tell_damaged_operations_of_the_loops() {
        for design in designs() {
            let program = engine::trace(&design);
            for model in crate::vectors::model::models(&design, &program) {
                if !model.name.ends_with("_loop") {
                    continue;
                }
                let (program, number) = model.recorded.clone().expect("recorded");
                let vectors = crate::vectors::search::vectors(&model, 9);
                let dense: Vec<_> = stimulus::random(&model.inputs, 1 << 14, 77).collect();
                let count = program.program().functions[number].inputs.len();
                let call = |damage, words: &Vec<i128>| {
                    let (mut state, mut outputs) = (words[count..].to_vec(), Vec::new());
                    program.damaged(number, damage, &words[..count], &mut state, &mut outputs);
                    (state, outputs)
                };
                for damage in program.damages(number) {
                    let tells = |words: &&Vec<i128>| call(Some(damage), words) != call(None, words);
                    if dense.iter().any(|words| tells(&words)) {
                        assert!(
                            vectors.iter().any(|words| tells(&words)),
                            "{}: {damage:?}",
                            model.name
                        );
                    }
                }
            }
        }
    }
}
