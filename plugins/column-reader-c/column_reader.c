/* column_reader.c: reads tables of numbers without a heading, by a column layout that the profile gives.
 *
 *     columns: "t_s, -, tip.x_mm, tip.y_mm, tip.z_mm, elbow_deg"
 *
 * One entry for each column: `t_s`, `t_ms`; `-` for one that is left out; `NAME.x_m` … `NAME.z_mm` for a marker or a
 * body; `NAME.qx` … `NAME.qw` makes it a body; `NAME_rad`, `NAME_deg`, `NAME_m`, `NAME_mm` for a joint. An empty cell,
 * `nan`, or the text given as `lost` is a lost sample. Everything is converted to SI.
 */
#include "calib_plugin.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_COLUMNS = 1024, LONGEST_NAME = 128, LONGEST_CELL = 64 };

/* Parameters, in the order of the descriptor. */
enum { COLUMNS, SEPARATOR, SKIP_LINES, LOST, COMMENT };

typedef enum { SKIP, TIME, POSITION, QUATERNION, ANGLE, LENGTH } role;

typedef struct {
    role role;
    int part;     /* x y z of a position, x y z w of a quaternion. */
    double scale; /* To SI. */
    size_t track;
} column;

typedef struct {
    char name[LONGEST_NAME];
    role role;       /* POSITION: marker or body; ANGLE, LENGTH: joint. */
    unsigned parts;  /* Bits of the position (0-2) and of the quaternion (3-6). */
    double *numbers; /* rows x 7; joints use the first. */
    uint8_t *mask;
} track;

typedef struct {
    column columns[MOST_COLUMNS];
    size_t column_count;
    track *tracks;
    size_t track_count;
    int has_time;
    size_t rows, capacity;
    double *times;
    uint64_t *lines;
} table;

static calib_status refuse(const calib_call *call, calib_status status, const char *format, ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return calib_say(call, status, text);
}

static void clear(table *t) {
    for (size_t k = 0; k < t->track_count; ++k) {
        free(t->tracks[k].numbers);
        free(t->tracks[k].mask);
    }
    free(t->tracks);
    free(t->times);
    free(t->lines);
}

/* ---- The layout ----------------------------------------------------------------------------------------------- */

static int ends_with(const char *text, const char *ending, size_t *stem) {
    const size_t n = strlen(text), m = strlen(ending);
    if (n <= m || strcmp(text + n - m, ending) != 0) return 0;
    *stem = n - m;
    return 1;
}

/* What one entry of the layout means; `stem`: length of the name. */
static int meaning(const char *entry, column *out, size_t *stem) {
    static const struct { const char *ending; role role; int part; double scale; } endings[] = {
        {".x_mm", POSITION, 0, 1e-3}, {".y_mm", POSITION, 1, 1e-3}, {".z_mm", POSITION, 2, 1e-3},
        {".x_m", POSITION, 0, 1.0},   {".y_m", POSITION, 1, 1.0},   {".z_m", POSITION, 2, 1.0},
        {".qx", QUATERNION, 0, 1.0},  {".qy", QUATERNION, 1, 1.0},  {".qz", QUATERNION, 2, 1.0},
        {".qw", QUATERNION, 3, 1.0},  {"_rad", ANGLE, 0, 1.0},      {"_deg", ANGLE, 0, 0.017453292519943295},
        {"_mm", LENGTH, 0, 1e-3},     {"_m", LENGTH, 0, 1.0},
    };
    *stem = 0;
    out->part = 0;
    out->scale = 1.0;
    out->role = SKIP;
    if (strcmp(entry, "-") == 0) return 1;
    out->role = TIME;
    if (strcmp(entry, "t_s") == 0) return 1;
    out->scale = 1e-3;
    if (strcmp(entry, "t_ms") == 0) return 1;
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; ++i) {
        if (!ends_with(entry, endings[i].ending, stem)) continue;
        out->role = endings[i].role;
        out->part = endings[i].part;
        out->scale = endings[i].scale;
        return 1;
    }
    return 0;
}

