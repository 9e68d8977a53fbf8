//! Steps at a temperature.

use super::switching::{at_jumps, ends, levels, thresholds};
use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, entry, gain, heated, map,
};
use crate::correction::Term;
use crate::thermal::channels::Channels;
use crate::thermal::firmware::{Words, knots};

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![Box::new(StressJump)]
}

/// A step at a temperature.
struct StressJump;

const STRESS_JUMP: Sheet = Sheet {
    id: "stress_jump",
    physics: "a joint (die attach, solder, lid) gives way at a temperature and comes back at the \
              same or a lower one, or never",
    equation: "the height where T is above T_s, else 0, T_s higher by the hysteresis on the way up than on the way down; or, where \
               the parts of the joint give way one after the other, height / (1 + exp(-2 (T - T_s) / width))",
    parameters: &[
        Parameter {
            name: "height_dps",
            plausible: (0.01, 5.0),
        },
        Parameter {
            name: "temperature_degc",
            plausible: (-40.0, 125.0),
        },
        Parameter {
            name: "hysteresis_k",
            plausible: (0.0, 20.0),
        },
        Parameter {
            name: "width_k",
            plausible: (0.1, 5.0),
        },
    ],
    compensable: true,
    confounders: &["mode_crossing", "thermal_lag", "ageing_drift"],
    experiment: "repeat the cycle with turning points on both sides of the step: a jump repeats, \
                 a drift does not",
    reference: "InterPACK 2007 (lead frames); Polimi 2025 (strain-gauge gyroscope)",
};

/// Forms of a step: at one temperature; with a gap; one that happens once; spread over a width; with a gap in which the record
/// begins, on the side that its first reading is farther from (what was before it decides that, and the record does not say it).
pub(super) const SHARP: usize = 0;
pub(super) const RELAY: usize = 1;
pub(super) const ONCE: usize = 2;
const SPREAD: usize = 3;
const OTHER_SIDE: usize = 4;

/// What the side costs on which a relay begins.
const OF_TWO: f64 = 1.0;

/// Widths that are tried, in u, the narrowest (a narrower one is sharp) and the widest (a wider one is a bend of the bias).
const WIDTHS: [f64; 3] = [0.012, 0.03, 0.08];
const NARROWEST: f64 = 0.01;
const WIDEST: f64 = 0.15;

/// Of a step that is spread, in u.
fn width(point: &Point) -> f64 {
    point.theta[1].exp().clamp(NARROWEST, WIDEST)
}

/// A step from 0 to 1 that is spread: the mean of sharp ones.
fn spread(point: &Point, u: f64) -> f64 {
    1.0 / (1.0 + (-2.0 * (u - point.theta[0]) / width(point)).exp())
}

/// Gaps of the hysteresis that are tried, in u.
const GAPS: [f64; 10] = [0.0, 0.04, 0.08, 0.14, 0.21, 0.3, 0.41, 0.54, 0.7, 0.9];

/// Gaps, in u, that firmware is tried with beyond the model's: what a noisy reading does not cross twice.
const WIDER: [f64; 5] = [0.002, 0.005, 0.01, 0.02, 0.04];

/// Centre and gap with which the relay of the firmware, which sees the thermometer's readings, is most often where the model's
/// is, which sees their smooth course (`wanted`, 0 or 1 a row): among equals those nearest to the model's.
fn in_readings(
    c: &Channels,
    f: &Words,
    (centre, gap): (f64, f64),
    wanted: &[f64],
    term: impl Fn(f64, f64) -> Term,
) -> Option<(f64, f64)> {
    let trial = f.trial(c)?;
    let step_dps = match term(centre, gap) {
        Term::Step { gain_dps, .. } => gain_dps,
        _ => return None,
    };
    let apart = |centre: f64, gap: f64| -> Option<usize> {
        let taken = trial.taken_off(&[term(centre, gap)], 4.0 * step_dps.abs().max(1e-3))?;
        let pairs = taken.iter().zip(wanted);
        Some(
            pairs
                .filter(|(t, w)| (**t / step_dps - **w).abs() > 0.5)
                .count(),
        )
    };
    let nearer = |best: (usize, f64, f64), centre: f64, gap: f64| {
        let rows = if best.0 > 0 { apart(centre, gap)? } else { 0 };
        Some(if rows < best.0 {
            (rows, centre, gap)
        } else {
            best
        })
    };
    let mut best = (apart(centre, gap)?, centre, gap);
    let mut others = thresholds(&c.u, centre);
    others.sort_by(|a, b| (a - centre).abs().total_cmp(&(b - centre).abs()));
    for other in others {
        best = nearer(best, other, gap)?;
    }
    for more in WIDER {
        best = nearer(best, best.1, gap + more)?;
    }
    Some((best.1, best.2))
}

