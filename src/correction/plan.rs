//! The plan of a correction: what is subtracted from a reading, in real numbers.

pub use crate::design::correction::{Input, Plan, Term};
use crate::error::{InputError, Result};
use crate::text::constant;

/// Most inputs of a plan.
pub const MOST_INPUTS: usize = 8;
/// Most terms of a kind that has a state or a table.
pub const MOST_OF_A_KIND: usize = 8;
/// Most knots of a curve.
pub const MOST_KNOTS: usize = 1025;
/// Most readings that a slope reaches back.
pub const MOST_SLOPE_ROWS: u32 = 64;
/// The longest time constant, in nominal periods: beyond it a state word would need more than 64 bits
/// in a product.
pub const LONGEST_TAU_PERIODS: f64 = 1e6;
/// The shortest: below it a lag is its input.
pub const SHORTEST_TAU_PERIODS: f64 = 0.01;
/// The highest power of an input in a product.
pub const HIGHEST_POWER: u32 = 9;

/// Digits of a constant in a sentence (convention: a step of the words is 1e-9 of their range at least; `design.toml` has every digit).
const SHOWN_DIGITS: usize = 9;

/// A constant of a plan in a sentence.
pub(super) fn in_words(value: f64) -> String {
    constant(value, SHOWN_DIGITS)
}

impl Input {
    /// x as a formula in the column, to nine digits: `(die_degc - 25) / 40`.
    pub fn formula(&self) -> String {
        let sign = if self.offset < 0.0 { '+' } else { '-' };
        let scale = match self.scale < 0.0 {
            true => format!("({})", in_words(self.scale)),
            false => in_words(self.scale),
        };
        format!(
            "({} {sign} {}) / {scale}",
            self.column,
            in_words(self.offset.abs())
        )
    }
}

impl Term {
    /// The name in a design file.
    pub fn kind(&self) -> &'static str {
        match self {
            Term::Product { .. } => "product",
            Term::Lag { .. } => "lag",
            Term::LagOfCurve { .. } => "lag_of_curve",
            Term::CurveOfLag { .. } => "curve_of_lag",
            Term::Slope { .. } => "slope",
            Term::Decay { .. } => "decay",
            Term::Curve { .. } => "curve",
            Term::Step { .. } => "step",
            Term::ScaleBy { .. } => "scale_by",
            Term::Cubic { .. } => "cubic",
            Term::Even { .. } => "even",
        }
    }

    /// True for a term whose value depends on earlier readings, or on the time since power-on.
    pub fn remembers(&self) -> bool {
        matches!(
            self,
            Term::Lag { .. }
                | Term::LagOfCurve { .. }
                | Term::CurveOfLag { .. }
                | Term::Slope { .. }
                | Term::Decay { .. }
                | Term::Step { .. }
        )
    }

    /// True for a term on the rate, which comes after those on the bias.
    pub fn is_on_rate(&self) -> bool {
        matches!(
            self,
            Term::ScaleBy { .. } | Term::Cubic { .. } | Term::Even { .. }
        )
    }

    /// True for a term whose state outlives a restart.
    pub fn is_kept(&self) -> bool {
        matches!(
            self,
            Term::Lag { kept: true, .. }
                | Term::LagOfCurve { kept: true, .. }
                | Term::CurveOfLag { kept: true, .. }
        )
    }

    /// The inputs that it reads.
    pub fn inputs(&self) -> Vec<usize> {
        match self {
            Term::Product { factors, .. } => factors.iter().map(|(input, _)| *input).collect(),
            Term::Lag { input, .. }
            | Term::LagOfCurve { input, .. }
            | Term::CurveOfLag { input, .. }
            | Term::Slope { input, .. }
            | Term::Curve { input, .. }
            | Term::Step { input, .. } => vec![*input],
            Term::ScaleBy { input, .. } => input.iter().copied().collect(),
            Term::Decay { .. } | Term::Cubic { .. } | Term::Even { .. } => Vec::new(),
        }
    }
}

