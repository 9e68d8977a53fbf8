//! One step of a correction, a nominal period long, as a block over any arithmetic.
//!
//! Inputs of the step: `restart` (1 = first reading after power-on), the scaled inputs, the rate.
//! The state needs no preparation beyond zeros: a step before which there was none restarts by itself.

use super::formats::Formats;
use super::plan::{MOST_OF_A_KIND, Plan, Term};
use super::rate_terms::{OnRate, passes};
use super::states::Followed;
use super::terms::{OnBias, Slots, exact, raw};
use crate::design::record_columns::unit_behind;
use crate::error::Result;
use crate::numeric::arithmetic::{Arithmetic, Block, Port, Scale, StateVisitor};
use crate::numeric::cast::{Cast, Label};
use crate::numeric::format::{Quantizer, pow2};
use crate::numeric::trace::ir::Interval;

/// The emitted function.
pub const STEP: &str = "correct";
/// Its state's type.
pub const STATE: &str = "state";

type Names = [&'static str; MOST_OF_A_KIND];
const LAGS: Names = [
    "lag_1", "lag_2", "lag_3", "lag_4", "lag_5", "lag_6", "lag_7", "lag_8",
];
const LAG_INPUTS: Names = [
    "lag_input_1",
    "lag_input_2",
    "lag_input_3",
    "lag_input_4",
    "lag_input_5",
    "lag_input_6",
    "lag_input_7",
    "lag_input_8",
];
const PASTS: Names = [
    "past_1", "past_2", "past_3", "past_4", "past_5", "past_6", "past_7", "past_8",
];
const DECAYS: Names = [
    "decay_1", "decay_2", "decay_3", "decay_4", "decay_5", "decay_6", "decay_7", "decay_8",
];
const RELAYS: Names = [
    "relay_1", "relay_2", "relay_3", "relay_4", "relay_5", "relay_6", "relay_7", "relay_8",
];

/// A plan compiled to one step.
#[derive(Debug, Clone)]
pub struct Step {
    on_bias: Vec<OnBias>,
    on_rate: Vec<OnRate>,
    passes: usize,
    /// The full scale, raw in the sum's unit.
    most: i128,
    formats: Formats,
    align: Cast,
    output: Cast,
    /// Of the inputs, the rate and the output.
    ports: Vec<Port>,
}

/// What a correction remembers from one reading to the next.
#[derive(Debug)]
pub struct State<A: Arithmetic> {
    /// 1 once there was a reading.
    started: A::Word,
    /// State and input of each lag.
    lags: Vec<[A::Word; 2]>,
    /// The inputs of each slope, the newest first.
    pasts: Vec<Vec<A::Residue>>,
    decays: Vec<A::Word>,
    /// 1 = on.
    relays: Vec<A::Word>,
}

// Derived, it would ask the arithmetic to be Clone.
impl<A: Arithmetic> Clone for State<A> {
    fn clone(&self) -> Self {
        State {
            started: self.started,
            lags: self.lags.clone(),
            pasts: self.pasts.clone(),
            decays: self.decays.clone(),
            relays: self.relays.clone(),
        }
    }
}

impl Step {
    /// Compiles a plan that was checked.
    ///
    /// # Errors
    /// As [`Plan::check`].
    pub fn new(plan: &Plan, formats: &Formats) -> Result<Self> {
        plan.check()?;
        let mut slots = Slots::default();
        let terms = plan.terms.iter();
        let on_bias = terms.filter_map(|t| OnBias::new(plan, formats, t, &mut slots));
        let mut step = Step {
            on_bias: on_bias.collect(),
            passes: match plan.terms.iter().any(Term::is_on_rate) {
                true => passes(plan, formats),
                false => 0,
            },
            most: raw(plan.full_scale_dps, formats.sum_fraction_bits),
            on_rate: plan
                .terms
                .iter()
                .filter_map(|t| OnRate::new(formats, t))
                .collect(),
            align: exact(
                "correction.rate",
                formats.rate.fraction_bits as i32,
                formats.sum_fraction_bits,
            ),
            output: Cast::to(
                Label::of("correction.output"),
                formats.sum_fraction_bits,
                0,
                Quantizer::default_of(formats.rate),
            ),
            ports: ports(plan, formats),
            formats: formats.clone(),
        };
        for (id, cast) in step.casts_mut().into_iter().enumerate() {
            cast.id = id;
        }
        Ok(step)
    }

    fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts = vec![&mut self.align];
        casts.extend(self.on_bias.iter_mut().flat_map(OnBias::casts_mut));
        casts.extend(self.on_rate.iter_mut().flat_map(OnRate::casts_mut));
        casts.push(&mut self.output);
        casts
    }

    /// The ranges of the step's inputs: restart, inputs, rate.
    pub fn ranges(&self) -> Vec<Interval> {
        let word = |f: &crate::numeric::format::Format| Interval::new(f.min_raw(), f.max_raw());
        let mut ranges = vec![Interval::new(0, 1)];
        ranges.extend(self.formats.inputs.iter().map(word));
        ranges.push(word(&self.formats.rate));
        ranges
    }

    /// Zeros, before the first reading.
    pub fn state<A: Arithmetic>(&self) -> State<A>
    where
        A::Word: Default,
        A::Residue: Default,
    {
        let mut state = State {
            started: A::Word::default(),
            lags: Vec::new(),
            pasts: Vec::new(),
            decays: Vec::new(),
            relays: Vec::new(),
        };
        for term in &self.on_bias {
            match term {
                OnBias::Lag(_) => state.lags.push([A::Word::default(); 2]),
                OnBias::Slope { rows, .. } => state.pasts.push(vec![A::Residue::default(); *rows]),
                OnBias::Decay(_) => state.decays.push(A::Word::default()),
                OnBias::Step(_) => state.relays.push(A::Word::default()),
                OnBias::Constant(_) | OnBias::Product { .. } | OnBias::Curve(_) => {}
            }
        }
        state
    }

    /// The corrected rate of one reading, deg/s; `inputs` as many as the plan's.
    #[inline(always)]
    pub fn run<A: Arithmetic>(
        &self,
        ar: &A,
        state: &mut State<A>,
        restart: A::Word,
        inputs: &[A::Word],
        rate: A::Word,
    ) -> A::Word {
        // Negative unless there was a reading before and none is asked to restart.
        let one = ar.constant(1, 0);
        let first = ar.sub(state.started, one);
        let [fresh, first] = [ar.sub(first, restart), first].map(|word| ar.is_negative(word));
        state.started = one;
        let mut r = ar.cast(rate, &self.align, &[rate]);
        for term in &self.on_bias {
            r = ar.sub(r, self.on_bias(ar, state, term, (fresh, first), inputs));
        }
        let measured = r;
        for _ in 0..self.passes {
            // A pass from beyond the full scale would lead away from it.
            let held = ar.limit(r, -self.most, self.most, self.formats.sum_fraction_bits);
            let mut next = measured;
            for term in &self.on_rate {
                next = ar.sub(next, term.error(ar, held, inputs));
            }
            r = next;
        }
        ar.cast(r, &self.output, &[r])
    }

    #[inline(always)]
    fn on_bias<A: Arithmetic>(
        &self,
        ar: &A,
        state: &mut State<A>,
        term: &OnBias,
        (fresh, first): (A::Truth, A::Truth),
        inputs: &[A::Word],
    ) -> A::Word {
        let sum = self.formats.sum_fraction_bits;
        // The plan was checked: every input exists, and every slot was made for its term.
        let zero = ar.constant(0, sum);
        let input = |k: usize| inputs.get(k).copied().unwrap_or(zero);
        match term {
            OnBias::Constant(raw) => ar.constant(*raw, sum),
            OnBias::Product {
                inputs,
                products,
                gain,
            } => {
                let mut factors = inputs.iter().map(|k| input(*k));
                let mut t = factors.next().unwrap_or(zero);
                for (factor, cast) in factors.zip(products) {
                    t = ar.cast(ar.mul(t, factor), cast, &[t, factor]);
                }
                gain.times(ar, t)
            }
            OnBias::Lag(lag) => {
                let x = match &lag.of {
                    Followed::Input(k) => input(*k),
                    Followed::Curve(curve) => curve.value(ar, input(curve.input())),
                };
                match state.lags.get_mut(lag.slot) {
                    Some(state) => {
                        let anew = if lag.kept { first } else { fresh };
                        lag.term(ar, state, anew, x)
                    }
                    None => zero,
                }
            }
            OnBias::Slope {
                slot,
                input: k,
                ring,
                gain,
                ..
            } => {
                let x = input(*k);
                let mut newest = x;
                let mut oldest = x;
                for past in state.pasts.get_mut(*slot).into_iter().flatten() {
                    oldest = ar.select(fresh, x, ar.centered(*past, ring));
                    *past = ar.residue(newest, ring);
                    newest = oldest;
                }
                gain.times(ar, ar.sub(x, oldest))
            }
            OnBias::Decay(decay) => match state.decays.get_mut(decay.slot) {
                Some(d) => decay.step(ar, d, fresh),
                None => zero,
            },
            OnBias::Curve(curve) => curve.value(ar, input(curve.input())),
            OnBias::Step(relay) => match state.relays.get_mut(relay.slot) {
                Some(on) => {
                    *on = relay.moved(ar, *on, fresh, input(relay.input));
                    ar.mul(*on, ar.constant(relay.gain, sum))
                }
                None => zero,
            },
        }
    }
}

