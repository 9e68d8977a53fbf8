//! Runs a chain over captured codes: in `f64`, or bit-accurately in the narrowest lanes that the
//! traced ranges fit into.

use super::block_kernel::{BlockKernel, Instructions};
pub use super::chain::Front;
use super::chain::{Chain, FastState, Held, SlowState};
use super::ends::{Ends, FloatScale, quantised};
use super::float_kernel::FloatKernel;
use super::row_batch::{RowBatch, Stages};
pub use super::rows::{Rows, columns};
use crate::design::Design;
use crate::numeric::arithmetic::{Arithmetic, Block};
use crate::numeric::cast::form;
use crate::numeric::fixed::{Fixed, Overflowed};
use crate::numeric::float::Float;
use crate::numeric::trace::ir::Program;

/// Which arithmetic a chain runs in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArithmeticKind {
    /// Bit-accurate.
    Fixed,
    /// No quantisation.
    Float,
}

/// Codes of 16 bits that are widened at a time, at most (calibrated: of 64 to 2048 the fastest over arrays in memory on Zen 3, where
/// longer ones leave the loads of the next no time to be fetched; a multiple of the kernel's samples side by side).
const WIDENED_CODES: usize = 128;

/// A chain with its state. Feeding it in pieces of any size gives the same rows.
pub trait Engine {
    /// Processes as many drive as sense codes, and appends the rows that are complete.
    ///
    /// # Errors
    /// The first overflow of a cast whose mode is `error`; the rows are then of no use.
    fn process(
        &mut self,
        drive: &[i32],
        sense: &[i32],
        rows: &mut Rows,
    ) -> Result<(), Box<Overflowed>>;
    /// The same for codes of at most 16 bits as they stand in memory or in a file: of half the memory, which is what
    /// the speed over long arrays depends on.
    ///
    /// # Errors
    /// As [`Engine::process`].
    fn process_16_bits(
        &mut self,
        drive: &[i16],
        sense: &[i16],
        rows: &mut Rows,
    ) -> Result<(), Box<Overflowed>>;
    /// The same for ADC inputs in LSB. The bit-accurate engine quantises them as an ideal ADC does
    /// (nearest, ties up, saturating); the one without quantisation takes them as they are, and a whole
    /// period at once by `float_kernel`, which rounds elsewhere than its samples one by one.
    ///
    /// # Errors
    /// As [`Engine::process`].
    fn process_inputs(
        &mut self,
        drive_lsb: &[f64],
        sense_lsb: &[f64],
        rows: &mut Rows,
    ) -> Result<(), Box<Overflowed>>;
    /// Processes codes at the sample rate alone, and appends what each complete period leaves there for circuits that
    /// [`follow`](Engine::follow). No row is made and no loop acts.
    ///
    /// # Errors
    /// As [`Engine::process`].
    fn fronts(
        &mut self,
        drive: &[i32],
        sense: &[i32],
        fronts: &mut Vec<Front>,
    ) -> Result<(), Box<Overflowed>>;
    /// What the last complete period left at the sample rate.
    fn front(&self) -> Front;
    /// Takes what whole periods leave at the sample rate from another circuit that is alike up to there (see
    /// [`super::ensemble`]), and appends their rows.
    ///
    /// # Errors
    /// As [`Engine::process`].
    fn follow(&mut self, fronts: &[Front], rows: &mut Rows) -> Result<(), Box<Overflowed>>;
    /// What makes rows of fronts stage by stage, where no row waits for the one before and no cast can stop the run.
    fn stages(&mut self) -> Option<&mut dyn Stages>;
    /// No rows, of the kind that this engine makes.
    fn no_rows(&self) -> Rows;
    /// What the circuit excites the drive with until the end of the next period.
    fn excitation(&self) -> Excitation;
    /// Puts the loops at rest (see [`Chain::hold`]).
    fn hold(&mut self, held: Held);
}

/// The circuit's outputs to the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excitation {
    /// Phase of the oscillator at the last sample, 2^-64 turn.
    pub phase: u64,
    /// What it advances by before each sample, 2^-64 turn.
    pub step: u64,
    /// Drive gain, 0 to 1; `None` without an amplitude loop.
    pub gain: Option<f64>,
}

/// The engine of a design, with the fastest instructions that the processor has.
pub fn engine(design: &Design, kind: ArithmeticKind) -> Box<dyn Engine> {
    by_stages(design, kind, None)
}

/// The engine of a design, with these instructions where a kernel applies and the processor has
/// them. The rows are the same with all.
pub fn engine_with(
    design: &Design,
    kind: ArithmeticKind,
    instructions: Instructions,
) -> Box<dyn Engine> {
    by_stages(design, kind, Some(instructions))
}

