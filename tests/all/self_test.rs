//! `gyrogen close --self-test`: its counts, on few records.

use crate::common::command::gyrogen_in;
use crate::common::design::design;
use gyrogen::error::Result;
use gyrogen::record::ThermalRecord;
use gyrogen::selftest::outcome::Outcome;
use gyrogen::selftest::{Request, run, run_with};
use gyrogen::thermal::close;
use gyrogen::thermal::close::Named;
use gyrogen::thermal::search::Effort;

fn request(only: &[&str], records: usize, clean: usize) -> Request {
    Request {
        records,
        clean,
        threads: 2,
        only: only.iter().map(|id| (*id).to_owned()).collect(),
        ..Request::default()
    }
}

/// (detected, records) at a size.
fn at(o: &Outcome, effect: &str, size: f64) -> (usize, usize) {
    let e = o.effects.iter().find(|e| e.effect == effect).unwrap();
    let s = e.by_size.iter().find(|s| s.times_noise == size).unwrap();
    (s.detected, s.records)
}

#[test]
fn large_effects_are_found_small_ones_are_not_and_noise_gets_no_name() {
    let only = ["supply_sensitivity", "stress_jump", "output_saturation"];
    let o = run(&design(""), None, &request(&only, 2, 3), &|_, _| {}).unwrap();
    assert_eq!(o.effects.len(), 3);
    for id in only {
        assert_eq!(at(&o, id, 10.0), (2, 2), "{id}");
        assert!(at(&o, id, 0.5).0 <= 1, "{id}");
    }
    let supply = o
        .effects
        .iter()
        .find(|e| e.effect == "supply_sensitivity")
        .unwrap();
    let least = supply.minimum_detectable.unwrap();
    assert!(
        least.relation == "at" && (0.5..3.0).contains(&least.times_noise),
        "{least:?}"
    );
    // Steps of 5 % of 5 V, rms 0.15 V.
    let dps_per_v = least.times_noise * o.noise.white_rms_dps / 0.15;
    assert!(
        (least.in_own_unit / dps_per_v - 1.0).abs() < 0.3,
        "{least:?}"
    );
    assert_eq!((o.false_alarms.records, o.false_alarms.alarms), (12, 0));
    assert!(o.holds, "{:?}", o.failures);
}

#[test]
fn a_search_without_a_candidate_does_not_pass() {
    let design = design("");
    let lacks = |record: &ThermalRecord| -> Result<Vec<Named>> {
        let mut names = close::names(record, &design, Effort::default())?;
        names.retain(|n| n.effect != "g_sensitivity");
        Ok(names)
    };
    let only = ["g_sensitivity", "supply_sensitivity"];
    let o = run_with(&design, None, &request(&only, 1, 1), &|_, _| {}, &lacks).unwrap();
    assert_eq!(at(&o, "g_sensitivity", 10.0), (0, 1));
    assert_eq!(at(&o, "supply_sensitivity", 10.0), (1, 1));
    assert!(!o.holds && o.failures.len() == 1 && o.failures[0].contains("g_sensitivity"));
}

#[test]
fn names_for_noise_do_not_pass() {
    let design = design("");
    let guesses = |record: &ThermalRecord| -> Result<Vec<Named>> {
        let name = Named {
            effect: "thermal_lag".to_owned(),
            rivals: Vec::new(),
        };
        // One record in five or so.
        Ok(
            if record.columns["rate_out_dps"][0]
                .to_bits()
                .is_multiple_of(5)
            {
                vec![name]
            } else {
                Vec::new()
            },
        )
    };
    let o = run_with(
        &design,
        None,
        &request(&["g_sensitivity"], 1, 10),
        &|_, _| {},
        &guesses,
    )
    .unwrap();
    assert!(
        (2..20).contains(&o.false_alarms.alarms),
        "{:?}",
        o.false_alarms
    );
    assert!(
        !o.holds && o.failures.iter().any(|f| f.contains("without an effect")),
        "{:?}",
        o.failures
    );
    assert_eq!(o.false_alarms.names[0].0, "thermal_lag");
}

const OWN: &str = r#"
[[effects]]
id = "rings_with_board"
expression = "a*sin(die_degc/w)"
[effects.parameters]
a = { unit = "deg/s" }
w = { unit = "K", range = [4, 10] }

