//! Senders of our own: DTrack datagrams and a VRPN server.

use nalgebra::Isometry3;

/// One DTrack datagram; `bodies` as (id, `room_from_body`).
pub fn dtrack(frame: u64, ts: Option<f64>, bodies: &[(u32, Isometry3<f64>)]) -> Vec<u8> {
    let mut text = format!("fr {frame}\r\n");
    if let Some(ts) = ts {
        text.push_str(&format!("ts {ts:.6}\r\n"));
    }
    text.push_str(&format!("6dcal 2\r\n6d {} ", bodies.len()));
    for (id, pose) in bodies {
        let p = pose.translation.vector * 1000.0;
        let r = pose.rotation.to_rotation_matrix();
        let b: Vec<String> = r.matrix().iter().map(|v| format!("{v:.6}")).collect();
        text.push_str(&format!(
            "[{id} 1.000][{:.3} {:.3} {:.3} 0 0 0][{}] ",
            p.x,
            p.y,
            p.z,
            b.join(" ")
        ));
    }
    text.push_str("\r\n\0");
    text.into_bytes()
}

/// A VRPN message: header, payload, padding.
pub fn message(stamp: (i32, i32), sender: i32, kind: i32, payload: &[u8]) -> Vec<u8> {
    let length = 24 + payload.len();
    let mut bytes = Vec::new();
    for word in [length as i32, stamp.0, stamp.1, sender, kind, 0] {
        bytes.extend(word.to_be_bytes());
    }
    bytes.extend(payload);
    bytes.resize(length.next_multiple_of(8), 0);
    bytes
}

/// A sender's (−1) or type's (−2) name.
pub fn name(kind: i32, id: i32, name: &str) -> Vec<u8> {
    let mut payload = (name.len() as i32 + 1).to_be_bytes().to_vec();
    payload.extend(name.bytes());
    payload.push(0);
    message((0, 0), id, kind, &payload)
}

/// A pose of sender 1, of type 4.
pub fn report(stamp: (i32, i32), sensor: i32, pose: &Isometry3<f64>) -> Vec<u8> {
    let mut payload = sensor.to_be_bytes().to_vec();
    payload.extend(0i32.to_be_bytes());
    let (p, q) = (pose.translation.vector, pose.rotation.coords);
    for value in [p.x, p.y, p.z, q[0], q[1], q[2], q[3]] {
        payload.extend(value.to_be_bytes());
    }
    message(stamp, 1, 4, &payload)
}

/// Greeting and names, as a server sends them first.
pub fn greeting(device: &str) -> Vec<u8> {
    [
        b"vrpn: ver. 07.38  0\0\0\0\0\0".to_vec(),
        name(-1, 0, "VRPN Control"),
        name(-1, 1, device),
        name(-2, 4, "vrpn_Tracker Pos_Quat"),
    ]
    .concat()
}

/// A file of `CALIB_REAL_DATA/formats`; `None`, counted as skipped, where it is not there.
pub fn real(path: &str) -> Option<Vec<u8>> {
    let path = skipped_tests::real_data("formats")?.join(path);
    Some(std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

/// The datagrams of a log, each with its NUL.
pub fn datagrams(log: &[u8]) -> Vec<Vec<u8>> {
    log.split_inclusive(|&b| b == 0)
        .map(<[u8]>::to_vec)
        .filter(|d| d.iter().any(|b| !b.is_ascii_whitespace() && *b != 0))
        .collect()
}
