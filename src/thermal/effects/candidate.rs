//! What every effect is: a sheet, shapes over its parameters, a report, a law that firmware may take up.

use crate::correction::Term;
use crate::thermal::channels::Channels;
use crate::thermal::firmware::Words;
use std::collections::BTreeMap;

/// How the odds of a time constant beyond the usual ones fall: with this power of it.
pub(crate) const UNUSUAL: f64 = 2.0;

/// A parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// With its unit, as in `closure.json`.
    pub name: &'static str,
    /// Magnitudes that such a gyro has; for a reader, not for the search.
    pub plausible: (f64, f64),
}

/// What there is to know of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Of `closure.json`.
    pub id: &'static str,
    /// What happens, in a sentence.
    pub physics: &'static str,
    /// The contribution to the output.
    pub equation: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Whether firmware can take it off, if it sees the channels.
    pub compensable: bool,
    /// Ids that look alike in many experiments.
    pub confounders: &'static [&'static str],
    /// What tells it from them.
    pub experiment: &'static str,
    /// Where it is described.
    pub reference: &'static str,
}

/// Most that a bend is of its law, rms over the record: more is no bend of it.
pub const MOST_BENT: f64 = 0.15;

/// The declared bias as it stands: deg/s over powers of u. Some effects act on it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bias {
    /// Lowest first.
    pub coefficients_dps: Vec<f64>,
    /// What other effects add to the output before it can clip, deg/s, one value a row; empty: nothing.
    pub others_dps: Vec<f64>,
}

impl Bias {
    /// deg/s.
    pub fn at(&self, u: f64) -> f64 {
        self.coefficients_dps
            .iter()
            .rev()
            .fold(0.0, |s, c| s * u + c)
    }

    /// deg/s per unit of u.
    pub fn slope(&self, u: f64) -> f64 {
        let terms = self.coefficients_dps.iter().enumerate().skip(1);
        terms
            .map(|(k, c)| k as f64 * c * u.powi(k as i32 - 1))
            .sum()
    }
}

/// One shape of an effect.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Point {
    /// Which of the effect's forms.
    pub form: usize,
    /// Its non-linear parameters, in the effect's own coordinates (logarithms of what is positive).
    pub theta: Vec<f64>,
}

impl Point {
    /// A form without non-linear parameters.
    pub fn form(form: usize) -> Self {
        Point {
            form,
            theta: Vec::new(),
        }
    }

    /// A form with its parameters.
    pub fn at(form: usize, theta: &[f64]) -> Self {
        Point {
            form,
            theta: theta.to_vec(),
        }
    }
}

/// A value with its standard deviation.
pub type Reported = BTreeMap<String, (f64, f64)>;

/// What has been estimated of a candidate, for its report.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The shape.
    pub point: Point,
    /// Coefficients of its columns, deg/s per unit of the column.
    pub beta: Vec<f64>,
    /// Their standard deviations.
    pub beta_std: Vec<f64>,
    /// Standard deviations of `point.theta`.
    pub theta_std: Vec<f64>,
}

/// A candidate effect.
pub trait Candidate: Send + Sync {
    /// What there is to know.
    fn sheet(&self) -> &Sheet;

    /// As reported.
    fn id(&self) -> String {
        self.sheet().id.to_owned()
    }

    /// What happens, in a sentence.
    fn physics(&self) -> String {
        self.sheet().physics.to_owned()
    }

    /// The contribution to the output in a shape that was found.
    fn equation(&self, _c: &Channels, _point: &Point) -> String {
        self.sheet().equation.to_owned()
    }

    /// The unit of a reported parameter, where its name does not say it.
    fn unit(&self, _parameter: &str) -> Option<String> {
        None
    }

    /// False for a shape that has no name: it takes part in every comparison, and where it wins,
    /// what is left has a channel but no cause.
    fn named(&self) -> bool {
        true
    }

    /// True for what a record may have any number of: a spectral line, a level that changes at a moment.
    fn repeats(&self) -> bool {
        false
    }

    /// The columns of the record that it uses.
    ///
    /// # Errors
    /// A channel that the record lacks, or that does not move: the remark.
    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing>;

    /// The columns of the record that it uses at this point, if it does not use the same at every one.
    fn channels_at(&self, c: &Channels, _point: &Point) -> Vec<String> {
        self.channels(c).unwrap_or_default()
    }

    /// Where the search starts.
    fn points(&self, c: &Channels) -> Vec<Point>;

    /// Further places from which the last refinement starts, where the likelihood has many tops; `seen`: the rows whose
    /// errors may be looked at.
    fn fine(&self, _c: &Channels, _point: &Point, _seen: &[bool]) -> Vec<Point> {
        Vec::new()
    }

    /// Forms that are asked only where the name is in, at the parameters of its shape.
    fn beside(&self, _c: &Channels, _point: &Point) -> Vec<Point> {
        Vec::new()
    }

    /// For thresholds, whose likelihood is a staircase: for each of them, the points near the given one along it,
    /// in order, one between any two readings; and points of other forms from which the same is worth a
    /// try.
    fn stairs(&self, _c: &Channels, _point: &Point) -> (Vec<Vec<Point>>, Vec<Point>) {
        (Vec::new(), Vec::new())
    }

    /// Shapes that the rows `seen` do not tell from the given one, and that say something else of the others: a dead band no
    /// wider than the rates that showed it, thresholds at the ends of what lies between two readings.
    fn open(&self, _c: &Channels, _point: &Point, _seen: &[bool]) -> Vec<Point> {
        Vec::new()
    }

    /// The columns of a shape, one value a row.
    fn columns(&self, c: &Channels, bias: &Bias, point: &Point) -> Vec<Vec<f64>>;

