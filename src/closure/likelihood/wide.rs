//! The widest registers that the processor has, for the few loops that a search spends its time in.
//!
//! A [`Kernel`] is ordinary code with a fixed order of operations; here it is compiled twice, once for every
//! processor of the target and once for those with 256-bit registers (AVX2), and the copy that runs is chosen
//! when it runs. Neither copy contracts a product and a sum into one rounding, so both give the same bits.
//!
//! This is the crate's only module with unsafe code: one call, behind a test of the processor.

#![allow(unsafe_code)]

/// A loop that is worth wide registers. `run` and what it calls must be `#[inline(always)]`, or they stay code for
/// any processor.
pub trait Kernel {
    /// What it computes.
    type Output;

    /// Computes it.
    fn run(self) -> Self::Output;
}

/// Runs a kernel with the widest registers that there are.
#[inline]
pub fn widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn wide<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor that runs this has AVX2, the one thing that `wide` asks for.
            return unsafe { wide(kernel) };
        }
    }
    kernel.run()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Sum<'a>(&'a [f64]);

    impl Kernel for Sum<'_> {
        type Output = f64;

        #[inline(always)]
        fn run(self) -> f64 {
            let mut sums = [0.0; 4];
            for four in self.0.chunks_exact(4) {
                for (s, v) in sums.iter_mut().zip(four) {
                    *s += v * 1.1 + 0.3;
                }
            }
            sums.iter().sum()
        }
    }

    #[test]
    fn both_copies_give_the_same_bits() {
        let values: Vec<f64> = (0..4096).map(|i| (f64::from(i) * 0.37).sin()).collect();
        let plain = Sum(&values).run();
        assert_eq!(widest(Sum(&values)).to_bits(), plain.to_bits());
    }
}
