//! Word-length studies: what each bit of the circuit buys, in the figures of a gyro's data sheet.
//!
//! [`space`] says which words vary, [`retune`] makes a design with other lengths. [`scenario`] is what every design
//! runs, [`measure`] runs it, [`figures`] are what comes out, [`merit`] is one number of them. [`mod@bench`] runs and
//! prices designs, each once, [`journal`] keeps that. [`front`] and [`search`] look for the cheapest, [`quarter`] for one that
//! costs a quarter less. [`verify`] runs
//! again what is reported, [`certainty`] says how certain that is, [`budget`] says what each word adds, [`job`] does all of it, `reporting` what follows the search, `unmet` says why no design is enough, `late` which starts are too far off, [`progress`] says how far it is, [`outcome`] is `study.json`, [`shard`] divides the work.

mod additive;
pub mod answer;
pub mod bandwidth;
pub mod bench;
pub mod budget;
pub mod certainty;
pub mod design_text;
pub mod figures;
pub mod front;
pub mod job;
pub mod journal;
mod late;
pub mod measure;
pub mod merit;
pub mod outcome;
pub mod overflow;
pub mod progress;
pub mod quarter;
pub mod reporting;
pub mod retune;
pub mod scenario;
pub mod search;
pub mod shard;
pub mod space;
mod unmet;
pub mod verify;
