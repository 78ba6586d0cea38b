/* calib_plugin.h: the plugin contract, version 1.
 *
 * A plugin is a shared library that exports one constant, `calib_plugin_entry`. It offers estimators, readers,
 * report writers and joint effects, each under a kind (`calib.cor/1`, `calib.aor/1`, `calib.reader/1`,
 * `calib.report/1`, `calib.effect/1`) and a name.
 *
 *     load        the host reads abi_major, abi_minor and struct_size: no code of the plugin has run
 *     describe()  what is offered, with parameters; does no work
 *     find()      the function table of one offer
 *     fit() / read() / write() / regressors()
 *
 * Units: m, rad, s, N·m. Rotations: 3 x 3, row-major, `a_from_b`: its columns are the axes of b in a.
 * Text: UTF-8, ends with a zero byte, at most 65535 bytes; files are bytes with a size.
 *
 * Memory. Nobody frees what the other side made. What the host passes is valid until the function returns; what a
 * plugin passes to a callback is valid until the callback returns, and the host copies it. What describe() and
 * find() return stays valid and unchanged until the process ends: libraries are never unloaded.
 *
 * Threads. Every function of a plugin may be called from any thread and from several at once. `cancelled` and
 * `progress` may be called from any thread while the function runs; sinks and `text` only from the thread that the
 * host called on. Nothing of the host may be used after the function has returned.
 *
 * Failures. A function returns a status and may write one line to `call->text`. No exception, panic or longjmp may
 * cross the border: catch it and return CALIB_PANICKED. A result that was passed to a sink counts only when the
 * function then returns CALIB_OK.
 *
 * Growth. Same major: loads, whatever the minor. A struct may only grow at its end, and its first field, or the field
 * of the struct that holds the array (`offer_size`, `parameter_size`), says how large the writer's is. Who reads
 * takes what both know: test with CALIB_HAS before reading a field that came later. A new kind is a new id, never a
 * new function in an old table. Offers of a kind, or with a type of parameter, that the host does not know are
 * skipped with a message. A change that breaks this is a new major and a new symbol of the same name.
 */
#ifndef CALIB_PLUGIN_H
#define CALIB_PLUGIN_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CALIB_ABI_MAJOR 1u
#define CALIB_ABI_MINOR 0u

#if defined(_WIN32)
#define CALIB_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define CALIB_EXPORT __attribute__((visibility("default")))
#else
#define CALIB_EXPORT
#endif

/* True when the writer of *pointer knew the field. `pointer` must have struct_size as its first field. */
#define CALIB_HAS(type, pointer, field) \
    (offsetof(type, field) + sizeof((pointer)->field) <= (pointer)->struct_size)

/* ---- Status --------------------------------------------------------------------------------------------------- */

typedef int32_t calib_status;
enum {
    CALIB_OK = 0,             /* The result was given to the sink. */
    CALIB_NOT_OBSERVABLE = 1, /* The data cannot answer; text says why. A result, not an error. */
    CALIB_BAD_INPUT = 2,      /* The input is not what this plugin reads; text says where and why. */
    CALIB_BAD_PARAMETER = 3,  /* Parameters that are each in range do not go together. */
    CALIB_CANCELLED = 4,      /* Stopped because cancelled() said so. */
    CALIB_FAILED = 5,         /* Anything else. */
    CALIB_PANICKED = 6        /* An exception or panic was stopped at the border. */
};

/* ---- Description ---------------------------------------------------------------------------------------------- */

#define CALIB_KIND_COR "calib.cor/1"
#define CALIB_KIND_AOR "calib.aor/1"
#define CALIB_KIND_READER "calib.reader/1"
#define CALIB_KIND_REPORT "calib.report/1"
#define CALIB_KIND_EFFECT "calib.effect/1"

enum { CALIB_BOOL = 1, CALIB_INTEGER = 2, CALIB_NUMBER = 3, CALIB_TEXT = 4 };

/* A value; `type` says which field holds it, the others are zero. Never grows. */
typedef struct calib_value {
    int32_t type;
    int32_t flag;     /* CALIB_BOOL: 0 or 1. */
    int64_t integer;  /* CALIB_INTEGER. */
    double number;    /* CALIB_NUMBER, finite. */
    const char *text; /* CALIB_TEXT. */
} calib_value;

