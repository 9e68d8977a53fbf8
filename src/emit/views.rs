//! What the templates show: strings only, made from the bundle.

use super::bundle::{Bundle, StateType};
use super::machine::{Type, Width};
use super::{c, notes, rust};
use crate::numeric::trace::ir::{Interval, SlotKind};
use crate::text::{self, Place};

/// A language to print.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// C99.
    C,
    /// Rust, `no_std`.
    Rust,
}

/// A table.
#[derive(Debug, Clone)]
pub struct TableView {
    /// Name without the prefix.
    pub name: String,
    /// Name in capitals.
    pub upper: String,
    /// Element type.
    pub ty: &'static str,
    /// Entries.
    pub len: usize,
    /// What it holds.
    pub note: String,
    /// Entries, ten a line.
    pub lines: Vec<String>,
    /// Raw entries.
    pub entries: Vec<i64>,
    /// Number in the self-test.
    pub number: u32,
    /// FNV-1a of the entries.
    pub checksum: String,
}

impl TableView {
    /// Its size.
    pub fn bytes(&self) -> usize {
        let digits = |c: char| c.is_ascii_digit();
        let bits: String = self.ty.chars().filter(|c| digits(*c)).collect();
        self.len * bits.parse::<usize>().unwrap_or(0) / 8
    }
}

/// A state's type.
#[derive(Debug, Clone)]
pub struct StateView {
    /// Name.
    pub name: String,
    /// Name as a Rust type.
    pub camel: String,
    /// Declarations without `;` or `,`.
    pub variables: Vec<String>,
    /// What each of them holds.
    pub meanings: Vec<String>,
}

/// A structure that a function returns.
#[derive(Debug, Clone)]
pub struct StructView {
    /// The function's name.
    pub name: String,
    /// As a Rust type, without `Out`.
    pub camel: String,
    /// Declaration and meaning.
    pub members: Vec<(String, String)>,
}

/// An input of a function in the self-test.
#[derive(Debug, Clone)]
pub struct InputView {
    /// Type.
    pub ty: String,
    /// Lower end.
    pub low: String,
    /// Width of the range.
    pub span: String,
}

/// A function.
#[derive(Debug, Clone)]
pub struct FunctionView {
    /// Name without the prefix.
    pub name: String,
    /// What it is for, in a sentence.
    pub purpose: &'static str,
    /// Domain, range, meaning.
    pub notes: Vec<String>,
    /// What comes of a word outside an input's range; empty where the types hold no such word.
    pub outside: String,
    /// Prototype without `;`.
    pub declaration: String,
    /// Definition.
    pub definition: String,
    /// Type of the result.
    pub result: String,
    /// It may note a fault.
    pub faults: bool,
    /// In C it is called by `push` alone and has no declaration in the header: compilers make one function of both.
    pub internal: bool,
    /// Its inputs.
    pub inputs: Vec<InputView>,
    /// Arguments a0, a1, ... in the self-test.
    pub arguments: String,
    /// Arguments from an array of 64-bit words in the harness.
    pub harness_arguments: String,
    /// Outputs of `r` as unsigned 64-bit words.
    pub outputs: Vec<String>,
}

/// The tables of a bundle.
pub fn tables(bundle: &Bundle, language: Language) -> Vec<TableView> {
    let mut tables = Vec::new();
    for (k, table) in bundle.program.sine_tables.iter().enumerate() {
        let note = format!(
            "One turn of a sine, {} entries, amplitude {} (error at most half an LSB)",
            table.entries.len(),
            table.entries.iter().max().copied().unwrap_or(0)
        );
        tables.push((format!("sine_{k}"), note, table.entries.to_vec()));
    }
    for table in &bundle.program.index_tables {
        let note = format!(
            "atan(2^-i) in units of 2^-{} turn (error at most half a unit)",
            table.fraction_bits
        );
        tables.push((table.name.to_owned(), note, table.entries.to_vec()));
    }
    let fixed = tables.len();
    for table in &bundle.program.tables {
        tables.push((
            table.name.to_owned(),
            table.note.clone(),
            table.entries.to_vec(),
        ));
    }
    tables
        .into_iter()
        .enumerate()
        .map(|(k, (name, note, entries))| table(k, name, note, entries, language, k >= fixed))
        .collect()
}

/// Bytes of an entry in the narrowest signed or unsigned type that holds all, and whether it is signed.
pub fn entry_type(entries: &[i64]) -> (usize, bool) {
    let low = entries.iter().copied().min().unwrap_or(0);
    let high = entries.iter().copied().max().unwrap_or(0);
    let signed = low < 0;
    let fits = |bytes: &usize| {
        let bits = 8 * *bytes as u32 - u32::from(signed);
        bits >= 63 || (low >= -(1i64 << bits) && high < 1i64 << bits)
    };
    let bytes = [1, 2, 4].into_iter().find(fits).unwrap_or(8);
    (bytes, signed)
}

