//! The recorded program: functions of integer operations with the interval of every value.

use crate::numeric::arithmetic::{IndexTable, Port, SineTable, Table};
use crate::numeric::cast::Cast;

/// A value inside one function: the position of the node that makes it.
pub type Id = usize;

/// A closed interval of raw integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interval {
    /// The smallest value.
    pub low: i128,
    /// The largest value.
    pub high: i128,
}

impl Interval {
    /// One value.
    pub const fn point(v: i128) -> Self {
        Interval { low: v, high: v }
    }

    /// `low ..= high`.
    pub const fn new(low: i128, high: i128) -> Self {
        Interval { low, high }
    }

    /// All two's-complement words of `bits` bits.
    pub fn of_bits(bits: u32) -> Self {
        let half = 1i128 << (bits - 1);
        Interval::new(-half, half - 1)
    }

    /// The smallest interval that holds both.
    pub fn join(self, other: Self) -> Self {
        Interval::new(self.low.min(other.low), self.high.max(other.high))
    }

    /// The part that both hold; `self` if there is none.
    pub fn meet(self, low: i128, high: i128) -> Self {
        let (l, h) = (self.low.max(low), self.high.min(high));
        if l <= h { Interval::new(l, h) } else { self }
    }

    /// True if every value is in `low ..= high`.
    pub fn is_within(self, low: i128, high: i128) -> bool {
        self.low >= low && self.high <= high
    }

    /// The width of the narrowest two's-complement word that holds every value.
    pub fn bits(self) -> u32 {
        let magnitude = |v: i128| if v < 0 { !v } else { v };
        128 - magnitude(self.low)
            .max(magnitude(self.high))
            .leading_zeros()
            + 1
    }
}

/// What a node computes. Words are signed integers of any width; residues are unsigned modulo
/// 2^bits of their ring; tests are Booleans.
#[derive(Debug, Clone, PartialEq)]
pub enum Op {
    /// The k-th input.
    Input(usize),
    /// A word of the state: slot and element.
    LoadWord(usize, usize),
    /// A residue of the state: slot and element.
    LoadResidue(usize, usize),
    /// A constant word.
    Constant(i128),
    /// a + b.
    Add(Id, Id),
    /// a - b.
    Sub(Id, Id),
    /// a * b.
    Mul(Id, Id),
    /// -a.
    Neg(Id),
    /// The k-th cast of the program's list.
    Cast(Id, usize),
    /// Two's-complement low bits.
    Wrap(Id, u32),
    /// Limited to low ..= high.
    Limit(Id, i128, i128),
    /// a < 0.
    IsNegative(Id),
    /// test ? yes : no.
    Select(Id, Id, Id),
    /// A word taken modulo 2^bits.
    Residue(Id, u32),
    /// A constant residue.
    ResidueConstant(u128, u32),
    /// Modular sum.
    ResidueAdd(Id, Id, u32),
    /// Modular difference.
    ResidueSub(Id, Id, u32),
    /// The word in [-2^(bits-1), 2^(bits-1)) that the residue stands for.
    Centered(Id, u32),
    /// Entry of a sine table at the phase: table number.
    Sine(Id, usize),
    /// Entry of a table at a word: table number.
    Lookup(Id, usize),
    /// floor(a / 2^index) by the loop's index.
    ShiftByIndex(Id),
    /// Entry of a table at the loop's index: table number.
    Entry(usize),
    /// A value carried around loop l: position k.
    Phi(usize, usize),
    /// The value k of loop l after its last iteration.
    LoopOut(usize, usize),
    /// A call: number in the function's list.
    Call(usize),
    /// Output k of call c.
    CallOut(usize, usize),
}

/// One node.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// What it computes.
    pub op: Op,
    /// Every value that it can have (words; residues and calls: meaningless).
    pub range: Interval,
}

/// A counted loop: nodes `start .. end`, of which the first are the phis.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// The first phi.
    pub start: Id,
    /// One past the last node of the body.
    pub end: Id,
    /// Iterations.
    pub count: u32,
    /// What the phis hold at first.
    pub inits: Vec<Id>,
    /// What they take from an iteration.
    pub outs: Vec<Id>,
}

/// A call of another function of the program.
#[derive(Debug, Clone, PartialEq)]
pub struct CallSite {
    /// Number of the callee.
    pub function: usize,
    /// The member of the state that it works on; empty if it has no state.
    pub instance: &'static str,
    /// Arguments.
    pub arguments: Vec<Id>,
}

