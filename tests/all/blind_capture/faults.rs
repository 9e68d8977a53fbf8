//! What can be wrong with the bench.

use super::bench::{Bench, Dice};
use std::f64::consts::{PI, TAU};

/// A fault with its size.
#[derive(Debug, Clone)]
pub enum Fault {
    /// Codes, by channel.
    Offset([f64; 2]),
    /// Relative.
    Gain(f64),
    /// Codes at full scale of a shape.
    Inl(f64, Shape),
    /// Spacing and residue.
    MissingEvery(i64, i64),
    /// Single codes.
    MissingSome(Vec<i64>),
    /// Levels low and high, of full scale; noise is limited too.
    Clip(f64, f64),
    /// Turns of the oscillator rms; both channels at the same instant.
    Jitter(f64, bool),
    /// Order, amplitude relative to the tone, phase: drive, and sense if asked.
    Harmonics(f64, Vec<(u32, f64, f64)>, bool),
    /// Drive to sense, codes by code, phase in turns; with the drive's noise.
    Feedthrough(f64, f64, bool),
    /// Samples.
    Latency(f64),
    /// Codes; frequency in Hz and relative amplitude of each line; channels.
    Mains(f64, Vec<(f64, f64)>, [f64; 2]),
    /// Address bits of the oscillator.
    Truncation(u32),
    /// Relative amplitude of a line at k 2^P + 1 times the tone.
    SpurLine(f64, i64),
}

/// Shape of a nonlinearity over -1 .. 1.
#[derive(Debug, Clone, Copy)]
pub enum Shape {
    Cubic,
    Mixed,
    Bow,
    Sigmoid,
    Steps(u32),
}

impl Shape {
    fn at(self, u: f64) -> f64 {
        match self {
            Shape::Cubic => u.powi(3),
            Shape::Mixed => 0.6 * u * u - 0.8 * u.powi(3),
            Shape::Bow => (0.5 * PI * u).cos(),
            Shape::Sigmoid => (PI * u).sin(),
            Shape::Steps(n) => {
                let place = (0.5 + 0.5 * u) * f64::from(n);
                let k = place.floor() as i64;
                f64::from(((k * 2654435761) >> 7 & 7) as i32) / 3.5 - 1.0
            }
        }
    }
}