impl Plan {
    /// True if a lag's state outlives a restart.
    pub fn keeps(&self) -> bool {
        self.terms.iter().any(Term::is_kept)
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first thing that cannot become firmware, with the rule.
    pub fn check(&self) -> Result<()> {
        positive("period_s", self.period_s)?;
        within("full_scale_dps", self.full_scale_dps, 1e-3, 1e6)?;
        if self.inputs.len() > MOST_INPUTS {
            let given = self.inputs.len();
            return refuse(format!("{given} inputs; a correction takes {MOST_INPUTS}"));
        }
        for input in &self.inputs {
            finite(&format!("offset of {}", input.column), input.offset)?;
            finite(&format!("scale of {}", input.column), 1.0 / input.scale)?;
            finite(&format!("scale of {}", input.column), input.scale)?;
            if input.column == "rate_out_dps" {
                return refuse("`rate_out_dps` is what is corrected and no input".into());
            }
        }
        let kinds: [&[&str]; 5] = [
            &["lag", "lag_of_curve", "curve_of_lag"],
            &["lag_of_curve", "curve_of_lag", "curve"],
            &["slope"],
            &["decay"],
            &["step"],
        ];
        for kind in kinds {
            let count = self.terms.iter().filter(|t| kind.contains(&t.kind()));
            if count.count() > MOST_OF_A_KIND {
                let what = kind.join(" and ");
                return refuse(format!("more than {MOST_OF_A_KIND} terms `{what}`"));
            }
        }
        self.terms.iter().enumerate().try_for_each(|(k, term)| {
            let place = format!("term {} ({})", k + 1, term.kind());
            self.check_term(&place, term)
        })
    }

    fn check_term(&self, place: &str, term: &Term) -> Result<()> {
        let named = |key: &str| format!("{place}: {key}");
        if let Some(unknown) = term.inputs().iter().find(|k| **k >= self.inputs.len()) {
            let count = self.inputs.len();
            return refuse(named(&format!("input {unknown} of {count} inputs")));
        }
        let gain = |key: &str, value: f64| within(&named(key), value, -1e6, 1e6);
        let knots = |values: &[f64]| {
            if !(2..=MOST_KNOTS).contains(&values.len()) {
                let count = values.len();
                return refuse(named(&format!(
                    "{count} knots; a curve has 2 to {MOST_KNOTS}"
                )));
            }
            values.iter().try_for_each(|v| gain("knot", *v))
        };
        let tau = |tau_s: f64| {
            let (low, high) = (SHORTEST_TAU_PERIODS, LONGEST_TAU_PERIODS);
            within(&named("tau_s in periods"), tau_s / self.period_s, low, high)
        };
        match term {
            Term::Product { gain_dps, factors } => {
                if factors
                    .iter()
                    .any(|(_, p)| !(1..=HIGHEST_POWER).contains(p))
                {
                    return refuse(named(&format!("a power is 1 to {HIGHEST_POWER}")));
                }
                gain("gain_dps", *gain_dps)
            }
            Term::Lag {
                gain_dps, tau_s, ..
            }
            | Term::Decay { gain_dps, tau_s } => {
                gain("gain_dps", *gain_dps).and_then(|()| tau(*tau_s))
            }
            Term::LagOfCurve {
                gain_dps,
                values,
                tau_s,
                ..
            }
            | Term::CurveOfLag {
                gain_dps,
                values,
                tau_s,
                ..
            } => {
                gain("gain_dps", *gain_dps)?;
                knots(values)?;
                tau(*tau_s)
            }
            Term::Slope {
                gain_dps_s, rows, ..
            } => {
                if !(1..=MOST_SLOPE_ROWS).contains(rows) {
                    return refuse(named(&format!("rows is 1 to {MOST_SLOPE_ROWS}")));
                }
                gain("gain per period", gain_dps_s / self.period_s)
            }
            Term::Curve { values_dps, .. } => knots(values_dps),
            Term::Step {
                gain_dps,
                centre,
                gap,
                ..
            } => {
                within(&named("centre"), *centre, -1e3, 1e3)?;
                within(&named("gap"), *gap, 0.0, 1e3)?;
                gain("gain_dps", *gain_dps)
            }
            Term::ScaleBy { s0, s1, s2, .. } => {
                within(&named("s0"), *s0, -0.5, 0.5)?;
                within(&named("s1"), *s1, -0.5, 0.5)?;
                within(&named("s2"), *s2, -0.5, 0.5)?;
                // What s0 and s1 alone reach: products stay as narrow as with these two.
                let sum = s0.abs() + s1.abs() + s2.abs();
                within(&named("|s0| + |s1| + |s2|"), sum, 0.0, 1.0)
            }
            Term::Cubic { ppm, rate_max_dps }
            | Term::Even {
                ppm, rate_max_dps, ..
            } => {
                within(&named("ppm"), *ppm, -1e5, 1e5)?;
                let share = rate_max_dps / self.full_scale_dps;
                within(&named("rate_max_dps over full scale"), share, 0.1, 100.0)
            }
        }
    }
}

fn refuse(what: String) -> Result<()> {
    Err(InputError::new(format!("correction: {what}"))
        .help("change the plan of the correction")
        .into())
}

fn finite(what: &str, value: f64) -> Result<()> {
    match value.is_finite() {
        true => Ok(()),
        false => refuse(format!("{what} makes {value}, which is not finite")),
    }
}

fn positive(what: &str, value: f64) -> Result<()> {
    within(what, value, f64::MIN_POSITIVE, f64::MAX)
}

fn within(what: &str, value: f64, low: f64, high: f64) -> Result<()> {
    // False for a NaN too.
    match value >= low && value <= high {
        true => Ok(()),
        false => refuse(format!(
            "{what} is {value}; it has to be from {low} to {high}"
        )),
    }
}
