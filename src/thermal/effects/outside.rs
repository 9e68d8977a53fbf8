//! Shapes without a name: what the catalogue does not have, but a record may show.
//!
//! They compete with the catalogue on equal terms. Where one of them wins, the catalogue's best
//! is a likeness, not a cause: what is left is reported with its channel, and without a name.

use super::covariate::spline;
use super::{Bias, Candidate, Estimate, Missing, Point, Reported, Sheet, gain, map, product};
use crate::record::columns::is_known;
use crate::statistics::linear::Basis;
use crate::thermal::channels::{Channels, lag, scaled};

/// What the shape is of.
#[derive(Debug, Clone, PartialEq)]
enum Kind {
    /// A function of the thermometer, finer than the declared one.
    Curve,
    /// Rate-independent hysteresis: a play operator of the temperature.
    Play,
    /// A level that changes at one moment.
    Change,
    /// A disturbance that comes and goes.
    Bump,
    /// A smooth function of a channel.
    Smooth(String),
    /// A channel times the temperature.
    TimesHeat(String),
    /// A channel times the applied rate.
    TimesRate(String),
    /// A channel's own past.
    Late(String),
    /// A constant error of the scale factor.
    Scale,
}

/// The id of a constant error of the scale factor.
pub const SCALE: &str = "outside:scale_factor";

/// A shape without a name.
pub struct Outside {
    kind: Kind,
}

const OUTSIDE: Sheet = Sheet {
    id: "outside",
    physics: "a dependence that the catalogue does not have",
    equation: "smooth functions, products and histories of the channels",
    parameters: &[],
    compensable: false,
    confounders: &[],
    experiment: "move the channel alone, everything else held",
    reference: "goodness of fit against smooth alternatives; Eubank 1999",
};

/// All shapes for a record.
pub fn all(c: &Channels) -> Vec<Box<dyn Candidate>> {
    let mut kinds = Vec::new();
    let heat = super::heated(c).is_ok();
    if heat {
        kinds.extend([Kind::Curve, Kind::Play]);
    }
    kinds.extend([Kind::Change, Kind::Bump]);
    let rate = c.moving("rate_dps").is_some();
    for name in c.columns.keys().filter(|n| c.moving(n).is_some()) {
        let name = || name.clone();
        if name() == "rate_dps" {
            kinds.extend([Kind::Scale, Kind::Smooth(name()), Kind::Late(name())]);
            continue;
        }
        let thermometer = ["phase_rad", "freq_hz", "die_degc", "chamber_degc"];
        if thermometer.contains(&name().as_str()) {
            continue;
        }
        if is_known(&name()) {
            kinds.extend([Kind::Smooth(name()), Kind::Late(name())]);
        }
        if heat && name() != "quad_dps" {
            kinds.push(Kind::TimesHeat(name()));
        }
        if rate {
            kinds.push(Kind::TimesRate(name()));
        }
    }
    kinds
        .into_iter()
        .map(|kind| Box::new(Outside { kind }) as Box<dyn Candidate>)
        .collect()
}

impl Candidate for Outside {
    fn sheet(&self) -> &Sheet {
        &OUTSIDE
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let u = "u the thermometer's reading scaled to -1..1";
        let spline = format!(
            "a natural cubic spline of {} degrees of freedom",
            point.form
        );
        match &self.kind {
            Kind::Curve => format!("f(u), {spline}, {u}"),
            Kind::Play => format!(
                "k y, y stands still until u is the half width of a play away from it and then follows u, {u}"
            ),
            Kind::Change => "0 up to one moment, k after it".to_owned(),
            Kind::Bump => "k exp(-x^2 / 2), x = (t - centre) / width".to_owned(),
            Kind::Smooth(n) => format!("f({n}), {spline}"),
            Kind::TimesHeat(n) => format!("(k1 u + k2) {n}, {u}"),
            Kind::TimesRate(n) => format!("(k1 rate + k2) {n}"),
            Kind::Late(n) => format!(
                "k1 (l - v) + k2 v, l lags v: tau dl/dt = v - l, v what {n} has beside a cubic in the temperature"
            ),
            Kind::Scale => "k rate".to_owned(),
        }
    }

    fn id(&self) -> String {
        match &self.kind {
            Kind::Curve => "outside:curve".to_owned(),
            Kind::Play => "outside:hysteresis".to_owned(),
            Kind::Change => "outside:change_in_time".to_owned(),
            Kind::Bump => "outside:bump_in_time".to_owned(),
            Kind::Smooth(n) => format!("outside:curve_in:{n}"),
            Kind::TimesHeat(n) => format!("outside:{n}_times_temperature"),
            Kind::TimesRate(n) => format!("outside:{n}_times_rate"),
            Kind::Late(n) => format!("outside:past_of:{n}"),
            Kind::Scale => SCALE.to_owned(),
        }
    }

