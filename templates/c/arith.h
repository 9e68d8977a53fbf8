/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Integer helpers with defined behaviour on every C99 target: floor shifts, sign extension,
 * limits, and 128-bit words for the few values that need more than 64 bits.
 */
#ifndef {{ v.guard }}_ARITH_H
#define {{ v.guard }}_ARITH_H

#include <stdbool.h>
#include <stdint.h>

/* The exact-width types exist only where they are two's complement without padding (C99 7.18.1.1). */
#if !defined(INT32_MAX) || !defined(INT64_MAX)
#error "this code needs int32_t and int64_t"
#endif

{% for w in [32, 64] %}
/* The word with these bits. Compilers make nothing of it. */
static inline int{{ w }}_t {{ v.p }}_word_{{ w }}(uint{{ w }}_t bits)
{
    return (bits <= (uint{{ w }}_t)INT{{ w }}_MAX) ? (int{{ w }}_t)bits
                                          : ((-(int{{ w }}_t)(UINT{{ w }}_MAX - bits)) - 1);
}

/* floor(a / 2^n), n < {{ w - 1 }}. Where n is a constant, compilers make one arithmetic shift of it. */
static inline int{{ w }}_t {{ v.p }}_asr_{{ w }}(int{{ w }}_t a, uint32_t n)
{
    const int{{ w }}_t unit = (int{{ w }}_t)(UINT{{ w }}_C(1) << n);
    return (a >= 0) ? (a / unit) : ((-1) - (((-1) - a) / unit));
}

/* The same where n < {{ w }} is not a constant: of a word below zero the complement is shifted. */
static inline int{{ w }}_t {{ v.p }}_asr_by_{{ w }}(int{{ w }}_t a, uint32_t n)
{
    return (a >= 0) ? (int{{ w }}_t)((uint{{ w }}_t)a >> n)
                    : ((-1) - (int{{ w }}_t)((uint{{ w }}_t)((-1) - a) >> n));
}

/* The bits up to and with `sign` as a two's-complement number. */
static inline int{{ w }}_t {{ v.p }}_sign_extend_{{ w }}(uint{{ w }}_t a, uint{{ w }}_t sign)
{
    const uint{{ w }}_t low = a & ((sign - UINT{{ w }}_C(1)) | sign);
    return {{ v.p }}_word_{{ w }}((low ^ sign) - sign);
}

static inline int{{ w }}_t {{ v.p }}_clamp_{{ w }}(int{{ w }}_t a, int{{ w }}_t low, int{{ w }}_t high)
{
    return (a < low) ? low : ((a > high) ? high : a);
}

/* As clamp; the first word outside is noted by its number. */
static inline int{{ w }}_t {{ v.p }}_check_{{ w }}(int{{ w }}_t a, int{{ w }}_t low, int{{ w }}_t high,
                                      uint32_t number, uint32_t *fault)
{
    if (((a < low) || (a > high)) && (*fault == UINT32_C(0))) {
        *fault = number;
    }
    return {{ v.p }}_clamp_{{ w }}(a, low, high);
}
{% endfor %}
{% if v.wide %}
/* 128-bit two's-complement words. */
typedef struct {
    uint64_t hi;
    uint64_t lo;
} {{ v.p }}_w128_t;

static inline {{ v.p }}_w128_t {{ v.p }}_w128_make(uint64_t hi, uint64_t lo)
{
    {{ v.p }}_w128_t r;
    r.hi = hi;
    r.lo = lo;
    return r;
}

static inline bool {{ v.p }}_w128_is_negative({{ v.p }}_w128_t a)
{
    return (a.hi >> 63U) != UINT64_C(0);
}

static inline {{ v.p }}_w128_t {{ v.p }}_w128_from_s64(int64_t a)
{
    return {{ v.p }}_w128_make((a < 0) ? UINT64_MAX : UINT64_C(0), (uint64_t)a);
}

/* The low word; for values that fit. */
static inline int64_t {{ v.p }}_w128_to_s64({{ v.p }}_w128_t a)
{
    return {{ v.p }}_sign_extend_64(a.lo, UINT64_C(1) << 63U);
}

static inline {{ v.p }}_w128_t {{ v.p }}_w128_add({{ v.p }}_w128_t a, {{ v.p }}_w128_t b)
{
    const uint64_t lo = a.lo + b.lo;
    const uint64_t carry = (lo < a.lo) ? UINT64_C(1) : UINT64_C(0);
    return {{ v.p }}_w128_make(a.hi + b.hi + carry, lo);
}

static inline {{ v.p }}_w128_t {{ v.p }}_w128_neg({{ v.p }}_w128_t a)
{
    return {{ v.p }}_w128_add({{ v.p }}_w128_make(~a.hi, ~a.lo), {{ v.p }}_w128_make(UINT64_C(0), UINT64_C(1)));
}

