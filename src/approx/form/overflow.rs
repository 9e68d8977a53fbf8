//! Whether an intermediate format can overflow: decided by ranges, and where these are not enough by running
//! every code.

use super::{Form, Settled};
use crate::error::{InputError, Result};
use crate::numeric::arithmetic::Block;
use crate::numeric::cast::{Cast, Label};
use crate::numeric::fixed::Fixed;
use crate::numeric::format::Overflow;
use crate::numeric::trace::ir::Interval;

/// The cast whose limits are the output's own: a result outside them is limited, and counted as error.
const OUTPUT: &str = "output";

/// Refuses a form in which a word other than the result can exceed its format.
///
/// # Errors
/// The node, the first input at which it overflows, and the integer bits that it needs.
pub fn refuse(settled: &Settled, most_codes: u128) -> Result<()> {
    let mut form = settled.form.clone();
    let casts = form.casts_mut();
    let suspects = casts.iter().filter(|c| settled.unproved.contains(&c.id));
    let suspects: Vec<Label> = suspects
        .map(|c| c.label)
        .filter(|l| l.key != OUTPUT)
        .collect();
    let Some(first) = suspects.first() else {
        return Ok(());
    };
    let codes = settled.form.codes();
    if codes.count() > most_codes {
        return Err(InputError::new(format!(
            "{first} may overflow: ranges do not exclude it, and there are too many codes to run all"
        ))
        .help("give `--intermediate` more integer bits, or leave it out to have it chosen")
        .into());
    }
    for cast in casts {
        if cast.label.key != OUTPUT {
            *cast = reporting(cast);
        }
    }
    let mut worst: Option<(Label, i128, i32, i128)> = None;
    for code in codes.low..=codes.high {
        let Some((label, value, fraction_bits)) = run(&form, code) else {
            continue;
        };
        let bits = |v: i128| Interval::point(v).bits();
        if worst.is_none_or(|(_, other, ..)| bits(value) > bits(other)) {
            worst = Some((label, value, fraction_bits, code));
        }
    }
    let Some((label, value, fraction_bits, code)) = worst else {
        return Ok(());
    };
    let needed = Interval::point(value).bits() as i32 - fraction_bits;
    Err(InputError::new(format!(
        "{label} overflows its format: at input {code} it is {value} in LSB"
    ))
    .help(format!(
        "it needs {needed} integer bits, the sign among them: `--intermediate Q{needed}.{fraction_bits}`"
    ))
    .into())
}

/// The same cast, with a report where the word is outside the limits.
fn reporting(cast: &Cast) -> Cast {
    let from = cast.shift + cast.gain + cast.target.fraction_bits;
    let overflow = cast.overflow.map(|_| Overflow::Error);
    let mut made = Cast::new(
        cast.label,
        from,
        cast.gain,
        cast.target,
        cast.rounding,
        overflow,
    );
    made.id = cast.id;
    made
}

fn run(form: &Form, code: i128) -> Option<(Label, i128, i32)> {
    let ar = Fixed::<i128, i128>::new();
    let _: [i128; 1] = Block::<_, 1, 1>::step(form, &ar, &mut (), [code]);
    let overflow = ar.overflowed()?;
    let mut form = form.clone();
    let casts = form.casts_mut();
    let cast = casts.into_iter().find(|c| c.id == overflow.cast)?;
    Some((overflow.label, overflow.value, cast.target.fraction_bits))
}
