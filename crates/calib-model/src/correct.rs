//! Which command moves the tool to where it is wanted: equation (5) of the crate.
//!
//! ```text
//! e = [l ω; v] of tool⁻¹ · wanted,   (JᵀJ + λ² 1) dq = Jᵀ e  or  dq = Jᵀ (JJᵀ + λ² 1)⁻¹ e for more than six joints        (1)
//! |q_command − q_desired| ≤ bound for every joint                                                                      (2)
//! ```
//!
//! Where that ends beyond a limit of a joint, it begins again with (2) and the limits. λ begins at what rounding needs and grows until the step is inside its bound: near a singular posture the tool then comes as
//! near as the bound allows. The result is evaluated by the forward model before it is given: a command that does not bring the
//! tool nearer is refused, and the command is then the desired position itself.

use nalgebra::{Cholesky, Matrix6, Vector6};

use crate::error::ModelError;
use crate::forward::{Under, Work};
use crate::model::{LinkId, Model, Place, Scope};
use crate::pose::Pose;
use crate::read::rotation_between;

/// What of the tool is to be right.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Aim {
    /// Position and orientation.
    #[default]
    Pose,
    /// Position of the tool's origin only: for arms of fewer than six joints.
    Position,
}

/// How a correction is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What is to be right.
    pub aim: Aim,
    /// Bound of equation (2) at turning joints, rad.
    pub largest_rad: f64,
    /// The same at sliding joints, m.
    pub largest_m: f64,
    /// Position error at which it ends, m; orientation: this over `lever_m`.
    pub tolerance_m: f64,
    /// l of equation (1), m: a rotation error counts as the motion of a point as far away.
    pub lever_m: f64,
    /// Steps at most.
    pub iterations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            aim: Aim::Pose,
            // Zero offsets of 5° were seen; more is no correction but another posture.
            largest_rad: 0.1,
            largest_m: 0.05,
            // A thousandth of what any tracker resolves.
            tolerance_m: 1e-9,
            lever_m: 0.3,
            iterations: 5,
        }
    }
}

impl Options {
    /// For [`Model::ik`]: steps until it is there, as far as the seed is from a solution.
    #[must_use]
    pub fn inverse() -> Self {
        Self {
            largest_rad: std::f64::consts::FRAC_PI_2,
            largest_m: 1.0,
            iterations: 30,
            ..Self::default()
        }
    }
}

/// How a correction ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// The tool is there to the tolerance.
    Reached,
    /// Reached, but this joint's command is outside of its fitted range: nothing was verified there.
    OutOfScope(usize),
    /// The tool came nearer, but not to the tolerance: a singular posture, or too few joints.
    Nearer,
    /// Refused: within the bound nothing brings the tool nearer. The command is the desired position.
    NotReached,
    /// Refused: this joint would have to leave its limits, and inside them nothing brings the tool nearer. The command is the desired position.
    BeyondLimits(usize),
}

impl Outcome {
    /// The command brings the tool nearer than the desired position would.
    #[must_use]
    pub fn is_usable(self) -> bool {
        matches!(self, Self::Reached | Self::OutOfScope(_) | Self::Nearer)
    }
}

/// What a correction does to the tool, by the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// How it ended.
    pub outcome: Outcome,
    /// Steps that were made.
    pub iterations: usize,
    /// Distance from where the tool is wanted, before and after, m.
    pub before_m: f64,
    /// After.
    pub after_m: f64,
    /// Rotation from how it is wanted, before and after, rad; 0 where only the position is wanted.
    pub before_rad: f64,
    /// After.
    pub after_rad: f64,
    /// Largest change of a joint, rad or m.
    pub step: f64,
}

impl Model {
    /// The command at which the tool, a link or what is fixed to one, stands where the nominal model has it at `q_desired` (both rad or m, as
    /// [`Model::joints`]). Joints that do not move the tool keep their positions. A body or point is where it was found on its link.
    ///
    /// # Errors
    /// As [`Model::forward`], and [`ModelError::Length`] of `q_command`.
    pub fn correct(
        &self,
        q_desired: &[f64],
        tool: impl Into<Place>,
        options: &Options,
        under: &Under,
        work: &mut Work,
        q_command: &mut [f64],
    ) -> Result<Correction, ModelError> {
        self.ready(q_desired, under, work)?;
        let tool = self.tool(tool.into())?;
        self.nominal_poses(q_desired, work);
        let wanted = tool.at(&work.nominal);
        self.approach_pose(
            q_desired,
            (tool, &wanted),
            options,
            under,
            (work, q_command),
        )
    }

