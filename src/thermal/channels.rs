//! What a record's rows say, ready for candidate effects: every channel whole, the thermometer smooth
//! and scaled.

use crate::statistics::Unusable;
use crate::statistics::blocks;
use crate::statistics::blocks::Split;
use crate::statistics::smooth::smoothed;
use crate::statistics::stats;
use std::collections::BTreeMap;

/// The channels of a record. All columns have one value a row, without holes: what was not measured
/// is interpolated in time (an applied rate counts as none).
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// s, never decreasing.
    pub time_s: Vec<f64>,
    /// Median distance of rows, s; 1 without any.
    pub(super) period_s: f64,
    /// Time since power-on, s; the record's time where it has no such column.
    pub on_s: Vec<f64>,
    /// Whether it has.
    pub on_known: bool,
    /// Output less applied rate, deg/s; NaN where not measured.
    pub error_dps: Vec<f64>,
    /// Name of the bias model's thermometer.
    pub thermometer: String,
    /// Its reading less `centre`, over `half`: -1..1.
    pub u: Vec<f64>,
    /// The same with its reading noise smoothed away, for lags, rates of change and thresholds.
    pub smooth_u: Vec<f64>,
    /// Middle of the thermometer's range, in its unit.
    pub centre: f64,
    /// Half of its range, in its unit; 1 if it did not move.
    pub half: f64,
    /// Temperature at u = 0, degC.
    pub middle_degc: f64,
    /// Change of temperature over one unit of u, K; negative for a thermometer that falls when
    /// heated.
    pub kelvin_per_u: f64,
    /// For a phase: the temperature as a resonator without phase lag elsewhere has it, tan(p - p_r),
    /// scaled to -1..1 and smooth; `None` for other thermometers, and for a phase far from resonance.
    pub tangent: Option<Vec<f64>>,
    /// A thermometer on the die beside that of the bias model, if it moves.
    pub die: Option<Other>,
    /// rms of the error that the circuit's own rounding leaves in the output, deg/s; 0 where it does not matter.
    pub rounding_dps: f64,
    /// One step of a thermometer that is read in coarse steps, in u; 0 for others.
    pub step_u: f64,
    /// All other columns but the output, by name.
    pub columns: BTreeMap<String, Vec<f64>>,
}

/// A further thermometer.
#[derive(Debug, Clone, PartialEq)]
pub struct Other {
    /// Its column.
    pub name: &'static str,
    /// Its reading scaled to -1..1.
    pub u: Vec<f64>,
    /// The same without its noise.
    pub smooth_u: Vec<f64>,
    /// Change of temperature over one unit of u, K.
    pub kelvin_per_u: f64,
}

impl Channels {
    /// From a record's columns (NaN = not measured). `degc_of` turns a reading of the thermometer into
    /// degC where no column says it.
    ///
    /// # Errors
    /// The name of a column that is needed and is not there or has no value.
    pub fn new(
        time_s: &[f64],
        columns: &BTreeMap<String, Vec<f64>>,
        thermometer: &str,
        degc_of: impl Fn(f64) -> f64,
    ) -> Result<Self, String> {
        let absent = |name: &str| name.to_owned();
        let output = columns
            .get("rate_out_dps")
            .ok_or_else(|| absent("rate_out_dps"))?;
        let reading = columns
            .get(thermometer)
            .ok_or_else(|| absent(thermometer))?;
        let reading = filled(time_s, reading).ok_or_else(|| absent(thermometer))?;
        let mut others = BTreeMap::new();
        for (name, values) in columns {
            let whole = if name == "rate_dps" {
                let at_rest = |v: &f64| if v.is_nan() { 0.0 } else { *v };
                Some(values.iter().map(at_rest).collect())
            } else {
                filled(time_s, values)
            };
            if let Some(whole) = whole
                && !["rate_out_dps", "time_since_power_on_s", thermometer].contains(&name.as_str())
            {
                others.insert(name.clone(), whole);
            }
        }
        let rate = others.get("rate_dps");
        let error_dps = output
            .iter()
            .enumerate()
            .map(|(i, o)| o - rate.map_or(0.0, |r| r[i]))
            .collect();
        let (low, high) = range(&reading);
        let centre = 0.5 * (low + high);
        let half = if high > low { 0.5 * (high - low) } else { 1.0 };
        let u: Vec<f64> = reading.iter().map(|r| (r - centre) / half).collect();
        let on = columns
            .get("time_since_power_on_s")
            .and_then(|c| since_power_on(time_s, c));
        let mut out = Channels {
            time_s: time_s.to_vec(),
            period_s: period_s(time_s),
            on_known: on.is_some(),
            on_s: on.unwrap_or_else(|| time_s.to_vec()),
            error_dps,
            thermometer: thermometer.to_owned(),
            smooth_u: smoothed(time_s, &u),
            u,
            centre,
            half,
            middle_degc: 0.0,
            kelvin_per_u: 1.0,
            tangent: None,
            die: None,
            rounding_dps: 0.0,
            step_u: 0.0,
            columns: others,
        };
        out.tangent = out.tangent_of_phase();
        out.die = out.other("die_degc");
        (out.middle_degc, out.kelvin_per_u) = out.temperature(thermometer, degc_of);
        Ok(out)
    }

