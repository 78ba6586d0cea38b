//! Ball bundle: the center, the markers' places in the body and the body's orientation in every frame, jointly.
//!
//! ```text
//! minimize Σ_i Σ_p |o + R_i b_p − v_ip|²        over o, b_p, R_i            (seen samples only)    (1)
//! e = b_p + y,  y = R_iᵀ(o − v_ip),   R_i ← R_i exp(δ_i):   de = db_p + R_iᵀ do + [y]ₓ δ_i          (2)
//! ```
//!
//! The orientations are eliminated frame by frame (Schur complement), which leaves 3 + 3P unknowns. One
//! frame's orientation is held: the body has no other frame. A frame with a single marker turns freely about the
//! line to the center; that direction is left out. It uses all that raw markers say: a fitted pose per frame and
//! then a hot spot reach 0.88–1.0 of it, the centroid's sphere as little as 0.07.

use calib_estimator::noise::Level;
use calib_estimator::{
    InputKind, Verdict,
    levenberg::{Problem, Stop, minimize},
    measured::{Cloud, longest},
};
use calib_geometry::{decompose::symmetric_eigen_small, so3};
use nalgebra::{DMatrix, DVector, Matrix3, Point3, UnitQuaternion, Vector3};

use crate::{
    options::{COMMON, EstimatorInfo},
    outcome::{CorEstimate, Known, Noise, NotObservable, Outcome, Shape},
    sphere::{Spread, leaves_its_plane, prepare},
    sphere_ml::isotropic,
};
use calib_estimator::{EstimatorError, Input, Options, cloud_of};

/// What `ball_bundle` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "ball_bundle",
    name: "markers of a rigid body, jointly",
    input: InputKind::Markers,
    options: COMMON,
    summary: "center, marker layout and all orientations at once; markers may be occluded",
    source: "joint likelihood, see the book",
    fit,
};

const MAX_STEPS: usize = 100;
/// Eigenvalue of a frame's rotation block, relative to the largest, below which the frame does not see that turn.
const UNSEEN: f64 = 1e-9;

/// The bundle on markers of one rigid body.
///
/// # Errors
/// [`EstimatorError`] for data that are not finite, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    const ID: &str = "ball_bundle";
    options.check()?;
    if !matches!(input, Input::Markers(_)) {
        return Err(input.wrong(InputKind::Markers));
    }
    let cloud = cloud_of(input, options)?;
    let factor = match prepare(ID, &cloud, false) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let center = isotropic(&cloud, factor.center(0.0), &[]);
    let problem = Bundle::of(&cloud);
    let Some(start) = problem.start(center) else {
        return Ok(Outcome::NotObservable(NotObservable {
            estimator: ID,
            verdict: Verdict::TooFew,
            reason: "the frames do not share enough markers to chain their orientations".into(),
            known: Known::Nothing,
        }));
    };
    let end = minimize(&problem, start, MAX_STEPS);
    let dof = problem.degrees_of_freedom(&end.x);
    let residual_sigma = (end.normal.cost / dof.max(1) as f64).sqrt();
    let level = match (dof, options.sigma_t) {
        (0, None) => {
            let of = "samples where no noise is stated, for all unknowns of the body";
            return Ok(Outcome::too_few(
                ID,
                cloud.points.len(),
                cloud.points.len() + 1,
                of,
            ));
        }
        (0, Some(stated)) => Level::stated(stated),
        (_, stated) => Level::of(stated, residual_sigma, dof as f64, options.significance),
    };
    let sigma = level.sigma;
    let Spread { kappa, doubt } =
        match leaves_its_plane(ID, &cloud, &factor, residual_sigma, dof, options) {
            Ok(spread) => spread,
            Err(answer) => return Ok(answer),
        };
    let inverse = problem
        .reduced(&end.normal, 0.0)
        .and_then(|(h, _)| h.cholesky())
        .map(|c| c.inverse());
    let (Some(inverse), true) = (inverse, end.stop != Stop::Broken) else {
        return Ok(Outcome::NotObservable(NotObservable {
            estimator: ID,
            verdict: Verdict::Diverged,
            reason: format!("no minimum after {} steps", end.iterations),
            known: Known::Nothing,
        }));
    };
    // Noise inflates what the weakest direction seems to tell.
    let naive: Matrix3<f64> = inverse.fixed_view::<3, 3>(0, 0) * (sigma * sigma);
    let eigen = symmetric_eigen_small(&naive);
    let worst = eigen.vectors.column(2);
    let covariance = naive + worst * worst.transpose() * (eigen.values[2] / (kappa - 1.0));
    let weakest = (eigen.values[2] / (1.0 - 1.0 / kappa)).sqrt();
    let radii: Vec<f64> = end.x.layout.iter().map(Vector3::norm).collect();
    let radius = radii.iter().sum::<f64>() / radii.len() as f64;
    let weak = weakest > options.weak_fraction * radius;
    Ok(Outcome::Estimate(Box::new(CorEstimate {
        estimator: ID,
        center: Point3::from(cloud.origin + end.x.center),
        covariance,
        shape: Shape::Radii { bias: vec![0.0; radii.len()], radii },
        noise: Noise {
            sigma_t: sigma,
            sigma_r: None,
            estimated: level.degrees_of_freedom.is_some(),
            contradicts: level.contradicts,
        },
        degrees_of_freedom: level.degrees_of_freedom,
        rms: (end.normal.cost / (3.0 * cloud.total(0..cloud.points.len()))).sqrt(),
        used: cloud.points.len(),
        rejected: Vec::new(),
        verdict: if weak || doubt.is_some() { Verdict::Weak } else { Verdict::Ok },
        reason: doubt.or_else(|| weak.then(|| {
            format!(
                "σ = {weakest:.3e} along ({:.2}, {:.2}, {:.2}) exceeds {:.0} % of the radius {radius:.3e}",
                worst[0],
                worst[1],
                worst[2],
                100.0 * options.weak_fraction
            )
        })),
    })))
}

