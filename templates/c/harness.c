/* {{ v.banner }}
 * SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Host-side driver, not firmware. Words are native int64, a wider one is its low and its high half; a
 * record is a function's outputs, its state after the call and the number of the fault (0 = none).
 *
 *   selftest          runs the start-up check, and compares the helpers of *_arith.h with plain arithmetic
 *   table NAME        writes a table
 *   call NAME         reads inputs and state, writes records
 *   range NAME A N    writes the records of N inputs from A on, of a function of one input
 *   every NAME        writes the checksum of the records of every input there is
 *   sequence          calls a function with a state, from the state at zeros, for the inputs it reads
 *   chain             reads int32 pairs (drive, sense), writes rows
 *   long              writes the checksum of a long run: of all rows or records and of the last state
 *   check NAME FILE   compares with vectors/NAME.csv; `chain` (two files), `tables` and `sequence` are names too;
 *                     without files the vectors come from the standard input
 *   check every       compares every function that is run over all its inputs with its checksum
 *   check long        compares the long run with its checksum
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "{{ v.p }}.h"
#include "{{ v.p }}_tables.h"

/* Words of the longest record. */
#define MOST {{ v.most_words() }}U

static size_t get(void *to, size_t size)
{
    return fread(to, size, 1U, stdin);
}

static void put(const uint64_t *words, size_t count)
{
    if (fwrite(words, sizeof(uint64_t), count, stdout) != count) {
        exit(3);
    }
}

/* The next byte of the input, -1 at its end. */
static int next(void)
{
    unsigned char c;
    return (get(&c, 1U) == 1U) ? (int)c : -1;
}

static uint64_t mix(uint64_t h, uint64_t word)
{
    return (h ^ word) * UINT64_C(0x100000001b3);
}

{% for f in v.tests %}static void call_{{ f.name }}(const int64_t *in, uint64_t *out)
{
{% if !f.state.is_empty() %}    {{ v.p }}_{{ f.state }}_t s;
{% endif %}{% if f.faults %}    uint32_t fault = UINT32_C(0);
{% endif %}{% if f.inputs == 0 %}    (void)in;
{% endif %}{% for w in f.set %}    {{ w }};
{% endfor %}    {% if !f.result.is_empty() %}const {{ f.result }} r = {% endif %}{{ v.p }}_{{ f.name }}({{ f.arguments }});
{% for o in f.words %}    out[{{ loop.index0 }}] = {{ o }};
{% endfor %}    out[{{ f.words.len() }}] = {% if f.faults %}fault{% else %}UINT64_C(0){% endif %};
}

{% if !f.domain.is_empty() %}static const int64_t low_{{ f.name }}[] = { {% for d in f.domain %}{{ d[0] }}, {% endfor %}};
static const uint64_t span_{{ f.name }}[] = { {% for d in f.domain %}{{ d[1] }}, {% endfor %}};

{% endif %}{% endfor %}typedef struct {
    const char *name;
    size_t inputs;
    size_t outputs;
    void (*call)(const int64_t *in, uint64_t *out);
    /* Where every input is run: ends, widths, checksum. */
    const int64_t *low;
    const uint64_t *span;
    uint64_t every;
} function_t;

static const function_t functions[] = {
{% for f in v.tests %}{% if f.domain.is_empty() %}    {"{{ f.name }}", {{ f.inputs }}U, {{ f.outputs }}U, call_{{ f.name }}, NULL, NULL, UINT64_C(0)},
{% else %}    {"{{ f.name }}", {{ f.inputs }}U, {{ f.outputs }}U, call_{{ f.name }}, low_{{ f.name }}, span_{{ f.name }}, UINT64_C({{ f.every }})},
{% endif %}{% endfor %}    {NULL, 0U, 0U, NULL, NULL, NULL, UINT64_C(0)},
};

static const function_t *find(const char *name)
{
    const function_t *f = functions;
    while ((f->name != NULL) && (strcmp(f->name, name) != 0)) {
        ++f;
    }
    return (f->name != NULL) ? f : NULL;
}

static int call(const function_t *f)
{
    int64_t in[MOST];
    uint64_t out[MOST];
    while (get(in, f->inputs * sizeof(int64_t)) == 1U) {
        f->call(in, out);
        put(out, f->outputs);
    }
    return 0;
}

