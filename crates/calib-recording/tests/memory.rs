//! Memory that reading a file takes, counted by the allocator: at most twice what the samples themselves are.
//!
//! The file is read from the disk and never held as a whole; what counts is the largest sum of all allocations at any
//! moment, the result included.

use calib_recording::{ReadOptions, read_path};
use std::alloc::{GlobalAlloc, Layout, System};
use std::fmt::Write as _;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
/// From here on the system's allocator grows a block by mapping pages, without a copy (`mremap`).
const LARGE: usize = 128 << 10;

fn grown(by: usize) {
    let now = NOW.fetch_add(by, Relaxed) + by;
    PEAK.fetch_max(now, Relaxed);
}

// SAFETY: every call is the system allocator's own; only sums are kept beside it.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // A small block stands beside its copy for a moment; a large one is given more pages where it is.
        if size < LARGE {
            grown(size);
            NOW.fetch_sub(layout.size(), Relaxed);
        } else if size > layout.size() {
            grown(size - layout.size());
        } else {
            NOW.fetch_sub(layout.size() - size, Relaxed);
        }
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const MARKERS: usize = 40;
const FRAMES: usize = 6000;

fn coordinate(frame: usize, k: usize) -> f64 {
    1000.0 * ((frame as f64 * 0.01 + k as f64).sin() + 0.01 * ((frame * 31 + k * 7) as f64).cos())
}

fn canonical() -> Vec<u8> {
    let mut text = String::from("t_s");
    (0..MARKERS).for_each(|k| write!(text, ",m{k}.x_mm,m{k}.y_mm,m{k}.z_mm").expect("text"));
    for frame in 0..FRAMES {
        write!(text, "\n{:.2}", frame as f64 * 0.01).expect("text");
        (0..3 * MARKERS).for_each(|k| write!(text, ",{:.3}", coordinate(frame, k)).expect("text"));
    }
    text.into_bytes()
}

fn nexus() -> Vec<u8> {
    let mut text = String::from("Trajectories\r\n100\r\n,");
    (0..MARKERS).for_each(|k| write!(text, ",Body:M{k},,").expect("text"));
    text.push_str("\r\nFrame,Sub Frame");
    (0..MARKERS).for_each(|_| text.push_str(",X,Y,Z"));
    text.push_str("\r\n,");
    (0..3 * MARKERS).for_each(|_| text.push_str(",mm"));
    for frame in 0..FRAMES {
        write!(text, "\r\n{},0", frame + 1).expect("text");
        (0..3 * MARKERS).for_each(|k| write!(text, ",{:.3}", coordinate(frame, k)).expect("text"));
    }
    text.into_bytes()
}

fn trc() -> Vec<u8> {
    let mut text = format!(
        "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t{FRAMES}\t{MARKERS}\tmm\t100\t1\t{FRAMES}\nFrame#\tTime"
    );
    (0..MARKERS).for_each(|k| write!(text, "\tM{k}\t\t").expect("text"));
    text.push_str("\n\t");
    (1..=MARKERS).for_each(|k| write!(text, "\tX{k}\tY{k}\tZ{k}").expect("text"));
    text.push_str("\n\n");
    for frame in 0..FRAMES {
        write!(text, "{}\t{:.2}", frame + 1, frame as f64 * 0.01).expect("text");
        (0..3 * MARKERS).for_each(|k| write!(text, "\t{:.3}", coordinate(frame, k)).expect("text"));
        text.push('\n');
    }
    text.into_bytes()
}

fn c3d(float: bool) -> Vec<u8> {
    let mut bytes = vec![0u8; 512];
    bytes[0] = 2;
    bytes[1] = 0x50;
    for (word, value) in [(2, MARKERS as u16), (4, 1), (5, FRAMES as u16), (9, 3)] {
        bytes[2 * word - 2..2 * word].copy_from_slice(&value.to_le_bytes());
    }
    bytes[12..16].copy_from_slice(&if float { -0.1f32 } else { 0.1 }.to_le_bytes());
    bytes[20..24].copy_from_slice(&100f32.to_le_bytes());
    bytes.extend([1, 0x50, 1, 84]);
    bytes.resize(1024, 0);
    for frame in 0..FRAMES {
        for k in 0..4 * MARKERS {
            let value = if k % 4 == 3 {
                1.0
            } else {
                coordinate(frame, k)
            };
            if float {
                bytes.extend((value as f32).to_le_bytes())
            } else {
                bytes.extend((value as i16).to_le_bytes())
            }
        }
    }
    bytes.resize(bytes.len().div_ceil(512) * 512, 0);
    bytes
}