    /// The position at which the tool stands at `wanted` (`root_from_tool`), near `seed`. Options: [`Options::inverse`].
    ///
    /// # Errors
    /// As [`Model::correct`].
    pub fn ik(
        &self,
        wanted: &Pose,
        seed: &[f64],
        tool: impl Into<Place>,
        options: &Options,
        under: &Under,
        (work, q): (&mut Work, &mut [f64]),
    ) -> Result<Correction, ModelError> {
        self.ready(seed, under, work)?;
        let tool = self.tool(tool.into())?;
        let numbers = wanted.rows();
        if let Some(index) = numbers.iter().position(|x| !x.is_finite()) {
            return Err(ModelError::NotFinite {
                what: "pose",
                index,
            });
        }
        self.approach_pose(seed, (tool, wanted), options, under, (work, q))
    }

    fn tool(&self, place: Place) -> Result<Tool, ModelError> {
        let (link, offset) = self.fixed(place).ok_or(ModelError::ForeignWork)?;
        Ok(Tool {
            link: LinkId(link),
            link_from_tool: (!matches!(place, Place::Link(_))).then_some(offset),
        })
    }

    /// Without a thought of limits; where that ends beyond one, inside them.
    fn approach_pose(
        &self,
        start: &[f64],
        target: (Tool, &Pose),
        options: &Options,
        under: &Under,
        (work, q): (&mut Work, &mut [f64]),
    ) -> Result<Correction, ModelError> {
        let free = self.approach(start, target, (options, false), under, (work, q))?;
        if !matches!(free.outcome, Outcome::BeyondLimits(_)) {
            return Ok(free);
        }
        let inside = self.approach(start, target, (options, true), under, (work, q))?;
        Ok(match inside.outcome.is_usable() {
            true => inside,
            false => free,
        })
    }

    fn approach(
        &self,
        start: &[f64],
        (tool, wanted): (Tool, &Pose),
        (options, inside): (&Options, bool),
        under: &Under,
        (work, q): (&mut Work, &mut [f64]),
    ) -> Result<Correction, ModelError> {
        let link = tool.link;
        if q.len() != start.len() {
            return Err(ModelError::Length {
                what: "q_command",
                found: q.len(),
                expected: start.len(),
            });
        }
        q.copy_from_slice(start);
        self.slopes(link, &self.leading[link.0], (start, under, false), work);
        let mut error = self.error_at(q, (tool, wanted), options, under, work);
        let before = error;
        let mut best = error;
        let mut iterations = 0;
        while iterations < options.iterations && !error.within(options) {
            self.columns_of(link, &self.leading[link.0], work);
            if let Some(offset) = &tool.link_from_tool {
                for k in &self.leading[link.0] {
                    work.jacobian[*k] = offset.pull_back(&work.jacobian[*k]);
                }
            }
            let found = self.step(start, (link, &error), (options, inside), (work, q));
            iterations += 1;
            if !found {
                break;
            }
            // The tried position is in work.q.
            let tried = std::mem::take(&mut work.q);
            let next = self.error_at(&tried, (tool, wanted), options, under, work);
            let nearer = next.weighed.norm() < best.weighed.norm();
            if nearer {
                q.copy_from_slice(&tried);
                best = next;
            }
            work.q = tried;
            if !nearer {
                break;
            }
            error = next;
        }
        let mut outcome = if best.within(options) {
            Outcome::Reached
        } else if best.weighed.norm() < before.weighed.norm() {
            Outcome::Nearer
        } else {
            Outcome::NotReached
        };
        match self.scope(q)? {
            // Where the desired position is beyond its limits already, that is the caller's.
            Scope::BeyondLimits(i) if q[i] != start[i] => outcome = Outcome::BeyondLimits(i),
            Scope::Outside(i) if outcome == Outcome::Reached => outcome = Outcome::OutOfScope(i),
            _ => {}
        }
        if !outcome.is_usable() {
            q.copy_from_slice(start);
            best = before;
        }
        let steps = q.iter().zip(start).map(|(a, b)| (a - b).abs());
        Ok(Correction {
            outcome,
            iterations,
            before_m: before.position,
            after_m: best.position,
            before_rad: before.rotation,
            after_rad: best.rotation,
            step: steps.fold(0.0, f64::max),
        })
    }

