/* An axis estimator, a reader and a report writer; one bad deed for each macro. */
#include "calib_plugin.h"

#include <math.h>
#include <string.h>

static calib_status fit(const calib_call *call, const calib_motion *motion, const calib_aor_sink *sink) {
    calib_aor_result result = {.struct_size = sizeof result, .direction = {0, 0, 1}};
    (void)call;
    result.used = motion->samples;
#if defined(NOT_UNIT)
    result.direction[2] = 2;
#elif defined(NOT_A_NUMBER)
    result.point_m[0] = INFINITY;
#endif
    return sink->result(sink->context, &result);
}

static calib_status read(const calib_call *call, const calib_source *source, const calib_recording_sink *sink) {
    static const uint64_t rows[2] = {1, 2};
    static const char *const labels[2] = {"a", "b"};
    double t[2] = {0.0, 0.5};
    double points[6] = {1, 2, 3, NAN, NAN, NAN};
    double rotations[18] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, -1, 0, 1, 0, 0, 0, 0, 1};
    double translations[6] = {0, 0, 0, 1, 1, 1};
    double angles[2] = {0.1, 0.2};
    uint8_t mask[2] = {CALIB_MEASURED, CALIB_LOST};
    const uint8_t both[2] = {CALIB_MEASURED, CALIB_MEASURED};
    size_t timeline = 7, count = 2, joint_timeline = 0;
    int32_t unit = CALIB_ANGLE;
    const char *name = "elbow";
    if (source->size == 0) return calib_say(call, CALIB_BAD_INPUT, "line 1: the file is empty");
#if defined(SCALED)
    rotations[0] = 2;
#elif defined(MIRRORED)
    rotations[8] = -1;
#elif defined(MEASURED_NAN)
    mask[1] = CALIB_MEASURED;
#elif defined(BAD_MASK)
    mask[1] = 9;
#elif defined(WRONG_LENGTH)
    count = 1;
#elif defined(NO_TIMELINE)
    joint_timeline = 5;
#elif defined(TIME_BACK)
    t[1] = -1;
#elif defined(BAD_UNIT)
    unit = 3;
#elif defined(NO_NAME)
    name = "";
#elif defined(NOT_UTF8)
    name = "\xc3";
#elif defined(NULL_NAME)
    name = NULL;
#elif defined(NOT_OBSERVABLE)
    return CALIB_NOT_OBSERVABLE;
#endif
    /* A careless author: no status of a callback is looked at. */
    sink->timeline(sink->context, "tracker", rows, t, 2, &timeline);
    sink->label(sink->context, timeline, "trial", labels, 2);
    sink->marker(sink->context, "tip", timeline, points, mask, count);
    sink->body(sink->context, "arm", timeline, rotations, translations, both, 2);
    sink->joint(sink->context, name, timeline + joint_timeline, unit, angles, both, 2);
    sink->torque(sink->context, "elbow", timeline, angles, both, 2);
    sink->note(sink->context, "nothing was converted");
#if defined(SAME_NAME)
    sink->marker(sink->context, "tip", timeline, points, mask, count);
#endif
    return CALIB_OK;
}

static int32_t recognizes(const uint8_t *head, size_t size) { return size >= 2 && head[0] == 'o' && head[1] == 'k'; }

static calib_status write(const calib_call *call, const calib_report_input *report, const calib_files_sink *sink) {
    const char *path = "form/report.txt";
    (void)call;
#if defined(ESCAPES)
    path = "../report.txt";
#elif defined(ABSOLUTE)
    path = "/report.txt";
#elif defined(NO_FILE)
    return CALIB_OK;
#elif defined(SAME_FILE)
    sink->file(sink->context, "Form/Report.txt", report->report_json, report->report_size);
#endif
    sink->file(sink->context, path, report->report_json, report->report_size);
    return CALIB_OK;
}

static const calib_aor_1 aor = {.struct_size = sizeof aor, .fit = fit};
static const calib_reader_1 reader = {.struct_size = sizeof reader, .read = read, .recognizes = recognizes};
static const calib_report_1 writer = {.struct_size = sizeof writer, .write = write};

static const calib_offer offers[] = {
    {.kind = CALIB_KIND_AOR, .name = "up", .summary = "", .source = "", .shapes = CALIB_TAKES_POSES},
    {.kind = CALIB_KIND_READER, .name = "two", .summary = "", .source = "", .example = (const uint8_t *)"ok", .example_size = 2},
    {.kind = CALIB_KIND_REPORT, .name = "copy", .summary = "", .source = ""},
};
static const calib_descriptor descriptor = {
    .struct_size = sizeof descriptor, .offer_size = sizeof offers[0], .name = "others", .version = "1.0",
    .author = "the tests", .licence = "MIT", .offers = offers, .offer_count = 3,
};
static const calib_descriptor *describe(void) { return &descriptor; }
static const void *find(const char *kind, const char *name) {
    (void)name;
    if (strcmp(kind, CALIB_KIND_AOR) == 0) return &aor;
    if (strcmp(kind, CALIB_KIND_READER) == 0) return &reader;
    return &writer;
}
const calib_entry calib_plugin_entry = {CALIB_ABI_MAJOR, CALIB_ABI_MINOR, sizeof(calib_entry), 0, describe, find};
