//! The files of a firmware bundle: sources, harness, self-test, vectors, manifest.

use super::manifest::{self, Header, Manifest};
use super::stepped::StreamView;
use super::{calibrated, outside};
use crate::circuit::engine::{self};
use crate::compensation::certainty;
use crate::design::Design;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::machine::{Type, Width, parameter_type};
use crate::emit::views;
use crate::emit::views::{FunctionView, Language, StateView, StructView, TableView, mix};
use crate::emit::{c, rust};
use crate::error::{InputError, Result, io_error};
use crate::numeric::trace::ir::{Function, Interval};
use crate::text::{self, Place};
use crate::vectors::model;
use crate::vectors::model::Model;
use crate::vectors::rows;
use crate::vectors::stimulus;
use crate::vectors::stimulus::{Lcg, SEED};
use askama::Template;
use std::path::Path;

/// Draws for each function in the self-test.
const SELFTEST_DRAWS: u32 = 256;
/// Decimation periods in the self-test, and least number of them in the vectors.
const PERIODS: usize = 64;
/// ADC samples of the chain's vectors, where the number of periods allows it.
const VECTOR_SAMPLES: usize = 1 << 14;
/// Most decimation periods in the vectors.
const MOST_PERIODS: usize = 512;
/// Words among which the vectors at ties and limits are searched.
const CANDIDATES: usize = 1 << 16;
/// Random vectors of each function.
const VECTORS: usize = 1024;

/// Random inputs among which those are searched that show a coefficient's last bit.
const SEARCHED: usize = 1 << 19;

/// A file of a bundle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EmittedFile {
    /// Path inside the bundle, with `/`.
    pub path: String,
    /// Contents.
    pub text: String,
}

macro_rules! page {
    ($name:ident, $path:literal) => {
        #[derive(Template)]
        #[template(path = $path, escape = "none")]
        struct $name<'a> {
            v: &'a View,
        }
    };
}

/// Everything that the templates of one bundle see.
#[derive(Debug)]
pub struct View {
    p: String,
    language: Language,
    banner: String,
    guard: String,
    facts: Vec<String>,
    states: Vec<StateView>,
    structs: Vec<StructView>,
    pub(super) functions: Vec<FunctionView>,
    pub(super) tables: Vec<TableView>,
    checks: Vec<&'static str>,
    wide: bool,
    chain: bool,
    ratio: u32,
    initial: Vec<String>,
    sample_faults: bool,
    period_faults: bool,
    pub(super) stimulated: bool,
    pub(super) stream: Option<StreamView>,
    seed: u64,
    chain_count: usize,
    code: String,
    code_low: String,
    code_span: String,
    row: Vec<String>,
    chain_checksum: String,
    chain_number: u32,
}

page!(Readme, "bundle/README.md");
page!(CArith, "c/arith.h");
page!(CHeader, "c/firmware.h");
page!(CSource, "c/firmware.c");
page!(CTablesHeader, "c/tables.h");
page!(CTables, "c/tables.c");
page!(CSelftest, "c/selftest.c");
page!(CHarness, "c/harness.c");
page!(RustLib, "rust/lib.rs");
page!(RustHarness, "rust/harness.rs");

/// Emits a design's firmware in one language, as files in memory.
///
/// # Errors
/// A design without what the part needs.
pub fn emit(
    design: &Design,
    part: Part,
    language: Language,
    command: &str,
) -> Result<Vec<EmittedFile>> {
    if part == Part::Compensation && design.compensation.is_none() {
        return Err(InputError::new("the design has no [compensation] to emit")
            .help("add a [compensation] table, or emit `--part chain`")
            .into());
    }
    calibrated::refuse_flag_without_range(design)?;
    let mut bundle = Bundle::new(design, part);
    // Words so long that the polynomial cannot be enclosed have no such line.
    if let Ok(Some(bounds)) = certainty::bounds(design) {
        bundle.accuracy = certainty::sentences(design, &bounds);
    }
    let models = model::models(design, &bundle.program);
    let banner = manifest::banner(&design.source.sha256, command);
    let facts = manifest::facts(design, &bundle);
    let view = View::new(&bundle, &models, language, banner, facts);
    let view = match part {
        Part::Tables => view.tables_alone(),
        _ => view.with_chain(design, &bundle, language),
    };
    let mut files = sources(&view, part, language)?;
    if part != Part::Tables {
        files.extend(vectors(design, &bundle, &models));
    }
    files.push(table_vectors(&view.tables));
    let header = Header {
        design_sha256: &design.source.sha256,
        command,
        language,
        part: &format!("{part:?}").to_lowercase(),
        has_code: part != Part::Tables,
        columns: &engine::columns(design),
    };
    let mut manifest = Manifest::new(&header, &bundle, &view.tables, &view.functions, &files);
    manifest.calibrated = calibrated::Calibrated::of(design);
    files.push(EmittedFile {
        path: manifest::NAME.into(),
        text: manifest.to_json(),
    });
    Ok(files)
}

