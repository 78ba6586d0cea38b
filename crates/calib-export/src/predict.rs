//! `calib predict`: where everything is, and how certain that is.

use std::collections::BTreeSet;
use std::path::Path;

use calib_finding::cell;
use calib_model::{Approach, ModelError, Place, Scope, Under};
use nalgebra::{Matrix3, Matrix6};

use crate::error::ExportError;
use crate::read::Robot;
use crate::table::{Csv, Program, WrittenLike, program};

/// The frame that poses are given in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Frame {
    /// The robot's root link.
    #[default]
    Root,
    /// The tracker.
    Tracker,
}

/// What is predicted, and under which circumstances.
#[derive(Debug, Clone, Default)]
pub struct PredictOptions {
    /// Links, bodies or points; empty: all bodies and points, or the last link where there are none.
    pub of: Vec<String>,
    /// The frame that poses are given in.
    pub frame: Frame,
    /// Rows are no sequence: every joint stands in the middle of its backlash.
    pub unordered: bool,
    /// The torques of the table load the joints, in place of gravity.
    pub torques: bool,
    /// How the table is written.
    pub like: WrittenLike,
}

/// Predicted poses.
#[derive(Debug, Clone)]
pub struct Predicted {
    /// CSV: one row for each row of the table, with its line; empty cells where a joint was lost, and for σ where it is not known.
    pub csv: String,
    /// Rows that were predicted.
    pub rows: usize,
    /// Of them, outside of the fitted range or of the limits.
    pub outside: usize,
    /// Joints that the table has no column for: they counted as 0.
    pub absent: Vec<String>,
    /// Joints that no recording moved and that stand elsewhere in some rows: without σ there.
    pub not_covered: Vec<String>,
    /// Temperature that was assumed, °C, because the table has none and lengths follow it.
    pub assumed_temperature_c: Option<f64>,
    /// Names that were asked for, or would have been given, that a link and a body or point have: the link's, and the other's here.
    pub renamed: Vec<(String, String)>,
}

/// Predicts the poses of a table of joint positions.
///
/// # Errors
/// [`ExportError`].
pub fn predict(
    robot: &Robot,
    table: &Path,
    options: &PredictOptions,
) -> Result<Predicted, ExportError> {
    let program = program(table, robot, &options.like)?;
    if options.torques && program.held.is_empty() {
        return Err(ExportError::Column {
            file: program.file,
            found: "the table".to_owned(),
            what: "has no column of a torque".to_owned(),
            remedy: "leave `--torques` out: gravity loads the joints then".to_owned(),
        });
    }
    let places = places(robot, &options.of)?;
    let mut csv = Csv::default();
    header(&mut csv, &places, robot.model.has_uncertainty());
    let mut out = Predicted {
        csv: String::new(),
        rows: 0,
        outside: 0,
        absent: program.absent.clone(),
        assumed_temperature_c: program.assumed_temperature_c(&robot.model),
        renamed: renamed(robot, &places),
        not_covered: Vec::new(),
    };
    let mut rows = Rows {
        robot,
        options,
        program: &program,
        approach: Approach::new(&robot.model),
        work: robot.model.work(),
        not_covered: BTreeSet::new(),
    };
    for k in 0..program.q.len() {
        let wrong = |source: ModelError| ExportError::Row {
            file: program.file.clone(),
            line: program.lines[k],
            source: Box::new(source),
        };
        let scope = rows.row(k, &places, &mut csv).map_err(wrong)?;
        out.rows += usize::from(scope.is_some());
        out.outside += usize::from(scope.is_some_and(|s| s != Scope::Inside));
    }
    let name = |joint: &usize| robot.model.joints()[*joint].name.clone();
    out.not_covered = rows.not_covered.iter().map(name).collect();
    out.csv = csv.text();
    Ok(out)
}

fn places(robot: &Robot, of: &[String]) -> Result<Vec<(String, Place)>, ExportError> {
    let model = &robot.model;
    let named: Vec<String> = match of {
        [] => model
            .bodies()
            .chain(model.points())
            .map(str::to_owned)
            .collect(),
        of => of.to_vec(),
    };
    if named.is_empty() {
        let last = model.last_link();
        return Ok(vec![(model.links()[last.index()].clone(), last.into())]);
    }
    named
        .into_iter()
        .map(|name| robot.place(&name).map(|place| (name, place)))
        .collect()
}

/// Of the names that a link and a body or point have, those that say what a column is.
fn renamed(robot: &Robot, places: &[(String, Place)]) -> Vec<(String, String)> {
    let given = |name: &String| places.iter().any(|(place, _)| place == name);
    let renamed = robot.model.renamed().iter();
    let said = renamed.filter(|(link, own)| given(link) || given(own));
    said.cloned().collect()
}

