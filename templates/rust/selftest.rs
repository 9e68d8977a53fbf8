// {{ v.banner }}
// SPDX-License-Identifier: MIT OR Apache-2.0
//
// Each function runs on a stimulus from a linear congruential generator, laid over the ranges of its
// inputs and of its state; the FNV-1a checksum of all outputs and of the state is compared with the model's.
// It calls all that the crate has.
#[allow(clippy::wildcard_imports)]
use super::*;

/// One step of the checksum.
fn mix(h: u64, word: u64) -> u64 {
    (h ^ word).wrapping_mul(0x100_0000_01b3)
}

{% if v.is_stimulated() %}/// The next word of the self-test's stimulus.
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
{% endfor %}{% for f in v.tests %}{% if f.alone %}    {
        let mut h = BASIS;
        let mut x = {{ v.seed }}_u64;
{% if !f.state.is_empty() %}        let mut s = {{ f.state }}::default();
{% endif %}{% if f.faults %}        let mut fault = 0_u32;
{% endif %}        for _ in 0..{{ v.draws }}_u32 {
{% for d in f.drawn %}            {% if d.declared %}let {% endif %}{{ d.target }} = stimulus(&mut x, {{ d.low }}, {{ d.span }}) as {{ d.ty }};
{% endfor %}            {% if !f.result.is_empty() %}let r = {% endif %}{{ f.name }}({{ f.drawn_arguments }});
{% for o in f.words %}            h = mix(h, {{ o }});
{% endfor %}        }
{% if f.faults %}        h = mix(h, u64::from(fault));
{% endif %}        if h != {{ f.checksum }} {
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
{% endfor %}                h = mix(h, u64::from(g.fault));
            }
        }
{% for o in v.chain_state %}        h = mix(h, {{ o }});
{% endfor %}        if h != {{ v.chain_checksum }} {
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
{% for o in t.final_state %}        h = mix(h, {{ o }});
{% endfor %}        if h != {{ t.checksum }} {
            return {{ t.number }}; // {{ t.name }}
        }
    }
{% endif %}    0
}
