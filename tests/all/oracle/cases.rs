//! Random cases: one seed gives a design, a capture, and their check.

use super::capture::{self, CsvStyle, NpyStyle};
use super::design::{Design, Verdict};
use super::fixed::{self, Stop};
use super::float::{self, FloatRow};
use super::generate::{self, Aim};
use super::harness::{self, Case, Run};
use super::toml_text::Printer;
use crate::rng::Rng;

/// What became of a case that holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The output agrees; this many rows.
    Agreed(usize),
    /// Refused, as it has to be.
    Refused,
    /// Stopped by an overflow, as it has to be.
    Stopped,
}

/// Counts of outcomes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    pub agreed: usize,
    pub rows: usize,
    pub refused: usize,
    pub stopped: usize,
}

/// A random design with its capture, as values and in a folder.
pub struct RandomCase {
    pub seed: u64,
    pub design: Design,
    pub codes: Vec<(i64, i64)>,
    pub case: Case,
}

impl RandomCase {
    /// The case of a seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let aim = match rng.range(0, 99) {
            0..=77 => Aim::Accepted,
            78..=87 => Aim::Edge,
            _ => Aim::Refused,
        };
        let design = generate::design(&mut rng, aim);
        let codes = capture::random(&mut rng, &design);
        let text = Printer::random(&mut rng).print(&design);
        let case = if rng.chance(50) {
            let style = CsvStyle::random(&mut rng);
            let bytes = style.print(&mut rng, &codes);
            Case::new(&text, "capture.csv", &bytes)
        } else {
            let bytes = NpyStyle::random(&mut rng, design.adc).print(&codes);
            Case::new(&text, "capture.npy", &bytes)
        };
        Self {
            seed,
            design,
            codes,
            case,
        }
    }

    /// Keeps the files and tells where they are.
    pub fn report(self, message: &str) -> String {
        let seed = self.seed;
        let folder = self.case.keep();
        let shown = folder.display();
        let design = std::fs::read_to_string(folder.join("design.toml")).unwrap_or_default();
        format!(
            "seed {seed} (GYROGEN_SEED={seed} GYROGEN_RANDOM_DESIGNS=1): {message}\n\
             files kept in {shown}\n--- design.toml\n{design}"
        )
    }

    /// Replays bit for bit.
    pub fn check_fixed(&self) -> Result<Outcome, String> {
        let arith = (self.seed.is_multiple_of(3)).then_some("fixed");
        let run = self.case.run("out.csv", arith);
        if let Verdict::Refused(reasons) = self.design.verdict() {
            self.check_refusal(&run, &reasons)?;
            return Ok(Outcome::Refused);
        }
        match fixed::replay(&self.design, &self.codes) {
            Ok(rows) => {
                run.expect_status(0)?;
                let expected = harness::expected_csv(&self.design, &rows);
                harness::compare_text(&expected, &self.case.read("out.csv")?)?;
                Ok(Outcome::Agreed(rows.len()))
            }
            Err(stop) => {
                self.check_stop(&run, &stop)?;
                Ok(Outcome::Stopped)
            }
        }
    }

    fn check_refusal(&self, run: &Run, reasons: &[super::design::Refusal]) -> Result<(), String> {
        run.expect_status(2)
            .map_err(|message| format!("to be refused for {reasons:?}: {message}"))?;
        self.case.expect_no_output()?;
        let numbers = run.integers();
        let named = reasons.iter().any(|reason| {
            let bits_given = reason
                .bits
                .is_none_or(|bits| numbers.contains(&i128::from(bits)));
            run.stderr.contains(reason.key) && bits_given
        });
        if named {
            return Ok(());
        }
        let stderr = &run.stderr;
        Err(format!("the refusal names none of {reasons:?}:\n{stderr}"))
    }

    fn check_stop(&self, run: &Run, stop: &Stop) -> Result<(), String> {
        run.expect_status(1)
            .map_err(|message| format!("to be stopped by {stop:?}: {message}"))?;
        self.case.expect_no_output()?;
        let stderr = &run.stderr;
        let numbers = run.integers();
        if !stderr.contains(&stop.node) {
            return Err(format!("the node of {stop:?} is not named:\n{stderr}"));
        }
        let sample = stop.sample as i128;
        for (at, &number) in stop.operands.iter().chain([&sample]).enumerate() {
            let other = stop.as_coefficient.filter(|_| at == 0);
            let given = numbers.contains(&number) || other.is_some_and(|it| numbers.contains(&it));
            if !given {
                return Err(format!("{number} of {stop:?} is not named:\n{stderr}"));
            }
        }
        Ok(())
    }

    /// Replays in real numbers; gives the cells compared and those left out
    /// because their value is not well conditioned.
    pub fn check_float(&self) -> Result<(usize, usize), String> {
        let run = self.case.run("out.csv", Some("float"));
        if let Verdict::Refused(reasons) = self.design.verdict() {
            self.check_refusal(&run, &reasons)?;
            return Ok((0, 0));
        }
        run.expect_status(0)?;
        let columns = self.design.columns();
        let found = harness::read_real_csv(&self.case.read("out.csv")?, &columns)?;
        let wanted = float::replay(&self.design, &self.codes, [0.0; 3]);
        if found.len() != wanted.len() {
            let (a, b) = (found.len(), wanted.len());
            return Err(format!("{a} rows where {b} are due"));
        }
        self.compare_float(&found, &wanted)
    }

    fn compare_float(
        &self,
        found: &[Vec<f64>],
        wanted: &[FloatRow],
    ) -> Result<(usize, usize), String> {
        let columns = self.design.columns();
        let scales = float::scales(&self.design, wanted);
        let disturbed = disturbed_runs(&self.design, &self.codes);
        let (mut compared, mut left_out) = (0, 0);
        for (index, (cells, row)) in found.iter().zip(wanted).enumerate() {
            let values = row.values(index);
            let mut astray = false;
            for (column, scale) in scales.iter().enumerate() {
                let value = values[column];
                let moved = disturbed
                    .iter()
                    .map(|rows| scale.distance(rows[index].values(index)[column], value))
                    .fold(0.0f64, f64::max);
                if moved > 0.1 * scale.tolerance {
                    left_out += 1;
                    astray |= matches!(columns[column], "phase" | "tuning_word");
                    continue;
                }
                compared += 1;
                let name = columns[column];
                let cell = cells[column];
                let distance = scale.distance(cell, value);
                // a NaN is never within the tolerance
                let near = distance <= scale.tolerance;
                if !near {
                    return Err(format!(
                        "row {index}, column {name}: expected {value:?}, found {cell:?}, \
                         differ by {distance:e} where {:e} is allowed",
                        scale.tolerance
                    ));
                }
                if name == "phase" && !(-0.5..0.5).contains(&cell) {
                    return Err(format!("row {index}: phase {cell:?} is not in [-1/2, 1/2)"));
                }
            }
            if astray && self.design.phase_loop.is_some() {
                // from here on each engine is on a way of its own
                left_out += (found.len() - index - 1) * scales.len();
                break;
            }
        }
        Ok((compared, left_out))
    }
}

/// The same capture with drive and sense moved by 1e-12 of their greatest value
/// in several directions. The angle of a vanishing vector, the sides of a wrap
/// and whatever a loop makes of them move by more than the tolerance: no f64
/// engine can promise such a value, so it is not compared.
fn disturbed_runs(design: &Design, codes: &[(i64, i64)]) -> Vec<Vec<FloatRow>> {
    let size = 1e-12;
    [
        [size, size, size],
        [-size, -size, size],
        [size, -size, -size],
        [-size, size, -size],
    ]
    .into_iter()
    .map(|disturbance| float::replay(design, codes, disturbance))
    .collect()
}
