//! Bodies, links, units, order and sign over designs and bodies, and the uses of recordings.

use calib_init::mistake::Mistake;
use calib_init::session::{Stream, Use};
use calib_init::{About, Fact, Proposal, tables};
use calib_sim::Motion;

use crate::lab::{
    Design, KINDS, Kind, arm, file, files, link_of, proposed, recordings, streams, text,
    with_cells, with_names,
};

/// What was corrected; nothing may be left that was not.
fn mistakes(proposal: &Proposal) -> Vec<&Mistake> {
    let of = |fact: &'_ Fact| {
        matches!(
            fact.about,
            About::NotCorrected { .. } | About::Disagrees { .. }
        )
    };
    assert!(!proposal.facts.iter().any(of), "{:?}", proposal.facts);
    let corrected = proposal.facts.iter().filter_map(|fact| match &fact.about {
        About::Corrected { mistake, .. } => Some(mistake),
        _ => None,
    });
    corrected.collect()
}

/// The last link, or one that the recordings cannot distinguish from it and that is named.
fn is_on(proposal: &Proposal, body: &str, link: &str) -> bool {
    let found = link_of(proposal, body);
    found == link
        || proposal.facts.iter().any(|fact| match &fact.about {
            About::Link {
                link: chosen, same, ..
            } => *chosen == found && same.iter().any(|s| s == link),
            _ => false,
        })
}

#[test]
fn every_kind_of_body_is_found_on_its_link_over_designs() {
    for design in [Design::Random, Design::Sweeps] {
        for (seed, kind) in (1..).zip(KINDS) {
            let proposal = proposed(&files(&recordings(
                &[("hand", "flange", kind)],
                design,
                seed,
            )));
            assert_eq!(
                proposal.bodies.len(),
                1,
                "{design:?} {kind:?}: {:?}",
                proposal.bodies
            );
            assert!(
                is_on(&proposal, &proposal.bodies[0].name, "link_6"),
                "{design:?} {kind:?}: {:?}",
                proposal.facts
            );
            assert!(
                mistakes(&proposal).is_empty(),
                "{design:?} {kind:?}: {:?}",
                proposal.facts
            );
            // The profile is one that the program takes.
            tables::robot_profile(&arm(), &proposal).unwrap_or_else(|e| panic!("{e}"));
        }
    }
}

#[test]
fn two_bodies_of_every_pair_of_kinds_are_two() {
    for (seed, (a, b)) in (10..).zip([(3, 4), (1, 4), (2, 1), (1, 1)]) {
        let bodies = [
            ("elbow", "link_3", Kind::Markers(a)),
            ("hand", "flange", Kind::Markers(b)),
        ];
        let proposal = proposed(&files(&recordings(&bodies, Design::Random, seed)));
        assert_eq!(proposal.bodies.len(), 2, "{a} {b}: {:?}", proposal.bodies);
        let name = |n: usize, name: &str| match n {
            1 => format!("{name}_1"),
            _ => name.to_owned(),
        };
        assert!(
            is_on(&proposal, &name(a, "elbow"), "link_3"),
            "{a} {b}: {:?}",
            proposal.facts
        );
        assert!(
            is_on(&proposal, &name(b, "hand"), "link_6"),
            "{a} {b}: {:?}",
            proposal.facts
        );
    }
    let bodies = [
        ("elbow", "link_3", Kind::Pose),
        ("hand", "flange", Kind::Pose),
    ];
    let proposal = proposed(&files(&recordings(&bodies, Design::Random, 20)));
    assert_eq!(
        (link_of(&proposal, "elbow"), link_of(&proposal, "hand")),
        ("link_3".to_owned(), "link_6".to_owned())
    );
}

#[test]
fn a_body_beside_the_robot_is_on_its_root() {
    let bodies = [
        ("table", "base_link", Kind::Markers(3)),
        ("hand", "flange", Kind::Markers(3)),
    ];
    let proposal = proposed(&files(&recordings(&bodies, Design::Random, 31)));
    assert_eq!(link_of(&proposal, "table"), "base_link");
    assert!(
        proposal
            .facts
            .iter()
            .any(|f| matches!(f.about, About::Still { .. }))
    );
    assert_eq!(link_of(&proposal, "hand"), "link_6");
}