fn by_stages(
    design: &Design,
    kind: ArithmeticKind,
    instructions: Option<Instructions>,
) -> Box<dyn Engine> {
    match design.circuit.decimator.stages {
        1 => with_stages::<1>(design, kind, instructions),
        2 => with_stages::<2>(design, kind, instructions),
        3 => with_stages::<3>(design, kind, instructions),
        4 => with_stages::<4>(design, kind, instructions),
        5 => with_stages::<5>(design, kind, instructions),
        _ => with_stages::<6>(design, kind, instructions),
    }
}

/// The chain of a design as a program of integer operations.
pub fn trace(design: &Design) -> Program {
    match design.circuit.decimator.stages {
        1 => Chain::<1>::new(design).trace(),
        2 => Chain::<2>::new(design).trace(),
        3 => Chain::<3>::new(design).trace(),
        4 => Chain::<4>::new(design).trace(),
        5 => Chain::<5>::new(design).trace(),
        _ => Chain::<6>::new(design).trace(),
    }
}

/// Lanes that a chain needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LaneBits {
    /// Of words at the sample rate.
    pub fast: u32,
    /// Of words at the decimated rate.
    pub slow: u32,
    /// Of residues.
    pub residue: u32,
}

/// The widest words and residues of a traced chain.
pub fn lane_bits<const N: usize>(chain: &Chain<N>, program: &Program) -> LaneBits {
    let bits = |name| {
        let function = program.functions.iter().position(|f| f.name == name);
        function.map_or(128, |k| program.word_bits_deep(k))
    };
    LaneBits {
        fast: bits("sample"),
        slow: bits("period"),
        residue: chain.cics[0].ring.bits.max(chain.nco.ring.bits),
    }
}

type Narrow<const FORM: u8 = { form::ANY }> = Fixed<i64, i64, FORM>;

fn with_stages<const N: usize>(
    design: &Design,
    kind: ArithmeticKind,
    instructions: Option<Instructions>,
) -> Box<dyn Engine> {
    let mut chain = Chain::<N>::new(design);
    let float_scale = FloatScale::new(design);
    if kind == ArithmeticKind::Float {
        let whole = FloatKernel::new(&chain);
        let mut running = Running::new(chain, Float, Float, float_scale, (None, None));
        running.float_kernel = Some(whole);
        return Box::new(running);
    }
    let bits = lane_bits(&chain, &chain.trace());
    let narrow = bits.fast <= 64 && bits.residue <= 64;
    let products = chain
        .mixers
        .iter()
        .map(|m| m.product.kernel::<i64>().form());
    let form = products.max().unwrap_or(form::ANY);
    let instructions = instructions.unwrap_or_else(|| Instructions::best(&chain));
    let kernel = narrow
        .then(|| BlockKernel::new(&chain, instructions))
        .flatten();
    // A tuning word is an unsigned number: of 64 bits it needs one more.
    let tunes_64_bits = chain.phase_loop.is_some() && chain.nco.ring.bits > 63;
    let slow_is_narrow = bits.slow <= 64 && !tunes_64_bits;
    let batch = (narrow && slow_is_narrow)
        .then(|| RowBatch::new(&mut chain, instructions))
        .flatten();
    let parts = (chain, float_scale, (kernel, batch));
    // Words of more than 64 bits at the decimated rate are rare, and one form serves them all.
    match (narrow, form, slow_is_narrow) {
        (true, form::IDLE, true) => fixed::<Narrow<{ form::IDLE }>, Narrow, N>(parts),
        (true, form::ROUNDED, true) => fixed::<Narrow<{ form::ROUNDED }>, Narrow, N>(parts),
        (true, _, true) => fixed::<Narrow, Narrow, N>(parts),
        (true, _, false) => fixed::<Narrow, Fixed<i128, i64>, N>(parts),
        _ if bits.fast <= 64 => fixed::<Fixed<i64, i128>, Fixed<i128, i128>, N>(parts),
        _ => fixed::<Fixed<i128, i128>, Fixed<i128, i128>, N>(parts),
    }
}

fn fixed<F, S, const N: usize>(
    (chain, scale, fast_ways): (Chain<N>, FloatScale, FastWays<N>),
) -> Box<dyn Engine>
where
    F: Ends + Default + 'static,
    S: Ends + Default + Arithmetic<Residue = F::Residue> + 'static,
{
    let (fast, slow) = (F::default(), S::default());
    Box::new(Running::new(chain, fast, slow, scale, fast_ways))
}

/// The kernel of the sample rate and the batch of the decimated rate, where they apply.
type FastWays<const N: usize> = (Option<BlockKernel<N>>, Option<RowBatch<N>>);

