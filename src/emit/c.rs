//! Spells lowered functions in C99: no float, no allocation, no undefined and no
//! implementation-defined behaviour. Shifts of signed values, sign extensions and 128-bit words go
//! through helpers of the emitted `*_arith.h`.

use super::bundle::Bundle;
use super::machine::{Expr, Lowered, Statement, Type, Typed, Value, Width};
use crate::numeric::trace::ir::{Function, Interval};
use std::fmt::Write as _;

/// The C type.
pub fn type_name(prefix: &str, ty: Type) -> String {
    match ty {
        Type::Signed(Width::W8) => "int8_t".into(),
        Type::Signed(Width::W16) => "int16_t".into(),
        Type::Unsigned(Width::W8) => "uint8_t".into(),
        Type::Unsigned(Width::W16) => "uint16_t".into(),
        Type::Signed(Width::W32) => "int32_t".into(),
        Type::Signed(Width::W64) => "int64_t".into(),
        Type::Unsigned(Width::W32) => "uint32_t".into(),
        Type::Unsigned(Width::W64) => "uint64_t".into(),
        Type::Signed(Width::W128) | Type::Unsigned(Width::W128) => format!("{prefix}_w128_t"),
        Type::Bool => "bool".into(),
    }
}

/// A constant of a type.
pub fn constant(prefix: &str, raw: i128, ty: Type) -> String {
    match ty {
        Type::Signed(Width::W32) if raw == i128::from(i32::MIN) => {
            "(-INT32_C(2147483647) - INT32_C(1))".into()
        }
        Type::Signed(Width::W64) if raw == i128::from(i64::MIN) => {
            "(-INT64_C(9223372036854775807) - INT64_C(1))".into()
        }
        Type::Signed(Width::W32) if raw < 0 => format!("(-INT32_C({}))", -raw),
        Type::Signed(Width::W32) => format!("INT32_C({raw})"),
        Type::Signed(Width::W64) if raw < 0 => format!("(-INT64_C({}))", -raw),
        Type::Signed(Width::W64) => format!("INT64_C({raw})"),
        Type::Unsigned(Width::W32) => format!("UINT32_C({})", raw as u32),
        Type::Unsigned(Width::W64) => format!("UINT64_C({})", raw as u64),
        Type::Signed(Width::W128) | Type::Unsigned(Width::W128) => format!(
            "{prefix}_w128_make(UINT64_C({}), UINT64_C({}))",
            (raw as u128 >> 64) as u64,
            raw as u64
        ),
        Type::Signed(Width::W8 | Width::W16) | Type::Unsigned(Width::W8 | Width::W16) => {
            format!("({}){raw}", type_name(prefix, ty))
        }
        Type::Bool => if raw == 0 { "false" } else { "true" }.into(),
    }
}

/// The declaration of a function, without `;`.
pub fn signature(bundle: &Bundle, number: usize) -> String {
    let (function, lowered) = (&bundle.program.functions[number], &bundle.lowered[number]);
    let p = &bundle.prefix;
    let mut parameters = Vec::new();
    if !function.state.is_empty() {
        parameters.push(format!("{p}_{}_t *s", function.state));
    }
    for ((port, _), ty) in function.inputs.iter().zip(&lowered.inputs) {
        parameters.push(format!("{} {}", type_name(p, *ty), port.name));
    }
    if lowered.may_fault {
        parameters.push("uint32_t *fault".into());
    }
    if parameters.is_empty() {
        parameters.push("void".into());
    }
    let name = &function.name;
    format!(
        "{} {p}_{name}({})",
        result_type(bundle, number),
        parameters.join(", ")
    )
}

/// The type that a function returns.
fn result_type(bundle: &Bundle, number: usize) -> String {
    let (function, lowered) = (&bundle.program.functions[number], &bundle.lowered[number]);
    match lowered.outputs.as_slice() {
        [] => "void".into(),
        [(_, v)] => type_name(&bundle.prefix, v.ty),
        _ => format!("{}_{}_out_t", bundle.prefix, function.name),
    }
}

/// The definition of a function.
pub fn definition(bundle: &Bundle, number: usize) -> String {
    let printer = Printer {
        bundle,
        function: &bundle.program.functions[number],
        lowered: &bundle.lowered[number],
        prefix: &bundle.prefix,
    };
    let mut text = signature(bundle, number);
    text.push_str("\n{\n");
    for k in printer.lowered.unused_inputs() {
        _ = writeln!(text, "    (void){};", printer.function.inputs[k].0.name);
    }
    printer.statements(&printer.lowered.body, 1, &mut text);
    match printer.lowered.outputs.as_slice() {
        [] => {}
        [(_, v)] => _ = writeln!(text, "    return {};", printer.value(v)),
        several => {
            _ = writeln!(text, "    {} out;", result_type(bundle, number));
            for (name, v) in several {
                _ = writeln!(text, "    out.{name} = {};", printer.value(v));
            }
            text.push_str("    return out;\n");
        }
    }
    text.push_str("}\n");
    text
}

