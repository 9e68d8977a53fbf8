//! `drive_feedthrough`: part of the drive signal is added to the sense channel.
//!
//! Its tone lies in the span of the rate's and the quadrature's carriers, so it shows in two ways only:
//! as an in-phase amplitude that the known rate does not account for (a gain error or a latency of
//! the sense channel alone would look the same), or, whatever is known, as drive noise in the sense codes.

use super::candidates::{Effect, Known, Variant};
use super::columns::OTHER;
use super::gram::Combo;

/// In-phase excess, noise that is common, both.
pub fn variants(known: &Known) -> Vec<Variant> {
    let noise = || Combo::one("drive_to_sense", 1, OTHER);
    let mut out = vec![Variant::new(Effect::Feedthrough, vec![noise()], 0.0)];
    if let Some(excess) = known.carrier("in_phase_codes", 1.0) {
        let both = vec![excess.clone(), noise()];
        out.push(Variant::new(Effect::Feedthrough, vec![excess], 0.0));
        out.push(Variant::new(Effect::Feedthrough, both, 0.0));
    }
    out
}
