//! `calib correct`: the program that brings the tool to where the nominal model has it.

use std::path::Path;

use calib_finding::cell;
use calib_model::file::ModelBody;
use calib_model::{ModelError, Outcome, Place, Pose};
use calib_recording::joint_column;
use nalgebra::{Isometry3, Point3};

use crate::commands::{Command, Commands, CorrectOptions};
use crate::error::ExportError;
use crate::read::Robot;
use crate::table::{Csv, NOTES, Program, program};

/// Rows at which it is asked how well the model knows where the tool stands.
const KNOWN_AT: usize = 200;

/// A corrected program.
#[derive(Debug, Clone)]
pub struct Corrected {
    /// CSV: the joints of the robot, what became of each row, and the tool's error by the model before and after, mm.
    pub csv: String,
    /// Rows with a position.
    pub rows: usize,
    /// Rows whose tool stands where it is wanted.
    pub reached: usize,
    /// Rows whose command brings the tool there, or nearer, outside of the fitted range.
    pub outside: usize,
    /// Of rows without joint positions, those that are reached by another posture than that of the row before.
    pub elsewhere: usize,
    /// Rows whose tool comes nearer only.
    pub nearer: usize,
    /// Rows that keep their position: refused.
    pub refused: usize,
    /// Tool error by the model, rms and largest over rows with a position, m: before and after.
    pub before_m: [f64; 2],
    /// After.
    pub after_m: [f64; 2],
    /// How well the model knows where the tool stands in the root's frame at the commands, by its σ, rms over some of the rows, m; `None` where it states
    /// no uncertainty.
    pub known_m: Option<f64>,
    /// Name of the tool.
    pub tool: String,
    /// Joints that the table has no column for: they counted as 0.
    pub absent: Vec<String>,
    /// Temperature that was assumed, °C, because the table has none and lengths follow it.
    pub assumed_temperature_c: Option<f64>,
    /// The rows have poses of the tool: these are reached by the command.
    pub cartesian: bool,
    /// Poses and positions of the table that belong to nothing the robot or its calibration knows, by name: they are not used.
    pub unused: Vec<String>,
}

/// Corrects a table of joint positions. Where the table has poses of the tool (`<tool>.x_m` …, in the root's frame), or its positions and
/// only these are wanted, the commands reach those, from the row's joints or, where it has none, from the row before, else from
/// postures all over the fitted range.
///
/// # Errors
/// [`ExportError`].
pub fn correct(
    robot: &Robot,
    table: &Path,
    options: &CorrectOptions,
) -> Result<Corrected, ExportError> {
    let model = &robot.model;
    let program = program(table, robot, &options.like)?;
    let last = &model.links()[model.last_link().index()];
    let name = options.tool.as_ref().unwrap_or(last);
    let tool = robot.tool(options.tool.as_deref())?;
    let Wanted {
        poses: wanted,
        oriented,
        unused,
    } = wanted(&program, robot, name, options.position_only)?;
    let without_joints = program.absent.len() == model.joints().len();
    let mut out = Corrected::of(&program.absent, wanted.is_some());
    out.tool.clone_from(name);
    out.unused = unused;
    let every = program.q.len().div_ceil(KNOWN_AT);
    let mut variances = Vec::new();
    out.assumed_temperature_c = program.assumed_temperature_c(model);
    let mut csv = Csv::default();
    header(&mut csv, robot);
    let mut commands = Commands::new(model, tool, options, without_joints);
    for (k, q) in program.q.iter().enumerate() {
        let wrong = |source: ModelError| ExportError::Row {
            file: program.file.clone(),
            line: program.lines[k],
            source: Box::new(source),
        };
        let target: Option<Option<Pose>> = wanted.as_ref().map(|poses| poses[k]);
        csv.cell(&program.lines[k].to_string());
        let (Some(q), false) = (q, target == Some(None)) else {
            lost(&mut csv, robot);
            continue;
        };
        let done = commands.next(q, target.flatten(), program.temperature_c(k));
        let done = done.map_err(wrong)?;
        out.count(&done);
        if k % every == 0 && model.has_uncertainty() {
            let sigma = commands.sigma(&done.q, program.temperature_c(k));
            let position = sigma.map_err(wrong)?.fixed_view::<3, 3>(3, 3).trace();
            variances.push(position);
        }
        line(&mut csv, robot, &done, oriented);
    }
    let mean = variances.iter().sum::<f64>() / variances.len().max(1) as f64;
    out.known_m = (!variances.is_empty()).then(|| mean.sqrt());
    out.finish();
    out.csv = csv.text();
    Ok(out)
}

/// What the table wants of the tool beside joint positions.
struct Wanted {
    /// By row; `None`: what the nominal model says of the joint positions.
    poses: Option<Vec<Option<Pose>>>,
    /// Whether the orientation of these is known.
    oriented: bool,
    /// What else the table has the place of, that neither the robot nor its calibration knows.
    unused: Vec<String>,
}

