//! The gyro's motion over a block of samples, by powers that are made once: between two changes of the
//! conditions it is linear, so a block needs no step from sample to sample.
//!
//! The free motion of both modes is w(n) = M^n w(0) with M block triangular: the drive moves the sense
//! mode by its velocity (Coriolis force) and by its displacement (quadrature), each linear in its
//! coupling. So M^n has four blocks that no coupling is in: [`Power`].

use crate::numeric::turn;
use nalgebra::Matrix2;

/// Samples that the tables reach over; a longer block is run in pieces.
pub const PIECE: usize = 64;

/// Samples that are made side by side.
const WIDTH: usize = 8;

/// Values of consecutive samples, as many as a piece has, in eights.
type Values = [[f64; WIDTH]; PIECE / WIDTH];

/// None yet.
const NO_VALUES: Values = [[0.0; WIDTH]; PIECE / WIDTH];

/// Both modes moved on by some time, for a state (x, u) of the drive and (y, v) of the sense mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Power {
    /// From (x, u) to (x, u).
    pub drive: Matrix2<f64>,
    /// From (y, v) to (y, v).
    pub sense: Matrix2<f64>,
    /// From (x, u) to (y, v) under a coupling of 1 by the velocity u.
    pub by_velocity: Matrix2<f64>,
    /// The same by the displacement x.
    pub by_position: Matrix2<f64>,
}

impl Power {
    /// No motion.
    pub fn identity() -> Self {
        Power {
            drive: Matrix2::identity(),
            sense: Matrix2::identity(),
            by_velocity: Matrix2::zeros(),
            by_position: Matrix2::zeros(),
        }
    }

    /// First `first`, then this.
    pub fn after(&self, first: &Power) -> Power {
        Power {
            drive: self.drive * first.drive,
            sense: self.sense * first.sense,
            by_velocity: self.by_velocity * first.drive + self.sense * first.by_velocity,
            by_position: self.by_position * first.drive + self.sense * first.by_position,
        }
    }

    /// This so many times, by squares.
    fn times_over(&self, mut times: usize) -> Power {
        let (mut all, mut square) = (Power::identity(), *self);
        while times > 0 {
            if times % 2 == 1 {
                all = square.after(&all);
            }
            square = square.after(&square);
            times /= 2;
        }
        all
    }

    fn times(&self, factor: f64) -> Power {
        Power {
            drive: self.drive * factor,
            sense: self.sense * factor,
            by_velocity: self.by_velocity * factor,
            by_position: self.by_position * factor,
        }
    }

    /// The exponential of this rate of change, by its series where it is small and squares from there.
    pub fn exp(&self) -> Power {
        /// The rest is below 0.25^13 / 13! = 3e-18.
        const TERMS: u32 = 12;
        let blocks = [self.drive, self.sense, self.by_velocity, self.by_position];
        let largest = blocks.iter().map(|m| m.norm()).fold(0.0, f64::max);
        let (mut halvings, mut scale) = (0, 1.0);
        while largest * scale > 0.25 && halvings < 64 {
            halvings += 1;
            scale /= 2.0;
        }
        let small = self.times(scale);
        let mut sum = Power::identity();
        for k in (1..=TERMS).rev() {
            sum = small.times(1.0 / f64::from(k)).after(&sum);
            sum.drive += Matrix2::identity();
            sum.sense += Matrix2::identity();
        }
        for _ in 0..halvings {
            sum = sum.after(&sum);
        }
        sum
    }
}

/// How the drive acts on the sense mode: by its velocity and by its displacement.
#[derive(Debug, Clone, Copy)]
pub struct Couplings {
    /// Of the velocity u.
    pub velocity: f64,
    /// Of the displacement x.
    pub position: f64,
}

/// What an ADC sees of the motion: of (x, u) the drive's, of (y, v) the sense channel's.
pub type Rows = [[f64; 2]; 2];

