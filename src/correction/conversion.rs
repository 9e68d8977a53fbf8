//! From the chain's rows to a correction's words: rows are averaged by integer sums, the mean is scaled in integers.
//!
//! A reading is N rows. For each word the block adds N differences from the input's offset (exact), rounds the sum
//! to a unit far below the LSB of what comes out, and multiplies once. The phase is cyclic: the first row of a
//! reading is taken to within half a turn of the offset, every other row to within half a turn of the first one. A
//! reading whose phase crosses the word's ends has the mean that it would have elsewhere.

use super::formats::Formats;
use super::rows::{self, Column, Source};
use super::run::{Calls, Correction};
use crate::design::Design;
use crate::error::Result;
use crate::numeric::arithmetic::{Arithmetic, Block, Port, Ring, StateVisitor};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::fixed::{Fixed, Words};
use crate::numeric::format::{Overflow, Quantizer, Rounding, pow2};
use crate::numeric::trace::Trace;
use crate::numeric::trace::ir::{Interval, Program};
use crate::text::at_most;

/// The emitted function.
pub const CONVERT: &str = "convert";
/// Its state's type.
pub const SUMS: &str = "sums";
/// Bits of the rounded sum below the LSB of what comes out.
const GUARD_BITS: i32 = 5;
/// Bits of the multiplier beyond those of the word that comes out.
const MULTIPLIER_BITS: i32 = 3;
/// What the 53 bits of the constants' own computation may add to the error, LSB.
const COMPUTED_LSB: f64 = 1e-3;

/// A reading's rows to a correction's inputs and rate.
#[derive(Debug, Clone)]
pub struct Conversion {
    /// N.
    rows: u32,
    /// How long N rows are, s.
    reading_s: f64,
    channels: Vec<Channel>,
    period_s: f64,
}

/// One word of a row, averaged and scaled.
#[derive(Debug, Clone)]
struct Channel {
    column: Column,
    /// Of what comes out: that of the correction's input.
    name: &'static str,
    /// Position among the correction's inputs; `None` = its rate.
    input: Option<usize>,
    /// Subtracted from each row, raw.
    offset: i128,
    /// The sum of a reading's rows, with room for the largest.
    sum: Ring,
    /// The sum, rounded and held.
    rounded: Cast,
    /// What `offset` lacks, times N, in the unit of the rounded sum.
    rest: i128,
    /// Factor and its fraction bits.
    multiplier: (i128, i32),
    output: Cast,
    /// Largest distance from the exact mean, LSB of what comes out, where it does not saturate.
    error_lsb: f64,
    meaning: String,
}

/// The sums of a reading.
#[derive(Debug)]
pub struct State<A: Arithmetic> {
    /// Rows so far.
    rows: A::Word,
    /// The phase of the reading's first row.
    first: A::Residue,
    sums: Vec<A::Residue>,
}

// Derived, it would ask the arithmetic to be Clone.
impl<A: Arithmetic> Clone for State<A> {
    fn clone(&self) -> Self {
        State {
            rows: self.rows,
            first: self.first,
            sums: self.sums.clone(),
        }
    }
}

impl Conversion {
    /// For a design's chain and its correction.
    ///
    /// # Errors
    /// A chain that gives no rate; a reading that is no whole number of rows; a correction without an input from the
    /// chain, or with one twice; an input that is finer than the chain's word.
    pub fn new(design: &Design, correction: &Correction) -> Result<Self> {
        let reading = rows::reading(design, &correction.plan)?;
        let chosen = rows::columns(design, &correction.plan)?;
        let mut channels = Vec::new();
        for (column, input) in chosen {
            channels.push(Channel::new(&column, input, reading.rows, correction));
        }
        let casts = channels
            .iter_mut()
            .flat_map(|c| [&mut c.rounded, &mut c.output]);
        for (id, cast) in casts.enumerate() {
            cast.id = id;
        }
        Ok(Conversion {
            rows: reading.rows,
            reading_s: reading.seconds,
            channels,
            period_s: correction.plan.period_s,
        })
    }

