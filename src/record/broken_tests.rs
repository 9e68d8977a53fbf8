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

#[test]
fn broken_records_are_refused_with_their_place() {
    let plain = RecordMapping::default();
    let map = |pairs: &[(&str, &str)]| mapping(pairs);
    let period = |p: f64| RecordMapping {
        row_period_s: Some(p),
        ..RecordMapping::default()
    };
    let rows = |n: usize| format!("{HEADER}\n{}\n", good_rows()[..n].join("\n")).into_bytes();
    // name, bytes, mapping, (line, column), parts of the printed error
    type Case = (
        &'static str,
        Vec<u8>,
        RecordMapping,
        Option<(usize, usize)>,
        &'static [&'static str],
    );
    let cases: Vec<Case> = vec![
        (
            "nothing",
            vec![],
            plain.clone(),
            Some((1, 1)),
            &["empty", "time_s,rate_out_dps"],
        ),
        (
            "blank lines",
            b"\n \n\r\n".to_vec(),
            plain.clone(),
            Some((1, 1)),
            &["empty"],
        ),
        (
            "comments only",
            b"# a\n# b\n".to_vec(),
            plain.clone(),
            Some((1, 1)),
            &["empty"],
        ),
        (
            "header only",
            b"# a\ntime_s,rate_out_dps\n".to_vec(),
            plain.clone(),
            Some((2, 1)),
            &["nothing after it"],
        ),
        (
            "no header",
            b"1,2,3\n4,5,6\n".to_vec(),
            plain.clone(),
            Some((1, 1)),
            &["no header", "numbers only"],
        ),
        (
            "semicolons, a bad cell",
            format!("{HEADER}\n{}\n", good_rows().join("\n"))
                .replace(',', ";")
                .replace('.', ",")
                .replace("0;0,000", "0;0,0x")
                .into_bytes(),
            plain.clone(),
            Some((2, 3)),
            &["0;0,0x;20,0", "rate_out_dps is no number"],
        ),
        (
            "tabs",
            b"time_s\trate_out_dps\n1\t2\n".to_vec(),
            plain.clone(),
            Some((1, 1)),
            &["tabs"],
        ),
        (
            "utf-16",
            b"\xFF\xFEt\0i\0".to_vec(),
            plain.clone(),
            Some((1, 1)),
            &["UTF-16"],
        ),
        (
            "latin-1",
            b"time_s,rate_out_dps,t_\xB0C\n".to_vec(),
            plain.clone(),
            Some((1, 23)),
            &["0xB0", "not UTF-8"],
        ),
        (
            "rate missing",
            with_header("time_s,gyro_x_dps,die_degc"),
            plain.clone(),
            Some((1, 1)),
            &[
                "no column rate_out_dps",
                "the file has: time_s, gyro_x_dps, die_degc",
                "[record.columns]",
                "rate_out_dps = \"gyro_x_dps\"",
            ],
        ),
        (
            "time missing",
            with_header("t_ms,rate_out_dps,die_degc"),
            plain.clone(),
            Some((1, 1)),
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
        (
            "twice the same",
            with_header("time_s,rate_out_dps,rate_out_dps"),
            plain.clone(),
            Some((1, 21)),
            &["two columns are called \"rate_out_dps\": the 2nd and the 3rd"],
        ),
        (
            "no name",
            with_header("time_s,rate_out_dps,"),
            plain.clone(),
            Some((2, 1)),
            &["no name"],
        ),
        (
            "open quote in the header",
            with_header("time_s,\"rate_out_dps"),
            plain.clone(),
            Some((1, 8)),
            &["quote"],
        ),
        (
            "open quote in a row",
            with_row(3, "3,\"0.1,23"),
            plain.clone(),
            Some((5, 3)),
            &["quote"],
        ),
        (
            "no number",
            with_row(4, "4, N/A ,24"),
            plain.clone(),
            Some((6, 4)),
            &[
                "\"N/A\" in column rate_out_dps is no number",
                "nan = not measured",
                "4, N/A ,24",
            ],
        ),
        (
            "a number with its unit",
            with_row(4, "4,0.1,24 degC"),
            plain.clone(),
            Some((6, 7)),
            &["\"24 degC\"", "unit belongs"],
        ),
        (
            "decimal comma, quoted",
            with_row(0, "0,\"0,5\",20"),
            plain.clone(),
            Some((2, 3)),
            &["\"0,5\"", "'.'"],
        ),
        (
            "decimal comma, bare",
            with_row(0, "0,0,5,20"),
            plain.clone(),
            Some((2, 7)),
            &["4 cells, and the header has 3", "decimal comma"],
        ),
        (
            "typographic minus",
            with_row(0, "0,\u{2212}0.5,20"),
            plain.clone(),
            Some((2, 3)),
            &["'-' (ASCII)"],
        ),
        (
            "infinite",
            with_row(19, "19,-inf,39"),
            plain.clone(),
            Some((21, 4)),
            &["not finite", "leave the cell empty"],
        ),
        (
            "too large",
            with_row(19, "19,1e400,39"),
            plain.clone(),
            Some((21, 4)),
            &["not finite"],
        ),
        (
            "hexadecimal",
            with_row(2, "0x02,0.1,22"),
            plain.clone(),
            Some((4, 1)),
            &["\"0x02\" in column time_s"],
        ),
        (
            "a cell too few",
            with_row(7, "7,0.1"),
            plain.clone(),
            Some((9, 6)),
            &["2 cells, and the header has 3", "die_degc"],
        ),
        (
            "a broken last line",
            with_row(19, "19,0."),
            plain.clone(),
            Some((21, 6)),
            &["2 cells", "an empty cell still needs its comma"],
        ),
        (
            "a file that ends in the middle of a row",
            {
                let mut text = with_row(19, "19");
                text.pop();
                text
            },
            plain.clone(),
            Some((21, 3)),
            &["1 cell, and", "the file ends in the middle of this row"],
        ),
        (
            "a file that ends in the sign of its last cell",
            {
                let mut text = with_row(19, "19,0.5,-");
                text.pop();
                text
            },
            plain.clone(),
            Some((21, 8)),
            &[
                "\"-\" in column die_degc",
                "the file ends in the middle of this row",
            ],
        ),
        (
            "a file that ends in a quote of its last row",
            {
                let mut text = with_row(19, "19,0.5,\"2");
                text.pop();
                text
            },
            plain.clone(),
            Some((21, 8)),
            &[
                "quote is not closed",
                "the file ends in the middle of this row",
            ],
        ),
        (
            "a last cell that is no beginning of a number",
            {
                let mut text = with_row(19, "19,0.5,n/a");
                text.pop();
                text
            },
            plain.clone(),
            Some((21, 8)),
            &["\"n/a\" in column die_degc", "leave the cell empty"],
        ),
        (
            "a sign alone in a row that ends",
            with_row(19, "19,0.5,-"),
            plain.clone(),
            Some((21, 8)),
            &["\"-\" in column die_degc", "leave the cell empty"],
        ),
        (
            "a comment among the rows",
            with_row(7, "# restarted"),
            plain.clone(),
            Some((9, 1)),
            &["comment", "before the header"],
        ),
        (
            "time decreases",
            with_row(9, "7.5,0.1,29"),
            plain.clone(),
            Some((11, 1)),
            &[
                "time decreases: 7.5 s after 8 s (line 10)",
                "only this time is out of order",
            ],
        ),
        (
            "time decreases, and no row shows that it goes on",
            with_row(19, "7.5,0.1,39"),
            plain.clone(),
            Some((21, 1)),
            &[
                "time decreases: 7.5 s after 18 s (line 20)",
                "time_since_power_on_s",
            ],
        ),
        (
            "a wild time in the middle",
            with_row(9, "1700000000,0.1,29"),
            plain.clone(),
            Some((11, 1)),
            &[
                "1700000000 s is a wild one",
                "8 s before it (line 10)",
                "10 s after it (line 12)",
            ],
        ),
        (
            "a wild time in the first row",
            with_row(0, "1700000000,0.1,29"),
            plain.clone(),
            Some((2, 1)),
            &["1700000000 s is a wild one", "1 s after it (line 3)"],
        ),
        (
            "a wild time in the last row",
            with_row(19, "1700000000,0.1,29"),
            plain.clone(),
            Some((21, 1)),
            &[
                "1700000000 s of the last row is a wild one",
                "(line 20) is at 18 s",
            ],
        ),
        (
            "the header again",
            with_row(9, HEADER),
            plain.clone(),
            Some((11, 1)),
            &["the header row again", "two records"],
        ),
        (
            "the header again, with a mark",
            with_row(9, &format!("\u{feff}{HEADER}")),
            plain.clone(),
            Some((11, 1)),
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
        (
            "time stands",
            format!("{HEADER}\n{}", "5,0.1,20\n".repeat(20)).into_bytes(),
            plain.clone(),
            Some((21, 1)),
            &["never advances", "row_period_s"],
        ),
        (
            "no time at all",
            format!("{HEADER}\n{}", ",0.1,20\n".repeat(20)).into_bytes(),
            plain.clone(),
            Some((2, 1)),
            &["time_s holds no measured value"],
        ),
        (
            "no rate at all",
            format!(
                "{HEADER}\n{}",
                (0..20).map(|k| format!("{k},nan,20\n")).collect::<String>()
            )
            .into_bytes(),
            plain.clone(),
            Some((21, 1)),
            &["only 0 rows"],
        ),
        (
            "nine rows",
            rows(9),
            plain.clone(),
            Some((10, 1)),
            &["only 9 rows", "10"],
        ),
        (
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
            plain.clone(),
            Some((7, 7)),
            &["\"low\" in column flow"],
        ),
        (
            "kelvin under a name that says degC",
            (0..20).fold(format!("{HEADER}\n").into_bytes(), |mut text, k| {
                text.extend(format!("{k},{:.3},{}\n", 0.1 * f64::from(k % 7), 290 + k).bytes());
                text
            }),
            plain.clone(),
            Some((1, 21)),
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
    let error = read(Path::new("no/such/record.csv"), &plain).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("no/such/record.csv: error: cannot read the record")
    );
}
