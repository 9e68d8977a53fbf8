//! The recursion of a whitener over many columns, in the widest registers that the processor has.
//!
//! What follows one row has to wait for it, and a row is a chain of some thirty cycles: so two registers of columns, if there
//! are as many, are filtered side by side. Every column sees the same operations in the same order whatever the width, and no product and sum are
//! contracted into one rounding: the bits do not depend on the processor. Loops, no closures: these would be compiled for any
//! processor.

use super::whiten::Whitener;
use pulp::{Arch, Simd, WithSimd};

/// Registers of columns that are filtered side by side, at most.
const BESIDE: usize = 2;

/// Rows that are turned at once from columns into lanes and back.
const TILE: usize = 16;

/// Lanes of the widest register that there is.
const WIDEST: usize = 8;

/// Whitens columns with a whitener of `N` states; `outputs` are as long as the whitener has rows.
pub fn filter<const N: usize>(
    whitener: &Whitener,
    columns: &[impl AsRef<[f64]>],
    outputs: &mut [Vec<f64>],
) {
    Arch::new().dispatch(Filter::<_, N> {
        whitener,
        columns,
        outputs,
    });
}

struct Filter<'a, C, const N: usize> {
    whitener: &'a Whitener,
    columns: &'a [C],
    outputs: &'a mut [Vec<f64>],
}

impl<C: AsRef<[f64]>, const N: usize> WithSimd for Filter<'_, C, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lanes = BESIDE * S::F64_LANES;
        let columns = self.columns.chunks(lanes);
        for (columns, outputs) in columns.zip(self.outputs.chunks_mut(lanes)) {
            if columns.len() > S::F64_LANES {
                States::<S, N, BESIDE>::new(simd).over(self.whitener, columns, outputs);
            } else {
                States::<S, N, 1>::new(simd).over(self.whitener, columns, outputs);
            }
        }
    }
}

/// What the filter knows of some columns, by state and register.
struct States<S: Simd, const N: usize, const B: usize> {
    simd: S,
    m: [[S::f64s; B]; N],
}

impl<S: Simd, const N: usize, const B: usize> States<S, N, B> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let m = [[simd.splat_f64s(0.0); B]; N];
        States { simd, m }
    }

    /// All rows, a tile at a time.
    #[inline(always)]
    fn over(
        mut self,
        whitener: &Whitener,
        columns: &[impl AsRef<[f64]>],
        outputs: &mut [Vec<f64>],
    ) {
        let lanes = B * S::F64_LANES;
        let mut buffer = [0.0; TILE * BESIDE * WIDEST];
        let buffer = &mut buffer[..TILE * lanes];
        for (tile, inverses) in whitener.inverse_std.chunks(TILE).enumerate() {
            let rows = tile * TILE..tile * TILE + inverses.len();
            for (lane, column) in columns.iter().enumerate() {
                let column = &column.as_ref()[rows.clone()];
                for (row, v) in buffer.chunks_exact_mut(lanes).zip(column) {
                    row[lane] = *v;
                }
            }
            let coefficients = &whitener.coefficients[2 * N * rows.start..];
            let (registers, _) = S::as_mut_simd_f64s(buffer);
            let (values, _) = pulp::as_arrays_mut::<B, _>(registers);
            for (row, (v, inverse)) in values.iter_mut().zip(inverses).enumerate() {
                let both = &coefficients[2 * N * row..2 * N * (row + 1)];
                let (decays, gains) = both.split_at(N);
                *v = self.row(*v, (decays, gains, *inverse));
            }
            for (lane, output) in outputs.iter_mut().enumerate() {
                let output = &mut output[rows.clone()];
                for (out, row) in output.iter_mut().zip(buffer.chunks_exact(lanes)) {
                    *out = row[lane];
                }
            }
        }
    }

    /// One row: what is new in it, in standard deviations.
    #[inline(always)]
    fn row(
        &mut self,
        v: [S::f64s; B],
        (decays, gains, inverse): (&[f64], &[f64], f64),
    ) -> [S::f64s; B] {
        let simd = self.simd;
        for (m, a) in self.m.iter_mut().zip(decays) {
            let a = simd.splat_f64s(*a);
            for m in m {
                *m = simd.mul_f64s(*m, a);
            }
        }
        if inverse <= 0.0 {
            return [simd.splat_f64s(0.0); B];
        }
        let mut new = v;
        for (k, new) in new.iter_mut().enumerate() {
            *new = simd.sub_f64s(*new, self.predicted(k));
        }
        for (m, g) in self.m.iter_mut().zip(gains) {
            let g = simd.splat_f64s(*g);
            for (m, new) in m.iter_mut().zip(&new) {
                *m = simd.add_f64s(*m, simd.mul_f64s(g, *new));
            }
        }
        let inverse = simd.splat_f64s(inverse);
        for new in &mut new {
            *new = simd.mul_f64s(*new, inverse);
        }
        new
    }

    /// The sum of the states in a register, by pairs: the filter waits for it in every row.
    #[inline(always)]
    fn predicted(&self, register: usize) -> S::f64s {
        let mut sums = self.m;
        let mut count = N;
        while count > 1 {
            let half = count.div_ceil(2);
            for k in half..count {
                let (a, b) = (sums[k - half][register], sums[k][register]);
                sums[k - half][register] = self.simd.add_f64s(a, b);
            }
            count = half;
        }
        match sums.first() {
            Some(sum) => sum[register],
            None => self.simd.splat_f64s(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise::{Shape, Timeline};
    use super::super::random::Stream;
    use super::*;
    use pulp::Scalar;

    #[test]
    fn every_width_gives_the_same_bits() {
        let rows = 3 * TILE + 5;
        let times: Vec<f64> = (0..rows).map(|k| k as f64 + f64::from(k > 20)).collect();
        let mut factor = vec![1.0; rows];
        factor[7] = f64::INFINITY;
        let line = Timeline::new(&times, factor).unwrap();
        let mut columns: Vec<Vec<f64>> = (0..2 * BESIDE as u64 * WIDEST as u64 + 3)
            .map(|k| Stream::new(4, k).normals(rows))
            .collect();
        columns[0][7] = f64::NAN;
        for (flicker, walk) in [(0.0, 0.0), (0.0, 0.01), (0.2, 0.0), (0.2, 0.01)] {
            let whitener = Whitener::new(&line, Shape { flicker, walk });
            let widest = whitener.apply_all(&columns);
            for (column, wide) in columns.iter().zip(&widest) {
                let mut narrow = [vec![0.0; rows]];
                let (columns, outputs) = (std::slice::from_ref(column), &mut narrow[..]);
                match whitener.width {
                    0 => States::<_, 0, 1>::new(Scalar::new()).over(&whitener, columns, outputs),
                    1 => States::<_, 1, 1>::new(Scalar::new()).over(&whitener, columns, outputs),
                    4 => States::<_, 4, 1>::new(Scalar::new()).over(&whitener, columns, outputs),
                    6 => States::<_, 6, 1>::new(Scalar::new()).over(&whitener, columns, outputs),
                    other => panic!("{other} states"),
                }
                let bits = |v: &[f64]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(wide), bits(&narrow[0]));
                assert_eq!(wide[7], 0.0, "a row that is not used");
            }
        }
    }
}
