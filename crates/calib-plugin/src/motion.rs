//! The motion of one joint as plain arrays: what estimators of both kinds are given.

/// What was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum Shape {
    /// Markers on the moving limb, not necessarily rigid to each other.
    Points = 1,
    /// Markers of one rigid body, seen together.
    Markers = 2,
    /// Poses of one body.
    Poses = 3,
    /// Simultaneous poses of both sides of the joint; track 0 is the body of reference (parent).
    TwoBodies = 4,
}

impl Shape {
    /// All.
    pub const ALL: [Self; 4] = [Self::Points, Self::Markers, Self::Poses, Self::TwoBodies];

    /// Its name in descriptions.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Points => "points",
            Self::Markers => "markers",
            Self::Poses => "poses",
            Self::TwoBodies => "two bodies",
        }
    }

    /// True for poses.
    #[must_use]
    pub const fn is_poses(self) -> bool {
        matches!(self, Self::Poses | Self::TwoBodies)
    }
}

/// `tracker_from_body` of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyPose {
    /// Row-major; the columns are the body's axes in the tracker's frame.
    pub rotation: [[f64; 3]; 3],
    /// The body's origin, m.
    pub translation_m: [f64; 3],
}

/// The motion of one joint in one tracker frame, borrowed: sample s of track k stands at `k · samples + s`.
///
/// Lengths m, angles rad. Seen samples are finite and rotations are rotations; lost samples are zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion<'a> {
    /// What was measured.
    pub shape: Shape,
    /// Markers; poses: 1; two bodies: 2.
    pub tracks: usize,
    /// Samples of each track.
    pub samples: usize,
    /// tracks × samples: 0 lost, 1 seen.
    pub seen: &'a [u8],
    /// tracks × samples positions, m; empty for poses.
    pub points_m: &'a [[f64; 3]],
    /// tracks × samples; empty for points.
    pub rotations: &'a [[[f64; 3]; 3]],
    /// tracks × samples, m; empty for points.
    pub translations_m: &'a [[f64; 3]],
    /// tracks × samples covariances of points, m².
    pub covariances_m2: Option<&'a [[[f64; 3]; 3]]>,
    /// Joint angle of each sample, rad, from the encoders.
    pub angles_rad: Option<&'a [f64]>,
    /// A point that an axis must pass through, m.
    pub center_m: Option<[f64; 3]>,
    /// The side that an axis points to where angles do not say.
    pub towards: Option<[f64; 3]>,
    /// Position noise of one coordinate as the tracker states it, m.
    pub sigma_t_m: Option<f64>,
    /// Orientation noise about one axis as the tracker states it, rad.
    pub sigma_r_rad: Option<f64>,
    /// Probability of calling an unanswerable recording answerable.
    pub significance: f64,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl<'a> Motion<'a> {
    /// Samples of a marker; nothing for a track there is not.
    pub fn points(&self, track: usize) -> impl Iterator<Item = Option<[f64; 3]>> + 'a {
        let (seen, points) = (self.of(self.seen, track), self.of(self.points_m, track));
        seen.iter()
            .zip(points)
            .map(|(seen, point)| (*seen != 0).then_some(*point))
    }

    /// Samples of a body; nothing for a track there is not.
    pub fn poses(&self, track: usize) -> impl Iterator<Item = Option<BodyPose>> + 'a {
        let seen = self.of(self.seen, track);
        let (rotations, translations) = (
            self.of(self.rotations, track),
            self.of(self.translations_m, track),
        );
        seen.iter().zip(rotations.iter().zip(translations)).map(
            |(seen, (rotation, translation))| {
                (*seen != 0).then_some(BodyPose {
                    rotation: *rotation,
                    translation_m: *translation,
                })
            },
        )
    }

    fn of<T>(&self, table: &'a [T], track: usize) -> &'a [T] {
        let start = track.saturating_mul(self.samples);
        table
            .get(start..start.saturating_add(self.samples))
            .unwrap_or(&[])
    }
}

