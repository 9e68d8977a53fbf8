//! Tests of the page, on a record that is made up.

use super::super::{Shown, render};
use crate::compensation::certainty;
use crate::design::Design;
use crate::job::coefficients::{self, Rounded};
use crate::job::outcome::{After, Drift, Emitted, Equivalence, FitSummary, Point, Points, Summary};
use crate::job::word_lengths::WordLengths;
use crate::job::{budget, drift_pp, formats, rms};
use crate::record::{self, Warning};
use crate::thermal;
use crate::thermal::BaselineFit;
use crate::verify::compare::Compared;
use std::path::Path;

/// All that a report needs.
struct Made {
    summary: Summary,
    design: Design,
    fit: BaselineFit,
    rounded: Rounded,
    chosen: Vec<String>,
    points: Vec<Point>,
}

impl Made {
    /// From readings of (time, thermometer, rate).
    fn from(rows: &[(f64, f64, f64)]) -> Self {
        let mut text = String::from("time_s,die_degc,rate_out_dps\n");
        for (time, die, rate) in rows {
            text += &format!("{time:.3},{die:.4},{rate:.6}\n");
        }
        let mut design = crate::design::reader::parse("", None).unwrap();
        let (record, _) =
            record::thermal::parse(text.as_bytes(), Path::new("r.csv"), &Default::default())
                .unwrap();
        let fit = thermal::fit(&record, &Default::default(), &design.fit).unwrap();
        let chosen = formats::fill(&mut design, &fit, &record).unwrap();
        let rounded = coefficients::round(&mut design, &fit).unwrap();
        let certainty = certainty::certainty(&design).unwrap().unwrap();
        let budget = budget::budget(&design, &fit, &certainty);
        let points: Vec<Point> = rows
            .iter()
            .map(|(time, die, rate)| {
                let after = rate - fit.bias_dps(*die);
                Point {
                    time_s: *time,
                    thermometer: *die,
                    temperature_degc: *die,
                    heating: *time < 100.0,
                    before_dps: *rate,
                    float_dps: after,
                    fixed_dps: after + 1e-9,
                    c_dps: Some(after + 1e-9),
                    rust_dps: Some(after + 1e-9),
                }
            })
            .collect();
        let all = Points::from(points.clone());
        let drift = |of: fn(&Point) -> f64| Drift {
            drift_pp_dps: drift_pp(&all, of),
            rms_dps: rms(&all, of),
        };
        let fixed = drift(|p| p.fixed_dps);
        let compared = |language, mismatches, first: Option<&str>| Compared {
            language,
            name: "bias".to_owned(),
            inputs: 65_536,
            exhaustive: true,
            compared: 131_072,
            mismatches,
            first: first.map(str::to_owned),
        };
        let word_lengths = WordLengths::measure(&design, &fit, &[1.0, 2.5], &[1.0, 2.0], None);
        let word_lengths = word_lengths.unwrap();
        let summary = Summary {
            finding: word_lengths.sentence(fit.heldout_rms_dps),
            word_lengths,
            chosen: Vec::new(),
            schema: "gyrogen.run/1",
            version: "0.1.0",
            design_sha256: "00".repeat(32),
            command: "gyrogen run".to_owned(),
            record: Some("r.csv".to_owned()),
            before: drift(|p| p.before_dps),
            after: After {
                float: drift(|p| p.float_dps),
                fixed,
                emitted: fixed,
                c: Some(fixed),
                rust: Some(fixed),
            },
            ratio: 0.1,
            fit: FitSummary {
                thermometer: fit.thermometer.clone(),
                unit: fit.unit.to_owned(),
                range: fit.range,
                order: fit.order,
                reason: fit.reason.clone(),
                coefficients: fit.coefficients.clone(),
                coefficients_raw: design
                    .compensation
                    .as_ref()
                    .unwrap()
                    .coefficients_raw
                    .clone(),
                coefficient_format: "Q2.30".to_owned(),
                in_sample_rms_dps: fit.in_sample_rms_dps,
                heldout_rms_dps: fit.heldout_rms_dps,
                heldout_max_abs_dps: fit.heldout_max_abs_dps,
                noise_floor_rms_dps: fit.noise_floor_rms_dps,
                outliers: 0,
            },
            budget,
            bound: None,
            certainty_text: certainty::sentences(&design, &certainty.bounds),
            certainty,
            equivalence: Equivalence {
                compared: 262_144,
                mismatches: 0,
                functions: vec![compared("c", 0, None), compared("rust", 0, None)],
                fixed_minus_float_max_dps: 1e-9,
            },
            emitted: vec![Emitted {
                path: "firmware/c/gyro.c".to_owned(),
                sha256: "ab".repeat(32),
            }],
            warnings: Vec::new(),
        };
        Made {
            summary,
            design,
            fit,
            rounded,
            chosen,
            points,
        }
    }