typedef struct calib_parameter {
    const char *name;           /* [a-z][a-z0-9_]*, with its unit: `gate_mm`. */
    const char *summary;        /* One line. */
    calib_value value;          /* The default. Of a required parameter: an example, used by the conformance check. */
    double minimum;             /* CALIB_INTEGER, CALIB_NUMBER: limits, both included; none if not minimum < maximum. */
    double maximum;
    const char *const *choices; /* CALIB_TEXT: the texts there are; NULL: any. */
    size_t choice_count;
    int32_t required;           /* 1: the profile must give it. */
    int32_t reserved;           /* 0. */
} calib_parameter;

typedef struct calib_offer {
    const char *kind;    /* CALIB_KIND_... */
    const char *name;    /* [a-z][a-z0-9_-]*: how a profile names it. Unique within its kind. */
    const char *summary; /* One line. */
    const char *source;  /* Publication or document; "" if none. */
    uint32_t shapes;     /* cor, aor: the data it takes, CALIB_TAKES_... combined; else 0. */
    uint32_t parameter_size; /* sizeof(calib_parameter) */
    const calib_parameter *parameters;
    size_t parameter_count;
    /* The struct may end here. */
    const uint8_t *example; /* reader: a small valid input for default parameters, used by the conformance check. */
    size_t example_size;
} calib_offer;

typedef struct calib_descriptor {
    uint32_t struct_size; /* sizeof(calib_descriptor) */
    uint32_t offer_size;  /* sizeof(calib_offer) */
    const char *name;     /* [a-z][a-z0-9_-]*; messages call the plugin so. */
    const char *version;  /* The plugin's own. */
    const char *author;
    const char *licence; /* SPDX. */
    const calib_offer *offers;
    size_t offer_count;
} calib_descriptor;

typedef struct calib_entry {
    uint32_t abi_major;   /* CALIB_ABI_MAJOR; first in every version there will ever be. */
    uint32_t abi_minor;   /* CALIB_ABI_MINOR */
    uint32_t struct_size; /* sizeof(calib_entry) */
    uint32_t reserved;    /* 0. */

    /* What the plugin offers. Does no work: reads no file, starts no thread, allocates at most its own tables.
     * [any time after loading; any thread, also concurrently; the plugin owns what it returns, for ever] */
    const calib_descriptor *(*describe)(void);

    /* The table of one offer (calib_cor_1, calib_aor_1, ... by kind), NULL for what is not offered.
     * [any time after loading; any thread, also concurrently; the plugin owns what it returns, for ever] */
    const void *(*find)(const char *kind, const char *name);
} calib_entry;

/* The one symbol of a plugin. */
CALIB_EXPORT extern const calib_entry calib_plugin_entry;

/* ---- One call ------------------------------------------------------------------------------------------------- */

/* What every function is given beside its data. The host owns all of it; valid until the function returns. */
typedef struct calib_call {
    uint32_t struct_size;
    uint32_t reserved;
    const calib_value *values; /* One for each parameter of the offer, in its order, checked, defaults filled in. */
    size_t value_count;
    char *text; /* One line for a person: the reason of a status, or of a weak result. Ends with a zero byte. */
    size_t text_size;
    void *context; /* For the callbacks. */

    /* Nonzero: stop, return CALIB_CANCELLED. Ask at least every 50 ms.
     * [while the function runs; any thread] */
    int32_t (*cancelled)(void *context);

    /* How far, 0 to 1, and at what (may be NULL). The host copies the text.
     * [while the function runs; any thread] */
    void (*progress)(void *context, double fraction, const char *text);
} calib_call;

/* ---- calib.cor/1 and calib.aor/1 ------------------------------------------------------------------------------ */

enum {
    CALIB_POINTS = 1,    /* Markers on the moving limb, not necessarily rigid to each other. */
    CALIB_MARKERS = 2,   /* Markers of one rigid body, seen together. */
    CALIB_POSES = 3,     /* Poses of one body. */
    CALIB_TWO_BODIES = 4 /* Simultaneous poses of both sides of the joint; track 0: the body of reference (parent). */
};
#define CALIB_TAKES(shape) (1u << (shape))
#define CALIB_TAKES_POINTS CALIB_TAKES(1)
#define CALIB_TAKES_MARKERS CALIB_TAKES(2)
#define CALIB_TAKES_POSES CALIB_TAKES(3)
#define CALIB_TAKES_TWO_BODIES CALIB_TAKES(4)

