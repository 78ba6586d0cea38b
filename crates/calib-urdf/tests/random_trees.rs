//! Laws that hold for any robot: random trees, random origins, random handwriting.

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{RobotModel, SecondReader, UrdfEdit, diff_models, patch, replay, revert, verify};
use nalgebra::{Isometry3, Translation3, Unit, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;

#[derive(Debug, Clone)]
struct RandomJoint {
    parent: usize,
    kind: usize,
    xyz: Option<[f64; 3]>,
    rpy: Option<[f64; 3]>,
    axis: Option<[f64; 3]>,
}

#[derive(Debug, Clone)]
struct Hand {
    line_ending: &'static str,
    indent: &'static str,
    quote: char,
    byte_order_mark: bool,
    comments: bool,
}

/// Angles of all sizes, and often the awkward ones.
fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => -4.0..4.0f64,
        1 => prop_oneof![Just(0.0), Just(FRAC_PI_2), Just(-FRAC_PI_2), Just(PI), Just(1.57081), Just(-3.14161), Just(FRAC_PI_2 - 1e-9)],
    ]
}

fn vector() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(
        prop_oneof![3 => -2.0..2.0f64, 1 => Just(0.0), 1 => Just(0.25), 1 => -1e-6..1e-6f64],
    )
}

fn rpy() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(angle())
}

fn joint() -> impl Strategy<Value = RandomJoint> {
    let axis = vector().prop_filter("a direction", |axis| Vector3::from(*axis).norm() > 1e-3);
    (
        any::<usize>(),
        0..4usize,
        prop::option::of(vector()),
        prop::option::of(rpy()),
        prop::option::of(axis),
    )
        .prop_map(|(parent, kind, xyz, rpy, axis)| RandomJoint {
            parent,
            kind,
            xyz,
            rpy,
            axis,
        })
}

fn hand() -> impl Strategy<Value = Hand> {
    (
        prop_oneof![Just("\n"), Just("\r\n"), Just("")],
        prop_oneof![Just("  "), Just("\t"), Just("")],
        prop_oneof![Just('"'), Just('\'')],
        any::<bool>(),
        any::<bool>(),
    )
        .prop_map(
            |(line_ending, indent, quote, byte_order_mark, comments)| Hand {
                line_ending,
                indent,
                quote,
                byte_order_mark,
                comments,
            },
        )
}