static int range(const function_t *f, int64_t low, int64_t count)
{
    uint64_t out[MOST];
    if (f->inputs != 1U) {
        return 2;
    }
    for (int64_t k = 0; k < count; ++k) {
        const int64_t in = low + k;
        f->call(&in, out);
        put(out, f->outputs);
    }
    return 0;
}

/* Counts through all inputs, the last one fastest; a checksum of each {{ v.every_block() }}, and one of these. */
static uint64_t every(const function_t *f)
{
    const uint64_t basis = UINT64_C(0xcbf29ce484222325);
    uint64_t place[MOST] = {0};
    int64_t in[MOST] = {0};
    uint64_t out[MOST];
    uint64_t whole = basis;
    uint64_t h = basis;
    uint64_t count = 0U;
    size_t k = 1U;
    while (k > 0U) {
        for (size_t i = 0U; i < f->inputs; ++i) {
            in[i] = f->low[i] + (int64_t)place[i];
        }
        f->call(in, out);
        for (size_t i = 0U; i < f->outputs; ++i) {
            h = mix(h, out[i]);
        }
        ++count;
        k = f->inputs;
        while (k > 0U) {
            if (place[k - 1U] < f->span[k - 1U]) {
                ++place[k - 1U];
                break;
            }
            place[k - 1U] = 0U;
            --k;
        }
        if (((count % {{ v.every_block() }}U) == 0U) || (k == 0U)) {
            whole = mix(whole, h);
            h = basis;
        }
    }
    return whole;
}

static int table(const char *name)
{
{% for t in v.tables %}    if (strcmp(name, "{{ t.name }}") == 0) {
        for (size_t k = 0U; k < {{ t.len }}U; ++k) {
            const uint64_t word = (uint64_t)(int64_t){{ v.p }}_{{ t.name }}[k];
            put(&word, 1U);
        }
        return 0;
    }
{% endfor %}    (void)name;
    return 2;
}

{% if let Some(t) = v.stream %}static void step({{ v.p }}_{{ t.state }}_t *state, const int64_t *in, uint64_t *out)
{
    const {{ t.function.result }} r = {{ v.p }}_{{ t.function.name }}(state, {{ t.function.harness_arguments }});
{% for o in t.function.outputs %}    out[{{ loop.index0 }}] = {{ o }};
{% endfor %}    out[{{ t.function.outputs.len() }}] = UINT64_C(0);
}

static int sequence(void)
{
    static {{ v.p }}_{{ t.state }}_t s;
    int64_t in[MOST];
    uint64_t out[MOST];
    (void)memset(&s, 0xA5, sizeof s);
    {{ v.p }}_init(&s);
    while (get(in, {{ t.function.inputs.len() }}U * sizeof(int64_t)) == 1U) {
        step(&s, in, out);
        put(out, {{ t.function.outputs.len() + 1 }}U);
    }
    return 0;
}

{% endif %}{% if v.chain %}static bool push({{ v.p }}_t *g, int32_t drive, int32_t sense, uint64_t *out)
{
    {{ v.p }}_period_out_t row;
    if (!{{ v.p }}_push(g, ({{ v.code }})drive, ({{ v.code }})sense, &row)) {
        return false;
    }
{% for o in v.row_at() %}    out[{{ loop.index0 }}] = {{ o }};
{% endfor %}    out[{{ v.row.len() }}] = g->fault;
    return true;
}

static int chain(void)
{
    static {{ v.p }}_t g;
    int32_t codes[2];
    uint64_t out[MOST];
    (void)memset(&g, 0xA5, sizeof g);
    {{ v.p }}_init(&g);
    while (get(codes, sizeof codes) == 1U) {
        if (push(&g, codes[0], codes[1], out)) {
            put(out, {{ v.row.len() + 1 }}U);
        }
    }
    return 0;
}

{% endif %}{% if !v.long_words.is_empty() %}/* Triangles of changing amplitude beside the given frequencies, with noise and without, random words, squares. */
static const int64_t long_low[] = { {% for w in v.long_words %}{{ w[0] }}, {% endfor %}};
static const uint64_t long_span[] = { {% for w in v.long_words %}{{ w[1] }}, {% endfor %}};
static const uint32_t long_rate[] = { {% for w in v.long_words %}{{ w[2] }}, {% endfor %}};

typedef struct {
    uint64_t x;
    uint64_t amplitude;
    uint32_t detuning;
} stimulus_t;