#[test]
fn wrong_signs_and_exchanged_columns_are_found_and_corrected() {
    let good = recordings(&[("hand", "flange", Kind::Markers(4))], Design::Random, 41);
    for joint in ["joint_2", "joint_3", "joint_5"] {
        let column = format!("{joint}_deg");
        let files: Vec<_> = good
            .iter()
            .map(|(name, poses)| {
                let negated = |c: &str, cell: &str| match c == column {
                    true => (-cell.parse::<f64>().expect("a number")).to_string(),
                    false => cell.to_owned(),
                };
                file(name, with_cells(&text(poses), negated))
            })
            .collect();
        let proposal = proposed(&files);
        let wanted = Mistake::Sign {
            joint: joint.to_owned(),
        };
        assert_eq!(mistakes(&proposal), [&wanted], "{joint}");
        assert_eq!(link_of(&proposal, "hand"), "link_6", "{joint}");
        for recording in &proposal.recordings {
            let map = recording.table.columns.as_ref().expect("a map");
            assert_eq!(map.reversed, [joint]);
        }
    }
    let exchanged = |name: &str| match name {
        "joint_2_deg" => "joint_3_deg".to_owned(),
        "joint_3_deg" => "joint_2_deg".to_owned(),
        name => name.to_owned(),
    };
    let files: Vec<_> = good
        .iter()
        .map(|(n, poses)| file(n, with_names(&text(poses), exchanged)))
        .collect();
    let proposal = proposed(&files);
    let wanted = Mistake::Exchange {
        first: "joint_2".to_owned(),
        second: "joint_3".to_owned(),
    };
    assert_eq!(mistakes(&proposal), [&wanted]);
    assert_eq!(link_of(&proposal, "hand"), "link_6");
}

#[test]
fn two_wrong_signs_are_both_corrected() {
    let good = recordings(&[("hand", "flange", Kind::Markers(4))], Design::Random, 42);
    let files: Vec<_> = good
        .iter()
        .map(|(name, poses)| {
            let negated = |c: &str, cell: &str| match c {
                "joint_3_deg" | "joint_5_deg" => {
                    (-cell.parse::<f64>().expect("a number")).to_string()
                }
                _ => cell.to_owned(),
            };
            file(name, with_cells(&text(poses), negated))
        })
        .collect();
    let proposal = proposed(&files);
    let mut joints: Vec<&str> = mistakes(&proposal)
        .into_iter()
        .filter_map(|mistake| match mistake {
            Mistake::Sign { joint } => Some(joint.as_str()),
            _ => None,
        })
        .collect();
    joints.sort_unstable();
    assert_eq!(joints, ["joint_3", "joint_5"]);
    assert_eq!(link_of(&proposal, "hand"), "link_6");
}

#[test]
fn few_poses_are_said_to_be_few_and_every_body_has_a_word_about_its_link() {
    let good = recordings(&[("hand", "flange", Kind::Markers(1))], Design::Random, 43);
    for (rows, few) in [(24, false), (5, true)] {
        let kept: Vec<usize> = (0..rows).collect();
        let proposal = proposed(&[file("poses", text(&good["poses"].select(&kept)))]);
        let of_link = |f: &&Fact| matches!(f.about, About::Link { .. } | About::LinkUnknown { .. });
        let links = proposal.facts.iter().filter(of_link).count();
        assert_eq!(links, proposal.bodies.len(), "{rows}: {:?}", proposal.facts);
        let said = proposal
            .to_check()
            .any(|f| matches!(f.about, About::TooFew { .. }));
        assert_eq!(said, few, "{rows}: {:?}", proposal.facts);
    }
}

