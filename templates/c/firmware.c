/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "{{ v.p }}.h"
#include "{{ v.p }}_tables.h"

{% for f in v.functions %}{% if f.internal %}/* {{ f.name }}: {{ f.purpose }}
{% for line in f.notes %} *   {{ line }}
{% endfor %} */
static {% endif %}{{ f.definition }}
{% endfor %}{% if v.chain %}void {{ v.p }}_init({{ v.p }}_t *g)
{
    static const {{ v.p }}_t zero = {0};
    *g = zero;
{% for i in v.initial %}    g->chain.{{ i }};
{% endfor %}}

bool {{ v.p }}_push({{ v.p }}_t *g, {{ v.code }} drive, {{ v.code }} sense, {{ v.p }}_period_out_t *row)
{
    {{ v.p }}_sample(&g->chain, drive, sense{% if v.sample_faults %}, &g->fault{% endif %});
    ++g->count;
    if (g->count < UINT32_C({{ v.ratio }})) {
        return false;
    }
    g->count = UINT32_C(0);
    *row = {{ v.p }}_period(&g->chain{% if v.period_faults %}, &g->fault{% endif %});
    return true;
}
{% endif %}{% if let Some(t) = v.stream %}void {{ v.p }}_init({{ v.p }}_{{ t.state }}_t *s)
{
    static const {{ v.p }}_{{ t.state }}_t zero = {0};
    *s = zero;
}
{% endif %}
