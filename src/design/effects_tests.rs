use super::*;
use crate::design::reader::parse;
use crate::design::template::{DEFAULT, default_design};
use crate::error::Error;

/// The ids of the records' contract, in its order.
const RECORD_IDS: &[&str] = &[
    "thermal_lag",
    "temperature_rate",
    "warmup_transient",
    "ageing_drift",
    "bias_third_order",
    "mode_crossing",
    "stress_jump",
    "damping_bias",
    "quadrature_leakage",
    "demod_phase_drift",
    "scale_factor_temperature",
    "scale_factor_nonlinearity",
    "scale_factor_asymmetry",
    "output_deadband",
    "output_saturation",
    "supply_sensitivity",
    "g_sensitivity",
    "g_squared_sensitivity",
    "periodic_pickup",
    "amplitude_phase_coupling",
    "adc_offset",
    "adc_gain_error",
    "adc_integral_nonlinearity",
    "adc_missing_codes",
    "adc_clipping",
    "aperture_jitter",
    "harmonic_distortion",
    "drive_feedthrough",
    "sample_latency",
    "mains_pickup",
    "nco_spur",
];

/// The line of default.toml that switches an effect on.
fn line(kind: &EffectKind) -> String {
    let parameters = kind.parameters.iter();
    let pairs: Vec<String> = parameters
        .map(|p| format!("{} = {}", p.key, p.example))
        .collect();
    format!("{} = {{ {} }}", kind.id, pairs.join(", "))
}

fn examples(kind: &EffectKind) -> Vec<f64> {
    let parameters = kind.parameters.iter();
    parameters.map(|p| p.example.parse().unwrap()).collect()
}

#[test]
fn the_catalogue_has_the_contracts_ids_and_one_more() {
    let mut expected = RECORD_IDS.to_vec();
    expected.push("stiffness_second_order");
    let mut ids: Vec<&str> = CATALOGUE.iter().map(|kind| kind.id).collect();
    expected.sort_unstable();
    ids.sort_unstable();
    assert_eq!(ids, expected);
    for kind in CATALOGUE {
        let mut keys: Vec<&str> = kind.parameters.iter().map(|p| p.key).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), kind.parameters.len(), "{}", kind.id);
        for p in kind.parameters {
            assert!(p.default.is_none_or(|d| p.accepted.accepts(d)), "{}", p.key);
        }
    }
}

#[test]
fn each_line_of_the_template_switches_its_effect_on_and_nothing_else() {
    let default = default_design().unwrap();
    for kind in CATALOGUE.iter().filter(|k| k.id != "mode_crossing") {
        let (off, on) = (
            format!("\n#{}\n", line(kind)),
            format!("\n{}\n", line(kind)),
        );
        assert_eq!(DEFAULT.matches(&off).count(), 1, "{off}");
        let text = DEFAULT.replace(&off, &on);
        let d = parse(&text, None).unwrap_or_else(|e| panic!("{e}"));
        let mut expected = default.gyro.effects.clone();
        expected.set(kind.id, &examples(kind)).unwrap();
        assert_eq!(d.gyro.effects, expected);
        assert_eq!(d.gyro.effects.values(kind.id), Some(&*examples(kind)));
        assert_eq!(
            (d.circuit, d.thermal_run),
            (default.circuit.clone(), default.thermal_run.clone())
        );
        // The same as a table with a header.
        let header = line(kind)
            .replacen(" = {", "]\n", 1)
            .replace(", ", "\n")
            .replace('}', "");
        let d = parse(&format!("[gyro.effects.{header}"), None).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(d.gyro.effects.values(kind.id), Some(&*examples(kind)));
        assert_eq!(d.gyro.effects.iter().count(), 1);
    }
}

