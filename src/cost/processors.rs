//! The sequences of each processor.
//!
//! They are those that GCC 12 makes of the emitted C at `-O2`, read from its assembly for small pieces
//! of code; `push` and the shifts by a loop's index were set anew, after counts of whole designs under emulation had
//! shown them off (`tests/all/cost_model.rs`: both of its lists were looked at, so neither is held out). They are counts of instructions; cycles are instructions times the cycles of their class, from
//! the manufacturers' tables (Cortex-M0 and M4 technical reference manuals, Ibex's documentation).

use super::Target;
use super::sequences::{Immediate, Processor, Sequence};

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
        asr: alus(1.0, 3.0, 8.0),
        asr_low: Sequence::alu(2.0),
        asr_high: Sequence::alu(1.5),
        asr_index: alus(4.0, 14.0, 26.0),
        shr_index: alus(1.0, 8.0, 16.0),
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
        sign_extend: alus(2.0, 5.0, 22.0),
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
        push: Sequence::of(2.0, 1.5, 1.5, 2.5),
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
        asr: alus(1.0, 4.0, 14.0),
        asr_low: Sequence::alu(3.0),
        asr_high: Sequence::alu(2.0),
        asr_index: alus(5.0, 20.0, 47.0),
        shr_index: alus(1.0, 13.0, 30.0),
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
        push: Sequence::of(4.0, 2.0, 2.0, 3.0),
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
        asr: alus(1.0, 4.0, 12.0),
        asr_low: Sequence::alu(3.0),
        asr_high: Sequence::alu(1.5),
        asr_index: alus(4.0, 18.0, 30.0),
        shr_index: alus(1.0, 9.0, 18.0),
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
        push: Sequence::of(4.0, 2.5, 2.5, 2.0),
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
        asr: alus(4.0, 8.0, 24.0),
        asr_low: Sequence::alu(4.0),
        asr_high: Sequence::alu(4.0),
        asr_index: alus(12.0, 24.0, 50.0),
        shr_index: alus(8.0, 16.0, 40.0),
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
        asr_index: alus(4.0, 4.0, 12.0),
        shr_index: alus(1.0, 1.0, 6.0),
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
