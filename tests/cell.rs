//! A robot and a tracker of ours on the loopback: `calib record` hears what a simulated recording says, and is interrupted.

use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::process::Child;
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::record::{datagram, free_port, rows, start};
use crate::scratch::Scratch;

/// How a tracker sends.
pub(crate) enum Tracker {
    Dtrack(UdpSocket, u16),
    /// Each program that comes is greeted again.
    Vrpn(TcpListener, Option<TcpStream>),
}

impl Tracker {
    pub(crate) fn dtrack() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        Self::Dtrack(socket, free_port())
    }

    pub(crate) fn vrpn() -> Self {
        Self::Vrpn(TcpListener::bind("127.0.0.1:0").expect("a free port"), None)
    }

    fn source(&self) -> String {
        match self {
            Self::Dtrack(_, port) => format!("dtrack:{port}"),
            Self::Vrpn(listener, _) => {
                let port = listener.local_addr().expect("bound").port();
                format!("vrpn:Cell@127.0.0.1:{port}")
            }
        }
    }

    /// The tracker's names of the bodies.
    fn names(&self, bodies: &[&str]) -> String {
        let of_tracker = match self {
            Self::Dtrack(..) => "body",
            Self::Vrpn(..) => "Cell",
        };
        let pairs = bodies.iter().enumerate();
        let pairs: Vec<String> = pairs
            .map(|(i, b)| format!("{b}={of_tracker}_{i}"))
            .collect();
        pairs.join(",")
    }

    /// A program that was started connects.
    fn accept(&mut self) {
        let Self::Vrpn(listener, stream) = self else {
            return;
        };
        let (mut client, _) = listener.accept().expect("a client");
        client.read_exact(&mut [0; 24]).expect("a greeting");
        let named = |kind: i32, id: i32, name: &str| {
            let mut payload = (name.len() as i32 + 1).to_be_bytes().to_vec();
            payload.extend(name.bytes().chain([0]));
            vrpn((0, 0), id, kind, &payload)
        };
        let says = [
            b"vrpn: ver. 07.38  0\0\0\0\0\0".to_vec(),
            named(-1, 0, "VRPN Control"),
            named(-1, 1, "Cell"),
            named(-2, 4, "vrpn_Tracker Pos_Quat"),
        ];
        client.write_all(&says.concat()).expect("heard");
        *stream = Some(client);
    }

    /// One frame at this time of the tracker, s.
    fn send(&mut self, number: u64, t: f64, bodies: &[(u32, Isometry3<f64>)]) {
        match self {
            Self::Dtrack(socket, port) => {
                let bytes = datagram(number, t, bodies);
                let _ = socket.send_to(&bytes, ("127.0.0.1", *port));
            }
            Self::Vrpn(_, Some(stream)) => {
                let us = (t * 1e6).round() as i64;
                let stamp = ((us / 1_000_000) as i32, (us % 1_000_000) as i32);
                for (id, pose) in bodies {
                    let (p, q) = (pose.translation.vector, pose.rotation.coords);
                    let mut payload = id.to_be_bytes().to_vec();
                    payload.extend([0; 4]);
                    let values = [p.x, p.y, p.z, q[0], q[1], q[2], q[3]];
                    payload.extend(values.iter().flat_map(|v| v.to_be_bytes()));
                    // The program may have gone.
                    let _ = stream.write_all(&vrpn(stamp, 1, 4, &payload));
                }
            }
            Self::Vrpn(_, None) => {}
        }
    }
}

/// A VRPN message: header, payload, padding.
fn vrpn(stamp: (i32, i32), sender: i32, kind: i32, payload: &[u8]) -> Vec<u8> {
    let length = 24 + payload.len();
    let words = [length as i32, stamp.0, stamp.1, sender, kind, 0];
    let mut bytes: Vec<u8> = words.iter().flat_map(|w| w.to_be_bytes()).collect();
    bytes.extend(payload);
    bytes.resize(length.next_multiple_of(8), 0);
    bytes
}

