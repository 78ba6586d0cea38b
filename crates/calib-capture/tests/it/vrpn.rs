//! VRPN: greeting, messages whole and in pieces, and streams that are none.

use crate::senders::{greeting, message, name, real, report};
use calib_capture::dtrack::datagram;
use calib_capture::vrpn::{Decoder, Grouper, Message, Place, VrpnError};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

fn pose(x: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(x, -0.5, 1.25),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.3)),
    )
}

fn stream() -> Vec<u8> {
    let mut bytes = greeting("Head");
    bytes.extend(message((5, 6), 1, 9, &[1, 2, 3]));
    bytes.extend(report((10, 250_000), 0, &pose(1.0)));
    bytes.extend(report((10, 250_000), 2, &pose(2.0)));
    bytes.extend(report((10, 260_000), 0, &pose(3.0)));
    bytes.extend(message((0, 0), 0, -5, &[]));
    bytes
}

#[test]
fn whole_and_byte_by_byte_say_the_same() {
    let bytes = stream();
    let mut whole = Decoder::default();
    let all = whole.push(&bytes).expect("vrpn");
    assert_eq!(all.len(), 4);
    assert_eq!(
        all[1],
        Message::Sensor {
            device: "Head".into(),
            sensor: 2,
            stamp: (10, 250_000),
            place: Place::Pose(pose(2.0))
        }
    );
    assert_eq!(all[3], Message::Goodbye);
    assert_eq!(whole.devices(), ["Head"]);
    let mut slow = Decoder::default();
    let mut pieces = Vec::new();
    for byte in &bytes {
        pieces.extend(slow.push(std::slice::from_ref(byte)).expect("vrpn"));
    }
    assert_eq!(pieces, all);
}

#[test]
fn wrong_greetings() {
    let push = |bytes: &[u8]| Decoder::default().push(bytes).expect_err("no greeting");
    let version = |v: &str| format!("vrpn: ver. {v}  0\0\0\0\0\0\0\0\0\0")[..24].to_string();
    assert_eq!(
        push(version("06.10").as_bytes()),
        VrpnError::Version {
            found: "06.10".into()
        }
    );
    assert!(matches!(
        push(b"HTTP/1.1 400 Bad Request\r\n"),
        VrpnError::NotVrpn { .. }
    ));
    // Wrong from the first byte is said at once.
    assert!(matches!(push(b"\x01"), VrpnError::NotVrpn { .. }));
    let mut other = Decoder::default();
    assert!(other.push(version("07.99").as_bytes()).is_ok() && other.greeted());
}

#[test]
fn lengths_that_no_message_has() {
    for length in [i32::MIN, -1, 0, 23, 64_001, i32::MAX] {
        let mut bytes = greeting("Head");
        let at = bytes.len() as u64;
        bytes.extend(length.to_be_bytes());
        bytes.extend([0; 20]);
        let error = Decoder::default().push(&bytes).expect_err("a wrong length");
        assert_eq!(error, VrpnError::Length { byte: at, length });
    }
}

#[test]
fn poses_that_are_none() {
    let mut bytes = greeting("Head");
    let good = report((1, 0), 0, &pose(1.0));
    for (from, value) in [(8, f64::NAN), (16, f64::INFINITY), (56, 3.0)] {
        let mut bad = good.clone();
        bad[24 + from..32 + from].copy_from_slice(&value.to_be_bytes());
        bytes.extend(bad);
    }
    // A stamp beyond the second, a payload that is too short, a type without a name.
    bytes.extend(report((1, 1_000_000), 7, &pose(1.0)));
    bytes.extend(message((1, 0), 1, 4, &[0; 40]));
    bytes.extend(message((1, 0), 1, 77, &good[24..]));
    bytes.extend(message((1, 0), 1, -2, &[0xff; 7]));
    bytes.extend(good);
    let messages = Decoder::default().push(&bytes).expect("vrpn");
    let bad = |m: &&Message| matches!(m, Message::BadPose { .. });
    assert_eq!(messages.iter().filter(bad).count(), 4);
    assert_eq!(messages.len(), 5);
}

#[test]
fn names_do_not_pile_up() {
    let mut decoder = Decoder::default();
    decoder.push(&greeting("Head")).expect("vrpn");
    for id in 0..5000 {
        decoder.push(&name(-1, id, "a device")).expect("vrpn");
    }
    assert!(decoder.devices().len() <= 2000);
}

#[test]
fn reports_of_one_instant_are_one_frame() {
    let mut grouper = Grouper::default();
    let mut frames = Vec::new();
    for (t, sensor) in [
        (0, 0),
        (0, 1),
        (800, 2),
        (10_000, 1),
        (10_000, 0),
        (10_100, 0),
        (20_000, 2),
    ] {
        frames.extend(grouper.report(format!("s{sensor}"), (7, t), Place::Pose(pose(0.0))));
    }
    frames.extend(grouper.finish());
    let names: Vec<String> = frames
        .iter()
        .map(|f| {
            f.bodies
                .keys()
                .map(String::as_str)
                .collect::<Vec<_>>()
                .join(" ")
        })
        .collect();
    assert_eq!(names, ["s0 s1 s2", "s0 s1", "s0", "s2"]);
    assert_eq!(frames[1].device, Some(7.01));
    assert!(grouper.finish().is_none());
}

