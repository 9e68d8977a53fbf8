//! Effects of heat's history.

use super::past::{LagTerm, past_lags, past_slopes};
use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, UNUSUAL, entry,
    from_log, gain, heated, map, spaced,
};
use crate::correction::Term;
use crate::statistics::linear::add_scaled;
use crate::statistics::smooth::slope;
use crate::statistics::trend;
use crate::thermal::channels::{Channels, lag};
use crate::thermal::firmware::{Trial, Words, knots};

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![Box::new(ThermalLag), Box::new(TemperatureRate)]
}

/// Part of the bias follows a temperature that lags the thermometer's.
struct ThermalLag;

/// Time constants of packages and boards, s, begin here: what lags by seconds follows the rate of the temperature, and
/// looks like it.
const FASTEST_S: f64 = 30.0;

const THERMAL_LAG: Sheet = Sheet {
    id: "thermal_lag",
    physics: "part of the bias (electronics, package) follows a temperature that lags the \
              structure's: a loop between heating and cooling that closes in dwells",
    equation: "gain (T - T_l), T_l lags T: tau dT_l/dt = T - T_l",
    parameters: &[
        Parameter {
            name: "gain_dps_per_k",
            plausible: (0.01, 3.0),
        },
        Parameter {
            name: "tau_s",
            plausible: (5.0, 2000.0),
        },
    ],
    compensable: true,
    confounders: &["temperature_rate", "stress_jump", "warmup_transient"],
    experiment: "ramps at three rates with dwells between them: a lag's loop widens with the rate \
                 and closes in a dwell",
    reference: "two-node thermal network; Chen et al. 2004 (circuit and structure at different \
                temperatures)",
};

impl Candidate for ThermalLag {
    fn sheet(&self) -> &Sheet {
        &THERMAL_LAG
    }

