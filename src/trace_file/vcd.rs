//! A trace as a value change dump (IEEE 1364-2005, section 18.2), which wave viewers open.
//!
//! - The unit of time is the coarsest power of ten, from 1 s to 1 fs, in which the sample period is
//!   a whole number; if there is none, the coarsest that is at most a millionth of the period (1 fs
//!   at the finest), and each sample's instant n / rate is rounded to the nearest by itself, so that
//!   errors do not add up.
//! - A dotted key is a path of scopes and the channel after the blank the variable: of
//!   `circuit.decimator.output drive_i`, `drive_i` in `circuit`, `decimator`, `output`; without a
//!   channel the key's last part is the variable. A character that no identifier has becomes `_`; the name as it was, and the unit,
//!   stand in a comment before the variable.
//! - An integer is a `wire`, two's complement, a real a `real`. Before its first value an integer is
//!   `x` and a real NaN. Values are written where they change.
//! - There is no date: the same trace is the same bytes.

use super::merge::Merge;
use super::{Signal, Sink, Trace, Values};
use crate::error::{InputError, Result};
use dashu_int::UBig;
use std::path::Path;

pub(super) fn write(trace: &Trace, path: &Path) -> Result<()> {
    let mut sink = Sink::open(path)?;
    let clock = Clock::new(trace.sample_rate_hz);
    let instant = |sample: u64| -> Result<u64> {
        clock.instant(sample).ok_or_else(|| {
            InputError::new(format!(
                "sample {sample} at {} Hz is beyond 2^64 of the unit of time ({})",
                trace.sample_rate_hz,
                clock.unit()
            ))
            .in_file(path)
            .help("write `.csv`, or a trace that begins earlier")
            .into()
        })
    };
    let version = env!("CARGO_PKG_VERSION");
    sink.text(&format!("$version gyrogen {version} $end\n"));
    sink.text(&format!("$timescale {} $end\n", clock.unit()));
    Scope::of(trace).declare(trace, &mut sink);
    sink.text("$enddefinitions $end\n");

    let dump = format!("#{}\n$dumpvars\n", instant(trace.first_sample)?);
    sink.text(&dump);
    let mut last: Vec<Option<u64>> = Vec::with_capacity(trace.signals.len());
    for (index, signal) in trace.signals.iter().enumerate() {
        let value = (signal.every == 1)
            .then(|| word(&signal.values, 0))
            .flatten();
        change(signal, value, index, &mut sink);
        last.push(value);
    }
    sink.text("$end\n");

    let mut merge = Merge::new(trace);
    let mut end = None;
    while let Some((sample, here)) = merge.next() {
        let mut stamped = sample == trace.first_sample;
        for (index, signal) in trace.signals.iter().enumerate() {
            let Some(k) = here.get(index).copied().flatten() else {
                continue;
            };
            let value = word(&signal.values, k);
            if last.get(index) == Some(&value) {
                continue;
            }
            if let Some(last) = last.get_mut(index) {
                *last = value;
            }
            if !stamped {
                sink.text(&format!("#{}\n", instant(sample)?));
                stamped = true;
            }
            change(signal, value, index, &mut sink);
        }
        end = sample.checked_add(1);
        sink.pass_on()?;
    }
    // One period after the last value, so that it has a width on the screen.
    if let Some(end) = end {
        sink.text(&format!("#{}\n", instant(end)?));
    }
    sink.finish()
}

/// Value k as what tells it from others: the low bits of an integer, all bits of a real.
fn word(values: &Values, k: usize) -> Option<u64> {
    match values {
        Values::Integer { bits, values } => {
            let mask = u64::MAX >> (64 - (*bits).clamp(1, 64));
            values.get(k).map(|v| (*v as u64) & mask)
        }
        Values::Real(values) => values.get(k).map(|v| v.to_bits()),
    }
}

/// One line: a scalar for a word of one bit, else a vector, or a real; `None` is unknown. A vector is
/// written without leading zeros: readers extend it with 0 (table 18-2 of the standard), and a negative
/// word has none.
fn change(signal: &Signal, value: Option<u64>, index: usize, sink: &mut Sink) {
    match (&signal.values, value) {
        (Values::Integer { bits: 1, .. }, Some(value)) => sink.text(&format!("{value:b}")),
        (Values::Integer { bits: 1, .. }, None) => sink.text("x"),
        (Values::Integer { .. }, Some(value)) => sink.text(&format!("b{value:b} ")),
        (Values::Integer { .. }, None) => sink.text("bx "),
        (Values::Real(_), value) => {
            sink.text("r");
            sink.real(value.map_or(f64::NAN, f64::from_bits));
            sink.text(" ");
        }
    }
    sink.text(&code(index));
    sink.text("\n");
}

/// The shortest codes of printable ASCII (`!` to `~`), one a signal.
fn code(index: usize) -> String {
    let mut code = String::new();
    let mut rest = index;
    loop {
        code.push(char::from(b'!' + (rest % 94) as u8));
        if rest < 94 {
            return code;
        }
        rest = rest / 94 - 1;
    }
}