fn wanted(
    program: &Program,
    robot: &Robot,
    tool: &str,
    position_only: bool,
) -> Result<Wanted, ExportError> {
    let model = &robot.model;
    let column = |found: &str, what: String, remedy: String| ExportError::Column {
        file: program.file.clone(),
        found: format!("`{found}`"),
        what,
        remedy,
    };
    let names = || program.poses.keys().chain(program.points.keys());
    let without_joints = program.absent.len() == model.joints().len();
    if let Some(poses) = program.poses.get(tool) {
        return Ok(Wanted {
            poses: Some(poses.clone()),
            oriented: true,
            unused: names()
                .filter(|n| *n != tool && model.place(n).is_none())
                .cloned()
                .collect(),
        });
    }
    if let Some(points) = program.points.get(tool) {
        if !position_only {
            let what =
                "is the tool, and the table has its position without its orientation".to_owned();
            let remedy = format!(
                "add `{tool}.qx`, `.qy`, `.qz` and `.qw`, or correct the position alone with `--position-only`"
            );
            return Err(column(tool, what, remedy));
        }
        let at = |t: &Point3<f64>| Pose::of(&Isometry3::translation(t.x, t.y, t.z));
        return Ok(Wanted {
            poses: Some(points.iter().map(|p| p.as_ref().map(at)).collect()),
            oriented: false,
            unused: Vec::new(),
        });
    }
    // The place of a link, or of anything where the table has nothing else, is meant as a target; a recording has those of its bodies.
    let of_robot = |name: &str| matches!(model.place(name), Some(Place::Link(_) | Place::Point(_)));
    if let Some(other) =
        names().find(|n| without_joints || (of_robot(n) && program.poses.contains_key(*n)))
    {
        let known = of_robot(other);
        let what = format!("is not the tool, which is `{tool}`");
        let remedy = match known {
            true => format!("state `--tool {other}`, or leave its columns out"),
            false => format!(
                "name the columns after the tool, `{tool}.x_m` …, or state another with `--tool`"
            ),
        };
        return Err(column(other, what, remedy));
    }
    let known = |name: &str| {
        let of_marker = |body: &ModelBody| {
            let mut markers = body.markers_m.keys();
            markers.any(|marker| name == marker || name.ends_with(&format!(".{marker}")))
        };
        robot.model.place(name).is_some() || robot.file.bodies.values().any(of_marker)
    };
    Ok(Wanted {
        poses: None,
        oriented: true,
        unused: names().filter(|n| !known(n)).cloned().collect(),
    })
}

impl Corrected {
    fn of(absent: &[String], cartesian: bool) -> Self {
        Self {
            csv: String::new(),
            rows: 0,
            reached: 0,
            outside: 0,
            elsewhere: 0,
            nearer: 0,
            refused: 0,
            before_m: [0.0; 2],
            after_m: [0.0; 2],
            known_m: None,
            tool: String::new(),
            absent: absent.to_vec(),
            assumed_temperature_c: None,
            cartesian,
            unused: Vec::new(),
        }
    }

    fn count(&mut self, done: &Command) {
        self.rows += 1;
        self.elsewhere += usize::from(done.elsewhere);
        match done.outcome {
            Outcome::Reached | Outcome::OutOfScope(_) => self.reached += 1,
            Outcome::Nearer => self.nearer += 1,
            _ => self.refused += 1,
        }
        self.outside += usize::from(done.outcome.is_usable() && done.outside.is_some());
        let sums = [
            (&mut self.before_m, done.before.0),
            (&mut self.after_m, done.after.0),
        ];
        for (sum, error) in sums {
            sum[0] += error * error;
            sum[1] = sum[1].max(error);
        }
    }

    fn finish(&mut self) {
        for sum in [&mut self.before_m, &mut self.after_m] {
            sum[0] = (sum[0] / self.rows.max(1) as f64).sqrt();
        }
    }
}

/// Name and decimals of a joint's column: nine in degrees are 2e-11 rad.
fn columns(robot: &Robot) -> impl Iterator<Item = (String, bool)> + '_ {
    robot.model.joints().iter().map(|j| {
        let unit = if j.prismatic { "m" } else { "deg" };
        (joint_column(&j.name, unit), j.prismatic)
    })
}

fn header(csv: &mut Csv, robot: &Robot) {
    let (first, rest) = NOTES.split_at(1);
    first.iter().for_each(|name| csv.cell(name));
    columns(robot).for_each(|(name, _)| csv.cell(&cell(&name)));
    rest.iter().for_each(|name| csv.cell(name));
    csv.end();
}

fn line(csv: &mut Csv, robot: &Robot, done: &Command, oriented: bool) {
    for (q, (_, prismatic)) in done.q.iter().zip(columns(robot)) {
        csv.number(Some(if prismatic { *q } else { q.to_degrees() }), 9);
    }
    let joint = |i: usize| &robot.model.joints()[i].name;
    csv.cell(&match (done.outcome, done.outside) {
        (Outcome::Reached | Outcome::OutOfScope(_), None) => "reached".to_owned(),
        (Outcome::Reached | Outcome::OutOfScope(_), Some(i)) => format!("outside:{}", joint(i)),
        (Outcome::Nearer, None) => "nearer".to_owned(),
        (Outcome::Nearer, Some(i)) => format!("nearer:outside:{}", joint(i)),
        (Outcome::BeyondLimits(i), _) => format!("refused:limits:{}", joint(i)),
        _ => "refused".to_owned(),
    });
    for at in [done.before.0, done.after.0] {
        csv.number(Some(1e3 * at), 6);
    }
    for turned in [done.before.1, done.after.1] {
        csv.number(oriented.then_some(1e3 * turned), 6);
    }
    csv.end();
}

fn lost(csv: &mut Csv, robot: &Robot) {
    columns(robot).for_each(|_| csv.cell(""));
    csv.cell("lost");
    (0..4).for_each(|_| csv.cell(""));
    csv.end();
}
