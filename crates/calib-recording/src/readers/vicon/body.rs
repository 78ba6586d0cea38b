//! A body of a Vicon file and its pose in each row.

use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::BodyStream;
use crate::readers::common::{Triplet, pose, triplet, unexpected};
use crate::rotation::quaternion;
use nalgebra::{UnitQuaternion, Vector3};

/// A body that is being read.
pub(super) struct Body {
    pub stream: BodyStream,
    pub position: [usize; 3],
    pub rotation: Vec<usize>,
    pub units_per_meter: f64,
    pub units_per_radian: f64,
    pub zeros: Vec<u64>,
}

/// Takes this row's pose.
pub(super) fn read_body(body: &mut Body, line: u64, row: u64, values: &[f64]) -> Placed<()> {
    let name = body.stream.name.clone();
    let position = triplet(
        line,
        &name,
        body.position.map(|i| values[i]),
        body.units_per_meter,
    )?;
    let parts: Vec<f64> = body
        .rotation
        .iter()
        .filter_map(|&i| values.get(i).copied())
        .collect();
    let given = parts.iter().filter(|value| !value.is_nan()).count();
    let point = match position {
        Triplet::Lost if given == 0 => {
            push(&mut body.stream.tracker_from_body, None);
            return Ok(());
        }
        Triplet::Zero if given == 0 || parts.iter().all(|&value| value == 0.0) => {
            body.zeros.push(row);
            push(&mut body.stream.tracker_from_body, None);
            return Ok(());
        }
        Triplet::Zero => nalgebra::Point3::origin(),
        Triplet::Point(point) if given == parts.len() => point,
        Triplet::Lost | Triplet::Point(_) => {
            let (given, needed) = (
                given
                    + if matches!(position, Triplet::Lost) {
                        0
                    } else {
                        3
                    },
                parts.len() + 3,
            );
            return Err((
                At::Line(line),
                Problem::PartlyLost {
                    entity: "body",
                    name,
                    given,
                    needed,
                },
            ));
        }
    };
    let scaled: Vec<f64> = parts
        .iter()
        .map(|value| value / body.units_per_radian)
        .collect();
    let rotation = match (scaled.as_slice(), body.rotation.len()) {
        ([_, _, _, _], _) => quaternion(
            At::Line(line),
            &name,
            [parts[0], parts[1], parts[2], parts[3]],
        )?,
        // R = Rx(a)·Ry(b)·Rz(c): turns about the moving axes x, y, z.
        ([a, b, c], 5) => {
            let turn = |axis: Vector3<f64>| UnitQuaternion::from_scaled_axis(axis);
            turn(Vector3::x() * *a) * turn(Vector3::y() * *b) * turn(Vector3::z() * *c)
        }
        ([a, b, c], _) => UnitQuaternion::from_scaled_axis(Vector3::new(*a, *b, *c)),
        _ => return unexpected(line, "", "three or four rotation columns"),
    };
    push(
        &mut body.stream.tracker_from_body,
        Some(pose(point, rotation)),
    );
    Ok(())
}
