//! The header compiles as C and C++, and means the same to a C compiler as to Rust.

use std::{collections::BTreeMap, process::Command};

use calib_plugin::{Coefficient, DependsOn, abi};

use crate::bed::{Bed, compiler, file, include};

macro_rules! table {
    ($($name:ident = $type:ty { $($field:ident $(as $c:ident)?),* $(,)? })*) => {{
        let mut table: BTreeMap<String, (usize, usize)> = BTreeMap::new();
        $(
            table.insert(stringify!($name).into(), (size_of::<$type>(), 0));
            $({
                fn size<F>(_: fn(&$type) -> &F) -> usize { size_of::<F>() }
                let name = [$(stringify!($c),)? stringify!($field)][0];
                table.insert(
                    format!("{}.{name}", stringify!($name)),
                    (size(|s| &s.$field), std::mem::offset_of!($type, $field)),
                );
            })*
        )*
        table
    }};
}

fn rust() -> BTreeMap<String, (usize, usize)> {
    let mut table = table! {
        calib_value = abi::Value { kind as type, flag, integer, number, text }
        calib_parameter = abi::Parameter {
            name, summary, value, minimum, maximum, choices, choice_count, required, reserved,
        }
        calib_offer = abi::Offer {
            kind, name, summary, source, shapes, parameter_size, parameters, parameter_count, example, example_size,
        }
        calib_descriptor = abi::Descriptor {
            struct_size, offer_size, name, version, author, licence, offers, offer_count,
        }
        calib_entry = abi::Entry { abi_major, abi_minor, struct_size, reserved, describe, find }
        calib_call = abi::Call {
            struct_size, reserved, values, value_count, text, text_size, context, cancelled, progress,
        }
        calib_motion = abi::Motion {
            struct_size, shape, tracks, samples, seen, points_m, rotations, translations_m, covariances_m2, angles_rad,
            center_m, towards, sigma_t_m, sigma_r_rad, significance, seed,
        }
        calib_cor_result = abi::CorResult {
            struct_size, weak, center_m, rms_m, used, covariance_m2, body_points_m, body_point_count, radii_m,
            radius_count, rejected, rejected_count,
        }
        calib_cor_sink = abi::CorSink { struct_size, reserved, context, result }
        calib_cor_1 = abi::Cor1 { struct_size, reserved, fit }
        calib_aor_result = abi::AorResult {
            struct_size, weak, point_m, direction, rms_m, used, covariance, in_child, rejected, rejected_count,
        }
        calib_aor_sink = abi::AorSink { struct_size, reserved, context, result }
        calib_aor_1 = abi::Aor1 { struct_size, reserved, fit }
        calib_source = abi::Source { struct_size, reserved, name, bytes, size }
        calib_recording_sink = abi::RecordingSink {
            struct_size, reserved, context, timeline, label, marker, body, joint, torque, note,
        }
        calib_reader_1 = abi::Reader1 { struct_size, reserved, read, recognizes }
        calib_report_input = abi::ReportInput {
            struct_size, reserved, report_json, report_size, scene_json, scene_size,
        }
        calib_files_sink = abi::FilesSink { struct_size, reserved, context, file }
        calib_report_1 = abi::Report1 { struct_size, reserved, write }
        calib_joint_states = abi::JointStates {
            struct_size, prismatic, samples, readings, motor_rad, loads, approaches,
        }
        calib_effect_sink = abi::EffectSink { struct_size, reserved, context, result }
        calib_effect_1 = abi::Effect1 {
            struct_size, depends_on, coefficient, revolute_only, prior_sigma, regressors,
        }
    };
    let pair = |a: i32, b: i32| (a as usize, b as usize);
    table.insert("major".into(), (abi::MAJOR as usize, abi::MINOR as usize));
    table.insert("status".into(), pair(abi::OK, abi::PANICKED));
    table.insert("types".into(), pair(abi::BOOL, abi::TEXT));
    table.insert(
        "shapes".into(),
        (
            calib_plugin::Shape::Points as usize,
            calib_plugin::Shape::TwoBodies as usize,
        ),
    );
    table.insert("masks".into(), (abi::LOST.into(), abi::FILLED.into()));
    table.insert("units".into(), pair(abi::ANGLE, abi::LENGTH));
    table.insert(
        "depends_on".into(),
        pair(DependsOn::Reading as i32, DependsOn::Approach as i32),
    );
    table.insert(
        "coefficients".into(),
        pair(Coefficient::Position as i32, Coefficient::Compliance as i32),
    );
    table
}

#[test]
fn the_header_is_c11_and_cpp17() {
    let bed = Bed::new();
    let source = "#include \"calib_plugin.h\"\n#include \"calib_plugin.h\"\n\
                  const calib_entry calib_plugin_entry = {CALIB_ABI_MAJOR, CALIB_ABI_MINOR, sizeof(calib_entry), 0, 0, 0};\n";
    for (program, standard, name) in [("cc", "-std=c11", "h.c"), ("c++", "-std=c++17", "h.cc")] {
        let (from, to) = (bed.path().join(name), bed.path().join("h.o"));
        std::fs::write(&from, source).unwrap();
        let _ = compiler(
            program,
            &[
                standard,
                "-Wall",
                "-Wextra",
                "-Werror",
                "-pedantic",
                &include(),
                "-c",
                from.to_str().unwrap(),
                "-o",
                to.to_str().unwrap(),
            ],
        );
    }
}

#[test]
fn c_and_rust_agree_on_every_field() {
    let bed = Bed::new();
    let (source, program) = (file("tests/c/layout.c"), bed.path().join("layout"));
    let arguments = [
        "-std=c11",
        &include(),
        source.to_str().unwrap(),
        "-o",
        program.to_str().unwrap(),
    ];
    if compiler("cc", &arguments).is_none() {
        return;
    }
    let output = Command::new(program).output().unwrap();
    let c: BTreeMap<String, (usize, usize)> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .map(|line| {
            let mut words = line.split(' ');
            let mut next = || words.next().unwrap();
            (
                next().to_string(),
                (next().parse().unwrap(), next().parse().unwrap()),
            )
        })
        .collect();
    assert_eq!(c, rust());

    // Every struct of the header is in the table.
    let structs: Vec<&str> = calib_plugin::HEADER
        .lines()
        .filter_map(|line| line.strip_prefix("typedef struct ")?.strip_suffix(" {"))
        .collect();
    assert_eq!(structs.len(), 22);
    for name in structs {
        let fields = c
            .keys()
            .filter(|key| key.starts_with(&format!("{name}.")))
            .count();
        assert!(
            c.contains_key(name) && fields >= 3,
            "{name} is not compared"
        );
    }
}
