//! Where joint values come from while a tracker is recorded: the person who moves the robot, or the robot.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::{Ipv4Addr, UdpSocket};
use std::time::Duration;

/// Angle or length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Radians inside, degrees in the file and on the screen.
    Angle,
    /// Meters inside, millimeters on the screen.
    Length,
}

impl Unit {
    /// The position that is asked for: hundredths, where it has any, `40.0°` or `39.96°`.
    pub fn asked(self, value: f64) -> String {
        let (number, unit) = match self {
            Unit::Angle => (format!("{:.2}", value.to_degrees()), "°"),
            Unit::Length => (format!("{:.2}", value * 1e3), " mm"),
        };
        let number = number.strip_suffix('0').unwrap_or(&number);
        format!("{number}{unit}")
    }

    /// The value as a person reads it, `40.0°` or `120.0 mm`.
    pub fn shown(self, value: f64) -> String {
        match self {
            Unit::Angle => format!("{:.1}°", value.to_degrees()),
            Unit::Length => format!("{:.1} mm", value * 1e3),
        }
    }
}

/// A joint that gets a column.
#[derive(Clone, Debug, PartialEq)]
pub struct JointColumn {
    /// Its name in the URDF.
    pub name: String,
    /// Angle or length.
    pub unit: Unit,
    /// It stands still at this value, rad or m, and nobody sends it.
    pub fixed: Option<f64>,
}

impl JointColumn {
    /// Name of its column.
    pub fn header(&self) -> String {
        match self.unit {
            Unit::Angle => format!("{}_deg", self.name),
            Unit::Length => format!("{}_m", self.name),
        }
    }

    /// The number in its column.
    pub fn written(&self, value: f64) -> f64 {
        match self.unit {
            Unit::Angle => value.to_degrees(),
            Unit::Length => value,
        }
    }
}

/// Where joint values come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointSource {
    /// The poses that the person is asked for: commanded, not measured.
    Targets,
    /// The robot's own program sends `name_deg=value …` in UDP datagrams to this port.
    Udp(u16),
}

impl std::str::FromStr for JointSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "targets" {
            return Ok(JointSource::Targets);
        }
        text.strip_prefix("udp:")
            .and_then(|port| port.parse().ok())
            .map(JointSource::Udp)
            .ok_or_else(|| format!("found `{text}`, expected `targets` or `udp:PORT`"))
    }
}

/// The joints of one datagram: `waist_deg=40.1 lift_mm=120` with blanks, commas or line breaks between them; SI out.
///
/// # Errors
/// What stands there and what was expected, as a sentence.
pub fn parse_joints(bytes: &[u8]) -> Result<BTreeMap<String, f64>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "no UTF-8 text".to_string())?;
    let mut joints = BTreeMap::new();
    for part in text.split(|c: char| c.is_whitespace() || c == ',' || c == '\0') {
        if part.is_empty() {
            continue;
        }
        let bad = || format!("found `{}`, expected `<joint>_deg=<number>`", excerpt(part));
        let (name, value) = part.split_once('=').ok_or_else(bad)?;
        let value: f64 = value.parse().map_err(|_| bad())?;
        let (name, unit) = name.rsplit_once('_').ok_or_else(bad)?;
        let si = match unit {
            "rad" | "m" => value,
            "deg" => value.to_radians(),
            "mm" => value * 1e-3,
            "cm" => value * 1e-2,
            _ => return Err(bad()),
        };
        if !si.is_finite() || name.is_empty() {
            return Err(bad());
        }
        joints.insert(name.to_string(), si);
    }
    if joints.is_empty() {
        return Err("no joints in it".to_string());
    }
    Ok(joints)
}

fn excerpt(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Joint values older than this, s, say nothing about now.
const STALE: f64 = 0.5;

/// Listens for the robot.
#[derive(Debug)]
pub struct JointListener {
    socket: UdpSocket,
    /// The last value of each joint and when it arrived.
    last: BTreeMap<String, (f64, f64)>,
    /// Datagrams with joints.
    pub taken: u64,
    /// Datagrams that were none, and what the last one was.
    pub foreign: u64,
    /// What the last of these was.
    pub why: Option<String>,
}

impl JointListener {
    /// Opens the port.
    ///
    /// # Errors
    /// The operating system's.
    pub fn open(port: u16) -> std::io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port))?;
        socket.set_nonblocking(true)?;
        socket.set_read_timeout(Some(Duration::from_millis(1)))?;
        Ok(JointListener {
            socket,
            last: BTreeMap::new(),
            taken: 0,
            foreign: 0,
            why: None,
        })
    }

    /// The port that is open.
    ///
    /// # Errors
    /// The operating system's.
    pub fn port(&self) -> std::io::Result<u16> {
        Ok(self.socket.local_addr()?.port())
    }

    /// Takes everything that has arrived; `now` is the time of this computer, s.
    pub fn take(&mut self, now: f64) {
        let mut buffer = [0; 4096];
        // A robot that floods the port must not keep the tracker waiting.
        for _ in 0..256 {
            match self.socket.recv(&mut buffer) {
                Ok(length) => self.datagram(&buffer[..length], now),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    }

    /// Takes one datagram.
    pub fn datagram(&mut self, bytes: &[u8], now: f64) {
        match parse_joints(bytes) {
            Ok(joints) => {
                self.taken += 1;
                self.last
                    .extend(joints.into_iter().map(|(name, q)| (name, (q, now))));
            }
            Err(why) => {
                self.foreign += 1;
                self.why = Some(why);
            }
        }
    }

    /// The joint's value, rad or m, unless it is too old.
    pub fn value(&self, name: &str, now: f64) -> Option<f64> {
        let &(value, at) = self.last.get(name)?;
        (now - at <= STALE).then_some(value)
    }

    /// How old the joint's last value is, s; `None` where none was received.
    pub fn age(&self, name: &str, now: f64) -> Option<f64> {
        self.last.get(name).map(|(_, at)| now - at)
    }

    /// What the robot sends: names of joints, what is wrong with the last datagram, or nothing.
    pub fn heard(&self) -> String {
        match (&self.why, self.last.is_empty()) {
            (_, false) => self.names().join(", "),
            (Some(why), true) => why.clone(),
            (None, true) => "nothing".to_owned(),
        }
    }

    /// Names that the robot sends.
    pub fn names(&self) -> Vec<&str> {
        self.last.keys().map(String::as_str).collect()
    }
}
