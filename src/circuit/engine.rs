//! Runs a chain over captured codes: in `f64`, or bit-accurately in the narrowest lanes that the
//! traced ranges fit into.

use super::chain::{Chain, FastState, Row, SlowState};
use crate::design::Design;
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::HasKernel;
use crate::numeric::fixed::{Fixed, Overflowed};
use crate::numeric::float::Float;
use crate::numeric::format::pow2;
use crate::numeric::lane::Lane;
use crate::numeric::trace::ir::Program;

/// Which arithmetic a chain runs in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArithmeticKind {
    /// Bit-accurate.
    Fixed,
    /// No quantisation.
    Float,
}

/// Decimated samples, row after row, in the columns of [`columns`].
#[derive(Debug, Clone, PartialEq)]
pub enum Rows {
    /// Raw integers.
    Integer(Vec<i128>),
    /// Real values: 1, turns, deg/s, Hz.
    Real(Vec<f64>),
}

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
    /// No rows, of the kind that this engine makes.
    fn no_rows(&self) -> Rows;
}

/// The columns of a row after `index`, in the contract's order.
pub fn columns(design: &Design) -> Vec<&'static str> {
    let mut columns = super::CHANNELS.to_vec();
    columns.extend(["phase", "magnitude"]);
    if has_rate(design) {
        columns.push("rate");
    }
    if design.circuit.phase_loop.is_some() {
        columns.push("tuning_word");
    }
    if design.circuit.amplitude_loop.is_some() {
        columns.push("gain");
    }
    columns
}

fn has_rate(design: &Design) -> bool {
    design
        .compensation
        .as_ref()
        .is_some_and(|c| c.input == crate::design::CompensationInput::Phase)
}

