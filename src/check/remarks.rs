//! What could be better in a design, each with the change that makes it so.

use super::budget::Budget;
use super::outcome::{NodeCheck, Overflows};
use crate::circuit::scale::{excitation_is_off, full_scale_is_off};
use crate::circuit::vector_width::{self, TooShort};
use crate::cosim::rest::rows_per_s;
use crate::design::{Compensation, Design};
use crate::nodes::repair;
use crate::numeric::format::Rounding;
use crate::spectrum::nco_spurs;
use crate::text::number;
use serde::Serialize;

/// A remark.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Remark {
    /// `idle_bits`, `biased_rounding`, `dead_band`, `spurs_in_band`, `output_hides_fit`, `wrap_possible`,
    /// `excitation_off_resonance`, `scale_factor`, `correction_not_checked`.
    pub code: &'static str,
    /// The dotted key, with the channel or the part.
    pub node: String,
    /// What is the case.
    pub message: String,
    /// What to change.
    pub mend: String,
}

/// Share of the noise of a row above which an output's LSB is said to hide what is before it.
const HIDES: f64 = 0.5;

/// All remarks, in the order of the circuit's steps.
pub fn remarks(design: &Design, nodes: &[NodeCheck], budget: &Budget) -> Vec<Remark> {
    let mut all = Vec::new();
    spurs(design, &mut all);
    for node in nodes {
        idle_bits(node, nodes, &mut all);
        biased_rounding(node, &mut all);
        dead_band(node, budget, &mut all);
        wraps(design, node, &mut all);
    }
    output(design, &mut all);
    if let Some((message, mend)) = excitation_is_off(design) {
        all.push(Remark {
            code: "excitation_off_resonance",
            node: "circuit.nco.tuning_word".to_owned(),
            message,
            mend,
        });
    }
    let is_of_chain = |c: &Compensation| c.input.is_of_chain();
    if design.compensation.as_ref().is_some_and(is_of_chain)
        && let Some((message, mend)) = full_scale_is_off(design)
    {
        all.push(Remark {
            code: "scale_factor",
            node: "compensation.rate_full_scale_dps".to_owned(),
            message,
            mend,
        });
    }
    if design.correction.is_some() {
        all.push(Remark {
            code: "correction_not_checked",
            node: "correction".to_owned(),
            message: "the design has a correction, and only its circuit and compensation are checked here".to_owned(),
            mend: "run `gyrogen close --verify`, which compares the correction's code with its model".to_owned(),
        });
    }
    all
}

/// Integer bits that no value of any word reaches that the same key gives its format to.
fn idle_bits(node: &NodeCheck, nodes: &[NodeCheck], all: &mut Vec<Remark>) {
    let like = |n: &&NodeCheck| key(&n.name) == key(&node.name) && n.format == node.format;
    let least = nodes.iter().filter(like).filter_map(|n| n.headroom_bits);
    let headroom = least.fold(f64::INFINITY, f64::min);
    if node.headroom_bits.is_none() || headroom < 1.0 - 1e-9 {
        return;
    }
    // Those of a table are its amplitude's; the magnitude's word is the engine's own.
    let has_format = [
        "circuit.demodulator",
        "circuit.decimator",
        "circuit.cordic.width",
        "compensation.",
    ];
    if !has_format.iter().any(|key| node.name.starts_with(key)) {
        return;
    }
    let idle = (headroom + 1e-9).floor() as u32;
    let fewer = match idle {
        1 => "take 1 bit fewer, which holds every value".to_owned(),
        _ => format!("take {idle} bits fewer, which hold every value"),
    };
    let mend = match node
        .format
        .strip_prefix('Q')
        .and_then(|f| f.split_once('.'))
    {
        Some((integer, fraction)) => match integer.parse::<u32>() {
            Ok(integer) if integer > idle => {
                format!(
                    "make it Q{}.{fraction}, which holds every value",
                    integer - idle
                )
            }
            _ => fewer,
        },
        None => fewer,
    };
    all.push(Remark {
        code: "idle_bits",
        node: node.name.clone(),
        message: format!(
            "its raw words go from {} to {} at most{} (proved). {} of {} {} needed",
            node.proved[0],
            node.proved[1],
            // `run` chooses formats with a factor of two to spare.
            match node.name.starts_with("compensation.") {
                true => " with these coefficients",
                false => "",
            },
            match idle {
                1 => "The highest bit".to_owned(),
                _ => format!("The {idle} highest bits"),
            },
            node.format,
            if idle == 1 { "is not" } else { "are not" }
        ),
        mend,
    });
}