/// Free motion and carrier by sample.
#[derive(Debug, Clone)]
pub struct Tables {
    /// M.
    one: Power,
    /// M^n of a whole piece, and of the number of samples that was last asked for beside it.
    whole: [(usize, Power); 2],
    rows: Rows,
    /// Samples that the outputs are made for.
    made: usize,
    /// What the ADCs see after n samples: the drive's of x and u; the sense channel's of y and v, of x and u
    /// by the velocity, of x and u by the displacement.
    outputs: [Values; 8],
    /// What the excitation's phase advances by, 2^-64 turn, and for how many samples the next are made.
    carrier: (u64, usize),
    /// Sine and cosine of n steps.
    sine: Values,
    cosine: Values,
}

impl Tables {
    /// For both modes moved on by one sample.
    pub fn new(one: Power) -> Self {
        Tables {
            one,
            whole: [(0, Power::identity()); 2],
            rows: [[0.0; 2]; 2],
            made: 0,
            outputs: [NO_VALUES; 8],
            carrier: (0, 0),
            sine: NO_VALUES,
            cosine: NO_VALUES,
        }
    }

    /// Other modes; the carrier stays.
    pub fn set(&mut self, one: Power) {
        self.one = one;
        self.whole = [(0, Power::identity()); 2];
        self.made = 0;
    }

    /// Both modes moved on by one sample.
    pub fn one(&self) -> &Power {
        &self.one
    }

    fn prepare(&mut self, samples: usize, rows: Rows, step: u64) {
        if self.made < samples || self.rows != rows {
            pulp::Arch::new().dispatch(Seen {
                one: self.one,
                rows,
                chunks: samples.div_ceil(WIDTH),
                outputs: &mut self.outputs,
            });
            (self.made, self.rows) = (samples, rows);
        }
        if self.carrier.0 != step || self.carrier.1 < samples {
            let sine = &mut self.sine.as_flattened_mut()[..samples];
            let cosine = &mut self.cosine.as_flattened_mut()[..samples];
            pulp::Arch::new().dispatch(Carrier { step, sine, cosine });
            self.carrier = (step, samples);
        }
    }

    /// What both ADCs see of eight samples: a place past [`PIECE`] has none.
    #[inline(always)]
    fn eight(
        &self,
        chunk: usize,
        [drive, sense]: [[f64; 2]; 2],
        [x, u, y, v, rx, ru, qx, qu]: [f64; 8],
    ) -> ([f64; WIDTH], [f64; WIDTH]) {
        let mut seen = ([0.0; WIDTH], [0.0; WIDTH]);
        if chunk >= PIECE / WIDTH {
            return seen;
        }
        let (sine, cosine) = (&self.sine[chunk], &self.cosine[chunk]);
        let [a, b, c, d, e, f, g, h] = self.outputs.each_ref().map(|o| &o[chunk]);
        for n in 0..WIDTH {
            seen.0[n] = drive[0] * cosine[n] + drive[1] * sine[n] + (x * a[n] + u * b[n]);
        }
        for n in 0..WIDTH {
            let free = (y * c[n] + v * d[n]) + (rx * e[n] + ru * f[n]) + (qx * g[n] + qu * h[n]);
            seen.1[n] = sense[0] * cosine[n] + sense[1] * sine[n] + free;
        }
        seen
    }

    /// At most [`PIECE`] samples of what both ADCs see: `steady` are the amplitudes of cosine and sine of the
    /// steady motion from the phase before the piece on, `deviation` is x, u, y, v of the free motion, which
    /// goes on.
    #[allow(clippy::too_many_arguments)]
    pub fn piece(
        &mut self,
        step: u64,
        steady: [[f64; 2]; 2],
        rows: Rows,
        couplings: Couplings,
        deviation: &mut [f64; 4],
        drive_lsb: &mut [f64],
        sense_lsb: &mut [f64],
    ) {
        let samples = drive_lsb.len();
        self.prepare(samples, rows, step);
        let [x, u, y, v] = *deviation;
        let (r, q) = (couplings.velocity, couplings.position);
        let weights = [x, u, y, v, r * x, r * u, q * x, q * u];
        pulp::Arch::new().dispatch(Piece {
            tables: self,
            steady,
            weights,
            drive: drive_lsb,
            sense: sense_lsb,
        });
        let all = self.over(samples);
        let (d, s) = (&all.drive, &all.sense);
        let c = all.by_velocity * r + all.by_position * q;
        *deviation = [
            d.m11 * x + d.m12 * u,
            d.m21 * x + d.m22 * u,
            c.m11 * x + c.m12 * u + s.m11 * y + s.m12 * v,
            c.m21 * x + c.m22 * u + s.m21 * y + s.m22 * v,
        ];
    }

