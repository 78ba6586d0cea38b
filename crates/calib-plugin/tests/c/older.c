/* A plugin from before the optional ends: smaller structs, fewer kinds. It has its own copy of what it knew. */
#include "calib_plugin.h"

#include <string.h>

typedef struct {
    const char *kind, *name, *summary, *source;
    uint32_t shapes, parameter_size;
    const calib_parameter *parameters;
    size_t parameter_count;
} old_offer;

typedef struct {
    uint32_t struct_size, reserved;
    calib_status (*read)(const calib_call *, const calib_source *, const calib_recording_sink *);
} old_reader;

static calib_status read(const calib_call *call, const calib_source *source, const calib_recording_sink *sink) {
    const uint64_t row = 1;
    const double value = (double)source->size;
    const uint8_t mask = CALIB_MEASURED;
    size_t timeline;
    (void)call;
    if (sink->timeline(sink->context, "file", &row, NULL, 1, &timeline) != CALIB_OK) return CALIB_FAILED;
    return sink->joint(sink->context, "size", timeline, CALIB_LENGTH, &value, &mask, 1);
}

/* Behind each old struct stands what the host must not read as a part of it. */
static const struct { old_reader table; void *garbage[4]; } reader = {{sizeof(old_reader), 0, read}, {(void *)1, (void *)1, (void *)1, (void *)1}};
static const old_offer offers[2] = {
    {CALIB_KIND_READER, "size", "", "", 0, 0, NULL, 0},
    {CALIB_KIND_READER, "again", "", "", 0, 0, NULL, 0},
};
static const calib_descriptor descriptor = {sizeof descriptor, sizeof(old_offer), "older", "0.9", "", "MIT",
                                            (const calib_offer *)(const void *)offers, 2};
static const calib_descriptor *describe(void) { return &descriptor; }
static const void *find(const char *kind, const char *name) {
    (void)name;
    return strcmp(kind, CALIB_KIND_READER) == 0 ? &reader.table : NULL;
}
const calib_entry calib_plugin_entry = {CALIB_ABI_MAJOR, 0, sizeof(calib_entry), 0, describe, find};
