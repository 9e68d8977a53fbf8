//! The user's own effects (`[[effects]]` of the design): a formula in the record's columns. Amplitudes
//! are coefficients of columns; parameters with a range make the shape, and are looked for on a grid as
//! fine as the record tells their values apart.

use super::{Bias, Candidate, Estimate, Missing, Point, Reported, Sheet, entry, gain};
use crate::approx::real::formula::Operand;
use crate::correction::Term;
use crate::design::UserEffect;
use crate::statistics::linear::{Basis, dot};
use crate::thermal::channels::{Channels, range};
use crate::thermal::firmware::{Words, knots, sees};

/// Most points of the grid over all axes, and those that it starts from.
const MOST_POINTS: [usize; 3] = [400, 20, 7];
const FIRST_POINTS: [usize; 3] = [17, 9, 5];

/// Neighbouring shapes that are less alike than this (cosine, the declared model taken out) get a
/// point between them.
const ALIKE: f64 = 0.7;

/// A range whose ends have at least this ratio is searched in equal ratios.
const DECADES: f64 = 4.0;

/// By how much a user's effect is preferred among equals: who writes it down has a reason to.
const PREFERRED: f64 = 0.1;

/// Knots of an effect that is a curve in the thermometer.
const KNOTS: usize = 513;

const USER: Sheet = Sheet {
    id: "user",
    physics: "declared in the design",
    equation: "a formula of the design",
    parameters: &[],
    compensable: true,
    confounders: &[],
    experiment: "move the columns of the formula one at a time, everything else held",
    reference: "the design file",
};

/// A user's effect in one record.
pub struct User {
    effect: UserEffect,
    /// The formula's columns, or why it cannot be judged.
    columns: Result<Vec<(String, Vec<f64>)>, Missing>,
    axes: Vec<Axis>,
    points: Vec<Point>,
    /// True if the record tells more values apart than the grid has.
    pub is_coarse: bool,
}

/// A parameter with a range.
#[derive(Debug, Clone, PartialEq)]
struct Axis {
    low: f64,
    high: f64,
    is_log: bool,
    start: Option<f64>,
    /// Grid in its own coordinate, ascending.
    grid: Vec<f64>,
}

impl Axis {
    /// The value at a coordinate, held within the range.
    fn value(&self, theta: f64) -> f64 {
        let value = if self.is_log { theta.exp() } else { theta };
        value.clamp(self.low, self.high)
    }

    fn coordinate(&self, value: f64) -> f64 {
        if self.is_log { value.ln() } else { value }
    }

    /// Distance of the grid's points around a coordinate.
    fn spacing(&self, theta: f64) -> f64 {
        let after = self.grid.partition_point(|g| *g <= theta);
        let at = after.clamp(1, self.grid.len().saturating_sub(1).max(1));
        match (self.grid.get(at - 1), self.grid.get(at)) {
            (Some(a), Some(b)) => b - a,
            _ => 0.1 * (self.coordinate(self.high) - self.coordinate(self.low)),
        }
    }
}

/// The user's effects for a record.
pub fn all(effects: &[UserEffect], c: &Channels) -> Vec<User> {
    effects.iter().map(|e| User::new(e, c)).collect()
}

impl User {
    /// The effect in a record; lays its grid.
    pub fn new(effect: &UserEffect, c: &Channels) -> Self {
        let axes = effect
            .shapes()
            .map(|(_, r)| Axis {
                low: r.low,
                high: r.high,
                is_log: r.low > 0.0 && r.high >= DECADES * r.low,
                start: r.start,
                grid: Vec::new(),
            })
            .collect();
        let mut out = User {
            effect: effect.clone(),
            columns: columns(effect, c),
            axes,
            points: Vec::new(),
            is_coarse: false,
        };
        if out.columns.is_ok() {
            out.lay_grid(c);
        }
        out
    }

