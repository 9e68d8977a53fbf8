//! Columns by their names, by a mapping and by their units.

use super::*;

fn at(text: &str) -> Line<'_> {
    Line {
        path: Path::new("r.csv"),
        number: 3,
        text,
    }
}

#[test]
fn a_mapping_renames_and_shadows() {
    let mut mapping = RecordMapping::default();
    for (role, name) in [
        ("rate_out_dps", "gyro_x_dps"),
        ("die_degc", "temp"),
        ("time_since_power_on_s", "time_s"),
    ] {
        mapping.columns.insert(role.into(), name.into());
    }
    // The mapping of time_s to a second part takes nothing from the clock if it says so too.
    mapping.columns.insert("time_s".into(), "time_s".into());
    let roles = resolve(at("time_s,gyro_x_dps,gyro_y_dps,temp,die_degc"), &mapping).unwrap();
    assert_eq!(
        roles.columns[0].1,
        ["time_s", "time_since_power_on_s"],
        "{roles:?}"
    );
    assert_eq!(roles.columns[1].1, ["rate_out_dps"]);
    assert_eq!(roles.columns[2].1, ["gyro_y_dps"]);
    assert_eq!(roles.columns[3].1, ["die_degc"]);
    assert!(roles.columns[4].1.is_empty());
    assert_eq!(roles.warnings[0].code, "shadowed_column");
}

#[test]
fn a_missing_rate_shows_the_snippet() {
    let e = resolve(at("time_s,gyro_x_dps"), &RecordMapping::default()).unwrap_err();
    let text = e.to_string();
    assert!(text.contains("r.csv:3:1"), "{text}");
    assert!(text.contains("the file has: time_s, gyro_x_dps"), "{text}");
    assert!(text.contains("rate_out_dps = \"gyro_x_dps\""), "{text}");
}