static inline {{ v.p }}_w128_t {{ v.p }}_w128_sub({{ v.p }}_w128_t a, {{ v.p }}_w128_t b)
{
    return {{ v.p }}_w128_add(a, {{ v.p }}_w128_neg(b));
}

/* The low 128 bits of the product, from 32-bit digits. */
static inline {{ v.p }}_w128_t {{ v.p }}_w128_mul({{ v.p }}_w128_t a, {{ v.p }}_w128_t b)
{
    const uint64_t mask = UINT64_C(0xFFFFFFFF);
    const uint64_t a0 = a.lo & mask;
    const uint64_t a1 = a.lo >> 32U;
    const uint64_t b0 = b.lo & mask;
    const uint64_t b1 = b.lo >> 32U;
    const uint64_t p00 = a0 * b0;
    const uint64_t p01 = a0 * b1;
    const uint64_t p10 = a1 * b0;
    const uint64_t middle = (p00 >> 32U) + (p01 & mask) + (p10 & mask);
    const uint64_t lo = (p00 & mask) | (middle << 32U);
    const uint64_t hi = (a1 * b1) + (p01 >> 32U) + (p10 >> 32U) + (middle >> 32U);
    return {{ v.p }}_w128_make(hi + (a.hi * b.lo) + (a.lo * b.hi), lo);
}

static inline {{ v.p }}_w128_t {{ v.p }}_w128_shl({{ v.p }}_w128_t a, uint32_t n)
{
    if (n == 0U) {
        return a;
    }
    if (n >= 64U) {
        return {{ v.p }}_w128_make(a.lo << (n - 64U), UINT64_C(0));
    }
    return {{ v.p }}_w128_make((a.hi << n) | (a.lo >> (64U - n)), a.lo << n);
}

/* a / 2^n with `fill` entering from above; n < 128. */
static inline {{ v.p }}_w128_t {{ v.p }}_w128_shift_in({{ v.p }}_w128_t a, uint32_t n, uint64_t fill)
{
    if (n == 0U) {
        return a;
    }
    if (n == 64U) {
        return {{ v.p }}_w128_make(fill, a.hi);
    }
    if (n > 64U) {
        return {{ v.p }}_w128_make(fill, (a.hi >> (n - 64U)) | (fill << (128U - n)));
    }
    return {{ v.p }}_w128_make((a.hi >> n) | (fill << (64U - n)), (a.lo >> n) | (a.hi << (64U - n)));
}

static inline {{ v.p }}_w128_t {{ v.p }}_w128_shr({{ v.p }}_w128_t a, uint32_t n)
{
    return {{ v.p }}_w128_shift_in(a, n, UINT64_C(0));
}

static inline {{ v.p }}_w128_t {{ v.p }}_w128_asr({{ v.p }}_w128_t a, uint32_t n)
{
    return {{ v.p }}_w128_shift_in(a, n, {{ v.p }}_w128_is_negative(a) ? UINT64_MAX : UINT64_C(0));
}

/* a modulo 2^n, n < 128. */
static inline {{ v.p }}_w128_t {{ v.p }}_w128_mask({{ v.p }}_w128_t a, uint32_t n)
{
    return (n >= 64U) ? {{ v.p }}_w128_make(a.hi & ((UINT64_C(1) << (n - 64U)) - UINT64_C(1)), a.lo)
                      : {{ v.p }}_w128_make(UINT64_C(0), a.lo & ((UINT64_C(1) << n) - UINT64_C(1)));
}

/* The low n bits as a two's-complement number, 0 < n <= 128. */
static inline {{ v.p }}_w128_t {{ v.p }}_w128_sign_extend({{ v.p }}_w128_t a, uint32_t n)
{
    return {{ v.p }}_w128_asr({{ v.p }}_w128_shl(a, 128U - n), 128U - n);
}

static inline bool {{ v.p }}_w128_less({{ v.p }}_w128_t a, {{ v.p }}_w128_t b)
{
    const uint64_t top = UINT64_C(1) << 63U;
    return ((a.hi ^ top) < (b.hi ^ top)) || ((a.hi == b.hi) && (a.lo < b.lo));
}

static inline {{ v.p }}_w128_t {{ v.p }}_clamp_128({{ v.p }}_w128_t a, {{ v.p }}_w128_t low, {{ v.p }}_w128_t high)
{
    return {{ v.p }}_w128_less(a, low) ? low : ({{ v.p }}_w128_less(high, a) ? high : a);
}

static inline {{ v.p }}_w128_t {{ v.p }}_check_128({{ v.p }}_w128_t a, {{ v.p }}_w128_t low, {{ v.p }}_w128_t high,
                                       uint32_t number, uint32_t *fault)
{
    if (({{ v.p }}_w128_less(a, low) || {{ v.p }}_w128_less(high, a)) && (*fault == UINT32_C(0))) {
        *fault = number;
    }
    return {{ v.p }}_clamp_128(a, low, high);
}
{% endif %}
#endif
