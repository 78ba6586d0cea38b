//! The files of a plan, and how they are read back.

use std::collections::{BTreeMap, BTreeSet};

use calib_files::OutputFile;
use calib_recording::{Poses, ReadOptions, WriteOptions};
use calib_urdf::{JointId, RobotModel};
use serde::{Deserialize, Serialize};

use crate::candidates::Counts;
use crate::error::PlanError;
use crate::joints::{JointBox, shown};
use crate::known::Known;
use crate::linear::joint_table;
use crate::list::{Goal, Parameter, Plan, Why};
use crate::note::Note;
use crate::page::page;
use crate::places;
use crate::words;

/// What is wrong with a table that cannot be written.
const RENAME: &str = "rename the joint in the URDF";

/// Every file that a plan can have.
const FILES: [&str; 5] = [
    "plan.yaml",
    "plan.csv",
    "held_out.csv",
    "plan.html",
    "trajectory.json",
];

/// Names of the files that this plan does not have: they must not remain from an earlier one.
#[must_use]
pub fn not_written(files: &[OutputFile]) -> Vec<&'static str> {
    let has = |name: &str| files.iter().any(|file| file.name == name);
    FILES.into_iter().filter(|name| !has(name)).collect()
}

/// Column of `plan.csv` with the reason of each posture.
const REASON: &str = "note";

/// Version of `plan.yaml`.
const VERSION: u32 = 1;

/// A plan as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanFile {
    /// Version of this format: 1.
    pub calib_plan: u32,
    /// The robot.
    pub robot: String,
    /// What the postures are good at.
    pub goal: Goal,
    /// What else was asked for.
    #[serde(default)]
    pub asked: AskedLine,
    /// σ of the task before and after, mm; absent: not determined.
    pub sigma_before_mm: Option<f64>,
    /// As `sigma_before_mm`.
    pub sigma_after_mm: Option<f64>,
    /// Least share of the best possible design of the postures chosen by information.
    pub efficiency_at_least: f64,
    /// In the order in which they are taken.
    pub postures: Vec<PostureLine>,
    /// To validate with.
    pub held_out: Vec<BTreeMap<String, f64>>,
}

/// What was asked for, as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct AskedLine {
    /// σ of the task, mm; absent: a number of postures.
    pub sigma_mm: Option<f64>,
    /// Time of all motions at the most, s; absent: any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path_time_s: Option<f64>,
    /// Wanted parameters, by a part of their names.
    pub of: Vec<String>,
    /// Seed of the candidates.
    pub seed: u32,
    /// Task postures that were given, `<joint>_deg` or `<joint>_mm`.
    pub task: Vec<BTreeMap<String, f64>>,
}

impl Default for AskedLine {
    fn default() -> Self {
        Self {
            sigma_mm: None,
            path_time_s: None,
            of: Vec::new(),
            seed: 1,
            task: Vec::new(),
        }
    }
}

/// A posture as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PostureLine {
    /// Its row in `plan.csv`, from 0; absent: only on the way, nothing is recorded.
    pub pose: Option<usize>,
    /// Why it is there.
    pub why: Why,
    /// The earlier pose that it repeats.
    pub repeats: Option<usize>,
    /// σ of the task after it, mm.
    pub sigma_mm: Option<f64>,
    /// `<joint>_deg` or `<joint>_mm`.
    pub joints: BTreeMap<String, f64>,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    plan: PlanFile,
    candidates: &'a Counts,
    parameters: &'a [Parameter],
    motion_time_s: f64,
    notes: &'a [Note],
}

impl Plan {
    /// As it is written.
    #[must_use]
    pub fn file(&self, model: &RobotModel) -> PlanFile {
        let mm = |s: Option<f64>| s.map(|s| rounded(s * 1e3, 6));
        let postures = self.postures.iter().enumerate();
        PlanFile {
            calib_plan: VERSION,
            robot: self.robot.clone(),
            goal: self.goal,
            asked: AskedLine {
                sigma_mm: mm(self.asked.sigma),
                path_time_s: self.asked.path_time,
                of: self.asked.of.clone(),
                seed: self.asked.seed,
                task: (self.asked.task.iter())
                    .map(|q| by_name(model, &self.joints, q))
                    .collect(),
            },
            sigma_before_mm: mm(self.sigma_before),
            sigma_after_mm: mm(self.sigma),
            efficiency_at_least: rounded(self.efficiency, 4),
            postures: postures
                .map(|(i, p)| PostureLine {
                    pose: self.pose(i),
                    why: p.why,
                    repeats: p.repeats.and_then(|place| self.pose(place)),
                    sigma_mm: mm(p.sigma),
                    joints: by_name(model, &self.joints, &p.q),
                })
                .collect(),
            held_out: self
                .held_out
                .iter()
                .map(|q| by_name(model, &self.joints, q))
                .collect(),
        }
    }

