//! Damage to recorded functions, which vectors have to tell from the functions.

use super::interpreter::Interpreter;
use crate::numeric::trace::ir::{Id, Op};

/// Damage to one operation of a function, which vectors have to tell from the function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// The node's result, or for a test its operand, moves by this.
    Result(Id, i128),
    /// A sum becomes a difference and the reverse, a product a sum, a selection the other one; of a cast and
    /// a wrap, one bit more.
    Operator(Id),
    /// Of a cast and a wrap, one bit less; of a selection, always the first; of a test, the other outcome.
    Other(Id),
    /// The lower limit of a cast or limit moves by this.
    Low(Id, i128),
    /// The upper limit.
    High(Id, i128),
    /// A store is left out.
    Store(usize),
}

impl Damage {
    /// The operation; `None` for a store.
    pub(super) fn node(self) -> Option<Id> {
        match self {
            Damage::Result(id, _)
            | Damage::Operator(id)
            | Damage::Other(id)
            | Damage::Low(id, _)
            | Damage::High(id, _) => Some(id),
            Damage::Store(_) => None,
        }
    }
}

impl Interpreter {
    /// Every damage that vectors are searched for.
    pub fn damages(&self, function: usize) -> Vec<Damage> {
        let f = &self.program().functions[function];
        let mut all = Vec::new();
        for (id, node) in f.nodes.iter().enumerate() {
            let moved = [Damage::Result(id, -1), Damage::Result(id, 1)];
            match node.op {
                Op::Input(_) | Op::Call(_) | Op::Phi(..) | Op::LoopOut(..) => {}
                Op::Add(..)
                | Op::Sub(..)
                | Op::Mul(..)
                | Op::ResidueAdd(..)
                | Op::ResidueSub(..) => {
                    all.extend(moved);
                    all.push(Damage::Operator(id));
                }
                Op::Cast(_, number) => {
                    // One more before it: its rounding constant.
                    all.extend(moved);
                    all.extend([Damage::Operator(id), Damage::Other(id)]);
                    if !self.program().is_proved_in_range(number) {
                        all.extend([-1, 1].map(|step| Damage::Low(id, step)));
                        all.extend([-1, 1].map(|step| Damage::High(id, step)));
                    }
                }
                Op::Limit(..) => {
                    all.extend([-1, 1].map(|step| Damage::Low(id, step)));
                    all.extend([-1, 1].map(|step| Damage::High(id, step)));
                }
                Op::Wrap(..) | Op::Select(..) | Op::IsNegative(_) => {
                    all.extend(moved);
                    all.extend([Damage::Operator(id), Damage::Other(id)]);
                }
                _ => all.extend(moved),
            }
        }
        all.extend((0..f.stores.len()).map(Damage::Store));
        all
    }
}