/// Writes a bundle's files under `folder`, which is made.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(files: &[EmittedFile], folder: &Path) -> Result<()> {
    for file in files {
        let path = folder.join(&file.path);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| io_error(parent, "make the folder", &e))?;
        }
        crate::output::write_whole(&path, file.text.as_bytes())?;
    }
    Ok(())
}

pub(super) fn sources(view: &View, part: Part, language: Language) -> Result<Vec<EmittedFile>> {
    let p = &view.p;
    let v = view;
    let mut pages: Vec<(String, askama::Result<String>)> = Vec::new();
    match language {
        Language::C => {
            pages.push((format!("{p}_tables.h"), CTablesHeader { v }.render()));
            pages.push((format!("{p}_tables.c"), CTables { v }.render()));
            if part != Part::Tables {
                pages.push((format!("{p}_arith.h"), CArith { v }.render()));
                pages.push((format!("{p}.h"), CHeader { v }.render()));
                pages.push((format!("{p}.c"), CSource { v }.render()));
                pages.push((format!("{p}_selftest.c"), CSelftest { v }.render()));
                pages.push((format!("test/{p}_harness.c"), CHarness { v }.render()));
            }
        }
        Language::Rust => {
            pages.push(("src/lib.rs".into(), RustLib { v }.render()));
            let cargo = format!(
                "# {}\n[package]\nname = \"{p}\"\nversion = \"0.1.0\"\nedition = \"2021\"\npublish = false\n\n[workspace]\n",
                v.banner
            );
            pages.push(("Cargo.toml".into(), Ok(cargo)));
            pages.push(("src/bin/harness.rs".into(), RustHarness { v }.render()));
        }
    }
    if part != Part::Tables {
        pages.push(("README.md".into(), Readme { v }.render()));
    }
    let mut files = Vec::new();
    for (path, text) in pages {
        let text = text.map_err(|e| InputError::new(format!("cannot print {path}: {e}")))?;
        let text = text.trim_end().to_owned() + "\n";
        files.push(EmittedFile { path, text });
    }
    Ok(files)
}

impl View {
    /// What every bundle shows: its functions and tables with the checksums of the self-test.
    pub(super) fn new(
        bundle: &Bundle,
        models: &[Model],
        language: Language,
        banner: String,
        facts: Vec<String>,
    ) -> Self {
        let facts = facts.iter().map(|line| text::shown(line, Place::Source));
        let tables = views::tables(bundle, language);
        let mut functions = views::functions(bundle, language);
        let mut number = tables.len() as u32;
        for view in &mut functions {
            let Some(model) = models.iter().find(|m| m.name == view.name) else {
                continue;
            };
            number += 1;
            view.tested = true;
            view.number = number;
            view.count = SELFTEST_DRAWS;
            view.checksum = format!("{:#x}", selftest_checksum(model));
        }
        let faults = |name: &str| {
            let k = bundle.program.functions.iter().position(|f| f.name == name);
            k.is_some_and(|k| bundle.lowered[k].may_fault)
        };
        View {
            p: bundle.prefix.clone(),
            language,
            banner,
            guard: bundle.prefix.to_uppercase(),
            facts: facts.collect(),
            states: views::states(bundle, language),
            structs: views::structs(bundle, language),
            checks: checks(bundle),
            wide: wide(bundle),
            chain: bundle.has_chain,
            ratio: bundle.ratio,
            initial: initial(bundle, language),
            sample_faults: faults("sample"),
            period_faults: faults("period"),
            stimulated: bundle.has_chain || functions.iter().any(|f| f.tested),
            stream: None,
            seed: SEED,
            chain_count: PERIODS * bundle.ratio as usize,
            code: String::new(),
            code_low: String::new(),
            code_span: String::new(),
            row: Vec::new(),
            chain_checksum: String::new(),
            chain_number: number + 1,
            functions,
            tables,
        }
    }

