//! The measured spurs against the formula, on words where it must hold and on words where it cannot.

use super::lines::lines;
use super::nco::{Dominant, Method, NcoSpurs, nco_spurs, product_gain, spurs_of};
use crate::circuit::nco::Oscillator;
use crate::design::Design;
use crate::design::template::default_design;
use crate::numeric::format::{Format, Rounding};

/// The default design with this oscillator: w, F, P, entry.
fn design(phase_bits: u32, tuning_word: i64, address_bits: u32, table: Format) -> Design {
    let mut design = default_design().unwrap();
    let nco = &mut design.circuit.nco;
    nco.phase_bits = phase_bits;
    nco.tuning_word = tuning_word;
    nco.table_address_bits = address_bits;
    nco.table = table;
    design.thermal_run.quadrature_dps = QUADRATURE_DPS;
    design
}

/// Of the gyro whose tone is looked for, deg/s.
const QUADRATURE_DPS: f64 = 250.0;

const FINE: Format = Format::q(1, 31);

fn worst_dbc(spurs: &NcoSpurs) -> f64 {
    -spurs.measured.as_ref().unwrap().sfdr_dbc.unwrap()
}

fn show(s: &NcoSpurs) {
    println!(
        "{:?} {} measured {:?} predicted {:?} table {:?} agrees {:?} {:?} tone {:.3e}",
        s.method,
        s.samples,
        s.measured.as_ref().and_then(|m| m.sfdr_dbc),
        s.predicted.truncation_dbc(),
        s.predicted.table_dbc,
        s.agrees,
        s.reason,
        s.quadrature_tone_dps
    );
}

/// Over a whole period the formula is exact, whatever the table: to the rounding of f64.
#[test]
fn a_whole_period_has_the_predicted_spurs_to_a_millionth_of_a_decibel() {
    for address_bits in [4, 8, 10, 12] {
        for (word, table) in [(1234567, FINE), (-300001, FINE), (654322, Format::q(1, 15))] {
            for rounding in [Rounding::Floor, Rounding::HalfUp] {
                let mut d = design(20, word, address_bits, table);
                d.circuit.nco.address_rounding = rounding;
                let s = nco_spurs(&d);
                show(&s);
                assert_eq!(s.method, Method::WholePeriod);
                assert_eq!(s.dominated_by, Dominant::PhaseTruncation);
                assert_eq!((s.agrees, &s.reason), (Some(true), &None));
                let level = worst_dbc(&s);
                let predicted = s.predicted.truncation_dbc().unwrap();
                assert!((level - predicted).abs() < 1e-6, "{level} {predicted}");
                let published = -20.0 * f64::log10(2.0) * f64::from(address_bits);
                assert!(
                    (level - published).abs() < 1.0,
                    "P = {address_bits}: {level}"
                );
                every_listed_spur_is_there(&s, 1e-6);
            }
        }
    }
}

/// Each of the strongest predicted spurs is among the measured ones.
fn every_listed_spur_is_there(s: &NcoSpurs, within_db: f64) {
    let measured = &s.measured.as_ref().unwrap().strongest;
    let bin_hz = 56000.0 / s.samples as f64;
    for spur in &s.predicted.strongest {
        let near =
            |m: &&super::nco::Spur| (m.frequency_hz - spur.frequency_hz).abs() < bin_hz / 2.0;
        let found = measured.iter().find(near);
        let found = found.unwrap_or_else(|| panic!("{spur:?} is not in {measured:?}"));
        assert!(
            (found.level_dbc - spur.level_dbc).abs() < within_db,
            "{found:?} {spur:?}"
        );
    }
}

/// Periods longer than what is looked at: the window and its interpolation.
#[test]
fn a_long_period_has_the_predicted_spurs_under_the_window() {
    let words = [
        (32, 123_456_789),
        (32, -987_654_321),
        (48, 0x1357_9bdf_0246),
        (64, 0x2545_f491_4f6c_dd1d),
    ];
    for address_bits in [8, 10, 12, 16] {
        for (phase_bits, word) in words {
            let s = nco_spurs(&design(phase_bits, word, address_bits, FINE));
            show(&s);
            assert_eq!(s.method, Method::BlackmanHarris7);
            assert_eq!(s.agrees, Some(true), "{:?}", s.reason);
            let predicted = s.predicted.truncation_dbc().unwrap();
            assert!((worst_dbc(&s) - predicted).abs() < 0.02);
            every_listed_spur_is_there(&s, 0.05);
        }
    }
}

/// Published figures for P = 10, 12 and 16 (simulated): -59.7, -71.8, -96.3 dBc.
#[test]
fn the_levels_are_those_that_were_published() {
    for (address_bits, published) in [(10, -59.7), (12, -71.8), (16, -96.3)] {
        let s = nco_spurs(&design(32, 123_456_789, address_bits, FINE));
        assert!((worst_dbc(&s) - published).abs() < 1.0);
    }
}

