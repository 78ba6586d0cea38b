//! Files that were cut, bent or glued: an error with a place or a recording without NaN, never a panic, and never
//! more memory than the file can fill.

use crate::{bags, fixtures};
use calib_recording::readers::readers;
use calib_recording::{At, Filled, ReadOptions, Recording, read_bytes};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Bent copies of each fixture.
const ROUNDS: usize = 1500;

/// Every reader's fixtures.
pub fn corpus() -> Vec<(&'static str, Vec<u8>)> {
    let mut corpus = vec![
        ("csv", b"# note\npose,trial,elbow_deg,m1.x_mm,m1.y_mm,m1.z_mm,h.x_m,h.y_m,h.z_m,h.qx,h.qy,h.qz,h.qw\n0,a,180,1000,2000,3000,0.1,0.2,0.3,0,0,0,1\n1,b,-90,,,,,,,,,,\n".to_vec()),
        ("csv", b"frame,marker,x_mm,y_mm,z_mm\n5,b,1,2,3\n5,a,4,5,6\n7,a,7,8,9\n".to_vec()),
        ("vicon_csv", fixtures::NEXUS.as_bytes().to_vec()),
        ("vicon_csv", fixtures::WORKSTATION.as_bytes().to_vec()),
        ("motive_csv", fixtures::motive().into_bytes()),
        ("qualisys_tsv", fixtures::QTM_3D.as_bytes().to_vec()),
        ("qualisys_tsv", fixtures::qtm_6d().into_bytes()),
        ("dtrack", fixtures::DTRACK.as_bytes().to_vec()),
        ("trc", fixtures::TRC.as_bytes().to_vec()),
        ("ur_rtde", b"timestamp actual_q_0 actual_q_1 actual_q_2 actual_q_3 actual_q_4 actual_q_5\r\n1.5 0 1 2 3 4 5\r\n".to_vec()),
        ("franka", b"time,success_rate,state.q[0],state.q[1],state.q[2],state.q[3],state.q[4],state.q[5],state.q[6]\n12,1,0.1,0.2,0.3,0.4,0.5,0.6,0.7\n".to_vec()),
        ("ndi", b"Frame#,ToolHandle,Face,q0,qx,qy,qz,tx,ty,tz\n1,02,0,0,1,0,0,10,20,30\n1,03,0,Missing,,,,,,\n".to_vec()),
    ];
    corpus.extend(fixtures::ENCODINGS.map(|encoding| ("c3d", fixtures::small_c3d(encoding))));
    corpus.extend(
        ["none", "", "lz4", "zstd"].map(|compression| ("ros2_mcap", bags::mcap(compression))),
    );
    corpus.push(("ros2_sqlite", bags::sqlite()));
    corpus
}

/// Samples of a recording, all of them finite.
fn checked_size(recording: &Recording) -> usize {
    let n = |timeline: usize| recording.timelines[timeline].len();
    for marker in &recording.markers {
        assert_eq!(marker.samples.len(), n(marker.timeline));
        let points = marker
            .samples
            .iter()
            .filter_map(|sample| sample.point(Filled::Include));
        assert!(
            points
                .into_iter()
                .all(|point| point.iter().all(|x| x.is_finite())),
            "{}",
            marker.name
        );
    }
    for body in &recording.bodies {
        assert_eq!(body.tracker_from_body.len(), n(body.timeline));
        for pose in body.tracker_from_body.iter().flatten() {
            assert!(
                pose.translation
                    .vector
                    .iter()
                    .chain(pose.rotation.coords.iter())
                    .all(|x| x.is_finite())
            );
        }
    }
    for joint in &recording.joints {
        assert_eq!(joint.q.len(), n(joint.timeline));
        assert!(joint.q.iter().flatten().all(|q| q.is_finite()));
    }
    for t in recording
        .timelines
        .iter()
        .filter_map(|timeline| timeline.t.as_ref())
    {
        assert!(t.windows(2).all(|w| w[1] >= w[0]));
    }
    recording
        .timelines
        .iter()
        .map(calib_recording::Timeline::len)
        .sum::<usize>()
        * (recording.markers.len() + recording.bodies.len())
}

fn try_all(bytes: &[u8], own: &str) {
    for format in [None, Some(own.to_string())] {
        let options = ReadOptions {
            format,
            ..ReadOptions::default()
        };
        match read_bytes("x", bytes, &options) {
            Ok(recording) => assert!(checked_size(&recording) <= (1 << 21) + 1000 * bytes.len()),
            Err(error) => {
                let text = error.to_string();
                assert!(text.starts_with("x:") && text.len() < 2000, "{text}");
                if let At::Byte(byte) = error.at {
                    assert!(byte <= bytes.len() as u64 + 512, "{text}");
                }
            }
        }
    }
}

#[test]
fn every_reader_has_a_fixture_and_recognizes_it() {
    for reader in readers() {
        let own: Vec<_> = corpus()
            .into_iter()
            .filter(|(id, _)| *id == reader.id)
            .collect();
        assert!(!own.is_empty(), "{} has no fixture", reader.id);
        for (_, bytes) in own {
            assert_eq!(fixtures::read("x", &bytes).meta.format, reader.id);
        }
    }
}

#[test]
fn empty_and_cut_files() {
    for (id, bytes) in corpus() {
        // Every length of short files, every 37th of bags.
        for length in (0..bytes.len()).step_by(if bytes.len() > 2500 { 37 } else { 1 }) {
            try_all(&bytes[..length], id);
        }
    }
}

#[test]
fn bent_files() {
    bend(6, ROUNDS);
}

#[test]
#[ignore = "minutes: the same with a hundred times more copies"]
fn many_bent_files() {
    for seed in 0..100 {
        bend(1000 + seed, ROUNDS);
    }
}

fn bend(seed: u64, rounds: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for (id, bytes) in corpus() {
        for _ in 0..rounds {
            let mut bent = bytes.clone();
            for _ in 0..rng.random_range(1..=3) {
                let at = rng.random_range(0..bent.len());
                match rng.random_range(0..5) {
                    0 => bent[at] ^= 1 << rng.random_range(0..8),
                    1 => bent[at] = rng.random(),
                    2 => drop(bent.remove(at)),
                    3 => bent.insert(
                        at,
                        *b"0919,;\t\n-.[]e \0\xff"
                            .get(rng.random_range(0..17))
                            .unwrap_or(&b'x'),
                    ),
                    _ => {
                        let end = (at + rng.random_range(1..40)).min(bent.len());
                        let piece = bent[at..end].to_vec();
                        let to = rng.random_range(0..=bent.len());
                        bent.splice(to..to, piece);
                    }
                }
                if bent.is_empty() {
                    break;
                }
            }
            try_all(&bent, id);
        }
    }
}

#[test]
fn every_byte_of_a_c3d_header_and_its_parameters() {
    for encoding in fixtures::ENCODINGS {
        let whole = fixtures::small_c3d(encoding);
        for at in (0..32).chain(512..760) {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut bent = whole.clone();
                bent[at] = value;
                try_all(&bent, "c3d");
            }
        }
    }
}

#[test]
fn a_reader_that_is_forced_onto_another_format_fails_in_peace() {
    for (_, bytes) in corpus() {
        for reader in readers() {
            try_all(&bytes, reader.id);
        }
    }
}
