/* What is refused leaves its outputs as they were. Usage: refused MODEL.json; ends with 0, or with the number of the line that does not hold. */
#include "calib_model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST = 16, MARK = 77 };

#define HOLDS(what) do { if (!(what)) { fprintf(stderr, "line %d: %s\n", __LINE__, #what); return 1; } } while (0)

static int is_marked(const double *values, int n)
{
    for (int i = 0; i < n; ++i) {
        if (values[i] != MARK) {
            return 0;
        }
    }
    return 1;
}

static int refuses(const calib_model *model, calib_model_work *work, calib_model_work *foreign)
{
    int n = (int)calib_model_joints(model);
    size_t none = calib_model_links(model), tip = none - 1;
    double good[MOST] = {0}, bad[MOST] = {0}, out[36 + 6 * MOST], pose[12] = {0};

    bad[0] = NAN;
    for (int i = 0; i < 36 + 6 * MOST; ++i) {
        out[i] = MARK;
    }
    HOLDS(calib_model_fk(model, work, bad, NULL, tip, out) < 0 && is_marked(out, 12));
    HOLDS(calib_model_fk(model, work, good, bad, tip, out) < 0 && is_marked(out, 12));
    HOLDS(calib_model_fk(model, work, good, NULL, none, out) < 0 && is_marked(out, 12));
    HOLDS(calib_model_fk(model, work, NULL, NULL, tip, out) < 0 && is_marked(out, 12));
    HOLDS(calib_model_jacobian(model, work, bad, NULL, tip, out) < 0 && is_marked(out, 6 * n));
    HOLDS(calib_model_sigma(model, work, bad, NULL, tip, out) < 0 && is_marked(out, 36));
    HOLDS(calib_model_correct(model, work, bad, NULL, tip, NULL, out, NULL) < 0 && is_marked(out, n));
    HOLDS(calib_model_correct(model, work, good, bad, tip, NULL, out, NULL) < 0 && is_marked(out, n));
    HOLDS(calib_model_correct(model, work, good, NULL, none, NULL, out, NULL) < 0 && is_marked(out, n));
    HOLDS(calib_model_correct(model, work, good, NULL, tip, NULL, NULL, NULL) < 0);
    HOLDS(calib_model_correct(model, foreign, good, NULL, tip, NULL, out, NULL) < 0 && is_marked(out, n));
    HOLDS(calib_model_set_temperature(model, work, bad) < 0 && calib_model_set_temperature(NULL, work, good) < 0);
    HOLDS(calib_model_set_temperature(model, NULL, good) < 0 && calib_model_set_temperature(model, work, NULL) == CALIB_MODEL_OK);
    pose[3] = NAN;
    HOLDS(calib_model_ik(model, work, pose, good, NULL, tip, NULL, out, NULL) < 0 && is_marked(out, n));
    HOLDS(calib_model_ik(model, work, good, bad, NULL, tip, NULL, out, NULL) < 0 && is_marked(out, n));
    /* What was refused leaves the memory of the thread as it was. */
    HOLDS(calib_model_correct(model, work, good, NULL, tip, NULL, out, NULL) >= 0 && !is_marked(out, n));
    return 0;
}

int main(int argc, char **argv)
{
    static char text[1 << 20];
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    calib_model *model = NULL, *small = NULL;
    static const char nothing[] = "{}";

    HOLDS(file != NULL);
    size_t length = fread(text, 1, sizeof text, file);
    fclose(file);
    HOLDS(calib_model_load(nothing, 2, &small, NULL, 0) < 0 && small == NULL);
    HOLDS(calib_model_load(NULL, 0, &small, NULL, 0) < 0 && small == NULL);
    HOLDS(calib_model_load(text, length, &model, NULL, 0) == CALIB_MODEL_OK);
    HOLDS(calib_model_joints(model) <= MOST && calib_model_links(model) > 0);
    calib_model_work *work = calib_model_work_new(model);
    HOLDS(work != NULL && calib_model_work_new(NULL) == NULL);
    int failed = refuses(model, work, NULL);
    calib_model_work_free(work);
    calib_model_free(model);
    return failed;
}
