//! `calib correct`: the program that brings the tool to where the nominal model has it.

use std::path::Path;

use calib_finding::cell;
use calib_model::{Aim, Approach, Correction, ModelError, Options, Outcome, Pose, Under};
use calib_recording::joint_column;

use crate::error::ExportError;
use crate::read::Robot;
use crate::starts::{LEVER, Starts};
use crate::table::{Csv, NOTES, program};

/// Rows at which it is asked how well the model knows where the tool stands.
const KNOWN_AT: usize = 200;

/// What is corrected.
#[derive(Debug, Clone, Default)]
pub struct CorrectOptions {
    /// The link or point that is to be right; `None`: the last link.
    pub tool: Option<String>,
    /// Only its position.
    pub position_only: bool,
    /// Bound on the change of a joint, rad and m; `None`: that of [`Options::default`].
    pub largest_rad: Option<f64>,
    /// The same of sliding joints.
    pub largest_m: Option<f64>,
}

/// A corrected program.
#[derive(Debug, Clone)]
pub struct Corrected {
    /// CSV: the joints of the robot, what became of each row, and the tool's error by the model before and after, mm.
    pub csv: String,
    /// Rows with a position.
    pub rows: usize,
    /// Rows whose tool stands where it is wanted.
    pub reached: usize,
    /// Of them, outside of the fitted range.
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
}

/// Corrects a table of joint positions. Where the table has poses of the tool (`<tool>.x_m` …, in the root's frame), the commands
/// reach those, from the row's joints or, where it has none, from the row before, else from postures all over the fitted range.
///
/// # Errors
/// [`ExportError`].
pub fn correct(
    robot: &Robot,
    table: &Path,
    options: &CorrectOptions,
) -> Result<Corrected, ExportError> {
    let model = &robot.model;
    let program = program(table, model)?;
    let tool = robot.tool(options.tool.as_deref())?;
    let last = &model.links()[model.last_link().index()];
    let wanted = program.poses.get(options.tool.as_ref().unwrap_or(last));
    let without_joints = program.absent.len() == model.joints().len();
    let (mut work, mut approach) = (model.work(), Approach::new(model));
    let mut out = Corrected::of(&program.absent, wanted.is_some());
    out.tool.clone_from(options.tool.as_ref().unwrap_or(last));
    let every = program.q.len().div_ceil(KNOWN_AT);
    let (mut variances, mut starts) = (Vec::new(), None);
    out.assumed_temperature_c = program.assumed_temperature_c(model);
    let mut csv = Csv::default();
    header(&mut csv, robot);
    let mut command = vec![0.0; model.joints().len()];
    for (k, q) in program.q.iter().enumerate() {
        let wrong = |source: ModelError| ExportError::Row {
            file: program.file.clone(),
            line: program.lines[k],
            source: Box::new(source),
        };
        let target: Option<Option<&Pose>> = wanted.map(|poses| poses[k].as_ref());
        csv.cell(&program.lines[k].to_string());
        let (Some(q), false) = (q, target == Some(None)) else {
            lost(&mut csv, robot);
            continue;
        };
        let seed = if without_joints {
            command.clone()
        } else {
            q.clone()
        };
        approach.update(model, &seed).map_err(wrong)?;
        let under = Under {
            approach: approach.directions(),
            held: None,
            temperature_c: program.temperature_c(k),
        };
        let done = match target.flatten() {
            None => {
                let with = options.within(Options::default());
                model.correct(&seed, tool, &with, &under, &mut work, &mut command)
            }
            Some(pose) => {
                let with = options.within(Options::inverse());
                let out = (&mut work, &mut command[..]);
                model.ik(pose, &seed, tool, &with, &under, out)
            }
        };
        let mut done = done.map_err(wrong)?;
        // Who states how far a joint may go wants no other posture.
        let free = without_joints && options.largest_rad.is_none() && options.largest_m.is_none();
        if let Some(pose) = target.flatten().filter(|_| free && !is_there(&done)) {
            let known = match starts.take() {
                Some(known) => known,
                None => Starts::of(model, tool, &mut work).map_err(wrong)?,
            };
            let near = known.near(pose, options.within(Options::inverse()).aim);
            let from = |start: &[f64], other: &mut [f64]| {
                let with = options.within(Options::inverse());
                model.ik(pose, start, tool, &with, &under, (&mut work, other))
            };
            let is_other = nearest(&near, from, (&mut done, &mut command));
            out.elsewhere += usize::from(is_other.map_err(wrong)?);
            starts = Some(known);
            // From none of them the tool came there: where it ended says nothing of the pose.
            if matches!(done.outcome, Outcome::Nearer) && is_elsewhere(&done) {
                command.copy_from_slice(&seed);
                (done.after_m, done.after_rad) = (done.before_m, done.before_rad);
                done.outcome = Outcome::NotReached;
            }
        }
        out.count(&done);
        if k % every == 0 && model.has_uncertainty() {
            let sigma = model.sigma(&command, tool, &under, &mut work);
            let position = sigma.map_err(wrong)?.fixed_view::<3, 3>(3, 3).trace();
            variances.push(position);
        }
        line(&mut csv, robot, &command, &done);
    }
    let mean = variances.iter().sum::<f64>() / variances.len().max(1) as f64;
    out.known_m = (!variances.is_empty()).then(|| mean.sqrt());
    out.finish();
    out.csv = csv.text();
    Ok(out)
}

