//! The parameters of a C3D file: groups and parameters, linked by offsets.

use super::{BLOCK, Processor, truncated};
use crate::error::{At, Placed, Problem};
use crate::readers::Input;
use std::collections::BTreeMap;
use std::io::{Read, SeekFrom};

/// Parameters have at most 255 blocks (their count is one byte).
const MAX_PARAMETER_BYTES: u64 = 255 * BLOCK;

/// One parameter: its element size (−1 = text), dimensions, and bytes.
struct Parameter {
    kind: i8,
    dims: Vec<usize>,
    data: Vec<u8>,
}

/// All parameters of a file.
pub(super) struct Parameters {
    pub processor: Processor,
    /// `GROUP:NAME` → parameter.
    all: BTreeMap<String, Parameter>,
}

impl Parameters {
    /// The numbers of a parameter; none where it is absent or a text.
    pub(super) fn numbers(&self, name: &str) -> Vec<f64> {
        let Some(parameter) = self.all.get(name) else {
            return Vec::new();
        };
        match parameter.kind {
            1 => parameter.data.iter().map(|&b| f64::from(b)).collect(),
            2 => parameter
                .data
                .chunks_exact(2)
                .map(|b| f64::from(self.processor.u16([b[0], b[1]])))
                .collect(),
            4 => parameter
                .data
                .chunks_exact(4)
                .map(|b| f64::from(self.processor.f32([b[0], b[1], b[2], b[3]])))
                .collect(),
            _ => Vec::new(),
        }
    }

    /// The first number of a parameter, if it is finite.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name)
            .first()
            .copied()
            .filter(|value| value.is_finite())
    }

    /// The texts of a parameter; none where it is absent or no text.
    pub(super) fn texts(&self, name: &str) -> Vec<String> {
        let Some(parameter) = self.all.get(name).filter(|parameter| parameter.kind == -1) else {
            return Vec::new();
        };
        let width = parameter.dims.first().copied().unwrap_or(0);
        if width == 0 {
            return Vec::new();
        }
        let text = |bytes: &[u8]| {
            // Latin-1: every byte is a character.
            let text: String = bytes.iter().map(|&b| char::from(b)).collect();
            text.trim_matches(|c: char| c.is_whitespace() || c == '\0')
                .to_string()
        };
        parameter.data.chunks(width).map(text).collect()
    }
}

/// Reads the parameters, which begin at this block (counted from 1) of a file of this length.
pub(super) fn read(input: &mut dyn Input, block: u64, length: u64) -> Placed<Parameters> {
    let io = |source| (At::File, Problem::Io(source));
    let start = block.saturating_sub(1) * BLOCK;
    if start + 4 > length || block == 0 {
        return Err((
            At::Byte(0),
            truncated("the parameter block", (start + 4).saturating_sub(length)),
        ));
    }
    input.seek(SeekFrom::Start(start)).map_err(io)?;
    let mut bytes = Vec::new();
    input
        .take(MAX_PARAMETER_BYTES)
        .read_to_end(&mut bytes)
        .map_err(io)?;
    // Some writers leave a dangling link behind the last parameter: the count of blocks ends the chain.
    if bytes[2] > 0 {
        bytes.truncate(usize::from(bytes[2]) * BLOCK as usize);
    }
    let processor = match bytes[3] {
        84 => Processor::Intel,
        85 => Processor::Dec,
        86 => Processor::Mips,
        other => {
            let problem = Problem::Unexpected {
                found: other.to_string(),
                expected: "processor 84 (Intel), 85 (DEC) or 86 (MIPS)".into(),
            };
            return Err((At::Byte(start + 3), problem));
        }
    };
    let block = Block {
        bytes: &bytes,
        start,
        processor,
    };
    Ok(Parameters {
        processor,
        all: block.parameters()?,
    })
}

