/* {{ banner }}
 *
 * Each function runs on a stimulus from a linear congruential generator, laid over its input range;
 * the outputs' FNV-1a checksum is compared with the model's.
 */
#include "{{ p }}.h"
{% if tables.len() > 0 %}#include "{{ p }}_tables.h"
{% endif %}
static uint64_t {{ p }}_mix(uint64_t h, uint64_t word)
{
    return (h ^ word) * UINT64_C(0x100000001b3);
}

{% if stimulated %}static int64_t {{ p }}_stimulus(uint64_t *x, int64_t low, uint64_t span)
{
    *x = (*x * UINT64_C(6364136223846793005)) + UINT64_C(1442695040888963407);
    const uint64_t r = *x >> 1U;
    const uint64_t offset = (span == UINT64_MAX) ? r : (r % (span + UINT64_C(1)));
    return {{ p }}_sign_extend_64((uint64_t)low + offset, UINT64_C(1) << 63U);
}

{% endif %}uint32_t {{ p }}_selftest(void)
{
    const uint64_t basis = UINT64_C(0xcbf29ce484222325);
    uint64_t h = basis;
{% for t in tables %}
    for (uint32_t k = UINT32_C(0); k < UINT32_C({{ t.len }}); ++k) {
        h = {{ p }}_mix(h, (uint64_t)(int64_t){{ p }}_{{ t.name }}[k]);
    }
    if (h != UINT64_C({{ t.checksum }})) {
        return UINT32_C({{ t.number }}); /* table {{ t.name }} */
    }
    h = basis;
{% endfor %}{% for f in functions %}
    {
        uint64_t x = UINT64_C({{ seed }});
{% if f.faults %}        uint32_t fault = UINT32_C(0);
{% endif %}        for (uint32_t k = UINT32_C(0); k < UINT32_C({{ f.count }}); ++k) {
{% for i in f.inputs %}            const {{ i.ty }} a{{ loop.index0 }} = ({{ i.ty }}){{ p }}_stimulus(&x, {{ i.low }}, {{ i.span }});
{% endfor %}            const {{ f.result }} r = {{ p }}_{{ f.name }}({{ f.arguments }});
{% for o in f.outputs %}            h = {{ p }}_mix(h, {{ o }});
{% endfor %}        }
    }
    if (h != UINT64_C({{ f.checksum }})) {
        return UINT32_C({{ f.number }}); /* {{ f.name }} */
    }
    h = basis;
{% endfor %}{% if chain %}
    {
        {{ p }}_t g;
        {{ p }}_period_out_t row;
        uint64_t x = UINT64_C({{ seed }});
        {{ p }}_init(&g);
        for (uint32_t k = UINT32_C(0); k < UINT32_C({{ chain_count }}); ++k) {
            const int32_t drive = (int32_t){{ p }}_stimulus(&x, {{ code_low }}, {{ code_span }});
            const int32_t sense = (int32_t){{ p }}_stimulus(&x, {{ code_low }}, {{ code_span }});
            if ({{ p }}_push(&g, drive, sense, &row)) {
{% for o in row %}                h = {{ p }}_mix(h, {{ o }});
{% endfor %}            }
        }
    }
    if (h != UINT64_C({{ chain_checksum }})) {
        return UINT32_C({{ chain_number }}); /* chain */
    }
{% endif %}    return UINT32_C(0);
}
