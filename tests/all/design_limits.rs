//! The limits of each key of a design, and what a design file may not say.

use crate::oracle::design::{AmplitudeLoop, Gain, PhaseLoop};
use crate::oracle::golden;
use crate::oracle::harness::{Case, Run};
use crate::oracle::toml_text::Printer;

/// A design file with every table, in plain spelling.
fn full_text() -> String {
    let mut design = golden::design();
    design.phase_loop = Some(PhaseLoop {
        setpoint_raw: -1_073_741_824,
        proportional: Gain { raw: 9, shift: 14 },
        integral: Gain { raw: 9, shift: 19 },
        integrator_bits: 64,
    });
    design.amplitude_loop = Some(AmplitudeLoop {
        setpoint_raw: 2_048_000,
        error_shift: 7,
        integrator_shift: 12,
        initial_raw: 67_108_864,
        gain_bits: 16,
    });
    Printer::plain().print(&design)
}

fn run(text: &str) -> (Case, Run) {
    let case = Case::new(text, "capture.csv", b"drive_code,sense_code\n1,1\n1,-1\n");
    let run = case.run("out.csv", None);
    (case, run)
}

/// Accepted: status 0.
fn accept(what: &str, text: &str) {
    let (_case, run) = run(text);
    run.expect_status(0)
        .unwrap_or_else(|message| panic!("{what}: {message}\n{text}"));
}

/// Refused: status 2, no output; the message has each of the `words`.
fn refuse(what: &str, text: &str, words: &[&str]) {
    let (case, run) = run(text);
    run.expect_status(2)
        .unwrap_or_else(|message| panic!("{what}: {message}\n{text}"));
    case.expect_no_output()
        .unwrap_or_else(|message| panic!("{what}: {message}"));
    for word in words {
        let stderr = &run.stderr;
        assert!(stderr.contains(word), "{what}: {word:?} is not in {stderr}");
    }
}

/// The table of a line of `full_text`, and the number of the line from 1.
fn find(text: &str, table: &str, key: &str) -> (usize, String) {
    let mut current = String::new();
    for (at, line) in text.lines().enumerate() {
        if let Some(name) = line.strip_prefix('[') {
            current = name.trim_end_matches(']').to_owned();
        } else if current == table && line.split(" = ").next() == Some(key) {
            return (at + 1, line.to_owned());
        }
    }
    panic!("no key {key} in [{table}]");
}

/// The text with the value of a key replaced.
fn with(table: &str, key: &str, value: &str) -> String {
    let text = full_text();
    let (number, _) = find(&text, table, key);
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines[number - 1] = format!("{key} = {value}");
    lines.join("\n") + "\n"
}

/// Integer keys: the least and the greatest value are accepted, those beside are
/// refused by the key's name.
#[test]
fn integer_limits() {
    // (table, key, least, greatest); where another key narrows the range at one
    // end, that end is tested in `limits_that_hang_together`.
    let keys = [
        ("circuit.nco", "phase_bits", Some(8), Some(64)),
        ("circuit.nco", "table_address_bits", Some(2), Some(16)),
        ("circuit.decimator", "stages", Some(1), Some(6)),
        ("circuit.decimator", "ratio", Some(2), Some(4096)),
        ("circuit.decimator", "differential_delay", Some(1), Some(2)),
        ("circuit.cordic", "iterations", Some(4), Some(30)),
        ("circuit.cordic", "guard_bits", Some(0), Some(32)),
        ("circuit.cordic", "width", Some(4), Some(64)),
        ("circuit.cordic", "angle_bits", Some(4), Some(64)),
        ("circuit.cordic", "gain_bits", Some(1), Some(62)),
        ("circuit.phase_loop", "integrator_bits", Some(2), Some(64)),
        ("circuit.amplitude_loop", "error_shift", Some(0), Some(63)),
        (
            "circuit.amplitude_loop",
            "integrator_shift",
            Some(0),
            Some(63),
        ),
        ("circuit.amplitude_loop", "gain_bits", Some(2), Some(32)),
    ];
    for (table, key, least, greatest) in keys {
        for (limit, step) in [(least, -1i64), (greatest, 1)] {
            let Some(limit) = limit else { continue };
            let text = with(table, key, &limit.to_string());
            let text = relax(&text, table, key);
            accept(&format!("{table}.{key} = {limit}"), &text);
            for beyond in [limit + step, limit + 1000 * step] {
                let what = format!("{table}.{key} = {beyond}");
                let text = relax(&with(table, key, &beyond.to_string()), table, key);
                refuse(&what, &text, &[key]);
            }
        }
        for wrong in ["1.5", "\"8\"", "true", "[8]"] {
            let what = format!("{table}.{key} = {wrong}");
            refuse(&what, &with(table, key, wrong), &[key]);
        }
        let (_, line) = find(&full_text(), table, key);
        let real = format!("{}.0", line.split(" = ").nth(1).expect("a value"));
        refuse(
            &format!("{table}.{key} = {real}"),
            &with(table, key, &real),
            &[key],
        );
    }
    for key in ["proportional", "integral"] {
        for (shift, good) in [(0, true), (63, true), (64, false), (-1, false)] {
            let value = format!("{{ raw = 9, shift = {shift} }}");
            let text = with("circuit.phase_loop", key, &value);
            if good {
                accept(&value, &text);
            } else {
                refuse(&value, &text, &["shift"]);
            }
        }
    }
}

