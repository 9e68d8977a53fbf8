/* The least that a bundle's test driver needs where there is no C library: the emulator's Linux calls
 * for reading, writing and leaving, and a few functions. Not firmware: the firmware uses no library. */
#include <stdarg.h>
#include <stdint.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(__arm__)
#define CALL_READ 3L
#define CALL_WRITE 4L
#define CALL_EXIT 248L
__asm__(".syntax unified\n"
        ".thumb\n"
        ".text\n"
        ".global _start\n"
        ".thumb_func\n"
        ".type _start, %function\n"
        "_start:\n"
        "    mov r0, sp\n"
        "    bl runtime_start\n");

static long system_call(long number, long a, long b, long c)
{
    register long r0 __asm__("r0") = a;
    register long r1 __asm__("r1") = b;
    register long r2 __asm__("r2") = c;
    register long r7 __asm__("r7") = number;
    __asm__ volatile("svc #0" : "+r"(r0) : "r"(r1), "r"(r2), "r"(r7) : "memory");
    return r0;
}
#elif defined(__riscv)
#define CALL_READ 63L
#define CALL_WRITE 64L
#define CALL_EXIT 94L
__asm__(".text\n"
        ".global _start\n"
        ".type _start, %function\n"
        "_start:\n"
        "    .option push\n"
        "    .option norelax\n"
        "    la gp, __global_pointer$\n"
        "    .option pop\n"
        "    mv a0, sp\n"
        "    andi sp, sp, -16\n"
        "    call runtime_start\n");

static long system_call(long number, long a, long b, long c)
{
    register long a0 __asm__("a0") = a;
    register long a1 __asm__("a1") = b;
    register long a2 __asm__("a2") = c;
    register long a7 __asm__("a7") = number;
    __asm__ volatile("ecall" : "+r"(a0) : "r"(a1), "r"(a2), "r"(a7) : "memory");
    return a0;
}
#else
#error "no system calls for this processor"
#endif

int main(int argc, char **argv);
void runtime_start(long *stack) __attribute__((noreturn, used));

FILE runtime_streams[3] = {0, 1, 2};

static unsigned char input[4096];
static size_t input_at, input_end;
static unsigned char output[4096];
static size_t output_end;

static void flush(void)
{
    size_t done = 0U;
    while (done < output_end) {
        const long wrote = system_call(CALL_WRITE, 1L, (long)(uintptr_t)(output + done), (long)(output_end - done));
        if (wrote <= 0L) {
            break;
        }
        done += (size_t)wrote;
    }
    output_end = 0U;
}

void exit(int status)
{
    flush();
    for (;;) {
        (void)system_call(CALL_EXIT, (long)status, 0L, 0L);
    }
}

void runtime_start(long *stack)
{
    exit(main((int)stack[0], (char **)(stack + 1)));
}

size_t fread(void *to, size_t size, size_t count, FILE *from)
{
    unsigned char *bytes = to;
    const size_t total = size * count;
    (void)from;
    for (size_t k = 0U; k < total; ++k) {
        if (input_at == input_end) {
            const long got = system_call(CALL_READ, 0L, (long)(uintptr_t)input, (long)sizeof input);
            if (got <= 0L) {
                return k / size;
            }
            input_at = 0U;
            input_end = (size_t)got;
        }
        bytes[k] = input[input_at];
        ++input_at;
    }
    return count;
}

size_t fwrite(const void *from, size_t size, size_t count, FILE *to)
{
    const unsigned char *bytes = from;
    if (*to != 1) {
        return count;
    }
    for (size_t k = 0U; k < size * count; ++k) {
        if (output_end == sizeof output) {
            flush();
        }
        output[output_end] = bytes[k];
        ++output_end;
    }
    return count;
}

int setvbuf(FILE *stream, char *buffer, int mode, size_t size)
{
    (void)stream;
    (void)buffer;
    (void)mode;
    (void)size;
    return 0;
}

FILE *freopen(const char *path, const char *mode, FILE *stream)
{
    (void)path;
    (void)mode;
    (void)stream;
    return NULL;
}

static void put_text(const char *text)
{
    for (; *text != '\0'; ++text) {
        (void)fwrite(text, 1U, 1U, stdout);
    }
}

static void put_number(unsigned long value)
{
    char digits[24];
    char *at = digits + sizeof digits - 1;
    *at = '\0';
    do {
        --at;
        *at = (char)('0' + (char)(value % 10UL));
        value /= 10UL;
    } while (value != 0UL);
    put_text(at);
}

int printf(const char *format, ...)
{
    va_list list;
    va_start(list, format);
    for (; *format != '\0'; ++format) {
        if ((format[0] == '%') && (format[1] == 's')) {
            put_text(va_arg(list, const char *));
            ++format;
        } else if ((format[0] == '%') && (format[1] == 'l') && (format[2] == 'u')) {
            put_number(va_arg(list, unsigned long));
            format += 2;
        } else {
            (void)fwrite(format, 1U, 1U, stdout);
        }
    }
    va_end(list);
    return 0;
}

int fprintf(FILE *to, const char *format, ...)
{
    (void)to;
    (void)format;
    return 0;
}

int strcmp(const char *a, const char *b)
{
    while ((*a != '\0') && (*a == *b)) {
        ++a;
        ++b;
    }
    return (int)(unsigned char)*a - (int)(unsigned char)*b;
}

/* Volatile, or the compiler makes a call of memcpy to itself of the loop. */
void *memcpy(void *to, const void *from, size_t size)
{
    volatile unsigned char *t = to;
    const unsigned char *f = from;
    for (size_t k = 0U; k < size; ++k) {
        t[k] = f[k];
    }
    return to;
}

void *memset(void *to, int value, size_t size)
{
    volatile unsigned char *t = to;
    for (size_t k = 0U; k < size; ++k) {
        t[k] = (unsigned char)value;
    }
    return to;
}

long long strtoll(const char *text, char **end, int base)
{
    const int negative = (*text == '-');
    unsigned long long value = 0ULL;
    (void)end;
    (void)base;
    if (negative) {
        ++text;
    }
    for (; (*text >= '0') && (*text <= '9'); ++text) {
        value = value * 10ULL + (unsigned long long)(*text - '0');
    }
    return (long long)(negative ? (0ULL - value) : value);
}