    /// What the user should know of: (code, message).
    pub fn remarks(&self) -> Option<(&'static str, String)> {
        let id = &self.effect.id;
        match &self.columns {
            Err(Missing::Channel(name)) => Some((
                "effect_without_channel",
                format!(
                    "the effect {id} of the design needs the column {name}, which the record does not have"
                ),
            )),
            Err(Missing::Excitation(why)) => Some((
                "effect_not_judged",
                format!("the effect {id} of the design cannot be judged: {why}"),
            )),
            Ok(_) if self.is_coarse => Some((
                "effect_range_wide",
                format!(
                    "the effect {id} of the design has ranges in which this record tells more values apart than are \
                     tried: it may be missed; give narrower ranges or a start"
                ),
            )),
            Ok(_) => None,
        }
    }

    /// The formula's value with parameters at a point, for each amplitude the column that it multiplies.
    fn shapes(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let Ok(columns) = &self.columns else {
            return Vec::new();
        };
        let rows = columns.first().map_or(0, |c| c.1.len());
        let amplitudes = self.effect.amplitudes().count();
        let of = |k: usize| {
            self.effect.formula.values(
                &self.operands(theta, Some(k), |name| {
                    let found = columns.iter().find(|(n, _)| n == name);
                    found.map(|(_, values)| Operand::Column(values))
                }),
                rows,
            )
        };
        (0..amplitudes.max(1)).map(of).collect()
    }

    /// The operands in the formula's order: parameters at `theta`, amplitude `one` as 1 and the others as
    /// 0, columns by `column`.
    fn operands<'a>(
        &self,
        theta: &[f64],
        one: Option<usize>,
        column: impl Fn(&str) -> Option<Operand<'a>>,
    ) -> Vec<Operand<'a>> {
        let names = self.effect.formula.names().iter();
        names
            .map(|name| {
                let shape = self.effect.shapes().position(|(p, _)| p.name == *name);
                if let Some((axis, t)) =
                    shape.and_then(|k| Some((self.axes.get(k)?, theta.get(k)?)))
                {
                    return Operand::Number(axis.value(*t));
                }
                match self.effect.amplitudes().position(|p| p.name == *name) {
                    Some(k) => Operand::Number(if one == Some(k) { 1.0 } else { 0.0 }),
                    None => column(name).unwrap_or(Operand::Number(f64::NAN)),
                }
            })
            .collect()
    }

    /// Lays a grid over the axes; without a point that has a value, the effect cannot be judged.
    fn lay_grid(&mut self, c: &Channels) {
        let declared = Basis::new(&crate::thermal::search::declared(c));
        let middle: Vec<f64> = self
            .axes
            .iter()
            .map(|a| 0.5 * (a.coordinate(a.low) + a.coordinate(a.high)))
            .collect();
        for k in 0..self.axes.len() {
            let shape = |t: f64| -> Vec<Vec<f64>> {
                let mut theta = middle.clone();
                theta[k] = t;
                let mut shapes = self.shapes(&theta);
                for column in &mut shapes {
                    declared.project_off(column);
                }
                shapes
            };
            let (grid, coarse) = laid(&self.axes[k], self.axes.len(), shape);
            self.axes[k].grid = grid;
            self.is_coarse |= coarse;
        }
        let mut thetas: Vec<Vec<f64>> = vec![Vec::new()];
        for axis in &self.axes {
            let with = |theta: &Vec<f64>, t: &f64| [theta.as_slice(), &[*t]].concat();
            thetas = thetas
                .iter()
                .flat_map(|theta| axis.grid.iter().map(move |t| with(theta, t)))
                .collect();
        }
        let has_value = |theta: &Vec<f64>| {
            let mut values = self.shapes(theta).into_iter().flatten();
            values.all(f64::is_finite)
        };
        let total = thetas.len();
        thetas.retain(has_value);
        if thetas.is_empty() && total > 0 {
            let why = "the formula has no finite value in some row, whatever its parameters";
            self.columns = Err(Missing::Excitation(why.to_owned()));
        }
        self.points = thetas.iter().map(|t| Point::at(0, t)).collect();
    }

    /// Its columns but the thermometer.
    fn others(&self, c: &Channels) -> Vec<&str> {
        let names = self.effect.columns();
        names.filter(|name| *name != c.thermometer).collect()
    }

    /// The curve in the thermometer that the effect is.
    fn curve(&self, c: &Channels, e: &Estimate) -> Option<Vec<f64>> {
        let readings: Vec<f64> = knots(KNOTS).map(|u| c.centre + c.half * u).collect();
        let column = |name: &str| (name == c.thermometer).then_some(Operand::Column(&readings));
        let mut sum = vec![0.0; KNOTS];
        for (k, b) in e.beta.iter().enumerate() {
            let operands = self.operands(&e.point.theta, Some(k), column);
            let shape = self.effect.formula.values(&operands, KNOTS);
            crate::statistics::linear::add_scaled(&mut sum, *b, &shape);
        }
        sum.iter().all(|v| v.is_finite()).then_some(sum)
    }
}