    fn html(&self) -> String {
        render(&Shown {
            summary: &self.summary,
            design: &self.design,
            fit: &self.fit,
            rounded: &self.rounded,
            chosen: &self.chosen,
            points: &Points::from(self.points.clone()),
            toolchains: ["cc 1; -O2", "rustc 1; -O"],
            output_lsb: self
                .design
                .compensation
                .as_ref()
                .unwrap()
                .output
                .format
                .lsb(),
        })
        .unwrap()
    }
}

/// Up to 60 degC and back, with a little that no polynomial follows.
fn usual(count: usize) -> Made {
    let rows: Vec<_> = (0..count)
        .map(|k| {
            let share = 2.0 * k as f64 / count as f64;
            let die = 20.0 + 40.0 * if share < 1.0 { share } else { 2.0 - share };
            let rate = 0.4 - 0.03 * die + 2e-4 * die * die + 0.01 * (7.0 * k as f64).sin();
            (10.0 * k as f64, die, rate)
        })
        .collect();
    Made::from(&rows)
}

/// No mark of a number that is none, in figures or tables.
fn is_sound(html: &str) {
    for mark in ["NaN", "inf<", "inf\"", "\"inf", "{{", "{%"] {
        assert!(!html.contains(mark), "{mark}");
    }
    assert_eq!(html.matches("<figure>").count(), 4);
    assert_eq!(
        html.matches("<svg ").count(),
        html.matches("</svg>").count()
    );
}

#[test]
fn the_page_is_whole_and_needs_nothing_else() {
    let html = usual(120).html();
    is_sound(&html);
    assert!(html.starts_with("<!doctype html>") && html.trim_end().ends_with("</html>"));
    assert!(html.contains("id=\"headline\">Bias drift over temperature falls from "));
    assert!(html.contains("0 mismatches in 262\u{202f}144 words compared"));
    for heading in [
        "Error budget",
        "Orders tried",
        "Where the guarantee stops",
        "Provenance",
    ] {
        assert!(html.contains(heading), "{heading}");
    }
    let links = html.replace("http://www.w3.org/2000/svg", "");
    for mark in ["http", "<script", "<link", "@import", "url("] {
        assert!(!links.contains(mark), "{mark}");
    }
}

#[test]
fn the_same_outcome_gives_the_same_bytes() {
    assert_eq!(usual(90).html(), usual(90).html());
}

#[test]
fn hostile_text_stays_text() {
    let mut made = usual(60);
    let hostile = "<script>alert(\"1\")</script>".to_owned();
    made.fit.thermometer.clone_from(&hostile);
    made.fit.reason.clone_from(&hostile);
    made.fit.unit = "<b>'";
    made.design.name.clone_from(&hostile);
    made.chosen.push(hostile.clone());
    made.summary.command.clone_from(&hostile);
    made.summary.record = Some(hostile.clone());
    made.summary.warnings = vec![Warning::on("odd", &hostile, hostile.as_str())];
    made.summary.emitted[0].path.clone_from(&hostile);
    made.summary.equivalence.functions[0].first = Some(hostile.clone());
    let html = made.html();
    is_sound(&html);
    assert!(!html.contains("<script") && !html.contains("<b>"));
    assert!(html.contains("thermometer: &lt;script&gt;"));
}

