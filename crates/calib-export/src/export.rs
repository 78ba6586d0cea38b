//! `calib export`: the robot in the formats of other programs, each verified on postures before it is given.

use calib_model::file::RobotModelFile;
use calib_model::{LinkId, Model, ModelError, Place, Pose};

use crate::cost::{Cost, anywhere, between, postures, truth};
use crate::error::ExportError;
use crate::geometric::{evaluated, geometric, lost};
use crate::names::accepted;
use crate::opw::{Axes, Opw, Readings, axes};
use crate::read::Robot;
use crate::target::Target;
use crate::yaml::Head;
use crate::{best, dh, poe, ur, xml, yaml};

/// An exported robot.
#[derive(Debug, Clone)]
pub struct Exported {
    /// The file.
    pub text: String,
    /// What of the model the format cannot hold: joint effects, or a part of the geometry.
    pub lost: Vec<&'static str>,
    /// Links that have another name in the file, in words.
    pub renamed: Vec<String>,
    /// Position error of the tool against the model, that this costs.
    pub cost: Cost,
    /// The link or point whose error that is.
    pub tool: String,
}

/// Postures that a cost is stated of; as many others are fitted.
const POSTURES: usize = 400;
/// Seeds of the two.
const HELD_OUT: u64 = 1;
const FITTED: u64 = 2;
/// What the formulas of a table may differ from the geometry that was meant, m and rad: the common normal of axes that are parallel to
/// 1e-9 rad is at 1e9 m, where a rounding is 1e-7.
const SAME: f64 = 1e-7;
/// Position error, rms in m, up to which an arm is of the kind that seven lengths describe. Tolerances of one that was built to them cost
/// some millimeters; the offsets of other shoulders and wrists are centimeters.
const OF_THE_KIND: f64 = 5e-3;

/// Writes a robot as another program reads it; costs are of `tool`, a link or a point, or of the last link. `region`: postures to be good
/// at, in place of the fitted range: every second one is kept for the cost of what is fitted.
///
/// # Errors
/// [`ExportError`].
pub fn export(
    robot: &Robot,
    target: Target,
    tool: Option<&str>,
    region: Option<&[Vec<f64>]>,
) -> Result<Exported, ExportError> {
    let (fitted, held_out) = match region {
        None => (
            postures(&robot.model, POSTURES, FITTED),
            postures(&robot.model, POSTURES, HELD_OUT),
        ),
        Some(given) => {
            let every = |odd: usize| given.iter().skip(odd).step_by(2).cloned().collect();
            (every(0), every(1))
        }
    };
    if held_out.is_empty() {
        return Err(ExportError::Region);
    }
    let with_point;
    let (robot, link) = match (robot.tool(tool)?, tool) {
        (Place::Link(link), _) => (robot, link),
        (_, Some(point)) if target != Target::Ur => {
            with_point = robot
                .with_link(point)
                .map_err(|reason| unfit(target, reason, FILE_ITSELF))?;
            (&with_point.0, with_point.1)
        }
        _ => {
            return Err(unfit(
                target,
                "it holds the joints of the arm, and no tool".to_owned(),
                "leave `--tool` out, and set the tool at the controller",
            ));
        }
    };
    let geometry = geometric(&robot.file);
    let asked = Asked {
        target,
        robot,
        link,
        tool: &robot.model.links()[link.index()],
        chain: best::chain(&geometry, link),
        geometry,
        fitted,
        held_out,
    };
    match target {
        Target::Opw => asked.opw(),
        Target::Ur => asked.ur(),
        _ => asked.geometry(),
    }
}

const FILE_ITSELF: &str = "use the model file itself";

fn unfit(target: Target, reason: String, remedy: &'static str) -> ExportError {
    ExportError::Unfit {
        target: target.name(),
        reason,
        remedy,
    }
}

/// What is exported.
struct Asked<'a> {
    target: Target,
    robot: &'a Robot,
    link: LinkId,
    /// Its name.
    tool: &'a str,
    /// The robot without effects, and its joints that lead to the tool.
    geometry: RobotModelFile,
    chain: Vec<usize>,
    fitted: Vec<Vec<f64>>,
    held_out: Vec<Vec<f64>>,
}

