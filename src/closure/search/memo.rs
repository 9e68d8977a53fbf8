//! What was found beside some terms, kept: a search comes back to the same terms, when it sweeps, when it asks
//! how stable a step is, and when it reports.

use super::Term;
use crate::closure::effects::Point;
use std::cell::RefCell;
use std::collections::VecDeque;

/// Entries that are kept: a search comes back to what it has just left.
const KEPT: usize = 8;

/// Terms by their ids and shapes, in order.
type Key = Vec<(String, Point)>;

/// The latest results by the terms that they belong to.
pub struct Memo<T> {
    entries: RefCell<VecDeque<(Key, T)>>,
}

impl<T> Default for Memo<T> {
    fn default() -> Self {
        Memo {
            entries: RefCell::new(VecDeque::new()),
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
        if entries.len() == KEPT {
            entries.pop_front();
        }
        entries.push_back((key, value));
    }
}