#[test]
fn readings_that_are_missing_or_constant_break_no_figure() {
    // An output of one value alone is refused when it is read.
    let constant = |k| (10.0 * f64::from(k), 25.0, 0.5 + 1e-6 * f64::from(k % 3));
    let constant: Vec<_> = (0..40).map(constant).collect();
    is_sound(&Made::from(&constant).html());
    let mut made = usual(60);
    for (k, p) in made.points.iter_mut().enumerate() {
        p.temperature_degc = f64::NAN;
        match k % 3 {
            0 => (p.c_dps, p.rust_dps) = (Some(f64::NAN), Some(f64::INFINITY)),
            1 => (p.time_s, p.before_dps) = (f64::NAN, f64::NAN),
            _ => (p.thermometer, p.float_dps) = (f64::NAN, f64::NEG_INFINITY),
        }
    }
    made.fit.heldout_rms_dps = f64::NAN;
    made.summary.before.drift_pp_dps = 0.0;
    made.summary.after.fixed.rms_dps = f64::NAN;
    is_sound(&made.html());
    made.points.clear();
    is_sound(&made.html());
}

#[test]
fn a_difference_is_said_at_the_top() {
    let mut made = usual(60);
    made.summary.equivalence.mismatches = 3;
    made.summary.equivalence.functions[1].mismatches = 2;
    made.summary.equivalence.functions[1].first = Some("input 5: emitted [1], model [2]".into());
    made.points[7].rust_dps = made.points[7].rust_dps.map(|dps| dps + 1.0);
    let html = made.html();
    assert!(html.contains("do not carry the model&#39;s bits: 3 mismatches"));
    assert!(html.contains("emitted code differs from the model"));
    assert!(html.contains("input 5: emitted [1], model [2]"));
    assert!(html.contains("at 70 s: fixed "));
    assert!(html.contains("do not use this firmware"));
}

#[test]
fn long_records_are_thinned_and_keep_their_extremes() {
    let mut made = usual(9000);
    made.points[4321].fixed_dps = 5.0;
    let html = made.html();
    is_sound(&html);
    assert!(html.contains("the shade is how many lie there") && html.contains(" cell l4"));
    assert!(html.len() < 1_500_000, "{}", html.len());
}

#[test]
fn the_lead_of_a_constant_thermometer_names_no_drift() {
    let mut made = usual(60);
    made.summary.warnings = vec![Warning::on("thermometer_constant", "die_degc", "stands")];
    let said = format!(
        "id=\"headline\">No dependence on temperature could be fitted: {} is constant. The emitted C and Rust carry the model",
        made.summary.fit.thermometer
    );
    let html = made.html();
    is_sound(&html);
    assert!(html.contains(&said), "{said}");
    assert!(!html.contains("Bias drift over temperature"));
}

#[test]
fn the_lead_says_what_the_mean_of_heating_and_cooling_leaves_out() {
    let mut made = usual(60);
    assert!(!made.html().contains("Heating and cooling differ, and"));
    made.summary.warnings = ["heating_cooling_loop", "units_converted"]
        .map(|code| Warning::on(code, "die_degc", "seen"))
        .to_vec();
    let html = made.html();
    is_sound(&html);
    assert!(html.contains("Heating and cooling differ, and the drift is that of their average"));
    assert!(html.contains(">1 warning, 1 note</a>"));
    // Where the record does not decide it, the readings are as far off.
    made.summary.warnings = vec![Warning::on("loop_or_slow_noise", "die_degc", "seen")];
    let html = made.html();
    assert!(html.contains(
        "Heating and cooling may differ (see the warning), and the drift is that of their average"
    ));
}

#[test]
fn the_page_and_the_terminal_say_the_same_uncertainty() {
    let made = usual(60);
    let std = crate::text::number(made.fit.std_max_dps(), 3);
    let said =
        format!("Sigma is the uncertainty of the fitted curve, {std} deg/s where it is largest");
    assert!(made.html().contains(&said), "{said}");
    let on_terminal = format!("its standard deviation is {std} deg/s");
    let told = &made.summary.certainty_text;
    assert!(
        told.iter().any(|line| line.contains(&on_terminal)),
        "{told:?}"
    );
}
