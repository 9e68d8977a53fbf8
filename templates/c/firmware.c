/* {{ banner }} */
#include "{{ p }}.h"
#include "{{ p }}_tables.h"

{% for f in functions %}{{ f.definition }}
{% endfor %}{% if chain %}void {{ p }}_init({{ p }}_t *g)
{
    static const {{ p }}_t zero = {0};
    *g = zero;
{% for i in initial %}    g->chain.{{ i }};
{% endfor %}}

bool {{ p }}_push({{ p }}_t *g, int32_t drive, int32_t sense, {{ p }}_period_out_t *row)
{
    {{ p }}_sample(&g->chain, drive, sense{% if sample_faults %}, &g->fault{% endif %});
    ++g->count;
    if (g->count < UINT32_C({{ ratio }})) {
        return false;
    }
    g->count = UINT32_C(0);
    *row = {{ p }}_period(&g->chain{% if period_faults %}, &g->fault{% endif %});
    return true;
}
{% endif %}
