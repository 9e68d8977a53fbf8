//! `gyrogen close` with effects of the user's own (`[[effects]]` of a design).

use crate::common::closing;
use gyrogen::plant::noise::Noise;
use gyrogen::thermal::close::Closed;
use gyrogen::verdict::{Fate, Step};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// White noise of a row, deg/s.
const NOISE_DPS: f64 = 0.01;

/// A record of 400 rows, 15 s apart: two thermal cycles, a table that turns by steps, a load torque.
/// `extra` of (time, temperature, rate, torque) is what nobody declared, deg/s.
fn record(seed: u64, extra: impl Fn(f64, f64, f64, f64) -> f64) -> String {
    let white = Noise::new(seed, 1);
    let mut text = String::from("time_s,rate_out_dps,rate_dps,die_degc,torque_nm\n");
    for k in 0..400u64 {
        let t = 15.0 * k as f64;
        let degc = 25.0 - 30.0 * (TAU * t / 3000.0).cos();
        let rate = [0.0, 41.3, -37.9, 83.1, -79.7, 21.9, -18.7][(k / 5) as usize % 7];
        let torque = 0.5 + 0.4 * (TAU * t / 1234.0).sin();
        let u = degc / 30.0;
        let bias = 0.3 + 0.2 * u - 0.1 * u * u;
        let out = rate + bias + extra(t, degc, rate, torque) + NOISE_DPS * white.normal(k);
        writeln!(text, "{t},{out:.6},{rate},{degc:.4},{torque:.5}").unwrap();
    }
    text
}

const DESIGN: &str = r#"
[[effects]]
id = "bearing_wobble"
expression = "gain*sin(2*pi*rate_dps*time_s/period)"
physics = "the table's bearing is not round"
[effects.parameters]
gain = { unit = "deg/s" }
period = { unit = "deg", range = [100.0, 2000.0] }

[[effects]]
id = "glue_softens"
expression = "a/(1 + exp(-(die_degc - at)/width))"
[effects.parameters]
a = { unit = "deg/s" }
at = { unit = "degC", range = [-20, 80] }
width = { unit = "K", range = [0.5, 20], start = 3 }

[[effects]]
id = "torque_rings"
expression = "a*sin(torque_nm/w)^2 + b*torque_nm"
compensable = true
[effects.parameters]
a = { unit = "deg/s" }
b = { unit = "deg/s/(N m)" }
w = { unit = "N m", range = [0.05, 1.0] }

[[effects]]
id = "has_no_column"
expression = "g*pressure_hpa"
parameters = { g = {} }

[[effects]]
id = "has_no_value"
expression = "g*log(time_s/tau)"
parameters = { g = {}, tau = { range = [1.0, 2.0] } }
"#;

fn closed(csv: &str) -> Closed {
    closing::closed(csv, DESIGN)
}

/// The only step; its parameters are within four standard deviations of the truth, and these are small.
fn only_step<'a>(c: &'a Closed, effect: &str, truth: &[(&str, f64)]) -> &'a Step {
    let names: Vec<&str> = c.closure.steps.iter().map(|s| s.effect.as_str()).collect();
    assert_eq!(names, [effect], "{:?}", c.closure.verdict);
    let step = &c.closure.steps[0];
    assert_eq!(step.parameters.len(), truth.len());
    for (name, value) in truth {
        let (found, std) = (step.parameters[*name], step.parameter_std[*name]);
        assert!(
            (found - value).abs() < 4.0 * std,
            "{name}: {found} +- {std}, not {value}"
        );
        assert!(
            std > 0.0 && std < 0.2 * value.abs(),
            "{name}: {found} +- {std}"
        );
    }
    step
}

#[test]
fn a_planted_effect_is_named_by_its_id_with_its_parameters() {
    let wobble = |t: f64, _: f64, rate: f64, _: f64| 0.04 * (TAU * rate * t / 360.0).sin();
    let c = closed(&record(1, wobble));
    let step = only_step(&c, "bearing_wobble", &[("gain", 0.04), ("period", 360.0)]);
    assert_eq!(step.channels, ["rate_dps", "time_s"]);
    // Firmware sees neither rate nor the record's time.
    assert!(!c.closure.firmware.compensable);
    let why = c
        .closure
        .warnings
        .iter()
        .find(|w| w.code == "not_compensable");
    assert!(why.unwrap().message.contains("rate_dps"));
    let page = gyrogen::report::closure::html(&c, "r.csv").unwrap();
    assert!(page.contains("bearing is not round") && page.contains("gain*sin(2*pi*rate_dps"));
}

#[test]
fn a_function_of_the_thermometer_goes_into_firmware() {
    let glue = |_: f64, degc: f64, _: f64, _: f64| 0.15 / (1.0 + (-(degc - 37.0) / 2.0).exp());
    let c = closed(&record(2, glue));
    let truth = [("a", 0.15), ("at", 37.0), ("width", 2.0)];
    only_step(&c, "glue_softens", &truth);
    let firmware = c.closure.firmware;
    assert!(firmware.compensable);
    assert!(firmware.heldout_rms.unwrap() < 1.02 * c.closure.after.heldout_rms);
    assert!(c.closure.after.heldout_rms < 1.1 * NOISE_DPS);
}

#[test]
fn a_column_that_the_design_lets_firmware_see_goes_there_too() {
    let rings = |_: f64, _: f64, _: f64, nm: f64| 0.2 * (nm / 0.2).sin().powi(2) + 0.1 * nm;
    let c = closed(&record(3, rings));
    only_step(&c, "torque_rings", &[("a", 0.2), ("b", 0.1), ("w", 0.2)]);
    assert!(c.closure.after.heldout_rms < 1.1 * NOISE_DPS);
}

#[test]
fn a_record_without_them_names_nothing_and_says_what_was_not_judged() {
    for seed in 10..14 {
        let c = closed(&record(seed, |_, _, _, _| 0.0));
        assert!(c.closure.steps.is_empty(), "{seed}: {:?}", c.closure.steps);
        let fate = |id: &str| {
            c.closure
                .evidence
                .iter()
                .find(|e| e.effect == id)
                .unwrap()
                .fate
        };
        assert_eq!(fate("bearing_wobble"), Fate::Rejected);
        assert_eq!(fate("has_no_column"), Fate::NoChannel);
        assert_eq!(fate("has_no_value"), Fate::NotExcited);
        let codes: Vec<&str> = c.closure.warnings.iter().map(|w| w.code).collect();
        assert!(codes.contains(&"effect_without_channel") && codes.contains(&"effect_not_judged"));
    }
}
