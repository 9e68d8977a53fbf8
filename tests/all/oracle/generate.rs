//! Random designs over the whole key space.
//!
//! Each word length is drawn around the one that just fits the signal before
//! it, so that most designs run, many overflow, and some need more than the
//! supported 127 bits.

use super::design::{
    AmplitudeLoop, Compensation, Cordic, Design, Gain, Nco, PhaseLoop, Thermometer, Verdict,
};
use super::float::greatest_channel;
use super::number::{CastTo, Format, Overflow, Rounding};
use crate::rng::Rng;

/// What kind of design is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// One that is accepted.
    Accepted,
    /// One whose widest intermediate has 120 to 127 bits, where that is found.
    Edge,
    /// One that is refused, where that is found.
    Refused,
}

/// A random design; never an undecided one.
pub fn design(rng: &mut Rng, aim: Aim) -> Design {
    let mut fallback = None;
    for _ in 0..400 {
        let mut design = draw(rng);
        if aim != Aim::Accepted {
            widen(rng, &mut design, aim);
        }
        let verdict = design.verdict();
        let fits = match aim {
            Aim::Accepted => verdict == Verdict::Accepted,
            Aim::Edge => verdict == Verdict::Accepted && design.widest() >= 120,
            Aim::Refused => matches!(verdict, Verdict::Refused(_)),
        };
        if fits {
            return design;
        }
        if verdict != Verdict::Undecided {
            fallback = Some(design);
        }
    }
    fallback.expect("most designs are decided")
}

/// A format near the one with `m` integer and `n` fraction bits.
fn format_near(rng: &mut Rng, m: i64, n: i64, may_be_unsigned: bool) -> Format {
    let signed = !(may_be_unsigned && rng.chance(15));
    let m = match rng.range(0, 9) {
        0..=4 => m + rng.range(0, 2),
        5..=7 => m - rng.range(1, 5),
        8 => m + rng.range(3, 20),
        _ => rng.range(1, 40),
    };
    let n = match rng.range(0, 9) {
        0..=3 => n,
        4..=7 => n - rng.range(1, 16),
        8 => n + rng.range(1, 8),
        _ => rng.range(0, 40),
    };
    let m = m.clamp(i64::from(signed), 64);
    let n = n.clamp(i64::from(m == 0), 64 - m);
    Format {
        signed,
        m: m as u32,
        n: n as u32,
    }
}

fn rounding(rng: &mut Rng) -> Rounding {
    rng.pick(&Rounding::ALL)
}

fn overflow(rng: &mut Rng) -> Overflow {
    match rng.range(0, 99) {
        0..=34 => Overflow::Wrap,
        35..=69 => Overflow::Saturate,
        70..=85 => Overflow::SaturateSymmetric,
        _ => Overflow::Error,
    }
}

fn cast_near(rng: &mut Rng, m: i64, n: i64) -> CastTo {
    CastTo::new(format_near(rng, m, n, true), rounding(rng), overflow(rng))
}

fn nco(rng: &mut Rng) -> Nco {
    let phase_bits = if rng.chance(40) {
        rng.pick(&[8, 16, 24, 32, 48, 63, 64])
    } else {
        rng.bits(8, 64)
    };
    let table_bits = if rng.chance(40) { 16 } else { rng.bits(2, 40) };
    let table_m = if rng.chance(60) {
        1
    } else {
        rng.bits(1, table_bits)
    };
    let address_bits = if rng.chance(4) { 16 } else { rng.bits(2, 12) };
    Nco {
        phase_bits,
        tuning_word: tuning_word(rng, phase_bits),
        address_bits: address_bits.min(phase_bits),
        address_half_up: rng.chance(40),
        table: Format::q(table_m, table_bits - table_m),
    }
}

