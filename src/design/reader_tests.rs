use super::*;
use crate::design::template::DEFAULT;

#[path = "reader_broken.rs"]
mod broken;
#[path = "reader_fuzz.rs"]
mod fuzz;

/// The error of a text in which `¦` marks the place where it has to be.
fn refused(marked: &str) -> Box<InputError> {
    let offset = marked.find('¦').expect("a mark");
    let before = &marked[..offset];
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    let text = marked.replacen('¦', "", 1);
    match parse(&text, Some(Path::new("d.toml"))) {
        Err(Error::Input(e)) => {
            assert_eq!((e.line, e.column), (Some(line), Some(column)), "{e}");
            assert_eq!(e.file.as_deref(), Some(Path::new("d.toml")), "{e}");
            e
        }
        other => panic!("{other:?} for {:?}", &marked[offset..]),
    }
}

fn says(marked: &str, message: &str, help: &str) {
    let e = refused(marked);
    assert!(e.message.contains(message), "message `{message}`:\n{e}");
    let remedy = e.help.as_deref().unwrap_or("");
    assert!(remedy.contains(help), "help `{help}`:\n{e}");
}

/// The default with several pieces replaced.
fn replaced(pairs: &[(&str, &str)]) -> String {
    pairs.iter().fold(DEFAULT.to_owned(), |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replacen(old, new, 1)
    })
}

#[test]
fn keys_that_contradict_each_other_are_refused() {
    says(
        &replaced(&[
            ("phase_bits = 32", "phase_bits = 8"),
            ("tuning_word = 134217728", "tuning_word = -200"),
            ("table_address_bits = 12", "table_address_bits = ¦12"),
        ]),
        "more than the 8 bits of the phase",
        "widen `phase_bits`",
    );
    says(
        &replaced(&[
            ("\"Q13.27\"", "\"Q13.19\""),
            ("coefficient_format = ", "coefficient_format = ¦"),
        ]),
        "20 fraction bits, more than the 19",
        "at least 20",
    );
    says(
        &replaced(&[("\"Q13.27\"", "\"Q11.27\""), ("1415954326", "¦1415954326")]),
        "Q11.27 cannot hold",
        "at least 12 integer bits hold all coefficients: Q12.27",
    );
    says(
        &replaced(&[
            ("\"Q13.27\"", "\"UQ12.27\""),
            ("[114923930, ", "[114923930, ¦-1, "),
        ]),
        "UQ12.27 cannot hold",
        "at least 12 integer bits hold all coefficients: Q12.27",
    );
}

#[test]
fn too_many_bits_are_refused_at_the_cast_with_their_sum() {
    says(
        &replaced(&[
            ("format = \"Q1.15\"", "format = \"Q32.0\""),
            ("table = \"Q1.15\"", "table = \"Q40.0\""),
            (
                "product = { format = \"Q2.22\"",
                "product = ¦{ format = \"Q1.63\"",
            ),
        ]),
        "`circuit.demodulator.product` needs 32 (adc) + 40 (table) + 63 (left shift) = 135 bits; \
         an exact intermediate has at most 127",
        "fewer fraction bits",
    );
    // In a file that gives only a compensation, the circuit being the default's.
    let own = "[compensation]\ninput = \"phase\"\ncoefficients_raw = [1, 2]\n\
               coefficient_format = \"Q64.0\"\naccumulator = ¦{ format = \"Q1.63\" }\n\
               rate_full_scale_dps = 2048\noutput = \"Q12.12\"\n";
    let own = own.replace("[1, 2]", "[0, 0]");
    says(
        &own,
        "64 (coefficient) + 24 (input) + 40 (left shift) = 128 bits",
        "fewer",
    );
}

#[test]
fn a_circuit_is_given_whole() {
    says(
        "¦[circuit.adc]\nformat = \"Q1.15\"\n"
            .replace("¦[", "[¦")
            .as_str(),
        "lacks the required key `sample_rate_hz`",
        "sample_rate_hz = 56000.0",
    );
    says(
        "¦[circuit]\nsample_rate_hz = 1\n",
        "lacks the required table `[circuit.adc]`",
        "gyrogen init",
    );
    let at = DEFAULT.find("[circuit.cordic]").unwrap();
    let end = DEFAULT
        .find("# Optional: a PI loop that holds the drive phase")
        .unwrap();
    let text =
        format!("{}{}", &DEFAULT[..at], &DEFAULT[end..]).replacen("\n[circuit]", "\n¦[circuit]", 1);
    says(
        &text,
        "lacks the required table `[circuit.cordic]`",
        "add `[circuit.cordic]`",
    );
}

