//! The table `[correction]`: the plan of a correction of averaged readings.

use super::correction::{Input, NOISE_PER_FULL_SCALE, Plan, Planned, Term};
use super::table::{Real, Table, Value};
use crate::error::Result;

const KINDS: [&str; 11] = [
    "product",
    "lag",
    "lag_of_curve",
    "curve_of_lag",
    "slope",
    "decay",
    "curve",
    "step",
    "scale_by",
    "cubic",
    "even",
];

/// Reads the table. Whether the plan can become firmware is for [`crate::correction::refuse_unbuildable`] to say.
pub(super) fn correction(table: &Table) -> Result<Planned> {
    let real = |key: &str, meaning: &str| table.need(key)?.real(Real::Positive, meaning);
    let inputs = table.need("inputs")?.array("[]")?;
    let terms = table.need("terms")?.array("[]")?;
    let plan = Plan {
        period_s: real("period_s", "nominal seconds between readings")?,
        full_scale_dps: real("full_scale_dps", "full scale of the rate, deg/s")?,
        inputs: inputs.iter().map(input).collect::<Result<_>>()?,
        terms: terms.iter().map(term).collect::<Result<_>>()?,
    };
    let noise_dps = table.take(
        "noise_dps",
        Some(plan.full_scale_dps * NOISE_PER_FULL_SCALE),
        |v| v.real(Real::Positive, "noise of a reading, deg/s rms"),
    )?;
    let heldout_rms_dps = table.take("heldout_rms_dps", Some(None), |v| {
        let meaning = "error on readings that the coefficients have not seen, deg/s rms";
        v.real(Real::Positive, meaning).map(Some)
    })?;
    Ok(Planned {
        plan,
        noise_dps,
        heldout_rms_dps,
    })
}

fn input(value: &Value) -> Result<Input> {
    let table = value.table()?;
    table.only(&["column", "offset", "scale"])?;
    Ok(Input {
        column: table.need("column")?.text("the column's name")?.to_owned(),
        offset: table.need("offset")?.real(Real::Any, "where x is 0")?,
        scale: table.need("scale")?.real(Real::Any, "from x = 0 to 1")?,
    })
}

fn term(value: &Value) -> Result<Term> {
    let table = value.table()?;
    let kind = table.need("kind")?;
    let kind = kind.choice(&KINDS.map(|kind| (kind, kind)))?;
    let read = Keys { table };
    match kind {
        "product" => read.product(),
        "lag" => {
            read.only(&["gain_dps", "input", "tau_s", "kept"])?;
            Ok(Term::Lag {
                gain_dps: read.real("gain_dps")?,
                input: read.input()?,
                tau_s: read.real("tau_s")?,
                kept: read.kept()?,
            })
        }
        "lag_of_curve" | "curve_of_lag" => read.lag_and_curve(kind),
        "slope" => {
            read.only(&["gain_dps_s", "input", "rows"])?;
            Ok(Term::Slope {
                gain_dps_s: read.real("gain_dps_s")?,
                input: read.input()?,
                rows: read
                    .table
                    .need("rows")?
                    .integer(1..=64, "readings that it reaches back")?,
            })
        }
        "decay" => {
            read.only(&["gain_dps", "tau_s"])?;
            Ok(Term::Decay {
                gain_dps: read.real("gain_dps")?,
                tau_s: read.real("tau_s")?,
            })
        }
        "curve" => {
            read.only(&["input", "values_dps"])?;
            Ok(Term::Curve {
                input: read.input()?,
                values_dps: read.reals("values_dps")?,
            })
        }
        "step" => {
            read.only(&["gain_dps", "input", "centre", "gap", "once"])?;
            Ok(Term::Step {
                gain_dps: read.real("gain_dps")?,
                input: read.input()?,
                centre: read.real("centre")?,
                gap: read.real("gap")?,
                once: read.flag("once")?,
            })
        }
        _ => read.on_rate(kind),
    }
}

/// The keys of a term.
struct Keys<'a> {
    table: Table<'a>,
}

impl Keys<'_> {
    fn only(&self, keys: &[&str]) -> Result<()> {
        let mut known = vec!["kind"];
        known.extend(keys);
        self.table.only(&known)
    }

    fn real(&self, key: &str) -> Result<f64> {
        self.table.need(key)?.real(Real::Any, "of this term")
    }

    fn reals(&self, key: &str) -> Result<Vec<f64>> {
        let knots = self.table.need(key)?.array("[0.0, 0.1, 0.0]")?;
        let real = |v: &Value| v.real(Real::Any, "a knot");
        knots.iter().map(real).collect()
    }

    fn input(&self) -> Result<usize> {
        let value = self.table.need("input")?;
        value.integer(0..=7, "position among `inputs`, from 0")
    }

    fn flag(&self, key: &str) -> Result<bool> {
        let value = self.table.need(key)?;
        value.choice(&[("yes", true), ("no", false)])
    }

    fn kept(&self) -> Result<bool> {
        let choices = [("yes", true), ("no", false)];
        self.table.take("kept", Some(false), |v| v.choice(&choices))
    }

    /// The two of a lag and a curve, which have the same keys.
    fn lag_and_curve(&self, kind: &str) -> Result<Term> {
        self.only(&["gain_dps", "input", "values", "tau_s", "kept"])?;
        let (gain_dps, input) = (self.real("gain_dps")?, self.input()?);
        let (values, tau_s) = (self.reals("values")?, self.real("tau_s")?);
        let kept = self.kept()?;
        Ok(match kind {
            "lag_of_curve" => Term::LagOfCurve {
                gain_dps,
                input,
                values,
                tau_s,
                kept,
            },
            _ => Term::CurveOfLag {
                gain_dps,
                input,
                values,
                tau_s,
                kept,
            },
        })
    }

    fn product(&self) -> Result<Term> {
        self.only(&["gain_dps", "factors"])?;
        let factors = self.table.need("factors")?.array("[[0, 2]]")?;
        let factor = |value: &Value| -> Result<(usize, u32)> {
            match value.array("[0, 2]")?.as_slice() {
                [input, power] => Ok((
                    input.integer(0..=7, "position among `inputs`, from 0")?,
                    power.integer(1..=9, "the input's power")?,
                )),
                _ => Err(value
                    .error("is no pair")
                    .help("write [input, power], such as [0, 2]")
                    .into()),
            }
        };
        Ok(Term::Product {
            gain_dps: self.real("gain_dps")?,
            factors: factors.iter().map(factor).collect::<Result<_>>()?,
        })
    }

    fn on_rate(&self, kind: &str) -> Result<Term> {
        match kind {
            "scale_by" => {
                self.only(&["input", "s0", "s1", "s2"])?;
                let s2 = |v: Value| v.real(Real::Any, "of this term");
                let given = self.table.get("input").is_some();
                Ok(Term::ScaleBy {
                    input: if given { Some(self.input()?) } else { None },
                    s0: self.real("s0")?,
                    s1: self.real("s1")?,
                    s2: self.table.take("s2", Some(0.0), s2)?,
                })
            }
            "cubic" => {
                self.only(&["ppm", "rate_max_dps"])?;
                Ok(Term::Cubic {
                    ppm: self.real("ppm")?,
                    rate_max_dps: self.real("rate_max_dps")?,
                })
            }
            _ => {
                self.only(&["ppm", "rate_max_dps", "absolute"])?;
                Ok(Term::Even {
                    ppm: self.real("ppm")?,
                    rate_max_dps: self.real("rate_max_dps")?,
                    absolute: self.flag("absolute")?,
                })
            }
        }
    }
}