/* The motion of one joint in one tracker frame. Sample s of track k stands at row k * samples + s of each table.
 * Seen samples are finite and rotations are rotations (the host has checked); samples that were lost are zero. */
typedef struct calib_motion {
    uint32_t struct_size;
    uint32_t shape; /* CALIB_POINTS, ... */
    size_t tracks;  /* Markers; poses: 1; two bodies: 2. */
    size_t samples; /* Of each track. */
    const uint8_t *seen;          /* tracks x samples: 0 lost, 1 seen. */
    const double *points_m;       /* tracks x samples x 3. Points, markers; else NULL. */
    const double *rotations;      /* tracks x samples x 9: tracker_from_body. Poses; else NULL. */
    const double *translations_m; /* tracks x samples x 3. Poses; else NULL. */
    const double *covariances_m2; /* tracks x samples x 9, of each point; NULL: not known. */
    const double *angles_rad;     /* samples: joint angle from the encoders; NULL: not known. */
    const double *center_m;       /* 3: aor: a point the axis must pass through; NULL: free. */
    const double *towards;        /* 3: aor: the axis points to this side where angles do not say; NULL: free. */
    double sigma_t_m;    /* Position noise of one coordinate as the tracker states it; 0: not stated. */
    double sigma_r_rad;  /* Orientation noise about one axis; 0: not stated. */
    double significance; /* Probability of calling an unanswerable recording answerable, in (0, 1). */
    uint64_t seed;       /* Of all random numbers: same input and seed, same bytes. */
} calib_motion;

typedef struct calib_cor_result {
    uint32_t struct_size;
    int32_t weak;        /* 1: determined, but badly; text says why. */
    double center_m[3];  /* In the tracker's frame; two bodies: in track 0. */
    double rms_m;        /* Of the residuals. */
    size_t used;         /* Samples used. */
    const double *covariance_m2; /* 9, symmetric; NULL: not known. */
    const double *body_points_m; /* The center in each body: poses 3, two bodies 6; NULL: not known. */
    size_t body_point_count;     /* Points, not numbers: 0, or tracks. */
    const double *radii_m;       /* Of each marker, 0 for one that has none; NULL: not known. */
    size_t radius_count;         /* 0, or tracks. */
    const size_t *rejected;      /* Samples left out as wrong: pairs (track, sample). */
    size_t rejected_count;       /* Pairs. */
} calib_cor_result;

typedef struct calib_cor_sink {
    uint32_t struct_size;
    uint32_t reserved;
    void *context;
    /* Gives the result; once. CALIB_OK, or CALIB_FAILED when the host refuses it.
     * [while fit() runs; the thread of fit(); the host copies everything] */
    calib_status (*result)(void *context, const calib_cor_result *result);
} calib_cor_sink;

typedef struct calib_cor_1 {
    uint32_t struct_size;
    uint32_t reserved;
    /* Finds the center of rotation.
     * [after find(); any thread, also concurrently; the host owns the arguments until the function returns] */
    calib_status (*fit)(const calib_call *call, const calib_motion *motion, const calib_cor_sink *sink);
} calib_cor_1;

typedef struct calib_aor_result {
    uint32_t struct_size;
    int32_t weak;        /* 1: determined, but badly; text says why. */
    double point_m[3];   /* A point of the axis, in the tracker's frame; two bodies: in track 0. */
    double direction[3]; /* Unit length. */
    double rms_m;        /* Of the residuals. */
    size_t used;         /* Samples used. */
    const double *covariance; /* 36, symmetric, over [direction; point] (rad, m); NULL: not known. */
    const double *in_child;   /* 6: [point; direction] in the moving body; NULL: not known. */
    const size_t *rejected;   /* Samples left out as wrong: pairs (track, sample). */
    size_t rejected_count;    /* Pairs. */
} calib_aor_result;