#[test]
fn foreign_names_and_units_become_a_column_map() {
    let good = recordings(&[("hand", "flange", Kind::Markers(3))], Design::Random, 51);
    let foreign = |name: &str| {
        name.replace("joint_", "q")
            .replace("_deg", "")
            .replace("hand_", "P")
            .replace(".x_m", "_x")
            .replace(".y_m", "_y")
            .replace(".z_m", "_z")
    };
    for (radians, millimeters) in [(false, false), (true, false), (false, true), (true, true)] {
        let files: Vec<_> = good
            .iter()
            .map(|(name, poses)| {
                let scaled = |c: &str, cell: &str| match (c, cell.parse::<f64>()) {
                    (c, Ok(q)) if c.starts_with("joint") && radians => q.to_radians().to_string(),
                    (c, Ok(p)) if c.starts_with("hand") && millimeters => (1e3 * p).to_string(),
                    _ => cell.to_owned(),
                };
                file(name, with_names(&with_cells(&text(poses), scaled), foreign))
            })
            .collect();
        let proposal = proposed(&files);
        assert!(mistakes(&proposal).is_empty(), "{:?}", proposal.facts);
        assert_eq!(proposal.bodies.len(), 1);
        assert_eq!(link_of(&proposal, &proposal.bodies[0].name), "link_6");
        assert!(
            proposal
                .to_check()
                .any(|f| matches!(f.about, About::JointsByOrder { .. }))
        );
        let map = proposal.recordings[0]
            .table
            .columns
            .as_ref()
            .expect("a map");
        assert_eq!(map.joints["joint_4"], "q4");
        assert_eq!(map.markers["P2"], ["P2_x", "P2_y", "P2_z"]);
        assert_eq!(map.angles == calib_recording::AngleUnit::Rad, radians);
        assert_eq!(map.lengths == calib_recording::LengthUnit::M, !millimeters);
    }
}

#[test]
fn degrees_that_could_be_radians_are_told_by_the_motion() {
    let good = recordings(&[("hand", "flange", Kind::Markers(3))], Design::Small, 55);
    let bare = |name: &str| name.replace("_deg", "");
    let table = with_names(&text(&good["poses"]), bare);
    let proposal = proposed(&[file("poses", table)]);
    let wanted = Mistake::Unit {
        joint: None,
        unit: "deg",
    };
    assert_eq!(mistakes(&proposal), [&wanted]);
    let map = proposal.recordings[0]
        .table
        .columns
        .as_ref()
        .expect("a map");
    assert_eq!(map.angles, calib_recording::AngleUnit::Deg);
    assert!(is_on(&proposal, "hand", "link_6"));
}

#[test]
fn units_that_the_names_state_wrongly_are_corrected_by_other_names() {
    let good = recordings(&[("hand", "flange", Kind::Markers(3))], Design::Random, 56);
    let files = |wrong: &dyn Fn(&str) -> String| -> Vec<_> {
        let of = |(name, poses): (&String, &_)| file(name, with_names(&text(poses), wrong));
        good.iter().map(of).collect()
    };
    let unit = |joint: Option<&str>| Mistake::Unit {
        joint: joint.map(str::to_owned),
        unit: "deg",
    };
    // All angles, one angle, and the tracker.
    let all = proposed(&files(&|name| name.replace("_deg", "_rad")));
    assert_eq!(mistakes(&all), [&unit(None)]);
    let one = proposed(&files(&|name| name.replace("joint_3_deg", "joint_3_rad")));
    assert_eq!(mistakes(&one), [&unit(Some("joint_3"))]);
    let tracker = proposed(&files(&|name| match name.ends_with("_m") {
        true => name.replace("_m", "_mm"),
        false => name.to_owned(),
    }));
    assert_eq!(mistakes(&tracker), [&Mistake::TrackerUnit { unit: "m" }]);
    for proposal in [all, one, tracker] {
        let map = proposal.recordings[0]
            .table
            .columns
            .as_ref()
            .expect("a map");
        assert!(
            map.names.contains(&"joint_3_deg".to_owned()),
            "{:?}",
            map.names
        );
        assert!(
            map.names.contains(&"hand_1.x_m".to_owned()),
            "{:?}",
            map.names
        );
        assert_eq!(link_of(&proposal, "hand"), "link_6");
    }
}

