use super::*;
use crate::design::template::default_design;

/// The default run; without noise if `quiet`.
fn plant(quiet: bool) -> ThermalPlant {
    let design = default_design().unwrap();
    let circuit = &design.circuit;
    let sampling = Sampling {
        sample_rate_hz: circuit.sample_rate_hz,
        adc_bits: circuit.adc.format.bits(),
        tuning_word: circuit.nco.tuning_word,
        phase_bits: circuit.nco.phase_bits,
    };
    let mut plant = ThermalPlant::new(&design.gyro, &design.thermal_run, sampling);
    if quiet {
        (plant.run.adc_noise_lsb, plant.run.rate_noise_dps_rthz) = (0.0, 0.0);
    }
    plant
}

/// 2/count times the sums of code * sin and code * cos: in-phase and quadrature amplitude, LSB.
fn demodulate(plant: &ThermalPlant, codes: &[i32]) -> (f64, f64) {
    let turns = plant.sampling.tuning_word as f64 / 2f64.powi(plant.sampling.phase_bits as i32);
    let mut sums = (0.0, 0.0);
    for (n, &code) in (1..).zip(codes) {
        let (s, c) = (std::f64::consts::TAU * turns * f64::from(n)).sin_cos();
        sums = (sums.0 + f64::from(code) * s, sums.1 + f64::from(code) * c);
    }
    let scale = 2.0 / codes.len() as f64;
    (scale * sums.0, scale * sums.1)
}

#[test]
fn the_schedule_goes_up_and_back_with_the_top_once() {
    let plant = plant(true);
    let readings = plant.readings(0.5);
    assert_eq!(plant.dwells().len(), 29);
    assert_eq!(readings.len(), 29 * 3);
    assert!(
        readings
            .iter()
            .enumerate()
            .all(|(i, r)| r.index == i as u64)
    );
    assert!(readings.windows(2).all(|w| w[0].time_s < w[1].time_s));
    let at = |i: usize| {
        (
            readings[i].time_s,
            readings[i].chamber_degc,
            readings[i].heating,
        )
    };
    assert_eq!((at(0), at(1)), ((900.0, 0.0, true), (910.0, 0.0, true)));
    // 30 s of readings, 300 s of ramp, 900 s of settling.
    assert_eq!(at(3), (900.0 + 30.0 + 300.0 + 900.0, 5.0, true));
    assert_eq!(
        (at(44).1, at(44).2, at(45).1, at(45).2),
        (70.0, true, 65.0, false)
    );
    assert_eq!((at(86).1, at(86).2), (0.0, false));
    // Long readings do not overlap.
    let long = plant.readings(25.0);
    assert_eq!(long[1].time_s - long[0].time_s, 25.0);
    assert_eq!(long[3].time_s - long[2].time_s, 25.0 + 300.0 + 900.0);
}

#[test]
fn a_step_that_does_not_divide_the_span_ends_at_the_stop() {
    let mut plant = plant(true);
    let dwells = |p: &ThermalPlant| p.dwells().iter().map(|d| d.0).collect::<Vec<_>>();
    (plant.run.start_degc, plant.run.stop_degc, plant.run.step_k) = (0.0, 12.0, 5.0);
    assert_eq!(dwells(&plant), [0.0, 5.0, 10.0, 12.0, 10.0, 5.0, 0.0]);
    // 0.7 / 0.1 is a little below 7 or above it: eight dwells up all the same.
    (plant.run.stop_degc, plant.run.step_k) = (0.7, 0.1);
    assert_eq!(plant.dwells().len(), 15);
    (plant.run.stop_degc, plant.run.step_k) = (5.0, 5.0);
    assert_eq!(dwells(&plant), [0.0, 5.0, 0.0]);
}

#[test]
fn codes_carry_phase_amplitude_bias_and_quadrature() {
    let plant = plant(true);
    for reading in plant.readings(1.0).iter().step_by(3) {
        let (drive, sense) = plant.codes(reading, 64, 32 * 100 - 64);
        assert_eq!((drive.len(), sense.len()), (3200, 3200));
        let (i, q) = demodulate(&plant, &drive);
        let phase = plant.true_phase_rad(reading);
        // Quantisation is periodic with the 32 samples of a period: below 1 LSB of 16384.
        assert!((q.atan2(i) - phase).abs() < 6e-5, "{} {phase}", q.atan2(i));
        assert!((i.hypot(q) - 16384.0).abs() < 1.0);
        let (i, q) = demodulate(&plant, &sense);
        assert!((i / 32.0 - plant.true_bias_dps(reading)).abs() < 1.0 / 32.0);
        assert!((q / 32.0 - 250.0).abs() < 1.0 / 32.0);
    }
}

