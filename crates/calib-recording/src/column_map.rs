//! A column map: what the columns of somebody else's table mean. The profile embeds it under a recording.

use crate::euler::EulerAxes;
use crate::units::{AngleUnit, LengthUnit, TimeUnit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Meaning of the columns of a delimited table whose header does not follow our own rules.
///
/// Columns that the map does not mention are read by our own rules when their names follow them, and are
/// otherwise ignored (and listed in the report).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ColumnMap {
    /// Start from a known log and change what else is given: `ur_rtde`, `franka`, `ndi`, `vive`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// What separates the cells; found from the header line when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delimiter: Option<Delimiter>,
    /// Lines above the header line that are not part of the table.
    pub skip_lines: u64,
    /// Column names, for a table without a header line (or with a useless one: count it in `skip_lines`).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// Numbers are written `1,5`.
    pub decimal_comma: bool,
    /// Unit of joint angles, rotation vectors, Euler angles and angles about an axis in the mapped columns; a name that ends in `_deg` says it itself.
    pub angles: AngleUnit,
    /// Unit of rotation vectors, Euler angles and angles about an axis of bodies, where it is another one than that of the joints.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body_angles: Option<AngleUnit>,
    /// Unit of positions and prismatic joints in the mapped columns; a name that ends in `_mm` says it itself.
    pub lengths: LengthUnit,
    /// The column of time, and its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<TimeColumn>,
    /// Revolute joints: joint name → column.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub joints: BTreeMap<String, String>,
    /// Columns that are revolute joints and have the joint's own name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub joint_columns: Vec<String>,
    /// Prismatic joints: joint name → column.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub prismatic: BTreeMap<String, String>,
    /// Joints of this map whose columns count the other way than the URDF's axis: their values are negated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub reversed: Vec<String>,
    /// Joint torques in N·m: joint name → column.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub torques: BTreeMap<String, String>,
    /// Temperatures in °C of the links before joints: joint name, or `robot` for all of them → column.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub temperatures: BTreeMap<String, String>,
    /// Markers: marker name → its x, y and z column.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub markers: BTreeMap<String, [String; 3]>,
    /// Bodies: body name → its position and rotation columns.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub bodies: BTreeMap<String, BodyColumns>,
    /// One row per body or marker and frame, its name in a column.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub long: Option<LongColumns>,
    /// Text columns to keep, e.g. `trial`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub labels: Vec<String>,
    /// Cell texts that mean *lost*, besides an empty cell and `NaN`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<String>,
    /// A marker at exactly (0, 0, 0) is a measured point, not a lost one.
    pub zero_is_a_point: bool,
}

/// What separates cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Delimiter {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// Tab.
    Tab,
    /// Any run of blanks.
    Space,
}

/// The column of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    /// Its name.
    pub column: String,
    /// Its unit.
    #[serde(default)]
    pub unit: TimeUnit,
}

/// Position and rotation columns of a body. Exactly one of the rotations must be given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BodyColumns {
    /// Columns of x, y, z.
    pub position: [String; 3],
    /// Columns of a quaternion, scalar last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[String; 4]>,
    /// Columns of a quaternion, scalar first (NDI).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_wxyz: Option<[String; 4]>,
    /// Columns of a rotation vector (axis times angle).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_vector: Option<[String; 3]>,
    /// Columns of angles about fixed x, y, z: `R = Rz(c)·Ry(b)·Rx(a)`, as URDF's rpy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fixed_xyz: Option<[String; 3]>,
    /// Columns of angles about axes that turn with the body, and which axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub euler: Option<EulerColumns>,
    /// Columns of a rotation matrix, row by row: the body's axes in the tracker's frame are its columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_matrix: Option<[String; 9]>,
    /// Columns of the x, y and z of an axis of length 1, and of the angle about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis_angle: Option<[String; 4]>,
    /// The columns hold the pose of the tracker in the body, as the software of a camera on the robot states where a board is: the inverse is used.
    /// The tracker's noise is that of the pose as it was measured, so of the board in the camera.
    #[serde(skip_serializing_if = "is_false")]
    pub inverted: bool,
}