/// 0 .. min(2^w, 2^63)-1, or negative.
fn tuning_word(rng: &mut Rng, phase_bits: u32) -> i64 {
    let greatest = if phase_bits >= 63 {
        i64::MAX
    } else {
        (1i64 << phase_bits) - 1
    };
    match rng.range(0, 19) {
        0 => 0,
        1 => greatest,
        2 => rng.range(0, greatest.min(1000)),
        3 => -1,
        4 => rng.range(i64::MIN, -1),
        5..=7 => -rng.range(1, greatest),
        8..=11 => rng.range(0, greatest),
        // about 3 to 40 samples a period, as in a gyro
        _ => (greatest as f64 / (3.0 + 37.0 * rng.unit())) as i64,
    }
}

fn draw(rng: &mut Rng) -> Design {
    let adc_bits = if rng.chance(40) {
        rng.pick(&[12, 14, 16, 18, 24, 32])
    } else {
        rng.bits(2, 32)
    };
    let adc_m = if rng.chance(60) {
        1
    } else {
        rng.bits(1, adc_bits)
    };
    let adc = Format::q(adc_m, adc_bits - adc_m);
    let nco = nco(rng);
    let product_m = i64::from(adc.m + nco.table.m) - rng.range(0, 1);
    let product_n = i64::from(adc.n + nco.table.n);
    let product = cast_near(rng, product_m, product_n);
    let product_format = product.format;
    let mut design = Design {
        sample_rate_hz: rng.pick(&[224_000.0, 1.0, 48_000.5, 1e6, 0.1, 123_456.789]),
        adc,
        nco,
        product,
        stages: rng.bits(1, 6),
        ratio: match rng.range(0, 19) {
            0 => rng.bits(2, 4096),
            1 => rng.pick(&[2, 3, 255, 256, 1024]),
            2..=4 => 1 << rng.bits(1, 6),
            _ => rng.bits(2, 70),
        },
        differential_delay: rng.bits(1, 2),
        output: product,
        cordic: Cordic {
            iterations: rng.bits(4, 30),
            guard_bits: 0,
            width: 4,
            angle_bits: if rng.chance(30) { 32 } else { rng.bits(4, 64) },
            gain_bits: if rng.chance(60) {
                rng.bits(10, 40)
            } else {
                rng.bits(1, 62)
            },
        },
        phase_loop: None,
        amplitude_loop: None,
        compensation: None,
    };
    let extra = rng.range(0, i64::from(design.growth_bits()));
    design.output = cast_near(
        rng,
        i64::from(product_format.m),
        i64::from(product_format.n) + extra,
    );
    let guard = if rng.chance(70) {
        rng.bits(0, 10)
    } else {
        rng.bits(0, 32)
    };
    design.cordic.guard_bits = guard;
    let roomy = i64::from(design.output.format.bits() + guard) + 2;
    let width = match rng.range(0, 9) {
        0..=5 => roomy + rng.range(0, 6),
        6..=7 => roomy - rng.range(1, 8),
        _ => rng.range(4, 64),
    };
    design.cordic.width = width.clamp(4, 64) as u32;
    if rng.chance(40) {
        design.phase_loop = Some(phase_loop(rng, &design));
    }
    if rng.chance(40) {
        design.amplitude_loop = Some(amplitude_loop(rng, &design));
    }
    if rng.chance(75) {
        let mut compensation = compensation(rng, &design);
        if design.phase_loop.is_some() && rng.chance(50) {
            compensation.input = tuning_input(rng, design.nco.phase_bits);
        }
        design.compensation = Some(compensation);
    }
    design
}

