//! A robot that is ready to be evaluated: names resolved, everything in the order of computation.

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::effect::{Outside, Term};
use crate::error::ModelError;
use crate::file::{ModelEffect, ModelJoint};
use crate::origin::Origin;
use crate::pose::Pose;

/// Index of a link: 0 is the root, i + 1 the child of joint i.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LinkId(pub(crate) usize);

impl LinkId {
    /// Its place among [`Model::links`].
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

/// What a pose is asked of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// A link.
    Link(LinkId),
    /// A tracking body with a frame, by its index in [`Model::bodies`].
    Body(usize),
    /// A point of the robot in the axes of its link, by its index in [`Model::points`].
    Point(usize),
}

impl From<LinkId> for Place {
    fn from(link: LinkId) -> Self {
        Self::Link(link)
    }
}

/// Gives what computes an effect of a joint that a plugin computes; `None` where that plugin is not there.
pub type FindOutside<'a> = &'a dyn Fn(&ModelJoint, &ModelEffect) -> Option<&'static Outside>;

/// A joint that the controller moves.
#[derive(Debug, Clone, PartialEq)]
pub struct JointInfo {
    /// Its name.
    pub name: String,
    /// It slides: m in place of rad.
    pub prismatic: bool,
    /// Limits of the URDF, rad or m.
    pub limits: Option<[f64; 2]>,
    /// Smallest and largest reading that was fitted, equal where the joint stood still; `None` where it moves nothing that was seen.
    pub fitted_range: Option<[f64; 2]>,
}

impl JointInfo {
    /// Where the joint stood in all recordings, if none moved it.
    #[must_use]
    pub fn stood_at(&self) -> Option<f64> {
        self.fitted_range
            .filter(|[low, high]| low == high)
            .map(|[at, _]| at)
    }
}

/// A joint that moves by no more stands still, rad or m: encoders flicker by less.
pub const STOOD_STILL: f64 = 1e-3;

/// Whether a posture lies where the model was fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// All joints are in their fitted ranges, and those that stood still are where they stood; joints that move nothing that was seen are not looked at.
    Inside,
    /// This joint (index in [`Model::joints`]) is outside of its fitted range: nothing was verified there.
    Outside(usize),
    /// This joint is outside of its limits.
    BeyondLimits(usize),
}

/// One term of a joint's effects.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointTerm {
    pub term: &'static Term,
    /// Its coefficient.
    pub value: f64,
    /// Axis across and which of the two; `None`: not across.
    pub across: Option<(usize, Vector3<f64>)>,
    /// The reach that grows, m, in the joint's axes; `None`: no growth.
    pub along: Option<Vector3<f64>>,
    /// The joint whose reading it follows.
    pub other: Option<usize>,
    /// Its size jumps with the load's sign: no derivative is taken through the jump.
    pub jumps: bool,
}

/// A joint with its link.
#[derive(Debug, Clone)]
pub(crate) struct Joint {
    /// Index of the parent link.
    pub parent: usize,
    /// `parent_from_joint`, calibrated and nominal.
    pub origin: Origin,
    pub nominal: Origin,
    pub axis: Option<Axis>,
    /// Axes across, in the child's frame.
    pub across: [Vector3<f64>; 2],
    /// reading = multiplier · q[source] + offset
    pub source: usize,
    pub multiplier: f64,
    pub offset: f64,
    /// The controller moves it: q[source] is its own reading.
    pub own: bool,
    pub gear_ratio: f64,
    pub friction: f64,
    pub terms: Vec<JointTerm>,
    /// Those of [`crate::effect::HARMONICS`] by their coefficients.
    pub harmonics: [f64; 8],
    /// Those of [`crate::effect::OF_STATE`].
    pub of_state: [f64; 5],
    /// Those of [`crate::effect::LATERAL`].
    pub lateral: [f64; 2],
    /// That of the loaded flank.
    pub flank: f64,
    /// Those that follow another joint: its index, their coefficients.
    pub couplings: Vec<(usize, f64)>,
    /// Growth of what leads to the joint, m/K, in the joint's axes.
    pub growth: Vector3<f64>,
    /// The others.
    pub direct: Vec<JointTerm>,
    /// A term grows with the temperature; one yields across the axis; one is a harmonic of the reading; one of the motor's angle.
    pub grows: bool,
    pub yields: bool,
    pub turns: bool,
    pub geared: bool,
    /// Mass and first moment of the child link, kg and kg m in its frame.
    pub moment: Vector3<f64>,
    pub mass: f64,
    /// Mass of everything that the joint carries.
    pub carried: f64,
}

