//! How far a form is from its function: over every code by running it, and over the real domain by proof.
//!
//! The proof, piece by piece (a piece is an interval of codes on which the form's data stand for one
//! polynomial p): sup |f - p| over the piece's real interval, by a rigorous method, plus the greatest |result - p|
//! over the piece's codes. Where p leaves the output's range it is limited to it, as the result is: that moves p towards f, or f is outside the
//! range by no less than the distance. The latter is evaluation and output rounding together; where every code is run, it is known exactly
//! (integers), else it is bounded by analysis. The sum is taken on each piece and not globally.

use super::polynomial::split;
use super::{Form, Piece, Settled, run_in};
use crate::error::{Error, Result};
use crate::numeric::cast::HasKernel;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Codes that are run where there are too many to run all, if nothing else is wanted.
pub const SAMPLE: u128 = 1 << 20;

/// Pieces are divided so that there are about so many at least: a sum of maxima is the tighter the shorter the piece.
const PARTS: i128 = 128;

/// The function that a form stands for, with proved enclosures.
pub trait Reference: Sync {
    /// f(x) and a certified radius, the rounding of the value included.
    fn at(&self, x: f64) -> (f64, f64);
    /// Certified sup |f - p| over `low ..= high`, p the piece's polynomial.
    fn supremum(&self, piece: &Piece, low: f64, high: f64) -> f64;
    /// A certified enclosure of f's range.
    fn range(&self, low: f64, high: f64) -> (f64, f64);
    /// The domain.
    fn domain(&self) -> (f64, f64);
}

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Proved over the real domain.
    pub certified: f64,
    /// Of the data alone: sup |f - p|, proved.
    pub data_only: f64,
    /// Greatest |result - p| on any piece: evaluation and output rounding.
    pub rounding: f64,
    /// Greatest error over the codes that were run; certified from above.
    pub observed: f64,
    /// The first code with it.
    pub at_input_raw: i128,
    /// Codes that were run.
    pub inputs_checked: u64,
    /// They were all.
    pub exhaustive: bool,
}

/// How much is run, and who is told.
pub struct Effort<'a> {
    /// All codes are run if there are at most so many.
    pub most_codes: u128,
    /// About so many are run if there are more.
    pub sample: u128,
    /// Threads.
    pub threads: usize,
    /// Told of codes that have been run.
    pub progress: &'a (dyn Fn(u64) + Sync),
}

/// The result for one piece.
#[derive(Debug, Clone, Copy)]
struct OfPiece {
    data: f64,
    /// sup |f - p limited to the output's range|.
    distance: f64,
    /// Greatest |y - p| where p is inside the output's range.
    rounding: f64,
    /// Greatest |y - p limited| where p is outside, if it is anywhere.
    limited: Option<f64>,
    observed: f64,
    at: i128,
    checked: u64,
}

/// Runs the form and proves its bound.
///
/// # Errors
/// A result outside the proved bound: an error of this program.
pub fn measure(settled: &Settled, reference: &dyn Reference, effort: &Effort) -> Result<Measured> {
    let codes = settled.form.codes();
    let pieces = divided(settled.form.pieces(), codes.count() as i128 / PARTS);
    let exhaustive = codes.count() <= effort.most_codes;
    let stride = match exhaustive {
        true => 1,
        false => (codes.count() / effort.sample.max(1)).max(1) as i128,
    };
    let (a, b) = reference.domain();
    let (least, greatest) = reference.range(a, b);
    let (bottom, top) = limits(&settled.form);
    let may_exceed = least < bottom || greatest > top;
    let results = Mutex::new(vec![None; pieces.len()]);
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..effort.threads.clamp(1, pieces.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some(piece) = pieces.get(k) else { break };
                    let end = ends(&pieces, k, &settled.form, reference);
                    let result = of_piece(
                        settled, reference, piece, end, exhaustive, stride, may_exceed,
                    );
                    (effort.progress)(result.checked);
                    if let Ok(mut results) = results.lock() {
                        results[k] = Some(result);
                    }
                }
            });
        }
    });
    let results = results.into_inner().unwrap_or_default();
    let mut all = Measured {
        certified: 0.0,
        data_only: 0.0,
        rounding: 0.0,
        observed: 0.0,
        at_input_raw: codes.low,
        inputs_checked: 0,
        exhaustive,
    };
    for result in results.into_iter().flatten() {
        let limited = result
            .limited
            .map_or(0.0, |rounding| result.distance + rounding);
        all.certified = all
            .certified
            .max(result.data + result.rounding)
            .max(limited);
        all.data_only = all.data_only.max(result.data);
        all.rounding = all
            .rounding
            .max(result.rounding)
            .max(result.limited.unwrap_or(0.0));
        if result.observed > all.observed {
            (all.observed, all.at_input_raw) = (result.observed, result.at);
        }
        all.inputs_checked += result.checked;
    }
    checked(all, settled, reference)
}

