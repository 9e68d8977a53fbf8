//! What takes minutes or other programs: every reported point run again by other commands with other noise, budgets of
//! random designs, GNU parallel and Slurm. By hand: `cargo test --release --test all -- --ignored study_slow::`.

use crate::common::command::{good, gyrogen_here, text, told};
use crate::common::dice::Dice;
use gyrogen::design::{Design, reader, template};
use gyrogen::study::budget::budget;
use gyrogen::study::certainty::{Bounds, Confidence, FIGURES, largest};
use gyrogen::study::verify::Verifier;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn gyrogen(arguments: &[&str], out: &Path) -> Output {
    gyrogen_here(&[arguments, &["--out", text(out)]].concat())
}

fn json(path: &Path) -> Value {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_slice(&bytes).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

fn interval(point: &Value, name: &str) -> [f64; 2] {
    let ends = &point["bounds"][name];
    [number(&ends[0]), number(&ends[1])]
}

/// Other noise than the search and the verification have.
const OTHER_SEED: &str = "seed = 77001";

/// Every point of the default's study: `equiv` holds, what `simulate` reads is within the point's bounds, and so are
/// the figures of the verification's runs with other noise.
#[test]
#[ignore = "a study of the default and forty designs by three commands: ten minutes"]
fn every_reported_point_meets_its_figures_with_other_noise() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("study");
    good(&gyrogen(&["study"], &out));
    let study = json(&out.join("study.json"));
    let points = study["front"].as_array().expect("a front");
    assert!(points.len() >= 15, "{}", points.len());
    let confidence = Confidence::of(FIGURES * points.len());
    let z = confidence.standard_errors;
    let given = with_other_noise(template::DEFAULT);
    let verifier = Verifier::new(&given).expect("runs");
    let mut wrong = Vec::new();
    let mut compared = 0;
    for point in points {
        let file = out.join(point["design"].as_str().expect("a file"));
        let text = std::fs::read_to_string(&file).expect("a design");
        let design = with_other_noise(&text);
        let verified = verifier.verify(&design.without_stops()).expect("runs");
        let (f, start) = (&verified.figures, verified.startup_dps);
        let bounds = Bounds::new(f, &verified.errors, start, &confidence);
        // Two intervals of the same figure, both with their own error: the distance of the middles.
        let mut apart = |name: &str, own: f64, [low, high]: [f64; 2]| {
            compared += 1;
            let first = interval(point, name);
            let half = |[low, high]: [f64; 2]| 0.5 * (high - low);
            let reach = half(first).hypot(half([low, high]));
            let away = own - 0.5 * (first[0] + first[1]);
            if away.abs() > reach * 1.02 + 1e-12 {
                wrong.push(format!(
                    "point {}: {name} {own:.4e}, first {first:?}",
                    point["number"]
                ));
            }
        };
        apart("bias_dps", f.bias_dps, bounds.bias_dps);
        apart("drift_dps", f.drift_dps, bounds.drift_dps);
        apart("noise_dps_rthz", f.noise_dps_rthz, bounds.noise_dps_rthz);
        apart(
            "scale_factor_ppm",
            f.scale_factor_ppm,
            bounds.scale_factor_ppm,
        );
        // Without a line the first interval begins at 0, and its middle says nothing.
        compared += 1;
        if f.spur_dps > interval(point, "spur_dps")[1] + z * verified.errors.spur_dps {
            wrong.push(format!(
                "point {}: spur_dps {:.4e}",
                point["number"], f.spur_dps
            ));
        }
        let other = folder.path().join("other.toml");
        std::fs::write(&other, text.replacen("seed = 20040024", OTHER_SEED, 1)).expect("writes");
        let other = other.to_str().expect("UTF-8");
        let results = folder.path().join("results");
        let equiv = gyrogen(&["equiv", other, "--samples", "1000000"], &results);
        if !equiv.status.success() {
            let said = told(&equiv);
            wrong.push(format!("point {}: equiv: {said}", point["number"]));
        }
        good(&gyrogen(&["simulate", other], &results));
        let simulated = json(&results.join("simulate.json"));
        let found = number(&simulated["float_fixed"]["rate_dps"]);
        // The largest difference of a reading: a bias at one temperature, and the noise of the reading.
        let reading_s = design.thermal_run.samples_per_reading as f64
            * f64::from(design.circuit.decimator.ratio)
            / design.circuit.sample_rate_hz;
        let noise = interval(point, "noise_dps_rthz")[1] / (2.0 * reading_s).sqrt();
        let allowed = largest(interval(point, "bias_dps"))
            + largest(interval(point, "drift_dps"))
            + z * noise;
        println!(
            "point {}: largest reading {found:.3e} deg/s of {allowed:.3e}",
            point["number"]
        );
        compared += 1;
        if found > allowed {
            wrong.push(format!(
                "point {}: simulate: {found:.4e} of {allowed:.4e}",
                point["number"]
            ));
        }
    }
    println!(
        "{} points, {compared} comparisons, {} outside",
        points.len(),
        wrong.len()
    );
    assert!(wrong.is_empty(), "{wrong:#?}");
}

