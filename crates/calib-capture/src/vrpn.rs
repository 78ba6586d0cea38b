//! VRPN, the part that a client of trackers needs: greeting, names, and `vrpn_Tracker Pos_Quat` over TCP.
//!
//! ```text
//! greeting   "vrpn: ver. 07.38  0" and NULs, 24 bytes; the major version must agree
//! message    i32 length (24 + payload) · i32 s · i32 µs · i32 sender · i32 type · i32 sequence · payload, padded to 8
//! type −1    a sender's name (i32 length, text, NUL)         −2   a type's name
//! type −3    the other side's UDP port: not used             −5   goodbye
//! Pos_Quat   i32 sensor · i32 padding · 3 f64 x y z · 4 f64 quaternion x y z w          big-endian, m
//! ```
//!
//! A sensor that is not seen is not reported: lost is absence. Times are the sender's; two senders on one
//! connection need not share a clock.

use crate::Frame;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use std::collections::BTreeMap;

/// Port of a VRPN server unless told otherwise.
pub const PORT: u16 = 3883;

/// What a client says first; a server says the same with its own minor version.
pub const GREETING: [u8; 24] = *b"vrpn: ver. 07.38  0\0\0\0\0\0";

const HEADER: usize = 24;
/// VRPN's own buffer has 64 000 bytes: no message is longer.
const MAX_LENGTH: usize = 64_000;
/// VRPN's own tables end here.
const MAX_NAMES: usize = 2_000;
const POSE: &str = "vrpn_Tracker Pos_Quat";
/// How far a quaternion's length may be from 1, as in files.
const UNIT_TOLERANCE: f64 = 5e-3;

/// Why the bytes are no VRPN stream that can be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VrpnError {
    /// The first bytes are no greeting.
    #[error(
        "byte 0: found `{found}`, expected `vrpn: ver. 07.…`; this port does not belong to a VRPN server"
    )]
    NotVrpn {
        /// The first bytes, as text.
        found: String,
    },
    /// Another major version.
    #[error("the server uses VRPN {found}, this program VRPN 07; the major versions must match")]
    Version {
        /// What the server says.
        found: String,
    },
    /// A length that no message has.
    #[error("byte {byte}: a message of {length} bytes, expected 24 to {MAX_LENGTH}")]
    Length {
        /// Place in the stream, from 0.
        byte: u64,
        /// The length found.
        length: i32,
    },
}

/// What a message means to us.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Where a sensor is.
    Sensor {
        /// Name of the device.
        device: String,
        /// Sensor of the device, from 0.
        sensor: i32,
        /// The device's time, whole seconds and µs.
        stamp: (i32, i32),
        /// Its pose, or its place where its quaternion is zero.
        place: Place,
    },
    /// A pose that is none: not finite, or a quaternion that is neither zero nor of length 1.
    BadPose {
        /// Name of the device.
        device: String,
        /// Sensor of the device, from 0.
        sensor: i32,
    },
    /// The server says goodbye.
    Goodbye,
}

/// Bytes in, messages out; keeps what is not complete yet.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    buffer: Vec<u8>,
    /// Bytes of the stream before the buffer.
    consumed: u64,
    greeted: bool,
    /// What is wrong after the messages that were given last.
    broken: Option<VrpnError>,
    senders: BTreeMap<i32, String>,
    types: BTreeMap<i32, String>,
}

impl Decoder {
    /// Whether the server's greeting was read and accepted.
    pub fn greeted(&self) -> bool {
        self.greeted
    }

    /// Whether the stream cannot be read on; the next [`push`](Self::push) says why.
    pub fn is_broken(&self) -> bool {
        self.broken.is_some()
    }

    /// Names of the devices that the server has, in its own order.
    pub fn devices(&self) -> Vec<&str> {
        self.senders
            .values()
            .map(String::as_str)
            .filter(|name| *name != "VRPN Control" && !name.starts_with("vrpn_Forwarder"))
            .collect()
    }

    /// Takes the next bytes of the stream and gives the messages that are complete with them.
    ///
    /// # Errors
    /// [`VrpnError`], after the messages before it have been given; the stream cannot be read on then.
    pub fn push(&mut self, bytes: &[u8]) -> Result<Vec<Message>, VrpnError> {
        if let Some(error) = &self.broken {
            return Err(error.clone());
        }
        self.buffer.extend_from_slice(bytes);
        let mut at = 0;
        if !self.greeted {
            if !self.greeting()? {
                return Ok(Vec::new());
            }
            at = GREETING.len();
        }
        let mut messages = Vec::new();
        loop {
            match self.message(at) {
                Ok(Some((message, size))) => {
                    messages.extend(message);
                    at += size;
                }
                Ok(None) => break,
                Err(error) => {
                    self.broken = Some(error.clone());
                    if messages.is_empty() {
                        return Err(error);
                    }
                    break;
                }
            }
        }
        self.buffer.drain(..at);
        self.consumed += at as u64;
        Ok(messages)
    }

    /// Whether the greeting is there; an error as soon as it cannot become one.
    fn greeting(&mut self) -> Result<bool, VrpnError> {
        let start = b"vrpn: ver. ";
        let known = self.buffer.len().min(start.len());
        if self.buffer[..known] != start[..known] {
            let first = self.buffer.iter().take(24).map(|&b| match b {
                b' '..=b'~' => char::from(b),
                _ => '·',
            });
            return Err(VrpnError::NotVrpn {
                found: first.collect(),
            });
        }
        if self.buffer.len() < GREETING.len() {
            return Ok(false);
        }
        let version: String = self.buffer[start.len()..GREETING.len()]
            .iter()
            .map(|&b| char::from(b))
            .take_while(|c| c.is_ascii_digit() || *c == '.')
            .collect();
        if version.split('.').next() != Some("07") {
            return Err(VrpnError::Version { found: version });
        }
        self.greeted = true;
        Ok(true)
    }

