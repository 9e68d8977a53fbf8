//! Spells lowered functions in Rust: `no_std`, no unsafe code, and no operation that can panic in
//! any build (wrapping operators where ranges prove that nothing wraps, checked table access).

use super::bundle::Bundle;
use super::machine::{Expr, Lowered, Statement, Type, Typed, Value, Width};
use super::views::table_type;
use crate::numeric::trace::ir::{Function, Interval};
use std::fmt::Write as _;

/// The Rust type.
pub fn type_name(ty: Type) -> &'static str {
    match ty {
        Type::Signed(Width::W8) => "i8",
        Type::Signed(Width::W16) => "i16",
        Type::Unsigned(Width::W8) => "u8",
        Type::Unsigned(Width::W16) => "u16",
        Type::Signed(Width::W32) => "i32",
        Type::Signed(Width::W64) => "i64",
        Type::Signed(Width::W128) => "i128",
        Type::Unsigned(Width::W32) => "u32",
        Type::Unsigned(Width::W64) => "u64",
        Type::Unsigned(Width::W128) => "u128",
        Type::Bool => "bool",
    }
}

/// A constant of a type.
pub fn constant(raw: i128, ty: Type) -> String {
    match ty {
        Type::Unsigned(Width::W128) => format!("{}_u128", raw as u128),
        Type::Unsigned(Width::W64) => format!("{}_u64", raw as u64),
        Type::Unsigned(width @ (Width::W8 | Width::W16)) => format!("{raw}_u{}", width.bits()),
        Type::Unsigned(Width::W32) => format!("{}_u32", raw as u32),
        Type::Signed(_) => format!("{raw}_{}", type_name(ty)),
        Type::Bool => (raw != 0).to_string(),
    }
}

/// `two_words` as `TwoWords`.
pub fn camel(name: &str) -> String {
    name.split('_')
        .map(|word| {
            let mut letters = word.chars();
            match letters.next() {
                Some(first) => first.to_uppercase().collect::<String>() + letters.as_str(),
                None => String::new(),
            }
        })
        .collect()
}

/// What a function returns.
fn result_type(bundle: &Bundle, number: usize) -> Option<String> {
    let (function, lowered) = (&bundle.program.functions[number], &bundle.lowered[number]);
    match lowered.outputs.as_slice() {
        [] => None,
        [(_, v)] => Some(type_name(v.ty).to_owned()),
        _ => Some(format!("{}Out", camel(&function.name))),
    }
}

/// The definition of a function.
pub fn definition(bundle: &Bundle, number: usize) -> String {
    let printer = Printer {
        bundle,
        function: &bundle.program.functions[number],
        lowered: &bundle.lowered[number],
    };
    let (function, lowered) = (printer.function, printer.lowered);
    let mut parameters = Vec::new();
    if !function.state.is_empty() {
        parameters.push(format!("s: &mut {}", camel(function.state)));
    }
    for ((port, _), ty) in function.inputs.iter().zip(&lowered.inputs) {
        parameters.push(format!("{}: {}", port.name, type_name(*ty)));
    }
    if lowered.may_fault {
        parameters.push("fault: &mut u32".into());
    }
    let result = result_type(bundle, number).map_or(String::new(), |t| format!(" -> {t}"));
    let name = &function.name;
    // Of no use but for its result.
    let must_use = match function.state.is_empty() && !lowered.outputs.is_empty() {
        true => "#[must_use]\n",
        false => "",
    };
    let mut text = must_use.to_owned();
    text += &format!("pub fn {name}({}){result} {{\n", parameters.join(", "));
    for k in lowered.unused_inputs() {
        _ = writeln!(text, "    let _ = {};", function.inputs[k].0.name);
    }
    printer.statements(&lowered.body, 1, &mut text);
    match lowered.outputs.as_slice() {
        [] => {}
        [(_, v)] => _ = writeln!(text, "    {}", printer.value(v)),
        several => {
            _ = writeln!(text, "    {}Out {{", camel(name));
            for (name, v) in several {
                let value = printer.value(v);
                _ = match value == *name {
                    true => writeln!(text, "        {name},"),
                    false => writeln!(text, "        {name}: {value},"),
                };
            }
            text.push_str("    }\n");
        }
    }
    text.push_str("}\n");
    text
}

