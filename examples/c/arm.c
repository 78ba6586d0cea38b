/* A control loop with a calibrated robot: arm MODEL.json
 *
 * Reads the model, then does for each cycle what a controller would: it takes the position that its planner wants, asks for the
 * command that brings the tool there, and checks the answer before it would send it. Compiles as C11 and as C++17.
 */
#include "calib_model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST_JOINTS = 64, CYCLES = 1000 };

/* The whole file; NULL where it cannot be read. */
static char *read_file(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    char *text = NULL;
    long size;
    if (file == NULL) {
        return NULL;
    }
    if (fseek(file, 0, SEEK_END) == 0 && (size = ftell(file)) > 0 && fseek(file, 0, SEEK_SET) == 0) {
        text = (char *)malloc((size_t)size);
        if (text != NULL) {
            *length = fread(text, 1, (size_t)size, file);
        }
    }
    fclose(file);
    return text;
}

static int control(const calib_model *model, calib_model_work *work)
{
    const size_t joints = calib_model_joints(model);
    const size_t tool = calib_model_links(model) - 1;
    const calib_model_options options = calib_model_default_options(0);
    double desired[MOST_JOINTS], command[MOST_JOINTS], pose[12], worst = 0.0;
    double jacobian[6 * MOST_JOINTS], covariance[36];
    calib_model_correction correction;
    int cycle, status, refused = 0, outside = 0;
    size_t j;

    for (cycle = 0; cycle < CYCLES; ++cycle) {
        for (j = 0; j < joints; ++j) {
            desired[j] = 0.4 * sin(0.01 * cycle + (double)j);
        }
        status = calib_model_correct(model, work, desired, NULL, tool, &options, command, &correction);
        if (status < 0) {
            return status;
        }
        if (status == CALIB_MODEL_NOT_REACHED || status == CALIB_MODEL_BEYOND_LIMITS) {
            ++refused; /* the command is the desired position: as without calibration */
        }
        /* Here the command goes to the motors; then the model is told, for the backlash. */
        if ((status = calib_model_moved_to(model, work, command)) < 0) {
            return status;
        }
        outside += calib_model_in_scope(model, command, NULL) != CALIB_MODEL_OK;
        worst = correction.step > worst ? correction.step : worst;
    }
    if ((status = calib_model_fk(model, work, command, NULL, tool, pose)) < 0
        || (status = calib_model_jacobian(model, work, command, NULL, tool, jacobian)) < 0) {
        return status;
    }
    printf("%d cycles, %d refused, %d outside of the fitted range; largest correction %.6f\n", CYCLES, refused, outside, worst);
    printf("%s at %.6f %.6f %.6f m\n", calib_model_link_name(model, tool), pose[3], pose[7], pose[11]);
    status = calib_model_sigma(model, work, command, NULL, tool, covariance);
    if (status == CALIB_MODEL_OK) {
        printf("sigma %.3e %.3e %.3e m\n", sqrt(covariance[21]), sqrt(covariance[28]), sqrt(covariance[35]));
    } else if (status != CALIB_MODEL_NO_UNCERTAINTY) {
        return status;
    }
    return CALIB_MODEL_OK;
}

int main(int argc, char **argv)
{
    size_t length = 0;
    char message[256] = "";
    char *text = argc == 2 ? read_file(argv[1], &length) : NULL;
    calib_model *model = NULL;
    calib_model_work *work = NULL;
    int status;

    if (text == NULL) {
        fprintf(stderr, "usage: arm MODEL.json\n");
        return 2;
    }
    status = calib_model_load(text, length, &model, message, sizeof message);
    free(text);
    if (status != CALIB_MODEL_OK) {
        fprintf(stderr, "%s: %s\n", argv[1], message);
        return 3;
    }
    work = calib_model_work_new(model);
    status = work != NULL && calib_model_joints(model) <= MOST_JOINTS ? control(model, work) : CALIB_MODEL_FAILED;
    calib_model_work_free(work);
    calib_model_free(model);
    if (status != CALIB_MODEL_OK) {
        fprintf(stderr, "status %d\n", status);
        return 1;
    }
    return 0;
}
