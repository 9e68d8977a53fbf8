//! The files of a firmware bundle: sources, harness, self-test, vectors, manifest.

use super::calibrated;
use super::manifest::{self, Header, Manifest};
use super::stepped::StreamView;
use super::tested::{self, TestView, Tested};
use super::vectors::{self, Checked};
use crate::compensation::certainty;
use crate::design::Design;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::machine::{Type, Width, parameter_type};
use crate::emit::views;
use crate::emit::views::{FunctionView, Language, StateView, StructView, TableView};
use crate::emit::{c, rust};
use crate::error::{InputError, Result, io_error};
use crate::numeric::trace::ir::Interval;
use crate::text::{self, Place};
use crate::vectors::chain;
use crate::vectors::interpreter::Interpreter;
use crate::vectors::model;
use crate::vectors::model::Model;
use crate::vectors::stimulus;
use crate::vectors::stimulus::SEED;
use askama::Template;
use std::path::Path;

/// Draws for each function in the self-test.
const SELFTEST_DRAWS: u32 = 256;
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
    pub(super) tests: Vec<TestView>,
    pub(super) stream: Option<StreamView>,
    seed: u64,
    draws: u32,
    chain_count: usize,
    code: String,
    code_low: String,
    code_span: String,
    row: Vec<String>,
    chain_state: Vec<String>,
    chain_checksum: String,
    pub(super) chain_number: u32,
    vector_rows: usize,
    /// Low end, width and rate of each word that a long run draws.
    long_words: Vec<[String; 3]>,
    long_steps: u64,
    long_checksum: String,
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
page!(RustSelftest, "rust/selftest.rs");
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
    let every: Vec<Option<Checked>> = match part {
        Part::Tables => Vec::new(),
        _ => models.iter().map(vectors::every_of).collect(),
    };
    let view = View::new(&bundle, &models, &every, language, banner, facts);
    let view = match part {
        Part::Tables => view.tables_alone(),
        _ => view.with_chain(design, &bundle, language),
    };
    let mut files = sources(&view, part, language)?;
    if part != Part::Tables {
        files.extend(vectors::of_design(design, &bundle, &models));
    }
    files.push(vectors::of_tables(&view.tables));
    let header = Header {
        design_sha256: &design.source.sha256,
        command,
        language,
        part: match part {
            Part::Chain if !bundle.has_chain => "compensation",
            Part::Chain => "chain",
            Part::Tables => "tables",
            _ => "compensation",
        },
        has_code: part != Part::Tables,
        columns: &chain::columns(design),
    };
    let mut manifest = Manifest::new(&header, &bundle, &view, &files);
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
            pages.push(("src/selftest.rs".into(), RustSelftest { v }.render()));
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
    /// What every bundle shows: its functions and tables with the checksums of the self-test. `every` of
    /// each model: number and checksum of all its inputs, where these are few.
    pub(super) fn new(
        bundle: &Bundle,
        models: &[Model],
        every: &[Option<Checked>],
        language: Language,
        banner: String,
        facts: Vec<String>,
    ) -> Self {
        let facts = facts.iter().map(|line| text::shown(line, Place::Source));
        let tables = views::tables(bundle, language);
        let functions = views::functions(bundle, language);
        let program = Interpreter::new(&bundle.program);
        let mut number = tables.len() as u32;
        let mut tests = Vec::new();
        for (k, function) in bundle.program.functions.iter().enumerate() {
            let Some(m) = models.iter().position(|m| m.name == function.name) else {
                continue;
            };
            number += 1;
            let (model, may_fault) = (&models[m], bundle.lowered[k].may_fault);
            let checksum = match model.stands_alone() {
                true => vectors::selftest_of_function(model, may_fault, SELFTEST_DRAWS),
                false => 0,
            };
            let of = Tested {
                model,
                number,
                checksum,
                every: every.get(m).copied().flatten(),
            };
            tests.push(tested::view(bundle, &program, k, &of, language));
        }
        let position = |name: &str| bundle.program.functions.iter().position(|f| f.name == name);
        let faults = |name: &str| position(name).is_some_and(|k| bundle.lowered[k].may_fault);
        let chain_state = match position("period") {
            Some(k) if bundle.has_chain => {
                let words = program.state(k).iter();
                words
                    .flat_map(|word| tested::state_words(word, "g.chain", language))
                    .collect()
            }
            _ => Vec::new(),
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
            tests,
            stream: None,
            seed: SEED,
            draws: SELFTEST_DRAWS,
            chain_count: vectors::PERIODS * bundle.ratio as usize,
            code: String::new(),
            code_low: String::new(),
            code_span: String::new(),
            row: Vec::new(),
            chain_state,
            chain_checksum: String::new(),
            chain_number: number + 1,
            vector_rows: 0,
            long_words: Vec::new(),
            long_steps: 0,
            long_checksum: String::new(),
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
        self.tests.clear();
        self.chain = false;
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
        if bundle.has_chain {
            self.chain_checksum = format!("{:#x}", vectors::selftest_of_chain(design));
            self.vector_rows = vectors::periods(design);
            self.with_long(
                vectors::long_words_of_chain(design),
                vectors::long_of_chain(design),
                language,
            );
        }
        self
    }

    /// Adds a long run: the words that it draws, its steps and its checksum.
    pub(super) fn with_long(
        &mut self,
        words: Vec<(Interval, u32)>,
        (steps, checksum): Checked,
        language: Language,
    ) {
        let low = Type::Signed(Width::W64);
        let word = |(range, rate): (Interval, u32)| {
            let span = (range.high - range.low) as u64;
            match language {
                Language::C => [
                    c::constant("", range.low, low),
                    format!("UINT64_C({span})"),
                    format!("UINT32_C({rate})"),
                ],
                Language::Rust => [
                    rust::constant(range.low, low),
                    span.to_string(),
                    rate.to_string(),
                ],
            }
        };
        self.long_words = words.into_iter().map(word).collect();
        self.long_steps = steps;
        self.long_checksum = format!("{checksum:#x}");
    }

    /// Steps and checksum of the long run, where there is one.
    pub(super) fn long(&self) -> Option<(u64, &str)> {
        (self.long_steps > 0).then_some((self.long_steps, self.long_checksum.as_str()))
    }

    /// The self-test draws words.
    fn is_stimulated(&self) -> bool {
        self.chain
            || self.stream.is_some()
            || self.tests.iter().any(|t| t.alone && !t.drawn.is_empty())
    }

    /// A row where the chain is at the pointer `g`.
    fn row_at(&self) -> Vec<String> {
        self.row
            .iter()
            .map(|word| word.replace("g.chain", "g->chain"))
            .collect()
    }

    /// The words of the state at the end of a long run.
    fn long_state(&self) -> &[String] {
        match &self.stream {
            Some(stream) => &stream.final_state,
            None => &self.chain_state,
        }
    }

    /// The type of a sequence's state.
    fn stream_state(&self) -> &str {
        self.stream.as_ref().map_or("", |t| match t.language {
            Language::C => t.state.as_str(),
            Language::Rust => t.camel.as_str(),
        })
    }

    /// Words of a sequence's record.
    fn stream_outputs(&self) -> usize {
        self.stream
            .as_ref()
            .map_or(0, |t| t.function.outputs.len() + 1)
    }

    fn every_block(&self) -> u64 {
        vectors::BLOCK
    }

    fn long_segment(&self) -> u64 {
        stimulus::SEGMENT
    }

    /// Words of the longest record or line of vectors.
    fn most_words(&self) -> usize {
        let tests = self.tests.iter().map(|t| t.inputs + t.outputs);
        tests.chain([16, self.row.len() + 1]).max().unwrap_or(16)
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
    chain::columns(design)
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
