//! Samples lost or repeated, wrong codes, stretches without a signal: with and without an effect beside them.

use super::examine::examined;
use super::synthetic_rows::{
    ROWS, WORDS, capture, clean, codes, judged, late, lose, meta, names, said, wrong,
};
use super::{analyse, clock};
use crate::record::capture_meta::CaptureMeta;
use crate::thermal::synthetic::Random;
use std::f64::consts::TAU;

#[test]
fn wrong_codes_are_left_out_and_name_nothing() {
    for (seed, word, count) in [
        (1, WORDS[0], 1),
        (2, WORDS[1], 1),
        (3, WORDS[0], 20),
        (4, WORDS[1], 300),
    ] {
        let mut codes = clean(seed, word);
        let rows = wrong(seed, &mut codes, count);
        let (capture, warnings, found) = judged(codes, meta(word));
        let left_out: Vec<usize> = (0..ROWS).filter(|r| capture.is_left_out(*r)).collect();
        assert_eq!(left_out, rows, "{seed}");
        assert_eq!(names(&found), [""; 0], "{seed}");
        assert_eq!(said(&warnings), ["outliers"], "{seed}");
        assert!(
            warnings[0]
                .message
                .starts_with(&format!("{count} of {ROWS} rows"))
        );
        assert!(
            found.before.heldout_rms < 1.1 && found.before.heldout_max_abs < 7.0,
            "{seed}"
        );
    }
}

#[test]
fn effects_are_found_beside_wrong_codes() {
    for seed in 1..4 {
        let word = WORDS[seed as usize % 2];
        let clipped = codes(seed, word, |_, _, x| x.min(1400.0));
        let missing = clean(seed, word).map(|c| {
            let moved = |code: i32| {
                if code.rem_euclid(16) == 3 {
                    code + 1
                } else {
                    code
                }
            };
            c.into_iter().map(moved).collect::<Vec<i32>>()
        });
        let jittered = late(seed, word, 0.05, |_, _, x| x);
        let bent = codes(seed, word, |c, _, x| {
            if c == 0 {
                x + 4.0 * (x / 1500.0).powi(3)
            } else {
                x
            }
        });
        let all = [
            (clipped, "adc_clipping"),
            (missing, "adc_missing_codes"),
            (jittered, "aperture_jitter"),
            (bent, "adc_integral_nonlinearity"),
        ];
        for (mut codes, effect) in all {
            let untouched = examined(capture(codes.clone(), meta(word))).unwrap().0;
            assert_eq!(
                untouched.used_rows(),
                ROWS,
                "{seed} {effect}: no effect makes wrong codes"
            );
            let rows = wrong(seed, &mut codes, 4);
            let (capture, _, found) = judged(codes, meta(word));
            assert!(
                rows.iter().all(|r| capture.is_left_out(*r)),
                "{seed} {effect}"
            );
            assert_eq!(names(&found).first(), Some(&effect), "{seed}");
        }
    }
}

#[test]
fn lost_samples_are_counted_and_the_rows_after_them_judged_at_their_time() {
    for seed in 1..4 {
        for word in WORDS {
            let cuts = [(5000 + 7 * seed as usize, 3), (11_000, 40)];
            let (capture, warnings, found) = judged(lose(clean(seed, word), &cuts), meta(word));
            assert_eq!(said(&warnings), ["sample_clock_broken"], "{seed}");
            assert_eq!(capture.rows(), ROWS);
            assert_eq!(capture.used_rows(), ROWS - 43);
            for (row, lost) in [(cuts[0].0, 3), (11_000 - 3, 40)] {
                // One row more or less has nearly the same phase.
                let near = (row - 1..=row + 1).any(|row| {
                    let told = format!("at row {row}: {lost} samples lost");
                    warnings[0].message.contains(&told)
                });
                assert!(near, "{seed} {row}: {}", warnings[0].message);
            }
            assert_eq!(names(&found), [""; 0], "{seed}");
        }
    }
}

#[test]
fn samples_that_came_twice_are_taken_away() {
    for (seed, word, count) in [(1, WORDS[0], 30), (2, WORDS[1], 1000), (3, WORDS[0], 300)] {
        let twice = clean(seed, word).map(|c| [&c[..8000], &c[8000 - count..]].concat());
        let (capture, warnings, found) = judged(twice, meta(word));
        let told = format!("{count} samples came twice");
        assert!(
            warnings[0].message.contains(&told),
            "{}",
            warnings[0].message
        );
        assert_eq!(capture.rows(), ROWS, "{seed}");
        assert_eq!(names(&found), [""; 0], "{seed}");
    }
}

