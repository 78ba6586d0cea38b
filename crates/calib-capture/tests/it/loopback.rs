//! Over this computer's own network: our senders, the real sockets.

use crate::senders::{datagrams, dtrack, greeting, real, report};
use calib_capture::{
    Address, CaptureError, Ended, Frame, Guide, Input, JointSource, Lines, Plan, Session, Source,
    SourceError, Table, Watched, WatchedKind, survey,
};
use calib_recording::{ReadOptions, read_bytes, read_path};
use nalgebra::Isometry3;
use std::io::{Read, Write};
use std::net::{TcpListener, UdpSocket};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

fn pose(x: f64) -> Isometry3<f64> {
    Isometry3::translation(x, 0.2, 0.3)
}

fn udp() -> (Source, UdpSocket) {
    let source = Source::open(&Address::Dtrack {
        port: 0,
        group: None,
    })
    .expect("a free port");
    let sender = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    sender
        .connect(("127.0.0.1", source.port().expect("bound")))
        .expect("loopback");
    (source, sender)
}

/// The next `count` inputs that are not nothing; gives up after ten seconds.
fn inputs(source: &mut Source, count: usize) -> Vec<Input> {
    let began = Instant::now();
    let mut found = Vec::new();
    while found.len() < count && began.elapsed() < Duration::from_secs(10) {
        match source.next(Duration::from_millis(100)).expect("open") {
            Input::Nothing => {}
            input => found.push(input),
        }
    }
    found
}

fn frames(inputs: Vec<Input>) -> Vec<Frame> {
    inputs
        .into_iter()
        .flat_map(|input| match input {
            Input::Frames(frames) => frames,
            _ => Vec::new(),
        })
        .collect()
}

fn plan(name: &str) -> Plan {
    Plan {
        columns: Vec::new(),
        joints: JointSource::Udp(0),
        guide: Guide::default(),
        watched: vec![Watched {
            name: "hand".into(),
            from: name.into(),
            kind: WatchedKind::Body,
        }],
        moved: Vec::new(),
        continuous: false,
        hold: 1.0,
        near: (0.02, 0.002),
        all: true,
        patience: 0.5,
        longest: None,
    }
}

/// A session of the plan for a body of that name, which writes to `path`.
fn session(path: &std::path::Path, name: &str) -> Session<'static> {
    let plan = plan(name);
    let table = Table::create(path, &[], &plan.header()).expect("made");
    Session::new(plan, table)
}

#[test]
fn datagrams_of_ours_and_of_others() {
    let (mut source, sender) = udp();
    let parts: [&[u8]; 6] = [
        &dtrack(1, Some(10.0), &[(0, pose(0.1))]),
        b"ping",
        b"\x00\xff\x00\xff",
        b"fr x\r\n\0",
        b"",
        &dtrack(2, None, &[(0, pose(0.2)), (1, pose(0.3))]),
    ];
    for part in parts {
        sender.send(part).expect("sent");
    }
    let found = inputs(&mut source, 6);
    assert_eq!(found.len(), 6);
    let foreign: Vec<&String> = found
        .iter()
        .filter_map(|i| match i {
            Input::Foreign(why) => Some(why),
            _ => None,
        })
        .collect();
    assert_eq!(foreign.len(), 4);
    assert_eq!(
        *foreign[0],
        "4 bytes that begin `ping`, expected `fr <number>`"
    );
    assert!(foreign[2].contains("datagram:1:"), "{}", foreign[2]);
    let frames = frames(found);
    assert_eq!(frames[0].device, Some(10.0));
    assert_eq!((frames[1].device, frames[1].bodies.len()), (None, 2));
}

#[test]
fn a_real_log_datagram_by_datagram_is_the_log() {
    for file in [
        "synthetic_2bodies_dropout_midnight.dtrack",
        "manual_examples.dtrack",
        "captured_quoted_in_public_code.dtrack",
    ] {
        let Some(log) = real(&format!("dtrack/{file}")) else {
            return;
        };
        let whole = read_bytes(file, &log, &ReadOptions::default()).expect("readable");
        let (mut source, sender) = udp();
        let mut live = Vec::new();
        for part in datagrams(&log) {
            // One at a time: a burst would overflow the system's buffer.
            sender.send(&part).expect("sent");
            live.extend(frames(inputs(&mut source, 1)));
        }
        assert_eq!(live.len(), whole.timelines[0].len(), "{file}");
        for body in &whole.bodies {
            for (frame, expected) in live.iter().zip(&body.tracker_from_body) {
                assert_eq!(frame.bodies.get(&body.name), expected.as_ref(), "{file}");
            }
        }
    }
}

