/* A plugin of minor version 7: every struct has grown at its end, and it offers what this host does not know. */
#include "calib_plugin.h"

#include <string.h>

typedef struct { calib_parameter old; double step; const char *unit; } new_parameter;
typedef struct { calib_offer old; const char *page; uint64_t flags; } new_offer;
typedef struct { calib_descriptor old; const char *homepage; } new_descriptor;
typedef struct { calib_entry old; void (*shutdown)(void); } new_entry;
typedef struct { calib_cor_1 old; void (*warm_up)(void); } new_cor;
typedef struct { calib_cor_result old; double confidence; } new_result;

/* A field of the call that only newer hosts have. */
typedef struct { calib_call old; void (*log)(void *context, const char *text); } new_call;

static calib_status fit(const calib_call *call, const calib_motion *motion, const calib_cor_sink *sink) {
    new_result result = {{0}, 0.9};
    const new_call *newer = (const new_call *)(const void *)call;
    if (CALIB_HAS(calib_call, call, progress)) call->progress(call->context, 1.0, NULL);
    if (offsetof(new_call, log) + sizeof newer->log <= call->struct_size) newer->log(call->context, "never here");
    if (call->value_count != 2) return calib_say(call, CALIB_FAILED, "two values were described");
    result.old.struct_size = sizeof result;
    result.old.used = motion->samples;
    result.old.center_m[0] = call->values[0].number;
    result.old.center_m[1] = call->values[1].number;
    return sink->result(sink->context, &result.old);
}

static const new_cor cor = {{sizeof cor, 0, fit}, NULL};

#define NUMBER(n, v) {{n, "", {CALIB_NUMBER, 0, 0, v, NULL}, 0, 0, NULL, 0, 0, 0}, 0.1, "m"}
static const new_parameter two[] = {NUMBER("first", 1.5), NUMBER("second", 2.5)};
static const new_parameter odd[] = {{{"vector", "", {99, 0, 0, 0, NULL}, 0, 0, NULL, 0, 0, 0}, 0, NULL}};

static const new_offer offers[] = {
    {{CALIB_KIND_COR, "grown", "", "", CALIB_TAKES_POINTS | CALIB_TAKES(9), sizeof(new_parameter), &two[0].old, 2, NULL, 0},
     "page", 1},
    {{"calib.teleport/1", "beam", "", "", 0, sizeof(new_parameter), NULL, 0, NULL, 0}, "page", 1},
    {{CALIB_KIND_COR, "vectors", "", "", CALIB_TAKES_POINTS, sizeof(new_parameter), &odd[0].old, 1, NULL, 0}, "page", 1},
    {{CALIB_KIND_COR, "clouds", "", "", CALIB_TAKES(9), sizeof(new_parameter), NULL, 0, NULL, 0}, "page", 1},
};
static const new_descriptor descriptor = {
    {sizeof descriptor, sizeof(new_offer), "newer", "7.0", "", "MIT", &offers[0].old, 4}, "home"};
static const calib_descriptor *describe(void) { return &descriptor.old; }
static const void *find(const char *kind, const char *name) {
    return strcmp(kind, CALIB_KIND_COR) == 0 && strcmp(name, "grown") == 0 ? &cor : NULL;
}
/* The entry has grown too. C knows the symbol by its old type, so the new one carries its name in the object file. */
#if defined(__APPLE__)
const new_entry newer_entry __asm__("_calib_plugin_entry") = {
#else
const new_entry newer_entry __asm__("calib_plugin_entry") = {
#endif
    {CALIB_ABI_MAJOR, 7, sizeof(new_entry), 0, describe, find}, NULL};
