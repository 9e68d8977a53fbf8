//! The bit-accurate model of each emitted function, as something that can be called: without a state the block
//! itself in [`Fixed`] arithmetic; with one the recorded program, its state going in and coming out as words.

use super::interpreter::Interpreter;
use super::repair::Repair;
use super::state::StateWord;
use crate::circuit::chain::Chain;
use crate::circuit::compensate::Compensate;
use crate::circuit::compensation::{Bias, Evaluation, Rate};
use crate::design::{Compensation, Design};
use crate::numeric::arithmetic::Block;
use crate::numeric::cast::Cast;
use crate::numeric::fixed::Fixed;
use crate::numeric::trace::ir::{Function, Interval, Program};
use std::sync::{Arc, OnceLock};

/// A function of the model.
pub struct Model {
    /// The emitted function's name.
    pub name: String,
    /// Range of each input, then of each word of the state.
    pub inputs: Vec<Interval>,
    /// Their names.
    pub input_names: Vec<String>,
    /// Names of the outputs, then of the words of the state.
    pub output_names: Vec<String>,
    /// Number of outputs with the words of the state.
    pub outputs: usize,
    /// How many of these words are the state's.
    pub state: usize,
    /// True for each input and word of the state that takes two 64-bit words.
    wide: Vec<bool>,
    /// The same of each output and word of the state, and of the fault: made when it is first asked for.
    wide_outputs: OnceLock<Vec<bool>>,
    call: Box<Evaluate>,
    /// The function with one rounding constant off by one.
    damaged: Vec<Box<Evaluate>>,
    /// The recorded function, where vectors are searched.
    pub(super) recorded: Option<(Arc<Interpreter>, usize)>,
    /// What states have to hold that no single word's range says.
    pub(super) repairs: Vec<Repair>,
}

/// Inputs, outputs; gives the number of the fault, 0 = none.
type Evaluate = dyn Fn(&[i128], &mut [i128]) -> u32 + Send + Sync;

impl Model {
    /// Evaluates; `inputs` and `outputs` have the model's lengths. Gives the number of the first
    /// overflow where the design says `error`, 0 = none.
    pub fn call(&self, inputs: &[i128], outputs: &mut [i128]) -> u32 {
        (self.call)(inputs, outputs)
    }

    /// Inputs at which the outputs change if a rounding constant moves by one, a few for each.
    pub fn near_ties(&self, candidates: &[Vec<i128>]) -> Vec<Vec<i128>> {
        const EACH: usize = 4;
        let outcome = |call: &Evaluate, input: &[i128]| {
            let mut outputs = vec![0; self.outputs];
            let fault = call(input, &mut outputs);
            (outputs, fault)
        };
        let mut inputs = Vec::new();
        for damaged in &self.damaged {
            let differs = |x: &&Vec<i128>| outcome(damaged, x) != outcome(&self.call, x);
            inputs.extend(candidates.iter().filter(differs).take(EACH).cloned());
        }
        inputs
    }

    /// Neighbouring inputs on both sides of a limit whose overflow is an error, found between
    /// candidates with and without a fault.
    pub fn fault_edges(&self, candidates: &[Vec<i128>]) -> Vec<Vec<i128>> {
        const PAIRS: usize = 24;
        let mut outputs = vec![0; self.outputs];
        let mut fault = |input: &[i128]| self.call(input, &mut outputs);
        let (within, outside): (Vec<_>, Vec<_>) =
            candidates.iter().partition(|input| fault(input) == 0);
        let pairs = within.iter().zip(&outside).take(PAIRS);
        let edges = pairs.flat_map(|(a, b)| edge(&mut fault, a, b));
        edges.collect()
    }