[[effects]]
id = "needs_pressure"
expression = "a*pressure_hpa"
parameters = { a = {} }
"#;

#[test]
fn an_effect_of_the_users_is_planted_too() {
    let only = ["rings_with_board", "needs_pressure"];
    let o = run(&design(OWN), None, &request(&only, 2, 0), &|_, _| {}).unwrap();
    assert_eq!(at(&o, "rings_with_board", 10.0), (2, 2));
    assert_eq!(at(&o, "needs_pressure", 10.0), (0, 0));
    let needs = o
        .effects
        .iter()
        .find(|e| e.effect == "needs_pressure")
        .unwrap();
    assert!(needs.remark.contains("pressure_hpa") && needs.minimum_detectable.is_none());
}

/// The status and the output of a self-test.
fn command(folder: &std::path::Path, more: &[&str]) -> (Option<i32>, Vec<u8>) {
    let self_test = ["close", "--self-test", "--format", "json"];
    let out = gyrogen_in(folder, &[&self_test[..], more].concat(), &[]);
    (out.status.code(), out.stdout)
}

#[test]
fn a_record_of_ones_own_gives_the_experiment_and_threads_do_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let white = gyrogen::plant::noise::Noise::new(3, 1);
    let mut csv = String::from("time_s,rate_out_dps,die_degc,supply_v,humidity_pct\n");
    for k in 0..200u64 {
        let t = 20.0 * k as f64;
        let degc = 25.0 + 20.0 * (t / 500.0).sin();
        let volt = 5.0 + 0.2 * (t / 130.0).sin();
        let humid = 40.0 + 10.0 * (t / 710.0).cos();
        // Its own step: the supply, 20 times the noise; it is taken off.
        let out = 0.1 + 0.01 * degc + 1.4 * (volt - 5.0) + 0.01 * white.normal(k);
        csv += &format!("{t},{out:.6},{degc:.4},{volt:.4},{humid:.3}\n");
    }
    std::fs::write(folder.path().join("r.csv"), csv).unwrap();
    let common = [
        "--record",
        "r.csv",
        "--records",
        "1",
        "--clean",
        "2",
        "--out",
        "o",
    ];
    let with = |threads: &str| {
        command(
            folder.path(),
            &[&common[..], &["--threads", threads]].concat(),
        )
    };
    let (status, one) = with("1");
    assert_eq!(with("2"), (status, one.clone()));
    let o: serde_json::Value = serde_json::from_slice(&one).unwrap();
    assert_eq!(o["own_steps"], serde_json::json!(["supply_sensitivity"]));
    let white = o["noise"]["white_rms_dps"].as_f64().unwrap();
    assert!((white - 0.01).abs() < 0.002, "{white}");
    let effects = o["effects"].as_array().unwrap();
    let of = |id: &str| effects.iter().find(|e| e["effect"] == id).unwrap();
    for id in [
        "supply_sensitivity",
        "temperature_rate",
        "covariate:humidity_pct",
    ] {
        let large = &of(id)["by_size"][4];
        assert_eq!(
            (&large["records"], &large["detected"]),
            (&1.into(), &1.into()),
            "{id}"
        );
    }
    let absent = of("g_sensitivity");
    assert_eq!(absent["minimum_detectable"], serde_json::Value::Null);
    assert!(absent["remark"].as_str().unwrap().contains("accel_g"));
    assert_eq!(o["false_alarms"]["records"], 8);
    let json = std::fs::read(folder.path().join("o/selftest.json")).unwrap();
    assert_eq!(json, one);
    let page = std::fs::read_to_string(folder.path().join("o/selftest.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("covariate:humidity_pct"));
}

#[test]
fn options_of_a_self_test_need_one() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let out = gyrogen_in(folder.path(), &[&["close"], arguments].concat(), &[]);
        out.status.code()
    };
    assert_eq!(run(&["--record", "r.csv", "--seed", "3"]), Some(2));
    assert_eq!(run(&["--self-test", "--capture", "c.csv"]), Some(2));
    assert_eq!(run(&["--self-test", "--records", "0"]), Some(2));
    assert_eq!(run(&["--self-test", "--effect", "gravity"]), Some(2));
    assert_eq!(run(&["--self-test", "--record", "absent.csv"]), Some(2));
}