/// Endings of the columns of a pose and of its σ: the axes of the frame that it is given in.
const POSE: [&str; 7] = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"];
const SIGMA: [&str; 6] = [
    "sigma_x_m",
    "sigma_y_m",
    "sigma_z_m",
    "sigma_rx_rad",
    "sigma_ry_rad",
    "sigma_rz_rad",
];

fn header(csv: &mut Csv, places: &[(String, Place)], sigma: bool) {
    csv.cell("line");
    csv.cell("scope");
    for (name, _) in places {
        let endings = POSE.iter().chain(SIGMA.iter().filter(|_| sigma));
        endings.for_each(|ending| csv.cell(&cell(&format!("{name}.{ending}"))));
    }
    csv.end();
}

/// Rows one after the other.
struct Rows<'a> {
    robot: &'a Robot,
    options: &'a PredictOptions,
    program: &'a Program,
    approach: Approach,
    work: calib_model::Work,
    not_covered: BTreeSet<usize>,
}

impl Rows<'_> {
    /// One line; `None` where a joint of the row was lost.
    fn row(
        &mut self,
        k: usize,
        places: &[(String, Place)],
        csv: &mut Csv,
    ) -> Result<Option<Scope>, ModelError> {
        let robot = self.robot;
        let model = &robot.model;
        let sigma = model.has_uncertainty();
        csv.cell(&self.program.lines[k].to_string());
        let held = match (self.options.torques, self.program.held.get(k)) {
            (true, Some(held)) => Some(held.as_deref()),
            _ => None,
        };
        // A lost torque loses the row where torques are wanted.
        let (Some(q), false) = (&self.program.q[k], held == Some(None)) else {
            csv.cell("lost");
            let cells = places.len() * (POSE.len() + if sigma { SIGMA.len() } else { 0 });
            (0..cells).for_each(|_| csv.cell(""));
            csv.end();
            return Ok(None);
        };
        if !self.options.unordered {
            self.approach.update(model, q)?;
        }
        let scope = model.scope(q)?;
        let joint = |i: usize| &model.joints()[i].name;
        csv.cell(&match scope {
            Scope::Inside => "inside".to_owned(),
            Scope::Outside(i) => format!("outside:{}", joint(i)),
            Scope::BeyondLimits(i) => format!("limits:{}", joint(i)),
        });
        let under = Under {
            approach: self.approach.directions(),
            held: held.flatten(),
            temperature_c: self.program.temperature_c(k),
        };
        for (_, place) in places {
            let tracker = self.options.frame == Frame::Tracker;
            let covariance = match (sigma, tracker) {
                (false, _) => None,
                (true, false) => Some(model.sigma(q, *place, &under, &mut self.work)?),
                (true, true) => Some(model.sigma_in_tracker(q, *place, &under, &mut self.work)?),
            };
            model.forward(q, &under, &mut self.work)?;
            let pose = match tracker {
                false => model.root_from(*place, &self.work)?,
                true => model.tracker_from(*place, &self.work)?,
            };
            pose.t.iter().for_each(|x| csv.number(Some(*x), 9));
            let turn = pose.isometry().rotation.coords;
            turn.iter().for_each(|x| csv.number(Some(*x), 12));
            let Some(covariance) = covariance else {
                continue;
            };
            match model.not_covered(q, *place)? {
                // What the axis of such a joint does there is in no covariance.
                Some(joint) => {
                    self.not_covered.insert(joint);
                    SIGMA.iter().for_each(|_| csv.cell(""));
                }
                None => {
                    let sigmas = sigmas(&covariance, &pose.r);
                    sigmas.iter().for_each(|x| csv.cell(&format!("{x:.3e}")));
                }
            }
        }
        csv.end();
        Ok(Some(scope))
    }
}

/// σ of position and rotation along the axes of the frame that the pose is given in.
fn sigmas(covariance: &Matrix6<f64>, r: &Matrix3<f64>) -> [f64; 6] {
    let block = |at: usize| -> Matrix3<f64> {
        let own: Matrix3<f64> = covariance.fixed_view::<3, 3>(at, at).into();
        r * own * r.transpose()
    };
    let (turn, place) = (block(0), block(3));
    let root = |m: &Matrix3<f64>, k: usize| m[(k, k)].max(0.0).sqrt();
    std::array::from_fn(|k| {
        if k < 3 {
            root(&place, k)
        } else {
            root(&turn, k - 3)
        }
    })
}
