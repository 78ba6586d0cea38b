//! Tracking bodies.

use super::names::MarkerList;
use super::*;
use crate::profile::{Body, BodyKind};
use crate::raw::{RawBody, RawSplit};

impl Checker<'_> {
    pub(super) fn bodies(&mut self) -> BTreeMap<String, Body> {
        let raw = self.raw;
        let mut owner: BTreeMap<&str, &str> = BTreeMap::new();
        let mut bodies = BTreeMap::new();
        for (name, body) in &raw.bodies {
            for marker in &body.markers {
                if let Some(other) = owner.insert(marker, name) {
                    self.problem(
                        &["bodies", name, "markers"],
                        format!("marker `{marker}` belongs to `{other}` already"),
                        "one marker belongs to one body; rename or remove it",
                    );
                }
            }
            if let Some(split) = &body.split {
                self.split(name, split);
            }
            if let Some(body) = self.body(name, body) {
                bodies.insert(name.clone(), body);
            }
        }
        bodies
    }

    fn body(&mut self, name: &str, raw: &RawBody) -> Option<Body> {
        let link = self.link(&["bodies", name, "link"], &raw.link);
        let kind = match (raw.pose, raw.markers.is_empty()) {
            (true, true) => BodyKind::Pose,
            (false, false) => {
                let template = self.template(name, raw);
                BodyKind::Markers {
                    names: raw.markers.clone(),
                    template,
                }
            }
            (true, false) => {
                self.problem(
                    &["bodies", name, "pose"],
                    "`pose: true` and `markers` contradict each other",
                    "keep one: the recording has either poses of the body or its markers",
                );
                BodyKind::Pose
            }
            (false, true) => {
                self.key_problem(
                    &["bodies", name],
                    format!("body `{name}` has neither `markers` nor `pose: true`"),
                    "list its markers, or say `pose: true` when the tracker exports its pose",
                );
                BodyKind::Pose
            }
        };
        if let Some(sigma) = raw.template_sigma_mm {
            let path = ["bodies", name, "template_sigma_mm"];
            self.positive(&path, sigma);
            if raw.template_mm.is_empty() {
                self.key_problem(
                    &path,
                    "no template is stated that this could be the standard deviation of",
                    "state the marker positions under `template_mm`, or remove the key: they are estimated then",
                );
            }
        }
        Some(Body {
            link: link?,
            kind,
            template_sigma: raw.template_sigma_mm.map(|s| s * MM),
            mount: raw.mount.as_ref().map(pose),
            split: raw.split.clone(),
        })
    }

    /// The recordings of a `split`, and the name that the body before it gets.
    fn split(&mut self, name: &str, split: &RawSplit) {
        let recordings = &self.raw.recordings;
        self.known(
            "recording",
            &["bodies", name, "split", "recording"],
            &split.recording,
            recordings.keys(),
        );
        for (i, recording) in split.before.iter().enumerate() {
            let path = ["bodies", name, "split", "before", &i.to_string()];
            self.known("recording", &path, recording, recordings.keys());
        }
        let before = format!("{name}_before");
        if self.raw.bodies.contains_key(&before) {
            self.problem(
                &["bodies", name, "split"],
                format!("a body `{before}` exists already"),
                "rename that body: the split gives its name to the rows before the change",
            );
        }
    }

    fn template(&mut self, name: &str, raw: &RawBody) -> Option<Vec<Point3<f64>>> {
        if raw.template_mm.is_empty() {
            return None;
        }
        self.marker_places(
            &["bodies", name, "template_mm"],
            name,
            &raw.template_mm,
            MarkerList::Template,
        );
        let points = raw.markers.iter().filter_map(|m| raw.template_mm.get(m));
        Some(
            points
                .map(|p| Point3::from(Vector3::from(*p) * MM))
                .collect(),
        )
    }
}
