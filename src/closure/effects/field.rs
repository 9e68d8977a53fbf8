//! Effects of supply and acceleration: one channel, one column.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, gain, map, moving,
    product,
};
use crate::closure::channels::{Channels, mean, scaled};
use crate::closure::firmware::Words;
use crate::correction::Term;
use crate::record::stats;

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![
        Box::new(Direct {
            sheet: SUPPLY,
            channel: "supply_v",
            power: 1,
        }),
        Box::new(Direct {
            sheet: G,
            channel: "accel_g",
            power: 1,
        }),
        Box::new(Direct {
            sheet: G_SQUARED,
            channel: "accel_g",
            power: 2,
        }),
    ]
}

/// An effect that is a power of a channel.
struct Direct {
    sheet: Sheet,
    channel: &'static str,
    power: i32,
}

/// What a device's law is off the catalogue's: a bend, a zero that is off, a gain that goes with temperature.
const BEND: Parameter = Parameter {
    name: "bend_dps",
    plausible: (0.0001, 1.0),
};

/// Most that a bend is of the law, rms over the record: more is no bend of it.
const MOST_BENT: f64 = 0.15;

/// Forms that have a bend with them, and what it costs that one of them is chosen, none of which the law needs.
const BENT: usize = 3;
const CHOICE: f64 = 4.0;

const SUPPLY: Sheet = Sheet {
    id: "supply_sensitivity",
    physics: "references and charge pump follow the supply",
    equation: "k V; and where the law bends b s^2, b s^3 or b s u with it, s the supply and u the temperature scaled to -1..1",
    parameters: &[
        Parameter {
            name: "gain_dps_per_v",
            plausible: (0.001, 20.0),
        },
        BEND,
    ],
    compensable: true,
    confounders: &[],
    experiment: "step the supply at constant temperature",
    reference: "IEEE Std 1431 (environmental sensitivity)",
};

const G: Sheet = Sheet {
    id: "g_sensitivity",
    physics: "acceleration moves the proof mass and unbalances the sense axis",
    equation: "g1 a; and where the law bends b s^2, b s^3 or b s u with it, s the acceleration and u the temperature scaled to -1..1",
    parameters: &[
        Parameter {
            name: "gain_dps_per_g",
            plausible: (0.001, 1.0),
        },
        BEND,
    ],
    compensable: true,
    confounders: &["scale_factor_asymmetry", "supply_sensitivity"],
    experiment: "six positions in the field of gravity at constant temperature",
    reference: "IEEE Std 1431; ADXRS453 data sheet",
};

const G_SQUARED: Sheet = Sheet {
    id: "g_squared_sensitivity",
    physics: "vibration rectification: the answer to acceleration has a square",
    equation: "g2 a^2; and where the law bends b s, b s^3 or b s^2 u with it, s the acceleration and u the temperature scaled to -1..1",
    parameters: &[
        Parameter {
            name: "gain_dps_per_g2",
            plausible: (1e-5, 0.3),
        },
        BEND,
    ],
    compensable: true,
    confounders: &["g_sensitivity"],
    experiment: "levels of vibration at one orientation",
    reference: "Guan et al., Sensors 16 (2016) 468",
};

impl Candidate for Direct {
    fn sheet(&self) -> &Sheet {
        &self.sheet
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        moving(c, self.channel)?;
        Ok(vec![self.channel.to_owned()])
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        vec![Point::form(0)]
    }

    fn beside(&self, _c: &Channels, _point: &Point) -> Vec<Point> {
        (1..=BENT).map(Point::form).collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let column = c.column(self.channel).unwrap_or(&[]);
        let law = map(column, |v| v.powi(self.power));
        let s = scaled(column).0;
        let bend = match point.form {
            0 => return vec![law],
            1 => map(&s, |s| s.powi(3 - self.power)),
            2 => map(&s, |s| s.powi(3)),
            _ => product(&map(&s, |s| s.powi(self.power)), &c.u),
        };
        vec![law, bend]
    }

    fn surcharge(&self, _c: &Channels, point: &Point) -> f64 {
        if point.form > 0 { CHOICE } else { 0.0 }
    }

    fn admits(&self, c: &Channels, point: &Point, beta: &[f64]) -> bool {
        let columns = self.columns(c, &Bias::default(), point);
        let moves = |column: &Vec<f64>| stats::rms(&map(column, |v| v - mean(column)));
        let sizes = columns.iter().zip(beta);
        let sizes: Vec<f64> = sizes.map(|(c, b)| b.abs() * moves(c)).collect();
        match sizes.as_slice() {
            [law, bend] => *bend <= MOST_BENT * law,
            _ => true,
        }
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let columns = self.columns(c, &f.bias.clone(), &e.point);
        f.surface(c, self.channel, &columns, &e.beta)
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        let name = self.sheet.parameters.first().map_or("gain", |p| p.name);
        let mut out: Reported = [gain(name, e, 0, 1.0)].into_iter().collect();
        if e.point.form > 0 {
            out.extend([gain(BEND.name, e, 1, 1.0)]);
        }
        out
    }
}