/// Moves the keys that would be refused beside the one under test.
fn relax(text: &str, table: &str, key: &str) -> String {
    let zeroed = |text: &str, key: &str, value: &str| {
        let (number, _) = find(text, table, key);
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines[number - 1] = format!("{key} = {value}");
        lines.join("\n") + "\n"
    };
    match (table, key) {
        ("circuit.nco", "phase_bits") => {
            let text = zeroed(text, "tuning_word", "1");
            zeroed(&text, "table_address_bits", "4")
        }
        ("circuit.amplitude_loop", _) => zeroed(text, "initial_raw", "0"),
        // the setpoint is in phase units
        ("circuit.cordic", "angle_bits") => text.replace("-1073741824", "0"),
        _ => text.to_owned(),
    }
}

#[test]
fn limits_that_hang_together() {
    let nco = "circuit.nco";
    for word in [
        "0",
        "4294967295",
        "-1",
        "-4294967296",
        "-9223372036854775808",
    ] {
        accept(word, &with(nco, "tuning_word", word));
    }
    for word in ["4294967296", "9223372036854775807"] {
        refuse(word, &with(nco, "tuning_word", word), &["tuning_word"]);
    }
    let wide = with(nco, "phase_bits", "64");
    accept(
        "2^63 - 1",
        &wide.replace(
            "tuning_word = 33554432",
            "tuning_word = 9223372036854775807",
        ),
    );
    // a <= w
    let narrow = with(nco, "phase_bits", "8").replace("tuning_word = 33554432", "tuning_word = 3");
    let address = |bits: &str| {
        narrow.replace(
            "table_address_bits = 10",
            &format!("table_address_bits = {bits}"),
        )
    };
    accept("a = w", &address("8"));
    refuse("a > w", &address("9"), &["table_address_bits"]);
    // the integrator starts within 0 ..= (2^15 - 1) * 2^12
    let amplitude = "circuit.amplitude_loop";
    for (value, good) in [
        ("0", true),
        ("134213632", true),
        ("134213633", false),
        ("-1", false),
    ] {
        let text = with(amplitude, "initial_raw", value);
        if good {
            accept(value, &text);
        } else {
            refuse(value, &text, &["initial_raw"]);
        }
    }
}

#[test]
fn formats() {
    let adc = ("circuit.adc", "format");
    let table = ("circuit.nco", "table");
    let coefficient = ("compensation", "coefficient_format");
    let product = ("circuit.demodulator", "product");
    let output = ("compensation", "output");
    let good = [
        (adc, "Q2.0"),
        (adc, "Q1.1"),
        (adc, "Q32.0"),
        (adc, "Q1.31"),
        (table, "Q1.1"),
        (table, "Q1.39"),
        (table, "Q40.0"),
        (coefficient, "UQ24.0"),
        (product, "UQ0.64"),
        (product, "UQ64.0"),
        (product, "Q1.0"),
        (product, "UQ1.0"),
        (product, "Q1.63"),
        (output, "Q64.0"),
    ];
    for ((table, key), format) in good {
        let text = with(table, key, &format!("\"{format}\""));
        accept(&format!("{table}.{key} = {format}"), &text);
    }
    let bad = [
        (adc, "Q1.0"),
        (adc, "Q33.0"),
        (adc, "UQ1.15"),
        (table, "Q1.0"),
        (table, "Q1.40"),
        (table, "UQ1.15"),
        (product, "Q0.16"),
        (product, "Q0.0"),
        (product, "UQ0.0"),
        (product, "Q1.64"),
        (product, "UQ1.64"),
        (product, "Q65.0"),
        (product, "Q4294967296.0"),
        (product, "Q99999999999999999999.1"),
        (product, "Q-1.17"),
        (product, "Q1"),
        (product, "Q.15"),
        (product, "Q1."),
        (product, "1.15"),
        (product, "S1.15"),
        (product, ""),
        (product, "Q1.15.2"),
    ];
    for ((table, key), format) in bad {
        let text = with(table, key, &format!("\"{format}\""));
        refuse(&format!("{table}.{key} = {format}"), &text, &[key]);
    }
    // strings only
    for (table, key) in [adc, table, coefficient] {
        let text = with(table, key, "{ format = \"Q17.15\" }");
        refuse(&format!("{table}.{key} as a table"), &text, &[key]);
    }
    for value in [
        "{ format = \"Q2.30\", rounding = \"nearest\" }",
        "{ format = \"Q2.30\", rounding = \"Floor\" }",
        "{ format = \"Q2.30\", overflow = \"clip\" }",
        "{ rounding = \"floor\" }",
        "{}",
        "{ format = \"Q2.30\", width = 3 }",
        "15",
    ] {
        refuse(value, &with(product.0, product.1, value), &["product"]);
    }
    for value in ["\"nearest\"", "\"half_even\"", "1"] {
        let text = with("circuit.nco", "address_rounding", value);
        refuse(value, &text, &["address_rounding"]);
    }
}