#[test]
fn sample_n_sees_n_tuning_words_exactly() {
    let mut plant = plant(true);
    let reading = plant.readings(1.0)[0];
    // Fine words have no drift: far out the phase is that of exact integers.
    plant.sampling.tuning_word = 0x2aaa_aaab_1234_5677;
    plant.sampling.phase_bits = 63;
    let first = 1u64 << 40;
    let (_, sense) = plant.codes_from(&reading, first, 500);
    let bias = plant.true_bias_dps(&reading);
    for (n, &code) in (first..).zip(&sense) {
        let word = (plant.sampling.tuning_word as u128 * u128::from(n)) % (1 << 63);
        let (s, c) = (std::f64::consts::TAU * word as f64 / 2f64.powi(63)).sin_cos();
        let ideal = 32.0 * (bias * s + 250.0 * c);
        assert!(
            (f64::from(code) - ideal).abs() <= 0.5 + 1e-6,
            "{n}: {code} {ideal}"
        );
    }
    // A negative word is its complement; all 64 bits can be used.
    (plant.sampling.tuning_word, plant.sampling.phase_bits) = (-3, 12);
    let negative = plant.codes(&reading, 0, 100);
    plant.sampling.tuning_word = 4093;
    assert_eq!(plant.codes(&reading, 0, 100), negative);
    (plant.sampling.tuning_word, plant.sampling.phase_bits) = (i64::MAX, 64);
    assert_eq!(plant.codes(&reading, 0, 1).1, [-8000]);
}

#[test]
fn neither_pieces_nor_order_matter() {
    let plant = plant(false);
    let readings = plant.readings(1.0);
    let whole = plant.codes(&readings[5], 100, 900);
    let pieces =
        [(1, 300), (301, 1), (302, 699)].map(|(n, c)| plant.codes_from(&readings[5], n, c));
    let drive: Vec<i32> = pieces.iter().flat_map(|p| p.0.clone()).collect();
    let sense: Vec<i32> = pieces.iter().flat_map(|p| p.1.clone()).collect();
    assert_eq!((drive, sense), whole);
    // Another reading of the same dwell, and another seed, have other noise.
    assert_ne!(plant.codes(&readings[4], 100, 900), whole);
    let mut other = plant.clone();
    other.run.seed += 1;
    assert_ne!(other.codes(&readings[5], 100, 900), whole);
}

#[test]
fn the_noise_has_its_declared_strength() {
    let mut noisy = plant(true);
    let reading = noisy.readings(1.0)[0];
    let clean = noisy.codes(&reading, 0, 320_000);
    noisy.run.adc_noise_lsb = 3.0;
    let codes = noisy.codes(&reading, 0, 320_000);
    for (noisy, clean) in [(&codes.0, &clean.0), (&codes.1, &clean.1)] {
        let square: f64 = noisy
            .iter()
            .zip(clean)
            .map(|(a, b)| f64::from(a - b).powi(2))
            .sum();
        // Both quantisers add: the clean one is fixed within a period, so 1/12 to 1/12 + 1/4.
        let variance = square / 320_000.0;
        assert!((9.0..9.5).contains(&variance), "{variance}");
    }
    // Rate noise: N * sqrt(fs/2) a sample; demodulated by 2 sin w its density is sqrt(3/2) * N.
    noisy.run.adc_noise_lsb = 0.0;
    noisy.run.rate_noise_dps_rthz = 0.1;
    let sense = noisy.codes(&reading, 0, 3_200_000).1;
    let period = 32;
    let means: Vec<f64> = sense
        .chunks(period)
        .map(|c| demodulate(&noisy, c).0 / 32.0)
        .collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / means.len() as f64;
    let expected = 1.5 * 0.1 * 0.1 * 28_000.0 / period as f64;
    assert!((mean - noisy.true_bias_dps(&reading)).abs() < 0.1, "{mean}");
    assert!(
        (variance / expected - 1.0).abs() < 0.025,
        "{variance} {expected}"
    );
}

#[test]
fn the_codes_reach_full_scale_and_stay_in_it() {
    let mut plant = plant(true);
    plant.run.drive_amplitude = 1.0;
    plant.run.sense_full_scale_dps = 100.0;
    let (drive, sense) = plant.codes(&plant.readings(1.0)[44], 0, 64);
    assert!(drive.iter().all(|c| (-32_768..=32_767).contains(c)));
    assert!(sense.contains(&32_767) && sense.contains(&-32_768));
}
