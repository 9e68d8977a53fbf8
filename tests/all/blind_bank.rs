//! The bank of blind records and its scorer, checked by themselves: `tests/all/blind`.
//!
//! `GYROGEN_BLIND_DUMP=DIR cargo test --release --test all blind_bank::dump -- --ignored` writes `GYROGEN_BLIND_COUNT` (20) records of each
//! class as CSV, with the truth beside them; `GYROGEN_SEED` (1) is the first seed.

use crate::blind::catalogue::{self, CATALOGUE};
use crate::blind::linear::{centred, deviation, least_squares, mean, rms};
use crate::blind::score::{column, oracle_residual};
use crate::blind::{BlindRecord, CLASSES, Class, Scenario, dump, make};
use gyrogen::design::RecordMapping;
use gyrogen::record::thermal;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

/// A number from the environment.
fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |v| v.parse().expect("a number"))
}

/// The records that most tests look at: 20 of each class, so that every id is planted alone twice.
fn bank() -> &'static [(String, BlindRecord)] {
    static BANK: OnceLock<Vec<(String, BlindRecord)>> = OnceLock::new();
    BANK.get_or_init(|| {
        let scenarios = dump::bank(20, number("GYROGEN_SEED", 1));
        scenarios
            .into_iter()
            .map(|(name, s)| (name, make(&s)))
            .collect()
    })
}

/// `y` without its least-squares fit, by singular values (the bank itself uses Gram-Schmidt).
fn without(columns: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    let k = least_squares(columns, y);
    let fit = |row: usize| columns.iter().zip(&k).map(|(c, k)| c[row] * k).sum::<f64>();
    (0..y.len()).map(|row| y[row] - fit(row)).collect()
}

/// {1, u, u^2} for a thermometer reading.
fn declared(p: &[f64]) -> Vec<Vec<f64>> {
    let u = centred(p);
    let square = u.iter().map(|x| x * x).collect();
    vec![vec![1.0; p.len()], u, square]
}

#[test]
#[ignore = "writes the bank into the folder GYROGEN_BLIND_DUMP"]
fn dump() {
    let folder = std::env::var("GYROGEN_BLIND_DUMP").expect("GYROGEN_BLIND_DUMP names a folder");
    let (count, seed) = (number("GYROGEN_BLIND_COUNT", 20), number("GYROGEN_SEED", 1));
    dump::write(Path::new(&folder), count, seed).expect("the folder can be written");
}

#[test]
fn equal_scenarios_give_equal_bytes_and_seeds_matter() {
    for class in CLASSES {
        let s = Scenario::drawn(class, 77);
        let (a, b) = (make(&s), make(&s));
        assert_eq!(a.csv, b.csv);
        assert_eq!(dump::truth_json(&a.truth), dump::truth_json(&b.truth));
        assert_ne!(a.csv, make(&Scenario::drawn(class, 78)).csv);
    }
}

#[test]
fn every_record_is_readable_and_plausible() {
    let mut warned: BTreeMap<String, usize> = BTreeMap::new();
    for (name, r) in bank() {
        let (record, warnings) = thermal::parse(
            r.csv.as_bytes(),
            Path::new("r.csv"),
            &RecordMapping::default(),
        )
        .unwrap_or_else(|e| panic!("{name}: {e}"));
        let thermometer = gyrogen::record::columns::THERMOMETERS
            .iter()
            .find(|t| record.measured(t) > 0);
        assert_eq!(thermometer, Some(&r.truth.thermometer), "{name}");
        assert!(record.len() >= 100, "{name}: {} rows", record.len());
        for w in warnings {
            let clipped = name.contains("saturation")
                || r.truth.planted.iter().any(|p| p.id == "output_saturation");
            let expected = match w.code {
                "repeated_times" => true,
                "time_gap" => {
                    let time_s = column(&r.csv, "time_s");
                    time_s.windows(2).any(|w| w[1] - w[0] > 60.0)
                }
                "rows_without_rate" => {
                    r.csv.contains(",nan") || r.csv.contains(",,") || r.csv.contains(",\n")
                }
                // A clipped output stands still, and so do settings that nobody changes.
                "frozen_channel" => clipped,
                // A drift as large as the rate, which happens to go with it.
                "scale_not_nominal" | "rate_sign_reversed" => {
                    deviation(&r.truth.clean_dps) > 0.3 * rms(&column(&r.csv, "rate_dps"))
                }
                _ => false,
            };
            *warned.entry(w.code.to_owned()).or_default() += 1;
            assert!(expected, "{name}: {w:?}");
        }
    }
    println!("{warned:?}");
}

