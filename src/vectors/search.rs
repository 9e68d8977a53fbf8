//! Which inputs and states a function is compared at: ends, random words, both sides of each branch and
//! limit, ties of each rounding, and what tells damaged operations from the function.

use super::incremental::Caller;
use super::interpreter::{Interpreter, low_bits};
use super::model::Model;
use super::stimulus;
use crate::numeric::arithmetic::SineTable;
use crate::numeric::cast::round_shift;
use crate::numeric::trace::ir::{Function, Id, Op};

/// Random vectors of a function of few words.
const RANDOM: usize = 1024;
/// Random vectors of a function of many words, a block of blocks.
const RANDOM_OF_MANY: usize = 256;
/// Words beyond which a function has many.
const MANY: usize = 12;
/// Vectors from which both sides of a branch are sought.
const STARTS: usize = 6;
/// Vectors from which a tie is sought further, once one has been found.
const SPREAD: usize = 64;
/// Newton's steps towards a value.
const ROUNDS: usize = 32;
/// So near is near enough for the last words to be tried one by one.
const NEAR: i128 = 40;
/// Entries of a sine table that are swept one by one.
const SWEPT: u32 = 16;

/// Vectors of a model: inputs and state of each.
pub fn vectors(model: &Model, seed: u64) -> Vec<Vec<i128>> {
    let random = match model.inputs.len() {
        0..MANY => RANDOM,
        _ => RANDOM_OF_MANY,
    };
    let mut chosen: Vec<_> = stimulus::inputs(&model.inputs, random, seed).collect();
    chosen.iter_mut().for_each(|words| model.repair(words));
    let Some((program, number)) = &model.recorded else {
        return chosen;
    };
    let search = Search {
        model,
        program,
        number: *number,
        function: &program.program().functions[*number],
        caller: Caller::new(program, *number),
    };
    search.directed(&mut chosen);
    search.swept(&mut chosen, seed);
    search.telling(&mut chosen, seed);
    let mut seen = std::collections::BTreeSet::new();
    chosen.retain(|words| seen.insert(words.clone()));
    chosen
}

/// A function in which vectors are sought.
pub(super) struct Search<'a> {
    pub(super) model: &'a Model,
    pub(super) program: &'a Interpreter,
    pub(super) number: usize,
    pub(super) function: &'a Function,
    pub(super) caller: Caller<'a>,
}