/// A row of the root of the covariance, and what it moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    /// Of `tracker_from_root`.
    Tracker(usize),
    /// Of a joint's origin.
    Origin(usize, usize),
    /// Coefficient of a joint's term.
    Coefficient(usize, usize),
    /// Of a body's mount.
    Mount(usize, usize),
    /// Coordinate of a point.
    Point(usize, usize),
    /// First moment of a link.
    Moment(usize, usize),
    /// Nothing that this library predicts (a marker of a body).
    Unused,
}

/// Something that is fixed to a link.
#[derive(Debug, Clone)]
pub(crate) struct Fixed {
    pub name: String,
    pub link: usize,
    pub link_from_it: Pose,
}

/// A calibrated robot. It is read once and never changes; share it between threads freely.
#[derive(Debug, Clone)]
pub struct Model {
    pub(crate) name: String,
    pub(crate) links: Vec<String>,
    pub(crate) joints: Vec<Joint>,
    pub(crate) moved: Vec<JointInfo>,
    pub(crate) gravity: Vector3<f64>,
    /// A term of some joint depends on the load.
    pub(crate) loaded: bool,
    pub(crate) threshold: f64,
    /// At which the lengths hold, °C.
    pub(crate) reference_temperature: f64,
    pub(crate) tracker_from_root: Pose,
    pub(crate) bodies: Vec<Fixed>,
    pub(crate) points: Vec<Fixed>,
    /// Bodies and points that a link's name was taken from: in the file, here.
    pub(crate) renamed: Vec<(String, String)>,
    /// By link: the joints that lead to it, root first.
    pub(crate) chains: Vec<Vec<usize>>,
    /// By link: the entries of q of the joints that lead to it, in ascending order.
    pub(crate) leading: Vec<Vec<usize>>,
    /// The same, and those that its effects depend on: coupled joints, masses further out.
    pub(crate) movers: Vec<Vec<usize>>,
    /// One for each row of `root`.
    pub(crate) numbers: Vec<Number>,
    /// By rows.
    pub(crate) root: Vec<f64>,
    /// Columns of `root`; 0: no uncertainty.
    pub(crate) columns: usize,
}

impl Model {
    /// The robot's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The joints that the controller moves, in the order of all slices `q`.
    #[must_use]
    pub fn joints(&self) -> &[JointInfo] {
        &self.moved
    }

    /// Names of all links; the first is the root.
    #[must_use]
    pub fn links(&self) -> &[String] {
        &self.links
    }

    /// Names of the bodies that have a frame.
    pub fn bodies(&self) -> impl Iterator<Item = &str> {
        self.bodies.iter().map(|b| b.name.as_str())
    }

    /// Names of the points.
    pub fn points(&self) -> impl Iterator<Item = &str> {
        self.points.iter().map(|p| p.name.as_str())
    }

    /// Index of a link.
    ///
    /// # Errors
    /// [`ModelError::Name`].
    pub fn link(&self, name: &str) -> Result<LinkId, ModelError> {
        let found = self.links.iter().position(|l| l == name);
        found.map(LinkId).ok_or_else(|| ModelError::Name {
            kind: "link",
            name: name.to_owned(),
            known: self.links.join(", "),
        })
    }

    /// Bodies and points that the file calls as a link is called: their names there, and here (`_body` behind it, as in the scene).
    #[must_use]
    pub fn renamed(&self) -> &[(String, String)] {
        &self.renamed
    }

    /// A link, body or point by its name; `None` where there is none. No body or point has the name of a link
    /// ([`Model::renamed`]).
    #[must_use]
    pub fn place(&self, name: &str) -> Option<Place> {
        let of = |fixed: &[Fixed]| fixed.iter().position(|f| f.name == name);
        let link = self.links.iter().position(|l| l == name);
        let link = link.map(|l| Place::Link(LinkId(l)));
        let link = link.or_else(|| of(&self.bodies).map(Place::Body));
        link.or_else(|| of(&self.points).map(Place::Point))
    }