    fn named(&self) -> bool {
        false
    }

    fn repeats(&self) -> bool {
        matches!(self.kind, Kind::Change | Kind::Bump)
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec![match &self.kind {
            Kind::Curve | Kind::Play => c.thermometer.clone(),
            Kind::Change | Kind::Bump => "time_s".to_owned(),
            Kind::Smooth(n) | Kind::TimesHeat(n) | Kind::TimesRate(n) | Kind::Late(n) => n.clone(),
            Kind::Scale => "rate_dps".to_owned(),
        }])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        match &self.kind {
            Kind::Curve => [5, 8, 12].map(Point::form).to_vec(),
            Kind::Play => [0.05, 0.1, 0.18, 0.3, 0.45, 0.65]
                .map(|r: f64| Point::at(0, &[r.ln()]))
                .to_vec(),
            Kind::Change => {
                let count = (c.len() / 8).clamp(8, 60);
                let at = (1..count).map(|k| k as f64 / count as f64);
                at.map(|x| Point::at(0, &[x])).collect()
            }
            Kind::Bump => {
                let mut out = Vec::new();
                for width in [0.02f64, 0.045, 0.1] {
                    let count = (1.2 / width) as usize;
                    for k in 0..count {
                        let at = (k as f64 + 0.5) / count as f64;
                        out.push(Point::at(0, &[at, width.ln()]));
                    }
                }
                out
            }
            Kind::Smooth(_) => [2, 4, 6].map(Point::form).to_vec(),
            Kind::TimesHeat(_) | Kind::TimesRate(_) | Kind::Scale => vec![Point::form(0)],
            Kind::Late(_) => [0.7, 2.0, 6.0]
                .map(|rows: f64| Point::at(0, &[(rows * c.period_s()).ln()]))
                .to_vec(),
        }
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let of = |name: &str| c.scaled(name).unwrap_or_else(|| vec![0.0; c.len()]);
        let start = c.time_s.first().copied().unwrap_or(0.0);
        let span = c.span_s().max(f64::MIN_POSITIVE);
        match &self.kind {
            Kind::Curve => spline(&c.u, point.form),
            Kind::Play => vec![play(&c.smooth_u, point.theta[0].exp())],
            Kind::Change => {
                let after = |t: f64| f64::from(u8::from((t - start) / span > point.theta[0]));
                vec![map(&c.time_s, after)]
            }
            Kind::Bump => {
                let (at, width) = (point.theta[0], point.theta[1].exp());
                let bump = |t: f64| (-0.5 * (((t - start) / span - at) / width).powi(2)).exp();
                vec![map(&c.time_s, bump)]
            }
            Kind::Smooth(name) => spline(&of(name), point.form),
            Kind::TimesHeat(name) => {
                let v = of(name);
                vec![product(&v, &c.u), v]
            }
            Kind::TimesRate(name) => {
                let (v, r) = (of(name), of("rate_dps"));
                vec![product(&v, c.column("rate_dps").unwrap_or(&r)), v]
            }
            Kind::Late(name) => {
                // What follows the temperature is a thermometer, and its past a thermal lag.
                let v = without_heat(c, &of(name));
                let late = lag(&c.time_s, &v, point.theta[0].exp());
                vec![late.iter().zip(&v).map(|(l, v)| l - v).collect(), v]
            }
            Kind::Scale => vec![of("rate_dps")],
        }
    }

    fn spacing(&self, c: &Channels, point: &Point) -> Vec<f64> {
        match &self.kind {
            Kind::Change => vec![1.0 / (c.len() / 8).clamp(8, 60) as f64],
            Kind::Bump => vec![point.theta[1].exp(), 0.5],
            _ => vec![0.5; point.theta.len()],
        }
    }

    fn report(&self, c: &Channels, estimate: &Estimate) -> Reported {
        if self.kind != Kind::Scale {
            return Reported::new();
        }
        let (_, _, half_dps) = scaled(c.column("rate_dps").unwrap_or(&[]));
        [gain("linear_ppm", estimate, 0, 1e6 / half_dps)]
            .into_iter()
            .collect()
    }
}

/// A column less its cubic in the temperature.
fn without_heat(c: &Channels, column: &[f64]) -> Vec<f64> {
    let powers: Vec<Vec<f64>> = (0..4).map(|k| map(&c.u, |u| u.powi(k))).collect();
    let mut rest = column.to_vec();
    Basis::new(&powers).project_off(&mut rest);
    rest
}

/// Play (backlash) operator with half width `r`: the output moves only when the input pushes it.
pub fn play(x: &[f64], r: f64) -> Vec<f64> {
    let mut y = x.first().copied().unwrap_or(0.0);
    x.iter()
        .map(|x| {
            y = y.clamp(x - r, x + r);
            y
        })
        .collect()
}
