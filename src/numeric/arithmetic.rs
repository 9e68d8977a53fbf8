//! The interface that every block of the circuit is written over, once (law 1 of the design).
//!
//! A word *is* a real number. What is stored is the arithmetic's affair: [`super::fixed::Fixed`]
//! holds its raw integer, [`super::float::Float`] an `f64`, [`super::trace::Trace`] a node of the
//! program that is later printed as C and Rust. The primitives are those that the blocks need and
//! no more; each says what an arithmetic without quantisation makes of it.

use super::cast::Cast;
use super::format::pow2;

/// A ring of integers modulo 2^bits: NCO phase and CIC accumulators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ring {
    /// Width in bits, 1..=127.
    pub bits: u32,
    /// One step is 2^-fraction_bits in the unit of the words that go in and out.
    pub fraction_bits: i32,
    /// Half the circle is 2^reach in that unit for an arithmetic without quantisation, which
    /// needs room for what a cast would have wrapped or saturated.
    pub reach: i32,
}

impl Ring {
    /// A ring whose circle has a meaning of its own, such as a turn.
    pub const fn cyclic(bits: u32, fraction_bits: i32) -> Self {
        Ring {
            bits,
            fraction_bits,
            reach: bits as i32 - 1 - fraction_bits,
        }
    }
}

/// A table of one turn of a sine, addressed by the top bits of a phase.
#[derive(Debug, Clone)]
pub struct SineTable {
    /// Raw entries, 2^address_bits of them.
    pub entries: std::sync::Arc<[i64]>,
    /// a: the top bits of the phase that address the table.
    pub address_bits: u32,
    /// Width of the phase.
    pub phase_bits: u32,
    /// Half an address step is added before truncating.
    pub half_step: bool,
    /// Fraction bits of an entry.
    pub fraction_bits: u32,
    /// The value of the sine's peak, for an arithmetic that computes it exactly.
    pub amplitude: f64,
}

/// Constants chosen by a loop's index.
#[derive(Debug, Clone)]
pub struct IndexTable {
    /// The name in emitted code.
    pub name: &'static str,
    /// Raw entries, one for each iteration.
    pub entries: std::sync::Arc<[i64]>,
    /// Fraction bits of an entry.
    pub fraction_bits: u32,
}

/// A table of a function, addressed by a word.
#[derive(Debug, Clone)]
pub struct Table {
    /// The name in emitted code.
    pub name: &'static str,
    /// What it holds, for emitted code.
    pub note: String,
    /// Raw entries.
    pub entries: std::sync::Arc<[i64]>,
    /// Fraction bits of an entry.
    pub fraction_bits: i32,
}

/// One arithmetic. Methods take `&self` (an arithmetic that records uses interior mutability), so
/// that expressions nest.
pub trait Arithmetic: Sized {
    /// A real number.
    type Word: Copy;
    /// An element of a [`Ring`].
    type Residue: Copy;
    /// The result of a test.
    type Truth: Copy;
    /// A loop's index.
    type Index: Copy;
    /// A bound on the length of a vector that is being rotated.
    type Radius: Copy;

