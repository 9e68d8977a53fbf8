//! What stands for channels with holes, and which way a temperature goes.

use super::channels::{Channels, filled};
use super::synthetic::Random;
use crate::statistics::blocks::Role;
use crate::statistics::smooth::{averaged, reading_noise, smoothed};
use crate::statistics::stats;
use std::collections::BTreeMap;

fn channels(time_s: &[f64], degc: Vec<f64>, on_s: Option<Vec<f64>>) -> Channels {
    let mut columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), vec![0.0; time_s.len()]),
        ("die_degc".to_owned(), degc),
    ]);
    columns.extend(on_s.map(|on_s| ("time_since_power_on_s".to_owned(), on_s)));
    Channels::new(time_s, &columns, "die_degc", |t| t).unwrap()
}

/// Power-ons after random breaks: the record's clock, time since power-on, and where each begins.
fn power_cycles(random: &mut Random) -> (Vec<f64>, Vec<f64>, Vec<usize>) {
    let (mut time_s, mut on_s, mut begins) = (Vec::new(), Vec::new(), Vec::new());
    let mut now_s = 100.0;
    for _ in 0..4 {
        now_s += 500.0 + 500.0 * random.uniform();
        begins.push(time_s.len());
        // Some records begin with the power-on, some later.
        let mut on = (20.0 * random.uniform() - 10.0).max(0.0);
        for _ in 0..10 + (20.0 * random.uniform()) as usize {
            time_s.push(now_s);
            on_s.push(on);
            let step = 1.0 + 30.0 * random.uniform();
            now_s += step;
            on += step;
        }
    }
    (time_s, on_s, begins)
}

#[test]
fn holes_in_the_time_since_power_on_are_filled_by_the_clock_of_their_own_power_on() {
    let mut random = Random::new(1);
    let rounded =
        |clock: &Vec<f64>| -> Vec<f64> { clock.iter().map(|t| (1e3 * t).round() / 1e3).collect() };
    for case in 0..200 {
        let (exact_s, truth, begins) = power_cycles(&mut random);
        // As a logger writes them.
        let time_s = rounded(&exact_s);
        let share = random.uniform();
        let truth = rounded(&truth);
        let mut holes = truth.clone();
        for value in &mut holes {
            if random.uniform() < share {
                *value = f64::NAN;
            }
        }
        // One known reading of each power-on, anywhere.
        let ends = begins[1..].iter().copied().chain([truth.len()]);
        for (from, to) in begins.iter().copied().zip(ends) {
            let k = from + ((to - from) as f64 * random.uniform()) as usize;
            holes[k] = truth[k];
        }
        let c = channels(&time_s, vec![20.0; time_s.len()], Some(holes));
        assert!(c.on_known);
        for (row, (a, b)) in c.on_s.iter().zip(&truth).enumerate() {
            assert!((a - b).abs() < 2e-3, "case {case}, row {row}: {a}, not {b}");
        }
    }
}

#[test]
fn a_power_on_that_no_reading_tells_of_goes_on_with_the_clock_before() {
    let time_s = [0.0, 10.0, 20.0, 100.0, 110.0];
    let on_s = vec![5.0, f64::NAN, 25.0, f64::NAN, f64::NAN];
    let c = channels(&time_s, vec![20.0; 5], Some(on_s));
    assert_eq!(c.on_s, [5.0, 15.0, 25.0, 105.0, 115.0]);
}

#[test]
fn a_record_without_that_clock_has_its_own() {
    let time_s = [3.0, 10.0, 20.0];
    for on_s in [None, Some(vec![f64::NAN; 3])] {
        let c = channels(&time_s, vec![20.0; 3], on_s);
        assert!(!c.on_known);
        assert_eq!(c.on_s, time_s);
    }
}

/// A course that ends `back` of its way before its far end, with a little noise of the readings.
fn course(random: &mut Random, rows: usize, back: f64, sign: f64) -> Channels {
    let bend = 0.5 + 2.0 * random.uniform();
    let turn = 1.0 / (1.0 + back);
    let degc = (0..rows).map(|k| {
        let x = k as f64 / (rows - 1) as f64;
        let way = if x <= turn {
            (x / turn).powf(bend)
        } else {
            1.0 - (x - turn) / turn
        };
        20.0 + sign * (50.0 * way + 0.02 * random.normal())
    });
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    channels(&time_s, degc.collect(), None)
}

#[test]
fn a_temperature_goes_one_way_if_it_hardly_comes_back() {
    let mut random = Random::new(2);
    for case in 0..60 {
        let rows = 60 + 40 * (case % 20);
        for sign in [1.0, -1.0] {
            assert!(
                course(&mut random, rows, 0.0, sign).goes_one_way(),
                "{rows}"
            );
            // Up by 1 and back by a fifth: 0.8 of a way of 1.2.
            assert!(
                !course(&mut random, rows, 0.2, sign).goes_one_way(),
                "{rows}"
            );
            assert!(
                !course(&mut random, rows, 1.0, sign).goes_one_way(),
                "{rows}"
            );
        }
    }
    let time_s: Vec<f64> = (0..50).map(f64::from).collect();
    assert!(!channels(&time_s, vec![20.0; 50], None).goes_one_way());
}

