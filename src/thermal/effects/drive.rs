//! Effects of the drive loop: damping and amplitude.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, UNUSUAL, entry, gain,
    map, moving, spaced,
};
use crate::correction::Term;
use crate::statistics::linear::Basis;
use crate::thermal::channels::Channels;
use crate::thermal::firmware::Words;

/// All of this file.
pub fn all(c: &Channels) -> Vec<Box<dyn Candidate>> {
    vec![Box::new(Damping), Box::new(Coupling::new(c))]
}

/// Bias through damping, which the drive gain follows.
struct Damping;

const DAMPING: Sheet = Sheet {
    id: "damping_bias",
    physics: "anisotropic damping turns part of the drive's motion into the sense axis in phase with \
              the rate: it goes as 1/Q, as the drive gain does; a changing Q also bends the phase",
    equation: "k (d - 1), d = 1 / Q relative; and B(p') - B(p), tan(p' - p_r) = d tan(p - p_r), p_r at or near a \
               quarter turn; d = g, or, of a drive off its resonance, g cos(m (p - p_r)), m (p - p_r) being the structure's \
               part of the phase",
    parameters: &[
        Parameter {
            name: "gain_dps",
            plausible: (0.01, 20.0),
        },
        Parameter {
            name: "share_of_phase_bend",
            plausible: (0.5, 1.5),
        },
        Parameter {
            name: "resonance_off_rad",
            plausible: (-0.6, 0.6),
        },
        Parameter {
            name: "structural_share_of_phase",
            plausible: (0.1, 1.0),
        },
    ],
    compensable: true,
    confounders: &["amplitude_phase_coupling", "bias_third_order"],
    experiment: "ring the drive down: Q directly; or step the amplitude's set point at constant Q",
    reference: "IEEE Std 1431, annex B; Weinberg & Kourepenis 2006",
};

/// Where the phase's own delay puts the resonance beside a quarter turn: places of the search, and the most, rad.
const OFF_RAD: [f64; 4] = [-0.35, -0.15, 0.15, 0.35];
const MOST_OFF_RAD: f64 = 0.6;

/// From here on it is unusual: far from its resonance a bend is the same at all temperatures, as a pull is.
const USUAL_OFF_RAD: f64 = 0.1;

/// Shapes of the effect: the gain's own, the phase's bend, both; from [`SHAPES`] on, of a drive off its resonance.
const SHAPES: usize = 3;

/// How much of the measured phase is the structure's: shares of the search, and the least. The rest is the electronics'.
const STRUCTURAL: [f64; 2] = [0.3, 1.0];
const LEAST_STRUCTURAL: f64 = 0.1;

/// Largest angle between phase and resonance, rad: beyond it tangents say nothing.
const STEEP_RAD: f64 = 1.5;

/// One row in so many, those whose gain is next to 1, say what the gain is relative to.
const NOMINAL: usize = 20;

/// Most bias per unit of the gain, deg/s, twenty times what is plausible: beyond it the gain does not act, but stands in
/// for the thermometer, next to whose square it differs by a little.
const MOST_DPS: f64 = 400.0;

impl Candidate for Damping {
    fn sheet(&self) -> &Sheet {
        &DAMPING
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let (by_gain, bend) = ("k (d - 1)", "share (B(p') - B(p))");
        let law = match point.form % SHAPES {
            0 => return format!("{by_gain}, d = g, the drive gain"),
            1 => bend.to_owned(),
            _ => format!("{by_gain} + {bend}"),
        };
        let (angle, damping) = match point.form >= SHAPES {
            true => ("m (p - p_r)", "g cos(a) over its value where g is 1"),
            false => ("p - p_r", "g"),
        };
        let off = if point.theta.is_empty() {
            ""
        } else {
            " + resonance_off_rad"
        };
        format!(
            "{law}, p' - p = atan(d tan(a)) - a, a = {angle}, d = {damping}, g the drive gain, p_r a quarter turn{off}"
        )
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        moving(c, "agc")?;
        Ok(vec!["agc".to_owned()])
    }