/// A rotation of a body in the notation of its columns, these in the order of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RotationColumns<'a> {
    /// A quaternion, scalar last.
    QuaternionXyzw(&'a [String; 4]),
    /// A quaternion, scalar first.
    QuaternionWxyz(&'a [String; 4]),
    /// Axis times angle.
    RotationVector(&'a [String; 3]),
    /// Angles about fixed x, y, z.
    FixedXyz(&'a [String; 3]),
    /// Angles about axes that turn with the body.
    Euler(EulerAxes, &'a [String; 3]),
    /// A matrix, row by row.
    Matrix(&'a [String; 9]),
    /// x, y, z of the axis, and the angle.
    AxisAngle(&'a [String; 4]),
}

impl<'a> RotationColumns<'a> {
    /// The columns.
    #[must_use]
    pub fn columns(self) -> &'a [String] {
        match self {
            Self::QuaternionXyzw(four) | Self::QuaternionWxyz(four) | Self::AxisAngle(four) => four,
            Self::RotationVector(three) | Self::FixedXyz(three) | Self::Euler(_, three) => three,
            Self::Matrix(nine) => nine,
        }
    }

    /// Which of the columns are angles; the others have no unit.
    #[must_use]
    pub fn angles(self) -> Range<usize> {
        match self {
            Self::QuaternionXyzw(_) | Self::QuaternionWxyz(_) | Self::Matrix(_) => 0..0,
            Self::RotationVector(_) | Self::FixedXyz(_) | Self::Euler(..) => 0..3,
            Self::AxisAngle(_) => 3..4,
        }
    }

    /// Keys below the body that lead to the columns.
    #[must_use]
    pub fn keys(self) -> &'static [&'static str] {
        match self {
            Self::QuaternionXyzw(_) => &["quaternion_xyzw"],
            Self::QuaternionWxyz(_) => &["quaternion_wxyz"],
            Self::RotationVector(_) => &["rotation_vector"],
            Self::FixedXyz(_) => &["fixed_xyz"],
            Self::Euler(..) => &["euler", "columns"],
            Self::Matrix(_) => &["rotation_matrix"],
            Self::AxisAngle(_) => &["axis_angle"],
        }
    }
}

impl BodyColumns {
    /// All rotations that are given, of which there must be one.
    pub fn rotations(&self) -> impl Iterator<Item = RotationColumns<'_>> {
        use RotationColumns as Of;
        let euler = self.euler.as_ref();
        let all = [
            self.quaternion_xyzw.as_ref().map(Of::QuaternionXyzw),
            self.quaternion_wxyz.as_ref().map(Of::QuaternionWxyz),
            self.rotation_vector.as_ref().map(Of::RotationVector),
            self.fixed_xyz.as_ref().map(Of::FixedXyz),
            euler.map(|euler| Of::Euler(euler.axes, &euler.columns)),
            self.rotation_matrix.as_ref().map(Of::Matrix),
            self.axis_angle.as_ref().map(Of::AxisAngle),
        ];
        all.into_iter().flatten()
    }

    /// All columns of the body, to be renamed.
    pub fn all_mut(&mut self) -> impl Iterator<Item = &mut String> {
        fn of<const N: usize>(columns: &mut Option<[String; N]>) -> &mut [String] {
            columns.as_mut().map_or(&mut [], |columns| columns)
        }
        let euler = self.euler.as_mut().map(|euler| &mut euler.columns);
        let all: [&mut [String]; 8] = [
            &mut self.position,
            of(&mut self.quaternion_xyzw),
            of(&mut self.quaternion_wxyz),
            of(&mut self.rotation_vector),
            of(&mut self.fixed_xyz),
            euler.map_or(&mut [], |columns| columns),
            of(&mut self.rotation_matrix),
            of(&mut self.axis_angle),
        ];
        all.into_iter().flatten()
    }
}

/// Whether a flag has its default.
#[allow(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_false(flag: &bool) -> bool {
    !*flag
}

/// Columns of Euler angles: `zyx` with columns a, b, c is `R = Rz(a)·Ry(b)·Rx(c)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EulerColumns {
    /// The axes in the order of the rotations, each as the rotations before it have left it.
    pub axes: EulerAxes,
    /// Columns of the three angles, in the same order.
    pub columns: [String; 3],
}

/// A table with one row per body or marker and frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LongColumns {
    /// Column with the name of the body or marker.
    pub name: String,
    /// Column with the frame number; rows of one frame stand together.
    pub frame: String,
    /// Columns of x, y, z of a marker.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub marker: Option<[String; 3]>,
    /// Columns of a body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyColumns>,
}

/// Names of the presets.
pub const PRESETS: [&str; 4] = ["ur_rtde", "franka", "ndi", "vive"];