    /// The record with the output of the given rows alone, NaN in all others: for whatever must not depend on these.
    pub fn seen(&self, rows: &[bool]) -> Self {
        let mut out = self.clone();
        let errors = out.error_dps.iter_mut().zip(rows);
        errors
            .filter(|(_, row)| !**row)
            .for_each(|(e, _)| *e = f64::NAN);
        out
    }

    /// What the output was, deg/s; NaN where not measured.
    pub fn output_dps(&self) -> Vec<f64> {
        let rate = self.column("rate_dps");
        let each = self.error_dps.iter().enumerate();
        each.map(|(i, e)| e + rate.map_or(0.0, |r| r[i])).collect()
    }

    /// Whether the power came back within the record.
    pub fn restarts(&self) -> bool {
        self.on_s.windows(2).any(|w| w[1] < w[0])
    }

    /// Which rows are fitted, which choose and which judge, by times and inputs alone.
    ///
    /// # Errors
    /// Too few rows.
    pub fn split(&self) -> Result<Split, Unusable> {
        let names = self.columns.keys().filter(|name| *name != "time_s");
        let mut cared: Vec<&[f64]> = names.filter_map(|name| self.moving(name)).collect();
        // What begins anew with the power is seen after each power-on alone.
        cared.extend(self.restarts().then_some(&self.on_s[..]));
        blocks::split(&self.time_s, &self.u, &cared)
    }

    /// (temperature at u = 0, change per u): the thermometer itself, another one by regression, or
    /// the given law.
    fn temperature(&self, thermometer: &str, degc_of: impl Fn(f64) -> f64) -> (f64, f64) {
        if thermometer.ends_with("_degc") {
            return (self.centre, self.half);
        }
        for name in ["die_degc", "chamber_degc"] {
            let Some(t) = self.columns.get(name) else {
                continue;
            };
            let n = t.len().max(1) as f64;
            let (mu, mt) = (mean(&self.u), mean(t));
            let pairs = || self.u.iter().zip(t);
            let cov: f64 = pairs().map(|(u, t)| (u - mu) * (t - mt)).sum::<f64>() / n;
            let var: f64 = self.u.iter().map(|u| (u - mu).powi(2)).sum::<f64>() / n;
            if var > 0.0 && cov != 0.0 {
                return (mt - cov / var * mu, cov / var);
            }
        }
        let (low, high) = (
            degc_of(self.centre - self.half),
            degc_of(self.centre + self.half),
        );
        (0.5 * (low + high), 0.5 * (high - low))
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// A column other than time, thermometer and output.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.get(name).map(Vec::as_slice)
    }

    /// The same if it moves at all.
    pub fn moving(&self, name: &str) -> Option<&[f64]> {
        self.column(name).filter(|c| {
            let (low, high) = range(c);
            high > low
        })
    }

    /// A column scaled to -1..1; `None` if it does not move.
    pub fn scaled(&self, name: &str) -> Option<Vec<f64>> {
        self.moving(name).map(|c| scaled(c).0)
    }

    /// True if the temperature only rises, or only falls: nearly all of its way leads from the first reading to
    /// the last.
    pub fn goes_one_way(&self) -> bool {
        const STRETCHES: usize = 40;
        const SHARE: f64 = 0.9;
        let every = (self.len() / STRETCHES).max(1);
        let coarse: Vec<f64> = self.smooth_u.iter().step_by(every).copied().collect();
        let way: f64 = coarse.windows(2).map(|w| (w[1] - w[0]).abs()).sum();
        let ends = coarse.first().zip(coarse.last());
        way > 0.0 && ends.is_some_and(|(a, b)| (b - a).abs() > SHARE * way)
    }