/// Two bodies, 15 000 frames.
fn dtrack() -> Vec<u8> {
    let mut text = String::new();
    for frame in 0..15_000 {
        write!(text, "fr {frame}\r\nts {:.6}\r\n6d 2 ", frame as f64 * 0.01).expect("text");
        for id in 0..2 {
            let x = coordinate(frame, id);
            write!(text, "[{id} 1.000][{x:.3} 1 2 0 0 0][1 0 0 0 1 0 0 0 1] ").expect("text");
        }
        text.push_str("\r\n\0");
    }
    text.into_bytes()
}

/// A bag of 100 000 poses of one body, in chunks of a thousand without compression.
fn mcap() -> Vec<u8> {
    let record = |kind: u8, content: &[u8]| -> Vec<u8> {
        [
            &[kind],
            (content.len() as u64).to_le_bytes().as_slice(),
            content,
        ]
        .concat()
    };
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let one = 1u16.to_le_bytes();
    let mut names = record(
        3,
        &[
            &one,
            text("geometry_msgs/msg/PoseStamped").as_slice(),
            &text("ros2msg"),
            &[0; 4],
        ]
        .concat(),
    );
    names.extend(record(
        4,
        &[
            &one,
            one.as_slice(),
            &text("/hand/pose"),
            &text("cdr"),
            &[0; 4],
        ]
        .concat(),
    ));
    let mut file = b"\x89MCAP0\r\n".to_vec();
    file.extend(record(1, &[text("ros2"), text("test")].concat()));
    for chunk in 0..100u64 {
        let mut records = if chunk == 0 {
            names.clone()
        } else {
            Vec::new()
        };
        for i in chunk * 1000..(chunk + 1) * 1000 {
            let mut data = vec![0, 1, 0, 0];
            data.extend((1 + i as u32 / 100).to_le_bytes());
            data.extend((i as u32 % 100 * 10_000_000).to_le_bytes());
            data.extend([2, 0, 0, 0, b'w', 0, 0, 0]);
            for value in [coordinate(i as usize, 0), 1.0, 2.0, 0.0, 0.0, 0.0, 1.0] {
                data.extend(value.to_le_bytes());
            }
            let time = (i * 10_000_000).to_le_bytes();
            records.extend(record(
                5,
                &[&one, [0; 4].as_slice(), &time, &time, &data].concat(),
            ));
        }
        let sizes = [0u64, 0, records.len() as u64]
            .map(u64::to_le_bytes)
            .concat();
        let packed = (records.len() as u64).to_le_bytes();
        let head = [sizes.as_slice(), &[0; 4], &text(""), &packed].concat();
        file.extend(record(6, &[head, records].concat()));
    }
    file.extend(record(15, &[0; 4]));
    file.extend(record(2, &[0; 20]));
    file.extend(b"\x89MCAP0\r\n");
    file
}

#[test]
fn reading_takes_at_most_twice_what_is_read() {
    // Coordinates as doubles; a time per row, and the quality of a body where the format has one.
    let markers = FRAMES * (MARKERS * 24 + 8);
    let cases: [(&str, Vec<u8>, usize); 7] = [
        ("csv", canonical(), markers),
        ("vicon_csv", nexus(), markers),
        ("trc", trc(), markers),
        ("c3d float", c3d(true), markers),
        ("c3d integer", c3d(false), markers),
        ("dtrack", dtrack(), 15_000 * (2 * 64 + 8)),
        ("ros2_mcap", mcap(), 100_000 * (56 + 8)),
    ];
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("file");
    let mut too_much = Vec::new();
    for (name, bytes, data) in cases {
        std::fs::write(&path, &bytes).expect("written");
        let size = bytes.len();
        drop(bytes);
        let before = NOW.load(Relaxed);
        PEAK.store(before, Relaxed);
        let recording = read_path(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let peak = PEAK.load(Relaxed) - before;
        let samples: usize = recording
            .markers
            .iter()
            .map(|m| m.samples.len())
            .sum::<usize>()
            + recording
                .bodies
                .iter()
                .map(|b| b.tracker_from_body.len())
                .sum::<usize>();
        assert!(samples >= 15_000, "{name}: {samples} samples");
        let ratio = peak as f64 / data as f64;
        println!(
            "{name:12} file {:6.2} MB  samples {:6.2} MB  peak {:6.2} MB  {ratio:.2}",
            size as f64 / 1e6,
            data as f64 / 1e6,
            peak as f64 / 1e6
        );
        // The buffers that reading needs do not grow with the file.
        if peak > 2 * data + (1 << 20) {
            too_much.push(format!("{name}: {ratio:.2}"));
        }
    }
    assert!(too_much.is_empty(), "{too_much:?}");
}