static calib_status parse_layout(const calib_call *call, table *t) {
    const char *text = call->values[COLUMNS].text;
    while (1) {
        char entry[LONGEST_NAME];
        size_t n = 0, stem;
        column *c = &t->columns[t->column_count];
        while (*text == ' ') ++text;
        while (text[n] != '\0' && text[n] != ',') ++n;
        size_t trimmed = n;
        while (trimmed > 0 && text[trimmed - 1] == ' ') --trimmed;
        if (t->column_count == MOST_COLUMNS) {
            return refuse(call, CALIB_BAD_PARAMETER, "columns: more than %d", (int)MOST_COLUMNS);
        }
        if (trimmed >= sizeof entry) {
            return refuse(call, CALIB_BAD_PARAMETER, "columns: entry %zu is longer than %d bytes", t->column_count + 1,
                          (int)sizeof entry - 1);
        }
        memcpy(entry, text, trimmed);
        entry[trimmed] = '\0';
        if (!meaning(entry, c, &stem)) {
            return refuse(call, CALIB_BAD_PARAMETER,
                          "columns: entry %zu `%s` is none of `-`, `t_s`, `t_ms`, `NAME.x_mm`, `NAME.qw`, `NAME_deg`, ...",
                          t->column_count + 1, entry);
        }
        if (c->role == TIME) {
            if (t->has_time) return refuse(call, CALIB_BAD_PARAMETER, "columns: time is given twice");
            t->has_time = 1;
        } else if (c->role != SKIP) {
            const role of = c->role == QUATERNION ? POSITION : c->role;
            const unsigned bit = 1u << (c->role == QUATERNION ? 3 + c->part : c->part);
            size_t k = 0;
            entry[stem] = '\0';
            while (k < t->track_count && (t->tracks[k].role != of || strcmp(t->tracks[k].name, entry) != 0)) ++k;
            if (k == t->track_count) {
                track *grown = realloc(t->tracks, (k + 1) * sizeof *grown);
                if (!grown) return refuse(call, CALIB_FAILED, "out of memory");
                t->tracks = grown;
                memset(&grown[k], 0, sizeof grown[k]);
                memcpy(grown[k].name, entry, stem + 1);
                grown[k].role = of;
                ++t->track_count;
            }
            if (t->tracks[k].parts & bit) {
                return refuse(call, CALIB_BAD_PARAMETER, "columns: entry %zu of `%s` is given twice", t->column_count + 1,
                              entry);
            }
            t->tracks[k].parts |= bit;
            c->track = k;
        }
        ++t->column_count;
        if (text[n] == '\0') break;
        text += n + 1;
    }
    if (t->track_count == 0) return refuse(call, CALIB_BAD_PARAMETER, "columns: no marker, body or joint");
    for (size_t k = 0; k < t->track_count; ++k) {
        const track *of = &t->tracks[k];
        if (of->role == POSITION && of->parts != 0x07 && of->parts != 0x7f) {
            return refuse(call, CALIB_BAD_PARAMETER, "columns: `%s` needs x, y, z, and all or none of qx, qy, qz, qw",
                          of->name);
        }
    }
    return CALIB_OK;
}

/* ---- The numbers ---------------------------------------------------------------------------------------------- */

/* A decimal number with a point, whatever the locale: strtod would read `1.5` as 1 where a comma is expected. */
static int parse_number(const char *text, double *out) {
    char whole[LONGEST_CELL + 8];
    const char *p = text;
    size_t digits = 0;
    if (*p == '+' || *p == '-') ++p;
    for (; *p >= '0' && *p <= '9'; ++p) ++digits;
    if (*p == '.') for (++p; *p >= '0' && *p <= '9'; ++p) ++digits;
    if (digits == 0) return 0;
    if (*p == 'e' || *p == 'E') {
        size_t exponent = 0;
        ++p;
        if (*p == '+' || *p == '-') ++p;
        for (; *p >= '0' && *p <= '9'; ++p) ++exponent;
        if (exponent == 0) return 0;
    }
    if (*p != '\0') return 0;
    /* The form is checked: now only the decimal sign of the locale matters. */
    snprintf(whole, sizeof whole, "%.1f", 0.5);
    const char sign = whole[1];
    snprintf(whole, sizeof whole, "%s", text);
    for (char *c = whole; *c; ++c) if (*c == '.') *c = sign;
    *out = strtod(whole, NULL);
    return isfinite(*out);
}