    fn equation(&self, c: &Channels, point: &Point) -> String {
        let as_is = "T_l = T at the first row";
        let (law, begun) = match Lagging::of(c, point) {
            Lagging::Linear => ("gain (T - T_l)", as_is),
            Lagging::Curved => (
                "gain (T - T_l) + curvature (T^2 - T_l^2) with T and T_l counted from reference_degc",
                as_is,
            ),
            Lagging::Begun => (
                "gain (T - T_l)",
                "T_l fitted at the first row and after the longest gaps",
            ),
        };
        format!("{law}; T_l lags T: tau dT_l/dt = T - T_l, {begun}")
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec![heated(c)?, "time_s".to_owned()])
    }

    fn channels_at(&self, c: &Channels, point: &Point) -> Vec<String> {
        heated_at(c, point.form % c.histories())
    }

    fn odds_against(&self, c: &Channels, point: &Point) -> f64 {
        UNUSUAL * (FASTEST_S / tau_s(c, point)).ln().max(0.0)
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let fastest = 2.0 * shortest_s(c);
        let slowest = (c.span_s() / 2.5).max(2.0 * fastest);
        let taus = spaced(fastest, slowest, 18);
        let histories = if c.span_s() > 0.0 { c.histories() } else { 0 };
        let every = |form| taus.iter().map(move |t| Point::at(form, &[t.ln()]));
        (0..2 * histories).flat_map(every).collect()
    }

    fn beside(&self, c: &Channels, point: &Point) -> Vec<Point> {
        // What was before a beginning is asked where a lag is seen without that.
        let begun = 2 * c.histories()..3 * c.histories();
        begun.map(|form| Point::at(form, &point.theta)).collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let (_, now, _) = c.history(point.form % c.histories());
        let late = lag(&c.time_s, now, tau_s(c, point));
        let behind = |power: i32| -> Vec<f64> {
            let pairs = now.iter().zip(&late);
            pairs.map(|(x, l)| x.powi(power) - l.powi(power)).collect()
        };
        match Lagging::of(c, point) {
            Lagging::Linear => vec![behind(1)],
            Lagging::Curved => vec![behind(1), behind(2)],
            Lagging::Begun => {
                let mut columns = vec![behind(1)];
                columns.extend(beginnings(c, tau_s(c, point)));
                columns
            }
        }
    }

    fn admits(&self, c: &Channels, point: &Point, beta: &[f64]) -> bool {
        let Some((gain, behind)) = beta
            .split_first()
            .filter(|_| Lagging::of(c, point) == Lagging::Begun)
        else {
            return true;
        };
        behind.iter().all(|b| b.abs() <= MOST_BEHIND_U * gain.abs())
    }

    fn spacing(&self, c: &Channels, _point: &Point) -> Vec<f64> {
        vec![((c.span_s() / c.period_s()).max(4.0)).ln() / 18.0]
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let (gain_dps, tau_s) = (*e.beta.first()?, tau_s(c, &e.point));
        let which = e.point.form % c.histories();
        let (input, trial) = read(c, f, which)?;
        let tangent = which > 0 && which < c.heats();
        let lagging = Lagging::of(c, &e.point);
        let of_square = match (lagging, e.beta.get(1)) {
            (Lagging::Curved, Some(b)) if gain_dps != 0.0 => b / gain_dps,
            _ => 0.0,
        };
        let curve = |u: f64| {
            let x = if tangent { c.tangent_at(u) } else { u };
            x + of_square * x * x
        };
        let values: Vec<f64> = knots(65).map(curve).collect();
        let linear = |share: f64, tau_s: f64, kept: bool| Term::Lag {
            gain_dps: share * gain_dps,
            input,
            tau_s,
            kept,
        };
        let late_curve = |share: f64, tau_s: f64, kept: bool| Term::LagOfCurve {
            gain_dps: share * gain_dps,
            input,
            values: values.clone(),
            tau_s,
            kept,
        };
        let curve_of_late = |share: f64, tau_s: f64, kept: bool| Term::CurveOfLag {
            gain_dps: share * gain_dps,
            input,
            values: values.clone(),
            tau_s,
            kept,
        };
        let mut columns = self.columns(c, &f.bias, &e.point);
        if lagging == Lagging::Begun {
            // What was before a beginning, firmware does not know either.
            columns.truncate(1);
        }
        // A curve of a lagging tangent is neither of the last two: what comes nearest is taken.
        let terms: &[&LagTerm<'_>] = match (tangent, lagging) {
            (_, Lagging::Curved) => &[&curve_of_late, &late_curve],
            (false, _) => &[&linear],
            (true, _) => &[&late_curve],
        };
        let mut wanted = vec![0.0; c.len()];
        for (column, b) in columns.iter().zip(&e.beta) {
            add_scaled(&mut wanted, *b, column);
        }
        let term = past_lags(c, f, &trial, tau_s, &wanted, terms);
        Some(term.unwrap_or_else(|| terms.iter().take(1).map(|t| t(1.0, tau_s, false)).collect()))
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let per_k = 1.0 / c.history(e.point.form % c.histories()).2;
        let (_, std) = from_log("tau_s", e, 0).1;
        let mut out: Reported = [
            gain("gain_dps_per_k", e, 0, per_k),
            entry("tau_s", tau_s(c, &e.point), std),
        ]
        .into_iter()
        .collect();
        if Lagging::of(c, &e.point) == Lagging::Curved {
            out.extend([gain("curvature_dps_per_k2", e, 1, per_k * per_k)]);
            // What gain and curvature are counted from: the zero of the scaled temperature, which is given and not estimated.
            let zero_degc = c.history_zero_degc(e.point.form % c.histories());
            out.extend([entry("reference_degc", zero_degc, 0.0)]);
        }
        out
    }
}

/// The columns of a term that follows a course of temperature in time.
fn heated_at(c: &Channels, which: usize) -> Vec<String> {
    vec![c.history_of(which).to_owned(), "time_s".to_owned()]
}

/// The input of firmware that a course of temperature is read at, and trials on it; a tangent is read as its phase.
fn read(c: &Channels, f: &mut Words, which: usize) -> Option<(usize, Trial)> {
    let Some(die) = c.die.as_ref().filter(|_| which >= c.heats()) else {
        return Some((f.thermometer()?, f.trial(c)?));
    };
    let (input, readings) = f.input(c, die.name)?;
    let trial = f.trial_of(c, input, &readings)?;
    Some((input, trial))
}

/// What lags, in the order of the forms (each for every course of temperature).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lagging {
    /// A part of the bias that is linear in temperature.
    Linear,
    /// One with a curve of its own.
    Curved,
    /// One that is linear, of which nobody knows how far it was behind when the record began, or went on after a gap.
    Begun,
}

impl Lagging {
    fn of(c: &Channels, point: &Point) -> Self {
        match point.form / c.histories() {
            0 => Lagging::Linear,
            1 => Lagging::Curved,
            _ => Lagging::Begun,
        }
    }
}

/// Rows without which a course of temperature is not known, most beginnings of a lag that are asked for, and how far it may be
/// behind there: as far as the thermometer goes.
const LOST: f64 = 3.5;
const MOST_BEGINNINGS: usize = 4;
const MOST_BEHIND_U: f64 = 2.0;