/// 0 below, 1 above `centre`, by half the gap later in each direction; `once`: it never comes back.
pub fn step(u: &[f64], centre: f64, gap: f64, once: bool) -> Vec<f64> {
    let above = u.first().is_some_and(|u| *u > centre);
    stepped(u, (centre, gap), once, above)
}

/// The same from a side on which it begins.
fn stepped(u: &[f64], (centre, gap): (f64, f64), once: bool, mut above: bool) -> Vec<f64> {
    u.iter()
        .map(|u| {
            if *u > centre + 0.5 * gap {
                above = true;
            } else if *u < centre - 0.5 * gap && !once {
                above = false;
            }
            f64::from(u8::from(above))
        })
        .collect()
}

/// The same for falling temperature first: the mirror image of [`step`] with `once`.
fn once(u: &[f64], centre: f64) -> Vec<f64> {
    if u.first().is_some_and(|u| *u > centre) {
        let mirrored = map(u, |u| -u);
        return step(&mirrored, -centre, 0.0, true);
    }
    step(u, centre, 0.0, true)
}

/// The other side of a relay's beginning, where the record begins in its gap.
fn other_side(c: &Channels, point: &Point) -> Option<Point> {
    let (centre, gap) = (point.theta.first()?, point.theta.get(1)?.abs());
    let first = c.smooth_u.first()?;
    let form = match point.form {
        RELAY => OTHER_SIDE,
        OTHER_SIDE => RELAY,
        _ => return None,
    };
    ((first - centre).abs() < 0.5 * gap).then(|| Point::at(form, &point.theta))
}

