/* A joint effect; one bad deed for each macro. */
#include "calib_plugin.h"

#include <math.h>
#include <string.h>

#define MOST 1000000

static calib_status regressors(const calib_call *call, const calib_joint_states *states,
                               const calib_effect_sink *sink) {
    static _Thread_local double f[MOST];
    size_t count = states->samples;
    (void)call;
    if (count >= MOST) return calib_say(call, CALIB_BAD_INPUT, "too many samples");
    for (size_t s = 0; s < count; ++s) f[s] = sin(3 * states->readings[s]);
#if defined(NOT_A_NUMBER)
    if (count > 2) f[2] = NAN;
#elif defined(ALL_NAN)
    for (size_t s = 0; s < count; ++s) f[s] = NAN;
#elif defined(WRONG_LENGTH)
    count += 1;
#elif defined(NOT_OBSERVABLE)
    return CALIB_NOT_OBSERVABLE;
#elif defined(SAYS_NOTHING)
    return CALIB_OK;
#elif defined(FAILS_AT_LARGE)
    for (size_t s = 0; s < count; ++s)
        if (states->readings[s] > 1) return calib_say(call, CALIB_FAILED, "no table beyond 1 rad");
#elif defined(BY_ORDER)
    for (size_t s = 1; s < count; ++s) f[s] += 1e-3 * f[s - 1];
#elif defined(JUMPS)
    for (size_t s = 0; s < count; ++s) f[s] = floor(states->readings[s] * 100 - 0.50005) > 0;
#elif defined(STEPS_ONCE)
    for (size_t s = 0; s < count; ++s) f[s] = states->readings[s] > 0.5;
#elif defined(WRAPS)
    for (size_t s = 0; s < count; ++s) f[s] = remainder(states->readings[s] - 1, 6.283185307179586);
#elif defined(LESS_THE_MEAN)
    double mean = 0;
    for (size_t s = 0; s < count; ++s) mean += states->readings[s] / (double)count;
    for (size_t s = 0; s < count; ++s) f[s] = states->readings[s] - mean;
#elif defined(STEEP)
    for (size_t s = 0; s < count; ++s) f[s] = tanh(200 * states->readings[s]);
#elif defined(BY_SIGN_OF_LOAD)
    for (size_t s = 0; s < count; ++s) f[s] = states->loads[s] > 0 ? 1 : -1;
#elif defined(ON_MOTOR)
    for (size_t s = 0; s < count; ++s) f[s] = sin(states->motor_rad[s]);
#elif defined(ON_LOAD)
    for (size_t s = 0; s < count; ++s) f[s] = states->loads[s] * states->loads[s] * states->loads[s];
#elif defined(ON_APPROACH)
    for (size_t s = 0; s < count; ++s) f[s] = -states->approaches[s] * cos(states->readings[s]);
#endif
    return sink->result(sink->context, f, count);
}

static const calib_effect_1 table = {
    .struct_size = sizeof table,
#if defined(BAD_SOURCE)
    .depends_on = 9,
#elif defined(ON_MOTOR)
    .depends_on = CALIB_ON_MOTOR,
#elif defined(ON_LOAD) || defined(BY_SIGN_OF_LOAD)
    .depends_on = CALIB_ON_LOAD,
#elif defined(ON_APPROACH)
    .depends_on = CALIB_ON_APPROACH,
#else
    .depends_on = CALIB_ON_READING,
#endif
#if defined(BAD_COEFFICIENT)
    .coefficient = 0,
#else
    .coefficient = CALIB_POSITION,
#endif
    .revolute_only = 1,
#if defined(NO_PRIOR)
    .prior_sigma = 0,
#else
    .prior_sigma = 0.0087,
#endif
#if defined(NO_FUNCTION)
    .regressors = sizeof(&regressors) > 0 ? NULL : regressors,
#else
    .regressors = regressors,
#endif
};

static const calib_offer offers[] = {{
    .kind = CALIB_KIND_EFFECT,
#if defined(BUILT_IN)
    .name = "gain",
#else
    .name = "third",
#endif
    .summary = "third harmonic of the reading",
    .source = "",
    .parameter_size = sizeof(calib_parameter),
}};

static const calib_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .offer_size = sizeof offers[0],
    .name = "waves",
    .version = "0.3.0",
    .author = "a test",
    .licence = "MIT",
    .offers = offers,
    .offer_count = 1,
};

static const calib_descriptor *describe(void) { return &descriptor; }

static const void *find(const char *kind, const char *name) {
    return strcmp(kind, offers[0].kind) == 0 && strcmp(name, offers[0].name) == 0 ? &table : NULL;
}

const calib_entry calib_plugin_entry = {
    .abi_major = CALIB_ABI_MAJOR,
    .abi_minor = CALIB_ABI_MINOR,
    .struct_size = sizeof(calib_entry),
    .describe = describe,
    .find = find,
};
