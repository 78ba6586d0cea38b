//! Quantities that follow from the parameters, with the uncertainty they inherit.
//!
//! ```text
//! T(q; x ⊞ δ) = T · exp(F δ),   Cov(T) = F C Fᵀ   ([ω; v] of the child)                     (1)
//! estimable  ⇔  F n = 0 for every direction n that the data do not see                       (2)
//! ```

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6, Point3, Vector3, Vector6};

use calib_geometry::{Twist, so3};

use crate::analysis::observability::weak;
use crate::analysis::solution::Solution;
use crate::analysis::spread::LinearPoint;
use crate::analysis::untested::MovedPoint;
use crate::graph::edge::EdgeKind;
#[cfg(doc)]
use crate::graph::edge::JointEffect;
use crate::graph::effect::{EffectKind, JointState};
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId, PointId};
use crate::model::cache::{EdgeCache, State};
use crate::model::path::{CompiledPath, Derivatives, PathBuffer, Step};

/// Joint readings (rad, m) and regressors of effects at which something is predicted. What is not
/// given is 0; what follows from the reading alone need not be given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Configuration {
    /// Reading per joint edge.
    pub q: BTreeMap<EdgeId, f64>,
    /// What the regressors of a joint edge depend on.
    pub states: BTreeMap<EdgeId, JointState>,
    /// Regressors per joint edge and effect, where they are not those of its state.
    pub regressors: BTreeMap<(EdgeId, EffectKind), f64>,
    /// Shares of a regressor per joint edge and effect, in the order of [`JointEffect::shares`].
    pub shares: BTreeMap<(EdgeId, EffectKind), Vec<f64>>,
}

impl Configuration {
    /// All joints at 0.
    #[must_use]
    pub fn zero() -> Self {
        Self::default()
    }

    /// With the reading of one joint set.
    #[must_use]
    pub fn with(mut self, joint: EdgeId, q: f64) -> Self {
        self.q.insert(joint, q);
        self
    }

    /// With the reading of one joint and what the regressors of all its effects depend on.
    #[must_use]
    pub fn at(mut self, joint: EdgeId, state: &JointState) -> Self {
        self.q.insert(joint, state.q);
        self.states.insert(joint, *state);
        self
    }

    /// With the shares of a term's regressor at one joint.
    #[must_use]
    pub fn with_shares(mut self, joint: EdgeId, kind: EffectKind, shares: Vec<f64>) -> Self {
        self.shares.insert((joint, kind), shares);
        self
    }
}

/// A pose between two frames of the solved graph.
#[derive(Debug, Clone, PartialEq)]
pub struct DerivedPose {
    /// `from_from_to`.
    pub pose: Isometry3<f64>,
    /// 6×6 in `[ω; v]` of `to` (parameters only, no measurement noise); `None` when a direction is
    /// determined by nothing.
    pub covariance: Option<Matrix6<f64>>,
    /// The data determine all six directions; if not, what is known of `unobservable` is prior.
    pub estimable: bool,
    /// Unit twists of `to` (rotation in rad against m as they are) that the data do not see.
    pub unobservable: Vec<Twist>,
}

/// A point of one frame seen from another.
#[derive(Debug, Clone, PartialEq)]
pub struct DerivedPoint {
    /// In `from`, m.
    pub position: Point3<f64>,
    /// 3×3 in `from`, m².
    pub covariance: Option<Matrix3<f64>>,
    /// The data determine all three coordinates.
    pub estimable: bool,
}

/// What is seen at a posture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Target {
    /// The origin of a frame.
    Frame(FrameId),
    /// A point of the problem, in the frame that it is fixed in.
    Point(PointId),
}

/// A path at a configuration.
struct Evaluated {
    pose: crate::model::pose::Pose,
    path: CompiledPath,
    /// Derivatives by the free parameters.
    buffer: PathBuffer,
    /// Body twists of its end per unit of motion of each joint: about the axis, about the two axes across.
    motions: Vec<(usize, [Vector6<f64>; 4])>,
}

