//! From lowered functions to instructions: what each statement takes on a processor, and which function a
//! compiler puts into its caller.

use super::sequences::{Immediate, Processor, Sequence};
use super::uses::Uses;
use crate::emit::machine::{Expr, Lowered, Statement, Type, Typed, Value, Width};
use crate::emit::tidy::with_conversions;
use crate::numeric::trace::ir::Program;
use std::collections::BTreeSet;

/// Statements, weighed, that GCC at `-O2` still puts into a caller.
const INLINED: u32 = 16;

/// Instructions of a function: executed in a call of it, and in its code.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    /// In one call, with those of what it calls.
    pub executed: Sequence,
    /// In its own code, with what was put into it.
    pub code: Sequence,
}

/// The instructions of every function of a program.
#[derive(Debug)]
pub struct Walk<'a> {
    program: &'a Program,
    lowered: &'a [Lowered],
    /// The statements of each function with its conversions.
    bodies: Vec<Vec<Statement>>,
    processor: &'a Processor,
    sizes: Vec<u32>,
    /// The most words that are alive in each function.
    peaks: Vec<usize>,
    tallies: Vec<Tally>,
}

/// A function being counted.
struct Counting<'w, 'a> {
    walk: &'w Walk<'a>,
    number: usize,
    uses: Uses<'w>,
    tally: Tally,
    tables: BTreeSet<(bool, usize)>,
    decided: BTreeSet<usize>,
}

impl<'a> Walk<'a> {
    /// Counts every function, callees first.
    pub fn new(program: &'a Program, lowered: &'a [Lowered], processor: &'a Processor) -> Self {
        let mut walk = Walk {
            program,
            lowered,
            bodies: lowered.iter().map(with_conversions).collect(),
            processor,
            sizes: Vec::new(),
            peaks: Vec::new(),
            tallies: Vec::new(),
        };
        for number in 0..lowered.len() {
            let size = walk.size(number, &walk.bodies[number]);
            walk.sizes.push(size);
            let (tally, peak) = walk.count(number);
            walk.tallies.push(tally);
            walk.peaks.push(peak);
        }
        walk
    }

    /// Of function `number`, with entry and return where it is not put into its callers.
    pub fn tally(&self, number: usize) -> Tally {
        self.tallies[number]
    }

    fn is_inlined(&self, number: usize) -> bool {
        self.sizes[number] <= INLINED
    }

    fn count(&self, number: usize) -> (Tally, usize) {
        let (function, lowered) = (&self.program.functions[number], &self.lowered[number]);
        let is_call = |site: usize| !self.is_inlined(function.calls[site].function);
        let inside = |site: usize| {
            let callee = function.calls[site].function;
            self.is_inlined(callee).then(|| self.peaks[callee])
        };
        let body = &self.bodies[number];
        let uses = Uses::of(function, lowered, body, self.processor.registers, &inside);
        let p = self.processor;
        let (crowded, peak) = (uses.crowded, uses.peak);
        let saved = uses
            .peak
            .max(p.registers.min(p.free_registers + uses.over_call));
        let saved = saved.saturating_sub(p.free_registers).min(12);
        let mut counting = Counting {
            walk: self,
            number,
            uses,
            tally: Tally::default(),
            tables: BTreeSet::new(),
            decided: BTreeSet::new(),
        };
        counting.body(body, 1.0);
        counting.take(&p.spill, crowded, 1.0);
        // `push` alone calls `sample`, which is static: they become one function.
        if !self.is_inlined(number) && function.name != "sample" {
            let calls = (0..function.calls.len()).any(is_call);
            if saved > 0 || calls {
                counting.take(&p.enter, 1.0, 1.0);
                counting.take(&p.save, saved as f64, 1.0);
            } else {
                counting.take(&p.leave, 1.0, 1.0);
            }
            if lowered.outputs.len() > 1 {
                // The results go through memory.
                for (_, v) in &lowered.outputs {
                    counting.take(&p.store[size_of(v.ty)], 1.0, 1.0);
                }
            }
        }
        (counting.tally, peak)
    }

    /// A function's size as the compiler sees it when it decides where to put it.
    fn size(&self, number: usize, body: &[Statement]) -> u32 {
        let of = |statement: &Statement| match statement {
            Statement::Let(_, ty, expr, _) => {
                let wide = matches!(ty, Type::Signed(Width::W128) | Type::Unsigned(Width::W128));
                let size = match expr {
                    Expr::Asr(..) | Expr::AsrIndex(_) => 4,
                    Expr::SignExtend(..) | Expr::Check(..) => 5,
                    Expr::Convert(a) if size_of(a.ty) == size_of(*ty) => 0,
                    Expr::Clamp(..) => 3,
                    Expr::Mask(..) => 0,
                    Expr::Low(a) if size_of(a.ty) == size_of(*ty) => 0,
                    _ => 1,
                };
                size * if wide { 10 } else { 1 }
            }
            Statement::Store(..) => 1,
            Statement::Carry(..) | Statement::Next(_) => 0,
            // A loop's body is never small enough.
            Statement::Loop(..) => INLINED + 1,
            Statement::Call(site, ..) => {
                let callee = self.program.functions[number].calls[*site].function;
                if self.is_inlined(callee) {
                    self.sizes[callee]
                } else {
                    4
                }
            }
        };
        body.iter().map(of).sum()
    }
}

