//! Many designs over the same codes: what they have in common at the sample rate is done once.
//!
//! Up to the decimator's sums a circuit is ADC format, oscillator, product and decimator. Designs that are alike
//! so far, and in which no phase loop moves the oscillator, share that work; of the stages after it they share those
//! up to which they are alike too (see [`super::followers`]). The rows are those of each design alone, bit for bit,
//! and so are its overflows.

use super::engine::{self, ArithmeticKind, Engine, Front, Rows};
use super::followers::Followers;
use crate::design::{Circuit, Design};
use crate::numeric::fixed::Overflowed;

/// True if two circuits make the same sums of the same codes.
pub fn share_a_front(a: &Circuit, b: &Circuit) -> bool {
    let of = |c: &Circuit| {
        let d = &c.decimator;
        let decimator = (d.stages, d.ratio, d.differential_delay);
        (
            c.adc.clone(),
            c.nco.clone(),
            c.demodulator.clone(),
            decimator,
        )
    };
    a.phase_loop.is_none() && b.phase_loop.is_none() && of(a) == of(b)
}

/// True if two circuits also excite a gyro alike, so that both see the same codes in closed loop with it: loops act
/// on what the whole circuit makes of them.
pub fn share_a_closed_loop(a: &Circuit, b: &Circuit) -> bool {
    a == b
        || (a.sample_rate_hz == b.sample_rate_hz
            && a.amplitude_loop.is_none()
            && b.amplitude_loop.is_none()
            && share_a_front(a, b))
}

/// Groups of places, in order of their first: `alike` with the first of a group is in it.
pub fn groups<T>(all: &[T], alike: impl Fn(&T, &T) -> bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (k, one) in all.iter().enumerate() {
        let first_of = |group: &&mut Vec<usize>| {
            let first = group.first().and_then(|first| all.get(*first));
            first.is_some_and(|first| alike(first, one))
        };
        match groups.iter_mut().find(first_of) {
            Some(group) => group.push(k),
            None => groups.push(vec![k]),
        }
    }
    groups
}

/// Designs at work on the same codes.
pub struct Ensemble {
    groups: Vec<Group>,
}

/// Designs with one front.
struct Group {
    /// What runs the sample rate for all; `None`: a design by itself.
    fast: Option<Box<dyn Engine>>,
    fronts: Vec<Front>,
    /// Their places are those among the designs.
    members: Followers,
}

impl Ensemble {
    /// Of designs that have not started.
    pub fn new(designs: &[Design], kind: ArithmeticKind) -> Self {
        let alike = |a: &Design, b: &Design| share_a_front(&a.circuit, &b.circuit);
        let of = |places: Vec<usize>| {
            let mut members = Followers::default();
            for k in &places {
                if let Some(design) = designs.get(*k) {
                    members.add(design, kind, *k);
                }
            }
            let first = places.first().filter(|_| places.len() > 1);
            let first = first.and_then(|k| designs.get(*k));
            Group {
                fast: first.map(|design| engine::engine(design, kind)),
                fronts: Vec::new(),
                members,
            }
        };
        Ensemble {
            groups: groups(designs, alike).into_iter().map(of).collect(),
        }
    }

    /// No rows of each design.
    pub fn no_rows(&self) -> Vec<Rows> {
        let mut rows: Vec<_> = self
            .groups
            .iter()
            .flat_map(|g| g.members.no_rows())
            .collect();
        rows.sort_by_key(|(k, _)| *k);
        rows.into_iter().map(|(_, rows)| rows).collect()
    }

    /// Processes as many drive as sense codes; appends the rows that are complete to those of each design, and tells
    /// whether an overflow stopped it: its first, as [`Engine::process`] does.
    pub fn process(
        &mut self,
        drive: &[i32],
        sense: &[i32],
        rows: &mut [Rows],
    ) -> Vec<Result<(), Box<Overflowed>>> {
        let mut results: Vec<_> = rows.iter().map(|_| Ok(())).collect();
        for group in &mut self.groups {
            let Some(fast) = &mut group.fast else {
                for (k, engine) in group.members.engines() {
                    if let (Some(rows), Some(result)) = (rows.get_mut(k), results.get_mut(k)) {
                        *result = engine.process(drive, sense, rows);
                    }
                }
                continue;
            };
            group.fronts.clear();
            let front = fast.fronts(drive, sense, &mut group.fronts);
            // An overflow at the sample rate is after the periods that came before it.
            if let Err(overflowed) = front {
                for (k, _) in group.members.engines() {
                    if let Some(result) = results.get_mut(k) {
                        *result = Err(overflowed.clone());
                    }
                }
            }
            group.members.follow(&group.fronts, rows, |k, overflowed| {
                if let Some(result) = results.get_mut(k) {
                    *result = Err(overflowed);
                }
            });
        }
        results
    }
}

#[cfg(test)]
#[path = "ensemble_tests.rs"]
mod tests;
