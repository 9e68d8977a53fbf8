//! Effects of time: since power-on, and since the beginning.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, UNUSUAL, entry,
    from_log, gain, map, spaced,
};
use crate::correction::Term;
use crate::thermal::channels::{Channels, range};
use crate::thermal::firmware::Words;

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![Box::new(Warmup), Box::new(Ageing)]
}

/// Exponential in time since power-on.
struct Warmup;

/// References and packages have settled after so long, s: what takes longer is nearly always another drift.
const SLOWEST_S: f64 = 2000.0;

const WARMUP: Sheet = Sheet {
    id: "warmup_transient",
    physics: "self-heating and settling of references after each power-on",
    equation: "amplitude exp(-t_on / tau), t_on the time since power-on; or s times that, s = 1 at first and less after a power-off that was too short to \
               cool down: what had settled goes back with a time constant of its own",
    parameters: &[
        Parameter {
            name: "amplitude_dps",
            plausible: (0.005, 5.0),
        },
        Parameter {
            name: "tau_s",
            plausible: (10.0, 3000.0),
        },
        Parameter {
            name: "cooling_tau_s",
            plausible: (1.0, 30_000.0),
        },
    ],
    compensable: true,
    confounders: &["ageing_drift", "thermal_lag", "stress_jump"],
    experiment: "power cycles at constant ambient temperature: the transient repeats with each one",
    reference: "Micromachines 12 (2021) 1329",
};

impl Candidate for Warmup {
    fn sheet(&self) -> &Sheet {
        &WARMUP
    }

    fn equation(&self, c: &Channels, point: &Point) -> String {
        let law = match c.on_known {
            true => "amplitude exp(-t_on / tau), t_on the time since power-on",
            false => {
                "amplitude exp(-t_on / tau), t_on the time since power-on: here time_s, as the record tells no time_since_power_on_s, so \
                 that time_s = 0 is taken as power-on"
            }
        };
        match point.form {
            RESTED => format!(
                "s {law}, s = 1 at first and less after a power-off that was too short to cool down: what had settled goes back \
                 with cooling_tau_s"
            ),
            _ => law.to_owned(),
        }
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        let clock = if c.on_known {
            "time_since_power_on_s"
        } else {
            "time_s"
        };
        Ok(vec![clock.to_owned()])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let (_, longest) = range(&c.on_s);
        let fastest = 1.5 * c.period_s();
        let taus = spaced(fastest, (longest / 1.5).max(2.0 * fastest), 16);
        let mut out: Vec<Point> = taus.iter().map(|t| Point::at(0, &[t.ln()])).collect();
        if c.on_known && c.restarts() {
            for ratio in COOLING {
                out.extend(
                    taus.iter()
                        .map(|t| Point::at(RESTED, &[t.ln(), ratio.ln()])),
                );
            }
        }
        out
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let tau_s = warm_s(c, point);
        vec![match point.form {
            RESTED => rested(c, tau_s, cooling_s(tau_s, point)),
            _ => map(&c.on_s, |t| (-t / tau_s).exp()),
        }]
    }

    fn odds_against(&self, c: &Channels, point: &Point) -> f64 {
        let rested = if point.form == RESTED { SELDOM } else { 0.0 };
        let tau_s = warm_s(c, point);
        let fast = 2.0 * UNUSUAL * (RESOLVED * c.period_s() / tau_s).ln().max(0.0);
        UNUSUAL * (tau_s / SLOWEST_S).ln().max(0.0) + fast + rested
    }

    fn spacing(&self, c: &Channels, point: &Point) -> Vec<f64> {
        let of_tau = ((c.span_s() / c.period_s()).max(4.0)).ln() / 16.0;
        let mut out = vec![of_tau, 0.7];
        out.truncate(point.theta.len());
        out
    }

    fn correction(&self, c: &Channels, e: &Estimate, _f: &mut Words) -> Option<Vec<Term>> {
        let gain_dps = *e.beta.first()?;
        let tau_s = warm_s(c, &e.point);
        (e.point.form != RESTED).then(|| vec![Term::Decay { gain_dps, tau_s }])
    }

    fn obstacle(&self, _c: &Channels, point: &Point) -> Option<String> {
        let said = "warmup_transient starts smaller after a short power-off, and firmware does not know how \
                    long the power was off";
        (point.form == RESTED).then(|| said.to_owned())
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let (_, std) = from_log("tau_s", e, 0).1;
        let mut out: Reported = [
            gain("amplitude_dps", e, 0, 1.0),
            entry("tau_s", warm_s(c, &e.point), std),
        ]
        .into_iter()
        .collect();
        if e.point.form == RESTED {
            let cooling_s = cooling_s(warm_s(c, &e.point), &e.point);
            let share = e.theta_std.get(1).copied().unwrap_or(0.0);
            out.extend([entry("cooling_tau_s", cooling_s, cooling_s * share)]);
        }
        out
    }
}