/// The same, owned.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionData {
    shape: Shape,
    tracks: usize,
    samples: usize,
    seen: Vec<u8>,
    points_m: Vec<[f64; 3]>,
    rotations: Vec<[[f64; 3]; 3]>,
    translations_m: Vec<[f64; 3]>,
    /// tracks × samples covariances of points, m²; empty: not known.
    pub covariances_m2: Vec<[[f64; 3]; 3]>,
    /// Joint angle of each sample, rad; empty: not known.
    pub angles_rad: Vec<f64>,
    /// A point that an axis must pass through, m.
    pub center_m: Option<[f64; 3]>,
    /// The side that an axis points to where angles do not say.
    pub towards: Option<[f64; 3]>,
    /// Position noise of one coordinate, m.
    pub sigma_t_m: Option<f64>,
    /// Orientation noise about one axis, rad.
    pub sigma_r_rad: Option<f64>,
    /// Probability of calling an unanswerable recording answerable. 10⁻³, as the built-in estimators.
    pub significance: f64,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl MotionData {
    fn new(shape: Shape, tracks: usize, samples: usize) -> Self {
        Self {
            shape,
            tracks,
            samples,
            seen: vec![0; tracks * samples],
            points_m: Vec::new(),
            rotations: Vec::new(),
            translations_m: Vec::new(),
            covariances_m2: Vec::new(),
            angles_rad: Vec::new(),
            center_m: None,
            towards: None,
            sigma_t_m: None,
            sigma_r_rad: None,
            significance: 1e-3,
            seed: 1,
        }
    }

    /// Markers of a limb; shorter tracks are filled up with lost samples.
    #[must_use]
    pub fn points(tracks: &[Vec<Option<[f64; 3]>>]) -> Self {
        Self::of_points(Shape::Points, tracks)
    }

    /// Markers of one rigid body.
    #[must_use]
    pub fn markers(tracks: &[Vec<Option<[f64; 3]>>]) -> Self {
        Self::of_points(Shape::Markers, tracks)
    }

    /// Poses of one body.
    #[must_use]
    pub fn poses(poses: &[Option<BodyPose>]) -> Self {
        Self::of_poses(Shape::Poses, &[poses])
    }

    /// Poses of the body of reference and of the other.
    #[must_use]
    pub fn two_bodies(parent: &[Option<BodyPose>], child: &[Option<BodyPose>]) -> Self {
        Self::of_poses(Shape::TwoBodies, &[parent, child])
    }

    fn of_points(shape: Shape, tracks: &[Vec<Option<[f64; 3]>>]) -> Self {
        let samples = tracks.iter().map(Vec::len).max().unwrap_or(0);
        let mut data = Self::new(shape, tracks.len(), samples);
        data.points_m = vec![[0.0; 3]; tracks.len() * samples];
        for (k, track) in tracks.iter().enumerate() {
            for (s, sample) in track.iter().enumerate() {
                if let Some(point) = sample {
                    data.seen[k * samples + s] = 1;
                    data.points_m[k * samples + s] = *point;
                }
            }
        }
        data
    }

    fn of_poses(shape: Shape, tracks: &[&[Option<BodyPose>]]) -> Self {
        let samples = tracks.iter().map(|t| t.len()).max().unwrap_or(0);
        let mut data = Self::new(shape, tracks.len(), samples);
        data.rotations = vec![[[0.0; 3]; 3]; tracks.len() * samples];
        data.translations_m = vec![[0.0; 3]; tracks.len() * samples];
        for (k, track) in tracks.iter().enumerate() {
            for (s, sample) in track.iter().enumerate() {
                if let Some(pose) = sample {
                    data.seen[k * samples + s] = 1;
                    data.rotations[k * samples + s] = pose.rotation;
                    data.translations_m[k * samples + s] = pose.translation_m;
                }
            }
        }
        data
    }

    /// The borrowed form.
    #[must_use]
    pub fn view(&self) -> Motion<'_> {
        Motion {
            shape: self.shape,
            tracks: self.tracks,
            samples: self.samples,
            seen: &self.seen,
            points_m: &self.points_m,
            rotations: &self.rotations,
            translations_m: &self.translations_m,
            covariances_m2: (!self.covariances_m2.is_empty()).then_some(&self.covariances_m2),
            angles_rad: (!self.angles_rad.is_empty()).then_some(&self.angles_rad),
            center_m: self.center_m,
            towards: self.towards,
            sigma_t_m: self.sigma_t_m,
            sigma_r_rad: self.sigma_r_rad,
            significance: self.significance,
            seed: self.seed,
        }
    }
}
