//! Random accepted designs with the rare features that emitted code has to get right: overflow that
//! is an error and happens, unsigned words, the widest and the narrowest words of every stage.

use super::design::{Design, Thermometer, Verdict};
use super::generate::{self, Aim};
use super::number::{CastTo, Format, Overflow, Rounding};
use crate::rng::Rng;

/// An accepted design, mostly with one to three edges.
pub fn design(rng: &mut Rng) -> Design {
    let aim = if rng.chance(25) {
        Aim::Edge
    } else {
        Aim::Accepted
    };
    loop {
        let plain = generate::design(rng, aim);
        if plain.verdict() != Verdict::Accepted {
            continue;
        }
        for _ in 0..20 {
            let mut edged = plain.clone();
            for _ in 0..rng.range(0, 3) {
                put_edge(rng, &mut edged);
            }
            settle(&mut edged);
            if edged.verdict() == Verdict::Accepted {
                return edged;
            }
        }
    }
}

/// `clamp_raw` for a design, as the line of its `[compensation]`.
pub fn clamp_line(rng: &mut Rng, design: &Design) -> String {
    let compensation = design.compensation.as_ref();
    let bits = match compensation.map(|c| c.input) {
        Some(Thermometer::TuningWord { .. }) => design.nco.phase_bits,
        _ => design.cordic.angle_bits,
    };
    let (least, greatest) = limits_of(bits);
    let draw = |rng: &mut Rng| match rng.range(0, 5) {
        0 => least,
        1 => greatest,
        2 => 0,
        _ => rng.range(least, greatest),
    };
    let (a, b) = (draw(rng), draw(rng));
    let (a, b) = if a == b { (least, greatest) } else { (a, b) };
    format!("clamp_raw = [{}, {}]", a.min(b), a.max(b))
}

fn limits_of(bits: u32) -> (i64, i64) {
    let greatest = i64::MAX >> (64 - bits);
    (-greatest - 1, greatest)
}

fn put_edge(rng: &mut Rng, design: &mut Design) {
    match rng.range(0, 5) {
        0 => error_edge(rng, design),
        1 => unsigned_edge(rng, design),
        2 => front_edge(rng, design),
        3 => cordic_edge(rng, design),
        4 => loop_edge(rng, design),
        _ => polynomial_edge(rng, design),
    }
}

/// Every cast to one of the design's quantisers.
fn any_cast<'a>(rng: &mut Rng, design: &'a mut Design) -> &'a mut CastTo {
    let choices = if design.compensation.is_some() { 3 } else { 1 };
    match (rng.range(0, choices), &mut design.compensation) {
        (2, Some(compensation)) => &mut compensation.accumulator,
        (3, Some(compensation)) => &mut compensation.output,
        (0, _) => &mut design.product,
        _ => &mut design.output,
    }
}

/// An overflow that is an error, in a format that is often too small.
fn error_edge(rng: &mut Rng, design: &mut Design) {
    let lost = rng.bits(0, 4);
    let cast = any_cast(rng, design);
    cast.overflow = Overflow::Error;
    let least = u32::from(cast.format.signed).max(u32::from(cast.format.n == 0));
    cast.format.m = cast.format.m.saturating_sub(lost).max(least);
}

fn unsigned_edge(rng: &mut Rng, design: &mut Design) {
    let overflow = rng.pick(&[
        Overflow::Wrap,
        Overflow::Saturate,
        Overflow::SaturateSymmetric,
        Overflow::Error,
    ]);
    let rounding = rng.pick(&Rounding::ALL);
    let everywhere = rng.chance(30);
    if everywhere {
        let mut all = vec![&mut design.product, &mut design.output];
        if let Some(compensation) = &mut design.compensation {
            let coefficient = &mut compensation.coefficient_format;
            coefficient.signed = false;
            let greatest = coefficient.greatest();
            for c in &mut compensation.coefficients_raw {
                *c = i64::try_from(i128::from(c.unsigned_abs()).min(greatest)).unwrap_or(0);
            }
            all.extend([&mut compensation.accumulator, &mut compensation.output]);
        }
        for cast in all {
            cast.format.signed = false;
        }
    }
    let wide = rng.chance(30);
    let cast = any_cast(rng, design);
    cast.format.signed = false;
    cast.overflow = overflow;
    cast.rounding = rounding;
    if wide {
        cast.format.m = 64 - cast.format.n;
    }
}

