// {{ v.banner }}

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

{% endfor %}{% for f in v.functions %}/// The block `{{ f.name }}`.
///
/// ```text
{% for line in f.notes %}/// {{ line }}
{% endfor %}/// ```
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

{% endif %}/// One step of the checksum.
fn mix(h: u64, word: u64) -> u64 {
    (h ^ word).wrapping_mul(0x100_0000_01b3)
}

{% if v.stimulated %}/// The next word of the self-test's stimulus.
fn stimulus(x: &mut u64, low: i64, span: u64) -> i64 {
    *x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let r = *x >> 1;
    let offset = match span.checked_add(1) {
        Some(n) => r.checked_rem(n).unwrap_or(0),
        None => r,
    };
    (low as u64).wrapping_add(offset) as i64
}

{% endif %}/// Start-up check: 0 = every function gives the model's bits on the built-in stimulus; otherwise the
/// number of the first function that does not, counted as in the manifest.
#[must_use]
pub fn selftest() -> u32 {
    const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
{% for t in v.tables %}    if {{ t.upper }}.iter().fold(BASIS, |h, v| mix(h, i64::from(*v) as u64)) != {{ t.checksum }} {
        return {{ t.number }}; // table {{ t.name }}
    }
{% endfor %}{% for f in v.functions %}{% if f.tested %}    {
        let mut h = BASIS;
        let mut x = {{ v.seed }}_u64;
{% if f.faults %}        let mut fault = 0_u32;
{% endif %}        for _ in 0..{{ f.count }}_u32 {
{% for i in f.inputs %}            let a{{ loop.index0 }} = stimulus(&mut x, {{ i.low }}, {{ i.span }}) as {{ i.ty }};
{% endfor %}            let r = {{ f.name }}({{ f.arguments }});
{% for o in f.outputs %}            h = mix(h, {{ o }});
{% endfor %}        }
        if h != {{ f.checksum }} {
            return {{ f.number }}; // {{ f.name }}
        }
    }
{% endif %}{% endfor %}{% if v.chain %}    {
        let mut h = BASIS;
        let mut x = {{ v.seed }}_u64;
        let mut g = Detector::new();
        for _ in 0..{{ v.chain_count }}_u32 {
            let drive = stimulus(&mut x, {{ v.code_low }}, {{ v.code_span }}) as {{ v.code }};
            let sense = stimulus(&mut x, {{ v.code_low }}, {{ v.code_span }}) as {{ v.code }};
            if let Some(row) = g.push(drive, sense) {
{% for o in v.row %}                h = mix(h, {{ o }});
{% endfor %}            }
        }
        if h != {{ v.chain_checksum }} {
            return {{ v.chain_number }}; // chain
        }
    }
{% endif %}{% if let Some(t) = v.stream %}    {
        let mut h = BASIS;
        let mut x = {{ v.seed }}_u64;
        let mut s = {{ t.camel }}::default();
        for k in 0..{{ t.count }}_u32 {
            let a0 = {{ t.function.inputs[0].ty }}::from(k % {{ t.restart }} == 0);
{% for i in t.function.inputs %}{% if !loop.first %}            let a{{ loop.index0 }} = stimulus(&mut x, {{ i.low }}, {{ i.span }}) as {{ i.ty }};
{% endif %}{% endfor %}            let r = {{ t.function.name }}(&mut s, {{ t.function.arguments }});
{% for o in t.function.outputs %}            h = mix(h, {{ o }});
{% endfor %}        }
        if h != {{ t.checksum }} {
            return {{ t.number }}; // {{ t.function.name }}
        }
    }
{% endif %}    0
}
