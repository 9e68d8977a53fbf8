//! Records with an error that is known.

use super::*;
use crate::design::reader;
use crate::record::ThermalRecord;
use crate::thermal::intake::Intake;
use crate::thermal::synthetic::{Random, record, triangle};

const ROWS: usize = 240;

/// 8 bits, and noise before them of 0.1 LSB.
fn coarse() -> Design {
    let mut design = reader::read(None).unwrap();
    design.circuit.adc.format = "Q1.7".parse().unwrap();
    design.thermal_run.adc_noise_lsb = 0.1;
    design.thermal_run.rate_noise_dps_rthz = 1e-4;
    design
}

/// A gyro of the design over 70 K: its record as the ADC's rounding leaves it, and the rate without.
fn taken(design: &Design, thermometer: &str, rate_noise_dps: f64) -> (ThermalRecord, Vec<f64>) {
    let levels = Levels::of(design);
    let sense = Rounding::new(design, ["sense_i", "sense_q"], levels.sense_noise);
    let drive = Rounding::new(design, ["drive_i", "drive_q"], levels.drive_noise);
    let (sense, drive) = (sense.unwrap(), drive.unwrap());
    let mut random = Random::new(5);
    let (mut rate, mut quad, mut phase, mut clean) = (vec![], vec![], vec![], vec![]);
    let degc = triangle(ROWS);
    let held = levels.drive_amplitude;
    for t in &degc {
        let x = t / 70.0;
        let truth = -1.8 + 0.4 * x;
        // The loop holds what is read, so that the tone is what is behind it.
        let mut tone = [held * f64::cos(truth), held * f64::sin(truth)];
        for _ in 0..20 {
            let added = drive.added(tone);
            let read = (tone[0] + added[0]).hypot(tone[1] + added[1]);
            tone = tone.map(|v| v * held / read);
        }
        let amplitude = tone[0].hypot(tone[1]) / held;
        let added = drive.added(tone);
        phase.push((tone[1] + added[1]).atan2(tone[0] + added[0]));
        let bias = 120.0 - 30.0 * x + 8.0 * x * x + rate_noise_dps * random.normal();
        let lsb = levels.sense_lsb_dps;
        let sensed = [bias, 500.0 - 9.0 * x].map(|v| v * amplitude / lsb);
        let [i, q] = sense.added(sensed);
        rate.push((sensed[0] + i) * lsb);
        quad.push((sensed[1] + q) * lsb);
        clean.push(bias);
    }
    let mut record = record("die_degc", &degc, &rate);
    record.columns.insert("quad_dps".to_owned(), quad);
    record.columns.insert("phase_rad".to_owned(), phase);
    if thermometer == "phase_rad" {
        record.columns.remove("die_degc");
    }
    (record, clean)
}

fn seen(record: &ThermalRecord, design: &Design) -> (Channels, Vec<&'static str>) {
    let intake = Intake::of(record, design, Vec::new()).unwrap();
    let codes = intake.warnings.iter().map(|w| w.code).collect();
    (intake.whole(), codes)
}

fn left(c: &Channels) -> f64 {
    stats::rms(&declared_by(&c.u, &c.error_dps).1)
}

#[test]
fn the_error_is_taken_off_row_by_row() {
    for thermometer in ["phase_rad", "die_degc"] {
        let design = coarse();
        let (mut record, clean) = taken(&design, thermometer, 0.01);
        record.columns.get_mut("rate_out_dps").unwrap()[17] = f64::NAN;
        let (c, warnings) = seen(&record, &design);
        assert!(
            warnings.contains(&"adc_not_dithered"),
            "{thermometer}: {warnings:?}"
        );
        assert!(c.error_dps[17].is_nan());
        // A law in the phase is no parabola in degC, but nearly.
        let raw = record.columns["rate_out_dps"].clone();
        let error = |rows: &[f64]| {
            let pairs = rows.iter().zip(&clean).filter(|(r, _)| r.is_finite());
            stats::rms(&pairs.map(|(r, c)| r - c).collect::<Vec<_>>())
        };
        assert!(error(&raw) > 0.3, "{thermometer}: {}", error(&raw));
        assert!(
            error(&c.error_dps) < 0.1 * error(&raw),
            "{thermometer}: {}",
            error(&c.error_dps)
        );
        assert!(left(&c) < 0.04, "{thermometer}: {}", left(&c));
        assert!((0.01..0.06).contains(&c.rounding_dps), "{}", c.rounding_dps);
    }
}

#[test]
fn where_the_rows_do_not_tell_it_the_predicted_size_is_kept() {
    let design = coarse();
    let (record, _) = taken(&design, "phase_rad", 0.01);
    let unchanged = |record: &ThermalRecord, design: &Design| {
        let (c, warnings) = seen(record, design);
        assert!(warnings.contains(&"adc_not_dithered"));
        assert_eq!(c.error_dps, record.columns["rate_out_dps"]);
        c.rounding_dps
    };
    // No quadrature.
    let mut alone = record.clone();
    alone.columns.remove("quad_dps");
    let predicted = unchanged(&alone, &design);
    assert!((0.4..0.8).contains(&predicted), "{predicted}");
    // Another unit than the circuit's: not its words.
    let mut scaled = record.clone();
    for v in scaled.columns.get_mut("rate_out_dps").unwrap() {
        *v *= 0.83;
    }
    unchanged(&scaled, &design);
    // A phase that creeps.
    let mut creeping = design.clone();
    creeping.circuit.nco.tuning_word += 1;
    assert!((unchanged(&record, &creeping) / predicted - 1.0).abs() < 0.1);
}

#[test]
fn dithered_codes_and_noisy_rows_are_left_as_they_are() {
    let design = coarse();
    let (record, _) = taken(&design, "phase_rad", 0.01);
    let untouched = |record: &ThermalRecord, design: &Design| {
        let (c, warnings) = seen(record, design);
        assert!(!warnings.contains(&"adc_not_dithered"), "{warnings:?}");
        assert_eq!(c.error_dps, record.columns["rate_out_dps"]);
        assert_eq!(c.rounding_dps, 0.0);
    };
    let mut dithered = design.clone();
    dithered.thermal_run.adc_noise_lsb = 0.8;
    untouched(&record, &dithered);
    untouched(&record, &reader::read(None).unwrap());
    // A tenth of the noise.
    let (noisy, _) = taken(&design, "phase_rad", 8.0);
    untouched(&noisy, &design);
}
