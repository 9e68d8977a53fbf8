//! Effects of supply and acceleration: one channel, one column.

use super::{
    Bias, Candidate, Estimate, MOST_BENT, Missing, Parameter, Point, Reported, Sheet, gain, map,
    moving, product,
};
use crate::correction::Term;
use crate::statistics::stats;
use crate::thermal::channels::{Channels, mean, scaled};
use crate::thermal::firmware::Words;

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

/// Forms that have a bend with them, and what it costs that one of them is chosen, none of which the law needs.
const BENT: usize = 3;
const CHOICE: f64 = 4.0;

const SUPPLY: Sheet = Sheet {
    id: "supply_sensitivity",
    physics: "references and charge pump follow the supply",
    equation: "gain V, V the supply; and where the law bends b s^2, b s^3 or b s u with it, s the supply and u the temperature scaled to -1..1",
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
    equation: "gain a, a the acceleration; and where the law bends b s^2, b s^3 or b s u with it, s the acceleration and u the temperature scaled to -1..1",
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
    equation: "gain a^2, a the acceleration; and where the law bends b s, b s^3 or b s^2 u with it, s the acceleration and u the temperature scaled to -1..1",
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

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let (v, name) = match self.channel {
            "supply_v" => ("V", "supply"),
            _ => ("a", "acceleration"),
        };
        let power = |x: &str, n: i32| match n {
            1 => x.to_owned(),
            _ => format!("{x}^{n}"),
        };
        let law = format!("gain {}", power(v, self.power));
        let (bend, with_u) = match point.form {
            0 => return format!("{law}, {v} the {name}"),
            1 => (power("s", 3 - self.power), ""),
            2 => (power("s", 3), ""),
            _ => (
                format!("{} u", power("s", self.power)),
                " and u the temperature",
            ),
        };
        format!("{law} + b {bend}, {v} the {name}, s the {name}{with_u} scaled to -1..1")
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

#[cfg(test)]
mod tests {
    use super::super::structure;
    use super::*;
    use crate::thermal::synthetic::triangle;
    use std::collections::BTreeMap;

    /// A supply from 4.5 to 5.5 V beside a temperature that goes up and down.
    fn channels() -> Channels {
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), vec![0.0; 300]),
            ("die_degc".to_owned(), triangle(300)),
            (
                "supply_v".to_owned(),
                (0..300).map(|k| 4.5 + f64::from(k % 11) / 10.0).collect(),
            ),
        ]);
        let time_s: Vec<f64> = (0..300).map(f64::from).collect();
        Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
    }

    fn of(all: Vec<Box<dyn Candidate>>, id: &str) -> Box<dyn Candidate> {
        all.into_iter().find(|k| k.id() == id).unwrap()
    }

    #[test]
    fn a_bend_is_little_beside_its_law() {
        let c = channels();
        let supply = of(all(), "supply_sensitivity");
        for point in supply.beside(&c, &Point::form(0)) {
            let columns = supply.columns(&c, &Bias::default(), &point);
            let rms = |column: &[f64]| {
                let moved = map(column, |v| v - mean(column));
                stats::rms(&moved)
            };
            let (law, bend) = (rms(&columns[0]), rms(&columns[1]));
            for (share, is_bend) in [(0.14, true), (-0.14, true), (0.16, false)] {
                let beta = [1.0, share * law / bend];
                assert_eq!(
                    supply.admits(&c, &point, &beta),
                    is_bend,
                    "{point:?} {share}"
                );
            }
            assert!(supply.surcharge(&c, &point) > supply.surcharge(&c, &Point::form(0)));
        }
        assert!(supply.admits(&c, &Point::form(0), &[1e-9]));
    }

    #[test]
    fn higher_orders_are_less_than_half_of_the_third() {
        let c = channels();
        let third = of(structure::all(), "bias_third_order");
        let bent = third.beside(&c, &Point::form(0)).remove(0);
        // Rms over -1 to 1 of the third Legendre polynomial in u^3, and of the fourth and fifth.
        let (of_third, of_fourth, of_fifth) = (0.4 / 7f64.sqrt(), 1.0 / 3.0, 1.0 / 11f64.sqrt());
        for (share, is_bend) in [(0.45, true), (0.55, false)] {
            for [l4, l5] in [
                [share * of_third / of_fourth, 0.0],
                [0.0, share * of_third / of_fifth],
            ] {
                assert_eq!(
                    third.admits(&c, &bent, &[1.0, l4, l5]),
                    is_bend,
                    "{share} {l4} {l5}"
                );
                assert_eq!(
                    third.admits(&c, &bent, &[-2.0, 2.0 * l4, 2.0 * l5]),
                    is_bend
                );
            }
        }
    }
}
