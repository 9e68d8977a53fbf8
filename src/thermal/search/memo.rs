//! What was found beside some terms, kept: a search comes back to the same terms, when it sweeps, when it asks
//! how stable a step is, and when it reports.

use super::Term;
use crate::thermal::effects::Point;
use std::cell::RefCell;
use std::collections::VecDeque;

/// Entries that are kept: a search comes back to what it has just left.
const KEPT: usize = 32;

/// The same of rounds, which are smaller than models and are met again from another beginning.
pub const SOME: usize = 128;

/// The same of shapes alone, which are small: another beginning of the search comes by most of the first one's.
pub const MANY: usize = 512;

/// Terms by their ids and shapes, in order.
type Key = Vec<(String, Point)>;

/// The latest results by the terms that they belong to.
pub struct Memo<T> {
    entries: RefCell<VecDeque<(Key, T)>>,
    kept: usize,
}

impl<T> Default for Memo<T> {
    fn default() -> Self {
        Memo::of(KEPT)
    }
}

impl<T> Memo<T> {
    /// One that keeps so many.
    pub fn of(kept: usize) -> Self {
        Memo {
            entries: RefCell::new(VecDeque::new()),
            kept,
        }
    }
}

fn key(terms: &[Term]) -> Key {
    terms.iter().map(|t| (t.id(), t.point.clone())).collect()
}

impl<T: Clone> Memo<T> {
    /// The result beside these terms.
    pub fn get(&self, terms: &[Term]) -> Option<T> {
        let key = key(terms);
        let entries = self.entries.borrow();
        entries.iter().find(|e| e.0 == key).map(|e| e.1.clone())
    }

    /// Keeps a result, in place of the oldest.
    pub fn keep(&self, terms: &[Term], value: T) {
        let key = key(terms);
        let mut entries = self.entries.borrow_mut();
        entries.retain(|e| e.0 != key);
        if entries.len() == self.kept {
            entries.pop_front();
        }
        entries.push_back((key, value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn term(id: &str, theta: f64) -> Term {
        use crate::thermal::effects::Candidate;
        use crate::thermal::effects::tone::Pickup;
        let candidate: std::sync::Arc<dyn Candidate> = std::sync::Arc::new(Pickup {
            frequency_hz: theta,
            further: id == "outside:tone",
        });
        Term::new(candidate, Point::at(0, &[theta]))
    }

    #[test]
    fn results_belong_to_their_terms_and_the_oldest_go_first() {
        let memo = Memo::default();
        let terms = |k: usize| vec![term("periodic_pickup", k as f64)];
        for k in 0..KEPT + 1 {
            memo.keep(&terms(k), k);
        }
        assert_eq!(memo.get(&terms(0)), None);
        assert_eq!(memo.get(&terms(1)), Some(1));
        memo.keep(&terms(1), 100);
        assert_eq!(memo.get(&terms(1)), Some(100));
        // Kept again: the next to go is another one.
        memo.keep(&terms(50), 50);
        assert_eq!(
            (memo.get(&terms(1)), memo.get(&terms(2))),
            (Some(100), None)
        );
        // In place of an entry that is not the oldest.
        memo.keep(&terms(5), 105);
        assert_eq!(memo.get(&terms(5)), Some(105));
        // Another id, another shape, another length: other terms.
        assert_eq!(memo.get(&[term("outside:tone", 3.0)]), None);
        assert_eq!(memo.get(&[]), None);
    }
}