/// Frames of seen markers.
pub(crate) struct Bundle {
    /// For each frame: (marker, position).
    frames: Vec<Vec<(usize, Vector3<f64>)>>,
    /// Weight of each frame.
    weights: Vec<f64>,
    markers: usize,
    /// The frame whose orientation is held.
    reference: usize,
}

#[derive(Clone)]
pub(crate) struct State {
    pub center: Vector3<f64>,
    /// Marker places in the body, relative to the center.
    pub layout: Vec<Vector3<f64>>,
    pub orientations: Vec<UnitQuaternion<f64>>,
}

/// One frame's share: its own block, its coupling to the center and to each marker it sees.
struct FrameBlock {
    own: Matrix3<f64>,
    gradient: Vector3<f64>,
    to_center: Matrix3<f64>,
    to_markers: Vec<(usize, Matrix3<f64>)>,
}

pub(crate) struct Normal {
    shared: DMatrix<f64>,
    gradient: DVector<f64>,
    frames: Vec<FrameBlock>,
    pub cost: f64,
}

pub(crate) struct Step {
    shared: DVector<f64>,
    turns: Vec<Vector3<f64>>,
}

impl Bundle {
    fn of(cloud: &Cloud) -> Self {
        let (frames, weights) = cloud
            .rows()
            .into_iter()
            .map(|r| (r.markers, r.weight))
            .unzip();
        Self::new(frames, weights, cloud.markers())
    }

    pub fn new(frames: Vec<Vec<(usize, Vector3<f64>)>>, weights: Vec<f64>, markers: usize) -> Self {
        Self {
            reference: longest(&frames),
            frames,
            weights,
            markers,
        }
    }

