//! The figures that coefficients must reach or beat: what Sollya's fpminimax gives for the same coefficients'
//! formats, under ideal evaluation and in the same 16-bit datapath.

use crate::common::command::told;
use serde_json::Value;
use std::process::Command;
use std::time::Instant;

const ATAN: &str = "atan(x)/(2*pi)";
const SINE: &str = "sin(pi*x/2)";
const DRIFT: &str = "136.82*x^2+242.97*x+109.60";

struct Case {
    function: &'static str,
    domain: &'static str,
    degree: &'static str,
    monomials: &'static str,
    coefficients: &'static str,
    /// fpminimax's largest error as it was printed, and one unit of its last digit.
    figure: (f64, f64),
}

const fn case(
    function: &'static str,
    domain: &'static str,
    (degree, monomials): (&'static str, &'static str),
    coefficients: &'static str,
    figure: (f64, f64),
) -> Case {
    Case {
        function,
        domain,
        degree,
        monomials,
        coefficients,
        figure,
    }
}

const CASES: [Case; 12] = [
    case(ATAN, "0,1", ("5", "all"), "Q1.15", (4.41e-6, 1e-8)),
    case(ATAN, "0,1", ("5", "all"), "Q1.17", (6.96e-6, 1e-8)),
    case(ATAN, "0,1", ("7", "all"), "Q1.15", (1.97e-7, 1e-9)),
    case(ATAN, "0,1", ("7", "all"), "Q1.17", (1.38e-7, 1e-9)),
    case(ATAN, "0,1", ("5", "odd"), "Q1.15", (9.91e-5, 1e-7)),
    case(ATAN, "0,1", ("5", "odd"), "Q1.17", (9.81e-5, 1e-7)),
    case(ATAN, "0,1", ("7", "odd"), "Q1.15", (1.60e-5, 1e-7)),
    case(ATAN, "0,1", ("7", "odd"), "Q1.17", (1.41e-5, 1e-7)),
    case(SINE, "0,1", ("5", "odd"), "Q2.15", (7.08e-5, 1e-7)),
    case(SINE, "0,1", ("7", "odd"), "Q2.15", (2.15e-6, 1e-8)),
    case("sqrt(x)", "0.25,1", ("4", "all"), "Q3.15", (1.79e-4, 1e-6)),
    case(DRIFT, "-0.9,0.2", ("2", "all"), "Q9.7", (2.90e-3, 1e-5)),
];

/// Runs `approx` and gives its JSON and its text.
fn approx(case: &Case, input: &str, output: &str, coefficients: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let domain = format!("--domain={}", case.domain);
    let started = Instant::now();
    let run = Command::new(env!("CARGO_BIN_EXE_gyrogen"))
        .args(["approx", "--function", case.function, &domain])
        .args(["--degree", case.degree, "--monomials", case.monomials])
        .args(["--input", input, "--output", output])
        .args(["--coefficients", coefficients, "--format", "json", "--out"])
        .arg(folder.path())
        .output()
        .unwrap();
    let told = told(&run);
    assert!(run.status.success(), "{} {told}", case.function);
    print!("{:.2} s  ", started.elapsed().as_secs_f64());
    serde_json::from_slice(&run.stdout).unwrap()
}

fn number(json: &Value, path: &str) -> f64 {
    json.pointer(path).and_then(Value::as_f64).unwrap()
}

fn is_proved(json: &Value, path: &str) -> bool {
    json.pointer(path).and_then(Value::as_bool).unwrap()
}

#[test]
fn coefficients_alone_are_never_worse_than_fpminimax() {
    for case in &CASES {
        // Wide and fine enough that the coefficients decide, with 16-bit and with wider input.
        let (output, wider) = match case.function {
            DRIFT => ("Q9.24", "Q1.19"),
            _ => ("Q2.28", "Q1.20"),
        };
        for input in ["Q1.15", wider] {
            let json = approx(case, input, output, case.coefficients);
            let ours = number(&json, "/error/coefficients_only_max_abs");
            let (figure, unit) = case.figure;
            println!(
                "{} {} {} {}: {ours:.4e}, fpminimax {figure:.2e}",
                case.function, case.degree, case.monomials, case.coefficients
            );
            assert!(
                ours <= figure + unit,
                "{}: {ours:e} is above {figure:e}",
                case.function
            );
            assert!(is_proved(&json, "/search/coefficients_proved_best"));
            let certified = number(&json, "/error/certified_max_abs");
            assert!(number(&json, "/error/exhaustive_max_abs") <= certified);
        }
    }
}