/// F n below this (rad, m, for n of one prior σ) is rounding: prior σ are about 1e-2, null vectors
/// are accurate to about 1e-9.
const ESTIMABLE: f64 = 1e-8;

/// A variance below this share of the terms that cancel in it is their rounding: of terms of 1 m², 60 nm.
const CANCELLED: f64 = 16.0 * f64::EPSILON;

impl Solution {
    /// Pose of `to` in `from` at a configuration, with covariance.
    ///
    /// # Errors
    /// [`Error::NoPath`], or [`Error::PerSample`] when a measured edge lies between.
    pub fn relative_pose(
        &self,
        from: FrameId,
        to: FrameId,
        at: &Configuration,
    ) -> Result<DerivedPose, Error> {
        let Evaluated {
            pose, path, buffer, ..
        } = self.evaluate(from, to, at)?;
        let f = self.expand(&path, &buffer);
        let covariance = self.inherit(&f).map(|c| {
            let c = Matrix6::from_iterator(c.iter().copied());
            crate::solve::rows::symmetric(&c)
        });
        let unseen = self.unseen(&f);
        let unobservable: Vec<Twist> = unseen
            .column_iter()
            .map(|c| {
                Twist::new(
                    nalgebra::Vector3::new(c[0], c[1], c[2]),
                    nalgebra::Vector3::new(c[3], c[4], c[5]),
                )
            })
            .collect();
        Ok(DerivedPose {
            pose: pose.isometry(),
            covariance,
            estimable: unobservable.is_empty(),
            unobservable,
        })
    }

    /// A point given in `to`, as seen from `from`, at a configuration.
    ///
    /// # Errors
    /// As [`Solution::relative_pose`].
    pub fn predict_point(
        &self,
        from: FrameId,
        to: FrameId,
        point: &Point3<f64>,
        at: &Configuration,
    ) -> Result<DerivedPoint, Error> {
        let Evaluated {
            pose, path, buffer, ..
        } = self.evaluate(from, to, at)?;
        let f = self.expand(&path, &buffer);
        let f = point_rows(&pose, point) * f;
        Ok(DerivedPoint {
            position: Point3::from(pose.r * point.coords + pose.t),
            covariance: self
                .inherit(&f)
                .map(|c| Matrix3::from_iterator(c.iter().copied())),
            estimable: self.unseen(&f).ncols() == 0,
        })
    }

    /// A target as seen from `from` at a configuration, and how it follows the free parameters: those of the edges between
    /// and, of a point, its own coordinates.
    ///
    /// # Errors
    /// As [`Solution::relative_pose`].
    pub fn linear_point(
        &self,
        from: FrameId,
        target: Target,
        at: &Configuration,
    ) -> Result<LinearPoint, Error> {
        Ok(self.moved_point(from, target, at)?.point)
    }

    /// A target as seen from `from` at a configuration, with covariance; of a point, its own coordinates are part of it.
    ///
    /// # Errors
    /// As [`Solution::relative_pose`].
    pub fn known_point(
        &self,
        from: FrameId,
        target: Target,
        at: &Configuration,
    ) -> Result<DerivedPoint, Error> {
        let LinearPoint { position, jacobian } = self.linear_point(from, target, at)?;
        Ok(DerivedPoint {
            position,
            covariance: self
                .inherit(&jacobian)
                .map(|c| Matrix3::from_iterator(c.iter().copied())),
            estimable: self.unseen(&jacobian).ncols() == 0,
        })
    }

