//! `adc_integral_nonlinearity`: code = x + g(x), g a function of the signal alone, not of the phase
//! (IEEE Std 1241, but for its end-point line): a polynomial, or a table of straight pieces.

use super::candidates::{Effect, Known, Variant};
use super::columns::{HAT, HATS, Model, POWER};
use super::gram::Combo;

/// Gain that a free constant or a free slope costs beyond a column: a bend that needs them is the
/// less natural one, as they are an offset and a gain error.
const LINE_TERMS: f64 = 5.0;

/// Least distance of knots, codes: closer ones would follow the quantiser's own pattern.
const LEAST_APART_CODES: f64 = 4.0;

/// Power k of the signal in some channels; the parameter is its value at full scale.
fn power(known: &Known, model: &Model, k: usize, channels: &[usize]) -> Combo {
    let prefix = match channels {
        [0] => "drive_",
        [1] => "sense_",
        _ => "",
    };
    let parts: Vec<_> = channels.iter().map(|c| (*c, POWER + k - 1, 1.0)).collect();
    let unit = (known.full_scale_codes / model.span_codes).powi(k as i32);
    Combo::new(
        &format!("{prefix}order{k}_at_full_scale_codes"),
        unit,
        &parts,
    )
}

/// A hat of `stride` fine intervals in some channels.
fn hat(model: &Model, at: usize, stride: usize, channels: &[usize]) -> Combo {
    let fine = 2.0 * model.span_codes / (HATS - 1) as f64;
    let code = at as f64 * fine - model.span_codes;
    let mut parts = Vec::new();
    for channel in channels {
        for k in 0..HATS {
            let value = 1.0 - k.abs_diff(at) as f64 / stride as f64;
            if value > 0.0 {
                parts.push((*channel, HAT + k, value));
            }
        }
    }
    let prefix = match channels {
        [0] => "drive_",
        [1] => "sense_",
        _ => "",
    };
    Combo::new(&format!("{prefix}at_code_{code:.0}_codes"), 1.0, &parts)
}

/// A table of straight pieces with every `stride`-th knot.
pub fn table(model: &Model, stride: usize, channels: &[usize]) -> Vec<Combo> {
    (0..HATS)
        .step_by(stride)
        .map(|at| hat(model, at, stride, channels))
        .collect()
}

/// Polynomials and tables; of both channels (the same bend) or of one.
pub fn variants(known: &Known, model: &Model) -> Vec<Variant> {
    let mut out = Vec::new();
    for (channels, further) in [(&[0usize, 1][..], 0.0), (&[0][..], 1.0), (&[1][..], 1.0)] {
        for orders in [
            &[3usize][..],
            &[2],
            &[2, 3],
            &[5],
            &[3, 5],
            &[4],
            &[2, 4],
            &[2, 3, 4, 5],
        ] {
            let of = |lines: usize| {
                let line = (0..lines).map(|k| match k {
                    0 => power(known, model, 1, channels),
                    _ => constant(channels),
                });
                let bend = orders.iter().map(|k| power(known, model, *k, channels));
                let combos = line.chain(bend).collect();
                let further = further + LINE_TERMS * lines as f64;
                Variant::new(Effect::Nonlinearity, combos, further)
            };
            out.push(of(0));
            out.push(of(1));
            if orders.len() > 1 || orders == [2] {
                out.push(of(2));
            }
        }
        for stride in [8, 4, 1] {
            let apart = 2.0 * model.span_codes / (HATS - 1) as f64 * stride as f64;
            if apart < LEAST_APART_CODES && stride != 8 {
                continue;
            }
            let combos = table(model, stride, channels);
            let further = further + 2.0 * LINE_TERMS;
            out.push(Variant::new(Effect::Nonlinearity, combos, further));
        }
    }
    out
}

fn constant(channels: &[usize]) -> Combo {
    let parts: Vec<_> = channels
        .iter()
        .map(|c| (*c, super::columns::ONE, 1.0))
        .collect();
    Combo::new("order0_codes", 1.0, &parts)
}
