//! What is left out of a lowered function, and what is written where it is used.

use super::machine::{Expr, Lowered, Statement, Type, Typed, Value, Width, visit_operands};
use std::collections::{BTreeMap, BTreeSet};

/// Removes temporaries that nothing reads; notes of faults and calls stay.
pub(super) fn drop_unused(body: &mut Vec<Statement>, outputs: &[(&'static str, Typed)]) {
    let mut used = BTreeSet::new();
    let mut note = |v: &Typed| {
        if let Value::Temp(t) = v.value {
            used.insert(t);
        }
    };
    outputs.iter().for_each(|(_, v)| note(v));
    visit_operands(body, &mut note);
    let before = count(body);
    retain(body, &|s| match s {
        Statement::Let(t, _, expr, _) => used.contains(t) || matches!(expr, Expr::Check(..)),
        _ => true,
    });
    if count(body) < before {
        drop_unused(body, outputs);
    }
}

/// Moves each store of a state's word, which all stand at the end, to where its value is known and the old word has
/// been read: fewer words are alive at once, and compilers add to memory.
pub(super) fn store_early(body: &mut Vec<Statement>) {
    let is_store = |s: &Statement| matches!(s, Statement::Store(..));
    let stores: Vec<Statement> = body.iter().filter(|s| is_store(s)).cloned().collect();
    body.retain(|s| !is_store(s));
    let mut after: Vec<Vec<Statement>> = vec![Vec::new(); body.len() + 1];
    for store in stores {
        let Statement::Store(slot, element, v) = &store else {
            continue;
        };
        let comes_first = |s: &Statement| {
            matches!(v.value, Value::Temp(k) if defines(s, k))
                || reads(s, &Expr::Load(*slot, *element))
        };
        let place = body.iter().rposition(comes_first);
        after[place.unwrap_or(body.len())].push(store);
    }
    let mut stored = after.into_iter();
    let whole = std::mem::take(body).into_iter();
    body.extend(
        whole
            .zip(&mut stored)
            .flat_map(|(s, more)| std::iter::once(s).chain(more)),
    );
    body.extend(stored.flatten());
}

/// The temporary gets a value in this statement.
fn defines(statement: &Statement, temp: usize) -> bool {
    match statement {
        Statement::Let(k, ..) | Statement::Carry(k, ..) => *k == temp,
        Statement::Call(_, _, results) => results.iter().any(|(k, _)| *k == temp),
        Statement::Loop(_, inner) => inner.iter().any(|s| defines(s, temp)),
        Statement::Next(values) => values.iter().any(|(k, _)| *k == temp),
        Statement::Store(..) => false,
    }
}

/// The statement takes this expression, in a loop too.
fn reads(statement: &Statement, load: &Expr) -> bool {
    match statement {
        Statement::Let(_, _, expr, _) => expr == load,
        Statement::Loop(_, inner) => inner.iter().any(|s| reads(s, load)),
        _ => false,
    }
}

fn count(body: &[Statement]) -> usize {
    body.iter()
        .map(|s| match s {
            Statement::Loop(_, inner) => 1 + count(inner),
            _ => 1,
        })
        .sum()
}

fn retain(body: &mut Vec<Statement>, keep: &dyn Fn(&Statement) -> bool) {
    body.retain(|s| keep(s));
    for s in body {
        if let Statement::Loop(_, inner) = s {
            retain(inner, keep);
        }
    }
}

/// Takes out temporaries that are nothing but another value in another type, and gives them back: the
/// printers write them where they are used. One that a loop's end assigns stays, as what it stands for may
/// have changed by then.
pub(super) fn write_out_conversions(body: &mut Vec<Statement>) -> BTreeMap<usize, (Type, Expr)> {
    let mut kept = Vec::new();
    note_assigned(body, &mut kept);
    let mut written_out = BTreeMap::new();
    take(body, &kept, &mut written_out);
    written_out
}

fn note_assigned(body: &[Statement], kept: &mut Vec<usize>) {
    for statement in body {
        match statement {
            Statement::Loop(_, inner) => note_assigned(inner, kept),
            Statement::Next(values) => {
                kept.extend(values.iter().filter_map(|(_, v)| match v.value {
                    Value::Temp(k) => Some(k),
                    _ => None,
                }))
            }
            _ => {}
        }
    }
}

/// The bits of a parameter of fewer than 32 bits. GCC's `-Wconversion` takes their sum with an unsigned word for one
/// of signed words, unless they have a name.
fn is_of_a_narrow_parameter(expr: &Expr, taken: &BTreeMap<usize, (Type, Expr)>) -> bool {
    let is_narrow = |v: &Typed| {
        let ty = matches!(v.ty, Type::Signed(Width::W8 | Width::W16));
        ty && matches!(v.value, Value::Input(_))
    };
    let Expr::Low(of) = expr else { return false };
    match of.value {
        Value::Temp(k) => matches!(taken.get(&k), Some((_, Expr::Convert(v))) if is_narrow(v)),
        _ => is_narrow(of),
    }
}

fn take(body: &mut Vec<Statement>, kept: &[usize], taken: &mut BTreeMap<usize, (Type, Expr)>) {
    body.retain(|s| match s {
        Statement::Let(k, ty, expr @ (Expr::Convert(_) | Expr::Low(_) | Expr::ToSigned(_)), _)
            if !kept.contains(k) && !is_of_a_narrow_parameter(expr, taken) =>
        {
            taken.insert(*k, (*ty, expr.clone()));
            false
        }
        _ => true,
    });
    for s in body {
        if let Statement::Loop(_, inner) = s {
            take(inner, kept, taken);
        }
    }
}

/// The body with the conversions that are written out put back before the statement that reads them first: what a
/// machine computes, for those who count it.
pub fn with_conversions(lowered: &Lowered) -> Vec<Statement> {
    let mut made = BTreeSet::new();
    let mut whole = put_back(&lowered.body, &lowered.written_out, &mut made);
    for (_, v) in &lowered.outputs {
        convert_before(v, &lowered.written_out, &mut made, &mut whole);
    }
    whole
}

fn put_back(
    body: &[Statement],
    written_out: &BTreeMap<usize, (Type, Expr)>,
    made: &mut BTreeSet<usize>,
) -> Vec<Statement> {
    let mut whole = Vec::new();
    for statement in body {
        if let Statement::Loop(count, inner) = statement {
            let inner = put_back(inner, written_out, made);
            whole.push(Statement::Loop(*count, inner));
            continue;
        }
        let mut read = Vec::new();
        visit_operands(std::slice::from_ref(statement), &mut |v| read.push(*v));
        for v in read {
            convert_before(&v, written_out, made, &mut whole);
        }
        whole.push(statement.clone());
    }
    whole
}

fn convert_before(
    v: &Typed,
    written_out: &BTreeMap<usize, (Type, Expr)>,
    made: &mut BTreeSet<usize>,
    whole: &mut Vec<Statement>,
) {
    let Value::Temp(k) = v.value else { return };
    let Some((ty, expr)) = written_out.get(&k) else {
        return;
    };
    if made.insert(k) {
        for v in expr.operands() {
            convert_before(&v, written_out, made, whole);
        }
        whole.push(Statement::Let(k, *ty, expr.clone(), None));
    }
}
