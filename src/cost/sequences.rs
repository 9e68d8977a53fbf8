//! What an operation of the lowered program takes on a processor: instructions by class.
//!
//! The sequences are those that GCC 12 makes of the emitted C at `-O2`, read from its assembly for small pieces
//! of code. They are counts of instructions; cycles are instructions times the cycles of their class, from
//! the manufacturers' tables (Cortex-M0 and M4 technical reference manuals, Ibex's documentation).

use super::Target;

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

    const fn of(alu: f64, load: f64, store: f64, branch: f64) -> Sequence {
        Sequence {
            alu,
            load,
            store,
            branch,
            mul: 0.0,
            long: 0.0,
        }
    }

    const fn alu(alu: f64) -> Sequence {
        Sequence::of(alu, 0.0, 0.0, 0.0)
    }

    const fn load(load: f64) -> Sequence {
        Sequence::of(0.0, load, 0.0, 0.0)
    }

    const fn store(store: f64) -> Sequence {
        Sequence::of(0.0, 0.0, store, 0.0)
    }

    const fn mul(mul: f64, long: f64, alu: f64) -> Sequence {
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

/// The sequences of a target.
pub fn processor(target: Target) -> Processor {
    match target {
        Target::Host => host(),
        Target::CortexM4 => cortex_m4(),
        Target::CortexM0 => cortex_m0(32.0),
        Target::CortexM0Fast => cortex_m0(1.0),
        Target::Rv32imc => rv32imc(),
        Target::Dsp16 => dsp16(),
    }
}

const fn alus(a: f64, b: f64, c: f64) -> [Sequence; 3] {
    [Sequence::alu(a), Sequence::alu(b), Sequence::alu(c)]
}

const fn loads(a: f64, b: f64, c: f64) -> [Sequence; 3] {
    [Sequence::load(a), Sequence::load(b), Sequence::load(c)]
}

const fn stores(a: f64, b: f64, c: f64) -> [Sequence; 3] {
    [Sequence::store(a), Sequence::store(b), Sequence::store(c)]
}

fn cycles(alu: f64, load: f64, store: f64, branch: f64, mul: f64, long: f64) -> Sequence {
    Sequence {
        mul,
        long,
        ..Sequence::of(alu, load, store, branch)
    }
}

/// ARMv7E-M: one-cycle SMULL and MLA, SSAT, conditional moves by IT (an instruction of its own).
fn cortex_m4() -> Processor {
    Processor {
        add: alus(1.0, 2.0, 10.0),
        shift: alus(1.0, 3.0, 8.0),
        shift_low: Sequence::alu(2.0),
        // Exclusive or with the sign, shift, exclusive or.
        asr: alus(3.0, 7.0, 14.0),
        asr_low: Sequence::alu(5.0),
        asr_high: Sequence::alu(3.5),
        asr_index: alus(3.0, 11.0, 22.0),
        multiply_short: Sequence::mul(1.0, 0.0, 0.0),
        multiply: [
            Sequence::mul(1.0, 0.0, 0.0),
            Sequence::mul(2.0, 1.0, 1.0),
            Sequence::mul(6.0, 5.0, 25.0),
        ],
        multiply_long: Sequence::mul(0.0, 1.0, 0.0),
        multiply_mixed: Sequence::mul(2.0, 1.0, 1.0),
        // Often the second operand's shift of an addition.
        extend: Sequence::alu(0.5),
        sign_extend: alus(6.0, 5.0, 22.0),
        mask: alus(1.0, 2.0, 4.0),
        test: Sequence::alu(1.0),
        decide: Sequence::of(0.0, 0.0, 0.0, 1.0),
        choose: alus(0.5, 1.0, 2.0),
        clamp: alus(4.0, 10.0, 22.0),
        saturate: Some(Sequence::alu(1.0)),
        note: Sequence::of(2.0, 0.5, 0.0, 1.0),
        read: Sequence::load(1.0),
        base: Sequence::load(1.0),
        entry: Sequence::load(1.0),
        // Some pairs are one LDRD or STRD.
        load: loads(1.0, 1.6, 4.0),
        store: stores(1.0, 1.6, 4.0),
        iteration: Sequence::of(2.0, 0.0, 0.0, 1.5),
        call: Sequence::of(1.5, 0.0, 0.0, 1.0),
        enter: Sequence::of(0.0, 1.0, 1.0, 0.0),
        leave: Sequence::of(0.0, 0.0, 0.0, 1.0),
        // PUSH and POP take lists.
        save: Sequence::NONE,
        free_registers: 5,
        registers: 14,
        spill: Sequence::of(0.0, 1.0, 1.0, 0.0),
        immediate: Immediate::Rotated,
        constant: Sequence::load(1.0),
        push: Sequence::of(4.0, 2.0, 2.0, 4.0),
        row: [
            Sequence::of(6.0, 1.0, 1.0, 2.0),
            Sequence::of(0.0, 0.5, 0.5, 0.0),
        ],
        cycles: cycles(1.0, 2.0, 1.0, 2.0, 1.0, 1.0),
        bytes: 3.0,
    }
}

/// ARMv6-M: two-operand instructions on eight registers, the upper ones by moves; no product of more than
/// 32 bits, which libgcc's `__aeabi_lmul` makes of six multiplications in 42 instructions.
fn cortex_m0(multiplication: f64) -> Processor {
    let library = Sequence {
        mul: 6.0,
        ..Sequence::of(29.0, 3.0, 2.0, 2.0)
    };
    let mut library_call = library;
    // Two words of 64 bits into their registers, signs extended; the result out of them.
    library_call.add(&Sequence::of(9.0, 0.0, 0.0, 1.0), 1.0);
    let mut wide = Sequence::alu(60.0);
    wide.add(&library_call, 6.0);
    Processor {
        add: alus(1.0, 2.0, 14.0),
        shift: alus(1.0, 4.0, 14.0),
        shift_low: Sequence::alu(3.0),
        asr: alus(4.5, 12.0, 26.0),
        asr_low: Sequence::alu(8.0),
        asr_high: Sequence::alu(5.0),
        asr_index: alus(5.0, 25.0, 45.0),
        multiply_short: Sequence::mul(1.0, 0.0, 0.5),
        multiply: [Sequence::mul(1.0, 0.0, 0.5), library_call, wide],
        multiply_long: library_call,
        multiply_mixed: library_call,
        extend: Sequence::alu(1.5),
        sign_extend: [
            Sequence::of(4.0, 0.0, 0.0, 1.0),
            Sequence::of(8.0, 0.0, 0.0, 1.0),
            Sequence::alu(40.0),
        ],
        mask: alus(2.0, 3.0, 6.0),
        test: Sequence::alu(1.0),
        decide: Sequence::of(0.0, 0.0, 0.0, 1.0),
        choose: alus(0.5, 1.0, 2.0),
        clamp: [
            Sequence::of(4.5, 0.5, 0.0, 2.0),
            Sequence::of(10.0, 1.0, 0.0, 3.0),
            Sequence::of(24.0, 2.0, 0.0, 6.0),
        ],
        saturate: None,
        note: Sequence::of(2.0, 1.0, 0.0, 2.0),
        read: Sequence::of(1.0, 1.0, 0.0, 0.0),
        base: Sequence::load(1.0),
        entry: Sequence::of(1.0, 1.0, 0.0, 0.0),
        load: loads(1.0, 2.0, 4.0),
        store: stores(1.0, 2.0, 4.0),
        iteration: Sequence::of(2.0, 0.0, 0.0, 1.5),
        call: Sequence::of(2.5, 0.0, 0.0, 1.0),
        enter: Sequence::of(0.0, 1.0, 1.0, 0.0),
        leave: Sequence::of(0.0, 0.0, 0.0, 1.0),
        // Of the upper registers: through a lower one.
        save: Sequence::alu(2.0),
        free_registers: 8,
        registers: 8,
        spill: Sequence::alu(2.0),
        immediate: Immediate::Below(256),
        constant: Sequence::of(0.5, 1.0, 0.0, 0.0),
        push: Sequence::of(6.5, 2.0, 2.0, 4.0),
        row: [
            Sequence::of(8.0, 2.0, 2.0, 2.0),
            Sequence::of(0.0, 0.6, 0.6, 0.0),
        ],
        cycles: cycles(1.0, 2.0, 2.0, 2.0, multiplication, multiplication),
        bytes: 2.05,
    }
}

/// RV32IMC on Ibex with its three-cycle multiplier: no carry, no saturation, compare and branch in one.
fn rv32imc() -> Processor {
    Processor {
        // The carry is a comparison.
        add: alus(1.0, 4.0, 16.0),
        shift: alus(1.0, 4.0, 12.0),
        shift_low: Sequence::alu(3.0),
        asr: alus(4.0, 9.0, 18.0),
        asr_low: Sequence::alu(7.0),
        asr_high: Sequence::alu(4.5),
        asr_index: alus(4.0, 14.0, 26.0),
        multiply_short: Sequence::mul(1.0, 0.0, 0.0),
        multiply: [
            Sequence::mul(1.0, 0.0, 0.0),
            Sequence::mul(3.0, 1.0, 2.0),
            Sequence::mul(8.0, 5.0, 32.0),
        ],
        multiply_long: Sequence::mul(1.0, 1.0, 0.0),
        multiply_mixed: Sequence::mul(3.0, 1.0, 3.0),
        extend: Sequence::alu(1.0),
        sign_extend: [
            Sequence::of(2.0, 0.0, 0.0, 1.0),
            Sequence::of(5.0, 0.0, 0.0, 1.0),
            Sequence::alu(24.0),
        ],
        mask: alus(1.5, 2.0, 4.0),
        test: Sequence::NONE,
        decide: Sequence::of(0.0, 0.0, 0.0, 1.0),
        choose: alus(0.5, 1.0, 2.0),
        clamp: [
            Sequence::of(2.5, 0.0, 0.0, 2.0),
            Sequence::of(9.0, 0.0, 0.0, 3.0),
            Sequence::of(20.0, 0.0, 0.0, 6.0),
        ],
        saturate: None,
        note: Sequence::of(0.5, 0.5, 0.0, 2.0),
        read: Sequence::of(2.0, 1.0, 0.0, 0.0),
        base: Sequence::alu(2.0),
        entry: Sequence::of(1.0, 1.0, 0.0, 0.0),
        load: loads(1.0, 2.0, 4.0),
        store: stores(1.0, 2.0, 4.0),
        iteration: Sequence::of(3.0, 0.0, 0.0, 1.0),
        call: Sequence::of(1.5, 0.0, 0.0, 1.0),
        enter: Sequence::of(2.0, 0.0, 0.0, 1.0),
        leave: Sequence::of(0.0, 0.0, 0.0, 1.0),
        save: Sequence::of(0.0, 1.0, 1.0, 0.0),
        free_registers: 15,
        registers: 26,
        spill: Sequence::of(0.0, 1.0, 1.0, 0.0),
        immediate: Immediate::Below(2048),
        constant: Sequence::alu(1.3),
        push: Sequence::of(6.5, 4.0, 4.0, 4.0),
        row: [
            Sequence::of(8.0, 2.0, 2.0, 2.0),
            Sequence::of(0.0, 1.0, 1.0, 0.0),
        ],
        cycles: cycles(1.0, 2.0, 2.0, 2.0, 3.0, 4.0),
        bytes: 3.05,
    }
}

/// A 16-bit signal processor of the dsPIC33 kind: 16 x 16 bit products in a cycle, words of 32 bits by pairs
/// of registers. No compiler for it was at hand: these are estimates, and not validated.
fn dsp16() -> Processor {
    Processor {
        add: alus(2.0, 4.0, 8.0),
        shift: alus(4.0, 8.0, 24.0),
        shift_low: Sequence::alu(4.0),
        asr: alus(6.0, 14.0, 30.0),
        asr_low: Sequence::alu(8.0),
        asr_high: Sequence::alu(8.0),
        asr_index: alus(12.0, 24.0, 50.0),
        multiply_short: Sequence::mul(1.0, 0.0, 0.0),
        multiply: [
            Sequence::mul(3.0, 0.0, 5.0),
            Sequence::mul(10.0, 0.0, 30.0),
            Sequence::mul(36.0, 0.0, 120.0),
        ],
        multiply_long: Sequence::mul(4.0, 0.0, 8.0),
        multiply_mixed: Sequence::mul(7.0, 0.0, 17.0),
        extend: Sequence::alu(2.0),
        sign_extend: alus(5.0, 8.0, 24.0),
        mask: alus(2.0, 4.0, 8.0),
        test: Sequence::alu(1.0),
        decide: Sequence::of(0.0, 0.0, 0.0, 1.0),
        choose: alus(1.0, 2.0, 4.0),
        clamp: [
            Sequence::of(7.0, 0.0, 0.0, 2.0),
            Sequence::of(14.0, 0.0, 0.0, 3.0),
            Sequence::of(28.0, 0.0, 0.0, 6.0),
        ],
        saturate: None,
        note: Sequence::of(2.0, 1.0, 0.0, 2.0),
        read: Sequence::of(2.0, 1.0, 0.0, 0.0),
        base: Sequence::alu(1.0),
        entry: Sequence::of(1.0, 2.0, 0.0, 0.0),
        load: loads(2.0, 4.0, 8.0),
        store: stores(2.0, 4.0, 8.0),
        iteration: Sequence::of(1.0, 0.0, 0.0, 1.0),
        call: Sequence::of(3.0, 0.0, 0.0, 1.0),
        enter: Sequence::of(0.0, 0.0, 0.0, 1.0),
        leave: Sequence::of(0.0, 0.0, 0.0, 1.0),
        save: Sequence::of(0.0, 1.0, 1.0, 0.0),
        free_registers: 4,
        registers: 7,
        spill: Sequence::of(0.0, 2.0, 2.0, 0.0),
        immediate: Immediate::Below(1024),
        constant: Sequence::alu(2.0),
        push: Sequence::of(7.0, 4.0, 4.0, 4.0),
        row: [
            Sequence::of(8.0, 2.0, 2.0, 2.0),
            Sequence::of(0.0, 2.0, 2.0, 0.0),
        ],
        cycles: cycles(1.0, 1.0, 1.0, 2.0, 1.0, 1.0),
        bytes: 3.0,
    }
}

/// A 64-bit processor; for the comparison of forms, not validated.
fn host() -> Processor {
    Processor {
        add: alus(1.0, 1.0, 3.0),
        shift: alus(1.0, 1.0, 4.0),
        shift_low: Sequence::alu(1.0),
        asr: alus(1.0, 1.0, 4.0),
        asr_low: Sequence::alu(1.0),
        asr_high: Sequence::alu(1.0),
        asr_index: alus(1.0, 1.0, 6.0),
        multiply_short: Sequence::mul(1.0, 0.0, 0.0),
        multiply: [
            Sequence::mul(1.0, 0.0, 0.0),
            Sequence::mul(1.0, 0.0, 0.0),
            Sequence::mul(3.0, 1.0, 4.0),
        ],
        multiply_long: Sequence::mul(1.0, 0.0, 0.0),
        multiply_mixed: Sequence::mul(1.0, 0.0, 0.0),
        extend: Sequence::alu(0.5),
        sign_extend: alus(2.0, 2.0, 6.0),
        mask: alus(1.0, 1.0, 2.0),
        test: Sequence::alu(1.0),
        decide: Sequence::NONE,
        choose: alus(1.0, 1.0, 2.0),
        clamp: alus(2.0, 2.0, 6.0),
        saturate: None,
        note: Sequence::of(1.0, 0.5, 0.0, 1.0),
        read: Sequence::load(1.0),
        base: Sequence::NONE,
        entry: Sequence::load(1.0),
        load: loads(1.0, 1.0, 2.0),
        store: stores(1.0, 1.0, 2.0),
        iteration: Sequence::of(1.0, 0.0, 0.0, 1.0),
        call: Sequence::of(1.0, 0.0, 0.0, 1.0),
        enter: Sequence::of(0.0, 0.0, 0.0, 1.0),
        leave: Sequence::of(0.0, 0.0, 0.0, 1.0),
        save: Sequence::of(0.0, 1.0, 1.0, 0.0),
        free_registers: 9,
        registers: 28,
        spill: Sequence::of(0.0, 1.0, 1.0, 0.0),
        immediate: Immediate::Below(1 << 31),
        constant: Sequence::alu(1.0),
        push: Sequence::of(4.0, 2.0, 2.0, 4.0),
        row: [
            Sequence::of(4.0, 1.0, 1.0, 2.0),
            Sequence::of(0.0, 0.5, 0.5, 0.0),
        ],
        cycles: cycles(1.0, 4.0, 1.0, 1.0, 3.0, 3.0),
        bytes: 4.0,
    }
}
