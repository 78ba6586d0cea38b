/* Prints size and offset of everything in the contract, one `struct.field size offset` per line. */
#include "calib_plugin.h"

#include <stdio.h>

#define S(type) printf(#type " %zu %zu\n", sizeof(type), (size_t)0)
#define F(type, field) printf(#type "." #field " %zu %zu\n", sizeof(((type *)0)->field), offsetof(type, field))

int main(void) {
    S(calib_value); F(calib_value, type); F(calib_value, flag); F(calib_value, integer); F(calib_value, number);
    F(calib_value, text);
    S(calib_parameter); F(calib_parameter, name); F(calib_parameter, summary); F(calib_parameter, value);
    F(calib_parameter, minimum); F(calib_parameter, maximum); F(calib_parameter, choices);
    F(calib_parameter, choice_count); F(calib_parameter, required); F(calib_parameter, reserved);
    S(calib_offer); F(calib_offer, kind); F(calib_offer, name); F(calib_offer, summary); F(calib_offer, source);
    F(calib_offer, shapes); F(calib_offer, parameter_size); F(calib_offer, parameters);
    F(calib_offer, parameter_count); F(calib_offer, example); F(calib_offer, example_size);
    S(calib_descriptor); F(calib_descriptor, struct_size); F(calib_descriptor, offer_size);
    F(calib_descriptor, name); F(calib_descriptor, version); F(calib_descriptor, author);
    F(calib_descriptor, licence); F(calib_descriptor, offers); F(calib_descriptor, offer_count);
    S(calib_entry); F(calib_entry, abi_major); F(calib_entry, abi_minor); F(calib_entry, struct_size);
    F(calib_entry, reserved); F(calib_entry, describe); F(calib_entry, find);
    S(calib_call); F(calib_call, struct_size); F(calib_call, reserved); F(calib_call, values);
    F(calib_call, value_count); F(calib_call, text); F(calib_call, text_size); F(calib_call, context);
    F(calib_call, cancelled); F(calib_call, progress);
    S(calib_motion); F(calib_motion, struct_size); F(calib_motion, shape); F(calib_motion, tracks);
    F(calib_motion, samples); F(calib_motion, seen); F(calib_motion, points_m); F(calib_motion, rotations);
    F(calib_motion, translations_m); F(calib_motion, covariances_m2); F(calib_motion, angles_rad);
    F(calib_motion, center_m); F(calib_motion, towards); F(calib_motion, sigma_t_m); F(calib_motion, sigma_r_rad);
    F(calib_motion, significance); F(calib_motion, seed);
    S(calib_cor_result); F(calib_cor_result, struct_size); F(calib_cor_result, weak); F(calib_cor_result, center_m);
    F(calib_cor_result, rms_m); F(calib_cor_result, used); F(calib_cor_result, covariance_m2);
    F(calib_cor_result, body_points_m); F(calib_cor_result, body_point_count); F(calib_cor_result, radii_m);
    F(calib_cor_result, radius_count); F(calib_cor_result, rejected); F(calib_cor_result, rejected_count);
    S(calib_cor_sink); F(calib_cor_sink, struct_size); F(calib_cor_sink, reserved); F(calib_cor_sink, context);
    F(calib_cor_sink, result);
    S(calib_cor_1); F(calib_cor_1, struct_size); F(calib_cor_1, reserved); F(calib_cor_1, fit);
    S(calib_aor_result); F(calib_aor_result, struct_size); F(calib_aor_result, weak); F(calib_aor_result, point_m);
    F(calib_aor_result, direction); F(calib_aor_result, rms_m); F(calib_aor_result, used);
    F(calib_aor_result, covariance); F(calib_aor_result, in_child); F(calib_aor_result, rejected);
    F(calib_aor_result, rejected_count);
    S(calib_aor_sink); F(calib_aor_sink, struct_size); F(calib_aor_sink, reserved); F(calib_aor_sink, context);
    F(calib_aor_sink, result);
    S(calib_aor_1); F(calib_aor_1, struct_size); F(calib_aor_1, reserved); F(calib_aor_1, fit);
    S(calib_source); F(calib_source, struct_size); F(calib_source, reserved); F(calib_source, name);
    F(calib_source, bytes); F(calib_source, size);
    S(calib_recording_sink); F(calib_recording_sink, struct_size); F(calib_recording_sink, reserved);
    F(calib_recording_sink, context); F(calib_recording_sink, timeline); F(calib_recording_sink, label);
    F(calib_recording_sink, marker); F(calib_recording_sink, body); F(calib_recording_sink, joint);
    F(calib_recording_sink, torque); F(calib_recording_sink, note);
    S(calib_reader_1); F(calib_reader_1, struct_size); F(calib_reader_1, reserved); F(calib_reader_1, read);
    F(calib_reader_1, recognizes);
    S(calib_report_input); F(calib_report_input, struct_size); F(calib_report_input, reserved);
    F(calib_report_input, report_json); F(calib_report_input, report_size); F(calib_report_input, scene_json);
    F(calib_report_input, scene_size);
    S(calib_files_sink); F(calib_files_sink, struct_size); F(calib_files_sink, reserved);
    F(calib_files_sink, context); F(calib_files_sink, file);
    S(calib_report_1); F(calib_report_1, struct_size); F(calib_report_1, reserved); F(calib_report_1, write);
    S(calib_joint_states); F(calib_joint_states, struct_size); F(calib_joint_states, prismatic);
    F(calib_joint_states, samples); F(calib_joint_states, readings); F(calib_joint_states, motor_rad);
    F(calib_joint_states, loads); F(calib_joint_states, approaches);
    S(calib_effect_sink); F(calib_effect_sink, struct_size); F(calib_effect_sink, reserved);
    F(calib_effect_sink, context); F(calib_effect_sink, result);
    S(calib_effect_1); F(calib_effect_1, struct_size); F(calib_effect_1, depends_on); F(calib_effect_1, coefficient);
    F(calib_effect_1, revolute_only); F(calib_effect_1, prior_sigma); F(calib_effect_1, regressors);
    printf("major %u %u\n", CALIB_ABI_MAJOR, CALIB_ABI_MINOR);
    printf("status %d %d\n", CALIB_OK, CALIB_PANICKED);
    printf("types %d %d\n", CALIB_BOOL, CALIB_TEXT);
    printf("shapes %d %d\n", CALIB_POINTS, CALIB_TWO_BODIES);
    printf("masks %d %d\n", CALIB_LOST, CALIB_FILLED);
    printf("units %d %d\n", CALIB_ANGLE, CALIB_LENGTH);
    printf("depends_on %d %d\n", CALIB_ON_READING, CALIB_ON_APPROACH);
    printf("coefficients %d %d\n", CALIB_POSITION, CALIB_COMPLIANCE);
    return 0;
}
