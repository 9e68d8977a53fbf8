//! Effects of the structure's temperature itself.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, entry, gain, heated, map,
};
use crate::correction::Term;
use crate::thermal::channels::Channels;
use crate::thermal::firmware::{Words, knots};

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![Box::new(ThirdOrder), Box::new(ModeCrossing)]
}

/// Third order of the thermometer.
struct ThirdOrder;

const THIRD_ORDER: Sheet = Sheet {
    id: "bias_third_order",
    physics: "the bias bends more than eq. 9 says: Q, the modes' split and the phase bend together",
    equation: "c3 u^3, u the thermometer's reading scaled to -1..1; a bend that is not quite of third order has l4 P4(u) + l5 P5(u) \
               with it (Legendre's polynomials), less than half of it",
    parameters: &[
        Parameter {
            name: "c3_dps",
            plausible: (0.01, 30.0),
        },
        Parameter {
            name: "l4_dps",
            plausible: (0.001, 5.0),
        },
        Parameter {
            name: "l5_dps",
            plausible: (0.001, 5.0),
        },
    ],
    compensable: true,
    confounders: &["damping_bias", "demod_phase_drift", "mode_crossing"],
    experiment: "record the drive gain and the quadrature: a Q or quadrature that moves with \
                 temperature shows in its own channel",
    reference: "Sensors 9 (2009) 8349 (piecewise and higher orders)",
};

/// The form with higher orders, and the most that these are of the third, rms over an evenly filled range.
const BENT: usize = 1;
const MOST_HIGHER: f64 = 0.5;

/// Legendre's polynomials of fourth and fifth order: each is apart from all lower orders.
fn higher_orders(u: f64) -> [f64; 2] {
    let v = u * u;
    [
        ((35.0 * v - 30.0) * v + 3.0) / 8.0,
        ((63.0 * v - 70.0) * v + 15.0) * u / 8.0,
    ]
}

impl Candidate for ThirdOrder {
    fn sheet(&self) -> &Sheet {
        &THIRD_ORDER
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let (higher, names) = match point.form {
            BENT => (
                " + l4 P4(u) + l5 P5(u)",
                ", P4 and P5 Legendre's polynomials",
            ),
            _ => ("", ""),
        };
        format!("c3 u^3{higher}, u the thermometer's reading scaled to -1..1{names}")
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec![heated(c)?])
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        vec![Point::form(0)]
    }

    fn beside(&self, _c: &Channels, _point: &Point) -> Vec<Point> {
        vec![Point::form(BENT)]
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let mut columns = vec![map(&c.u, |u| u * u * u)];
        if point.form == BENT {
            columns.extend((0..2).map(|k| map(&c.u, |u| higher_orders(u)[k])));
        }
        columns
    }

    fn admits(&self, _c: &Channels, _point: &Point, beta: &[f64]) -> bool {
        let [c3, l4, l5] = *beta else { return true };
        // u^3 is 2/5 P3 and lower orders; the mean square of Pn is 1 / (2 n + 1).
        let third = 0.4 * c3;
        l4 * l4 / 9.0 + l5 * l5 / 11.0 <= MOST_HIGHER.powi(2) * third * third / 7.0
    }

    fn correction(&self, _c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let input = f.thermometer()?;
        Some(vec![match e.beta.as_slice() {
            [c3, l4, l5] => {
                let bend = |u: f64| {
                    let [p4, p5] = higher_orders(u);
                    c3 * u * u * u + l4 * p4 + l5 * p5
                };
                // Linear interpolation between so many knots is a thousandth off.
                Term::Curve {
                    input,
                    values_dps: knots(129).map(bend).collect(),
                }
            }
            beta => Term::Product {
                gain_dps: *beta.first()?,
                factors: vec![(input, 3)],
            },
        }])
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let mut out: Reported = [
            gain("c3_dps", e, 0, 1.0),
            entry("u_zero", c.centre, 0.0),
            entry("u_one", c.centre + c.half, 0.0),
        ]
        .into_iter()
        .collect();
        if e.point.form == BENT {
            out.extend([gain("l4_dps", e, 1, 1.0), gain("l5_dps", e, 2, 1.0)]);
        }
        out
    }
}

/// A parasitic mode crosses the drive's frequency.
struct ModeCrossing;