    /// All files: `plan.yaml`, `plan.csv`, `held_out.csv`, `plan.html`, and `trajectory.json` where every motion is free.
    ///
    /// # Errors
    /// [`PlanError::Table`] where a name cannot stand in a table.
    pub fn files(&self, model: &RobotModel, profile: &str) -> Result<Vec<OutputFile>, PlanError> {
        let file = self.file(model);
        let yaml = serde_saphyr::to_string(&file).map_err(|e| unwritable("plan.yaml", &e))?;
        let q: Vec<&Vec<f64>> = self.postures.iter().map(|p| &p.q).collect();
        let reasons = self.postures.iter().map(|p| words::why(p.why).to_owned());
        let held_out: Vec<&Vec<f64>> = self.held_out.iter().collect();
        let html = page(self, model, profile).map_err(|e| unwritable("plan.html", &e))?;
        let mut files = vec![
            OutputFile::text("plan.yaml", yaml),
            OutputFile::text("plan.csv", table(model, profile, &q, reasons.collect())?),
            OutputFile::text(
                "held_out.csv",
                table(model, profile, &held_out, Vec::new())?,
            ),
            OutputFile::text("plan.html", html),
        ];
        // A list of points that a controller would drive through must not lead through anything.
        if self.blocked.is_empty() {
            files.push(OutputFile::text("trajectory.json", self.trajectory(model)?));
        }
        Ok(files)
    }

    /// What `--json` prints.
    ///
    /// # Errors
    /// [`PlanError::Table`] for numbers that are not finite.
    pub fn json(&self, model: &RobotModel) -> Result<String, PlanError> {
        let printed = Printed {
            plan: self.file(model),
            candidates: &self.counts,
            parameters: &self.parameters,
            motion_time_s: self.motion_time,
            notes: &self.notes,
        };
        let text = serde_json::to_string_pretty(&printed);
        Ok(text.map_err(|e| unwritable("the plan", &e))? + "\n")
    }

