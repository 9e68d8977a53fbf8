//! Probabilities that no longer are those of what is in the model.

use super::forward::WORTH;
use super::{LEVEL, Model, Search, Term};
use crate::statistics::Unusable;
use crate::statistics::linear::{Basis, dot};

/// Share of what a shape contributes that is another one than that of its step, from which on its probability is none.
const MOVED: f64 = 0.5;

/// Gain below which a name is asked again beside what came after it: chance makes ten of the best of all candidates in one of a
/// hundred records.
const SLIGHT: f64 = 15.0;

impl Search<'_> {
    /// Tests again, with surrogates, every name whose probability was found beside terms that are no longer in, or in another
    /// shape, or that explains little beside those that came later: two shapes that cancel each other out can both be beyond chance, and neither alone; a curve that came
    /// in place of what is in by now is left with nothing but a few odd rows.
    ///
    /// # Errors
    /// Too few rows.
    pub fn proven(&self, mut model: Model) -> Result<Model, Unusable> {
        let mut k = 0;
        while k < model.terms.len() {
            let mut others = model.terms.clone();
            let mut own = others.remove(k);
            let ids: Vec<String> = others.iter().map(Term::id).collect();
            let moved = self.has_moved(&model, k);
            let later = ids.iter().any(|id| !own.beside.contains(id));
            let slight = later && own.gain < SLIGHT && !own.evident;
            let holds = own.beside.iter().all(|id| ids.contains(id)) && !moved && !slight;
            if holds || !own.candidate.named() {
                k += 1;
                continue;
            }
            let without = self.model(&others)?;
            if self.spikes(&without.fit) > self.spikes(&model.fit) + 1 {
                // Rows that only it explains are out beside the others.
                if moved && self.net(&model) < self.net(&without) + WORTH {
                    model = without;
                    k = 0;
                } else {
                    k += 1;
                }
                continue;
            }
            let round = self.round(&without, self.effort.surrogates);
            let again = round.judged.iter().find(|j| j.candidate.id() == own.id());
            match again.filter(|j| j.p_value <= LEVEL) {
                Some(j) => {
                    own.p_value = j.p_value;
                    own.found_at.clone_from(&own.point);
                    own.beside = ids;
                    model.terms[k] = own;
                    k += 1;
                }
                None => match self.still_a_pair(&model, k)? {
                    Some(pair) => {
                        model = pair;
                        k += 1;
                    }
                    None => {
                        self.bar(own.id());
                        model = without;
                        k = 0;
                    }
                },
            }
        }
        Ok(model)
    }

    /// Whether a shape at one temperature is another one than that of its step: of what it contributes beside the declared
    /// model, most is beyond what it was there.
    fn has_moved(&self, model: &Model, k: usize) -> bool {
        let c = self.channels;
        let own = &model.terms[k];
        if !own.candidate.is_local() || own.point == own.found_at {
            return false;
        }
        let of_used = |column: &Vec<f64>| self.of_used(column);
        let declared: Vec<Vec<f64>> = super::declared(c).iter().map(of_used).collect();
        let then = own.candidate.columns(c, &model.acting, &own.found_at);
        let then = then.iter().map(of_used).collect::<Vec<_>>();
        let left_beside = |columns: &[Vec<f64>]| {
            let mut rest = of_used(&model.contributions(c)[k]);
            Basis::new(columns).project_off(&mut rest);
            dot(&rest, &rest)
        };
        left_beside(&[declared.clone(), then].concat()) > MOVED * left_beside(&declared)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Effort, Term};
    use super::*;
    use crate::thermal::effects::Point;
    use crate::thermal::synthetic::Pull;

    /// What is proven of a resonance that was found at one place, when it is at another and gains so much there, beside a supply.
    fn proven(found_at: &Point, at: &Point, gain: f64) -> Vec<String> {
        let pulled = Pull {
            supply_dps: 0.1,
            ..Pull::default()
        };
        let pulled = pulled.made();
        let c = &pulled.channels;
        let search = Search::new(c, &c.split().unwrap(), Effort::default(), Vec::new());
        let term = |id: &str, point: Point| {
            let mut all = search.candidates().iter();
            let candidate = all.find(|c| c.id() == id).unwrap().clone();
            Term::new(candidate, point)
        };
        let pull = Point::at(0, &[pulled.most_u]);
        let mut terms = vec![
            term("amplitude_phase_coupling", pull),
            term("supply_sensitivity", Point::form(0)),
            term("mode_crossing", at.clone()),
        ];
        terms[2].found_at = found_at.clone();
        for term in &mut terms {
            term.gain = gain;
        }
        let model = search.model(&terms).unwrap();
        let model = search.proven(model).unwrap();
        model.terms.iter().map(Term::id).collect()
    }

    #[test]
    fn a_probability_is_that_of_a_shape() {
        let causes = ["amplitude_phase_coupling", "supply_sensitivity"];
        let broad = Point::at(0, &[-0.5, -0.4]);
        let narrow = Point::at(0, &[0.6, -4.5]);
        assert_eq!(proven(&broad, &narrow, 100.0), causes);
        // Where it was found it is not asked again, nor when it is next to there.
        let near = Point::at(0, &[-0.48, -0.35]);
        for at in [&broad, &near] {
            assert_eq!(proven(&broad, at, 100.0).len(), 3);
            // A gain that chance may make beside what came later is.
            assert_eq!(proven(&broad, at, 10.0), causes);
        }
    }
}
