//! One typo in a real profile is one problem, with the word that was meant, and nothing is concluded from it.

use std::path::Path;

use calib_profile::{Problem, check, parse};
use calib_urdf::RobotModel;

fn problems(robot: &str, urdf: &str, edit: &dyn Fn(&str) -> String) -> Vec<Problem> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("in the project");
    let text = edit(&read(&format!("{robot}.yaml")));
    let model = RobotModel::from_urdf_text(&read(urdf), urdf).expect("a robot");
    match parse(&text, robot).and_then(|raw| check(&raw, &text, robot, &model)) {
        Ok(_) => Vec::new(),
        Err(error) => error.problems,
    }
}

/// What is right, what was written instead (once), what was meant, and the line that is blamed.
type Slip = (&'static str, &'static str, &'static str, usize);

const RIPLEY: &[Slip] = &[
    ("joint: shoulder\n", "joint: sholder\n", "shoulder", 37),
    (
        "joint: wrist_roll\n",
        "joint: wrist_rol\n",
        "wrist_roll",
        44,
    ),
    ("{x: wrist_roll}", "{x: wrist_rol}", "wrist_roll", 47),
    ("waist_deg: [-70, 180]", "wast_deg: [-70, 180]", "waist", 27),
    ("link: gripper,", "link: griper,", "gripper", 21),
    ("body: gripM", "body: gripN", "gripM", 45),
    // The name is wrong where it is declared: every use is counted, none is a problem of its own.
    ("  gripM: {link", "  gripN: {link", "gripN", 45),
    (
        "  wrist_sweep:\n    file",
        "  wrist_swep:\n    file",
        "wrist_swep",
        46,
    ),
    ("markers: [gripM_1", "markers: [gripM_l", "gripM_l", 91),
    ("      table_1: [", "      table_l: [", "table_1", 16),
    ("        gripM_1: [", "        gripM_l: [", "gripM_1", 91),
    ("to: endJ", "to: endI", "endJ", 56),
    ("distance_from: base", "distance_from: bas", "base", 50),
    ("parent: table", "parent: tabel", "table", 53),
    (
        "correct: table_to_base",
        "correct: table_to_bas",
        "table_to_base",
        53,
    ),
    (
        "    table_to_base: {free",
        "    table_to_bas: {free",
        "table_to_base",
        61,
    ),
    (
        "table_to_base: {xyz",
        "table_to_bas: {xyz",
        "table_to_base",
        102,
    ),
    ("sweep: wrist_sweep", "sweep: wrist_swep", "wrist_sweep", 46),
    ("add_bodies: [linkM", "add_bodies: [linkN", "linkM", 67),
    ("joint_offsets,", "joint_offset,", "joint_offsets", 59),
    (
        "    linkM:\n      xyz",
        "    linkN:\n      xyz",
        "linkM",
        79,
    ),
    (
        "{joint: wrist_roll_deg, from",
        "{joint: wrist_rol_deg, from",
        "wrist_roll",
        110,
    ),
    ("random: {waist_deg", "random: {wast_deg", "waist", 113),
];

const JUSTIN: &[Slip] = &[
    ("joint: head_tilt\n", "joint: head_tlt\n", "head_tilt", 27),
    ("joint: right_6\n", "joint: rigth_6\n", "right_6", 33),
    ("-y: head_pan", "-y: head_pam", "head_pan", 31),
    ("link: tcp", "link: tpc", "tcp", 39),
    ("link: head,", "link: haed,", "head", 10),
    ("  heT: {link", "  heI: {link", "heI", 28),
    ("from: head", "from: haed", "head", 42),
    ("    neck: {free", "    nek: {free", "neck", 48),
    ("right_0: 0.006", "rigth_0: 0.006", "right_0", 76),
    ("torso_0_deg: [0,", "torsoo_0_deg: [0,", "torso_0", 115),
    (
        "right_5_deg: [-45, 80], r",
        "right_5_degg: [-45, 80], r",
        "right_5_deg",
        21,
    ),
];

#[test]
fn one_slip_is_one_problem() {
    let robots = [
        ("ripley", "ripley/r17.urdf", RIPLEY),
        ("justin", "justin/justin.urdf", JUSTIN),
    ];
    for (robot, urdf, slips) in robots {
        assert_eq!(problems(robot, urdf, &str::to_owned), [], "{robot} itself");
        for (right, wrong, meant, line) in slips {
            let found = problems(robot, urdf, &|text| {
                assert!(text.contains(right), "{robot} has no `{right}`");
                text.replacen(right, wrong, 1)
            });
            let [problem] = found.as_slice() else {
                panic!("{robot}, `{wrong}`: {found:#?}");
            };
            let near = format!("did you mean `{meant}`?");
            assert!(problem.remedy.contains(&near), "`{wrong}`: {problem:#?}");
            assert_eq!(problem.place.map(|p| p.line), Some(*line), "`{wrong}`");
        }
    }
}

#[test]
fn two_slips_are_two_problems() {
    let found = problems("ripley", "ripley/r17.urdf", &|text| {
        text.replacen("joint: shoulder", "joint: sholder", 1)
            .replacen("link: gripper,", "link: griper,", 1)
    });
    assert_eq!(found.len(), 2, "{found:#?}");
}

#[test]
fn a_number_that_is_not_finite_has_its_place() {
    for (right, wrong, line, column) in [
        ("marker_sigma_mm: 0.3", "marker_sigma_mm: .nan", 7, 42),
        ("table_1: [-500", "table_1: [.nan", 16, 17),
        ("occluded: 0.01", "occluded: -.inf", 103, 54),
        ("waist_deg: [-70, 180]", "waist_deg: [-70, .inf]", 27, 31),
        (
            "center: sfe\n",
            "center: sfe\n    center_parameters: {x: .nan}\n",
            41,
            28,
        ),
    ] {
        let found = problems("ripley", "ripley/r17.urdf", &|text| {
            assert!(text.contains(right), "no `{right}`");
            text.replacen(right, wrong, 1)
        });
        let [problem] = found.as_slice() else {
            panic!("`{wrong}`: {found:#?}");
        };
        let place = problem.place.map(|p| (p.line, p.column));
        assert_eq!(place, Some((line, column)), "`{wrong}`");
        assert!(problem.finding.contains("not finite"), "{problem:#?}");
    }
}

/// Justin's `torso_tests` repeats its poses at five values.
#[test]
fn factors_of_the_tracker_s_noise_are_above_zero_and_one_per_repetition() {
    const AT: &str = "repeat_at: {torso_0_deg: [0, 90, 90, -90, 90]}\n";
    let with = |repeat: &str, times: &str| {
        problems("justin", "justin/justin.urdf", &|text| {
            assert!(text.contains(AT), "no `{AT}`");
            let indent = if repeat.is_empty() { "" } else { "      " };
            let lines = format!("tracker_noise_times: {times}\n{indent}{repeat}");
            text.replacen(AT, &lines, 1)
        })
    };
    for (repeat, times) in [
        (AT, "2.5"),
        (AT, "[1, 1, 1, 1.8, 1]"),
        ("", "2.5"),
        ("", "1"),
    ] {
        assert_eq!(with(repeat, times), [], "`{times}`");
    }
    for (repeat, times, finding, remedy) in [
        (AT, "[1, 1, 1, 2]", "4 factors for 5", "give 5 numbers"),
        (AT, "[]", "0 factors for 5", "give 5 numbers"),
        ("", "[1, 2]", "no `repeat_at`", "one number for the whole"),
        (AT, "[1, 1, 1, 0, 1]", "0 is not above 0", "above 0"),
        (AT, "-2", "-2 is not above 0", "above 0"),
        (AT, "[1, 1, .inf, 1, 1]", "not finite", "finite number"),
        ("", ".nan", "not finite", "finite number"),
    ] {
        let found = with(repeat, times);
        let [problem] = found.as_slice() else {
            panic!("`{times}`: {found:#?}");
        };
        assert!(problem.finding.contains(finding), "{problem:#?}");
        assert!(problem.remedy.contains(remedy), "{problem:#?}");
        assert_eq!(problem.place.map(|p| p.line), Some(115), "{problem:#?}");
    }
}

#[test]
fn factors_of_another_form_are_refused_with_what_they_could_be() {
    let found = problems("justin", "justin/justin.urdf", &|text| {
        let poses = "      poses: 30\n";
        text.replacen(
            poses,
            &format!("{poses}      tracker_noise_times: {{torso_0: 2}}\n"),
            1,
        )
    });
    let [problem] = found.as_slice() else {
        panic!("{found:#?}");
    };
    assert!(problem.finding.contains("`repeat_at`"), "{problem:#?}");
    assert_eq!(problem.place.map(|p| p.line), Some(115), "{problem:#?}");
}