    /// Marker places from the reference frame, carried to other frames by rotations about the center.
    fn start(&self, center: Vector3<f64>) -> Option<State> {
        let mut layout: Vec<Option<Vector3<f64>>> = vec![None; self.markers];
        for &(p, v) in &self.frames[self.reference] {
            layout[p] = Some(v - center);
        }
        let mut orientations = vec![None; self.frames.len()];
        orientations[self.reference] = Some(UnitQuaternion::identity());
        // Frames with most known markers first, until nothing more can be placed.
        for needed in [2, 1] {
            loop {
                let mut placed = false;
                for (frame, orientation) in self.frames.iter().zip(&mut orientations) {
                    let known = frame.iter().filter(|(p, _)| layout[*p].is_some()).count();
                    if orientation.is_some() || known < needed {
                        continue;
                    }
                    let mut correlation = Matrix3::zeros();
                    for (p, v) in frame {
                        if let Some(b) = layout[*p] {
                            correlation += (v - center) * b.transpose();
                        }
                    }
                    // Two directions fix a rotation; one leaves a turn that does not matter.
                    let turn = so3::nearest_rotation(&correlation).or_else(|| {
                        let (p, v) = frame.iter().find(|(p, _)| layout[*p].is_some())?;
                        UnitQuaternion::rotation_between(&layout[*p]?, &(v - center))
                    });
                    *orientation = Some(turn.unwrap_or_else(UnitQuaternion::identity));
                    placed = true;
                    if known >= 2 {
                        for (p, v) in frame {
                            let place = orientation.map(|r| r.inverse() * (v - center));
                            if layout[*p].is_none() {
                                layout[*p] = place;
                            }
                        }
                    }
                }
                if !placed {
                    break;
                }
            }
        }
        Some(State {
            center,
            layout: layout.into_iter().collect::<Option<_>>()?,
            orientations: orientations.into_iter().collect::<Option<_>>()?,
        })
    }

    /// Coordinates minus unknowns that the data see.
    fn degrees_of_freedom(&self, x: &State) -> usize {
        let samples: usize = self.frames.iter().map(Vec::len).sum();
        let turns: usize = self
            .linearize(x)
            .frames
            .iter()
            .enumerate()
            .filter(|(i, _)| *i != self.reference)
            .map(|(_, f)| {
                let eigen = symmetric_eigen_small(&f.own);
                eigen
                    .values
                    .iter()
                    .filter(|v| **v > UNSEEN * eigen.values[2])
                    .count()
            })
            .sum();
        (3 * samples).saturating_sub(3 + 3 * self.markers + turns)
    }

    /// The normal equations of center and layout with the orientations eliminated.
    fn reduced(&self, normal: &Normal, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let mut h = normal.shared.clone();
        for k in 0..h.nrows() {
            h[(k, k)] *= 1.0 + damping;
        }
        let mut g = normal.gradient.clone();
        for (i, frame) in normal.frames.iter().enumerate() {
            if i == self.reference {
                continue;
            }
            let inverse = pseudo_inverse(&frame.own, damping);
            let couplings = || {
                std::iter::once((0, &frame.to_center))
                    .chain(frame.to_markers.iter().map(|(p, c)| (3 + 3 * p, c)))
            };
            for (a, ca) in couplings() {
                let left = ca.transpose() * inverse;
                let mut part = g.fixed_rows_mut::<3>(a);
                part -= left * frame.gradient;
                for (b, cb) in couplings() {
                    let mut block = h.fixed_view_mut::<3, 3>(a, b);
                    block -= left * cb;
                }
            }
        }
        h.iter().all(|x| x.is_finite()).then_some((h, g))
    }
}

fn pseudo_inverse(block: &Matrix3<f64>, damping: f64) -> Matrix3<f64> {
    let eigen = symmetric_eigen_small(block);
    let mut out = Matrix3::zeros();
    for k in 0..3 {
        if eigen.values[k] > UNSEEN * eigen.values[2] {
            let v = eigen.vectors.column(k);
            out += v * v.transpose() / (eigen.values[k] * (1.0 + damping));
        }
    }
    out
}

impl Problem for Bundle {
    type Point = State;
    type Normal = Normal;
    type Step = Step;

