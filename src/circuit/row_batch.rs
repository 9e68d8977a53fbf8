//! The slow rate over several rows at once, where no loop is closed and no cast can stop the run: the
//! rows do not wait for one another, so the blocks run on eight of them side by side, the combs on the four channels.
//!
//! In stages, so that designs that are alike up to one share it: combs, CORDIC, then compensation and the row.

use super::block_kernel::Instructions;
use super::chain::{Chain, Front, compensated};
use super::compensation::{Bias, Rate};
use super::cordic::Vectoring;
use super::decimator::{Cic, CicState, Decimate};
use super::in_range::InRange;
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::batch::Batch;
use crate::numeric::cast::Cast;
use pulp::NullaryFnOnce;

/// Rows side by side.
pub const WIDTH: usize = 8;

/// One word of each row.
type Words = [i64; WIDTH];

/// The decimated channels of some rows.
#[derive(Debug, Clone, Copy)]
pub struct Decimated {
    channels: [Words; 4],
    /// How many of the rows there are.
    count: usize,
}

/// Phase and magnitude of the drive in those rows.
pub type Polar = [Words; 2];

/// The stages of the slow rate by themselves.
pub trait Stages {
    /// The combs and the decimator's output: appends the channels of the rows of these sums. The only stage that
    /// remembers what was before.
    fn decimate(&mut self, sums: &[Front], to: &mut Vec<Decimated>);
    /// The CORDIC: appends phase and magnitude.
    fn rotate(&self, decimated: &[Decimated], to: &mut Vec<Polar>);
    /// The compensation: appends the rows, in the contract's columns.
    fn put(&self, decimated: &[Decimated], polar: &[Polar], rows: &mut Vec<i64>);
}

/// The slow rate of a chain, with sums that wait for their rows.
#[derive(Debug, Clone)]
pub struct RowBatch<const N: usize> {
    instructions: Instructions,
    cic: Cic<N>,
    combs: Combs<N>,
    tail: Tail,
    sums: [Front; WIDTH],
    count: usize,
}

/// What the combs of the four channels remember, side by side.
type Combs<const N: usize> = CicState<[i64; 4], N>;

/// What comes after the decimator.
#[derive(Debug, Clone)]
struct Tail {
    cordic: Vectoring,
    compensation: Option<(Bias, Rate)>,
    in_range: Option<InRange>,
}

impl<const N: usize> RowBatch<N> {
    /// For a chain whose words at the decimated rate fit into 64 bits; `None` where a row needs the
    /// one before, or where a cast may stop the run.
    pub fn new(chain: &mut Chain<N>, instructions: Instructions) -> Option<Self> {
        let applies = instructions != Instructions::Plain && chain.is_row_by_row_free();
        let [first, others @ ..] = &chain.cics;
        let alike = |output: &Cast| {
            output.does_as(&first.output) && output.is_proved() == first.output.is_proved()
        };
        let applies = applies && others.iter().all(|cic| alike(&cic.output));
        applies.then(|| RowBatch {
            instructions,
            cic: first.clone(),
            combs: first.start(&Batch::<4>),
            tail: Tail {
                cordic: chain.cordic.clone(),
                compensation: chain.compensation.clone(),
                in_range: chain.in_range.clone(),
            },
            sums: [[0; 4]; WIDTH],
            count: 0,
        })
    }

    /// Takes the sums of one row. Appends the rows that wait once they are many.
    pub fn push(&mut self, sums: Front, rows: &mut Vec<i64>) {
        if let Some(to) = self.sums.get_mut(self.count) {
            *to = sums;
        }
        self.count += 1;
        if self.count >= WIDTH {
            self.put_waiting(rows);
        }
    }

    /// Appends the rows that wait.
    pub fn put_waiting(&mut self, rows: &mut Vec<i64>) {
        if self.count > 0 {
            let sums = self.sums.get(..self.count).unwrap_or(&self.sums);
            let (cic, combs) = (&self.cic, &mut self.combs);
            let decimated = within(self.instructions, Combing { cic, combs, sums });
            within(self.instructions, Whole(&self.tail, &decimated, rows));
            self.count = 0;
        }
    }
}

impl<const N: usize> Stages for RowBatch<N> {
    fn decimate(&mut self, sums: &[Front], to: &mut Vec<Decimated>) {
        for sums in sums.chunks(WIDTH) {
            let (cic, combs) = (&self.cic, &mut self.combs);
            to.push(within(self.instructions, Combing { cic, combs, sums }));
        }
    }