fn is_there(done: &Correction) -> bool {
    matches!(done.outcome, Outcome::Reached | Outcome::OutOfScope(_))
}

/// Replaces the command by the one that ends nearest to the pose, from these starts; whether it did and the tool is there, or nearly.
fn nearest<F>(
    starts: &[&[f64]],
    mut from: F,
    (done, command): (&mut Correction, &mut Vec<f64>),
) -> Result<bool, ModelError>
where
    F: FnMut(&[f64], &mut [f64]) -> Result<Correction, ModelError>,
{
    let mut other = command.clone();
    let mut replaced = false;
    for start in starts {
        let tried = from(start, &mut other)?;
        // A pose that the real robot just misses, its arm stretched, is reached from nowhere: the nearest counts.
        let nearer = tried.outcome == Outcome::Nearer && away(&tried) < away(done);
        if is_there(&tried) || nearer {
            command.copy_from_slice(&other);
            replaced = true;
            *done = tried;
        }
        if is_there(done) {
            break;
        }
    }
    Ok(replaced && !is_elsewhere(done))
}

/// How far the tool is from its pose, m: a rotation by 1 rad counts as by [`LEVER`].
fn away(done: &Correction) -> f64 {
    done.after_m + LEVER * done.after_rad
}

/// A tool that is further from a pose than this is nowhere near it, m and rad (1°).
const NEAR: (f64, f64) = (5e-3, 0.0175);

fn is_elsewhere(done: &Correction) -> bool {
    done.after_m > NEAR.0 || done.after_rad > NEAR.1
}

impl CorrectOptions {
    fn within(&self, default: Options) -> Options {
        Options {
            aim: match self.position_only {
                true => Aim::Position,
                false => default.aim,
            },
            largest_rad: self.largest_rad.unwrap_or(default.largest_rad),
            largest_m: self.largest_m.unwrap_or(default.largest_m),
            ..default
        }
    }
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
        }
    }

    fn count(&mut self, done: &Correction) {
        self.rows += 1;
        match done.outcome {
            Outcome::Reached => self.reached += 1,
            Outcome::OutOfScope(_) => {
                self.reached += 1;
                self.outside += 1;
            }
            Outcome::Nearer => self.nearer += 1,
            _ => self.refused += 1,
        }
        let sums = [
            (&mut self.before_m, done.before_m),
            (&mut self.after_m, done.after_m),
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

fn line(csv: &mut Csv, robot: &Robot, command: &[f64], done: &Correction) {
    for (q, (_, prismatic)) in command.iter().zip(columns(robot)) {
        csv.number(Some(if prismatic { *q } else { q.to_degrees() }), 9);
    }
    let joint = |i: usize| &robot.model.joints()[i].name;
    csv.cell(&match done.outcome {
        Outcome::Reached => "reached".to_owned(),
        Outcome::OutOfScope(i) => format!("outside:{}", joint(i)),
        Outcome::Nearer => "nearer".to_owned(),
        Outcome::BeyondLimits(i) => format!("refused:limits:{}", joint(i)),
        _ => "refused".to_owned(),
    });
    let errors = [done.before_m, done.after_m, done.before_rad, done.after_rad];
    errors.iter().for_each(|x| csv.number(Some(1e3 * x), 6));
    csv.end();
}

fn lost(csv: &mut Csv, robot: &Robot) {
    columns(robot).for_each(|_| csv.cell(""));
    csv.cell("lost");
    (0..4).for_each(|_| csv.cell(""));
    csv.end();
}
