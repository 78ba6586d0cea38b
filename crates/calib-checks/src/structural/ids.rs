//! Typed positions in the input. A joint index equals `calib_urdf::JointId::index`, a link index `LinkId::index`.

use serde::Serialize;

/// A joint, and the column of its readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct JointIndex(pub usize);

/// A link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct LinkIndex(pub usize);

/// A body, in the order of [`Data::bodies`](super::Data::bodies).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct BodyIndex(pub usize);

/// A recording, as the rows number them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct RecordingIndex(pub usize);

/// One sample: a marker (or, for a body with poses, the whole pose: marker 0) of a body in a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct SampleIndex {
    /// Row of the input.
    pub row: usize,
    /// Body.
    pub body: BodyIndex,
    /// Marker of the body.
    pub marker: usize,
}

impl From<calib_urdf::JointId> for JointIndex {
    fn from(id: calib_urdf::JointId) -> Self {
        Self(id.index())
    }
}

impl From<calib_urdf::LinkId> for LinkIndex {
    fn from(id: calib_urdf::LinkId) -> Self {
        Self(id.index())
    }
}
