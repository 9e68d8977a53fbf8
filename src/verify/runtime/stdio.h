/* What a bundle's test driver uses of <stdio.h>. */
#ifndef RUNTIME_STDIO_H
#define RUNTIME_STDIO_H

#include <stddef.h>

typedef int FILE;
extern FILE runtime_streams[3];
#define stdin (&runtime_streams[0])
#define stdout (&runtime_streams[1])
#define stderr (&runtime_streams[2])
#define _IOFBF 0

size_t fread(void *to, size_t size, size_t count, FILE *from);
size_t fwrite(const void *from, size_t size, size_t count, FILE *to);
int setvbuf(FILE *stream, char *buffer, int mode, size_t size);
/* There are no files: always NULL. */
FILE *freopen(const char *path, const char *mode, FILE *stream);
/* %s and %lu only. */
int printf(const char *format, ...);
int fprintf(FILE *to, const char *format, ...);

#endif