#[test]
fn a_hole_on_a_slope_lies_on_the_line_and_a_hole_at_a_step_on_one_of_its_sides() {
    let nan = f64::NAN;
    let time_s: Vec<f64> = (0..8).map(f64::from).collect();
    let slope = [0.0, 1.0, 2.0, nan, 4.0, 5.5, 6.0, 7.0];
    assert_eq!(filled(&time_s, &slope).unwrap()[3], 3.0);
    let switched = [0.01, 0.0, 0.02, nan, nan, 1.0, 1.01, nan];
    let whole = filled(&time_s, &switched).unwrap();
    assert_eq!((whole[3], whole[4], whole[7]), (0.02, 1.0, 1.01));
    // Noise of the size of its changes is no step.
    let noisy = [0.0, 1.0, 0.0, nan, 2.0, 0.0, 1.0, 0.0];
    assert_eq!(filled(&time_s, &noisy).unwrap()[3], 1.0);
    assert_eq!(filled(&time_s, &[nan; 8]), None);
}

#[test]
fn a_coarse_reading_has_the_noise_of_its_steps_and_a_mean_takes_away_noise_alone() {
    let mut random = Random::new(7);
    let rows = 2000;
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    let course: Vec<f64> = (0..rows).map(|k| (k as f64 / 90.0).sin()).collect();
    // Steps of an odd fraction, as a scaled reading has them: a row that stands still does so but for rounding.
    let step = 0.25 / 7.3;
    let read = |v: f64| ((v / step).round() * 0.25 + 31.7) / 7.3 - 31.7 / 7.3;
    let values: Vec<f64> = course
        .iter()
        .map(|v| read(v + 0.5 * step * random.normal()))
        .collect();
    let noise = reading_noise(&time_s, &values);
    // Half a step, and what rounding adds.
    assert!((0.4 * step..0.8 * step).contains(&noise), "{noise} {step}");
    let off = |mean: &[f64]| {
        let off: Vec<f64> = mean.iter().zip(&course).map(|(m, v)| m - v).collect();
        stats::rms(&off)
    };
    let mean = averaged(&time_s, &values);
    assert!(off(&mean) < 0.4 * off(&values), "{}", off(&mean));
    // Without noise there is nothing to take away.
    assert!(off(&averaged(&time_s, &course)) < 1e-4);
    // Nor is a dwell of three readings noise.
    let dwells: Vec<f64> = (0..rows).map(|k| course[k / 3 * 3]).collect();
    let dwells: Vec<f64> = dwells.iter().map(|v| v + 1e-5 * random.normal()).collect();
    assert_eq!(averaged(&time_s, &dwells), dwells);
}

/// Of the power-ons in the middle of a record, how many begin in held-out rows, with and without their clock.
#[test]
fn the_rows_after_a_power_on_are_fitted() {
    let rows = 450;
    let time_s: Vec<f64> = (0..rows).map(|k| 60.0 * k as f64).collect();
    let degc: Vec<f64> = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0]
        .iter()
        .flat_map(|sign| (0..rows / 6).map(move |k| sign * (k as f64 - 37.0)))
        .collect();
    let (mut held_out, mut without) = (0, 0);
    for again in (50..400).step_by(7) {
        let on_s = |k: usize| time_s[k] - if k < again { 0.0 } else { time_s[again] - 3.0 };
        let on_s = Some((0..rows).map(on_s).collect());
        let seen =
            |on_s| channels(&time_s, degc.clone(), on_s).split().unwrap().roles[again] != Role::Fit;
        held_out += usize::from(seen(on_s));
        without += usize::from(seen(None));
    }
    assert_eq!(held_out, 0);
    // The rule has something to do.
    assert!(without > 8, "{without}");
}

/// Readings at uneven times have third differences without any noise.
#[test]
fn a_ramp_read_at_uneven_times_has_no_noise_and_is_not_smoothed() {
    let mut random = Random::new(11);
    let mut at = 0.0;
    let time_s: Vec<f64> = (0..400)
        .map(|_| {
            at += [1.0, 1.0, 2.0, 8.0][(4.0 * random.uniform()) as usize % 4];
            at
        })
        .collect();
    let course: Vec<f64> = time_s.iter().map(|t| (t / 60.0).sin()).collect();
    assert!(reading_noise(&time_s, &course) < 1e-3);
    let noisy: Vec<f64> = course.iter().map(|v| v + 0.01 * random.normal()).collect();
    let noise = reading_noise(&time_s, &noisy);
    assert!((0.008..0.012).contains(&noise), "{noise}");
    let smooth = smoothed(&time_s, &course);
    let most = smooth.iter().zip(&course).map(|(s, v)| (s - v).abs());
    assert!(most.fold(0.0, f64::max) < 1e-3);
}

#[test]
fn the_output_has_no_say_in_what_is_held_out() {
    let mut random = Random::new(3);
    let time_s: Vec<f64> = (0..300).map(f64::from).collect();
    let split = |output: Vec<f64>| {
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output),
            (
                "die_degc".to_owned(),
                time_s.iter().map(|t| (t / 40.0).sin()).collect(),
            ),
            (
                "rate_dps".to_owned(),
                time_s
                    .iter()
                    .map(|t| 100.0 * (t / 17.0).sin().powi(9))
                    .collect(),
            ),
        ]);
        let channels = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        channels.split().unwrap()
    };
    let plain = split(vec![0.0; 300]);
    for _ in 0..20 {
        let noise = (0..300).map(|_| 1000.0 * random.normal()).collect();
        assert_eq!(split(noise), plain);
    }
}
