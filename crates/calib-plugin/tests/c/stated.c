/* The mean of all points less the part that is known of the check's motion: a center whose scatter is sigma / sqrt(n). One bad deed for
 * each macro. */
#include "calib_plugin.h"

#include <math.h>
#include <string.h>

/* Noise of a coordinate where it is not stated, m. */
#define USUAL 2e-4

/* Mean of the points about the center, where there are a hundred samples, m. */
static const double mean[3] = {0.12376561847907233, 0.04641210692965211, -0.04308167339298919};

static calib_status fit(const calib_call *call, const calib_motion *motion, const calib_cor_sink *sink) {
    calib_cor_result result = {.struct_size = sizeof result};
    const size_t rows = motion->tracks * motion->samples;
    const double sigma = motion->sigma_t_m > 0 ? motion->sigma_t_m : USUAL;
    double covariance[9] = {0};
    for (size_t r = 0; r < rows; ++r) {
        if (!motion->seen[r]) continue;
        for (int i = 0; i < 3; ++i) result.center_m[i] += motion->points_m[3 * r + i];
        ++result.used;
    }
    if (result.used == 0) return calib_say(call, CALIB_NOT_OBSERVABLE, "no sample was seen");
    for (int i = 0; i < 3; ++i) result.center_m[i] = result.center_m[i] / (double)result.used - mean[i];
    for (int i = 0; i < 3; ++i) covariance[4 * i] = sigma * sigma / (double)result.used;
#if defined(TWICE)
    for (int i = 0; i < 3; ++i) covariance[4 * i] *= 4;
#elif defined(HALF)
    for (int i = 0; i < 3; ++i) covariance[4 * i] /= 4;
#elif defined(CORRELATED)
    covariance[1] = covariance[3] = 0.9 * covariance[0];
#elif defined(EXACT_ONLY)
    return calib_say(call, CALIB_NOT_OBSERVABLE, "there is noise");
#endif
    result.covariance_m2 = covariance;
#if defined(NEVER)
    result.covariance_m2 = NULL;
#elif defined(SOMETIMES)
    if (motion->seed % 2 == 0) result.covariance_m2 = NULL;
#endif
    return sink->result(sink->context, &result);
}

static const calib_cor_1 table = {.struct_size = sizeof table, .fit = fit};

static const calib_offer offers[] = {{
    .kind = CALIB_KIND_COR,
    .name = "stated",
    .summary = "mean of all points",
    .source = "",
    .shapes = CALIB_TAKES_POINTS,
}};

static const calib_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .offer_size = sizeof offers[0],
    .name = "stated",
    .version = "1.0",
    .author = "the tests",
    .licence = "MIT",
    .offers = offers,
    .offer_count = 1,
};

static const calib_descriptor *describe(void) { return &descriptor; }

static const void *find(const char *kind, const char *name) {
    return strcmp(kind, CALIB_KIND_COR) == 0 && strcmp(name, "stated") == 0 ? &table : NULL;
}

const calib_entry calib_plugin_entry = {
    .abi_major = CALIB_ABI_MAJOR,
    .abi_minor = CALIB_ABI_MINOR,
    .struct_size = sizeof(calib_entry),
    .describe = describe,
    .find = find,
};
