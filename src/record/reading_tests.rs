//! Records that are read: what is tolerated, what is told, and that no damage makes a panic.

use super::broken_tests::{HEADER, good_rows, mapping, try_parse, with_row};
use crate::design::RecordMapping;
use proptest::prelude::*;

#[test]
fn what_is_tolerated_reads_the_same() {
    let plain = RecordMapping::default();
    let text = format!("# made by hand\n\n{HEADER}\n{}\n", good_rows().join("\n"));
    let (record, warnings) = try_parse(text.as_bytes(), &plain).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(
        (record.len(), record.lines[0], record.lines[19]),
        (20, 4, 23)
    );
    assert_eq!(record.column("die_degc").unwrap()[3], 23.0);
    let variants = [
        format!("\u{feff}{text}"),
        text.replace('\n', "\r\n"),
        text.replace("\n\n", "\n# more\n").trim_end().to_owned(),
        text.replace(HEADER, " time_s , \"rate_out_dps\",die_degc "),
        text.replace(',', " , "),
        text.replace("\n\n", "\n#\n").replace('\n', "\r"),
    ];
    for variant in variants {
        let (other, warnings) = try_parse(variant.as_bytes(), &plain).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(other, record, "{variant}");
    }
    // A spreadsheet's trailing commas.
    let trailing: String = text.lines().map(|l| format!("{l},\n")).collect();
    let trailing = trailing.replace("\n,\n", "\n\n");
    assert_eq!(try_parse(trailing.as_bytes(), &plain).unwrap().0, record);
}

#[test]
fn what_was_read_is_told_in_the_contracts_order() {
    let text = format!("t_ms,flow,temp,gx_dps\n{}\n", {
        let rows = (0..20).map(|k| format!("{}000,{k},{},0.{}", k, 20 + k, k % 7));
        rows.collect::<Vec<_>>().join("\n")
    });
    let mut columns = mapping(&[("rate_out_dps", "gx_dps"), ("die_degc", "temp")]);
    columns.columns.insert("time_s".into(), "t_ms".into());
    let (record, warnings) = try_parse(text.as_bytes(), &columns).unwrap();
    assert_eq!(
        record.understood(&columns),
        "time_s from t_ms, rate_out_dps from gx_dps, die_degc from temp (degC assumed); further measured quantities, which \
         `close` tries as causes: flow (to leave a column out: ignore = [\"flow\"] in [record])"
    );
    assert_eq!(
        record.rows_understood(&warnings, None),
        "20 over 19 s, one every 1.000 s, not averaged (to average, set `average_s` in [record])"
    );
    assert_eq!(
        record.rows_understood(&warnings, Some(0.5)),
        "20 over 19 s, one every 1.000 s, not averaged (`average_s` = 0.5 s joins no two of them)"
    );
    // The design states the unit.
    columns.units.insert("die_degc".into(), "degC".into());
    let (record, _) = try_parse(text.as_bytes(), &columns).unwrap();
    assert!(
        record
            .understood(&columns)
            .contains("die_degc from temp; further measured quantities, "),
        "{}",
        record.understood(&columns)
    );
    columns.ignore.insert("flow".into(), Default::default());
    let (record, _) = try_parse(text.as_bytes(), &columns).unwrap();
    assert_eq!(
        record.understood(&columns),
        "time_s from t_ms, rate_out_dps from gx_dps, die_degc from temp; left out: flow"
    );
}

#[test]
fn rows_in_groups_are_told_with_their_distances() {
    let plain = RecordMapping::default();
    let told = |time: &dyn Fn(usize) -> usize| {
        let rows = (0..87).map(|k| format!("{},0.{k:03},{k}", time(k)));
        let text = format!("{HEADER}\n{}\n", rows.collect::<Vec<_>>().join("\n"));
        let (record, warnings) = try_parse(text.as_bytes(), &plain).unwrap();
        record.rows_understood(&warnings, None)
    };
    let end = "not averaged (to average, set `average_s` in [record])";
    // Three rows at each set point.
    assert_eq!(
        told(&|k| 900 + 1230 * (k / 3) + 10 * (k % 3)),
        format!(
            "87 over 9.57 h, in 29 groups: 10.00 s between the rows of a group, up to 1210 s between groups; {end}"
        )
    );
    // A record that was interrupted for a while has no groups.
    let interrupted = |k: usize| 10 * k + 200 * (k / 60);
    assert_eq!(
        told(&interrupted),
        format!("87 over 17.7 min, one every 10.00 s, {end}")
    );
}