    /// How far the tool is from where it is wanted; the poses of the links are in `work` then.
    fn error_at(
        &self,
        q: &[f64],
        (tool, wanted): (Tool, &Pose),
        options: &Options,
        under: &Under,
        work: &mut Work,
    ) -> ToolError {
        self.motions(q, under, work);
        self.poses(work);
        let at = tool.at(&work.at);
        let v = at.r.tr_mul(&(wanted.t - at.t));
        let omega = match options.aim {
            Aim::Pose => rotation_between(&at, wanted),
            Aim::Position => nalgebra::Vector3::zeros(),
        };
        let l = options.lever_m;
        ToolError {
            weighed: Vector6::new(l * omega.x, l * omega.y, l * omega.z, v.x, v.y, v.z),
            position: v.norm(),
            rotation: omega.norm(),
        }
    }

    /// Equation (1) inside equation (2), into `work.q`; false where no λ gives a step.
    fn step(
        &self,
        start: &[f64],
        (link, error): (LinkId, &ToolError),
        (options, inside): (&Options, bool),
        (work, q): (&mut Work, &[f64]),
    ) -> bool {
        /// m (per rad): from what rounding needs to what holds any arm of meters.
        const DAMPINGS: [f64; 5] = [1e-6, 1e-3, 1e-2, 1e-1, 1.0];
        let l = match options.aim {
            Aim::Pose => options.lever_m,
            Aim::Position => 0.0,
        };
        let bound = |k: usize| match self.moved[k].prismatic {
            true => options.largest_m,
            false => options.largest_rad,
        };
        let movers = &self.leading[link.0];
        let Work {
            jacobian, q: tried, ..
        } = work;
        for &k in movers {
            let mut rotation = jacobian[k].fixed_rows_mut::<3>(0);
            rotation *= l;
        }
        DAMPINGS.iter().any(|damping| {
            let Some(()) = solve(jacobian, movers, &error.weighed, *damping, tried) else {
                return false;
            };
            for (k, (tried, q)) in tried.iter_mut().zip(q).enumerate() {
                *tried = q + if movers.contains(&k) { *tried } else { 0.0 };
            }
            let within = |k: usize, q: f64| {
                let limits = self.moved[k].limits;
                limits.is_none_or(|[low, high]| (low..=high).contains(&q))
            };
            // Where a joint is beyond its limits already, that is the caller's.
            let allowed = |k: usize| {
                let near = (tried[k] - start[k]).abs() <= bound(k);
                near && (!inside || within(k, tried[k]) || !within(k, start[k]))
            };
            movers.iter().all(|k| allowed(*k))
        })
    }
}

/// What is brought to where it is wanted.
#[derive(Debug, Clone, Copy)]
struct Tool {
    link: LinkId,
    /// `None`: the link itself.
    link_from_tool: Option<Pose>,
}

impl Tool {
    /// root_from_tool, from those of all links.
    fn at(&self, links: &[Pose]) -> Pose {
        let link = &links[self.link.0];
        self.link_from_tool
            .as_ref()
            .map_or(*link, |offset| link.then(offset))
    }
}

/// How far a tool is from where it is wanted.
#[derive(Debug, Clone, Copy)]
struct ToolError {
    /// e of equation (1), m.
    weighed: Vector6<f64>,
    /// m.
    position: f64,
    /// rad.
    rotation: f64,
}

impl ToolError {
    fn within(&self, options: &Options) -> bool {
        self.position <= options.tolerance_m
            && self.rotation * options.lever_m <= options.tolerance_m
    }
}

/// Equation (1) into the entries `movers` of `out`; `None` where the matrix is not positive definite.
fn solve(
    jacobian: &[Vector6<f64>],
    movers: &[usize],
    error: &Vector6<f64>,
    damping: f64,
    out: &mut [f64],
) -> Option<()> {
    let square = damping * damping;
    if movers.len() <= 6 {
        // Rows and columns beyond the joints that there are: the identity.
        let mut normal = Matrix6::identity();
        let mut right = Vector6::zeros();
        for (a, i) in movers.iter().enumerate() {
            right[a] = jacobian[*i].dot(error);
            for (b, k) in movers.iter().enumerate() {
                let damped = if a == b { square } else { 0.0 };
                normal[(a, b)] = jacobian[*i].dot(&jacobian[*k]) + damped;
            }
        }
        let dq = Cholesky::new(normal)?.solve(&right);
        for (a, k) in movers.iter().enumerate() {
            out[*k] = dq[a];
        }
    } else {
        let mut outer = Matrix6::identity() * square;
        for k in movers {
            outer.ger(1.0, &jacobian[*k], &jacobian[*k], 1.0);
        }
        let dual = Cholesky::new(outer)?.solve(error);
        for k in movers {
            out[*k] = jacobian[*k].dot(&dual);
        }
    }
    movers.iter().all(|k| out[*k].is_finite()).then_some(())
}