fn phase_loop(rng: &mut Rng, design: &Design) -> PhaseLoop {
    let angle_bits = i64::from(design.cordic.angle_bits);
    let half_turn = if angle_bits == 64 {
        i64::MAX
    } else {
        1i64 << (angle_bits - 1)
    };
    // A gain of about 2^(w - b) per unit moves the word by whole turns.
    let unity = (angle_bits - i64::from(design.nco.phase_bits)).clamp(0, 40);
    let gain = |rng: &mut Rng, low: i64| Gain {
        raw: match rng.range(0, 9) {
            0 => 0,
            1 => rng.range(-(1i64 << 40), 1i64 << 40),
            2 => -rng.range(1, 100),
            _ => rng.range(1, 100),
        },
        shift: (unity + rng.range(low, low + 15)).clamp(0, 63) as u32,
    };
    PhaseLoop {
        setpoint_raw: match rng.range(0, 4) {
            0 => -half_turn / 2,
            1 => 0,
            _ => rng.range(-half_turn, half_turn - 1),
        },
        proportional: gain(rng, 3),
        integral: gain(rng, 6),
        integrator_bits: if rng.chance(60) { 64 } else { rng.bits(2, 64) },
    }
}

fn amplitude_loop(rng: &mut Rng, design: &Design) -> AmplitudeLoop {
    let bits = design.output.format.bits().min(62);
    let scale = 1i64 << (bits - 1);
    let gain_bits = rng.bits(2, 32);
    let shift = |rng: &mut Rng| {
        let most = if rng.chance(80) { bits } else { 63 };
        rng.bits(0, most)
    };
    let mut control = AmplitudeLoop {
        setpoint_raw: match rng.range(0, 9) {
            0 => rng.range(i64::MIN, i64::MAX),
            1 => -rng.range(0, scale),
            _ => rng.range(0, scale),
        },
        error_shift: shift(rng),
        integrator_shift: shift(rng),
        initial_raw: 0,
        gain_bits,
    };
    if rng.chance(60) {
        // a loop that fits the signal: the integrator meets its limits and leaves them
        let greatest = greatest_channel(design) * 2f64.powi(design.output.format.n as i32);
        let share = 0.05 + 0.5 * rng.unit();
        control.setpoint_raw = (share * greatest.min(scale as f64)) as i64;
        let size = 64 - control.setpoint_raw.leading_zeros();
        let roomy = i64::from(size) - i64::from(gain_bits);
        control.error_shift = (roomy + rng.range(0, 5)).clamp(0, 63) as u32;
        control.integrator_shift = (roomy + rng.range(0, 5)).clamp(0, 63) as u32;
    }
    let greatest = i64::try_from(control.greatest_integrator()).unwrap_or(i64::MAX);
    control.initial_raw = match rng.range(0, 3) {
        0 => 0,
        1 => greatest,
        _ => rng.range(0, greatest),
    };
    control
}

/// Offsets up to the ends; scales about the width, so that the variable is about one.
fn tuning_input(rng: &mut Rng, phase_bits: u32) -> Thermometer {
    let greatest = i64::MAX >> (64 - phase_bits);
    let offset_raw = match rng.range(0, 9) {
        0 => greatest,
        1 => -greatest - 1,
        2..=4 => 0,
        _ => rng.range(-greatest - 1, greatest) >> rng.range(0, 8),
    };
    let scale_bits = if rng.chance(80) {
        rng.bits(phase_bits - 2, phase_bits.min(63) + 1)
    } else {
        rng.bits(0, 64)
    };
    Thermometer::TuningWord {
        offset_raw,
        scale_bits,
    }
}

