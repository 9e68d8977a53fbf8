//! `gyrogen close --controls`: what a name, and what silence is worth in this record.

use super::stages::Stages;
use crate::design::Design;
use crate::error::Result;
use crate::record::ThermalRecord;
use crate::report::closure::controls as words;
use crate::selftest::controls::{self, Controls, Shown};
use crate::thermal::close::Closed;

/// Controls of a closed record, with progress on a terminal.
///
/// # Errors
/// A record that cannot be closed with what is added.
pub fn run(
    closed: &Closed,
    record: &ThermalRecord,
    design: &Design,
    stages: &Stages,
) -> Result<Controls> {
    let shown = Shown {
        stage: &|what: &str| stages.stage(what),
        progress: &|done: usize, of: usize| stages.at(done as u64, Some(of as u64)),
    };
    controls::run(closed, record, design, super::threads(None), &shown)
}

/// The tables.
pub fn print(c: &Controls) {
    let mut table = super::terminal::table(&[
        "fake column",
        "spectrum of",
        "p, before any cause",
        "p, beside the causes",
        "control",
    ]);
    for fake in &c.negative.fakes {
        table.add_row(words::fake(fake));
    }
    super::terminal::show(&table);
    say!(
        "fake column: noise with that spectrum, which means nothing. p: the probability that noise alone lets the best of all effects do \
         as well, before any cause and beside those that were found. control: whether a cause has the column's name"
    );
    say!("negative control: {}", words::negative(c));
    if !c.positive.is_empty() {
        let mut table = super::terminal::table(&[
            "planted",
            "90 % found from",
            "planted x",
            "which is",
            "named",
            "other names",
        ]);
        for planted in &c.positive {
            table.add_row(words::planted(planted));
        }
        super::terminal::show(&table);
        let listed = match c.positive.iter().any(|p| p.only_listed > 0) {
            true => "; \"listed in\": with another name that lists it as indistinguishable",
            false => "",
        };
        say!(
            "90 % found from: the size that is found in nine of ten records like this one. planted x: the size that was planted in what the \
             closing left. Both are in noises of a row; which is: the planted one in the effect's own unit. named: records with its \
             name{listed}. other names: what else was named (how often)"
        );
    }
    say!("positive control: {}", words::positive(c));
}