    /// The same with the motions of the joints between.
    ///
    /// # Errors
    /// As [`Solution::relative_pose`].
    pub fn moved_point(
        &self,
        from: FrameId,
        target: Target,
        at: &Configuration,
    ) -> Result<MovedPoint, Error> {
        let (to, known) = match target {
            Target::Frame(frame) => (frame, None),
            Target::Point(id) => {
                let point = &self.model.problem.points[id.index()];
                (point.frame, Some(point))
            }
        };
        let own = known.and_then(|p| p.parameters);
        let local = match (known, own) {
            (_, Some(own)) => Point3::from(own.map(|p| self.values.0[p.index()])),
            (Some(point), None) => point.position,
            (None, None) => Point3::origin(),
        };
        let Evaluated {
            pose,
            path,
            buffer,
            motions,
        } = self.evaluate(from, to, at)?;
        let rows = point_rows(&pose, &local);
        let mut jacobian = &rows * self.expand(&path, &buffer);
        for (k, parameter) in own.into_iter().flatten().enumerate() {
            // ∂(R p + t)/∂p_k = R e_k
            if let Some(column) = self.model.column_of[parameter.index()] {
                let mut column = jacobian.column_mut(column);
                column += pose.r.column(k);
            }
        }
        let by = motions.into_iter().map(|(edge, twists)| {
            let moved: nalgebra::DVector<f64> = &rows * twists[0];
            (EdgeId::of(edge), Vector3::new(moved[0], moved[1], moved[2]))
        });
        Ok(MovedPoint {
            by: by.collect(),
            turn: pose.r,
            place: local.coords,
            point: LinearPoint {
                position: Point3::from(pose.r * local.coords + pose.t),
                jacobian,
            },
        })
    }

    /// Pose of `to` in `from` at a recorded sample, with that sample's readings, regressors and measured
    /// edges (a measured edge that was lost counts as identity).
    ///
    /// # Errors
    /// [`Error::NoPath`].
    pub fn pose_at_sample(
        &self,
        from: FrameId,
        to: FrameId,
        sample: usize,
    ) -> Result<Isometry3<f64>, Error> {
        if sample >= self.model.problem.samples {
            return Err(Error::NoSuchSample {
                what: "pose at sample".to_owned(),
                sample,
                samples: self.model.problem.samples,
            });
        }
        let path = self.model.compile_between(from, to, &self.values)?;
        let mut cache = EdgeCache::new(&self.model.problem, self.model.trig.clone());
        cache.update(&self.model.problem, &self.values);
        let mut buffer = path.buffer();
        let at = State::new(&self.model.problem, &cache, &self.values);
        let pose = path.evaluate(at, sample, Derivatives::None, &mut buffer);
        Ok(pose.isometry())
    }

    /// What each weak direction ([`Solution::weak`], same order) costs at
    /// a point of `to`: σ of its position in `from`, m, if that direction alone were uncertain.
    ///
    /// # Errors
    /// As [`Solution::relative_pose`].
    pub fn weak_at_point(
        &self,
        from: FrameId,
        to: FrameId,
        point: &Point3<f64>,
        at: &Configuration,
    ) -> Result<Vec<f64>, Error> {
        let Evaluated {
            pose, path, buffer, ..
        } = self.evaluate(from, to, at)?;
        let f = self.scaled(&(point_rows(&pose, point) * self.expand(&path, &buffer)));
        Ok(weak(&self.information)
            .map(|i| {
                let moved = &f * self.information.directions().column(i);
                let prior = &self.information;
                // Posterior σ along the direction in units of its scale: data and prior together.
                moved.norm() * prior.posterior_along(i)
            })
            .collect())
    }

    /// The compiled path and its derivatives at a configuration.
    fn evaluate(&self, from: FrameId, to: FrameId, at: &Configuration) -> Result<Evaluated, Error> {
        let path = self.model.compile_between(from, to, &self.values)?;
        let mut problem = crate::graph::problem::Problem::new(1);
        problem.edges = self
            .model
            .problem
            .edges
            .iter()
            .enumerate()
            .map(|(e, edge)| at_configuration(EdgeId::of(e), edge, at))
            .collect();
        for step in &path.steps {
            if let Step::Measured { edge, .. } = step {
                return Err(Error::PerSample {
                    edge: problem.edges[*edge].name.clone(),
                });
            }
        }
        let mut cache = EdgeCache::new(&problem, std::sync::Arc::default());
        cache.update(&problem, &self.values);
        let mut buffer = path.buffer();
        let at = State::new(&problem, &cache, &self.values);
        let pose = path.evaluate(at, 0, Derivatives::All, &mut buffer);
        let mut motions = Vec::new();
        path.effects(at, 0, &mut motions);
        Ok(Evaluated {
            pose,
            path,
            buffer,
            motions,
        })
    }

