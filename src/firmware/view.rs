//! Everything that the templates of a bundle see.

use super::example::{ByHand, ExampleView, example};
use super::recipe::{Recipes, own_words};
use super::tested::{self, TestView, Tested};
use super::vectors::{self, Checked};
use crate::design::Design;
use crate::emit::bundle::Bundle;
use crate::emit::machine::{Type, Width, parameter_type};
use crate::emit::views::{self, FunctionView, Language, StateView, StructView, TableView};
use crate::emit::{c, rust};
use crate::numeric::trace::ir::Interval;
use crate::text::{self, Place};
use crate::vectors::chain;
use crate::vectors::interpreter::Interpreter;
use crate::vectors::model::Model;
use crate::vectors::stimulus::{self, SEED};

/// Draws for each function in the self-test.
const SELFTEST_DRAWS: u32 = 256;

/// What the templates show of a function with a state that is called once a reading, or once a row.
#[derive(Debug, Clone)]
pub struct StreamView {
    /// The function.
    pub function: FunctionView,
    /// Printed in.
    pub language: Language,
    /// What vectors and self-test call it.
    pub name: &'static str,
    /// The state's name.
    pub state: String,
    /// As a Rust type.
    pub camel: String,
    /// The state `s` as unsigned 64-bit words.
    pub final_state: Vec<String>,
    /// Number in the self-test.
    pub number: u32,
    /// Calls in the self-test.
    pub count: usize,
    /// A restart so often.
    pub restart: usize,
    /// When it is called.
    pub called: &'static str,
    /// What its parameter `restart` is.
    pub restarts: &'static str,
    /// FNV-1a of the outputs.
    pub checksum: String,
}

