//! Random plans and records for the tests, and the plan evaluated in real numbers.

use super::*;
use crate::vectors::stimulus::Lcg;

/// Uniform in -1 .. 1.
pub fn unit(lcg: &mut Lcg) -> f64 {
    (lcg.draw() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// Uniform in 0 .. n.
fn below(lcg: &mut Lcg, n: u64) -> u64 {
    (lcg.draw() >> 33) % n
}

/// About normal, unit variance (sum of twelve).
pub fn normal(lcg: &mut Lcg) -> f64 {
    (0..12).map(|_| unit(lcg) / 2.0).sum()
}

/// None to two curves of lags, from draws of their own: beside them a seed makes the terms that it made
/// before there were any.
fn curves_of_lags(seed: u64, inputs: usize, period_s: f64) -> Vec<Term> {
    let mut lcg = Lcg(seed ^ 0x001a_6ced);
    // Seeds next to each other begin with nearly the same draws.
    (0..4).for_each(|_| _ = lcg.draw());
    let count = below(&mut lcg, 3);
    let one = |_| Term::CurveOfLag {
        gain_dps: unit(&mut lcg),
        input: below(&mut lcg, inputs as u64) as usize,
        values: (0..2 + below(&mut lcg, 30))
            .map(|_| unit(&mut lcg))
            .collect(),
        tau_s: period_s * 10f64.powf(2.0 + 2.0 * unit(&mut lcg)),
        kept: unit(&mut lcg) > 0.3,
    };
    (0..count).map(one).collect()
}

/// None to two scales that bend with an input, from draws of their own, as above.
fn bent_scales(seed: u64, inputs: usize) -> Vec<Term> {
    let mut lcg = Lcg(seed ^ 0x00be_4d5c);
    (0..4).for_each(|_| _ = lcg.draw());
    let count = below(&mut lcg, 3);
    let one = |_| Term::ScaleBy {
        input: Some(below(&mut lcg, inputs as u64) as usize),
        s0: 1e-3 * unit(&mut lcg),
        s1: 1e-3 * unit(&mut lcg),
        s2: 1e-3 * unit(&mut lcg),
    };
    (0..count).map(one).collect()
}

/// True if a scale bends with an input.
pub fn bends(plan: &Plan) -> bool {
    let bent = |t: &Term| matches!(t, Term::ScaleBy { s2, .. } if *s2 != 0.0);
    plan.terms.iter().any(bent)
}

/// A random plan of `inputs` inputs; with relays only if asked.
pub fn plan(seed: u64, inputs: usize, relays: bool) -> Plan {
    let mut lcg = Lcg(seed);
    let period_s = [0.5, 1.0, 10.0, 30.0][below(&mut lcg, 4) as usize];
    let names = ["phase_rad", "agc", "supply_v", "humidity", "quad_dps"];
    let input = |k: usize| Input {
        column: names[k % names.len()].into(),
        offset: 0.25 * k as f64,
        scale: 0.5 + k as f64,
    };
    let count = 4 + below(&mut lcg, 8);
    let mut terms = vec![
        Term::Product {
            gain_dps: 100.0 * unit(&mut lcg),
            factors: vec![],
        },
        Term::Cubic {
            ppm: 300.0 * unit(&mut lcg),
            rate_max_dps: 450.0,
        },
    ];
    if inputs > 0 {
        terms.extend(curves_of_lags(seed, inputs, period_s));
        terms.extend(bent_scales(seed, inputs));
    }
    for _ in 0..count {
        let any = below(&mut lcg, inputs.max(1) as u64) as usize;
        let tau_s = period_s * 10f64.powf(2.0 + 2.0 * unit(&mut lcg));
        let knots = |lcg: &mut Lcg, n: u64| (0..n).map(|_| unit(lcg)).collect::<Vec<_>>();
        let n = 2 + below(&mut lcg, 30);
        terms.push(match below(&mut lcg, if inputs == 0 { 3 } else { 11 }) {
            0 => Term::Decay {
                gain_dps: 2.0 * unit(&mut lcg),
                tau_s,
            },
            1 => Term::Even {
                ppm: 200.0 * unit(&mut lcg),
                rate_max_dps: 500.0,
                absolute: unit(&mut lcg) > 0.0,
            },
            2 => Term::ScaleBy {
                input: None,
                s0: 1e-3 * unit(&mut lcg),
                s1: 0.0,
                s2: 0.0,
            },
            3 | 4 => Term::Product {
                gain_dps: 50.0 * unit(&mut lcg),
                factors: (0..1 + below(&mut lcg, 2))
                    .map(|k| ((any + k as usize) % inputs, 1 + below(&mut lcg, 3) as u32))
                    .collect(),
            },
            5 | 6 => Term::Lag {
                gain_dps: unit(&mut lcg),
                input: any,
                tau_s,
                kept: unit(&mut lcg) > 0.3,
            },
            7 => Term::LagOfCurve {
                gain_dps: unit(&mut lcg),
                input: any,
                values: knots(&mut lcg, n),
                tau_s,
                kept: unit(&mut lcg) > 0.3,
            },
            8 => Term::Slope {
                gain_dps_s: period_s * unit(&mut lcg),
                input: any,
                rows: 1 + below(&mut lcg, 12) as u32,
            },
            9 if relays => Term::Step {
                gain_dps: unit(&mut lcg),
                input: any,
                centre: 0.4 * unit(&mut lcg),
                gap: if unit(&mut lcg) > 0.0 { 0.2 } else { 0.0 },
                once: unit(&mut lcg) > 0.3,
            },
            9 => Term::ScaleBy {
                input: Some(any),
                s0: 1e-3 * unit(&mut lcg),
                s1: 1e-3 * unit(&mut lcg),
                s2: 0.0,
            },
            _ => Term::Curve {
                input: any,
                values_dps: knots(&mut lcg, n),
            },
        });
    }
    let mut plan = Plan {
        period_s,
        inputs: (0..inputs).map(input).collect(),
        full_scale_dps: 500.0,
        terms,
    };
    // No more of a kind than a correction takes.
    while plan.check().is_err() {
        plan.terms.pop();
    }
    plan
}

/// Readings whose inputs wander over -0.99 .. 0.99; uneven, with gaps and power-ons.
pub fn record(plan: &Plan, rows: usize, seed: u64) -> Vec<Reading> {
    let mut lcg = Lcg(seed ^ 0x5eed);
    let (mut time_s, mut on_s) = (0.0, 0.0);
    let mut x: Vec<f64> = plan.inputs.iter().map(|_| unit(&mut lcg)).collect();
    let mut readings = Vec::new();
    for row in 0..rows {
        if row > 0 {
            let gap = if below(&mut lcg, 50) == 0 { 7.0 } else { 1.0 };
            let dt_s = plan.period_s * (gap + 0.2 * unit(&mut lcg));
            time_s += dt_s;
            on_s += dt_s;
        }
        if below(&mut lcg, 400) == 0 {
            on_s = 0.0;
            time_s += 20.0 * plan.period_s * (1.0 + unit(&mut lcg));
        }
        for x in &mut x {
            *x = (*x + 0.05 * unit(&mut lcg)).clamp(-0.99, 0.99);
        }
        let values = x.iter().zip(&plan.inputs);
        readings.push(Reading {
            time_s,
            time_since_power_on_s: Some(on_s),
            inputs: values.map(|(x, i)| i.offset + i.scale * x).collect(),
            rate_out_dps: 380.0 * unit(&mut lcg),
        });
    }
    readings
}

/// The error of a term on the rate r.
fn error_on_rate(term: &Term, r: f64, x: &[f64]) -> f64 {
    match term {
        Term::ScaleBy { input, s0, s1, s2 } => {
            r * (s0 + input.map_or(0.0, |k| s1 * x[k] + s2 * x[k].powi(2)))
        }
        Term::Cubic { ppm, rate_max_dps } => ppm * 1e-6 * r * (r / rate_max_dps).powi(2),
        Term::Even {
            ppm,
            rate_max_dps,
            absolute,
        } => {
            ppm * 1e-6
                * if *absolute {
                    r.abs()
                } else {
                    r * r / rate_max_dps
                }
        }
        _ => 0.0,
    }
}

fn knot(values: &[f64], x: f64) -> f64 {
    let u = (x + 1.0) / 2.0 * (values.len() - 1) as f64;
    let k = (u.floor() as usize).min(values.len() - 2);
    values[k] + (values[k + 1] - values[k]) * (u - k as f64)
}

/// The plan in real numbers, straight from its definition, without relays, the errors on the rate taken off
/// in so many passes. Lags are sums over all
/// steps since power-on, or ever: y_n = sum of the responses to the straight pieces of the input.
pub fn evaluate(plan: &Plan, passes: usize, readings: &[Reading]) -> Vec<f64> {
    let (mut past, mut ever): (Vec<Vec<f64>>, Vec<Vec<f64>>) = Default::default();
    let mut result = Vec::new();
    for (reading, steps) in readings.iter().zip(schedule(plan, readings)) {
        if steps.restart {
            past.clear();
        }
        let of = |(value, i): (&f64, &Input)| ((value - i.offset) / i.scale).clamp(-1.0, 1.0);
        let x: Vec<f64> = reading.inputs.iter().zip(&plan.inputs).map(of).collect();
        for _ in 0..steps.unpowered {
            ever.push(x.clone());
        }
        for _ in 0..steps.count {
            past.push(x.clone());
            ever.push(x.clone());
        }
        let series = |input: usize, kept: bool| -> Vec<f64> {
            let steps = if kept { &ever } else { &past };
            steps.iter().map(|x| x[input]).collect()
        };
        let mut r = reading.rate_out_dps;
        for term in &plan.terms {
            r -= match term {
                Term::Product { gain_dps, factors } => factors
                    .iter()
                    .fold(*gain_dps, |t, (k, p)| t * x[*k].powi(*p as i32)),
                Term::Lag {
                    gain_dps,
                    input,
                    tau_s,
                    kept,
                } => gain_dps * behind(&series(*input, *kept), plan.period_s / tau_s),
                Term::LagOfCurve {
                    gain_dps,
                    input,
                    values,
                    tau_s,
                    kept,
                } => {
                    let x = series(*input, *kept);
                    let c: Vec<f64> = x.iter().map(|x| knot(values, *x)).collect();
                    gain_dps * behind(&c, plan.period_s / tau_s)
                }
                Term::CurveOfLag {
                    gain_dps,
                    input,
                    values,
                    tau_s,
                    kept,
                } => {
                    let y = x[*input] - behind(&series(*input, *kept), plan.period_s / tau_s);
                    gain_dps * (knot(values, x[*input]) - knot(values, y))
                }
                Term::Slope {
                    gain_dps_s,
                    input,
                    rows,
                } => {
                    let before = past.len().saturating_sub(1 + *rows as usize);
                    let rise = x[*input] - past[before][*input];
                    gain_dps_s * rise / (f64::from(*rows) * plan.period_s)
                }
                Term::Decay { gain_dps, tau_s } => {
                    gain_dps * (-((past.len() - 1) as f64) * plan.period_s / tau_s).exp()
                }
                Term::Curve { input, values_dps } => knot(values_dps, x[*input]),
                _ => 0.0,
            };
        }
        let measured = r;
        for _ in 0..passes {
            let held = r.clamp(-plan.full_scale_dps, plan.full_scale_dps);
            let errors = plan.terms.iter().map(|t| error_on_rate(t, held, &x));
            r = measured - errors.sum::<f64>();
        }
        result.push(r);
    }
    result
}

/// x - y after the last point of a polyline with unit steps, y a lag of 1/h steps that starts at rest:
/// each step's rise d is forgotten as d (1 - e^-h) / h e^(-h age).
fn behind(x: &[f64], h: f64) -> f64 {
    let response = -(-h).exp_m1() / h;
    let rises = x.windows(2).rev().enumerate();
    rises
        .map(|(age, w)| (w[1] - w[0]) * response * (-h * age as f64).exp())
        .sum()
}