    /// The message at this place of the buffer and how many bytes it takes; `None` until it is complete.
    fn message(&mut self, at: usize) -> Result<Option<(Option<Message>, usize)>, VrpnError> {
        let rest = &self.buffer[at..];
        let (Some(length), true) = (int(rest, 0), rest.len() >= HEADER) else {
            return Ok(None);
        };
        let whole = usize::try_from(length).unwrap_or(0);
        if !(HEADER..=MAX_LENGTH).contains(&whole) {
            let byte = self.consumed + at as u64;
            return Err(VrpnError::Length { byte, length });
        }
        let size = whole.next_multiple_of(8);
        if rest.len() < size {
            return Ok(None);
        }
        let word = |i: usize| int(rest, 4 * i).unwrap_or_default();
        let (stamp, sender, kind) = ((word(1), word(2)), word(3), word(4));
        let payload = &rest[HEADER..whole];
        let name = || -> Option<String> {
            let length = usize::try_from(int(payload, 0)?).ok()?;
            let text = payload.get(4..)?.get(..length)?;
            let end = text.iter().position(|&b| b == 0).unwrap_or(text.len());
            Some(String::from_utf8_lossy(&text[..end]).into_owned())
        };
        let message = match kind {
            -1 | -2 => {
                let name = name();
                let names = if kind == -1 {
                    &mut self.senders
                } else {
                    &mut self.types
                };
                if let Some(name) = name.filter(|_| names.len() < MAX_NAMES) {
                    names.insert(sender, name);
                }
                None
            }
            -5 => Some(Message::Goodbye),
            kind if self.types.get(&kind).map(String::as_str) == Some(POSE) => {
                let device = self.senders.get(&sender).cloned();
                pose(
                    device.unwrap_or_else(|| format!("sender_{sender}")),
                    stamp,
                    payload,
                )
            }
            _ => None,
        };
        Ok(Some((message, size)))
    }
}

/// `None` when the payload is not as long as a pose.
fn pose(device: String, stamp: (i32, i32), payload: &[u8]) -> Option<Message> {
    let sensor = int(payload, 0)?;
    let mut v = [0.0; 7];
    for (i, value) in v.iter_mut().enumerate() {
        let bytes = payload.get(8 + 8 * i..16 + 8 * i)?;
        *value = f64::from_be_bytes(bytes.try_into().ok()?);
    }
    let q = Quaternion::new(v[6], v[3], v[4], v[5]);
    let finite = v.iter().all(|value| value.is_finite()) && (0..1_000_000).contains(&stamp.1);
    if finite && q.norm() == 0.0 {
        return Some(Message::Sensor {
            device,
            sensor,
            stamp,
            place: Place::Point(Point3::new(v[0], v[1], v[2])),
        });
    }
    let unit = (q.norm() - 1.0).abs() <= UNIT_TOLERANCE;
    if !unit || !finite {
        return Some(Message::BadPose { device, sensor });
    }
    let pose = Isometry3::from_parts(
        Translation3::new(v[0], v[1], v[2]),
        UnitQuaternion::from_quaternion(q),
    );
    Some(Message::Sensor {
        device,
        sensor,
        stamp,
        place: Place::Pose(pose),
    })
}

fn int(bytes: &[u8], at: usize) -> Option<i32> {
    let four = bytes.get(at..at + 4)?;
    Some(i32::from_be_bytes(four.try_into().ok()?))
}

/// Reports of one device whose stamps are this close belong to one frame, s.
const SAME_FRAME: f64 = 0.002;

/// Where a sensor is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// `tracker_from_sensor`, m.
    Pose(Isometry3<f64>),
    /// Its place in the tracker's frame, m.
    Point(Point3<f64>),
}

impl Place {
    fn put(self, name: String, frame: &mut Frame) {
        match self {
            Place::Pose(pose) => {
                frame.bodies.insert(name, pose);
            }
            Place::Point(point) => {
                frame.markers.insert(name, point);
            }
        }
    }
}

/// Puts the sensors of one device that were reported for the same instant into one frame.
#[derive(Clone, Debug, Default)]
pub struct Grouper {
    open: Option<(f64, Frame)>,
}

impl Grouper {
    /// Takes a report; gives the frame before when this one begins the next.
    pub fn report(&mut self, name: String, stamp: (i32, i32), place: Place) -> Option<Frame> {
        let t = f64::from(stamp.0) + f64::from(stamp.1) * 1e-6;
        if let Some((began, frame)) = &mut self.open
            && (t - *began).abs() <= SAME_FRAME
            && !frame.bodies.contains_key(&name)
            && !frame.markers.contains_key(&name)
        {
            place.put(name, frame);
            return None;
        }
        let mut frame = Frame {
            device: Some(t),
            ..Frame::default()
        };
        place.put(name, &mut frame);
        self.open.replace((t, frame)).map(|(_, frame)| frame)
    }

    /// The frame that is not complete yet, for the end of a stream.
    pub fn finish(&mut self) -> Option<Frame> {
        self.open.take().map(|(_, frame)| frame)
    }
}
