//! The run as a thermal record (`docs/manual.md`, "Thermal records"): what the bit-accurate circuit and
//! a laboratory's instruments say.

use super::Run;
use crate::cosim::readings::{Mean, Taken};
use crate::design::Design;
use std::fmt::Write as _;

/// A column: name, decimals, value.
type Column = (&'static str, usize, fn(&Taken) -> f64);

/// The columns of a run's record. The thermometer is the phase with a fixed-frequency drive, the
/// frequency where a phase loop holds the phase.
fn columns(design: &Design, run: &Run) -> Vec<Column> {
    let thermometer: Column = if design.circuit.phase_loop.is_some() {
        ("freq_hz", 7, |t| t.fixed.freq_hz)
    } else {
        ("phase_rad", 9, |t| t.fixed.phase_rad)
    };
    let mut columns: Vec<Column> = vec![
        ("time_s", 3, |t| t.reading.time_s),
        ("rate_out_dps", 7, |t| t.fixed.rate_out_dps),
        ("chamber_degc", 4, |t| t.moment.temperatures.chamber_degc),
        thermometer,
        ("die_degc", 4, |t| t.moment.temperatures.electronics_degc),
    ];
    if design.circuit.amplitude_loop.is_some() {
        columns.push(("agc", 7, |t| t.fixed.agc));
    }
    columns.push(("quad_dps", 5, |t| t.fixed.quad_dps));
    let world: [Column; 3] = [
        ("rate_dps", 6, |t| t.moment.surroundings.rate_dps),
        ("supply_v", 5, |t| t.moment.surroundings.supply_v),
        ("accel_g", 5, |t| t.moment.surroundings.accel_g),
    ];
    let stated = world.into_iter().zip(run.has).filter(|(_, has)| *has);
    columns.extend(stated.map(|(column, _)| column));
    columns
}

/// The record as CSV.
pub fn text(design: &Design, run: &Run) -> String {
    let columns = columns(design, run);
    let names: Vec<&str> = columns.iter().map(|c| c.0).collect();
    let mut text = names.join(",") + "\n";
    for taken in &run.taken {
        for (k, (_, decimals, value)) in columns.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            _ = write!(text, "{comma}{:.decimals$}", value(taken));
        }
        text.push('\n');
    }
    text
}

/// A column's name, and its value in a reading.
type Quantity = (&'static str, fn(&Mean) -> f64);

/// Float and fixed beside each other, uncompensated and (where it was fitted) compensated, as CSV.
pub fn both_paths(taken: &[Taken], after: Option<&[Taken]>) -> String {
    let quantities: [Quantity; 6] = [
        ("phase_rad", |m| m.phase_rad),
        ("freq_hz", |m| m.freq_hz),
        ("agc", |m| m.agc),
        ("rate_out_dps", |m| m.rate_out_dps),
        ("quad_dps", |m| m.quad_dps),
        ("rate_std_dps", |m| m.rate_std_dps),
    ];
    let mut text = String::from("time_s,chamber_degc,structure_degc,electronics_degc,heating");
    for (name, _) in quantities {
        _ = write!(text, ",fixed_{name},float_{name}");
    }
    if after.is_some() {
        text += ",fixed_compensated_dps,float_compensated_dps";
    }
    text.push('\n');
    for (k, t) in taken.iter().enumerate() {
        let at = &t.moment.temperatures;
        _ = write!(
            text,
            "{:?},{:?},{:?},{:?},{}",
            t.reading.time_s,
            at.chamber_degc,
            at.structure_degc,
            at.electronics_degc,
            u8::from(t.reading.heating)
        );
        for (_, of) in quantities {
            _ = write!(text, ",{:?},{:?}", of(&t.fixed), of(&t.float));
        }
        if let Some(a) = after.and_then(|a| a.get(k)) {
            _ = write!(text, ",{:?},{:?}", a.fixed.rate_dps, a.float.rate_dps);
        }
        text.push('\n');
    }
    text
}
