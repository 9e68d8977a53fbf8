//! `sample_latency`: the codes are the signal tau earlier. The drive's declared phase shows it; of the
//! sense channel alone it turns rate into quadrature, which only a known rate tells.

use super::candidates::{Effect, Known, Variant};
use super::columns::{COS, Model, SIN};
use super::gram::Combo;

/// Of the drive alone or of both. `free` are sine and cosine of both tones as found. The column is the
/// exact difference of the late tone and the declared one at the angle found, so that a large
/// latency needs no second order.
pub fn variants(known: &Known, model: &Model, free: [[f64; 2]; 2]) -> Vec<Variant> {
    let mut out = Vec::new();
    let angle = model.tone.angle();
    if angle == 0.0 {
        return out;
    }
    let (name, unit) = match known.fs_hz {
        Some(fs) => ("latency_s", 1.0 / fs),
        None => ("latency_samples", 1.0),
    };
    if known.phase {
        let [s, c] = model.declared[0];
        let [fs, fc] = free[0];
        // Late by `lag` rad: sine part s cos + c sin, cosine part c cos - s sin.
        let mut lag = (fs * c - fc * s).atan2(fs * s + fc * c);
        if lag.abs() < 1e-7 {
            lag = 1e-7;
        }
        let (sin, cos) = lag.sin_cos();
        let samples = lag / angle;
        let late_s = (s * cos + c * sin - s) / samples;
        let late_c = (c * cos - s * sin - c) / samples;
        let drive = [(0, SIN, late_s), (0, COS, late_c)];
        let alone = Combo::new(name, unit, &drive);
        out.push(Variant::new(Effect::Latency, vec![alone], 0.0));
        if let Some(([cs, cc], _)) = known.in_phase {
            let [gs, gc] = free[1];
            // In-phase part as it is, and as it would be without the latency.
            let now = gs * cs + gc * cc;
            let (bs, bc) = (gs * cos - gc * sin, gc * cos + gs * sin);
            let change = (now - (bs * cs + bc * cc)) / samples;
            let parts = [
                drive[0],
                drive[1],
                (1, SIN, cs * change),
                (1, COS, cc * change),
            ];
            let both = Combo::new(name, unit, &parts);
            out.push(Variant::new(Effect::Latency, vec![both], 0.0));
        }
    }
    if let Some(([cs, cc], _)) = known.in_phase {
        let [gs, gc] = free[1];
        let quadrature = -gs * cc + gc * cs;
        if quadrature != 0.0 {
            let turned = quadrature * angle;
            let parts = [(1, SIN, cs * turned), (1, COS, cc * turned)];
            let sense = Combo::new(&format!("sense_{name}"), unit, &parts);
            out.push(Variant::new(Effect::Latency, vec![sense], 2.0));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::synthetic_rows::{WORDS, codes, judged, meta, names};
    use std::f64::consts::TAU;

    #[test]
    fn a_latency_of_a_radian_is_one_effect_whatever_carrier_the_tone_is_near_then() {
        let word = WORDS[1];
        let step = TAU * f64::from(word) / 4_294_967_296.0;
        let signal = |channel: usize, angle: f64| match channel {
            0 => -1500.0 * angle.cos(),
            _ => 300.0 * (angle + 0.3).sin() + 90.0 * (angle + 0.3).cos(),
        };
        for lag in [-1.2f64, 0.6, 1.2] {
            let late = codes(1, word, |channel, row, x| {
                let angle = TAU * f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
                x - signal(channel, angle) + signal(channel, angle - lag)
            });
            let found = judged(late, meta(word)).2;
            assert_eq!(names(&found), ["sample_latency"], "{lag}");
            let seconds = found.steps[0].parameters["latency_s"];
            assert!(
                (seconds * 200e3 * step / lag - 1.0).abs() < 1e-3,
                "{lag} {seconds}"
            );
            assert!(!found.structure.left);
        }
    }
}
