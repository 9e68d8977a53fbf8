/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Each function runs on a stimulus from a linear congruential generator, laid over the ranges of its
 * inputs and of its state; the FNV-1a checksum of all outputs and of the state is compared with the model's.
 */
#include "{{ v.p }}.h"
{% if v.tables.len() > 0 %}#include "{{ v.p }}_tables.h"
{% endif %}
static uint64_t {{ v.p }}_mix(uint64_t h, uint64_t word)
{
    return (h ^ word) * UINT64_C(0x100000001b3);
}

{% if v.is_stimulated() %}static int64_t {{ v.p }}_stimulus(uint64_t *x, int64_t low, uint64_t span)
{
    *x = (*x * UINT64_C(6364136223846793005)) + UINT64_C(1442695040888963407);
    const uint64_t r = *x >> 1U;
    const uint64_t offset = (span == UINT64_MAX) ? r : (r % (span + UINT64_C(1)));
    return {{ v.p }}_sign_extend_64((uint64_t)low + offset, UINT64_C(1) << 63U);
}

{% endif %}uint32_t {{ v.p }}_selftest(void)
{
    const uint64_t basis = UINT64_C(0xcbf29ce484222325);
    uint64_t h = basis;
{% for t in v.tables %}
    for (uint32_t k = UINT32_C(0); k < UINT32_C({{ t.len }}); ++k) {
        h = {{ v.p }}_mix(h, (uint64_t)(int64_t){{ v.p }}_{{ t.name }}[k]);
    }
    if (h != UINT64_C({{ t.checksum }})) {
        return UINT32_C({{ t.number }}); /* table {{ t.name }} */
    }
    h = basis;
{% endfor %}{% for f in v.tests %}{% if f.alone %}
    {
        uint64_t x = UINT64_C({{ v.seed }});
{% if !f.state.is_empty() %}        {{ v.p }}_{{ f.state }}_t s;
{% endif %}{% if f.faults %}        uint32_t fault = UINT32_C(0);
{% endif %}        for (uint32_t k = UINT32_C(0); k < UINT32_C({{ v.draws }}); ++k) {
{% for d in f.drawn %}            {% if d.declared %}const {{ d.ty }} {% endif %}{{ d.target }} = ({{ d.ty }}){{ v.p }}_stimulus(&x, {{ d.low }}, {{ d.span }});
{% endfor %}            {% if !f.result.is_empty() %}const {{ f.result }} r = {% endif %}{{ v.p }}_{{ f.name }}({{ f.drawn_arguments }});
{% for o in f.words %}            h = {{ v.p }}_mix(h, {{ o }});
{% endfor %}        }
{% if f.faults %}        h = {{ v.p }}_mix(h, fault);
{% endif %}    }
    if (h != UINT64_C({{ f.checksum }})) {
        return UINT32_C({{ f.number }}); /* {{ f.name }} */
    }
    h = basis;
{% endif %}{% endfor %}{% if v.chain %}
    {
        {{ v.p }}_t g;
        {{ v.p }}_period_out_t row;
        uint64_t x = UINT64_C({{ v.seed }});
        {{ v.p }}_init(&g);
        for (uint32_t k = UINT32_C(0); k < UINT32_C({{ v.chain_count }}); ++k) {
            const {{ v.code }} drive = ({{ v.code }}){{ v.p }}_stimulus(&x, {{ v.code_low }}, {{ v.code_span }});
            const {{ v.code }} sense = ({{ v.code }}){{ v.p }}_stimulus(&x, {{ v.code_low }}, {{ v.code_span }});
            if ({{ v.p }}_push(&g, drive, sense, &row)) {
{% for o in v.row %}                h = {{ v.p }}_mix(h, {{ o }});
{% endfor %}                h = {{ v.p }}_mix(h, g.fault);
            }
        }
{% for o in v.chain_state %}        h = {{ v.p }}_mix(h, {{ o }});
{% endfor %}    }
    if (h != UINT64_C({{ v.chain_checksum }})) {
        return UINT32_C({{ v.chain_number }}); /* chain */
    }
{% endif %}{% if let Some(t) = v.stream %}
    {
        {{ v.p }}_{{ t.state }}_t s;
        uint64_t x = UINT64_C({{ v.seed }});
        {{ v.p }}_init(&s);
        for (uint32_t k = UINT32_C(0); k < UINT32_C({{ t.count }}); ++k) {
            const {{ t.function.inputs[0].ty }} a0 = ((k % UINT32_C({{ t.restart }})) == UINT32_C(0)) ? 1 : 0;
{% for i in t.function.inputs %}{% if !loop.first %}            const {{ i.ty }} a{{ loop.index0 }} = ({{ i.ty }}){{ v.p }}_stimulus(&x, {{ i.low }}, {{ i.span }});
{% endif %}{% endfor %}            const {{ t.function.result }} r = {{ v.p }}_{{ t.function.name }}(&s, {{ t.function.arguments }});
{% for o in t.function.outputs %}            h = {{ v.p }}_mix(h, {{ o }});
{% endfor %}        }
{% for o in t.final_state %}        h = {{ v.p }}_mix(h, {{ o }});
{% endfor %}    }
    if (h != UINT64_C({{ t.checksum }})) {
        return UINT32_C({{ t.number }}); /* {{ t.name }} */
    }
{% endif %}    return UINT32_C(0);
}