#[test]
fn breaks_close_together_or_at_the_ends_name_nothing() {
    for seed in 1..3 {
        for word in WORDS {
            let every: Vec<(usize, usize)> = (1..16).map(|k| (1000 * k + 37, 1)).collect();
            for cuts in [
                &[(7000, 3), (7400, 4)][..],
                &[(100, 5)],
                &[(16_300, 5)],
                &every,
            ] {
                let (_, warnings, found) = judged(lose(clean(seed, word), cuts), meta(word));
                assert!(!warnings.is_empty(), "{seed} {cuts:?}");
                assert_eq!(names(&found), [""; 0], "{seed} {cuts:?} {warnings:?}");
            }
        }
    }
}

#[test]
fn an_effect_is_found_beside_lost_samples() {
    for seed in 1..4 {
        let word = WORDS[seed as usize % 2];
        let offset = codes(seed, word, |c, _, x| if c == 0 { x + 4.0 } else { x });
        let (_, warnings, found) = judged(lose(offset, &[(7000, 5)]), meta(word));
        assert_eq!(said(&warnings), ["sample_clock_broken"]);
        assert_eq!(names(&found), ["adc_offset"], "{seed}");
    }
}

#[test]
fn a_step_of_half_a_sample_ends_what_is_judged() {
    for seed in 1..4 {
        let word = WORDS[1];
        let half = 0.5 * f64::from(word) / 4_294_967_296.0;
        let mut random = Random::new(seed);
        let mut made = [Vec::new(), Vec::new()];
        for row in 0..ROWS {
            let turns = f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
            let angle = TAU * (turns + if row < 9000 { 0.0 } else { half });
            made[0].push((-1500.0 * angle.cos() + random.normal()).round() as i32);
            made[1].push((300.0 * (angle + 0.3).sin() + random.normal()).round() as i32);
        }
        let tone = super::tone::Tone::of(&capture(made.clone(), meta(word))).unwrap();
        let retimed = clock::retimed(capture(made.clone(), meta(word)), &tone);
        let [one] = retimed.breaks.as_slice() else {
            panic!("{:?}", retimed.breaks)
        };
        assert!(
            one.samples.is_none() && one.row.abs_diff(9000) < 4,
            "{one:?}"
        );
        let (capture, warnings, found) = judged(made, meta(word));
        assert!(warnings[0].message.contains("no whole number of samples"));
        assert!(capture.rows().abs_diff(9000) < 4);
        assert_eq!(names(&found), [""; 0], "{seed}");
    }
}

#[test]
fn rows_that_are_all_there_twice_count_once() {
    for seed in 1..4 {
        let twice = clean(seed, WORDS[0]).map(|c| c.iter().flat_map(|v| [*v, *v]).collect());
        let (capture, warnings, found) = judged(twice, meta(WORDS[0]));
        assert_eq!(
            (said(&warnings), capture.rows()),
            (vec!["rows_repeated"], ROWS)
        );
        assert_eq!(names(&found), [""; 0], "{seed}");
        // An ADC that holds each sample: the tone has its frequency with the copies there.
        let held = clean(seed, WORDS[0]).map(|c| (0..ROWS).map(|k| c[k - k % 2]).collect());
        let (capture, warnings, found) = judged(held, meta(WORDS[0]));
        assert_eq!(said(&warnings), ["rows_repeated"]);
        assert_eq!((capture.rows(), capture.used_rows()), (ROWS, ROWS / 2));
        assert_eq!(names(&found), [""; 0], "{seed}");
    }
}

#[test]
fn a_stretch_at_one_code_is_left_out() {
    for (seed, from, to) in [(1, 8000, ROWS), (2, 3000, 5000), (3, 0, 700)] {
        let mut stuck = clean(seed, WORDS[1]);
        let code = stuck[0][from];
        stuck[0][from..to].fill(code);
        let (capture, warnings, found) = judged(stuck, meta(WORDS[1]));
        assert_eq!(said(&warnings), ["frozen"], "{seed}");
        assert!(
            capture.used_rows().abs_diff(ROWS - (to - from)) < 3,
            "{seed}"
        );
        assert_eq!(names(&found), [""; 0], "{seed}");
    }
}