    fn channels_at(&self, c: &Channels, point: &Point) -> Vec<String> {
        let mut out = vec!["agc".to_owned()];
        if point.form > 0 {
            out.push(c.thermometer.clone());
        }
        out
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        if c.thermometer != "phase_rad" {
            return vec![Point::form(0)];
        }
        let bent = || [1, 2].into_iter();
        let off = bent().flat_map(|form| OFF_RAD.map(|off_rad| Point::at(form, &[off_rad])));
        let places = || OFF_RAD.into_iter().chain([0.0]);
        let detuned = bent().flat_map(|form| {
            let each = STRUCTURAL.into_iter();
            each.flat_map(move |m| places().map(move |o| Point::at(SHAPES + form, &[o, m])))
        });
        let plain = (0..SHAPES).map(Point::form);
        plain.chain(off).chain(detuned).collect()
    }

    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        map(&point.theta, |_| OFF_RAD[2])
    }

    /// Each of its forms: the step is often taken in one that has half of the effect.
    fn fine(&self, c: &Channels, _point: &Point, _seen: &[bool]) -> Vec<Point> {
        self.points(c)
    }

    fn columns(&self, c: &Channels, bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let mut all = self.columns_of(c, std::slice::from_ref(bias), point);
        all.pop().unwrap_or_default()
    }

    fn columns_of(&self, c: &Channels, biases: &[Bias], point: &Point) -> Vec<Vec<Vec<f64>>> {
        let Some(g) = c.column("agc") else {
            return vec![Vec::new(); biases.len()];
        };
        let off_rad = point.theta.first().copied().unwrap_or(0.0);
        let resonance = c.resonance_rad() + off_rad.clamp(-MOST_OFF_RAD, MOST_OFF_RAD);
        let share = point.theta.get(1).copied().unwrap_or(1.0);
        let share = share.clamp(LEAST_STRUCTURAL, 1.0);
        let from_resonance = |u: f64| {
            let rad = share * (c.centre + c.half * u - resonance);
            rad.clamp(-STEEP_RAD, STEEP_RAD)
        };
        let form = point.form % SHAPES;
        let (bends, is_detuned) = (form != 0, point.form >= SHAPES);
        let angles = match bends || is_detuned {
            true => map(&c.u, from_resonance),
            false => Vec::new(),
        };
        let damping = match is_detuned {
            true => detuned(g, &angles),
            false => g.to_vec(),
        };
        let bent_u: Vec<f64> = match bends {
            true => {
                let rows = c.u.iter().zip(&damping).zip(&angles);
                let bent = rows.map(|((u, d), a)| u + ((d * a.tan()).atan() - a) / c.half);
                bent.collect()
            }
            false => Vec::new(),
        };
        let plain = map(&damping, |d| d - 1.0);
        let bend = |bias: &Bias| moved(&c.u, &bent_u, bias);
        let each = biases.iter().map(|bias| match form {
            0 => vec![plain.clone()],
            1 => vec![bend(bias)],
            _ => vec![plain.clone(), bend(bias)],
        });
        each.collect()
    }

    fn acts_on_bias(&self) -> bool {
        true
    }

    fn admits(&self, _c: &Channels, point: &Point, beta: &[f64]) -> bool {
        // Less Q bends the phase one way; where the resonance is free as well, by what physics says.
        let (least, most) = match point.theta.is_empty() {
            true => (0.0, f64::INFINITY),
            false => DAMPING.parameters[1].plausible,
        };
        let bends = |share: &f64| (least..=most).contains(share);
        let (by_gain, by_bend) = match point.form % SHAPES {
            0 => (beta.first(), None),
            1 => (None, beta.last()),
            _ => (beta.first(), beta.last()),
        };
        by_gain.is_none_or(|b| b.abs() <= MOST_DPS) && by_bend.is_none_or(bends)
    }

    fn surcharge(&self, _c: &Channels, point: &Point) -> f64 {
        if point.form % SHAPES == 2 { 2.0 } else { 0.0 }
    }

    fn odds_against(&self, _c: &Channels, point: &Point) -> f64 {
        let off_rad = point.theta.first().map_or(0.0, |off| off.abs());
        UNUSUAL * (off_rad / USUAL_OFF_RAD).ln().max(0.0)
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let columns = self.columns(c, &f.bias.clone(), &e.point);
        f.surface(c, "agc", &columns, &e.beta)
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        let names: &[&str] = match e.point.form % SHAPES {
            0 => &["gain_dps"],
            1 => &["share_of_phase_bend"],
            _ => &["gain_dps", "share_of_phase_bend"],
        };
        let each = names.iter().enumerate();
        let free = ["resonance_off_rad", "structural_share_of_phase"].iter();
        let off = free.zip(e.point.theta.iter().zip(&e.theta_std));
        let off = off.map(|(name, (value, std))| entry(name, *value, *std));
        each.map(|(k, name)| gain(name, e, k, 1.0))
            .chain(off)
            .collect()
    }
}