static int is_lost(const char *cell, const char *lost) {
    return *cell == '\0' || strcmp(cell, "nan") == 0 || strcmp(cell, "NaN") == 0 || strcmp(cell, "NAN") == 0 ||
           (*lost != '\0' && strcmp(cell, lost) == 0);
}

static int grow(table *t) {
    if (t->rows < t->capacity) return 1;
    const size_t capacity = t->capacity ? 2 * t->capacity : 256;
    double *times = realloc(t->times, capacity * sizeof *times);
    if (!times) return 0;
    t->times = times;
    uint64_t *lines = realloc(t->lines, capacity * sizeof *lines);
    if (!lines) return 0;
    t->lines = lines;
    for (size_t k = 0; k < t->track_count; ++k) {
        double *numbers = realloc(t->tracks[k].numbers, capacity * 7 * sizeof *numbers);
        if (!numbers) return 0;
        t->tracks[k].numbers = numbers;
        uint8_t *mask = realloc(t->tracks[k].mask, capacity);
        if (!mask) return 0;
        t->tracks[k].mask = mask;
    }
    t->capacity = capacity;
    return 1;
}

/* One line; `line` counts from 1. */
static calib_status parse_line(const calib_call *call, table *t, const char *text, const char *end, char separator,
                               uint64_t line) {
    const char *lost = call->values[LOST].text;
    const size_t row = t->rows;
    const char *p = text;
    size_t i = 0;
    if (!grow(t)) return refuse(call, CALIB_FAILED, "out of memory");
    t->lines[row] = line;
    for (size_t k = 0; k < t->track_count; ++k) {
        memset(t->tracks[k].numbers + 7 * row, 0, 7 * sizeof(double));
        t->tracks[k].mask[row] = CALIB_MEASURED;
    }
    for (;;) {
        char cell[LONGEST_CELL];
        const char *next = p;
        if (separator == ' ') {
            while (p < end && (*p == ' ' || *p == '\t')) ++p;
            if (p == end) break;
            next = p;
            while (next < end && *next != ' ' && *next != '\t') ++next;
        } else {
            while (next < end && *next != separator) ++next;
        }
        const char *from = p, *to = next;
        while (from < to && (*from == ' ' || *from == '\t')) ++from;
        while (to > from && (to[-1] == ' ' || to[-1] == '\t')) --to;
        if (i == t->column_count) {
            return refuse(call, CALIB_BAD_INPUT, "line %llu: more than the %zu columns of the layout",
                          (unsigned long long)line, t->column_count);
        }
        if ((size_t)(to - from) >= sizeof cell) {
            return refuse(call, CALIB_BAD_INPUT, "line %llu, column %zu: longer than %d bytes", (unsigned long long)line,
                          i + 1, (int)sizeof cell - 1);
        }
        memcpy(cell, from, (size_t)(to - from));
        cell[to - from] = '\0';
        const column *c = &t->columns[i++];
        double number = 0;
        if (c->role == SKIP) {
            /* Whatever it is. */
        } else if (c->role != TIME && is_lost(cell, lost)) {
            t->tracks[c->track].mask[row] = CALIB_LOST;
        } else if (!parse_number(cell, &number)) {
            return refuse(call, CALIB_BAD_INPUT, "line %llu, column %zu: `%s` is not a number", (unsigned long long)line, i,
                          cell);
        } else if (c->role == TIME) {
            t->times[row] = number * c->scale;
        } else {
            t->tracks[c->track].numbers[7 * row + (size_t)(c->role == QUATERNION ? 3 + c->part : c->part)] =
                number * c->scale;
        }
        if (next == end) break;
        p = next + 1;
        if (separator == ' ') p = next;
    }
    if (i != t->column_count) {
        return refuse(call, CALIB_BAD_INPUT, "line %llu: %zu columns, the layout has %zu", (unsigned long long)line, i,
                      t->column_count);
    }
    if (t->has_time && row > 0 && !(t->times[row - 1] <= t->times[row])) {
        return refuse(call, CALIB_BAD_INPUT, "line %llu: time goes back from %g s to %g s", (unsigned long long)line,
                      t->times[row - 1], t->times[row]);
    }
    ++t->rows;
    return CALIB_OK;
}

