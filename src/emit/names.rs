//! Names of the temporaries in emitted code: what the block calls a value, else what the operation makes.

use super::machine::{Expr, Statement};
use crate::numeric::cast::Cast;
use crate::numeric::trace::ir::{Function, Id, Op, Program};
use std::collections::BTreeSet;

/// Words that C or Rust keep for themselves, and those that the printers use.
const TAKEN: &str = " \
    as async await auto bool box break case char const continue crate default do double dyn else enum extern \
    false final float fn for gen goto if impl in inline int let long loop macro match mod move mut override \
    priv pub ref register restrict return self short signed sizeof static struct super switch trait true try \
    type typedef typeof union unsafe unsigned unsized use virtual void volatile where while yield \
    s out fault i g row ";

/// The name that a node has from its block: given there, of the output that it is, or of the state that it
/// becomes.
pub(super) fn of_node(function: &Function, id: Id) -> Option<String> {
    if let Some(name) = function.names.get(&id) {
        return Some((*name).to_owned());
    }
    if matches!(
        function.nodes[id].op,
        Op::LoadWord(..) | Op::LoadResidue(..)
    ) {
        return None;
    }
    let named = |(port, _): &&(crate::numeric::arithmetic::Port, Id)| !port.name.is_empty();
    let mut outputs = function.outputs.iter().filter(named);
    if let Some((port, _)) = outputs.find(|(_, node)| *node == id) {
        return Some(port.name.to_owned());
    }
    let stored = function.stores.iter().find(|(_, _, node)| *node == id);
    stored.map(|(slot, element, _)| format!("new_{}", of_slot(function, *slot, *element)))
}

fn of_slot(function: &Function, slot: usize, element: usize) -> String {
    let slot = &function.slots[slot];
    match slot.len {
        1 => slot.name.to_owned(),
        _ => format!("{}_{element}", slot.name),
    }
}

/// The name of what an operation makes.
pub(super) fn of_operation(program: &Program, function: &Function, expr: &Expr) -> String {
    let plain = match expr {
        Expr::Convert(_) | Expr::Low(_) | Expr::ToSigned(_) => "word",
        Expr::SignExtend(..) => "wrapped",
        Expr::Add(..) => "sum",
        Expr::Sub(..) => "difference",
        Expr::Mul(..) => "product",
        Expr::Neg(_) => "negated",
        Expr::Asr(..) | Expr::AsrIndex(_) | Expr::ShrIndex(_) | Expr::ShrPositive(..) => "shifted",
        Expr::Shl(..) | Expr::Shr(..) => "shifted",
        Expr::Mask(..) => "low_bits",
        Expr::IsNegative(_) => "is_negative",
        Expr::Select(..) => "selected",
        Expr::Clamp(..) => "limited",
        Expr::Check(..) => "checked",
        Expr::Sine(..) => "sine",
        Expr::Lookup(k, _) => return format!("{}_entry", program.tables[*k].name),
        Expr::Entry(k) => return format!("{}_entry", program.index_tables[*k].name),
        Expr::Load(slot, element) => return of_slot(function, *slot, *element),
    };
    plain.to_owned()
}

/// A cast in words: the format that it makes, how it rounds and what happens outside.
pub(super) fn of_cast(cast: &Cast) -> String {
    let target = cast.target;
    let unsigned = if target.signed { "" } else { "U" };
    let integer_bits = target.bits as i32 - target.fraction_bits;
    let mut words = match cast.overflow {
        // Exact: as wide as the value needs.
        None => format!("2^{} units", -target.fraction_bits),
        Some(_) => format!("{unsigned}Q{integer_bits}.{}", target.fraction_bits),
    };
    if cast.shift > 0 {
        words += &format!(", {}", cast.rounding.name());
    }
    match cast.overflow {
        Some(overflow) => words + &format!(", {}", overflow.name()),
        None => words,
    }
}

/// Names that are all different, in the order of the statements: the second `sum` is `sum_2`.
pub(super) fn distinct(
    program: &Program,
    function: &Function,
    body: &[Statement],
    wishes: &[String],
) -> Vec<String> {
    let mut taken: BTreeSet<String> = TAKEN.split(' ').map(str::to_owned).collect();
    taken.extend(function.inputs.iter().map(|(port, _)| port.name.to_owned()));
    let mut naming = Naming {
        program,
        function,
        wishes,
        names: wishes.to_vec(),
        taken,
    };
    naming.body(body);
    naming.names
}

struct Naming<'a> {
    program: &'a Program,
    function: &'a Function,
    wishes: &'a [String],
    names: Vec<String>,
    taken: BTreeSet<String>,
}

impl Naming<'_> {
    fn body(&mut self, body: &[Statement]) {
        for statement in body {
            match statement {
                Statement::Let(k, ..) | Statement::Carry(k, ..) => self.name(*k, None),
                Statement::Loop(_, inner) => self.body(inner),
                Statement::Call(number, _, results) => {
                    let callee = self.function.calls[*number].function;
                    results
                        .iter()
                        .for_each(|(k, _)| self.name(*k, Some(callee)));
                }
                Statement::Next(_) | Statement::Store(..) => {}
            }
        }
    }

    /// Names temporary `k`, which is a result of the function `callee` if there is one. In Rust a variable
    /// hides a function of its name: none but the result of its only call has it.
    fn name(&mut self, k: usize, callee: Option<usize>) {
        let hides = |name: &str| {
            let called = |c: &&crate::numeric::trace::ir::CallSite| {
                self.program.functions[c.function].name == name
            };
            let calls: Vec<usize> = self
                .function
                .calls
                .iter()
                .filter(called)
                .map(|c| c.function)
                .collect();
            !calls.is_empty() && (calls.len() > 1 || callee != Some(calls[0]))
        };
        let wish = match self.wishes[k].as_str() {
            "" => "word",
            wish => wish,
        };
        // `c0`, `c1`, ... hold what calls return.
        let is_free = |name: &String| {
            let is_call = name
                .strip_prefix('c')
                .is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
            !self.taken.contains(name) && !is_call && !hides(name)
        };
        let numbered = (2..).map(|n| format!("{wish}_{n}"));
        let found = std::iter::once(wish.to_owned())
            .chain(numbered)
            .find(is_free);
        let name = found.unwrap_or_default();
        self.taken.insert(name.clone());
        self.names[k] = name;
    }
}
