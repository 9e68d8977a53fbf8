// {{ v.banner }}
// SPDX-License-Identifier: MIT OR Apache-2.0

//! Firmware in integers: no float, no heap, nothing that can panic.
//!
//! ```text
{% for line in v.facts %}//! {{ line }}
{% endfor %}//! ```
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]
// The words' widths and signs are proved where they are printed; every conversion between them is meant.
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
// A result has its name and its range first; `clamp` could panic.
#![allow(clippy::let_and_return, clippy::manual_clamp)]
// Numbers are printed as the model has them, and functions as long as the circuit's blocks are.
#![allow(clippy::unreadable_literal, clippy::too_many_lines)]
// Roundings are called as in the design: half_up.
#![allow(clippy::doc_markdown)]
// Names are the circuit's: `phase` beside `phases`, x, y and z.
#![allow(clippy::similar_names, clippy::many_single_char_names)]

{% for t in v.tables %}/// {{ t.note }}.
pub static {{ t.upper }}: [{{ t.ty }}; {{ t.len }}] = [
{% for line in t.lines %}    {{ line }}
{% endfor %}];

{% endfor %}{% for s in v.states %}/// State of `{{ s.name }}`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct {{ s.camel }} {
{% for x in s.variables %}    /// {{ s.meanings[loop.index0] }}.
    pub {{ x }},
{% endfor %}}

{% endfor %}{% for s in v.structs %}/// What `{{ s.name }}` returns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct {{ s.camel }}Out {
{% for x in s.members %}    /// {{ x.1 }}
    pub {{ x.0 }},
{% endfor %}}

{% endfor %}{% for c in v.checks %}/// Limits `a`; the first word outside is noted by its number.
fn check_{{ c }}(a: {{ c }}, low: {{ c }}, high: {{ c }}, number: u32, fault: &mut u32) -> {{ c }} {
    if (a < low || a > high) && *fault == 0 {
        *fault = number;
    }
    a.max(low).min(high)
}

{% endfor %}{% for f in v.functions %}/// {{ f.purpose }}
///
/// ```text
{% for line in f.notes %}/// {{ line }}
{% endfor %}{% if !f.outside.is_empty() %}/// {{ f.outside }}
{% endif %}/// ```
{{ f.definition }}
{% endfor %}{% if v.chain %}/// The chain with its sample counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Detector {
    /// Every block's state.
    pub chain: Chain,
    /// Samples of the decimation period at hand.
    pub count: u32,
    /// Number of the first overflow where the design says `error`; 0 = none.
    pub fault: u32,
}

impl Default for Detector {
    fn default() -> Self {
        Detector::new()
    }
}

impl Detector {
    /// Before the first sample.
    #[must_use]
    pub fn new() -> Self {
        #[allow(unused_mut)]
        let mut chain = Chain::default();
{% for i in v.initial %}        chain.{{ i }};
{% endfor %}        Detector {
            chain,
            count: 0,
            fault: 0,
        }
    }

    /// One ADC sample of both channels; a row after every {{ v.ratio }}.
    pub fn push(&mut self, drive: {{ v.code }}, sense: {{ v.code }}) -> Option<PeriodOut> {
        sample(&mut self.chain, drive, sense{% if v.sample_faults %}, &mut self.fault{% endif %});
        self.count = self.count.wrapping_add(1);
        if self.count < {{ v.ratio }} {
            return None;
        }
        self.count = 0;
        Some(period(&mut self.chain{% if v.period_faults %}, &mut self.fault{% endif %}))
    }
}

{% endif %}mod selftest;
pub use selftest::selftest;
