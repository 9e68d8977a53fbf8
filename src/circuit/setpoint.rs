//! The setpoint of the amplitude loop against the magnitudes that the circuit can have, for every ADC code and state.

use super::engine;
use super::vector_width::TooShort;
use crate::design::Design;

/// The key of the setpoint.
const KEY: &str = "circuit.amplitude_loop.setpoint_raw";

/// A setpoint that no magnitude reaches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutOfReach {
    /// As the design gives it, raw.
    pub setpoint: i64,
    /// The largest magnitude, raw (proved).
    pub largest: i128,
    /// Where the key stands: file and line.
    pub place: String,
    /// The format whose LSB it counts, by its name.
    format: String,
}

impl OutOfReach {
    /// Of a design; `None` without an amplitude loop, or where a magnitude can be as large as its setpoint.
    pub fn of(design: &Design) -> Option<Self> {
        let setpoint = design.circuit.amplitude_loop.as_ref()?.setpoint_raw;
        // x and y that wrap make the magnitude small: that is the width's own mistake, and has its own message.
        let mut wide = design.clone();
        if let Some(short) = TooShort::of(design) {
            wide.circuit.cordic.width = short.needs;
        }
        let program = engine::trace(&wide);
        let casts = program.casts.iter().zip(&program.cast_ranges);
        let magnitudes = casts.filter(|(c, _)| c.label.key == "circuit.cordic.gain_bits");
        let largest = magnitudes
            .filter_map(|(_, range)| Some((*range)?.high))
            .max()?;
        (i128::from(setpoint) > largest).then(|| OutOfReach {
            setpoint,
            largest,
            place: design.place_of(KEY),
            format: design.circuit.decimator.output.format.to_string(),
        })
    }

    /// What is out of reach, what follows, and what the number counts; without the last stop.
    pub fn sentence(&self) -> String {
        format!(
            "{}: {KEY} is {}, above the largest magnitude, {} (proved). The loop cannot reach it and stays at its limit. A \
             setpoint counts LSB of circuit.decimator.output ({}): where that format was changed, scale it too",
            self.place, self.setpoint, self.largest, self.format
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{reader, template};
    use std::path::Path;

    fn of(changes: &[(&str, &str)]) -> Option<OutOfReach> {
        let mut text = template::DEFAULT.to_owned();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        let file = Path::new("folder/high.toml");
        OutOfReach::of(&reader::parse(&text, Some(file)).unwrap())
    }

    const OWN: &str = "\nsetpoint_raw = 1048576";

    #[test]
    fn a_setpoint_above_every_magnitude_is_named_with_its_line() {
        let largest = 5_931_461;
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[(OWN, "\nsetpoint_raw = 5931461")]), None);
        let high = of(&[(OWN, "\nsetpoint_raw = 5931462")]).unwrap();
        assert_eq!((high.setpoint, high.largest), (largest + 1, largest.into()));
        let line = 1 + template::DEFAULT
            .lines()
            .position(|l| l == "setpoint_raw = 1048576")
            .unwrap();
        let said = high.sentence();
        assert!(
            said.starts_with(&format!("high.toml, line {line}: "))
                && said.contains(
                    "setpoint_raw is 5931462, above the largest magnitude, 5931461 (proved)"
                ),
            "{said}"
        );
    }

    #[test]
    fn a_format_that_was_changed_without_its_setpoint_is_named_and_a_narrow_vector_is_not() {
        let coarse = of(&[("\"Q2.22\"", "\"Q1.18\"")]).unwrap();
        assert!(
            coarse.largest < 1 << 20 && coarse.sentence().contains("(Q1.18)"),
            "{coarse:?}"
        );
        assert_eq!(of(&[("\nwidth = 32", "\nwidth = 24")]), None);
    }
}
