//! Sine, cosine and logarithm from additions, multiplications and divisions alone: the same bits
//! on every machine (a system's mathematics library gives no such promise), and branch-free.

use num_traits::Float;

/// Radians in one step of a 64-bit phase, 2 pi / 2^64.
const RAD_PER_STEP: f64 = std::f64::consts::TAU / 18_446_744_073_709_551_616.0;

/// Taylor coefficients of (sin x)/x in x^2, lowest first; the rest is below 5e-17 for x <= pi/4.
const SINE: [f64; 8] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
];

/// Taylor coefficients of cos x in x^2, lowest first; the rest is below 3e-18 for x <= pi/4.
const COSINE: [f64; 9] = [
    1.0,
    -1.0 / 2.0,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

/// A polynomial, its coefficients lowest first. No closure, so that it is compiled for whatever SIMD its caller is.
#[inline(always)]
fn horner<T: Float, const N: usize>(coefficients: &[T; N], x: T) -> T {
    let mut sum = T::zero();
    for c in coefficients.iter().rev() {
        sum = sum * x + *c;
    }
    sum
}

/// Sine and cosine of a phase in 2^-64 turn; the error is below 1e-15.
#[inline(always)]
pub fn sin_cos(phase: u64) -> (f64, f64) {
    // The nearest quarter turn, and what is left, within an eighth of a turn.
    let quarter = phase.wrapping_add(1 << 61) >> 62;
    let x = phase.wrapping_sub(quarter << 62) as i64 as f64 * RAD_PER_STEP;
    let square = x * x;
    let (s, c) = (x * horner(&SINE, square), horner(&COSINE, square));
    let (s, c) = if quarter & 1 == 0 { (s, c) } else { (c, -s) };
    if quarter & 2 == 0 { (s, c) } else { (-s, -c) }
}

/// Natural logarithm of a positive normal number; the relative error is below 1e-14.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    // x = m * 2^e with m in [sqrt(1/2), sqrt(2)).
    const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    let bits = x.to_bits().wrapping_add(ONE - ROOT_HALF);
    let exponent = (bits >> 52) as i64 - 1023;
    let m = f64::from_bits((bits & ((1 << 52) - 1)) + ROOT_HALF);
    // ln m = 2 artanh s; s^2 <= 0.0295, so eleven terms leave 1e-18.
    const ARTANH: [f64; 11] = [
        1.0,
        1.0 / 3.0,
        1.0 / 5.0,
        1.0 / 7.0,
        1.0 / 9.0,
        1.0 / 11.0,
        1.0 / 13.0,
        1.0 / 15.0,
        1.0 / 17.0,
        1.0 / 19.0,
        1.0 / 21.0,
    ];
    let s = (m - 1.0) / (m + 1.0);
    exponent as f64 * std::f64::consts::LN_2 + 2.0 * s * horner(&ARTANH, s * s)
}

/// An angle in rad as a phase in 2^-64 turn (the nearest that f64 can state), modulo one turn.
pub fn phase_of_rad(rad: f64) -> u64 {
    let turns = rad / std::f64::consts::TAU;
    // In [-1/2, 1/2]; the cast saturates at +1/2, one step short of it.
    ((turns - turns.round()) * 18_446_744_073_709_551_616.0) as i64 as u64
}

/// The same in single precision, for noise: half the width, so twice the lanes.
pub mod single {
    use super::horner;

    /// Radians in one step of a 32-bit phase, 2 pi / 2^32.
    const RAD_PER_STEP: f32 = std::f32::consts::TAU / 4_294_967_296.0;

    /// Taylor coefficients of (sin x)/x in x^2, lowest first; the rest is below 2e-9 for x <= pi/4.
    const SINE: [f32; 5] = [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0];

    /// Taylor coefficients of cos x in x^2, lowest first; the rest is below 3e-8 for x <= pi/4.
    const COSINE: [f32; 5] = [1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0];

    /// ln m = 2 artanh s; s^2 <= 0.0295, so five terms leave 2e-9.
    const ARTANH: [f32; 5] = [1.0, 1.0 / 3.0, 1.0 / 5.0, 1.0 / 7.0, 1.0 / 9.0];