impl Asked<'_> {
    /// Formats of the whole geometry.
    fn geometry(&self) -> Result<Exported, ExportError> {
        let alone = match self.target {
            Target::UrdfBest => {
                let there = truth(&self.robot.model, self.link, &self.fitted);
                best::refitted(&self.geometry, self.link, &self.fitted, &there)
                    .map_err(|e| self.of_model(&e))?
            }
            _ => self.geometry.clone(),
        };
        let model = evaluated(&alone).map_err(|e| self.of_model(&e))?;
        let held = truth(&model, self.link, &self.held_out);
        let mut out = self.costing(&held, Vec::new());
        let mut notes = self.notes(&out, None);
        // What was written is evaluated by its own formulas, where it has any.
        let mut seen = None;
        out.text = match self.target {
            Target::Dh | Target::Hayati => {
                let hayati = self.target == Target::Hayati;
                let table = dh::table(&alone, &self.chain, hayati);
                let at = |q: &Vec<f64>| dh::forward(&table, &|name| by_name(&model, q, name));
                seen = Some(self.held_out.iter().map(at).collect::<Vec<_>>());
                if let Some((one, other, meters)) = dh::far(&alone, &self.chain, &table) {
                    notes.push(format!(
                        "The axes of {one} and {other} are nearly parallel: their common normal is {meters:.0} m away, and small errors move it by meters. The numbers are exact together. `--to hayati` has none of this size."
                    ));
                }
                yaml::dh(&self.head(&notes), &table, hayati)
            }
            Target::Poe => {
                let screws = poe::screws(&alone, &self.chain);
                let at = |q: &Vec<f64>| poe::forward(&screws, &|name| by_name(&model, q, name));
                seen = Some(self.held_out.iter().map(at).collect::<Vec<_>>());
                yaml::poe(&self.head(&notes), &screws)
            }
            Target::Mjcf | Target::Sdf => {
                let (named, renamed) = accepted(alone.clone(), self.target);
                notes.extend(renamed.iter().cloned());
                out.renamed = renamed;
                match self.target {
                    Target::Mjcf => xml::mjcf(&named, &notes),
                    _ => xml::sdf(&named, &notes),
                }
            }
            _ => xml::urdf(&alone, &notes),
        };
        if let Some(seen) = seen {
            let turned = seen.iter().zip(&held).map(|(a, b)| (a.r - b.r).norm());
            let off = turned.fold(between(&seen, &held).largest_m, f64::max);
            if off > SAME {
                let reason =
                    format!("what was written differs from what was meant by {off:.1e} (m, rad)");
                return Err(unfit(self.target, reason, FILE_ITSELF));
            }
        }
        Ok(out)
    }

    /// Origins of a UR arm.
    fn ur(&self) -> Result<Exported, ExportError> {
        let arm = ur::arm(&self.geometry, &self.chain)
            .map_err(|(reason, remedy)| unfit(self.target, reason, remedy))?;
        let model = evaluated(&arm.file).map_err(|e| self.of_model(&e))?;
        let held = truth(&model, self.link, &self.held_out);
        let others = arm.others.then_some("origins of other joints");
        let mut out = self.costing(&held, others.into_iter().collect());
        let notes = self.notes(&out, None);
        out.text = yaml::ur(&self.head(&notes), &arm);
        Ok(out)
    }

    /// Lengths and offsets of an arm with a spherical wrist.
    fn opw(&self) -> Result<Exported, ExportError> {
        let remedy = "use `dh`, `hayati` or `poe`: they hold any chain";
        let refused = |reason: String| unfit(self.target, reason, remedy);
        let axes = axes(&self.geometry, &self.chain).map_err(refused)?;
        let (start, alone) = self.of_the_kind(&axes)?.map_err(refused)?;
        let there = truth(&self.robot.model, self.link, &self.fitted);
        let opw = start.refitted(&self.readings(&start, &self.fitted), &there);
        let held = forward(&opw, &self.readings(&opw, &self.held_out));
        let mut out = self.costing(&held, vec!["deviations from its seven lengths"]);
        let notes = self.notes(&out, Some(alone));
        out.text = yaml::opw(&self.head(&notes), &opw);
        Ok(out)
    }

    /// The parameters that come nearest to the geometry wherever the arm can be, and what they cost there; or why it is another kind of arm.
    fn of_the_kind(&self, axes: &Axes) -> Result<Result<(Opw, Cost), String>, ExportError> {
        let Some(start) = axes.closed_form() else {
            return Ok(Err(axes.deviations()));
        };
        let model = evaluated(&self.geometry).map_err(|e| self.of_model(&e))?;
        let at = |seed: u64| {
            let postures = anywhere(&model, POSTURES, seed);
            let there = truth(&model, self.link, &postures);
            (self.readings(&start, &postures), there)
        };
        let (readings, there) = at(FITTED);
        let opw = start.refitted(&readings, &there);
        let (readings, there) = at(HELD_OUT);
        let cost = between(&forward(&opw, &readings), &there);
        // Not a number is no small cost.
        if cost.rms_m <= OF_THE_KIND {
            return Ok(Ok((opw, cost)));
        }
        Ok(Err(format!(
            "its geometry is {:.1} mm rms from that of an arm with parallel axes 2 and 3 and a spherical wrist (at most {} mm): {}",
            1e3 * cost.rms_m,
            1e3 * OF_THE_KIND,
            axes.deviations()
        )))
    }

    /// Readings of the six joints at postures.
    fn readings(&self, of: &Opw, postures: &[Vec<f64>]) -> Vec<Readings> {
        let model = &self.robot.model;
        let at = |q: &Vec<f64>| std::array::from_fn(|i| by_name(model, q, &of.joints[i]));
        postures.iter().map(at).collect()
    }

    fn of_model(&self, error: &ModelError) -> ExportError {
        unfit(self.target, error.to_string(), FILE_ITSELF)
    }

    /// Without the text yet; `besides`: what is lost of the geometry.
    fn costing(&self, held: &[Pose], besides: Vec<&'static str>) -> Exported {
        let wanted = truth(&self.robot.model, self.link, &self.held_out);
        let mut lost = lost(&self.robot.file);
        lost.extend(besides);
        Exported {
            text: String::new(),
            lost,
            renamed: Vec::new(),
            cost: between(held, &wanted),
            tool: self.tool.to_owned(),
        }
    }

    fn head<'a>(&'a self, notes: &'a [String]) -> Head<'a> {
        Head {
            notes,
            convention: self.target.name(),
            root: &self.geometry.root,
            tool: self.tool,
        }
    }

    /// What a reader of the file has to know; `kind`: what the geometry alone costs.
    fn notes(&self, of: &Exported, kind: Option<Cost>) -> Vec<String> {
        let mut notes = vec![format!(
            "Written by calib {} from the model of {}.",
            env!("CARGO_PKG_VERSION"),
            self.robot.file.robot
        )];
        let (rms, largest) = (1e3 * of.cost.rms_m, 1e3 * of.cost.largest_m);
        let (tool, n) = (&of.tool, of.cost.postures);
        if of.lost.is_empty() {
            notes.push("The model has no effects beyond zero offsets: nothing is lost.".to_owned());
        } else {
            let lost = of.lost.join(", ");
            notes.push(format!(
                "Not in this file: {lost}. Without them {tool} is off by {rms:.3} mm rms, {largest:.3} mm at most ({n} postures)."
            ));
        }
        if let Some(kind) = kind {
            notes.push(format!(
                "All numbers were fitted to predict best; the error is of postures that were not fitted. The geometry without effects costs {:.3} mm \
                 rms wherever the arm can be.",
                1e3 * kind.rms_m
            ));
        }
        let of_target: &[&str] = match self.target {
            Target::UrdfBest => &[
                "The origins were refitted to predict best without effects; the error is of postures that were not fitted.",
                NO_SHAPES,
            ],
            Target::Urdf => &[NO_SHAPES],
            Target::Mjcf => &[
                "Inertia tensors are not known: those here are placeholders for kinematics and gravity, not for dynamics. Mimic joints are constraints of the simulation.",
            ],
            Target::Ur => &[
                "The kinematics parameters of ur_description. All other joints are as in the nominal URDF.",
                "ur_robot_driver compares the hash with that of the controller and reports that they differ: the controller moves by its own calibration, which this is not. The hash is made of the numbers.",
            ],
            _ => &[],
        };
        notes.extend(of_target.iter().map(|note| (*note).to_owned()));
        let holds_masses = matches!(
            self.target,
            Target::UrdfBest | Target::Urdf | Target::Mjcf | Target::Sdf
        );
        if holds_masses && self.robot.file.masses_assumed {
            notes.push(NO_MASSES.to_owned());
        }
        notes
    }
}

const NO_SHAPES: &str = "Efforts, velocities, inertia tensors and shapes are not known here and are 0 or absent: `calib apply` writes the geometry into a URDF that has them.";

const NO_MASSES: &str = "The nominal URDF states no masses, and none are written: those that the fit assumed are not the robot's.";

/// A joint's reading at a posture of a model; 0 where it has no such joint.
fn by_name(model: &Model, q: &[f64], name: &str) -> f64 {
    let joints = model.joints().iter();
    joints
        .zip(q)
        .find(|(j, _)| j.name == name)
        .map_or(0.0, |(_, q)| *q)
}

fn forward(opw: &Opw, readings: &[Readings]) -> Vec<Pose> {
    let at = |q: &Readings| Pose::of(&opw.forward(q));
    readings.iter().map(at).collect()
}
