/* {{ v.banner }} */
#include "{{ v.p }}_tables.h"

{% for t in v.tables %}const {{ t.ty }} {{ v.p }}_{{ t.name }}[{{ t.len }}] = {
{% for line in t.lines %}    {{ line }}
{% endfor %}};

{% endfor %}