typedef struct calib_aor_sink {
    uint32_t struct_size;
    uint32_t reserved;
    void *context;
    /* Gives the result; once. CALIB_OK, or CALIB_FAILED when the host refuses it.
     * [while fit() runs; the thread of fit(); the host copies everything] */
    calib_status (*result)(void *context, const calib_aor_result *result);
} calib_aor_sink;

typedef struct calib_aor_1 {
    uint32_t struct_size;
    uint32_t reserved;
    /* Finds the axis of rotation.
     * [after find(); any thread, also concurrently; the host owns the arguments until the function returns] */
    calib_status (*fit)(const calib_call *call, const calib_motion *motion, const calib_aor_sink *sink);
} calib_aor_1;

/* ---- calib.reader/1 ------------------------------------------------------------------------------------------- */

typedef struct calib_source {
    uint32_t struct_size;
    uint32_t reserved;
    const char *name;     /* Of the file, for messages; not a path to open. */
    const uint8_t *bytes; /* The whole file. */
    size_t size;
} calib_source;

enum { CALIB_LOST = 0, CALIB_MEASURED = 1, CALIB_FILLED = 2 /* Interpolated. Only markers. */ };
enum { CALIB_ANGLE = 1, CALIB_LENGTH = 2 };

/* Takes the streams of a recording. Every function copies, and returns CALIB_OK, or CALIB_FAILED when what it was
 * given breaks the contract: return at once then. Masks hold CALIB_LOST, ...; lost numbers are ignored.
 * [all: while read() runs; the thread of read(); the plugin owns the arguments] */
typedef struct calib_recording_sink {
    uint32_t struct_size;
    uint32_t reserved;
    void *context;

    /* Adds sampling instants, writes their index to *timeline. `clock`: which clock, one text per clock. `rows`: where
     * each sample stands in the file (frame number or line, from 1). `t_s`: s, never decreasing; NULL: static poses. */
    calib_status (*timeline)(void *context, const char *clock, const uint64_t *rows, const double *t_s, size_t count,
                             size_t *timeline);
    /* A text column that names samples, e.g. `trial`. No name that tables read as something else, as `pose`, `t_s` or
     * `elbow_rad`: the label would be lost. */
    calib_status (*label)(void *context, size_t timeline, const char *name, const char *const *texts, size_t count);
    /* A marker: count x 3. */
    calib_status (*marker)(void *context, const char *name, size_t timeline, const double *points_m,
                           const uint8_t *mask, size_t count);
    /* A body: count x 9 and count x 3, tracker_from_body. */
    calib_status (*body)(void *context, const char *name, size_t timeline, const double *rotations,
                         const double *translations_m, const uint8_t *mask, size_t count);
    /* A joint; `unit`: CALIB_ANGLE (rad) or CALIB_LENGTH (m). */
    calib_status (*joint)(void *context, const char *name, size_t timeline, int32_t unit, const double *values,
                          const uint8_t *mask, size_t count);
    /* The torque of a joint, N·m. */
    calib_status (*torque)(void *context, const char *name, size_t timeline, const double *values,
                           const uint8_t *mask, size_t count);
    /* What the reader converted or left out: one sentence. */
    calib_status (*note)(void *context, const char *text);
} calib_recording_sink;

typedef struct calib_reader_1 {
    uint32_t struct_size;
    uint32_t reserved;
    /* Reads a file that the host has loaded.
     * [after find(); any thread, also concurrently; the host owns the arguments until the function returns] */
    calib_status (*read)(const calib_call *call, const calib_source *source, const calib_recording_sink *sink);
    /* The struct may end here. */
    /* Nonzero when these first bytes (at most 4096) look like this reader's format. May be NULL: only by name.
     * [after find(); any thread, also concurrently; the host owns `head`] */
    int32_t (*recognizes)(const uint8_t *head, size_t size);
} calib_reader_1;

/* ---- calib.report/1 ------------------------------------------------------------------------------------------- */

typedef struct calib_report_input {
    uint32_t struct_size;
    uint32_t reserved;
    const uint8_t *report_json; /* What `report.json` holds; SI. */
    size_t report_size;
    const uint8_t *scene_json; /* What `scene.json` holds; NULL: there is none. */
    size_t scene_size;
} calib_report_input;

