//! A robot and its recordings, ready for the estimators.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use calib_core::measurement::Growth;
use calib_finding::Finding;
use calib_profile::{BodyKind, Profile, RecordingSpec};
use calib_recording::{Meta, Poses};
use calib_urdf::{JointId, RobotModel};
use nalgebra::Matrix3;

use crate::prepare::aligned::Alignment;
use crate::prepare::estimators::Estimators;
use crate::prepare::excluded::Excluded;
use crate::prepare::loads::Masses;
use crate::prepare::mixed::Mixed;
use crate::prepare::row_noise::RowNoise;
use crate::prepare::scatter::Scatter;

/// A profile as it was written, for messages with their place.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Written {
    /// The file, as the caller named it.
    pub shown: String,
    /// Its text.
    pub text: String,
}

/// A profile with its robot, before any recording is read.
#[derive(Debug, Clone)]
pub struct RobotProfile {
    /// The profile's file name, without folder.
    pub file: String,
    /// The profile as it was written.
    pub written: Written,
    /// Folder that relative paths start from.
    pub folder: PathBuf,
    /// The checked profile.
    pub profile: Profile,
    /// The nominal robot.
    pub model: RobotModel,
    /// What loads its joints.
    pub masses: Masses,
    /// The URDF, byte for byte.
    pub urdf_text: String,
    /// Digests of the profile and the nominal URDF.
    pub digests: Vec<Digest>,
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Digest {
    /// Relative to the profile.
    pub path: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

/// One recording, ready for the estimators.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Its name in the profile.
    pub name: String,
    /// What the profile says of it.
    pub spec: RecordingSpec,
    /// The table, SI.
    pub poses: Poses,
    /// Joint positions per row, indexed by joint id, rad or m; `None` where a recorded joint is missing in that row.
    pub q: Vec<Option<Vec<f64>>>,
    /// Where it comes from and what was converted.
    pub meta: Meta,
    /// How rows with a time became poses; `None` for a table whose rows are poses.
    pub alignment: Option<Alignment>,
    /// Speed of each recorded joint per row of a motion, rad/s or m/s; empty for static poses.
    pub velocities: BTreeMap<String, Vec<Option<f64>>>,
    /// From which side a joint came before its first motion in the recording, by joint index: +1 from below, −1 from above. What is
    /// missing is not known.
    pub starts: BTreeMap<usize, f64>,
    /// Shape of each marker's covariance per row, in units of the usual variance; empty where no scatter is known.
    pub shapes: BTreeMap<String, Vec<Option<Matrix3<f64>>>>,
    /// The markers whose shapes follow from the cameras of the profile.
    pub by_camera: BTreeSet<String>,
    /// Scatter of markers about their bodies, and of bodies that nothing moves; `None` where nothing tells.
    pub scatter: Option<Scatter>,
    /// Usual variances of single rows about the mean of their hold; zero where the rows are no means of holds.
    pub row_noise: RowNoise,
    /// Body → row → what makes the errors of its points independent there; `None` where they are.
    pub mixed: BTreeMap<String, Vec<Option<Mixed>>>,
}

/// Smallest and largest position of a joint in these rows.
pub(crate) fn range<'a>(
    rows: impl Iterator<Item = &'a Vec<f64>>,
    joint: JointId,
) -> Option<(f64, f64)> {
    let positions = rows.map(|q| q[joint.index()]);
    positions
        .filter(|q| q.is_finite())
        .fold(None, |range, q| match range {
            None => Some((q, q)),
            Some((low, high)) => Some((q.min(low), q.max(high))),
        })
}

/// Bodies whose noise along the line of sight has levels of its own, and how these grow.
pub type Sights = BTreeMap<String, Growth>;

/// Bodies for which the profile states the noise along the line of sight.
pub(crate) fn stated_sights(profile: &Profile) -> Sights {
    let sight = profile.tracker.sight;
    let is_stated = |kind: &BodyKind| match kind {
        BodyKind::Pose => sight.body.is_some() || sight.body_rad.is_some(),
        BodyKind::Markers { .. } => sight.marker.is_some(),
    };
    let bodies = profile.bodies.iter();
    let stated = bodies.filter(|(_, body)| is_stated(&body.kind));
    stated
        .map(|(name, _)| (name.clone(), Growth::default()))
        .collect()
}

/// Everything the estimation needs.
#[derive(Debug, Clone)]
pub struct Inputs {
    /// Profile and robot.
    pub robot: RobotProfile,
    /// Recordings by name.
    pub recordings: BTreeMap<String, Loaded>,
    /// What was noticed while reading.
    pub findings: Vec<Finding>,
    /// What of the recordings takes no part, found before the fit.
    pub excluded: Vec<Excluded>,
    /// The measurements that this took out: recording, row from 0, marker or body.
    pub taken_out: BTreeSet<(String, usize, String)>,
    /// Bodies of very many markers, for which a few points stand: scatter of a marker coordinate about the rigid body, m, where it can be told.
    pub condensed: BTreeMap<String, Option<f64>>,
    /// Bodies with noise of its own along the line of sight, as the profile states or the fit found.
    pub sights: Sights,
    /// Digests of all files read, profile first.
    pub digests: Vec<Digest>,
    /// Estimators, readers and writers that the profile can name.
    pub estimators: Arc<Estimators>,
}

impl Inputs {
    /// Smallest and largest position of a joint that moves on its own, over all recordings, rad or m; `None` where none is known.
    #[must_use]
    pub fn range(&self, joint: JointId) -> Option<(f64, f64)> {
        let rows = self.recordings.values();
        range(rows.flat_map(|loaded| loaded.q.iter().flatten()), joint)
    }

    /// Takes bodies and markers of single rows out, as if the tracker had lost them, and remembers why.
    pub fn exclude(&mut self, excluded: Vec<Excluded>) {
        for out in &excluded {
            let taken_out = &mut self.taken_out;
            let mut remember = |subject: &str| {
                taken_out.insert((out.recording.clone(), out.row, subject.to_owned()));
            };
            let markers = match self.robot.profile.bodies.get(&out.body).map(|b| &b.kind) {
                Some(BodyKind::Markers { names, .. }) => names.clone(),
                Some(BodyKind::Pose) | None => vec![out.body.clone()],
            };
            let Some(loaded) = self.recordings.get_mut(&out.recording) else {
                continue;
            };
            let bodies = &mut loaded.poses.bodies;
            let track = bodies.get_mut(&out.body);
            let pose = track.and_then(|track| track.get_mut(out.row));
            if pose.is_some_and(|pose| pose.take().is_some()) {
                remember(&out.body);
            }
            for marker in markers {
                let track = loaded.poses.markers.get_mut(&marker);
                let point = track.and_then(|track| track.get_mut(out.row));
                if point.is_some_and(|point| point.take().is_some()) {
                    remember(&marker);
                }
            }
        }
        self.excluded.extend(excluded);
    }

    /// How many measurements this took out: markers of a body, or a body or stream of its own.
    #[must_use]
    pub fn taken_out_of(&self, excluded: &Excluded) -> usize {
        let body = self.robot.profile.bodies.get(&excluded.body);
        let markers = body.map(|body| match &body.kind {
            BodyKind::Markers { names, .. } => names.as_slice(),
            BodyKind::Pose => &[],
        });
        let seen = |subject: &String| {
            let key = (excluded.recording.clone(), excluded.row, subject.clone());
            self.taken_out.contains(&key)
        };
        let subjects = markers.unwrap_or_default().iter().chain([&excluded.body]);
        subjects.filter(|subject| seen(subject)).count()
    }
}
