//! Marks: what was named first, what was named beside it, and what is alike.

use std::collections::BTreeMap;

/// One answer: effects in order, each with what it cannot be told from.
#[derive(Debug, Clone, Default)]
pub struct Answer {
    pub steps: Vec<(String, Vec<String>)>,
}

/// Marks of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    /// The first step is one of the truth.
    pub first: bool,
    /// It is, or it lists one.
    pub alike: bool,
    /// All of the truth was named, in any order.
    pub all: bool,
    /// Steps that are not in the truth and not alike to one of it.
    pub extra: usize,
}

/// Marks an answer against the truth (ids).
pub fn mark(answer: &Answer, truth: &[&str]) -> Mark {
    let is = |id: &String| truth.contains(&id.as_str());
    let hit = |step: &(String, Vec<String>)| is(&step.0) || step.1.iter().any(is);
    let first = answer.steps.first();
    Mark {
        first: first.is_some_and(|s| is(&s.0)),
        alike: first.is_some_and(hit),
        all: truth.iter().all(|t| answer.steps.iter().any(|s| s.0 == *t)),
        extra: answer.steps.iter().filter(|s| !hit(s)).count(),
    }
}

/// How often each truth was answered by what.
#[derive(Debug, Clone, Default)]
pub struct Confusion {
    cells: BTreeMap<(String, String), usize>,
}

impl Confusion {
    pub fn add(&mut self, truth: &str, answer: &Answer) {
        let named = match answer.steps.as_slice() {
            [] => "nothing".to_owned(),
            steps => steps
                .iter()
                .map(|s| s.0.as_str())
                .collect::<Vec<_>>()
                .join("+"),
        };
        *self.cells.entry((truth.to_owned(), named)).or_default() += 1;
    }

    /// One line a cell.
    pub fn table(&self) -> String {
        let line = |((truth, named), n): (&(String, String), &usize)| {
            format!("{truth:44} {n:5}  {named}\n")
        };
        self.cells.iter().map(line).collect()
    }
}
