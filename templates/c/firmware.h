/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
{% for line in v.facts %} * {{ line }}
{% endfor %} */
#ifndef {{ v.guard }}_H
#define {{ v.guard }}_H

#include <stdbool.h>
#include <stdint.h>

#include "{{ v.p }}_arith.h"

#ifdef __cplusplus
extern "C" {
#endif

{% for s in v.states %}typedef struct {
{% for x in s.variables %}    {{ x }}; /* {{ s.meanings[loop.index0] }} */
{% endfor %}} {{ v.p }}_{{ s.name }}_t;

{% endfor %}{% for s in v.structs %}/* What {{ v.p }}_{{ s.name }} returns. */
typedef struct {
{% for x in s.members %}    {{ x.0 }}; /* {{ x.1 }} */
{% endfor %}} {{ v.p }}_{{ s.name }}_out_t;

{% endfor %}{% for f in v.functions %}{% if !f.internal %}/* {{ f.name }}: {{ f.purpose }}
{% for line in f.notes %} *   {{ line }}
{% endfor %}{% if !f.outside.is_empty() %} *   {{ f.outside }}
{% endif %} */
{{ f.declaration }};

{% endif %}{% endfor %}{% if v.chain %}/* The chain with its sample counter. */
typedef struct {
    {{ v.p }}_chain_t chain;
    uint32_t count; /* samples of the decimation period at hand */
    uint32_t fault; /* number of the first overflow where the design says `error`; 0 = none */
} {{ v.p }}_t;

/* Before the first sample. */
void {{ v.p }}_init({{ v.p }}_t *g);

/* One ADC sample of both channels; true when `row` holds a new decimated sample (every {{ v.ratio }}). */
bool {{ v.p }}_push({{ v.p }}_t *g, {{ v.code }} drive, {{ v.code }} sense, {{ v.p }}_period_out_t *row);

{% endif %}{% if let Some(t) = v.stream %}/* The state before the first reading: zeros. */
void {{ v.p }}_init({{ v.p }}_{{ t.state }}_t *s);

{% endif %}/* Start-up check: 0 = every function gives the model's bits on the built-in stimulus; otherwise the
 * number of the first function that does not, counted as in the manifest. Stack only. */
uint32_t {{ v.p }}_selftest(void);

#ifdef __cplusplus
}
#endif

#endif
