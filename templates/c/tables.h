/* {{ banner }} */
#ifndef {{ guard }}_TABLES_H
#define {{ guard }}_TABLES_H

#include <stdint.h>

{% for t in tables %}/* {{ t.note }} */
extern const {{ t.ty }} {{ p }}_{{ t.name }}[{{ t.len }}];

{% endfor %}#endif
