//! The 127-bit rule at its exact edge: 127 bits are accepted, 128 refused.

use super::*;
use crate::design::template::default_design;
use crate::numeric::format::Quantizer;

fn q(text: &str) -> Format {
    text.parse().unwrap()
}

fn cast(text: &str) -> Quantizer {
    Quantizer::default_of(q(text))
}

fn base() -> Design {
    let mut d = default_design().unwrap();
    d.circuit.phase_loop = Some(PhaseLoop {
        setpoint_raw: 0,
        proportional: LoopGain { raw: 1, shift: 0 },
        integral: LoopGain { raw: 1, shift: 0 },
        integrator_bits: 64,
    });
    d
}

fn compensation(d: &mut Design) -> &mut Compensation {
    d.compensation.as_mut().unwrap()
}

/// `change(design, true)` needs 127 bits, `change(design, false)` 128 with the given sum.
fn edge(key: &str, sum: &str, change: impl Fn(&mut Design, bool)) {
    let mut d = base();
    change(&mut d, true);
    assert_eq!(check(&d), Ok(()), "{key}: 127 bits");
    let mut d = base();
    change(&mut d, false);
    let e = check(&d).unwrap_err();
    assert_eq!(
        (e.key, e.sum.as_str()),
        (key, format!("{sum} = 128 bits").as_str())
    );
    assert_eq!(e.bits, 128);
    assert!(!e.remedy().is_empty());
}

#[test]
fn the_product_shifted_left() {
    let key = "circuit.demodulator.product";
    edge(key, "32 (adc) + 40 (table) + 56 (left shift)", |d, fits| {
        d.circuit.adc.format = q("Q32.0");
        d.circuit.nco.table = q("Q40.0");
        d.circuit.demodulator.product = cast(if fits { "Q2.55" } else { "Q2.56" });
    });
    // A right shift counts the word before it: 72 bits.
    let mut d = base();
    d.circuit.adc.format = q("Q1.31");
    d.circuit.nco.table = q("Q1.39");
    d.circuit.demodulator.product = cast("Q64.0");
    assert_eq!(check(&d), Ok(()));
}

#[test]
fn the_sum_of_the_decimator() {
    let key = "circuit.decimator.output";
    // N = 3, R M = 2^21 is out of reach; N = 6: 1448^6 < 2^63 < 1449^6 <= 2^64.
    let gain = |d: &mut Design, ratio| {
        d.circuit.decimator.stages = 6;
        d.circuit.decimator.ratio = ratio;
    };
    edge(
        key,
        "64 (product) + 64 (gain of the decimator)",
        |d, fits| {
            gain(d, if fits { 1448 } else { 1449 });
            d.circuit.demodulator.product = cast("Q34.30");
        },
    );
    edge(
        key,
        "64 (product) + 1 (unsigned) + 63 (gain of the decimator)",
        |d, fits| {
            gain(d, 1448);
            d.circuit.demodulator.product = cast(if fits { "UQ33.30" } else { "UQ34.30" });
        },
    );
    edge(
        key,
        "64 (product) + 15 (gain of the decimator) + 49 (left shift)",
        |d, fits| {
            d.circuit.demodulator.product = cast(if fits { "Q63.0" } else { "Q64.0" });
            d.circuit.decimator.output = cast("Q0.64".replace('Q', "UQ").as_str());
        },
    );
}

#[test]
fn cordic_and_amplitude_loop_fit_at_their_widest() {
    let mut d = base();
    d.compensation = None;
    d.circuit.decimator.output = cast("UQ34.30");
    d.circuit.cordic.guard_bits = 32;
    d.circuit.cordic.width = 64;
    d.circuit.cordic.gain_bits = 62;
    d.circuit.amplitude_loop = Some(AmplitudeLoop {
        setpoint_raw: i64::MIN,
        error_shift: 63,
        integrator_shift: 63,
        initial_raw: 0,
        gain_bits: 32,
    });
    assert_eq!(check(&d), Ok(()));
    // One bit beyond the range of the key, were it allowed.
    d.circuit.cordic.gain_bits = 63;
    let e = check(&d).unwrap_err();
    assert_eq!(e.key, "circuit.cordic.gain_bits");
    assert_eq!(e.sum, "64 (x) + 64 (magnitude constant) = 128 bits");
}

#[test]
fn the_first_product_of_the_polynomial() {
    let key = "compensation.accumulator";
    edge(key, "64 (coefficient) + 64 (input)", |d, fits| {
        d.circuit.cordic.angle_bits = if fits { 63 } else { 64 };
        compensation(d).coefficient_format = q("Q44.20");
    });
    edge(
        key,
        "63 (coefficient) + 1 (unsigned) + 64 (input)",
        |d, fits| {
            d.circuit.cordic.angle_bits = if fits { 63 } else { 64 };
            compensation(d).coefficient_format = q("UQ43.20");
        },
    );
    edge(
        key,
        "64 (coefficient) + 4 (input) + 60 (left shift)",
        |d, fits| {
            d.circuit.cordic.angle_bits = 4;
            let k = compensation(d);
            k.coefficient_format = q(if fits { "Q63.0" } else { "Q64.0" });
            k.accumulator = cast("Q1.63");
        },
    );
    // A constant has no product.
    let mut d = base();
    d.circuit.cordic.angle_bits = 64;
    d.circuit.phase_loop = None;
    let k = compensation(&mut d);
    k.coefficient_format = q("Q44.20");
    k.coefficients_raw.truncate(1);
    assert_eq!(check(&d), Ok(()));
}