#[test]
fn lost_disordered_and_foreign_datagrams_in_a_recording() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.csv");
    let mut session = session(&path, "body_0");
    let (mut source, sender) = udp();
    for number in [1u64, 2, 4, 3, 4, 5, 8] {
        let seen: &[(u32, Isometry3<f64>)] = if number == 5 { &[] } else { &[(0, pose(0.5))] };
        sender
            .send(&dtrack(number, Some(100.0 + number as f64 * 0.01), seen))
            .expect("sent");
        sender.send(b"who is there?").expect("sent");
    }
    let (_keys, keys) = channel();
    let began = Instant::now();
    let clock = || began.elapsed().as_secs_f64();
    let mut text = Vec::new();
    let mut screen = Lines::new(&mut text);
    let ended = session
        .record(&mut source, &mut None, &keys, &clock, &mut screen)
        .expect("recorded");
    assert!(matches!(ended, Ended::Silent(_)), "{ended:?}");
    session.report(&mut screen);
    let summary = session.summary();
    assert_eq!(summary.frames, (5, 3, 2));
    assert_eq!((summary.foreign, summary.rows), (7, 5));
    let recording = read_path(&path, &ReadOptions::default()).expect("readable");
    let hand = &recording.bodies[0].tracker_from_body;
    let seen: Vec<bool> = hand.iter().map(Option::is_some).collect();
    assert_eq!(seen, [true, true, true, false, true]);
    let text = String::from_utf8(text).expect("text");
    assert!(
        text.contains("3 missing, 2 late or duplicate (dropped), 7 not readable"),
        "{text}"
    );
}

#[test]
fn a_silent_tracker_is_told() {
    let (mut source, _sender) = udp();
    let began = Instant::now();
    // A clock that runs forty times faster: the messages of ten seconds in a quarter of one.
    let clock = || 40.0 * began.elapsed().as_secs_f64();
    let mut text = Vec::new();
    let mut screen = Lines::new(&mut text);
    let ended = survey(
        &mut source,
        &mut None,
        &clock,
        (1.0, 12.0),
        false,
        &mut screen,
    )
    .expect("open");
    let ended = ended.expect_err("nobody sends");
    assert!(matches!(ended, Ended::Silent(s) if s >= 12.0));
    assert!(
        ended
            .to_string()
            .contains("sends to this computer and port")
    );
    let text = String::from_utf8(text).expect("text");
    assert!(text.contains("no data from the tracker for"), "{text}");
}

/// What arrives and cannot be read is said to, and not called silence.
#[test]
fn another_program_on_the_port_is_told() {
    let (mut source, sender) = udp();
    sender.send(b"hello tracker\r\n").expect("loopback");
    let began = Instant::now();
    let clock = || 40.0 * began.elapsed().as_secs_f64();
    let mut text = Vec::new();
    let mut screen = Lines::new(&mut text);
    let ended = survey(
        &mut source,
        &mut None,
        &clock,
        (1.0, 12.0),
        false,
        &mut screen,
    )
    .expect("open");
    let ended = ended.expect_err("no frame").to_string();
    assert!(
        ended.starts_with("what arrives is not from the tracker: 15 bytes"),
        "{ended}"
    );
}

/// A VRPN server that says this and then, when asked to, hangs up.
fn server(says: Vec<u8>, stays: bool) -> (u16, std::thread::JoinHandle<Vec<u8>>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("bound").port();
    let thread = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        let mut greeting = vec![0; 24];
        stream.read_exact(&mut greeting).expect("a greeting");
        for piece in says.chunks(61) {
            if stream.write_all(piece).is_err() {
                return greeting;
            }
        }
        if stays {
            // Until the client goes.
            let _ = stream.read(&mut [0; 16]);
        }
        greeting
    });
    (port, thread)
}

fn vrpn(port: u16, device: Option<&str>) -> Address {
    Address::Vrpn {
        device: device.map(str::to_string),
        host: "127.0.0.1".into(),
        port,
    }
}

