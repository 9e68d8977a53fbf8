//! Effects of heat's history and of time.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, from_log, gain, heated,
    map, spaced,
};
use crate::closure::channels::{Channels, lag, slope};
use crate::closure::firmware::{Words, knots};
use crate::closure::likelihood::linear::{Basis, add_scaled, dot};
use crate::correction::Term;

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![
        Box::new(ThermalLag),
        Box::new(TemperatureRate),
        Box::new(Warmup),
        Box::new(Ageing),
    ]
}

/// Part of the bias follows a temperature that lags the thermometer's.
struct ThermalLag;

const THERMAL_LAG: Sheet = Sheet {
    id: "thermal_lag",
    physics: "part of the bias (electronics, package) follows a temperature that lags the \
              structure's: a loop between heating and cooling that closes in dwells",
    equation: "k (T - T_l), tau dT_l/dt = T - T_l",
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

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec![heated(c)?, "time_s".to_owned()])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let fastest = (1.5 * c.period_s()).max(1e-3);
        let slowest = (c.span_s() / 2.5).max(2.0 * fastest);
        let taus = spaced(fastest, slowest, 18);
        // Forms: the whole bias curve lags, with the declared curve's own shape; a temperature lags.
        let forms = if c.span_s() > 0.0 { 1 + c.heats() } else { 0 };
        (0..forms)
            .flat_map(|form| taus.iter().map(move |t| Point::at(form, &[t.ln()])))
            .collect()
    }

    fn columns(&self, c: &Channels, bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let tau_s = tau_s(c, point);
        let now = if point.form == 0 {
            map(&c.smooth_u, |u| bias.at(u))
        } else {
            c.heat(point.form - 1).to_vec()
        };
        let late = lag(&c.time_s, &now, tau_s);
        vec![now.iter().zip(&late).map(|(u, l)| u - l).collect()]
    }

    fn spacing(&self, c: &Channels, _point: &Point) -> Vec<f64> {
        vec![((c.span_s() / c.period_s()).max(4.0)).ln() / 18.0]
    }

    fn acts_on_bias(&self) -> bool {
        true
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let (gain_dps, tau_s) = (*e.beta.first()?, tau_s(c, &e.point));
        let input = f.thermometer()?;
        let bias = f.bias.clone();
        let curve = |u: f64| match e.point.form {
            0 => bias.at(u),
            _ => c.tangent_at(u),
        };
        let values: Vec<f64> = knots(65).map(curve).collect();
        let term = |share: f64, tau_s: f64, kept: bool| match e.point.form {
            1 => Term::Lag {
                gain_dps: share * gain_dps,
                input,
                tau_s,
                kept,
            },
            _ => Term::LagOfCurve {
                gain_dps: share * gain_dps,
                input,
                values: values.clone(),
                tau_s,
                kept,
            },
        };
        let wanted = self.columns(c, &f.bias, &e.point).pop()?;
        let wanted = map(&wanted, |v| gain_dps * v);
        Some(
            past_lags(c, f, tau_s, &wanted, &term).unwrap_or_else(|| vec![term(1.0, tau_s, false)]),
        )
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let per_k = if e.point.form > 0 {
            gain("gain_dps_per_k", e, 0, 1.0 / c.kelvin_per_u)
        } else {
            gain("share_of_bias", e, 0, 1.0)
        };
        [per_k, from_log("tau_s", e, 0)].into_iter().collect()
    }
}

/// Time constants, in periods of the firmware, of a second lag beside a lag.
const SHORTER: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// The lags that come nearest to the wanted part of the output, deg/s; `term`: of a share of the gain, a time constant
/// and whether its state outlives a restart.
///
/// The difference of a noisy reading and its lag has the reading's noise; less the one to a short lag it has that of a
/// smoothed reading. And where the power was off for less than the lag, the gyro has kept its own state.
fn past_lags(
    c: &Channels,
    f: &Words,
    tau_s: f64,
    wanted: &[f64],
    term: &impl Fn(f64, f64, bool) -> Term,
) -> Option<Vec<Term>> {
    let trial = f.trial(c)?;
    let most_dps = wanted.iter().fold(1e-3, |m: f64, v| m.max(4.0 * v.abs()));
    let taken = |tau_s: f64, kept: bool| trial.taken_off(&[term(1.0, tau_s, kept)], most_dps);
    let restarts = c.on_s.windows(2).any(|w| w[1] < w[0]);
    let mut best: Option<(f64, Vec<Term>)> = None;
    for kept in [false, true].into_iter().take(1 + usize::from(restarts)) {
        let long = taken(tau_s, kept)?;
        let mut left = wanted.to_vec();
        add_scaled(&mut left, -1.0, &long);
        let off = dot(&left, &left);
        if best.as_ref().is_none_or(|b| off < b.0) {
            best = Some((off, vec![term(1.0, tau_s, kept)]));
        }
        let shorter = SHORTER.iter().map(|periods| periods * f.period_s);
        for short_s in shorter.take_while(|short_s| *short_s < 0.5 * tau_s) {
            let basis = Basis::new(&[long.clone(), taken(short_s, kept)?]);
            let mut left = wanted.to_vec();
            let z = basis.project_off(&mut left);
            let off = dot(&left, &left);
            let better = |b: &(f64, Vec<Term>)| off < (1.0 - WORTH_A_TERM) * b.0;
            if let [of_long, of_short] = basis.solve(&z)[..]
                && best.as_ref().is_none_or(better)
            {
                let pair = [(of_long, tau_s), (of_short, short_s)];
                best = Some((
                    off,
                    pair.map(|(share, tau_s)| term(share, tau_s, kept)).to_vec(),
                ));
            }
        }
    }
    best.map(|b| b.1)
}

