//! Records that are refused, as a table: what is wrong, where it is said to be, what is said.

use super::thermal::{ThermalRecord, parse, read};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::{Error, InputError};
use std::path::Path;

pub(super) const HEADER: &str = "time_s,rate_out_dps,die_degc";

/// Twenty good rows.
pub(super) fn good_rows() -> Vec<String> {
    (0..20)
        .map(|k| {
            format!(
                "{k},{:.3},{:.1}",
                0.1 * f64::from(k % 7),
                20.0 + f64::from(k)
            )
        })
        .collect()
}

/// A good record in which the row with index `k` (line `k + 2`) reads otherwise.
pub(super) fn with_row(k: usize, row: &str) -> Vec<u8> {
    let mut rows = good_rows();
    rows[k] = row.to_owned();
    format!("{HEADER}\n{}\n", rows.join("\n")).into_bytes()
}

fn with_header(header: &str) -> Vec<u8> {
    format!("{header}\n{}\n", good_rows().join("\n")).into_bytes()
}

pub(super) fn mapping(pairs: &[(&str, &str)]) -> RecordMapping {
    RecordMapping {
        columns: pairs
            .iter()
            .map(|(a, b)| ((*a).to_owned(), (*b).to_owned()))
            .collect(),
        ..RecordMapping::default()
    }
}

pub(super) fn try_parse(
    bytes: &[u8],
    mapping: &RecordMapping,
) -> Result<(ThermalRecord, Vec<Warning>), Box<InputError>> {
    parse(bytes, Path::new("r.csv"), mapping).map_err(|e| match e {
        Error::Input(e) => e,
        other => panic!("not an input error: {other}"),
    })
}

/// Name, bytes, mapping, (line, column), parts of the printed error.
type Case = (
    &'static str,
    Vec<u8>,
    RecordMapping,
    Option<(usize, usize)>,
    &'static [&'static str],
);

/// A case without a mapping.
fn plain(
    name: &'static str,
    bytes: Vec<u8>,
    place: (usize, usize),
    parts: &'static [&'static str],
) -> Case {
    (name, bytes, RecordMapping::default(), Some(place), parts)
}

