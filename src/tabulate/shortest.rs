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
    coefficients + p.formats.intermediate.bits as u32
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