struct Printer<'a> {
    bundle: &'a Bundle,
    function: &'a Function,
    lowered: &'a Lowered,
}

impl Printer<'_> {
    fn value(&self, v: &Typed) -> String {
        match v.value {
            Value::Temp(k) => match self.lowered.written_out.get(&k) {
                Some((ty, expr)) => self.expression(expr, *ty),
                None => self.lowered.names[k].clone(),
            },
            Value::Constant(raw) => constant(raw, v.ty),
            Value::Input(k) => self.function.inputs[k].0.name.to_owned(),
        }
    }

    fn name(&self, k: usize) -> &str {
        &self.lowered.names[k]
    }

    fn state(&self, slot: usize, element: usize) -> String {
        let slot = &self.function.slots[slot];
        if slot.len > 1 {
            format!("s.{}[{element}]", slot.name)
        } else {
            format!("s.{}", slot.name)
        }
    }

    fn statements(&self, body: &[Statement], depth: usize, text: &mut String) {
        let indent = "    ".repeat(depth);
        for statement in body {
            match statement {
                Statement::Let(k, ty, expr, range) => {
                    let expr = self.expression(expr, *ty);
                    let comment = comment(self.lowered.notes.get(k), *range);
                    _ = writeln!(
                        text,
                        "{indent}let {}: {} = {expr};{comment}",
                        self.name(*k),
                        type_name(*ty)
                    );
                }
                Statement::Carry(k, ty, init) => {
                    let init = self.value(init);
                    let name = self.name(*k);
                    _ = writeln!(text, "{indent}let mut {name}: {} = {init};", type_name(*ty));
                }
                Statement::Loop(count, inner) => {
                    _ = writeln!(text, "{indent}for i in 0_u32..{count} {{");
                    self.statements(inner, depth + 1, text);
                    _ = writeln!(text, "{indent}}}");
                }
                Statement::Next(values) => {
                    for (k, v) in values {
                        _ = writeln!(text, "{indent}{} = {};", self.name(*k), self.value(v));
                    }
                }
                Statement::Call(number, arguments, results) => {
                    self.call(*number, arguments, results, &indent, text);
                }
                Statement::Store(slot, element, v) => {
                    let target = self.state(*slot, *element);
                    _ = writeln!(text, "{indent}{target} = {};", self.value(v));
                }
            }
        }
    }

    fn call(
        &self,
        number: usize,
        arguments: &[Typed],
        results: &[(usize, Type)],
        indent: &str,
        text: &mut String,
    ) {
        let site = &self.function.calls[number];
        let callee = &self.bundle.program.functions[site.function];
        let lowered = &self.bundle.lowered[site.function];
        let mut passed = Vec::new();
        if !site.instance.is_empty() {
            passed.push(format!("&mut s.{}", site.instance));
        }
        passed.extend(arguments.iter().map(|a| self.value(a)));
        if lowered.may_fault {
            passed.push("fault".into());
        }
        let call = format!("{}({})", callee.name, passed.join(", "));
        match results {
            [] => _ = writeln!(text, "{indent}{call};"),
            [(k, ty)] => {
                let name = self.name(*k);
                _ = writeln!(text, "{indent}let {name}: {} = {call};", type_name(*ty));
            }
            several => {
                _ = writeln!(text, "{indent}let c{number} = {call};");
                for ((k, ty), (name, _)) in several.iter().zip(&lowered.outputs) {
                    let ty = type_name(*ty);
                    let result = self.name(*k);
                    _ = writeln!(text, "{indent}let {result}: {ty} = c{number}.{name};");
                }
            }
        }
    }

    fn expression(&self, expr: &Expr, ty: Type) -> String {
        let v = |t: &Typed| self.value(t);
        // `-1.f()` is `-(1.f())`.
        let receiver = |t: &Typed| match t.value {
            Value::Constant(raw) if raw < 0 => format!("({})", self.value(t)),
            Value::Temp(k) if self.lowered.written_out.contains_key(&k) => {
                format!("({})", self.value(t))
            }
            _ => self.value(t),
        };
        let name = type_name(ty);
        match expr {
            Expr::Convert(a) | Expr::Low(a) | Expr::ToSigned(a) => {
                format!("{} as {name}", receiver(a))
            }
            Expr::SignExtend(a, bits) => {
                let Type::Unsigned(width) = a.ty else {
                    return v(a);
                };
                match width.bits() - bits {
                    0 => format!("{} as {name}", v(a)),
                    spare => format!(
                        "({}.wrapping_shl({spare}) as {name}) >> {spare}",
                        receiver(a)
                    ),
                }
            }
            Expr::Add(a, b) => format!("{}.wrapping_add({})", receiver(a), v(b)),
            Expr::Sub(a, b) => format!("{}.wrapping_sub({})", receiver(a), v(b)),
            Expr::Mul(a, b) => format!("{}.wrapping_mul({})", receiver(a), v(b)),
            Expr::Neg(a) => format!("{}.wrapping_neg()", receiver(a)),
            Expr::Asr(a, n) | Expr::ShrPositive(a, n) => format!("{} >> {n}", v(a)),
            Expr::AsrIndex(a) | Expr::ShrIndex(a) => format!("{}.wrapping_shr(i)", receiver(a)),
            Expr::Shl(a, n) => format!("{} << {n}", receiver(a)),
            Expr::Shr(a, n) => format!("{} >> {n}", v(a)),
            Expr::Mask(a, n) => {
                format!("{} & {}", v(a), constant(((1u128 << n) - 1) as i128, a.ty))
            }
            Expr::IsNegative(a) => format!("{} < 0", receiver(a)),
            Expr::Select(t, a, b) => format!("if {} {{ {} }} else {{ {} }}", v(t), v(a), v(b)),
            Expr::Clamp(a, low, high) => format!(
                "{}.max({}).min({})",
                receiver(a),
                constant(*low, ty),
                constant(*high, ty)
            ),
            Expr::Check(a, low, high, fault) => format!(
                "check_{name}({}, {}, {}, {fault}, fault)",
                v(a),
                constant(*low, ty),
                constant(*high, ty)
            ),
            Expr::Sine(k, index) => {
                let entries = &self.bundle.program.sine_tables[*k].entries;
                entry(
                    &format!("SINE_{k}"),
                    &v(index),
                    table_type(entries, false).1,
                    name,
                )
            }
            Expr::Lookup(k, index) => {
                let table = &self.bundle.program.tables[*k];
                let ty = table_type(&table.entries, true).1;
                entry(&table.name.to_uppercase(), &v(index), ty, name)
            }
            Expr::Entry(k) => {
                let table = &self.bundle.program.index_tables[*k];
                let ty = table_type(&table.entries, false).1;
                entry(&table.name.to_uppercase(), "i", ty, name)
            }
            Expr::Load(slot, element) => self.state(*slot, *element),
        }
    }
}

/// What a word is and its range, as a comment.
fn comment(note: Option<&String>, range: Option<Interval>) -> String {
    let range = range.map(|r| format!("{} .. {}", r.low, r.high));
    let words: Vec<String> = note.cloned().into_iter().chain(range).collect();
    match words.as_slice() {
        [] => String::new(),
        words => format!(" // {}", words.join("; ")),
    }
}

/// An entry of a table of words of type `held`, as one of type `wanted`; an index is in range, and nothing panics.
fn entry(table: &str, index: &str, held: &str, wanted: &str) -> String {
    let entry = format!("{table}.get({index} as usize).copied().unwrap_or(0)");
    if held == wanted {
        entry
    } else {
        format!("{entry} as {wanted}")
    }
}
