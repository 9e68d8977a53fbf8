//! Auxiliary columns: any one of them may be a cause, by a smooth function of it.

use super::{Bias, Candidate, Estimate, Missing, Point, Reported, Sheet, entry};
use crate::record::columns::{is_known, unit_of};
use crate::thermal::channels::{Channels, lag, scaled};

/// A candidate for each auxiliary column that moves, and for thermometers beside the model's own.
pub fn all(c: &Channels) -> Vec<Box<dyn Candidate>> {
    c.columns
        .keys()
        .filter(|name| !is_known(name) && c.moving(name).is_some())
        .map(|name| Box::new(Covariate { name: name.clone() }) as Box<dyn Candidate>)
        .collect()
}

/// What it means that the output follows a turn rate's column; `None` for other columns. The record cannot tell the two apart.
pub fn of_another_axis(column: &str) -> Option<String> {
    (unit_of(column) == "deg/s").then(|| {
        format!(
            "if {column} is another axis's rate, it stands for what moves both axes: a turn that both see (cross-axis sensitivity), or, \
             at rest, a cause that they share"
        )
    })
}

/// A smooth function of one column.
struct Covariate {
    name: String,
}

const COVARIATE: Sheet = Sheet {
    id: "covariate",
    physics: "something that this column measures moves the bias, by a smooth function",
    equation: "f(c), a natural cubic spline of one to seven degrees of freedom; at once or after a \
               first-order delay",
    parameters: &[],
    compensable: false,
    confounders: &[],
    experiment: "move this quantity alone, everything else held",
    reference: "general additive models; Wood 2017",
};

/// Forms: degrees of freedom of the curve.
const DEGREES: [usize; 4] = [1, 2, 4, 7];

/// Delays that are tried, in rows.
const DELAYS_ROWS: [f64; 4] = [1.5, 3.0, 6.0, 12.0];

impl Candidate for Covariate {
    fn sheet(&self) -> &Sheet {
        &COVARIATE
    }

    fn id(&self) -> String {
        format!("covariate:{}", self.name)
    }

    fn physics(&self) -> String {
        format!(
            "something that the record's column {} measures moves the bias, by a smooth function",
            self.name
        )
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let name = &self.name;
        let (of, late) = match point.theta.is_empty() {
            true => (name.clone(), String::new()),
            false => (
                "l".to_owned(),
                format!(", l lags {name}: delay_s dl/dt = {name} - l"),
            ),
        };
        let curve = match DEGREES[point.form % DEGREES.len()] {
            1 => "a straight line".to_owned(),
            degrees => format!("a natural cubic spline of {degrees} degrees of freedom"),
        };
        format!("f({of}), {curve} in the record's column {name}{late}")
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        super::moving(c, &self.name)?;
        Ok(vec![self.name.clone()])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let mut out: Vec<Point> = (0..DEGREES.len()).map(Point::form).collect();
        for form in [0, 2] {
            let delays = DELAYS_ROWS.iter();
            let theta = delays.map(|rows| (rows * c.period_s()).ln());
            out.extend(theta.map(|t| Point::at(DEGREES.len() + form, &[t])));
        }
        out
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let Some(values) = c.column(&self.name) else {
            return Vec::new();
        };
        spline(
            &scaled(&felt(c, values, point)).0,
            DEGREES[point.form % DEGREES.len()],
        )
    }

    fn obstacle(&self, _c: &Channels, _point: &Point) -> Option<String> {
        let name = &self.name;
        let mut said = format!(
            "firmware does not see {name} by itself; if it does in your gyro, give the curve as an [[effects]] formula in \
             {name} with compensable = true"
        );
        if let Some(meaning) = of_another_axis(name) {
            said += &format!(
                "; {meaning}. Leave {name} out of the record, and `close` looks for that cause in the other columns"
            );
        }
        Some(said)
    }

    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        vec![0.7; point.theta.len()]
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let values = c.column(&self.name).unwrap_or(&[]);
        let (_, middle, half) = scaled(&felt(c, values, &e.point));
        let mut out: Reported = [entry("middle", middle, 0.0), entry("half_range", half, 0.0)]
            .into_iter()
            .collect();
        for (k, (b, s)) in e.beta.iter().zip(&e.beta_std).enumerate() {
            out.insert(format!("spline_{k}_dps"), (*b, *s));
        }
        if let Some(tau) = e.point.theta.first() {
            let std = e.theta_std.first().copied().unwrap_or(0.0);
            out.insert("delay_s".to_owned(), (tau.exp(), tau.exp() * std));
        }
        out
    }
}

/// A column as it acts at a point: at once, or behind by the point's delay.
fn felt(c: &Channels, values: &[f64], point: &Point) -> Vec<f64> {
    match point.theta.first() {
        Some(tau) => lag(&c.time_s, values, tau.exp()),
        None => values.to_vec(),
    }
}

/// The columns of a natural cubic spline over x in -1..1 without its constant: x, and truncated
/// cubes made linear beyond the outer knots (Hastie, Tibshirani & Friedman 2009, eq. 5.4). `degrees` columns, over
/// equal distances of knots.
pub fn spline(x: &[f64], degrees: usize) -> Vec<Vec<f64>> {
    let mut out = vec![x.to_vec()];
    if degrees < 2 {
        return out;
    }
    let knots: Vec<f64> = (0..=degrees)
        .map(|k| -1.0 + 2.0 * k as f64 / degrees as f64)
        .collect();
    let (last, before) = (knots[degrees], knots[degrees - 1]);
    let cube = |v: f64| v.max(0.0).powi(3);
    let d = |x: f64, knot: f64| (cube(x - knot) - cube(x - last)) / (last - knot);
    for knot in knots.iter().take(degrees - 1) {
        out.push(x.iter().map(|x| d(*x, *knot) - d(*x, before)).collect());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(name: &str) -> String {
        let columns =
            ["rate_out_dps", "die_degc"].map(|name| (name.to_owned(), vec![1.0, 2.0, 3.0]));
        let channels = Channels::new(&[0.0, 1.0, 2.0], &columns.into(), "die_degc", |t| t);
        let channels = channels.expect("channels");
        let covariate = Covariate { name: name.into() };
        covariate
            .obstacle(&channels, &Point::form(0))
            .expect("an obstacle")
    }

    #[test]
    fn another_axis_stands_for_what_moves_both() {
        let meaning = of_another_axis("gy_dps").expect("a meaning");
        assert!(meaning.contains("cross-axis sensitivity") && meaning.contains("share"));
        let text = said("gy_dps");
        assert!(
            text.contains(&meaning) && !text.contains("no cause"),
            "{text}"
        );
        assert_eq!(of_another_axis("humidity_pct"), None);
        assert!(!said("humidity_pct").contains("axis"));
    }
}