    fn is_c(&self) -> bool {
        self.language == Language::C
    }

    /// Takes away all but the tables.
    fn tables_alone(mut self) -> Self {
        // The name of the design.
        self.facts.truncate(1);
        self.states.clear();
        self.structs.clear();
        self.functions.clear();
        self.checks.clear();
        (self.chain, self.stimulated) = (false, false);
        self
    }

    /// Adds what the chain's parts of the pages show.
    fn with_chain(mut self, design: &Design, bundle: &Bundle, language: Language) -> Self {
        let code = design.circuit.adc.format;
        let code = Interval::new(code.min_raw(), code.max_raw());
        self.code = match language {
            Language::C => c::type_name("", parameter_type(code)),
            Language::Rust => rust::type_name(parameter_type(code)).to_owned(),
        };
        let low = Type::Signed(Width::W64);
        (self.code_low, self.code_span) = match language {
            Language::C => (
                c::constant("", code.low, low),
                format!("UINT64_C({})", (code.high - code.low) as u64),
            ),
            Language::Rust => (
                rust::constant(code.low, low),
                ((code.high - code.low) as u64).to_string(),
            ),
        };
        self.row = row(design, bundle, language);
        self.chain_checksum = format!("{:#x}", chain_checksum(design, bundle));
        self
    }

    /// Functions that the self-test and the harness call.
    fn tested(&self) -> impl Iterator<Item = &FunctionView> {
        self.functions.iter().filter(|f| f.tested)
    }
}

/// The columns of a row as unsigned 64-bit words, in the order of `replay`.
fn row(design: &Design, bundle: &Bundle, language: Language) -> Vec<String> {
    let Some(k) = bundle
        .program
        .functions
        .iter()
        .position(|f| f.name == "period")
    else {
        return Vec::new();
    };
    let outputs = &bundle.lowered[k].outputs;
    let bits = design.circuit.nco.phase_bits;
    let mask = u64::MAX >> (64 - bits);
    engine::columns(design)
        .iter()
        .map(
            |column| match outputs.iter().find(|(name, _)| name == column) {
                Some((name, v)) => views::word_64(&format!("row.{name}"), v.ty, language),
                None => match language {
                    Language::C => {
                        format!("(uint64_t)g.chain.nco.tuning_word & UINT64_C({mask})")
                    }
                    Language::Rust => {
                        format!("u64::from(g.chain.nco.tuning_word) & {mask}")
                    }
                },
            },
        )
        .collect()
}

fn initial(bundle: &Bundle, language: Language) -> Vec<String> {
    let type_of = |member: &str, variable: &str| {
        let chain = bundle.states.iter().find(|s| s.name == "chain")?;
        let (_, state) = chain.members.iter().find(|(m, _)| *m == member)?;
        let state = bundle.states.iter().find(|s| s.name == *state)?;
        let found = state.variables.iter().find(|(v, _, _)| *v == variable)?;
        Some(found.2)
    };
    bundle
        .initial
        .iter()
        .filter_map(|i| {
            let ty = type_of(i.member, i.variable)?;
            let value = match language {
                Language::C => c::constant(&bundle.prefix, i.value, ty),
                Language::Rust => rust::constant(i.value, ty),
            };
            Some(format!("{}.{} = {value}", i.member, i.variable))
        })
        .collect()
}

/// Types in which the emitted Rust checks for faults.
fn checks(bundle: &Bundle) -> Vec<&'static str> {
    use crate::emit::machine::{Expr, Statement};
    let mut types = Vec::new();
    for lowered in &bundle.lowered {
        for statement in &lowered.body {
            if let Statement::Let(_, ty, Expr::Check(..), _) = statement {
                types.push(rust::type_name(*ty));
            }
        }
    }
    types.sort_unstable();
    types.dedup();
    types
}

/// True if any value needs more than 64 bits.
fn wide(bundle: &Bundle) -> bool {
    format!("{:?}{:?}", bundle.lowered, bundle.states).contains("W128")
}

fn selftest_checksum(model: &Model) -> u64 {
    let mut lcg = Lcg(SEED);
    let mut outputs = vec![0; model.outputs];
    let mut h = views::BASIS;
    for _ in 0..SELFTEST_DRAWS {
        let inputs: Vec<i128> = model.inputs.iter().map(|range| lcg.word(*range)).collect();
        model.call(&inputs, &mut outputs);
        h = outputs.iter().fold(h, |h, word| mix(h, *word as u64));
    }
    h
}

