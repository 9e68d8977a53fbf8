use super::*;
use crate::plant::noise::Noise;

fn with(effects: &[(&str, &[f64])], channel: Channel) -> Converter {
    let mut on = Effects::default();
    for (id, values) in effects {
        on.set(id, values).unwrap();
    }
    Converter::new(&on, channel, 16)
}

fn sense(id: &str, values: &[f64]) -> Converter {
    with(&[(id, values)], Channel::Sense)
}

fn close(value: f64, expected: f64) {
    assert!(
        (value - expected).abs() < 1e-9,
        "{value}, expected {expected}"
    );
}

#[test]
fn the_adc_takes_the_nearest_ties_up_and_saturates() {
    let adc = with(&[], Channel::Drive);
    let cases = [
        (0.5, 1),
        (-0.5, 0),
        (1.5, 2),
        (-1.5, -1),
        (0.499_999_999_999_999_94, 0),
        (-0.500_000_000_000_000_1, -1),
        (2.4, 2),
        (-2.6, -3),
        (32_767.6, 32_767),
        (1e300, 32_767),
        (-32_768.7, -32_768),
        (f64::NEG_INFINITY, -32_768),
    ];
    for (lsb, code) in cases {
        assert_eq!(adc.code(lsb), code, "{lsb}");
    }
    let wide = Converter::new(&Effects::default(), Channel::Sense, 32);
    assert_eq!((wide.code(1e10), wide.code(-1e10)), (i32::MAX, i32::MIN));
    assert_eq!(wide.code(-2_147_483_647.5), -2_147_483_647);
}

#[test]
fn without_effects_the_input_is_untouched_bit_for_bit() {
    let adc = with(&[], Channel::Sense);
    let noise = Noise::new(5, 5);
    let random = (0..10_000).map(|i| (noise.uniform(i) - 0.5) * 1e5);
    for x in random.chain([0.0, -0.0, 1e300, f64::NEG_INFINITY]) {
        assert_eq!(adc.analog(x).to_bits(), x.to_bits());
    }
    assert_eq!((adc.additive_lsb(0.3), adc.latency_samples()), (0.0, 0.0));
    assert_eq!(
        (adc.aperture_jitter_rms_s(), adc.drive_feedthrough()),
        (0.0, None)
    );
}

#[test]
fn gain_offset_bend_and_limit_follow_their_equations() {
    close(
        sense("adc_gain_error", &[5e-3]).analog(-10_000.0),
        -10_050.0,
    );
    close(sense("adc_offset", &[20.0]).analog(-10_000.0), -9_980.0);
    // x = 1/2: cubic 1/8, square 1/4.
    close(
        sense("adc_integral_nonlinearity", &[4.0, 0.0]).analog(-16_384.0),
        -16_384.5,
    );
    close(
        sense("adc_integral_nonlinearity", &[0.0, 4.0]).analog(-16_384.0),
        -16_383.0,
    );
    close(
        sense("adc_integral_nonlinearity", &[4.0, 4.0]).analog(0.0),
        0.0,
    );
    let clipping = sense("adc_clipping", &[0.25]);
    for (input, limited) in [(8000.5, 8000.5), (9000.0, 8192.0), (-9000.0, -8192.0)] {
        close(clipping.analog(input), limited);
    }
    // The limit is before the ADC: its offset comes on top.
    let both: &[(&str, &[f64])] = &[("adc_clipping", &[0.25]), ("adc_offset", &[20.0])];
    close(with(both, Channel::Drive).analog(30_000.0), 8212.0);
}

#[test]
fn a_full_scale_sine_gets_the_harmonics_that_were_asked_for() {
    let adc = sense("harmonic_distortion", &[2e-3, 5e-3]);
    // Amplitude of a harmonic, of the fundamental at the input.
    let harmonic = |k: f64, amplitude: f64| {
        let sum = (0..64).fold((0.0, 0.0), |sum, i| {
            let w = std::f64::consts::TAU * f64::from(i) / 64.0;
            let y = adc.analog(amplitude * 32_768.0 * w.sin()) / 32_768.0;
            (
                sum.0 + y * (k * w).sin() / 32.0,
                sum.1 + y * (k * w).cos() / 32.0,
            )
        });
        sum.0.hypot(sum.1) / amplitude
    };
    close(harmonic(2.0, 1.0), 2e-3);
    close(harmonic(3.0, 1.0), 5e-3);
    close(harmonic(1.0, 1.0), 1.015);
    close(harmonic(2.0, 0.5), 1e-3);
    close(harmonic(3.0, 0.5), 1.25e-3);
}

#[test]
fn missing_codes_never_appear_and_their_inputs_go_below() {
    let adc = sense("adc_missing_codes", &[64.0, 5.0]);
    let ideal = with(&[], Channel::Sense);
    for lsb in (-32_768..=32_767).map(f64::from) {
        let (code, expected) = (adc.code(lsb), ideal.code(lsb));
        let missing = (expected - 5) % 64 == 0;
        assert_eq!(code, expected - i32::from(missing), "{lsb}");
    }
    assert_eq!((adc.code(5.4), adc.code(4.5), adc.code(5.5)), (4, 4, 6));
    assert_eq!((adc.code(-59.0), adc.code(-58.6)), (-60, -60));
    // The first may be any of them, and the lowest code of all has none below.
    assert_eq!(sense("adc_missing_codes", &[64.0, -59.0]).code(5.0), 4);
    let every_second = sense("adc_missing_codes", &[2.0, 0.0]);
    assert_eq!(every_second.code(-32_768.0), -32_767);
    assert_eq!((every_second.code(0.0), every_second.code(-1.0)), (-1, -1));
}

#[test]
fn latency_and_feedthrough_are_the_sense_channels_only() {
    let effects: &[(&str, &[f64])] = &[
        ("sample_latency", &[0.25]),
        ("drive_feedthrough", &[5.0, 0.3]),
        ("aperture_jitter", &[1e-7]),
        ("mains_pickup", &[30.0, 50.0]),
    ];
    let [drive, sense] = [Channel::Drive, Channel::Sense].map(|c| with(effects, c));
    assert_eq!(
        (drive.channel(), sense.channel()),
        (Channel::Drive, Channel::Sense)
    );
    assert_eq!(
        (drive.latency_samples(), sense.latency_samples()),
        (0.0, 0.25)
    );
    assert_eq!(drive.drive_feedthrough(), None);
    assert_eq!(sense.drive_feedthrough(), Some([5.0, 0.3]));
    for converter in [drive, sense] {
        assert_eq!(converter.aperture_jitter_rms_s(), 1e-7);
        // A quarter period after 1000 s, and a twelfth.
        close(converter.additive_lsb(1000.005), 30.0);
        assert!((converter.additive_lsb(1.0 / 600.0) - 15.0).abs() < 1e-9);
    }
}