    /// Duration, s.
    pub fn span_s(&self) -> f64 {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(a), Some(b)) => b - a,
            _ => 0.0,
        }
    }

    /// Median distance of rows, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }
}

/// Median distance of rows, s; 1 without any.
fn period_s(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.retain(|s| *s > 0.0);
    if steps.is_empty() {
        return 1.0;
    }
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// (least, greatest); (0, 0) of nothing.
pub fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .filter(|v| v.is_finite())
        .fold(None, |r: Option<(f64, f64)>, v| {
            Some(r.map_or((*v, *v), |(a, b)| (a.min(*v), b.max(*v))))
        })
        .unwrap_or((0.0, 0.0))
}

/// Arithmetic mean; 0 of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Scaled to -1..1, with the middle and half of the range; all 0 if it does not move.
pub fn scaled(values: &[f64]) -> (Vec<f64>, f64, f64) {
    let (low, high) = range(values);
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let of = |v: &f64| if half > 0.0 { (v - middle) / half } else { 0.0 };
    (values.iter().map(of).collect(), middle, half)
}

/// Times the usual change from row to row that a channel has to change across a hole for a step.
const STEPS: f64 = 10.0;

/// Holes filled linearly in time, at the ends by the nearest value, and so where the channel steps, for halfway it
/// never was; `None` without any value.
pub fn filled(time_s: &[f64], values: &[f64]) -> Option<Vec<f64>> {
    let known: Vec<usize> = (0..values.len().min(time_s.len()))
        .filter(|i| values[*i].is_finite())
        .collect();
    let (first, last) = (*known.first()?, *known.last()?);
    if known.len() == time_s.len() {
        return Some(values.to_vec());
    }
    let change = |w: &[usize]| (values[w[1]] - values[w[0]]).abs() / (w[1] - w[0]) as f64;
    let changes: Vec<f64> = known.windows(2).map(change).collect();
    let usual = stats::median(&changes);
    let mut next = 0;
    let at = |i: usize| {
        while next < known.len() && known[next] < i {
            next += 1;
        }
        if i <= first {
            return values[first];
        }
        if i >= last {
            return values[last];
        }
        let (a, b) = (known[next - 1], known[next]);
        let width = time_s[b] - time_s[a];
        let share = match (width > 0.0, change(&[a, b]) > STEPS * usual) {
            (true, false) => (time_s[i] - time_s[a]) / width,
            (true, true) => f64::from(u8::from(time_s[i] - time_s[a] > 0.5 * width)),
            (false, _) => 0.5,
        };
        values[a] + share * (values[b] - values[a])
    };
    Some((0..time_s.len()).map(at).collect())
}

/// Times since power-on with their holes filled: a hole before which there was no power-on, or after
/// it, goes on with the clock. `None` without any value.
fn since_power_on(time_s: &[f64], values: &[f64]) -> Option<Vec<f64>> {
    let mut out = values.to_vec();
    // Both clocks are rounded: a row at power-on may seem to be a little before it.
    let rounding_s = 0.01 * period_s(time_s);
    let mut next = None;
    for i in (0..out.len()).rev() {
        if out[i].is_finite() {
            next = Some(i);
        } else if let Some(b) = next {
            // Negative: it was before the power-on that the later value counts from.
            let back = values[b] - (time_s[b] - time_s[i]);
            out[i] = if back >= -rounding_s {
                back.max(0.0)
            } else {
                f64::NAN
            };
        }
    }
    let mut before = None;
    for i in 0..out.len() {
        if out[i].is_finite() {
            before = Some(i);
        } else if let Some(a) = before {
            out[i] = out[a] + (time_s[i] - time_s[a]);
        }
    }
    filled(time_s, &out)
}

/// First-order lag with time constant `tau_s`: tau y' = x - y, x straight between rows, y(0) = x(0).
pub fn lag(time_s: &[f64], values: &[f64], tau_s: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(values.len());
    let mut y = values.first().copied().unwrap_or(0.0);
    for i in 0..values.len() {
        if i > 0 {
            let dt = time_s[i] - time_s[i - 1];
            let (x0, x1) = (values[i - 1], values[i]);
            if dt > 0.0 {
                let trail = (x1 - x0) / dt * tau_s;
                y = x1 - trail + (y - x0 + trail) * (-dt / tau_s).exp();
            }
        }
        out.push(y);
    }
    out
}
