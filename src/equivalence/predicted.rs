//! The root mean square error of each node by the theory of quantisation, from the design and from second
//! moments of the signals; no observed error goes in.
//!
//! - **Table.** The error of each phase is known; what is predicted is its mean square over the phases that
//!   the oscillator visits ([`TableErrors`]).
//! - **Product.** e = code * table error + own rounding. The code's mean square at phase theta is m0 + mc cos 2
//!   theta + ms sin 2 theta (a tone and noise), weighed with the table error's. The own rounding is that of
//!   uniformly spread low bits, but for the zero bits in which codes and entries end.
//! - **Decimator.** A tone's table error is a known sequence times the signal, decimated ([`Lines`]). Noise in the
//!   codes times the table error, and the products' roundings, are white there: times the sum of
//!   the squared taps. Own rounding added.
//! - **CORDIC.** e_phase = (I e_Q - Q e_I) / (2 pi r^2) + an angle left that is uniform within +-a_(n-1) + the table's
//!   roundings + (n - 1) floors, each of variance 1/3 LSB^2 with either sign. e_magnitude likewise along r.
//! - **Compensation.** Horner's slopes from the variable's error, its casts' roundings from where they arise. In the
//!   rate, what table errors do to the phase and to the sense channel is one and the same sequence: their product
//!   is counted.
//!
//! A condition that does not hold is a flag, and the figure is left out. (`coherent_nco` and
//! `few_rows` stand beside a figure: they say that white noise is no model of that table error,
//! or that the observed figure is uncertain.)
//!
//! [`Lines`]: super::table_noise::Lines

use super::table_noise::TableErrors;
use crate::design::Design;
use crate::nodes::activity::{Activity, PHASE_BINS};
use crate::nodes::node::Node;
use crate::nodes::probe::Seen;
use crate::nodes::quantisation::{Spread, cic_noise_gain, spread};
use crate::numeric::format::pow2;

/// What theory says of a node.
#[derive(Debug, Clone, Default)]
pub struct Prediction {
    /// rms of fixed - float, in the node's unit.
    pub rms: Option<f64>,
    /// rms of the node's own rounding, LSB.
    pub local_rms_lsb: Option<f64>,
    /// Conditions that do not hold.
    pub flags: Vec<&'static str>,
}

/// Every flag and what it means.
pub const FLAGS: [(&str, &str); 12] = [
    (
        "coherent_nco",
        "the oscillator steps through few phases over and over, so that the errors of its table are spectral lines, not noise, and roundings may repeat. The predicted rms takes the table's errors as they are, and the roundings as noise",
    ),
    (
        "near_coherent_nco",
        "the oscillator's phases drift slowly over few clusters, or the run is short, so that its table errors are slow waves, not noise. The predicted figure is made as with coherent_nco",
    ),
    (
        "few_words",
        "too few different words reach the rounding for its error to be uniform",
    ),
    (
        "carrier_lines",
        "codes repeat with the phase, so that the products' roundings may be lines, and one of them may be passed whole",
    ),
    (
        "idle_input",
        "the value moves too little from sample to sample for a uniform rounding error",
    ),
    (
        "weak_vector",
        "the drive vector is so short, or its length varies so much, that the phase error is not linear in it",
    ),
    ("closed_loop", "the phase loop feeds the error back"),
    (
        "open_loop_integral",
        "their errors add up over the rows, so that they grow with time. Their rms is not predicted",
    ),
    (
        "other_form",
        "the bias is a table or another form that stands for the polynomial. It has no prediction, as the theory is that of Horner's steps",
    ),
    (
        "overflow",
        "they have overflowed, or a node that stands before them in this table has: their error may not be one of rounding",
    ),
    (
        "phase_cut",
        "on some rows the phase is near half a turn, fixed on one side of the cut and float on the other. The error there is a whole turn",
    ),
    (
        "few_rows",
        "they have fewer than 1000 words, so that the observed rms is itself uncertain. Take more samples",
    ),
];

/// Different words that make the mean square of a uniform error certain to 10 %: with n words its
/// rms has a relative deviation of 0.45 / sqrt(n); three of them and a reserve of 2 for unequal weights.
pub(super) const ENOUGH_WORDS: f64 = 2000.0;
/// Words that make an observed rms certain to 10 %: 0.71 / sqrt(n) for normal errors, three deviations, reserve.
pub(super) const ENOUGH_ROWS: u64 = 1000;
/// Share of a mean square that may be of doubtful whiteness: it then moves the rms by less than 5 %.
pub(super) const DOUBTFUL: f64 = 0.1;
/// Share of samples that have to move.
pub(super) const MOVING: f64 = 0.5;

