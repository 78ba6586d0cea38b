//! Names that MJCF and SDF keep for themselves.

use std::process::Command;

use calib_export::{Target, export};
use calib_model::file::RobotModelFile;

use crate::common::{Effects, rng, robot};
use crate::exports::read;

/// Links with these names in place of the first ones, the root first.
fn with(names: &[&str]) -> RobotModelFile {
    let mut file = robot(&mut rng(3), 5, true, Effects::All);
    let joints = file.joints.iter().map(|j| j.child.clone());
    let links: Vec<String> = std::iter::once(file.root.clone()).chain(joints).collect();
    for (old, new) in links.iter().zip(names) {
        let change = |name: &mut String| {
            if name == old {
                (*new).clone_into(name);
            }
        };
        change(&mut file.root);
        file.links.iter_mut().for_each(|l| change(&mut l.name));
        for joint in &mut file.joints {
            change(&mut joint.parent);
            change(&mut joint.child);
        }
    }
    file
}

/// A URDF's root is often `world`, and its links often have the names of its joints.
#[test]
fn names_that_a_format_reserves_are_changed_and_that_is_said() {
    let joint = with(&[]).joints[1].name.clone();
    let names = ["world", &joint, "a::b", "__c__"];
    let folder = tempfile::tempdir().expect("a folder");
    for (target, changed, checker, kept) in [
        (Target::Mjcf, 1, "mujoco", &names[1..]),
        (Target::Sdf, 4, "sdf", &names[..0]),
        (Target::Urdf, 0, "urdf", &names[..0]),
    ] {
        let done = export(&read(with(&names)), target, None, None).expect("written");
        assert_eq!(done.renamed.len(), changed, "{:?}", done.renamed);
        for said in &done.renamed {
            assert!(done.text.contains(&said.replace("--", "- -")), "{said}");
        }
        for name in kept {
            assert!(
                done.text.contains(&format!("<body name=\"{name}\"")),
                "{name}"
            );
        }
        let Some(program) = skipped_tests::checker(checker) else {
            continue;
        };
        let path = folder.path().join(format!("robot.{}", target.name()));
        std::fs::write(&path, &done.text).expect("written");
        let mut check = Command::new(program);
        if target == Target::Mjcf {
            check.args([
                "-c",
                "import sys, mujoco; m = mujoco.MjModel.from_xml_path(sys.argv[1]); m.body('world_link')",
            ]);
        }
        let ran = check.arg(&path).output().expect("it starts");
        let said = String::from_utf8_lossy(&ran.stdout).into_owned()
            + &String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success(), "{}: {said}", target.name());
    }
}
