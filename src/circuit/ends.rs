//! How an arithmetic meets the outside of a chain: codes in, columns out, overflows.

use super::block_kernel::BlockKernel;
use super::chain::{Chain, FastState, Row};
use super::engine::Rows;
use super::float_kernel::FloatKernel;
use crate::design::Design;
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::{HasKernel, form};
use crate::numeric::fixed::{Fixed, Overflowed};
use crate::numeric::float::Float;
use crate::numeric::format::pow2;
use crate::numeric::lane::Lane;
use crate::numeric::trace::ir::Interval;
use std::any::Any;

/// What turns a float row into the contract's units.
#[derive(Debug, Clone, Copy)]
pub(super) struct FloatScale {
    sample_rate_hz: f64,
    gain_lsb: f64,
}

impl FloatScale {
    pub(super) fn new(design: &Design) -> Self {
        let loop_bits = design.circuit.amplitude_loop.as_ref().map(|l| l.gain_bits);
        FloatScale {
            sample_rate_hz: design.circuit.sample_rate_hz,
            gain_lsb: pow2(1 - loop_bits.unwrap_or(1) as i32),
        }
    }
}

/// The codes that an ideal ADC makes of inputs in LSB: the nearest ones, ties up, saturating.
pub(super) fn quantised(inputs_lsb: &[f64], range: Interval) -> Vec<i32> {
    let [low, high] = [range.low as f64, range.high as f64];
    // Of at most 32 bits: the sum with a half is exact.
    let code = |lsb: &f64| (lsb.max(low).min(high) + 0.5).floor().min(high) as i32;
    inputs_lsb.iter().map(code).collect()
}

/// How an arithmetic meets the outside: codes in, columns out, overflows.
pub(super) trait Ends: Arithmetic {
    fn code(&self, code: i32, fraction_bits: i32) -> Self::Word;
    /// A phase or step of a ring of `bits` in 2^-64 turn.
    fn turns(residue: Self::Residue, bits: u32) -> u64;
    /// A residue as [`super::engine::Front`] holds it.
    fn wide(residue: Self::Residue) -> i128;
    /// The residue that it is of.
    fn narrow(word: i128) -> Self::Residue;
    /// A drive gain, 0 to 1.
    fn gain(word: Self::Word, scale: &FloatScale) -> f64;
    /// Runs the samples that a kernel left nothing over of.
    fn run_kernel<const N: usize>(
        _kernel: &mut BlockKernel<N>,
        _state: &mut FastState<Self::Residue, N>,
        _codes: [&[i32]; 2],
    ) {
    }
    /// Runs inputs of one period, LSB, without quantisation.
    fn run_inputs<const N: usize>(
        _kernel: &mut FloatKernel<N>,
        _chain: &Chain<N>,
        _state: &mut FastState<Self::Residue, N>,
        _inputs: [&[f64]; 2],
    ) {
    }
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

impl<W: HasKernel, R: Lane, const FORM: u8> Ends for Fixed<W, R, FORM> {
    #[inline(always)]
    fn code(&self, code: i32, _fraction_bits: i32) -> W {
        W::from_i32(code)
    }
    fn turns(residue: R, bits: u32) -> u64 {
        (residue.wide() as u64) << (64 - bits)
    }
    #[inline(always)]
    fn wide(residue: R) -> i128 {
        residue.wide()
    }
    #[inline(always)]
    fn narrow(word: i128) -> R {
        R::low(word)
    }
    fn gain(word: W, scale: &FloatScale) -> f64 {
        word.wide() as f64 * scale.gain_lsb
    }
    fn run_kernel<const N: usize>(
        kernel: &mut BlockKernel<N>,
        state: &mut FastState<R, N>,
        [drive, sense]: [&[i32]; 2],
    ) {
        // A kernel is for residues in 64 bits, and is compiled for these alone.
        let state: &mut dyn Any = state;
        if let Some(state) = state.downcast_mut::<FastState<i64, N>>() {
            kernel.run(state, drive, sense);
        }
    }
    #[inline(always)]
    fn at(&self, sample: u64) {
        // No other cast reports anything.
        if FORM == form::ANY {
            self.at_sample(sample);
        }
    }
    fn stopped(&self) -> Option<Overflowed> {
        self.overflowed()
    }
    fn no_rows() -> Rows {
        if W::BITS <= 64 {
            Rows::Integer(Vec::new())
        } else {
            Rows::Wide(Vec::new())
        }
    }
    fn put(row: &Row<W>, tuning: Option<R>, phase_bits: u32, _scale: &FloatScale, rows: &mut Rows) {
        let tuning = tuning.map(|t| t.wide() & ((1 << phase_bits) - 1));
        match rows {
            Rows::Integer(rows) if W::BITS <= 64 => append(row, tuning, rows, |word| word as i64),
            Rows::Wide(rows) => append(row, tuning, rows, |word| word),
            _ => {}
        }
    }
}

/// Appends a row of raw words.
#[inline(always)]
fn append<W: Lane, T>(
    row: &Row<W>,
    tuning: Option<i128>,
    rows: &mut Vec<T>,
    of: impl Fn(i128) -> T,
) {
    let word = |w: W| of(w.wide());
    rows.extend(row.channels.map(word));
    rows.extend([row.phase, row.magnitude].map(word));
    rows.extend(row.compensation.map(|[_, rate]| word(rate)));
    rows.extend(tuning.map(&of));
    rows.extend(row.gain.map(word));
    rows.extend(row.in_range.map(word));
}

impl Ends for Float {
    fn code(&self, code: i32, fraction_bits: i32) -> f64 {
        f64::from(code) * pow2(-fraction_bits)
    }
    fn run_inputs<const N: usize>(
        kernel: &mut FloatKernel<N>,
        chain: &Chain<N>,
        state: &mut FastState<i128, N>,
        [drive, sense]: [&[f64]; 2],
    ) {
        if kernel.samples() == drive.len() {
            kernel.run(chain, state, [drive, sense]);
            return;
        }
        let lsb = pow2(-chain.code_fraction_bits);
        // A copy that does not escape lives in registers.
        let mut local = *state;
        for (d, s) in drive.iter().zip(sense) {
            chain.sample(&Float, &mut local, [d * lsb, s * lsb]);
        }
        *state = local;
    }
    fn turns(residue: i128, _bits: u32) -> u64 {
        // One turn is the whole 128-bit circle.
        (residue >> 64) as u64
    }
    fn wide(residue: i128) -> i128 {
        residue
    }
    fn narrow(word: i128) -> i128 {
        word
    }
    fn gain(word: f64, scale: &FloatScale) -> f64 {
        word * scale.gain_lsb
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
        rows.extend(row.in_range);
    }
}
