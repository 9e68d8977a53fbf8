//! What a function's values are used for: which halves of a word are looked at, what is only computed on one side
//! of a branch, how many words are alive at once. A compiler drops and shares by the same facts.

use crate::emit::machine::{Expr, Lowered, Statement, Type, Typed, Value, Width};
use crate::numeric::trace::ir::{Function, Interval};

/// One temporary.
#[derive(Debug, Clone)]
pub struct Use {
    /// The expression that makes it; `None` for what a loop carries or a call returns.
    pub made: Option<Expr>,
    /// Its interval, where known.
    pub range: Option<Interval>,
    /// Users look at the upper half of its 64 bits.
    pub upper: bool,
    /// Share of the executions in which it is needed: one side of a selection is half.
    pub share: f64,
    /// How many statements read it; stores not.
    pub count: usize,
    /// Every reader is a product that takes it as a word of 32 bits.
    pub multiplied_only: bool,
    /// The last statement that reads it, by its number in order of execution.
    last: usize,
}

/// All temporaries of a function, and how many words of 32 bits are alive.
#[derive(Debug)]
pub struct Uses<'a> {
    function: &'a Function,
    temps: Vec<Use>,
    /// Definitions of words where more are alive than `registers`, as often as they are executed.
    pub crowded: f64,
    /// The most that are alive.
    pub peak: usize,
    /// The most that are alive over a call.
    pub over_call: usize,
}

impl<'a> Uses<'a> {
    /// Of a lowered function with its `body` of all conversions; `inside` gives the words that are alive in the callee of a call which is none in
    /// machine code.
    pub fn of(
        function: &'a Function,
        lowered: &Lowered,
        body: &[Statement],
        registers: usize,
        inside: &dyn Fn(usize) -> Option<usize>,
    ) -> Self {
        let mut repeated = Vec::new();
        flatten(body, 1.0, &mut repeated);
        let flat: Vec<&Statement> = repeated.iter().map(|(s, _)| *s).collect();
        let mut uses = Uses {
            function,
            temps: vec![
                Use {
                    made: None,
                    range: None,
                    upper: false,
                    share: 0.0,
                    count: 0,
                    multiplied_only: true,
                    last: 0,
                };
                temps(body)
            ],
            crowded: 0.0,
            peak: 0,
            over_call: 0,
        };
        for statement in &flat {
            if let Statement::Let(t, _, expr, range) = statement {
                uses.temps[*t].made = Some(expr.clone());
                uses.temps[*t].range = *range;
            }
        }
        for (_, v) in &lowered.outputs {
            uses.note(v, true, 1.0, flat.len(), false);
        }
        for (at, statement) in flat.iter().enumerate().rev() {
            uses.statement(statement, at);
        }
        let state = usize::from(!function.state.is_empty());
        uses.alive(&repeated, lowered, state, registers, inside);
        uses
    }

    /// A temporary's uses.
    pub fn temp(&self, t: usize) -> &Use {
        &self.temps[t]
    }

    /// The interval of a value, where known.
    pub fn range(&self, v: &Typed) -> Option<Interval> {
        match v.value {
            Value::Constant(c) => Some(Interval::point(c)),
            Value::Input(k) => Some(self.function.inputs[k].1),
            Value::Temp(t) => match (&self.temps[t].made, self.temps[t].range) {
                (_, Some(range)) => Some(range),
                (Some(Expr::Convert(a) | Expr::ToSigned(a)), None) => self.range(a),
                _ => None,
            },
        }
    }

    /// True if the value is a signed word of 32 bits, perhaps extended.
    pub fn is_narrow(&self, v: &Typed) -> bool {
        match v.value {
            Value::Constant(c) => i32::try_from(c).is_ok(),
            _ if is_signed_word(v.ty) => true,
            Value::Temp(t) => match &self.temps[t].made {
                Some(Expr::Convert(a) | Expr::Low(a)) => is_signed_word(a.ty),
                _ => false,
            },
            Value::Input(_) => false,
        }
    }

    fn note(&mut self, v: &Typed, upper: bool, share: f64, at: usize, product: bool) {
        if let Value::Temp(t) = v.value {
            let u = &mut self.temps[t];
            u.upper |= upper;
            u.share = if u.count > 0 { 1.0 } else { share };
            u.count += 1;
            u.last = u.last.max(at);
            u.multiplied_only &= product;
        }
    }

    /// What a statement does to what it reads; from the last to the first.
    fn statement(&mut self, statement: &Statement, at: usize) {
        match statement {
            Statement::Let(t, ty, expr, _) => self.expression(*t, *ty, expr, at),
            Statement::Carry(_, _, v) => self.note(v, true, 1.0, at, false),
            Statement::Next(values) => {
                for (t, v) in values {
                    self.note(v, true, 1.0, at, false);
                    self.temps[*t].last = self.temps[*t].last.max(at);
                }
            }
            Statement::Call(_, arguments, _) => {
                for a in arguments {
                    self.note(a, true, 1.0, at, false);
                }
            }
            Statement::Store(_, _, v) => {
                // Written as soon as it is made.
                if let Value::Temp(t) = v.value {
                    let u = &mut self.temps[t];
                    u.upper = true;
                    u.share = 1.0;
                    u.multiplied_only = false;
                }
            }
            Statement::Loop(..) => {}
        }
    }