/// sup |f - p| of a form's data alone, proved.
pub(crate) fn data_only(form: &Form, reference: &dyn Reference) -> f64 {
    let pieces = form.pieces();
    let of = |(k, piece): (usize, &Piece)| {
        let (low, high) = ends(&pieces, k, form, reference);
        reference.supremum(piece, low, high)
    };
    pieces.iter().enumerate().map(of).fold(0.0, f64::max)
}

/// The same pieces, none of much more than so many codes.
fn divided(pieces: Vec<Piece>, most: i128) -> Vec<Piece> {
    let parts = |piece: Piece| {
        let count = (piece.high - piece.low + 1) / most.max(1);
        split(piece.low, piece.high, count.max(1)).map(move |(low, high)| Piece {
            low,
            high,
            ..piece.clone()
        })
    };
    pieces.into_iter().flat_map(parts).collect()
}

/// Nothing that was observed lies outside what was proved.
fn checked(mut all: Measured, settled: &Settled, reference: &dyn Reference) -> Result<Measured> {
    let x = settled.form.codes().real(all.at_input_raw);
    let (value, radius) = reference.at(x);
    let result = settled.run(all.at_input_raw) as f64 * settled.form.output().lsb();
    if (result - value).abs() - radius > all.certified * (1.0 + 1e-9) {
        return Err(Error::Check(format!(
            "internal: at input {} the error {:e} exceeds the proved bound {:e}; please report this",
            all.at_input_raw,
            (result - value).abs(),
            all.certified
        )));
    }
    // Both are proved bounds of what was observed.
    all.observed = all.observed.min(all.certified);
    Ok(all)
}

/// The real interval of piece k.
fn ends(pieces: &[Piece], k: usize, form: &Form, reference: &dyn Reference) -> (f64, f64) {
    let codes = form.codes();
    let piece = &pieces[k];
    let (a, b) = reference.domain();
    let (low, high) = (codes.real(piece.low), codes.real(piece.high));
    if !matches!(form, Form::Polynomial(_)) {
        return (low.max(a), high.min(b));
    }
    // A polynomial goes on between the codes and up to the domain's ends.
    let low = if k == 0 { a } else { low };
    let high = if k + 1 == pieces.len() {
        b
    } else {
        codes.real(piece.high + 1)
    };
    (low, high)
}

/// The output's least and greatest value.
fn limits(form: &Form) -> (f64, f64) {
    let output = form.output();
    let value = |raw| raw as f64 * output.lsb();
    (value(output.min_raw()), value(output.max_raw()))
}

fn of_piece(
    settled: &Settled,
    reference: &dyn Reference,
    piece: &Piece,
    (low, high): (f64, f64),
    exhaustive: bool,
    stride: i128,
    may_exceed: bool,
) -> OfPiece {
    let data = reference.supremum(piece, low, high);
    let mut result = if settled.bits <= 64 {
        run_piece::<i64>(&settled.form, reference, piece, stride)
    } else {
        run_piece::<i128>(&settled.form, reference, piece, stride)
    };
    result.data = data;
    result.distance = data;
    if may_exceed {
        // What the output's limits cannot reach.
        let (bottom, top) = limits(&settled.form);
        let (least, greatest) = reference.range(low, high);
        result.distance = data.max(greatest - top).max(bottom - least);
    }
    if !exhaustive {
        result.rounding = piece.evaluation_bound + 0.5 * settled.form.output().lsb();
        result.limited = Some(result.rounding);
    }
    result
}

fn run_piece<L: HasKernel>(
    form: &Form,
    reference: &dyn Reference,
    piece: &Piece,
    stride: i128,
) -> OfPiece {
    let codes = form.codes();
    let lsb = form.output().lsb();
    let (bottom, top) = limits(form);
    let mut result = OfPiece {
        data: 0.0,
        distance: 0.0,
        rounding: 0.0,
        limited: None,
        observed: -1.0,
        at: piece.low,
        checked: 0,
    };
    let input_lsb = codes.format.lsb();
    let polynomial = piece.in_doubles();
    // Codes have at most 48 bits.
    let (mut code, last, stride) = (piece.low as i64, piece.high as i64, stride as i64);
    while code <= last {
        let x = code as f64 * input_lsb;
        let y = run_in::<L>(form, L::low(i128::from(code))).real() * lsb;
        let (value, radius) = reference.at(x);
        let error = (y - value).abs() + radius;
        if error > result.observed {
            (result.observed, result.at) = (error, i128::from(code));
        }
        let (ideal, slack) = polynomial.value(x);
        let difference = (y - ideal.clamp(bottom, top)).abs() + slack;
        if bottom <= ideal && ideal <= top {
            result.rounding = result.rounding.max(difference);
        } else {
            result.limited = Some(result.limited.unwrap_or(0.0).max(difference));
        }
        result.checked += 1;
        // The last code is always run.
        code = if code < last {
            (code + stride).min(last)
        } else {
            code + 1
        };
    }
    result
}

/// The threads of this machine.
pub fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
