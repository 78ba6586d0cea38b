//! A plan as data.

use calib_report::view3d::View3d;
use serde::{Deserialize, Serialize};

use crate::candidates::Counts;
use crate::joints::JointBox;
use crate::note::Note;

/// What the postures are to be good at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// The tool's position over the task postures.
    #[default]
    Task,
    /// All parameters together: determinant.
    Parameters,
    /// All parameters, the sum of their variances in units of their priors.
    Variances,
    /// The least determined combination of the parameters in units of their priors.
    Weakest,
}

/// Why a posture is in the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// It tells most about what is asked for.
    Information,
    /// It fills the joint ranges, for effects that nobody thought of.
    SpaceFilling,
    /// From here the next posture is approached from the other side.
    Approach,
    /// An earlier posture again, from the other side: backlash and noise.
    OtherSide,
    /// Only on the way: nothing is measured.
    Detour,
}

/// A planned posture.
#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    /// Joint positions by joint index, rad or m.
    pub q: Vec<f64>,
    /// Why.
    pub why: Why,
    /// Place in the list of the earlier posture that [`Why::OtherSide`] repeats.
    pub repeats: Option<usize>,
    /// How many subjects are seen.
    pub seen: usize,
    /// σ of the task after it, m; `None`: not determined yet.
    pub sigma: Option<f64>,
}

/// What a plan was asked for beside its goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// σ of the task, m; `None`: a number of postures.
    pub sigma: Option<f64>,
    /// Time of all motions at the most, s.
    pub path_time: Option<f64>,
    /// Wanted parameters, by a part of their names.
    pub of: Vec<String>,
    /// Seed of the candidates.
    pub seed: u32,
    /// Task postures that were given, by joint index.
    pub task: Vec<Vec<f64>>,
}

/// A plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Name of the robot.
    pub robot: String,
    /// What the postures are good at.
    pub goal: Goal,
    /// Moved joints, and what every other joint stands at.
    pub joints: JointBox,
    /// What was asked for.
    pub asked: Asked,
    /// Postures in the order in which they are taken.
    pub postures: Vec<Posture>,
    /// Independent postures to validate with.
    pub held_out: Vec<Vec<f64>>,
    /// What removed how many candidates.
    pub counts: Counts,
    /// Least share of the best possible design of the postures chosen by information.
    pub efficiency: f64,
    /// σ of the task before the first posture, m; `None`: not determined.
    pub sigma_before: Option<f64>,
    /// σ of the task after the last, m.
    pub sigma: Option<f64>,
    /// What becomes of the parameters.
    pub parameters: Vec<Parameter>,
    /// Time of all motions, s.
    pub motion_time: f64,
    /// Places in the list of the postures to which no collision-free motion was found.
    pub blocked: Vec<usize>,
    /// What was assumed.
    pub notes: Vec<Note>,
    /// The 3-D view of the page; empty where only the list is wanted.
    pub view: View3d,
}

/// What a plan makes of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: calib_core::Unit,
    /// σ of its prior.
    pub prior: Option<f64>,
    /// σ after the plan; `None`: no prediction depends on it, or the plan does not determine it.
    pub after: Option<f64>,
}

impl Plan {
    /// The number of a posture in `plan.csv`, which is its place in the list; `None`: it is only on the way, and nothing is recorded there.
    #[must_use]
    pub fn pose(&self, place: usize) -> Option<usize> {
        let of = self.postures.get(place)?;
        (of.why != Why::Detour).then_some(place)
    }

    /// Postures that are recorded: those on the way are not.
    #[must_use]
    pub fn recorded(&self) -> usize {
        let recorded = self.postures.iter().filter(|p| p.why != Why::Detour);
        recorded.count()
    }

    /// Parameters with a prior that the plan hardly narrows: by less than 30 %.
    #[must_use]
    pub fn weak(&self) -> Vec<&Parameter> {
        const NARROWED: f64 = 0.7;
        let near = |p: &&Parameter| match (p.prior, p.after) {
            (Some(prior), Some(after)) => after > NARROWED * prior,
            (Some(_), None) => true,
            _ => false,
        };
        self.parameters.iter().filter(near).collect()
    }
}
