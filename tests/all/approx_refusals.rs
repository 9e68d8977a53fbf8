//! What `gyrogen approx` cannot use is refused with the reason, and nothing is written.

use crate::common::command::{gyrogen_here, told};

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    let base = |function: &'static str, domain: &'static str| {
        vec!["--function", function, domain, "--input", "Q1.15"]
    };
    let with = |mut list: Vec<&'static str>, more: &[&'static str]| {
        list.extend(more);
        list
    };
    let cubic = [
        "--degree",
        "3",
        "--output",
        "Q2.14",
        "--coefficients",
        "Q2.14",
    ];
    let [odd, fifth, unsigned, quadratic] = [
        ["--degree=3", "--monomials=odd", "--coefficients=Q2.14"],
        ["--degree=5", "--monomials=all", "--coefficients=Q2.14"],
        ["--degree=1", "--monomials=all", "--coefficients=UQ1.15"],
        ["--degree=2", "--monomials=all", "--coefficients=Q1.15"],
    ]
    .map(|list| [&list[..], &["--output=Q2.14"]].concat());
    let [mixed, mixed_bound, mixed_table, estrin_table] = [
        ["--degree=3", "--coefficients=Q2.14,Q2.12"],
        ["--bound=1e-3", "--coefficients=Q2.14,Q2.12"],
        ["--form=table", "--coefficients=Q2.14,Q2.12"],
        ["--form=table", "--evaluation=estrin"],
    ]
    .map(|list| [&list[..], &["--output=Q2.14", "--degree=1"]].concat());
    let mixed = &mixed[..3];
    let cases: Vec<(Vec<&str>, &[&str])> = vec![
        (
            with(base("1/x", "--domain=-1,1"), &cubic),
            &["pole", "x = 0", "1:2"],
        ),
        (
            with(base("tan(2*x)", "--domain=-0.9,0.9"), &cubic),
            &["pole"],
        ),
        (
            with(base("log(x)", "--domain=-0.5,0.5"), &cubic),
            &["--function:1:1", "undefined"],
        ),
        (
            with(base("sin(x", "--domain=0,1"), &cubic),
            &["close it with `)`"],
        ),
        (
            with(
                base("a*x", "--domain=0,1"),
                &["--parameter", "a=1,5", "--degree=1", "--output=Q2.14"],
            ),
            &["--parameter a=1,5", "the decimal mark is a point; give 1.5"],
        ),
        // Each level multiplies how often it turns: told at once, and not after minutes.
        (
            with(
                base(
                    "sin(9*sin(9*sin(9*sin(9*sin(9*sin(9*x))))))",
                    "--domain=-1,1",
                ),
                &cubic,
            ),
            &["turns too often", "narrow the domain", "each level"],
        ),
        (
            with(base("sinn(x)", "--domain=0,1"), &cubic),
            &["`sinn`", "1:1", "sin"],
        ),
        (
            with(base("sin(x)", "--domain=1,0"), &cubic),
            &["wrong order"],
        ),
        (with(base("sin(x)", "--domain=1,1"), &cubic), &["empty"]),
        (with(base("sin(x)", "--domain=0"), &cubic), &["comma"]),
        (
            with(base("sin(x)", "--domain=0,3"), &cubic),
            &["outside the input format", "Q3.15"],
        ),
        (
            with(base("9*x", "--domain=0,1"), &cubic),
            &["output format", "integer bits"],
        ),
        (
            with(base("sin(x)", "--domain=0,1"), &["--output", "Q2.14"]),
            &["neither a degree nor a bound"],
        ),
        (
            with(
                base("sin(x)", "--domain=0,1"),
                &[
                    "--degree",
                    "25",
                    "--output",
                    "Q2.14",
                    "--coefficients",
                    "Q2.14",
                ],
            ),
            &["degree 25", "24"],
        ),
        (
            with(
                base("1.7*x-0.2", "--domain=0,1"),
                &[
                    "--degree",
                    "1",
                    "--output",
                    "Q2.14",
                    "--coefficients",
                    "Q1.15",
                ],
            ),
            &["x^1", "2 integer bits"],
        ),
        (
            with(
                base("sin(x)", "--domain=0,1"),
                &["--bound", "1e-9", "--output", "Q2.14"],
            ),
            &["half an LSB"],
        ),
        (
            with(base("cos(x)", "--domain=-0.5,0.5"), &odd),
            &["odd polynomial is 0", "function is 1"],
        ),
        (
            with(base("sin(x)", "--domain=0,0.0001"), &fifth),
            &["6 coefficients", "4 codes"],
        ),
        (
            with(base("0.5-x", "--domain=0,0.9"), &unsigned),
            &["x^1", "-1.0", "signed format", "2 integer bits"],
        ),
        (
            with(base("2.3*x^2", "--domain=0,0.9"), &quadratic),
            &["x^2", "2.3", "Q3.15"],
        ),
        (
            with(base("sin(x)", "--domain=0,1"), mixed),
            &[
                "2 formats are given for 4",
                "x^0, x^1, x^2, x^3",
                "one for each",
            ],
        ),
        (
            with(base("sin(x)", "--domain=0,1"), &mixed_bound),
            &["2 formats are given", "`--bound`"],
        ),
        (
            with(base("sin(x)", "--domain=0,1"), &mixed_table),
            &["2 formats are given", "table"],
        ),
        (
            with(base("sin(x)", "--domain=0,1"), &estrin_table),
            &["Estrin", "tables and segments"],
        ),
        (
            with(base("1e300*x", "--domain=0,1"), &cubic),
            &["1.0000e300", "output format"],
        ),
        (
            with(base("sin(x)", "--domain=0,nan"), &cubic),
            &["unknown name `nan`"],
        ),
        (
            with(
                base("sin(x)", "--domain=0,1"),
                &["--bound", "-1", "--output", "Q2.14"],
            ),
            &["not a positive number"],
        ),
        (
            with(
                base("sin(3*x)", "--domain=-1,1"),
                &[
                    "--degree",
                    "5",
                    "--output",
                    "Q2.14",
                    "--coefficients",
                    "Q4.12",
                    "--intermediate",
                    "Q1.15",
                ],
            ),
            &["overflows", "integer bits", "polynomial step"],
        ),
    ];
    for (arguments, expected) in cases {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("made");
        let mut all = vec!["approx", "--out", out.to_str().unwrap()];
        all.extend(&arguments);
        let output = gyrogen_here(&all);
        let told = told(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {told}");
        for word in expected {
            assert!(
                told.contains(word),
                "{arguments:?}: `{word}` is not in {told}"
            );
        }
        assert!(!out.exists(), "{arguments:?} left something behind");
    }
}