#[test]
fn sizes_are_as_asked_by_another_projection() {
    for (name, r) in bank() {
        for (planted, ratio) in r.truth.planted.iter().zip(&r.truth.ratios) {
            let left = rms(&without(&declared(&r.truth.reading), &planted.contribution));
            let again = left / r.truth.short_term;
            assert!(
                (again - ratio).abs() < 1e-4 * ratio + 1e-6,
                "{name}: {again} {ratio}"
            );
            let (low, high) = match r.truth.class {
                Class::Faint => (0.5, 1.5),
                Class::Unexcited => (0.0, 0.101),
                Class::Pair | Class::Triple => (1.5, 10.0),
                _ => (1.5, 20.0),
            };
            assert!((0.9 * low..=1.1 * high).contains(ratio), "{name}: {ratio}");
        }
    }
    for id in [
        "thermal_lag",
        "output_saturation",
        "output_deadband",
        "amplitude_phase_coupling",
    ] {
        let r = make(&Scenario {
            ratio: Some(4.0),
            ..Scenario::single(id, 5)
        });
        let within = if id == "output_deadband" { 0.1 } else { 0.001 };
        assert!(
            (r.truth.ratios[0] / 4.0 - 1.0).abs() < within,
            "{id}: {:?}",
            r.truth.ratios
        );
    }
}

#[test]
fn the_output_is_rate_plus_truth_plus_noise() {
    for (name, r) in bank() {
        let t = &r.truth;
        let (out, rate) = (column(&r.csv, "rate_out_dps"), column(&r.csv, "rate_dps"));
        let mut steps = Vec::new();
        let mut last: Option<f64> = None;
        for (k, value) in out.iter().enumerate() {
            let noise = value - rate.get(k).copied().unwrap_or(0.0) - t.clean_dps[k];
            if value.is_nan() || t.outlier[k] {
                last = None;
                continue;
            }
            assert!(
                (noise - t.noise_dps[k]).abs() < 0.02 * t.short_term,
                "{name} row {k}"
            );
            steps.extend(last.map(|l| noise - l));
            last = Some(noise);
        }
        // Clipped noise is smaller; gaps in slow noise are jumps.
        let found = rms(&steps) / 2f64.sqrt() / t.short_term;
        let clips = t.planted.iter().any(|p| p.id == "output_saturation");
        let (low, high) = (
            if clips { 0.3 } else { 0.8 },
            if t.class == Class::NoiseOnly {
                1.6
            } else {
                1.2
            },
        );
        assert!((low..high).contains(&found), "{name}: {found}");
    }
}

#[test]
fn an_oracle_recovers_the_effect_and_leaves_the_noise() {
    for (name, r) in bank()
        .iter()
        .filter(|(_, r)| r.truth.class != Class::Unexcited)
    {
        let t = &r.truth;
        let (residual, k) = oracle_residual(r, |_| true);
        let rows: Vec<usize> = (0..residual.len())
            .filter(|k| residual[*k].is_finite() && !t.outlier[*k])
            .collect();
        let on = |v: &[f64]| rows.iter().map(|k| v[*k]).collect::<Vec<f64>>();
        let mut columns = declared(&on(&t.reading));
        columns.extend(t.oracle.iter().map(|c| on(c)));
        let expected = rms(&without(&columns, &on(&t.noise_dps)));
        let left = rms(&on(&residual));
        // The read noise of the thermometer is at most a tenth of the noise: half a per cent, give or take
        // its chance correlation with the noise, 0.1 / sqrt(rows).
        assert!(
            (0.98..1.025).contains(&(left / expected)),
            "{name}: {left} {expected}"
        );
        for (j, p) in t.planted.iter().enumerate() {
            let mut others = declared(&on(&t.reading));
            others.extend(
                t.oracle
                    .iter()
                    .enumerate()
                    .filter(|(i, _)| *i != j)
                    .map(|(_, c)| on(c)),
            );
            let own = rms(&without(&others, &on(&p.contribution)));
            let sigma = expected / own / (rows.len() as f64).sqrt();
            let white = t.protocol.ends_with("White");
            // Slow noise lies along slow shapes: its standard deviation grows by the root of the rows it spans.
            let wide = if white { 5.0 * sigma } else { 25.0 * sigma };
            assert!(
                (k[3 + j] - 1.0).abs() < wide + 0.01,
                "{name} {}: {} +- {sigma}",
                p.id,
                k[3 + j]
            );
        }
    }
}

