use super::*;
use crate::design::keys;
use crate::design::reader::parse;
use crate::design::schema::*;

#[test]
fn the_default_is_what_it_says() {
    let d = default_design().unwrap();
    assert_eq!(d.name, "gyro");
    assert!(!d.compensation_is_own);
    assert_eq!(d.source.text, DEFAULT);
    assert_eq!((d.source.path.clone(), d.source.sha256.len()), (None, 64));
    let c = &d.circuit;
    let tone = c.nco.tuning_word as f64 / 2f64.powi(32) * c.sample_rate_hz;
    assert_eq!(tone, d.gyro.drive_frequency_hz);
    assert_eq!(c.decimator.gain_bits(), 15);
    assert!(c.phase_loop.is_none());
    assert_eq!(c.amplitude_loop.as_ref().unwrap().initial_raw, 1 << 26);
    let k = d.compensation.as_ref().unwrap();
    assert_eq!((&k.input, k.clamp_raw), (&CompensationInput::Phase, None));
    assert_eq!(k.rate_full_scale_exponent(), 11);
    // The nearest integers of eq. 9 in half turns.
    for ((raw, per_rad), power) in k.coefficients_raw.iter().zip(d.gyro.bias_dps).zip(0..) {
        let exact = per_rad * std::f64::consts::PI.powi(power) * 2f64.powi(20);
        assert_eq!(*raw, exact.round() as i128);
    }
    assert_eq!(d.fit.order, FitOrder::ByRecord);
    let on: Vec<&str> = d.gyro.effects.iter().map(|(kind, _)| kind.id).collect();
    assert_eq!(on, ["mode_crossing"]);
}

#[test]
fn the_default_gyro_drifts_by_the_published_160_deg_per_s() {
    let g = default_design().unwrap().gyro;
    // Eq. 7 with law (4), written out here on its own.
    let phase = |degc: f64| {
        let r = 1.0 - g.stiffness_tempco_per_k / 2.0 * (degc + 273.15 - g.reference_temperature_k);
        let e = &g.electronics;
        -f64::atan2(r, g.drive_q * (r * r - 1.0))
            + e.phase_offset_rad
            + e.phase_slope_rad_per_k * (degc - e.reference_temperature_degc)
    };
    let bias = |p: f64| g.bias_dps[0] + p * (g.bias_dps[1] + p * g.bias_dps[2]);
    assert!((phase(0.0) + 1.5046).abs() < 5e-5, "{}", phase(0.0));
    assert!((phase(70.0) + 2.1328).abs() < 5e-5, "{}", phase(70.0));
    let drift = bias(phase(70.0)) - bias(phase(0.0));
    assert!((drift - 160.0).abs() < 0.01, "{drift}");
}

/// The default with the settings on that are off and whose key begins with one of `on`.
fn switched_on(on: &[&str]) -> String {
    let lines = DEFAULT.lines().map(|line| match line.strip_prefix('#') {
        Some(setting) if on.iter().any(|key| setting.starts_with(key)) => setting,
        _ => line,
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn every_setting_that_is_off_can_be_turned_on() {
    let text = switched_on(&[
        "[circuit.phase_loop]",
        "setpoint_raw",
        "proportional",
        "integra",
        "clamp_raw",
        "outside",
        "bound_dps",
        "form = ",
        "target = ",
        "[compensation.fitted]",
        "coefficients_dps",
        "std_max_dps",
        "heldout_rms_dps",
        "loop_rms_dps",
        "row_period_s",
        "thermometer",
        "average_s",
        "[record.columns]",
        "time_s",
        "time_since_power_on_s",
        "rate_",
        "chamber_degc",
        "die_degc",
        "phase_rad",
        "freq_hz",
        "agc",
        "quad_dps",
        "supply_v",
        "accel_g",
    ])
    .replace("rate_input_format", "#rate_input_format")
    // Of [correction], which stays off.
    .replace("heldout_rms_dps = 2e-3", "#heldout_rms_dps = 2e-3");
    let d = parse(&text, None).unwrap_or_else(|e| panic!("{e}"));
    assert!(d.circuit.phase_loop.is_some());
    let low = d.compensation.as_ref().unwrap().clamp_raw.unwrap().0;
    assert_eq!(low, -5900000);
    assert_eq!(d.bound.map(|b| (b.bound_dps, b.auto)), Some((0.01, true)));
    let fitted = d.compensation.as_ref().and_then(|c| c.fitted.as_ref());
    assert_eq!(fitted.map(|f| f.coefficients_dps.len()), Some(3));
    assert_eq!(d.record.columns.len(), 12);
    assert_eq!(d.record.thermometer.as_deref(), Some("die_degc"));
    assert_eq!(d.record.average_s, Some(10.0));
    assert_eq!((d.record.axis, d.record.instance), (LogAxis::Z, None));

    let text = switched_on(&["input_", "rate_input_format"])
        .replace("input = \"phase\"", "input = \"die_degc\"");
    let d = parse(&text, None).unwrap_or_else(|e| panic!("{e}"));
    let CompensationInput::Channel(channel) = d.compensation.unwrap().input else {
        panic!("no channel");
    };
    assert_eq!((channel.offset_raw, channel.scale_bits), (4480, 13));
}

#[test]
fn every_key_is_in_the_template_and_every_example_is_toml() {
    for (table, known) in keys::KEYS {
        for (key, example) in *known {
            if *example == "[" {
                continue;
            }
            // A key with a dot in it is quoted.
            let quoted = key.contains('.');
            let key = if quoted {
                format!("\"{key}\"")
            } else {
                (*key).to_owned()
            };
            let line = format!("{key} = {example}");
            toml::de::DeTable::parse(&line).unwrap_or_else(|e| panic!("{table}: {line}: {e}"));
            let inside = table.ends_with("proportional") || table.ends_with("integral");
            let there = DEFAULT
                .lines()
                .any(|l| l.trim_start_matches('#').starts_with(&format!("{key} = ")));
            assert!(there || inside, "{table}: {key}");
        }
    }
}

#[test]
fn the_template_fits_a_page_and_is_ascii() {
    assert!(DEFAULT.is_ascii());
    assert!(DEFAULT.lines().all(|l| l.len() <= 100));
    assert!(DEFAULT.ends_with('\n') && !DEFAULT.contains('\r'));
}