    /// M^n of a piece of n samples.
    fn over(&mut self, samples: usize) -> &Power {
        let (kept, power) = &mut self.whole[usize::from(samples != PIECE)];
        if *kept != samples {
            (*kept, *power) = (samples, self.one.times_over(samples));
        }
        power
    }
}

/// What the ADCs see after 1, 2, ... samples, as [`Tables::outputs`]: eight one by one, and from eight the next eight. The same with
/// every instruction set, as [`Carrier`].
struct Seen<'a> {
    one: Power,
    rows: Rows,
    chunks: usize,
    outputs: &'a mut [Values; 8],
}

impl Seen<'_> {
    /// Rows that see what `power` moves on, by lane.
    #[inline(always)]
    fn moved<const N: usize>(
        power: &Power,
        [dx, du, sy, sv, vx, vu, px, pu]: [[f64; N]; 8],
    ) -> [[f64; N]; 8] {
        let (d, s) = (&power.drive, &power.sense);
        let (v, p) = (&power.by_velocity, &power.by_position);
        let mut to = [[0.0; N]; 8];
        for n in 0..N {
            to[0][n] = dx[n] * d.m11 + du[n] * d.m21;
            to[1][n] = dx[n] * d.m12 + du[n] * d.m22;
            to[2][n] = sy[n] * s.m11 + sv[n] * s.m21;
            to[3][n] = sy[n] * s.m12 + sv[n] * s.m22;
            to[4][n] = (vx[n] * d.m11 + vu[n] * d.m21) + (sy[n] * v.m11 + sv[n] * v.m21);
            to[5][n] = (vx[n] * d.m12 + vu[n] * d.m22) + (sy[n] * v.m12 + sv[n] * v.m22);
            to[6][n] = (px[n] * d.m11 + pu[n] * d.m21) + (sy[n] * p.m11 + sv[n] * p.m21);
            to[7][n] = (px[n] * d.m12 + pu[n] * d.m22) + (sy[n] * p.m12 + sv[n] * p.m22);
        }
        to
    }
}

impl pulp::WithSimd for Seen<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let [[dx, du], [sy, sv]] = self.rows;
        let mut one = [[dx], [du], [sy], [sv], [0.0], [0.0], [0.0], [0.0]];
        let mut eight = [[0.0; WIDTH]; 8];
        for n in 0..WIDTH {
            one = Self::moved(&self.one, one);
            for (to, [value]) in eight.iter_mut().zip(one) {
                to[n] = value;
            }
        }
        let by_eight = self.one.times_over(WIDTH);
        for chunk in 0..self.chunks.min(PIECE / WIDTH) {
            if chunk > 0 {
                eight = Self::moved(&by_eight, eight);
            }
            for (to, values) in self.outputs.iter_mut().zip(&eight) {
                to[chunk] = *values;
            }
        }
    }
}

/// Sine and cosine of 1, 2, ... steps: an object, so that it is compiled for wider SIMD. It has no sum
/// that another order could change, so the values are the same with every instruction set.
struct Carrier<'a> {
    step: u64,
    sine: &'a mut [f64],
    cosine: &'a mut [f64],
}

impl pulp::WithSimd for Carrier<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        for (n, (sine, cosine)) in (1u64..).zip(self.sine.iter_mut().zip(self.cosine)) {
            (*sine, *cosine) = turn::sin_cos(self.step.wrapping_mul(n));
        }
    }
}

/// The samples of a piece, as [`Carrier`] the same with every instruction set.
struct Piece<'a> {
    tables: &'a Tables,
    steady: [[f64; 2]; 2],
    weights: [f64; 8],
    drive: &'a mut [f64],
    sense: &'a mut [f64],
}