    /// 6 × n from the path's local columns.
    fn expand(&self, path: &CompiledPath, buffer: &PathBuffer) -> DMatrix<f64> {
        let mut f = DMatrix::zeros(6, self.model.free());
        for (&c, twist) in path.columns.iter().zip(&buffer.columns) {
            f.column_mut(c).copy_from(twist);
        }
        f
    }

    /// F C Fᵀ, unless F feels a direction that nothing determines.
    pub(crate) fn inherit(&self, f: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let leak = self.scaled(f) * &self.information.indeterminate;
        if leak.amax() > ESTIMABLE {
            return None;
        }
        // Most columns of a long robot concern other limbs.
        let concern = |c: &usize| f.column(*c).iter().any(|x| *x != 0.0);
        let columns: Vec<usize> = (0..f.ncols()).filter(concern).collect();
        let (f, covariance) = (f.select_columns(&columns), &self.information.covariance);
        let own = DMatrix::from_fn(columns.len(), columns.len(), |i, k| {
            covariance[(columns[i], columns[k])]
        });
        let mut out = &f * &own * f.transpose();
        // What cancels but for rounding is known exactly, in the last bit of any machine.
        let (sizes, own) = (f.abs(), own.abs());
        for (i, row) in sizes.row_iter().enumerate() {
            let of_terms = (&own * row.transpose()).dot(&row.transpose());
            if out[(i, i)] <= CANCELLED * of_terms {
                out.row_mut(i).fill(0.0);
                out.column_mut(i).fill(0.0);
            }
        }
        Some(out)
    }

    /// Orthonormal basis of the directions of F's image that only the prior fixes.
    pub(crate) fn unseen(&self, f: &DMatrix<f64>) -> DMatrix<f64> {
        let image = self.scaled(f) * self.information.null_space();
        if image.ncols() == 0 {
            return DMatrix::zeros(f.nrows(), 0);
        }
        let svd = calib_geometry::decompose::svd(&image);
        let seen = svd.s.iter().filter(|&&s| s > ESTIMABLE).count();
        svd.u.columns(0, seen).into_owned()
    }

    fn scaled(&self, f: &DMatrix<f64>) -> DMatrix<f64> {
        let mut f = f.clone();
        for (c, s) in self.information.scale.iter().enumerate() {
            f.column_mut(c).scale_mut(*s);
        }
        f
    }
}

/// ∂(R p + t) = R (−[p]ₓ ω + v), 3 × 6
fn point_rows(pose: &crate::model::pose::Pose, point: &Point3<f64>) -> DMatrix<f64> {
    let mut a = DMatrix::zeros(3, 6);
    a.view_mut((0, 0), (3, 3))
        .copy_from(&(-(pose.r * so3::skew(&point.coords))));
    a.view_mut((0, 3), (3, 3)).copy_from(&pose.r);
    a
}

/// The edge with its per-sample arrays cut to the one configuration.
fn at_configuration(
    id: EdgeId,
    edge: &crate::graph::edge::Edge,
    at: &Configuration,
) -> crate::graph::edge::Edge {
    let mut edge = edge.clone_shallow();
    if let EdgeKind::Joint(joint) = &mut edge.kind {
        let q = at.q.get(&id).copied().unwrap_or(0.0);
        joint.q = vec![q];
        for f in &mut joint.effects {
            if f.values.is_some() {
                let given = at.regressors.get(&(id, f.kind)).copied();
                let own = || f.kind.of_reading(q);
                let of_state = || Some(f.kind.term().regressor.at(at.states.get(&id)?));
                let value = given.or_else(own).or_else(of_state).unwrap_or(0.0);
                f.values = Some(vec![value]);
            }
            let given = at.shares.get(&(id, f.kind));
            for (i, share) in f.shares.iter_mut().enumerate() {
                let value = given.and_then(|s| s.get(i)).copied().unwrap_or(0.0);
                share.values = vec![value];
            }
        }
    }
    edge
}