    /// The link at the end of the longest chain: the tool of an arm. Of equal ones the first.
    #[must_use]
    pub fn last_link(&self) -> LinkId {
        let depth = |link: &usize| (self.chains[*link].len(), usize::MAX - link);
        LinkId((0..self.links.len()).max_by_key(depth).unwrap_or(0))
    }

    /// Indices in [`Model::joints`] of the joints that lead to a link: those that a correction may use.
    #[must_use]
    pub fn joints_to(&self, link: LinkId) -> &[usize] {
        self.leading.get(link.0).map_or(&[], Vec::as_slice)
    }

    /// Where the root stands in the tracker.
    #[must_use]
    pub fn tracker_from_root(&self) -> &Pose {
        &self.tracker_from_root
    }

    /// A joint that moved by less than this keeps its direction of approach, rad or m.
    #[must_use]
    pub fn approach_threshold(&self) -> f64 {
        self.threshold
    }

    /// Whether the length of a link follows its temperature.
    #[must_use]
    pub fn grows(&self) -> bool {
        self.joints.iter().any(|j| j.grows)
    }

    /// Temperature at which the lengths hold, °C.
    #[must_use]
    pub fn reference_temperature_c(&self) -> f64 {
        self.reference_temperature
    }

    /// Whether [`Model::sigma`] can answer.
    #[must_use]
    pub fn has_uncertainty(&self) -> bool {
        self.columns > 0
    }

    /// Link and offset of a place.
    pub(crate) fn fixed(&self, place: Place) -> Option<(usize, Pose)> {
        match place {
            Place::Link(link) => (link.0 < self.links.len()).then(|| (link.0, Pose::identity())),
            Place::Body(k) => self.bodies.get(k).map(|f| (f.link, f.link_from_it)),
            Place::Point(k) => self.points.get(k).map(|f| (f.link, f.link_from_it)),
        }
    }

    /// Whether every joint is where the model was fitted. `q` as [`Model::joints`].
    ///
    /// # Errors
    /// [`ModelError::Length`], [`ModelError::NotFinite`].
    pub fn scope(&self, q: &[f64]) -> Result<Scope, ModelError> {
        /// Rounding of a limit that was written in degrees, rad or m.
        const SLACK: f64 = 1e-9;
        self.checked("q", q)?;
        let outside = |range: Option<[f64; 2]>, q: f64| {
            range.is_some_and(|[low, high]| q < low - SLACK || q > high + SLACK)
        };
        let joints = || self.moved.iter().zip(q).enumerate();
        if let Some((i, _)) = joints().find(|(_, (j, q))| outside(j.limits, **q)) {
            return Ok(Scope::BeyondLimits(i));
        }
        let beyond = |j: &JointInfo, q: f64| match j.stood_at() {
            Some(at) => (q - at).abs() > STOOD_STILL,
            None => outside(j.fitted_range, q),
        };
        let found = joints().find(|(_, (j, q))| beyond(j, **q));
        Ok(found.map_or(Scope::Inside, |(i, _)| Scope::Outside(i)))
    }

    /// A joint (index in [`Model::joints`]) before `place` that no recording moved and that stands elsewhere at `q`: where its axis is, was not
    /// measured, and [`Model::sigma`] does not hold it. `q` as [`Model::joints`].
    ///
    /// # Errors
    /// [`ModelError::Length`], [`ModelError::NotFinite`], [`ModelError::ForeignWork`].
    pub fn not_covered(&self, q: &[f64], place: Place) -> Result<Option<usize>, ModelError> {
        self.checked("q", q)?;
        let (link, _) = self.fixed(place).ok_or(ModelError::ForeignWork)?;
        let elsewhere = |i: &&usize| {
            let at = self.moved[**i].stood_at();
            at.is_some_and(|at| (q[**i] - at).abs() > STOOD_STILL)
        };
        Ok(self.leading[link].iter().find(elsewhere).copied())
    }

    /// Length and finiteness of a slice in the order of [`Model::joints`].
    pub(crate) fn checked(&self, what: &'static str, q: &[f64]) -> Result<(), ModelError> {
        if q.len() != self.moved.len() {
            return Err(ModelError::Length {
                what,
                found: q.len(),
                expected: self.moved.len(),
            });
        }
        match q.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(ModelError::NotFinite { what, index }),
            None => Ok(()),
        }
    }
}