#[test]
fn broken_records_are_refused_with_their_place() {
    let map = |pairs: &[(&str, &str)]| mapping(pairs);
    let period = |p: f64| RecordMapping {
        row_period_s: Some(p),
        ..RecordMapping::default()
    };
    let rows = |n: usize| format!("{HEADER}\n{}\n", good_rows()[..n].join("\n")).into_bytes();
    let cases: Vec<Case> = vec![
        plain("nothing", vec![], (1, 1), &["empty", "time_s,rate_out_dps"]),
        plain("blank lines", b"\n \n\r\n".to_vec(), (1, 1), &["empty"]),
        plain("comments only", b"# a\n# b\n".to_vec(), (1, 1), &["empty"]),
        plain(
            "header only",
            b"# a\ntime_s,rate_out_dps\n".to_vec(),
            (2, 1),
            &["nothing after it"],
        ),
        plain(
            "no header",
            b"1,2,3\n4,5,6\n".to_vec(),
            (1, 1),
            &["no header", "numbers only"],
        ),
        plain(
            "semicolons, a bad cell",
            format!("{HEADER}\n{}\n", good_rows().join("\n"))
                .replace(',', ";")
                .replace('.', ",")
                .replace("0;0,000", "0;0,0x")
                .into_bytes(),
            (2, 3),
            &["0;0,0x;20,0", "rate_out_dps is no number"],
        ),
        plain(
            "tabs",
            b"time_s\trate_out_dps\n1\t2\n".to_vec(),
            (1, 1),
            &["tabs"],
        ),
        plain("utf-16", b"\xFF\xFEt\0i\0".to_vec(), (1, 1), &["UTF-16"]),
        plain(
            "latin-1",
            b"time_s,rate_out_dps,t_\xB0C\n".to_vec(),
            (1, 23),
            &["0xB0", "not UTF-8"],
        ),
        plain(
            "rate missing",
            with_header("time_s,gyro_x_dps,die_degc"),
            (1, 1),
            &[
                "no column rate_out_dps",
                "the file has: time_s, gyro_x_dps, die_degc",
                "[record.columns]",
                "rate_out_dps = \"gyro_x_dps\"",
            ],
        ),
        plain(
            "time missing",
            with_header("t_ms,rate_out_dps,die_degc"),
            (1, 1),
            &[
                "no column time_s",
                "row_period_s",
                "time_s = { column = \"t_ms\", unit = \"ms\" }",
            ],
        ),
        (
            "mapped column missing",
            with_header(HEADER),
            map(&[("die_degc", "temp")]),
            Some((1, 1)),
            &["no column \"temp\"", "die_degc = \"die_degc\""],
        ),
        plain(
            "twice the same",
            with_header("time_s,rate_out_dps,rate_out_dps"),
            (1, 21),
            &["two columns are called \"rate_out_dps\": the 2nd and the 3rd"],
        ),
        plain(
            "no name",
            with_header("time_s,rate_out_dps,"),
            (2, 1),
            &["no name"],
        ),
        plain(
            "open quote in the header",
            with_header("time_s,\"rate_out_dps"),
            (1, 8),
            &["quote"],
        ),
        plain(
            "open quote in a row",
            with_row(3, "3,\"0.1,23"),
            (5, 3),
            &["quote"],
        ),
        plain(
            "no number",
            with_row(4, "4, N/A ,24"),
            (6, 4),
            &[
                "\"N/A\" in column rate_out_dps is no number",
                "nan = not measured",
                "4, N/A ,24",
            ],
        ),
        plain(
            "a number with its unit",
            with_row(4, "4,0.1,24 degC"),
            (6, 7),
            &["\"24 degC\"", "unit belongs"],
        ),
        plain(
            "decimal comma, quoted",
            with_row(0, "0,\"0,5\",20"),
            (2, 3),
            &["\"0,5\"", "'.'"],
        ),
        plain(
            "decimal comma, bare",
            with_row(0, "0,0,5,20"),
            (2, 7),
            &[
                "4 cells, and the header has 3",
                "this looks like decimal commas: export with decimal points, or with semicolons between cells",
            ],
        ),
        plain(
            "a cell too many",
            with_row(0, "0,0.5,20,7"),
            (2, 10),
            &["4 cells, and the header has 3", "remove what is too much"],
        ),
        plain(
            "typographic minus",
            with_row(0, "0,\u{2212}0.5,20"),
            (2, 3),
            &["'-' (ASCII)"],
        ),
        plain(
            "infinite",
            with_row(19, "19,-inf,39"),
            (21, 4),
            &["not finite", "leave the cell empty"],
        ),
        plain(
            "too large",
            with_row(19, "19,1e400,39"),
            (21, 4),
            &["not finite"],
        ),
        plain(
            "hexadecimal",
            with_row(2, "0x02,0.1,22"),
            (4, 1),
            &["\"0x02\" in column time_s"],
        ),
        plain(
            "a cell too few",
            with_row(7, "7,0.1"),
            (9, 6),
            &["2 cells, and the header has 3", "die_degc"],
        ),
        plain(
            "a broken last line",
            with_row(19, "19,0."),
            (21, 6),
            &["2 cells", "an empty cell still needs its comma"],
        ),
        plain(
            "a file that ends in the middle of a row",
            {
                let mut text = with_row(19, "19");
                text.pop();
                text
            },
            (21, 3),
            &["1 cell, and", "the file ends in the middle of this row"],
        ),
        plain(
            "a file that ends in the sign of its last cell",
            {
                let mut text = with_row(19, "19,0.5,-");
                text.pop();
                text
            },
            (21, 8),
            &[
                "\"-\" in column die_degc",
                "the file ends in the middle of this row",
            ],
        ),
        plain(
            "a file that ends in a quote of its last row",
            {
                let mut text = with_row(19, "19,0.5,\"2");
                text.pop();
                text
            },
            (21, 8),
            &[
                "quote is not closed",
                "the file ends in the middle of this row",
            ],
        ),
        plain(
            "a last cell that is no beginning of a number",
            {
                let mut text = with_row(19, "19,0.5,n/a");
                text.pop();
                text
            },
            (21, 8),
            &["\"n/a\" in column die_degc", "leave the cell empty"],
        ),
        plain(
            "a sign alone in a row that ends",
            with_row(19, "19,0.5,-"),
            (21, 8),
            &["\"-\" in column die_degc", "leave the cell empty"],
        ),
        plain(
            "a comment among the rows",
            with_row(7, "# restarted"),
            (9, 1),
            &["comment", "before the header"],
        ),
        plain(
            "time decreases",
            with_row(9, "7.5,0.1,29"),
            (11, 1),
            &[
                "time decreases: 7.5 s after 8 s (line 10)",
                "only this time is out of order",
            ],
        ),
        plain(
            "time decreases, and no row shows that it goes on",
            with_row(19, "7.5,0.1,39"),
            (21, 1),
            &[
                "time decreases: 7.5 s after 18 s (line 20)",
                "time_since_power_on_s",
            ],
        ),
        plain(
            "a wild time in the middle",
            with_row(9, "1700000000,0.1,29"),
            (11, 1),
            &[
                "1700000000 s is a wild one",
                "8 s before it (line 10)",
                "10 s after it (line 12)",
            ],
        ),
        plain(
            "a wild time in the first row",
            with_row(0, "1700000000,0.1,29"),
            (2, 1),
            &["1700000000 s is a wild one", "1 s after it (line 3)"],
        ),
        plain(
            "a wild time in the last row",
            with_row(19, "1700000000,0.1,29"),
            (21, 1),
            &[
                "1700000000 s of the last row is a wild one",
                "(line 20) is at 18 s",
            ],
        ),
        plain(
            "the header again",
            with_row(9, HEADER),
            (11, 1),
            &["the header row again", "two records"],
        ),
        plain(
            "the header again, with a mark",
            with_row(9, &format!("\u{feff}{HEADER}")),
            (11, 1),
            &["the header row again"],
        ),
        (
            "time decreases, mapped and further right",
            format!(
                "die_degc,rate_out_dps, t\n{}",
                (0..12)
                    .map(|k| format!("{k},0.{k}, {}\n", if k == 5 { 1 } else { k }))
                    .collect::<String>()
            )
            .into_bytes(),
            map(&[("time_s", "t")]),
            Some((7, 8)),
            &["time decreases: 1 s after 4 s"],
        ),
        plain(
            "time stands",
            format!("{HEADER}\n{}", "5,0.1,20\n".repeat(20)).into_bytes(),
            (21, 1),
            &["never advances", "row_period_s"],
        ),
        plain(
            "no time at all",
            format!("{HEADER}\n{}", ",0.1,20\n".repeat(20)).into_bytes(),
            (2, 1),
            &["time_s holds no measured value"],
        ),
        plain(
            "no rate at all",
            format!(
                "{HEADER}\n{}",
                (0..20).map(|k| format!("{k},nan,20\n")).collect::<String>()
            )
            .into_bytes(),
            (21, 1),
            &["only 0 rows"],
        ),
        plain("nine rows", rows(9), (10, 1), &["only 9 rows", "10"]),
        plain(
            "text among numbers in an auxiliary column",
            format!(
                "time_s,rate_out_dps,flow\n{}",
                (0..12)
                    .map(|k| format!(
                        "{k},0.{k},{}\n",
                        if k == 5 {
                            "low".to_owned()
                        } else {
                            k.to_string()
                        }
                    ))
                    .collect::<String>()
            )
            .into_bytes(),
            (7, 7),
            &["\"low\" in column flow"],
        ),
        plain(
            "kelvin under a name that says degC",
            (0..20).fold(format!("{HEADER}\n").into_bytes(), |mut text, k| {
                text.extend(format!("{k},{:.3},{}\n", 0.1 * f64::from(k % 7), 290 + k).bytes());
                text
            }),
            (1, 21),
            &["looks like kelvin", "unit = \"K\""],
        ),
        (
            "a period that is not that of the times",
            with_header(HEADER),
            period(3.0),
            None,
            &["row_period_s is 3 s", "1 s apart", "delete row_period_s"],
        ),
        (
            "a correction that no CSV holds",
            with_header(HEADER),
            RecordMapping {
                undo_correction: true,
                ..RecordMapping::default()
            },
            None,
            &["--undo-correction", "the autopilot's own log"],
        ),
        (
            "rate and temperature the wrong way round, by their names",
            with_header("time_s,gyro,temp"),
            map(&[("rate_out_dps", "temp"), ("die_degc", "gyro")]),
            Some((1, 1)),
            &[
                "look swapped",
                "rate_out_dps = \"gyro\" and die_degc = \"temp\"",
            ],
        ),
        (
            "no period",
            with_header(HEADER),
            period(0.0),
            None,
            &["row_period_s = 0", "no period"],
        ),
        (
            "a period that is not a number",
            with_header(HEADER),
            period(f64::NAN),
            None,
            &["row_period_s"],
        ),
    ];
    assert!(cases.len() >= 25);
    for (name, bytes, mapping, place, parts) in cases {
        let error = match try_parse(&bytes, &mapping) {
            Err(e) => e,
            Ok((_, w)) => panic!("{name}: not refused, warnings {w:?}"),
        };
        let text = error.to_string();
        assert_eq!(error.line.zip(error.column), place, "{name}: {text}");
        assert!(error.help.is_some(), "{name}: {text}");
        for part in parts {
            assert!(text.contains(part), "{name}: no \"{part}\" in\n{text}");
        }
    }
    let error = read(Path::new("no/such/record.csv"), &RecordMapping::default()).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("no/such/record.csv: error: cannot read the record")
    );
}