    /// The model of a function without state. `narrow`: 64-bit lanes hold every word.
    pub fn new<const I: usize, const O: usize, B>(
        function: &Function,
        block: B,
        narrow: bool,
    ) -> Self
    where
        B: Block<Fixed<i64, i64>, I, O, State = ()> + Block<Fixed<i128, i128>, I, O, State = ()>,
        B: Send + Sync + 'static,
    {
        let names = |ports: &[(crate::numeric::arithmetic::Port, usize)]| -> Vec<String> {
            ports.iter().map(|(port, _)| port.name.to_owned()).collect()
        };
        let inputs = function.inputs.iter();
        Model {
            name: function.name.clone(),
            inputs: inputs.clone().map(|(_, range)| *range).collect(),
            input_names: inputs.map(|(port, _)| port.name.to_owned()).collect(),
            output_names: names(&function.outputs),
            outputs: O,
            state: 0,
            wide: function
                .inputs
                .iter()
                .map(|(_, range)| is_wide(range))
                .collect(),
            wide_outputs: OnceLock::new(),
            call: evaluate(block, narrow),
            damaged: Vec::new(),
            recorded: None,
            repairs: Vec::new(),
        }
    }

    /// The model of any function as it was recorded, with its state among inputs and outputs.
    pub fn recorded(program: &Arc<Interpreter>, number: usize) -> Self {
        let function = &program.program().functions[number];
        let words = program.state(number);
        let named = || {
            function
                .outputs
                .iter()
                .enumerate()
                .filter(|(_, (port, _))| !port.name.is_empty())
        };
        // Outputs of stages that the design lacks have no name.
        let kept: Vec<usize> = named().map(|(k, _)| k).collect();
        let mut output_names: Vec<String> =
            named().map(|(_, (port, _))| port.name.to_owned()).collect();
        let mut inputs: Vec<Interval> = function.inputs.iter().map(|(_, range)| *range).collect();
        let mut input_names: Vec<String> = function
            .inputs
            .iter()
            .map(|(port, _)| port.name.to_owned())
            .collect();
        let mut wide: Vec<bool> = inputs.iter().map(is_wide).collect();
        wide.extend(words.iter().map(StateWord::is_wide));
        inputs.extend(words.iter().map(StateWord::range));
        input_names.extend(words.iter().map(StateWord::name));
        output_names.extend(words.iter().map(StateWord::name));
        let (count, run) = (function.inputs.len(), program.clone());
        let call = move |inputs: &[i128], outputs: &mut [i128]| {
            let mut state = inputs[count..].to_vec();
            let mut results = Vec::with_capacity(kept.len());
            let fault = run.call(number, &inputs[..count], &mut state, &mut results);
            let words = kept.iter().map(|k| results[*k]).chain(state);
            for (output, word) in outputs.iter_mut().zip(words) {
                *output = word;
            }
            fault
        };
        Model {
            name: function.name.clone(),
            inputs,
            input_names,
            outputs: output_names.len(),
            output_names,
            state: words.len(),
            wide,
            wide_outputs: OnceLock::new(),
            call: Box::new(call),
            damaged: Vec::new(),
            recorded: Some((program.clone(), number)),
            repairs: Repair::of(program, number),
        }
    }

    /// The recorded function beside the model, so that vectors can be searched in it.
    pub fn with_recorded(mut self, program: &Arc<Interpreter>) -> Self {
        let functions = &program.program().functions;
        let number = functions.iter().position(|f| f.name == self.name);
        self.recorded = number.map(|number| (program.clone(), number));
        self.wide_outputs = OnceLock::new();
        self
    }

    /// Outputs, state and fault as the recorded function gives them, also of words outside their ranges, where the
    /// emitted function would limit them; nothing where none was recorded.
    pub fn traced(&self, words: &[i128]) -> Vec<i128> {
        let Some((program, number)) = &self.recorded else {
            return Vec::new();
        };
        let inputs = program.program().functions[*number].inputs.len();
        let (inputs, state) = words.split_at(inputs);
        let (mut state, mut outputs) = (state.to_vec(), Vec::new());
        let fault = program.call(*number, inputs, &mut state, &mut outputs);
        outputs.extend(state);
        outputs.push(i128::from(fault));
        outputs
    }

