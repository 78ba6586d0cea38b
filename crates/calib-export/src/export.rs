//! `calib export`: the robot in the formats of other programs, each verified on postures before it is given.

use std::fmt::Write as _;

use calib_model::file::RobotModelFile;
use calib_model::{LinkId, Model, Pose};

use crate::cost::{Cost, between, postures, truth};
use crate::error::ExportError;
use crate::geometric::{evaluated, geometric, lost};
use crate::read::Robot;
use crate::{best, dh, poe, xml};

/// A format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Target {
    /// URDF of the calibrated geometry.
    Urdf,
    /// URDF refitted to predict best alone.
    UrdfBest,
    /// Denavit–Hartenberg parameters (standard), YAML.
    Dh,
    /// The same with Hayati's β for nearly parallel axes.
    Hayati,
    /// Product of exponentials, YAML.
    Poe,
    /// MuJoCo.
    Mjcf,
    /// SDFormat.
    Sdf,
}

impl Target {
    /// As it is named on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::UrdfBest => "urdf-best",
            Self::Dh => "dh",
            Self::Hayati => "hayati",
            Self::Poe => "poe",
            Self::Mjcf => "mjcf",
            Self::Sdf => "sdf",
        }
    }
}

/// An exported robot.
#[derive(Debug, Clone)]
pub struct Exported {
    /// The file.
    pub text: String,
    /// Effects that the format cannot hold.
    pub lost: Vec<&'static str>,
    /// Position error of the tool against the model, that this costs.
    pub cost: Cost,
    /// The link whose error that is.
    pub tool: String,
}

/// Postures that a cost is stated of; as many others fit `urdf-best`.
const POSTURES: usize = 400;
/// Seeds of the two.
const HELD_OUT: u64 = 1;
const FITTED: u64 = 2;
/// What a written format may differ from the geometry that was meant, m and rad: nine decimals in each of ten origins.
const SAME: f64 = 1e-7;

/// Writes a robot as another program reads it; costs are of `tool`, or of the last link. `region`: postures to be good at, in place of
/// the fitted range: every second one is kept for the cost of `urdf-best`.
///
/// # Errors
/// [`ExportError`].
pub fn export(
    robot: &Robot,
    target: Target,
    tool: Option<&str>,
    region: Option<&[Vec<f64>]>,
) -> Result<Exported, ExportError> {
    let link = robot.tool(tool)?;
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
    let unfit = |reason: String| ExportError::Unfit {
        target: target.name(),
        reason,
        remedy: "use the model file itself",
    };
    let wanted = truth(&robot.model, link, &held_out);
    let plain = geometric(&robot.file);
    let alone = match target {
        Target::UrdfBest => {
            let there = truth(&robot.model, link, &fitted);
            best::refitted(&plain, link, &fitted, &there).map_err(|e| unfit(e.to_string()))?
        }
        _ => plain,
    };
    let model = evaluated(&alone).map_err(|e| unfit(e.to_string()))?;
    let held = truth(&model, link, &held_out);
    let mut out = Exported {
        text: String::new(),
        lost: lost(&robot.file),
        cost: between(&held, &wanted),
        tool: robot.model.links()[link.index()].clone(),
    };
    let notes = notes(robot, target, &out);
    let written = Written {
        file: &alone,
        model: &model,
        link,
        notes: &notes,
    };
    let check = written.table(target, &held_out, &mut out.text);
    if let Some(seen) = check {
        // What was written is evaluated by its own formulas.
        let turned = seen.iter().zip(&held).map(|(a, b)| (a.r - b.r).norm());
        let off = turned.fold(between(&seen, &held).largest_m, f64::max);
        if off > SAME {
            return Err(unfit(format!(
                "what was written differs from what was meant by {off:.1e} (m, rad)"
            )));
        }
    }
    Ok(out)
}

