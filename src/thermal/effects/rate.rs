//! Effects of the applied rate and of the output stage.

use super::outside::SCALE;
use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, entry, gain, heated,
    map, moving, product,
};
use crate::correction::Term;
use crate::thermal::channels::{Channels, range};
use crate::thermal::firmware::Words;

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![
        Box::new(ScaleTemperature),
        Box::new(Nonlinearity),
        Box::new(Asymmetry),
        Box::new(super::deadband::Deadband),
        Box::new(super::saturation::Saturation),
    ]
}

/// Largest magnitude of the applied rate, deg/s; 1 without one.
pub(super) fn top(c: &Channels) -> f64 {
    let (low, high) = range(c.column("rate_dps").unwrap_or(&[]));
    let top = low.abs().max(high.abs());
    if top > 0.0 { top } else { 1.0 }
}

/// The applied rate over its largest magnitude.
fn relative(c: &Channels) -> Vec<f64> {
    let top = top(c);
    map(c.column("rate_dps").unwrap_or(&[]), |o| o / top)
}

pub(super) fn rate_alone(c: &Channels) -> Result<Vec<String>, Missing> {
    moving(c, "rate_dps")?;
    Ok(vec!["rate_dps".to_owned()])
}

/// Scale factor linear in temperature, or bent.
struct ScaleTemperature;

/// What a bend costs, that the effect does not need.
const BENT: f64 = 4.0;

/// Whether a shape is the bent one: in the reading, after those that are linear in a temperature.
fn is_bent(c: &Channels, point: &Point) -> bool {
    point.form == c.heats()
}

/// Where b1 + b0 u + b2 u^2 passes through zero: the root next to the line's, or that one.
fn scale_zero(slope: f64, constant: f64, bend: f64) -> f64 {
    let line = -constant / slope;
    let under = slope * slope - 4.0 * bend * constant;
    if under < 0.0 || bend == 0.0 {
        return line;
    }
    // Without the cancellation of nearly equal numbers (Numerical Recipes, 5.6).
    let q = -0.5 * (slope + slope.signum() * under.sqrt());
    constant / q
}

/// Standard deviation of that place, the coefficients' errors being small and independent of each other: a zero far from the
/// record's temperatures is where the slope says.
fn scale_zero_std(e: &Estimate, zero: f64) -> f64 {
    let at = |k: usize| e.beta.get(k).copied().unwrap_or(0.0);
    let by_zero = at(0) + 2.0 * at(2) * zero;
    // What each coefficient is of: u, 1, u^2.
    let of = [zero, 1.0, zero * zero];
    let parts = of.iter().zip(&e.beta_std).map(|(u, std)| (u * std).powi(2));
    parts.sum::<f64>().sqrt() / by_zero.abs()
}

const SCALE_TEMPERATURE: Sheet = Sheet {
    id: "scale_factor_temperature",
    physics: "the modes' split, the gap and the references move with temperature, and the scale \
              factor with them",
    equation: "rate (slope (T - reference)), where that does not do with curvature (T - reference)^2 in the brackets",
    parameters: &[
        Parameter {
            name: "slope_ppm_per_k",
            plausible: (1.0, 3000.0),
        },
        Parameter {
            name: "reference_degc",
            plausible: (-40.0, 125.0),
        },
    ],
    compensable: true,
    confounders: &["scale_factor_nonlinearity"],
    experiment: "three rates at three temperatures, both directions",
    reference: "Chen et al. 2004 (4.3 % over the range); Cao et al.",
};

impl Candidate for ScaleTemperature {
    fn sheet(&self) -> &Sheet {
        &SCALE_TEMPERATURE
    }

    fn equation(&self, c: &Channels, point: &Point) -> String {
        let law = match is_bent(c, point) {
            true => "rate (slope (T - reference) + curvature (T - reference)^2)",
            false => "rate slope (T - reference)",
        };
        law.to_owned()
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        let mut out = rate_alone(c)?;
        out.push(heated(c)?);
        Ok(out)
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        (0..=c.heats()).map(Point::form).collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let r = relative(c);
        let bent = is_bent(c, point);
        let u = c.heat(if bent { 0 } else { point.form });
        let linear = product(&r, u);
        let bend = bent.then(|| product(&linear, u));
        [vec![linear, r], bend.into_iter().collect()].concat()
    }

    fn surcharge(&self, c: &Channels, point: &Point) -> f64 {
        if is_bent(c, point) { BENT } else { 0.0 }
    }

    fn contains(&self, _point: &Point) -> Option<&'static str> {
        Some(SCALE)
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        if e.point.form > 0 && !is_bent(c, &e.point) {
            return None;
        }
        let relative = |k: usize| e.beta.get(k).copied().unwrap_or(0.0) / top(c);
        Some(vec![Term::ScaleBy {
            input: Some(f.thermometer()?),
            s0: relative(1),
            s1: relative(0),
            s2: relative(2),
        }])
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let at = |k: usize| e.beta.get(k).copied().unwrap_or(0.0);
        let (slope, constant, bend) = (at(0), at(1), at(2));
        let factor = 1e6 / (top(c) * c.kelvin_per_u);
        let mut out: Reported = [gain("slope_ppm_per_k", e, 0, factor)]
            .into_iter()
            .collect();
        if slope != 0.0 {
            let zero = scale_zero(slope, constant, bend);
            if bend != 0.0 {
                // Where the scale is nominal, as the equation has it.
                if let Some(at_zero) = out.get_mut("slope_ppm_per_k") {
                    at_zero.0 = factor * (slope + 2.0 * bend * zero);
                }
                out.extend([gain("curvature_ppm_per_k2", e, 2, factor / c.kelvin_per_u)]);
            }
            let std = c.kelvin_per_u * scale_zero_std(e, zero);
            out.insert(
                "reference_degc".to_owned(),
                (c.middle_degc + c.kelvin_per_u * zero, std),
            );
        }
        out
    }
}