/// The type of a table's entries in C and in Rust. `narrow`: the narrowest that holds all, else 16 bits at least and
/// signed.
pub(super) fn table_type(entries: &[i64], narrow: bool) -> (&'static str, &'static str) {
    let largest = entries.iter().map(|v| v.unsigned_abs()).max().unwrap_or(0);
    match (narrow, entry_type(entries), largest) {
        (true, (1, true), _) => ("int8_t", "i8"),
        (true, (1, false), _) => ("uint8_t", "u8"),
        (true, (2, false), _) => ("uint16_t", "u16"),
        (true, (4, false), _) => ("uint32_t", "u32"),
        (_, _, 0..=0x7fff) | (true, (2, true), _) => ("int16_t", "i16"),
        (_, _, 0x8000..=0x7fff_ffff) | (true, (4, true), _) => ("int32_t", "i32"),
        _ => ("int64_t", "i64"),
    }
}

fn table(
    k: usize,
    name: String,
    note: String,
    entries: Vec<i64>,
    language: Language,
    narrow: bool,
) -> TableView {
    let (c_type, rust_type) = table_type(&entries, narrow);
    let entry = |v: &i64| match (language, c_type) {
        (Language::C, "int64_t") if *v == i64::MIN => "INT64_MIN".to_owned(),
        (Language::C, "int64_t") => format!("INT64_C({v})"),
        (Language::C, "int32_t") => format!("INT32_C({v})"),
        (Language::C, "uint32_t") => format!("UINT32_C({v})"),
        _ => v.to_string(),
    };
    let line = |chunk: &[i64]| {
        chunk
            .iter()
            .map(|v| entry(v) + ",")
            .collect::<Vec<_>>()
            .join(" ")
    };
    TableView {
        upper: name.to_uppercase(),
        name,
        ty: if language == Language::C {
            c_type
        } else {
            rust_type
        },
        len: entries.len(),
        note: text::shown(&note, Place::Source),
        lines: entries.chunks(10).map(line).collect(),
        number: k as u32 + 1,
        checksum: format!(
            "{:#x}",
            entries.iter().fold(BASIS, |h, v| mix(h, *v as u64))
        ),
        entries,
    }
}

/// The states of a bundle.
pub fn states(bundle: &Bundle, language: Language) -> Vec<StateView> {
    bundle
        .states
        .iter()
        .map(|s| state(bundle, s, language))
        .collect()
}

fn state(bundle: &Bundle, s: &StateType, language: Language) -> StateView {
    let p = &bundle.prefix;
    let (mut variables, mut meanings) = (Vec::new(), Vec::new());
    for (name, len, ty) in &s.variables {
        meanings.push(kept(bundle, s.name, name));
        variables.push(match (language, len) {
            (Language::C, 1) => format!("{} {name}", c::type_name(p, *ty)),
            (Language::C, n) => format!("{} {name}[{n}]", c::type_name(p, *ty)),
            (Language::Rust, 1) => format!("{name}: {}", rust::type_name(*ty)),
            (Language::Rust, n) => format!("{name}: [{}; {n}]", rust::type_name(*ty)),
        });
    }
    for (name, ty) in &s.members {
        meanings.push(format!("of the block `{name}`"));
        variables.push(match language {
            Language::C => format!("{p}_{ty}_t {name}"),
            Language::Rust => format!("{name}: {}", rust::camel(ty)),
        });
    }
    StateView {
        name: s.name.to_owned(),
        camel: rust::camel(s.name),
        variables,
        meanings,
    }
}

/// What a variable of a state holds: the words that are proved for it.
fn kept(bundle: &Bundle, state: &str, variable: &str) -> String {
    let functions = bundle.program.functions.iter();
    let mut slots = functions
        .filter(|f| f.state == state)
        .flat_map(|f| &f.slots);
    match slots
        .find(|slot| slot.name == variable)
        .map(|slot| slot.kind)
    {
        Some(SlotKind::Word(range)) => format!("{} .. {}", range.low, range.high),
        Some(SlotKind::Residue(bits)) => format!("modulo 2^{bits}"),
        None => String::new(),
    }
}