/// With a 16-bit output the emitted coefficients are those that the datapath does best with; what the formats allow under
/// ideal evaluation is said beside them.
#[test]
fn the_ideal_coefficients_are_reported_whatever_is_emitted() {
    let mut apart = 0;
    for case in &CASES {
        let output = if case.function == DRIFT {
            "Q9.7"
        } else {
            "Q1.15"
        };
        let json = approx(case, "Q1.15", output, case.coefficients);
        let ideal = number(&json, "/ideal/coefficients_only_max_abs");
        let emitted = number(&json, "/error/coefficients_only_max_abs");
        let (figure, unit) = case.figure;
        assert!(ideal <= figure + unit, "{}: {ideal:e}", case.function);
        assert!(is_proved(&json, "/ideal/proved_best"));
        let same = json["ideal"]["coefficients"] == json["coefficients"];
        assert_eq!(is_proved(&json, "/ideal/emitted"), same);
        if same {
            assert_eq!(ideal, emitted);
            continue;
        }
        apart += 1;
        assert!(ideal <= emitted);
        let whole = number(&json, "/error/exhaustive_max_abs");
        assert!(whole < number(&json, "/ideal/total_max_abs"));
        assert_eq!(json["search"]["reason"], "least_total");
    }
    println!("{apart} of 12 apart");
    assert!((1..6).contains(&apart));
}

/// With 16-bit input, output and coefficients the whole evaluation is below that of the nearest plane's
/// coefficients, or it is proved that no coefficients are.
#[test]
fn the_whole_evaluation_is_below_the_nearest_planes_or_nothing_is() {
    let more = [
        case("log(1+x)", "0,0.9", ("5", "all"), "Q2.14", (1.0, 1.0)),
        case("1/(1+x^2)", "-0.9,0.2", ("5", "all"), "Q3.13", (1.0, 1.0)),
        case("x^2.5", "0,1", ("5", "all"), "Q3.13", (1.0, 1.0)),
        case("exp(x)/4", "-1,1", ("4", "all"), "Q1.15", (1.0, 1.0)),
        case("cos(x)", "-1,1", ("4", "even"), "Q2.14", (1.0, 1.0)),
        case("asin(x)", "-0.5,0.5", ("7", "odd"), "Q2.14", (1.0, 1.0)),
    ];
    let mut better = 0;
    for case in CASES
        .iter()
        .filter(|c| !c.coefficients.ends_with(".17"))
        .chain(&more)
    {
        let own = match case.coefficients {
            "Q2.15" => "Q2.14",
            "Q3.15" => "Q3.13",
            other => other,
        };
        let output = if case.function == DRIFT {
            "Q9.7"
        } else {
            "Q1.15"
        };
        let json = approx(case, "Q1.15", output, own);
        let compared = json["search"]["compared"].as_array().unwrap();
        let total = |name: &str| {
            let one = compared
                .iter()
                .find(|c| c["name"].as_str().unwrap().starts_with(name));
            one.unwrap()["total_max_abs"].as_f64().unwrap()
        };
        let (plane, ours) = (total("lattice rounding"), total("taken"));
        let proved = is_proved(&json, "/search/proved_best");
        let gain = number(&json, "/search/gain_over_nearest_plane_percent");
        println!(
            "{} {} {}: lattice rounding {plane:.5e}, ours {ours:.5e} ({gain:.2} % less), proved {proved}",
            case.function, case.degree, case.monomials
        );
        let least = number(&json, "/search/least_total");
        assert!(ours < plane || proved && ours <= plane && plane <= least);
        better += usize::from(ours < plane);
        // What is compared is what was emitted and run.
        let run = number(&json, "/error/exhaustive_max_abs");
        assert!((run - ours).abs() <= 1e-6 * ours, "{run} {ours}");
        assert!((gain - 100.0 * (1.0 - ours / plane)).abs() < 1e-9);
    }
    assert!(better >= 8, "{better}");
}
