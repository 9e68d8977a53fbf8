//! `adc_gain_error`: code = (1 + g) signal. The drive's amplitude is declared; the sense channel's is
//! where the rate is known, and else follows the gain unseen.

use super::candidates::{Effect, Known, Variant};
use super::columns::{COS, Model, SIN};
use super::gram::Combo;

/// Of the drive, of both, of the sense channel.
pub fn variants(known: &Known, model: &Model) -> Vec<Variant> {
    let mut out = Vec::new();
    let [s, c] = model.declared[0];
    let drive = [(0, SIN, s), (0, COS, c)];
    if known.amplitude {
        let combo = Combo::new("relative", 1.0, &drive);
        out.push(Variant::new(Effect::Gain, vec![combo], 0.0));
    }
    if let Some(([cs, cc], codes)) = known.in_phase
        && codes != 0.0
    {
        let sense = [(1, SIN, cs * codes), (1, COS, cc * codes)];
        let alone = Combo::new("sense_relative", 1.0, &sense);
        out.push(Variant::new(Effect::Gain, vec![alone.clone()], 2.0));
        if known.amplitude {
            let parts: Vec<_> = drive.into_iter().chain(sense).collect();
            let both = Combo::new("relative", 1.0, &parts);
            out.push(Variant::new(Effect::Gain, vec![both], 0.0));
            let drive = Combo::new("drive_relative", 1.0, &drive);
            out.push(Variant::new(Effect::Gain, vec![drive, alone], 0.0));
        }
    }
    out
}
