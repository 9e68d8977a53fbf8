use super::super::thermal::parse;
use crate::design::RecordMapping;
use std::path::Path;

/// The codes for a record of 40 rows made by `row`.
fn codes(header: &str, row: impl Fn(f64) -> String) -> Vec<&'static str> {
    let mut text = format!("{header}\n");
    for k in 0..40 {
        text.push_str(&row(f64::from(k)));
        text.push('\n');
    }
    let mapping = RecordMapping::default();
    let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
    warnings.iter().map(|w| w.code).collect()
}

/// Something that moves like a reading.
fn wiggle(k: f64) -> f64 {
    (k * 1.7).sin() * 0.01 + (k * 0.9).cos() * 0.013
}

#[test]
fn a_remedy_never_contradicts_the_columns_name() {
    let said = |name: &str| {
        let mut text = format!("time_s,{name},rate_out_dps\n");
        for k in 0..40 {
            let k = f64::from(k);
            text.push_str(&format!("{k},{},{}\n", 290.0 + k, wiggle(k)));
        }
        let mapping = RecordMapping {
            columns: [("die_degc".to_owned(), name.into())].into(),
            ..RecordMapping::default()
        };
        let refused = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap_err();
        refused.to_string()
    };
    // Kelvin under a name that says degC: the name has to go before the unit can be said.
    let text = said("die_degc");
    assert!(
        text.contains("rename the column") && text.contains("unit = \"K\""),
        "{text}"
    );
    let text = said("die");
    assert!(
        !text.contains("rename the column")
            && text.contains("die_degc = { column = \"die\", unit = \"K\" }"),
        "{text}"
    );
}