impl pulp::WithSimd for Piece<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let (drive, drive_rest) = self.drive.as_chunks_mut::<WIDTH>();
        let (sense, sense_rest) = self.sense.as_chunks_mut::<WIDTH>();
        let whole = drive.len();
        for (chunk, (drive, sense)) in drive.iter_mut().zip(sense).enumerate() {
            (*drive, *sense) = self.tables.eight(chunk, self.steady, self.weights);
        }
        if !drive_rest.is_empty() {
            let (drive, sense) = self.tables.eight(whole, self.steady, self.weights);
            drive_rest.copy_from_slice(&drive[..drive_rest.len()]);
            sense_rest.copy_from_slice(&sense[..sense_rest.len()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::noise::Noise;

    fn some(noise: &Noise, from: u64) -> Power {
        let number = |k| 2.0 * noise.uniform(from + k) - 1.0;
        let matrix = |k: u64| Matrix2::from_fn(|r, c| number(k + 2 * r as u64 + c as u64));
        Power {
            drive: matrix(0),
            sense: matrix(4),
            by_velocity: matrix(8),
            by_position: matrix(12),
        }
    }

    fn joined(p: &Power, couplings: Couplings) -> nalgebra::Matrix4<f64> {
        let mut all = nalgebra::Matrix4::zeros();
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(&p.drive);
        all.fixed_view_mut::<2, 2>(2, 2).copy_from(&p.sense);
        let c = p.by_velocity * couplings.velocity + p.by_position * couplings.position;
        all.fixed_view_mut::<2, 2>(2, 0).copy_from(&c);
        all
    }

    #[test]
    fn the_exponential_is_the_whole_matrix_s() {
        let noise = Noise::new(5, 1);
        for k in 0..200 {
            let rate = some(&noise, 100 * k).times(0.01 * (k + 1) as f64);
            let couplings = Couplings {
                velocity: 3.0 * noise.uniform(100 * k + 50) - 1.0,
                position: 3.0 * noise.uniform(100 * k + 51) - 1.0,
            };
            let (own, other) = (
                joined(&rate.exp(), couplings),
                joined(&rate, couplings).exp(),
            );
            assert!((own - other).norm() <= 1e-13 * other.norm(), "{k}");
        }
    }

    /// Against steps from sample to sample, pieces of every length.
    #[test]
    fn a_piece_is_its_samples_one_by_one() {
        let noise = Noise::new(5, 2);
        for k in 0..300u64 {
            let number = |i| 2.0 * noise.uniform(100 * k + i) - 1.0;
            let one = some(&noise, 100 * k).times(0.3).exp().times(0.7);
            let couplings = Couplings {
                velocity: number(20),
                position: number(21),
            };
            let rows = [[number(22), number(23)], [number(24), number(25)]];
            let steady = [[number(26), number(27)], [number(28), number(29)]];
            let step = noise.bits(100 * k + 30);
            let mut tables = Tables::new(one);
            let mut free = [number(31), number(32), number(33), number(34)];
            for part in 0..4u64 {
                let samples = (noise.bits(100 * k + 40 + part) % PIECE as u64) as usize + 1;
                let mut w = nalgebra::Vector4::from(free);
                let (mut d, mut s) = ([0.0; PIECE], [0.0; PIECE]);
                let (d, s) = (&mut d[..samples], &mut s[..samples]);
                tables.piece(step, steady, rows, couplings, &mut free, d, s);
                for n in 0..samples {
                    w = joined(&one, couplings) * w;
                    let (sine, cosine) = turn::sin_cos(step.wrapping_mul(n as u64 + 1));
                    let seen = |k: usize, a: f64, b: f64| {
                        steady[k][0] * cosine
                            + steady[k][1] * sine
                            + rows[k][0] * a
                            + rows[k][1] * b
                    };
                    let most = 1e-12 * (1.0 + w.norm());
                    let near = |a: f64, b: f64| assert!((a - b).abs() < most, "{k} {n}: {a} {b}");
                    near(d[n], seen(0, w[0], w[1]));
                    near(s[n], seen(1, w[2], w[3]));
                }
                for (a, b) in free.iter().zip(w.iter()) {
                    assert!((a - b).abs() < 1e-12 * (1.0 + w.norm()), "{k}");
                }
            }
        }
    }
}