fn chain_checksum(design: &Design, bundle: &Bundle) -> u64 {
    if !bundle.has_chain {
        return 0;
    }
    let format = design.circuit.adc.format;
    let code = Interval::new(format.min_raw(), format.max_raw());
    let mut lcg = Lcg(SEED);
    let (mut drive, mut sense) = (Vec::new(), Vec::new());
    for _ in 0..PERIODS * bundle.ratio as usize {
        drive.push(lcg.word(code) as i32);
        sense.push(lcg.word(code) as i32);
    }
    let words = rows::saturating_rows(design, &drive, &sense);
    words
        .iter()
        .fold(views::BASIS, |h, word| mix(h, *word as u64))
}

pub(super) fn csv_line(words: &[i128]) -> String {
    let words: Vec<String> = words.iter().map(i128::to_string).collect();
    words.join(",") + "\n"
}

fn vectors(design: &Design, bundle: &Bundle, models: &[Model]) -> Vec<EmittedFile> {
    let mut files = Vec::new();
    for model in models {
        let function = bundle.program.function(&model.name);
        let (mut header, mut outputs) = (Vec::new(), Vec::new());
        if let Some(f) = function {
            header.extend(f.inputs.iter().map(|(port, _)| port.name));
            outputs.extend(f.outputs.iter().map(|(port, _)| port.name));
        }
        header.extend(outputs);
        header.push("fault");
        let mut text = header.join(",") + "\n";
        let mut inputs = stimulus::inputs(&model.inputs, VECTORS, SEED);
        inputs.extend(calibrated::about_the_ends(design, model));
        let candidates = stimulus::inputs(&model.inputs, CANDIDATES, SEED + 4);
        inputs.extend(model.near_ties(&candidates));
        inputs.extend(model.fault_edges(&candidates));
        if model.name == "bias" {
            let candidates: Vec<i128> = stimulus::inputs(&model.inputs, SEARCHED, SEED + 1)
                .into_iter()
                .flatten()
                .collect();
            let sensitive = model::sensitive_inputs(design, &candidates);
            inputs.extend(sensitive.into_iter().map(|x| vec![x]));
        }
        let mut results = vec![0; model.outputs];
        let position = |f: &Function| f.name == model.name;
        let lowered = bundle.program.functions.iter().position(position);
        let beside = lowered.map_or(Vec::new(), |k| {
            outside::rows(&bundle.lowered[k], &model.inputs)
        });
        let inside = inputs.into_iter().map(|input| [input.clone(), input]);
        for [given, due] in inside.chain(beside) {
            let fault = model.call(&due, &mut results);
            let mut line = given;
            line.extend(&results);
            line.push(i128::from(fault));
            text += &csv_line(&line);
        }
        files.push(EmittedFile {
            path: format!("vectors/{}.csv", model.name),
            text,
        });
    }
    if bundle.has_chain {
        files.extend(chain_vectors(design, bundle));
    }
    files
}

fn chain_vectors(design: &Design, bundle: &Bundle) -> [EmittedFile; 2] {
    // Long enough for the loops to reach their limits, where the periods are short.
    let ratio = bundle.ratio as usize;
    let periods = (VECTOR_SAMPLES / ratio).clamp(PERIODS, MOST_PERIODS);
    let samples = periods * ratio;
    let segment = periods.div_ceil(6) * ratio;
    let (drive, sense) = stimulus::segments(design, samples, segment, SEED);
    let mut input = String::from("drive_code,sense_code\n");
    for (d, s) in drive.iter().zip(&sense) {
        input += &format!("{d},{s}\n");
    }
    let mut output = engine::columns(design).join(",") + ",fault\n";
    for row in rows::expected_rows(design, &drive, &sense) {
        output += &csv_line(&row);
    }
    [
        EmittedFile {
            path: "vectors/chain_input.csv".into(),
            text: input,
        },
        EmittedFile {
            path: "vectors/chain_output.csv".into(),
            text: output,
        },
    ]
}

pub(super) fn table_vectors(tables: &[TableView]) -> EmittedFile {
    let mut text = String::from("table,entry,value\n");
    for table in tables {
        for (k, v) in table.entries.iter().enumerate() {
            text += &format!("{},{k},{v}\n", table.name);
        }
    }
    EmittedFile {
        path: "vectors/tables.csv".into(),
        text,
    }
}