#[test]
fn what_a_file_leaves_out_is_the_defaults() {
    let default = read(None).unwrap();
    let empty = parse("", None).unwrap();
    let source = default.source.clone();
    assert_eq!(Design { source, ..empty }, default);

    let d = parse(
        "name = \"x\"\n[fit]\norder = \"auto\"\n[thermal_run]\nstop_degc = 85\n",
        None,
    )
    .unwrap();
    assert_eq!(
        (d.name.as_str(), d.fit.order, d.fit.heldout_blocks),
        ("x", FitOrder::Auto, 10)
    );
    assert_eq!(
        (d.thermal_run.start_degc, d.thermal_run.stop_degc),
        (0.0, 85.0)
    );
    assert_eq!(
        (&d.circuit, &d.compensation),
        (&default.circuit, &default.compensation)
    );
    assert_eq!(d.gyro, default.gyro);

    // Effects are only those that a given [gyro] names; a named one's keys have defaults.
    let d = parse(
        "[gyro]\nsense_q = 4\n[gyro.bias]\nlinear_dps_per_rad = 1\n",
        None,
    )
    .unwrap();
    assert_eq!((d.gyro.sense_q, d.gyro.drive_q), (4.0, 50.0));
    assert_eq!(d.gyro.bias_dps, [109.60, 1.0, 136.82]);
    assert!(d.gyro.effects.is_empty());
    let d = parse("[gyro.effects.mode_crossing]\ncenter_degc = 20\n", None).unwrap();
    let crossing = d.gyro.effects.get("mode_crossing");
    assert_eq!(crossing, Some([4.5, 20.0, 3.7]));

    // A whole circuit without compensation has none; an own compensation is marked so.
    let at = DEFAULT.find("\n[compensation]").unwrap();
    let end = DEFAULT.find("\n[gyro]").unwrap();
    let bare = format!("{}{}", &DEFAULT[..at], &DEFAULT[end..]);
    assert_eq!(parse(&bare, None).unwrap().compensation, None);
    let own = parse(&DEFAULT[at..end].replacen("Q12.20", "Q13.20", 1), None).unwrap();
    assert!(own.compensation_is_own && own.circuit == default.circuit);

    // One that repeats the default's is not: all commands take the file of `init` as they take no file.
    // Not assert_eq: it would print both designs, the text in them.
    assert!(parse(DEFAULT, None).unwrap() == default);
    assert!(!parse(&DEFAULT[at..end], None).unwrap().compensation_is_own);
}

#[test]
fn the_contracts_own_example_is_read() {
    let text = r#"
[circuit]
sample_rate_hz = 224000
circuit_is_no_key = 0
[circuit.adc]
format = "Q1.15"
[circuit.nco]
phase_bits = 32
tuning_word = 33554432
table_address_bits = 10
address_rounding = "floor"
table = "Q1.15"
[circuit.demodulator]
product = { format = "Q2.30", rounding = "half_up", overflow = "wrap" }
[circuit.decimator]
stages = 3
ratio = 64
differential_delay = 1
output = { format = "Q9.23", overflow = "wrap" }
[circuit.cordic]
iterations = 16
guard_bits = 6
width = 32
angle_bits = 32
gain_bits = 16
[circuit.phase_loop]
setpoint_raw = -1073741824
proportional = { raw = 9, shift = 14 }
integral     = { raw = 9, shift = 19 }
integrator_bits = 64
[circuit.amplitude_loop]
setpoint_raw = 2048000
error_shift = 7
integrator_shift = 12
initial_raw = 67108864
gain_bits = 16
[compensation]
input = "phase"
coefficients_raw = [3591373, 7961641, 4483318]
coefficient_format = "Q17.15"
accumulator = { format = "Q33.15", rounding = "half_up", overflow = "error" }
rate_full_scale_dps = 32768.0
output = { format = "Q16.8", rounding = "half_up", overflow = "saturate" }
"#;
    let text = text.replace("circuit_is_no_key = 0\n", "");
    for text in [
        text.clone(),
        format!("\u{feff}{}", text.replace('\n', "\r\n")),
    ] {
        let d = parse(&text, None).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(d.circuit.sample_rate_hz, 224000.0);
        assert_eq!(d.circuit.decimator.output.to_string(), "Q9.23 half_up wrap");
        assert_eq!(d.circuit.decimator.gain_bits(), 18);
        assert_eq!(
            d.circuit.phase_loop.unwrap().integral,
            LoopGain { raw: 9, shift: 19 }
        );
        assert_eq!(d.compensation.unwrap().rate_full_scale_exponent(), 15);
        assert_eq!(d.source.text, text);
    }
}

