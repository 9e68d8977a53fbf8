//! The -3 dB frequency of the decimator, which no word length changes.

use crate::design::Design;
use std::f64::consts::PI;

/// Where (sin(pi f W / fs) / (W sin(pi f / fs)))^N, with W = R M, has fallen to 1 / sqrt(2), Hz; by bisection to 1e-9
/// of the first zero.
pub fn bandwidth_hz(design: &Design) -> f64 {
    let d = &design.circuit.decimator;
    let width = f64::from(d.ratio * d.differential_delay);
    let fs = design.circuit.sample_rate_hz;
    let gain = |hz: f64| {
        let x = PI * hz / fs;
        ((width * x).sin() / (width * x.sin())).powi(d.stages as i32)
    };
    let (mut low, mut high) = (0.0, fs / width);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if gain(middle) > 0.5f64.sqrt() {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    #[test]
    fn three_stages_of_32_pass_half_the_power_at_about_a_quarter_of_the_rows() {
        let design = crate::design::reader::read(None).expect("the default");
        // sinc^3 at 0.2621 / W of the rate: (sin(0.8234) / 0.8234)^3 = 0.7071.
        let hz = super::bandwidth_hz(&design);
        assert!((hz - 0.2621 * 1750.0).abs() < 1.0, "{hz}");
    }
}
