//! The words of a design with the ranges that the traced program proves for them.

use crate::circuit::{CHANNELS, vector_width};
use crate::design::Design;
use crate::numeric::format::{Overflow, Rounding};
use crate::numeric::trace::ir::{Function, Interval, Op, Program};

/// A word before its overflow step.
#[derive(Debug, Clone, PartialEq)]
pub struct Proved {
    /// As `equiv` names the node; the steps of a polynomial are one.
    pub name: String,
    /// In words.
    pub format: String,
    /// How dropped bits are rounded; `None` where none are dropped.
    pub rounding: Option<Rounding>,
    /// What happens beyond the limits.
    pub mode: &'static str,
    /// Wrapping or a limit that is the circuit's function, and not an overflow.
    pub by_design: Option<&'static str>,
    /// Every raw value that can come.
    pub range: Interval,
    /// Every raw value that fits.
    pub limits: Interval,
    /// What goes in, raw.
    pub operands: Vec<[i128; 2]>,
}

impl Proved {
    /// log2 of the factor by which the range could grow; negative where it does not fit. `None` for a word that
    /// is always 0.
    pub fn headroom_bits(&self) -> Option<f64> {
        let room = |value: i128, limit: i128| match (value, limit) {
            (0, _) => f64::INFINITY,
            (v, l) if (v > 0) == (l > 0) && l != 0 => (l as f64 / v as f64).log2(),
            _ => f64::NEG_INFINITY,
        };
        let up = if self.range.high > 0 {
            room(self.range.high, self.limits.high)
        } else {
            f64::INFINITY
        };
        let down = if self.range.low < 0 {
            room(self.range.low, self.limits.low)
        } else {
            f64::INFINITY
        };
        let bits = up.min(down);
        bits.is_finite().then_some(bits)
    }
}

/// All words of a chain, in the order of the circuit's steps.
pub fn nodes(design: &Design, program: &Program) -> Vec<Proved> {
    let circuit = &design.circuit;
    let mut all = Vec::new();
    let bits = |n: u32| Interval::of_bits(n);
    all.push(by_design(
        "circuit.nco.phase_bits",
        format!("{} bits", circuit.nco.phase_bits),
        "wraps: a turn",
        Interval::new(0, power(circuit.nco.phase_bits) - 1),
    ));
    if let Some(nco) = program.function("nco") {
        for (port, id) in nco.outputs.iter().filter(|(p, _)| !p.name.is_empty()) {
            let table = circuit.nco.table;
            all.push(Proved {
                name: format!("circuit.nco.table {}", port.name),
                format: table.to_string(),
                rounding: None,
                mode: "none",
                by_design: None,
                range: nco.nodes[*id].range,
                limits: Interval::new(table.min_raw(), table.max_raw()),
                operands: Vec::new(),
            });
        }
    }
    let casts = of_casts(program);
    let of_key = |key: &str, into: &mut Vec<Proved>| {
        let own = casts.iter().filter(|c| c.name.starts_with(key));
        into.extend(own.cloned());
    };
    of_key("circuit.demodulator.product", &mut all);
    let width = integrator_bits(program);
    for channel in CHANNELS {
        all.push(by_design(
            &format!("circuit.decimator integrators {channel}"),
            format!("{width} bits"),
            "wraps: the combs take whole turns out",
            Interval::new(0, power(width) - 1),
        ));
    }
    of_key("circuit.decimator.output", &mut all);
    if let Some(cordic) = program.function("cordic") {
        all.extend(vector(design, program, cordic));
        all.push(by_design(
            "circuit.cordic phase",
            format!("{} bits", circuit.cordic.angle_bits),
            "wraps: a turn",
            bits(circuit.cordic.angle_bits),
        ));
    }
    of_key("circuit.cordic.gain_bits", &mut all);
    of_key("compensation.", &mut all);
    if circuit.phase_loop.is_some() {
        of_key("circuit.phase_loop.", &mut all);
        all.push(by_design(
            "circuit.phase_loop tuning_word",
            format!("{} bits", circuit.nco.phase_bits),
            "wraps: a turn a sample",
            Interval::new(0, power(circuit.nco.phase_bits) - 1),
        ));
    }
    if let Some(l) = &circuit.amplitude_loop {
        let limit = Interval::new(0, l.integrator_limit());
        let name = "circuit.amplitude_loop integrator";
        all.push(by_design(
            name,
            format!("0 to {}", limit.high),
            "limits: so that the gain stays in its range",
            limit,
        ));
        let limit = Interval::new(0, l.gain_limit());
        let name = "circuit.amplitude_loop gain";
        all.push(by_design(
            name,
            format!("{} bits", l.gain_bits),
            "limits: the drive gain",
            limit,
        ));
    }
    all
}

/// A word whose end is its function.
fn by_design(name: &str, format: String, what: &'static str, all: Interval) -> Proved {
    Proved {
        name: name.to_owned(),
        format,
        rounding: None,
        mode: "none",
        by_design: Some(what),
        range: all,
        limits: all,
        operands: Vec::new(),
    }
}

