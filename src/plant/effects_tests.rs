use super::*;
use crate::design::effects::CATALOGUE;
use crate::plant::converter::{Channel, Converter};

/// An instant at which no effect is at a zero of its own.
const AT: Instant = Instant {
    time_s: 150.0,
    power_on_s: 60.0,
    structure_degc: 45.0,
    electronics_degc: 35.0,
    structure_k_per_s: 0.02,
    lagged_degc: 42.0,
    phase_rad: -2.0,
    inverse_q: 0.1,
    quadrature_dps: 250.0,
    rate_dps: -100.0,
    supply_v: 5.2,
    accel_g: -2.0,
};

fn only(id: &str, values: &[f64]) -> Effects {
    let mut effects = Effects::default();
    effects.set(id, values).unwrap();
    effects
}

fn close(value: f64, expected: f64) {
    assert!(
        (value - expected).abs() < 1e-9,
        "{value}, expected {expected}"
    );
}

#[test]
fn each_effect_on_the_bias_follows_its_equation() {
    #[rustfmt::skip]
    let cases: &[(&str, &[f64], f64)] = &[
        ("thermal_lag", &[0.8, 240.0], -2.4),
        ("temperature_rate", &[60.0], 1.2),
        ("warmup_transient", &[1.5, 60.0], 1.5 * 0.367_879_441_171_442_3),
        // ln(1 + 150/150)
        ("ageing_drift", &[0.2, 150.0], 0.2 * std::f64::consts::LN_2),
        ("bias_third_order", &[100.0, -1.8], -0.8),
        ("bias_third_order", &[100.0, -2.5], 12.5),
        // u = 2: 2u/(1 + u^2) = 0.8
        ("mode_crossing", &[4.5, 37.5, 3.75], 3.6),
        ("damping_bias", &[10.0, 0.7], 1.0),
        ("quadrature_leakage", &[0.01], 250.0 * 0.009_999_833_334_166_664),
        // The electronics' temperature, not the structure's.
        ("demod_phase_drift", &[2e-4, 25.0], 0.5),
        ("supply_sensitivity", &[1.5, 5.0], 0.3),
        ("g_sensitivity", &[0.05], -0.1),
        ("g_squared_sensitivity", &[5e-3], 0.02),
        // A quarter turn.
        ("periodic_pickup", &[0.5, 600.0, 0.0], 0.5),
        // A quarter turn and a third of half a turn: sin 150 deg.
        ("periodic_pickup", &[0.5, 600.0, std::f64::consts::FRAC_PI_3], 0.25),
    ];
    for (id, values, expected) in cases {
        let effects = only(id, values);
        close(bias_dps(&effects, &AT), *expected);
        assert_eq!(contributions(&effects, &AT).len(), 1);
        assert_eq!(rate_dps(&effects, &AT), AT.rate_dps, "{id}");
    }
}

#[test]
fn each_effect_on_the_rate_follows_its_equation() {
    let rate = |id: &str, values: &[f64], rate| {
        let at = Instant {
            rate_dps: rate,
            ..AT
        };
        assert_eq!(bias_dps(&only(id, values), &at), 0.0);
        rate_dps(&only(id, values), &at)
    };
    // 20 K above the reference.
    close(
        rate("scale_factor_temperature", &[1e-3, 25.0], -100.0),
        -102.0,
    );
    close(
        rate("scale_factor_nonlinearity", &[1e-2, 200.0], -100.0),
        -100.25,
    );
    close(
        rate("scale_factor_nonlinearity", &[1e-2, 200.0], 200.0),
        202.0,
    );
    close(rate("scale_factor_asymmetry", &[1e-2], -100.0), -99.0);
    close(rate("scale_factor_asymmetry", &[1e-2], 100.0), 101.0);
    for (applied, sensed) in [
        (0.5, 0.0),
        (-0.5, 0.0),
        (0.0, 0.0),
        (0.51, 0.51),
        (-3.0, -3.0),
    ] {
        assert_eq!(rate("output_deadband", &[0.5], applied), sensed);
    }
    // The errors of the scale factor add; what the dead band takes has none.
    let mut both = only("scale_factor_asymmetry", &[1e-2]);
    both.set("scale_factor_temperature", &[1e-3, 25.0]).unwrap();
    both.set("output_deadband", &[0.5]).unwrap();
    close(rate_dps(&both, &AT), -101.0);
    assert_eq!(
        rate_dps(
            &both,
            &Instant {
                rate_dps: 0.4,
                ..AT
            }
        ),
        0.0
    );
}

