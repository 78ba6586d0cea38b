//! C3D: the points of all six encodings (Intel, DEC or MIPS; integer or float). Analog data are skipped.
//!
//! ```text
//! block 1      header: first parameter block, 0x50, points and analog values per frame, first and last frame, …
//! block P      parameters: processor (84 Intel, 85 DEC, 86 MIPS), then groups and parameters, linked by offsets
//! block D      frames: per point x, y, z, w as i16 × SCALE or f32, then the analog values
//! ```
//!
//! A point with `w < 0` is lost. The low byte of `w` is the residual in units of |SCALE|; 0 means interpolated — unless
//! no point of the file has a residual, then its writer does not know residuals and all points count as measured.

mod parameters;
mod points;
mod shape;

use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::model::Recording;
use std::io::SeekFrom;

pub(super) const READER: Reader = Reader {
    id: "c3d",
    name: "C3D",
    extensions: &["c3d"],
    detect,
    read,
};

const BLOCK: u64 = 512;

fn detect(head: &[u8]) -> bool {
    head.len() >= 2 && head[0] >= 1 && head[1] == 0x50
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Processor {
    Intel,
    Dec,
    Mips,
}

impl Processor {
    fn u16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Processor::Mips => u16::from_be_bytes(bytes),
            _ => u16::from_le_bytes(bytes),
        }
    }

    fn f32(self, bytes: [u8; 4]) -> f32 {
        let [a, b, c, d] = bytes;
        match self {
            Processor::Intel => f32::from_le_bytes(bytes),
            Processor::Mips => f32::from_be_bytes(bytes),
            // VAX F: 16-bit words in the other order, exponent biased by two more; exponent 0 is zero.
            Processor::Dec => {
                if b & 0x7f == 0 && a & 0x80 == 0 {
                    0.0
                } else {
                    f32::from_be_bytes([b, a, d, c]) / 4.0
                }
            }
        }
    }

    fn name(self) -> &'static str {
        match self {
            Processor::Intel => "Intel",
            Processor::Dec => "DEC",
            Processor::Mips => "MIPS",
        }
    }
}

fn read(input: &mut dyn Input, _options: &ReadOptions) -> Placed<Recording> {
    let io = |source| (At::File, Problem::Io(source));
    let length = input.seek(SeekFrom::End(0)).map_err(io)?;
    input.seek(SeekFrom::Start(0)).map_err(io)?;
    let mut header = [0u8; BLOCK as usize];
    if length < BLOCK {
        return Err((
            At::Byte(length),
            truncated("the header block", BLOCK - length),
        ));
    }
    input.read_exact(&mut header).map_err(io)?;
    if header[1] != 0x50 {
        let problem = Problem::Unexpected {
            found: format!("{:#04x}", header[1]),
            expected: "0x50, the mark of a C3D file".into(),
        };
        return Err((At::Byte(1), problem));
    }
    let parameters = parameters::read(input, u64::from(header[0]), length)?;
    let mut recording = Recording::default();
    let shape = shape::shape(&header, &parameters, length, &mut recording)?;
    points::read(input, &shape, &parameters, &mut recording)?;
    Ok(recording)
}

fn truncated(what: &str, needed: u64) -> Problem {
    Problem::Truncated {
        what: what.to_string(),
        needed,
    }
}