#[test]
fn all_at_once_are_held_in_the_catalogues_order_whatever_the_files() {
    let lines: Vec<String> = CATALOGUE.iter().rev().map(line).collect();
    let d = parse(&format!("[gyro.effects]\n{}\n", lines.join("\n")), None).unwrap();
    let ids: Vec<&str> = d.gyro.effects.iter().map(|(kind, _)| kind.id).collect();
    let all: Vec<&str> = CATALOGUE.iter().map(|kind| kind.id).collect();
    assert_eq!(ids, all);
    let mut set = Effects::default();
    for kind in CATALOGUE.iter().rev() {
        set.set(kind.id, &examples(kind)).unwrap();
    }
    assert_eq!(set, d.gyro.effects);
}

#[test]
fn parameters_with_a_default_may_be_left_out_and_others_may_not() {
    for kind in CATALOGUE.iter().filter(|k| k.id != "mode_crossing") {
        for (i, left_out) in kind.parameters.iter().enumerate() {
            let example = format!("{} = {}", left_out.key, left_out.example);
            let text = line(kind)
                .replace(&example, "")
                .replace("{ , ", "{ ")
                .replace(", , ", ", ")
                .replace(",  }", " }");
            let text = format!("[gyro.effects]\n{text}\n");
            match (parse(&text, None), left_out.default) {
                (Ok(d), Some(default)) => {
                    assert_eq!(d.gyro.effects.values(kind.id).unwrap()[i], default);
                }
                (Err(Error::Input(e)), None) => {
                    assert!(
                        e.message
                            .contains(&format!("lacks the required key `{}`", left_out.key)),
                        "{e}"
                    );
                    assert!(e.help.as_ref().is_some_and(|h| h.contains(&example)), "{e}");
                    assert_eq!(e.line, Some(2));
                }
                (other, _) => panic!("{text}: {other:?}"),
            }
        }
    }
}

#[test]
fn a_given_gyro_has_only_the_effects_that_it_names() {
    let d = parse("[gyro.effects.adc_offset]\nlsb = 3\n", None).unwrap();
    assert_eq!(d.gyro.effects.get("adc_offset"), Some([3.0]));
    assert_eq!(d.gyro.effects.get::<3>("mode_crossing"), None);
    assert!(parse("[gyro]\n", None).unwrap().gyro.effects.is_empty());
    assert!(!parse("", None).unwrap().gyro.effects.is_empty());
}

#[test]
fn set_refuses_what_a_file_could_not_say() {
    let mut effects = Effects::default();
    let mut refused = |id: &str, values: &[f64], what: &str, help: &str| {
        let said = effects.set(id, values).unwrap_err().to_string();
        assert!(said.contains(what) && said.contains(help), "{said}");
        assert!(effects.is_empty());
    };
    refused("adc_ofset", &[1.0], "no effect `adc_ofset`", "`adc_offset`");
    refused(
        "thermal_lag",
        &[1.0],
        "takes 2 parameters",
        "`dps_per_k` and `tau_s`",
    );
    refused("thermal_lag", &[1.0, 0.0], "`tau_s` is 0", "in s");
    refused(
        "thermal_lag",
        &[f64::NAN, 1.0],
        "`dps_per_k` is NaN",
        "deg/s",
    );
    refused(
        "output_saturation",
        &[5.0, 5.0],
        "nothing is between",
        "below",
    );
    refused("adc_missing_codes", &[2.5, 0.0], "whole number", "codes");
    effects.set("thermal_lag", &[1.0, 2.0]).unwrap();
    effects.set("thermal_lag", &[3.0, 4.0]).unwrap();
    assert_eq!(effects.iter().count(), 1);
    assert_eq!(effects.get("thermal_lag"), Some([3.0, 4.0]));
    assert!(effects.remove("thermal_lag") && !effects.remove("thermal_lag"));
}

#[test]
fn the_manual_names_every_effect_and_parameter() {
    let manual = include_str!("../../docs/manual.md");
    for kind in CATALOGUE {
        let row = manual
            .lines()
            .find(|l| l.starts_with(&format!("| `{}` |", kind.id)));
        let row = row.unwrap_or_else(|| panic!("{} is not in the manual", kind.id));
        for p in kind.parameters {
            assert!(
                row.contains(&format!("`{}`", p.key)),
                "{}: {}",
                kind.id,
                p.key
            );
        }
    }
}
