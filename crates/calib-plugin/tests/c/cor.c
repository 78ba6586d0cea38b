/* A center estimator that answers with the mean of the first marker, and one bad deed for each macro. */
#include "calib_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#if defined(LEAKS)
static void *volatile lost;
#endif

static calib_status fit(const calib_call *call, const calib_motion *motion, const calib_cor_sink *sink) {
    calib_cor_result result = {.struct_size = sizeof result};
    double radii[8] = {0};
    size_t rejected[2] = {0, 0};
    size_t n = 0;
    for (size_t s = 0; s < motion->samples; ++s) {
        if (!motion->seen[s]) continue;
        for (int i = 0; i < 3; ++i) result.center_m[i] += motion->points_m[3 * s + i];
        ++n;
    }
    if (n == 0) return calib_say(call, CALIB_NOT_OBSERVABLE, "no samples");
    for (int i = 0; i < 3; ++i) result.center_m[i] = result.center_m[i] / (double)n + call->values[0].number;
    result.used = n;
    result.radii_m = radii;
    result.radius_count = motion->tracks;
    (void)rejected;

#if defined(PANICS)
    return calib_say(call, CALIB_PANICKED, "index out of bounds");
#elif defined(SAYS_NOTHING)
    return CALIB_FAILED;
#elif defined(NOT_A_NUMBER)
    result.center_m[1] = NAN;
#elif defined(WRONG_LENGTH)
    result.radius_count = motion->tracks + 1;
#elif defined(WRONG_REJECTED)
    rejected[1] = motion->samples;
    result.rejected = rejected;
    result.rejected_count = 1;
#elif defined(BAD_COVARIANCE)
    static const double covariance[9] = {1, 2, 0, 2, 1, 0, 0, 0, 1};
    result.covariance_m2 = covariance;
#elif defined(SHORT_RESULT)
    result.struct_size = 8;
#elif defined(NOWHERE)
    result.radii_m = NULL;
#elif defined(TWICE)
    sink->result(sink->context, &result);
#elif defined(NO_RESULT)
    (void)sink;
    return CALIB_OK;
#elif defined(UNKNOWN_STATUS)
    sink->result(sink->context, &result);
    return 77;
#elif defined(HALF)
    sink->result(sink->context, &result);
    return calib_say(call, CALIB_FAILED, "the second half failed");
#elif defined(HANGS)
    while (!call->cancelled(call->context)) {
        call->progress(call->context, 0.5, "waiting");
    }
    return CALIB_CANCELLED;
#elif defined(HANGS_FOR_EVER)
    /* As good as for ever for who waits a second; the test's process ends. */
    const time_t end = time(NULL) + 6;
    while (motion->samples > 100000 && time(NULL) < end) {}
#elif defined(LEAKS)
    lost = malloc(1 << 16);
    if (lost) memset(lost, 1, 1 << 16);
#elif defined(LONG_TEXT)
    {
        char text[5000];
        memset(text, 'x', sizeof text - 1);
        text[sizeof text - 1] = '\0';
        return calib_say(call, CALIB_FAILED, text);
    }
#elif defined(KEEPS_STATE)
    static double calls = 0;
    result.center_m[0] += 1e-3 * calls++;
#elif defined(WEAK)
    result.weak = 1;
    calib_say(call, CALIB_OK, "a mean is a weak center");
#endif
    return sink->result(sink->context, &result);
}

#if defined(NO_FUNCTION)
static const calib_cor_1 table = {.struct_size = sizeof table, .fit = 0 ? fit : NULL};
#else
static const calib_cor_1 table = {.struct_size = sizeof table, .fit = fit};
#endif

static const calib_parameter parameters[] = {{
    .name = "offset_m",
    .summary = "added to every coordinate",
#if defined(BAD_DEFAULT)
    .value = {.type = CALIB_NUMBER, .number = 7.0},
#else
    .value = {.type = CALIB_NUMBER, .number = 0.0},
#endif
    .minimum = -1.0,
    .maximum = 1.0,
}};

static const calib_offer offers[] = {{
    .kind = CALIB_KIND_COR,
#if defined(BAD_NAME)
    .name = "Mean Value",
#else
    .name = "mean",
#endif
    .summary = "mean of the first marker",
#if defined(NOT_UTF8)
    .source = "\xff\xfe",
#else
    .source = "",
#endif
    .shapes = CALIB_TAKES_POINTS,
    .parameter_size = sizeof parameters[0],
    .parameters = parameters,
    .parameter_count = 1,
}
#if defined(OFFERS_TWICE)
, {.kind = CALIB_KIND_COR, .name = "mean", .summary = "", .source = "", .shapes = CALIB_TAKES_POINTS}
#endif
};

static const calib_descriptor descriptor = {
#if defined(SHORT_DESCRIPTOR)
    .struct_size = 16,
#else
    .struct_size = sizeof descriptor,
#endif
    .offer_size = sizeof offers[0],
    .name = "bad",
    .version = "1.0",
    .author = "the tests",
    .licence = "MIT",
    .offers = offers,
#if defined(BAD_COUNT)
    .offer_count = (size_t)-1,
#else
    .offer_count = sizeof offers / sizeof offers[0],
#endif
};

static const calib_descriptor *describe(void) {
#if defined(NO_DESCRIPTION)
    return NULL;
#else
    return &descriptor;
#endif
}

static const void *find(const char *kind, const char *name) {
#if defined(NOT_FOUND)
    (void)kind;
    (void)name;
    return NULL;
#else
    return strcmp(kind, CALIB_KIND_COR) == 0 && strcmp(name, "mean") == 0 ? &table : NULL;
#endif
}

#if defined(NO_SYMBOL)
const calib_descriptor *(*const only_user)(void) = describe;
const void *(*const other_user)(const char *, const char *) = find;
#else
const calib_entry calib_plugin_entry = {
#if defined(WRONG_ABI)
    .abi_major = 2,
    .abi_minor = 3,
#else
    .abi_major = CALIB_ABI_MAJOR,
    .abi_minor = CALIB_ABI_MINOR,
#endif
#if defined(SHORT_ENTRY)
    .struct_size = 20,
#else
    .struct_size = sizeof(calib_entry),
#endif
    .describe = describe,
    .find = find,
};
#endif
