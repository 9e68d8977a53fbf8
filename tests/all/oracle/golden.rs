//! The golden design and capture of the contract, and their checksum.

use super::constants::sine_table;
use super::design::{Compensation, Cordic, Design, Nco, Thermometer};
use super::fixed::Row;
use super::number::{CastTo, Format, Overflow, Rounding};

/// The design of the contract's "Keys", without the two loops.
pub fn design() -> Design {
    Design {
        sample_rate_hz: 224_000.0,
        adc: Format::q(1, 15),
        nco: Nco {
            phase_bits: 32,
            tuning_word: 33_554_432,
            address_bits: 10,
            address_half_up: false,
            table: Format::q(1, 15),
        },
        product: CastTo::new(Format::q(2, 30), Rounding::HalfUp, Overflow::Wrap),
        stages: 3,
        ratio: 64,
        differential_delay: 1,
        output: CastTo::new(Format::q(9, 23), Rounding::HalfUp, Overflow::Wrap),
        cordic: Cordic {
            iterations: 16,
            guard_bits: 6,
            width: 32,
            angle_bits: 32,
            gain_bits: 16,
        },
        phase_loop: None,
        amplitude_loop: None,
        compensation: Some(Compensation {
            input: Thermometer::Phase,
            coefficients_raw: vec![3_591_373, 7_961_641, 4_483_318],
            coefficient_format: Format::q(17, 15),
            accumulator: CastTo::new(Format::q(33, 15), Rounding::HalfUp, Overflow::Error),
            rate_full_scale_log2: 15,
            output: CastTo::new(Format::q(16, 8), Rounding::HalfUp, Overflow::Saturate),
        }),
    }
}

/// The golden checksums by number of samples.
pub const CHECKSUMS: [(usize, u64); 5] = [
    (64, 0xe843_526b_42f6_c485),
    (4096, 0x2db9_8c33_479e_d0b9),
    (65_536, 0x80b9_a81d_fbad_5676),
    (1_048_576, 0x66d3_a075_3c64_2cd0),
    (33_554_432, 0xd8b8_9dd5_77cd_4bde),
];

/// (rate, phase, magnitude) of the first three rows.
pub const FIRST_ROWS: [(i64, i64, i64); 3] = [
    (95_979, 339_870_620, 580_613),
    (277_854, 59_256_350, 2_907_253),
    (228_135, -405_188, 3_326_345),
];

/// The capture of the contract, (drive, sense) codes without end.
pub fn samples() -> impl Iterator<Item = (i16, i16)> {
    let table: Vec<i32> = sine_table(Format::q(1, 15), 10)
        .iter()
        .map(|&entry| entry as i32)
        .collect();
    let sat16 = |v: i32| v.clamp(-32768, 32767) as i16;
    let mut lcg = 0x1234_5678u32;
    let mut noise = move || {
        lcg = lcg.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (lcg >> 24) as i32 - 128
    };
    let (mut ph, mut mph) = (0u32, 0u32);
    std::iter::repeat_with(move || {
        ph = ph.wrapping_add(33_555_666);
        mph = mph.wrapping_add(77_777);
        let at = (ph >> 22) as usize;
        let si = table[at];
        let co = table[(at + 256) & 1023];
        let m = table[(mph >> 22) as usize];
        let n1 = noise();
        let n2 = noise();
        let d = ((26_000 * si) >> 15) + n1;
        let s = (((((m * 3000) >> 15) + 9000) * co) >> 15) + ((2000 * si) >> 15) + n2;
        (sat16(d), sat16(s))
    })
}

/// The first `count` samples of the capture.
pub fn capture(count: usize) -> Vec<(i64, i64)> {
    samples()
        .take(count)
        .map(|(drive, sense)| (i64::from(drive), i64::from(sense)))
        .collect()
}

/// The checksum over words of (rate, phase, magnitude), row by row.
pub fn checksum(words: impl Iterator<Item = [i64; 3]>) -> u64 {
    words.flatten().fold(0xcbf2_9ce4_8422_2325u64, |h, word| {
        (h ^ u64::from(word as u32)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The words of a row that the checksum takes.
pub fn words_of(row: &Row) -> [i64; 3] {
    let rate = row.rate.expect("the golden design has a rate");
    [rate as i64, row.phase as i64, row.magnitude as i64]
}
