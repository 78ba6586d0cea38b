//! Poses that are written otherwise than their columns' names say: the column map lists quaternions in the order of the file, or says that poses
//! are inverted.

use calib_checks::structural::PoseMistake;
use calib_recording::{BodyColumns, ColumnMap};
use calib_urdf::RobotModel;

use crate::columns;
use crate::header::header;
use crate::source::Source;

/// The map with the poses of these bodies, by their names in the profile, as the file has them; `None` where their columns are not found, or no map
/// says it.
pub fn as_written(
    model: &RobotModel,
    source: &Source,
    bodies: &[&String],
    mistake: PoseMistake,
) -> Option<ColumnMap> {
    let mut map = source.columns.clone().unwrap_or_default();
    let alone = source.recording.bodies.len() == 1;
    for body in bodies {
        let name = source.name_in_file(body);
        let mut columns = match map.bodies.get(name) {
            Some(columns) => columns.clone(),
            // By the readers' own rules; a header that is not read any more has other names.
            None if map.names.is_empty() => of_header(model, source, name, alone)?,
            None => return None,
        };
        swap(&mut columns, mistake)?;
        map.bodies.insert(name.to_owned(), columns);
    }
    Some(map)
}

/// The columns of a body of the file; `alone`: the only one, which may have no name.
fn of_header(model: &RobotModel, source: &Source, name: &str, alone: bool) -> Option<BodyColumns> {
    let mut bodies = columns::guess(model, &header(&source.file.bytes)?)
        .map
        .bodies;
    if let Some(columns) = bodies.remove(name) {
        return Some(columns);
    }
    let (_, columns) = bodies.pop_first()?;
    (alone && bodies.is_empty()).then_some(columns)
}

/// The same columns, as the file has them.
fn swap(columns: &mut BodyColumns, mistake: PoseMistake) -> Option<()> {
    match mistake {
        PoseMistake::ScalarFirstReadAsLast => {
            columns.quaternion_wxyz = Some(columns.quaternion_xyzw.take()?);
        }
        PoseMistake::ScalarLastReadAsFirst => {
            columns.quaternion_xyzw = Some(columns.quaternion_wxyz.take()?);
        }
        PoseMistake::Inverse => columns.inverted = !columns.inverted,
        // The file writes the matrix column by column.
        PoseMistake::Transposed => {
            let [a, b, c, d, e, f, g, h, i] = columns.rotation_matrix.take()?;
            columns.rotation_matrix = Some([a, d, g, b, e, h, c, f, i]);
        }
    }
    Some(())
}