    /// Moves a word of a drawn state where the state would be one that no run of the chain reaches and that
    /// the emitted code's types do not hold.
    pub fn repair(&self, inputs: &mut [i128]) {
        for repair in &self.repairs {
            repair.apply(inputs);
        }
    }

    /// Words that are drawn each for itself from its range make a call of it: no word of more than 64 bits, no
    /// state that has to be repaired, no other blocks' states in its own.
    pub fn stands_alone(&self) -> bool {
        let holds_others = self.recorded.as_ref().is_some_and(|(program, number)| {
            !program.program().functions[*number].members.is_empty()
        });
        !holds_others && self.repairs.is_empty() && !self.wide.contains(&true)
    }

    /// The words of a record as 64-bit words, a wider one as its low and its high half.
    pub fn input_words(&self, inputs: &[i128]) -> Vec<i128> {
        halves(inputs, &self.wide)
    }

    /// True for each output and word of the state that takes two 64-bit words; the fault, which comes last, does not.
    fn wide_outputs(&self) -> &[bool] {
        self.wide_outputs.get_or_init(|| {
            let plain = std::iter::repeat_n(false, self.outputs - self.state);
            let inputs = self.inputs.len() - self.state;
            let state = self.wide[inputs..].iter().copied();
            let mut wide: Vec<bool> = plain.chain(state).collect();
            if let Some((program, number)) = &self.recorded {
                let function = &program.program().functions[*number];
                let named = function
                    .outputs
                    .iter()
                    .filter(|(port, _)| !port.name.is_empty());
                for (wide, (_, id)) in wide.iter_mut().zip(named) {
                    *wide = function.nodes[*id].range.bits() > 64;
                }
            }
            wide.push(false);
            wide
        })
    }

    /// The columns of its vectors: inputs, outputs, fault, each of at most 64 bits; and how many are inputs.
    pub fn columns(&self) -> (Vec<String>, usize) {
        let split = |names: &[String], wide: &[bool]| -> Vec<String> {
            let columns = names.iter().zip(wide).flat_map(|(name, wide)| match wide {
                true => vec![format!("{name}.low"), format!("{name}.high")],
                false => vec![name.clone()],
            });
            columns.collect()
        };
        let mut columns = split(&self.input_names, &self.wide);
        let inputs = columns.len();
        columns.extend(split(&self.output_names, self.wide_outputs()));
        columns.push("fault".to_owned());
        (columns, inputs)
    }

    /// Appends outputs, state and fault at an input, as 64-bit words.
    pub fn record(&self, input: &[i128], to: &mut Vec<i128>) {
        let from = to.len();
        to.resize(from + self.outputs, 0);
        let fault = self.call(input, &mut to[from..]);
        to.push(i128::from(fault));
        let wide = self.wide_outputs();
        if wide.contains(&true) {
            let words = halves(&to[from..], wide);
            to.truncate(from);
            to.extend(words);
        }
    }

    /// The model with damaged copies of its block, each of which vectors have to tell from it.
    pub fn with_damage<const I: usize, const O: usize, B>(
        mut self,
        blocks: impl IntoIterator<Item = B>,
        narrow: bool,
    ) -> Self
    where
        B: Block<Fixed<i64, i64>, I, O, State = ()> + Block<Fixed<i128, i128>, I, O, State = ()>,
        B: Send + Sync + 'static,
    {
        let blocks = blocks.into_iter().map(|block| evaluate(block, narrow));
        self.damaged = blocks.collect();
        self
    }
}

/// The machine type of these words has 128 bits.
fn is_wide(range: &Interval) -> bool {
    range.bits() > 64
}

fn halves(words: &[i128], wide: &[bool]) -> Vec<i128> {
    let mut all = Vec::with_capacity(2 * words.len());
    for (word, wide) in words.iter().zip(wide) {
        if *wide {
            all.extend([word & i128::from(u64::MAX), word >> 64]);
        } else {
            all.push(*word);
        }
    }
    all
}

