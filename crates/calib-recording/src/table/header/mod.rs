//! What the columns of a table mean: by a column map for the columns it names ([`mapped`]), and by our own naming rules
//! for the others ([`naming`], [`rules`]).

mod mapped;
mod naming;
mod rules;
mod units;

pub(crate) use naming::{JOINT, is_canonical, is_text_column, length_unit, reads_as_joint};

use crate::column_map::ColumnMap;
use crate::error::{At, Placed, Problem};
use crate::euler::EulerAxes;
use crate::model::JointUnit;
use crate::table::stated_unit::{StatedUnit, UnitRow};
use crate::units::TimeUnit;
use std::collections::BTreeMap;
use std::ops::Range;

/// What is known of the robot beside a table.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Known<'a> {
    /// Names of its joints.
    pub joints: &'a [String],
    /// Whether the table is its own log.
    pub of_robot: bool,
    /// The columns that begin with a word, where those that no rule knows are remarks.
    pub remarks: Option<&'a [bool]>,
}

impl Known<'_> {
    /// Whether a column is somebody's remark, if no rule knows it.
    pub(super) fn is_remark(&self, column: usize) -> bool {
        let words = self.remarks.and_then(|words| words.get(column));
        words == Some(&true)
    }
}

/// Meaning of one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Column {
    Ignore,
    /// Number into this slot, divided by this: units of the column in the SI unit.
    Number {
        slot: usize,
        scale: f64,
    },
    /// Text into this label.
    Label(usize),
    /// State of this marker.
    State(usize),
    /// Name of the row's entity (long tables).
    Entity,
    /// Name of the row's pose (long tables of static poses).
    Pose,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SlotKind {
    Time,
    Counter,
    Robot,
    Tracker,
}

#[derive(Clone, Debug)]
pub(super) struct Slot {
    pub kind: SlotKind,
    pub column: usize,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Rotation {
    /// Slots of x, y, z, w.
    Quaternion([usize; 4]),
    Vector([usize; 3]),
    FixedXyz([usize; 3]),
    Euler(EulerAxes, [usize; 3]),
    /// Slots of a matrix, row by row.
    Matrix([usize; 9]),
    /// Slots of x, y, z of the axis, and of the angle.
    AxisAngle([usize; 4]),
}

impl Rotation {
    pub(super) fn slots(&self) -> &[usize] {
        match self {
            Rotation::Quaternion(slots) | Rotation::AxisAngle(slots) => slots,
            Rotation::Vector(slots) | Rotation::FixedXyz(slots) | Rotation::Euler(_, slots) => {
                slots
            }
            Rotation::Matrix(slots) => slots,
        }
    }