/// The casts that have an overflow step: those of one key, channel and function are one word.
pub fn of_casts(program: &Program) -> Vec<Proved> {
    let mut all: Vec<Proved> = Vec::new();
    for (number, cast) in program.casts.iter().enumerate() {
        let Some(overflow) = cast.overflow else {
            continue;
        };
        // Its width is the vector's: see there.
        if cast.label.key == "circuit.cordic.guard_bits" {
            continue;
        }
        let place = place(program, number);
        let mut name = cast.label.to_string();
        if cast.label.key == "compensation.output"
            && let Some((function, _)) = place
        {
            name = format!("{name} {}", function.name);
        }
        // Casts that no trace has seen share the function, and so the range, of another channel.
        let range = program.cast_ranges.get(number).copied().flatten();
        let range = range.or_else(|| of_same_key(program, cast.label.key));
        let (low, high) = cast.limits();
        let Some(range) = range else { continue };
        let operands = place.map_or(Vec::new(), |(function, id)| operands(function, id));
        if let Some(known) = all.iter_mut().find(|p| p.name == name) {
            known.range = known.range.join(range);
            known.operands.extend(operands);
            known.operands.sort();
            known.operands.dedup();
            continue;
        }
        all.push(Proved {
            name,
            format: format(cast),
            rounding: (cast.shift > 0).then_some(cast.rounding),
            mode: mode(overflow),
            by_design: None,
            range,
            limits: Interval::new(low, high),
            operands,
        });
    }
    all
}

fn format(cast: &crate::numeric::cast::Cast) -> String {
    let t = cast.target;
    let integer = i64::from(t.bits) - i64::from(t.fraction_bits);
    let sign = if t.signed { "Q" } else { "UQ" };
    match t.fraction_bits {
        0 => format!("{} bits", t.bits),
        n if integer >= 0 && n > 0 => format!("{sign}{integer}.{n}"),
        n => format!("{} bits, LSB 2^{}", t.bits, -n),
    }
}

fn mode(overflow: Overflow) -> &'static str {
    match overflow {
        Overflow::Saturate => "saturate",
        Overflow::SaturateSymmetric => "saturate_symmetric",
        Overflow::Wrap => "wrap",
        Overflow::Error => "error",
    }
}

fn of_same_key(program: &Program, key: &str) -> Option<Interval> {
    let casts = program.casts.iter().zip(&program.cast_ranges);
    let mut ranges = casts.filter_map(|(c, r)| (*r).filter(|_| c.label.key == key));
    let first = ranges.next()?;
    Some(ranges.fold(first, Interval::join))
}

/// The function and the node of a cast; of another channel's where blocks are shared.
fn place(program: &Program, number: usize) -> Option<(&Function, usize)> {
    let key = program.casts[number].label.key;
    let find = |same: &dyn Fn(usize) -> bool| {
        program.functions.iter().find_map(|f| {
            let at = f.nodes.iter().position(|n| match n.op {
                Op::Cast(_, cast) => same(cast),
                _ => false,
            });
            Some((f, at?))
        })
    };
    find(&|cast| cast == number).or_else(|| find(&|cast| program.casts[cast].label.key == key))
}

/// Ranges of what a cast's value is made of.
fn operands(function: &Function, cast: usize) -> Vec<[i128; 2]> {
    let Some(value) = function.operands(cast).first().copied() else {
        return Vec::new();
    };
    let made_of = match function.nodes[value].op {
        Op::Add(..) | Op::Sub(..) | Op::Mul(..) => function.operands(value),
        _ => vec![value],
    };
    let ranges = made_of.iter().map(|id| function.nodes[*id].range);
    ranges.map(|r| [r.low, r.high]).collect()
}

/// x and y of the CORDIC. Where they can wrap, the range is what they would need to be whole.
fn vector(design: &Design, program: &Program, cordic: &Function) -> Option<Proved> {
    let width = design.circuit.cordic.width;
    let limits = Interval::of_bits(width);
    let mut range = vector_width::range(program)?;
    if !range.is_within(limits.low, limits.high) {
        range = vector_width::of_a_wide_vector(design).unwrap_or(range);
    }
    let inputs = cordic.inputs.iter().map(|(_, r)| [r.low, r.high]);
    Some(Proved {
        name: vector_width::KEY.to_owned(),
        format: format!("{width} bits"),
        rounding: None,
        mode: "wrap",
        by_design: None,
        range,
        limits,
        operands: inputs.collect(),
    })
}

fn integrator_bits(program: &Program) -> u32 {
    use crate::numeric::trace::ir::SlotKind;
    let slots = program
        .function("integrate")
        .into_iter()
        .flat_map(|f| &f.slots);
    let bits = slots.filter_map(|s| match s.kind {
        SlotKind::Residue(bits) => Some(bits),
        SlotKind::Word(_) => None,
    });
    bits.max().unwrap_or(0)
}

fn power(bits: u32) -> i128 {
    1i128 << bits.min(126)
}