/// The ports of the inputs in order, of the rate, and of what comes out.
fn ports(plan: &Plan, formats: &Formats) -> Vec<Port> {
    let names = plan.input_names();
    let inputs = plan.inputs.iter().zip(&formats.inputs).zip(names);
    let mut ports: Vec<Port> = inputs
        .map(|((input, format), name)| {
            let scale = Scale {
                quantity: input.column.clone(),
                offset: input.offset,
                factor: input.scale * pow2(-(format.fraction_bits as i32)),
                unit: unit_behind(&input.column),
            };
            Port {
                scale: Some(scale),
                ..Port::new(name, format!("{}, {format}", input.formula()))
            }
        })
        .collect();
    let exponent = -(formats.rate.fraction_bits as i32);
    let in_dps = |name, what: &str, further: &str| {
        let meaning = format!(
            "{what} = raw * 2^{exponent} deg/s, {}{further}",
            formats.rate
        );
        Port::new(name, meaning).in_unit(what, exponent, "deg/s")
    };
    ports.push(in_dps("rate", "rate", ""));
    ports.push(in_dps("corrected", "corrected rate", ", saturated"));
    ports
}

impl<A: Arithmetic, const I: usize> Block<A, I, 1> for Step {
    type State = State<A>;
    const NAME: &'static str = STEP;
    const PURPOSE: &'static str = "The corrected rate of one reading.";
    const STATE: &'static str = STATE;

