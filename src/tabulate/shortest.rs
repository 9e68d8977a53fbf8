//! The shortest words that keep to a bound.

use crate::approx::form::Form;

/// Fraction bits below a bisection's result that are tried one by one.
const A_LITTLE: u32 = 2;

/// Fewer bits come first where the price is the same.
pub(super) fn polynomial_bits(form: &Form) -> u32 {
    let Form::Polynomial(p) = form else { return 0 };
    let degree = p.coefficients.len().saturating_sub(1);
    let each = p.formats.coefficients.each(p.monomials, degree);
    let coefficients: u32 = each.iter().map(|f| f.bits()).sum();
    coefficients + p.formats.intermediate.bits
}

/// The fewest bits from `low` up to below `most` for which `at` has something, and what it has. More bits are better, if
/// not always: the bisection is followed by a look a little below.
pub(super) fn fewest<T>(low: u32, most: u32, at: &dyn Fn(u32) -> Option<T>) -> Option<(u32, T)> {
    let (mut least, mut known) = (low, most);
    let mut best = None;
    while least < known {
        let bits = (least + known) / 2;
        match at(bits) {
            Some(found) => (best, known) = (Some((bits, found)), bits),
            None => least = bits + 1,
        }
    }
    let below = known.saturating_sub(A_LITTLE).max(low)..known;
    { below }
        .find_map(|bits| at(bits).map(|found| (bits, found)))
        .or(best)
}

#[cfg(test)]
mod tests {
    use super::fewest;

    #[test]
    fn the_fewest_bits_are_found_also_a_little_below_a_gap() {
        let from = |least: u32| move |bits: u32| (bits >= least).then_some(());
        assert_eq!(fewest(0, 20, &from(7)), Some((7, ())));
        assert_eq!(fewest(9, 20, &from(7)), Some((9, ())));
        assert_eq!(fewest(0, 7, &from(7)), None);
        // 5 bits do, 6 do not, 7 do.
        let gap = |bits: u32| (bits == 5 || bits >= 7).then_some(());
        assert_eq!(fewest(0, 20, &gap), Some((5, ())));
    }
}