#[test]
fn a_mark_at_the_start_does_not_shift_columns() {
    let e = parse("\u{feff}nam = \"x\"", None).unwrap_err();
    assert!(
        e.to_string().starts_with("1:1: error: unknown key `nam`"),
        "{e}"
    );
}

#[test]
fn files_that_cannot_be_read_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("d.toml");
    let e = read(Some(&path)).unwrap_err();
    assert!(
        e.exit_status() == 2 && e.to_string().contains("d.toml"),
        "{e}"
    );
    assert!(read(Some(folder.path())).is_err());
    std::fs::write(&path, b"name = \"x\"\n# \xff\n").unwrap();
    let e = read(Some(&path)).unwrap_err().to_string();
    assert!(e.contains("d.toml:2:3: error: the byte 0xff"), "{e}");
    std::fs::write(&path, b"\xff\xfen\0").unwrap();
    assert!(
        read(Some(&path))
            .unwrap_err()
            .to_string()
            .contains("UTF-16")
    );
    std::fs::write(&path, "name = \"x\"\n").unwrap();
    let d = read(Some(&path)).unwrap();
    assert_eq!((d.name.as_str(), d.source.path), ("x", Some(path)));
    // `printf 'name = "x"\n' | sha256sum`
    let sum = "3eb10e9d710d38dc9fe5566f14f7d2cb97ca68a5c6c6b00150b73c69064410cc";
    assert_eq!(d.source.sha256, sum);
}

#[test]
fn deep_nesting_is_refused() {
    for text in [
        format!("name = {}", "[".repeat(50_000)),
        format!("{}x = 1", "a.".repeat(50_000)),
        format!("[{}x]", "a.".repeat(50_000)),
        format!("{} = 1", "a".repeat(100_000)),
    ] {
        let Err(Error::Input(e)) = parse(&text, None) else {
            panic!("taken");
        };
        assert!(e.line.is_some() && e.help.is_some());
    }
}

#[test]
fn a_bracket_that_stays_open_is_named_with_its_line() {
    let cut = "[study]\nwords = [\"a\",\n  \"b\"";
    let going_on = "[study]\nwords = [\"a\",\n  \"b\"\n\n[fit]\norder = 2\n";
    for (text, says) in [
        (
            cut,
            "the file ends inside the value of `words` that line 2 begins: write its `]`",
        ),
        (
            "x = { a = 1, b",
            "the file ends inside the value of `x` that line 1 begins: write its `}`",
        ),
        (
            going_on,
            "the value of `words` that line 2 begins is still open here: write its `]`",
        ),
    ] {
        let e = parse(text, None).unwrap_err().to_string();
        assert!(e.contains(says), "{e}");
    }
}

#[test]
fn a_study_and_a_bound_take_every_target_by_every_name_that_the_file_lists() {
    use crate::design::target::Target;
    for (name, target) in Target::named() {
        let listed = DEFAULT.matches(&format!("\"{name}\"")).count();
        assert!(listed >= 2, "{name}");
        let study = format!("[study]\ntargets = [\"{name}\"]\n");
        let study = parse(&study, None).expect("a design").study;
        assert_eq!(study.targets, [target.name()]);
        let bound = format!("[compensation]\nbound_dps = 0.01\ntarget = \"{name}\"\n");
        let bound = parse(&bound, None).expect("a design").bound;
        assert_eq!(bound.map(|b| b.target), Some(target));
    }
    refused("[study]\ntargets = [¦\"cortex-m7\"]\n");
}
