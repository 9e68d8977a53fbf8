/* {{ banner }} */
#include "{{ p }}_tables.h"

{% for t in tables %}const {{ t.ty }} {{ p }}_{{ t.name }}[{{ t.len }}] = {
{% for line in t.lines %}    {{ line }}
{% endfor %}};

{% endfor %}