static calib_status parse_rows(const calib_call *call, table *t, const calib_source *source) {
    const char *names[] = {"comma", "semicolon", "tab", "space"}, signs[] = {',', ';', '\t', ' '};
    const char *p = (const char *)source->bytes, *const end = p ? p + source->size : p;
    const char *comment = call->values[COMMENT].text;
    const size_t comment_size = strlen(comment);
    char separator = ',';
    uint64_t line = 0;
    for (size_t i = 0; i < 4; ++i) if (strcmp(call->values[SEPARATOR].text, names[i]) == 0) separator = signs[i];
    while (p < end) {
        const char *stop = memchr(p, '\n', (size_t)(end - p));
        const char *next = stop ? stop + 1 : end;
        if (!stop) stop = end;
        if (stop > p && stop[-1] == '\r') --stop;
        ++line;
        if (line % 4096 == 0) {
            if (call->cancelled(call->context)) return CALIB_CANCELLED;
            call->progress(call->context, (double)(p - (const char *)source->bytes) / (double)source->size, NULL);
        }
        const char *first = p;
        while (first < stop && (*first == ' ' || *first == '\t')) ++first;
        const int is_comment = comment_size > 0 && (size_t)(stop - first) >= comment_size &&
                               memcmp(first, comment, comment_size) == 0;
        if (line > (uint64_t)call->values[SKIP_LINES].integer && first < stop && !is_comment) {
            const calib_status status = parse_line(call, t, p, stop, separator, line);
            if (status != CALIB_OK) return status;
        }
        p = next;
    }
    if (t->rows == 0) return refuse(call, CALIB_BAD_INPUT, "there is no line of numbers");
    return CALIB_OK;
}

/* ---- The streams ---------------------------------------------------------------------------------------------- */

/* tracker_from_body from a quaternion x, y, z, w of about unit length. */
static int to_rotation(const double *q, double *r) {
    const double n = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(n - 1.0) < 0.01)) return 0;
    const double x = q[0] / n, y = q[1] / n, z = q[2] / n, w = q[3] / n;
    r[0] = 1 - 2 * (y * y + z * z); r[1] = 2 * (x * y - z * w);     r[2] = 2 * (x * z + y * w);
    r[3] = 2 * (x * y + z * w);     r[4] = 1 - 2 * (x * x + z * z); r[5] = 2 * (y * z - x * w);
    r[6] = 2 * (x * z - y * w);     r[7] = 2 * (y * z + x * w);     r[8] = 1 - 2 * (x * x + y * y);
    return 1;
}

static calib_status give(const calib_call *call, table *t, const calib_recording_sink *sink) {
    size_t timeline = 0;
    double *first = malloc(t->rows * 3 * sizeof *first), *rotations = malloc(t->rows * 9 * sizeof *rotations);
    calib_status status = CALIB_FAILED;
    if (!first || !rotations) {
        refuse(call, CALIB_FAILED, "out of memory");
        goto done;
    }
    status = sink->timeline(sink->context, "file", t->lines, t->has_time ? t->times : NULL, t->rows, &timeline);
    for (size_t k = 0; k < t->track_count && status == CALIB_OK; ++k) {
        const track *of = &t->tracks[k];
        const size_t width = of->role == POSITION ? 3 : 1;
        for (size_t s = 0; s < t->rows; ++s) {
            memcpy(first + width * s, of->numbers + 7 * s, width * sizeof(double));
            if (of->parts != 0x7f) continue;
            if (of->mask[s] == CALIB_MEASURED && !to_rotation(of->numbers + 7 * s + 3, rotations + 9 * s)) {
                status = refuse(call, CALIB_BAD_INPUT, "line %llu: the quaternion of `%s` has not unit length",
                                (unsigned long long)t->lines[s], of->name);
                goto done;
            }
        }
        if (of->parts == 0x7f) {
            status = sink->body(sink->context, of->name, timeline, rotations, first, of->mask, t->rows);
        } else if (of->role == POSITION) {
            status = sink->marker(sink->context, of->name, timeline, first, of->mask, t->rows);
        } else {
            const int32_t unit = of->role == ANGLE ? CALIB_ANGLE : CALIB_LENGTH;
            status = sink->joint(sink->context, of->name, timeline, unit, first, of->mask, t->rows);
        }
    }
    for (size_t i = 0; i < t->column_count && status == CALIB_OK; ++i) {
        char text[64];
        if (t->columns[i].role != SKIP) continue;
        snprintf(text, sizeof text, "Column %zu is left out, as the layout says.", i + 1);
        status = sink->note(sink->context, text);
    }
done:
    free(first);
    free(rotations);
    return status;
}