impl Search<'_> {
    /// The values of all nodes.
    fn values(&self, words: &[i128]) -> Vec<i128> {
        self.caller.evaluated(words).values
    }

    /// The value of one.
    fn value(&self, words: &[i128], node: Id) -> i128 {
        self.caller.value(words, node)
    }

    fn is_allowed(&self, words: &[i128]) -> bool {
        let mut repaired = words.to_vec();
        self.model.repair(&mut repaired);
        let ranges = words.iter().zip(&self.model.inputs);
        repaired == words
            && ranges
                .into_iter()
                .all(|(word, range)| (range.low..=range.high).contains(word))
    }

    /// Adds both sides of each branch and limit, and ties.
    fn directed(&self, chosen: &mut Vec<Vec<i128>>) {
        let many = chosen.clone();
        let starts: Vec<Vec<i128>> = {
            let step = (chosen.len() / SPREAD).max(1);
            chosen.iter().step_by(step).cloned().collect()
        };
        let values: Vec<Vec<i128>> = starts.iter().map(|words| self.values(words)).collect();
        let of = |id: Id| values.iter().map(move |v| v[id]);
        // Ties so far, with what is rounded there.
        let mut ties: Vec<(Id, Vec<Vec<i128>>)> = Vec::new();
        for node in &self.function.nodes {
            match node.op {
                Op::IsNegative(a) => {
                    for edge in [0, 1] {
                        self.edge(&starts, of(a), &|words| self.value(words, a), edge, chosen);
                    }
                }
                Op::Limit(a, low, high) => {
                    for edge in [low, low + 1, high, high + 1] {
                        self.edge(&starts, of(a), &|words| self.value(words, a), edge, chosen);
                    }
                }
                Op::Wrap(a, bits) if bits < 127 => {
                    for edge in [-1i128 << (bits - 1), 1i128 << (bits - 1)] {
                        self.edge(&starts, of(a), &|words| self.value(words, a), edge, chosen);
                    }
                }
                Op::Cast(a, number) => {
                    let program = self.program.program();
                    let cast = &program.casts[number];
                    let round = |v: i128| round_shift(v, cast.shift, cast.rounding);
                    if !program.is_proved_in_range(number) && cast.overflow.is_some() {
                        let (low, high) = cast.limits();
                        for edge in [low, low + 1, high, high + 1] {
                            let rounded = of(a).map(round);
                            let at = |words: &[i128]| round(self.value(words, a));
                            self.edge(&starts, rounded, &at, edge, chosen);
                        }
                    }
                    if (1..=62).contains(&cast.shift) {
                        let half = 1i128 << (cast.shift - 1);
                        let about = |v: i128| [v - 1, v, v + 1];
                        let shift = cast.shift as u32;
                        let before = chosen.len();
                        let targets = [about(0), about(half)].concat();
                        let found = self.ties(&many, (a, shift), &targets, None);
                        for (target, found) in targets.iter().zip(found) {
                            chosen.extend(found);
                            if matches!(self.function.nodes[a].op, Op::Mul(..)) {
                                self.tie_of_product(&starts, a, shift, *target, chosen);
                            }
                        }
                        let first = chosen[before..].to_vec();
                        // What a first rounding drops shows where a later one is at a tie as well.
                        for (earlier, vectors) in &ties {
                            let found = self.ties(vectors, (a, shift), &targets, Some(*earlier));
                            chosen.extend(found.concat());
                        }
                        ties.push((a, first));
                    }
                }
                Op::Sine(phase, number) => {
                    let table = &self.program.program().sine_tables[number];
                    let dropped = table.phase_bits - table.address_bits;
                    if (1..=62).contains(&dropped) {
                        let half = half_step(table);
                        let found = self.ties(&starts, (phase, dropped), &[-half - 1, -half], None);
                        chosen.extend(found.concat());
                    }
                }
                _ => {}
            }
        }
    }

    /// Between vectors on both sides of `value < edge`, neighbours that differ in one word by one.
    fn edge(
        &self,
        starts: &[Vec<i128>],
        values: impl Iterator<Item = i128>,
        value: &dyn Fn(&[i128]) -> i128,
        edge: i128,
        chosen: &mut Vec<Vec<i128>>,
    ) {
        let (mut below, mut above) = (Vec::new(), Vec::new());
        for (words, value) in starts.iter().zip(values) {
            if value < edge { &mut below } else { &mut above }.push(words);
        }
        for (a, b) in below.iter().zip(&above).take(STARTS) {
            let mut at = a.to_vec();
            for k in 0..at.len() {
                let (mut near, mut far) = (at[k], b[k]);
                at[k] = far;
                if value(&at) < edge {
                    continue;
                }
                while near.abs_diff(far) > 1 {
                    at[k] = near + (far - near) / 2;
                    let side = if value(&at) < edge {
                        &mut near
                    } else {
                        &mut far
                    };
                    *side = at[k];
                }
                for word in [near, far] {
                    at[k] = word;
                    if self.is_allowed(&at) {
                        chosen.push(at.clone());
                    }
                }
                break;
            }
        }
    }

    /// For each target, vectors at which the node is it modulo 2^bits: one word is moved, along which the node is linear.
    /// The node `kept`, if any, keeps its value.
    fn ties(
        &self,
        starts: &[Vec<i128>],
        (node, bits): (Id, u32),
        targets: &[i128],
        kept: Option<Id>,
    ) -> Vec<Vec<Vec<i128>>> {
        let mut found = vec![Vec::new(); targets.len()];
        for (tried, start) in spread(starts).enumerate() {
            let is_open =
                |found: &Vec<_>| found.len() <= 2 * STARTS && (found.is_empty() || tried < SPREAD);
            let open: Vec<bool> = found.iter().map(is_open).collect();
            if !open.contains(&true) {
                break;
            }
            let value = self.value(start, node);
            let kept = kept.map(|id| (id, self.value(start, id)));
            let mut words = start.clone();
            for k in 0..words.len() {
                let range = self.model.inputs[k];
                let unit = if words[k] < range.high { 1 } else { -1 };
                words[k] += unit;
                let slope = self
                    .value(&words, node)
                    .wrapping_sub(value)
                    .wrapping_mul(unit);
                let targets = targets.iter().zip(&mut found).zip(&open);
                for ((target, found), _) in targets.filter(|(_, open)| **open) {
                    for step in steps_to(*target, value, slope, bits) {
                        words[k] = start[k] + step;
                        let hits = || {
                            let off = self.value(&words, node).wrapping_sub(*target);
                            off.rem_euclid(1i128 << bits) == 0
                                && kept.is_none_or(|(id, value)| self.value(&words, id) == value)
                        };
                        if self.is_allowed(&words) && hits() {
                            found.push(words.clone());
                        }
                    }
                }
                words[k] = start[k];
            }
        }
        found
    }

    /// Vectors at which a product with a constant is `target` modulo 2^bits: the other factor is solved for and
    /// sought, whatever it is made by.
    fn tie_of_product(
        &self,
        starts: &[Vec<i128>],
        node: Id,
        bits: u32,
        target: i128,
        chosen: &mut Vec<Vec<i128>>,
    ) {
        let Op::Mul(a, b) = self.function.nodes[node].op else {
            return;
        };
        let constant = |id: Id| match self.function.nodes[id].op {
            Op::Constant(word) => Some(word),
            _ => None,
        };
        let (word, factor) = match (constant(a), constant(b)) {
            (Some(c), None) => (b, c),
            (None, Some(c)) => (a, c),
            _ => return,
        };
        let free = factor.trailing_zeros();
        // An input is moved by `tie`.
        let is_input = matches!(
            self.function.nodes[word].op,
            Op::Input(_) | Op::LoadWord(..)
        );
        if factor == 0 || is_input || free >= bits || target.trailing_zeros() < free {
            return;
        }
        let period = 1i128 << (bits - free);
        let due = (target >> free)
            .wrapping_mul(inverse(factor >> free))
            .rem_euclid(period);
        let step = (starts.len() / STARTS).max(1);
        for start in starts.iter().step_by(step) {
            let is = self.value(start, word);
            let nearest = is + (due - is).rem_euclid(period);
            for goal in [nearest, nearest - period] {
                if let Some(words) = self.reached(start, word, goal) {
                    chosen.push(words);
                    return;
                }
            }
        }
    }

    /// A vector near `start` at which the node has this value: one word is moved by the slope, then two by little.
    fn reached(&self, start: &[i128], node: Id, goal: i128) -> Option<Vec<i128>> {
        let mut words = start.to_vec();
        let moved = |words: &[i128], k: usize, by: i128| {
            let range = self.model.inputs[k];
            let mut words = words.to_vec();
            words[k] = (words[k] + by).clamp(range.low, range.high);
            words
        };
        let mut steepest = 0;
        for _ in 0..ROUNDS {
            let off = goal - self.value(&words, node);
            if off.abs() <= NEAR {
                break;
            }
            let slope = |k: usize| {
                let range = self.model.inputs[k];
                let step = ((range.high - range.low) >> 12).max(1);
                let step = if words[k] + step > range.high {
                    -step
                } else {
                    step
                };
                let change = self.value(&moved(&words, k, step), node) - self.value(&words, node);
                change as f64 / step as f64
            };
            let slopes = (0..words.len()).map(|k| (k, slope(k)));
            let (k, most) = slopes.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
            if most == 0.0 {
                return None;
            }
            steepest = k;
            words = moved(&words, k, (off as f64 / most).round() as i128);
        }
        let other = (steepest + 1) % words.len();
        (-NEAR..=NEAR).find_map(|d| {
            let row = moved(&words, steepest, d);
            let value = |e: i128| self.value(&moved(&row, other, e), node);
            let hits = (first_at(&value, goal)?..=NEAR).take_while(|e| value(*e) == goal);
            let mut hits = hits.map(|e| moved(&row, other, e));
            hits.find(|near| self.is_allowed(near))
        })
    }

    /// Every entry of a sine table, once through each node that reads it.
    fn swept(&self, chosen: &mut Vec<Vec<i128>>, seed: u64) {
        let Some((phase, number)) = self.function.nodes.iter().find_map(|node| match node.op {
            Op::Sine(phase, number) => Some((phase, number)),
            _ => None,
        }) else {
            return;
        };
        let table = &self.program.program().sine_tables[number];
        if table.address_bits > SWEPT {
            return;
        }
        let dropped = table.phase_bits - table.address_bits;
        let half = half_step(table);
        let mut lcg = stimulus::Lcg(seed + 6);
        for address in 0..1i128 << table.address_bits {
            let mut words: Vec<i128> = self.model.inputs.iter().map(|r| lcg.word(*r)).collect();
            let is = self.value(&words, phase);
            let inside = i128::from(lcg.draw() >> 1) & ((1 << dropped) - 1);
            let due = low_bits((address << dropped) + inside - half, table.phase_bits);
            // The first word that moves the phase by as much.
            for k in 0..words.len() {
                let before = words[k];
                words[k] = (before + due - is).rem_euclid(1i128 << table.phase_bits);
                if self.is_allowed(&words) && self.value(&words, phase) == due {
                    break;
                }
                words[k] = before;
            }
            chosen.push(words);
        }
    }
}