fn compensation(rng: &mut Rng, design: &Design) -> Compensation {
    let coefficient_bits = rng.bits(2, 40);
    let signed = !rng.chance(15);
    let coefficient_n = if rng.chance(80) {
        rng.bits(0, coefficient_bits - u32::from(signed))
    } else {
        coefficient_bits - u32::from(signed)
    };
    let coefficient_format = Format {
        signed,
        m: coefficient_bits - coefficient_n,
        n: coefficient_n,
    };
    let mut accumulator = cast_near(
        rng,
        i64::from(coefficient_format.m) + 2,
        i64::from(coefficient_n) + 4,
    );
    if accumulator.format.n < coefficient_n {
        accumulator.format.n = coefficient_n;
        accumulator.format.m = accumulator.format.m.min(64 - coefficient_n);
    }
    let count = match rng.range(0, 9) {
        0 => 1,
        1 => 16,
        2..=6 => rng.range(2, 4),
        _ => rng.range(1, 16),
    };
    // Raw limits of both formats.
    let align = accumulator.format.n - coefficient_n;
    let least = coefficient_format
        .least()
        .max(accumulator.format.least() >> align);
    let greatest = coefficient_format
        .greatest()
        .min(accumulator.format.greatest() >> align);
    let least = if accumulator.format.signed { least } else { 0 };
    let coefficients_raw = (0..count)
        .map(|_| {
            let exact = rng.range(least as i64, greatest as i64);
            // mostly small ones, so that the accumulator does not always overflow
            match rng.range(0, 9) {
                0 => least as i64,
                1 => greatest as i64,
                2..=4 => exact,
                _ => exact >> rng.range(1, 6),
            }
        })
        .collect();
    let rate_full_scale_log2 = match rng.range(0, 9) {
        0 => rng.range(-40, 40),
        1 => rng.pick(&[-200, -1, 0, 1]),
        2 => rng.range(-8, 0),
        _ => rng.range(0, 16),
    };
    let output_m = i64::from(design.output.format.m) + rate_full_scale_log2;
    Compensation {
        input: Thermometer::Phase,
        coefficients_raw,
        coefficient_format,
        accumulator,
        rate_full_scale_log2: rate_full_scale_log2 as i32,
        output: cast_near(rng, output_m.max(i64::from(coefficient_format.m)), 8),
    }
}

/// Pushes one word length to or over the edge of the supported bits.
fn widen(rng: &mut Rng, design: &mut Design, aim: Aim) {
    let over = match aim {
        Aim::Refused if rng.chance(50) => 128,
        Aim::Refused => rng.range(128, 140),
        _ => rng.range(120, 127),
    };
    match rng.range(0, 3) {
        0 => {
            // product: a wide word shifted left by the cast
            let (adc_n, table_n) = (rng.bits(0, 3), rng.bits(0, 3));
            design.adc = Format::q(32 - adc_n, adc_n);
            design.nco.table = Format::q(40 - table_n, table_n);
            let n = over - i64::from(design.adc.m + design.nco.table.m);
            if (0..=63).contains(&n) {
                design.product.format = Format::q(1.max(rng.bits(0, 64 - n as u32)), n as u32);
            }
        }
        1 => {
            // decimator: product bits + G, with long filters
            design.stages = rng.bits(5, 6);
            design.ratio = rng.bits(1000, 4096);
            let sum = over - i64::from(design.growth_bits());
            let unsigned = u32::from(!design.product.format.signed);
            let bits = sum.clamp(2, 64) as u32 - unsigned;
            let m = design.product.format.m.clamp(1, bits);
            design.product.format.m = m;
            design.product.format.n = bits - m;
        }
        2 => {
            if let Some(compensation) = &mut design.compensation {
                compensation.input = Thermometer::Phase;
                // accumulator: its bits and those of the angle
                let format = &mut compensation.accumulator.format;
                format.m = rng.bits(60, 64).max(format.n + 1) - format.n;
                let operand = i64::from(format.operand_bits());
                let angle = (over - operand).clamp(4, 64);
                design.cordic.angle_bits = angle as u32;
                if let Some(control) = &mut design.phase_loop {
                    control.setpoint_raw = 0;
                }
            }
        }
        _ => {
            if let Some(compensation) = &mut design.compensation {
                // rate: sense I shifted left by a large full scale
                let m = i64::from(design.output.format.operand_bits() - design.output.format.n);
                let shift = over - m - i64::from(compensation.output.format.n);
                compensation.rate_full_scale_log2 = shift.clamp(-100, 130) as i32;
            }
        }
    }
}
