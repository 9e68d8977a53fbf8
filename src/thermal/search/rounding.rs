//! Names for what the circuit's own rounding may have made.

use super::{Found, Model, Search, declared, weighted};
use crate::statistics::Unusable;
use crate::statistics::linear::add_scaled;
use crate::statistics::stats;

/// A step has to contribute this many times the rounding's rms.
const TIMES: f64 = 2.0;

impl Search<'_> {
    /// Drops names, the least first, whose whole contribution is no more than twice what rounding leaves in the
    /// rows ([`crate::thermal::channels::Channels::rounding_dps`]).
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn kept_above_rounding(&self, found: &mut Found) -> Result<(), Unusable> {
        let limit = TIMES * self.channels.rounding_dps;
        while limit > 0.0 && !found.terms.is_empty() {
            let each = self.contributed(&self.model(&found.terms)?);
            let least = (0..each.len()).min_by(|a, b| each[*a].total_cmp(&each[*b]));
            let Some(k) = least.filter(|k| each[*k] < limit) else {
                break;
            };
            let term = self.drop(found, k);
            found.within_rounding.push((term.id(), each[k]));
        }
        Ok(())
    }

    /// The rms of what each term adds beyond what the declared model could take up, over the rows of the fit, deg/s.
    fn contributed(&self, model: &Model) -> Vec<f64> {
        let c = self.channels;
        let weights: Vec<f64> = self.used.iter().map(|u| f64::from(u8::from(*u))).collect();
        let declared = declared(c);
        let own = |mut sum: Vec<f64>| {
            let beta = weighted(&declared, &sum, &weights);
            for (b, column) in beta.iter().zip(&declared) {
                add_scaled(&mut sum, -b, column);
            }
            stats::rms(&self.of_used(&sum))
        };
        model.contributions(c).into_iter().map(own).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::channels::Channels;
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::{Random, triangle};
    use std::collections::BTreeMap;

    /// A supply of 0.03 deg/s rms in noise of 0.01, and what rounding leaves.
    fn names(rounding_dps: f64) -> Found {
        let mut random = Random::new(3);
        let degc = [triangle(150), triangle(150)].concat();
        let supply: Vec<f64> = (0..300)
            .map(|k| f64::from(u8::from(k / 11 % 3 == 1)))
            .collect();
        let output = (0..300).map(|k| {
            let u = degc[k] / 35.0 - 1.0;
            // Large by what the declared model takes up, too.
            0.3 - 2.0 * u + 0.064 * supply[k] + 0.01 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
            ("supply_v".to_owned(), supply),
        ]);
        let time_s: Vec<f64> = (0..300).map(|k| 10.0 * f64::from(k)).collect();
        let mut c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        c.rounding_dps = rounding_dps;
        let split = c.split().unwrap();
        Search::new(&c, &split, Effort::default(), Vec::new())
            .run()
            .unwrap()
    }

    #[test]
    fn a_name_has_to_contribute_twice_what_rounding_leaves() {
        for (rounding_dps, named) in [(0.0, true), (0.012, true), (0.018, false)] {
            let found = names(rounding_dps);
            let ids: Vec<String> = found
                .terms
                .iter()
                .map(crate::thermal::search::Term::id)
                .collect();
            assert_eq!(
                ids == ["supply_sensitivity"],
                named,
                "{rounding_dps}: {ids:?}"
            );
            if !named {
                let (id, rms_dps) = &found.within_rounding[0];
                assert!(ids.is_empty() && id == "supply_sensitivity");
                assert!((0.026..0.034).contains(rms_dps), "{rms_dps}");
                assert_eq!(found.left.as_deref(), Some("supply_v"));
            }
        }
    }
}