/// Everything that the templates of one bundle see.
#[derive(Debug)]
pub struct View {
    pub(super) p: String,
    pub(super) language: Language,
    pub(super) banner: String,
    pub(super) guard: String,
    pub(super) guarded: bool,
    pub(super) facts: Vec<String>,
    pub(super) states: Vec<StateView>,
    pub(super) structs: Vec<StructView>,
    pub(super) functions: Vec<FunctionView>,
    pub(super) tables: Vec<TableView>,
    pub(super) checks: Vec<&'static str>,
    pub(super) wide: bool,
    pub(super) chain: bool,
    /// The compensation's polynomial was fitted to a record.
    pub(super) fitted: bool,
    pub(super) ratio: u32,
    pub(super) initial: Vec<String>,
    pub(super) sample_faults: bool,
    pub(super) period_faults: bool,
    pub(super) tests: Vec<TestView>,
    pub(super) stream: Option<StreamView>,
    pub(super) seed: u64,
    pub(super) draws: u32,
    pub(super) chain_count: usize,
    pub(super) code: String,
    pub(super) code_low: String,
    pub(super) code_span: String,
    pub(super) row: Vec<String>,
    pub(super) chain_state: Vec<String>,
    pub(super) chain_checksum: String,
    pub(super) chain_number: u32,
    pub(super) vector_rows: usize,
    /// Low end, width and rate of each word that a long run draws.
    pub(super) long_words: Vec<[String; 3]>,
    pub(super) long_steps: u64,
    /// Calls between restarts.
    pub(super) long_restart: u64,
    pub(super) long_checksum: String,
    pub(super) example: Option<ExampleView>,
    /// How a sensor's code becomes a word of the function that is called.
    pub(super) recipes: Recipes,
    /// Where its words come from, if no sensor's code is one of them.
    pub(super) own_words: &'static str,
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
        let result = functions.last().map_or("", |f| f.result.as_str());
        // What has a state is called as the bundle's own pages say.
        let last = bundle.program.functions.last();
        let last = last.and_then(|f| models.iter().find(|m| m.name == f.name && m.state == 0));
        let example = last.and_then(|model| {
            example(bundle, result, language, |inputs| {
                let mut outputs = vec![0; model.outputs];
                model.call(inputs, &mut outputs);
                outputs
            })
        });
        // The chain takes codes as they come.
        let called = bundle
            .program
            .functions
            .last()
            .filter(|_| !bundle.has_chain);
        View {
            p: bundle.prefix.clone(),
            language,
            banner,
            guard: bundle.prefix.to_uppercase(),
            guarded: bundle.lowered.iter().any(|l| l.guarded),
            facts: facts.collect(),
            states: views::states(bundle, language),
            structs: views::structs(bundle, language),
            checks: checks(bundle),
            wide: wide(bundle),
            chain: bundle.has_chain,
            fitted: false,
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
            long_restart: stimulus::SEGMENT,
            long_checksum: String::new(),
            example,
            recipes: called.map_or_else(Recipes::default, |f| Recipes::of(&f.inputs)),
            own_words: "",
            functions,
            tables,
        }
    }

    /// Whether one function does all of a reading.
    pub(super) fn calls_once(&self) -> bool {
        !self.chain
            && self
                .functions
                .last()
                .is_some_and(|f| f.name == "compensate")
    }

    /// The call of `rate` with the result of `bias`, where that is cast to a narrower parameter.
    pub(super) fn by_hand(&self) -> Option<ByHand> {
        let named = |name: &str| self.functions.iter().find(|f| f.name == name);
        let (bias, rate) = (named("bias")?, named("rate")?);
        ByHand::of(&self.p, self.language, bias, rate)
    }

    pub(super) fn is_c(&self) -> bool {
        self.language == Language::C
    }

    /// Takes away all but the tables.
    pub(super) fn tables_alone(mut self) -> Self {
        // The name of the design.
        self.facts.truncate(1);
        self.states.clear();
        self.structs.clear();
        self.functions.clear();
        self.example = None;
        self.recipes = Recipes::default();
        self.checks.clear();
        self.tests.clear();
        self.chain = false;
        self
    }

    /// Adds what the chain's parts of the pages show.
    pub(super) fn with_chain(
        mut self,
        design: &Design,
        bundle: &Bundle,
        language: Language,
    ) -> Self {
        let compensation = design.compensation.as_ref();
        self.fitted = compensation.is_some_and(|c| c.fitted.is_some());
        let alone = compensation.filter(|_| !bundle.has_chain);
        self.own_words = alone.map_or("", |c| own_words(&c.input));
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

    /// What has vectors, by the name that the test driver checks it under.
    pub(super) fn vector_names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.tests.iter().map(|t| t.name.as_str()).collect();
        if !self.tables.is_empty() {
            names.push("tables");
        }
        names.extend(self.stream.as_ref().map(|stream| stream.name));
        if self.chain {
            names.push("chain");
        }
        names
    }

    /// The files with these vectors.
    pub(super) fn vector_files(&self, name: &str) -> Vec<String> {
        let names = match name {
            "chain" => vec!["chain_input", "chain_output"],
            name => vec![name],
        };
        let path = |name| format!("vectors/{name}.csv");
        names.into_iter().map(path).collect()
    }

    /// A function limits its inputs.
    pub(super) fn has_guards(&self) -> bool {
        self.guarded
    }

    /// The entry of a function says what one step of a word is worth in a unit.
    pub(super) fn has_worth(&self) -> bool {
        let mut notes = self.functions.iter().flat_map(|f| &f.notes);
        notes.any(|note| note.contains(" = raw * "))
    }

    /// The functions that are run over all their inputs, and how many these are.
    pub(super) fn exhausted(&self) -> String {
        let run = self.tests.iter().filter(|t| !t.every.is_empty());
        let named = run.map(|t| format!("`{}` ({})", t.name, t.every_count));
        named.collect::<Vec<_>>().join(", ")
    }

    /// A function is run over all its inputs.
    pub(super) fn has_every(&self) -> bool {
        self.tests.iter().any(|t| !t.every.is_empty())
    }

    /// The self-test draws words.
    pub(super) fn is_stimulated(&self) -> bool {
        self.chain
            || self.stream.is_some()
            || self.tests.iter().any(|t| t.alone && !t.drawn.is_empty())
    }

    /// A row where the chain is at the pointer `g`.
    pub(super) fn row_at(&self) -> Vec<String> {
        self.row
            .iter()
            .map(|word| word.replace("g.chain", "g->chain"))
            .collect()
    }

    /// The words of the state at the end of a long run.
    pub(super) fn long_state(&self) -> &[String] {
        match &self.stream {
            Some(stream) => &stream.final_state,
            None => &self.chain_state,
        }
    }

    /// The type of a sequence's state.
    pub(super) fn stream_state(&self) -> &str {
        self.stream.as_ref().map_or("", |t| match t.language {
            Language::C => t.state.as_str(),
            Language::Rust => t.camel.as_str(),
        })
    }

    /// Words of a sequence's record.
    pub(super) fn stream_outputs(&self) -> usize {
        self.stream
            .as_ref()
            .map_or(0, |t| t.function.outputs.len() + 1)
    }

    pub(super) fn every_block(&self) -> u64 {
        vectors::BLOCK
    }

    pub(super) fn long_segment(&self) -> u64 {
        stimulus::SEGMENT
    }

    /// Words of the longest record or line of vectors.
    pub(super) fn most_words(&self) -> usize {
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
