/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef {{ v.guard }}_TABLES_H
#define {{ v.guard }}_TABLES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

{% for t in v.tables %}/* {{ t.note }} */
extern const {{ t.ty }} {{ v.p }}_{{ t.name }}[{{ t.len }}];

{% endfor %}#ifdef __cplusplus
}
#endif

#endif
