//! `adc_offset`: code = signal + offset, each channel its own or both the same.

use super::candidates::{Effect, Variant};
use super::columns::ONE;
use super::gram::Combo;

/// Both the same, one of them, both their own.
pub fn variants() -> Vec<Variant> {
    let drive = || Combo::one("drive_offset_codes", 0, ONE);
    let sense = || Combo::one("sense_offset_codes", 1, ONE);
    let both = Combo::new("offset_codes", 1.0, &[(0, ONE, 1.0), (1, ONE, 1.0)]);
    let of = |combos| Variant::new(Effect::Offset, combos, 0.0);
    vec![
        of(vec![both]),
        of(vec![drive()]),
        of(vec![sense()]),
        of(vec![drive(), sense()]),
    ]
}
