//! The table of readers: what a file can be, how it is recognized, how it is read.

mod c3d;
mod canonical;
mod common;
mod dtrack;
mod motive;
mod qualisys;
mod ros;
mod trc;
mod vicon;

use crate::column_map::ColumnMap;
use crate::encoding::{is_utf16, utf8};
use crate::error::{At, Error, Placed, Problem, in_file};
use crate::model::Recording;
use calib_finding::nearest_word;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes of a file that a reader sees when it says whether it can read it.
pub const HEAD_BYTES: usize = 16 << 10;

/// A file being read: any place in it can be reached.
pub trait Input: Read + Seek {}
impl<T: Read + Seek> Input for T {}

/// How to read.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Id of the reader; found from the content when `None`.
    pub format: Option<String>,
    /// Meaning of the columns of a table that is not ours; then the reader is the table reader, unless the map describes no columns.
    pub columns: Option<ColumnMap>,
    /// The axis that points up, for formats that do not say (`+Y`); recorded, nothing is turned.
    pub up_axis: Option<String>,
    /// What three rotation columns mean, where a file leaves it open (Vicon objects).
    pub rotation: Option<RotationForm>,
    /// Names of the robot's joints, where they are known: columns of a table that read as coordinates by their names alone (`x_mm` of a gantry) are theirs.
    pub joints: Vec<String>,
    /// The robot's own log: a table of three coordinates without a name is one of joints of these names, and of no marker.
    pub of_robot: bool,
    /// Columns that no rule knows and that begin with a word are somebody's remarks, and are left out.
    pub remarks: bool,
    /// Files above this size are refused, bytes.
    pub max_bytes: u64,
}

impl Default for ReadOptions {
    /// Found from the content, at most 8 GiB.
    fn default() -> Self {
        ReadOptions {
            format: None,
            columns: None,
            up_axis: None,
            rotation: None,
            joints: Vec::new(),
            of_robot: false,
            remarks: false,
            max_bytes: 8 << 30,
        }
    }
}

/// What rotation columns hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RotationForm {
    /// Axis times angle.
    RotationVector,
    /// Turns about the moving axes: `R = Rx(a)·Ry(b)·Rz(c)`.
    EulerXyz,
    /// `x, y, z, w`.
    Quaternion,
}

impl std::fmt::Display for RotationForm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            RotationForm::RotationVector => "a rotation vector",
            RotationForm::EulerXyz => "Euler angles about the moving axes x, y, z",
            RotationForm::Quaternion => "a quaternion x, y, z, w",
        })
    }
}

/// One format.
pub struct Reader {
    /// Stable id, as profiles name it.
    pub id: &'static str,
    /// Name for people.
    pub name: &'static str,
    /// Usual file name extensions, lower case, without dot.
    pub extensions: &'static [&'static str],
    /// Whether the first bytes (at most [`HEAD_BYTES`]) are this format's.
    pub detect: fn(&[u8]) -> bool,
    /// Reads from the start of the input.
    pub(crate) read: ReadFn,
}

type ReadFn = fn(&mut dyn Input, &ReadOptions) -> Placed<Recording>;

/// All built-in readers; the first whose `detect` says yes reads the file.
pub fn readers() -> &'static [Reader] {
    const READERS: &[Reader] = &[
        c3d::READER,
        ros::MCAP,
        ros::SQLITE,
        vicon::READER,
        motive::READER,
        qualisys::READER,
        dtrack::READER,
        trc::READER,
        canonical::UR_RTDE,
        canonical::FRANKA,
        canonical::NDI,
        canonical::READER,
    ];
    READERS
}

/// Reads a file.
///
/// # Errors
/// [`Error`] with the file as `path` is written, the place and the problem.
pub fn read_path(path: &Path, options: &ReadOptions) -> Result<Recording, Error> {
    read_path_with(path, options, &mut |_, _| ())
}

/// [`read_path`] that tells how far it is: `progress(bytes read, bytes in all)`, about every megabyte.
///
/// # Errors
/// As [`read_path`].
pub fn read_path_with(
    path: &Path,
    options: &ReadOptions,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Recording, Error> {
    let name = path.display().to_string();
    let open = || -> Placed<(std::fs::File, u64)> {
        let io = |source| (At::File, Problem::Io(source));
        let file = calib_files::input::open(path).map_err(io)?;
        let bytes = file.metadata().map_err(io)?.len();
        Ok((file, bytes))
    };
    let (file, bytes) = in_file(&name, open())?;
    if bytes > options.max_bytes {
        return in_file(
            &name,
            Err((
                At::File,
                Problem::TooLarge {
                    bytes,
                    limit: options.max_bytes,
                },
            )),
        );
    }
    read_input(
        &name,
        &mut Watched {
            file,
            read: 0,
            told: 0,
            bytes,
            progress,
        },
        options,
    )
}

/// A file that tells how far it has been read.
struct Watched<'a> {
    file: std::fs::File,
    read: u64,
    told: u64,
    bytes: u64,
    progress: &'a mut dyn FnMut(u64, u64),
}