    fn linearize(&self, x: &State) -> Normal {
        let size = 3 + 3 * self.markers;
        let mut normal = Normal {
            shared: DMatrix::zeros(size, size),
            gradient: DVector::zeros(size),
            frames: Vec::with_capacity(self.frames.len()),
            cost: 0.0,
        };
        for ((frame, orientation), &w) in self.frames.iter().zip(&x.orientations).zip(&self.weights)
        {
            let r = orientation.to_rotation_matrix().into_inner();
            let mut block = FrameBlock {
                own: Matrix3::zeros(),
                gradient: Vector3::zeros(),
                to_center: Matrix3::zeros(),
                to_markers: Vec::with_capacity(frame.len()),
            };
            for &(p, v) in frame {
                let y = r.tr_mul(&(x.center - v));
                let e = x.layout[p] + y;
                let cross = so3::skew(&y);
                let back = cross.transpose() * w;
                normal.cost += w * e.norm_squared();
                block.own += back * cross;
                block.gradient += back * e;
                block.to_center += back * r.transpose();
                block.to_markers.push((p, back));
                let at = 3 + 3 * p;
                let h = &mut normal.shared;
                for k in 0..3 {
                    h[(k, k)] += w;
                    h[(at + k, at + k)] += w;
                    for l in 0..3 {
                        h[(at + k, l)] += w * r[(l, k)];
                        h[(l, at + k)] += w * r[(l, k)];
                    }
                }
                let world = r * e;
                for k in 0..3 {
                    normal.gradient[k] += w * world[k];
                    normal.gradient[at + k] += w * e[k];
                }
            }
            normal.frames.push(block);
        }
        normal
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Step, f64)> {
        let (h, g) = self.reduced(normal, damping)?;
        let shared = -h.cholesky()?.solve(&g);
        let mut predicted = -shared.dot(&normal.gradient);
        let turns = normal
            .frames
            .iter()
            .enumerate()
            .map(|(i, frame)| {
                if i == self.reference {
                    return Vector3::zeros();
                }
                let mut pull = frame.gradient + frame.to_center * shared.fixed_rows::<3>(0);
                for (p, c) in &frame.to_markers {
                    pull += c * shared.fixed_rows::<3>(3 + 3 * p);
                }
                let turn = -(pseudo_inverse(&frame.own, damping) * pull);
                predicted -= turn.dot(&frame.gradient);
                turn
            })
            .collect();
        Some((Step { shared, turns }, predicted))
    }

    fn retract(&self, x: &State, step: &Step) -> State {
        State {
            center: x.center + step.shared.fixed_rows::<3>(0),
            layout: x
                .layout
                .iter()
                .enumerate()
                .map(|(p, b)| b + step.shared.fixed_rows::<3>(3 + 3 * p))
                .collect(),
            orientations: x
                .orientations
                .iter()
                .zip(&step.turns)
                .map(|(r, turn)| {
                    let mut next = r * so3::exp(turn);
                    next.renormalize();
                    next
                })
                .collect(),
        }
    }

    fn is_negligible(&self, x: &State, step: &Step) -> bool {
        let size = x.layout.iter().fold(0.0_f64, |m, b| m.max(b.norm()));
        step.shared.amax() <= 1e-14 * size && step.turns.iter().all(|t| t.norm() <= 1e-14)
    }
}

/// Covariance of the center at the truth for unit noise: the bound that no unbiased estimator beats.
///
/// `layout`: marker places relative to the center; `orientations`: one for each frame, all markers seen.
pub(crate) fn unit_bound(
    layout: &[Vector3<f64>],
    orientations: &[UnitQuaternion<f64>],
) -> Option<Matrix3<f64>> {
    let frames = orientations
        .iter()
        .map(|r| layout.iter().enumerate().map(|(p, b)| (p, r * b)).collect())
        .collect();
    let problem = Bundle::new(frames, vec![1.0; orientations.len()], layout.len());
    let truth = State {
        center: Vector3::zeros(),
        layout: layout.to_vec(),
        orientations: orientations.to_vec(),
    };
    let (h, _) = problem.reduced(&problem.linearize(&truth), 0.0)?;
    Some(
        h.cholesky()?
            .inverse()
            .fixed_view::<3, 3>(0, 0)
            .into_owned(),
    )
}
