//! The rules of the house: imports go one way between rooms, and circles inside a room stay small.

use super::imports::Import;
use std::collections::{BTreeMap, BTreeSet};

/// Most files of a circle of imports inside a room.
pub const LARGEST_CIRCLE: usize = 3;

/// The room of a file: its folder, or the file itself.
pub fn room(file: &str) -> &str {
    file.split('/')
        .next()
        .unwrap_or(file)
        .trim_end_matches(".rs")
}

/// Imports of a room that stands later in the order, or of none in it.
pub fn against_the_order(imports: &[Import], order: &[String]) -> Vec<String> {
    let place = |file: &str| order.iter().position(|r| r == room(file));
    let wrong = imports.iter().filter(|i| {
        let (from, to) = (place(&i.from), place(&i.to));
        room(&i.from) != room(&i.to) && !(to.is_some() && to < from)
    });
    wrong
        .map(|i| {
            let (from, to) = (room(&i.from), room(&i.to));
            format!(
                "src/{}:{}: {from} imports {} of {to}, which stands above it",
                i.from, i.line, i.path
            )
        })
        .collect()
}

/// Circles of more than [`LARGEST_CIRCLE`] files, each with the imports that close it; those that lie wholly in the
/// folder `except` are left out.
pub fn circles(imports: &[Import], except: &str) -> Vec<String> {
    let mut next: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for i in imports {
        next.entry(&i.from).or_default().insert(&i.to);
    }
    let reach = |from: &str| {
        let mut seen: BTreeSet<&str> = BTreeSet::new();
        let mut due = vec![from];
        while let Some(at) = due.pop() {
            for to in next.get(at).into_iter().flatten() {
                if seen.insert(to) {
                    due.push(to);
                }
            }
        }
        seen
    };
    let reached: BTreeMap<&str, BTreeSet<&str>> =
        next.keys().map(|from| (*from, reach(from))).collect();
    let returns = |a: &str, b: &str| reached.get(a).is_some_and(|seen| seen.contains(b));
    let mut told: BTreeSet<&str> = BTreeSet::new();
    let mut found = Vec::new();
    for file in next.keys() {
        let circle: BTreeSet<&str> = next
            .keys()
            .filter(|other| returns(file, other) && returns(other, file))
            .copied()
            .collect();
        let excused = circle.iter().all(|f| f.starts_with(except));
        if circle.len() <= LARGEST_CIRCLE || excused || told.contains(file) {
            continue;
        }
        let lines = imports
            .iter()
            .filter(|i| circle.contains(i.from.as_str()) && circle.contains(i.to.as_str()))
            .map(|i| format!("  src/{}:{}: {} ({})", i.from, i.line, i.path, i.to));
        let lines: Vec<String> = lines.collect();
        found.push(format!(
            "{} files import each other in a circle:\n{}",
            circle.len(),
            lines.join("\n")
        ));
        told.extend(circle);
    }
    found
}