/// The formula's columns.
fn columns(effect: &UserEffect, c: &Channels) -> Result<Vec<(String, Vec<f64>)>, Missing> {
    let of = |name: &str| -> Option<Vec<f64>> {
        Some(match name {
            "time_s" => c.time_s.clone(),
            "time_since_power_on_s" if c.on_known => c.on_s.clone(),
            name if name == c.thermometer => c.u.iter().map(|u| c.centre + c.half * u).collect(),
            name => c.column(name)?.to_vec(),
        })
    };
    let named = |name: &str| {
        let column = of(name).ok_or_else(|| Missing::Channel(name.to_owned()))?;
        Ok((name.to_owned(), column))
    };
    let columns: Vec<(String, Vec<f64>)> = effect.columns().map(named).collect::<Result<_, _>>()?;
    let moves = |column: &[f64]| {
        let (low, high) = range(column);
        high > low
    };
    if !columns.iter().any(|(_, column)| moves(column)) {
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        return Err(Missing::Excitation(format!(
            "{} does not move in this record",
            names.join(", ")
        )));
    }
    Ok(columns)
}

/// The points of an axis: neighbours that are less than [`ALIKE`] get one between them, the least alike
/// first, up to a limit for the number of axes. True if that limit was met.
fn laid(axis: &Axis, axes: usize, shape: impl Fn(f64) -> Vec<Vec<f64>>) -> (Vec<f64>, bool) {
    let at = axes.clamp(1, MOST_POINTS.len()) - 1;
    let (first, most) = (FIRST_POINTS[at], MOST_POINTS[at]);
    let (low, high) = (axis.coordinate(axis.low), axis.coordinate(axis.high));
    let mut grid: Vec<(f64, Vec<Vec<f64>>)> = (0..first)
        .map(|k| low + (high - low) * k as f64 / (first - 1) as f64)
        .map(|t| (t, shape(t)))
        .collect();
    let mut likeness: Vec<f64> = grid.windows(2).map(|w| alike(&w[0].1, &w[1].1)).collect();
    let mut coarse = false;
    loop {
        let worst = likeness
            .iter()
            .enumerate()
            .filter(|(_, l)| **l < ALIKE)
            // Those that are unlike at all differ by chance only: the widest gap first.
            .min_by(|a, b| {
                let gap = |k: usize| grid[k].0 - grid[k + 1].0;
                gap(a.0).total_cmp(&gap(b.0))
            })
            .map(|(k, _)| k);
        let Some(k) = worst else { break };
        if grid.len() >= most {
            coarse = true;
            break;
        }
        let t = 0.5 * (grid[k].0 + grid[k + 1].0);
        grid.insert(k + 1, (t, shape(t)));
        likeness[k] = alike(&grid[k].1, &grid[k + 1].1);
        likeness.insert(k + 1, alike(&grid[k + 1].1, &grid[k + 2].1));
    }
    let mut out: Vec<f64> = grid.into_iter().map(|g| g.0).collect();
    if let Some(start) = axis.start {
        out.push(axis.coordinate(start));
        out.sort_by(f64::total_cmp);
        out.dedup();
    }
    (out, coarse)
}

