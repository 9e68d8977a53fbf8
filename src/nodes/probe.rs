//! Looks on while a chain runs in [`Paired`](crate::numeric::paired::Paired): gives every node its
//! name, adds up what it does, remembers the first overflow.

use super::activity::Activity;
use super::layout::Places;
use super::loops::PhaseLoopBound;
use super::node::{Event, History, Node};
use super::polar::Polar;
use crate::circuit::chain::Chain;
use crate::circuit::compensation::Evaluation;
use crate::design::Design;
use crate::numeric::cast::{Cast, Label};
use crate::numeric::format::pow2;
use crate::numeric::lane::Lane;
use crate::numeric::paired::{Pair, Watch};
use std::cell::{Cell, RefCell};
use std::f64::consts::TAU;

/// What a cast is to the probe.
#[derive(Debug, Clone, Copy)]
enum Role {
    /// A node of its own.
    Node(usize),
    /// One of the Horner steps: the node of the first step; each step has two.
    Horner { first: usize, outer: bool },
    /// The end of a Horner evaluation.
    Bias(usize),
    /// The phase loop's integral.
    Integral(usize),
    /// No node: a shift inside a loop.
    Inside,
}

/// The observer of one run.
#[derive(Debug)]
pub struct Probe {
    nodes: RefCell<Vec<Node>>,
    places: Places,
    roles: Vec<Role>,
    sample: Cell<u64>,
    cosine_is_next: Cell<bool>,
    horner_step: Cell<usize>,
    table_errors: Vec<f64>,
    polar: Polar,
    phase_loop: RefCell<Option<PhaseLoopBound>>,
    activity: RefCell<Activity>,
    first_overflow: RefCell<Option<Event>>,
    /// Bits that x and y of the CORDIC needed at most.
    needed_width: Cell<u32>,
    /// Rows on which fixed and float phase lay on both sides of the cut at half a turn.
    cut_rows: Cell<u64>,
    /// Sees every raw word.
    tap: Option<Box<dyn Tap>>,
}

/// Sees every raw word of a run, in the order of the steps.
pub trait Tap: std::fmt::Debug {
    /// A word of a node at an ADC sample.
    fn word(&self, node: usize, sample: u64, raw: i128);
}

impl Probe {
    /// For a chain of a design. The nodes stand in the order of the circuit's steps.
    pub fn new<const N: usize>(design: &Design, chain: &Chain<N>) -> Self {
        let layout = super::layout::Layout::new(design);
        let mut roles = Vec::new();
        let mut role = |cast: &Cast, role: Role| {
            if roles.len() <= cast.id {
                roles.resize(cast.id + 1, Role::Inside);
            }
            roles[cast.id] = role;
        };
        let places = layout.places;
        for k in 0..4 {
            role(&chain.mixers[k].product, Role::Node(places.product + k));
            role(&chain.cics[k].output, Role::Node(places.decimator + k));
        }
        if let (Some((bias, rate)), Some(at)) = (&chain.compensation, places.bias) {
            if let (Some((first, _)), Evaluation::Horner(horner)) =
                (places.horner, &bias.evaluation)
            {
                role(
                    &horner.first,
                    Role::Horner {
                        first,
                        outer: false,
                    },
                );
                role(
                    &horner.inner,
                    Role::Horner {
                        first,
                        outer: false,
                    },
                );
                role(&horner.outer, Role::Horner { first, outer: true });
            }
            role(bias.output_cast(), Role::Bias(at));
            role(&rate.scale, Role::Node(at + 1));
            role(&rate.output, Role::Node(at + 2));
        }
        if let (Some(l), Some(at)) = (&chain.phase_loop, places.phase_loop) {
            role(&l.accumulate, Role::Integral(at));
        }
        Probe {
            nodes: RefCell::new(layout.identities.into_iter().map(Node::new).collect()),
            places,
            roles,
            sample: Cell::new(0),
            cosine_is_next: Cell::new(false),
            horner_step: Cell::new(0),
            table_errors: table_errors(chain),
            polar: Polar::new(design),
            phase_loop: RefCell::new(PhaseLoopBound::new(design)),
            activity: RefCell::new(Activity::with_period(super::quantisation::repeats(design))),
            first_overflow: RefCell::new(None),
            needed_width: Cell::new(0),
            cut_rows: Cell::new(0),
            tap: None,
        }
    }