impl Fault {
    pub fn id(&self) -> &'static str {
        match self {
            Fault::Offset(_) => "adc_offset",
            Fault::Gain(_) => "adc_gain_error",
            Fault::Inl(..) => "adc_integral_nonlinearity",
            Fault::MissingEvery(..) | Fault::MissingSome(_) => "adc_missing_codes",
            Fault::Clip(..) => "adc_clipping",
            Fault::Jitter(..) => "aperture_jitter",
            Fault::Harmonics(..) => "harmonic_distortion",
            Fault::Feedthrough(..) => "drive_feedthrough",
            Fault::Latency(_) => "sample_latency",
            Fault::Mains(..) => "mains_pickup",
            Fault::Truncation(_) | Fault::SpurLine(..) => "nco_spur",
        }
    }

    /// Whether this code never appears.
    fn is_gone(&self, code: i64) -> bool {
        match self {
            Fault::MissingEvery(n, k) => code.rem_euclid(*n) == *k,
            Fault::MissingSome(codes) => codes.contains(&code),
            _ => false,
        }
    }

    /// The same, times a factor; those without a size stay.
    pub fn scaled(&self, f: f64) -> Fault {
        match self.clone() {
            Fault::Offset(o) => Fault::Offset(o.map(|o| o * f)),
            Fault::Gain(g) => Fault::Gain(g * f),
            Fault::Inl(a, s) => Fault::Inl(a * f, s),
            Fault::Jitter(t, c) => Fault::Jitter(t * f, c),
            Fault::Harmonics(a, h, s) => Fault::Harmonics(a * f, h, s),
            Fault::Feedthrough(a, p, n) => Fault::Feedthrough(a * f, p, n),
            Fault::Latency(s) => Fault::Latency(s * f),
            Fault::Mains(a, l, c) => Fault::Mains(a * f, l, c),
            Fault::SpurLine(a, k) => Fault::SpurLine(a * f, k),
            other => other,
        }
    }

    /// Draws a kind (0 .. 11); `None` where this bench cannot show it.
    pub fn draw(bench: &Bench, kind: usize, z: f64, d: &mut Dice) -> Option<Fault> {
        let fault = match kind {
            0 => Fault::Offset([[1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [1.0, -0.6]][d.below(4)]),
            1 => Fault::Gain(if d.odds(0.5) { 1.0 } else { -1.0 }),
            2 => {
                let shapes = [
                    Shape::Cubic,
                    Shape::Mixed,
                    Shape::Bow,
                    Shape::Sigmoid,
                    Shape::Steps(16),
                ];
                Fault::Inl(1.0, shapes[d.below(5)])
            }
            3 => return missing(bench, z, d),
            4 => return clip(bench, z, d),
            5 => Fault::Jitter(1.0, d.odds(0.7)),
            6 => {
                let count = 1 + d.below(3);
                let lines = (0..count).map(|k| {
                    (
                        2 + ((d.below(2) + k) % 4) as u32,
                        d.between(0.3, 1.0),
                        d.unit(),
                    )
                });
                Fault::Harmonics(1.0, lines.collect(), d.odds(0.5))
            }
            7 if bench.rate_known => Fault::Feedthrough(1.0, d.unit(), d.odds(0.5)),
            8 => Fault::Latency(1.0),
            9 => {
                let hz = if d.odds(0.5) { 50.0 } else { 60.0 };
                // Half a period at least, or it is an offset.
                if hz / bench.fs_hz * (bench.rows as f64) < 0.5 {
                    return None;
                }
                let mut lines = vec![(hz, 1.0)];
                if d.odds(0.3) {
                    lines.push((3.0 * hz, 0.4));
                }
                Fault::Mains(1.0, lines, [[1.0, 1.0], [1.0, 0.2], [0.0, 1.0]][d.below(3)])
            }
            10 if d.odds(0.5) => {
                let bits = 4 + d.below(9) as u32;
                let fault = Fault::Truncation(bits);
                let seen = bench.visible(&Faults::of(vec![fault.clone()]));
                let lost = !bench.ftw.is_multiple_of(1 << (32 - bits));
                return (lost && seen > z).then_some(fault);
            }
            10 => {
                let bits = 4 + d.below(8) as u32;
                let k = (1i64 << bits) * if d.odds(0.5) { 1 } else { -1 } + 1;
                if bench.ftw.is_multiple_of(1 << (32 - bits)) {
                    return None;
                }
                Fault::SpurLine(1.0, k)
            }
            _ => return None,
        };
        let fault = bench.sized(&fault, z);
        // Some never get that large: jitter is part of the noise it is seen against.
        let seen = bench.visible(&Faults::of(vec![fault.clone()]));
        let sane = match &fault {
            Fault::Jitter(turns, _) => *turns < 0.05,
            // A larger step skips codes: these are missing.
            Fault::Inl(a, Shape::Steps(_)) => *a < 0.4,
            Fault::Latency(samples) => *samples < 2.0,
            // A signal beyond full scale is clipped as well, and rightly said to be.
            _ => bench
                .signals(&Faults::of(vec![fault.clone()]))
                .iter()
                .flatten()
                .all(|x| x.abs() < bench.full_scale() - 6.0 * bench.noise[0].max(bench.noise[1])),
        };
        (sane && seen > 0.9 * z).then_some(fault)
    }
}

/// Missing codes that should have had at least max(40, z) rows.
fn missing(bench: &Bench, z: f64, d: &mut Dice) -> Option<Fault> {
    // Noise added to the rounded code hides a missing one.
    if bench.noise_after {
        return None;
    }
    let wanted = (0.5 * z * z).max(40.0);
    let train = 0.75 * 2.0 * bench.rows as f64;
    // A code that the tone never reaches, or that a coherent tone's few phases never hit, is not missed.
    let missed = |fault: Fault| {
        let whole = bench.codes(&Faults::none()).codes;
        let gone = |code: &&i32| fault.is_gone(i64::from(**code));
        let rows = whole.iter().flatten().filter(gone).count();
        (0.75 * rows as f64 >= wanted).then_some(fault)
    };
    if d.odds(0.6) {
        let longest = (train / wanted).min(4096.0) as i64;
        if longest < 16 {
            return None;
        }
        let spacing = 16 + d.below((longest - 15) as usize) as i64;
        return missed(Fault::MissingEvery(
            spacing,
            d.below(spacing as usize) as i64,
        ));
    }
    let per_code = 0.75 * bench.rows as f64 / (PI * bench.amplitude);
    if per_code < 40.0 {
        return None;
    }
    let reach = (0.8 * bench.amplitude) as usize;
    let count = 1 + d.below(4);
    missed(Fault::MissingSome(
        (0..count)
            .map(|_| d.below(2 * reach) as i64 - reach as i64)
            .collect(),
    ))
}

