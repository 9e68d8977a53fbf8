/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "{{ v.p }}_tables.h"

{% for t in v.tables %}const {{ t.ty }} {{ v.p }}_{{ t.name }}[{{ t.len }}] = {
{% for line in t.lines %}    {{ line }}
{% endfor %}};

{% endfor %}