#[test]
fn one_message_asks_for_all_that_is_missing() {
    let e = resolve(at("time,temp,gyro_z,note"), &RecordMapping::default()).unwrap_err();
    let text = e.to_string();
    for line in [
        "time_s = { column = \"time\", unit = \"s\" } # a guess: or ms, us, ns, min, h",
        "rate_out_dps = { column = \"gyro_z\", unit = \"deg/s\" } # a guess: or mdeg/s, rad/s, mrad/s, urad/s, deg/h, rpm",
        "die_degc = { column = \"temp\", unit = \"degC\" } # a guess: or degF, K, mdegC, cdegC",
        "is not in the column's name: check it",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    // What is there is not asked for.
    let e = resolve(at("time_s,gyro_z,die_degc"), &RecordMapping::default()).unwrap_err();
    let text = e.to_string();
    assert!(
        !text.contains("time_s =") && !text.contains("die_degc ="),
        "{text}"
    );
    // A name that says its unit leaves nothing to guess.
    let e = resolve(
        at("time_s,gyro_z_rad_s,die_degc"),
        &RecordMapping::default(),
    )
    .unwrap_err();
    let text = e.to_string();
    assert!(
        text.contains("unit = \"rad/s\" }") && !text.contains("a guess"),
        "{text}"
    );
}

#[test]
fn a_choice_is_told_as_one() {
    let said = |header: &str| {
        let error = resolve(at(header), &RecordMapping::default()).unwrap_err();
        error.to_string()
    };
    let text = said("time_s,GyroTemp,GyroX,GyroY,GyroZ,die_degc");
    assert!(
        text.contains("rate_out_dps = { column = \"GyroX\", unit = \"deg/s\" }"),
        "{text}"
    );
    let others = "GyroX, GyroY and GyroZ would do as rate_out_dps; take the axis you want";
    assert!(text.contains(others), "{text}");
    assert!(!said("time_s,gyro_z,die_degc").contains("would do"));
    // Asked for the clock, it says the same of the rate that it shows beside it.
    assert!(said("t,GyroX,GyroY,GyroZ").contains(others));
    // The thermometer is listed too.
    let text = said("Time (ms),Rate (\u{b0}/s),Die (\u{b0}C)");
    assert!(text.contains("die_degc = \"Die (\u{b0}C)\""), "{text}");
}

#[test]
fn a_quantity_that_is_there_twice_is_told() {
    let told = |header: &str, mapping: &RecordMapping| {
        let roles = resolve(at(header), mapping).unwrap();
        let found = roles
            .warnings
            .into_iter()
            .find(|w| w.code == "two_columns_of_one");
        found.map(|w| w.message).unwrap_or_default()
    };
    let plain = RecordMapping::default();
    let text = told("time_s,time_ms,rate_out_dps", &plain);
    assert!(
        text.contains("\"time_s\" is taken") && text.contains("\"time_ms\""),
        "{text}"
    );
    assert!(told("time_ms,time_us,rate_out_dps", &plain).contains("\"time_ms\" is taken"));
    assert_eq!(told("time_s,rate_out_dps,note_ms", &plain), "");
    let mut mapping = RecordMapping::default();
    mapping.columns.insert("time_s".into(), "time_ms".into());
    assert_eq!(told("time_s,time_ms,rate_out_dps", &mapping), "");
}

#[test]
fn a_unit_against_the_columns_name_is_refused_with_both_remedies() {
    let mut mapping = mapped_to("gyro_z_rad_s");
    mapping.units.insert("rate_out_dps".into(), "deg/s".into());
    let header = "time_s,gyro_z_rad_s";
    let error = resolve(at(header), &mapping).unwrap_err().to_string();
    for part in [
        "column \"gyro_z_rad_s\" is in deg/s, and its name says rad/s",
        "write unit = \"rad/s\" or leave the unit out",
        "rename the column in the file's header",
        "rate_out_dps = { column = \"x\", unit = \"deg/s\" }",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
    // What the message says helps.
    mapping.units.clear();
    assert!(resolve(at(header), &mapping).is_ok());
    let mut mapping = mapped_to("x");
    mapping.units.insert("rate_out_dps".into(), "deg/s".into());
    assert!(resolve(at("time_s,x"), &mapping).is_ok());
}

#[test]
fn a_unit_that_nobody_says_is_warned_of() {
    let said = |mapping: &RecordMapping| {
        let roles = resolve(at("time_s,gyro_z,die_degc,agc"), mapping).unwrap();
        let found = roles
            .warnings
            .into_iter()
            .find(|w| w.code == "unit_assumed");
        found.map(|w| (w.label(), w.message))
    };
    let mut mapping = mapped_to("gyro_z");
    let (label, message) = said(&mapping).expect("a warning");
    assert_eq!(label, "warning");
    assert!(
        message.contains("\"gyro_z\" in deg/s")
            && message.ends_with("rate_out_dps = { column = \"gyro_z\", unit = \"deg/s\" }"),
        "{message}"
    );
    // A relative gain has no unit; the contract's names say theirs.
    assert!(!message.contains("agc") && !message.contains("die_degc"));
    mapping.units.insert("rate_out_dps".into(), "deg/s".into());
    assert_eq!(said(&mapping), None);
}

#[test]
fn columns_are_left_out_by_their_names_in_the_file() {
    let read = |ignore: &str| {
        let text = format!(
            "[record]\nignore = [{ignore}]\n[record.columns]\nrate_out_dps = \"gyro_z_dps\"\n"
        );
        crate::design::reader::parse(&text, Some(Path::new("hub.toml")))
    };
    let header = "time_s,time_ms,gyro_x_dps,gyro_y_dps,gyro_z_dps,die_degc";
    let design = read("\"gyro_x_dps\", \"die_degc\", \"time_ms\"").unwrap();
    let roles = resolve(at(header), &design.record).unwrap();
    let kept: Vec<&str> = roles
        .columns
        .iter()
        .filter(|(_, roles)| !roles.is_empty())
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(kept, ["time_s", "gyro_y_dps", "gyro_z_dps"]);
    assert!(roles.warnings.is_empty(), "{:?}", roles.warnings);
    for (ignore, said) in [
        ("\"gyro_y_dps\", \"gyro_w_dps\"", "did you mean \"gyro_"),
        (
            "\"time_s\"",
            "leaves out time_s of the record r.csv, which is required",
        ),
    ] {
        let design = read(ignore).unwrap();
        let error = resolve(at(header), &design.record).unwrap_err().to_string();
        assert!(error.starts_with("hub.toml:2:"), "{error}");
        assert!(error.contains(said), "{said}: {error}");
    }
    // Read and left out at once.
    let error = read("\"gyro_z_dps\"").unwrap_err().to_string();
    assert!(
        error.starts_with("hub.toml:4:") && error.contains("which `ignore` leaves out"),
        "{error}"
    );
}

/// A mapping of the rate to a column.
fn mapped_to(name: &str) -> RecordMapping {
    RecordMapping {
        columns: [("rate_out_dps".to_owned(), name.into())].into(),
        ..RecordMapping::default()
    }
}

#[test]
fn raw_codes_are_no_rate() {
    for name in ["gyro_z_lsb", "GyroZ raw", "rate_counts", "z.code"] {
        let header = format!("time_s,die_degc,{name}");
        let error = resolve(at(&header), &mapped_to(name))
            .unwrap_err()
            .to_string();
        assert!(error.contains("holds raw codes"), "{name}: {error}");
        // Nor is it proposed for one.
        let error = resolve(at(&header), &RecordMapping::default()).unwrap_err();
        let proposed = format!("rate_out_dps = \"{name}\"");
        assert!(!error.to_string().contains(&proposed), "{name}");
    }
    for name in ["raw", "gyro_z", "rawrate", "lsbgyro_z"] {
        let header = format!("time_s,die_degc,{name}");
        assert!(resolve(at(&header), &mapped_to(name)).is_ok(), "{name}");
    }
}

#[test]
fn units_come_from_the_name() {
    assert_eq!(unit_of("phase_rad"), "rad");
    assert_eq!(unit_of("pressure_hpa"), "hPa");
    assert_eq!(unit_of("gyro_x_rad_s"), "rad/s");
    assert_eq!(unit_of("agc"), "1");
    assert_eq!(unit_of("whatever"), "1");
}
