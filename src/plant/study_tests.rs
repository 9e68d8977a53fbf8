//! What a quadratic in the measured phase leaves of the default device's bias: the published 5 %.

use super::device::Device;
use super::effects::mode_crossing_dps;
use crate::design::template::default_design;
use crate::plant::profile;

/// The default device and the temperature of every reading of the default run, degC.
fn default_run() -> (Device, Vec<f64>) {
    let design = default_design().unwrap();
    let dwells = profile::dwells(&design.thermal_run);
    (
        Device::new(&design.gyro),
        dwells.iter().map(|d| d.0).collect(),
    )
}

/// What least squares by a quadratic in `x` leaves of `y` (modified Gram-Schmidt).
fn quadratic_residual(x: &[f64], y: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let powers = (0..3).map(|k| x.iter().map(|x| (x - mean).powi(k)).collect::<Vec<f64>>());
    for mut v in powers.chain([y.to_vec()]) {
        for b in &basis {
            let part = dot(&v, b);
            v.iter_mut().zip(b).for_each(|(v, b)| *v -= part * b);
        }
        if basis.len() == 3 {
            return v;
        }
        let length = dot(&v, &v).sqrt();
        v.iter_mut().for_each(|v| *v /= length);
        basis.push(v);
    }
    Vec::new()
}

fn peak_to_peak(values: &[f64]) -> f64 {
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    high - values.iter().copied().fold(f64::INFINITY, f64::min)
}

#[test]
fn a_quadratic_leaves_the_published_8_of_160() {
    let (mut device, temperatures) = default_run();
    let phases: Vec<f64> = temperatures
        .iter()
        .map(|&t| device.measured_phase_rad(t))
        .collect();
    let biases = |d: &Device| {
        temperatures
            .iter()
            .map(|&t| d.bias_dps(t))
            .collect::<Vec<_>>()
    };
    let total = biases(&device);
    let drift = peak_to_peak(&total);
    let left = peak_to_peak(&quadratic_residual(&phases, &total));
    assert!((drift - 160.0).abs() <= 2.0, "{drift}");
    assert!((left - 8.0).abs() <= 0.1, "{left}");

    // Well inside the run, and every slope of the bump is seen by a dwell.
    let [_, center_degc, half_width_k] = device.effects.get("mode_crossing").unwrap();
    let (low, high) = (
        center_degc - 4.0 * half_width_k,
        center_degc + 4.0 * half_width_k,
    );
    assert!(low > 0.0 && high < 70.0);
    let u = |t: &f64| (t - center_degc) / half_width_k;
    assert_eq!(
        temperatures.iter().filter(|t| u(t).abs() < 1.0).count(),
        2 * 2
    );

    // Without the effect the declared model is the truth.
    assert!(device.effects.remove("mode_crossing"));
    let left = peak_to_peak(&quadratic_residual(&phases, &biases(&device)));
    assert!(left < 1e-9, "{left}");
}

/// Why the default's half width is below one step: 8 deg/s left of a drift within 160 +- 2 deg/s
/// cannot be had with a bump of two steps' half width (nor of one), wherever its centre. Its tails add
/// amplitude * (f(u(70)) - f(u(0))), always of the amplitude's sign, to the 160 of eq. 9.
#[test]
fn a_wider_bump_cannot_leave_8_and_keep_160() {
    let (device, temperatures) = default_run();
    let phases: Vec<f64> = temperatures
        .iter()
        .map(|&t| device.measured_phase_rad(t))
        .collect();
    // The least departure of the drift from 160 over centres and both signs, deg/s.
    let departure = |half_width_k: f64| {
        let centers = (20..=120).map(|i| f64::from(i) / 2.0);
        let departures = centers.flat_map(|center_degc| {
            let bump: Vec<f64> = temperatures
                .iter()
                .map(|&t| mode_crossing_dps(1.0, center_degc, half_width_k, t))
                .collect();
            let amplitude = 8.0 / peak_to_peak(&quadratic_residual(&phases, &bump));
            [amplitude, -amplitude].map(|a| {
                let bias = temperatures.iter().zip(&bump);
                let total: Vec<f64> = bias
                    .map(|(&t, b)| device.declared_bias_dps(t) + a * b)
                    .collect();
                (peak_to_peak(&total) - 160.0).abs()
            })
        });
        departures.fold(f64::INFINITY, f64::min)
    };
    assert!(departure(3.7) < 2.0);
    assert!(departure(5.0) > 2.2, "{}", departure(5.0));
    assert!(departure(10.0) > 5.0, "{}", departure(10.0));
}