static uint64_t draw(stimulus_t *s)
{
    s->x = (s->x * UINT64_C(6364136223846793005)) + UINT64_C(1442695040888963407);
    return s->x;
}

static void stimulus(stimulus_t *s, uint64_t step, int64_t *in)
{
    if ((step % {{ v.long_segment() }}U) == 0U) {
        s->amplitude = draw(s) >> 48U;
        s->detuning = (uint32_t)(draw(s) >> 52U);
    }
    for (size_t k = 0U; k < {{ v.long_words.len() }}U; ++k) {
        const uint64_t noise = draw(s) >> 32U;
        const uint32_t turn = ((uint32_t)step * (long_rate[k] + s->detuning)) + ((uint32_t)k << 30U);
        const uint32_t up = turn * 2U;
        const uint64_t triangle = ((turn >> 31U) == 0U) ? up : (uint32_t)~up;
        const uint64_t scaled = ((triangle * s->amplitude) >> 16U) + ((UINT64_C(65535) - s->amplitude) << 15U);
        uint64_t place = scaled;
        switch ((step / {{ v.long_segment() }}U) % 4U) {
        case 0U:
            break;
        case 1U:
            place = scaled + (noise >> 12U);
            place = (place > UINT32_MAX) ? UINT32_MAX : place;
            break;
        case 2U:
            place = noise;
            break;
        default:
            place = (uint64_t)UINT32_MAX * (turn >> 31U);
            break;
        }
        const uint64_t high = (long_span[k] >> 32U) * place;
        const uint64_t low = (((long_span[k] & UINT32_MAX) * place) + UINT32_MAX) >> 32U;
        in[k] = (int64_t)((uint64_t)long_low[k] + high + low);
    }
}

static uint64_t long_run(void)
{
    static {{ v.p }}_{% if v.chain %}t g{% else %}{{ v.stream_state() }}_t s{% endif %};
    stimulus_t stimuli = {UINT64_C({{ v.seed }}), 0U, 0U};
    uint64_t h = UINT64_C(0xcbf29ce484222325);
    int64_t in[MOST];
    uint64_t out[MOST];
    (void)memset(&{% if v.chain %}g, 0xA5, sizeof g{% else %}s, 0xA5, sizeof s{% endif %});
    {{ v.p }}_init(&{% if v.chain %}g{% else %}s{% endif %});
{% for o in v.long_state() %}    h = mix(h, {{ o }});
{% endfor %}    for (uint64_t n = 0U; n < UINT64_C({{ v.long_steps }}); ++n) {
        {% if v.chain %}stimulus(&stimuli, n, in);
        if (push(&g, (int32_t)in[0], (int32_t)in[1], out)) {
            for (size_t k = 0U; k < {{ v.row.len() + 1 }}U; ++k) {
                h = mix(h, out[k]);
            }
        }
{% else %}stimulus(&stimuli, n, &in[1]);
        in[0] = ((n % {{ v.long_restart }}U) == 0U) ? 1 : 0;
        step(&s, in, out);
        for (size_t k = 0U; k < {{ v.stream_outputs() }}U; ++k) {
            h = mix(h, out[k]);
        }
{% endif %}    }
{% for o in v.long_state() %}    h = mix(h, {{ o }});
{% endfor %}    return h;
}

{% endif %}/* A line of vectors: words between commas, of which the first `skip` are text. 0 at the end, MOST + 1 if it is no such line. */
static size_t line(uint64_t *words, size_t skip)
{
    size_t count = 0U;
    size_t cell = 0U;
    bool digits = false;
    bool minus = false;
    uint64_t word = 0U;
    for (int c = next(); c >= 0; c = next()) {
        if ((c == ',') || (c == '\n')) {
            if ((cell >= skip) && ((!digits) || (count == MOST))) {
                return MOST + 1U;
            }
            if (cell >= skip) {
                words[count] = minus ? (UINT64_C(0) - word) : word;
                ++count;
            }
            ++cell;
            word = 0U;
            digits = false;
            minus = false;
            if (c == '\n') {
                return count;
            }
        } else if ((c >= '0') && (c <= '9')) {
            word = (word * 10U) + (uint64_t)(c - '0');
            digits = true;
        } else if (c == '-') {
            minus = true;
        } else if (cell >= skip) {
            return MOST + 1U;
        } else {
            /* Text. */
        }
    }
    return digits ? (MOST + 1U) : 0U;
}

