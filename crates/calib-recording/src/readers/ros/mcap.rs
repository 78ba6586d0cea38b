//! MCAP: records of one byte type, eight bytes length and content; messages may stand in compressed chunks.
//! Format: <https://mcap.dev/spec>.

use super::{Input, Visit, read_exactly};
use crate::error::{At, Placed, Problem, excerpt};
use std::collections::BTreeMap;
use std::io::{Read, SeekFrom};

pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const DATA_END: u8 = 0x0f;

/// A chunk may grow to this many times its compressed size, plus a megabyte: pose data shrink twentyfold at most.
const MAX_RATIO: u64 = 256;

/// Types and topics seen so far.
#[derive(Default)]
struct Directory {
    schemas: BTreeMap<u16, String>,
    /// Channel → topic and schema.
    channels: BTreeMap<u16, (String, u16)>,
}

pub(super) fn messages(input: &mut dyn Input, visit: &mut Visit) -> Placed<()> {
    let io = |source| (At::File, Problem::Io(source));
    let length = input.seek(SeekFrom::End(0)).map_err(io)?;
    let mut at = MAGIC.len() as u64;
    input.seek(SeekFrom::Start(at)).map_err(io)?;
    let mut directory = Directory::default();
    loop {
        let head = read_exactly(input, at, 9, "a record; the recording was not closed")?;
        let size = u64::from_le_bytes([
            head[1], head[2], head[3], head[4], head[5], head[6], head[7], head[8],
        ]);
        let content_at = at + 9;
        if size > length.saturating_sub(content_at) {
            let needed = size - length.saturating_sub(content_at);
            return Err((
                At::Byte(at),
                Problem::Truncated {
                    what: format!("a record of {size} bytes"),
                    needed,
                },
            ));
        }
        match head[0] {
            DATA_END => return Ok(()),
            SCHEMA | CHANNEL | MESSAGE => {
                let content = read_exactly(input, content_at, size, "a record")?;
                directory.record(content_at, head[0], &content, visit)?;
            }
            CHUNK => {
                let content = read_exactly(input, content_at, size, "a chunk")?;
                let records = unpack(content_at, &content)?;
                directory.records(content_at, &records, visit)?;
            }
            _ => {
                input.seek(SeekFrom::Start(content_at + size)).map_err(io)?;
            }
        }
        at = content_at + size;
    }
}

/// Fields of a record, one after the other.
struct Fields<'a> {
    bytes: &'a [u8],
    at: u64,
}

impl<'a> Fields<'a> {
    fn take(&mut self, count: u64) -> Placed<&'a [u8]> {
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        let Some((taken, rest)) = self.bytes.split_at_checked(count) else {
            let needed = (count - self.bytes.len()) as u64;
            return Err((
                At::Byte(self.at),
                Problem::Truncated {
                    what: "a record's field".to_string(),
                    needed,
                },
            ));
        };
        self.bytes = rest;
        Ok(taken)
    }

    fn number(&mut self, size: usize) -> Placed<u64> {
        Ok(self
            .take(size as u64)?
            .iter()
            .rev()
            .fold(0, |number, &b| number << 8 | u64::from(b)))
    }

    fn text(&mut self) -> Placed<String> {
        let length = self.number(4)?;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

impl Directory {
    /// The records of a chunk.
    fn records(&mut self, at: u64, bytes: &[u8], visit: &mut Visit) -> Placed<()> {
        let mut fields = Fields { bytes, at };
        while !fields.bytes.is_empty() {
            let (kind, size) = (fields.number(1)? as u8, fields.number(8)?);
            let content = fields.take(size)?;
            self.record(at, kind, content, visit)?;
        }
        Ok(())
    }

    fn record(&mut self, at: u64, kind: u8, content: &[u8], visit: &mut Visit) -> Placed<()> {
        let mut fields = Fields { bytes: content, at };
        match kind {
            SCHEMA => {
                let id = fields.number(2)? as u16;
                self.schemas.insert(id, fields.text()?);
            }
            CHANNEL => {
                let (id, schema) = (fields.number(2)? as u16, fields.number(2)? as u16);
                let (topic, encoding) = (fields.text()?, fields.text()?);
                if encoding == "cdr" {
                    self.channels.insert(id, (topic, schema));
                }
            }
            MESSAGE => {
                let id = fields.number(2)? as u16;
                let (_sequence, log_time, _publish_time) =
                    (fields.number(4)?, fields.number(8)?, fields.number(8)?);
                if let Some((topic, schema)) = self.channels.get(&id) {
                    let kind = self.schemas.get(schema).map_or("", String::as_str);
                    visit(at, topic, kind, log_time, fields.bytes)?;
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// The records of a chunk, decompressed.
fn unpack(at: u64, content: &[u8]) -> Placed<Vec<u8>> {
    let mut fields = Fields { bytes: content, at };
    let (_start, _end, size, _crc) = (
        fields.number(8)?,
        fields.number(8)?,
        fields.number(8)?,
        fields.number(4)?,
    );
    let compression = fields.text()?;
    let packed = fields.number(8)?;
    let packed = fields.take(packed)?;
    let limit = MAX_RATIO * packed.len() as u64 + (1 << 20);
    if size > limit {
        let found = format!(
            "a chunk of {} bytes that says it grows to {size}",
            packed.len()
        );
        return Err((
            At::Byte(at),
            Problem::Misfit {
                found,
                expected: format!("at most {limit}"),
            },
        ));
    }
    let mut records = Vec::new();
    let broken = |error: String| {
        let found = format!("a chunk that does not decompress ({})", excerpt(&error, 80));
        (
            At::Byte(at),
            Problem::Misfit {
                found,
                expected: format!("valid {compression} data"),
            },
        )
    };
    match compression.as_str() {
        "" => records.extend_from_slice(packed),
        "lz4" => {
            let decoder = lz4_flex::frame::FrameDecoder::new(packed);
            decoder
                .take(limit)
                .read_to_end(&mut records)
                .map_err(|error| broken(error.to_string()))?;
        }
        "zstd" => {
            let decoder = ruzstd::decoding::StreamingDecoder::new(packed)
                .map_err(|error| broken(error.to_string()))?;
            decoder
                .take(limit)
                .read_to_end(&mut records)
                .map_err(|error| broken(error.to_string()))?;
        }
        other => {
            let what = format!("compression `{}`", excerpt(other, 20));
            let remedy = "record with lz4, zstd or none".to_string();
            return Err((At::Byte(at), Problem::Unsupported { what, remedy }));
        }
    }
    Ok(records)
}
