//! Where frames come from: a UDP port that DTrack sends to, or a TCP connection to a VRPN server.

use crate::vrpn::{Decoder, GREETING, Grouper, Message, Place, VrpnError};
use crate::{Frame, dtrack, vrpn};
use std::fmt;
use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpStream, ToSocketAddrs, UdpSocket};
use std::str::FromStr;
use std::time::{Duration, Instant};

/// How long a VRPN server may take to answer, s.
const ANSWER: u64 = 5;

/// A tracker's address, as `dtrack:5000`, `dtrack:239.1.2.3:5000@192.168.0.10`, `vrpn:host`, `vrpn:Tracker0@host:3883`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// DTrack sends to this port of this computer.
    Dtrack {
        /// UDP port.
        port: u16,
        /// The multicast group that DTrack sends to, where it does not send to this computer alone.
        group: Option<Group>,
    },
    /// A VRPN server.
    Vrpn {
        /// The device among the server's, when it has several.
        device: Option<String>,
        /// Host name or number.
        host: String,
        /// TCP port.
        port: u16,
    },
}

/// A multicast group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its address, 224.0.0.0 to 239.255.255.255.
    pub address: Ipv4Addr,
    /// This computer's address in the tracker's network; unspecified: the system chooses.
    pub interface: Ipv4Addr,
}

/// A source that is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "source `{found}`: expected `dtrack:PORT`, `dtrack:GROUP:PORT[@ADDRESS]`, `vrpn:HOST[:PORT]` or `vrpn:DEVICE@HOST[:PORT]`"
)]
pub struct BadAddress {
    /// What was given.
    pub found: String,
}

impl FromStr for Address {
    type Err = BadAddress;

    fn from_str(text: &str) -> Result<Self, BadAddress> {
        let bad = || BadAddress {
            found: text.to_string(),
        };
        if text == "dtrack" {
            return Ok(Address::Dtrack {
                port: dtrack::PORT,
                group: None,
            });
        }
        let (kind, rest) = text.split_once(':').ok_or_else(bad)?;
        match kind {
            "dtrack" => dtrack_address(rest).ok_or_else(bad),
            "vrpn" => {
                let (device, rest) = match rest.split_once('@') {
                    Some((device, rest)) => (Some(device.to_string()), rest),
                    None => (None, rest),
                };
                // An IPv6 number stands in brackets when a port follows.
                let (host, port) = match rest.rsplit_once(':') {
                    Some((host, port)) if !host.contains(':') || host.ends_with(']') => {
                        (host, port.parse().map_err(|_| bad())?)
                    }
                    _ => (rest, vrpn::PORT),
                };
                let host = host.trim_matches(['[', ']']).to_string();
                if host.is_empty() || device.as_deref() == Some("") {
                    return Err(bad());
                }
                Ok(Address::Vrpn { device, host, port })
            }
            _ => Err(bad()),
        }
    }
}

/// `PORT` or `GROUP:PORT[@ADDRESS]`.
fn dtrack_address(text: &str) -> Option<Address> {
    let Some((group, rest)) = text.split_once(':') else {
        let port = text.parse().ok()?;
        return Some(Address::Dtrack { port, group: None });
    };
    let (port, interface) = match rest.split_once('@') {
        Some((port, interface)) => (port, interface.parse().ok()?),
        None => (rest, Ipv4Addr::UNSPECIFIED),
    };
    let address: Ipv4Addr = group.parse().ok()?;
    let group = Group { address, interface };
    address.is_multicast().then_some(Address::Dtrack {
        port: port.parse().ok()?,
        group: Some(group),
    })
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Dtrack { port, group: None } => write!(f, "dtrack:{port}"),
            Address::Dtrack {
                port,
                group: Some(Group { address, interface }),
            } => {
                write!(f, "dtrack:{address}:{port}")?;
                if !interface.is_unspecified() {
                    write!(f, "@{interface}")?;
                }
                Ok(())
            }
            Address::Vrpn { device, host, port } => {
                f.write_str("vrpn:")?;
                if let Some(device) = device {
                    write!(f, "{device}@")?;
                }
                write!(f, "{host}:{port}")
            }
        }
    }
}

