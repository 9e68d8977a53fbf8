//! What became of every effect of the catalogue, and why.

use super::Told;
use crate::text::number;
use crate::thermal::effects::{Candidate, Missing, tone};
use crate::thermal::search::LEVEL;
use crate::thermal::search::judge::Judged;
use crate::verdict::{Evidence, Fate, Step};
use std::sync::Arc;

impl Told<'_> {
    /// Every effect once: what was judged before the first step, what could not be, and what the declared model has.
    pub(super) fn evidence(&self, steps: &[Step]) -> Vec<Evidence> {
        let judged = self.found.first.iter().filter(|j| j.candidate.named());
        let mut out: Vec<Evidence> = judged.map(|j| self.of_judged(j, steps)).collect();
        for (candidate, why) in self.found.missing.iter().filter(|(c, _)| c.named()) {
            let (fate, remark) = match why {
                Missing::Channel(name) => {
                    (Fate::NoChannel, format!("the record has no column {name}"))
                }
                Missing::Excitation(remark) => (Fate::NotExcited, remark.clone()),
            };
            out.push(unjudged(candidate, fate, remark));
        }
        let evident = self.found.terms.iter().filter(|t| t.evident);
        out.extend(evident.map(|term| {
            Evidence {
                effect: term.id(),
                fate: Fate::Taken,
                p_value: Some(term.p_value),
                gain: None,
                remark:
                    "a step: readings that agree to the last digit at an end of the output's range"
                        .to_owned(),
            }
        }));
        out.extend(self.wave(&out));
        let listed: Vec<String> = out.iter().map(|e| e.effect.clone()).collect();
        for candidate in self.search.candidates() {
            if candidate.named() && !listed.contains(&candidate.id()) {
                // What has no free coefficient may be worse than nothing at every size.
                let (fate, remark) = match candidate.is_whole() {
                    true => (Fate::Rejected, "no size of it does better than none"),
                    false => (
                        Fate::NotExcited,
                        "what it does lies within the polynomial in this record",
                    ),
                };
                out.push(unjudged(candidate, fate, remark.to_owned()));
            }
        }
        out
    }

    /// Of an effect that the first round judged.
    fn of_judged(&self, j: &Judged, steps: &[Step]) -> Evidence {
        let effect = j.candidate.id();
        let (fate, remark) = self.fate(j, &effect, steps);
        Evidence {
            effect,
            fate,
            p_value: Some(j.p_value),
            gain: Some(j.gain),
            remark,
        }
    }

    /// What became of it, and why.
    fn fate(&self, j: &Judged, id: &String, steps: &[Step]) -> (Fate, String) {
        if steps.iter().any(|s| s.effect == *id) {
            return (Fate::Taken, "a step".to_owned());
        }
        let experiment = &j.candidate.sheet().experiment;
        let mut rivals = steps.iter().flat_map(|s| &s.indistinguishable_from);
        if rivals.any(|rival| rival == id) || self.found.undecided.contains(id) {
            return (Fate::Confounded, format!("explains as much; {experiment}"));
        }
        if let Some((_, rms_dps)) = self.found.within_rounding.iter().find(|r| r.0 == *id) {
            let remark = format!(
                "its whole contribution, {rms_dps} deg/s rms, is below twice the {} deg/s that the ADC's \
                 rounding makes",
                number(self.search.channels.rounding_dps, 3),
                rms_dps = number(*rms_dps, 3)
            );
            return (Fate::Rejected, remark);
        }
        if j.p_value > LEVEL && self.search.is_declared(j) {
            let remark = format!(
                "goes with the temperature in this record: the polynomial has whatever it does; {experiment}"
            );
            return (Fate::Confounded, remark);
        }
        let remark = rejected(j.p_value, j.gain, steps.is_empty());
        (Fate::Rejected, remark.to_owned())
    }

    /// What is said of `periodic_pickup` where the strongest sinusoid comes back too seldom for its name.
    fn wave(&self, listed: &[Evidence]) -> Option<Evidence> {
        let mut judged = self.found.first.iter();
        let wave = judged.find(|j| j.candidate.id() == tone::FURTHER)?;
        let absent = listed.iter().all(|e| e.effect != tone::NAMED);
        let remark =
            "the strongest sinusoid has fewer than four periods in this record, as a wander has";
        absent.then(|| Evidence {
            effect: tone::NAMED.to_owned(),
            fate: Fate::Rejected,
            p_value: Some(wave.p_value),
            gain: Some(wave.gain),
            remark: remark.to_owned(),
        })
    }
}

/// Why a candidate of this chance and gain in log-likelihood was not taken; `alone` if none was.
fn rejected(p_value: f64, gain: f64, alone: bool) -> &'static str {
    match (p_value <= LEVEL, gain > 0.0, alone) {
        (false, ..) => "chance does as well among so many candidates",
        (true, false, _) => {
            "beyond chance at a first look, but as fitted it makes the record less likely"
        }
        (true, true, false) => "seen alone it helps, but what was taken explains more",
        (true, true, true) => {
            "beyond chance, but it does not hold over the whole record, or a shape without a name explains more"
        }
    }
}

/// Of an effect without a score.
fn unjudged(candidate: &Arc<dyn Candidate>, fate: Fate, remark: String) -> Evidence {
    Evidence {
        effect: candidate.id(),
        fate,
        p_value: None,
        gain: None,
        remark,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What has a gain below 0 is not said to help.
    #[test]
    fn the_remark_does_not_contradict_the_gain() {
        for alone in [false, true] {
            assert!(rejected(5e-4, -6.6, alone).contains("less likely"));
            assert!(rejected(0.97, 3.6, alone).starts_with("chance does as well"));
            assert!(!rejected(2e-9, 3.5, alone).contains("less likely"));
        }
        assert!(rejected(2e-9, 3.5, false).contains("it helps"));
    }
}
