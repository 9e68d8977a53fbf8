/* {{ v.banner }}
 *
 * Host-side driver, not firmware. `selftest` runs the start-up check; `table NAME` writes a table;
 * `call NAME` reads int64 inputs and writes the outputs; `range NAME LOW COUNT` counts one input
 * up; `stream` calls a function with a state for int64 inputs from the state at zeros; `chain` reads
 * int32 pairs (drive, sense) and writes rows. Words are native int64; every record ends with the
 * number of the fault, 0 = none.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "{{ v.p }}.h"
#include "{{ v.p }}_tables.h"

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

{% for f in v.tested() %}static void call_{{ f.name }}(const int64_t *in, uint64_t *out)
{
{% if f.faults %}    uint32_t fault = UINT32_C(0);
{% endif %}    const {{ f.result }} r = {{ v.p }}_{{ f.name }}({{ f.harness_arguments }});
{% for o in f.outputs %}    out[{{ loop.index0 }}] = {{ o }};
{% endfor %}    out[{{ f.outputs.len() }}] = {% if f.faults %}fault{% else %}UINT64_C(0){% endif %};
}

{% endfor %}typedef struct {
    const char *name;
    size_t inputs;
    size_t outputs;
    void (*call)(const int64_t *in, uint64_t *out);
} function_t;

static const function_t functions[] = {
{% for f in v.tested() %}    {"{{ f.name }}", {{ f.inputs.len() }}U, {{ f.outputs.len() + 1 }}U, call_{{ f.name }}},
{% endfor %}    {NULL, 0U, 0U, NULL},
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
    int64_t in[8];
    uint64_t out[16];
    while (get(in, f->inputs * sizeof(int64_t)) == 1U) {
        f->call(in, out);
        put(out, f->outputs);
    }
    return 0;
}

static int range(const function_t *f, int64_t low, int64_t count)
{
    uint64_t out[16];
    for (int64_t k = 0; k < count; ++k) {
        const int64_t in = low + k;
        f->call(&in, out);
        put(out, f->outputs);
    }
    return 0;
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

{% if let Some(t) = v.stream %}static int stream(void)
{
    static {{ v.p }}_{{ t.state }}_t s;
    int64_t in[16];
    {{ v.p }}_init(&s);
    while (get(in, {{ t.function.inputs.len() }}U * sizeof(int64_t)) == 1U) {
        const {{ t.function.result }} r = {{ v.p }}_{{ t.function.name }}(&s, {{ t.function.harness_arguments }});
        uint64_t out[{{ t.function.outputs.len() + 1 }}U];
{% for o in t.function.outputs %}        out[{{ loop.index0 }}] = {{ o }};
{% endfor %}        out[{{ t.function.outputs.len() }}] = UINT64_C(0);
        put(out, {{ t.function.outputs.len() + 1 }}U);
    }
    return 0;
}

{% endif %}{% if v.chain %}static int chain(void)
{
    static {{ v.p }}_t g;
    {{ v.p }}_period_out_t row;
    int32_t codes[2];
    uint64_t out[16];
    {{ v.p }}_init(&g);
    while (get(codes, sizeof codes) == 1U) {
        if ({{ v.p }}_push(&g, ({{ v.code }})codes[0], ({{ v.code }})codes[1], &row)) {
{% for o in v.row %}            out[{{ loop.index0 }}] = {{ o }};
{% endfor %}            out[{{ v.row.len() }}] = g.fault;
            put(out, {{ v.row.len() + 1 }}U);
        }
    }
    return 0;
}

{% endif %}int main(int argc, char **argv)
{
    const char *mode = (argc > 1) ? argv[1] : "selftest";
    const function_t *f = (argc > 2) ? find(argv[2]) : NULL;
    static char buffer[1U << 16U];
    (void)setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
    if (strcmp(mode, "selftest") == 0) {
        const uint32_t failed = {{ v.p }}_selftest();
        (void)printf("selftest: %s (%" PRIu32 ")\n", (failed == 0U) ? "pass" : "FAIL", failed);
        return (failed == 0U) ? 0 : 1;
    }
    if ((strcmp(mode, "call") == 0) && (f != NULL)) {
        return call(f);
    }
    if ((strcmp(mode, "range") == 0) && (f != NULL) && (argc > 4)) {
        return range(f, strtoll(argv[3], NULL, 10), strtoll(argv[4], NULL, 10));
    }
    if ((strcmp(mode, "table") == 0) && (argc > 2)) {
        return table(argv[2]);
    }
{% if v.stream.is_some() %}    if (strcmp(mode, "stream") == 0) {
        return stream();
    }
{% endif %}{% if v.chain %}    if (strcmp(mode, "chain") == 0) {
        return chain();
    }
{% endif %}    (void)fprintf(stderr, "unknown mode or function\n");
    return 2;
}