    fn rotate(&self, decimated: &[Decimated], to: &mut Vec<Polar>) {
        within(self.instructions, Rotating(&self.tail, decimated, to));
    }

    fn put(&self, decimated: &[Decimated], polar: &[Polar], rows: &mut Vec<i64>) {
        let putting = Putting(&self.tail, decimated, polar, rows);
        within(self.instructions, putting);
    }
}

impl Tail {
    #[inline(always)]
    fn polar(&self, decimated: &Decimated) -> Polar {
        let [drive_i, drive_q, ..] = decimated.channels;
        Batch::<WIDTH>.call(&self.cordic, "", &mut (), [drive_i, drive_q])
    }

    #[inline(always)]
    fn rows(&self, decimated: &Decimated, [phase, magnitude]: &Polar, rows: &mut Vec<i64>) {
        let [drive_i, drive_q, sense_i, sense_q] = &decimated.channels;
        let blocks = (self.compensation.as_ref(), self.in_range.as_ref());
        let (compensation, in_range) = compensated(&Batch::<WIDTH>, blocks, *sense_i, [*phase]);
        let count = decimated.count;
        let rate = compensation.as_ref().map(|[_, rate]| rate);
        let [a, b, c, d, e, f] = [drive_i, drive_q, sense_i, sense_q, phase, magnitude];
        match (rate, &in_range) {
            (Some(rate), Some(inside)) => put([a, b, c, d, e, f, rate, inside], count, rows),
            (Some(rate), None) => put([a, b, c, d, e, f, rate], count, rows),
            _ => put([a, b, c, d, e, f], count, rows),
        }
    }
}

/// Appends the first `count` rows of these columns.
#[inline(always)]
fn put<const C: usize>(columns: [&Words; C], count: usize, rows: &mut Vec<i64>) {
    let mut all = [[0; C]; WIDTH];
    for (k, row) in all.iter_mut().enumerate() {
        for (to, column) in row.iter_mut().zip(columns) {
            *to = column[k];
        }
    }
    rows.extend_from_slice(all[..count.min(WIDTH)].as_flattened());
}

/// Calls an object inside a function that is compiled for these instructions: closures would not be inlined into it.
fn within<C: NullaryFnOnce>(instructions: Instructions, called: C) -> C::Output {
    #[cfg(target_arch = "x86_64")]
    if instructions == Instructions::Avx512
        && let Some(simd) = pulp::x86::V4::try_new()
    {
        return simd.vectorize(called);
    }
    #[cfg(target_arch = "x86_64")]
    if instructions == Instructions::Avx2
        && let Some(simd) = pulp::x86::V3::try_new()
    {
        return simd.vectorize(called);
    }
    called.call()
}

/// The combs over the sums of at most [`WIDTH`] rows.
struct Combing<'a, const N: usize> {
    cic: &'a Cic<N>,
    combs: &'a mut Combs<N>,
    sums: &'a [Front],
}

impl<const N: usize> NullaryFnOnce for Combing<'_, N> {
    type Output = Decimated;

    #[inline(always)]
    fn call(self) -> Decimated {
        // A copy that does not escape lives in registers.
        let mut combs = *self.combs;
        let mut channels = [[0; WIDTH]; 4];
        for (k, sums) in self.sums.iter().enumerate().take(WIDTH) {
            combs.integrators[N - 1] = sums.map(|word| word as i64);
            let [words] = Batch::<4>.call(&Decimate(self.cic), "", &mut combs, []);
            for c in 0..4 {
                channels[c][k] = words[c];
            }
        }
        *self.combs = combs;
        let count = self.sums.len().min(WIDTH);
        Decimated { channels, count }
    }
}

/// Both later stages of some rows.
struct Whole<'a>(&'a Tail, &'a Decimated, &'a mut Vec<i64>);

impl NullaryFnOnce for Whole<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Whole(tail, decimated, rows) = self;
        tail.rows(decimated, &tail.polar(decimated), rows);
    }
}

/// [`Stages::rotate`].
struct Rotating<'a>(&'a Tail, &'a [Decimated], &'a mut Vec<Polar>);

impl NullaryFnOnce for Rotating<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Rotating(tail, decimated, to) = self;
        for rows in decimated {
            to.push(tail.polar(rows));
        }
    }
}

/// [`Stages::put`].
struct Putting<'a>(&'a Tail, &'a [Decimated], &'a [Polar], &'a mut Vec<i64>);

impl NullaryFnOnce for Putting<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Putting(tail, decimated, polar, rows) = self;
        for (decimated, polar) in decimated.iter().zip(polar) {
            tail.rows(decimated, polar, rows);
        }
    }
}
