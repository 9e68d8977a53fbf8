//! The candidate effects, and the ways in which each can show.

use super::columns::Model;
pub use super::variant::{Effect, Known, PRIOR, Variant, base, base_ridge, per_column};
use std::collections::BTreeMap;

/// All ways of all linear effects, near the model. `free` are the sine and cosine of both channels' tones
/// as they are in the codes.
pub fn variants(
    known: &Known,
    model: &Model,
    free: [[f64; 2]; 2],
    rows: usize,
    coupled: bool,
) -> Vec<Variant> {
    let mut out = super::offset::variants();
    out.extend(super::gain::variants(known, model));
    out.extend(super::latency::variants(known, model, free));
    out.extend(super::feedthrough::variants(known, coupled));
    out.extend(super::nonlinearity::variants(known, model, free));
    out.extend(super::harmonics::variants(known, model));
    out.extend(super::mains::variants(known, model, rows));
    out.extend(super::spur::variants(known, model, rows));
    let mut ways: BTreeMap<Effect, usize> = BTreeMap::new();
    for variant in &out {
        *ways.entry(variant.effect).or_default() += 1;
    }
    // All effects are as likely; what has many ways to show has each of them the less.
    for variant in &mut out {
        let ways = ways.get(&variant.effect).copied().unwrap_or(1) as f64;
        variant.cost += ways.ln() + variant.combos.len() as f64 * per_column(rows);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{Made, model};
    use super::*;

    #[test]
    fn a_variant_costs_its_columns_by_rows_and_its_effects_ways() {
        assert!((per_column(20_000) - 0.5 * 20_000f64.ln()).abs() < 1e-12);
        // Few rows: what a column gains by chance, and some.
        assert_eq!(per_column(10), 2.0);
        let made = Made::CLEAN;
        let (known, model) = model(&made.capture(), &made);
        let free = model.declared;
        let all = variants(&known, &model, free, made.rows, true);
        for variant in &all {
            let ways = all.iter().filter(|v| v.effect == variant.effect).count() as f64;
            let columns = variant.combos.len() as f64 * per_column(made.rows);
            let rest = variant.cost - PRIOR - variant.further - columns - ways.ln();
            assert!(rest.abs() < 1e-9, "{:?} {rest}", variant.effect);
        }
    }
}
