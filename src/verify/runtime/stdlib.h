/* What a bundle's test driver uses of <stdlib.h>. */
#ifndef RUNTIME_STDLIB_H
#define RUNTIME_STDLIB_H

void exit(int status) __attribute__((noreturn));
/* Decimal only. */
long long strtoll(const char *text, char **end, int base);

#endif
