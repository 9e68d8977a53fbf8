//! What each row is for.

use super::*;

/// The share of the rows that are not fitted, in how many blocks, and the split.
fn shares(thermometer: &[f64]) -> (f64, usize, Split) {
    let times: Vec<f64> = (0..thermometer.len()).map(|i| i as f64).collect();
    let split = split(&times, thermometer, &[]).unwrap();
    let taken = taken(&split);
    let starts = taken.windows(2).filter(|w| !w[0] && w[1]).count();
    (share_of(&taken), starts, split)
}

fn taken(split: &Split) -> Vec<bool> {
    split.roles.iter().map(|r| *r != Role::Fit).collect()
}

fn share_of(rows: &[bool]) -> f64 {
    rows.iter().filter(|r| **r).count() as f64 / rows.len() as f64
}

#[test]
fn shares_blocks_ends_and_coverage() {
    for n in [45usize, 150, 301, 2000] {
        for cycles in [0.0, 0.5, 1.0, 3.0, 8.0, 20.0] {
            let t: Vec<f64> = (0..n)
                .map(|i| -(std::f64::consts::TAU * cycles * i as f64 / n as f64).cos())
                .collect();
            let (share, blocks, split) = shares(&t);
            let what = format!("{n} rows, {cycles} cycles: {share} in {blocks}");
            assert!((0.2..0.34).contains(&share), "{what}");
            assert!(blocks >= 4, "{what}");
            let ends = [split.roles[0], split.roles[n - 1]];
            assert_eq!(ends, [Role::Fit; 2], "{what}");
            // A single ramp passes each temperature once: there rows that are taken are gaps.
            let open = left_open(&t, &directions(&t), &taken(&split));
            // Four segments of 50 / 15 bins, of 50 / 7.5 on one way of a single cycle, wider in its middle.
            let most = if cycles < 1.0 { 150.0 } else { 60.0 };
            assert!(open < most, "{what}: {open}");
            let judge = share_of(&split.rows(Role::Judge));
            let due = match n {
                0..JUDGED => 0.0..0.001,
                JUDGED..200 => 0.07..0.14,
                // Of runs of seven rows three judge.
                _ => 0.04..0.12,
            };
            assert!(due.contains(&judge), "{what}: {judge} judge");
            let errors_of = if n < JUDGED { share } else { judge };
            assert_eq!(share_of(&split.judging()), errors_of, "{what}");
        }
    }
    assert!(super::split(&[0.0; 10], &[0.0; 10], &[]).is_err());
}

#[test]
fn what_is_passed_once_on_a_way_is_not_held_out_as_a_whole() {
    // One slow cycle with dwells; a thermometer with noise of a hundredth of its range.
    for (n, seed) in [(300usize, 1u64), (1000, 2), (4000, 3)] {
        let mut random = crate::thermal::synthetic::Random::new(seed);
        let course = |x: f64| (1.4 * (1.0 - (4.0 * x - 2.0).abs())).clamp(-1.0, 1.0);
        let clean: Vec<f64> = (0..n).map(|i| course(i as f64 / n as f64)).collect();
        let noisy: Vec<f64> = clean.iter().map(|t| t + 0.02 * random.normal()).collect();
        let (share, blocks, split) = shares(&noisy);
        assert!(
            (0.2..0.34).contains(&share) && blocks >= 7,
            "{n}: {share} in {blocks}"
        );
        let rising: Vec<bool> = (0..n).map(|i| 2 * i < n).collect();
        let open = left_open(&clean, &rising, &taken(&split));
        // Each of eight blocks is a thirtieth of the record, 3.6 bins on its way where it moves.
        assert!(open < 45.0, "{n}: {open}");
        let said = directions(&noisy);
        let wrong = said.iter().zip(&rising).filter(|(a, b)| a != b).count();
        assert!(wrong < n / 6, "{n}: {wrong}");
    }
}

#[test]
fn a_rate_s_outermost_readings_are_fitted() {
    // Three slow cycles of temperature; the highest rate in one of the 15 spans alone.
    let n = 450;
    let times: Vec<f64> = (0..n).map(f64::from).collect();
    let t: Vec<f64> = times.iter().map(|t| (t / 24.0).sin()).collect();
    for highest in 0..15 {
        let rate = |i: i32| match i / 30 == highest {
            true => 100.0,
            false => f64::from(i % 7),
        };
        let rates: Vec<f64> = (0..n).map(rate).collect();
        let split = super::split(&times, &t, &[&rates]).unwrap();
        assert_eq!(split.roles[30 * highest as usize], Role::Fit, "{highest}");
    }
    let blind = super::split(&times, &t, &[]).unwrap();
    assert!((0..15).any(|s| blind.roles[30 * s] == Role::Choose));
}

#[test]
fn where_the_temperature_has_no_say_four_of_fifteen_are_taken() {
    for n in [60, 900] {
        let (_, blocks, split) = shares(&vec![25.0; n]);
        assert_eq!(blocks, 4, "{n}");
        // Each begins with rows that choose and ends with rows that judge.
        for w in split.roles.windows(2) {
            let is_next = match w[0] {
                Role::Fit => w[1] != Role::Judge,
                Role::Choose => w[1] != Role::Fit,
                Role::Judge => w[1] != Role::Choose,
            };
            assert!(is_next, "{n}: {w:?}");
        }
        let judging = split.rows(Role::Judge).iter().filter(|j| **j).count();
        assert_eq!(judging, if n == 60 { 8 } else { 60 }, "{n}");
    }
}

#[test]
fn runs_are_cut_at_turning_points_and_fitted_as_a_whole_or_not_at_all() {
    // Sixteen ramps of 25 rows, with a ripple below the threshold.
    let t: Vec<f64> = (0..400)
        .map(|i| {
            let (run, at) = (i / 25, f64::from(i % 25));
            let ramp = if run % 2 == 0 { at } else { 24.0 - at };
            ramp + 0.5 * f64::from(i % 3)
        })
        .collect();
    let (_, _, split) = shares(&t);
    assert_eq!(split.segment.last(), Some(&15));
    for (i, s) in split.segment.iter().enumerate() {
        assert!(
            (i as i64 / 25 - *s as i64).abs() <= 1 && (i + 3) / 25 >= *s,
            "{i} {s}"
        );
    }
    for i in 1..400 {
        if split.segment[i] == split.segment[i - 1] {
            let fitted = [i - 1, i].map(|i| split.roles[i] == Role::Fit);
            assert_eq!(fitted[0], fitted[1], "{i}");
        }
    }
}