/// The engine of a design.
pub fn engine(design: &Design, kind: ArithmeticKind) -> Box<dyn Engine> {
    match design.circuit.decimator.stages {
        1 => with_stages::<1>(design, kind),
        2 => with_stages::<2>(design, kind),
        3 => with_stages::<3>(design, kind),
        4 => with_stages::<4>(design, kind),
        5 => with_stages::<5>(design, kind),
        _ => with_stages::<6>(design, kind),
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

fn with_stages<const N: usize>(design: &Design, kind: ArithmeticKind) -> Box<dyn Engine> {
    let chain = Chain::<N>::new(design);
    let float_scale = FloatScale::new(design);
    if kind == ArithmeticKind::Float {
        return Box::new(Running::new(chain, Float, Float, float_scale));
    }
    let bits = lane_bits(&chain, &chain.trace());
    let narrow = bits.fast <= 64 && bits.residue <= 64;
    let idle = chain.mixers.iter().all(|m| m.product.is_idle());
    match (narrow, idle, bits.slow <= 64) {
        (true, true, true) => {
            fixed::<Fixed<i64, i64, true>, Fixed<i64, i64>, N>(chain, float_scale)
        }
        (true, true, false) => {
            fixed::<Fixed<i64, i64, true>, Fixed<i128, i64>, N>(chain, float_scale)
        }
        (true, false, true) => fixed::<Fixed<i64, i64>, Fixed<i64, i64>, N>(chain, float_scale),
        (true, false, false) => fixed::<Fixed<i64, i64>, Fixed<i128, i64>, N>(chain, float_scale),
        _ if bits.fast <= 64 => fixed::<Fixed<i64, i128>, Fixed<i128, i128>, N>(chain, float_scale),
        _ => fixed::<Fixed<i128, i128>, Fixed<i128, i128>, N>(chain, float_scale),
    }
}

fn fixed<F, S, const N: usize>(chain: Chain<N>, scale: FloatScale) -> Box<dyn Engine>
where
    F: Ends + Default + 'static,
    S: Ends + Default + Arithmetic<Residue = F::Residue> + 'static,
{
    Box::new(Running::new(chain, F::default(), S::default(), scale))
}

/// What turns a float row into the contract's units.
#[derive(Debug, Clone, Copy)]
struct FloatScale {
    sample_rate_hz: f64,
    gain_lsb: f64,
}

impl FloatScale {
    fn new(design: &Design) -> Self {
        let loop_bits = design.circuit.amplitude_loop.as_ref().map(|l| l.gain_bits);
        FloatScale {
            sample_rate_hz: design.circuit.sample_rate_hz,
            gain_lsb: pow2(1 - loop_bits.unwrap_or(1) as i32),
        }
    }
}

/// How an arithmetic meets the outside: codes in, columns out, overflows.
trait Ends: Arithmetic {
    fn code(&self, code: i32, fraction_bits: i32) -> Self::Word;
    fn at(&self, _sample: u64) {}
    fn stopped(&self) -> Option<Overflowed> {
        None
    }
    fn no_rows() -> Rows;
    /// Appends a row; the tuning word is an element of a ring of `phase_bits`.
    fn put(
        row: &Row<Self::Word>,
        tuning: Option<Self::Residue>,
        phase_bits: u32,
        scale: &FloatScale,
        rows: &mut Rows,
    );
}

impl<W: HasKernel, R: Lane, const IDLE: bool> Ends for Fixed<W, R, IDLE> {
    #[inline(always)]
    fn code(&self, code: i32, _fraction_bits: i32) -> W {
        W::from_i32(code)
    }
    #[inline(always)]
    fn at(&self, sample: u64) {
        self.at_sample(sample);
    }
    fn stopped(&self) -> Option<Overflowed> {
        self.overflowed()
    }
    fn no_rows() -> Rows {
        Rows::Integer(Vec::new())
    }
    fn put(row: &Row<W>, tuning: Option<R>, phase_bits: u32, _scale: &FloatScale, rows: &mut Rows) {
        let Rows::Integer(rows) = rows else { return };
        rows.extend(row.channels.iter().map(|w| w.wide()));
        rows.extend([row.phase.wide(), row.magnitude.wide()]);
        rows.extend(row.compensation.map(|[_, rate]| rate.wide()));
        rows.extend(tuning.map(|t| t.wide() & ((1 << phase_bits) - 1)));
        rows.extend(row.gain.map(|g| g.wide()));
    }
}

impl Ends for Float {
    fn code(&self, code: i32, fraction_bits: i32) -> f64 {
        f64::from(code) * pow2(-fraction_bits)
    }
    fn no_rows() -> Rows {
        Rows::Real(Vec::new())
    }
    fn put(
        row: &Row<f64>,
        tuning: Option<i128>,
        _phase_bits: u32,
        scale: &FloatScale,
        rows: &mut Rows,
    ) {
        let Rows::Real(rows) = rows else { return };
        rows.extend(row.channels);
        rows.extend([row.phase, row.magnitude]);
        rows.extend(row.compensation.map(|[_, rate]| rate));
        // A turn is the whole 128-bit circle.
        rows.extend(tuning.map(|t| t as u128 as f64 * pow2(-128) * scale.sample_rate_hz));
        rows.extend(row.gain.map(|g| g * scale.gain_lsb));
    }
}

/// A chain at work: `F` at the sample rate, `S` at the decimated rate.
struct Running<F: Arithmetic, S: Arithmetic<Residue = F::Residue>, const N: usize> {
    chain: Chain<N>,
    fast: F,
    slow: S,
    fast_state: FastState<F::Residue, N>,
    slow_state: SlowState<S::Word>,
    scale: FloatScale,
    /// Samples so far.
    samples: u64,
    /// Samples of the period at hand.
    phase: usize,
    /// A cast at the sample rate may stop the run.
    watched: bool,
}

impl<F: Ends, S: Ends + Arithmetic<Residue = F::Residue>, const N: usize> Running<F, S, N> {
    fn new(chain: Chain<N>, fast: F, slow: S, scale: FloatScale) -> Self {
        let product = &chain.mixers[0].product;
        Running {
            fast_state: chain.start_fast(&fast),
            slow_state: chain.start_slow(&slow),
            watched: product.overflow == Some(crate::numeric::format::Overflow::Error)
                && !product.is_proved(),
            chain,
            fast,
            slow,
            scale,
            samples: 0,
            phase: 0,
        }
    }

    /// Samples inside one period: nothing but the fast state changes.
    fn block(&mut self, drive: &[i32], sense: &[i32]) {
        let fraction_bits = self.chain.code_fraction_bits;
        // A copy that does not escape lives in registers.
        let mut state = self.fast_state;
        for (k, (d, s)) in drive.iter().zip(sense).enumerate() {
            if self.watched {
                self.fast.at(self.samples + k as u64);
            }
            let codes = [
                self.fast.code(*d, fraction_bits),
                self.fast.code(*s, fraction_bits),
            ];
            self.chain.sample(&self.fast, &mut state, codes);
        }
        self.fast_state = state;
        self.samples += drive.len() as u64;
    }

    fn end_of_period(&mut self, rows: &mut Rows) {
        self.slow.at(self.samples - 1);
        let row = self
            .chain
            .period(&self.slow, &mut self.fast_state, &mut self.slow_state);
        let tuning = self
            .slow_state
            .phase_loop
            .is_some()
            .then_some(self.fast_state.oscillator.tuning);
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
        let ratio = self.chain.cics[0].ratio as usize;
        let (mut drive, mut sense) = (drive, sense);
        while !drive.is_empty() {
            let count = drive.len().min(ratio - self.phase);
            let (d, s);
            (d, drive) = drive.split_at(count);
            (s, sense) = sense.split_at(count);
            self.block(d, s);
            // The fast rate comes first in the order of steps; an overflow there is the earlier.
            if let Some(overflowed) = self.fast.stopped() {
                return Err(Box::new(overflowed));
            }
            self.phase += count;
            if self.phase == ratio {
                self.phase = 0;
                self.end_of_period(rows);
                if let Some(overflowed) = self.slow.stopped() {
                    return Err(Box::new(overflowed));
                }
            }
        }
        Ok(())
    }

    fn no_rows(&self) -> Rows {
        S::no_rows()
    }
}