/// What is added to a phase before its low bits are dropped.
fn half_step(table: &SineTable) -> i128 {
    let dropped = table.phase_bits - table.address_bits;
    match table.half_step && dropped > 0 {
        true => 1 << (dropped - 1),
        false => 0,
    }
}

/// The first of -[`NEAR`] ..= [`NEAR`] at which a monotone function has come to the goal.
fn first_at(value: &dyn Fn(i128) -> i128, goal: i128) -> Option<i128> {
    let (mut low, mut high) = (-NEAR, NEAR);
    let rises = value(low) <= value(high);
    let is_past = |e: i128| match rises {
        true => value(e) >= goal,
        false => value(e) <= goal,
    };
    if !is_past(high) {
        return None;
    }
    while low < high {
        let middle = (low + high).div_euclid(2);
        match is_past(middle) {
            true => high = middle,
            false => low = middle + 1,
        }
    }
    Some(high)
}

/// The steps of a word that bring a value with this slope to the target modulo 2^bits: the shortest, and those of a period
/// more and less; none where no step does.
fn steps_to(target: i128, value: i128, slope: i128, bits: u32) -> Vec<i128> {
    let free = slope.trailing_zeros().min(127);
    let off = target.wrapping_sub(value).rem_euclid(1i128 << bits);
    if slope == 0 || free >= bits || off.trailing_zeros().min(127) < free {
        return Vec::new();
    }
    let period = 1i128 << (bits - free);
    let step = (off >> free)
        .wrapping_mul(inverse(slope >> free))
        .rem_euclid(period);
    let centred = if step > period / 2 {
        step - period
    } else {
        step
    };
    vec![centred, centred + period, centred - period]
}

/// Vectors far from each other first.
fn spread(starts: &[Vec<i128>]) -> impl Iterator<Item = &Vec<i128>> {
    let step = (starts.len() / SPREAD).max(1);
    (0..step).flat_map(move |first| starts.iter().skip(first).step_by(step))
}

/// The inverse of an odd number modulo 2^127.
fn inverse(odd: i128) -> i128 {
    let mut x = odd;
    // Each round doubles the bits that are right, of which there are three at first.
    for _ in 0..6 {
        x = x.wrapping_mul(2i128.wrapping_sub(odd.wrapping_mul(x)));
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_monotone_function_is_found_at_its_first_goal() {
        assert_eq!(first_at(&|e| e / 3, 2), Some(6));
        assert_eq!(first_at(&|e| -e, 40), Some(-40));
        assert_eq!(first_at(&|e| 2 * e, 1), Some(1));
        assert_eq!(first_at(&|e| e, 41), None);
    }

    #[test]
    fn an_inverse_gives_one() {
        for odd in [1i128, 3, -5, 5_094_007, i128::MAX] {
            assert_eq!(inverse(odd).wrapping_mul(odd), 1);
        }
    }
}