#[test]
fn kelvin_and_fahrenheit_under_another_name_stop_alike() {
    let read = |degc: fn(f64) -> f64, unit: Option<&str>| {
        let mut text = "time_s,die_degc,rate_out_dps\n".to_owned();
        for k in 0..40 {
            let k = f64::from(k);
            text.push_str(&format!("{k},{},{}\n", degc(k), wiggle(k)));
        }
        let units = unit.map(|unit| ("die_degc".to_owned(), unit.to_owned()));
        let mapping = RecordMapping {
            units: units.into_iter().collect(),
            ..RecordMapping::default()
        };
        parse(text.as_bytes(), Path::new("r.csv"), &mapping)
    };
    // (readings, what they look like, its unit, the warning where the design states degC)
    type Case = (fn(f64) -> f64, &'static str, &'static str, &'static str);
    let cases: [Case; 2] = [
        (
            |k| 260.0 + k,
            "looks like kelvin (K)",
            "K",
            "temperature_in_kelvin",
        ),
        (
            |k| 70.0 + 2.5 * k,
            "looks like Fahrenheit (degF)",
            "degF",
            "temperature_in_fahrenheit",
        ),
    ];
    for (degc, like, unit, code) in cases {
        let text = read(degc, None).unwrap_err().to_string();
        assert!(text.starts_with("r.csv:1:8: error: "), "{text}");
        for part in [
            like.to_owned(),
            format!("die_degc = {{ column = \"x\", unit = \"{unit}\" }}"),
            "die_degc = { column = \"die_degc\", unit = \"degC\" }".to_owned(),
        ] {
            assert!(text.contains(&part), "no {part} in {text}");
        }
        let (record, warnings) = read(degc, Some("degC")).expect("a stated unit");
        assert!(warnings.iter().any(|w| w.code == code), "{warnings:?}");
        assert_eq!(record.column("die_degc").map(|c| c[0]), Some(degc(0.0)));
    }
    // The hottest chamber that gyros are rated for, with their own heat.
    assert!(read(|k| -40.0 + 4.5 * k, None).is_ok());
}

#[test]
fn each_mistake_has_its_warning() {
    // (column, values, warning)
    type Case = (&'static str, fn(f64) -> f64, Option<&'static str>);
    let cases: [Case; 39] = [
        ("phase_rad", |k| -90.0 + k * 0.1, Some("phase_in_degrees")),
        ("phase_rad", |k| -2.0 + k * 0.13, Some("phase_in_degrees")),
        ("phase_rad", |k| -1.6 + k * 0.002, None),
        (
            "phase_rad",
            |k| if k == 7.0 { 99.0 } else { -1.6 + k * 0.002 },
            Some("error_values"),
        ),
        (
            "phase_rad",
            |k| {
                let p = 3.1 + k * 0.002;
                if p > std::f64::consts::PI {
                    p - std::f64::consts::TAU
                } else {
                    p
                }
            },
            Some("phase_wraps"),
        ),
        (
            "chamber_degc",
            |k| 210.15 + k,
            Some("temperature_in_kelvin"),
        ),
        ("board_degc", |k| 300.0 + k, Some("temperature_in_kelvin")),
        ("die_degc", |k| 2500.0 + k, Some("temperature_out_of_range")),
        ("die_degc", |k| -40.0 + 1.4 * k, None),
        (
            "die_degc",
            |k| if k == 3.0 { -273.15 } else { 20.0 + k },
            Some("error_values"),
        ),
        ("rate_out_dps", |k| 30_000.0 + k, Some("rate_out_of_range")),
        ("rate_out_dps", |k| 1900.0 + k, Some("rate_in_millidegrees")),
        ("rate_out_dps", |k| 19.0 + wiggle(k), None),
        (
            "rate_out_dps",
            |k| 213.0 + (k * 1.7).sin().round(),
            Some("rate_in_counts"),
        ),
        (
            "rate_out_dps",
            |k| -213.0 + (k * 1.7).sin().round(),
            Some("rate_in_counts"),
        ),
        // Rounded to half a deg/s, and to 1 deg/s at a usual bias.
        (
            "rate_out_dps",
            |k| 213.0 + 0.5 * (k * 1.7).sin().round(),
            Some("rate_not_given"),
        ),
        ("rate_out_dps", |k| 13.0 + (k * 1.7).sin().round(), None),
        (
            "rate_out_dps",
            |k| 0.005 + 1e-3 * wiggle(k),
            Some("rate_in_radians"),
        ),
        (
            "die_degc",
            |k| 70.0 + 1.2 * k,
            Some("temperature_in_fahrenheit"),
        ),
        (
            "freq_hz",
            |k| 17.5 + k * 1e-4,
            Some("frequency_in_kilohertz"),
        ),
        ("freq_hz", |k| 17_500.0 + k * 0.1, None),
        ("freq_hz", |k| k * 100.0, Some("error_values")),
        (
            "freq_hz",
            |k| -k * 100.0 - 1.0,
            Some("frequency_out_of_range"),
        ),
        ("agc", |k| 20_000.0 + k, Some("agc_not_relative")),
        ("agc", |k| 98.0 + k * 0.1, Some("agc_not_relative")),
        ("agc", |k| 45.0 + k * 0.01, Some("agc_not_relative")),
        ("agc", |k| 1.0 + k * 1e-3, None),
        ("supply_v", |k| 3300.0 + k, Some("supply_out_of_range")),
        ("supply_v", |k| 3.3 + k * 0.01, None),
        (
            "accel_g",
            |k| 9.8 + k * 1e-4,
            Some("acceleration_in_m_per_s2"),
        ),
        (
            "accel_g",
            |k| 9.807 * ((k % 3.0) - 1.0) + k * 1e-4,
            Some("acceleration_in_m_per_s2"),
        ),
        ("accel_g", |k| 1.0 + k * 1e-4, None),
        ("accel_g", |k| (k % 3.0) - 1.0 + k * 1e-4, None),
        ("accel_g", |k| 20.0 * (k * 0.7).sin(), None),
        ("time_s", |k| 1.7e9 + k, Some("time_is_calendar_time")),
        (
            "time_s",
            |k| 1.7e12 + 1e3 * k,
            Some("time_is_calendar_time"),
        ),
        ("time_s", |k| 15_000.0 * k, Some("time_step_implausible")),
        ("time_s", |k| 1800.0 * k, None),
        ("quad_dps", |k| 1e6 + k, Some("rate_out_of_range")),
    ];
    for (name, value, expected) in cases {
        let found = match name {
            "time_s" => codes("time_s,rate_out_dps", |k| {
                format!("{},{}", value(k), wiggle(k))
            }),
            "rate_out_dps" => codes("time_s,rate_out_dps", |k| format!("{k},{}", value(k))),
            _ => codes(&format!("time_s,rate_out_dps,{name}"), |k| {
                format!("{k},{},{}", wiggle(k), value(k))
            }),
        };
        let expected: Vec<&str> = expected.into_iter().collect();
        assert_eq!(found, expected, "{name} {} .. {}", value(0.0), value(39.0));
    }
}

#[test]
fn whole_numbers_without_a_stated_unit_are_doubted() {
    let said = |name: &str, unit: Option<&str>, fine: f64| {
        let mut text = format!("time_s,{name}\n");
        for k in 0..40 {
            let k = f64::from(k);
            text.push_str(&format!("{k},{}\n", 13.0 + fine * (k * 1.7).sin().round()));
        }
        let role = || "rate_out_dps".to_owned();
        let mapping = RecordMapping {
            columns: [(role(), name.into())].into(),
            units: unit.map(|u| (role(), u.to_owned())).into_iter().collect(),
            ..RecordMapping::default()
        };
        let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
        warnings.iter().any(|w| w.code == "rate_in_counts")
    };
    assert!(said("gz", None, 1.0));
    assert!(!said("gz", None, 0.5) && !said("gz", Some("dps"), 1.0));
    assert!(!said("gz_dps", None, 1.0));
}

#[test]
fn a_steady_large_output_without_a_rate_is_doubted() {
    let turned = |k: f64| format!("{k},{}", 150.5 + wiggle(k));
    assert_eq!(codes("time_s,rate_out_dps", turned), ["rate_not_given"]);
    let back = |k: f64| format!("{k},{}", -101.0 + wiggle(k));
    assert_eq!(codes("time_s,rate_out_dps", back), ["rate_not_given"]);
    // A bias of a bare gyro, which moves with its temperature.
    let drifts = |k: f64| format!("{k},{}", 140.0 + 3.0 * k + wiggle(k));
    assert!(codes("time_s,rate_out_dps", drifts).is_empty());
    // At rest by the record's own word.
    let rests = |k: f64| format!("{k},{},0", 150.5 + wiggle(k));
    let found = codes("time_s,rate_out_dps,rate_dps", rests);
    assert!(!found.contains(&"rate_not_given"), "{found:?}");
}

#[test]
fn the_applied_rate_shows_sign_and_unit() {
    let header = "time_s,rate_out_dps,rate_dps";
    for (factor, expected) in [
        (1.02, None),
        (-1.0, Some("rate_sign_reversed")),
        (0.017453, Some("rate_in_radians")),
        (57.3, Some("rate_in_radians")),
        (16.4, Some("scale_not_nominal")),
    ] {
        let found = codes(header, |k| {
            let rate = (k - 20.0) * 5.0;
            format!("{k},{},{rate}", factor * rate + wiggle(k))
        });
        let expected: Vec<&str> = expected.into_iter().collect();
        assert_eq!(found, expected, "{factor}");
    }
    // A small rate under a large drift decides nothing.
    let found = codes(header, |k| format!("{k},{},{}", k * 10.0, wiggle(k)));
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn a_remedy_is_not_what_stands_there_already() {
    let rows: Vec<String> = (0..40)
        .map(|k| format!("{},{}", f64::from(k) * 1e6, wiggle(f64::from(k))))
        .collect();
    let text = format!("t,rate_out_dps\n{}\n", rows.join("\n"));
    let mapping = RecordMapping {
        columns: [("time_s".to_owned(), "t".to_owned())].into(),
        units: [("time_s".to_owned(), "ms".to_owned())].into(),
        ..RecordMapping::default()
    };
    let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
    let told = &warnings
        .iter()
        .find(|w| w.code == "time_step_implausible")
        .expect("a row every 1000 s")
        .message;
    assert!(told.contains("looks like us"), "{told}");
    assert!(told.contains("unit = \"us\""), "{told}");
}