/// From samples to the file's unit of time.
struct Clock {
    /// The unit is 10^-exponent s, 0..=15.
    exponent: u32,
    /// Units in a sample period: `numerator / denominator`, exactly.
    numerator: UBig,
    denominator: UBig,
}

impl Clock {
    /// For a positive rate, Hz.
    fn new(sample_rate_hz: f64) -> Self {
        // rate = mantissa * 2^power exactly.
        let bits = sample_rate_hz.to_bits();
        let field = ((bits >> 52) & 0x7ff) as i32;
        let fraction = bits & ((1 << 52) - 1);
        let (mantissa, power) = match field {
            0 => (fraction, -1074),
            _ => (fraction | 1 << 52, field - 1075),
        };
        let two = UBig::ONE << power.unsigned_abs() as usize;
        let (rate, seconds) = match power {
            0.. => (UBig::from(mantissa) * two, UBig::ONE),
            _ => (UBig::from(mantissa), two),
        };
        let in_units = |exponent: u32| Clock {
            exponent,
            numerator: &seconds * UBig::from(10u32).pow(exponent as usize),
            denominator: rate.clone(),
        };
        let is_whole = |c: &Clock| &c.numerator % &c.denominator == UBig::ZERO;
        let is_fine = |c: &Clock| c.numerator >= &c.denominator * UBig::from(1_000_000u32);
        let whole = (0..=15).map(in_units).find(is_whole);
        let fine = || (0..=15).map(in_units).find(is_fine);
        whole.or_else(fine).unwrap_or_else(|| in_units(15))
    }

    /// `1 us`, `10 ps` and so on.
    fn unit(&self) -> String {
        const NAMES: [&str; 6] = ["s", "ms", "us", "ns", "ps", "fs"];
        let thousands = self.exponent.div_ceil(3);
        let count = 10u32.pow(thousands * 3 - self.exponent);
        let name = NAMES.get(thousands as usize).unwrap_or(&"fs");
        format!("{count} {name}")
    }

    /// The instant of a sample in units, to the nearest (a half goes up).
    fn instant(&self, sample: u64) -> Option<u64> {
        let twice = UBig::from(2u32);
        let doubled = UBig::from(sample) * &self.numerator * &twice + &self.denominator;
        u64::try_from(doubled / (&self.denominator * twice)).ok()
    }
}

/// A scope with what is in it, in the order of the trace.
#[derive(Default)]
struct Scope {
    scopes: Vec<(String, Scope)>,
    /// Name and index of the signal.
    variables: Vec<(String, usize)>,
}

impl Scope {
    fn of(trace: &Trace) -> Scope {
        let mut root = Scope::default();
        for (index, signal) in trace.signals.iter().enumerate() {
            let mut path: Vec<&str> = match signal.name.split_once(' ') {
                Some((key, channel)) => key.split('.').chain([channel]).collect(),
                None => signal.name.split('.').collect(),
            };
            let variable = path.pop().unwrap_or_default();
            let mut scope = &mut root;
            for part in path {
                scope = scope.inner(identifier_of(part));
            }
            scope.add(identifier_of(variable), index);
        }
        root
    }

    /// The scope of that name, made if there is none.
    fn inner(&mut self, name: String) -> &mut Scope {
        let known = self.scopes.iter().position(|(n, _)| *n == name);
        let at = known.unwrap_or_else(|| {
            self.scopes.push((name, Scope::default()));
            self.scopes.len() - 1
        });
        // `at` was found or made just now.
        &mut self.scopes[at].1
    }

    /// A variable; `_2`, `_3` and so on follow a name that is taken.
    fn add(&mut self, name: String, index: usize) {
        let taken = |n: &String| self.variables.iter().any(|(v, _)| v == n);
        let numbered = (2u32..).map(|i| format!("{name}_{i}"));
        let free = std::iter::once(name.clone())
            .chain(numbered)
            .find(|n| !taken(n));
        self.variables.push((free.unwrap_or(name), index));
    }

    fn declare(&self, trace: &Trace, sink: &mut Sink) {
        for (name, index) in &self.variables {
            let Some(signal) = trace.signals.get(*index) else {
                continue;
            };
            let kind = match signal.values {
                Values::Integer { bits, .. } => format!("wire {bits}"),
                Values::Real(_) => "real 64".to_owned(),
            };
            let code = code(*index);
            let title = comment(&signal.title());
            sink.text(&format!(
                "$comment {title} $end\n$var {kind} {code} {name} $end\n"
            ));
        }
        for (name, scope) in &self.scopes {
            sink.text(&format!("$scope module {name} $end\n"));
            scope.declare(trace, sink);
            sink.text("$upscope $end\n");
        }
    }
}

/// A simple identifier of Verilog (section 3.7): letters, digits and `_`, no digit first.
fn identifier_of(text: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = text.chars().map(plain).collect();
    match name.chars().next() {
        Some(c) if !c.is_ascii_digit() => name,
        _ => format!("_{name}"),
    }
}

/// Printable ASCII in one line that holds no keyword.
fn comment(text: &str) -> String {
    let plain = |c: char| match c {
        '$' => '_',
        ' '..='~' => c,
        _ => '?',
    };
    text.chars().map(plain).collect()
}