#[test]
fn the_output_is_limited_and_need_not_be_symmetrical() {
    let limits = only("output_saturation", &[-250.0, 300.0]);
    for (total, limited) in [
        (-251.0, -250.0),
        (301.0, 300.0),
        (12.5, 12.5),
        (-250.0, -250.0),
    ] {
        assert_eq!(limit_dps(&limits, total), limited);
    }
}

#[test]
fn phase_quality_factor_and_stiffness_follow_their_equations() {
    close(
        phase_pull_rad(&only("amplitude_phase_coupling", &[0.02]), -0.25),
        -0.005,
    );
    let damping = only("damping_bias", &[10.0, 2.0]);
    close(quality_factor(&damping, 50.0, 60.0, 333.15), 50.0);
    // T/T0 = 1/2.
    close(quality_factor(&damping, 50.0, 26.85, 600.0), 200.0);
    let stiffness = only("stiffness_second_order", &[5e-8]);
    assert!((stiffness_extra(&stiffness, -40.0) - 8e-5).abs() < 1e-18);
    assert_eq!(stiffness_extra(&stiffness, 0.0), 0.0);
}

#[test]
fn without_effects_nothing_is_changed_bit_for_bit() {
    let none = Effects::default();
    assert_eq!(bias_dps(&none, &AT).to_bits(), 0);
    for x in [0.0, -0.0, -100.3, 1e300, f64::MIN_POSITIVE] {
        let at = Instant { rate_dps: x, ..AT };
        assert_eq!(rate_dps(&none, &at).to_bits(), x.to_bits());
        assert_eq!(limit_dps(&none, x).to_bits(), x.to_bits());
        assert_eq!(quality_factor(&none, x, 45.0, 300.0).to_bits(), x.to_bits());
        assert_eq!(phase_pull_rad(&none, x), 0.0);
        assert_eq!(stiffness_extra(&none, x), 0.0);
    }
    assert!(contributions(&none, &AT).is_empty());
    assert_eq!(StressJump::new(&none, 20.0), None);
}

/// Everything that the plant can ask of a set of effects, as bits.
fn everything(effects: &Effects) -> Vec<u64> {
    let mut values = vec![
        bias_dps(effects, &AT),
        rate_dps(effects, &AT),
        rate_dps(
            effects,
            &Instant {
                rate_dps: 0.1,
                ..AT
            },
        ),
        limit_dps(effects, 5000.0),
        phase_pull_rad(effects, 0.1),
        quality_factor(effects, 50.0, 60.0, 300.0),
        stiffness_extra(effects, 20.0),
        StressJump::new(effects, 20.0).map_or(0.0, |mut jump| jump.step(60.0)),
    ];
    for channel in [Channel::Drive, Channel::Sense] {
        let converter = Converter::new(effects, channel, 16);
        values.extend([
            converter.analog(20_000.3),
            f64::from(converter.code(5.0)),
            converter.additive_lsb(0.003),
            converter.latency_samples(),
            converter.aperture_jitter_rms_s(),
        ]);
        values.extend(converter.drive_feedthrough().unwrap_or_default());
    }
    values.into_iter().map(f64::to_bits).collect()
}