    /// `raw * 2^-fraction_bits`.
    fn constant(&self, raw: i128, fraction_bits: i32) -> Self::Word;
    /// Exact sum of two words with equal fraction bits.
    fn add(&self, a: Self::Word, b: Self::Word) -> Self::Word;
    /// Exact difference of two words with equal fraction bits.
    fn sub(&self, a: Self::Word, b: Self::Word) -> Self::Word;
    /// Exact product; fraction bits add up.
    fn mul(&self, a: Self::Word, b: Self::Word) -> Self::Word;
    /// Exact negative.
    fn neg(&self, a: Self::Word) -> Self::Word;
    /// The same word under a name of its own, for emitted code.
    #[inline(always)]
    fn named(&self, a: Self::Word, _name: &'static str) -> Self::Word {
        a
    }
    /// The same raw word read in another unit: its value times 2^exponent.
    fn read_as(&self, a: Self::Word, exponent: i32) -> Self::Word;
    /// Quantisation. `operands` are what the design's error message names. Without quantisation:
    /// the value times 2^gain, neither rounded nor limited.
    fn cast(&self, a: Self::Word, cast: &Cast, operands: &[Self::Word]) -> Self::Word;
    /// Modulo 2^bits LSB, two's complement: a cyclic quantity, in every arithmetic.
    fn wrap(&self, a: Self::Word, bits: u32, fraction_bits: i32) -> Self::Word;
    /// [`Arithmetic::wrap`] of a word that ranges may have proved to be inside; `idle` where they have.
    #[inline(always)]
    fn wrap_unless(&self, _idle: bool, a: Self::Word, bits: u32, fraction_bits: i32) -> Self::Word {
        self.wrap(a, bits, fraction_bits)
    }
    /// [`Arithmetic::wrap`] of a word that nothing but sums and such wraps take until it is
    /// [`settled`](Arithmetic::settled): an arithmetic may put the wrap off until then.
    #[inline(always)]
    fn wrap_in_sum(&self, a: Self::Word, bits: u32, fraction_bits: i32) -> Self::Word {
        self.wrap(a, bits, fraction_bits)
    }
    /// The word after the last [`Arithmetic::wrap_in_sum`] to `bits`.
    #[inline(always)]
    fn settled(&self, a: Self::Word, _bits: u32) -> Self::Word {
        a
    }
    /// Limited to `low ..= high` LSB: a limit that belongs to the circuit's function, in every
    /// arithmetic.
    fn limit(&self, a: Self::Word, low: i128, high: i128, fraction_bits: i32) -> Self::Word;
    /// Is the word below zero?
    fn is_negative(&self, a: Self::Word) -> Self::Truth;
    /// `yes` where `test` holds, else `no`.
    fn select(&self, test: Self::Truth, yes: Self::Word, no: Self::Word) -> Self::Word;

    /// The word as an element of the ring: its value in steps, modulo the circle.
    fn residue(&self, a: Self::Word, ring: &Ring) -> Self::Residue;
    /// The constant `raw` steps.
    fn residue_constant(&self, raw: i128, ring: &Ring) -> Self::Residue;
    /// Modular sum.
    fn residue_add(&self, a: Self::Residue, b: Self::Residue, ring: &Ring) -> Self::Residue;
    /// Modular difference.
    fn residue_sub(&self, a: Self::Residue, b: Self::Residue, ring: &Ring) -> Self::Residue;
    /// The representative in [-circle/2, circle/2).
    fn centered(&self, a: Self::Residue, ring: &Ring) -> Self::Word;
    /// The table's entry at a phase; without quantisation: the sine of that phase, exactly.
    fn sine(&self, phase: Self::Residue, table: &SineTable) -> Self::Word;

    /// The table's entry at an address: a word without fraction bits, never below 0 nor beyond the last
    /// entry. No arithmetic knows the function behind the entries, so the one without quantisation
    /// takes the entry too, at the floor of its address.
    fn lookup(&self, address: Self::Word, table: &Table) -> Self::Word;

    /// `floor(a / 2^index)`.
    fn shift_right_by(&self, a: Self::Word, index: Self::Index) -> Self::Word;
    /// The table's entry for an index.
    fn entry(&self, table: &IndexTable, index: Self::Index) -> Self::Word;
    /// Runs `body` for index 0 .. count. The body is an object, not a closure: closures are not
    /// inlined into functions compiled for wider SIMD.
    fn repeat<const S: usize, B: LoopBody<Self, S>>(
        &self,
        count: u32,
        state: [Self::Word; S],
        radius: Self::Radius,
        body: &B,
    ) -> [Self::Word; S];

    /// States that `low <= a <= high` (raw; proved where it is called, lost by intervals).
    fn within(&self, a: Self::Word, low: i128, high: i128) -> Self::Word;
    /// The length of (x, y), for arithmetics that prove ranges.
    fn radius(&self, x: Self::Word, y: Self::Word) -> Self::Radius;
    /// States that `a` is a component of a vector no longer than `radius` (proved where it is
    /// called; intervals alone lose it).
    fn bounded(&self, a: Self::Word, radius: Self::Radius) -> Self::Word;
    /// States that `a`, a component of a vector no longer than `radius`, is not below zero as long as no word of
    /// `width` bits wraps (proved where it is called; intervals alone lose it).
    #[inline(always)]
    fn not_negative(&self, a: Self::Word, _radius: Self::Radius, _width: u32) -> Self::Word {
        a
    }
    /// The bound after a CORDIC micro-rotation by `index`: the length grows by sqrt(1 + 4^-index),
    /// and each floor moves a component by less than one LSB.
    fn rotated(&self, radius: Self::Radius, index: Self::Index) -> Self::Radius;
    /// The bound after both components were wrapped to `width` bits, which forgets it if it acted.
    fn wrapped_radius(&self, radius: Self::Radius, width: u32) -> Self::Radius;