    /// A ROS 2 `trajectory_msgs/JointTrajectory` as JSON, rad and m, at a third of the joints' speed with 2 s at each posture. Its first
    /// point leaves time to come from anywhere in the joint ranges at that speed.
    fn trajectory(&self, model: &RobotModel) -> Result<String, PlanError> {
        /// Speed beside the limit.
        const SPEED: f64 = 1.0 / 3.0;
        /// Hold at each posture, s.
        const HOLD: f64 = 2.0;
        let moved = &self.joints.moved;
        let names: Vec<&str> = moved
            .iter()
            .map(|m| model.joint(m.joint).name.as_str())
            .collect();
        let corner = |of: fn(&crate::joints::Moved) -> f64| {
            let mut q = self.joints.base.clone();
            for m in moved {
                q[m.joint.index()] = of(m);
            }
            q
        };
        let mut at = 0.0;
        let mut points = Vec::new();
        let stamp = |t: f64| {
            let nanoseconds = (t * 1e9).round() as u64;
            serde_json::json!({"sec": nanoseconds / 1_000_000_000, "nanosec": nanoseconds % 1_000_000_000})
        };
        for (i, posture) in self.postures.iter().enumerate() {
            at += match i.checked_sub(1) {
                Some(last) => self.joints.time(&self.postures[last].q, &posture.q) / SPEED,
                None => self.joints.time(&corner(|m| m.low), &corner(|m| m.high)) / SPEED,
            };
            let of = |m: &crate::joints::Moved| rounded(posture.q[m.joint.index()], 6);
            let positions: Vec<f64> = moved.iter().map(of).collect();
            let still = vec![0.0; moved.len()];
            let mut reach = |t: f64| {
                points.push(serde_json::json!({
                    "positions": positions, "velocities": still, "accelerations": [], "effort": [], "time_from_start": stamp(t)
                }));
            };
            reach(at);
            if posture.why != Why::Detour {
                at += HOLD;
                reach(at);
            }
        }
        let header = serde_json::json!({"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""});
        let whole = serde_json::json!({"header": header, "joint_names": names, "points": points});
        let text = serde_json::to_string_pretty(&whole);
        Ok(text.map_err(|e| unwritable("trajectory.json", &e))? + "\n")
    }
}

/// Reads a plan.
///
/// # Errors
/// [`PlanError::NotAPlan`] where the file is none, or names joints that the robot does not have.
pub fn read(text: &str, name: &str, model: &RobotModel) -> Result<PlanFile, PlanError> {
    let wrong = |why: String| PlanError::NotAPlan {
        file: name.to_owned(),
        why,
    };
    let file: PlanFile = serde_saphyr::from_str(text).map_err(|e| wrong(e.to_string()))?;
    if file.calib_plan != VERSION {
        return Err(wrong(format!(
            "its version is {}, this program reads {VERSION}",
            file.calib_plan
        )));
    }
    let joint = |key: &str| key.rsplit_once('_').map(|k| k.0.to_owned());
    let all = file.postures.iter().flat_map(|p| p.joints.keys());
    for key in all.chain(file.held_out.iter().flat_map(BTreeMap::keys)) {
        let known = joint(key).is_some_and(|name| model.joint_id(&name).is_ok());
        if !known {
            return Err(wrong(format!(
                "`{key}` is not a joint of this robot; the plan is for `{}`",
                file.robot
            )));
        }
    }
    Ok(file)
}

impl PlanFile {
    /// Joint positions of the postures that are recorded, and of those to validate with, by joint index; joints that the plan does not name
    /// stand as in `base`.
    #[must_use]
    pub fn positions(&self, model: &RobotModel, base: &[f64]) -> [Vec<Vec<f64>>; 2] {
        let of = |joints| self.at(model, base, joints);
        let recorded = self.postures.iter().filter(|p| p.why != Why::Detour);
        [
            recorded.map(|p| of(&p.joints)).collect(),
            self.held_out.iter().map(of).collect(),
        ]
    }

    /// Joint positions of one of its postures, by joint index.
    #[must_use]
    pub fn at(&self, model: &RobotModel, base: &[f64], joints: &BTreeMap<String, f64>) -> Vec<f64> {
        let mut q = base.to_vec();
        for (key, value) in joints {
            let named = key.rsplit_once('_').map(|k| model.joint_id(k.0));
            if let Some(Ok(id)) = named {
                q[id.index()] = value / shown(model.joint(id).kind.turns()).0;
            }
        }
        q
    }

    /// Joints that it moves.
    #[must_use]
    pub fn joints(&self, model: &RobotModel) -> Vec<JointId> {
        let all = self.postures.iter().map(|p| &p.joints);
        let named: BTreeSet<&String> = all.chain(&self.held_out).flat_map(BTreeMap::keys).collect();
        let names = named.into_iter().filter_map(|key| key.rsplit_once('_'));
        let ids: BTreeSet<JointId> = names.filter_map(|k| model.joint_id(k.0).ok()).collect();
        model
            .independent_joints()
            .filter(|id| ids.contains(id))
            .collect()
    }
}

/// Reads a list of postures: a table with joint columns. Joints that it does not name are where the others stand; rows of a plan that are only
/// on the way are left out.
///
/// # Errors
/// [`PlanError::NotJoints`] for a table of something else, [`PlanError::OutOfReach`] for positions outside the ranges.
pub fn read_postures(
    bytes: &[u8],
    name: &str,
    model: &RobotModel,
    joints: &JointBox,
) -> Result<Vec<Vec<f64>>, PlanError> {
    let wrong = |why: String| PlanError::NotJoints {
        file: name.to_owned(),
        why,
    };
    let table = read_poses(bytes, name)?;
    if table.joints.is_empty() || table.is_empty() {
        return Err(wrong("the table has no joint positions".to_owned()));
    }
    of_joints(&table, name, model, joints)
}

/// Reads a task: a table of joint positions, or of places of one link, body or marker in the frame of the robot's root, for each of which a posture is
/// found.
///
/// # Errors
/// As [`read_postures`]; [`PlanError::NotPlaces`] for a table of neither, [`PlanError::PlaceOutOfReach`] for a place without a posture.
pub fn read_task(bytes: &[u8], name: &str, known: &Known) -> Result<Vec<Vec<f64>>, PlanError> {
    let table = read_poses(bytes, name)?;
    let (model, joints) = (&known.robot.model, known.joint_box()?);
    if !table.joints.is_empty() && !table.is_empty() {
        return of_joints(&table, name, model, &joints);
    }
    let (feasible, _) = known.feasible(&joints, 1);
    let (tool, goals) = places::goals(&table, name, model, &feasible)?;
    places::postures((tool, &goals), name, &joints, &feasible)
}

fn read_poses(bytes: &[u8], name: &str) -> Result<Poses, PlanError> {
    let wrong = |why: String| PlanError::NotJoints {
        file: name.to_owned(),
        why,
    };
    let table = calib_recording::read_bytes(name, bytes, &ReadOptions::default());
    let table = table.map_err(|e| wrong(e.to_string()))?;
    let table = table.poses(calib_recording::Filled::Exclude);
    table.map_err(|e| wrong(e.to_string()))
}

fn of_joints(
    table: &Poses,
    name: &str,
    model: &RobotModel,
    joints: &JointBox,
) -> Result<Vec<Vec<f64>>, PlanError> {
    let wrong = |why: String| PlanError::NotJoints {
        file: name.to_owned(),
        why,
    };
    let mut columns = Vec::new();
    for (joint, column) in &table.joints {
        let id = model.joint_id(joint).map_err(|e| wrong(e.to_string()))?;
        columns.push((id, column));
    }
    let mut postures = Vec::new();
    let reasons = table.labels.get(REASON);
    let on_the_way = |row: usize| reasons.is_some_and(|r| r[row] == words::why(Why::Detour));
    for row in (0..table.len()).filter(|row| !on_the_way(*row)) {
        let mut q = joints.base.clone();
        for (id, column) in &columns {
            let missing = || {
                wrong(format!(
                    "row {}: `{}` is missing",
                    row + 1,
                    model.joint(*id).name
                ))
            };
            q[id.index()] = column[row].ok_or_else(missing)?;
        }
        for m in &joints.moved {
            let at = q[m.joint.index()];
            if at < m.low - 1e-3 || at > m.high + 1e-3 {
                let (factor, unit) = shown(m.turns);
                let of = |x: f64| format!("{:.1}", x * factor);
                return Err(PlanError::OutOfReach {
                    file: name.to_owned(),
                    row: row + 1,
                    joint: model.joint(m.joint).name.clone(),
                    found: format!("{} {unit}", of(at)),
                    range: format!("{} … {} {unit}", of(m.low), of(m.high)),
                });
            }
        }
        postures.push(q);
    }
    Ok(postures)
}

/// Positions of the moved joints by `<joint>_deg` or `<joint>_mm`, whole hundredths.
pub(crate) fn by_name(model: &RobotModel, joints: &JointBox, q: &[f64]) -> BTreeMap<String, f64> {
    let of = |m: &crate::joints::Moved| {
        let (factor, unit) = shown(m.turns);
        let key = format!("{}_{unit}", model.joint(m.joint).name);
        (key, rounded(q[m.joint.index()] * factor, 2))
    };
    joints.moved.iter().map(of).collect()
}

fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale + 0.0
}

fn table(
    model: &RobotModel,
    profile: &str,
    postures: &[&Vec<f64>],
    reasons: Vec<String>,
) -> Result<String, PlanError> {
    let mut poses = joint_table(model, postures);
    let mut comments = vec![format!("planned by `calib plan {profile}`")];
    if !reasons.is_empty() {
        comments.extend(words::OF_TABLE.map(str::to_owned));
        poses.labels.insert(REASON.to_owned(), reasons);
    }
    let options = WriteOptions {
        comments,
        decimals: Some(5),
        degrees: true,
        ..WriteOptions::default()
    };
    calib_recording::write_poses(&poses, &options).map_err(|e| unwritable("plan.csv", &e))
}

fn unwritable(file: &str, why: &dyn std::fmt::Display) -> PlanError {
    PlanError::Table {
        file: file.to_owned(),
        why: why.to_string(),
        help: RENAME,
    }
}