impl Candidate for StressJump {
    fn sheet(&self) -> &Sheet {
        &STRESS_JUMP
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let relay = "the height where T is above T_s, else 0; T_s is higher by the hysteresis on the way up than on the way down";
        match point.form {
            SHARP => "the height where T is above T_s, else 0".to_owned(),
            RELAY => relay.to_owned(),
            OTHER_SIDE => format!(
                "{relay}; the record begins within the hysteresis, in the state that its first reading is farther from"
            ),
            SPREAD => "height / (1 + exp(-2 (T - T_s) / width))".to_owned(),
            _ => "0 until T first passes T_s, the height from then on".to_owned(),
        }
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec![heated(c)?, "time_s".to_owned()])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let mut out = Vec::new();
        let centres =
            |count: usize| (0..count).map(move |k| -0.85 + 1.7 * k as f64 / (count - 1) as f64);
        for (k, gap) in GAPS.into_iter().enumerate() {
            for centre in centres(if k == 0 { 40 } else { 30 }) {
                out.push(match k {
                    0 => Point::at(SHARP, &[centre]),
                    _ => Point::at(RELAY, &[centre, gap]),
                });
            }
        }
        let others: Vec<Point> = out.iter().filter_map(|p| other_side(c, p)).collect();
        out.extend(others);
        out.extend(centres(24).map(|centre| Point::at(ONCE, &[centre])));
        for width in WIDTHS {
            out.extend(centres(24).map(|centre| Point::at(SPREAD, &[centre, width.ln()])));
        }
        out
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let centre = point.theta[0];
        vec![match point.form {
            SHARP => step(&c.smooth_u, centre, 0.0, false),
            RELAY => step(&c.smooth_u, centre, point.theta[1].abs(), false),
            OTHER_SIDE => {
                let begins = c.smooth_u.first().is_some_and(|u| *u <= centre);
                stepped(&c.smooth_u, (centre, point.theta[1].abs()), false, begins)
            }
            SPREAD => map(&c.smooth_u, |u| spread(point, u)),
            _ => once(&c.smooth_u, centre),
        }]
    }

    fn is_local(&self) -> bool {
        true
    }

    fn surcharge(&self, _c: &Channels, point: &Point) -> f64 {
        // What happened once may be anything: a law that fits as well says what comes next.
        match point.form {
            ONCE => 4.0,
            OTHER_SIDE => OF_TWO,
            _ => 0.0,
        }
    }

    fn fine(&self, c: &Channels, _point: &Point, seen: &[bool]) -> Vec<Point> {
        // Where the temperature wanders, a step that is a little off switches at other times.
        let mut out = at_jumps(c, seen);
        for j in 0..75 {
            let centre = -0.9 + 1.8 * f64::from(j) / 74.0;
            out.push(Point::at(SHARP, &[centre]));
            out.push(Point::at(ONCE, &[centre]));
            out.extend((1..25).map(|k| Point::at(RELAY, &[centre, 0.04 * f64::from(k)])));
            out.extend(WIDTHS.map(|width| Point::at(SPREAD, &[centre, width.ln()])));
        }
        let others: Vec<Point> = out.iter().filter_map(|p| other_side(c, p)).collect();
        out.extend(others);
        out
    }

    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        match point.form {
            SPREAD => vec![width(point), 0.5],
            RELAY | OTHER_SIDE => vec![0.05; 2],
            _ => vec![0.05],
        }
    }

    fn stairs(&self, c: &Channels, point: &Point) -> (Vec<Vec<Point>>, Vec<Point>) {
        if point.form == SPREAD {
            return (Vec::new(), Vec::new());
        }
        let centre = point.theta[0];
        let gap = point.theta.get(1).map_or(0.0, |g| g.abs());
        if !matches!(point.form, RELAY | OTHER_SIDE) {
            let along = thresholds(&c.smooth_u, centre);
            let along = along.into_iter().map(|t| Point::at(point.form, &[t]));
            return (vec![along.collect()], Vec::new());
        }
        let (up, down) = (centre + 0.5 * gap, centre - 0.5 * gap);
        let of = |up: f64, down: f64| Point::at(point.form, &[0.5 * (up + down), up - down]);
        let ups = thresholds(&c.smooth_u, up).into_iter();
        let downs = thresholds(&c.smooth_u, down).into_iter();
        let axes = vec![
            ups.filter(|t| *t >= down).map(|t| of(t, down)).collect(),
            downs.filter(|t| *t <= up).map(|t| of(up, t)).collect(),
        ];
        (
            axes,
            [up, centre, down].map(|t| Point::at(SHARP, &[t])).into(),
        )
    }

    fn open(&self, c: &Channels, point: &Point, seen: &[bool]) -> Vec<Point> {
        let centre = point.theta[0];
        let starts = match point.form {
            SPREAD => return Vec::new(),
            // Where it comes back on the way down may not have been seen.
            SHARP => vec![point.clone(), Point::at(RELAY, &[centre, 0.0])],
            _ => vec![point.clone()],
        };
        let of_seen = |point: &Point| -> Vec<f64> {
            let columns = self.columns(c, &Bias::default(), point);
            let pairs = columns[0].iter().zip(seen);
            pairs.filter(|(_, seen)| **seen).map(|(v, _)| *v).collect()
        };
        let own = of_seen(point);
        let levels = levels(&c.smooth_u);
        let mut out = Vec::new();
        for start in starts {
            let mut open = vec![start];
            for axis in 0..open[0].theta.len() {
                let ends = |from: &Point| ends(from, axis, &levels, |p| of_seen(p) == own);
                open = open.iter().flat_map(ends).collect();
            }
            out.extend(open);
        }
        out
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let centre = e.point.theta[0];
        if e.point.form == ONCE && c.smooth_u.first().is_some_and(|u| *u > centre) {
            // It waits for the cold: the relay of the firmware waits for the warm only.
            return None;
        }
        let gap = match e.point.form {
            RELAY | OTHER_SIDE => e.point.theta[1].abs(),
            _ => 0.0,
        };
        let (gain_dps, input) = (*e.beta.first()?, f.thermometer()?);
        if e.point.form == SPREAD {
            let shape = |u: f64| gain_dps * spread(&e.point, u);
            // Eight knots over a width keep the linear interpolation two thousandths off.
            let count = (16.0 / width(&e.point)).clamp(129.0, 1025.0) as usize;
            return Some(vec![Term::Curve {
                input,
                values_dps: knots(count).map(shape).collect(),
            }]);
        }
        let once = e.point.form == ONCE;
        let term = |centre: f64, gap: f64| Term::Step {
            gain_dps,
            input,
            centre,
            gap,
            once,
        };
        let wanted = self.columns(c, &f.bias, &e.point).pop()?;
        let (centre, gap) =
            in_readings(c, f, (centre, gap), &wanted, term).unwrap_or((centre, gap));
        Some(vec![term(centre, gap)])
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let k = c.kelvin_per_u;
        let std = |i: usize| e.theta_std.get(i).copied().unwrap_or(0.0);
        let mut out: Reported = [
            gain("height_dps", e, 0, k.signum()),
            entry(
                "temperature_degc",
                c.middle_degc + k * e.point.theta[0],
                (k * std(0)).abs(),
            ),
        ]
        .into_iter()
        .collect();
        if matches!(e.point.form, RELAY | OTHER_SIDE) {
            let gap = e.point.theta[1].abs();
            out.insert(
                "hysteresis_k".to_owned(),
                ((k * gap).abs(), (k * std(1)).abs()),
            );
        }
        if e.point.form == SPREAD {
            let width = width(&e.point);
            let std = (k * width * std(1)).abs();
            out.insert("width_k".to_owned(), ((k * width).abs(), std));
        }
        if e.point.form == ONCE {
            out.insert("returns".to_owned(), (0.0, 0.0));
        }
        if e.point.form == OTHER_SIDE {
            let begins = c.smooth_u.first().is_some_and(|u| *u <= e.point.theta[0]);
            let warm = begins == (k > 0.0);
            out.insert("begins_warm".to_owned(), (f64::from(u8::from(warm)), 0.0));
        }
        out
    }
}

#[cfg(test)]
#[path = "step_tests.rs"]
mod tests;