#[test]
fn recordings_are_used_by_what_they_move_by_name_and_by_size() {
    let sweeps = proposed(&files(&recordings(
        &[("hand", "flange", Kind::Markers(3))],
        Design::Sweeps,
        61,
    )));
    assert!(
        sweeps
            .recordings
            .iter()
            .all(|r| matches!(&r.usage, Use::Sweep(joints) if joints.len() == 1))
    );
    assert!(sweeps.facts.iter().any(|f| f.about == About::LeftOutInTurn));
    let mut random = recordings(&[("hand", "flange", Kind::Markers(3))], Design::Random, 62);
    let by_size = proposed(&files(&random));
    let usage = |p: &Proposal, name: &str| {
        p.recordings
            .iter()
            .find(|r| r.name == name)
            .map(|r| r.usage.clone())
    };
    assert_eq!(usage(&by_size, "more"), Some(Use::Validation));
    assert!(
        by_size
            .to_check()
            .any(|f| matches!(f.about, About::ValidationSmallest { rows: 10 }))
    );
    let poses = random.remove("poses").expect("there");
    random.insert("tuesday_check".to_owned(), poses);
    let by_name = proposed(&files(&random));
    assert_eq!(usage(&by_name, "tuesday_check"), Some(Use::Validation));
    assert_eq!(usage(&by_name, "more"), Some(Use::Static));
}

#[test]
fn streams_of_one_clock_and_of_two_are_brought_together() {
    let holds = Motion::StopAndGo {
        hold: 1.6,
        travel: 1.2,
    };
    for (seed, (motion, kind, wanted)) in (70..).zip([
        (holds, Kind::Markers(4), Stream::Settle),
        (holds, Kind::Pose, Stream::Settle),
        (Motion::Continuous, Kind::Markers(3), Stream::Continuous),
    ]) {
        let two = streams(&[("hand", "flange", kind)], motion, 1.7, seed);
        let given = [
            file("run_tracker", text(&two.tracker)),
            file("run_robot", text(&two.robot)),
        ];
        let proposal = proposed(&given);
        assert_eq!(proposal.recordings.len(), 1);
        assert_eq!(proposal.recordings[0].stream, Some(wanted));
        assert!(proposal.recordings[0].log.is_some());
        assert_eq!(link_of(&proposal, "hand"), "link_6", "{motion:?} {kind:?}");
        // One clock: the joints at the tracker's times.
        let one = streams(&[("hand", "flange", kind)], motion, 0.0, seed);
        let mut poses = one.tracker.clone();
        let times = one.robot.t.as_ref().expect("times");
        for (joint, q) in &one.robot.joints {
            let at = |t: &f64| {
                let after = times.partition_point(|r| r < t).clamp(1, times.len() - 1);
                let (a, b) = (q[after - 1]?, q[after]?);
                Some(a + (b - a) * (t - times[after - 1]) / (times[after] - times[after - 1]))
            };
            let values = poses.t.as_ref().expect("times").iter().map(at).collect();
            poses.joints.insert(joint.clone(), values);
        }
        poses.joint_units.clone_from(&one.robot.joint_units);
        let proposal = proposed(&[file("run", text(&poses))]);
        assert_eq!(proposal.recordings[0].stream, Some(wanted), "{kind:?}");
        assert_eq!(
            link_of(&proposal, "hand"),
            "link_6",
            "one clock, {motion:?} {kind:?}"
        );
    }
}

#[test]
fn a_repeated_marker_and_one_hardly_seen_are_left_out() {
    let mut good = recordings(&[("hand", "flange", Kind::Markers(4))], Design::Random, 81);
    for poses in good.values_mut() {
        let third = poses.markers["hand_3"].clone();
        poses.markers.insert("hand_4".to_owned(), third);
        let rows = poses.len();
        let mut ghost = vec![None; rows];
        ghost[0] = poses.markers["hand_1"][0];
        poses.markers.insert("ghost".to_owned(), ghost);
    }
    let proposal = proposed(&files(&good));
    assert_eq!(proposal.bodies[0].markers, ["hand_1", "hand_2", "hand_3"]);
    let is_said = |wanted: &About| proposal.to_check().any(|f| f.about == *wanted);
    assert!(is_said(&About::Duplicate {
        marker: "hand_4".to_owned(),
        of: "hand_3".to_owned()
    }));
    assert!(is_said(&About::Seldom {
        markers: vec!["ghost".to_owned()]
    }));
}

#[test]
fn the_noise_is_that_of_the_markers() {
    let proposal = proposed(&files(&recordings(
        &[("hand", "flange", Kind::Markers(4))],
        Design::Random,
        91,
    )));
    let sigma = proposal.noise.marker.expect("four markers show it");
    assert!((0.8..1.2).contains(&(sigma / 2e-4)), "{sigma}");
}