    /// Sine and cosine of a phase in 2^-32 turn; the error is below 2e-7.
    #[inline(always)]
    pub fn sin_cos(phase: u32) -> (f32, f32) {
        let quarter = phase.wrapping_add(1 << 29) >> 30;
        let x = phase.wrapping_sub(quarter << 30) as i32 as f32 * RAD_PER_STEP;
        let square = x * x;
        let (s, c) = (x * horner(&SINE, square), horner(&COSINE, square));
        let (s, c) = if quarter & 1 == 0 { (s, c) } else { (c, -s) };
        if quarter & 2 == 0 { (s, c) } else { (-s, -c) }
    }

    /// Natural logarithm of a positive normal number; the relative error is below 4e-7.
    #[inline(always)]
    pub fn ln(x: f32) -> f32 {
        // x = m * 2^e with m in [sqrt(1/2), sqrt(2)).
        const ROOT_HALF: u32 = 0x3f35_04f3;
        const ONE: u32 = 0x3f80_0000;
        let bits = x.to_bits().wrapping_add(ONE - ROOT_HALF);
        let exponent = (bits >> 23) as i32 - 127;
        let m = f32::from_bits((bits & ((1 << 23) - 1)) + ROOT_HALF);
        let s = (m - 1.0) / (m + 1.0);
        exponent as f32 * std::f32::consts::LN_2 + 2.0 * s * horner(&ARTANH, s * s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::noise::Noise;

    #[test]
    fn sine_and_cosine_agree_with_the_library() {
        let noise = Noise::new(1, 1);
        let edges =
            (0..=16u64).flat_map(|k| [-1i64, 0, 1].map(|d| (k << 60).wrapping_add(d as u64)));
        for phase in edges.chain((0..100_000).map(|i| noise.bits(i))) {
            // Up to pi, where the angle itself is rounded by 4e-16.
            let rad = phase as i64 as f64 * RAD_PER_STEP;
            let (s, c) = sin_cos(phase);
            assert!((s - rad.sin()).abs() < 1e-15, "{phase}: {s} {}", rad.sin());
            assert!((c - rad.cos()).abs() < 1e-15, "{phase}: {c} {}", rad.cos());
        }
        assert_eq!(sin_cos(0), (0.0, 1.0));
        assert_eq!(sin_cos(1 << 62), (1.0, -0.0));
    }

    #[test]
    fn the_logarithm_agrees_with_the_library() {
        let noise = Noise::new(1, 2);
        for i in 0..100_000 {
            let u = noise.uniform(i);
            for x in [u, u * 1e-12, 1.0 - u * 1e-6, 1.0 / u] {
                let (own, library) = (ln(x), x.ln());
                assert!(
                    (own - library).abs() <= 1e-14 * library.abs(),
                    "{x}: {own} {library}"
                );
            }
        }
        assert_eq!(ln(1.0), 0.0);
    }

    #[test]
    fn single_precision_agrees_with_double() {
        let noise = Noise::new(1, 3);
        let edges =
            (0..=16u32).flat_map(|k| [-1, 0, 1].map(|d: i32| (k << 28).wrapping_add_signed(d)));
        for phase in edges.chain((0..100_000).map(|i| noise.bits(i) as u32)) {
            let (s, c) = sin_cos(u64::from(phase) << 32);
            let (own_s, own_c) = single::sin_cos(phase);
            assert!((f64::from(own_s) - s).abs() < 2e-7, "{phase}: {own_s} {s}");
            assert!((f64::from(own_c) - c).abs() < 2e-7, "{phase}: {own_c} {c}");
        }
        for i in 0..100_000 {
            let u = noise.uniform(i) as f32;
            for x in [u, u * 1e-9, 1.0 - u * 1e-3, 1.0 / u] {
                let (own, double) = (f64::from(single::ln(x)), ln(f64::from(x)));
                assert!(
                    (own - double).abs() <= 4e-7 * double.abs(),
                    "{x}: {own} {double}"
                );
            }
        }
        assert_eq!(single::ln(1.0), 0.0);
    }

    #[test]
    fn an_angle_becomes_a_phase() {
        for rad in [-9.0, -2.1328, -0.3, 0.0, 1.0, std::f64::consts::PI, 400.0] {
            let (s, c) = sin_cos(phase_of_rad(rad));
            assert!((s - rad.sin()).abs() < 1e-13 && (c - rad.cos()).abs() < 1e-13);
        }
    }
}
