/* What a bundle's test driver uses of <inttypes.h>. */
#ifndef RUNTIME_INTTYPES_H
#define RUNTIME_INTTYPES_H

#include <stdint.h>

#define PRIu32 "lu"

#endif