#[test]
fn compensation_values() {
    let table = "compensation";
    for value in ["1", "0.5", "0.0009765625", "1048576", "32768"] {
        accept(value, &with(table, "rate_full_scale_dps", value));
    }
    for value in ["3", "0.3", "0", "0.0", "-2.0", "nan", "inf", "\"1\""] {
        let text = with(table, "rate_full_scale_dps", value);
        refuse(value, &text, &["rate_full_scale_dps"]);
    }
    let sixteen = format!("[{}]", vec!["1"; 16].join(", "));
    accept("16", &with(table, "coefficients_raw", &sixteen));
    accept("1", &with(table, "coefficients_raw", "[-5]"));
    accept(
        "least",
        &with(table, "coefficients_raw", "[-2147483648, 2147483647]"),
    );
    let seventeen = format!("[{}]", vec!["1"; 17].join(", "));
    for value in [
        "[]",
        &seventeen,
        "[2147483648]",
        "[1, -2147483649]",
        "[1.5]",
        "[1.0]",
        "3",
    ] {
        let text = with(table, "coefficients_raw", value);
        refuse(value, &text, &["coefficients_raw"]);
    }
    // not representable in the accumulator
    for format in ["Q34.14", "Q8.15", "UQ0.15"] {
        let text = with(table, "accumulator", &format!("\"{format}\""));
        refuse(format, &text, &["compensation"]);
    }
    refuse("input", &with(table, "input", "\"magnitude\""), &["input"]);
}

/// A key that is missing, unknown or twice; tables likewise.
#[test]
fn keys_that_are_missing_or_unknown() {
    let text = full_text();
    for (at, line) in text.lines().enumerate() {
        if line.is_empty() || line.starts_with('[') {
            continue;
        }
        let key = line.split(" = ").next().expect("a key");
        let mut lines: Vec<&str> = text.lines().collect();
        lines.remove(at);
        let less = lines.join("\n");
        refuse(&format!("without {line}"), &less, &[key]);

        let mut lines: Vec<&str> = text.lines().collect();
        lines.insert(at + 1, "no_such_key = 1");
        let more = lines.join("\n");
        let number = (at + 2).to_string();
        refuse("an unknown key", &more, &["no_such_key", &number]);
    }
    let required = [
        "circuit.adc",
        "circuit.nco",
        "circuit.demodulator",
        "circuit.decimator",
    ];
    for table in required.into_iter().chain(["circuit.cordic"]) {
        let start = text.find(&format!("[{table}]")).expect("the table");
        let end = start + text[start..].find("\n\n").expect("an end");
        let less = format!("{}{}", &text[..start], &text[end..]);
        let name = table.split('.').nth(1).expect("a name");
        refuse(&format!("without [{table}]"), &less, &[name]);
    }
    for table in [
        "circuit.phase_loop",
        "circuit.amplitude_loop",
        "compensation",
    ] {
        let start = text.find(&format!("[{table}]")).expect("the table");
        let end = start + text[start..].find("\n\n").expect("an end");
        let less = format!("{}{}", &text[..start], &text[end..]);
        accept(&format!("without [{table}]"), &less);
    }
    let lines = (text.lines().count() + 1).to_string();
    for table in ["circuit.no_such_table", "no_such_table"] {
        let more = format!("{text}[{table}]\nx = 1\n");
        refuse(table, &more, &["no_such_table", &lines]);
    }
    refuse("not TOML", &text.replace("ratio = 64", "ratio 64"), &[]);
    let twice = text.replace("ratio = 64", "ratio = 64\nratio = 64");
    refuse("a key twice", &twice, &[]);
}

/// A TOML integer serves for a real.
#[test]
fn integers_serve_for_reals() {
    accept("224000", &with("circuit", "sample_rate_hz", "224000"));
    for value in ["0", "-1.0", "nan", "inf", "\"224000\""] {
        let text = with("circuit", "sample_rate_hz", value);
        refuse(value, &text, &["sample_rate_hz"]);
    }
}