/// gcd(F, 2^B) = 2^(B-1): a single truncation spur, 20 log10(pi / 2) = 3.92 dB above -6.02 P.
#[test]
fn two_steps_of_the_dropped_bits_give_one_spur_3_92_decibels_higher() {
    for address_bits in [8, 10, 12] {
        let dropped = 32 - address_bits;
        let word = (1i64 << (dropped - 1)) * 37;
        let s = nco_spurs(&design(32, word, address_bits, FINE));
        show(&s);
        assert_eq!(
            (s.predicted.truncation_steps, s.predicted.truncation_spurs),
            (2, 1)
        );
        assert_eq!(s.predicted.strongest.len(), 1);
        let correction = worst_dbc(&s) + 20.0 * f64::log10(2.0) * f64::from(address_bits);
        assert!((correction - 3.922).abs() < 0.035, "{correction}");
        assert_eq!((s.agrees, s.method), (Some(true), Method::WholePeriod));
        assert_eq!(s.measured.as_ref().unwrap().strong_spurs, 1);
        every_listed_spur_is_there(&s, 1e-6);
    }
}

/// Multiples of 2^B: what is left are the harmonics of the entries that are visited.
#[test]
fn a_coherent_word_has_no_truncation_spur() {
    let s = nco_spurs(&default_design().unwrap());
    show(&s);
    assert_eq!((s.samples, s.carrier_hz), (32, 1750.0));
    assert_eq!(s.predicted.truncation_spurs, 0);
    assert_eq!((s.dominated_by, s.agrees), (Dominant::Table, None));
    assert!(s.reason.as_ref().unwrap().contains("multiple of 2^20"));
    assert!((worst_dbc(&s) - s.predicted.table_dbc.unwrap()).abs() < 1e-6);
    assert!(worst_dbc(&s) < -90.0);
    // Odd harmonics of 1750 Hz fall on zeros of the decimator: nothing of the quadrature is left.
    assert!(s.quadrature_tone_dps < 1e-15, "{}", s.quadrature_tone_dps);
    // A quarter turn a sample: 0, 1, 0, -1.
    let s = nco_spurs(&design(32, 1 << 30, 12, FINE));
    assert_eq!(s.dominated_by, Dominant::None);
    assert_eq!(s.measured.unwrap().sfdr_dbc, None);
}

/// Few bits in an entry: its harmonics, as its transform predicts them, are above the truncation.
#[test]
fn a_coarse_table_is_named_as_what_dominates() {
    for (phase_bits, word) in [(20, 54321), (16, 777)] {
        let s = nco_spurs(&design(phase_bits, word, 12, Format::q(1, 5)));
        show(&s);
        assert_eq!((s.dominated_by, s.agrees), (Dominant::Table, None));
        assert!(s.reason.as_ref().unwrap().contains("table"));
        assert!((worst_dbc(&s) - s.predicted.table_dbc.unwrap()).abs() < 1e-6);
        // Six bits: the total is that of white rounding errors, nearly.
        let total = s.measured.unwrap().total_dbc.unwrap();
        assert!((total - s.predicted.table_noise_dbc).abs() < 1.0, "{total}");
        assert!((s.predicted.table_noise_dbc + 6.0206 * 6.0 + 1.76).abs() < 1e-3);
    }
}

#[test]
fn a_damaged_entry_shows() {
    let d = design(20, 300_001, 10, Format::q(1, 15));
    let good = Oscillator::new(&d.circuit.nco);
    let mut damaged = good.clone();
    let mut entries = good.table.entries.to_vec();
    // Its sign bit, stuck.
    entries[100] -= 1 << 15;
    damaged.table.entries = entries.into();
    let of = |o: &Oscillator| spurs_of(o, 56000.0, &d.circuit.decimator, QUADRATURE_DPS);
    let (good, damaged) = (of(&good), of(&damaged));
    show(&good);
    show(&damaged);
    assert_eq!(good.agrees, Some(true));
    let worst = |s: &NcoSpurs| s.measured.as_ref().unwrap().strongest.clone();
    assert!(
        worst_dbc(&damaged) > worst_dbc(&good) + 1.0,
        "{:?}",
        worst(&damaged)
    );
    assert_eq!(damaged.dominated_by, Dominant::Table);
    assert!(damaged.quadrature_tone_dps > good.quadrature_tone_dps);
}

#[test]
fn where_the_formula_says_nothing_the_reason_is_given() {
    let reason = |word: i64, phase_bits| {
        let s = nco_spurs(&design(phase_bits, word, 12, FINE));
        assert_eq!(s.agrees, None);
        s.reason.unwrap()
    };
    assert!(reason(0, 32).contains("no carrier"));
    assert!(reason(1 << 31, 32).contains("no carrier"));
    assert!(reason(3, 32).contains("too near"));
    // One step off a coherent word: the spurs are a thousandth of a hertz from the carrier.
    assert!(reason((1 << 27) + 1, 32).contains("from another line"));
    // 1/14 of the sample rate nearly: orders 7 apart meet.
    assert!(reason(i64::MAX / 7, 64).contains("from another line"));
    let s = nco_spurs(&design(32, (1 << 27) + 1, 12, FINE));
    // The tone is in the band of the rate all the same.
    let expected = QUADRATURE_DPS * 10f64.powf(s.predicted.truncation_dbc().unwrap() / 20.0);
    assert!((s.quadrature_tone_dps / expected - 1.0).abs() < 1e-3);
}

