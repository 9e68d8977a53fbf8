//! A block's state while it is recorded: loads in place of its words before the step, stores after it.

use super::Trace;
use super::ir::{Id, Interval, Op, Slot, SlotKind};
use crate::numeric::arithmetic::{Ring, StateVisitor};

/// Replaces a state's words by loads.
pub(super) struct Loader<'a> {
    pub(super) trace: &'a Trace,
}

impl Loader<'_> {
    fn slot(&self, name: &'static str, len: usize, kind: SlotKind) -> usize {
        self.trace.with(|frame| {
            frame.function.slots.push(Slot { name, len, kind });
            frame.function.slots.len() - 1
        })
    }
}

impl StateVisitor<Trace> for Loader<'_> {
    fn word(&mut self, name: &'static str, word: &mut Id, low: i128, high: i128) {
        let range = Interval::new(low, high);
        let slot = self.slot(name, 1, SlotKind::Word(range));
        *word = self.trace.push(Op::LoadWord(slot, 0), range);
    }

    fn residues(&mut self, name: &'static str, residues: &mut [Id], ring: &Ring) {
        let slot = self.slot(name, residues.len(), SlotKind::Residue(ring.bits));
        for (k, residue) in residues.iter_mut().enumerate() {
            *residue = self
                .trace
                .push(Op::LoadResidue(slot, k), Interval::point(0));
        }
    }
}

/// Notes what a state's words have become.
pub(super) struct Storer<'a> {
    pub(super) trace: &'a Trace,
    pub(super) slot: usize,
}

impl Storer<'_> {
    fn store(&mut self, ids: &[Id]) {
        let slot = self.slot;
        self.slot += 1;
        self.trace.with(|frame| {
            for (k, id) in ids.iter().enumerate() {
                let node = &frame.function.nodes[*id];
                let unchanged =
                    node.op == Op::LoadWord(slot, k) || node.op == Op::LoadResidue(slot, k);
                if !unchanged {
                    if let SlotKind::Word(declared) = frame.function.slots[slot].kind {
                        assert!(
                            node.range.is_within(declared.low, declared.high),
                            "state {} leaves its declared range",
                            frame.function.slots[slot].name
                        );
                    }
                    frame.function.stores.push((slot, k, *id));
                }
            }
        });
    }
}

impl StateVisitor<Trace> for Storer<'_> {
    fn word(&mut self, _name: &'static str, word: &mut Id, _low: i128, _high: i128) {
        self.store(&[*word]);
    }
    fn residues(&mut self, _name: &'static str, residues: &mut [Id], _ring: &Ring) {
        self.store(residues);
    }
}
