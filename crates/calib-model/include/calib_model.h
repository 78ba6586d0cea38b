/* calib_model.h: a calibrated robot in a control loop, version 1.
 *
 * Reads `<robot>.calibrated.model.json` as `calib run` writes it.
 *
 *     calib_model_load        once: reads the text of the file; the model never changes afterwards
 *     calib_model_work_new    once for each thread
 *     everything else         in the loop: no memory is taken, nothing is locked, nothing is written but the outputs
 *
 * Units: rad, m, N m. Joint arrays have calib_model_joints() numbers, in the order of calib_model_joint_name().
 * Poses: 12 numbers by rows, R | t, root_from_link. Twists: [omega; v] in the frame of the link.
 * `held`: torques (forces) that the joints hold, as sensors in them read; NULL: gravity loads the joints.
 * Temperature: lengths that grow hold at the model's reference until calib_model_set_temperature() says how warm each link is.
 * Backlash: calib_model_moved_to() remembers from which side each joint came; before any motion it is taken in the middle.
 *
 * A model may be used by several threads at once, a work by one. Pointers must be valid for as many numbers as said; NULL is
 * refused where it is not allowed. On a status below 0 the outputs are not written. Nothing unwinds out of a call.
 */
#ifndef CALIB_MODEL_H
#define CALIB_MODEL_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

enum calib_model_status {
    CALIB_MODEL_OK = 0,
    CALIB_MODEL_OUT_OF_SCOPE = 1,  /* done; a joint is outside of the range that was fitted */
    CALIB_MODEL_NEARER = 2,        /* done; the tool comes nearer but not to the tolerance: singular, or too few joints */
    CALIB_MODEL_NOT_REACHED = 3,   /* refused; the command is the desired position */
    CALIB_MODEL_BEYOND_LIMITS = 4, /* refused: a joint would leave its limits; the command is the desired position */
    CALIB_MODEL_BAD_FILE = -1,
    CALIB_MODEL_BAD_ARGUMENT = -2, /* NULL, a number that is not finite, a link that is not there, the work of another model */
    CALIB_MODEL_NO_UNCERTAINTY = -3,
    CALIB_MODEL_FAILED = -4        /* an internal error */
};

typedef struct calib_model calib_model;
typedef struct calib_model_work calib_model_work;

typedef struct calib_model_options {
    int position_only;  /* not 0: only the position of the link is to be right */
    int iterations;     /* steps at most */
    double largest_rad; /* no joint is commanded further than this from where it was desired */
    double largest_m;
    double tolerance_m;
    double lever_m;     /* a rotation error counts as the motion of a point as far away */
} calib_model_options;

typedef struct calib_model_correction {
    int iterations;
    int joint;          /* of CALIB_MODEL_OUT_OF_SCOPE and CALIB_MODEL_BEYOND_LIMITS; else -1 */
    double before_m;    /* distance from where the link is wanted, by the model */
    double after_m;
    double before_rad;
    double after_rad;
    double step;        /* largest change of a joint, rad or m */
} calib_model_correction;

/* `message` (may be NULL) receives what is wrong, with its place. */
int calib_model_load(const char *json, size_t length, calib_model **model, char *message, size_t message_size);
void calib_model_free(calib_model *model);

size_t calib_model_joints(const calib_model *model);
size_t calib_model_links(const calib_model *model);
const char *calib_model_joint_name(const calib_model *model, size_t i);
const char *calib_model_link_name(const calib_model *model, size_t i);
int calib_model_link(const calib_model *model, const char *name, size_t *link);

calib_model_work *calib_model_work_new(const calib_model *model);
void calib_model_work_free(calib_model_work *work);

/* pose: 12 */
int calib_model_fk(const calib_model *model, calib_model_work *work, const double *q, const double *held, size_t link,
                   double *pose);
/* poses: 12 for each link */
int calib_model_fk_all(const calib_model *model, calib_model_work *work, const double *q, const double *held,
                       double *poses);
/* jacobian: 6 for each joint: root_from_link(q + dq) = root_from_link(q) exp(J dq) */
int calib_model_jacobian(const calib_model *model, calib_model_work *work, const double *q, const double *held,
                         size_t link, double *jacobian);
/* covariance: 36, of root_from_link as a twist */
int calib_model_sigma(const calib_model *model, calib_model_work *work, const double *q, const double *held,
                      size_t link, double *covariance);
/* joint (may be NULL): the one that is outside, or -1 */
int calib_model_in_scope(const calib_model *model, const double *q, int *joint);

calib_model_options calib_model_default_options(int inverse);
/* q_command: the link stands there where the nominal model has it at q_desired. options, correction: may be NULL.
 * q_command may be q_desired. */
int calib_model_correct(const calib_model *model, calib_model_work *work, const double *q_desired, const double *held,
                        size_t link, const calib_model_options *options, double *q_command,
                        calib_model_correction *correction);
/* q: the link stands at `pose` (12 numbers), near the seed. */
int calib_model_ik(const calib_model *model, calib_model_work *work, const double *pose, const double *seed,
                   const double *held, size_t link, const calib_model_options *options, double *q,
                   calib_model_correction *correction);

/* Takes the next commanded position of all joints. */
int calib_model_moved_to(const calib_model *model, calib_model_work *work, const double *q);
/* +1: a joint came from below, -1: from above, 0: not known. */
int calib_model_approach(const calib_model_work *work, double *directions);
int calib_model_set_approach(calib_model_work *work, const double *directions);
/* celsius: of the link before each joint; NULL: where the lengths of the model hold */
int calib_model_set_temperature(const calib_model *model, calib_model_work *work, const double *celsius);

#ifdef __cplusplus
}
#endif

#endif