/// What a reader of the file has to know.
fn notes(robot: &Robot, target: Target, of: &Exported) -> Vec<String> {
    let mut notes = vec![format!(
        "Written by calib {} from the model of {}.",
        env!("CARGO_PKG_VERSION"),
        robot.file.robot
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
    match target {
        Target::UrdfBest => notes.push(
            "The origins were refitted to predict best without effects; the error is of postures that were not fitted.".to_owned(),
        ),
        Target::Mjcf => notes.push(
            "Inertia tensors are not known: those here are placeholders for kinematics and gravity, not for dynamics. Mimic joints are constraints of the simulation.".to_owned(),
        ),
        _ => {}
    }
    if matches!(target, Target::Urdf | Target::UrdfBest) {
        notes.push(
            "Efforts, velocities, inertia tensors and shapes are not known here and are 0 or absent: `calib apply` writes the geometry into a URDF that has them.".to_owned(),
        );
    }
    notes
}

/// What is written of.
struct Written<'a> {
    file: &'a RobotModelFile,
    model: &'a Model,
    link: LinkId,
    notes: &'a [String],
}

impl Written<'_> {
    /// The text; where the format is a table of ours, the tool by its own formula at postures.
    fn table(&self, target: Target, postures: &[Vec<f64>], text: &mut String) -> Option<Vec<Pose>> {
        let chain = best::chain(self.file, self.link);
        let by_name = |q: &[f64], name: &str| {
            let joints = self.model.joints().iter();
            joints
                .zip(q)
                .find(|(j, _)| j.name == name)
                .map_or(0.0, |(_, q)| *q)
        };
        match target {
            Target::Urdf | Target::UrdfBest => *text = xml::urdf(self.file, self.notes),
            Target::Mjcf => *text = xml::mjcf(self.file, self.notes),
            Target::Sdf => *text = xml::sdf(self.file, self.notes),
            Target::Dh | Target::Hayati => {
                let table = dh::table(self.file, &chain, target == Target::Hayati);
                *text = self.dh_text(target, &table);
                let at = |q: &Vec<f64>| dh::forward(&table, &|name| by_name(q, name));
                return Some(postures.iter().map(at).collect());
            }
            Target::Poe => {
                let screws = poe::screws(self.file, &chain);
                *text = self.poe_text(&screws);
                let at = |q: &Vec<f64>| poe::forward(&screws, &|name| by_name(q, name));
                return Some(postures.iter().map(at).collect());
            }
        }
        None
    }

    fn head(&self, convention: &str) -> String {
        let notes: String = self.notes.iter().map(|n| format!("# {n}\n")).collect();
        let tool = &self.model.links()[self.link.index()];
        format!(
            "{notes}# Lengths in m, angles in rad; transforms: 12 numbers by rows, R | t.\nconvention: {convention}\nroot: {}\ntool_link: {}\n",
            quoted(&self.file.root),
            quoted(tool)
        )
    }

    fn dh_text(&self, target: Target, table: &dh::Table) -> String {
        let beta = target == Target::Hayati;
        let mut out = self.head(target.name());
        let last = if beta { " Ry(beta)" } else { "" };
        let _ = writeln!(
            out,
            "# root_from_tool = base * A_1 * … * A_n * tool,  A = Rz(theta) Tz(d) Tx(a) Rx(alpha){last}\n\
             # A revolute joint adds multiplier * q + offset to theta, a prismatic one to d; q is what `reads` reads.\n\
             base: [{}]\njoints:",
            xml::rows(&table.base)
        );
        for row in &table.rows {
            let kind = if row.prismatic {
                "prismatic"
            } else {
                "revolute"
            };
            let n = xml::number;
            let _ = write!(
                out,
                "  - {{joint: {}, type: {kind}, theta: {}, d: {}, a: {}, alpha: {}",
                quoted(&row.joint),
                n(row.theta),
                n(row.d),
                n(row.a),
                n(row.alpha)
            );
            if beta {
                let _ = write!(out, ", beta: {}", n(row.beta));
            }
            let _ = writeln!(out, "{}}}", reads(&row.reads, row.multiplier, row.offset));
        }
        let _ = writeln!(out, "tool: [{}]", xml::rows(&table.tool));
        out
    }

    fn poe_text(&self, (screws, end): &(Vec<poe::Screw>, nalgebra::Isometry3<f64>)) -> String {
        let mut out = self.head("poe");
        out.push_str(
            "# root_from_tool = exp([S_1] q_1) * … * exp([S_n] q_n) * home; S = [omega; v] in the root; q is multiplier * q + offset of what `reads` reads.\njoints:\n",
        );
        for s in screws {
            let _ = writeln!(
                out,
                "  - {{joint: {}, omega: [{}], v: [{}]{}}}",
                quoted(&s.joint),
                xml::vector(&s.omega),
                xml::vector(&s.v),
                reads(&s.reads, s.multiplier, s.offset)
            );
        }
        let _ = writeln!(out, "home: [{}]", xml::rows(end));
        out
    }
}

fn reads(other: &str, multiplier: f64, offset: f64) -> String {
    format!(
        ", reads: {}, multiplier: {multiplier}, offset: {offset}",
        quoted(other)
    )
}

/// A name as a YAML string.
fn quoted(name: &str) -> String {
    format!(
        "\"{}\"",
        name.replace('\\', "\\\\")
            .replace('"', "\\\"")
            .replace('\n', " ")
    )
}