/// The time constant of a lag: shorter ones are a rate of change, longer ones a drift in time.
fn tau_s(c: &Channels, point: &Point) -> f64 {
    let longest = (0.5 * c.span_s()).max(c.period_s());
    point.theta[0].exp().clamp(c.period_s(), longest)
}

/// Bias proportional to dT/dt.
struct TemperatureRate;

const TEMPERATURE_RATE: Sheet = Sheet {
    id: "temperature_rate",
    physics: "a temperature gradient over the die bends it while the temperature changes",
    equation: "k dT/dt",
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

    fn points(&self, c: &Channels) -> Vec<Point> {
        // Forms: how far the slope looks to both sides, for each reading of the temperature. Corners
        // want it short, noise long.
        (0..c.heats() * SLOPES.len()).map(Point::form).collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        // Per record length, so that the column is of order one.
        let span = c.span_s().max(f64::MIN_POSITIVE);
        let rows = SLOPES[point.form % SLOPES.len()];
        let heat = match point.form / SLOPES.len() {
            0 => &c.u,
            k => c.heat(k),
        };
        vec![map(&slope(&c.time_s, heat, rows), |v| v * span)]
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        if e.point.form >= SLOPES.len() {
            return None;
        }
        let gain_dps_s = e.beta.first()? * c.span_s();
        let wanted = slope(&c.time_s, &c.u, SLOPES[e.point.form]);
        past_slopes(c, f, gain_dps_s, &map(&wanted, |s| gain_dps_s * s))
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let factor = c.span_s() / c.kelvin_per_u;
        [gain("gain_dps_s_per_k", e, 0, factor)]
            .into_iter()
            .collect()
    }
}

/// Rows that a difference of the firmware looks back.
const PAST: [u32; 9] = [1, 2, 3, 4, 5, 7, 9, 12, 16];

/// Share of the square that a further term of firmware has to take off for its words.
const WORTH_A_TERM: f64 = 0.05;

/// The slopes that firmware can take and that together come nearest to the wanted part of the output, deg/s.
///
/// Firmware has no readings to come, only differences to past ones: short ones are noisy, long ones late. Shares of
/// several that sum to one follow a steady rise exactly, and extrapolate (twice the difference over k readings
/// less that over 2 k is late in second order only) or average; least squares over the record chooses. What
/// each makes of the record is the block's own doing.
fn past_slopes(c: &Channels, f: &Words, gain_dps_s: f64, wanted: &[f64]) -> Option<Vec<Term>> {
    let (input, trial) = (f.thermometer()?, f.trial(c)?);
    let term = |share: f64, rows: u32| Term::Slope {
        gain_dps_s: share * gain_dps_s,
        input,
        rows,
    };
    let finer = (c.period_s() / f.period_s).round().max(1.0) as u32;
    // Until `MOST_SLOPE_ROWS`.
    let each = PAST.iter().map_while(|rows| {
        let rows = rows * finer;
        // As much as a jump of the thermometer over its range would make.
        let most_dps = 6.0 * gain_dps_s.abs() / (f64::from(rows) * f.period_s);
        let values = trial.taken_off(&[term(1.0, rows)], most_dps.max(1e-3))?;
        Some((rows, values))
    });
    let each: Vec<(u32, Vec<f64>)> = each.collect();
    let mut best: Option<(f64, Vec<(f64, u32)>)> = None;
    for count in 1..=3 {
        for chosen in subsets(each.len(), count) {
            let chosen: Vec<&(u32, Vec<f64>)> = chosen.iter().map(|k| &each[*k]).collect();
            let Some((off, shares)) = mixed(&chosen, wanted) else {
                continue;
            };
            let better = |b: &(f64, Vec<_>)| {
                let more = if b.1.len() < count { WORTH_A_TERM } else { 0.0 };
                off < (1.0 - more) * b.0
            };
            if best.as_ref().is_none_or(better) {
                let rows = chosen.iter().map(|c| c.0);
                best = Some((off, shares.into_iter().zip(rows).collect()));
            }
        }
    }
    let (_, parts) = best?;
    Some(parts.iter().map(|(share, k)| term(*share, *k)).collect())
}