/// What a bias is at other readings than those that are there, less what it is at these.
fn moved(from_u: &[f64], to_u: &[f64], bias: &Bias) -> Vec<f64> {
    let pairs = from_u.iter().zip(to_u);
    pairs
        .map(|(from, to)| bias.at(*to) - bias.at(*from))
        .collect()
}

/// The damping, relative, of a drive that is held at its amplitude off resonance: the force has the elastic part as well,
/// g = sqrt(d^2 + t^2) with t = d tan(angle), the angle that of the phase from resonance; where the gain is 1, so is the damping.
fn detuned(g: &[f64], angle_rad: &[f64]) -> Vec<f64> {
    let damping: Vec<f64> = g.iter().zip(angle_rad).map(|(g, a)| g * a.cos()).collect();
    let mut order: Vec<usize> = (0..g.len()).filter(|k| damping[*k].is_finite()).collect();
    let near = order.len().div_ceil(NOMINAL).max(1);
    let off = |k: &usize| (g[*k] - 1.0).abs();
    if near < order.len() {
        // The first of equal ones.
        order.select_nth_unstable_by(near, |a, b| off(a).total_cmp(&off(b)).then(a.cmp(b)));
    }
    let sum: f64 = order.iter().take(near).map(|k| damping[*k]).sum();
    let nominal = sum / near as f64;
    map(&damping, |d| d / nominal)
}

/// The drive's amplitude pulls the measured phase.
struct Coupling {
    /// By form, the course of the pull and its largest magnitude.
    pulls: Vec<(Vec<f64>, f64)>,
}

impl Coupling {
    fn new(c: &Channels) -> Self {
        let pulls = |g| (0..PULLS).map(|form| pulls(g, c, form)).collect();
        Coupling {
            pulls: c.column("agc").map(pulls).unwrap_or_default(),
        }
    }
}

const COUPLING: Sheet = Sheet {
    id: "amplitude_phase_coupling",
    physics: "a stiffening spring moves the resonance with the drive's amplitude (Duffing), so the \
              measured phase, the thermometer, errs with the drive gain",
    equation: "B(p - k (g^n - 1)) - B(p), n = 1 or 2",
    parameters: &[Parameter {
        name: "pull_rad",
        plausible: (1e-4, 0.3),
    }],
    compensable: true,
    confounders: &["damping_bias"],
    experiment: "step the amplitude's set point by 30 % at two temperatures: the error follows the \
                 bias curve's slope, damping's does not",
    reference: "(3/8)(k3/k1) A^2 of a Duffing resonator; Chen et al. 2004, eq. 7",
};

impl Candidate for Coupling {
    fn sheet(&self) -> &Sheet {
        &COUPLING
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let square = if point.form % 2 == 1 { "^2" } else { "" };
        let pull = format!("k (g{square} - 1)");
        let law = match point.theta.is_empty() {
            true => format!("-{pull} B'(p)"),
            false => format!("B(p - {pull}) - B(p)"),
        };
        let gain = match point.form < 2 {
            true => "the drive gain",
            false => "the drive gain over its course in temperature",
        };
        format!("{law}, g {gain}")
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        if c.thermometer != "phase_rad" {
            return Err(Missing::Channel("phase_rad".to_owned()));
        }
        moving(c, "agc")?;
        Ok(vec!["agc".to_owned(), "phase_rad".to_owned()])
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        // Small pulls, along the curve's slope; large ones by the curve itself.
        let large = (0..2).flat_map(|form| LARGE.map(|most_u| Point::at(form, &[most_u])));
        (0..PULLS).map(Point::form).chain(large).collect()
    }

