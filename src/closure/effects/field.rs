//! Effects of supply and acceleration: one channel, one column.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, gain, map, moving,
};
use crate::closure::channels::Channels;
use crate::closure::firmware::Words;
use crate::correction::Term;

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

const SUPPLY: Sheet = Sheet {
    id: "supply_sensitivity",
    physics: "references and charge pump follow the supply",
    equation: "k V",
    parameters: &[Parameter {
        name: "gain_dps_per_v",
        plausible: (0.001, 20.0),
    }],
    compensable: true,
    confounders: &[],
    experiment: "step the supply at constant temperature",
    reference: "IEEE Std 1431 (environmental sensitivity)",
};

const G: Sheet = Sheet {
    id: "g_sensitivity",
    physics: "acceleration moves the proof mass and unbalances the sense axis",
    equation: "g1 a",
    parameters: &[Parameter {
        name: "gain_dps_per_g",
        plausible: (0.001, 1.0),
    }],
    compensable: true,
    confounders: &["scale_factor_asymmetry", "supply_sensitivity"],
    experiment: "six positions in the field of gravity at constant temperature",
    reference: "IEEE Std 1431; ADXRS453 data sheet",
};

const G_SQUARED: Sheet = Sheet {
    id: "g_squared_sensitivity",
    physics: "vibration rectification: the answer to acceleration has a square",
    equation: "g2 a^2",
    parameters: &[Parameter {
        name: "gain_dps_per_g2",
        plausible: (1e-5, 0.3),
    }],
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

    fn columns(&self, c: &Channels, _bias: &Bias, _point: &Point) -> Vec<Vec<f64>> {
        let column = c.column(self.channel).unwrap_or(&[]);
        vec![map(column, |v| v.powi(self.power))]
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let columns = self.columns(c, &f.bias.clone(), &e.point);
        f.surface(c, self.channel, &columns, &e.beta)
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        let name = self.sheet.parameters.first().map_or("gain", |p| p.name);
        [gain(name, e, 0, 1.0)].into_iter().collect()
    }
}
