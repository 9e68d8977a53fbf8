//! A plan as the table `[correction]` of a design file, so that a corrected gyro is a design.

use super::formats::Formats;
use super::plan::Term;
use super::run::Correction;
use crate::design::Design;
pub use crate::design::correction::Planned;
use crate::error::{Error, Result};
use std::fmt::Write as _;

/// Refuses a design whose `[correction]` cannot become firmware.
///
/// # Errors
/// As [`Planned::compile`], at the table.
pub fn refuse_unbuildable(design: &Design) -> Result<()> {
    let Some(planned) = &design.correction else {
        return Ok(());
    };
    planned.compile().map(drop).map_err(|e| match e {
        Error::Input(e) => design
            .error_at("correction", e.message.clone())
            .help(e.help.clone().unwrap_or_default())
            .into(),
        other => other,
    })
}

impl Planned {
    /// Compiles it.
    ///
    /// # Errors
    /// As [`Correction::new`] and [`Formats::choose`].
    pub fn compile(&self) -> Result<Correction> {
        self.plan.check()?;
        let formats = Formats::choose(&self.plan, self.noise_dps)?;
        let mut correction = Correction::new(&self.plan, &formats)?;
        correction.heldout_rms_dps = self.heldout_rms_dps;
        Ok(correction)
    }

    /// The table as text, read back as itself.
    pub fn to_toml(&self) -> String {
        let plan = &self.plan;
        let mut text = String::from("[correction]\n");
        _ = writeln!(text, "period_s = {:?}", plan.period_s);
        _ = writeln!(text, "full_scale_dps = {:?}", plan.full_scale_dps);
        _ = writeln!(text, "noise_dps = {:?}", self.noise_dps);
        if let Some(rms) = self.heldout_rms_dps {
            _ = writeln!(text, "heldout_rms_dps = {rms:?}");
        }
        text += "inputs = [\n";
        for input in &plan.inputs {
            let column = toml::Value::from(input.column.as_str());
            let (offset, scale) = (input.offset, input.scale);
            _ = writeln!(
                text,
                "    {{ column = {column}, offset = {offset:?}, scale = {scale:?} }},"
            );
        }
        text += "]\nterms = [\n";
        for term in &plan.terms {
            let keys = keys(term);
            _ = writeln!(text, "    {{ kind = \"{}\", {keys} }},", term.kind());
        }
        text + "]\n"
    }
}

fn yes(flag: bool) -> &'static str {
    if flag { "\"yes\"" } else { "\"no\"" }
}

/// The keys of a term but its kind.
fn keys(term: &Term) -> String {
    match term {
        Term::Product { gain_dps, factors } => {
            let pairs: Vec<[usize; 2]> = factors.iter().map(|(k, p)| [*k, *p as usize]).collect();
            format!("gain_dps = {gain_dps:?}, factors = {pairs:?}")
        }
        Term::Lag {
            gain_dps,
            input,
            tau_s,
            kept,
        } => format!(
            "gain_dps = {gain_dps:?}, input = {input}, tau_s = {tau_s:?}, kept = {}",
            yes(*kept)
        ),
        Term::LagOfCurve {
            gain_dps,
            input,
            values,
            tau_s,
            kept,
        }
        | Term::CurveOfLag {
            gain_dps,
            input,
            values,
            tau_s,
            kept,
        } => format!(
            "gain_dps = {gain_dps:?}, input = {input}, tau_s = {tau_s:?}, kept = {}, values = {values:?}",
            yes(*kept)
        ),
        Term::Slope {
            gain_dps_s,
            input,
            rows,
        } => format!("gain_dps_s = {gain_dps_s:?}, input = {input}, rows = {rows}"),
        Term::Decay { gain_dps, tau_s } => format!("gain_dps = {gain_dps:?}, tau_s = {tau_s:?}"),
        Term::Curve { input, values_dps } => {
            format!("input = {input}, values_dps = {values_dps:?}")
        }
        Term::Step {
            gain_dps,
            input,
            centre,
            gap,
            once,
        } => format!(
            "gain_dps = {gain_dps:?}, input = {input}, centre = {centre:?}, gap = {gap:?}, once = {}",
            yes(*once)
        ),
        Term::ScaleBy { input, s0, s1, s2 } => {
            let input = input.map_or(String::new(), |k| format!("input = {k}, "));
            let s2 = match *s2 == 0.0 {
                true => String::new(),
                false => format!(", s2 = {s2:?}"),
            };
            format!("{input}s0 = {s0:?}, s1 = {s1:?}{s2}")
        }
        Term::Cubic { ppm, rate_max_dps } => {
            format!("ppm = {ppm:?}, rate_max_dps = {rate_max_dps:?}")
        }
        Term::Even {
            ppm,
            rate_max_dps,
            absolute,
        } => format!(
            "ppm = {ppm:?}, rate_max_dps = {rate_max_dps:?}, absolute = {}",
            yes(*absolute)
        ),
    }
}
