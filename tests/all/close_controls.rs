//! `gyrogen close --controls`, and the design's diff.

use crate::common::closing::closed;
use crate::common::command::gyrogen_in;
use crate::common::design::design;
use gyrogen::error::Result;
use gyrogen::plant::noise::Noise;
use gyrogen::record::{ThermalRecord, thermal};
use gyrogen::selftest::controls::{self, Controls, Seen};
use gyrogen::thermal::close::Named;
use gyrogen::thermal::search::Effort;
use serde_json::Value;
use std::path::Path;

/// Uneven ramps and dwells, with `dps_per_v` times a supply that steps at its own times.
fn csv(dps_per_v: f64) -> String {
    let noise = Noise::new(11, 1);
    let mut out = String::from("time_s,rate_out_dps,die_degc,supply_v,humidity_pct\n");
    let corners = [
        (0.0, -20.0),
        (35.0, 60.0),
        (55.0, 60.0),
        (80.0, 5.0),
        (125.0, 70.0),
        (160.0, -10.0),
        (200.0, 40.0),
    ];
    for k in 0..200u64 {
        let row = k as f64;
        let at = corners
            .windows(2)
            .find(|w| row < w[1].0)
            .expect("a stretch");
        let degc = at[0].1 + (at[1].1 - at[0].1) * (row - at[0].0) / (at[1].0 - at[0].0);
        let volt = 5.0 + 0.1 * f64::from(u8::from(k * k / 31 % 3 == 1));
        let humid = 40.0 + 10.0 * (row / 37.0).cos() + 3.0 * (row / 11.0).sin();
        let rate = 0.2 + 0.01 * degc - 3e-5 * degc * degc + dps_per_v * (volt - 5.0);
        out += &format!(
            "{},{:.6},{degc:.4},{volt:.4},{humid:.3}\n",
            20.0 * row,
            rate + 0.01 * noise.normal(k)
        );
    }
    out
}

fn close(folder: &Path, more: &[&str]) -> (Option<i32>, [String; 2]) {
    let common = ["close", "--record", "r.csv", "--out", "o"];
    let out = gyrogen_in(folder, &[&common[..], more].concat(), &[]);
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (out.status.code(), [text(out.stdout), text(out.stderr)])
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join("o").join(name)).expect("a file")
}

#[test]
fn a_record_with_an_effect_passes_its_controls() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("r.csv"), csv(0.5)).expect("written");
    let (status, [said, talk]) = close(folder.path(), &["--controls"]);
    assert_eq!(status, Some(0), "{said}{talk}");
    assert!(
        said.contains("negative control: 0 of 8") && said.contains("positive control: "),
        "{said}"
    );
    let json: Value = serde_json::from_str(&read(folder.path(), "closure.json")).expect("JSON");
    assert_eq!(json["steps"][0]["effect"], "supply_sensitivity");
    let controls = &json["controls"];
    assert_eq!(
        (&controls["holds"], &controls["negative"]["named"]),
        (&true.into(), &0.into())
    );
    assert_eq!(
        controls["negative"]["steps_with_fakes"],
        serde_json::json!(["supply_sensitivity"])
    );
    let fakes = controls["negative"]["fakes"].as_array().expect("a list");
    // Judged, not left out.
    assert_eq!(fakes.len(), 8);
    assert!(
        fakes.iter().all(|f| f["p_value_beside_steps"].is_f64()),
        "{fakes:?}"
    );
    let planted = controls["positive"].as_array().expect("a list");
    assert_eq!(planted.len(), 4);
    let count = |key: &str| {
        planted
            .iter()
            .map(|p| p[key].as_u64().expect("a count"))
            .sum::<u64>()
    };
    assert!(count("records") >= 6, "{planted:?}");
    assert!(
        4 * (count("named") + count("only_listed")) >= 3 * count("records"),
        "{planted:?}"
    );
    assert!(planted.iter().all(|p| p["effect"] != "supply_sensitivity"));
    assert!(read(folder.path(), "report.html").contains("What silence means here"));

    // The same closure without them.
    let (status, [said, talk]) = close(folder.path(), &["--format", "json"]);
    assert_eq!((status, talk.as_str()), (Some(0), ""));
    let plain: Value = serde_json::from_str(&said).expect("JSON");
    assert!(plain.get("controls").is_none() && plain["steps"] == json["steps"]);
    let page = read(folder.path(), "report.html");
    assert!(!page.contains("What silence means here"));

    // The diff: every line of the correction, escaped on the page; nothing said into a pipe.
    let (diff, text) = (
        read(folder.path(), "design.diff"),
        read(folder.path(), "design.toml"),
    );
    assert!(
        diff.starts_with("--- the embedded default\n+++ design.toml\n@@ "),
        "{diff}"
    );
    let (_, correction) = text.split_once("\n[correction]\n").expect("a correction");
    for line in correction.lines().filter(|l| !l.is_empty()) {
        assert!(diff.contains(&format!("\n+{line}\n")), "{line}");
    }
    let added = diff.lines().filter(|l| l.starts_with('+')).count() - 1;
    assert!(page.contains(&format!(
        "design.toml: {added} lines added, 0 changed (design.diff)"
    )));
    assert!(page.contains("+[correction]") && page.contains("kind = &#34;product&#34;"));
}

/// Without steps of its own, what a search of this level would name.
fn at_level(level: f64) -> impl Fn(&ThermalRecord) -> Result<Seen> {
    move |record| {
        let mut seen = controls::look(record, &design(""), Effort::default())?;
        let found = seen.alone.iter().filter(|(_, p)| **p <= level);
        seen.names = found
            .map(|(id, _)| Named {
                effect: id.clone(),
                rivals: Vec::new(),
            })
            .collect();
        Ok(seen)
    }
}

#[test]
fn a_search_that_accepts_anything_is_caught() {
    let text = csv(0.0);
    let before = closed(&text, "");
    assert!(before.closure.steps.is_empty());
    let (record, _) =
        thermal::parse(text.as_bytes(), Path::new("r.csv"), &design("").record).expect("a record");
    for (level, named) in [(0.01, 0), (1.0, 8)] {
        let negative = controls::negative(&before, &record, &at_level(level)).expect("closed");
        assert_eq!(negative.named, named, "{negative:?}");
        let c = Controls {
            holds: negative.named == 0,
            negative,
            positive: Vec::new(),
        };
        assert_eq!(c.failure().is_some(), level == 1.0);
    }
}

#[test]
fn a_search_that_names_nothing_is_told_that_its_silence_means_nothing() {
    let before = closed(&csv(0.0), "");
    let deaf = |_: &ThermalRecord| Ok(Vec::new());
    let shown = controls::Shown {
        stage: &|_| {},
        progress: &|_, _| {},
    };
    let planted = controls::positive(&before, &design(""), 1, &shown, &deaf).expect("closed");
    assert_eq!(planted.len(), 4);
    for p in &planted {
        assert!(
            p.detectable.as_ref().is_some_and(|d| d.relation == "above"),
            "{p:?}"
        );
        assert!(p.records == 0 && p.remark.contains("not found"), "{p:?}");
    }
}

#[test]
fn controls_need_a_record() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| gyrogen_in(folder.path(), arguments, &[]).status.code();
    assert_eq!(run(&["close", "--capture", "c.csv", "--controls"]), Some(2));
    assert_eq!(run(&["close", "--self-test", "--controls"]), Some(2));
}