#[test]
fn without_a_tuning_word_the_tone_is_found_as_it_is() {
    for seed in 1..5 {
        let word = [WORDS[1], 0x0734_aa79, 0x0523_4567][seed as usize % 3];
        let unknown = CaptureMeta {
            ftw: None,
            ..meta(word)
        };
        let (_, warnings, found) = judged(clean(seed, word), unknown.clone());
        assert_eq!((said(&warnings), names(&found)), (vec![], vec![]), "{seed}");
        let lost = lose(clean(seed, word), &[(7000, 5)]);
        let (_, warnings, found) = judged(lost, unknown);
        assert!(
            warnings[0].message.contains("5 samples lost"),
            "{}",
            warnings[0].message
        );
        assert_eq!(names(&found), [""; 0], "{seed}");
    }
}

#[test]
fn steps_help_held_out_rows_and_are_no_chance_whatever_the_codes_are() {
    for seed in 1..9 {
        // As they are, as if nobody had looked at the rows before.
        let mut codes = clean(seed, WORDS[seed as usize % 2]).map(|c| c[..1200].to_vec());
        let row = 50 + 140 * seed as usize;
        codes[1][row] += if seed % 3 == 0 { 500 } else { -40 };
        let found = analyse(&capture(codes, meta(WORDS[seed as usize % 2]))).unwrap();
        for step in &found.steps {
            assert!(
                step.p_value <= 0.01,
                "{seed}: {} {}",
                step.effect,
                step.p_value
            );
        }
        let word = WORDS[seed as usize % 2];
        let lost = lose(clean(seed, word), &[(3000 + 500 * seed as usize, 1)]);
        let noise = analyse(&capture(lost, meta(word))).unwrap();
        for found in [&found, &noise] {
            let (before, after) = (found.before.heldout_rms, found.after.heldout_rms);
            assert!(
                after <= before,
                "{seed}: {:?} {before} {after}",
                names(found)
            );
        }
    }
}

#[test]
fn one_slow_line_is_one_line() {
    for (seed, hz) in [(1, 100.0), (2, 150.0), (3, 120.0), (4, 50.0), (5, 180.0)] {
        let line = |row: usize| 15.0 * (TAU * hz * row as f64 / 200e3 + seed as f64).sin();
        let made = codes(
            seed,
            WORDS[1],
            |c, row, x| if c == 1 { x + line(row) } else { x },
        );
        let (_, _, found) = judged(made, meta(WORDS[1]));
        assert_eq!(names(&found), ["mains_pickup"], "{hz}");
        let told: Vec<f64> = found.lines.iter().map(|l| l.0 * 200e3).collect();
        assert!(
            told.len() == 1 && (told[0] - hz).abs() < 0.5,
            "{hz}: {told:?}"
        );
    }
}

#[test]
fn samples_lost_in_the_first_rows_are_counted() {
    for seed in 1..5 {
        let word = WORDS[seed as usize % 2];
        let row = 60 + 40 * seed as usize;
        let (capture, warnings, found) = judged(lose(clean(seed, word), &[(row, 5)]), meta(word));
        assert_eq!(said(&warnings), ["sample_clock_broken"], "{seed}");
        let message = &warnings[0].message;
        assert!(message.contains("5 samples lost"), "{seed} {message}");
        assert_eq!(capture.rows(), ROWS, "{seed}");
        assert_eq!(names(&found), [""; 0], "{seed}");
    }
}

#[test]
fn the_phases_of_a_short_table_are_no_break() {
    // Words near a ratio of small numbers: the truncated tone differs from block to block.
    for (word, bits) in [
        (1_742_787_059u32, 5),
        (1_742_787_059, 4),
        (1_288_490_205, 5),
    ] {
        for seed in 1..4 {
            let steps = f64::powi(2.0, bits);
            let short = codes(seed, word, |c, row, x| {
                let turns = f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
                let signal = |turns: f64| match c {
                    0 => -1500.0 * (TAU * turns).cos(),
                    _ => 300.0 * (TAU * turns + 0.3).sin() + 90.0 * (TAU * turns + 0.3).cos(),
                };
                x + signal((turns * steps).floor() / steps) - signal(turns)
            });
            let (_, warnings) = examined(capture(short, meta(word))).unwrap();
            assert_eq!(said(&warnings), [""; 0], "{word} {bits} {seed}");
        }
    }
}