    /// Every form: which one it is shows only when the others' spikes are gone.
    fn fine(&self, _c: &Channels, _point: &Point, _seen: &[bool]) -> Vec<Point> {
        let large = spaced(0.02, 2.0, 8).into_iter();
        let large = large.flat_map(|most_u| [most_u, -most_u]);
        let large = large.flat_map(|most_u| (0..PULLS).map(move |f| Point::at(f, &[most_u])));
        (0..PULLS).map(Point::form).chain(large).collect()
    }

    fn columns(&self, c: &Channels, bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let mut all = self.columns_of(c, std::slice::from_ref(bias), point);
        all.pop().unwrap_or_default()
    }

    fn columns_of(&self, c: &Channels, biases: &[Bias], point: &Point) -> Vec<Vec<Vec<f64>>> {
        let Some((pull, most)) = self.pulls.get(point.form) else {
            return vec![Vec::new(); biases.len()];
        };
        let rows = || c.u.iter().zip(pull);
        let Some(most_u) = point.theta.first() else {
            let along = |b: &Bias| vec![rows().map(|(u, d)| -b.slope(*u) * d).collect()];
            return biases.iter().map(along).collect();
        };
        let k = most_u / most;
        let pulled_u: Vec<f64> = rows().map(|(u, d)| u - k * d).collect();
        let each = biases.iter().map(|b| vec![moved(&c.u, &pulled_u, b)]);
        each.collect()
    }

    fn is_sized(&self, point: &Point) -> bool {
        !point.theta.is_empty()
    }

    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        map(&point.theta, |most_u| (0.2 * most_u.abs()).max(0.01))
    }

    fn acts_on_bias(&self) -> bool {
        true
    }

    fn admits(&self, _c: &Channels, point: &Point, beta: &[f64]) -> bool {
        // Beside a bias that hardly moves, a small pull would have to be a huge one.
        let small = beta.first().filter(|_| point.theta.is_empty());
        small.is_none_or(|pull_u| pull_u.abs() <= MOST_PULL_U)
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let columns = self.columns(c, &f.bias.clone(), &e.point);
        f.surface(c, "agc", &columns, &e.beta)
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let Some(most_u) = e.point.theta.first() else {
            return [gain("pull_rad", e, 0, c.half)].into_iter().collect();
        };
        let most = self.pulls.get(e.point.form).map_or(1.0, |pull| pull.1);
        let per_unit = c.half / most;
        let std = e.theta_std.first().copied().unwrap_or(0.0);
        [entry("pull_rad", most_u * per_unit, (std * per_unit).abs())]
            .into_iter()
            .collect()
    }
}

/// Courses of the pull: the drive gain's first and second power, and those of the amplitude, which is the gain without Q's
/// course in temperature.
const PULLS: usize = 4;

/// Most pull per unit of the gain, in units of u: three times the largest that is plausible, over a range of a milliradian.
const MOST_PULL_U: f64 = 1000.0;

/// Largest pulls, in units of u, at which the search looks.
const LARGE: [f64; 6] = [0.15, -0.15, 0.4, -0.4, 1.0, -1.0];

/// The course of a form's pull by the drive gain, and its largest magnitude.
fn pulls(g: &[f64], c: &Channels, form: usize) -> (Vec<f64>, f64) {
    let source = match form {
        0 | 1 => g.to_vec(),
        _ => without_temperature(g, &c.u),
    };
    let pull = map(&source, |g| g.powi(1 + form as i32 % 2) - 1.0);
    let most = pull.iter().fold(f64::MIN_POSITIVE, |m, d| m.max(d.abs()));
    (pull, most)
}

/// A gain over its own quadratic in temperature.
fn without_temperature(g: &[f64], u: &[f64]) -> Vec<f64> {
    let powers: Vec<Vec<f64>> = (0..3).map(|k| map(u, |u| u.powi(k))).collect();
    let basis = Basis::new(&powers);
    let mut rest = g.to_vec();
    basis.project_off(&mut rest);
    let pairs = g.iter().zip(&rest);
    pairs
        .map(|(g, r)| if g == r { 1.0 } else { g / (g - r) })
        .collect()
}

#[cfg(test)]
#[path = "drive_tests.rs"]
mod tests;