/// What happens at the fourth posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Interruption {
    None,
    /// SIGKILL.
    Kill,
    /// SIGINT, as by Ctrl-C.
    Interrupt,
    /// The key `q`.
    Quit,
    /// The tracker sends nothing any more.
    Silence,
    /// Nothing is seen for a while.
    Hidden,
}

/// A posture: what the robot sends, and what the tracker sees.
pub(crate) struct Seen {
    joints: String,
    bodies: Vec<(u32, Isometry3<f64>)>,
}

/// The rows of a simulated recording.
pub(crate) fn seen(text: &str, bodies: &[&str]) -> Vec<Seen> {
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let of_row = |line: &str| {
        let cells: BTreeMap<&str, &str> = header.iter().copied().zip(line.split(',')).collect();
        let joints = header.iter().filter(|name| name.ends_with("_deg"));
        let joints: Vec<String> = joints.map(|n| format!("{n}={}", cells[n])).collect();
        let body = |(id, name): (usize, &&str)| {
            let part = |p: &str| cells[format!("{name}.{p}").as_str()].parse::<f64>().ok();
            let q = Quaternion::new(part("qw")?, part("qx")?, part("qy")?, part("qz")?);
            let place = Translation3::new(part("x_m")?, part("y_m")?, part("z_m")?);
            let pose = Isometry3::from_parts(place, UnitQuaternion::from_quaternion(q));
            Some((id as u32, pose))
        };
        Seen {
            joints: joints.join(" "),
            bodies: bodies.iter().enumerate().filter_map(body).collect(),
        }
    };
    lines.map(of_row).collect()
}

/// A recording that goes on.
struct Live<'a> {
    dir: &'a Scratch,
    arguments: Vec<String>,
    tracker: Tracker,
    robot: UdpSocket,
    joints: u16,
    number: u64,
    child: Child,
}

impl<'a> Live<'a> {
    fn new(
        dir: &'a Scratch,
        profile: &str,
        recording: &str,
        bodies: &[&str],
        mut tracker: Tracker,
    ) -> Self {
        let joints = free_port();
        let (source, udp) = (tracker.source(), format!("udp:{joints}"));
        std::fs::create_dir_all(dir.path(recording)).expect("a folder");
        let (names, out) = (tracker.names(bodies), format!("{recording}/live.csv"));
        let arguments = [
            "record",
            profile,
            "--source",
            &source,
            "--joints",
            &udp,
            "--recording",
            "holds",
            "--map",
            &names,
            "--hold",
            "0.2",
            "--patience",
            "1",
            "--out",
            &out,
            "--append",
        ];
        let child = start(dir, &arguments);
        tracker.accept();
        Self {
            dir,
            arguments: arguments.map(str::to_owned).to_vec(),
            tracker,
            robot: UdpSocket::bind("127.0.0.1:0").expect("a free port"),
            joints,
            number: 0,
            child,
        }
    }

    /// Some frames; the tracker's clock runs faster than ours, so that the test is short.
    fn send(&mut self, at: &Seen, frames: usize, visible: bool) {
        for _ in 0..frames {
            let joints = at.joints.as_bytes();
            let _ = self.robot.send_to(joints, ("127.0.0.1", self.joints));
            // The body trembles by a few micrometers.
            let tremble = 3e-6 * (1.7 * self.number as f64).sin();
            let moved = |(id, pose): &(u32, Isometry3<f64>)| {
                (*id, Translation3::new(tremble, -tremble, tremble) * pose)
            };
            let bodies: Vec<_> = at.bodies.iter().filter(|_| visible).map(moved).collect();
            let t = 100.0 + 0.05 * self.number as f64;
            self.tracker.send(self.number, t, &bodies);
            self.number += 1;
            std::thread::sleep(Duration::from_millis(4));
        }
    }

    /// Poses in the file.
    fn holds(&self) -> usize {
        let path = self.dir.path(&self.arguments[15]);
        let rows = rows(&path);
        let holds = rows.iter().filter_map(|row| row.split(',').nth(3));
        holds.collect::<std::collections::BTreeSet<_>>().len()
    }