/// 0, 1, 2 for words of up to 32, 64 and 128 bits.
fn size_of(ty: Type) -> usize {
    match ty {
        Type::Bool => 0,
        Type::Signed(width) | Type::Unsigned(width) => match width {
            // Parameters come in registers of 32 bits.
            Width::W8 | Width::W16 | Width::W32 => 0,
            Width::W64 => 1,
            Width::W128 => 2,
        },
    }
}

impl Counting<'_, '_> {
    /// Notes a sequence that is executed `times`, of which `share` of the executions are.
    fn take(&mut self, sequence: &Sequence, times: f64, share: f64) {
        self.tally.executed.add(sequence, times * share);
        self.tally.code.add(sequence, 1.0);
    }

    fn body(&mut self, body: &[Statement], times: f64) {
        let p = self.walk.processor;
        for statement in body {
            match statement {
                Statement::Let(t, ty, expr, _) => self.expression(*t, *ty, expr, times),
                Statement::Carry(_, ty, v) => {
                    // A constant has to be put there; a word is there already.
                    if matches!(v.value, Value::Constant(_)) {
                        self.take(&p.choose[size_of(*ty)], 2.0 * times, 1.0);
                    }
                }
                Statement::Loop(count, inner) => {
                    let times = times * f64::from(*count);
                    self.take(&p.iteration, times, 1.0);
                    self.body(inner, times);
                }
                Statement::Next(_) => {}
                Statement::Call(site, arguments, results) => {
                    self.call(*site, arguments.len(), results, times);
                }
                Statement::Store(_, _, v) => self.take(&p.store[size_of(v.ty)], times, 1.0),
            }
        }
    }

    fn call(&mut self, site: usize, arguments: usize, results: &[(usize, Type)], times: f64) {
        let p = self.walk.processor;
        let callee = self.walk.program.functions[self.number].calls[site].function;
        let tally = self.walk.tallies[callee];
        self.tally.executed.add(&tally.executed, times);
        if self.walk.is_inlined(callee) {
            self.tally.code.add(&tally.code, 1.0);
            return;
        }
        self.take(&p.call, times, 1.0);
        if arguments > 2 {
            self.take(&p.choose[0], 2.0 * times * (arguments - 2) as f64, 1.0);
        }
        if results.len() > 1 {
            for (_, ty) in results {
                self.take(&p.load[size_of(*ty)], times, 1.0);
            }
        }
    }

    /// A constant that the operation cannot carry.
    fn constant(&mut self, v: &Typed, times: f64, share: f64) {
        let Value::Constant(c) = v.value else {
            return;
        };
        let p = self.walk.processor;
        let words: &[i128] = match size_of(v.ty) {
            0 => &[c],
            _ => &[c & 0xffff_ffff, c >> 32],
        };
        for word in words {
            if !is_immediate(*word as i32, p.immediate) {
                self.take(&p.constant, times, share);
            }
        }
    }