#[test]
fn a_vrpn_server_until_it_goes() {
    let mut says = greeting("Head");
    for i in 0..150 {
        let stamp = (100, i * 6000);
        says.extend(report(stamp, 0, &pose(f64::from(i))));
        says.extend(report(stamp, 1, &pose(-f64::from(i))));
    }
    let (port, thread) = server(says, false);
    let mut source = Source::open(&vrpn(port, None)).expect("connected");
    let mut all = Vec::new();
    loop {
        match source.next(Duration::from_secs(5)).expect("vrpn") {
            Input::Frames(frames) => all.extend(frames),
            Input::Closed => break,
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(
        thread.join().expect("served"),
        calib_capture::vrpn::GREETING
    );
    let of = |name: &str| all.iter().filter(|f| f.bodies.contains_key(name)).count();
    assert_eq!((of("Head_0"), of("Head_1")), (150, 150));
    assert!(all.windows(2).all(|w| w[0].device < w[1].device));
}

#[test]
fn the_real_bytes_of_a_server() {
    let Some(bytes) = real("vrpn/vrpn_07.38_server_to_client_tcp_first24k.bin") else {
        return;
    };
    let (port, thread) = server(bytes.clone(), false);
    let mut source = Source::open(&vrpn(port, Some("DTrack"))).expect("connected");
    let mut all = Vec::new();
    loop {
        match source.next(Duration::from_secs(5)).expect("vrpn") {
            Input::Frames(frames) => all.extend(frames),
            Input::Closed => break,
            other => panic!("{other:?}"),
        }
    }
    drop(thread.join());
    let of = |name: &str| all.iter().filter(|f| f.bodies.contains_key(name)).count();
    assert_eq!((of("DTrack_0"), of("DTrack_2")), (26, 38));
    // Two devices with two clocks: one must be chosen.
    let (port, thread) = server(bytes, true);
    let mut source = Source::open(&vrpn(port, None)).expect("connected");
    let error = loop {
        match source.next(Duration::from_secs(5)) {
            Ok(Input::Closed) => panic!("closed"),
            Ok(_) => {}
            Err(error) => break error,
        }
    };
    assert!(matches!(&error, SourceError::Devices { devices, .. } if devices.len() == 2));
    drop(source);
    drop(thread.join());
}

#[test]
fn servers_that_are_none() {
    let says = |text: &[u8]| {
        let (port, thread) = server(text.to_vec(), true);
        let error = Source::open(&vrpn(port, None)).expect_err("no server");
        drop(thread.join());
        error.to_string().replace(&port.to_string(), "PORT")
    };
    assert_eq!(
        says(b"vrpn: ver. 06.04  0\0\0\0\0\0"),
        "127.0.0.1:PORT: the server uses VRPN 06.04, this program VRPN 07; the major versions must match"
    );
    assert!(says(b"SSH-2.0-OpenSSH\r\n").contains("found `S`"));
    let (port, thread) = server(Vec::new(), false);
    let error = Source::open(&vrpn(port, None)).expect_err("mute");
    assert!(matches!(error, SourceError::Mute { .. }), "{error}");
    drop(thread.join());
    // Nobody listens on a port that was just given back.
    let free = TcpListener::bind("127.0.0.1:0")
        .expect("free")
        .local_addr()
        .expect("bound")
        .port();
    let error = Source::open(&vrpn(free, None)).expect_err("nobody");
    assert!(matches!(error, SourceError::Connect { .. }), "{error}");
}

#[test]
fn a_stream_that_goes_wrong_in_the_middle_keeps_what_was_recorded() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.csv");
    let mut session = session(&path, "Head_0");
    let mut says = greeting("Head");
    for i in 0..20 {
        says.extend(report((100, i * 10_000), 0, &pose(0.1)));
    }
    let (port, thread) = server([says, vec![0xff; 64]].concat(), true);
    let mut source = Source::open(&vrpn(port, None)).expect("connected");
    let (_keys, keys) = channel();
    let began = Instant::now();
    let clock = || began.elapsed().as_secs_f64();
    let mut screen = Lines::new(Vec::new());
    let ended = session.record(&mut source, &mut None, &keys, &clock, &mut screen);
    let error = ended.expect_err("no message has this length");
    assert!(
        matches!(error, CaptureError::Source(SourceError::Vrpn { .. })),
        "{error}"
    );
    drop(source);
    drop(thread.join());
    let recording = read_path(&path, &ReadOptions::default()).expect("readable");
    assert!(recording.timelines[0].len() >= 10);
}

#[test]
fn a_multicast_group_and_a_single_marker() {
    let address: Address = "dtrack:239.77.3.1:0@127.0.0.1".parse().expect("an address");
    assert_eq!(address.to_string(), "dtrack:239.77.3.1:0@127.0.0.1");
    let mut source = Source::open(&address).expect("joined");
    // Bound to the loopback, so that the group is that of the loopback.
    let sender = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    let to = ("239.77.3.1", source.port().expect("bound"));
    for text in [
        "fr 1\r\n3d 1 [7 1.000][1000 2000 3000]\r\n\0",
        "fr 2\r\n3d 2 [7 1.000][1 2 3] [9 1.000][4 5 6]\r\n\0",
        "fr 3\r\n3d 1 [9 1.000][1001 2000 3000]\r\n\0",
    ] {
        sender.send_to(text.as_bytes(), to).expect("sent");
    }
    let frames = frames(inputs(&mut source, 3));
    let x: Vec<Option<f64>> = frames.iter().map(|f| Some(f.point("marker")?.x)).collect();
    // Whatever its number; of two, nobody knows which is which.
    assert_eq!(x, [Some(1.0), None, Some(1.001)]);
    for bad in [
        "dtrack:10.0.0.1:5000",
        "dtrack:239.1.2.3",
        "dtrack:239.1.2.3:5000@here",
    ] {
        assert!(bad.parse::<Address>().is_err(), "{bad}");
    }
}