    /// The same with a tap.
    pub fn with_tap(mut self, tap: Box<dyn Tap>) -> Self {
        self.tap = Some(tap);
        self
    }

    #[inline(always)]
    fn tap(&self, node: usize, raw: i128) {
        if let Some(tap) = &self.tap {
            tap.word(node, self.sample.get(), raw);
        }
    }

    /// Keeps every word of every node.
    pub fn remembering(self) -> Self {
        for node in self.nodes.borrow_mut().iter_mut() {
            node.history = Some(History::default());
        }
        self
    }

    /// The ADC sample that words belong to from now on.
    #[inline(always)]
    pub fn at_sample(&self, sample: u64) {
        self.sample.set(sample);
    }

    /// The largest drive code of a block of samples; the phase loop's bound needs it.
    pub fn drive_peak(&self, peak: f64) {
        if let Some(bound) = &mut *self.phase_loop.borrow_mut() {
            bound.drive_peak(peak);
        }
    }

    /// Where the nodes are.
    pub fn places(&self) -> Places {
        self.places
    }

    /// Notes a word that is no cast.
    pub fn note<W: Lane>(&self, node: usize, word: &Pair<W>) {
        self.tap(node, word.raw.wide());
        if let Some(node) = self.nodes.borrow_mut().get_mut(node) {
            node.note(word, self.sample.get());
        }
    }

    /// Notes a raw value with error and bound that were made elsewhere.
    pub fn note_error(&self, node: usize, raw: i128, error: f64, bound: f64, real: f64) {
        self.tap(node, raw);
        if let Some(node) = self.nodes.borrow_mut().get_mut(node) {
            node.note_error(raw, error, bound, real, self.sample.get());
        }
    }

    /// The results.
    pub fn finish(self) -> Seen {
        Seen {
            places: self.places,
            nodes: self.nodes.into_inner(),
            activity: self.activity.into_inner(),
            first_overflow: self.first_overflow.into_inner(),
            needed_width: self.needed_width.get(),
            cut_rows: self.cut_rows.get(),
            phase_loop: self.phase_loop.into_inner(),
        }
    }

    #[cold]
    #[inline(never)]
    fn overflow(&self, event: impl FnOnce() -> Event) {
        let mut first = self.first_overflow.borrow_mut();
        if first.is_none() {
            *first = Some(event());
        }
    }

    #[inline(always)]
    fn node_of(&self, cast: &Cast) -> Option<usize> {
        match self.roles.get(cast.id).copied().unwrap_or(Role::Inside) {
            Role::Node(node) | Role::Integral(node) => Some(node),
            Role::Horner { first, outer } => {
                let step = self.horner_step.get();
                self.horner_step.set(step + usize::from(outer));
                Some(first + 2 * step + usize::from(outer))
            }
            Role::Bias(node) => {
                self.horner_step.set(0);
                Some(node)
            }
            Role::Inside => None,
        }
    }
}

/// What a probe has seen.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Where the nodes are.
    pub places: Places,
    /// In the order of the circuit's steps.
    pub nodes: Vec<Node>,
    /// What the signals were like.
    pub activity: Activity,
    /// The first overflow in the order of the steps.
    pub first_overflow: Option<Event>,
    /// Bits that x and y of the CORDIC needed where they overflowed; 0 = they did not.
    pub needed_width: u32,
    /// Rows on which the phases lay on both sides of the cut.
    pub cut_rows: u64,
    /// The phase loop's bound at the end.
    pub phase_loop: Option<PhaseLoopBound>,
}