/// All choices of `count` of the first numbers, each ascending.
fn subsets(of: usize, count: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for _ in 0..count {
        let longer = |begun: &Vec<usize>| -> Vec<Vec<usize>> {
            let next = begun.last().map_or(0, |last| last + 1);
            (next..of)
                .map(|k| [begun.as_slice(), &[k]].concat())
                .collect()
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}

/// The shares, one in sum, with which columns come nearest to the wanted one, and the square that is left.
fn mixed(columns: &[&(u32, Vec<f64>)], wanted: &[f64]) -> Option<(f64, Vec<f64>)> {
    let (first, others) = columns.split_first()?;
    let against = |column: &[f64]| -> Vec<f64> {
        let pairs = column.iter().zip(&first.1);
        pairs.map(|(v, f)| v - f).collect()
    };
    let basis = Basis::new(&others.iter().map(|o| against(&o.1)).collect::<Vec<_>>());
    let mut left = against(wanted);
    let z = basis.project_off(&mut left);
    let mut shares = basis.solve(&z);
    shares.insert(0, 1.0 - shares.iter().sum::<f64>());
    (shares.len() == columns.len()).then(|| (dot(&left, &left), shares))
}

/// Rows to each side of a slope.
const SLOPES: [usize; 5] = [1, 2, 3, 5, 9];

/// Exponential in time since power-on.
struct Warmup;

const WARMUP: Sheet = Sheet {
    id: "warmup_transient",
    physics: "self-heating and settling of references after each power-on",
    equation: "w exp(-t_on / tau)",
    parameters: &[
        Parameter {
            name: "amplitude_dps",
            plausible: (0.005, 5.0),
        },
        Parameter {
            name: "tau_s",
            plausible: (10.0, 3000.0),
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

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        let clock = if c.on_known {
            "time_since_power_on_s"
        } else {
            "time_s"
        };
        Ok(vec![clock.to_owned()])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let (_, longest) = crate::closure::channels::range(&c.on_s);
        let fastest = 1.5 * c.period_s();
        spaced(fastest, (longest / 1.5).max(2.0 * fastest), 16)
            .into_iter()
            .map(|tau| Point::at(0, &[tau.ln()]))
            .collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let tau_s = point.theta[0].exp();
        vec![map(&c.on_s, |t| (-t / tau_s).exp())]
    }

    fn spacing(&self, c: &Channels, _point: &Point) -> Vec<f64> {
        vec![((c.span_s() / c.period_s()).max(4.0)).ln() / 16.0]
    }

    fn correction(&self, _c: &Channels, e: &Estimate, _f: &mut Words) -> Option<Vec<Term>> {
        Some(vec![Term::Decay {
            gain_dps: *e.beta.first()?,
            tau_s: e.point.theta[0].exp(),
        }])
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        [gain("amplitude_dps", e, 0, 1.0), from_log("tau_s", e, 0)]
            .into_iter()
            .collect()
    }
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
mod tests {
    use super::*;

    #[test]
    fn slopes_are_mixed_to_follow_what_rises_faster_and_faster() {
        // Of t^2, over one and over two periods, against 2 t.
        let t: Vec<f64> = (0..20).map(f64::from).collect();
        let over = |k: f64| map(&t, |t| 2.0 * t - k);
        let (one, two, three) = ((1, over(1.0)), (2, over(2.0)), (3, over(3.0)));
        let (off, shares) = mixed(&[&one, &two], &over(0.0)).unwrap();
        assert!(
            off < 1e-18 && (shares[0] - 2.0).abs() < 1e-9,
            "{off} {shares:?}"
        );
        let (_, shares) = mixed(&[&one, &three], &over(2.0)).unwrap();
        assert!((shares[0] - 0.5).abs() < 1e-9 && (shares[1] - 0.5).abs() < 1e-9);
        // One alone has no choice: a steady rise is followed exactly.
        assert_eq!(mixed(&[&two], &over(0.0)).unwrap(), (80.0, vec![1.0]));
        assert_eq!(subsets(9, 3).len(), 84);
        assert_eq!(subsets(3, 2), [[0, 1], [0, 2], [1, 2]]);
    }
}
