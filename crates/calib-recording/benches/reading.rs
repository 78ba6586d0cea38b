//! Throughput of the readers, bytes of the file per second.

use calib_recording::{Poses, ReadOptions, WriteOptions, read_bytes, write_poses};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Point3;
use std::hint::black_box;

const MARKERS: usize = 60;

/// 4000, or what `CALIB_BENCH_FRAMES` says, up to the 65 535 that a C3D header can count.
fn frames() -> usize {
    let asked = std::env::var("CALIB_BENCH_FRAMES").ok();
    let asked = asked.and_then(|text| text.parse().ok());
    asked.unwrap_or(4000).clamp(1, usize::from(u16::MAX))
}

/// A smooth, never repeating coordinate, mm.
fn coordinate(frame: usize, k: usize) -> f64 {
    1000.0 * ((frame as f64 * 0.01 + k as f64).sin() + 0.01 * ((frame * 31 + k * 7) as f64).cos())
}

/// Nexus CSV with six significant digits.
fn nexus(frames: usize) -> Vec<u8> {
    let mut text = String::from("Trajectories\r\n100\r\n,");
    (0..MARKERS).for_each(|k| text.push_str(&format!(",Body:M{k},,")));
    text.push_str("\r\nFrame,Sub Frame");
    (0..MARKERS).for_each(|_| text.push_str(",X,Y,Z"));
    text.push_str("\r\n,");
    (0..3 * MARKERS).for_each(|_| text.push_str(",mm"));
    text.push_str("\r\n");
    for frame in 0..frames {
        text.push_str(&format!("{},0", frame + 1));
        (0..3 * MARKERS).for_each(|k| text.push_str(&format!(",{:.3}", coordinate(frame, k))));
        text.push_str("\r\n");
    }
    text.into_bytes()
}

/// Our own table with micrometers.
fn canonical(frames: usize) -> Vec<u8> {
    let mut poses = Poses {
        rows: (0..frames as u64).collect(),
        ..Poses::default()
    };
    poses.t = Some((0..frames).map(|i| i as f64 * 0.01).collect());
    for k in 0..MARKERS {
        let point = |frame| {
            Point3::new(
                coordinate(frame, 3 * k),
                coordinate(frame, 3 * k + 1),
                coordinate(frame, 3 * k + 2),
            ) * 1e-3
        };
        poses.markers.insert(
            format!("m{k}"),
            (0..frames).map(|frame| Some(point(frame))).collect(),
        );
    }
    write_poses(&poses, &WriteOptions::micro())
        .unwrap_or_default()
        .into_bytes()
}

/// C3D, Intel, float or integer points, no analog data.
fn c3d(frames: usize, float: bool) -> Vec<u8> {
    let mut header = vec![0u8; 512];
    header[0] = 2;
    header[1] = 0x50;
    for (word, value) in [(2, MARKERS as u16), (4, 1), (5, frames as u16), (9, 3)] {
        header[2 * word - 2..2 * word].copy_from_slice(&value.to_le_bytes());
    }
    header[12..16].copy_from_slice(&if float { -0.1f32 } else { 0.1f32 }.to_le_bytes());
    header[20..24].copy_from_slice(&100f32.to_le_bytes());
    let scale = if float { -0.1f32 } else { 0.1 };
    let mut parameters = vec![1, 0x50, 1, 84];
    let mut add = |id: i8, name: &str, body: &[u8], last: bool| {
        parameters.push(name.len() as u8);
        parameters.push(id as u8);
        parameters.extend(name.bytes());
        let link = if last { 0 } else { 2 + body.len() as u16 };
        parameters.extend(link.to_le_bytes());
        parameters.extend(body);
    };
    let word = |value: u16| [&[2u8, 0], value.to_le_bytes().as_slice(), &[0]].concat();
    let number = |value: f32| [&[4u8, 0], value.to_le_bytes().as_slice(), &[0]].concat();
    let labels: Vec<u8> = (0..MARKERS)
        .flat_map(|k| format!("M{k:02}").into_bytes())
        .collect();
    add(-1, "POINT", &[0], false);
    add(-2, "ANALOG", &[0], false);
    add(1, "USED", &word(MARKERS as u16), false);
    add(1, "FRAMES", &word(frames as u16), false);
    add(1, "DATA_START", &word(3), false);
    add(1, "SCALE", &number(scale), false);
    add(1, "RATE", &number(100.0), false);
    add(1, "UNITS", &[0xff, 2, 2, 1, b'm', b'm', 0], false);
    add(
        1,
        "LABELS",
        &[&[0xff, 2, 3, MARKERS as u8], labels.as_slice(), &[0]].concat(),
        false,
    );
    add(2, "USED", &word(0), true);
    parameters.resize(512, 0);
    let mut data = Vec::new();
    for frame in 0..frames {
        for k in 0..MARKERS {
            for axis in 0..3 {
                let value = coordinate(frame, 3 * k + axis);
                if float {
                    data.extend((value as f32).to_le_bytes())
                } else {
                    data.extend(((value * 10.0) as i16).to_le_bytes())
                }
            }
            if float {
                data.extend(1f32.to_le_bytes())
            } else {
                data.extend(1i16.to_le_bytes())
            }
        }
    }
    data.resize(data.len().div_ceil(512) * 512, 0);
    [header, parameters, data].concat()
}

fn reading(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("reading");
    group.sample_size(20);
    let frames = frames();
    for (name, bytes) in [
        ("nexus_csv", nexus(frames)),
        ("canonical_csv", canonical(frames)),
        ("c3d_float", c3d(frames, true)),
        ("c3d_integer", c3d(frames, false)),
    ] {
        // For other programs to read the same files.
        if let Some(folder) = std::env::var_os("CALIB_BENCH_FILES") {
            let path = std::path::Path::new(&folder).join(name);
            let made = std::fs::create_dir_all(&folder);
            if let Err(error) = made.and_then(|()| std::fs::write(&path, &bytes)) {
                eprintln!("{}: {error}", path.display());
            }
        }
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_with_input(
            BenchmarkId::from_parameter(name),
            &bytes,
            |bencher, bytes| {
                bencher.iter(|| {
                    read_bytes(name, black_box(bytes), &ReadOptions::default())
                        .map(|recording| recording.markers.len())
                });
            },
        );
    }
    group.finish();
}

criterion_group!(benches, reading);
criterion_main!(benches);
