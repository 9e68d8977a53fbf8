//! Words for emitted functions, many rows in one piece of memory.

/// Rows of 64-bit words, each of as many words as the first. A record of a million rows goes through every
/// comparison, so that no row has memory of its own.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WordRows {
    columns: usize,
    words: Vec<i64>,
}

impl WordRows {
    /// No rows yet, of `columns` words each.
    pub fn new(columns: usize) -> Self {
        let words = Vec::new();
        WordRows { columns, words }
    }

    /// Appends a row, of which each word has at most 64 bits; an unsigned word keeps its bits.
    ///
    /// # Panics
    /// Where the row has another length than the table's.
    pub fn push(&mut self, row: impl IntoIterator<Item = i128>) {
        let before = self.words.len();
        self.words.extend(row.into_iter().map(|word| word as i64));
        assert_eq!(self.words.len() - before, self.columns, "words of a row");
    }

    /// How many rows.
    pub fn len(&self) -> usize {
        self.words.len() / self.columns.max(1)
    }

    /// There is no row.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Words of a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// A row; none past the last.
    pub fn row(&self, k: usize) -> &[i64] {
        let from = k * self.columns;
        self.words.get(from..from + self.columns).unwrap_or(&[])
    }

    /// The rows in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[i64]> {
        self.words.chunks_exact(self.columns.max(1))
    }

    /// All words as this machine stores them, for a program that reads them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let bytes = self.words.iter().flat_map(|word| word.to_ne_bytes());
        bytes.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_as_they_were_given() {
        let mut rows = WordRows::new(2);
        rows.push([1, -2]);
        rows.push([i128::from(u64::MAX), 4]);
        assert_eq!((rows.len(), rows.columns()), (2, 2));
        assert_eq!(rows.row(1), [-1, 4]);
        assert!(rows.row(2).is_empty());
        assert_eq!(rows.iter().collect::<Vec<_>>(), [[1, -2], [-1, 4]]);
        assert_eq!(rows.to_bytes().len(), 32);
        assert!(WordRows::new(0).is_empty());
    }

    #[test]
    #[should_panic(expected = "words of a row")]
    fn a_row_of_another_length_is_refused() {
        WordRows::new(2).push([1]);
    }
}
