//! The slow rate over several rows at once, where no loop is closed and no cast can stop the run: the
//! rows do not wait for one another, so CORDIC and compensation run on eight of them side by side.

use super::block_kernel::Instructions;
use super::chain::Chain;
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::batch::{Batch, WIDTH, Words};

/// Rows that wait for their phase, magnitude and rate.
#[derive(Debug, Clone)]
pub struct RowBatch {
    instructions: Instructions,
    /// By channel, then row.
    channels: [Words; 4],
    count: usize,
}

impl RowBatch {
    /// For a chain whose words at the decimated rate fit into 64 bits; `None` where a row needs the
    /// one before, or where a cast may stop the run.
    pub fn new<const N: usize>(chain: &mut Chain<N>, instructions: Instructions) -> Option<Self> {
        let applies = instructions != Instructions::Plain && chain.is_row_by_row_free();
        applies.then_some(RowBatch {
            instructions,
            channels: [[0; WIDTH]; 4],
            count: 0,
        })
    }

    /// Takes the channels of one row. True: the batch is full and has to be put out.
    pub fn push(&mut self, channels: [i64; 4]) -> bool {
        for (to, from) in self.channels.iter_mut().zip(channels) {
            if let Some(to) = to.get_mut(self.count) {
                *to = from;
            }
        }
        self.count += 1;
        self.count >= WIDTH
    }

    /// Appends the rows that wait, in the contract's columns.
    pub fn put<const N: usize>(&mut self, chain: &Chain<N>, rows: &mut Vec<i128>) {
        match self.instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => {
                if let Some(simd) = pulp::x86::V4::try_new() {
                    simd.vectorize(Put(self, chain, rows));
                }
            }
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => {
                if let Some(simd) = pulp::x86::V3::try_new() {
                    simd.vectorize(Put(self, chain, rows));
                }
            }
            _ => self.put_here(chain, rows),
        }
    }

    #[inline(always)]
    fn put_here<const N: usize>(&mut self, chain: &Chain<N>, rows: &mut Vec<i128>) {
        let ar = Batch;
        let [drive_i, drive_q, sense_i, _] = self.channels;
        let [phase, magnitude] = ar.call(&chain.cordic, "", &mut (), [drive_i, drive_q]);
        let (compensation, in_range) = chain.compensated(&ar, sense_i, [phase]);
        let mut columns = [&phase; 8];
        columns[5] = &magnitude;
        for (to, channel) in columns.iter_mut().zip(&self.channels) {
            *to = channel;
        }
        let mut count = 6;
        let rate = compensation.as_ref().map(|[_, rate]| rate);
        for column in [rate, in_range.as_ref()].into_iter().flatten() {
            columns[count] = column;
            count += 1;
        }
        for k in 0..self.count.min(WIDTH) {
            rows.extend(columns[..count].iter().map(|words| i128::from(words[k])));
        }
        self.count = 0;
    }
}

/// As [`RowBatch::put`], inside a function that is compiled for wider SIMD.
#[cfg(target_arch = "x86_64")]
struct Put<'a, const N: usize>(&'a mut RowBatch, &'a Chain<N>, &'a mut Vec<i128>);

#[cfg(target_arch = "x86_64")]
impl<const N: usize> pulp::NullaryFnOnce for Put<'_, N> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.0.put_here(self.1, self.2);
    }
}