/// On the way from `a` to `b`, one input after the other: the neighbours between which the fault
/// changes first.
fn edge(fault: &mut impl FnMut(&[i128]) -> u32, a: &[i128], b: &[i128]) -> Vec<Vec<i128>> {
    let first = fault(a);
    let mut at = a.to_vec();
    for k in 0..a.len() {
        let (mut near, mut far) = (at[k], b[k]);
        at[k] = far;
        if fault(&at) == first {
            continue;
        }
        while near.abs_diff(far) > 1 {
            at[k] = near + (far - near) / 2;
            let side = if fault(&at) == first {
                &mut near
            } else {
                &mut far
            };
            *side = at[k];
        }
        return [near, far]
            .into_iter()
            .map(|word| {
                at[k] = word;
                at.clone()
            })
            .collect();
    }
    Vec::new()
}

fn evaluate<const I: usize, const O: usize, B>(block: B, narrow: bool) -> Box<Evaluate>
where
    B: Block<Fixed<i64, i64>, I, O, State = ()> + Block<Fixed<i128, i128>, I, O, State = ()>,
    B: Send + Sync + 'static,
{
    if narrow {
        Box::new(move |inputs, outputs| {
            let ar = Fixed::<i64, i64>::new();
            let words = std::array::from_fn(|k| inputs[k] as i64);
            let results = Block::<_, I, O>::step(&block, &ar, &mut (), words);
            for (output, word) in outputs.iter_mut().zip(results) {
                *output = i128::from(word);
            }
            ar.overflowed().map_or(0, |o| o.cast as u32 + 1)
        })
    } else {
        Box::new(move |inputs, outputs| {
            let ar = Fixed::<i128, i128>::new();
            let words = std::array::from_fn(|k| inputs[k]);
            let results = Block::<_, I, O>::step(&block, &ar, &mut (), words);
            outputs[..O].copy_from_slice(&results);
            ar.overflowed().map_or(0, |o| o.cast as u32 + 1)
        })
    }
}

/// Copies of a block in which one rounding constant is off by one.
fn nudged<B: Clone>(block: &B, casts: fn(&mut B) -> Vec<&mut Cast>) -> Vec<B> {
    let mut blocks = Vec::new();
    for k in 0..casts(&mut block.clone()).len() {
        for step in [-1, 1] {
            let mut damaged = block.clone();
            let moved = casts(&mut damaged).into_iter().nth(k).and_then(|cast| {
                *cast = cast.nudged(step)?;
                Some(())
            });
            if moved.is_some() {
                blocks.push(damaged);
            }
        }
    }
    blocks
}

/// Models of the functions that a program has, in the program's order.
pub fn models(design: &Design, program: &Program) -> Vec<Model> {
    match design.circuit.decimator.stages {
        1 => of_chain(&Chain::<1>::new(design), design, program),
        2 => of_chain(&Chain::<2>::new(design), design, program),
        3 => of_chain(&Chain::<3>::new(design), design, program),
        4 => of_chain(&Chain::<4>::new(design), design, program),
        5 => of_chain(&Chain::<5>::new(design), design, program),
        _ => of_chain(&Chain::<6>::new(design), design, program),
    }
}