#[test]
fn the_later_products_of_the_polynomial() {
    let key = "compensation.accumulator";
    edge(key, "64 (accumulator) + 64 (input)", |d, fits| {
        d.circuit.cordic.angle_bits = 64;
        compensation(d).accumulator = cast(if fits { "Q36.27" } else { "Q37.27" });
    });
    edge(
        key,
        "63 (accumulator) + 1 (unsigned) + 64 (input)",
        |d, fits| {
            d.circuit.cordic.angle_bits = 64;
            compensation(d).accumulator = cast(if fits { "UQ35.27" } else { "UQ36.27" });
        },
    );
    // A straight line has only the first product.
    let mut d = base();
    d.circuit.cordic.angle_bits = 64;
    compensation(&mut d).accumulator = cast("Q37.27");
    compensation(&mut d).coefficients_raw.truncate(2);
    assert_eq!(check(&d), Ok(()));
}

#[test]
fn a_channel_counts_its_word_less_its_offset() {
    let channel = |d: &mut Design, format: &str, offset_raw| {
        let k = compensation(d);
        k.accumulator = cast("Q36.27");
        k.input = CompensationInput::Channel(ChannelInput {
            column: "die_degc".to_owned(),
            format: q(format),
            offset_raw,
            scale_bits: 31,
            rate_format: q("Q2.22"),
        });
    };
    let key = "compensation.accumulator";
    edge(key, "63 (accumulator) + 65 (input)", |d, fits| {
        channel(d, "UQ64.0", if fits { 1 << 63 } else { 0 });
    });
    edge(key, "63 (accumulator) + 65 (input)", |d, fits| {
        channel(d, "Q64.0", i128::from(!fits));
    });
}

#[test]
fn bias_and_rate_in_the_output() {
    let key = "compensation.output";
    edge(key, "64 (accumulator) + 64 (left shift)", |d, fits| {
        let k = compensation(d);
        k.coefficient_format = q("Q12.0");
        k.accumulator = cast(if fits { "Q63.0" } else { "Q64.0" });
        k.output = cast("UQ0.64");
    });
    edge(key, "64 (coefficient) + 64 (left shift)", |d, fits| {
        let k = compensation(d);
        k.coefficients_raw.truncate(1);
        k.coefficient_format = q(if fits { "Q63.0" } else { "Q64.0" });
        k.output = cast("UQ0.64");
    });
    let rate = "64 (rate input) + 64 (left shift to rate_full_scale_dps)";
    edge(key, rate, |d, fits| {
        d.circuit.decimator.output = cast("Q64.0");
        compensation(d).output = cast(if fits { "Q1.52" } else { "Q1.53" });
    });
    edge(
        key,
        "63 (rate input) + 1 (unsigned) + 64 (left shift to rate_full_scale_dps)",
        |d, fits| {
            d.circuit.decimator.output = cast(if fits { "UQ62.0" } else { "UQ63.0" });
            compensation(d).output = cast("Q1.53");
        },
    );
    edge(key, rate, |d, fits| {
        compensation(d).input = CompensationInput::Channel(ChannelInput {
            column: "freq_hz".to_owned(),
            format: q("Q16.16"),
            offset_raw: 0,
            scale_bits: 31,
            rate_format: q("Q64.0"),
        });
        compensation(d).output = cast(if fits { "Q1.52" } else { "Q1.53" });
    });
    // Full scales far below one LSB are right shifts and cost nothing.
    let mut d = base();
    compensation(&mut d).rate_full_scale_dps = f64::MIN_POSITIVE;
    assert_eq!(check(&d), Ok(()));
    compensation(&mut d).rate_full_scale_dps = 2f64.powi(1023);
    assert_eq!(check(&d).unwrap_err().bits, 24 + 12 + 1023 - 22);
}

#[test]
fn the_products_of_the_phase_loop() {
    let gain = |d: &mut Design| {
        d.circuit.cordic.angle_bits = 64;
        d.compensation = None;
    };
    let largest = (1i64 << 62) - 1;
    edge(
        "circuit.phase_loop.proportional",
        "64 (proportional.raw) + 64 (phase error)",
        |d, fits| {
            gain(d);
            let l = d.circuit.phase_loop.as_mut().unwrap();
            l.proportional.raw = if fits { largest } else { largest + 1 };
        },
    );
    edge(
        "circuit.phase_loop.integral",
        "64 (integral.raw) + 64 (integrator)",
        |d, fits| {
            gain(d);
            let l = d.circuit.phase_loop.as_mut().unwrap();
            l.integral.raw = if fits { -largest - 1 } else { -largest - 2 };
        },
    );
}

#[test]
fn integers_have_their_shortest_width() {
    for (v, bits) in [
        (0, 1),
        (-1, 1),
        (1, 2),
        (-2, 2),
        (2, 3),
        (127, 8),
        (-128, 8),
        (128, 9),
        (i128::from(i64::MIN), 64),
        (i128::from(i64::MAX), 64),
        (i128::MIN, 128),
    ] {
        assert_eq!(integer_bits(v), bits, "{v}");
    }
}