impl Read for Watched<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read += count as u64;
        if self.read >= self.told + (1 << 20) || count == 0 {
            self.told = self.read;
            (self.progress)(self.read.min(self.bytes), self.bytes);
        }
        Ok(count)
    }
}

impl Seek for Watched<'_> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        let place = self.file.seek(to)?;
        self.read = place;
        self.told = self.told.min(place);
        Ok(place)
    }
}

/// Reads bytes that are in memory; `name` stands in messages.
///
/// # Errors
/// As [`read_path`].
pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Recording, Error> {
    read_input(name, &mut Cursor::new(bytes), options)
}

fn read_input(
    name: &str,
    input: &mut dyn Input,
    options: &ReadOptions,
) -> Result<Recording, Error> {
    let mut recording = in_file(name, read_placed(input, options))?;
    recording.meta.source = name.to_string();
    Ok(recording)
}

fn read_placed(input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let io = |source| (At::File, Problem::Io(source));
    let mut head = Vec::new();
    input
        .take(HEAD_BYTES as u64)
        .read_to_end(&mut head)
        .map_err(io)?;
    if head.is_empty() {
        return Err((At::File, Problem::Empty));
    }
    input.seek(SeekFrom::Start(0)).map_err(io)?;
    if is_utf16(&head) {
        let mut bytes = Vec::new();
        input.read_to_end(&mut bytes).map_err(io)?;
        let text = utf8(&bytes).map_err(|byte| (At::Byte(byte), Problem::NotUtf16))?;
        return read_recognized(&mut Cursor::new(&*text), &text, options);
    }
    read_recognized(input, &head, options)
}

/// Reads what is no UTF-16; `head`: its first bytes.
fn read_recognized(input: &mut dyn Input, head: &[u8], options: &ReadOptions) -> Placed<Recording> {
    let reader = choose(&head[..head.len().min(HEAD_BYTES)], options)?;
    let mut recording = (reader.read)(input, options)?;
    recording.meta.format = reader.id.to_string();
    Ok(recording)
}

/// The reader, when it can do what a map asks that describes no columns.
fn takes(reader: &'static Reader, map: &ColumnMap) -> Placed<&'static Reader> {
    if canonical::is_of_tables(reader.id) {
        return Ok(reader);
    }
    if let Some(label) = map.labels.first() {
        let problem = Problem::MissingColumn {
            what: "a label".to_string(),
            column: label.clone(),
            nearest: None,
        };
        return Err((At::File, problem));
    }
    let default = ColumnMap::default();
    let given = [
        ("lost", map.lost != default.lost),
        ("decimal_comma", map.decimal_comma),
        ("angles", map.angles != default.angles),
        ("lengths", map.lengths != default.lengths),
    ];
    match given.iter().find(|(_, given)| *given) {
        None => Ok(reader),
        Some((key, _)) => Err((
            At::File,
            Problem::Unsupported {
                what: format!(
                    "`columns: {{{key}: …}}` for a file of format {}",
                    reader.name
                ),
                remedy: format!("remove `{key}` from the profile: the format itself states it"),
            },
        )),
    }
}

fn choose(head: &[u8], options: &ReadOptions) -> Placed<&'static Reader> {
    let known = || {
        readers()
            .iter()
            .map(|reader| reader.id)
            .collect::<Vec<_>>()
            .join(", ")
    };
    if let Some(id) = &options.format {
        return readers()
            .iter()
            .find(|reader| reader.id == id)
            .ok_or_else(|| {
                let nearest =
                    nearest_word(id, readers().iter().map(|reader| reader.id)).map(str::to_owned);
                (
                    At::File,
                    Problem::UnknownReader {
                        id: id.clone(),
                        known: known(),
                        nearest,
                    },
                )
            });
    }
    let detected = || readers().iter().find(|reader| (reader.detect)(head));
    match &options.columns {
        Some(map) if map.describes_columns() => return Ok(&canonical::READER),
        Some(map) => return detected().map_or(Ok(&canonical::READER), |r| takes(r, map)),
        None => {}
    }
    if let Some(reader) = detected() {
        return Ok(reader);
    }
    // A table with a header of text, though not of our names: read it as ours, whose message names the column.
    if canonical::looks_like_a_table(head) {
        return Ok(&canonical::READER);
    }
    Err((At::File, Problem::UnknownFormat { known: known() }))
}