    /// Stops in the middle of a hold, and goes on as the program says.
    fn interrupted(&mut self, at: &Seen, by: Interruption) {
        self.send(at, 6, true);
        match by {
            Interruption::None => return,
            Interruption::Hidden => return self.send(at, 40, false),
            Interruption::Kill => self.child.kill().expect("killed"),
            Interruption::Interrupt => {
                let id = self.child.id().to_string();
                let sent = std::process::Command::new("kill")
                    .args(["-INT", &id])
                    .status();
                assert!(sent.expect("kill").success());
            }
            Interruption::Quit => {
                let stdin = self.child.stdin.as_mut().expect("open");
                stdin.write_all(b"q\n").expect("heard");
            }
            Interruption::Silence => {}
        }
        let began = Instant::now();
        while self.child.try_wait().expect("a child").is_none() {
            assert!(
                began.elapsed() < Duration::from_secs(30),
                "{by:?} ends nothing"
            );
            match by {
                Interruption::Silence => std::thread::sleep(Duration::from_millis(20)),
                _ => self.send(at, 2, true),
            }
        }
        let arguments: Vec<&str> = self.arguments.iter().map(String::as_str).collect();
        self.child = start(self.dir, &arguments);
        self.tracker.accept();
    }

    fn end(mut self) -> String {
        let mut stdin = self.child.stdin.take().expect("open");
        let _ = stdin.write_all(b"q\n");
        let output = self.child.wait_with_output().expect("ended");
        String::from_utf8(output.stderr).expect("text")
    }
}

/// Records held postures into `<recording>/live.csv` with an interruption; every posture is in the file once.
pub(crate) fn record_holds(
    dir: &Scratch,
    profile: &str,
    recording: &str,
    (bodies, postures): (&[&str], &[Seen]),
    tracker: Tracker,
    by: Interruption,
) {
    let mut live = Live::new(dir, profile, recording, bodies, tracker);
    for (k, at) in postures.iter().enumerate() {
        let before = live.holds();
        if k == 3 {
            live.interrupted(at, by);
        }
        // What was held to its end before the program stopped is not held again.
        let began = Instant::now();
        while live.holds() == before {
            live.send(at, 10, true);
            let late = began.elapsed() > Duration::from_secs(30);
            let ended = live.child.try_wait().expect("a child").is_some();
            assert!(
                !late && !ended,
                "{recording}: posture {k} after {by:?}: {}",
                live.end()
            );
        }
    }
    let (held, asked) = (live.holds(), postures.len());
    let said = live.end();
    assert_eq!(held, asked, "after {by:?}: {said}");
}

/// Records a motion into `<recording>.csv`: rows with the tracker's time, s; the joints are in the robot's own log.
pub(crate) fn record_motion(
    dir: &Scratch,
    profile: &str,
    recording: &str,
    (bodies, motion): (&[&str], &[(f64, Seen)]),
    mut tracker: Tracker,
) {
    let (source, names) = (tracker.source(), tracker.names(bodies));
    let out = format!("{recording}.csv");
    let arguments = [
        "record",
        profile,
        "--source",
        &source,
        "--recording",
        recording,
        "--map",
        &names,
        "--out",
        &out,
    ];
    let mut child = start(dir, &arguments);
    tracker.accept();
    for (number, (t, at)) in motion.iter().enumerate() {
        tracker.send(number as u64, *t, &at.bodies);
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut stdin = child.stdin.take().expect("open");
    stdin.write_all(b"q\n").expect("heard");
    let output = child.wait_with_output().expect("ended");
    let said = String::from_utf8_lossy(&output.stderr);
    // The first second goes into finding out what is sent.
    let written = rows(&dir.path(&out)).len();
    assert!(
        output.status.success() && 2 * written > motion.len(),
        "{written} of {}: {said}",
        motion.len()
    );
}

/// The time of each row of a table, s.
pub(crate) fn times(text: &str) -> Vec<f64> {
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let at = header
        .iter()
        .position(|name| *name == "t_s")
        .expect("times");
    let time = |line: &str| line.split(',').nth(at).and_then(|t| t.parse().ok());
    lines.map(|line| time(line).expect("a time")).collect()
}
