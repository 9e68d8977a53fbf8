//! `[gyro.effects.ID]`: which effects of the [catalogue](CATALOGUE) a simulated gyro has.

pub use super::effect_catalogue::{CATALOGUE, EffectKind, Parameter};
pub use super::table::Real;

use super::table::Table;
use crate::error::{InputError, Result};

impl EffectKind {
    /// The kind called `id`.
    pub fn named(id: &str) -> Option<&'static EffectKind> {
        CATALOGUE.iter().find(|kind| kind.id == id)
    }

    /// Parameters that are in range each and that contradict one another: key, what, remedy.
    fn contradiction(&self, values: &[f64]) -> Option<(&'static str, String, &'static str)> {
        match (self.id, values) {
            ("output_saturation", &[low, high]) if low >= high => Some((
                "high_dps",
                format!("is {high}, and `low_dps` is {low}: nothing is between them"),
                "give `low_dps` below `high_dps`; without a limit, delete the effect",
            )),
            _ => None,
        }
    }

    /// The values of the effect's table; a parameter that is left out has `base`'s value, or its
    /// default.
    fn read(&self, t: &Table, base: Option<&[f64]>) -> Result<Vec<f64>> {
        let parameters = self.parameters.iter().enumerate();
        let read = |(i, p): (usize, &Parameter)| {
            let left_out = base.and_then(|b| b.get(i).copied()).or(p.default);
            t.take(p.key, left_out, |v| v.real(p.accepted, p.meaning))
        };
        let values = parameters.map(read).collect::<Result<Vec<f64>>>()?;
        let Some((key, what, help)) = self.contradiction(&values) else {
            return Ok(values);
        };
        let e = match t.get(key) {
            Some(value) => value.error(what),
            None => t.error(format!("`{key}` of {} {what}", t.title())),
        };
        Err(e.help(help).into())
    }
}

/// Departures of the simulated device from the declared model: effects and their parameters.
///
/// The default has none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Effects {
    /// In the catalogue's order, whatever the file's.
    on: Vec<(&'static EffectKind, Vec<f64>)>,
}

impl Effects {
    /// The parameters of the effect `id` in the catalogue's order; `None` if it is off.
    pub fn values(&self, id: &str) -> Option<&[f64]> {
        let found = self.on.iter().find(|(kind, _)| kind.id == id);
        found.map(|(_, values)| values.as_slice())
    }

    /// As [`values`](Self::values), for an effect with `N` parameters; `None` also for another `N`.
    pub fn get<const N: usize>(&self, id: &str) -> Option<[f64; N]> {
        let values = self.values(id)?;
        debug_assert_eq!(values.len(), N, "{id}");
        values.try_into().ok()
    }

    /// Multiplies a parameter of an effect that is on, by its position in the catalogue.
    pub fn scale(&mut self, id: &str, parameter: usize, factor: f64) {
        let found = self.on.iter_mut().find(|(kind, _)| kind.id == id);
        if let Some(value) = found.and_then(|(_, values)| values.get_mut(parameter)) {
            *value *= factor;
        }
    }

    /// The effects that are on, with their parameters, in the catalogue's order.
    pub fn iter(&self) -> impl Iterator<Item = (&'static EffectKind, &[f64])> {
        self.on.iter().map(|(kind, v)| (*kind, v.as_slice()))
    }

    /// True if the device is as declared.
    pub fn is_empty(&self) -> bool {
        self.on.is_empty()
    }

    /// Switches an effect on, or gives it other parameters: all of them, in the catalogue's order.
    ///
    /// # Errors
    /// An unknown effect, another number of parameters, or one out of its range.
    pub fn set(&mut self, id: &str, values: &[f64]) -> Result<()> {
        let Some(kind) = EffectKind::named(id) else {
            let ids: Vec<&str> = CATALOGUE.iter().map(|kind| kind.id).collect();
            let help = match crate::nearest::nearest(id, &ids) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("it can be {}", super::keys::one_of(ids.into_iter())),
            };
            let e = InputError::new(format!("there is no effect `{id}`"));
            return Err(e.help(help).into());
        };
        let refused = |what: String, help: &str| {
            InputError::new(format!("the effect `{id}`: {what}")).help(help.to_owned())
        };
        if values.len() != kind.parameters.len() {
            let keys = kind.parameters.iter().map(|p| p.key);
            let what = format!("takes {} parameters", kind.parameters.len());
            let help = format!(
                "give {}",
                super::keys::one_of(keys).replace(" or ", " and ")
            );
            return Err(refused(what, &help).into());
        }
        for (p, &value) in kind.parameters.iter().zip(values) {
            if !(value.is_finite() && p.accepted.accepts(value)) {
                let what = format!("`{}` is {value}; it has to be {}", p.key, p.accepted.rule());
                return Err(refused(what, p.meaning).into());
            }
        }
        if let Some((key, what, help)) = kind.contradiction(values) {
            return Err(refused(format!("`{key}` {what}"), help).into());
        }
        self.remove(id);
        self.on.push((kind, values.to_vec()));
        let place = |kind: &EffectKind| CATALOGUE.iter().position(|k| k.id == kind.id);
        self.on.sort_by_key(|(kind, _)| place(kind));
        Ok(())
    }

    /// Switches an effect off; true if it was on.
    pub fn remove(&mut self, id: &str) -> bool {
        let before = self.on.len();
        self.on.retain(|(kind, _)| kind.id != id);
        self.on.len() < before
    }
}

/// Reads `[gyro.effects]`: a file with a `[gyro]` has the effects that it names and no others.
pub(super) fn read(gyro: &Table, base: Option<&Effects>) -> Result<Effects> {
    if let (false, Some(base)) = (gyro.is_given(), base) {
        return Ok(base.clone());
    }
    let section = gyro.section("effects")?;
    let mut effects = Effects::default();
    for kind in CATALOGUE {
        let t = section.section(kind.id)?;
        if t.is_given() {
            let base = base.and_then(|b| b.values(kind.id));
            effects.on.push((kind, kind.read(&t, base)?));
        }
    }
    Ok(effects)
}

#[cfg(test)]
#[path = "effects_tests.rs"]
mod tests;