typedef struct calib_files_sink {
    uint32_t struct_size;
    uint32_t reserved;
    void *context;
    /* Gives one file. `path`: relative, `/` between folders, no `..`. `calib run` puts it beside the report, with the
     * writer's name in front and `.` for `/`: `pages/a.txt` of `my_form` is `my_form.pages.a.txt`. The host writes all files after write() has
     * returned CALIB_OK, or none. CALIB_FAILED when the path is refused.
     * [while write() runs; the thread of write(); the host copies everything] */
    calib_status (*file)(void *context, const char *path, const uint8_t *bytes, size_t size);
} calib_files_sink;

typedef struct calib_report_1 {
    uint32_t struct_size;
    uint32_t reserved;
    /* Makes files from a report; writes none itself.
     * [after find(); any thread, also concurrently; the host owns the arguments until the function returns] */
    calib_status (*write)(const calib_call *call, const calib_report_input *report, const calib_files_sink *sink);
} calib_report_1;

/* ---- calib.effect/1 ------------------------------------------------------------------------------------------- */

/* An effect of a joint: the joint stands at reading + coefficient * regressor (rad or m). The fit estimates the
 * coefficient with all others; a profile names the effect for a joint. */

/* What the regressor depends on. The host gives nothing else. */
enum {
    CALIB_ON_READING = 1,
    CALIB_ON_MOTOR = 2,   /* The motor's angle; the profile must state the gear ratio. */
    CALIB_ON_LOAD = 3,    /* What gravity exerts about (along) the axis. */
    CALIB_ON_APPROACH = 4 /* The direction that the joint came from. */
};

/* What the coefficient measures. */
enum {
    CALIB_POSITION = 1,  /* rad, m at a sliding joint. */
    CALIB_RATIO = 2,     /* 1. */
    CALIB_COMPLIANCE = 3 /* rad/(N·m), m/N at a sliding joint. */
};

/* States of one joint, one per sample. Arrays that the effect does not depend on are NULL. */
typedef struct calib_joint_states {
    uint32_t struct_size;
    int32_t prismatic;        /* 1: the joint slides. */
    size_t samples;
    const double *readings;   /* rad, m at a sliding joint; never NULL. */
    const double *motor_rad;  /* CALIB_ON_MOTOR: gear ratio times reading. */
    const double *loads;      /* CALIB_ON_LOAD: N·m, N at a sliding joint; minus what the joint holds. */
    const double *approaches; /* CALIB_ON_APPROACH: +1 from below, -1 from above, 0 not known. */
} calib_joint_states;

typedef struct calib_effect_sink {
    uint32_t struct_size;
    uint32_t reserved;
    void *context;
    /* Gives the regressors, one finite number per sample; once. CALIB_OK, or CALIB_FAILED when the host refuses them.
     * [while regressors() runs; the thread of regressors(); the host copies everything] */
    calib_status (*result)(void *context, const double *regressors, size_t count);
} calib_effect_sink;

typedef struct calib_effect_1 {
    uint32_t struct_size;
    int32_t depends_on;    /* CALIB_ON_READING, ... */
    int32_t coefficient;   /* CALIB_POSITION, ... */
    int32_t revolute_only; /* 1: for turning joints only. */
    double prior_sigma;    /* Standard deviation of the coefficient on an ordinary joint before any data, > 0. */
    /* The regressor at each state. It is a function of that state alone: not of other samples, their number or order,
     * and not of earlier calls. It has no jumps in the reading: poses are differentiated by it.
     * [after find(); any thread, also concurrently; the host owns the arguments until the function returns] */
    calib_status (*regressors)(const calib_call *call, const calib_joint_states *states, const calib_effect_sink *sink);
} calib_effect_1;

/* ---- Help for authors ----------------------------------------------------------------------------------------- */

/* Puts a text where the host will read it, cut to what fits, and returns the status: `return calib_say(call, ...)`. */
static inline calib_status calib_say(const calib_call *call, calib_status status, const char *text) {
    size_t i = 0;
    if (call->text_size == 0) return status;
    while (i + 1 < call->text_size && text[i] != '\0') {
        call->text[i] = text[i];
        ++i;
    }
    call->text[i] = '\0';
    return status;
}

#ifdef __cplusplus
}
#endif

#endif