    fn expression(&mut self, t: usize, ty: Type, expr: &Expr, at: usize) {
        let (upper, share) = (self.temps[t].upper, self.temps[t].share);
        let is_short = words(ty) < 2;
        match expr {
            Expr::Convert(a) | Expr::Low(a) | Expr::ToSigned(a) => {
                self.note(a, upper && !is_short, share, at, false);
            }
            Expr::Add(a, b) | Expr::Sub(a, b) => {
                for v in [a, b] {
                    self.note(v, upper, share, at, false);
                }
            }
            Expr::Mul(a, b) => {
                let both = self.is_narrow(a) && self.is_narrow(b);
                for v in [a, b] {
                    self.note(v, upper, share, at, both);
                }
            }
            Expr::Neg(a) | Expr::Shl(a, _) => self.note(a, upper, share, at, false),
            Expr::Mask(a, bits) | Expr::SignExtend(a, bits) => {
                self.note(a, *bits > 32, share, at, false);
            }
            Expr::Select(test, a, b) => {
                self.note(test, false, 1.0, at, false);
                for v in [a, b] {
                    self.note(v, upper, 0.5 * share, at, false);
                }
            }
            other => {
                for v in other.operands() {
                    self.note(&v, true, share, at, false);
                }
            }
        }
    }

    fn alive(
        &mut self,
        flat: &[(&Statement, f64)],
        lowered: &Lowered,
        state: usize,
        registers: usize,
        inside: &dyn Fn(usize) -> Option<usize>,
    ) {
        let mut inputs = vec![0usize; lowered.inputs.len()];
        for (at, (statement, _)) in flat.iter().enumerate() {
            operands(statement, &mut |v| {
                if let Value::Input(k) = v.value {
                    inputs[k] = at;
                }
            });
        }
        let mut live = vec![0usize; flat.len() + 1];
        // Words that end at each statement.
        for (k, last) in inputs.iter().enumerate() {
            live[*last] += words(lowered.inputs[k]);
        }
        let mut now = state + live.iter().sum::<usize>();
        for (at, (statement, times)) in flat.iter().enumerate() {
            if let Statement::Call(number, ..) = statement {
                let waiting = now.saturating_sub(live[at]);
                match inside(*number) {
                    None => self.over_call = self.over_call.max(waiting),
                    // What waits while the callee's words take the registers; both have the state's address.
                    Some(words) => {
                        let waiting = waiting.saturating_sub(state);
                        let over = (waiting + words).saturating_sub(registers.max(words));
                        self.crowded += over.min(waiting) as f64 * times;
                    }
                }
            }
            now -= live[at];
            for (t, ty) in defined(statement) {
                // What only the store takes is gone with it.
                if self.temps[t].last > at {
                    let words = words(ty);
                    now += words;
                    live[self.temps[t].last] += words;
                    if now > registers {
                        self.crowded += words.min(now - registers) as f64 * times;
                    }
                }
            }
            self.peak = self.peak.max(now);
        }
    }
}

fn is_signed_word(ty: Type) -> bool {
    matches!(ty, Type::Signed(width) if width <= Width::W32)
}

fn words(ty: Type) -> usize {
    match ty {
        Type::Signed(w) | Type::Unsigned(w) => w.bits().div_ceil(32) as usize,
        Type::Bool => 0,
    }
}

fn defined(statement: &Statement) -> Vec<(usize, Type)> {
    match statement {
        Statement::Let(t, ty, ..) | Statement::Carry(t, ty, _) => vec![(*t, *ty)],
        Statement::Call(_, _, results) => results.clone(),
        _ => Vec::new(),
    }
}

fn operands(statement: &Statement, note: &mut dyn FnMut(&Typed)) {
    match statement {
        Statement::Let(_, _, expr, _) => expr.operands().iter().for_each(note),
        Statement::Carry(_, _, v) | Statement::Store(_, _, v) => note(v),
        Statement::Next(values) => values.iter().for_each(|(_, v)| note(v)),
        Statement::Call(_, arguments, _) => arguments.iter().for_each(note),
        Statement::Loop(..) => {}
    }
}

/// Every statement with how often it is executed.
fn flatten<'s>(body: &'s [Statement], times: f64, into: &mut Vec<(&'s Statement, f64)>) {
    for statement in body {
        into.push((statement, times));
        if let Statement::Loop(count, inner) = statement {
            flatten(inner, times * f64::from(*count), into);
        }
    }
}

/// One more than the largest temporary.
fn temps(body: &[Statement]) -> usize {
    let of = |s: &Statement| match s {
        Statement::Loop(_, inner) => temps(inner),
        other => defined(other).iter().map(|(t, _)| t + 1).max().unwrap_or(0),
    };
    body.iter().map(of).max().unwrap_or(0)
}