    /// Which of the slots are angles; the others have no unit.
    pub(super) fn angles(&self) -> Range<usize> {
        match self {
            Rotation::Quaternion(_) | Rotation::Matrix(_) => 0..0,
            Rotation::Vector(_) | Rotation::FixedXyz(_) | Rotation::Euler(..) => 0..3,
            Rotation::AxisAngle(_) => 3..4,
        }
    }
}

pub(super) struct MarkerPlan {
    pub name: String,
    pub slots: [usize; 3],
}

pub(super) struct BodyPlan {
    pub name: String,
    pub position: [usize; 3],
    pub rotation: Rotation,
    /// The numbers are the pose of the tracker in the body.
    pub inverted: bool,
}

#[derive(Default)]
pub(super) struct Layout {
    pub names: Vec<String>,
    pub columns: Vec<Column>,
    pub slots: Vec<Slot>,
    pub time: Option<usize>,
    /// The clock of the computer that recorded, s.
    pub received: Option<usize>,
    pub counter: Option<usize>,
    pub joints: Vec<(String, JointUnit, usize)>,
    pub torques: Vec<(String, usize)>,
    pub temperatures: Vec<(String, usize)>,
    pub markers: Vec<MarkerPlan>,
    pub bodies: Vec<BodyPlan>,
    pub labels: Vec<String>,
    /// Long table: column of the entity's name; the only marker or body plan is its template.
    pub entity: Option<usize>,
    /// Long table of static poses: column of the pose's name.
    pub pose: Option<usize>,
    pub conversions: Vec<String>,
}

impl Layout {
    /// Reads the header, and the row of units below it. `dates`: the columns that hold dates, as far as they are known.
    pub(super) fn new(
        line: u64,
        names: Vec<String>,
        (units, dates): (Option<&UnitRow>, &[bool]),
        (map, known): (Option<&ColumnMap>, Known<'_>),
    ) -> Placed<Layout> {
        let at = || At::Line(line);
        check_unique(&names).map_err(|problem| (at(), problem))?;
        let mut layout = Layout {
            columns: vec![Column::Ignore; names.len()],
            names,
            ..Layout::default()
        };
        let mut mapped = vec![false; layout.names.len()];
        if let Some(map) = map {
            mapped::apply(&mut layout, map, &mut mapped).map_err(|problem| (at(), problem))?;
        }
        // A date is a time in seconds, whatever stands in the row of units.
        let date = |i: usize| dates.get(i) == Some(&true);
        let stated = |i: usize| match date(i) {
            true => Some(StatedUnit::Time(TimeUnit::S)),
            false => units.and_then(|row| row.units[i]),
        };
        layout
            .by_rules(&mapped, map.is_some(), stated, known)
            .map_err(|problem| (at(), problem))?;
        if let Some(row) = units {
            layout.take_units(row, map)?;
        }
        layout.name_poses();
        Ok(layout)
    }

    fn slot(&mut self, column: usize, kind: SlotKind, scale: f64) -> usize {
        self.slots.push(Slot { kind, column });
        let slot = self.slots.len() - 1;
        self.columns[column] = Column::Number { slot, scale };
        slot
    }

    /// In a long table of static poses the counter is the pose's name: any text, in any order.
    fn name_poses(&mut self) {
        let of_poses = self.entity.is_some() && !self.joints.is_empty() && self.time.is_none();
        if let Some(counter) = self.counter.filter(|_| of_poses) {
            let column = self.slots[counter].column;
            self.columns[column] = Column::Pose;
            self.pose = Some(column);
        }
    }

    /// A joint twice (`a_rad` and `a_deg`), or a long table with other columns than it can carry.
    fn check_names(&self) -> Result<(), Problem> {
        let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
        for (name, _, slot) in &self.joints {
            let column = self.slots[*slot].column;
            if let Some(first) = seen.insert(name, column) {
                return Err(Problem::DuplicateColumn {
                    name: name.clone(),
                    first: first + 1,
                    second: column + 1,
                });
            }
        }
        if self.entity.is_some() {
            let only_template = self.markers.len() + self.bodies.len() == 1
                && self.markers.iter().all(|m| m.name.is_empty())
                && self.bodies.iter().all(|b| b.name.is_empty());
            if !only_template {
                return Err(Problem::Misfit {
                    found: "a `marker`, `point` or `body` column stands beside named markers or bodies".to_string(),
                    expected: "a long table `pose,<joint>_deg,point,x_m,y_m,z_m` or `frame,body,x_m,y_m,z_m,qx,qy,qz,qw`".to_string(),
                });
            }
            if self.counter.is_none() && self.time.is_none() {
                return Err(Problem::MissingColumn {
                    what: "a long table".to_string(),
                    column: "frame".to_string(),
                    nearest: None,
                });
            }
        }
        Ok(())
    }
}

/// No column name occurs twice; columns may be without name.
fn check_unique(names: &[String]) -> Result<(), Problem> {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            continue;
        }
        if let Some(first) = seen.insert(name, i) {
            return Err(Problem::DuplicateColumn {
                name: name.clone(),
                first: first + 1,
                second: i + 1,
            });
        }
    }
    Ok(())
}