#[test]
fn a_last_cell_with_fewer_digits_and_no_line_end_is_told() {
    let plain = RecordMapping::default();
    let whole = with_row(19, "19,0.500,39.0");
    let text = std::str::from_utf8(&whole).unwrap();
    for (cut, is_told) in [
        (0, false),
        (1, false),
        (2, true),
        (3, true),
        (4, true),
        (5, true),
    ] {
        let text = &text[..text.len() - cut];
        let (record, warnings) = try_parse(text.as_bytes(), &plain).unwrap();
        assert_eq!(record.len(), 20, "{cut}");
        let told = warnings.iter().find(|w| w.code == "last_row_may_be_cut");
        assert_eq!(told.is_some(), is_told, "{cut}: {warnings:?}");
        if let Some(told) = told {
            assert_eq!(told.column.as_deref(), Some("die_degc"));
            assert!(told.message.contains("line 21"), "{}", told.message);
        }
    }
    // Not measured, and said to be so; a row that ends.
    for last in ["19,0.500,nan", "19,0.500,39\n"] {
        let mut text = with_row(19, last);
        text.pop();
        let (_, warnings) = try_parse(&text, &plain).unwrap();
        assert!(
            warnings.iter().all(|w| w.code != "last_row_may_be_cut"),
            "{warnings:?}"
        );
    }
    // Where rows differ in their digits, fewer say nothing.
    let shortest = text.replace(",20.0\n", ",20\n");
    let (_, warnings) = try_parse(&shortest.as_bytes()[..text.len() - 5], &plain).unwrap();
    assert!(
        warnings.iter().all(|w| w.code != "last_row_may_be_cut"),
        "{warnings:?}"
    );
}

#[test]
fn semicolons_and_decimal_commas_read_as_commas_and_points() {
    let plain = RecordMapping::default();
    let text = format!("# by hand, once\n{HEADER}\n{}\n", good_rows().join("\n"));
    let (record, _) = try_parse(text.as_bytes(), &plain).unwrap();
    let semicolons = text.replace(',', ";");
    for (variant, commas) in [
        (semicolons.clone(), false),
        (semicolons.replace('.', ","), true),
    ] {
        let (other, warnings) = try_parse(variant.as_bytes(), &plain).unwrap();
        assert_eq!(other, record, "{variant}");
        let codes: Vec<&str> = warnings.iter().map(|w| w.code).collect();
        assert_eq!(codes, ["semicolons"]);
        assert_eq!(warnings[0].message.contains("decimal point"), commas);
    }
    // A comma among commas stays what it was.
    let mixed = with_row(4, "4;0,5;20");
    assert!(try_parse(&mixed, &plain).is_err());
}

