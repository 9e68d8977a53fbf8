//! Emission of random designs: `gyrogen emit` and `gyrogen verify` in both languages, and the
//! emitted chain against the independent reference.
//!
//! Environment: `GYROGEN_EMIT_DESIGNS` (how many), `GYROGEN_SEED` (the first seed; each design has
//! the next one), `GYROGEN_BINARY`, `GYROGEN_TEST_CC` (another C compiler; gcc).

use std::collections::BTreeMap;

use crate::oracle::bundle::{Bundle, Harness, Language};
use crate::oracle::design::Design;
use crate::oracle::fixed::{self, Row, Stop};
use crate::oracle::harness::setting;
use crate::oracle::toml_text::Printer;
use crate::oracle::{capture, edges};
use crate::rng::Rng;

/// Seed of the first random design.
const SEED: u64 = 20_261_121;
/// Designs in an ordinary test run.
const DESIGNS: u64 = 3;
/// Failures that are told before the test gives up.
const MOST_FAILURES: usize = 6;

/// One random design with a capture of whole periods.
struct Case {
    seed: u64,
    design: Design,
    text: String,
    clamped: bool,
    codes: Vec<(i64, i64)>,
}

/// What the contract says of the capture: the rows before the stop, if any.
struct Expected {
    rows: Vec<Row>,
    stop: Option<Stop>,
}

impl Case {
    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let design = edges::design(&mut rng);
        let mut text = Printer::plain().print(&design);
        let clamped = design.compensation.is_some() && rng.chance(15);
        if clamped {
            let line = edges::clamp_line(&mut rng, &design);
            text = text.replace("[compensation]", &format!("[compensation]\n{line}"));
        }
        let mut codes = Vec::new();
        while codes.is_empty() {
            codes = capture::random(&mut rng, &design);
        }
        // Zeros up to the end of the period show the fault of the samples before them.
        let ratio = design.ratio as usize;
        codes.resize(codes.len().div_ceil(ratio) * ratio, (0, 0));
        Self {
            seed,
            design,
            text,
            clamped,
            codes,
        }
    }

    fn expected(&self) -> Expected {
        match fixed::replay(&self.design, &self.codes) {
            Ok(rows) => Expected { rows, stop: None },
            Err(stop) => {
                let whole = stop.sample / self.design.ratio as usize * self.design.ratio as usize;
                let rows = fixed::replay(&self.design, &self.codes[..whole]);
                Expected {
                    rows: rows.expect("no stop before the first one"),
                    stop: Some(stop),
                }
            }
        }
    }

    /// Emits, verifies and compares both languages. Gives the stop's node.
    fn check(&self) -> Result<Option<String>, String> {
        let folder = tempfile::Builder::new()
            .prefix("gyrogen-emit-")
            .tempdir()
            .map_err(|e| e.to_string())?;
        let path = folder.path().join("design.toml");
        std::fs::write(&path, &self.text).map_err(|e| e.to_string())?;
        let expected = self.expected();
        let mut both = Vec::new();
        for language in [Language::C, Language::Rust] {
            let place = folder.path().join(language.name());
            let bundle = Bundle::emit(&path, language, place)?;
            let told = |message| format!("{language:?}: {message}");
            bundle.expect_verified().map_err(told)?;
            let harness = bundle.build().map_err(told)?;
            check_functions(&bundle, &harness).map_err(told)?;
            let rows = harness.chain(&self.codes, bundle.columns().len());
            let rows = rows.map_err(told)?;
            if !self.clamped {
                self.compare(&expected, &bundle, &rows).map_err(told)?;
            }
            both.push(rows);
        }
        if both[0] != both[1] {
            let at = both[0].iter().zip(&both[1]).position(|(a, b)| a != b);
            return Err(format!("C and Rust differ in row {at:?}"));
        }
        let node = expected.stop.map(|stop| stop.node);
        Ok(if self.clamped { None } else { node })
    }

    /// Rows against the reference up to a stop; there, the fault's node.
    fn compare(
        &self,
        expected: &Expected,
        bundle: &Bundle,
        found: &[Vec<u64>],
    ) -> Result<(), String> {
        let rows = self.codes.len() / self.design.ratio as usize;
        if found.len() != rows {
            return Err(format!("{} rows where {rows} are due", found.len()));
        }
        for (k, row) in expected.rows.iter().enumerate() {
            let due: Vec<u64> = row.values(k)[1..].iter().map(|v| *v as u64).collect();
            // The bias behind the rate follows the columns of the contract, then the fault.
            let (words, fault) = found[k].split_at(found[k].len() - 1);
            if !words.starts_with(&due) || words.len() > due.len() + 1 || fault != [0] {
                let columns = bundle.columns();
                return Err(format!(
                    "row {k} of {columns:?}: {due:?}, not {:?}",
                    found[k]
                ));
            }
        }
        let Some(stop) = &expected.stop else {
            return Ok(());
        };
        for row in &found[expected.rows.len()..] {
            let number = *row.last().expect("a fault");
            let node = bundle.fault_node(number);
            if node != stop.node {
                return Err(format!("fault {number} is {node}, not {}", stop.node));
            }
        }
        Ok(())
    }
}

fn check_functions(bundle: &Bundle, harness: &Harness) -> Result<(), String> {
    harness.selftest()?;
    for (name, inputs, rows) in bundle.vectors() {
        harness.call(&name, inputs, &rows)?;
    }
    Ok(())
}

#[test]
fn random_designs_emit_what_the_contract_says() {
    let first = setting("GYROGEN_SEED", SEED);
    let count = setting("GYROGEN_EMIT_DESIGNS", DESIGNS);
    let mut outcomes: BTreeMap<String, usize> = BTreeMap::new();
    let mut failures = Vec::new();
    for seed in first..first + count {
        let case = Case::new(seed);
        match case.check() {
            Ok(stop) => {
                println!("seed {seed} agrees, stop: {stop:?}");
                let name = stop.unwrap_or_else(|| "to the end".to_owned());
                *outcomes.entry(name).or_default() += 1;
            }
            Err(message) => {
                let Case { seed, text, .. } = case;
                eprintln!("seed {seed}: {message}");
                failures.push(format!("seed {seed}: {message}\n{text}"));
            }
        }
        if failures.len() >= MOST_FAILURES {
            break;
        }
    }
    println!("{outcomes:#?}");
    assert!(failures.is_empty(), "\n{}", failures.join("\n\n"));
}