    /// The phase (turns) and magnitude of (i, q) where an arithmetic has them exactly.
    fn ideal_polar(&self, _i: Self::Word, _q: Self::Word) -> Option<[Self::Word; 2]> {
        None
    }

    /// Runs a block. An arithmetic that records makes a function of it, named after the block,
    /// whose state is the member `instance` of the state around it.
    #[inline(always)]
    fn call<const I: usize, const O: usize, B: Block<Self, I, O>>(
        &self,
        block: &B,
        _instance: &'static str,
        state: &mut B::State,
        inputs: [Self::Word; I],
    ) -> [Self::Word; O] {
        block.step(self, state, inputs)
    }
}

/// The body of a counted loop.
pub trait LoopBody<A: Arithmetic, const S: usize> {
    /// One iteration.
    fn step(
        &self,
        ar: &A,
        index: A::Index,
        state: [A::Word; S],
        radius: &mut A::Radius,
    ) -> [A::Word; S];
}

/// A block of the circuit: configuration in `self`, history in `State`, `I` words in, `O` words out.
pub trait Block<A: Arithmetic, const I: usize, const O: usize> {
    /// What the block remembers.
    type State: Clone;
    /// The name of the function in emitted code.
    const NAME: &'static str;
    /// What the function is for, in a sentence, for emitted code.
    const PURPOSE: &'static str;
    /// The name of the state's type in emitted code; empty = no state.
    const STATE: &'static str = "";
    /// Names and units of the inputs, for emitted code.
    fn inputs(&self) -> [Port; I];
    /// Names and units of the outputs, for emitted code.
    fn outputs(&self) -> [Port; O];
    /// One step.
    fn step(&self, ar: &A, state: &mut Self::State, inputs: [A::Word; I]) -> [A::Word; O];
    /// Shows every word and residue of the state to `visitor`, by name.
    fn visit(&self, _state: &mut Self::State, _visitor: &mut dyn StateVisitor<A>) {}
}

/// What a word stands for: `quantity = offset + factor * raw`.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// What is measured, such as a column of a record.
    pub quantity: String,
    /// Of the word 0, in `unit`.
    pub offset: f64,
    /// Of one step of the word, in `unit`.
    pub factor: f64,
    /// Empty for a number.
    pub unit: &'static str,
}

/// An input or output of a block, as emitted code documents it.
#[derive(Debug, Clone, PartialEq)]
pub struct Port {
    /// An identifier.
    pub name: &'static str,
    /// Format and unit in words.
    pub meaning: String,
    /// What its words stand for, where that is a quantity outside the circuit.
    pub scale: Option<Scale>,
    /// First and last word that the block computes with, where it limits all others of the range to these.
    pub limits: Option<(i128, i128)>,
}

impl Port {
    /// A port.
    pub fn new(name: &'static str, meaning: impl Into<String>) -> Self {
        Port {
            name,
            meaning: meaning.into(),
            scale: None,
            limits: None,
        }
    }

    /// The same port, whose words the block limits to `low ..= high`.
    pub fn limited(mut self, low: i128, high: i128) -> Self {
        self.limits = Some((low, high));
        self
    }

    /// A port that is not there: without a name.
    pub fn absent() -> Self {
        Port::new("", "")
    }

    /// The same port, whose words are `quantity = raw * 2^exponent`, in `unit`.
    pub fn in_unit(mut self, quantity: &str, exponent: i32, unit: &'static str) -> Self {
        self.scale = Some(Scale {
            quantity: quantity.to_owned(),
            offset: 0.0,
            factor: pow2(exponent),
            unit,
        });
        self
    }
}

/// Walks over a block's state.
pub trait StateVisitor<A: Arithmetic> {
    /// A word that is always within `low ..= high`.
    fn word(&mut self, name: &'static str, word: &mut A::Word, low: i128, high: i128);
    /// Residues of one ring.
    fn residues(&mut self, name: &'static str, residues: &mut [A::Residue], ring: &Ring);
}
