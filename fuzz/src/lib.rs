//! What every fuzz target demands of a reader: an error with a place, or a recording that holds together.
//!
//! Memory is watched by the fuzzer itself (`-malloc_limit_mb`, `-rss_limit_mb`), time by `-timeout`.

pub mod robot;

use calib_capture::{Order, dtrack, parse_joints, vrpn};
use calib_recording::{
    At, ColumnMap, Filled, ReadOptions, Recording, WriteOptions, read_bytes, write_recording,
};

/// Reads the bytes as the format `id`, and once more as whatever they look like.
pub fn read_as(id: &str, bytes: &[u8]) {
    let options = ReadOptions {
        format: Some(id.to_string()),
        ..ReadOptions::default()
    };
    check(bytes, &options);
    check(bytes, &ReadOptions::default());
}

/// Reads a table whose columns the first line describes (a [`ColumnMap`] as JSON).
pub fn read_mapped(bytes: &[u8]) {
    let end = bytes.iter().position(|&byte| byte == b'\n');
    let (map, table) = bytes.split_at(end.unwrap_or(bytes.len()));
    let Ok(map) = serde_json::from_slice::<ColumnMap>(map) else {
        return;
    };
    let table = table.get(1..).unwrap_or_default();
    let options = ReadOptions {
        columns: Some(map),
        ..ReadOptions::default()
    };
    check(table, &options);
}

fn check(bytes: &[u8], options: &ReadOptions) {
    match read_bytes("x", bytes, options) {
        Ok(recording) => holds_together(&recording, bytes.len()),
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with("x:"), "no place: {text}");
            assert!(text.len() < 20_000, "{} bytes of message", text.len());
            if let At::Byte(byte) = error.at {
                assert!(byte <= bytes.len() as u64 + 512, "{text}");
            }
        }
    }
}

/// Equal lengths, finite numbers, times that do not fall, and not much larger than the file.
fn holds_together(recording: &Recording, bytes: usize) {
    let n = |timeline: usize| recording.timelines[timeline].len();
    let mut samples = 0;
    for marker in &recording.markers {
        assert_eq!(marker.samples.len(), n(marker.timeline));
        samples += marker.samples.len();
        for sample in &marker.samples {
            if let Some(point) = sample.point(Filled::Include) {
                assert!(point.iter().all(|x| x.is_finite()));
            }
        }
    }
    for body in &recording.bodies {
        assert_eq!(body.tracker_from_body.len(), n(body.timeline));
        samples += body.tracker_from_body.len();
        for pose in body.tracker_from_body.iter().flatten() {
            assert!(pose.translation.vector.iter().all(|x| x.is_finite()));
            assert!(pose.rotation.coords.iter().all(|x| x.is_finite()));
            assert!((pose.rotation.coords.norm() - 1.0).abs() < 1e-9);
        }
        for quality in body.quality.iter().flatten() {
            assert!(quality.is_finite());
        }
    }
    for joint in &recording.joints {
        assert_eq!(joint.q.len(), n(joint.timeline));
        samples += joint.q.len();
        assert!(joint.q.iter().flatten().all(|q| q.is_finite()));
    }
    for torque in &recording.torques {
        assert_eq!(torque.torque.len(), n(torque.timeline));
        assert!(torque.torque.iter().flatten().all(|value| value.is_finite()));
    }
    for timeline in &recording.timelines {
        if let Some(t) = &timeline.t {
            assert_eq!(t.len(), timeline.len());
            assert!(t.windows(2).all(|pair| pair[1] >= pair[0]));
            assert!(t.iter().all(|t| t.is_finite()));
        }
        for labels in timeline.labels.values() {
            assert_eq!(labels.len(), timeline.len());
        }
    }
    assert!(samples <= (1 << 21) + 1000 * bytes, "{samples} samples");
    // What can be read can be used: as one table, and written as our own.
    for timeline in 0..recording.timelines.len() {
        let _ = recording.poses_of(timeline, Filled::Include);
    }
    let _ = write_recording(recording, &WriteOptions::micro());
}

/// A datagram on the tracker's port, and on the robot's.
pub fn datagram(bytes: &[u8]) {
    if let Ok(joints) = parse_joints(bytes) {
        assert!(joints.values().all(|q| q.is_finite()));
    }
    let _ = dtrack::is_ours(bytes);
    let Ok(frames) = dtrack::datagram(bytes) else {
        return;
    };
    assert!(frames.len() <= bytes.len());
    let mut order = Order::default();
    for frame in &frames {
        frame.bodies.values().for_each(finite);
        order.arrives(frame);
    }
}

/// A stream in pieces gives what it gives as a whole.
pub fn stream(bytes: &[u8]) {
    let Some((&size, bytes)) = bytes.split_first() else {
        return;
    };
    let mut whole = vrpn::Decoder::default();
    let mut all = Vec::new();
    let mut ended = whole.push(bytes).map(|messages| all.extend(messages));
    if ended.is_ok() {
        ended = whole.push(&[]).map(|messages| all.extend(messages));
    }
    let mut decoder = vrpn::Decoder::default();
    let mut grouper = vrpn::Grouper::default();
    let mut pieces = Vec::new();
    let mut broken = None;
    for piece in bytes.chunks(usize::from(size).max(1)) {
        match decoder.push(piece) {
            Ok(messages) => pieces.extend(messages),
            Err(error) => {
                broken = Some(error);
                break;
            }
        }
    }
    if broken.is_none() {
        broken = decoder.push(&[]).err();
    }
    // How much of a wrong greeting is quoted depends on how much of it was there.
    assert_eq!(ended.is_err(), broken.is_some());
    assert_eq!(all, pieces);
    for message in pieces {
        if let vrpn::Message::Sensor {
            device,
            stamp,
            place,
            ..
        } = message
        {
            match place {
                vrpn::Place::Pose(pose) => finite(&pose),
                vrpn::Place::Point(point) => assert!(point.iter().all(|x| x.is_finite())),
            }
            if let Some(frame) = grouper.report(device, stamp, place) {
                assert!(frame.device.is_some_and(f64::is_finite));
            }
        }
    }
}

fn finite(pose: &nalgebra::Isometry3<f64>) {
    assert!(pose.translation.vector.iter().all(|x| x.is_finite()));
    assert!(pose.rotation.coords.iter().all(|x| x.is_finite()));
}
