//! Whether a draw is what its class promises, and what else would explain it.

use super::covariates::Auxiliary;
use super::form::Planted;
use super::linear::{Span, rms};
use super::rivals::rivals;
use super::world::World;
use super::{Class, EVIDENCE, INSEPARABLE};

/// (planted, other, correlation).
pub type Likeness = Vec<(String, String, f64)>;

/// What a draw is judged by.
pub struct Bench<'a> {
    pub class: Class,
    pub w: &'a World,
    /// Short-term noise, deg/s.
    pub short_term: f64,
    /// Ids that come near an outside cause.
    pub nearest: &'a [&'static str],
    pub channels: &'a [&'static str],
    pub auxiliaries: &'a [Auxiliary],
}

impl Bench<'_> {
    /// Alternatives and closest others of all that is planted; None where the draw does not suit its class.
    pub fn judge(&self, planted: &[Planted]) -> Option<(Likeness, Likeness)> {
        let (mut alternatives, mut closest) = (Vec::new(), Vec::new());
        if self.class == Class::Unexcited {
            return Some((alternatives, closest));
        }
        for (k, p) in planted.iter().enumerate() {
            let rest = planted.iter().enumerate().filter(|(j, _)| *j != k);
            let others: Vec<&[f64]> = rest.map(|(_, o)| o.contribution.as_slice()).collect();
            let mut base = Span::declared(&self.w.reading());
            others.iter().for_each(|o| base.add(o));
            let own = rms(&base.residual(&p.contribution));
            // Hidden in the declared model, or in one another.
            if p.surviving < 0.03 || own < 0.7 * p.orthogonal_rms {
                return None;
            }
            // A scale factor that errs by more is another sensor.
            let errs = p.id.starts_with("scale_factor") || p.id == "outside:accel_times_rate";
            if errs && rms(&p.contribution) > 0.15 * rms(&self.w.rate_dps) {
                return None;
            }
            let all = rivals(
                self.w,
                &p.id,
                &p.contribution,
                &others,
                self.channels,
                self.auxiliaries,
            );
            if all
                .iter()
                .any(|(id, r)| self.is_too_close(&p.id, id, *r, own))
            {
                return None;
            }
            let like = |(id, r): &(String, f64)| (p.id.clone(), id.clone(), *r);
            closest.extend(all.first().map(like));
            alternatives.extend(
                all.iter()
                    .filter(|(_, r)| self.is_alternative(*r, own))
                    .map(like),
            );
        }
        let suits = self.class != Class::Confounded || !alternatives.is_empty();
        suits.then_some((alternatives, closest))
    }

    /// The id whose best shape fits an error (deg/s) best, for classes with one cause of the catalogue: what a plain
    /// search through the dictionary names, with no care for how many shapes an id has.
    pub fn best(&self, error: &[f64]) -> Option<String> {
        let one = matches!(self.class, Class::Single | Class::Faint | Class::Covariate);
        let all = one.then(|| rivals(self.w, "", error, &[], self.channels, self.auxiliaries))?;
        all.into_iter().next().map(|(id, _)| id)
    }

    /// True where an id that correlates by `r` is as good an answer: alike in shape, or what it leaves of the effect (`own`,
    /// deg/s rms) drowns in white noise over the record's rows.
    fn is_alternative(&self, r: f64, own: f64) -> bool {
        let left = own / self.short_term;
        r > INSEPARABLE || self.w.len() as f64 * left * left * (1.0 - r * r) < EVIDENCE
    }

    /// True where `other` spoils the record for its class.
    fn is_too_close(&self, planted: &str, other: &str, r: f64, own: f64) -> bool {
        match self.class {
            Class::Confounded => false,
            Class::HiddenChannel => r > 0.9,
            Class::Outside if !self.nearest.contains(&other) => r > 0.9,
            // A lag shorter than everything in the program is a rate; the reverse need not be.
            _ if planted == "temperature_rate" && other == "thermal_lag" => false,
            _ if other.starts_with("covariate:") => r > 0.9,
            _ => self.is_alternative(r, own),
        }
    }
}