static void header(void)
{
    int c = next();
    while ((c >= 0) && (c != '\n')) {
        c = next();
    }
}

/* The helpers of {{ v.p }}_arith.h over their whole domains, wider than the ranges that the functions use. */
{% for w in [32, 64] %}static uint64_t arith_{{ w }}(int{{ w }}_t a, int{{ w }}_t b)
{
    uint64_t differing = 0U;
    for (uint32_t n = 0U; n < {{ w }}U; ++n) {
        const uint{{ w }}_t sign = UINT{{ w }}_C(1) << n;
        const uint{{ w }}_t mask = sign | (sign - 1U);
        const uint{{ w }}_t low = (uint{{ w }}_t)a & mask;
        int{{ w }}_t floored = a;
        for (uint32_t k = 0U; k < n; ++k) {
            floored = (floored / 2) - (((floored % 2) < 0) ? 1 : 0);
        }
        const int{{ w }}_t extended = ((low & sign) != 0U) ? ((-(int{{ w }}_t)(mask - low)) - 1) : (int{{ w }}_t)low;
        differing += ((n < {{ w - 1 }}U) && ({{ v.p }}_asr_{{ w }}(a, n) != floored)) ? 1U : 0U;
        differing += ({{ v.p }}_asr_by_{{ w }}(a, n) != floored) ? 1U : 0U;
        differing += ({{ v.p }}_sign_extend_{{ w }}((uint{{ w }}_t)a, sign) != extended) ? 1U : 0U;
    }
    const int{{ w }}_t least = (a < b) ? a : b;
    const int{{ w }}_t most = (a < b) ? b : a;
    for (int c = -2; c <= 2; ++c) {
        const bool fits = (c < 0) ? (least > (INT{{ w }}_MIN - c)) : (most < (INT{{ w }}_MAX - c));
        const int{{ w }}_t x = !fits ? 0 : ((c < 0) ? (least + c) : (most + c));
        const int{{ w }}_t due = (x < least) ? least : ((x > most) ? most : x);
        uint32_t fault = 0U;
        uint32_t first = 3U;
        differing += ({{ v.p }}_clamp_{{ w }}(x, least, most) != due) ? 1U : 0U;
        differing += ({{ v.p }}_check_{{ w }}(x, least, most, 7U, &fault) != due) ? 1U : 0U;
        differing += ({{ v.p }}_check_{{ w }}(x, least, most, 7U, &first) != due) ? 1U : 0U;
        differing += ((fault != ((x != due) ? 7U : 0U)) || (first != 3U)) ? 1U : 0U;
    }
    differing += ({{ v.p }}_word_{{ w }}((uint{{ w }}_t)a) != a) ? 1U : 0U;
    return differing;
}

{% endfor %}{% if v.wide %}static bool same_128({{ v.p }}_w128_t a, {{ v.p }}_w128_t b)
{
    return (a.hi == b.hi) && (a.lo == b.lo);
}