fn with_other_noise(text: &str) -> Design {
    assert!(text.contains("seed = 20040024"));
    reader::parse(&text.replacen("seed = 20040024", OTHER_SEED, 1), None).expect("a design")
}

/// The default with other words, roundings and now and then another oscillator.
fn random(dice: &mut Dice) -> Option<Design> {
    let product = dice.between(12, 24);
    let output = dice.between(14, 24);
    let roundings = ["half_up", "half_even", "floor", "half_away"];
    let rounding = roundings[dice.below(3) as usize];
    let tuning = [134_217_728, 134_217_728, 134_230_000, 134_000_123][dice.below(4) as usize];
    let changes = [
        (
            "product = { format = \"Q2.22\", rounding = \"half_up\"".to_owned(),
            format!("product = {{ format = \"Q2.{product}\", rounding = \"{rounding}\""),
        ),
        (
            "output = { format = \"Q12.12\"".to_owned(),
            format!("output = {{ format = \"Q12.{}\"", dice.between(4, 13)),
        ),
        (
            "tuning_word = 134217728".to_owned(),
            format!("tuning_word = {tuning}"),
        ),
        (
            "table_address_bits = 12".to_owned(),
            format!("table_address_bits = {}", dice.between(8, 14)),
        ),
        (
            "table = \"Q1.15\"".to_owned(),
            format!("table = \"Q1.{}\"", dice.between(9, 19)),
        ),
        (
            "iterations = 20".to_owned(),
            format!("iterations = {}", dice.between(12, 22)),
        ),
        (
            "angle_bits = 24".to_owned(),
            format!("angle_bits = {}", dice.between(16, 24)),
        ),
    ];
    let mut text = template::DEFAULT.to_owned();
    for (from, to) in &changes {
        assert!(text.contains(from.as_str()), "{from}");
        text = text.replacen(from.as_str(), to, 1);
    }
    let design = reader::parse(&text, None).ok()?;
    // The decimated word with what is in its LSB.
    let word = gyrogen::design::word::Word::Decimated;
    gyrogen::study::retune::with_lengths(&design, &[(word, output + 2)]).ok()
}