struct Printer<'a> {
    bundle: &'a Bundle,
    function: &'a Function,
    lowered: &'a Lowered,
    prefix: &'a str,
}

impl Printer<'_> {
    fn value(&self, v: &Typed) -> String {
        match v.value {
            Value::Temp(k) => match self.lowered.written_out.get(&k) {
                // A cast binds closer than any operator.
                Some((ty, expr)) => self.expression(expr, *ty),
                None => self.lowered.names[k].clone(),
            },
            Value::Constant(raw) => constant(self.prefix, raw, v.ty),
            Value::Input(k) => self.function.inputs[k].0.name.to_owned(),
        }
    }

    fn name(&self, k: usize) -> &str {
        &self.lowered.names[k]
    }

    fn state(&self, slot: usize, element: usize) -> String {
        let slot = &self.function.slots[slot];
        if slot.len > 1 {
            format!("s->{}[{element}]", slot.name)
        } else {
            format!("s->{}", slot.name)
        }
    }

    fn statements(&self, body: &[Statement], depth: usize, text: &mut String) {
        let indent = "    ".repeat(depth);
        for statement in body {
            match statement {
                Statement::Let(k, ty, expr, range) => {
                    let ty_name = type_name(self.prefix, *ty);
                    let expr = self.expression(expr, *ty);
                    let comment = comment(self.lowered.notes.get(k), *range);
                    _ = writeln!(
                        text,
                        "{indent}const {ty_name} {} = {expr};{comment}",
                        self.name(*k)
                    );
                }
                Statement::Carry(k, ty, init) => {
                    let ty_name = type_name(self.prefix, *ty);
                    let name = self.name(*k);
                    _ = writeln!(text, "{indent}{ty_name} {name} = {};", self.value(init));
                }
                Statement::Loop(count, inner) => {
                    _ = writeln!(
                        text,
                        "{indent}for (uint32_t i = UINT32_C(0); i < UINT32_C({count}); ++i) {{"
                    );
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
            passed.push(format!("&s->{}", site.instance));
        }
        passed.extend(arguments.iter().map(|a| self.value(a)));
        if lowered.may_fault {
            passed.push("fault".into());
        }
        let call = format!("{}_{}({})", self.prefix, callee.name, passed.join(", "));
        match results {
            [] => _ = writeln!(text, "{indent}{call};"),
            [(k, ty)] => {
                let ty = type_name(self.prefix, *ty);
                _ = writeln!(text, "{indent}const {ty} {} = {call};", self.name(*k));
            }
            several => {
                let ty = result_type(self.bundle, site.function);
                _ = writeln!(text, "{indent}const {ty} c{number} = {call};");
                for ((k, ty), (name, _)) in several.iter().zip(&lowered.outputs) {
                    let ty = type_name(self.prefix, *ty);
                    let result = self.name(*k);
                    _ = writeln!(text, "{indent}const {ty} {result} = c{number}.{name};");
                }
            }
        }
    }

    fn expression(&self, expr: &Expr, ty: Type) -> String {
        let p = self.prefix;
        let v = |t: &Typed| self.value(t);
        let wide = matches!(ty, Type::Signed(Width::W128) | Type::Unsigned(Width::W128));
        let bits = |t: &Typed| match t.ty {
            Type::Signed(w) | Type::Unsigned(w) => w.bits(),
            Type::Bool => 1,
        };
        let cast = |text: String| format!("({}){text}", type_name(p, ty));
        let binary = |a: &Typed, b: &Typed, name: &str, sign: &str| {
            if wide {
                format!("{p}_w128_{name}({}, {})", v(a), v(b))
            } else if matches!(ty, Type::Unsigned(_)) {
                cast(format!("({} {sign} {})", v(a), v(b)))
            } else {
                format!("{} {sign} {}", v(a), v(b))
            }
        };
        match expr {
            Expr::Convert(a) if bits(a) == 128 && wide => v(a),
            Expr::Convert(a) if wide => format!("{p}_w128_from_s64((int64_t){})", v(a)),
            Expr::Convert(a) if bits(a) == 128 => cast(format!("{p}_w128_to_s64({})", v(a))),
            Expr::Convert(a) => cast(v(a)),
            Expr::Low(a) if bits(a) == 128 && wide => v(a),
            Expr::Low(a) if wide && matches!(a.ty, Type::Signed(_)) => {
                format!("{p}_w128_from_s64((int64_t){})", v(a))
            }
            Expr::Low(a) if wide => format!("{p}_w128_make(UINT64_C(0), (uint64_t){})", v(a)),
            Expr::Low(a) if bits(a) == 128 => cast(format!("{}.lo", v(a))),
            Expr::Low(a) => cast(v(a)),
            Expr::SignExtend(a, n) => match bits(a) {
                128 => format!("{p}_w128_sign_extend({}, {n}U)", v(a)),
                w => {
                    let sign = constant(p, 1i128 << (n - 1), a.ty);
                    format!("{p}_sign_extend_{w}({}, {sign})", v(a))
                }
            },
            Expr::Add(a, b) => binary(a, b, "add", "+"),
            Expr::Sub(a, b) => binary(a, b, "sub", "-"),
            Expr::Mul(a, b) => binary(a, b, "mul", "*"),
            Expr::Neg(a) if wide => format!("{p}_w128_neg({})", v(a)),
            Expr::Neg(a) => format!("-{}", v(a)),
            Expr::Asr(a, n) if wide => format!("{p}_w128_asr({}, {n}U)", v(a)),
            Expr::Asr(a, n) => format!("{p}_asr_{}({}, {n}U)", bits(a), v(a)),
            Expr::ShrPositive(a, n) if wide => format!("{p}_w128_shr({}, {n}U)", v(a)),
            Expr::ShrPositive(a, n) => {
                let unsigned = match a.ty {
                    Type::Signed(width) => type_name(p, Type::Unsigned(width)),
                    ty => type_name(p, ty),
                };
                cast(format!("(({unsigned}){} >> {n}U)", v(a)))
            }
            Expr::ShrIndex(a) if wide => format!("{p}_w128_shr({}, i)", v(a)),
            Expr::ShrIndex(a) => {
                let unsigned = match a.ty {
                    Type::Signed(width) => type_name(p, Type::Unsigned(width)),
                    ty => type_name(p, ty),
                };
                cast(format!("(({unsigned}){} >> i)", v(a)))
            }
            Expr::AsrIndex(a) if wide => format!("{p}_w128_asr({}, i)", v(a)),
            Expr::AsrIndex(a) => format!("{p}_asr_by_{}({}, i)", bits(a), v(a)),
            Expr::Shl(a, n) if wide => format!("{p}_w128_shl({}, {n}U)", v(a)),
            Expr::Shl(a, n) => cast(format!("({} << {n}U)", v(a))),
            Expr::Shr(a, n) if wide => format!("{p}_w128_shr({}, {n}U)", v(a)),
            Expr::Shr(a, n) => cast(format!("({} >> {n}U)", v(a))),
            Expr::Mask(a, n) if wide => format!("{p}_w128_mask({}, {n}U)", v(a)),
            Expr::Mask(a, n) => {
                let mask = constant(p, ((1u128 << n) - 1) as i128, a.ty);
                format!("{} & {mask}", v(a))
            }
            Expr::ToSigned(a) if bits(a) == 128 && wide => v(a),
            Expr::ToSigned(a) if wide => {
                format!("{p}_w128_make(UINT64_C(0), (uint64_t){})", v(a))
            }
            Expr::ToSigned(a) if bits(a) == 128 => cast(format!("{}.lo", v(a))),
            Expr::ToSigned(a) => cast(v(a)),
            Expr::IsNegative(a) if bits(a) == 128 => format!("{p}_w128_is_negative({})", v(a)),
            Expr::IsNegative(a) => format!("{} < {}", v(a), constant(p, 0, a.ty)),
            Expr::Select(t, a, b) => format!("{} ? {} : {}", v(t), v(a), v(b)),
            Expr::Clamp(a, low, high) => format!(
                "{p}_clamp_{}({}, {}, {})",
                bits(a),
                v(a),
                constant(p, *low, ty),
                constant(p, *high, ty)
            ),
            Expr::Check(a, low, high, fault) => format!(
                "{p}_check_{}({}, {}, {}, UINT32_C({fault}), fault)",
                bits(a),
                v(a),
                constant(p, *low, ty),
                constant(p, *high, ty)
            ),
            Expr::Sine(k, index) => cast(format!("{p}_sine_{k}[{}]", v(index))),
            Expr::Lookup(k, index) => {
                let name = self.bundle.program.tables[*k].name;
                cast(format!("{p}_{name}[{}]", v(index)))
            }
            Expr::Entry(k) => {
                let name = self.bundle.program.index_tables[*k].name;
                cast(format!("{p}_{name}[i]"))
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
        words => format!(" /* {} */", words.join("; ")),
    }
}