impl ColumnMap {
    /// The map of a known log; `None` when there is no such preset.
    pub fn preset(name: &str) -> Option<ColumnMap> {
        let text = |text: &str| text.to_string();
        match name {
            // record.py of UR's RTDE client: blanks, controller uptime in s, rad.
            "ur_rtde" => Some(ColumnMap {
                delimiter: Some(Delimiter::Space),
                time: Some(TimeColumn {
                    column: text("timestamp"),
                    unit: TimeUnit::S,
                }),
                joints: [
                    "shoulder_pan",
                    "shoulder_lift",
                    "elbow",
                    "wrist_1",
                    "wrist_2",
                    "wrist_3",
                ]
                .iter()
                .enumerate()
                .map(|(i, joint)| (format!("{joint}_joint"), format!("actual_q_{i}")))
                .collect(),
                ..ColumnMap::default()
            }),
            // libfranka's logToCSV: integer ms, rad, N·m.
            "franka" => Some(ColumnMap {
                delimiter: Some(Delimiter::Comma),
                time: Some(TimeColumn {
                    column: text("time"),
                    unit: TimeUnit::Ms,
                }),
                joints: (0..7)
                    .map(|i| (format!("panda_joint{}", i + 1), format!("state.q[{i}]")))
                    .collect(),
                ..ColumnMap::default()
            }),
            // NDI combined API sample: one row per tool, scalar first, mm, `Missing`.
            "ndi" => Some(ColumnMap {
                delimiter: Some(Delimiter::Comma),
                lengths: LengthUnit::Mm,
                lost: vec![text("Missing")],
                long: Some(LongColumns {
                    name: text("ToolHandle"),
                    frame: text("Frame#"),
                    marker: None,
                    body: Some(BodyColumns {
                        position: [text("tx"), text("ty"), text("tz")],
                        quaternion_wxyz: Some([text("q0"), text("qx"), text("qy"), text("qz")]),
                        ..BodyColumns::default()
                    }),
                }),
                ..ColumnMap::default()
            }),
            // OpenVR samples as `x,y,z,A,B,C,button,T,delta`: mm, rad, epoch ms. The order of A, B, C is not
            // documented; fixed x-y-z is an assumption and the reader says so.
            "vive" => Some(ColumnMap {
                delimiter: Some(Delimiter::Comma),
                lengths: LengthUnit::Mm,
                time: Some(TimeColumn {
                    column: text("T"),
                    unit: TimeUnit::Ms,
                }),
                bodies: BTreeMap::from([(
                    text("controller"),
                    BodyColumns {
                        position: [text("x"), text("y"), text("z")],
                        fixed_xyz: Some([text("A"), text("B"), text("C")]),
                        ..BodyColumns::default()
                    },
                )]),
                ..ColumnMap::default()
            }),
            _ => None,
        }
    }

    /// Whether the map says what the columns are or how the table is laid out; a map that does not leaves a file its own format.
    #[must_use]
    pub fn describes_columns(&self) -> bool {
        let without = ColumnMap {
            decimal_comma: false,
            angles: AngleUnit::default(),
            body_angles: None,
            lengths: LengthUnit::default(),
            labels: Vec::new(),
            lost: Vec::new(),
            zero_is_a_point: false,
            ..self.clone()
        };
        without != ColumnMap::default()
    }

    /// The bodies whose columns hold the pose of the tracker in the body.
    #[must_use]
    pub fn inverse_bodies(&self) -> BTreeSet<String> {
        let resolved = self.resolved().unwrap_or_default();
        let inverse = resolved.bodies.into_iter().filter(|(_, of)| of.inverted);
        inverse.map(|(name, _)| name).collect()
    }

    /// This map on top of its preset: what is given here wins, maps of the preset are replaced as a whole.
    /// `None` when the preset does not exist.
    pub fn resolved(&self) -> Option<ColumnMap> {
        let Some(name) = &self.preset else {
            return Some(self.clone());
        };
        let base = ColumnMap::preset(name)?;
        let default = ColumnMap::default();
        fn or<T: PartialEq + Clone>(given: &T, default: &T, base: &T) -> T {
            if given == default {
                base.clone()
            } else {
                given.clone()
            }
        }
        Some(ColumnMap {
            preset: None,
            delimiter: self.delimiter.or(base.delimiter),
            skip_lines: or(&self.skip_lines, &default.skip_lines, &base.skip_lines),
            names: or(&self.names, &default.names, &base.names),
            decimal_comma: self.decimal_comma || base.decimal_comma,
            angles: or(&self.angles, &default.angles, &base.angles),
            body_angles: self.body_angles.or(base.body_angles),
            lengths: or(&self.lengths, &default.lengths, &base.lengths),
            time: self.time.clone().or(base.time),
            joints: or(&self.joints, &default.joints, &base.joints),
            joint_columns: or(
                &self.joint_columns,
                &default.joint_columns,
                &base.joint_columns,
            ),
            prismatic: or(&self.prismatic, &default.prismatic, &base.prismatic),
            reversed: or(&self.reversed, &default.reversed, &base.reversed),
            torques: or(&self.torques, &default.torques, &base.torques),
            temperatures: or(
                &self.temperatures,
                &default.temperatures,
                &base.temperatures,
            ),
            markers: or(&self.markers, &default.markers, &base.markers),
            bodies: or(&self.bodies, &default.bodies, &base.bodies),
            long: self.long.clone().or(base.long),
            labels: or(&self.labels, &default.labels, &base.labels),
            lost: or(&self.lost, &default.lost, &base.lost),
            zero_is_a_point: self.zero_is_a_point || base.zero_is_a_point,
        })
    }
}