    fn inputs(&self) -> [Port; I] {
        let restart = Port::new("restart", "1 = first reading after power-on, else 0");
        std::array::from_fn(|k| match k.checked_sub(1) {
            Some(k) => self.ports.get(k).cloned().unwrap_or_else(Port::absent),
            None => restart.clone(),
        })
    }

    fn outputs(&self) -> [Port; 1] {
        [self.ports.last().cloned().unwrap_or_else(Port::absent)]
    }

    #[inline(always)]
    fn step(&self, ar: &A, state: &mut State<A>, words: [A::Word; I]) -> [A::Word; 1] {
        match words.as_slice() {
            [restart, inputs @ .., rate] => [self.run(ar, state, *restart, inputs, *rate)],
            // A correction has at least these two.
            _ => [ar.constant(0, 0)],
        }
    }

    fn visit(&self, state: &mut State<A>, visitor: &mut dyn StateVisitor<A>) {
        visitor.word("started", &mut state.started, 0, 1);
        for term in &self.on_bias {
            match term {
                OnBias::Lag(lag) => {
                    let names = LAGS.get(lag.slot).zip(LAG_INPUTS.get(lag.slot));
                    let words = state.lags.get_mut(lag.slot);
                    if let (Some((y, before)), Some(words)) = (names, words) {
                        let (low, high) = lag.limits;
                        for (name, word) in [y, before].into_iter().zip(words) {
                            visitor.word(name, word, low, high);
                        }
                    }
                }
                OnBias::Slope { slot, ring, .. } => {
                    if let (Some(name), Some(past)) = (PASTS.get(*slot), state.pasts.get_mut(*slot))
                    {
                        visitor.residues(name, past, ring);
                    }
                }
                OnBias::Decay(decay) => {
                    let word = state.decays.get_mut(decay.slot);
                    if let Some((name, d)) = DECAYS.get(decay.slot).zip(word) {
                        visitor.word(name, d, 0, decay.one());
                    }
                }
                OnBias::Step(relay) => {
                    let word = state.relays.get_mut(relay.slot);
                    if let Some((name, on)) = RELAYS.get(relay.slot).zip(word) {
                        visitor.word(name, on, 0, 1);
                    }
                }
                OnBias::Constant(_) | OnBias::Product { .. } | OnBias::Curve(_) => {}
            }
        }
    }
}
