//! The bits that x and y of the CORDIC need, for every ADC code and state, against those that the design gives them.

use super::engine;
use crate::design::{Design, limits};
use crate::numeric::trace::ir::{Interval, Op, Program};

/// The key of the width.
pub const KEY: &str = "circuit.cordic.width";

/// A `circuit.cordic.width` below the bits that x and y need.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TooShort {
    /// Bits that the design gives x and y.
    pub has: u32,
    /// Bits that hold x and y for every ADC code (proved).
    pub needs: u32,
    /// Where the key stands: file and line.
    pub place: String,
}

impl TooShort {
    /// Of a design; `None` where its width is enough, or where no width within 64 bits a word is.
    pub fn of(design: &Design) -> Option<Self> {
        let has = design.circuit.cordic.width;
        let needs = of_a_wide_vector(design)?.bits();
        (has < needs && needs <= 64).then(|| TooShort {
            has,
            needs,
            place: design.place_of(KEY),
        })
    }

    /// What is short, as a clause.
    pub fn what(&self) -> String {
        format!(
            "x and y of the CORDIC need {} bits (proved for every ADC code), and `{KEY}` gives them {}",
            self.needs, self.has
        )
    }

    /// What to write, as a clause.
    pub fn mend(&self) -> String {
        format!("in {}, write `width = {}`", self.place, self.needs)
    }

    /// Both, without the last stop.
    pub fn sentence(&self) -> String {
        format!("{}. To mend it, {}", self.what(), self.mend())
    }
}

/// Every raw value of x and y that can come in a traced program, before they wrap: what comes in, is turned, and comes
/// out of a step.
pub fn range(program: &Program) -> Option<Interval> {
    let cordic = program.function("cordic")?;
    let turned = cordic.loops.first().and_then(|l| l.outs.get(2)).copied();
    let nodes = cordic.nodes.iter().enumerate();
    let wraps = nodes.filter_map(|(id, n)| match n.op {
        Op::Wrap(a, _) if Some(id) != turned => Some(cordic.nodes[a].range),
        _ => None,
    });
    let widened = program.casts.iter().zip(&program.cast_ranges);
    let widened = widened
        .filter(|(c, _)| c.label.key == "circuit.cordic.guard_bits")
        .filter_map(|(_, range)| *range);
    wraps.chain(widened).reduce(Interval::join)
}

/// The range of x and y where they have so many bits that they do not wrap; `None` where the design would then need
/// more bits than the engine has.
pub fn of_a_wide_vector(design: &Design) -> Option<Interval> {
    let mut wide = design.clone();
    let output = wide.circuit.decimator.output.format;
    let cordic = &mut wide.circuit.cordic;
    let enough = output.signed_bits() + cordic.guard_bits + 2;
    cordic.width = enough.min(64).max(cordic.width);
    limits::check(&wide).ok()?;
    range(&engine::trace(&wide))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{reader, template};
    use std::path::Path;

    fn of_width(width: u32) -> Option<TooShort> {
        let text = template::DEFAULT.replacen("width = 32", &format!("width = {width}"), 1);
        let file = Path::new("folder/narrow.toml");
        TooShort::of(&reader::parse(&text, Some(file)).unwrap())
    }

    #[test]
    fn a_width_that_is_too_short_is_named_with_what_it_needs_and_its_line() {
        assert_eq!((of_width(32), of_width(31)), (None, None));
        let line = 1 + template::DEFAULT
            .lines()
            .position(|l| l == "width = 32")
            .unwrap();
        // The same need, however short the width is: what has wrapped is not what it was.
        for has in [30, 26, 20] {
            let short = of_width(has).unwrap();
            assert_eq!((short.has, short.needs), (has, 31));
            let mend = format!("in narrow.toml, line {line}, write `width = 31`");
            assert_eq!(short.mend(), mend);
            assert!(
                short.sentence().contains("need 31 bits"),
                "{}",
                short.sentence()
            );
        }
    }
}