fn written(joints: &[RandomJoint], hand: &Hand) -> String {
    let (eol, i, q) = (hand.line_ending, hand.indent, hand.quote);
    let mut text = if hand.byte_order_mark {
        "\u{feff}".to_owned()
    } else {
        String::new()
    };
    let _ = write!(
        text,
        "<robot name={q}random{q}>{eol}{i}<link name={q}l0{q}/>{eol}"
    );
    let numbers = |v: &[f64; 3]| format!("{} {}  {}", v[0], v[1], v[2]);
    for (n, joint) in joints.iter().enumerate() {
        let kind = ["fixed", "revolute", "continuous", "prismatic"][joint.kind];
        let _ = write!(
            text,
            "{i}<link name={q}l{}{q}/>{eol}{i}<joint name={q}j{n}{q} type={q}{kind}{q}>{eol}",
            n + 1
        );
        if hand.comments {
            let _ = write!(text, "{i}{i}<!-- <origin xyz=\"1 2 3\"/> -->{eol}");
        }
        let _ = write!(
            text,
            "{i}{i}<parent link={q}l{}{q}/>{eol}{i}{i}<child link={q}l{}{q}/>{eol}",
            joint.parent % (n + 1),
            n + 1
        );
        if joint.xyz.is_some() || joint.rpy.is_some() {
            let _ = write!(text, "{i}{i}<origin");
            for (name, value) in [("rpy", &joint.rpy), ("xyz", &joint.xyz)] {
                if let Some(value) = value {
                    let _ = write!(text, " {name}={q}{}{q}", numbers(value));
                }
            }
            let _ = write!(text, "/>{eol}");
        }
        if let Some(axis) = &joint.axis {
            let _ = write!(text, "{i}{i}<axis xyz={q}{}{q}/>{eol}", numbers(axis));
        }
        let _ = write!(text, "{i}</joint>{eol}");
    }
    let _ = write!(
        text,
        "{i}<gazebo><joint name={q}j0{q}><origin xyz={q}1 1 1{q}/></joint></gazebo>{eol}</robot>{eol}"
    );
    text
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, rng_seed: RngSeed::Fixed(20), ..ProptestConfig::default() })]

    #[test]
    fn a_patch_says_what_it_should_and_can_be_reverted(
        joints in prop::collection::vec(joint(), 1..9),
        hand in hand(),
        wanted in prop::collection::vec(prop::option::of((vector(), rpy())), 9),
        axes in prop::collection::vec(prop::option::of(vector()), 9),
        frame in prop::option::of((vector(), rpy(), any::<usize>())),
    ) {
        let text = written(&joints, &hand);
        let nominal = RobotModel::from_urdf_text(&text, "random.urdf").unwrap();
        let mut edits = Vec::new();
        for (n, joint) in joints.iter().enumerate() {
            if let Some((xyz, rpy)) = wanted[n] {
                let pose = Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), rotation_from_rpy(&Vector3::from(rpy)));
                edits.push(UrdfEdit::SetOrigin { joint: format!("j{n}"), parent_link_from_joint: pose });
            }
            if let Some(axis) = axes[n].and_then(|axis| Unit::try_new(Vector3::from(axis), 1e-3)).filter(|_| joint.kind > 0) {
                edits.push(UrdfEdit::SetAxis { joint: format!("j{n}"), axis });
            }
        }
        if let Some((xyz, rpy, on)) = frame {
            let pose = Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), rotation_from_rpy(&Vector3::from(rpy)));
            edits.push(UrdfEdit::AddFixedFrame {
                name: "body".to_owned(), parent_link: format!("l{}", on % (joints.len() + 1)), joint_name: "body_mount".to_owned(),
                parent_from_frame: pose, comment: Some("added".to_owned()),
            });
        }
        let done = patch(&text, "random.urdf", &edits).unwrap();

        // Re-read, it is what was asked for, for both readers.
        let expected = nominal.clone().with_edits("random.urdf", &edits).unwrap();
        let verification = verify(&done.text, &expected, "random.urdf").unwrap();
        prop_assert!(matches!(verification.second_reader, SecondReader::Agrees { .. }), "{verification:?}");

        // Back to the same bytes.
        prop_assert_eq!(&revert(&done.text, &done.record(&text)).unwrap(), &text);
        let again = replay(&text, &done.record(&text));
        prop_assert_eq!(again.as_ref(), Some(&done.text));

        // Only splices differ: what lies between them is the same.
        let mut at = (0, 0);
        for splice in &done.splices {
            let kept = &text[at.0..splice.range.start];
            prop_assert_eq!(kept, &done.text[at.1..at.1 + kept.len()]);
            at = (splice.range.end, at.1 + kept.len() + splice.new.len());
        }
        prop_assert_eq!(&text[at.0..], &done.text[at.1..]);

        // A second time there is nothing to do.
        let again = patch(&done.text, "random.urdf", &edits).unwrap();
        prop_assert!(again.splices.is_empty(), "{:?}", again.splices);

        // No foreign line ending, no exponent, no negative zero in what is new.
        for splice in &done.splices {
            prop_assert!(hand.line_ending == "\r\n" || !splice.new.contains('\r'));
            prop_assert!(!hand.line_ending.is_empty() || !splice.new.contains('\n'));
            prop_assert!(!splice.new.split([' ', '"']).any(|word| word == "-0"));
        }
        prop_assert!(diff_models(&expected, &RobotModel::from_urdf_text(&done.text, "r").unwrap()).is_empty());
    }

    /// The way from a link to another and back is the identity; a chain is the quotient of two ways from the root.
    #[test]
    fn chains_compose(joints in prop::collection::vec(joint(), 1..9), angles in prop::collection::vec(angle(), 9), ends in any::<(usize, usize, usize)>()) {
        let text = written(&joints, &Hand { line_ending: "\n", indent: "", quote: '"', byte_order_mark: false, comments: false });
        let model = RobotModel::from_urdf_text(&text, "random.urdf").unwrap();
        let links: Vec<_> = model.link_ids().collect();
        let [a, b, c] = [ends.0, ends.1, ends.2].map(|end| links[end % links.len()]);
        let a_from_c = model.link_from_link(&angles, a, b) * model.link_from_link(&angles, b, c);
        let difference = a_from_c.to_homogeneous() - model.link_from_link(&angles, a, c).to_homogeneous();
        prop_assert!(difference.amax() < 1e-13);
        let all = model.forward_kinematics(&angles);
        let difference = all[c.index()].to_homogeneous() - model.root_from_link(&angles, c).to_homogeneous();
        prop_assert!(difference.amax() < 1e-13);
    }

    /// Whatever the bytes, there is an answer and no panic.
    #[test]
    fn damaged_text_is_answered(joints in prop::collection::vec(joint(), 1..5), hand in hand(), cut in any::<(usize, usize)>(), junk in "[<>/\"'& ${}a-z0-9.=-]{0,6}") {
        let text = written(&joints, &hand);
        let chars: Vec<char> = text.chars().collect();
        let (from, to) = (cut.0 % chars.len(), cut.1 % chars.len());
        let damaged: String = chars[..from].iter().copied().chain(junk.chars()).chain(chars[from.max(to)..].iter().copied()).collect();
        let edits = [UrdfEdit::SetOrigin { joint: "j0".to_owned(), parent_link_from_joint: Isometry3::translation(0.5, 0.25, 0.125) }];
        match RobotModel::from_urdf_text(&damaged, "damaged.urdf") {
            Ok(_) => if let Ok(done) = patch(&damaged, "damaged.urdf", &edits) {
                prop_assert_eq!(revert(&done.text, &done.record(&damaged)).unwrap(), damaged);
            },
            Err(error) => {
                prop_assert!(!error.problems.is_empty());
                prop_assert!(error.to_string().starts_with("damaged.urdf:"));
                let _ = patch(&damaged, "damaged.urdf", &edits);
            }
        }
    }
}