    /// The same for several biases: what a shape is apart from the bias is worked out once.
    fn columns_of(&self, c: &Channels, biases: &[Bias], point: &Point) -> Vec<Vec<Vec<f64>>> {
        biases.iter().map(|b| self.columns(c, b, point)).collect()
    }

    /// Distance of neighbouring points in each non-linear parameter.
    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        vec![0.2; point.theta.len()]
    }

    /// True if physics gives the column's coefficient, 1 (a clip has no gain): the threshold is then
    /// estimated with it held.
    fn is_whole(&self) -> bool {
        false
    }

    /// True for a shape that has its size in it, so that its column's coefficient is 1: every shape of a whole
    /// candidate, and a non-linear shape of another one.
    fn is_sized(&self, _point: &Point) -> bool {
        self.is_whole()
    }

    /// What a shape costs in log-likelihood beyond the usual price: for a choice among many, or for
    /// a part that the effect does not need.
    fn surcharge(&self, _c: &Channels, _point: &Point) -> f64 {
        0.0
    }

    /// Logarithm of the odds against a shape before any record is seen: a time constant that devices of its kind do not
    /// have. It decides between names, and not whether one is listed beside another.
    fn odds_against(&self, _c: &Channels, _point: &Point) -> f64 {
        0.0
    }

    /// The id of a shape without a name that this shape has in it, so that it is only where it is more than that one.
    fn contains(&self, _point: &Point) -> Option<&'static str> {
        None
    }

    /// True for a shape at one temperature, which chance finds somewhere: it has to be found in most halves
    /// of the record.
    fn is_local(&self) -> bool {
        false
    }

    /// True if it acts on the sum of all others (a clip), so that it adds nothing to that sum.
    fn is_last(&self) -> bool {
        false
    }

    /// The shape with its levels moved to where the rows at its upper and at its lower one lie, by so much, deg/s, for a clip; one
    /// level of both signs by the mean of what there is.
    fn moved(&self, _point: &Point, _by_dps: [Option<f64>; 2]) -> Option<Point> {
        None
    }

    /// The shape with given levels, deg/s, for a clip.
    fn at_levels(&self, _lower_dps: Option<f64>, _upper_dps: Option<f64>) -> Option<Point> {
        None
    }

    /// True if the columns depend on the declared bias.
    fn acts_on_bias(&self) -> bool {
        false
    }

    /// False for coefficients that physics excludes, however well they fit.
    fn admits(&self, _c: &Channels, _point: &Point, _beta: &[f64]) -> bool {
        true
    }

    /// What firmware subtracts; `None` if it cannot, or does not see what it needs.
    fn correction(&self, _c: &Channels, _e: &Estimate, _f: &mut Words) -> Option<Vec<Term>> {
        None
    }

    /// Why firmware cannot subtract it, where there is more to say than [`Sheet::compensable`].
    fn obstacle(&self, _c: &Channels, _point: &Point) -> Option<String> {
        None
    }

    /// Parameters in units.
    fn report(&self, c: &Channels, estimate: &Estimate) -> Reported;
}

/// Why a candidate cannot be judged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Missing {
    /// The record has no such column.
    Channel(String),
    /// It has, and the column does not move (or the experiment lacks something else).
    Excitation(String),
}

/// The named column if the record has it and it moves.
///
/// # Errors
/// Otherwise.
pub fn moving<'a>(c: &'a Channels, name: &str) -> Result<&'a [f64], Missing> {
    if c.column(name).is_none() {
        return Err(Missing::Channel(name.to_owned()));
    }
    c.moving(name)
        .ok_or_else(|| Missing::Excitation(format!("{name} is constant in this record")))
}

/// The thermometer if it moves.
///
/// # Errors
/// It does not.
pub fn heated(c: &Channels) -> Result<String, Missing> {
    let (low, high) = crate::thermal::channels::range(&c.u);
    if high > low {
        return Ok(c.thermometer.clone());
    }
    Err(Missing::Excitation(
        "the temperature is constant in this record".to_owned(),
    ))
}

/// The product of two columns.
pub fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// A function of a column.
pub fn map(a: &[f64], f: impl Fn(f64) -> f64) -> Vec<f64> {
    a.iter().map(|v| f(*v)).collect()
}

/// `count` numbers from `low` to `high` in equal ratios.
pub fn spaced(low: f64, high: f64, count: usize) -> Vec<f64> {
    // What a record's own values ask for is no reason to look at more than tells them apart.
    const MOST: usize = 1 << 12;
    let count = count.min(MOST);
    let ratio = (high / low).max(1.0);
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count)
        .map(|k| low * ratio.powf(k as f64 / last))
        .collect()
}

/// A pair for a [`Reported`].
pub fn entry(name: &str, value: f64, std: f64) -> (String, (f64, f64)) {
    (name.to_owned(), (value, std))
}

/// The coefficient `k` of an estimate times a unit's factor, with its deviation.
pub fn gain(name: &str, e: &Estimate, k: usize, factor: f64) -> (String, (f64, f64)) {
    let at = |v: &[f64]| v.get(k).copied().unwrap_or(0.0);
    entry(name, at(&e.beta) * factor, (at(&e.beta_std) * factor).abs())
}

/// The non-linear parameter `k`, which is a logarithm.
pub fn from_log(name: &str, e: &Estimate, k: usize) -> (String, (f64, f64)) {
    let at = |v: &[f64]| v.get(k).copied().unwrap_or(0.0);
    let value = at(&e.point.theta).exp();
    entry(name, value, value * at(&e.theta_std))
}