    /// Rows of a reading.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// The words of a row that go in, in their order.
    pub fn sources(&self) -> Vec<Source> {
        self.channels.iter().map(|c| c.column.source).collect()
    }

    /// The inputs of the correction that come out, in their order.
    pub fn inputs(&self) -> Vec<usize> {
        self.channels.iter().filter_map(|c| c.input).collect()
    }

    /// The ranges of the function's inputs: restart, words of a row.
    pub fn ranges(&self) -> Vec<Interval> {
        let words = self.channels.iter().map(|c| c.column.range);
        std::iter::once(Interval::new(0, 1)).chain(words).collect()
    }

    /// Largest distance from the exact mean, scaled, where nothing saturates: LSB of each word that comes out.
    pub fn error_lsb(&self) -> Vec<f64> {
        self.channels.iter().map(|c| c.error_lsb).collect()
    }

    /// What the head of the sources says.
    pub fn facts(&self) -> Vec<String> {
        let mut facts = vec![
            format!(
                "from the chain's rows to the correction's words: one call a row; complete = 1 after every {} rows, which are {:?} s (a reading has {:?} s)",
                self.rows, self.reading_s, self.period_s
            ),
            "what comes out is a reading's where complete = 1; before that it is the sum so far".to_owned(),
            "restart = 1 begins a reading with this row: at power-on, and after rows that are missing".to_owned(),
        ];
        facts.extend(self.channels.iter().map(|c| {
            format!(
                "{} = the mean of {}: {}; at most {} LSB from the exact mean",
                c.name,
                c.column.source.name(),
                c.meaning,
                at_most(c.error_lsb, 3)
            )
        }));
        if self.channels.iter().any(|c| c.column.turn.is_some()) {
            facts.push(
                "the first phase of a reading is taken within half a turn of the offset, every other one within half a turn of the first"
                    .to_owned(),
            );
        }
        facts
    }

    /// Zeros, before the first row.
    pub fn state<A: Arithmetic>(&self) -> State<A>
    where
        A::Word: Default,
        A::Residue: Default,
    {
        State {
            rows: A::Word::default(),
            first: A::Residue::default(),
            sums: vec![A::Residue::default(); self.channels.len()],
        }
    }

    /// One row: whether the reading is complete, then the words of the correction.
    #[inline(always)]
    fn run<A: Arithmetic>(
        &self,
        ar: &A,
        state: &mut State<A>,
        restart: A::Word,
        row: &[A::Word],
    ) -> Vec<A::Word> {
        let [zero, one] = [0, 1].map(|raw| ar.constant(raw, 0));
        let all = ar.constant(i128::from(self.rows), 0);
        let anew = ar.is_negative(ar.sub(zero, restart));
        let before = ar.named(ar.select(anew, zero, state.rows), "before");
        let is_first = ar.is_negative(ar.sub(before, one));
        let rows = ar.named(ar.add(before, one), "rows");
        let is_open = ar.is_negative(ar.sub(rows, all));
        let kept = ar.select(is_open, rows, zero);
        // Where the reading is open there are fewer than N rows.
        state.rows = ar.within(kept, 0, i128::from(self.rows) - 1);
        let mut words = vec![ar.select(is_open, zero, one)];
        let channels = self.channels.iter().zip(&mut state.sums);
        for ((channel, sum), word) in channels.zip(row) {
            let difference = match &channel.column.turn {
                Some(turn) => {
                    let first = ar.select(is_first, *word, ar.centered(state.first, turn));
                    state.first = ar.residue(first, turn);
                    let offset = ar.residue_constant(channel.offset, turn);
                    let from_offset = ar.centered(ar.residue_sub(state.first, offset, turn), turn);
                    let row = ar.residue(*word, turn);
                    let from_first = ar.centered(ar.residue_sub(row, state.first, turn), turn);
                    ar.add(from_offset, from_first)
                }
                None if channel.offset == 0 => *word,
                None => ar.sub(*word, ar.constant(channel.offset, 0)),
            };
            let difference = ar.named(difference, "difference");
            let so_far = ar.select(is_first, zero, ar.centered(*sum, &channel.sum));
            let total = ar.named(ar.add(so_far, difference), "total");
            *sum = ar.residue(total, &channel.sum);
            words.push(channel.scaled(ar, total));
        }
        words
    }