/// A chain at work: `F` at the sample rate, `S` at the decimated rate.
struct Running<F: Arithmetic, S: Arithmetic<Residue = F::Residue>, const N: usize> {
    chain: Chain<N>,
    fast: F,
    slow: S,
    fast_state: FastState<F::Residue, N>,
    slow_state: SlowState<S::Word>,
    scale: FloatScale,
    /// What runs codes at the sample rate, where it applies.
    kernel: Option<BlockKernel<N>>,
    /// What runs inputs without quantisation, where the arithmetic has none.
    float_kernel: Option<FloatKernel<N>>,
    /// Rows that wait; none do between two calls.
    batch: Option<RowBatch<N>>,
    /// Samples so far.
    samples: u64,
    /// Samples of the period at hand.
    phase: usize,
    /// Drive gain as last put out.
    gain: Option<f64>,
}

impl<F: Ends, S: Ends + Arithmetic<Residue = F::Residue>, const N: usize> Running<F, S, N> {
    fn new(
        chain: Chain<N>,
        fast: F,
        slow: S,
        scale: FloatScale,
        (kernel, batch): FastWays<N>,
    ) -> Self {
        let mut running = Running {
            fast_state: chain.start_fast(&fast),
            slow_state: chain.start_slow(&slow),
            chain,
            fast,
            slow,
            scale,
            kernel,
            float_kernel: None,
            batch,
            samples: 0,
            phase: 0,
            gain: None,
        };
        running.gain = running.initial_gain();
        running
    }

    /// The drive gain before the first row: that of the integrator as the design gives it.
    fn initial_gain(&self) -> Option<f64> {
        let block = self.chain.amplitude_loop.as_ref()?;
        let mut state = self.slow_state.amplitude_loop?;
        // At the setpoint there is no error, so this step changes nothing.
        let [gain] = block.step(&self.slow, &mut state, [block.setpoint(&self.slow)]);
        Some(S::gain(gain, &self.scale))
    }

    /// Codes inside one period: nothing but the fast state changes. A function of its own, so that what is around it takes none of
    /// its registers.
    #[inline(never)]
    fn block(&mut self, drive: &[i32], sense: &[i32]) {
        let fraction_bits = self.chain.code_fraction_bits;
        // A copy that does not escape lives in registers.
        let mut state = self.fast_state;
        for (k, (d, s)) in drive.iter().zip(sense).enumerate() {
            self.fast.at(self.samples + k as u64);
            let codes = [*d, *s].map(|code| self.fast.code(code, fraction_bits));
            self.chain.sample(&self.fast, &mut state, codes);
        }
        self.fast_state = state;
        self.samples += drive.len() as u64;
    }

    /// Codes inside one period, by the kernel where there is one.
    #[inline(always)]
    fn codes(&mut self, drive: &[i32], sense: &[i32]) {
        let left_over = match &self.kernel {
            Some(kernel) => kernel.left_over(drive.len()),
            None => drive.len(),
        };
        let (single, drive) = drive.split_at(left_over);
        let (single_sense, sense) = sense.split_at(left_over);
        if !single.is_empty() {
            self.block(single, single_sense);
        }
        if let Some(kernel) = self.kernel.as_mut().filter(|_| !drive.is_empty()) {
            F::run_kernel(kernel, &mut self.fast_state, [drive, sense]);
            self.samples += drive.len() as u64;
        }
    }

    /// Codes or inputs of any number of periods: `block` takes what is inside one, `end` comes after each.
    #[inline(always)]
    fn periods<T: Copy>(
        &mut self,
        drive: &[T],
        sense: &[T],
        mut block: impl FnMut(&mut Self, &[T], &[T]),
        mut end: impl FnMut(&mut Self) -> Result<(), Box<Overflowed>>,
    ) -> Result<(), Box<Overflowed>> {
        let ratio = self.chain.cics[0].ratio as usize;
        let (mut drive, mut sense) = (drive, sense);
        while !drive.is_empty() {
            let count = drive.len().min(ratio - self.phase);
            let (d, s);
            (d, drive) = drive.split_at(count);
            (s, sense) = sense.split_at(count);
            block(self, d, s);
            // The fast rate comes first in the order of steps; an overflow there is the earlier.
            if let Some(overflowed) = self.fast.stopped() {
                return Err(Box::new(overflowed));
            }
            self.phase += count;
            if self.phase == ratio {
                self.phase = 0;
                end(self)?;
            }
        }
        Ok(())
    }

    /// Appends the rows that wait.
    fn put_waiting(&mut self, rows: &mut Rows) {
        if let (Some(batch), Rows::Integer(rows)) = (&mut self.batch, rows) {
            batch.put_waiting(rows);
        }
    }

    /// The row of a period whose samples are through.
    fn row(&mut self, rows: &mut Rows) -> Result<(), Box<Overflowed>> {
        self.end_of_period(rows);
        self.slow.stopped().map_or(Ok(()), |o| Err(Box::new(o)))
    }