/// Odd, cubic in rate.
struct Nonlinearity;

const NONLINEARITY: Sheet = Sheet {
    id: "scale_factor_nonlinearity",
    physics: "stiffening springs and converters bend the answer to rate, equally to both sides",
    equation: "n3 rate_max (rate / rate_max)^3",
    parameters: &[Parameter {
        name: "cubic_ppm",
        plausible: (10.0, 20_000.0),
    }],
    compensable: true,
    confounders: &["output_saturation", "scale_factor_temperature"],
    experiment: "a rate table with seven rates to each side",
    reference: "IEEE Std 1431, 12.9",
};

impl Candidate for Nonlinearity {
    fn sheet(&self) -> &Sheet {
        &NONLINEARITY
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let linear = if point.form == 0 { "" } else { " + n1 rate" };
        format!("{}{linear}", NONLINEARITY.equation)
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        rate_alone(c)
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        vec![Point::form(0), Point::form(1)]
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let r = relative(c);
        let cube = map(&r, |x| x * x * x);
        // The scale factor is exact at small rates, or as a mean over the range.
        if point.form == 0 {
            vec![cube]
        } else {
            vec![cube, r]
        }
    }

    fn surcharge(&self, _c: &Channels, point: &Point) -> f64 {
        // A scale factor that is wrong at small rates is another effect.
        3.0 * point.form as f64
    }

    fn contains(&self, point: &Point) -> Option<&'static str> {
        (point.form == 1).then_some(SCALE)
    }

    fn correction(&self, c: &Channels, e: &Estimate, _f: &mut Words) -> Option<Vec<Term>> {
        let mut out = vec![Term::Cubic {
            ppm: e.beta.first()? * 1e6 / top(c),
            rate_max_dps: top(c),
        }];
        if let Some(linear) = e.beta.get(1) {
            out.push(Term::ScaleBy {
                input: None,
                s0: linear / top(c),
                s1: 0.0,
                s2: 0.0,
            });
        }
        Some(out)
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let ppm = 1e6 / top(c);
        let mut out: Reported = [
            gain("cubic_ppm", e, 0, ppm),
            entry("rate_max_dps", top(c), 0.0),
        ]
        .into_iter()
        .collect();
        if e.point.form == 1 {
            out.extend([gain("linear_ppm", e, 1, ppm)]);
        }
        out
    }
}

/// Even in rate.
struct Asymmetry;

const ASYMMETRY: Sheet = Sheet {
    id: "scale_factor_asymmetry",
    physics: "the answers to the two turning directions differ",
    equation: "n2 rate^2 / rate_max, or n2 |rate|, or n2 (|rate| + rate) or n2 (|rate| - rate): one direction alone",
    parameters: &[Parameter {
        name: "even_ppm",
        plausible: (10.0, 20_000.0),
    }],
    compensable: true,
    confounders: &["output_saturation", "g_sensitivity"],
    experiment: "a rate table with both directions, at two radii (centripetal acceleration)",
    reference: "IEEE Std 1431, 12.9",
};

impl Candidate for Asymmetry {
    fn sheet(&self) -> &Sheet {
        &ASYMMETRY
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let law = match point.form {
            0 => "n2 rate^2 / rate_max",
            1 => "n2 |rate|",
            2 => "n2 (|rate| + rate), which is 0 at negative rates",
            _ => "n2 (|rate| - rate), which is 0 at positive rates",
        };
        law.to_owned()
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        rate_alone(c)
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        (0..4).map(Point::form).collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let odd = odd_part(point);
        let shape = |x: &f64| match point.form {
            0 => x * x,
            _ => x.abs() + odd * x,
        };
        vec![relative(c).iter().map(shape).collect()]
    }

    fn surcharge(&self, _c: &Channels, point: &Point) -> f64 {
        // A scale factor that is exact on one side alone.
        odd_part(point).abs()
    }

    fn correction(&self, c: &Channels, e: &Estimate, _f: &mut Words) -> Option<Vec<Term>> {
        let relative = e.beta.first()? / top(c);
        let mut out = vec![Term::Even {
            ppm: relative * 1e6,
            rate_max_dps: top(c),
            absolute: e.point.form > 0,
        }];
        let odd = odd_part(&e.point);
        if odd != 0.0 {
            out.push(Term::ScaleBy {
                input: None,
                s0: odd * relative,
                s1: 0.0,
                s2: 0.0,
            });
        }
        Some(out)
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let ppm = 1e6 / top(c);
        let mut out: Reported = [
            gain("even_ppm", e, 0, ppm),
            entry("two_slopes", f64::from(u8::from(e.point.form > 0)), 0.0),
        ]
        .into_iter()
        .collect();
        let odd = odd_part(&e.point);
        if odd != 0.0 {
            out.extend([gain("linear_ppm", e, 0, odd * ppm)]);
        }
        out
    }
}

/// The part of an asymmetry that is linear in rate, in units of the even one: not 0 where one direction alone is off.
fn odd_part(point: &Point) -> f64 {
    [0.0, 0.0, 1.0, -1.0][point.form.min(3)]
}

#[cfg(test)]
#[path = "rate_tests.rs"]
mod tests;
