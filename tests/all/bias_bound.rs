//! `compensation.bound_dps` as a user meets it: `run`, then everything that takes the design that it writes.

use crate::common::command::{gyrogen, told};
use serde_json::Value;
use std::path::Path;

fn good(arguments: &[&str], folder: &Path) -> String {
    let output = gyrogen(arguments, folder);
    let talk = told(&output);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {talk}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn refused(design: &str, folder: &Path) -> String {
    std::fs::write(folder.join("bad.toml"), design).expect("a file");
    let output = gyrogen(&["run", "bad.toml", "--out", "bad"], folder);
    let talk = told(&output);
    assert_eq!(output.status.code(), Some(2), "{talk}");
    assert!(talk.contains("help:"), "{talk}");
    talk
}

/// Runs a `[compensation]` that only asks; its summary.
fn run(asked: &str, folder: &Path) -> Value {
    let design = format!("[compensation]\n{asked}\n");
    std::fs::write(folder.join("asked.toml"), design).expect("a file");
    good(&["run", "asked.toml", "--out", "out"], folder);
    let text = std::fs::read(folder.join("out/summary.json")).expect("a summary");
    serde_json::from_slice(&text).expect("JSON")
}

fn check(summary: &Value, bound: f64) {
    let number = |v: &Value| v.as_f64().expect("a number");
    let c = &summary["certainty"];
    let certified = number(&c["bounds"]["certified_max_dps"]);
    assert!(number(&c["exhaustive_max_dps"]) <= certified);
    assert_eq!(c["exhaustive"], true);
    let kept = &summary["bound"];
    assert!(certified + number(&kept["rate_rounding_dps"]) <= bound);
    assert_eq!(number(&kept["bound_dps"]), bound);
    assert_eq!(summary["equivalence"]["mismatches"], 0);
    let all = kept["alternatives"].as_array().expect("a list");
    assert_eq!(all.iter().filter(|a| a["chosen"] == true).count(), 1);
    assert!(all.iter().filter(|a| a["undominated"] == true).count() > 2);
    assert!(all.iter().all(|a| number(&a["certified_max_dps"]) < bound));
}

/// Replaces the first number after `after` by the next one up.
fn damage(file: &Path, after: &str) {
    let text = std::fs::read_to_string(file).expect("a source");
    let from = text.find(after).expect("the place") + after.len();
    let start = from
        + text[from..]
            .find(|c: char| c.is_ascii_digit())
            .expect("a number");
    let length = text[start..]
        .find(|c: char| !c.is_ascii_digit())
        .expect("its end");
    let number: i64 = text[start..start + length].parse().expect("a number");
    let damaged = format!(
        "{}{}{}",
        &text[..start],
        number + 1,
        &text[start + length..]
    );
    std::fs::write(file, damaged).expect("a source");
}

#[test]
fn a_table_for_a_bound_goes_all_the_way_and_its_damage_is_caught() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let asked = "bound_dps = 0.5\nform = \"auto\"\ntarget = \"cortex-m0\"";
    let summary = run(asked, at);
    check(&summary, 0.5);
    let design = std::fs::read_to_string(at.join("out/design.toml")).expect("a design");
    assert!(design.contains("[compensation.evaluation]\nkind = \"plain\""));
    let report = std::fs::read_to_string(at.join("out/report.html")).expect("a report");
    assert!(report.contains("Forms that keep to the bound"));

    // The written design gives the same firmware, but for its banner.
    for language in ["c", "rust"] {
        let out = format!("emitted_{language}");
        good(
            &["emit", "out/design.toml", "--lang", language, "--out", &out],
            at,
        );
        let name = if language == "c" {
            "gyro.c"
        } else {
            "src/lib.rs"
        };
        let body = |path: String| {
            let text = std::fs::read_to_string(at.join(path)).expect("a source");
            text.split_once('\n').expect("lines").1.to_owned()
        };
        let again = body(format!("{out}/{name}"));
        assert_eq!(again, body(format!("out/firmware/{language}/{name}")));
        assert!(good(&["verify", &out], at).contains("self-test: pass"));
    }
    let capture: String = (0..6400)
        .map(|n| {
            let phase = std::f64::consts::TAU * f64::from(n) / 32.0;
            let code = |v: f64| (16000.0 * v).round();
            format!(
                "{},{}\n",
                code((phase + 0.3).sin()),
                code((phase + 1.0).cos())
            )
        })
        .collect();
    std::fs::write(
        at.join("c.csv"),
        format!("drive_code,sense_code\n{capture}"),
    )
    .expect("a file");
    good(
        &[
            "replay",
            "out/design.toml",
            "--capture",
            "c.csv",
            "--out",
            "rows.csv",
        ],
        at,
    );
    let equiv = [
        "equiv",
        "out/design.toml",
        "--samples",
        "200000",
        "--out",
        "eq",
    ];
    assert!(good(&equiv, at).contains("holds"));

    damage(&at.join("emitted_c/gyro_tables.c"), "gyro_table[410] = {");
    let output = gyrogen(&["verify", "emitted_c"], at);
    assert_eq!(output.status.code(), Some(1), "damage of an entry");
}