/// Why there is no source, or no more.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The port of this computer cannot be opened.
    #[error("UDP port {port} cannot be opened: {source}. Check that no other program uses it.")]
    Port {
        /// The port.
        port: u16,
        /// Why.
        source: std::io::Error,
    },
    /// The multicast group cannot be joined.
    #[error(
        "the multicast group {address} cannot be joined: {source}. State this computer's address in the tracker's network: `--source dtrack:{address}:{port}@ADDRESS`."
    )]
    Join {
        /// The group.
        address: Ipv4Addr,
        /// The port.
        port: u16,
        /// Why.
        source: std::io::Error,
    },
    /// The server cannot be reached.
    #[error(
        "{host}:{port} cannot be reached: {source}. Check that the VRPN server is running and that no firewall blocks it."
    )]
    Connect {
        /// The host.
        host: String,
        /// The port.
        port: u16,
        /// Why.
        source: std::io::Error,
    },
    /// Connected, but nobody speaks.
    #[error(
        "{host}:{port} accepted the connection but sent nothing for {ANSWER} s. Check that it is a VRPN server."
    )]
    Mute {
        /// The host.
        host: String,
        /// The port.
        port: u16,
    },
    /// What the server says is no VRPN.
    #[error("{host}:{port}: {problem}")]
    Vrpn {
        /// The host.
        host: String,
        /// The port.
        port: u16,
        /// What is wrong.
        problem: VrpnError,
    },
    /// Two devices report, and none was chosen.
    #[error("the server has several devices that send reports ({}). Choose one: `--source vrpn:{}@{host}`.", .devices.join(", "), .devices.first().map_or("DEVICE", String::as_str))]
    Devices {
        /// The host.
        host: String,
        /// Their names.
        devices: Vec<String>,
    },
    /// The connection broke.
    #[error("the connection was lost: {0}")]
    Broken(std::io::Error),
}

/// What came in.
#[derive(Debug, PartialEq)]
pub enum Input {
    /// Frames, in the order of arrival.
    Frames(Vec<Frame>),
    /// A datagram or report that is not ours or cannot be read; what it was.
    Foreign(String),
    /// Nothing within the time.
    Nothing,
    /// The other side ended the connection.
    Closed,
}

/// An open source.
#[derive(Debug)]
pub enum Source {
    /// DTrack's datagrams.
    Dtrack {
        /// Bound to the port.
        socket: UdpSocket,
    },
    /// A VRPN server's stream.
    Vrpn(Box<Connection>),
}

/// A connection to a VRPN server.
#[derive(Debug)]
pub struct Connection {
    stream: TcpStream,
    host: String,
    port: u16,
    device: Option<String>,
    /// The device that reported first, when none was chosen.
    first: Option<String>,
    decoder: Decoder,
    grouper: Grouper,
    closed: bool,
}

impl Source {
    /// Opens the port, or connects and greets.
    ///
    /// # Errors
    /// [`SourceError`].
    pub fn open(address: &Address) -> Result<Source, SourceError> {
        match address {
            Address::Dtrack { port, group } => {
                let port = *port;
                let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port))
                    .map_err(|source| SourceError::Port { port, source })?;
                if let Some(Group { address, interface }) = group {
                    let joined = socket.join_multicast_v4(address, interface);
                    joined.map_err(|source| SourceError::Join {
                        address: *address,
                        port,
                        source,
                    })?;
                }
                Ok(Source::Dtrack { socket })
            }
            Address::Vrpn { device, host, port } => {
                let connection = Connection::open(device.clone(), host, *port)?;
                Ok(Source::Vrpn(Box::new(connection)))
            }
        }
    }

    /// The port of this computer that is listened on (DTrack).
    pub fn port(&self) -> Option<u16> {
        match self {
            Source::Dtrack { socket } => Some(socket.local_addr().ok()?.port()),
            Source::Vrpn(_) => None,
        }
    }

    /// Waits for the next input, at most this long (at least 1 ms).
    ///
    /// # Errors
    /// [`SourceError`] when nothing can come any more.
    pub fn next(&mut self, timeout: Duration) -> Result<Input, SourceError> {
        let timeout = timeout.max(Duration::from_millis(1));
        match self {
            Source::Dtrack { socket } => {
                socket
                    .set_read_timeout(Some(timeout))
                    .map_err(SourceError::Broken)?;
                let mut buffer = vec![0; dtrack::MAX_DATAGRAM];
                match socket.recv(&mut buffer) {
                    Ok(length) => Ok(datagram(&buffer[..length])),
                    Err(e) if nothing(&e) => Ok(Input::Nothing),
                    // Somebody refused a datagram of ours: we sent none.
                    Err(e) if e.kind() == ErrorKind::ConnectionReset => Ok(Input::Nothing),
                    Err(e) => Err(SourceError::Broken(e)),
                }
            }
            Source::Vrpn(connection) => connection.next(timeout),
        }
    }
}

