//! Instructions by class, and what an operation of the lowered program takes of them on a processor.

/// Instructions by class; halves where a branch decides whether they are executed.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sequence {
    /// Additions, shifts, logic, moves.
    pub alu: f64,
    /// Reads of memory.
    pub load: f64,
    /// Writes of memory.
    pub store: f64,
    /// Branches, calls, returns.
    pub branch: f64,
    /// Multiplications that keep the lower word.
    pub mul: f64,
    /// Multiplications that make the upper word, alone or with the lower.
    pub long: f64,
}

impl Sequence {
    /// No instruction.
    pub const NONE: Sequence = Sequence::of(0.0, 0.0, 0.0, 0.0);

    pub(super) const fn of(alu: f64, load: f64, store: f64, branch: f64) -> Sequence {
        Sequence {
            alu,
            load,
            store,
            branch,
            mul: 0.0,
            long: 0.0,
        }
    }

    pub(super) const fn alu(alu: f64) -> Sequence {
        Sequence::of(alu, 0.0, 0.0, 0.0)
    }

    pub(super) const fn load(load: f64) -> Sequence {
        Sequence::of(0.0, load, 0.0, 0.0)
    }

    pub(super) const fn store(store: f64) -> Sequence {
        Sequence::of(0.0, 0.0, store, 0.0)
    }

    pub(super) const fn mul(mul: f64, long: f64, alu: f64) -> Sequence {
        let mut s = Sequence::alu(alu);
        s.mul = mul;
        s.long = long;
        s
    }

    /// All of them, `times` over, added.
    pub fn add(&mut self, other: &Sequence, times: f64) {
        self.alu += other.alu * times;
        self.load += other.load * times;
        self.store += other.store * times;
        self.branch += other.branch * times;
        self.mul += other.mul * times;
        self.long += other.long * times;
    }

    /// Instructions of all classes.
    pub fn instructions(&self) -> f64 {
        self.alu + self.load + self.store + self.branch + self.mul + self.long
    }

    /// Cycles, with those of each class.
    pub fn cycles(&self, each: &Sequence) -> f64 {
        self.alu * each.alu
            + self.load * each.load
            + self.store * each.store
            + self.branch * each.branch
            + self.mul * each.mul
            + self.long * each.long
    }
}

/// Constants that an addition takes without an instruction of their own.
#[derive(Debug, Clone, Copy)]
pub enum Immediate {
    /// Eight bits at any place (ARM's modified immediates).
    Rotated,
    /// Magnitudes below this.
    Below(u32),
}

/// A processor's sequences. Three numbers are for words of 32, 64 and 128 bits.
#[derive(Debug)]
pub struct Processor {
    /// Sum, difference.
    pub add: [Sequence; 3],
    /// Logical shift by a constant.
    pub shift: [Sequence; 3],
    /// The lower half of a 64-bit shift.
    pub shift_low: Sequence,
    /// Arithmetic shift right by a constant.
    pub asr: [Sequence; 3],
    /// The lower half of a 64-bit one.
    pub asr_low: Sequence,
    /// A 64-bit one by 32 and more.
    pub asr_high: Sequence,
    /// Arithmetic shift right by a loop's index.
    pub asr_index: [Sequence; 3],
    /// The same of a word that is never below zero.
    pub shr_index: [Sequence; 3],
    /// Operands of 16 bits.
    pub multiply_short: Sequence,
    /// A product as wide as its operands.
    pub multiply: [Sequence; 3],
    /// 32 x 32 to 64 bits.
    pub multiply_long: Sequence,
    /// 64 x 32 to 64 bits.
    pub multiply_mixed: Sequence,
    /// From 32 to 64 bits.
    pub extend: Sequence,
    /// The low bits as a signed number.
    pub sign_extend: [Sequence; 3],
    /// The low bits.
    pub mask: [Sequence; 3],
    /// a < 0.
    pub test: Sequence,
    /// Branch on a test, once for all that it selects.
    pub decide: Sequence,
    /// A selected word's moves.
    pub choose: [Sequence; 3],
    /// Limits.
    pub clamp: [Sequence; 3],
    /// Limits that are a power of two, where there is an instruction for it.
    pub saturate: Option<Sequence>,
    /// The note of a fault, beside the limit.
    pub note: Sequence,
    /// A table's entry.
    pub read: Sequence,
    /// A table's address.
    pub base: Sequence,
    /// A table's entry at a loop's index.
    pub entry: Sequence,
    /// A word of the state.
    pub load: [Sequence; 3],
    /// The same, written.
    pub store: [Sequence; 3],
    /// A loop's count and branch.
    pub iteration: Sequence,
    /// A call with its arguments.
    pub call: Sequence,
    /// Entry and return of a function that saves registers.
    pub enter: Sequence,
    /// Return of one that saves none.
    pub leave: Sequence,
    /// A register saved and restored.
    pub save: Sequence,
    /// Words of 32 bits that fit registers which need no saving.
    pub free_registers: usize,
    /// Words of 32 bits that fit registers.
    pub registers: usize,
    /// A word that does not, put away and taken back.
    pub spill: Sequence,
    /// Constants of additions.
    pub immediate: Immediate,
    /// Another constant.
    pub constant: Sequence,
    /// What `push` does for a sample beside the call of `sample`.
    pub push: Sequence,
    /// What it does for a row beside the call of `period`, and for each of its words.
    pub row: [Sequence; 2],
    /// Cycles of each class.
    pub cycles: Sequence,
    /// Bytes of an instruction with its share of literals.
    pub bytes: f64,
}