const MODE_CROSSING: Sheet = Sheet {
    id: "mode_crossing",
    physics: "at one temperature a parasitic mode has the drive's frequency and takes energy from \
              it: a bump, or a swing to both sides, in temperature",
    equation: "(a + d 2 x) / (1 + x^2); x = (T - center) / half width, a absorptive, d dispersive",
    parameters: &[
        Parameter {
            name: "center_degc",
            plausible: (-40.0, 125.0),
        },
        Parameter {
            name: "half_width_k",
            plausible: (0.3, 15.0),
        },
        Parameter {
            name: "absorptive_dps",
            plausible: (0.01, 20.0),
        },
        Parameter {
            name: "dispersive_dps",
            plausible: (0.01, 20.0),
        },
    ],
    compensable: true,
    confounders: &["bias_third_order", "stress_jump"],
    experiment: "a slow sweep through the crossing in both directions: a crossing repeats at the \
                 same temperature; a different drive amplitude or frequency moves it",
    reference: "mode coupling in vibratory gyroscopes; general knowledge",
};

/// Widths of crossings that are tried, in u.
const WIDTHS: [f64; 5] = [0.03, 0.06, 0.12, 0.22, 0.4];

/// The widest crossing, in u: of a wider one the record (-1..1) does not show both flanks, and what fits is any bend.
const WIDEST: f64 = 0.6;

/// From which width on a crossing is more like a bend of the whole characteristic, and the odds against it for each e-fold.
const WIDE: f64 = 0.35;
const UNUSUAL: f64 = 12.0;

/// A resonance by its parts, one that is blurred, and the magnitude of one.
const FORMS: usize = 3;

/// The shapes of a form, x in half widths from the centre.
fn shapes(form: usize) -> &'static [fn(f64) -> f64] {
    match form {
        0 => &[|x| 1.0 / (1.0 + x * x), |x| 2.0 * x / (1.0 + x * x)],
        1 => &[|x| (-0.5 * x * x).exp()],
        _ => &[|x| 1.0 / (1.0 + x * x).sqrt()],
    }
}

/// The narrowest crossing in steps of a coarse thermometer: within a step nothing is known of the temperature, least where it
/// turns.
const STEPS: f64 = 2.0;

/// Centre and half width of a crossing, in u: within the record, and such that its thermometer shows it.
fn crossing(c: &Channels, point: &Point) -> (f64, f64) {
    let (centre, width) = (point.theta[0], point.theta[1].exp());
    let narrowest = (STEPS * c.step_u).min(WIDEST);
    (centre.clamp(-1.0, 1.0), width.clamp(narrowest, WIDEST))
}

