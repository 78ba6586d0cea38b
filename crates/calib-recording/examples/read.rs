//! Reads a file once and says how long it took and what memory: `cargo run --release -p calib-recording --example read FILE`.

use calib_recording::{ReadOptions, read_path_with};
use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path: PathBuf = std::env::args_os().nth(1).ok_or("which file?")?.into();
    let bytes = std::fs::metadata(&path)?.len();
    let before = peak();
    let began = Instant::now();
    let mut tenths = 0;
    let recording = read_path_with(&path, &ReadOptions::default(), &mut |read, all| {
        if 10 * read / all.max(1) > tenths {
            tenths = 10 * read / all.max(1);
            eprint!("\r{} %", 10 * tenths);
            let _ = std::io::stderr().flush();
        }
    })?;
    let seconds = began.elapsed().as_secs_f64();
    let points: usize = recording.markers.iter().map(|m| m.samples.len()).sum();
    let poses: usize = recording
        .bodies
        .iter()
        .map(|b| b.tracker_from_body.len())
        .sum();
    // Coordinates as doubles: three of a point, seven of a pose.
    let data = 24 * points + 56 * poses;
    let megabytes = |bytes: f64| bytes / 1e6;
    eprintln!();
    println!(
        "{}: {:.1} MB in {seconds:.2} s, {:.0} MB/s; {points} points, {poses} poses = {:.1} MB",
        recording.meta.format,
        megabytes(bytes as f64),
        megabytes(bytes as f64) / seconds,
        megabytes(data as f64)
    );
    if let (Some(before), Some(after)) = (before, peak()) {
        println!(
            "peak memory {:.1} MB more than before = {:.2} of the points",
            megabytes(after - before),
            (after - before) / data as f64
        );
    }
    Ok(())
}

/// Largest resident memory of this process so far, bytes, where the system tells.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()? * 1024.0)
}