/// Predictions for every node of a run, in its order.
pub fn predict(design: &Design, seen: &Seen) -> Vec<Prediction> {
    let theory = Theory::new(design, seen);
    let mut all = vec![Prediction::default(); seen.nodes.len()];
    theory.fast(&mut all);
    let inputs = theory.decimators(&mut all);
    let phase = theory.cordic(&mut all, &inputs);
    theory.compensation(&mut all, &inputs, &phase);
    theory.loops(&mut all);
    theory.general(&mut all);
    all
}

/// What is known of the run.
pub(super) struct Theory<'a> {
    pub(super) design: &'a Design,
    pub(super) seen: &'a Seen,
    pub(super) activity: &'a Activity,
    pub(super) spread: Spread,
    pub(super) table: TableErrors,
    /// g' = (R M)^N / 2^G.
    pub(super) gain: f64,
    /// Sum of the squared taps, all taps adding up to g'.
    pub(super) noise_gain: f64,
}

pub(super) fn set(all: &mut [Prediction], at: usize, rms: Option<f64>, flags: &[&'static str]) {
    if let Some(p) = all.get_mut(at) {
        for flag in flags {
            if !p.flags.contains(flag) {
                p.flags.push(flag);
            }
        }
        p.rms = rms.filter(|_| {
            flags
                .iter()
                .all(|f| ["coherent_nco", "few_rows"].contains(f))
        });
    }
}

impl<'a> Theory<'a> {
    fn new(design: &'a Design, seen: &'a Seen) -> Self {
        let d = &design.circuit.decimator;
        let samples = seen.nodes.get(seen.places.sine).map_or(0, |n| n.count);
        let spread = spread(design, samples);
        let width = d.ratio as usize * d.differential_delay as usize;
        let gain = (width as f64).powi(d.stages as i32) * pow2(-(d.gain_bits() as i32));
        Theory {
            design,
            seen,
            activity: &seen.activity,
            spread,
            table: TableErrors::new(design, samples),
            gain,
            noise_gain: cic_noise_gain(d.stages, width) * gain * gain,
        }
    }

    pub(super) fn node(&self, at: usize) -> Option<&Node> {
        self.seen.nodes.get(at)
    }

    pub(super) fn mean_square(&self, at: usize) -> f64 {
        self.node(at).map_or(0.0, Node::mean_square_value)
    }

    pub(super) fn nco_flags(&self) -> Vec<&'static str> {
        match self.spread {
            Spread::Coherent(_) => vec!["coherent_nco"],
            Spread::Clusters(_) => vec!["near_coherent_nco"],
            Spread::Many => Vec::new(),
        }
    }

    /// Is what reaches a node's rounding spread, sample by sample?
    pub(super) fn moves(&self, at: usize) -> bool {
        let node = self.node(at);
        node.is_some_and(|n| n.is_active(MOVING, ENOUGH_WORDS))
    }

    /// Phase bins that have rows, with their share.
    pub(super) fn bins(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let rows = self.activity.rows.max(1) as f64;
        let bins = self.activity.phase_rows.iter().enumerate();
        bins.filter(|(_, n)| **n > 0)
            .map(move |(k, n)| (k, *n as f64 / rows))
    }

    fn loops(&self, all: &mut [Prediction]) {
        let places = self.seen.places;
        if let Some(at) = places.amplitude_loop {
            set(all, at, None, &["open_loop_integral"]);
            set(all, at + 1, None, &["open_loop_integral"]);
        }
        if places.phase_loop.is_some() {
            for k in 0..all.len() {
                set(all, k, None, &["closed_loop"]);
            }
        }
    }

    fn general(&self, all: &mut [Prediction]) {
        let places = self.seen.places;
        let overflowed = self.seen.nodes.iter().position(|n| n.overflows > 0);
        for (k, node) in self.seen.nodes.iter().enumerate() {
            if overflowed.is_some_and(|first| k >= first) {
                set(all, k, None, &["overflow"]);
            }
            if self.seen.cut_rows > 0 && k >= places.phase + 2 {
                set(all, k, None, &["phase_cut"]);
            }
            if node.count < ENOUGH_ROWS {
                set(all, k, None, &["few_rows"]);
            }
        }
    }
}

/// The middle of a phase bin, turns.
pub(super) fn bin_turns(bin: usize) -> f64 {
    (bin as f64 + 0.5) / PHASE_BINS as f64 - 0.5
}