#[test]
fn every_effect_of_the_catalogue_acts_somewhere() {
    let none = everything(&Effects::default());
    for kind in CATALOGUE {
        let parameters = kind.parameters.iter();
        let values: Vec<f64> = parameters.map(|p| p.example.parse().unwrap()).collect();
        let effects = only(kind.id, &values);
        // The spur is in the excitation, which the drive's loop makes.
        let acts = everything(&effects) != none || kind.id == "nco_spur";
        assert!(acts, "{}", kind.id);
    }
    assert_eq!(
        only("nco_spur", &[0.5, 9.0]).get("nco_spur"),
        Some([0.5, 9.0])
    );
}

#[test]
fn contributions_add_up_to_what_bias_and_rate_have_more() {
    let mut effects = Effects::default();
    for kind in CATALOGUE {
        let parameters = kind.parameters.iter();
        let values: Vec<f64> = parameters.map(|p| p.example.parse().unwrap()).collect();
        effects.set(kind.id, &values).unwrap();
    }
    for rate in [-100.0, 0.3] {
        let at = Instant {
            rate_dps: rate,
            ..AT
        };
        let parts = contributions(&effects, &at);
        // 13 on the bias, 4 on the rate.
        assert_eq!(parts.len(), 17);
        let sum: f64 = parts.iter().map(|(_, dps)| dps).sum();
        close(
            sum,
            bias_dps(&effects, &at) + rate_dps(&effects, &at) - rate,
        );
    }
}

#[test]
fn the_bump_has_its_extremes_at_one_half_width() {
    let at = |u: f64| mode_crossing_dps(4.7, 31.25, 6.5, 31.25 + u * 6.5);
    assert_eq!((at(1.0), at(-1.0), at(0.0)), (4.7, -4.7, 0.0));
    assert!((-1000..=1000).all(|i| at(f64::from(i) / 50.0).abs() <= 4.7));
    assert!((at(100.0) - 4.7 * 0.02).abs() < 1e-4);
}

#[test]
fn a_stress_jump_remembers_the_way() {
    let walk = |hysteresis_k: f64, start: f64, path: &[f64]| -> Vec<f64> {
        let effects = only("stress_jump", &[1.5, 45.0, hysteresis_k]);
        let mut jump = StressJump::new(&effects, start).unwrap();
        path.iter().map(|&degc| jump.step(degc)).collect()
    };
    // Without hysteresis it has no memory.
    let path = [44.9, 45.0, 70.0, 45.0, 44.9];
    assert_eq!(walk(0.0, 0.0, &path), [0.0, 1.5, 1.5, 1.5, 0.0]);
    // Up at 48, down below 42; minor loops inside stay where they are.
    let path = [47.0, 48.0, 43.0, 47.0, 42.0, 41.9, 47.9];
    assert_eq!(walk(6.0, 0.0, &path), [0.0, 1.5, 1.5, 1.5, 1.5, 0.0, 0.0]);
    // Started above it, it has been released; started inside the loop, not yet.
    assert_eq!(walk(6.0, 50.0, &[45.0]), [1.5]);
    assert_eq!(walk(6.0, 45.0, &[45.0]), [0.0]);
    // Wider than the run: it stays.
    assert_eq!(walk(200.0, -90.0, &[146.0, 0.0, -50.0]), [1.5, 1.5, 1.5]);
}

#[test]
fn equilibrium_leaves_only_what_depends_on_the_temperature() {
    let mut effects = Effects::default();
    for id in [
        "thermal_lag",
        "temperature_rate",
        "warmup_transient",
        "supply_sensitivity",
        "g_sensitivity",
        "g_squared_sensitivity",
        "quadrature_leakage",
        "damping_bias",
    ] {
        let kind = CATALOGUE.iter().find(|k| k.id == id).unwrap();
        let parameters = kind.parameters.iter();
        let values: Vec<f64> = parameters.map(|p| p.example.parse().unwrap()).collect();
        effects.set(id, &values).unwrap();
    }
    assert_eq!(
        bias_dps(&effects, &Instant::equilibrium(&effects, 60.0)),
        0.0
    );
    effects.set("mode_crossing", &[4.5, 56.0, 4.0]).unwrap();
    assert_eq!(
        bias_dps(&effects, &Instant::equilibrium(&effects, 60.0)),
        4.5
    );
}