#[test]
fn classes_hold_what_they_promise() {
    for (name, r) in bank() {
        let t = &r.truth;
        let header = r.csv.lines().find(|l| !l.starts_with('#')).unwrap_or("");
        let has = |column: &str| header.split(',').any(|c| c == column);
        let count = t.planted.len();
        let expected = match t.class {
            Class::None | Class::NoiseOnly => 0,
            Class::Pair => 2,
            Class::Triple => 3,
            _ => 1,
        };
        assert_eq!(count, expected, "{name}");
        for p in t.planted.iter().filter(|_| t.class != Class::HiddenChannel) {
            if let Some(e) = CATALOGUE.iter().find(|e| e.id == p.id)
                && let Some(channel) = e.channel
                && t.class != Class::Unexcited
            {
                let clock =
                    channel == "time_since_power_on_s" && t.protocol.contains("power_cycles: 1");
                let at_rest = channel == "rate_dps" && p.id == "output_saturation";
                assert!(has(channel) || clock || at_rest, "{name}: no {channel}");
            }
        }
        match t.class {
            Class::Single | Class::Faint | Class::Pair | Class::Triple => {
                let allowed =
                    |a: &(String, String, f64)| a.0 == "temperature_rate" && a.1 == "thermal_lag";
                assert!(
                    t.alternatives.iter().all(allowed),
                    "{name}: {:?}",
                    t.alternatives
                );
                assert_eq!(t.effects.len(), count);
            }
            Class::NoiseOnly => assert!(t.noise_rms > 1.3 * t.short_term, "{name}"),
            Class::HiddenChannel => {
                assert!(!has(t.hidden.expect("a hidden channel")), "{name}");
                assert!(t.effects.is_empty());
            }
            Class::Covariate => {
                let cause = t.effects[0]
                    .strip_prefix("covariate:")
                    .expect("a covariate");
                assert!(
                    has(cause) && !t.decoys.is_empty() && !t.decoys.contains(&cause),
                    "{name}"
                );
                assert!(t.decoys.iter().all(|d| has(d)), "{name}");
            }
            Class::Confounded => {
                assert!(!t.alternatives.is_empty(), "{name}");
            }
            Class::Outside => {
                assert!(
                    t.planted[0].id.starts_with("outside:") && t.effects.is_empty(),
                    "{name}"
                );
            }
            Class::Unexcited => assert!(t.ratios[0] < 0.15 && t.effects.is_empty(), "{name}"),
            Class::None => {}
        }
    }
}

#[test]
fn a_plain_search_finds_most_single_causes() {
    for class in [Class::Single, Class::Faint, Class::Covariate] {
        let (mut right, mut wrong) = (0, Vec::new());
        for (_, r) in bank().iter().filter(|(_, r)| r.truth.class == class) {
            let said = r.truth.dictionary.clone().unwrap_or_default();
            let same = |a: &(String, String, f64)| a.1 == said;
            if said == r.truth.effects[0] || r.truth.alternatives.iter().any(same) {
                right += 1;
            } else {
                wrong.push((r.truth.effects[0].clone(), said));
            }
        }
        println!(
            "{class:?}: {right} of {}, not {wrong:?}",
            right + wrong.len()
        );
        assert!(right >= 4 * wrong.len(), "{class:?} {wrong:?}");
    }
}

#[test]
fn the_bank_is_varied() {
    let mut singles = BTreeMap::new();
    let (mut rows, mut thermometers, mut chambers) =
        (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (_, r) in bank() {
        *thermometers.entry(r.truth.thermometer).or_insert(0) += 1;
        *rows.entry(r.truth.reading.len() / 150).or_insert(0) += 1;
        let kind = r
            .truth
            .protocol
            .split([',', ':'])
            .nth(1)
            .unwrap_or("")
            .trim()
            .to_owned();
        *chambers.entry(kind).or_insert(0) += 1;
        if r.truth.class == Class::Single {
            *singles.entry(r.truth.effects[0].clone()).or_insert(0) += 1;
        }
    }
    println!("{rows:?} {thermometers:?} {chambers:?}");
    assert_eq!(singles.len(), CATALOGUE.len());
    assert_eq!(thermometers.len(), 4);
    assert!(chambers.len() >= 7, "{chambers:?}");
    assert_eq!(catalogue::of("thermal_lag").id, "thermal_lag");
}

#[test]
fn outliers_are_few_and_large() {
    let touched: Vec<&BlindRecord> = bank()
        .iter()
        .map(|(_, r)| r)
        .filter(|r| r.truth.outlier.iter().any(|o| *o))
        .collect();
    assert!(touched.len() > 20);
    let mut sizes = Vec::new();
    for r in touched {
        let t = &r.truth;
        let hit = t.outlier.iter().filter(|o| **o).count() as f64 / t.outlier.len() as f64;
        assert!(hit < 0.06);
        let usual = t.noise_dps.iter().zip(&t.outlier).filter(|(_, o)| !**o);
        let largest = usual.map(|(n, _)| n.abs()).fold(0.0, f64::max);
        let hits: Vec<f64> = (0..t.outlier.len())
            .filter(|k| t.outlier[*k])
            .map(|k| t.noise_dps[k].abs())
            .collect();
        let least = 8.0 * t.short_term - 1.2 * largest;
        assert!(hits.iter().all(|n| *n > least), "{hits:?} {least}");
        sizes.extend(
            hits.iter()
                .filter(|_| t.class != Class::NoiseOnly)
                .map(|n| n / t.short_term),
        );
    }
    let typical = mean(&sizes);
    assert!((20.0..28.0).contains(&typical), "{typical}");
}
