//! What the tracker sees of a posture.
//!
//! ```text
//! seen by camera c:  ∠(axis, p − c) ≤ field/2,  |p − c| ≤ range,  no capsule of another rigid part on the way,
//!                    ∠(n, c − p) ≤ the greatest angle of the marker                                               (1)
//! Σ ∝ (Σ_c (1 − d_c d_cᵀ)/ρ_c²)⁻¹     of a marker, from the directions d and distances ρ of the cameras that see it  (2)
//! ```
//!
//! (2) is a triangulation with equal angular noise; its trace over all markers that are seen is on average that of the stated σ.

use std::collections::{BTreeMap, BTreeSet};

use calib_profile::{Camera, Facing, PlanSpec};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::known::CameraNoise;
use crate::scene::Scene;
use crate::shape::Capsule;

/// A marker, or the origin of a body that the tracker states as a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    /// The body.
    pub body: String,
    /// The marker; `None`: the body's pose.
    pub marker: Option<String>,
    /// Index of the link that carries it.
    pub link: usize,
    /// In the frame of the link, m.
    pub at: Point3<f64>,
    /// The side that it shows, in the frame of the link.
    pub facing: Option<Facing>,
    /// Whether planned postures move it.
    pub moves: bool,
}

impl Subject {
    /// The name under which it is recorded.
    #[must_use]
    pub fn name(&self) -> &str {
        self.marker.as_deref().unwrap_or(&self.body)
    }
}

/// The tracker's eyes.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    /// Where the robot stands (`tracker_from_root`).
    pub tracker_from_root: Isometry3<f64>,
    /// Everything that can be seen.
    pub subjects: Vec<Subject>,
    /// How (2) is scaled.
    pub noise: CameraNoise,
    /// Factor of equation (2) that brings its mean trace to that of σ.
    pub scale: f64,
    /// Bodies and markers that are not recorded: they count as hidden.
    pub unrecorded: BTreeSet<String>,
    cameras: Vec<Camera>,
    least: usize,
}

/// What is seen of one subject: equation (2) where there are cameras, up to a factor that all share.
pub type Seen = Option<Option<Matrix3<f64>>>;

impl Sight {
    /// Of the profile's cameras.
    #[must_use]
    pub fn new(spec: &PlanSpec, subjects: Vec<Subject>, tracker_from_root: Isometry3<f64>) -> Self {
        Self {
            tracker_from_root,
            subjects,
            noise: CameraNoise::Stated,
            scale: 1.0,
            unrecorded: BTreeSet::new(),
            cameras: spec.cameras.values().cloned().collect(),
            least: spec.min_cameras,
        }
    }

    /// Whether anything decides what is seen.
    #[must_use]
    pub fn has_cameras(&self) -> bool {
        !self.cameras.is_empty()
    }

    /// Equation (1) for every subject; `occluders` where links can hide it.
    #[must_use]
    pub fn seen(
        &self,
        (scene, body_of_link): (&Scene, &[usize]),
        placed: &[Capsule],
        root_from_link: &[Isometry3<f64>],
    ) -> Vec<Seen> {
        let root_from_tracker = self.tracker_from_root.inverse();
        let of = |subject: &Subject| {
            if self.unrecorded.contains(subject.name()) {
                return None;
            }
            if self.cameras.is_empty() {
                return Some(None);
            }
            let link = &root_from_link[subject.link];
            let at = link * subject.at;
            let in_tracker = self.tracker_from_root * at;
            let (mut count, mut information) = (0, Matrix3::zeros());
            for camera in &self.cameras {
                let eye = root_from_tracker * camera.at;
                let visible = camera.covers(&in_tracker)
                    && shown(subject.facing.as_ref(), link, &(eye - at))
                    && scene.sees(placed, &eye, (&at, body_of_link[subject.link]));
                if visible {
                    count += 1;
                    information += camera.information(&in_tracker);
                }
            }
            let shape = || match self.noise {
                CameraNoise::Equal => None,
                _ => information.try_inverse().map(|m| m * self.scale),
            };
            (count >= self.least).then(shape)
        };
        self.subjects.iter().map(of).collect()
    }

    /// Whether what is seen is a measurement of a moving body: its pose, or as many of its markers as span it.
    #[must_use]
    pub fn measures(&self, seen: &[Seen]) -> bool {
        !self.measured(seen).is_empty()
    }

    /// Moving bodies that are measured.
    #[must_use]
    pub fn measured(&self, seen: &[Seen]) -> BTreeSet<String> {
        /// Markers that span a body.
        const SPAN: usize = 3;
        let mut of_body: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
        for (subject, seen) in self.subjects.iter().zip(seen).filter(|(s, _)| s.moves) {
            let (all, visible) = of_body.entry(&subject.body).or_default();
            *all += 1;
            *visible += usize::from(seen.is_some());
        }
        let enough = |(_, (all, visible)): &(&str, (usize, usize))| *visible >= SPAN.min(*all);
        let measured = of_body.into_iter().filter(enough);
        measured.map(|(body, _)| body.to_owned()).collect()
    }
}

/// The factor by which the mean trace of covariance shapes is 3.
#[must_use]
pub fn normal<'s>(all: impl Iterator<Item = &'s Seen>) -> f64 {
    let shapes = all.flatten().flatten();
    let (sum, count) = shapes.fold((0.0, 0), |(s, n), m| (s + m.trace(), n + 1));
    if count == 0 || sum <= 0.0 {
        return 1.0;
    }
    3.0 * f64::from(count) / sum
}

/// Whether the side that is shown looks toward the eye.
fn shown(facing: Option<&Facing>, root_from_link: &Isometry3<f64>, to_eye: &Vector3<f64>) -> bool {
    facing.is_none_or(|facing| {
        let normal = root_from_link.rotation * facing.normal.into_inner();
        normal.angle(to_eye) <= facing.within
    })
}