/// A level below the drive's peak that a matched filter sees at z or more.
fn clip(bench: &Bench, z: f64, d: &mut Dice) -> Option<Fault> {
    let peak = bench.amplitude / bench.full_scale();
    let sides = d.below(3);
    let of = |depth: f64| {
        let level = peak * (1.0 - depth);
        Fault::Clip(
            if sides == 1 { -2.0 } else { -level },
            if sides == 2 { 2.0 } else { level },
        )
    };
    let (mut low, mut high) = (-9.0f64, -0.36f64);
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if bench.visible(&Faults::of(vec![of(middle.exp())])) > z {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(of(high.exp()))
}

/// The faults of a capture.
#[derive(Debug, Clone, Default)]
pub struct Faults(pub Vec<Fault>);

impl Faults {
    pub fn none() -> Self {
        Faults(Vec::new())
    }

    pub fn of(faults: Vec<Fault>) -> Self {
        Faults(faults)
    }

    pub fn jitter(&self) -> f64 {
        let of = |f: &Fault| if let Fault::Jitter(t, _) = f { *t } else { 0.0 };
        self.0.iter().map(of).sum()
    }

    pub fn is_common(&self) -> bool {
        self.0.iter().any(|f| matches!(f, Fault::Jitter(_, true)))
    }

    /// A nonlinearity and nothing else.
    pub fn is_bend_alone(&self) -> bool {
        matches!(self.0.as_slice(), [Fault::Inl(..)])
    }

    /// Levels of a limit, of full scale.
    pub fn levels(&self) -> Option<[f64; 2]> {
        let of = |f: &Fault| match f {
            Fault::Clip(low, high) => Some([*low, *high]),
            _ => None,
        };
        self.0.iter().find_map(of)
    }

    pub fn only_jitter(&self) -> Option<f64> {
        match self.0.as_slice() {
            [Fault::Jitter(t, _)] => Some(*t),
            _ => None,
        }
    }

    pub fn noise_coupling(&self) -> f64 {
        let of = |f: &Fault| {
            if let Fault::Feedthrough(a, _, true) = f {
                *a
            } else {
                0.0
            }
        };
        self.0.iter().map(of).sum()
    }

    /// Both signals at a row before the converter.
    pub fn signal(&self, bench: &Bench, row: usize) -> [f64; 2] {
        self.signal_late(bench, row, 0.0)
    }

    /// The same, sampled `late` samples later.
    pub fn signal_late(&self, bench: &Bench, row: usize, late: f64) -> [f64; 2] {
        let step = f64::from(bench.ftw) / 4_294_967_296.0;
        let mut at = late;
        let mut bits = None;
        for fault in &self.0 {
            match fault {
                Fault::Latency(samples) => at -= samples,
                Fault::Truncation(b) => bits = Some(*b),
                _ => {}
            }
        }
        let turns = match bits {
            Some(b) => {
                let steps = f64::powi(2.0, b as i32);
                (bench.turns(row) * steps).floor() / steps + step * at
            }
            None => bench.turns(row) + step * at,
        };
        let clean = bench.ideal(turns);
        let [mut drive, mut sense] = clean;
        let sense_size = bench.in_phase.hypot(bench.quadrature);
        let time = (row as f64 + at) / bench.fs_hz;
        for fault in &self.0 {
            match fault {
                Fault::Harmonics(a, lines, both) => {
                    for (k, part, phase) in lines {
                        let wave = a * part * (TAU * (f64::from(*k) * turns + phase)).sin();
                        drive += bench.amplitude * wave;
                        sense += if *both { sense_size * wave } else { 0.0 };
                    }
                }
                Fault::Feedthrough(a, phase, _) => {
                    sense += a * bench.amplitude * (TAU * (turns - 0.25 + phase)).sin();
                }
                Fault::Mains(a, lines, channels) => {
                    let wave: f64 = lines
                        .iter()
                        .map(|(hz, r)| r * (TAU * hz * time + 0.4).sin())
                        .sum();
                    drive += channels[0] * a * wave;
                    sense += channels[1] * a * wave;
                }
                Fault::SpurLine(a, k) => {
                    let steps =
                        (i128::from(*k) * i128::from(bench.ftw) * row as i128).rem_euclid(1 << 32);
                    let wave = a * (TAU * steps as f64 / 4_294_967_296.0 + 1.1).sin();
                    drive += bench.amplitude * wave;
                    sense += sense_size * wave;
                }
                _ => {}
            }
        }
        [drive, sense]
    }

    /// Static characteristic of the converter, no rounding.
    pub fn bend(&self, channel: usize, x: f64, full: f64) -> f64 {
        let mut x = x;
        for fault in &self.0 {
            if let Fault::Clip(low, high) = fault {
                x = x.clamp(low * full, high * full);
            }
        }
        let mut y = x;
        for fault in &self.0 {
            match fault {
                Fault::Gain(g) => y += g * x,
                Fault::Offset(o) => y += o[channel],
                Fault::Inl(a, shape) => y += a * shape.at(x / full),
                _ => {}
            }
        }
        y
    }

    /// The code.
    pub fn convert(&self, channel: usize, x: f64, full: f64) -> i64 {
        let code = (self.bend(channel, x, full) + 0.5).floor() as i64;
        match self.0.iter().any(|f| f.is_gone(code)) {
            true => code - 1,
            false => code,
        }
    }
}
