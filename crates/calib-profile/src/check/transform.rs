//! Transforms to report, and loop closures.

use super::*;
use crate::profile::{LinkTransform, Loop};
use crate::raw::RawTransform;

impl Checker<'_> {
    pub(super) fn transforms(&mut self) -> BTreeMap<String, LinkTransform> {
        let raw = self.raw;
        let mut transforms = BTreeMap::new();
        for (name, t) in &raw.transforms {
            let parent = self.link(&["transforms", name, "parent"], &t.parent);
            let child = self.link(&["transforms", name, "child"], &t.child);
            let ends = parent.zip(child);
            let correct = t
                .correct
                .as_ref()
                .and_then(|joint| self.correct(name, t, joint, ends));
            if let Some((parent, child)) = ends {
                transforms.insert(
                    name.clone(),
                    LinkTransform {
                        parent,
                        child,
                        correct,
                    },
                );
            }
        }
        transforms
    }

    /// The fixed joint between two links that takes up the difference.
    fn correct(
        &mut self,
        name: &str,
        transform: &RawTransform,
        joint_name: &str,
        ends: Option<(LinkId, LinkId)>,
    ) -> Option<JointId> {
        let path = ["transforms", name, "correct"];
        let joint = self.joint(&path, joint_name)?;
        if self.robot.joint(joint).kind != JointKind::Fixed {
            self.problem(
                &path,
                format!("joint `{joint_name}` moves"),
                "name a fixed joint, e.g. the one that stands the robot on its table",
            );
        }
        if let Some((parent, child)) = ends {
            let chain = self.robot.chain(parent, child);
            if !chain.iter().any(|step| step.joint == joint) {
                self.problem(
                    &path,
                    format!(
                        "joint `{joint_name}` is not between `{}` and `{}`",
                        transform.parent, transform.child
                    ),
                    "name a fixed joint on the way",
                );
            }
        }
        Some(joint)
    }

    pub(super) fn loops(&mut self) -> BTreeMap<String, Loop> {
        let raw = self.raw;
        for (name, l) in &raw.loops {
            for (key, end) in [("from", &l.from), ("to", &l.to)] {
                self.known("origin", &["loops", name, key], end, raw.origins.keys());
            }
            if l.from == l.to {
                self.problem(
                    &["loops", name, "to"],
                    "the loop ends where it starts",
                    "name two different origins",
                );
            }
            if let Some(recording) = &l.recording {
                self.known(
                    "recording",
                    &["loops", name, "recording"],
                    recording,
                    raw.recordings.keys(),
                );
            }
        }
        raw.loops
            .iter()
            .map(|(name, l)| {
                (
                    name.clone(),
                    Loop {
                        from: l.from.clone(),
                        to: l.to.clone(),
                        recording: l.recording.clone(),
                    },
                )
            })
            .collect()
    }
}