/// Lines above one percent of the whole, without a flag: what theory says against what was measured.
#[test]
#[ignore = "a hundred budgets: five minutes"]
fn budget_lines_without_a_flag_are_within_15_percent_of_the_measured_ones() {
    let mut dice = Dice(20_040_024);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (mut designs, mut lines, mut counted) = (0, 0, 0);
    let mut wrong = Vec::new();
    while designs < 100 {
        let Some(design) = random(&mut dice) else {
            continue;
        };
        let Ok(verifier) = Verifier::new(&design) else {
            continue;
        };
        let budget = budget(&design, &verifier, threads).expect("runs");
        designs += 1;
        let whole: f64 = budget
            .lines
            .iter()
            .filter_map(|l| l.measured_rms_dps)
            .map(|r| r * r)
            .sum();
        for line in &budget.lines {
            let (Some(predicted), Some(measured)) = (line.predicted_rms_dps, line.measured_rms_dps)
            else {
                lines += 1;
                continue;
            };
            lines += 1;
            if !line.flags.is_empty() || measured <= 0.01 * whole.sqrt() {
                continue;
            }
            counted += 1;
            let ratio = predicted / measured;
            if !(0.85..=1.15).contains(&ratio) {
                wrong.push(format!(
                    "design {designs}: {} of {}: {ratio:.3}",
                    line.name, line.length
                ));
            }
        }
    }
    println!(
        "{designs} designs, {lines} lines, {counted} above one percent and without a flag, {} of them off by more than 15 percent",
        wrong.len()
    );
    assert!(counted > 100, "{counted}");
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Three words, 175 designs.
fn small(folder: &Path) -> PathBuf {
    let text = "[study]\nwords = [\"circuit.demodulator.product\", \"circuit.cordic.iterations\", \
                \"compensation.output\"]\ntargets = [\"cortex-m4\"]\n[study.ranges]\n\
                \"circuit.demodulator.product\" = [14, 20]\n\"circuit.cordic.iterations\" = [14, 18]\n\
                \"compensation.output\" = [18, 22]\n";
    let path = folder.join("small.toml");
    std::fs::write(&path, text).expect("writes");
    path
}

/// Parts that a scheduler ran, merged, against the single run.
fn same_as_one_run(folder: &Path, file: &str) {
    let one = folder.join("one");
    good(&gyrogen(&["study", file], &one));
    let parts: Vec<String> = (1..=3)
        .map(|k| {
            folder
                .join(format!("part{k}"))
                .to_str()
                .expect("UTF-8")
                .to_owned()
        })
        .collect();
    let merged = folder.join("merged");
    good(&gyrogen(
        &["study", file, "--merge", &parts[0], &parts[1], &parts[2]],
        &merged,
    ));
    let bytes = |out: &Path| std::fs::read(out.join("study.json")).expect("study.json");
    assert!(bytes(&one) == bytes(&merged));
}

#[test]
#[ignore = "needs GNU parallel (Debian: parallel)"]
fn gnu_parallel_gives_the_bytes_of_one_run() {
    let version = Command::new("parallel").arg("--version").output();
    let version =
        version.unwrap_or_else(|e| panic!("GNU parallel is not here ({e}): install `parallel`"));
    let version = String::from_utf8_lossy(&version.stdout).into_owned();
    assert!(
        version.starts_with("GNU parallel"),
        "`parallel` is another program: {version}"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let file = small(folder.path());
    let mut command = Command::new("parallel");
    command.current_dir(folder.path());
    command.args([
        "--joblog",
        "log",
        "--resume-failed",
        "-j",
        "2",
        env!("CARGO_BIN_EXE_gyrogen"),
    ]);
    command.args([
        "study",
        "small.toml",
        "--shard",
        "{}/3",
        "--out",
        "part{}",
        ":::",
        "1",
        "2",
        "3",
    ]);
    good(&command.output().expect("parallel starts"));
    same_as_one_run(folder.path(), file.to_str().expect("UTF-8"));
}

/// A cluster of one machine, ended with the test.
struct Cluster {
    script: Option<PathBuf>,
    folder: tempfile::TempDir,
}

impl Cluster {
    /// The cluster that is there, or one that the script in `GYROGEN_SLURM_CLUSTER` starts (`SCRIPT start DIR`, which
    /// writes DIR/slurm.conf, and `SCRIPT stop DIR`).
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let script = std::env::var_os("GYROGEN_SLURM_CLUSTER").map(PathBuf::from);
        if let Some(script) = &script {
            let done = Command::new(script)
                .arg("start")
                .arg(folder.path())
                .output();
            good(&done.unwrap_or_else(|e| panic!("{}: {e}", script.display())));
        } else {
            let there = Command::new("sinfo")
                .output()
                .is_ok_and(|o| o.status.success());
            assert!(
                there,
                "no Slurm cluster answers `sinfo`: install `slurm-wlm` and `munge` and start one, or name a script that \
                 does in GYROGEN_SLURM_CLUSTER"
            );
        }
        Cluster { script, folder }
    }

    fn sbatch(&self) -> Command {
        let mut command = Command::new("sbatch");
        if self.script.is_some() {
            command.env("SLURM_CONF", self.folder.path().join("slurm.conf"));
        }
        command
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        if let Some(script) = &self.script {
            let _ = Command::new(script)
                .arg("stop")
                .arg(self.folder.path())
                .output();
        }
    }
}

#[test]
#[ignore = "needs a Slurm cluster (Debian: slurm-wlm, munge), or GYROGEN_SLURM_CLUSTER"]
fn a_slurm_job_array_gives_the_bytes_of_one_run() {
    let cluster = Cluster::new();
    let folder = tempfile::tempdir().expect("a folder");
    let file = small(folder.path());
    let job = format!(
        "#!/bin/sh\nexec {} study small.toml --threads 1 --shard $SLURM_ARRAY_TASK_ID/3 --out part$SLURM_ARRAY_TASK_ID\n",
        env!("CARGO_BIN_EXE_gyrogen")
    );
    std::fs::write(folder.path().join("job.sh"), job).expect("writes");
    let mut sbatch = cluster.sbatch();
    sbatch.args(["--wait", "--array=1-3", "--output=/dev/null", "--chdir"]);
    sbatch.arg(folder.path()).arg(folder.path().join("job.sh"));
    good(&sbatch.output().expect("sbatch starts"));
    same_as_one_run(folder.path(), file.to_str().expect("UTF-8"));
}