impl Candidate for ModeCrossing {
    fn sheet(&self) -> &Sheet {
        &MODE_CROSSING
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let x = "x = (T - center) / half width, a absorptive";
        match point.form {
            0 => MODE_CROSSING.equation.to_owned(),
            1 => format!(
                "a exp(-x^2 / 2), a crossing that is blurred (several modes, a gradient over the die); {x}"
            ),
            _ => format!("a / sqrt(1 + x^2), the other mode's amplitude acts; {x}"),
        }
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec![heated(c)?])
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        let mut out = Vec::new();
        for width in WIDTHS {
            let count = (1.4 / width).clamp(8.0, 24.0) as usize;
            for k in 0..count {
                let centre = -0.85 + 1.7 * k as f64 / (count - 1) as f64;
                out.extend((0..FORMS).map(|form| Point::at(form, &[centre, width.ln()])));
            }
        }
        out
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let (centre, width) = crossing(c, point);
        let shapes = shapes(point.form).iter();
        shapes
            .map(|shape| map(&c.u, |u| shape((u - centre) / width)))
            .collect()
    }

    fn spacing(&self, c: &Channels, point: &Point) -> Vec<f64> {
        vec![crossing(c, point).1, 0.5]
    }

    fn odds_against(&self, c: &Channels, point: &Point) -> f64 {
        UNUSUAL * (crossing(c, point).1 / WIDE).ln().max(0.0)
    }

    fn is_local(&self) -> bool {
        true
    }

    fn fine(&self, _c: &Channels, _point: &Point, _seen: &[bool]) -> Vec<Point> {
        let mut out = Vec::new();
        for k in 0..10 {
            let width = 0.02 * 1.45f64.powi(k);
            for j in 0..30 {
                let theta = [-0.9 + 1.8 * f64::from(j) / 29.0, width.ln()];
                out.extend((0..FORMS).map(|form| Point::at(form, &theta)));
            }
        }
        out
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let (centre, width) = crossing(c, &e.point);
        let shape = |u: f64| -> f64 {
            let x = (u - centre) / width;
            let pairs = shapes(e.point.form).iter().zip(&e.beta);
            pairs.map(|(shape, b)| b * shape(x)).sum()
        };
        // Sixteen knots over a half width keep the linear interpolation a thousandth off.
        let count = (32.0 / width).clamp(65.0, 1025.0) as usize;
        Some(vec![Term::Curve {
            input: f.thermometer()?,
            values_dps: knots(count).map(shape).collect(),
        }])
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let k = c.kelvin_per_u;
        let std = |i: usize| e.theta_std.get(i).copied().unwrap_or(0.0);
        let (centre, width) = crossing(c, &e.point);
        let mut out: Reported = [
            entry(
                "center_degc",
                c.middle_degc + k * centre,
                (k * std(0)).abs(),
            ),
            entry(
                "half_width_k",
                (k * width).abs(),
                (k * width * std(1)).abs(),
            ),
            gain("absorptive_dps", e, 0, 1.0),
        ]
        .into_iter()
        .collect();
        if shapes(e.point.form).len() > 1 {
            out.extend([gain("dispersive_dps", e, 1, k.signum())]);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::search::{Effort, Search};
    use crate::thermal::synthetic::{Random, triangle};
    use std::collections::BTreeMap;
    #[test]
    fn a_crossing_lies_within_the_record() {
        let degc = triangle(100);
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), vec![0.0; 100]),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let mut c = Channels::new(&degc, &columns, "die_degc", |t| t).unwrap();
        for (theta, step_u, expected) in [
            ([0.3, f64::ln(0.1)], 0.0, (0.3, 0.1)),
            ([-7.0, f64::ln(40.0)], 0.0, (-1.0, WIDEST)),
            ([0.3, f64::ln(0.1)], 0.07, (0.3, 0.14)),
            ([0.3, f64::ln(0.1)], 2.0, (0.3, WIDEST)),
        ] {
            c.step_u = step_u;
            let (centre, width) = crossing(&c, &Point::at(0, &theta));
            assert!((centre - expected.0).abs() < 1e-12 && (width - expected.1).abs() < 1e-12);
        }
    }

    #[test]
    fn a_bump_of_either_shape_is_a_crossing_with_its_own_width() {
        let shapes: [fn(f64) -> f64; 4] = [
            |x| 1.0 / (1.0 + x * x),
            |x| 2.0 * x / (1.0 + x * x),
            |x| (-0.5 * x * x).exp(),
            |x| 1.0 / (1.0 + x * x).sqrt(),
        ];
        for (k, shape) in shapes.iter().enumerate() {
            let (rows, mut random) = (400, Random::new(k as u64));
            // The last one differs from a wider first one by its flanks, most of which are the declared bias's.
            let noise_dps = [0.01, 0.01, 0.01, 0.001][k];
            let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
            let output = degc.iter().map(|t| {
                0.3 - 0.01 * t + 0.2 * shape((t - 30.0) / 4.0) + noise_dps * random.normal()
            });
            let columns = BTreeMap::from([
                ("rate_out_dps".to_owned(), output.collect()),
                ("die_degc".to_owned(), degc.clone()),
            ]);
            let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
            let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
            let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
            let found = search.run().unwrap();
            let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
            assert_eq!(
                (names, found.left),
                (vec!["mode_crossing".to_owned()], None),
                "{k}"
            );
            let model = search.model(&found.terms).unwrap();
            let estimate = &search.estimates(&model)[0];
            assert_eq!(estimate.point.form, k.saturating_sub(1));
            let reported = found.terms[0].candidate.report(&c, estimate);
            for (name, value) in [("center_degc", 30.0), ("half_width_k", 4.0)] {
                let (found, std) = reported[name];
                assert!((found - value).abs() < 4.0 * std, "{k} {reported:?}");
            }
        }
    }
}