/// The tone by hand: one spur of known place through the decimator's response.
#[test]
fn the_tone_of_the_quadrature_is_that_of_the_spur_through_the_decimator() {
    // The single spur is at F (1 - 2^10) / 2^32: half the sample rate from the carrier.
    let d = design(32, (1 << 21) * 37, 10, FINE);
    let s = nco_spurs(&d);
    let spur = s.predicted.strongest[0];
    let fs = d.circuit.sample_rate_hz;
    let gain = |f_hz: f64| {
        let x = std::f64::consts::PI * f_hz / fs;
        ((32.0 * x).sin() / (32.0 * x.sin())).abs().powi(3)
    };
    let [below, above] = [
        spur.frequency_hz - s.carrier_hz,
        spur.frequency_hz + s.carrier_hz,
    ]
    .map(gain);
    let expected = QUADRATURE_DPS * 10f64.powf(spur.level_dbc / 20.0) * below.max(above);
    assert!(expected > 0.0);
    println!("{spur:?} {expected:e} {:e}", s.quadrature_tone_dps);
    assert!((s.quadrature_tone_dps / expected - 1.0).abs() < 1e-3);
    assert!(
        serde_json::to_string(&s)
            .unwrap()
            .contains("\"dominated_by\":\"phase_truncation\"")
    );
}

/// Three moving sums of `ratio` samples, divided by it, then every `ratio`-th: `rows` of them.
fn decimated(input: impl Fn(usize) -> f64, ratio: usize, rows: usize) -> Vec<f64> {
    let mut sums: Vec<f64> = (0..(rows + 3) * ratio).map(input).collect();
    for _ in 0..3 {
        let mean = |w: &[f64]| w.iter().sum::<f64>() / ratio as f64;
        sums = sums.windows(ratio).map(mean).collect();
    }
    sums.iter().step_by(ratio).take(rows).copied().collect()
}

/// The tone in the time domain: what is left of the sine without its carrier, times a quadrature of
/// [`QUADRATURE_DPS`], through a decimator of its own.
#[test]
fn the_tone_of_the_quadrature_is_there_in_the_time_domain() {
    let d = design(16, 63 << 8, 7, FINE);
    let s = nco_spurs(&d);
    let (period, turn) = (256, std::f64::consts::TAU * 63.0 / 256.0);
    let sine = super::nco::sine(&Oscillator::new(&d.circuit.nco), period);
    let part = |f: fn(f64) -> f64| -> f64 {
        let terms = sine.iter().enumerate();
        terms.map(|(n, x)| x * f(turn * n as f64)).sum::<f64>() * 2.0 / period as f64
    };
    let (p, q) = (part(f64::sin), part(f64::cos));
    let product = |n: usize| {
        let angle = turn * n as f64;
        let rest = sine[n % period] - p * angle.sin() - q * angle.cos();
        2.0 * QUADRATURE_DPS * rest / p.hypot(q) * (angle - q.atan2(p)).cos()
    };
    let rows = decimated(product, 32, period);
    let simulated = lines(&rows, Method::WholePeriod).unwrap().largest.amplitude;
    assert!(simulated > 1.0, "{simulated}");
    let error = s.quadrature_tone_dps / simulated - 1.0;
    assert!(error.abs() < 1e-6, "{simulated} {}", s.quadrature_tone_dps);
}

/// Two plain sines multiplied and decimated: where the difference is in the band, and where it is on
/// a zero of the decimator (R = 4, a quarter of the sample rate) and only the sum is left. The two do
/// not fold onto one another.
#[test]
fn both_products_of_spur_and_carrier_count() {
    for (ratio, carrier_bin, spur_bin, of_difference) in [(32, 61, 63, true), (4, 33, 97, false)] {
        let mut decimator = default_design().unwrap().circuit.decimator;
        decimator.ratio = ratio as u32;
        let [carrier, spur] = [carrier_bin, spur_bin].map(|b| f64::from(b) / 256.0);
        let cosine = |f: f64, n: usize| (std::f64::consts::TAU * f * n as f64).cos();
        let product = |n: usize| 2.0 * cosine(carrier, n) * cosine(spur, n);
        let rows = decimated(product, ratio, 256);
        let simulated = lines(&rows, Method::WholePeriod).unwrap().largest.amplitude;
        let gain = product_gain(&decimator, spur, carrier);
        assert!((gain / simulated - 1.0).abs() < 1e-6, "{gain} {simulated}");
        assert_eq!(gain > 0.1, of_difference, "{gain}");
    }
}