fn nothing(error: &std::io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

fn datagram(bytes: &[u8]) -> Input {
    if !dtrack::is_ours(bytes) {
        let start: String = bytes
            .iter()
            .take(20)
            .map(|&b| match b {
                b' '..=b'~' => char::from(b),
                _ => '·',
            })
            .collect();
        return Input::Foreign(format!(
            "{} bytes that begin `{start}`, expected `fr <number>`",
            bytes.len()
        ));
    }
    match dtrack::datagram(bytes) {
        Ok(frames) => Input::Frames(frames),
        Err(error) => Input::Foreign(error.to_string()),
    }
}

impl Connection {
    fn open(device: Option<String>, host: &str, port: u16) -> Result<Connection, SourceError> {
        let failed = |source| SourceError::Connect {
            host: host.to_string(),
            port,
            source,
        };
        let mut last = std::io::Error::new(ErrorKind::NotFound, "the host has no address");
        let mut found = None;
        for address in (host, port).to_socket_addrs().map_err(failed)? {
            match TcpStream::connect_timeout(&address, Duration::from_secs(ANSWER)) {
                Ok(stream) => {
                    found = Some(stream);
                    break;
                }
                Err(error) => last = error,
            }
        }
        let mut stream = found.ok_or(last).map_err(failed)?;
        stream.write_all(&GREETING).map_err(failed)?;
        let mut connection = Connection {
            stream,
            host: host.to_string(),
            port,
            device,
            first: None,
            decoder: Decoder::default(),
            grouper: Grouper::default(),
            closed: false,
        };
        connection.greet()?;
        Ok(connection)
    }

    /// Reads the greeting, byte for byte, so that nothing that follows it is taken.
    fn greet(&mut self) -> Result<(), SourceError> {
        let began = Instant::now();
        self.stream
            .set_read_timeout(Some(Duration::from_millis(100)))
            .map_err(SourceError::Broken)?;
        let mut one = [0];
        while !self.decoder.greeted() {
            match self.stream.read(&mut one) {
                Ok(1) => {
                    self.take(&one)?;
                }
                Ok(_) => return Err(self.mute()),
                Err(e) if nothing(&e) => {
                    if began.elapsed() > Duration::from_secs(ANSWER) {
                        return Err(self.mute());
                    }
                }
                Err(e) => return Err(SourceError::Broken(e)),
            }
        }
        Ok(())
    }

    fn mute(&self) -> SourceError {
        SourceError::Mute {
            host: self.host.clone(),
            port: self.port,
        }
    }

    fn next(&mut self, timeout: Duration) -> Result<Input, SourceError> {
        if self.decoder.is_broken() {
            return self.take(&[]);
        }
        if self.closed {
            return Ok(Input::Closed);
        }
        self.stream
            .set_read_timeout(Some(timeout))
            .map_err(SourceError::Broken)?;
        let mut buffer = [0; 16 << 10];
        match self.stream.read(&mut buffer) {
            Ok(0) => {
                self.closed = true;
                Ok(Input::Frames(self.grouper.finish().into_iter().collect()))
            }
            Ok(length) => self.take(&buffer[..length]),
            // A frame is complete when nothing more of it comes.
            Err(e) if nothing(&e) => Ok(match self.grouper.finish() {
                Some(frame) => Input::Frames(vec![frame]),
                None => Input::Nothing,
            }),
            Err(e) if e.kind() == ErrorKind::ConnectionReset => {
                self.closed = true;
                Ok(Input::Frames(self.grouper.finish().into_iter().collect()))
            }
            Err(e) => Err(SourceError::Broken(e)),
        }
    }

    fn take(&mut self, bytes: &[u8]) -> Result<Input, SourceError> {
        let messages = self
            .decoder
            .push(bytes)
            .map_err(|problem| SourceError::Vrpn {
                host: self.host.clone(),
                port: self.port,
                problem,
            })?;
        let (mut frames, mut bad) = (Vec::new(), None);
        for message in messages {
            match message {
                Message::Sensor {
                    device,
                    sensor,
                    stamp,
                    place,
                } => frames.extend(self.report(&device, sensor, stamp, place)?),
                Message::BadPose { device, sensor } => {
                    bad = Some(format!(
                        "sensor {sensor} of `{device}` reports an orientation that is none"
                    ));
                }
                Message::Goodbye => {
                    self.closed = true;
                    frames.extend(self.grouper.finish());
                }
            }
        }
        Ok(match bad {
            Some(why) if frames.is_empty() => Input::Foreign(why),
            _ => Input::Frames(frames),
        })
    }

    /// Takes the report of a sensor; the frame that it completes.
    fn report(
        &mut self,
        device: &str,
        sensor: i32,
        stamp: (i32, i32),
        place: Place,
    ) -> Result<Option<Frame>, SourceError> {
        if !self.is_mine(device)? {
            return Ok(None);
        }
        Ok(self
            .grouper
            .report(format!("{device}_{sensor}"), stamp, place))
    }

    /// Whether the device is the one to be recorded; an error when that is open.
    fn is_mine(&mut self, device: &str) -> Result<bool, SourceError> {
        if let Some(chosen) = &self.device {
            return Ok(chosen == device);
        }
        let first = self.first.get_or_insert_with(|| device.to_string());
        if first != device {
            return Err(SourceError::Devices {
                host: self.host.clone(),
                devices: vec![first.clone(), device.to_string()],
            });
        }
        Ok(true)
    }
}