    fn expression(&mut self, t: usize, ty: Type, expr: &Expr, times: f64) {
        let p = self.walk.processor;
        let size = size_of(ty);
        let u = self.uses.temp(t);
        let (share, upper) = (u.share, u.upper);
        // The lower half of a word of 64 bits is a word.
        let half = if size == 1 && !upper { 0 } else { size };
        let none = Sequence::NONE;
        let sequence = match expr {
            Expr::Convert(a) | Expr::Low(a) | Expr::ToSigned(a) => {
                let widens = size > size_of(a.ty) && upper;
                let signed = matches!(a.ty, Type::Signed(_));
                match (widens, size) {
                    (true, 1) if signed && !u.multiplied_only => p.extend,
                    (true, 2) => p.extend,
                    _ => none,
                }
            }
            Expr::Add(a, b) | Expr::Sub(a, b) => {
                for v in [a, b] {
                    self.constant(v, times, share);
                }
                p.add[half]
            }
            Expr::Mul(a, b) => self.product(half, a, b, times, share),
            Expr::Neg(_) => p.add[half],
            Expr::Asr(_, count) => match size {
                1 if *count >= 32 => p.asr_high,
                1 if !upper => p.asr_low,
                _ => p.asr[size],
            },
            Expr::ShrPositive(_, count) => match size {
                1 if *count >= 32 => p.shift[0],
                1 if !upper => p.shift_low,
                _ => p.shift[size],
            },
            Expr::AsrIndex(_) => p.asr_index[size],
            Expr::ShrIndex(_) => p.shr_index[size],
            Expr::Shl(..) | Expr::Shr(..) if half == 0 && size == 1 => p.shift_low,
            Expr::Shl(..) | Expr::Shr(..) => p.shift[size],
            Expr::Mask(a, bits) => self.mask(half, a, *bits),
            Expr::SignExtend(..) => p.sign_extend[half],
            Expr::IsNegative(_) => p.test,
            Expr::Select(test, _, _) => {
                if let Value::Temp(test) = test.value
                    && self.decided.insert(test)
                {
                    self.take(&p.decide, times, 1.0);
                }
                p.choose[half]
            }
            Expr::Clamp(_, low, high) => self.limit(size, *low, *high),
            Expr::Check(_, low, high, _) => {
                self.take(&p.note, times, share);
                self.limit(size, *low, *high)
            }
            Expr::Sine(table, _) => self.read((true, *table), times),
            Expr::Lookup(table, _) => self.read((false, *table), times),
            Expr::Entry(_) => p.entry,
            Expr::Load(..) => p.load[size],
        };
        self.take(&sequence, times, share);
    }

    fn product(&mut self, half: usize, a: &Typed, b: &Typed, times: f64, share: f64) -> Sequence {
        let p = self.walk.processor;
        let size = size_of(a.ty);
        if let Some(power) = [a, b].iter().find_map(|v| power_of_two(v)) {
            return match (power, half, size) {
                (0, ..) => Sequence::NONE,
                (_, 0, 1) => p.shift[0],
                (_, half, _) => p.shift[half],
            };
        }
        let short = |v: &Typed| self.uses.range(v).is_some_and(|r| r.bits() <= 16);
        let narrow = |v: &Typed| self.uses.is_narrow(v);
        let sequence = match (size, narrow(a), narrow(b)) {
            _ if size < 2 && short(a) && short(b) => p.multiply_short,
            (0, ..) => p.multiply[0],
            (1, true, true) if half == 0 => p.multiply[0],
            (1, true, true) => p.multiply_long,
            (1, false, false) => p.multiply[1],
            (1, ..) => p.multiply_mixed,
            _ => p.multiply[2],
        };
        if [a, b].iter().any(|v| matches!(v.value, Value::Constant(_))) {
            self.take(&p.constant, times, share);
        }
        sequence
    }

    /// Nothing where a shift has left no other bits.
    fn mask(&self, half: usize, a: &Typed, bits: u32) -> Sequence {
        let shifted = |v: &Typed| match v.value {
            Value::Temp(t) => match self.uses.temp(t).made {
                Some(Expr::Shr(from, count)) => Some((from.ty, count)),
                _ => None,
            },
            _ => None,
        };
        let through = |v: &Typed| match v.value {
            Value::Temp(t) => match self.uses.temp(t).made {
                Some(Expr::Low(from)) => shifted(&from),
                _ => None,
            },
            _ => None,
        };
        let left = shifted(a).or_else(|| through(a)).map(|(ty, count)| {
            let width = 32 << size_of(ty);
            width - count.min(width)
        });
        match left {
            Some(left) if left <= bits => Sequence::NONE,
            _ => self.walk.processor.mask[half],
        }
    }

    fn limit(&self, size: usize, low: i128, high: i128) -> Sequence {
        let p = self.walk.processor;
        let power = |v: i128| v > 0 && v & (v - 1) == 0;
        match p.saturate {
            Some(saturate) if size == 0 && power(high + 1) && (low == 0 || low == -high - 1) => {
                saturate
            }
            _ => p.clamp[size],
        }
    }

    fn read(&mut self, table: (bool, usize), times: f64) -> Sequence {
        if self.tables.insert(table) {
            self.take(&self.walk.processor.base, times, 1.0);
        }
        self.walk.processor.read
    }
}

/// The exponent of a constant that is a power of two.
fn power_of_two(v: &Typed) -> Option<u32> {
    match v.value {
        Value::Constant(c) if c > 0 && c & (c - 1) == 0 => Some(c.trailing_zeros()),
        _ => None,
    }
}

fn is_immediate(word: i32, immediate: Immediate) -> bool {
    match immediate {
        Immediate::Below(limit) => word.unsigned_abs() < limit,
        Immediate::Rotated => [word, word.wrapping_neg()].iter().any(|w| {
            let w = *w as u32;
            w < 256 || 32 - w.leading_zeros() - w.trailing_zeros() <= 8
        }),
    }
}