/// A state variable (or array) of a block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Slot {
    /// Name of the member.
    pub name: &'static str,
    /// Elements; 1 = no array.
    pub len: usize,
    /// Word or residue.
    pub kind: SlotKind,
}

/// What a state variable holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlotKind {
    /// A word that stays inside the interval.
    Word(Interval),
    /// A residue modulo 2^bits.
    Residue(u32),
}

/// A function of the program.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Function {
    /// The block's name.
    pub name: String,
    /// What it is for, in a sentence.
    pub purpose: &'static str,
    /// The name of its state's type; empty = none.
    pub state: &'static str,
    /// The state's variables.
    pub slots: Vec<Slot>,
    /// Members of the state that callees work on: (member, type).
    pub members: Vec<(&'static str, &'static str)>,
    /// Inputs with their ranges.
    pub inputs: Vec<(Port, Interval)>,
    /// Outputs: port and node.
    pub outputs: Vec<(Port, Id)>,
    /// State written at the end: slot, element, node.
    pub stores: Vec<(usize, usize, Id)>,
    /// All nodes, in order of evaluation.
    pub nodes: Vec<Node>,
    /// Loops.
    pub loops: Vec<Loop>,
    /// Calls.
    pub calls: Vec<CallSite>,
    /// Values with a name of their own.
    pub names: std::collections::BTreeMap<Id, &'static str>,
}

/// Everything that was recorded.
#[derive(Debug, Clone, Default)]
pub struct Program {
    /// Functions, callees before callers.
    pub functions: Vec<Function>,
    /// Casts by number.
    pub casts: Vec<Cast>,
    /// What reached each cast before its overflow step; `None` = never traced.
    pub cast_ranges: Vec<Option<Interval>>,
    /// Sine tables.
    pub sine_tables: Vec<SineTable>,
    /// Tables by loop index.
    pub index_tables: Vec<IndexTable>,
    /// Tables by a word.
    pub tables: Vec<Table>,
}

impl Function {
    /// The operands of a node.
    pub fn operands(&self, id: Id) -> Vec<Id> {
        match &self.nodes[id].op {
            Op::Add(a, b) | Op::Sub(a, b) | Op::Mul(a, b) => vec![*a, *b],
            Op::ResidueAdd(a, b, _) | Op::ResidueSub(a, b, _) => vec![*a, *b],
            Op::Neg(a)
            | Op::Cast(a, _)
            | Op::Wrap(a, _)
            | Op::Limit(a, _, _)
            | Op::IsNegative(a)
            | Op::Residue(a, _)
            | Op::Centered(a, _)
            | Op::Sine(a, _)
            | Op::Lookup(a, _)
            | Op::ShiftByIndex(a) => vec![*a],
            Op::Select(t, a, b) => vec![*t, *a, *b],
            Op::Call(c) => self.calls[*c].arguments.clone(),
            _ => Vec::new(),
        }
    }

    /// For each node: true if nothing but wraps and residues of at most 64 bits look at it, directly
    /// or through a selection, so that its low 64 bits are enough whatever its range.
    pub fn modular(&self) -> Vec<bool> {
        let mut uses = vec![0usize; self.nodes.len()];
        let mut low_bits_only = vec![0usize; self.nodes.len()];
        let mut modular = vec![false; self.nodes.len()];
        let kept = self.outputs.iter().map(|(_, id)| *id);
        let kept = kept.chain(self.stores.iter().map(|(_, _, id)| *id));
        let carried = self
            .loops
            .iter()
            .flat_map(|l| l.inits.iter().chain(&l.outs));
        for id in kept.chain(carried.copied()) {
            uses[id] += 1;
        }
        // Users come after what they use (a loop's carried values are kept above).
        for id in (0..self.nodes.len()).rev() {
            let op = &self.nodes[id].op;
            let summing = matches!(op, Op::Add(..) | Op::Sub(..) | Op::Neg(_) | Op::Select(..));
            modular[id] = summing && uses[id] > 0 && uses[id] == low_bits_only[id];
            for (k, operand) in self.operands(id).into_iter().enumerate() {
                uses[operand] += 1;
                let low_bits = match *op {
                    Op::Wrap(_, bits) | Op::Residue(_, bits) => bits <= 64,
                    Op::Select(..) => modular[id] && k > 0,
                    _ => false,
                };
                low_bits_only[operand] += usize::from(low_bits);
            }
        }
        modular
    }
}

impl Program {
    /// The function of that name.
    pub fn function(&self, name: &str) -> Option<&Function> {
        self.functions.iter().find(|f| f.name == name)
    }
}
