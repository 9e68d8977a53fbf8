//! The parts from which blind records are made, against closed forms.

use crate::blind::linear::{mean, rms};
use crate::blind::{Scenario, heat, make, noise};

#[test]
fn lags_agree_with_the_closed_form() {
    // Ramp r t into a lag tau: r (t - tau (1 - exp(-t / tau))).
    let (step, tau, r) = (2.0, 30.0, 0.05);
    let x: Vec<f64> = (0..400).map(|k| r * step * f64::from(k)).collect();
    let smooth = heat::lag_runge_kutta(&x, step, tau);
    for (k, y) in smooth.iter().enumerate() {
        let t = step * k as f64;
        let exact = r * (t - tau * (1.0 - (-t / tau).exp()));
        assert!((y - exact).abs() < 1e-6, "{k}: {y} {exact}");
    }
    let stepwise = heat::lag_stepwise(&x, step, tau);
    let worst = smooth
        .iter()
        .zip(&stepwise)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(worst < 1.01 * r * step && worst > 0.0, "{worst}");
    assert!(
        heat::play(&x, 3.0)
            .iter()
            .zip(&x)
            .all(|(y, x)| (x - y).abs() <= 3.0)
    );
}

#[test]
fn flicker_has_a_flat_allan_variance_and_a_walk_a_rising_one() {
    let mut rng = crate::rng::Rng::new(3);
    let allan = |v: &[f64], m: usize| {
        let means: Vec<f64> = v.chunks_exact(m).map(mean).collect();
        let d: Vec<f64> = means.windows(2).map(|w| w[1] - w[0]).collect();
        0.5 * rms(&d).powi(2)
    };
    let mut growth = [0.0; 4];
    let runs = 24;
    for _ in 0..runs {
        let white: Vec<f64> = noise::make(2048, 1.0, noise::Flavour::White, &mut rng).values;
        let all = [
            noise::kasdin(2048, &mut rng),
            noise::relaxations(2048, &mut rng),
            noise::walk(2048, &mut rng),
            white,
        ];
        for (g, v) in growth.iter_mut().zip(&all) {
            *g += (allan(v, 64) / allan(v, 8)).ln() / f64::from(runs);
        }
    }
    let slopes = growth.map(|g| g / 8f64.ln());
    println!("{slopes:?}");
    assert!(
        slopes[0].abs() < 0.25 && slopes[1].abs() < 0.25,
        "1/f: {slopes:?}"
    );
    assert!(
        (slopes[2] - 1.0).abs() < 0.2 && (slopes[3] + 1.0).abs() < 0.2,
        "{slopes:?}"
    );
}

#[test]
fn both_dead_bands_and_both_ways_of_damping_occur() {
    let seen = |id: &'static str, name: &str| -> Vec<bool> {
        (0..24)
            .map(|seed| {
                let t = make(&Scenario::single(id, seed)).truth;
                let p = &t.planted[0].parameters;
                p.iter().any(|(k, v)| *k == name && *v == 1.0)
            })
            .collect()
    };
    for (id, name) in [
        ("output_deadband", "jumps"),
        ("damping_bias", "bends_phase"),
        ("scale_factor_asymmetry", "two_slopes"),
        ("amplitude_phase_coupling", "by_gain"),
    ] {
        let found = seen(id, name).iter().filter(|s| **s).count();
        println!("{id} {name} {found} of 24");
        assert!((2..=22).contains(&found), "{id} {name}: {found} of 24");
    }
}
