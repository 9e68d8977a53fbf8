//! Rails: where the output stands still, and where it only seems to.

use super::*;
use crate::design::reader;
use crate::statistics::{blocks::Role, reml};
use crate::thermal::close::{Closed, close};
use crate::thermal::search::{Effort, Search, Term};
use crate::thermal::synthetic;
use crate::thermal::synthetic::{Random, triangle};
use crate::verdict::Fate;
use std::collections::BTreeMap;

const UPPER_DPS: f64 = 70.123;
const LOWER_DPS: f64 = -66.871;

/// A record of an output, with the rate that was applied.
fn channels(output: &[f64], rate: Option<&[f64]>) -> Channels {
    let mut columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.to_vec()),
        ("die_degc".to_owned(), triangle(output.len())),
    ]);
    if let Some(rate) = rate {
        columns.insert("rate_dps".to_owned(), rate.to_vec());
    }
    let time_s: Vec<f64> = (0..output.len()).map(|k| k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

fn of_all(c: &Channels) -> Option<Rails> {
    of(c, &vec![true; c.len()])
}

fn sine_dps(k: usize) -> f64 {
    80.0 * (0.168_3 * k as f64).sin()
}

/// A sinusoid with noise, clipped: 16 % of its rows at each side.
fn clipped(random: &mut Random, rows: usize, low: f64, high: f64) -> Vec<f64> {
    (0..rows)
        .map(|k| (sine_dps(k) + 0.3 * random.normal()).clamp(low, high))
        .collect()
}

#[test]
fn one_rail_and_both_are_found_with_outliers_beyond_them() {
    let none = f64::INFINITY;
    for seed in 0..20 {
        for (low, high) in [
            (-none, UPPER_DPS),
            (LOWER_DPS, none),
            (LOWER_DPS, UPPER_DPS),
        ] {
            for outliers in [0, 8] {
                let mut output = clipped(&mut Random::new(seed), 300, low, high);
                let stands: Vec<bool> = output.iter().map(|v| *v == low || *v == high).collect();
                let free: Vec<usize> = (0..300).filter(|k| !stands[*k]).collect();
                for k in 0..outliers {
                    let off = 90.0 + 7.0 * k as f64;
                    output[free[20 * k + 20]] = if k % 2 == 0 { off } else { -off };
                }
                // As channels have it: the rate taken off and added again, which rounds.
                let rate: Vec<f64> = (0..300).map(|k| 100.0 * sine_dps(k)).collect();
                let c = channels(&output, Some(&rate));
                let rails = of_all(&c).unwrap();
                for (found, due) in [(rails.upper_dps, high), (rails.lower_dps, low)] {
                    assert_eq!(found.is_some(), due.is_finite(), "{seed}: {rails:?}");
                    let off = found.map_or(0.0, |found| (found - due).abs());
                    assert!(off < 1e-11, "{seed}: {off}");
                }
                assert_eq!(rails.rows, stands, "{seed}, {outliers}");
                assert!(rails.p_value < 1e-20, "{seed}: {}", rails.p_value);
            }
        }
    }
}

#[test]
fn rows_that_are_not_given_or_not_measured_show_no_rail_and_may_stand_at_one() {
    let mut output = clipped(&mut Random::new(1), 300, LOWER_DPS, UPPER_DPS);
    let first = output.iter().position(|v| *v == UPPER_DPS).unwrap();
    output[first] = f64::NAN;
    let c = channels(&output, None);
    let early: Vec<bool> = (0..300).map(|k| k < 200).collect();
    let rails = of(&c, &early).unwrap();
    let stands: Vec<bool> = output
        .iter()
        .map(|v| [LOWER_DPS, UPPER_DPS].contains(v))
        .collect();
    assert!(!stands[first] && stands[200..].contains(&true));
    assert_eq!(rails.rows, stands);
    // All but those that stand.
    let moving: Vec<bool> = stands.iter().map(|s| !s).collect();
    assert_eq!(of(&c, &moving), None);
}

#[test]
fn continuous_noise_has_no_rail() {
    for seed in 0..400 {
        let mut random = Random::new(seed);
        let rows = [20, 60, 300][seed as usize % 3];
        let output: Vec<f64> = match seed % 4 {
            0 => (0..rows).map(|_| random.normal()).collect(),
            1 => (0..rows).map(|_| random.uniform()).collect(),
            2 => random.coloured(rows, 0.95),
            _ => (0..rows).map(|k| sine_dps(k) + random.normal()).collect(),
        };
        assert_eq!(of_all(&channels(&output, None)), None, "{seed}");
    }
}

#[test]
fn a_coarse_output_has_no_rail() {
    for seed in 0..400 {
        let mut random = Random::new(seed);
        let step = [0.03, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0][seed as usize % 7];
        let middle = random.uniform();
        // Noise, noise over a course, and the course of a rate.
        let course = |k: usize| match seed % 3 {
            0 => 0.0,
            1 => (k as f64 / 50.0).sin(),
            _ => 30.0 * (k as f64 / 9.0).sin(),
        };
        let output: Vec<f64> = (0..300)
            .map(|k| step * ((course(k) + random.normal()) / step + middle).round())
            .collect();
        let c = channels(&output, None);
        assert_eq!(of_all(&c), None, "{seed}: steps of {step}, {middle}");
    }
}

#[test]
fn the_ends_of_a_coarse_sinusoid_are_no_rails() {
    // The peak is at the edge of the last step, which then has 2.4 times the rows of the next.
    for peak in 10..40 {
        let peak = 0.5 + f64::from(peak);
        let output: Vec<f64> = (0..600)
            .map(|k| (peak * f64::from(k).sin()).round())
            .collect();
        assert_eq!(of_all(&channels(&output, None)), None, "{peak}");
    }
}

#[test]
fn a_rate_that_dwells_at_its_extremes_makes_no_rail() {
    for seed in 0..100 {
        let mut random = Random::new(seed);
        let step = [0.2, 1.0, 3.0][seed as usize % 3];
        let offset = 2.0 * random.uniform();
        // Up, dwell, down, dwell.
        let rate: Vec<f64> = (0..320)
            .map(|k| {
                let way = (k % 80) as f64 - 20.0;
                100.0 * (1.0 - ((way - 20.0).abs() / 10.0 - 2.0).clamp(-1.0, 1.0)) - 100.0
            })
            .collect();
        assert!(rate.iter().filter(|r| r.abs() == 100.0).count() > 100);
        let output: Vec<f64> = rate
            .iter()
            .map(|r| step * ((r + offset + 0.05 * random.normal()) / step).round())
            .collect();
        let c = channels(&output, Some(&rate));
        assert_eq!(of_all(&c), None, "{seed}: steps of {step}");
    }
}

#[test]
fn the_fewer_readings_agree_the_less_certain_is_a_rail() {
    // In steps of a tenth of the noise. As many readings as asked for are at the rail, the others are below.
    let p_value = |count: usize| {
        let mut random = Random::new(3);
        let mut output: Vec<f64> = (0..400)
            .map(|_| 0.1 * (10.0 * random.normal()).round())
            .filter(|v| *v < 1.35)
            .collect();
        output.extend(vec![1.5; count]);
        of_all(&channels(&output, None)).map(|r| r.p_value)
    };
    let sizes = [160, 145, 130, 115, 100];
    let all: Vec<f64> = sizes.iter().map(|n| p_value(*n).unwrap()).collect();
    assert!(all.windows(2).all(|w| w[0] < w[1]), "{all:?}");
    assert!(all[0] < 1e-30 && all[4] < 1e-4, "{all:?}");
    assert_eq!(p_value(6), None);
    // Where readings are as fine as the noise, three that agree are enough and two are not.
    let fine = |count: usize| {
        let mut random = Random::new(4);
        let mut output: Vec<f64> = (0..100).map(|_| random.uniform()).collect();
        output.extend(vec![1.01; count]);
        of_all(&channels(&output, None)).map(|r| r.p_value)
    };
    assert_eq!(fine(2), None);
    assert!(fine(3).unwrap() < 1e-4 && fine(4) < fine(3));
}

const ROWS: usize = 300;
const NOISE_DPS: f64 = 0.05;

/// Noise, then a hard clip; the share of the rows that it clips, and the noise of the held-out ones that it does not.
fn closed(seed: u64, (low, high): (f64, f64), supply_dps: f64) -> (Closed, f64, f64) {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let rate: Vec<f64> = (0..ROWS).map(sine_dps).collect();
    let supply: Vec<f64> = (0..ROWS)
        .map(|k| f64::from(u8::from(k / 11 % 3 == 1)))
        .collect();
    let noise: Vec<f64> = (0..ROWS).map(|_| NOISE_DPS * random.normal()).collect();
    let output: Vec<f64> = (0..ROWS)
        .map(|k| {
            let u = degc[k] / 35.0 - 1.0;
            let total = rate[k] + 2.0 - 1.5 * u + 0.7 * u * u + supply_dps * supply[k];
            (total + noise[k]).clamp(low, high)
        })
        .collect();
    let stands: Vec<bool> = output.iter().map(|v| *v == low || *v == high).collect();
    let mut record = synthetic::record("die_degc", &degc, &output);
    record.columns.insert("rate_dps".to_owned(), rate);
    record.columns.insert("supply_v".to_owned(), supply);
    let design = reader::read(None).unwrap();
    let closed = close(&record, Vec::new(), &design, "test", Effort::default()).unwrap();
    let judging = closed.split.judging();
    let held = (0..ROWS).filter(|k| judging[*k]);
    let squares: Vec<f64> = held
        .map(|k| if stands[k] { 0.0 } else { noise[k].powi(2) })
        .collect();
    let due_dps = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    let share = stands.iter().filter(|s| **s).count() as f64 / ROWS as f64;
    (closed, share, due_dps)
}

/// The clip's step with its exact levels, said to be taken; as little is left as noise makes.
fn is_told(closed: &Closed, (low, high): (f64, f64), due_dps: f64) {
    let closure = &closed.closure;
    let step = closure.steps.iter().find(|s| s.effect == EFFECT).unwrap();
    for (name, due) in [("low_dps", low), ("high_dps", high)] {
        let found = step.parameters.get(name);
        assert_eq!(found.is_some(), due.is_finite(), "{step:?}");
        assert!(found.is_none_or(|found| (found - due).abs() < 1e-12));
    }
    assert!(step.selection_frequency > 0.9, "{step:?}");
    assert!(step.p_value < 1e-4, "{step:?}");
    let told: Vec<Fate> = closure
        .evidence
        .iter()
        .filter(|e| e.effect == EFFECT)
        .map(|e| e.fate)
        .collect();
    assert_eq!(told, [Fate::Taken]);
    let left = closure.after.heldout_rms;
    assert!(left < 1.1 * due_dps, "{left} of {due_dps}");
    // Of all fitted rows: few of those that judge may stand at a rail.
    assert!(closure.before.train_rms > 10.0 * left);
}

const EFFECT: &str = "output_saturation";
const NONE: f64 = f64::INFINITY;

#[test]
fn a_hard_clip_after_the_noise_is_the_only_name_with_its_exact_levels() {
    for (seed, limits, due_share) in [
        (0, (-NONE, 76.111), 0.12),
        (1, (-54.321, NONE), 0.25),
        (2, (LOWER_DPS, UPPER_DPS), 0.35),
        (3, (-62.7, 65.3), 0.4),
    ] {
        let (closed, share, due_dps) = closed(seed, limits, 0.0);
        assert!((share - due_share).abs() < 0.04, "{seed}: {share}");
        let steps = closed.closure.steps.iter();
        let names: Vec<&str> = steps.map(|s| s.effect.as_str()).collect();
        assert_eq!(names, [EFFECT], "{seed}");
        is_told(&closed, limits, due_dps);
    }
}

#[test]
fn beside_a_hard_clip_another_effect_is_found() {
    for (seed, limits) in [(0, (-NONE, 76.111)), (1, (LOWER_DPS, UPPER_DPS))] {
        let (closed, _, due_dps) = closed(seed, limits, 0.4);
        let steps = &closed.closure.steps;
        let mut names: Vec<&str> = steps.iter().map(|s| s.effect.as_str()).collect();
        names.sort_unstable();
        assert_eq!(names, [EFFECT, "supply_sensitivity"], "{seed}");
        is_told(&closed, limits, due_dps);
    }
}

#[test]
fn without_its_clip_a_record_is_fitted_over_all_its_rows() {
    let (closed, ..) = closed(2, (LOWER_DPS, UPPER_DPS), 0.0);
    let (c, fitted) = (&closed.channels, closed.split.rows(Role::Fit));
    let search = Search::new(c, &closed.split, Effort::default(), Vec::new());
    let count = |rows: &[bool]| rows.iter().filter(|r| **r).count();
    assert_eq!(search.train, fitted);
    let stand = search.rails.as_ref().unwrap().rows.iter();
    let at_rails = stand.zip(&fitted).filter(|(s, t)| **s && **t).count();
    assert!(at_rails > 60);
    assert_eq!(count(&search.used), count(&fitted) - at_rails);
    // With every row at full weight.
    let plainly = reml::Options {
        robust: false,
        ..search.options()
    };
    let used = |terms: &[Term]| {
        let model = search.model_with(terms, &plainly).unwrap();
        model.fit.problem.line.used()
    };
    assert_eq!(used(&[]), count(&fitted));
    assert_eq!(used(&closed.after.terms), count(&search.used));
    let residual = closed.before.residual(c);
    let usual = fitted.iter().zip(&closed.accidents);
    let usual: Vec<bool> = usual.map(|(t, accident)| *t && !accident).collect();
    let rows = residual.iter().zip(&usual).filter(|(_, t)| **t);
    let square: f64 = rows.map(|(r, _)| r * r).sum();
    let due = (square / count(&usual) as f64).sqrt();
    let told = closed.closure.before.train_rms;
    assert!((told / due - 1.0).abs() < 1e-9, "{told} for {due}");
}

#[test]
fn a_level_before_the_noise_is_found_opposite_to_a_rail() {
    // A rate table: above, the word ends; below, an amplifier, whose level has the noise on it.
    let mut random = Random::new(8);
    let rate = |k: usize| [0.0, 60.0, -60.0, 100.0, -100.0, 140.0, -160.0][k / 3 % 7];
    let output: Vec<f64> = (0..210)
        .map(|k| (f64::max(rate(k) + 1.0, -120.0) + 0.02 * random.normal()).min(121.0))
        .collect();
    let rates: Vec<f64> = (0..210).map(rate).collect();
    let c = channels(&output, Some(&rates));
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    assert_eq!(search.rails.as_ref().unwrap().lower_dps, None);
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
    assert_eq!(names, ["output_saturation"]);
    let levels = &found.terms[0].point.theta;
    assert!(
        levels[0] == 121.0 && (levels[1] + 120.0).abs() < 0.01,
        "{levels:?}"
    );
    let model = search.model(&found.terms).unwrap();
    let residual = model.residual(&c);
    let worst = residual.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn noise_between_two_clips_leaves_half_of_the_clipped_readings_short_of_the_rail() {
    let mut random = Random::new(3);
    let rate = |k: usize| [0.0, 60.0, -60.0, 100.0, -100.0, 140.0, -160.0][k / 3 % 7];
    let held = |total: f64| total.clamp(-120.0, 121.0);
    let output: Vec<f64> = (0..420)
        .map(|k| held(held(rate(k) + 1.0) + 0.02 * random.normal()))
        .collect();
    let rates: Vec<f64> = (0..420).map(rate).collect();
    let c = channels(&output, Some(&rates));
    let rails = of_all(&c).unwrap();
    let beyond: Vec<bool> = rates.iter().map(|r| r.abs() > 130.0).collect();
    assert_eq!(rails.rows, beyond);
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
    assert_eq!(
        (names, found.left),
        (vec!["output_saturation".to_owned()], None)
    );
    let residual = search.model(&found.terms).unwrap().residual(&c);
    let worst = residual.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn a_bias_that_rises_to_a_clip_is_held_there_whatever_noise_comes_after_it() {
    let mut random = Random::new(8);
    let bias_dps = |k: usize| 80.0 - 0.25 * (k as f64 % 240.0 - 120.0).abs();
    let held = |total: f64| total.min(78.0);
    let output: Vec<f64> = (0..480)
        .map(|k| held(held(bias_dps(k)) + 0.3 * random.normal()))
        .collect();
    let rails = of_all(&channels(&output, None)).unwrap();
    for top in [120, 360] {
        let beyond = top - 7..=top + 7;
        assert!(beyond.clone().all(|k| bias_dps(k) > 78.0));
        let stands: Vec<usize> = beyond.filter(|k| output[*k] == 78.0).collect();
        let (first, last) = (stands[0], stands[stands.len() - 1]);
        let between = first..=last;
        assert!(between.clone().count() > stands.len() + 2, "{stands:?}");
        assert!(between.clone().all(|k| rails.rows[k]), "{stands:?}");
    }
    // No row that comes near to it only by a rare noise.
    let held = (0..480).filter(|k| rails.rows[*k]);
    let least_dps = held.map(bias_dps).fold(f64::INFINITY, f64::min);
    assert!(least_dps > 78.0 - 2.0 * NEAR * 0.3, "{least_dps}");
}

/// A rate table of an output whose upper end is hard, but in two readings, a little short of that (their means have a sample
/// within the range); its rates.
fn nearly_hard() -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(5);
    let rate = |k: usize| [0.0, 60.0, -60.0, 100.0, -100.0, 140.0, 240.0][k % 7];
    let output = (0..84).map(|k| {
        let total = rate(k) - 0.5 + 0.02 * random.normal();
        let short = match k {
            12 => 0.001,
            27 => 0.002,
            _ => 0.0,
        };
        if total > 121.0 { 121.0 - short } else { total }
    });
    (output.collect(), (0..84).map(rate).collect())
}

#[test]
fn a_reading_near_to_a_rail_is_held_there_where_the_rate_is_far_beyond_it() {
    let (output, rates) = nearly_hard();
    let c = channels(&output, Some(&rates));
    let rails = of_all(&c).unwrap();
    let beyond: Vec<bool> = rates.iter().map(|r| *r > 130.0).collect();
    assert_eq!(rails.upper_dps, Some(121.0));
    assert_eq!(rails.rows, beyond);
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let residual = search.model(&found.terms).unwrap().residual(&c);
    let worst = residual.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    assert!(worst < 0.1, "{worst}");
    // What lies a noise below, at a rate that is no more than that beyond, may have been there without the clip.
    let mut output = output;
    output[5] = 120.97;
    let mut rates = rates;
    rates[5] = 121.47;
    let c = channels(&output, Some(&rates));
    assert!(!of_all(&c).unwrap().rows[5]);
}

#[test]
fn a_level_opposite_to_a_rail_is_where_its_rows_are_whatever_wanders_beside_it() {
    // Sweeps of a rate table whose zero wanders. What wanders comes before the clip.
    for seed in 0..6 {
        let mut random = Random::new(seed);
        let sweeps = [50.0, 100.0, 200.0, 400.0].iter();
        let rates: Vec<f64> = sweeps
            .flat_map(|most| (-5..=5).map(move |k| most * f64::from(k) / 5.0))
            .collect();
        let mut zero = 0.0;
        let output = rates.iter().map(|rate| {
            zero += 0.1 * random.normal();
            let held = f64::max(rate + zero, -120.0) + 0.01 * random.normal();
            held.min(121.0)
        });
        let output: Vec<f64> = output.collect();
        let c = channels(&output, Some(&rates));
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        assert_eq!(search.rails.as_ref().unwrap().lower_dps, None);
        let model = search.beginning().unwrap();
        let levels = &model.terms[0].point.theta;
        assert!((levels[1] + 120.0).abs() < 0.02, "{seed}: {levels:?}");
    }
}

#[test]
fn an_output_that_is_stuck_but_for_two_rows_has_no_rails() {
    let mut output = vec![0.5; 202];
    (output[3], output[9]) = (0.4, 0.7);
    assert_eq!(of_all(&channels(&output, None)), None);
    // Both glitches below: nothing lies within a lower level.
    output[9] = 0.45;
    let lower_dps = of_all(&channels(&output, None)).and_then(|rails| rails.lower_dps);
    assert_eq!(lower_dps, None);
}

#[test]
fn readings_a_few_steps_beyond_a_level_deny_it_where_the_output_has_steps() {
    // A dwell at the lowest output, where a step is two thirds of the noise.
    let step = 0.01;
    let record = |beyond: f64| {
        let mut random = Random::new(3);
        let mut output: Vec<f64> = (0..240)
            .map(|k| 7.0 + 0.7 * f64::from(k) + 0.4 * random.normal())
            .collect();
        output.extend([6.5; 7]);
        output.extend([6.5 - beyond; 2]);
        output.iter().map(|v| (v / step).round() * step).collect()
    };
    let lower = |output: Vec<f64>| of_all(&channels(&output, None)).and_then(|r| r.lower_dps);
    assert!(lower(record(-step)).is_some_and(|l| (l - 6.5).abs() < 1e-9));
    assert_eq!(lower(record(2.0 * step)), None);
}

#[test]
fn a_rail_that_only_the_noise_meets_is_a_step_though_the_total_does_not_pass_it() {
    for seed in 0..4 {
        let mut random = Random::new(seed);
        // The bias is highest, a quarter of a deviation below the level, in the middle of each ramp.
        let output: Vec<f64> = triangle(800)
            .iter()
            .map(|t| 1.0 - 0.5 * (t / 35.0 - 1.0).powi(2) + 0.02 * random.normal())
            .map(|v| v.min(1.005))
            .collect();
        let c = channels(&output, None);
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let names: Vec<String> = search.run().unwrap().terms.iter().map(Term::id).collect();
        assert_eq!(names, ["output_saturation"], "{seed}");
    }
}
