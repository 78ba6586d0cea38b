//! CDR, the encoding of ROS 2 messages: little or big endian, values aligned to their size from byte 4 on.

use crate::error::{At, Placed, Problem};

/// A message being decoded.
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    position: usize,
    big_endian: bool,
    /// Place of the message in the file, for errors.
    at: u64,
}

impl<'a> Cdr<'a> {
    pub(super) fn new(at: u64, message: &'a [u8]) -> Placed<Self> {
        match message {
            [0, kind @ (0 | 1), _, _, bytes @ ..] => Ok(Cdr {
                bytes,
                position: 0,
                big_endian: *kind == 0,
                at,
            }),
            _ => {
                let found = message
                    .iter()
                    .take(4)
                    .map(|b| format!("{b:02x}"))
                    .collect::<Vec<_>>()
                    .join(" ");
                let expected = "a CDR message beginning with 00 00 or 00 01".to_string();
                Err((At::Byte(at), Problem::Unexpected { found, expected }))
            }
        }
    }

    fn take(&mut self, size: usize, align: usize) -> Placed<&'a [u8]> {
        let start = self.position.next_multiple_of(align);
        let end = start.saturating_add(size);
        let Some(bytes) = self.bytes.get(start..end) else {
            let needed = (end - self.bytes.len()) as u64;
            return Err((
                At::Byte(self.at),
                Problem::Truncated {
                    what: "a ROS message".to_string(),
                    needed,
                },
            ));
        };
        self.position = end;
        Ok(bytes)
    }

    fn number<const N: usize>(&mut self) -> Placed<[u8; N]> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N, N)?);
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(super) fn u32(&mut self) -> Placed<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Placed<i32> {
        self.number().map(i32::from_le_bytes)
    }

    pub(super) fn i8(&mut self) -> Placed<i8> {
        self.number().map(i8::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Placed<f64> {
        self.number().map(f64::from_le_bytes)
    }

    pub(super) fn string(&mut self) -> Placed<String> {
        let length = self.u32()? as usize;
        let bytes = self.take(length, 1)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }

    /// Length of a sequence whose elements have at least `smallest` bytes: checked against what is left.
    pub(super) fn count(&mut self, smallest: usize) -> Placed<usize> {
        let count = self.u32()? as usize;
        let left = self.bytes.len() - self.position;
        if count.saturating_mul(smallest) > left {
            let needed = (count.saturating_mul(smallest) - left) as u64;
            return Err((
                At::Byte(self.at),
                Problem::Truncated {
                    what: format!("a sequence of {count}"),
                    needed,
                },
            ));
        }
        Ok(count)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Placed<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }
}