/// What is left of a lag that was one behind at a beginning of the record: at its first row, and after its longest gaps.
fn beginnings(c: &Channels, tau_s: f64) -> Vec<Vec<f64>> {
    let gap_s = |row: &usize| c.time_s[*row] - c.time_s[row - 1];
    let mut after: Vec<usize> = (1..c.len())
        .filter(|row| gap_s(row) > LOST * c.period_s())
        .collect();
    after.sort_by(|a, b| gap_s(b).total_cmp(&gap_s(a)));
    after.truncate(MOST_BEGINNINGS - 1);
    let rows = std::iter::once(0).chain(after);
    rows.map(|row| {
        let begun_s = c.time_s.get(row).copied().unwrap_or(0.0);
        map(&c.time_s, |t| match t >= begun_s {
            true => (-(t - begun_s) / tau_s).exp(),
            false => 0.0,
        })
    })
    .collect()
}

/// Shortest time constant of a lag, s: of a shorter one a row sees no more than that it comes after the rate of change.
fn shortest_s(c: &Channels) -> f64 {
    (0.25 * c.period_s()).max(1e-3)
}

/// The time constant of a lag: longer ones are a drift in time.
fn tau_s(c: &Channels, point: &Point) -> f64 {
    let shortest = shortest_s(c);
    let longest = (0.5 * c.span_s()).max(shortest);
    point.theta[0].exp().clamp(shortest, longest)
}

/// Bias proportional to dT/dt.
struct TemperatureRate;

const TEMPERATURE_RATE: Sheet = Sheet {
    id: "temperature_rate",
    physics: "a temperature gradient over the die bends it while the temperature changes",
    equation: "gain dT/dt",
    parameters: &[Parameter {
        name: "gain_dps_s_per_k",
        plausible: (0.1, 1000.0),
    }],
    compensable: true,
    confounders: &["thermal_lag"],
    experiment: "ramps shorter than the suspected lag: a gradient follows dT/dt at once, a lag \
                 after its time constant",
    reference: "thermal gradients in MEMS gyroscopes; general knowledge",
};

impl Candidate for TemperatureRate {
    fn sheet(&self) -> &Sheet {
        &TEMPERATURE_RATE
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec![heated(c)?, "time_s".to_owned()])
    }

    fn channels_at(&self, c: &Channels, point: &Point) -> Vec<String> {
        heated_at(c, point.form / SLOPES.len())
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        // Forms: how closely the rate follows the readings, for each reading of the temperature. Corners want it close,
        // noise far.
        (0..c.histories() * SLOPES.len()).map(Point::form).collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        // Per record length, so that the column is of order one.
        let span = c.span_s().max(f64::MIN_POSITIVE);
        vec![map(&rate_of_heat(c, point.form), |v| v * span)]
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let which = e.point.form / SLOPES.len();
        if which > 0 && which < c.heats() {
            return None;
        }
        let (input, trial) = read(c, f, which)?;
        let gain_dps_s = e.beta.first()? * c.span_s();
        let wanted = map(&rate_of_heat(c, e.point.form), |s| gain_dps_s * s);
        past_slopes(c, f, (input, &trial), gain_dps_s, &wanted)
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let factor = c.span_s() / c.history(e.point.form / SLOPES.len()).2;
        [gain("gain_dps_s_per_k", e, 0, factor)]
            .into_iter()
            .collect()
    }
}

/// How the temperature's rate is found.
enum Slope {
    /// By lines through so many rows to each side: they see nothing of a corner beyond.
    Rows(usize),
    /// By a spline of this suppleness ([`trend::slope`]): all rows say something of the rate at each.
    Spline(f64),
}

/// The ways that are tried.
const SLOPES: [Slope; 8] = [
    Slope::Rows(1),
    Slope::Rows(2),
    Slope::Rows(3),
    Slope::Rows(5),
    Slope::Rows(9),
    Slope::Spline(1.0),
    Slope::Spline(0.1),
    Slope::Spline(0.01),
];

/// The rate of change, per second, of a reading of the temperature, as a form has it.
fn rate_of_heat(c: &Channels, form: usize) -> Vec<f64> {
    let (heat, _, _) = c.history(form / SLOPES.len());
    match SLOPES[form % SLOPES.len()] {
        Slope::Rows(rows) => slope(&c.time_s, heat, rows),
        Slope::Spline(suppleness) => trend::slope(&c.time_s, heat, suppleness),
    }
}
