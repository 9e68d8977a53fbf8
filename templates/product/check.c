/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Host-side check, not firmware: codes -> push -> convert -> correct, {{ v.samples }} samples. Exit status 0 if all
 * words of the conversion after every row, every corrected rate and the chain's fault are the model's (by a checksum).
 */
#include "{{ v.p }}.h"
#include "{{ v.p }}_conversion.h"
#include "{{ v.p }}_correction.h"

static uint64_t mix(uint64_t h, uint64_t word)
{
    return (h ^ word) * UINT64_C(0x100000001b3);
}

/* A triangle over the ADC's range. */
static {{ v.code }} code(uint32_t turn)
{
    const uint32_t up = turn * 2U;
    const uint64_t place = ((turn >> 31U) == 0U) ? up : (uint32_t)~up;
    return ({{ v.code }})({{ v.code_low }} + (int64_t)(({{ v.code_span }} * place) >> 32U));
}

int main(void)
{
    static {{ v.p }}_t g;
    static {{ v.p }}_conversion_{{ v.sums }}_t sums;
    static {{ v.p }}_correction_{{ v.state }}_t state;
    {{ v.p }}_period_out_t row;
    uint64_t h = UINT64_C(0xcbf29ce484222325);
    uint64_t reading = 0U;
    uint32_t turn = 0U;
    {{ v.p }}_init(&g);
    {{ v.p }}_conversion_init(&sums);
    {{ v.p }}_correction_init(&state);
    for (uint64_t n = 0U; n < UINT64_C({{ v.samples }}); ++n) {
        turn += UINT32_C({{ v.step }});
        if (!{{ v.p }}_push(&g, code(turn), code(turn + UINT32_C({{ v.lead }})), &row)) {
            continue;
        }
        const {{ v.p }}_conversion_convert_out_t words = {{ v.p }}_conversion_convert(&sums, 0{% for a in v.row %}, {{ a }}{% endfor %});
{% for w in v.words %}        h = mix(h, (uint64_t)(int64_t)words.{{ w }});
{% endfor %}        if (words.complete != 0) {
            const int64_t rate = {{ v.p }}_correction_correct(&state, (reading == 0U) ? 1 : 0{% for i in v.inputs %},
                {% if i.own %}{{ i.argument }}{% else %}({{ i.ty }})({{ i.low }} + (int64_t)(((reading * {{ v.stride }}U) + {{ i.start }}U) % UINT64_C({{ i.count }}))){% endif %}{% endfor %},
                {{ v.rate }});
            h = mix(h, (uint64_t)rate);
            ++reading;
        }
    }
    h = mix(h, g.fault);
    return (h == UINT64_C({{ v.checksum }})) ? 0 : 1;
}