/// The least cosine between columns of two shapes; 1 where one of them has no value or vanishes.
fn alike(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs
        .map(|(a, b)| {
            let cosine = dot(a, b).abs() / (dot(a, a) * dot(b, b)).sqrt();
            if cosine.is_finite() { cosine } else { 1.0 }
        })
        .fold(1.0, f64::min)
}

impl Candidate for User {
    fn sheet(&self) -> &Sheet {
        &USER
    }

    fn id(&self) -> String {
        self.effect.id.clone()
    }

    fn physics(&self) -> String {
        match self.effect.physics.as_str() {
            "" => USER.physics.to_owned(),
            said => said.to_owned(),
        }
    }

    fn equation(&self, _c: &Channels, _point: &Point) -> String {
        self.effect.text.clone()
    }

    fn unit(&self, parameter: &str) -> Option<String> {
        let mut all = self.effect.parameters.iter();
        all.find(|p| p.name == parameter).map(|p| p.unit.clone())
    }

    fn channels(&self, _c: &Channels) -> Result<Vec<String>, Missing> {
        let columns = self.columns.as_ref().map_err(Clone::clone)?;
        Ok(columns.iter().map(|(name, _)| name.clone()).collect())
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        self.points.clone()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let mut out = self.shapes(&point.theta);
        if out.iter().flatten().any(|v| !v.is_finite()) {
            // No value here: a shape that explains nothing.
            out = vec![vec![0.0; c.len()]; out.len()];
        }
        out
    }

    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        let pairs = self.axes.iter().zip(&point.theta);
        pairs.map(|(axis, t)| axis.spacing(*t)).collect()
    }

    fn is_whole(&self) -> bool {
        self.effect.amplitudes().next().is_none()
    }

    fn surcharge(&self, _c: &Channels, _point: &Point) -> f64 {
        -PREFERRED
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        if self.obstacle(c, &e.point).is_some() {
            return None;
        }
        let thermometer = f.thermometer();
        match self.others(c).as_slice() {
            [] => Some(vec![Term::Curve {
                input: thermometer?,
                values_dps: self.curve(c, e)?,
            }]),
            [name] => {
                f.allow(name);
                f.surface(c, name, &self.shapes(&e.point.theta), &e.beta)
            }
            _ => None,
        }
    }

    fn obstacle(&self, c: &Channels, _point: &Point) -> Option<String> {
        let id = &self.effect.id;
        if self.effect.compensable == Some(false) {
            return Some(format!(
                "the design says that firmware cannot take {id} off"
            ));
        }
        let told = self.effect.compensable == Some(true);
        let never = ["time_s", "time_since_power_on_s", "rate_dps"];
        let unseen =
            |name: &&str| never.contains(name) || !(sees(name) || told && *name != c.thermometer);
        if let Some(name) = self.effect.columns().find(unseen) {
            return Some(format!(
                "{id} needs {name}, which the correction in firmware does not have"
            ));
        }
        (self.others(c).len() > 1).then(|| {
            format!(
                "{id} is a function of more columns than the thermometer and one other: the correction in firmware \
                 has no form for it"
            )
        })
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        let mut out = Reported::new();
        for (k, p) in self.effect.amplitudes().enumerate() {
            out.extend([gain(&p.name, e, k, 1.0)]);
        }
        for (k, (p, _)) in self.effect.shapes().enumerate() {
            let theta = e.point.theta.get(k).copied().unwrap_or(0.0);
            let std = e.theta_std.get(k).copied().unwrap_or(0.0);
            let Some(axis) = self.axes.get(k) else {
                continue;
            };
            let value = axis.value(theta);
            let factor = if axis.is_log { value.abs() } else { 1.0 };
            out.extend([entry(&p.name, value, std * factor)]);
        }
        out
    }
}