/// The bytes of the parameter block.
struct Block<'a> {
    bytes: &'a [u8],
    /// Where the block begins in the file.
    start: u64,
    processor: Processor,
}

/// Head of a group (id below 0) or parameter (id of its group).
struct Head {
    id: i8,
    name: String,
    /// Where the offset to the next head stands.
    link: usize,
    /// 0 at the end of the chain.
    offset: usize,
}

impl Block<'_> {
    /// Follows the chain; `GROUP:NAME` → parameter.
    fn parameters(&self) -> Placed<BTreeMap<String, Parameter>> {
        let mut groups: BTreeMap<u8, String> = BTreeMap::new();
        let mut raw: Vec<(u8, String, Parameter)> = Vec::new();
        let mut at = 4usize;
        while let Some(head) = self.head(at)? {
            if head.id < 0 {
                groups.insert(head.id.unsigned_abs(), head.name);
            } else {
                let parameter = self.parameter(at, head.link)?;
                raw.push((head.id as u8, head.name, parameter));
            }
            if head.offset == 0 {
                break;
            }
            if head.offset < 2 {
                let problem = Problem::Unexpected {
                    found: head.offset.to_string(),
                    expected: "a link to the next parameter".into(),
                };
                return Err((At::Byte(self.start + head.link as u64), problem));
            }
            at = head.link + head.offset;
        }
        let named = raw.into_iter().filter_map(|(id, name, parameter)| {
            Some((format!("{}:{name}", groups.get(&id)?), parameter))
        });
        Ok(named.collect())
    }

    /// The problem of a block that ends inside the entry at `at`.
    fn short(&self, at: usize, what: &str) -> (At, Problem) {
        (At::Byte(self.start + at as u64), truncated(what, 1))
    }

    /// The head at this place; `None` at the end of the block or an empty name.
    fn head(&self, at: usize) -> Placed<Option<Head>> {
        let Some([name_length, id]) = (self.bytes)
            .get(at..at + 2)
            .map(|b| [b[0] as i8, b[1] as i8])
        else {
            return Ok(None);
        };
        let name_length = usize::from(name_length.unsigned_abs());
        if name_length == 0 || id == 0 {
            return Ok(None);
        }
        let name_bytes = (self.bytes)
            .get(at + 2..at + 2 + name_length)
            .ok_or_else(|| self.short(at, "a parameter's name"))?;
        let name: String = name_bytes
            .iter()
            .map(|&b| char::from(b))
            .collect::<String>()
            .to_ascii_uppercase();
        let link = at + 2 + name_length;
        let offset = (self.bytes)
            .get(link..link + 2)
            .map(|b| usize::from(self.processor.u16([b[0], b[1]])))
            .ok_or_else(|| self.short(at, "a parameter's link"))?;
        Ok(Some(Head {
            id,
            name,
            link,
            offset,
        }))
    }

    /// Type, dimensions and values behind the link of the head at `at`.
    fn parameter(&self, at: usize, link: usize) -> Placed<Parameter> {
        let (kind, dims) = match self.bytes.get(link + 2..link + 4) {
            Some(&[kind, count]) => (kind as i8, usize::from(count)),
            _ => return Err(self.short(at, "a parameter's type")),
        };
        let dims = (self.bytes)
            .get(link + 4..link + 4 + dims)
            .ok_or_else(|| self.short(at, "a parameter's dimensions"))?;
        let dims: Vec<usize> = dims.iter().map(|&b| usize::from(b)).collect();
        let first = link + 4 + dims.len();
        let size = dims
            .iter()
            .try_fold(usize::from(kind.unsigned_abs()), |size, &dim| {
                size.checked_mul(dim)
            });
        let data = size
            .and_then(|size| self.bytes.get(first..first.checked_add(size)?))
            .ok_or_else(|| self.short(at, "a parameter's values"))?;
        Ok(Parameter {
            kind,
            dims,
            data: data.to_vec(),
        })
    }
}
