//! What a design puts out over a plan's stretches, and how far that is from the float twin.

use super::scenario::{Plan, Stretch, detuned};
use crate::circuit::engine::ArithmeticKind;
use crate::circuit::scale::full_scale_dps;
use crate::cosim::path::Path;
use crate::design::Design;
use crate::error::Result;

/// The rate of every row, deg/s, by stretch: the nominal ones, then the detuned one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Output {
    /// deg/s.
    pub rates_dps: Vec<Vec<f64>>,
}

/// Runs a design over a plan. Without a rate in its chain the output is sense I in deg/s.
///
/// # Errors
/// An overflow where the design says `error`; a phase loop that cannot lock.
pub fn run(design: &Design, kind: ArithmeticKind, plan: &Plan) -> Result<Output> {
    let outputs = run_together(&[design], kind, plan)?;
    Ok(outputs.into_iter().next().unwrap_or_default())
}

/// Runs designs that [share a closed loop](crate::circuit::ensemble::share_a_closed_loop) over a plan at once: each
/// output is that of its design alone.
///
/// # Errors
/// As [`run`], of any of them.
pub fn run_together(designs: &[&Design], kind: ArithmeticKind, plan: &Plan) -> Result<Vec<Output>> {
    let mut outputs = vec![Output::default(); designs.len()];
    let mut shared = path(designs, kind);
    for stretch in &plan.nominal {
        stretch_of(designs, &mut shared, stretch, &mut outputs)?;
    }
    if let Some(stretch) = &plan.detuned {
        let designs: Vec<Design> = designs
            .iter()
            .map(|d| detuned(d, plan.detuned_hz))
            .collect();
        let designs: Vec<&Design> = designs.iter().collect();
        let mut path = path(&designs, kind);
        stretch_of(&designs, &mut path, stretch, &mut outputs)?;
    }
    Ok(outputs)
}

/// The first design's path, shared with the others; none without designs.
fn path(designs: &[&Design], kind: ArithmeticKind) -> Option<Path> {
    let (first, others) = designs.split_first()?;
    let mut path = Path::new(first, kind);
    for other in others {
        path.share_with(other);
    }
    Some(path)
}

fn stretch_of(
    designs: &[&Design],
    path: &mut Option<Path>,
    stretch: &Stretch,
    outputs: &mut [Output],
) -> Result<()> {
    let (Some(path), Some(first)) = (path, designs.first()) else {
        return Ok(());
    };
    path.warm_start(first, stretch.conditions, &stretch.noise)?;
    let scales: Vec<f64> = designs.iter().map(|d| full_scale_dps(d)).collect();
    for output in outputs.iter_mut() {
        output.rates_dps.push(Vec::with_capacity(stretch.rows));
    }
    for _ in 0..stretch.rows {
        let first = path.period(&stretch.noise)?;
        let rows = std::iter::once(first).chain(path.other_rows());
        for ((output, row), scale) in outputs.iter_mut().zip(rows).zip(&scales) {
            let [_, _, sense_i, _] = row.channels;
            let rate = if row.rate_dps.is_nan() {
                sense_i * scale
            } else {
                row.rate_dps
            };
            if let Some(rates) = output.rates_dps.last_mut() {
                rates.push(rate);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::ensemble::share_a_closed_loop;
    use crate::design::template::default_design;
    use crate::study::scenario::Extent;

    /// With and without loops, and a word that the loop is in: that one runs by itself.
    #[test]
    fn designs_that_run_together_are_as_alone() {
        let extent = Extent {
            temperatures: 3,
            rates: 1,
            rest_rows: 24,
            rate_rows: 12,
            detuned_rows: 40,
        };
        for looped in [true, false] {
            let mut given = default_design().expect("the default").without_stops();
            if !looped {
                given.circuit.amplitude_loop = None;
            }
            let mut designs = vec![given.clone(); 3];
            let compensation = |d: &mut Design, bits: u32| {
                let c = d.compensation.as_mut().expect("it has one");
                c.output.format.fraction_bits = bits;
            };
            compensation(&mut designs[1], 7);
            designs[2].compensation = None;
            let mut other = given.clone();
            other.circuit.cordic.iterations = 11;
            assert_eq!(share_a_closed_loop(&given.circuit, &other.circuit), !looped);
            if !looped {
                other.circuit.decimator.output.format.fraction_bits = 16;
                designs.push(other);
            }
            let plan = Plan::new(&given, extent, 5).expect("a plan");
            let all: Vec<&Design> = designs.iter().collect();
            let together = run_together(&all, ArithmeticKind::Fixed, &plan).expect("they run");
            for (design, together) in designs.iter().zip(together) {
                let alone = run(design, ArithmeticKind::Fixed, &plan).expect("it runs");
                assert_eq!(together, alone);
            }
        }
    }
}
