//! The declared bias beside an effect that acts on it.

use super::*;
use crate::closure::channels::lag;
use crate::closure::search::Effort;
use crate::closure::synthetic::{Random, triangle};
use std::collections::BTreeMap;

/// deg/s, in the thermometer scaled to -1 ..= 1.
const BIAS: [f64; 3] = [8.0, -3.0, 1.0];
const TAU_S: f64 = 300.0;
/// Of the bias, behind.
const SHARE: f64 = 0.6;

#[test]
fn the_bias_beside_a_strong_lag_is_the_true_one() {
    let mut random = Random::new(4);
    let time_s: Vec<f64> = (0..400).map(|k| 10.0 * k as f64).collect();
    let degc = [triangle(100), triangle(300)].concat();
    let bias = |degc: &f64| {
        let u = degc / 35.0 - 1.0;
        BIAS[0] + BIAS[1] * u + BIAS[2] * u * u
    };
    let now: Vec<f64> = degc.iter().map(bias).collect();
    let late = lag(&time_s, &now, TAU_S);
    let output = now.iter().zip(&late);
    let output = output.map(|(now, late)| now + SHARE * (now - late) + 0.01 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let is_it = |c: &&Arc<dyn Candidate>| c.id() == "thermal_lag";
    let candidate = search.candidates().iter().find(is_it).unwrap();
    let model = search.model(&[]).unwrap();
    let point = Point::at(0, &[TAU_S.ln()]);
    let off = |bias: &Bias| {
        let pairs = bias.coefficients_dps.iter().zip(BIAS);
        pairs.fold(0.0, |m: f64, (b, due)| m.max((b - due).abs()))
    };
    let (beside, own) = search.bias_beside(&model, candidate.as_ref(), &point);
    let (alone, found) = (off(&model.bias), off(&beside));
    assert!(
        alone > 0.1 && found < 0.1 * alone,
        "{alone} alone, {found} beside"
    );
    assert!((own[0] - SHARE).abs() < 0.05, "{own:?}");
}