/// Roundings whose mean is not 0.
fn biased_rounding(node: &NodeCheck, all: &mut Vec<Remark>) {
    let Some(rounding @ (Rounding::Floor | Rounding::Ceil | Rounding::TowardZero)) = node.rounding
    else {
        return;
    };
    let bias = node.budget.as_ref().and_then(|b| b.rate_mean_dps);
    let bias = match bias {
        Some(dps) => format!(
            ", which makes {dps} deg/s of the rate's bias",
            dps = number(dps, 3)
        ),
        None => String::new(),
    };
    all.push(Remark {
        code: "biased_rounding",
        node: node.name.clone(),
        message: format!(
            "`{}` is off by half an LSB in the mean{bias}",
            rounding.name()
        ),
        mend: "set `rounding = \"half_up\"`".to_owned(),
    });
}

/// Words whose input stands still.
fn dead_band(node: &NodeCheck, budget: &Budget, all: &mut Vec<Remark>) {
    if !budget.flags(&node.name).contains(&"idle_input") {
        return;
    }
    let is_decimated = node.name.starts_with("circuit.decimator.output");
    if !is_decimated {
        return;
    }
    all.push(Remark {
        code: "dead_band",
        node: node.name.clone(),
        message: "its input moves by less than an LSB from row to row. Every row is rounded the same way then, and an average of rows is \
                  no finer than an LSB"
            .to_owned(),
        mend: format!("give {} more fraction bits", key(&node.name)),
    });
}

/// Wrapping that is no turn of anything.
fn wraps(design: &Design, node: &NodeCheck, all: &mut Vec<Remark>) {
    if node.overflow != Overflows::Possible || node.mode != "wrap" {
        return;
    }
    let short = TooShort::of(design).filter(|_| node.name == vector_width::KEY);
    if let Some(short) = short {
        all.push(Remark {
            code: "wrap_possible",
            node: node.name.clone(),
            message: format!("{}. A word that wraps has the other sign", short.what()),
            mend: short.mend(),
        });
        return;
    }
    all.push(Remark {
        code: "wrap_possible",
        node: node.name.clone(),
        message: format!(
            "the proved range {} to {} does not fit {}, and a word that wraps has the other sign; it reaches {}",
            node.proved[0],
            node.proved[1],
            repair::format_of(design, key(&node.name)),
            node.path.join(" > ")
        ),
        mend: format!("give {} more bits", key(&node.name)),
    });
}

fn key(name: &str) -> &str {
    name.split_once(' ').map_or(name, |(key, _)| key)
}

/// Spurs of the oscillator that fold into the output's band.
fn spurs(design: &Design, all: &mut Vec<Remark>) {
    let spurs = nco_spurs(design);
    let Some(measured) = &spurs.measured else {
        return;
    };
    let tone = spurs.quadrature_tone_dps;
    let lsb = design
        .compensation
        .as_ref()
        .map_or(0.0, |c| c.output.format.lsb());
    if tone <= lsb || tone == 0.0 {
        return;
    }
    let worst = measured.sfdr_dbc.map_or(String::new(), |l| {
        format!(", the worst {:.1} dB below the carrier", l)
    });
    all.push(Remark {
        code: "spurs_in_band",
        node: "circuit.nco.table_address_bits".to_owned(),
        message: format!(
            "the oscillator has {} spurs{worst}; with the design's quadrature one is a tone of {tone} deg/s, more than an LSB of the output",
            measured.spurs
        , tone = number(tone, 3)),
        mend: "give the table more address bits and its entries more bits, or take a tuning word that ends in as many \
               zero bits as the phase has below the address"
            .to_owned(),
    });
}

/// An output LSB that is coarse beside what the fit knows or the gyro's noise.
fn output(design: &Design, all: &mut Vec<Remark>) {
    let Some(c) = &design.compensation else {
        return;
    };
    let lsb = c.output.format.lsb();
    // White noise over the band up to half the rows' rate.
    let noise = design.thermal_run.rate_noise_dps_rthz * (rows_per_s(design) / 2.0).sqrt();
    let fitted = c.fitted.as_ref().map(|f| f.std_max_dps);
    let (what, size) = match fitted {
        Some(std) if std > 0.0 && lsb > 2.0 * std => {
            ("the fitted bias is known to (one standard deviation)", std)
        }
        _ if noise > 0.0 && lsb / 12f64.sqrt() > HIDES * noise => {
            ("the gyro's noise of a row is", noise)
        }
        _ => return,
    };
    let more = (lsb / size).log2().ceil().max(1.0) as u32;
    all.push(Remark {
        code: "output_hides_fit",
        node: "compensation.output".to_owned(),
        message: format!(
            "an LSB of {} is {lsb} deg/s, and {what} {size} deg/s",
            c.output.format,
            lsb = number(lsb, 3),
            size = number(size, 3)
        ),
        mend: format!("give compensation.output {more} more fraction bits"),
    });
}