/// The structures that functions return.
pub fn structs(bundle: &Bundle, language: Language) -> Vec<StructView> {
    let mut structs = Vec::new();
    for (function, lowered) in bundle.program.functions.iter().zip(&bundle.lowered) {
        if lowered.outputs.len() < 2 {
            continue;
        }
        let ports = function
            .outputs
            .iter()
            .filter(|(port, _)| !port.name.is_empty());
        let members = ports.zip(&lowered.outputs).map(|((port, _), (name, v))| {
            let declaration = match language {
                Language::C => format!("{} {name}", c::type_name(&bundle.prefix, v.ty)),
                Language::Rust => format!("{name}: {}", rust::type_name(v.ty)),
            };
            (
                declaration,
                text::shown(&notes::meaning(port), Place::Source),
            )
        });
        structs.push(StructView {
            name: function.name.clone(),
            camel: rust::camel(&function.name),
            members: members.collect(),
        });
    }
    structs
}

/// The functions of a bundle.
pub fn functions(bundle: &Bundle, language: Language) -> Vec<FunctionView> {
    (0..bundle.program.functions.len())
        .map(|k| function(bundle, k, language))
        .collect()
}

fn function(bundle: &Bundle, k: usize, language: Language) -> FunctionView {
    let (function, lowered) = (&bundle.program.functions[k], &bundle.lowered[k]);
    let p = &bundle.prefix;
    let mut notes = Vec::new();
    for (port, range) in &function.inputs {
        notes.push(format!("in  {}", notes::described(port, *range)));
    }
    for (port, id) in &function.outputs {
        if !port.name.is_empty() {
            let range = function.nodes[*id].range;
            notes.push(format!("out {}", notes::described(port, range)));
        }
    }
    notes.extend(notes::guarantee(&function.name).map(str::to_owned));
    let notes = notes
        .iter()
        .map(|n| text::shown(n, Place::Source))
        .collect();

    let fault = match (lowered.may_fault, language) {
        (false, _) => "",
        (true, Language::C) => ", &fault",
        (true, Language::Rust) => ", &mut fault",
    };
    let arguments: Vec<String> = (0..lowered.inputs.len()).map(|i| format!("a{i}")).collect();
    let ty = |ty: &Type| match language {
        Language::C => c::type_name(p, *ty),
        Language::Rust => rust::type_name(*ty).to_owned(),
    };
    let from_array: Vec<String> = lowered
        .inputs
        .iter()
        .enumerate()
        .map(|(i, t)| match language {
            Language::C => format!("({})in[{i}]", ty(t)),
            Language::Rust => format!("a[{i}] as {}", ty(t)),
        })
        .collect();
    let outputs = match lowered.outputs.as_slice() {
        [(_, v)] => vec![word_64("r", v.ty, language)],
        several => several
            .iter()
            .map(|(name, v)| word_64(&format!("r.{name}"), v.ty, language))
            .collect(),
    };
    let inputs = function.inputs.iter().zip(&lowered.inputs);
    FunctionView {
        name: function.name.clone(),
        purpose: function.purpose,
        notes,
        outside: notes::outside(function, lowered),
        declaration: c::signature(bundle, k),
        definition: match language {
            Language::C => c::definition(bundle, k),
            Language::Rust => rust::definition(bundle, k),
        },
        result: match lowered.outputs.as_slice() {
            [(_, v)] => ty(&v.ty),
            _ => format!("{p}_{}_out_t", function.name),
        },
        faults: lowered.may_fault,
        internal: language == Language::C && bundle.has_chain && function.name == "sample",
        inputs: inputs
            .map(|((_, range), t)| input(*range, ty(t), language))
            .collect(),
        arguments: arguments.join(", ") + fault,
        harness_arguments: from_array.join(", ") + fault,
        outputs,
    }
}

fn input(range: Interval, ty: String, language: Language) -> InputView {
    let span = (range.high - range.low) as u64;
    match language {
        Language::C => InputView {
            ty,
            low: c::constant("", range.low, Type::Signed(Width::W64)),
            span: format!("UINT64_C({span})"),
        },
        Language::Rust => InputView {
            ty,
            low: rust::constant(range.low, Type::Signed(Width::W64)),
            span: format!("{span}_u64"),
        },
    }
}

/// An expression's low 64 bits, unsigned.
pub fn word_64(expression: &str, ty: Type, language: Language) -> String {
    match (language, ty) {
        (Language::C, Type::Signed(Width::W128) | Type::Unsigned(Width::W128)) => {
            format!("{expression}.lo")
        }
        (Language::C, Type::Signed(_)) => format!("(uint64_t)(int64_t){expression}"),
        (Language::C, _) => format!("(uint64_t){expression}"),
        (Language::Rust, Type::Unsigned(Width::W64)) => expression.to_owned(),
        (Language::Rust, _) => format!("{expression} as u64"),
    }
}

/// Start of the FNV-like checksum.
pub const BASIS: u64 = 0xcbf2_9ce4_8422_2325;

/// One step of the checksum.
pub fn mix(h: u64, word: u64) -> u64 {
    (h ^ word).wrapping_mul(0x100_0000_01b3)
}
