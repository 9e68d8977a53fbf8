//! Circuits that take their sample rate from another, and from one another what they have in common after it.
//!
//! The decimated rate has three stages: combs with the decimator's output, CORDIC, compensation. A stage is a
//! function of the sums and of the tables of the design up to it, so circuits with one front that agree in these
//! tables make the same words there. The first of them makes them for all.

use super::engine::{self, ArithmeticKind, Engine, Front, Rows};
use super::row_batch::{Decimated, Polar, Stages};
use crate::design::{Circuit, Design};
use crate::numeric::fixed::Overflowed;

/// True if two circuits with one front decimate its sums to the same words.
fn share_combs(a: &Circuit, b: &Circuit) -> bool {
    a.decimator == b.decimator
}

/// True if two circuits with the same decimated words make the same phase and magnitude of them.
fn share_a_cordic(a: &Circuit, b: &Circuit) -> bool {
    a.cordic == b.cordic
}

/// Circuits with one front (see [`super::ensemble::share_a_front`]).
#[derive(Default)]
pub struct Followers {
    members: Vec<Member>,
    /// Those that make rows stage by stage: by the combs that they share.
    by_combs: Vec<WithCombs>,
    /// Those that make each row by itself.
    row_by_row: Vec<usize>,
    decimated: Vec<Decimated>,
    polar: Vec<Polar>,
}

struct Member {
    /// Whose rows are its own.
    place: usize,
    engine: Box<dyn Engine>,
    circuit: Circuit,
}

/// Members that make the same words of the sums: by the CORDIC that they share.
struct WithCombs {
    by_cordic: Vec<Vec<usize>>,
}

impl Followers {
    /// One more circuit, that of a design that has not started; its rows are those at `place`.
    pub fn add(&mut self, design: &Design, kind: ArithmeticKind, place: usize) {
        let mut engine = engine::engine(design, kind);
        let circuit = design.circuit.clone();
        let number = self.members.len();
        if engine.stages().is_some() {
            self.by_stages(number, &circuit);
        } else {
            self.row_by_row.push(number);
        }
        self.members.push(Member {
            place,
            engine,
            circuit,
        });
    }

    fn by_stages(&mut self, number: usize, circuit: &Circuit) {
        let members = &self.members;
        let of = |numbers: &Vec<usize>| members.get(*numbers.first()?).map(|m| &m.circuit);
        let alike = self.by_combs.iter_mut().find(|with| {
            let first = with.by_cordic.first().and_then(of);
            first.is_some_and(|first| share_combs(first, circuit))
        });
        let Some(alike) = alike else {
            let by_cordic = vec![vec![number]];
            self.by_combs.push(WithCombs { by_cordic });
            return;
        };
        let same = |numbers: &&mut Vec<usize>| {
            of(numbers).is_some_and(|first| share_a_cordic(first, circuit))
        };
        match alike.by_cordic.iter_mut().find(same) {
            Some(numbers) => numbers.push(number),
            None => alike.by_cordic.push(vec![number]),
        }
    }

    /// There is none.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// No rows of each, with their places.
    pub fn no_rows(&self) -> impl Iterator<Item = (usize, Rows)> {
        self.members.iter().map(|m| (m.place, m.engine.no_rows()))
    }

    /// The circuits' engines with their places, in the order in which they came.
    pub fn engines(&mut self) -> impl Iterator<Item = (usize, &mut Box<dyn Engine>)> {
        self.members.iter_mut().map(|m| (m.place, &mut m.engine))
    }

    /// How many take the words of the combs, and how many those of the CORDIC, from another.
    #[cfg(test)]
    pub(super) fn shared(&self) -> [usize; 2] {
        let staged = self.members.len() - self.row_by_row.len();
        let combs = self.by_combs.len();
        let cordics: usize = self.by_combs.iter().map(|w| w.by_cordic.len()).sum();
        [staged - combs, staged - cordics]
    }

    /// Appends the rows of these fronts to those of each circuit. `stopped` is told the place of a circuit that an
    /// overflow stops, as [`Engine::follow`] says.
    pub fn follow(
        &mut self,
        fronts: &[Front],
        rows: &mut [Rows],
        mut stopped: impl FnMut(usize, Box<Overflowed>),
    ) {
        let members = &mut self.members;
        for number in &self.row_by_row {
            if let Some(member) = members.get_mut(*number)
                && let Some(rows) = rows.get_mut(member.place)
                && let Err(overflowed) = member.engine.follow(fronts, rows)
            {
                stopped(member.place, overflowed);
            }
        }
        for WithCombs { by_cordic } in &self.by_combs {
            self.decimated.clear();
            let first = by_cordic.first().and_then(|numbers| numbers.first());
            if let Some((_, stages)) = staged(members, first) {
                stages.decimate(fronts, &mut self.decimated);
            }
            for numbers in by_cordic {
                self.polar.clear();
                if let Some((_, stages)) = staged(members, numbers.first()) {
                    stages.rotate(&self.decimated, &mut self.polar);
                }
                for number in numbers {
                    if let Some((place, stages)) = staged(members, Some(number))
                        && let Some(Rows::Integer(rows)) = rows.get_mut(place)
                    {
                        stages.put(&self.decimated, &self.polar, rows);
                    }
                }
            }
        }
    }
}

/// The stages of a member that has them, and whose rows they make.
fn staged<'a>(
    members: &'a mut [Member],
    number: Option<&usize>,
) -> Option<(usize, &'a mut dyn Stages)> {
    let member = members.get_mut(*number?)?;
    Some((member.place, member.engine.stages()?))
}
