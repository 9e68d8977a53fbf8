//! The words of a function's state, by their names and ranges.

use super::interpreter::low_bits;
use crate::numeric::trace::ir::{Interval, Program, SlotKind};

/// A word or residue of a state, at its place in the state's type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateWord {
    /// Members on the way and the variable, from the state's own type: `["nco", "phase"]`.
    pub path: Vec<&'static str>,
    /// Element of the variable, where it is an array.
    pub element: Option<usize>,
    /// What it holds.
    pub kind: SlotKind,
}

impl StateWord {
    /// Every value that it can have.
    pub fn range(&self) -> Interval {
        match self.kind {
            SlotKind::Word(range) => range,
            SlotKind::Residue(bits) => Interval::new(0, low_bits(-1, bits)),
        }
    }

    /// Its machine type has 128 bits.
    pub fn is_wide(&self) -> bool {
        match self.kind {
            SlotKind::Word(range) => range.bits() > 64,
            SlotKind::Residue(bits) => bits > 64,
        }
    }

    /// `nco.phase`, `cic.integrator[1]`.
    pub fn name(&self) -> String {
        let path = self.path.join(".");
        match self.element {
            Some(k) => format!("{path}[{k}]"),
            None => path,
        }
    }
}

/// The words of a state's type: its variables, then its members'.
pub(super) fn words(program: &Program, state: &str, before: &[&'static str]) -> Vec<StateWord> {
    let path = |name| [before, &[name]].concat();
    let own = || program.functions.iter().filter(|f| f.state == state);
    let mut all: Vec<StateWord> = Vec::new();
    for slot in own().flat_map(|f| &f.slots) {
        if !all.iter().any(|word| word.path == path(slot.name)) {
            all.extend((0..slot.len).map(|k| StateWord {
                path: path(slot.name),
                element: (slot.len > 1).then_some(k),
                kind: slot.kind,
            }));
        }
    }
    let mut seen: Vec<&str> = Vec::new();
    for (member, ty) in own().flat_map(|f| &f.members) {
        if !seen.contains(member) {
            seen.push(member);
            all.extend(words(program, ty, &path(member)));
        }
    }
    all
}