/// Form of a warm-up that depends on the rest before it, and minus the logarithm of its odds: it is about the beginnings of
/// a few power-ons, and no firmware can carry it.
const RESTED: usize = 1;
const SELDOM: f64 = 4.0;

/// Time constants of the way back while the power is off, over that of the warm-up: where the search starts, and the
/// least and the most that the record is asked for.
const COOLING: [f64; 2] = [1.0, 0.25];
const COOLINGS: (f64, f64) = (0.05, 10.0);

/// Of the way back, s.
fn cooling_s(tau_s: f64, point: &Point) -> f64 {
    tau_s * point.theta[1].exp().clamp(COOLINGS.0, COOLINGS.1)
}

/// A warm-up that has to make up for what the rest before it undid: 1 at the first power-on's beginning.
///
/// Off lasts from half a period after the last reading to the next power-on.
fn rested(c: &Channels, tau_s: f64, cooling_s: f64) -> Vec<f64> {
    let mut start = 1.0;
    let mut out = Vec::with_capacity(c.len());
    for i in 0..c.len() {
        if let Some(last) = i.checked_sub(1).filter(|last| c.on_s[i] < c.on_s[*last]) {
            let settled = 1.0 - start * (-c.on_s[last] / tau_s).exp();
            let off_s = c.time_s[i] - c.on_s[i] - c.time_s[last] - 0.5 * c.period_s();
            start = 1.0 - settled * (-off_s.max(0.0) / cooling_s).exp();
        }
        out.push(start * (-c.on_s[i] / tau_s).exp());
    }
    out
}

/// Periods of the rows below which a time constant is doubted: what the first rows have of their own (a rate of change
/// that is known from one side) looks like it.
const RESOLVED: f64 = 4.0;
/// The time constant of a warm-up: one that goes on for longer than the power is on is a drift.
fn warm_s(c: &Channels, point: &Point) -> f64 {
    let (_, longest) = range(&c.on_s);
    point.theta[0].exp().min(longest.max(c.period_s()))
}

/// Slow drift in time, linear or logarithmic.
struct Ageing;

const AGEING: Sheet = Sheet {
    id: "ageing_drift",
    physics: "creep, outgassing and relaxing stress: a drift that does not come back",
    equation: "k t, or k ln(1 + t / t0)",
    parameters: &[
        Parameter {
            name: "drift_dps_per_h",
            plausible: (1e-4, 10.0),
        },
        Parameter {
            name: "t0_s",
            plausible: (10.0, 1e6),
        },
    ],
    compensable: false,
    confounders: &["warmup_transient", "stress_jump"],
    experiment: "a second run after power-off at the same temperatures: ageing goes on where it \
                 stopped, a warm-up starts again",
    reference: "general knowledge; IEEE Std 952 for rate random walk",
};

impl Candidate for Ageing {
    fn sheet(&self) -> &Sheet {
        &AGEING
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let law = if point.form == 0 {
            "k t"
        } else {
            "k ln(1 + t / t0)"
        };
        format!("{law}, t the time since the first row")
    }

    fn channels(&self, _c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec!["time_s".to_owned()])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let span = c.span_s();
        let mut out = vec![Point::form(0)];
        let starts = spaced(0.01 * span, 1.5 * span, 8);
        out.extend(starts.into_iter().map(|t0| Point::at(1, &[t0.ln()])));
        out
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let start = c.time_s.first().copied().unwrap_or(0.0);
        if point.form == 0 {
            let span = c.span_s().max(f64::MIN_POSITIVE);
            return vec![map(&c.time_s, |t| (t - start) / span)];
        }
        let t0 = point.theta[0].exp();
        vec![map(&c.time_s, |t| ((t - start) / t0).ln_1p())]
    }

    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        vec![0.7; point.theta.len()]
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        if e.point.form == 0 {
            let per_h = 3600.0 / c.span_s().max(f64::MIN_POSITIVE);
            return [gain("drift_dps_per_h", e, 0, per_h)].into_iter().collect();
        }
        [
            gain("gain_dps_per_efold", e, 0, 1.0),
            from_log("t0_s", e, 0),
        ]
        .into_iter()
        .collect()
    }
}

#[cfg(test)]
#[path = "time_tests.rs"]
mod tests;
