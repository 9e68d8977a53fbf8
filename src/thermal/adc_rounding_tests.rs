//! Against the formula, and against the whole circuit.

use super::*;
use crate::circuit::CHANNELS;
use crate::circuit::engine::{ArithmeticKind, columns, engine};
use crate::circuit::scale::amplitude_lsb_per_magnitude;
use crate::design::reader;
use crate::numeric::format::Format;
use crate::statistics::random::Stream;

/// An ADC of few bits, and an oscillator that samples `count` phases.
fn design(adc: &str, count: u32) -> Design {
    let mut design = reader::read(None).unwrap();
    design.circuit.adc.format = adc.parse::<Format>().unwrap();
    design.circuit.nco.tuning_word = 1i64 << (design.circuit.nco.phase_bits - count.ilog2());
    design
}

fn rounding(design: &Design, noise_lsb: f64) -> Rounding {
    Rounding::new(design, [CHANNELS[2], CHANNELS[3]], noise_lsb).unwrap()
}

/// Tones around an amplitude, at all angles.
fn tones(count: usize, amplitude_lsb: f64) -> Vec<[f64; 2]> {
    let stream = Stream::new(7, 1);
    let draws = stream.normals(2 * count);
    draws
        .chunks(2)
        .map(|two| {
            let (sin, cos) = (10.0 * two[0]).sin_cos();
            let amplitude = amplitude_lsb + 3.0 * two[1];
            [amplitude * cos, amplitude * sin]
        })
        .collect()
}

#[test]
fn the_rms_is_the_formulas() {
    for (adc, count, amplitude) in [
        ("Q1.7", 8, 60.0),
        ("Q1.7", 32, 60.0),
        ("Q1.7", 128, 60.0),
        ("Q1.7", 1024, 60.0),
        ("Q1.7", 1024, 20.0),
        ("Q1.9", 32, 240.0),
        ("Q1.5", 64, 16.0),
    ] {
        let design = design(adc, count);
        for noise_lsb in [0.0, 0.1, 0.2, 0.35] {
            let rounding = rounding(&design, noise_lsb);
            let draws = if count > 200 { 150 } else { 400 };
            let each = tones(draws, amplitude);
            let square: f64 = each
                .iter()
                .flat_map(|tone| rounding.added(*tone))
                .map(|a| a * a)
                .sum();
            let rms = (square / (2 * draws) as f64).sqrt();
            let predicted = rms_lsb(f64::from(count), amplitude, noise_lsb);
            let ratio = rms / predicted;
            assert!(
                (0.85..1.18).contains(&ratio),
                "{adc} {count} {noise_lsb}: {rms} {predicted}"
            );
        }
    }
}

/// What the whole circuit makes of the tone, sample by sample, is the tone and what rounding adds.
#[test]
fn the_circuit_reads_the_tone_and_what_is_added() {
    for (adc, count) in [("Q1.7", 32), ("Q1.5", 8), ("Q1.9", 16)] {
        let mut design = design(adc, count);
        // Coarse products are rounding, too.
        design.circuit.demodulator.product.format = "Q2.12".parse::<Format>().unwrap();
        design.circuit.decimator.output.format = "Q2.40".parse::<Format>().unwrap();
        let rounding = rounding(&design, 0.0);
        let full_scale = -design.circuit.adc.format.min_raw() as f64;
        for [i, q] in tones(20, 0.5 * full_scale) {
            let mut engine = engine(&design, ArithmeticKind::Fixed);
            let mut rows = engine.no_rows();
            // The phase advances before each sample.
            let sense: Vec<f64> = (1..=8 * 32)
                .map(|n| {
                    let (sin, cos) = (TAU * f64::from(n) / f64::from(count)).sin_cos();
                    i * sin + q * cos
                })
                .collect();
            engine
                .process_inputs(&vec![0.0; sense.len()], &sense, &mut rows)
                .unwrap();
            let rows = rows.raw().expect("integers");
            let last = &rows[rows.len() - columns(&design).len()..];
            let added = rounding.added([i, q]);
            for (k, tone) in [i, q].into_iter().enumerate() {
                let value = last[2 + k] as f64 * design.circuit.decimator.output.format.lsb();
                let read = value * amplitude_lsb_per_magnitude(&design);
                // The table's words are no exact sines.
                assert!(
                    (read - tone - added[k]).abs() < 2e-3,
                    "{adc} {k}: {read} {tone} {}",
                    added[k]
                );
            }
        }
    }
}

#[test]
fn the_tone_is_found_behind_what_was_read() {
    let design = design("Q1.7", 32);
    for (noise_lsb, least) in [(0.1, 0.95), (0.3, 1.0)] {
        let rounding = rounding(&design, noise_lsb);
        let each = tones(200, 64.0);
        let found = each.iter().filter(|[i, q]| {
            let [a, b] = rounding.added([*i, *q]);
            let [back_i, back_q] = rounding.behind([i + a, q + b]);
            (back_i - i).hypot(back_q - q) < 0.02
        });
        let share = found.count() as f64 / each.len() as f64;
        assert!(share >= least, "{noise_lsb}: {share}");
    }
}

#[test]
fn phases_that_creep_are_few() {
    let mut design = design("Q1.7", 32);
    assert_eq!(period(&design), 32.0);
    let phases = |design: &Design| phases(design, 64.0, 16384.0);
    assert_eq!(phases(&design), 32.0);
    // A turn in 2^32 samples more is next to none within a row.
    design.circuit.nco.tuning_word += 1;
    assert_eq!((period(&design), phases(&design)), (pow2(32), 32.0));
    assert!(Rounding::new(&design, [CHANNELS[2], CHANNELS[3]], 0.1).is_none());
    // Four thousandths of a turn: 1.5 LSB.
    design.circuit.nco.tuning_word = (1 << 27) + 1000;
    let creep = 1000.0 * 16384.0 / pow2(32);
    let want = 32.0 * (TAU * 64.0 * creep).powi(2);
    assert!((phases(&design) / want - 1.0).abs() < 1e-6);
    // Far from any fraction (the golden section): q phases creep by 1 / (sqrt(5) q) of a step of theirs in a turn, and
    // by an LSB in all at q = 1720.
    design.circuit.nco.tuning_word = (0.618_033_988_7 * pow2(32)) as i64;
    assert!(
        (1600.0..3000.0).contains(&phases(&design)),
        "{}",
        phases(&design)
    );
    // A loop moves it.
    let with_loop = phase_loop();
    design.circuit.nco.tuning_word = 1 << 27;
    design.circuit.phase_loop = Some(with_loop);
    assert_eq!(phases(&design), 16384.0);
    assert!(Rounding::new(&design, [CHANNELS[2], CHANNELS[3]], 0.1).is_none());
}

fn phase_loop() -> crate::design::PhaseLoop {
    use crate::design::{LoopGain, PhaseLoop};
    let gain = LoopGain { raw: 9, shift: 6 };
    PhaseLoop {
        setpoint_raw: -4_194_304,
        proportional: gain,
        integral: gain,
        integrator_bits: 48,
    }
}