/* The helpers for 128 bits against themselves in single steps: halves, doubles, sums of shifted words. */
static uint64_t arith_128({{ v.p }}_w128_t a, {{ v.p }}_w128_t b)
{
    const {{ v.p }}_w128_t zero = {{ v.p }}_w128_make(0U, 0U);
    uint64_t differing = 0U;
    const bool minus = (a.hi >> 63U) != 0U;
    {{ v.p }}_w128_t halved = a;
    {{ v.p }}_w128_t floored = a;
    {{ v.p }}_w128_t doubled = a;
    {{ v.p }}_w128_t product = zero;
    {{ v.p }}_w128_t due;
    /* Digits of 32 bits with their carries. */
    uint64_t carry = (a.lo & UINT32_MAX) + (b.lo & UINT32_MAX);
    due.lo = carry & UINT32_MAX;
    carry = (carry >> 32U) + (a.lo >> 32U) + (b.lo >> 32U);
    due.lo |= carry << 32U;
    due.hi = a.hi + b.hi + (carry >> 32U);
    differing += same_128({{ v.p }}_w128_add(a, b), due) ? 0U : 1U;
    differing += same_128({{ v.p }}_w128_sub(due, b), a) ? 0U : 1U;
    differing += same_128({{ v.p }}_w128_add({{ v.p }}_w128_neg(a), a), zero) ? 0U : 1U;
    differing += ({{ v.p }}_w128_is_negative(a) != minus) ? 1U : 0U;
    for (uint32_t n = 0U; n < 128U; ++n) {
        const {{ v.p }}_w128_t low = {{ v.p }}_w128_shr({{ v.p }}_w128_shl(a, 128U - ((n == 0U) ? 128U : n)), 128U - ((n == 0U) ? 128U : n));
        const uint64_t bit = (n < 64U) ? ((b.lo >> n) & 1U) : ((b.hi >> (n - 64U)) & 1U);
        differing += same_128({{ v.p }}_w128_shr(a, n), halved) ? 0U : 1U;
        differing += same_128({{ v.p }}_w128_asr(a, n), floored) ? 0U : 1U;
        differing += same_128({{ v.p }}_w128_shl(a, n), doubled) ? 0U : 1U;
        differing += ((n > 0U) && !same_128({{ v.p }}_w128_mask(a, n), low)) ? 1U : 0U;
        if (n > 0U) {
            const {{ v.p }}_w128_t extended = {{ v.p }}_w128_sign_extend(a, n);
            const {{ v.p }}_w128_t top = {{ v.p }}_w128_shr(low, n - 1U);
            const {{ v.p }}_w128_t fill = (top.lo != 0U) ? {{ v.p }}_w128_shl({{ v.p }}_w128_make(UINT64_MAX, UINT64_MAX), n) : zero;
            differing += same_128(extended, {{ v.p }}_w128_add(low, fill)) ? 0U : 1U;
        }
        if (bit != 0U) {
            product = {{ v.p }}_w128_add(product, doubled);
        }
        halved.lo = (halved.lo >> 1U) | (halved.hi << 63U);
        halved.hi >>= 1U;
        floored.lo = (floored.lo >> 1U) | (floored.hi << 63U);
        floored.hi = (floored.hi >> 1U) | (minus ? (UINT64_C(1) << 63U) : 0U);
        doubled.hi = (doubled.hi << 1U) | (doubled.lo >> 63U);
        doubled.lo <<= 1U;
    }
    differing += same_128({{ v.p }}_w128_mul(a, b), product) ? 0U : 1U;
    differing += same_128({{ v.p }}_w128_from_s64({{ v.p }}_word_64(a.lo)), {{ v.p }}_w128_sign_extend({{ v.p }}_w128_make(0U, a.lo), 64U)) ? 0U : 1U;
    differing += ({{ v.p }}_w128_to_s64(a) != {{ v.p }}_word_64(a.lo)) ? 1U : 0U;
    const bool minus_b = (b.hi >> 63U) != 0U;
    const bool less = (minus != minus_b) ? minus : ((a.hi < b.hi) || ((a.hi == b.hi) && (a.lo < b.lo)));
    differing += ({{ v.p }}_w128_less(a, b) != less) ? 1U : 0U;
    differing += {{ v.p }}_w128_less(a, a) ? 1U : 0U;
    const {{ v.p }}_w128_t least = less ? a : b;
    const {{ v.p }}_w128_t most = less ? b : a;
    uint32_t fault = 0U;
    differing += same_128({{ v.p }}_clamp_128(a, least, most), a) ? 0U : 1U;
    differing += same_128({{ v.p }}_clamp_128(a, b, b), b) ? 0U : 1U;
    differing += same_128({{ v.p }}_check_128(a, b, b, 7U, &fault), b) ? 0U : 1U;
    differing += (fault != (same_128(a, b) ? 0U : 7U)) ? 1U : 0U;
    return differing;
}

{% endif %}static bool arith(void)
{
    uint64_t differing = 0U;
    for (uint32_t n = 0U; n < 64U; ++n) {
        for (uint32_t k = 0U; k < 5U; ++k) {
            const uint64_t word = (UINT64_C(1) << n) + k - 2U;
            const uint64_t other = (k * UINT64_C(0x9E3779B97F4A7C15)) ^ ~word;
            differing += arith_64({{ v.p }}_word_64(word), {{ v.p }}_word_64(other));
{% if v.wide %}            differing += arith_128({{ v.p }}_w128_make(word, other), {{ v.p }}_w128_make(other, ~word));
            differing += arith_128({{ v.p }}_w128_make(other, word), {{ v.p }}_w128_make(word, word));
            differing += arith_128({{ v.p }}_w128_make((k == 0U) ? 0U : UINT64_MAX, word), {{ v.p }}_w128_make(0U, other));
{% endif %}            differing += arith_64({{ v.p }}_word_64(~word), {{ v.p }}_word_64(word));
            differing += arith_32({{ v.p }}_word_32((uint32_t)word), {{ v.p }}_word_32((uint32_t)other));
            differing += arith_32({{ v.p }}_word_32(~(uint32_t)word), {{ v.p }}_word_32((uint32_t)word));
        }
    }
    return differing == 0U;
}