impl Watch for Probe {
    #[inline(always)]
    fn cast<W: Lane>(
        &self,
        cast: &Cast,
        input: &Pair<W>,
        rounded: W,
        operands: &[Pair<W>],
        mut output: Pair<W>,
    ) -> Pair<W> {
        let Some(place) = self.node_of(cast) else {
            return output;
        };
        if let Some(Role::Integral(_)) = self.roles.get(cast.id)
            && let Some(bound) = &mut *self.phase_loop.borrow_mut()
        {
            if rounded != output.raw {
                bound.lose(self.sample.get());
            }
            let known = bound.integral_counts();
            if output.bound + output.phase_bound > known {
                (output.bound, output.phase_bound) = (known, 0.0);
            }
        }
        let channel = place.wrapping_sub(self.places.product);
        if let (0..4, [code, entry, ..]) = (channel, operands) {
            let mut activity = self.activity.borrow_mut();
            activity.product(channel, output.real, code.raw.wide(), entry.raw.wide());
        } else if channel < 8 {
            self.activity.borrow_mut().output(channel - 4, output.real);
        }
        let mut nodes = self.nodes.borrow_mut();
        let Some(node) = nodes.get_mut(place) else {
            return output;
        };
        self.tap(place, output.raw.wide());
        node.note(&output, self.sample.get());
        node.different.mark(input.raw.wide() as u64);
        if !cast.is_proved() {
            node.note_before(rounded.wide());
        }
        if rounded != output.raw {
            node.overflows += 1;
            self.overflow(|| Event {
                sample: self.sample.get(),
                label: cast.label,
                part: node.identity.name.clone(),
                node: place,
                operands: operands.iter().map(|w| w.raw.wide()).collect(),
                value: rounded.wide(),
            });
        } else if cast.shift > 0 && (cast.shift as u32) < W::BITS {
            let dropped = rounded.shl(cast.shift as u32).minus(input.raw).real();
            node.note_local(dropped * crate::numeric::paired::exp2i(-cast.shift));
        }
        output
    }

    #[inline(always)]
    fn sine<W: Lane>(&self, word: &Pair<W>) {
        let cosine = self.cosine_is_next.replace(!self.cosine_is_next.get());
        self.tap(self.places.sine + usize::from(cosine), word.raw.wide());
        if let Some(node) = self
            .nodes
            .borrow_mut()
            .get_mut(self.places.sine + usize::from(cosine))
        {
            node.note(word, self.sample.get());
        }
    }

    #[inline(always)]
    fn table_error(&self, address: usize) -> f64 {
        self.table_errors.get(address).copied().unwrap_or(f64::MAX)
    }

    #[inline(always)]
    fn phase_cap_turns(&self) -> f64 {
        self.phase_loop
            .borrow()
            .as_ref()
            .map_or(0.0, PhaseLoopBound::phase_turns)
    }

    #[inline(always)]
    fn tuning_cap_turns(&self) -> f64 {
        self.phase_loop
            .borrow()
            .as_ref()
            .map_or(0.0, PhaseLoopBound::tuning_turns)
    }

    fn polar<W: Lane>(&self, i: &Pair<W>, q: &Pair<W>) -> [Pair<W>; 2] {
        let outcome = self.polar.run(i, q);
        let mut phase = outcome.phase;
        if let Some(bound) = &mut *self.phase_loop.borrow_mut() {
            let own = i.bound.hypot(q.bound);
            let measured = bound.row(&phase, outcome.length - own, self.sample.get());
            phase.phase_bound = phase.phase_bound.min((measured - phase.bound).max(0.0));
        }
        let length = outcome.magnitude.real;
        self.activity.borrow_mut().vector(phase.real, length);
        if (phase.value() - phase.real).abs() > 0.5 {
            self.cut_rows.set(self.cut_rows.get() + 1);
        }
        self.note(self.places.phase, &phase);
        self.note(self.places.phase + 1, &outcome.magnitude);
        if let Some(bits) = outcome.needed_width {
            self.needed_width.set(self.needed_width.get().max(bits));
            if let Some(node) = self.nodes.borrow_mut().get_mut(self.places.phase) {
                node.overflows += 1;
            }
            self.overflow(|| Event {
                sample: self.sample.get(),
                label: Label::of("circuit.cordic.width"),
                part: "circuit.cordic.width".into(),
                node: self.places.phase,
                operands: vec![i.raw.wide(), q.raw.wide()],
                value: 1i128 << (bits - 2).min(126),
            });
        }
        [phase, outcome.magnitude]
    }
}

/// |entry - amplitude * sin| of every table entry.
fn table_errors<const N: usize>(chain: &Chain<N>) -> Vec<f64> {
    let table = &chain.nco.table;
    let lsb = pow2(-(table.fraction_bits as i32));
    let turn = pow2(-(table.address_bits as i32));
    let entries = table.entries.iter().zip(0u32..);
    entries
        .map(|(raw, k)| {
            let sine = table.amplitude * (f64::from(k) * turn * TAU).sin();
            (*raw as f64 * lsb - sine).abs() + table.amplitude * 4.0 * f64::EPSILON
        })
        .collect()
}
