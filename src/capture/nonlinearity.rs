//! `adc_integral_nonlinearity`: code = x + g(x), g a function of the signal alone, not of the phase
//! (IEEE Std 1241, but for its end-point line): a polynomial, a table of straight pieces, or a staircase: a converter
//! of several stages has an error of its own in each of the equal parts of its range that the first stage tells apart.

use super::candidates::{Effect, Known, Variant};
use super::columns::{EXACT, HAT, HATS, Model, POWER, SEGMENT, SEGMENTS};
use super::gram::Combo;

/// Gain that a free constant or a free slope costs beyond a column: a bend that needs them is the
/// less natural one, as they are an offset and a gain error.
const LINE_TERMS: f64 = 5.0;

/// Least distance of knots, codes: closer ones would follow the quantiser's own pattern.
const LEAST_APART_CODES: f64 = 4.0;

/// What the names of parameters of some channels begin with.
fn prefix(channels: &[usize]) -> &'static str {
    match channels {
        [0] => "drive_",
        [1] => "sense_",
        _ => "",
    }
}

/// Power k of the signal in some channels; the parameter is its value at full scale. The first is of the exact tone: that
/// of the truncated tone beside a carrier that is free (no declared amplitude) is all that truncation makes, so that a
/// bend would stand for it. A table, which has such a line too, costs more than the spur.
fn power(known: &Known, model: &Model, k: usize, channels: &[usize]) -> Combo {
    let prefix = prefix(channels);
    let mut parts: Vec<_> = channels.iter().map(|c| (*c, POWER + k - 1, 1.0)).collect();
    if k == 1 {
        parts.extend(channels.iter().map(|c| (*c, EXACT, 1.0)));
    }
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
    let prefix = prefix(channels);
    Combo::new(&format!("{prefix}at_code_{code:.0}_codes"), 1.0, &parts)
}

/// A table of straight pieces with every `stride`-th knot.
pub fn table(model: &Model, stride: usize, channels: &[usize]) -> Vec<Combo> {
    (0..HATS)
        .step_by(stride)
        .map(|at| hat(model, at, stride, channels))
        .collect()
}

/// Parts of the range that a first stage tells apart.
const PARTS: [usize; 3] = [8, 16, 32];

/// The errors of those of `parts` equal parts of the range that signals up to `reach` codes visit.
fn staircase(model: &Model, parts: usize, reach: f64, channels: &[usize]) -> Vec<Combo> {
    let each = SEGMENTS / parts;
    let visited = model.segment(-reach) / each..=model.segment(reach) / each;
    let of = |part: usize| {
        let fine = part * each..(part + 1) * each;
        let columns = channels
            .iter()
            .flat_map(|c| fine.clone().map(|k| (*c, SEGMENT + k, 1.0)));
        let code = (2.0 * part as f64 / parts as f64 - 1.0) * model.full_scale_codes;
        let name = format!("{}from_code_{code:.0}_codes", prefix(channels));
        Combo::new(&name, 1.0, &columns.collect::<Vec<_>>())
    };
    visited.map(of).collect()
}

/// Polynomials, tables and staircases; of both channels (the same bend) or of one. `free` are sine and cosine of both
/// tones as they are in the codes.
pub fn variants(known: &Known, model: &Model, free: [[f64; 2]; 2]) -> Vec<Variant> {
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
            let of = |with_slope: bool, with_constant: bool| {
                let slope = with_slope.then(|| power(known, model, 1, channels));
                let constant = with_constant.then(|| constant(channels));
                let line: Vec<Combo> = slope.into_iter().chain(constant).collect();
                let further = further + LINE_TERMS * line.len() as f64;
                let bend = orders.iter().map(|k| power(known, model, *k, channels));
                let combos = line.into_iter().chain(bend).collect();
                Variant::new(Effect::Nonlinearity, combos, further)
            };
            out.push(of(false, false));
            out.push(of(true, false));
            // Of an odd curve the constant is an offset.
            if orders.iter().any(|k| k % 2 == 0) {
                out.push(of(false, true));
            }
            if orders.len() > 1 || orders == [2] {
                out.push(of(true, true));
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
        let reach = channels.iter().map(|c| free[*c][0].hypot(free[*c][1]));
        let reach = reach.fold(0.0, f64::max);
        for parts in PARTS {
            let combos = staircase(model, parts, reach, channels);
            // In a single part it is an offset.
            if combos.len() > 1 {
                let further = further + 2.0 * LINE_TERMS;
                out.push(Variant::new(Effect::Nonlinearity, combos, further));
            }
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

#[cfg(test)]
mod tests {
    use super::super::candidates::{base, variants};
    use super::super::columns::{COS, TRUNCATED};
    use super::super::gram::Gram;
    use super::super::search::Search;
    use super::super::synthetic::{AMPLITUDE, Made, model};
    use super::super::truncation::Truncation;
    use super::*;

    #[test]
    fn a_bend_does_not_stand_for_truncation_where_the_amplitude_is_not_declared() {
        let made = Made {
            bits: Some(7),
            ..Made::CLEAN
        };
        let mut capture = made.capture();
        capture.meta.drive_amplitude_codes = None;
        let (known, mut model) = model(&capture, &made);
        // As the fit leaves it: the truncated tone was taken, beside a free carrier.
        model.truncation = Some(Truncation {
            bits: 7,
            half_up: false,
        });
        model.coefficients[0][COS] = -AMPLITUDE;
        model.coefficients[0][TRUNCATED + 1] = -AMPLITUDE;
        let mut all = variants(
            &known,
            &model,
            [[0.0, -AMPLITUDE], [61.7, 20.2]],
            20_000,
            false,
        );
        // The control: a line of the truncated tone.
        let line = vec![Combo::one("", 0, POWER)];
        all.push(Variant::new(Effect::Gain, line, 0.0));
        let gram = Gram::of(&capture, &model);
        let base = base(&known);
        let mut search = Search::new(gram.all(), &base, &[], &all);
        let none = search.gain(&[]);
        let mut most = |is: &dyn Fn(&Variant) -> bool| -> f64 {
            let own = (0..all.len()).filter(|k| is(&all[*k]));
            own.map(|k| search.gain(&[k]) - none).fold(0.0, f64::max)
        };
        let spur = most(&|v| v.effect == Effect::Spur);
        assert!(spur > 1000.0, "{spur}");
        let control = most(&|v| v.combos.len() == 1 && v.combos[0].name.is_empty());
        assert!(control > 0.9 * spur, "{control} {spur}");
        let has_line = |v: &Variant| {
            let mut columns = v.combos.iter().flat_map(|c| &c.parts);
            v.effect == Effect::Nonlinearity && columns.any(|p| p.0 == 0 && p.1 == POWER)
        };
        let bend = most(&has_line);
        assert!(bend < 0.5 * spur, "{bend} {spur}");
    }
}