/* Of what is held against one checksum, which covers `what`. */
static int by_checksum(const char *name, const char *what, bool good)
{
    (void)printf("%s: %s, %s by a checksum\n", name, good ? "pass" : "FAIL", what);
    return good ? 0 : 1;
}

static int verdict(const char *name, uint64_t compared, uint64_t differing)
{
    const bool good = (compared > 0U) && (differing == 0U);
    (void)printf("%s: %s, %lu compared, %lu differ\n", name, good ? "pass" : "FAIL",
                 (unsigned long)compared, (unsigned long)differing);
    return good ? 0 : 1;
}

/* Compares the end of a line with what was computed. */
static uint64_t differs(const uint64_t *due, const uint64_t *found, size_t count)
{
    uint64_t differing = 0U;
    for (size_t k = 0U; k < count; ++k) {
        differing += (due[k] != found[k]) ? 1U : 0U;
    }
    return differing;
}

static int check_function(const function_t *f)
{
    uint64_t words[MOST + 1U];
    int64_t in[MOST];
    uint64_t out[MOST];
    uint64_t compared = 0U;
    uint64_t differing = 0U;
    header();
    for (size_t count = line(words, 0U); count > 0U; count = line(words, 0U)) {
        if (count != (f->inputs + f->outputs)) {
            return verdict(f->name, compared, differing + 1U);
        }
        for (size_t k = 0U; k < f->inputs; ++k) {
            in[k] = (int64_t)words[k];
        }
        f->call(in, out);
        differing += differs(&words[f->inputs], out, f->outputs);
        compared += f->outputs;
    }
    return verdict(f->name, compared, differing);
}

static int check_every(void)
{
    int failed = 0;
    for (const function_t *f = functions; f->name != NULL; ++f) {
        if (f->low != NULL) {
            failed |= by_checksum(f->name, "every input", every(f) == f->every);
        }
    }
    return failed;
}

static int check_tables(void)
{
    uint64_t words[MOST + 1U];
    uint64_t compared = 0U;
    uint64_t differing = 0U;
    header();
{% for t in v.tables %}    for (size_t k = 0U; k < {{ t.len }}U; ++k) {
        const bool good = (line(words, 1U) == 2U) && (words[0] == k)
            && (words[1] == (uint64_t)(int64_t){{ v.p }}_{{ t.name }}[k]);
        differing += good ? 0U : 1U;
        ++compared;
    }
{% endfor %}    differing += (line(words, 1U) == 0U) ? 0U : 1U;
    return ((compared == 0U) && (differing == 0U)) ? 0 : verdict("tables", compared, differing);
}

{% if let Some(t) = v.stream %}static int check_sequence(void)
{
    static {{ v.p }}_{{ t.state }}_t s;
    uint64_t words[MOST + 1U];
    int64_t in[MOST];
    uint64_t out[MOST];
    uint64_t compared = 0U;
    uint64_t differing = 0U;
    (void)memset(&s, 0xA5, sizeof s);
    {{ v.p }}_init(&s);
    header();
    for (size_t count = line(words, 0U); count > 0U; count = line(words, 0U)) {
        if (count != {{ t.function.inputs.len() + t.function.outputs.len() + 1 }}U) {
            return verdict("sequence", compared, differing + 1U);
        }
        for (size_t k = 0U; k < {{ t.function.inputs.len() }}U; ++k) {
            in[k] = (int64_t)words[k];
        }
        step(&s, in, out);
        differing += differs(&words[{{ t.function.inputs.len() }}], out, {{ t.function.outputs.len() + 1 }}U);
        compared += {{ t.function.outputs.len() + 1 }}U;
    }
    return verdict("sequence", compared, differing);
}