    /// The block as a program of integer operations.
    pub fn trace(&self) -> Program {
        let trace = Trace::new();
        match self.channels.len() {
            2 => record::<3>(self, &trace),
            3 => record::<4>(self, &trace),
            _ => record::<5>(self, &trace),
        }
        trace.finish()
    }

    /// The bit-accurate model, row by row from the state before the first one.
    pub fn stepper(&self) -> Stepper<'_> {
        Stepper {
            conversion: self,
            ar: Fixed::new(),
            state: self.state(),
        }
    }
}

impl Channel {
    fn new(column: &Column, input: Option<usize>, rows: u32, correction: &Correction) -> Self {
        let Formats { inputs, rate, .. } = &correction.formats;
        let chosen = input.and_then(|k| correction.plan.inputs.get(k).zip(inputs.get(k)));
        let (offset, scale, format) = chosen.map_or((0.0, 1.0, *rate), |(input, format)| {
            (input.offset, input.scale, *format)
        });
        let n = f64::from(rows);
        let exact = offset / column.lsb;
        let offset = exact.round();
        let reach = match column.turn {
            Some(turn) => 1i128 << turn.bits,
            None => {
                let end = |word: i128| (word - offset as i128).abs();
                end(column.range.low).max(end(column.range.high))
            }
        };
        let sum_bits = bits_of(reach.saturating_mul(i128::from(rows))) + 1;
        // Of the value that comes out in a unit of the sum.
        let factor = column.lsb / (scale * n);
        let (width, fraction_bits) = (format.bits() as i32, format.fraction_bits as i32);
        let in_lsb = factor.abs() * pow2(fraction_bits);
        // One unit of the rounded sum is 2^unit of the sum, and 2^-6 to 2^-5 of an LSB.
        let unit = (-f64::from(GUARD_BITS) - in_lsb.log2()).floor() as i32;
        let held = Target::signed((width + GUARD_BITS + 2) as u32, -unit);
        let rounded = Cast::new(
            Label::of("correction.inputs"),
            0,
            0,
            held,
            Rounding::HalfUp,
            Some(Overflow::Saturate),
        );
        let rest_exact = n * (offset - exact) * pow2(-unit);
        let q = width + MULTIPLIER_BITS + GUARD_BITS + unit + fraction_bits;
        let multiplier = (factor * pow2(q)).round();
        let output = Cast::to(
            Label::of("correction.inputs"),
            q - unit,
            0,
            Quantizer::default_of(format),
        );
        let unit_lsb = in_lsb * pow2(unit);
        let is_rounded = f64::from(u8::from(unit > 0));
        let of_rest = (rest_exact - rest_exact.round()).abs();
        let of_multiplier = (multiplier / (factor * pow2(q)) - 1.0).abs() * pow2(width - 1);
        let scaling = chosen.map_or("deg/s".to_owned(), |(input, _)| input.formula());
        let names = correction.plan.input_names();
        let name = input.and_then(|k| names.get(k).copied());
        Channel {
            name: name.unwrap_or("rate"),
            input,
            offset: offset as i128,
            sum: Ring::cyclic(sum_bits, 0),
            rounded,
            rest: rest_exact.round() as i128,
            multiplier: (multiplier as i128, q),
            output,
            error_lsb: 0.5 + unit_lsb * (0.5 * is_rounded + of_rest) + of_multiplier + COMPUTED_LSB,
            meaning: format!("{scaling}, {format}, saturated; {}", column.unit()),
            column: column.clone(),
        }
    }