#[test]
fn a_column_that_the_design_misspells_is_shown_in_the_design() {
    let design = "name = \"hub\"\n[record.columns]\nrate_out_dps = \"gyro_x\"\n";
    let design = crate::design::reader::parse(design, Some(std::path::Path::new("hub.toml")));
    let mapping = design.unwrap().record;
    let text = format!("time_s,gyro_z,die_degc\n{}\n", good_rows().join("\n"));
    let error = try_parse(text.as_bytes(), &mapping).unwrap_err();
    assert_eq!((error.line, error.column), (Some(3), Some(16)));
    let said = error.to_string();
    for part in [
        "hub.toml:3:16: error: the record r.csv has no column \"gyro_x\"",
        "did you mean \"gyro_z\"? the file has: time_s, gyro_z, die_degc\n  name one of these in [record.columns]",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // The output is needed, other columns are not.
    assert!(!said.contains("take the line away"), "{said}");
    for (role, column, help) in [
        (
            "die_degc",
            "temp",
            "take the line away; a record without a thermometer: `gyrogen close --record`",
        ),
        (
            "agc",
            "gain",
            "name one of these in [record.columns], or take the line away",
        ),
    ] {
        let design =
            format!("[record.columns]\nrate_out_dps = \"gyro_z\"\n{role} = \"{column}\"\n");
        let design = crate::design::reader::parse(&design, Some(std::path::Path::new("hub.toml")));
        let error = try_parse(text.as_bytes(), &design.unwrap().record).unwrap_err();
        let said = error.to_string();
        assert!(
            said.contains(help) && error.line == Some(3),
            "{help}: {said}"
        );
    }
}

#[test]
fn what_the_design_says_wrongly_is_shown_in_the_design() {
    let text = format!("time_s,gyro_dps,die_degc\n{}\n", good_rows().join("\n"));
    for (design, line, part) in [
        (
            "[record.columns]\nrate_out_dps = \"die_degc\"\ndie_degc = \"gyro_dps\"\n",
            2,
            "look swapped",
        ),
        (
            "[record.columns]\nrate_out_dps = \"gyro_dps\"\nphase_rad = \"die_degc\"\n",
            3,
            "which is no unit of phase_rad",
        ),
        (
            "[record]\nrow_period_s = 7\n[record.columns]\nrate_out_dps = \"gyro_dps\"\n",
            2,
            "the times of the record r.csv are 1 s apart",
        ),
    ] {
        let read = crate::design::reader::parse(design, Some(std::path::Path::new("hub.toml")));
        let error = try_parse(text.as_bytes(), &read.unwrap().record).unwrap_err();
        let said = error.to_string();
        assert!(
            said.starts_with("hub.toml") && error.line == Some(line),
            "{said}"
        );
        assert!(said.contains(part) && said.contains("r.csv"), "{said}");
    }
    // A period that is that of the times is told to be of no use.
    let mut mapping = mapping(&[("rate_out_dps", "gyro_dps")]);
    mapping.row_period_s = Some(1.005);
    let (_, warnings) = try_parse(text.as_bytes(), &mapping).unwrap();
    assert_eq!(warnings[0].code, "record_keys_unused");
    let design = "[record]\ninstance = 1\n[record.columns]\nrate_out_dps = \"gyro_dps\"\n";
    let design = crate::design::reader::parse(design, None).unwrap();
    let (_, warnings) = try_parse(text.as_bytes(), &design.record).unwrap();
    let told = warnings.iter().find(|w| w.code == "record_keys_unused");
    assert!(told.is_some_and(|w| w.message.starts_with("`instance`")));
}

#[test]
fn a_column_that_is_a_time_by_its_unit_is_proposed_with_it() {
    let said = |header: &str| {
        let text = format!("{header}\n{}\n", good_rows().join("\n"));
        let error = try_parse(text.as_bytes(), &RecordMapping::default()).unwrap_err();
        error.to_string()
    };
    for (header, line) in [
        (
            "t_ms,rate_out_dps,die_degc",
            "time_s = { column = \"t_ms\", unit = \"ms\" }",
        ),
        (
            "uptime_us,gyro_deg_sec,die_degc",
            "time_s = { column = \"uptime_us\", unit = \"us\" }",
        ),
        (
            "t,rate_out_dps,die_degc",
            "time_s = { column = \"t\", unit = \"s\" } # a guess",
        ),
        ("k,rate_out_dps,t_c", "time_s = \"NAME_IN_THE_FILE\""),
    ] {
        assert!(said(header).contains(line), "{line}: {}", said(header));
    }
}

#[test]
fn a_capture_in_the_place_of_a_record_is_told_what_takes_it() {
    for header in [
        "drive_code,sense_code",
        "Drive (V),Sense (V)",
        "drive;sense",
    ] {
        let text =
            format!("{header}\n1,2\n").replace(',', if header.contains(';') { ";" } else { "," });
        let error = try_parse(text.as_bytes(), &RecordMapping::default()).unwrap_err();
        let said = error.to_string();
        assert!(
            said.contains("a capture of ADC codes") && said.contains("close --capture"),
            "{said}"
        );
    }
}

#[test]
fn missing_cells_text_columns_and_repeated_times_are_told() {
    let plain = RecordMapping::default();
    let mut text = String::from("time_s,rate_out_dps,die_degc,session,humidity_pct\n");
    for k in 0..20 {
        let time = if k == 6 { 5 } else { k };
        let rate = if k == 9 {
            String::new()
        } else {
            format!("0.{k}")
        };
        text.push_str(&format!("{time},{rate},{},cold,\n", 20 + k));
    }
    text.push_str(",0.1,40,cold,\n");
    let (record, warnings) = try_parse(text.as_bytes(), &plain).unwrap();
    let codes: Vec<&str> = warnings.iter().map(|w| w.code).collect();
    assert_eq!(
        codes,
        [
            "text_column",
            "empty_column",
            "rows_without_time",
            "repeated_times",
            "rows_without_rate"
        ]
    );
    assert!(warnings[2].message.contains("line 22"), "{:?}", warnings[2]);
    assert!(
        warnings[3]
            .message
            .contains("2 rows with repeated times were averaged (the first is line 7)")
    );
    assert_eq!(record.len(), 19);
    assert!((record.column("rate_out_dps").unwrap()[5] - 0.55).abs() < 1e-12);
    assert_eq!(record.column("die_degc").unwrap()[5], 25.5);
    assert!(record.column("session").is_none() && record.column("humidity_pct").is_none());
    assert_eq!(record.measured("rate_out_dps"), 18);
    let json = serde_json::to_string(&warnings[0]).unwrap();
    assert!(
        json.starts_with(r#"{"code":"text_column","column":"session","message":"#),
        "{json}"
    );
}

#[test]
fn repeated_times_with_different_rates_are_kept() {
    let mut text = String::from("time_s,rate_out_dps,rate_dps\n");
    for k in 0..20 {
        let rate = if k % 2 == 0 { 50 } else { -50 };
        text.push_str(&format!("{},{rate}.{k},{rate}\n", k / 2));
    }
    let (record, warnings) = try_parse(text.as_bytes(), &RecordMapping::default()).unwrap();
    assert_eq!(record.len(), 20);
    assert!(
        warnings[0]
            .message
            .contains("20 rows with repeated times were kept"),
        "{warnings:?}"
    );
    assert!((record.error_dps()[3] + 0.3).abs() < 1e-12);
}

#[test]
fn a_record_without_a_clock_takes_the_row_period() {
    let text: String = (0..20)
        .map(|k| format!("{},{}\n", 0.01 * f64::from(k % 5), 20 + k))
        .collect();
    let text = format!("gyro_x_dps,temperature_degc\n{text}");
    let mut mapping = mapping(&[
        ("rate_out_dps", "gyro_x_dps"),
        ("die_degc", "temperature_degc"),
    ]);
    mapping.row_period_s = Some(15.0);
    let (record, warnings) = try_parse(text.as_bytes(), &mapping).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(record.time_s[19], 285.0);
    assert_eq!(record.renamed["die_degc"], "temperature_degc");
    assert_eq!(record.column("time_s").unwrap().len(), record.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_records_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..3), 0..12),
        cut in any::<prop::sample::Index>(),
        whole in any::<bool>(),
    ) {
        let mut bytes = with_row(5, "5,\"0.1\",25");
        for (at, byte, kind) in edits {
            let at = at.index(bytes.len());
            // Half of the bytes come from those that mean something here.
            let common = b"\",\n\r#-.e0 \tnif";
            let byte = if byte < 128 { common[usize::from(byte) % 14] } else { byte };
            match kind {
                0 => bytes[at] = byte,
                1 => bytes.insert(at, byte),
                _ => { bytes.remove(at); }
            }
        }
        if !whole {
            bytes.truncate(cut.index(bytes.len()));
        }
        match try_parse(&bytes, &RecordMapping::default()) {
            Ok((record, _)) => {
                prop_assert!(record.len() >= 10);
                prop_assert!(record.columns.values().all(|c| c.len() == record.len()));
                prop_assert!(record.lines.len() == record.len());
                prop_assert!(record.time_s.windows(2).all(|w| w[0] <= w[1]));
            }
            Err(e) => {
                prop_assert!(e.line.is_some() && e.column.is_some() && e.help.is_some(), "{e}");
                let _ = e.to_string();
            }
        }
    }

    #[test]
    fn noise_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = try_parse(&bytes, &RecordMapping::default());
    }
}

#[test]
fn a_capture_is_told_as_one_also_where_the_design_names_a_records_columns() {
    let text = format!("drive,sense\n{}", "12,-7\n".repeat(20));
    let names = mapping(&[("rate_out_dps", "gyro"), ("die_degc", "temp_degC")]);
    let refused = try_parse(text.as_bytes(), &names).unwrap_err().to_string();
    assert!(
        refused.contains("this is a capture of ADC codes"),
        "{refused}"
    );
    // Somebody's names for a record's columns.
    let own = mapping(&[("rate_out_dps", "sense"), ("die_degc", "drive")]);
    let read = try_parse(text.as_bytes(), &own);
    assert!(read.is_err_and(|e| !e.to_string().contains("capture of ADC codes")));
}
