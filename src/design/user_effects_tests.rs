use super::*;
use crate::design::reader::parse;

/// A design with one effect.
fn design(lines: &str) -> Result<Vec<UserEffect>> {
    Ok(parse(&format!("[[effects]]\n{lines}\n"), None)?.effects)
}

const WOBBLE: &str = "\
id = \"bearing_wobble\"
expression = \"gain*sin(2*pi*rate_dps*time_s/period)\"
physics = \"the table's bearing is not round\"
compensable = false
[effects.parameters]
gain = { unit = \"deg/s\" }
period = { unit = \"s\", range = [5, 200], start = 20.0 }";

#[test]
fn an_effect_is_read() {
    let effects = design(WOBBLE).unwrap();
    let [effect] = effects.as_slice() else {
        panic!("{effects:?}")
    };
    assert_eq!(effect.id, "bearing_wobble");
    let columns: Vec<&str> = effect.columns().collect();
    assert_eq!(columns, ["rate_dps", "time_s"]);
    let amplitudes: Vec<&str> = effect.amplitudes().map(|p| p.name.as_str()).collect();
    assert_eq!(amplitudes, ["gain"]);
    let shapes: Vec<(&str, Range)> = effect.shapes().map(|(p, r)| (p.name.as_str(), r)).collect();
    let range = Range {
        low: 5.0,
        high: 200.0,
        start: Some(20.0),
    };
    assert_eq!(shapes, [("period", range)]);
    assert_eq!(effect.compensable, Some(false));
    assert!(parse("", None).unwrap().effects.is_empty());
}

#[test]
fn what_is_wrong_is_refused_in_its_place() {
    // Lines of the effect, then line, column (of the file, which has a header before), message, help.
    let expression = |text: &str, parameters: &str| {
        format!("id = \"own\"\nexpression = \"{text}\"\nparameters = {{ {parameters} }}")
    };
    let cases: &[(String, usize, usize, &str, &str)] = &[
        (
            expression("g*tanh(time_s)", "g = {}"),
            3,
            17,
            "unknown function `tanh`",
            "tan",
        ),
        (expression("g*(time_s", "g = {}"), 3, 24, "is open", ""),
        (
            expression("g*sin(time_s/tau)", "g = {}, tau = {}"),
            3,
            27,
            "`time_s/tau` is not linear in `g`, `tau`",
            "range = [",
        ),
        (
            expression("sin(g*time_s)", "g = {}"),
            3,
            15,
            "`sin(g*time_s)` is not linear",
            "range = [",
        ),
        (
            expression("g*agc + agc", "g = {}"),
            3,
            21,
            "adds a part with an amplitude",
            "amplitude of its own",
        ),
        (
            expression("g*agc", "g = {}, period = {}"),
            3,
            14,
            "has no `period`",
            "delete it",
        ),
        (
            expression("gian*agc", "gain = {}"),
            3,
            14,
            "has no `gain`",
            "`gian`",
        ),
        (
            expression("time_s", ""),
            1,
            1,
            "without parameters",
            "gain*(",
        ),
        (expression("g", "g = {}"), 3, 14, "has no column", "time_s"),
        (
            expression("g*rate_out_dps", "g = {}"),
            3,
            17,
            "`rate_out_dps` is what effects explain",
            "",
        ),
        (
            expression(
                "g*exp(-time_s/a)*b*c",
                "g = {}, a = { range = [3, 2] }, b = {}, c = {}",
            ),
            4,
            38,
            "goes from 3 to 2",
            "least value first",
        ),
        (
            expression("g*agc", "g = { range = [1] }"),
            4,
            30,
            "has 1 values",
            "[low, high]",
        ),
        (
            expression("g*agc", "g = { start = 1.0 }"),
            4,
            20,
            "a start and no range",
            "range = ",
        ),
        (
            expression("g*agc", "g = { range = [1, 2], start = 3 }"),
            4,
            46,
            "is 3, outside the range",
            "",
        ),
        (
            expression("g*agc", "g = { scale = 1 }"),
            4,
            22,
            "unknown key `scale`",
            "range",
        ),
        (
            expression("agc*die_degc", "die_degc = {}"),
            4,
            27,
            "the column die_degc",
            "another name",
        ),
        (
            "id = \"thermal_lag\"\nexpression = \"g*agc\"\nparameters = { g = {} }".into(),
            2,
            6,
            "which the catalogue has",
            "my_thermal_lag",
        ),
        (
            "id = \"Own effect\"\nexpression = \"g*agc\"\nparameters = { g = {} }".into(),
            2,
            6,
            "is no id",
            "lower-case",
        ),
        (
            "expression = \"g*agc\"\nparameters = { g = {} }".into(),
            1,
            1,
            "required key `id`",
            "bearing_wobble",
        ),
        (
            "id = \"own\"\nparameters = { g = {} }".into(),
            1,
            1,
            "required key `expression`",
            "gain*sin",
        ),
        (
            "id = \"own\"\nexpression = \"g*agc\"".into(),
            1,
            1,
            "required key `parameters`",
            "gain",
        ),
        (
            format!("{WOBBLE}\n[[effects]]\n{WOBBLE}"),
            10,
            6,
            "as that of an effect above",
            "id of its own",
        ),
        (
            expression("g*agc", "g = {}") + "\ncompensable = \"yes\"",
            5,
            15,
            "takes true or false",
            "without quotes",
        ),
        (
            expression(
                "a*sin(agc/w)*exp(agc/x)+y/z*agc",
                "a = {}, w = { range = [1, 2] }, x = { range = [1, 2] }, y = { range = [1, 2] }, z = { range = [1, 2] }",
            ),
            3,
            14,
            "too many parameters",
            "at most 3",
        ),
    ];
    for (lines, line, column, message, help) in cases {
        let Error::Input(e) = design(lines).expect_err(lines) else {
            panic!("{lines}")
        };
        assert!(e.message.contains(message), "{lines}\n{}", e.message);
        assert!(
            e.help.as_deref().unwrap_or("").contains(help),
            "{lines}\n{:?}",
            e.help
        );
        assert_eq!(
            (e.line, e.column),
            (Some(*line), Some(*column)),
            "{lines}\n{e}"
        );
    }
}

#[test]
fn single_brackets_are_told_from_the_simulated_gyros_effects() {
    let error = parse("[effects.thermal_lag]\ntau_s = 3.0\n", None).unwrap_err();
    let said = error.to_string();
    assert!(
        said.contains("[[effects]]") && said.contains("[gyro.effects]"),
        "{said}"
    );
}

#[test]
fn a_formula_over_lines_keeps_its_place() {
    let lines = "id = \"own\"\nexpression = \"\"\"\ngain*time_s\n+ gain*tanh(agc)\"\"\"\nparameters = { gain = {} }";
    let Error::Input(e) = design(lines).unwrap_err() else {
        panic!()
    };
    assert_eq!((e.line, e.column), (Some(5), Some(8)), "{e}");
}