/// NCO, products, decimators: the widest table and codes, rings over 64 bits, few phase bits.
fn front_edge(rng: &mut Rng, design: &mut Design) {
    match rng.range(0, 5) {
        0 => design.nco.table = Format::q(1, 39),
        1 => design.adc = Format::q(1, 31),
        2 => {
            design.stages = rng.bits(4, 6);
            design.ratio = rng.bits(100, 800);
        }
        3 => design.nco.phase_bits = rng.bits(8, 31),
        4 => design.nco.phase_bits = 64,
        _ => {
            let n = design.product.format.n;
            design.product.format.m = (64 - n).max(1);
        }
    }
}

fn cordic_edge(rng: &mut Rng, design: &mut Design) {
    match rng.range(0, 4) {
        0 => design.cordic.width = 64,
        1 => design.cordic.width = rng.bits(4, 12),
        2 => design.cordic.angle_bits = 64,
        3 => design.cordic.angle_bits = rng.bits(4, 9),
        _ => {
            design.cordic.gain_bits = rng.pick(&[1, 62]);
            design.cordic.guard_bits = rng.pick(&[0, 32]);
        }
    }
}

fn loop_edge(rng: &mut Rng, design: &mut Design) {
    let sixty_four = rng.chance(50);
    let wild = rng.chance(30);
    if let Some(control) = &mut design.phase_loop {
        control.integrator_bits = if sixty_four { 64 } else { rng.bits(2, 20) };
        if wild {
            control.proportional.raw = rng.range(i64::MIN >> 2, i64::MAX >> 2);
            control.integral.raw = rng.pick(&[i64::MIN >> 2, i64::MAX >> 2, 1, -1]);
            control.proportional.shift = rng.pick(&[0, 1, 63]);
            control.integral.shift = rng.pick(&[0, 1, 63]);
        }
    }
    if let Some(control) = &mut design.amplitude_loop
        && wild
    {
        control.setpoint_raw = rng.pick(&[i64::MIN, i64::MAX, 0, -1]);
        control.error_shift = rng.pick(&[0, 63]);
        control.integrator_shift = rng.pick(&[0, 63]);
    }
}

fn polynomial_edge(rng: &mut Rng, design: &mut Design) {
    let count = rng.pick(&[1, 2, 16]);
    let rounding = rng.pick(&Rounding::ALL);
    let log2 = rng.pick(&[-200, -64, -1, 0, 1, 15, 40]);
    if let Some(compensation) = &mut design.compensation {
        match rng.range(0, 3) {
            0 => {
                let first = compensation.coefficients_raw[0];
                compensation.coefficients_raw.resize(count, first);
            }
            1 => compensation.accumulator.rounding = rounding,
            2 => compensation.rate_full_scale_log2 = log2,
            _ => {
                let format = &mut compensation.accumulator.format;
                format.m = 64 - format.n;
            }
        }
    }
}

/// Brings dependent numbers back into their ranges.
fn settle(design: &mut Design) {
    let nco = &mut design.nco;
    nco.address_bits = nco.address_bits.min(nco.phase_bits);
    if nco.phase_bits < 63 && nco.tuning_word >= 0 {
        nco.tuning_word &= (1i64 << nco.phase_bits) - 1;
    }
    if let Some(compensation) = &mut design.compensation
        && let Thermometer::TuningWord { offset_raw, .. } = &mut compensation.input
    {
        let (least, greatest) = limits_of(nco.phase_bits);
        *offset_raw = (*offset_raw).clamp(least, greatest);
    }
    if let Some(control) = &mut design.phase_loop {
        let (least, greatest) = limits_of(design.cordic.angle_bits);
        control.setpoint_raw = control.setpoint_raw.clamp(least, greatest);
    }
    if let Some(control) = &mut design.amplitude_loop {
        let greatest = control.greatest_integrator();
        let greatest = i64::try_from(greatest).unwrap_or(i64::MAX);
        control.initial_raw = control.initial_raw.clamp(0, greatest);
    }
}