#[test]
fn a_polynomial_for_a_bound_is_the_bias_and_its_damage_is_caught() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let summary = run("bound_dps = 0.01\nform = \"auto\"", at);
    check(&summary, 0.01);
    good(
        &["emit", "out/design.toml", "--lang", "c", "--out", "c"],
        at,
    );
    good(&["verify", "c"], at);
    // The first factor of the evaluation: the coefficient of the highest order.
    let source = std::fs::read_to_string(at.join("c/gyro.c")).expect("a source");
    let bias = source.find("gyro_bias(").expect("the bias");
    let factor = source[bias..]
        .find(" = INT64_C(")
        .expect("a product of a coefficient");
    let place = &source[bias + factor..bias + factor + " = INT64_C(".len() + 3];
    damage(&at.join("c/gyro.c"), place);
    let output = gyrogen(&["verify", "c"], at);
    assert_eq!(output.status.code(), Some(1), "damage of a coefficient");
}

#[test]
fn without_a_form_the_polynomial_stays_and_the_list_is_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    // Finer than the default's output allows: everything is chosen anew.
    let summary = run("bound_dps = 1e-4", at);
    check(&summary, 1e-4);
    assert!(!summary["chosen"].as_array().expect("a list").is_empty());
    let first = &summary["bound"]["alternatives"][0];
    assert!(first["detail"].as_str().expect("words").contains("Horner"));
    assert_eq!(first["chosen"], true);
    let design = std::fs::read_to_string(at.join("out/design.toml")).expect("a design");
    assert!(!design.contains("[compensation.evaluation]"));
    assert!(design.contains("bound_dps = 0.0001"));
}

#[test]
fn what_is_in_the_way_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let own = |extra: &str| {
        format!(
            "[compensation]\ninput = \"phase\"\ncoefficients_raw = [1, 2, 3]\ncoefficient_format = \"Q12.6\"\n\
             accumulator = \"Q13.8\"\nrate_full_scale_dps = 2048.0\noutput = \"Q12.12\"\n{extra}\n"
        )
    };
    let talk = refused(&own("bound_dps = 0.003"), at);
    assert!(talk.contains("these would do"), "{talk}");
    let talk = refused(&own("bound_dps = 1e-4"), at);
    assert!(talk.contains("`compensation.output` at least"), "{talk}");
    let talk = refused("[compensation]\nbound_dps = 1e-6\n", at);
    assert!(
        talk.contains("bad.toml:2:13: error: compensation.bound_dps")
            && talk.contains("thermometer's word")
            && talk.contains("angle_bits"),
        "{talk}"
    );
    let talk = refused("[compensation]\nform = \"auto\"\n", at);
    assert!(talk.contains("goes only with `bound_dps`"), "{talk}");
    let talk = refused("[compensation]\nbound_dps = -1\n", at);
    assert!(talk.contains("has to be positive"), "{talk}");
    let talk = refused("[compensation]\nbound_dps = 0.1\nform = \"table\"\n", at);
    assert!(
        talk.contains("polynomial") && talk.contains("auto"),
        "{talk}"
    );
    let evaluation = "[compensation.evaluation]\nkind = \"plain\"\nsegment_bits = 12\nfraction_bits = 12\nentries = [[1, 2]]\n";
    let talk = refused(&(own("clamp_raw = [-5694953, -4017570]") + evaluation), at);
    assert!(
        talk.contains("[2] entries where [410] are needed"),
        "{talk}"
    );
}

/// The words of a record's thermometer are chosen, and end somewhere: the bound that is proposed then is kept.
#[test]
fn a_bound_below_every_chosen_word_is_refused_with_one_that_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let rows = (0..60).map(|k| {
        let degc = 20 + 2 * (30 - i32::abs(k - 30));
        let noise = 0.002 * f64::from(k % 3);
        format!("{},{:.4},{degc}\n", 10 * k, 0.01 * f64::from(degc) + noise)
    });
    let record = format!("time_s,rate_out_dps,die_degc\n{}", rows.collect::<String>());
    std::fs::write(at.join("r.csv"), record).expect("a record");
    let asked = |bound: &str| {
        let design = format!("[compensation]\nbound_dps = {bound}\n");
        std::fs::write(at.join("asked.toml"), design).expect("a design");
        let arguments = ["run", "asked.toml", "--record", "r.csv", "--out", "out"];
        let output = gyrogen(&arguments, at);
        (output.status.code(), told(&output))
    };
    let (status, talk) = asked("1e-9");
    assert_eq!(status, Some(2), "{talk}");
    let proposed = talk.split("write `bound_dps = ").nth(1).expect(&talk);
    let (status, talk) = asked(proposed.split('`').next().expect("a figure"));
    assert_eq!(status, Some(0), "{talk}");
}