    fn end_of_period(&mut self, rows: &mut Rows) {
        let front = self.front();
        if let (Some(batch), Rows::Integer(rows)) = (&mut self.batch, &mut *rows) {
            batch.push(front, rows);
            return;
        }
        self.slow.at(self.samples - 1);
        let row = self
            .chain
            .period(&self.slow, &mut self.fast_state, &mut self.slow_state);
        let tuning = self
            .slow_state
            .phase_loop
            .is_some()
            .then_some(self.fast_state.oscillator.tuning);
        self.gain = row.gain.map(|g| S::gain(g, &self.scale));
        S::put(&row, tuning, self.chain.nco.ring.bits, &self.scale, rows);
    }
}

impl<F: Ends, S: Ends + Arithmetic<Residue = F::Residue>, const N: usize> Engine
    for Running<F, S, N>
{
    fn process(
        &mut self,
        drive: &[i32],
        sense: &[i32],
        rows: &mut Rows,
    ) -> Result<(), Box<Overflowed>> {
        self.periods(drive, sense, Self::codes, |running| running.row(rows))?;
        self.put_waiting(rows);
        Ok(())
    }

    fn process_16_bits(
        &mut self,
        drive: &[i16],
        sense: &[i16],
        rows: &mut Rows,
    ) -> Result<(), Box<Overflowed>> {
        let mut wide = [[0; WIDENED_CODES]; 2];
        let block = |running: &mut Self, drive: &[i16], sense: &[i16]| {
            let pieces = drive.chunks(WIDENED_CODES).zip(sense.chunks(WIDENED_CODES));
            for (d, s) in pieces {
                for (to, from) in wide.iter_mut().zip([d, s]) {
                    for (to, from) in to.iter_mut().zip(from) {
                        *to = i32::from(*from);
                    }
                }
                let [drive, sense] = &wide;
                running.codes(&drive[..d.len()], &sense[..s.len()]);
            }
        };
        self.periods(drive, sense, block, |running| running.row(rows))?;
        self.put_waiting(rows);
        Ok(())
    }

    fn fronts(
        &mut self,
        drive: &[i32],
        sense: &[i32],
        fronts: &mut Vec<Front>,
    ) -> Result<(), Box<Overflowed>> {
        self.periods(drive, sense, Self::codes, |running| {
            fronts.push(running.front());
            Ok(())
        })
    }

    fn front(&self) -> Front {
        let last = |k: usize| F::wide(self.fast_state.cics[k].integrators[N - 1]);
        [last(0), last(1), last(2), last(3)]
    }

    fn follow(&mut self, fronts: &[Front], rows: &mut Rows) -> Result<(), Box<Overflowed>> {
        for front in fronts {
            for (cic, word) in self.fast_state.cics.iter_mut().zip(front) {
                cic.integrators[N - 1] = F::narrow(*word);
            }
            self.samples += u64::from(self.chain.cics[0].ratio);
            self.row(rows)?;
        }
        self.put_waiting(rows);
        Ok(())
    }

    fn stages(&mut self) -> Option<&mut dyn Stages> {
        self.batch.as_mut().map(|batch| batch as &mut dyn Stages)
    }

    fn process_inputs(
        &mut self,
        drive_lsb: &[f64],
        sense_lsb: &[f64],
        rows: &mut Rows,
    ) -> Result<(), Box<Overflowed>> {
        if self.float_kernel.is_none() {
            let [drive, sense] =
                [drive_lsb, sense_lsb].map(|lsb| quantised(lsb, self.chain.code_range));
            return self.process(&drive, &sense, rows);
        }
        let block = |running: &mut Self, drive: &[f64], sense: &[f64]| {
            let Running {
                chain, fast_state, ..
            } = running;
            if let Some(kernel) = &mut running.float_kernel {
                F::run_inputs(kernel, chain, fast_state, [drive, sense]);
            }
            running.samples += drive.len() as u64;
        };
        self.periods(drive_lsb, sense_lsb, block, |running| running.row(rows))?;
        self.put_waiting(rows);
        Ok(())
    }

    fn excitation(&self) -> Excitation {
        let bits = self.chain.nco.ring.bits;
        let oscillator = &self.fast_state.oscillator;
        Excitation {
            phase: F::turns(oscillator.phase, bits),
            step: F::turns(oscillator.tuning, bits),
            gain: self.gain,
        }
    }

    fn hold(&mut self, held: Held) {
        let gain = self
            .chain
            .hold(&self.slow, &mut self.fast_state, &mut self.slow_state, held);
        self.gain = gain.map(|g| S::gain(g, &self.scale));
    }

    fn no_rows(&self) -> Rows {
        S::no_rows()
    }
}