fn of_chain<const N: usize>(chain: &Chain<N>, design: &Design, program: &Program) -> Vec<Model> {
    let alone = crate::circuit::compensate::compensation_alone(design);
    let compensation = chain.compensation.clone().or(alone);
    let variants = program
        .functions
        .iter()
        .filter(|f| f.name.starts_with("demodulate"))
        .count();
    let interpreter = Interpreter::new(program);
    let mut models = Vec::new();
    // `push` alone calls `sample`, and the chain's rows are compared with all that they leave in the state.
    let called = program.functions.iter().enumerate();
    for (number, function) in called.filter(|(_, f)| f.name != "sample") {
        let recorded = || Model::recorded(&interpreter, number);
        let narrow = program.word_bits(function) <= 64;
        let base = function
            .name
            .trim_end_matches(|c: char| c == '_' || c.is_ascii_digit());
        let model = match (base, &compensation) {
            ("demodulate", _) => {
                // One for all channels, or one for each in the channels' order.
                let variant = function.name.trim_start_matches("demodulate_");
                let channel = variant.parse::<usize>().map_or(0, |k| k - 1);
                let channel = if variants > 1 { channel.min(3) } else { 0 };
                let mixer = &chain.mixers[channel];
                Model::new(function, mixer.clone(), narrow)
                    .with_damage(nudged(mixer, |m| vec![&mut m.product]), narrow)
            }
            ("cordic", _) => Model::new(function, chain.cordic.clone(), narrow),
            ("bias", Some((bias, _))) => Model::new(function, bias.clone(), narrow)
                .with_damage(nudged(bias, Bias::casts_mut), narrow),
            ("rate", Some((_, rate))) => Model::new(function, rate.clone(), narrow)
                .with_damage(nudged(rate, Rate::casts_mut), narrow),
            ("in_range", _) => match crate::circuit::compensate::in_range(design) {
                Some(flag) => Model::new(function, flag, narrow),
                None => recorded(),
            },
            ("compensate", Some((bias, rate))) => {
                let (bias, rate) = (bias.clone(), rate.clone());
                // The callees' words count too.
                let narrow = program.functions.iter().all(|f| program.word_bits(f) <= 64);
                Model::new(function, Compensate { bias, rate }, narrow)
            }
            _ => recorded(),
        };
        models.push(model.with_recorded(&interpreter));
    }
    models
}

/// For each coefficient of the polynomial, inputs at which the model's output changes if the
/// coefficient moves by one LSB, or by one LSB of the accumulator that emitted code aligns it to:
/// vectors that catch such damage.
pub fn sensitive_inputs(design: &Design, candidates: &[i128]) -> Vec<i128> {
    const EACH: usize = 4;
    let Some(compensation) = &design.compensation else {
        return Vec::new();
    };
    let evaluate = |bias: &Bias, input: i128| {
        let ar = Fixed::<i128, i128>::new();
        Block::<_, 1, 1>::step(bias, &ar, &mut (), [input])
    };
    let nominal = Bias::new(&design.circuit, compensation);
    let mut inputs = Vec::new();
    if let Evaluation::Form(form) = &nominal.evaluation {
        for damaged in super::form::damaged(form) {
            let mut other = nominal.clone();
            other.evaluation = Evaluation::Form(Box::new(damaged));
            let differs = |x: &&i128| evaluate(&other, **x) != evaluate(&nominal, **x);
            inputs.extend(candidates.iter().filter(differs).take(EACH));
        }
        return inputs;
    }
    let mut search = |damaged: &Compensation| {
        let damaged = Bias::new(&design.circuit, damaged);
        let differs = |x: &&i128| evaluate(&damaged, **x) != evaluate(&nominal, **x);
        inputs.extend(candidates.iter().filter(differs).take(EACH));
    };
    for k in 0..compensation.coefficients_raw.len() {
        for step in [-1, 1] {
            let mut damaged = compensation.clone();
            damaged.coefficients_raw[k] += step;
            search(&damaged);
            let mut damaged = aligned(compensation);
            damaged.coefficients_raw[k] += step;
            search(&damaged);
        }
    }
    inputs
}

/// The same polynomial with coefficients in the accumulator's LSB.
fn aligned(compensation: &Compensation) -> Compensation {
    let mut aligned = compensation.clone();
    let fine = compensation.accumulator.format.fraction_bits;
    let shift = fine - compensation.coefficient_format.fraction_bits;
    aligned.coefficient_format.fraction_bits = fine;
    for coefficient in &mut aligned.coefficients_raw {
        *coefficient <<= shift;
    }
    aligned
}
