//! The nearest of the words that are known: what was meant by one that is not.

/// The known word within two edits of `word`, the nearest first; else the only one that begins with it.
pub fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    known
        .iter()
        .map(|key| (edits(word, key), *key))
        .filter(|(distance, key)| *distance <= 2 && *distance < key.len())
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, key)| key)
        .or_else(|| only_one_that_begins_with(word, known))
}

/// Two letters begin too many words.
fn only_one_that_begins_with<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let mut longer = known.iter().filter(|key| key.starts_with(word));
    match (longer.next(), longer.next()) {
        (Some(key), None) if word.len() > 2 => Some(key),
        _ => None,
    }
}

/// Insertions, deletions, replacements and swaps of neighbours that lead from `a` to `b`.
fn edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(80).collect(), b.chars().collect());
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replace = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replace.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_count_swaps_as_one() {
        assert_eq!(edits("ratio", "ratio"), 0);
        assert_eq!(edits("raito", "ratio"), 1);
        assert_eq!(edits("", "abc"), 3);
        assert_eq!(edits("kitten", "sitting"), 3);
    }

    #[test]
    fn a_beginning_names_the_word_if_it_is_of_one_alone() {
        let known = ["bias_dps", "drift_dps", "chamber_degc", "chamber_kelvin"];
        assert_eq!(nearest("bias", &known), Some("bias_dps"));
        assert_eq!(nearest("chamber", &known), None);
        assert_eq!(nearest("dr", &known), None);
    }
}