{% endif %}{% if v.chain %}/* Reads chain_input.csv and then chain_output.csv, which is `second` or follows it. */
static int check_chain(const char *second)
{
    static {{ v.p }}_t g;
    static uint64_t rows[{{ v.vector_rows }}U][MOST];
    uint64_t words[MOST + 1U];
    size_t pushed = 0U;
    uint64_t compared = 0U;
    uint64_t differing = 0U;
    (void)memset(&g, 0xA5, sizeof g);
    {{ v.p }}_init(&g);
    header();
    size_t count = line(words, 0U);
    while (count == 2U) {
        if ((pushed < {{ v.vector_rows }}U) && push(&g, (int32_t)(int64_t)words[0], (int32_t)(int64_t)words[1], rows[pushed])) {
            ++pushed;
        }
        count = line(words, 0U);
    }
    if ((second != NULL) && (freopen(second, "r", stdin) == NULL)) {
        return 2;
    }
    header();
    for (size_t k = 0U; k < pushed; ++k) {
        const bool whole = line(words, 0U) == {{ v.row.len() + 1 }}U;
        differing += whole ? differs(words, rows[k], {{ v.row.len() + 1 }}U) : 1U;
        compared += {{ v.row.len() + 1 }}U;
    }
    differing += (line(words, 0U) == 0U) ? 0U : 1U;
    return verdict("chain", compared, differing);
}

{% endif %}static int check(const char *name, const char *first, const char *second)
{
{% if !v.chain %}    (void)second;
{% endif %}    if ((first != NULL) && (freopen(first, "r", stdin) == NULL)) {
        (void)printf("%s: FAIL, cannot read %s\n", name, first);
        return 2;
    }
    const function_t *f = find(name);
    if (f != NULL) {
        return check_function(f);
    }
    if (strcmp(name, "every") == 0) {
        return check_every();
    }
    if (strcmp(name, "tables") == 0) {
        return check_tables();
    }
{% if v.stream.is_some() %}    if (strcmp(name, "sequence") == 0) {
        return check_sequence();
    }
{% endif %}{% if v.chain %}    if (strcmp(name, "chain") == 0) {
        return check_chain(second);
    }
{% endif %}{% if !v.long_words.is_empty() %}    if (strcmp(name, "long") == 0) {
        return by_checksum("long", "a run of {{ v.long_steps }} {% if v.chain %}samples{% else %}calls{% endif %}", long_run() == UINT64_C({{ v.long_checksum }}));
    }
{% endif %}    return 2;
}

int main(int argc, char **argv)
{
    const char *mode = (argc > 1) ? argv[1] : "selftest";
    const char *name = (argc > 2) ? argv[2] : "";
    const function_t *f = find(name);
    static char buffer[1U << 16U];
    (void)setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
    if (strcmp(mode, "selftest") == 0) {
        const uint32_t failed = {{ v.p }}_selftest();
        if (!arith()) {
            (void)printf("arith: FAIL\n");
            return 1;
        }
        (void)printf("selftest: %s (%" PRIu32 ")\n", (failed == 0U) ? "pass" : "FAIL", failed);
        return (failed == 0U) ? 0 : 1;
    }
    if ((strcmp(mode, "call") == 0) && (f != NULL)) {
        return call(f);
    }
    if ((strcmp(mode, "range") == 0) && (f != NULL) && (argc > 4)) {
        return range(f, strtoll(argv[3], NULL, 10), strtoll(argv[4], NULL, 10));
    }
    if ((strcmp(mode, "every") == 0) && (f != NULL) && (f->low != NULL)) {
        const uint64_t word = every(f);
        put(&word, 1U);
        return 0;
    }
    if ((strcmp(mode, "table") == 0) && (argc > 2)) {
        return table(name);
    }
    if (strcmp(mode, "check") == 0) {
        return check(name, (argc > 3) ? argv[3] : NULL, (argc > 4) ? argv[4] : NULL);
    }
{% if v.stream.is_some() %}    if (strcmp(mode, "sequence") == 0) {
        return sequence();
    }
{% endif %}{% if v.chain %}    if (strcmp(mode, "chain") == 0) {
        return chain();
    }
{% endif %}{% if !v.long_words.is_empty() %}    if (strcmp(mode, "long") == 0) {
        const uint64_t word = long_run();
        put(&word, 1U);
        return 0;
    }
{% endif %}    (void)fprintf(stderr, "unknown mode or function\n");
    return 2;
}