static calib_status read(const calib_call *call, const calib_source *source, const calib_recording_sink *sink) {
    table *t = calloc(1, sizeof *t);
    if (!t) return refuse(call, CALIB_FAILED, "out of memory");
    calib_status status = parse_layout(call, t);
    if (status == CALIB_OK) status = parse_rows(call, t, source);
    if (status == CALIB_OK) status = give(call, t, sink);
    clear(t);
    free(t);
    return status;
}

/* ---- The description of the reader ----------------------------------------------------------------------------- */

static const char *const separators[] = {"comma", "semicolon", "tab", "space"};

static const calib_parameter parameters[] = {
    {.name = "columns", .required = 1,
     .summary = "one entry for each column: t_s, -, NAME.x_mm, NAME.qw, NAME_deg, ...",
     .value = {.type = CALIB_TEXT, .text = "t_s, tip.x_mm, tip.y_mm, tip.z_mm, -, elbow_deg"}},
    {.name = "separator", .summary = "what stands between two cells",
     .value = {.type = CALIB_TEXT, .text = "comma"}, .choices = separators, .choice_count = 4},
    {.name = "skip_lines", .summary = "lines above the numbers",
     .value = {.type = CALIB_INTEGER, .integer = 0}, .minimum = 0, .maximum = 1e9},
    {.name = "lost", .summary = "cell that stands for a lost sample, besides an empty one and nan",
     .value = {.type = CALIB_TEXT, .text = ""}},
    {.name = "comment", .summary = "beginning of lines that are left out",
     .value = {.type = CALIB_TEXT, .text = "#"}},
};

static const char example[] = "# t, tip, quality, elbow\n0.00, 100, 200, 300, good, 90\n0.01, , , , lost, 45\n";

static const calib_offer offers[] = {{
    .kind = CALIB_KIND_READER,
    .name = "columns",
    .summary = "tables of numbers without a heading, by a layout that the profile gives",
    .source = "",
    .parameter_size = sizeof parameters[0],
    .parameters = parameters,
    .parameter_count = sizeof parameters / sizeof parameters[0],
    .example = (const uint8_t *)example,
    .example_size = sizeof example - 1,
}};

static const calib_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .offer_size = sizeof offers[0],
    .name = "column-reader",
    .version = "0.1.0",
    .author = "the calib authors",
    .licence = "MIT OR Apache-2.0",
    .offers = offers,
    .offer_count = sizeof offers / sizeof offers[0],
};

static const calib_descriptor *describe(void) { return &descriptor; }

/* Any table of numbers could be one of these: only a profile that names it knows. */
static const calib_reader_1 reader = {.struct_size = sizeof reader, .read = read, .recognizes = NULL};

static const void *find(const char *kind, const char *name) {
    return strcmp(kind, CALIB_KIND_READER) == 0 && strcmp(name, "columns") == 0 ? &reader : NULL;
}

const calib_entry calib_plugin_entry = {
    .abi_major = CALIB_ABI_MAJOR,
    .abi_minor = CALIB_ABI_MINOR,
    .struct_size = sizeof(calib_entry),
    .describe = describe,
    .find = find,
};