    /// The sum of N rows as a word of the correction.
    #[inline(always)]
    fn scaled<A: Arithmetic>(&self, ar: &A, total: A::Word) -> A::Word {
        let rounded = ar.cast(total, &self.rounded, &[total]);
        let (raw, fraction_bits) = self.multiplier;
        let whole = match self.rest {
            0 => rounded,
            rest => ar.add(
                rounded,
                ar.constant(rest, self.rounded.target.fraction_bits),
            ),
        };
        let product = ar.mul(whole, ar.constant(raw, fraction_bits));
        ar.cast(product, &self.output, &[product])
    }
}

/// Bits of a magnitude.
fn bits_of(magnitude: i128) -> u32 {
    128 - magnitude.leading_zeros()
}

impl<A: Arithmetic, const N: usize> Block<A, N, N> for Conversion {
    type State = State<A>;
    const NAME: &'static str = CONVERT;
    const PURPOSE: &'static str = "Takes a row of the chain into a reading's means; with its last row, the words of the correction.";
    const STATE: &'static str = SUMS;

    fn inputs(&self) -> [Port; N] {
        std::array::from_fn(|k| match k.checked_sub(1).map(|k| self.channels.get(k)) {
            Some(Some(c)) => Port::new(c.column.source.name(), c.column.unit()),
            _ => Port::new("restart", "1 = the first row of a reading, else 0"),
        })
    }

    fn outputs(&self) -> [Port; N] {
        std::array::from_fn(|k| match k.checked_sub(1).map(|k| self.channels.get(k)) {
            Some(Some(c)) => Port::new(c.name, c.meaning.clone()),
            _ => Port::new(
                "complete",
                "1 = the words beside it are a reading's, else 0",
            ),
        })
    }

    #[inline(always)]
    fn step(&self, ar: &A, state: &mut State<A>, words: [A::Word; N]) -> [A::Word; N] {
        let given = match words.as_slice() {
            [restart, row @ ..] => self.run(ar, state, *restart, row),
            [] => Vec::new(),
        };
        std::array::from_fn(|k| given.get(k).copied().unwrap_or_else(|| ar.constant(0, 0)))
    }

    fn visit(&self, state: &mut State<A>, visitor: &mut dyn StateVisitor<A>) {
        visitor.word("rows", &mut state.rows, 0, i128::from(self.rows) - 1);
        for (channel, sum) in self.channels.iter().zip(&mut state.sums) {
            if let Some(turn) = &channel.column.turn {
                let first = std::slice::from_mut(&mut state.first);
                visitor.residues("first_phase", first, turn);
            }
            let name = channel.column.source.sum();
            visitor.residues(name, std::slice::from_mut(sum), &channel.sum);
        }
    }
}

/// The bit-accurate model of a conversion with its state.
#[derive(Debug)]
pub struct Stepper<'a> {
    conversion: &'a Conversion,
    ar: Fixed<i128, i128>,
    state: State<Fixed<i128, i128>>,
}

impl Calls for Stepper<'_> {
    fn call(&mut self, words: &[i128], outputs: &mut Vec<i128>) {
        if let [restart, row @ ..] = words {
            let given = self
                .conversion
                .run(&self.ar, &mut self.state, *restart, row);
            outputs.extend(given);
        }
    }

    fn state(&mut self) -> Vec<i128> {
        let mut words = Words::default();
        Block::<_, 3, 3>::visit(self.conversion, &mut self.state, &mut words);
        words.0
    }
}

fn record<const N: usize>(conversion: &Conversion, trace: &Trace) {
    if let Ok(ranges) = conversion.ranges().try_into() {
        let state: <Conversion as Block<Trace, N, N>>::State = conversion.state::<Trace>();
        trace.record::<N, N, Conversion>(conversion, &state, ranges);
    }
}

#[cfg(test)]
#[path = "conversion_tests.rs"]
mod tests;
