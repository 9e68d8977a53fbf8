//! `gyrogen approx` as a user runs it, against an evaluator that is written from the manual's text alone.

mod evaluator;

use crate::common::command::{gyrogen_here, told};
use crate::common::dice::Dice;
use evaluator::{Evaluator, checksum};
use serde_json::Value;
use std::path::Path;

/// Runs `approx` into `folder` and gives its JSON.
fn approx(folder: &Path, arguments: &[&str]) -> Value {
    let mut all = vec![
        "approx",
        "--format",
        "json",
        "--out",
        folder.to_str().unwrap(),
    ];
    all.extend(arguments);
    let output = gyrogen_here(&all);
    let told = told(&output);
    assert!(output.status.success(), "{arguments:?}: {told}");
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let written = std::fs::read_to_string(folder.join("approx.json")).unwrap();
    assert_eq!(json, serde_json::from_str::<Value>(&written).unwrap());
    json
}

/// A function with the same in plain double precision.
type Case = (&'static str, &'static str, fn(f64) -> f64);

/// The evaluator's outputs are the vectors' and, by their checksums, those of every input; the errors are those that the
/// JSON states.
fn agrees(folder: &Path, json: &Value, f: fn(f64) -> f64) -> (f64, f64) {
    let evaluator = Evaluator::of(json);
    let vectors = std::fs::read_to_string(folder.join("c/vectors/evaluate.csv")).unwrap();
    for line in vectors.lines().skip(1) {
        let words: Vec<i128> = line.split(',').map(|w| w.parse().unwrap()).collect();
        assert_eq!(
            evaluator.run(words[0]),
            words[1],
            "input {}: {json:#}",
            words[0]
        );
    }
    let manifest = std::fs::read_to_string(folder.join("c/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&manifest).unwrap();
    let every = &manifest["functions"][0]["every_input"];
    // All words of the input's format, in blocks of 4096.
    let words = evaluator.words.0..=evaluator.words.1;
    assert_eq!(
        every["inputs"].as_i64().unwrap() as i128,
        words.end() - words.start() + 1
    );
    let starts = words.clone().step_by(4096);
    let block =
        |low: i128| checksum((low..=(low + 4095).min(*words.end())).map(|x| evaluator.run(x)));
    let whole = starts.fold(0xcbf2_9ce4_8422_2325, |h: u64, low| {
        (h ^ block(low)).wrapping_mul(0x100_0000_01b3)
    });
    assert_eq!(every["checksum"], format!("{whole:#x}"));
    let (low, high) = evaluator.codes;
    let error = |x: i128| (evaluator.value(evaluator.run(x)) - f(evaluator.input(x))).abs();
    let worst = (low..=high).map(error).fold(0.0, f64::max);
    let e = &json["error"];
    let exhaustive = e["exhaustive_max_abs"].as_f64().unwrap();
    let certified = e["certified_max_abs"].as_f64().unwrap();
    assert!(
        (exhaustive - worst).abs() < 1e-11 * (1.0 + worst),
        "{exhaustive} {worst}"
    );
    assert!(exhaustive <= certified);
    let at = i128::from(e["at_input_raw"].as_i64().unwrap());
    assert!((error(at) - worst).abs() < 1e-11);
    assert_eq!(
        json["inputs_checked"].as_i64().unwrap() as i128,
        high - low + 1
    );
    (exhaustive, certified)
}

const CASES: [Case; 8] = [
    ("atan(x)/(2*pi)", "0,1", |x| {
        x.atan() / std::f64::consts::TAU
    }),
    ("sin(pi*x/2)", "0,1", |x| {
        (x * std::f64::consts::FRAC_PI_2).sin()
    }),
    ("sin(pi*x/2)", "-1,1", |x| {
        (x * std::f64::consts::FRAC_PI_2).sin()
    }),
    ("cos(x)", "-1,1", f64::cos),
    ("exp(x)/4", "-1,0.7", |x| x.exp() / 4.0),
    ("sqrt(x)", "0.25,1", f64::sqrt),
    ("log(1+x)", "-0.3,0.9", f64::ln_1p),
    ("1/(1+x^2)", "-0.9,0.2", |x| 1.0 / (1.0 + x * x)),
];

#[test]
fn random_polynomials_are_what_the_manual_says_and_within_their_bounds() {
    let mut dice = Dice(7);
    let mut ratios = Vec::new();
    for k in 0..36 {
        let (function, domain, f) = CASES[dice.below(CASES.len() as u64) as usize];
        let folder = tempfile::tempdir().unwrap();
        let bits = 8 + dice.below(9);
        let fine = 9 + dice.below(10);
        let own = 8 + dice.below(10);
        let degree = (1 + dice.below(7)).to_string();
        let domain = format!("--domain={domain}");
        let formats = [
            format!("Q1.{bits}"),
            format!("Q2.{fine}"),
            format!("Q7.{own}"),
        ];
        let inner = format!("Q8.{}", 10 + dice.below(16));
        let kind = ["all", "odd", "even"][dice.below(3) as usize];
        let kind = if function.starts_with("sin") && domain.contains('-') {
            kind
        } else {
            "all"
        };
        let mut arguments = vec![
            "--function",
            function,
            &domain,
            "--degree",
            &degree,
            "--input",
            &formats[0],
            "--output",
            &formats[1],
            "--coefficients",
            &formats[2],
            "--monomials",
            kind,
        ];
        if dice.below(2) == 0 {
            arguments.extend(["--intermediate", &inner]);
        }
        let json = approx(folder.path(), &arguments);
        let (exhaustive, certified) = agrees(folder.path(), &json, f);
        ratios.push(certified / exhaustive);
        if k % 6 == 0 {
            verified(folder.path());
        }
    }
    distribution("polynomials", ratios);
}

#[test]
fn formats_of_their_own_and_estrins_scheme_are_what_the_manual_says() {
    let mut dice = Dice(29);
    let mut ratios = Vec::new();
    for k in 0..15 {
        let (function, domain, f) = CASES[dice.below(CASES.len() as u64) as usize];
        let folder = tempfile::tempdir().unwrap();
        let kind = match function {
            "sin(pi*x/2)" => "odd",
            "cos(x)" => "even",
            _ => "all",
        };
        let degree = 2 + dice.below(9);
        let count = match kind {
            "all" => degree + 1,
            "odd" => degree.div_ceil(2),
            _ => degree / 2 + 1,
        };
        let formats: Vec<String> = (0..count)
            .map(|_| format!("Q7.{}", 6 + dice.below(14)))
            .collect();
        let list = match dice.below(4) {
            0 => formats[0].clone(),
            _ => formats.join(","),
        };
        let scheme = ["horner", "estrin"][(k % 3).min(1)];
        let arguments = [
            format!("--function={function}"),
            format!("--domain={domain}"),
            format!("--degree={degree}"),
            format!("--input=Q1.{}", 7 + dice.below(9)),
            format!("--output=Q2.{}", 9 + dice.below(10)),
            format!("--coefficients={list}"),
            format!("--monomials={kind}"),
            format!("--evaluation={scheme}"),
            format!("--intermediate=Q9.{}", 8 + dice.below(16)),
        ];
        let given = arguments.len() - usize::from(dice.below(2) == 0);
        let arguments: Vec<&str> = arguments[..given].iter().map(String::as_str).collect();
        let json = approx(folder.path(), &arguments);
        assert_eq!(json["evaluation"], scheme);
        let one = list.split(',').all(|f| f == formats[0]);
        let said = if one { &formats[0] } else { &list };
        assert_eq!(
            json["formats"]["coefficients"].as_str(),
            Some(said.as_str())
        );
        let (exhaustive, certified) = agrees(folder.path(), &json, f);
        ratios.push(certified / exhaustive);
        if k % 5 == 0 {
            verified(folder.path());
        }
    }
    distribution("formats of their own, Estrin", ratios);
}

/// Prints how far above the greatest error the proved bound is; above 1.2 only rarely.
fn distribution(what: &str, mut ratios: Vec<f64>) {
    ratios.sort_by(f64::total_cmp);
    let n = ratios.len();
    let above = ratios.iter().filter(|r| **r > 1.2).count();
    println!(
        "{what}: certified / exhaustive: median {:.4}, 90 % {:.4}, greatest {:.4}; {above} of {n} above 1.2",
        ratios[n / 2],
        ratios[n * 9 / 10],
        ratios[n - 1]
    );
    assert!(above * 10 <= n, "{ratios:?}");
}

/// Both bundles hold when they are rebuilt from their own files.
fn verified(folder: &Path) {
    for language in ["c", "rust"] {
        let output = gyrogen_here(&["verify", folder.join(language).to_str().unwrap()]);
        let told = told(&output);
        assert!(output.status.success(), "{language}: {told}");
    }
}

#[test]
fn tables_and_segments_are_what_the_manual_says_and_within_their_bounds() {
    let mut dice = Dice(3);
    let mut ratios = Vec::new();
    for (form, degree) in [
        ("table", Some("0")),
        ("table", Some("1")),
        ("table", Some("2")),
        ("table", None),
        ("piecewise", Some("1")),
        ("piecewise", Some("2")),
        ("piecewise", Some("3")),
        ("piecewise", Some("4")),
        ("piecewise", None),
        ("auto", None),
    ] {
        for _ in 0..2 {
            let (function, domain, f) = CASES[dice.below(CASES.len() as u64) as usize];
            let folder = tempfile::tempdir().unwrap();
            let input = format!("Q1.{}", 9 + dice.below(6));
            let fine = 9 + dice.below(5);
            let output = format!("Q2.{fine}");
            let domain = format!("--domain={domain}");
            // A plain table cannot do better than the input's own steps.
            let lsb = f64::powi(2.0, -(fine.min(8) as i32));
            let bound = (lsb * (1.0 + dice.below(40) as f64 / 10.0)).to_string();
            let mut arguments = vec![
                "--function",
                function,
                &domain,
                "--form",
                form,
                "--input",
                &input,
                "--output",
                &output,
                "--bound",
                &bound,
            ];
            if let Some(degree) = degree {
                arguments.extend(["--degree", degree]);
            }
            let json = approx(folder.path(), &arguments);
            let (exhaustive, certified) = agrees(folder.path(), &json, f);
            assert!(certified <= bound.parse::<f64>().unwrap());
            let alternatives = json["alternatives"].as_array().unwrap();
            assert_eq!(
                alternatives.iter().filter(|a| a["chosen"] == true).count(),
                1
            );
            assert!(alternatives.iter().any(|a| a["undominated"] == true));
            ratios.push(certified / exhaustive);
        }
        let folder = tempfile::tempdir().unwrap();
        let mut arguments = vec![
            "--function",
            "x^0.5",
            "--domain=0,1",
            "--form",
            form,
            "--input",
            "UQ0.12",
            "--output",
            "UQ1.10",
            "--bound",
            "0.002",
        ];
        if let Some(degree) = degree {
            arguments.extend(["--degree", degree]);
        }
        let json = approx(folder.path(), &arguments);
        agrees(folder.path(), &json, f64::sqrt);
        verified(folder.path());
    }
    distribution("tables and segments", ratios);
}

#[test]
fn what_the_list_promises_is_kept_by_what_is_emitted() {
    // The coefficients with the least observed error have a proved one of 5.2e-4; those of the list keep to it.
    let folder = tempfile::tempdir().unwrap();
    let json = approx(
        folder.path(),
        &[
            "--function",
            "sqrt(x+1.141)*0.716",
            "--domain=0,1",
            "--input",
            "Q1.12",
            "--output",
            "Q3.13",
            "--bound",
            "0.0005",
            "--form",
            "auto",
        ],
    );
    let certified = json["error"]["certified_max_abs"].as_f64().unwrap();
    assert!(certified <= 5e-4, "{certified}");
    assert_eq!(json["holds"], true);
}

#[test]
fn damage_of_one_lsb_is_caught() {
    let polynomial = [
        "--function",
        "atan(x)/(2*pi)",
        "--domain=0,1",
        "--degree",
        "5",
        "--input",
        "Q1.15",
        "--output",
        "Q1.15",
        "--coefficients",
        "Q1.15",
        "--intermediate",
        "Q1.17",
    ];
    let table = [
        "--function",
        "sin(x)",
        "--domain=-1,1",
        "--form",
        "table",
        "--input",
        "Q1.13",
        "--output",
        "Q1.13",
        "--bound",
        "2e-4",
    ];
    for (arguments, file) in [
        (&polynomial[..], "c/approx.c"),
        (&table[..], "c/approx_tables.c"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        approx(folder.path(), arguments);
        verified(folder.path());
        let path = folder.path().join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut caught = 0;
        for (damaged, what) in damages(&text).into_iter().take(12) {
            std::fs::write(&path, damaged).unwrap();
            // The manifest follows, so that only the numbers can tell.
            let manifest = folder.path().join("c/manifest.json");
            let before = std::fs::read_to_string(&manifest).unwrap();
            let sum = |text: &str| gyrogen::digest::sha256(text.as_bytes());
            let damaged = std::fs::read_to_string(&path).unwrap();
            std::fs::write(&manifest, before.replace(&sum(&text), &sum(&damaged))).unwrap();
            let output = gyrogen_here(&["verify", folder.path().join("c").to_str().unwrap()]);
            assert_eq!(
                output.status.code(),
                Some(1),
                "{file}: {what} is not noticed"
            );
            std::fs::write(&manifest, before).unwrap();
            caught += 1;
        }
        assert!(caught >= 3, "{file}: only {caught} damages were tried");
    }
}

/// Texts in which one number of an evaluation or a table is one larger.
fn damages(text: &str) -> Vec<(String, String)> {
    let mut all = Vec::new();
    let lines: Vec<&str> = text.lines().collect();
    for (k, line) in lines.iter().enumerate() {
        let number = if line.contains(" + ") && line.contains("_C(") {
            // A coefficient or a rounding constant.
            let start = line.rfind("_C(").unwrap() + 3;
            Some((start, line[start..].find(')').unwrap() + start))
        } else if line.starts_with("    ") && line.ends_with(',') {
            Some((4, line.find(',').unwrap()))
        } else {
            None
        };
        let Some((start, end)) = number else { continue };
        let Ok(value) = line[start..end].parse::<i64>() else {
            continue;
        };
        // A rounding constant may be off by one without any effect.
        let table = line.ends_with(',');
        if value == 0 || !table && value.unsigned_abs().is_power_of_two() {
            continue;
        }
        // One LSB of the coefficient, as it is aligned.
        let aligned = if all.is_empty() { 15 } else { 17 };
        let step = if table { 1 } else { 1 << aligned };
        let mut copy: Vec<String> = lines.iter().map(|l| l.to_string()).collect();
        copy[k] = format!("{}{}{}", &line[..start], value + step, &line[end..]);
        all.push((
            copy.join("\n") + "\n",
            format!("line {}: {}", k + 1, line.trim()),
        ));
    }
    all
}

#[test]
fn the_threads_do_not_show() {
    let mut texts = Vec::new();
    for threads in ["1", "2", "5"] {
        let folder = tempfile::tempdir().unwrap();
        approx(
            folder.path(),
            &[
                "--function",
                "cos(x)",
                "--domain=-1,1",
                "--bound",
                "1e-3",
                "--form",
                "auto",
                "--input",
                "Q1.12",
                "--output",
                "Q2.12",
                "--threads",
                threads,
            ],
        );
        let mut all = String::new();
        for name in [
            "approx.json",
            "c/approx.c",
            "c/manifest.json",
            "rust/src/lib.rs",
        ] {
            all += &std::fs::read_to_string(folder.path().join(name)).unwrap();
        }
        texts.push(all);
    }
    assert!(texts.iter().all(|t| *t == texts[0]));
}
