//! Random instants beside the quantiser's steps.

use super::super::synthetic_rows::{WORDS, judged, late, meta, names};
use super::*;
use crate::record::capture_meta::CaptureMeta;
use crate::thermal::synthetic::Random;
use std::f64::consts::TAU;

#[test]
fn random_instants_take_their_part_of_both_declared_tones() {
    // 0.22 rad rms: 2.3 per cent of the rate's 300 codes.
    let codes = late(3, WORDS[1], 4.0, |_, _, x| x);
    let found = judged(codes, meta(WORDS[1])).2;
    assert_eq!(names(&found), ["aperture_jitter"]);
}

#[test]
fn steps_that_a_line_moves_are_no_random_instants() {
    // Noise too small to hide the quantiser's steps, and a modulated phase that moves the steep rows by a code.
    let word = 108_867_417u32;
    let mut random = Random::new(4);
    let mut codes = [Vec::new(), Vec::new()];
    for row in 0..5000u32 {
        let phase = TAU * f64::from(word.wrapping_mul(row)) / 4_294_967_296.0;
        let angle = phase + 9e-5 * (512.0 * phase + 2.0).sin();
        let sense = 5000.0 * (angle - 1.9).sin() + 500.0 * (angle - 1.9).cos();
        for (codes, x) in codes.iter_mut().zip([-11_160.0 * angle.cos(), sense]) {
            codes.push((x + 0.11 * random.normal() + 0.5).floor() as i32);
        }
    }
    let meta = CaptureMeta {
        adc_bits: Some(16),
        drive_amplitude_codes: Some(11_160.0),
        sense_codes_per_dps: None,
        rate_dps: None,
        ..meta(word)
    };
    assert_eq!(names(&judged(codes, meta).2), ["nco_spur"]);
}

#[test]
fn random_instants_hold_where_the_steps_were_found_without_them() {
    // Noise after rounding hides no step, and an instant moves the steepest rows by a third of a code.
    let word = 0x0f6a_7c57u32;
    for seed in 2..9 {
        let mut random = Random::new(seed);
        let mut codes = [Vec::new(), Vec::new()];
        for row in 0..20_000u32 {
            let phase = TAU * f64::from(word.wrapping_mul(row)) / 4_294_967_296.0;
            let angle = phase + TAU * 2.5e-4 * random.normal();
            let sense = 61.7 * angle.sin() + 20.2 * angle.cos();
            for (codes, x) in codes.iter_mut().zip([-182.7 * angle.cos(), sense]) {
                codes.push((x + 0.5).floor() as i32 + (0.2 * random.normal()).round() as i32);
            }
        }
        let meta = CaptureMeta {
            adc_bits: Some(9),
            drive_amplitude_codes: Some(182.7),
            sense_codes_per_dps: None,
            rate_dps: None,
            ..meta(word)
        };
        let found = judged(codes, meta).2;
        assert_eq!(names(&found), ["aperture_jitter"], "{seed}");
    }
}

#[test]
fn what_is_left_of_a_tone_is_exact_for_large_instants() {
    let tone = Tone {
        word: None,
        turns: 0.1,
        offset_turns: 0.0,
    };
    // Variance of the phase 0.4: a mean tone of e^-0.2, and 1 - e^-0.4 of its slope squared.
    let jitter = (1.0 - (-0.4f64).exp()) / tone.angle().powi(2);
    assert!((left_by(jitter, &tone) - (-0.2f64).exp()).abs() < 1e-12);
}
