/* {{ banner }}
 *
{% for line in facts %} * {{ line }}
{% endfor %} */
#ifndef {{ guard }}_H
#define {{ guard }}_H

#include <stdbool.h>
#include <stdint.h>

#include "{{ p }}_arith.h"

{% for s in states %}typedef struct {
{% for v in s.variables %}    {{ v }};
{% endfor %}} {{ p }}_{{ s.name }}_t;

{% endfor %}{% for s in structs %}/* What {{ p }}_{{ s.name }} returns. */
typedef struct {
{% for v in s.members %}    {{ v.0 }}; /* {{ v.1 }} */
{% endfor %}} {{ p }}_{{ s.name }}_out_t;

{% endfor %}{% for f in functions %}/* {{ f.name }}
{% for line in f.notes %} *   {{ line }}
{% endfor %} */
{{ f.declaration }};

{% endfor %}{% if chain %}/* The chain with its sample counter. */
typedef struct {
    {{ p }}_chain_t chain;
    uint32_t count; /* samples of the decimation period at hand */
    uint32_t fault; /* number of the first overflow where the design says `error`; 0 = none */
} {{ p }}_t;

/* Before the first sample. */
void {{ p }}_init({{ p }}_t *g);

/* One ADC sample of both channels; true when `row` holds a new decimated sample (every {{ ratio }}). */
bool {{ p }}_push({{ p }}_t *g, int32_t drive, int32_t sense, {{ p }}_period_out_t *row);

{% endif %}/* Start-up check: 0 = every function gives the model's bits on the built-in stimulus; otherwise the
 * number of the first function that does not, counted as in the manifest. Stack only. */
uint32_t {{ p }}_selftest(void);

#endif