#[test]
fn a_real_stream_that_was_cut() {
    let Some(bytes) = real("vrpn/vrpn_07.38_server_to_client_tcp_first24k.bin") else {
        return;
    };
    let mut decoder = Decoder::default();
    let mut counts: BTreeMap<(String, i32), usize> = BTreeMap::new();
    for piece in bytes.chunks(97) {
        for message in decoder.push(piece).expect("vrpn") {
            match message {
                Message::Sensor { device, sensor, .. } => {
                    *counts.entry((device, sensor)).or_default() += 1
                }
                other => panic!("{other:?}"),
            }
        }
    }
    let counts: Vec<(String, usize)> = counts
        .into_iter()
        .map(|((d, s), n)| (format!("{d} {s}"), n))
        .collect();
    let expected = [
        ("DTrack 0", 26),
        ("DTrack 2", 38),
        ("Tracker0 0", 31),
        ("Tracker0 1", 31),
    ];
    assert_eq!(counts, expected.map(|(name, n)| (name.to_string(), n)));
    assert_eq!(decoder.devices(), ["Tracker0", "DTrack"]);
}

/// What VRPN's own client printed of a server that was fed with the synthetic DTrack log: the same log, through our
/// sender and our decoder, gives the same number of reports of each sensor and the same poses.
#[test]
fn the_synthetic_log_gives_what_vrpns_client_printed() {
    let (Some(printed), Some(log)) = (
        real("vrpn/vrpn_print_devices_of_synthetic_dtrack.txt"),
        real("dtrack/synthetic_2bodies_dropout_midnight.dtrack"),
    ) else {
        return;
    };
    let mut bytes = greeting("DTrack");
    for (i, part) in crate::senders::datagrams(&log).iter().enumerate() {
        for frame in datagram(part).expect("readable") {
            for (name, pose) in &frame.bodies {
                let sensor = name
                    .strip_prefix("body_")
                    .expect("a body")
                    .parse()
                    .expect("a number");
                let t = i as i32 * 16_667;
                bytes.extend(report((t / 1_000_000, t % 1_000_000), sensor, pose));
            }
        }
    }
    let mut ours: BTreeMap<i32, Vec<Isometry3<f64>>> = BTreeMap::new();
    for message in Decoder::default().push(&bytes).expect("vrpn") {
        if let Message::Sensor {
            sensor,
            place: Place::Pose(pose),
            ..
        } = message
        {
            ours.entry(sensor).or_default().push(pose);
        }
    }
    assert_eq!(ours[&1].len(), 150);
    assert_eq!(ours[&0].len(), 180);
    let text = String::from_utf8(printed).expect("text");
    let lines: Vec<&str> = text.lines().collect();
    for sensor in [0, 1] {
        let wanted = format!("sensor {sensor}:");
        let theirs: Vec<Vec<f64>> = lines
            .windows(2)
            .filter(|pair| pair[0].ends_with(&wanted))
            .map(|pair| {
                let numbers = pair[1].split(|c: char| !(c.is_ascii_digit() || "-.".contains(c)));
                numbers.filter_map(|n| n.parse().ok()).collect()
            })
            .collect();
        assert_eq!(theirs.len(), ours[&sensor].len());
        for (pose, numbers) in ours[&sensor].iter().zip(&theirs) {
            let (p, q) = (pose.translation.vector, pose.rotation.coords);
            let mine = [p.x, p.y, p.z, q[0], q[1], q[2], q[3]];
            let sign = if mine[6] * numbers[6] < 0.0 {
                -1.0
            } else {
                1.0
            };
            for (k, (a, b)) in mine.iter().zip(numbers).enumerate() {
                let b = if k < 3 { *b } else { sign * b };
                // Printed with two decimals.
                assert!((a - b).abs() < 0.0051, "{mine:?} {numbers:?}");
            }
        }
    }
}

#[test]
fn a_sensor_without_orientation_is_a_marker() {
    let mut bytes = greeting("Leds");
    let mut point = report((1, 0), 3, &pose(1.5));
    point[56..80].fill(0);
    // The last of the quaternion.
    point[80..].fill(0);
    bytes.extend(point);
    let messages = Decoder::default().push(&bytes).expect("vrpn");
    let [
        Message::Sensor {
            device,
            sensor,
            stamp,
            place: Place::Point(point),
        },
    ] = &messages[..]
    else {
        panic!("{messages:?}");
    };
    assert_eq!((device.as_str(), *sensor, point.x), ("Leds", 3, 1.5));
    let mut grouper = Grouper::default();
    grouper.report("s0".into(), *stamp, Place::Pose(pose(0.0)));
    grouper.report("s3".into(), *stamp, Place::Point(*point));
    let frame = grouper.finish().expect("a frame");
    assert_eq!((frame.bodies.len(), frame.point("s3")), (1, Some(*point)));
}
