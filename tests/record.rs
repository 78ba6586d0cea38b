//! `calib record` as it is used: a sender of ours on the loopback, the program beside it, the file read back.

use crate::scratch;

use std::collections::BTreeMap;
use std::io::Write as _;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use scratch::Scratch;

/// A UDP port that nobody has just now.
pub(crate) fn free_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    socket.local_addr().expect("bound").port()
}

pub(crate) fn start(dir: &Scratch, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_calib"))
        .args(arguments)
        .current_dir(dir.path(""))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

pub(crate) fn datagram(frame: u64, ts: f64, bodies: &[(u32, Isometry3<f64>)]) -> Vec<u8> {
    let mut text = format!("fr {frame}\r\nts {ts:.6}\r\n6d {} ", bodies.len());
    for (id, pose) in bodies {
        let p = pose.translation.vector * 1000.0;
        let r = pose.rotation.to_rotation_matrix();
        let b: Vec<String> = r.matrix().iter().map(|v| format!("{v:.6}")).collect();
        let place = format!("{:.4} {:.4} {:.4}", p.x, p.y, p.z);
        text += &format!("[{id} 1.000][{place} 0 0 0][{}] ", b.join(" "));
    }
    (text + "\r\n\0").into_bytes()
}

/// Rows of the file that are whole, without comments and header.
pub(crate) fn rows(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let whole = &text[..text.rfind('\n').map_or(0, |i| i + 1)];
    let lines = whole.lines().filter(|l| !l.starts_with('#')).skip(1);
    lines.map(str::to_owned).collect()
}

fn wait_for(what: &str, mut done: impl FnMut() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < Duration::from_secs(60), "no {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Sends a body that stands still, a hundred times a second, until told to stop.
pub(crate) fn still_body(
    port: u16,
    first: u64,
    stop: Arc<AtomicBool>,
) -> std::thread::JoinHandle<u64> {
    std::thread::spawn(move || {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let mut number = first;
        while !stop.load(Ordering::Relaxed) {
            let pose = Isometry3::translation(0.5, 0.6, 0.7);
            let _ = socket.send_to(
                &datagram(number, number as f64 * 0.01, &[(0, pose)]),
                ("127.0.0.1", port),
            );
            number += 1;
            std::thread::sleep(Duration::from_millis(10));
        }
        number
    })
}

/// `calib record` of Justin's head into `sweep.csv`, gone on with where it exists.
fn head_sweep<'a>(source: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let fixed = [
        "record",
        "robots/justin.yaml",
        "--source",
        source,
        "--recording",
        "head_sweep",
        "--map",
        "heT=body_0",
        "--out",
        "sweep.csv",
        "--append",
    ];
    [&fixed[..], more].concat()
}

#[test]
fn a_kill_leaves_a_file_that_reads_and_goes_on() {
    let dir = Scratch::new().brief("justin");
    let out = dir.path("sweep.csv");
    let port = free_port();
    let source = format!("dtrack:{port}");
    let arguments = head_sweep(&source, &["--all"]);
    let stop = Arc::new(AtomicBool::new(false));
    let sender = still_body(port, 1000, stop.clone());
    let mut child = start(&dir, &arguments);
    wait_for("rows", || rows(&out).len() >= 100);
    // SIGKILL: no chance to tidy up.
    child.kill().expect("killed");
    let _ = child.wait();
    let before = rows(&out);
    let numbers = |rows: &[String]| -> Vec<u64> {
        let first = |row: &String| row.split(',').next().and_then(|n| n.parse().ok());
        rows.iter().filter_map(first).collect()
    };
    // Nothing in the middle is missing: what a kill takes is the end.
    let found = numbers(&before);
    assert_eq!(found.len(), before.len());
    assert!(found.windows(2).all(|w| w[1] == w[0] + 1), "{found:?}");
    // As if the kill had hit the writing itself.
    let mut file = std::fs::OpenOptions::new()
        .append(true)
        .open(&out)
        .expect("there");
    file.write_all(b"99999,12.3").expect("written");
    let ran = dir.calib(["convert", "sweep.csv", "again.csv"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert_eq!(rows(&dir.path("again.csv")).len(), before.len());
    assert!(dir.read("again.csv").contains("host_s"));

    let mut child = start(&dir, &arguments);
    wait_for("further rows", || rows(&out).len() >= before.len() + 50);
    stop.store(true, Ordering::Relaxed);
    sender.join().expect("sent");
    let mut stdin = child.stdin.take().expect("piped");
    stdin.write_all(b"q\n").expect("heard");
    let output = child.wait_with_output().expect("ended");
    assert!(output.status.success(), "{output:?}");
    let after = rows(&out);
    assert_eq!(after[..before.len()], before);
    assert!(!after.iter().any(|row| row.starts_with("99999")));
    assert!(
        numbers(&after).windows(2).all(|w| w[1] > w[0]),
        "{:?}",
        numbers(&after)
    );
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(said.contains("ended: stopped by the operator"), "{said}");
    assert!(said.lines().all(|l| l.chars().count() <= 80), "{said}");
    assert_eq!(String::from_utf8_lossy(&output.stdout), "sweep.csv\n");
}

/// An interrupt of the terminal ends a recording as `q` does: what is in the file is whole, what is missing is said, and `--append` asks
/// for it.
#[cfg(unix)]
#[test]
fn an_interrupt_ends_with_whole_poses_and_says_how_to_go_on() {
    let dir = Scratch::new().brief("justin");
    let port = free_port();
    let source = format!("dtrack:{port}");
    let arguments = head_sweep(&source, &["--hold", "0.4", "--poses", "2"]);
    let stop = Arc::new(AtomicBool::new(false));
    let sender = still_body(port, 1000, stop.clone());
    let path = dir.path("sweep.csv");
    // One pose is held, the next one begun; how far it came is for the machine to say.
    let interrupted = || {
        let mut child = start(&dir, &arguments);
        let mut stdin = child.stdin.take().expect("piped");
        let before = rows(&path).len();
        stdin.write_all(b"\n").expect("heard");
        wait_for("a pose", || rows(&path).len() > before);
        stdin.write_all(b"\n").expect("heard");
        std::thread::sleep(Duration::from_millis(100));
        let id = child.id().to_string();
        let sent = Command::new("kill").args(["-INT", &id]).status();
        assert!(sent.expect("kill").success());
        let output = child.wait_with_output().expect("ended");
        let said = String::from_utf8(output.stderr).expect("text");
        assert!(
            output.status.code() == Some(3) || said.contains("all poses"),
            "{said}"
        );
        said
    };
    // Device times of every hold in the file, in their order.
    let held = || -> Vec<(String, f64)> {
        let mut holds: Vec<(String, f64, f64)> = Vec::new();
        for row in rows(&path) {
            let cells: Vec<&str> = row.split(',').collect();
            let t: f64 = cells[1].parse().expect("a time");
            match holds.last_mut() {
                Some((hold, _, last)) if hold == cells[3] => *last = t,
                _ => holds.push((cells[3].to_owned(), t, t)),
            }
        }
        let lasted = |(hold, first, last)| (hold, last - first);
        holds.into_iter().map(lasted).collect()
    };
    let are_whole = |said: &str| {
        let holds = held();
        let numbers: Vec<&str> = holds.iter().map(|(hold, _)| hold.as_str()).collect();
        assert_eq!(numbers, ["1", "2", "3", "4"][..holds.len()], "{said}");
        assert!(holds.iter().all(|(_, lasted)| *lasted > 0.2), "{holds:?}");
        let counted = format!("and {} of 4 poses in the file", holds.len());
        assert!(said.contains(&counted), "{counted}: {said}");
        holds.len()
    };
    let said = interrupted();
    for part in [
        "taken as 0, because nobody sends them: torso_0",
        "missing: pose ",
        "`--append`",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let text = dir.read("sweep.csv");
    assert!(text.contains("# joints taken as 0: torso_0, "), "{text}");
    assert!(text.contains("# poses: 4 poses of head_pan"), "{text}");
    let first = are_whole(&said);
    let said = interrupted();
    assert!(are_whole(&said) > first, "{said}");
    // Another grid is another recording: its poses would be taken for these.
    let other = head_sweep(&source, &["--poses", "3"]);
    let output = start(&dir, &other).wait_with_output().expect("ended");
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(said.contains("its poses are `4 poses of"), "{said}");
    stop.store(true, Ordering::Relaxed);
    sender.join().expect("sent");
}

/// Rows of a shipped recording: joints in degrees, and the poses of the two bodies.
struct Pose {
    joints: String,
    bodies: Vec<(u32, Isometry3<f64>)>,
}

fn shipped(text: &str) -> Vec<Pose> {
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    lines
        .map(|line| {
            let cells: BTreeMap<&str, &str> = header.iter().copied().zip(line.split(',')).collect();
            let number = |name: &str| cells[name].parse::<f64>().ok();
            let joints = header.iter().filter(|name| name.ends_with("_deg"));
            let joints: Vec<String> = joints.map(|n| format!("{n}={}", cells[n])).collect();
            let body = |id: u32, name: &str| {
                let part = |p: &str| number(&format!("{name}.{p}"));
                let rotation = Quaternion::new(part("qw")?, part("qx")?, part("qy")?, part("qz")?);
                let place = Translation3::new(part("x_m")?, part("y_m")?, part("z_m")?);
                let rotation = UnitQuaternion::from_quaternion(rotation);
                Some((id, Isometry3::from_parts(place, rotation)))
            };
            Pose {
                joints: joints.join(" "),
                bodies: [body(0, "heT"), body(1, "haT")]
                    .into_iter()
                    .flatten()
                    .collect(),
            }
        })
        .collect()
}

/// A robot that sends its joints and a tracker that sees it: the poses of a shipped recording, recorded again, are
/// what `calib run` takes.
#[test]
fn what_is_recorded_live_is_what_run_reads() {
    let dir = Scratch::new().brief("justin");
    let file = "robots/justin/arm_poses.csv";
    // Every third pose: each is held for a tenth of a second.
    let poses: Vec<Pose> = shipped(&dir.read(file)).into_iter().step_by(3).collect();
    std::fs::remove_file(dir.path(file)).expect("there");
    let (tracker, robot) = (free_port(), free_port());
    let source = format!("dtrack:{tracker}");
    let joints = format!("udp:{robot}");
    let mut child = start(
        &dir,
        &[
            "record",
            "robots/justin.yaml",
            "--source",
            &source,
            "--joints",
            &joints,
            "--recording",
            "arm_poses",
            "--map",
            "heT=body_0,haT=body_1",
            "--hold",
            "0.02",
        ],
    );
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    let mut number = 0u64;
    // The tracker's clock runs faster than ours, so that the test is short: ten frames are half a second of it.
    let mut send = |pose: &Pose, frames: usize| {
        for _ in 0..frames {
            let _ = socket.send_to(pose.joints.as_bytes(), ("127.0.0.1", robot));
            let bytes = datagram(number, 100.0 + number as f64 * 0.05, &pose.bodies);
            let _ = socket.send_to(&bytes, ("127.0.0.1", tracker));
            number += 1;
            std::thread::sleep(Duration::from_millis(4));
        }
    };
    let path = dir.path(file);
    // The first second goes into finding out what is sent.
    wait_for("a first row", || {
        send(&poses[0], 10);
        path.exists()
    });
    for pose in &poses {
        send(pose, 25);
    }
    let mut stdin = child.stdin.take().expect("piped");
    stdin.write_all(b"q\n").expect("heard");
    let output = child.wait_with_output().expect("ended");
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.success(), "{said}");
    assert!(
        said.contains("recorded: haT (body_1), heT (body_0)"),
        "{said}"
    );
    let recorded = rows(&path);
    // A machine that stands still for long may cost poses, not all of them.
    assert!(recorded.len() > poses.len(), "{said}");
    let ran = dir.calib(["check", "robots/justin.yaml"]);
    assert!(
        [0, 1].contains(&ran.code),
        "{}{}\n{said}",
        ran.stdout,
        ran.stderr
    );
}

#[test]
fn refusals_before_anything_is_written() {
    let dir = Scratch::new().brief("justin").brief("ripley");
    let before = dir.files("");
    let refused = |arguments: &[&str]| {
        let child = start(&dir, arguments);
        let output = child.wait_with_output().expect("ended");
        let said = String::from_utf8(output.stderr).expect("text");
        (output.status.code(), said)
    };
    let justin = |rest: &[&'static str]| -> Vec<&str> {
        [&["record", "robots/justin.yaml"][..], rest].concat()
    };
    for (arguments, code, expected) in [
        (
            justin(&["--source", "vicon:1"]),
            2,
            "choose one with --recording: arm_poses, hand_sweep, head_sweep, torso_tests",
        ),
        (
            justin(&["--source", "vicon:1", "--recording", "head_sweep"]),
            2,
            "source `vicon:1`: expected `dtrack:PORT`, `dtrack:GROUP:PORT[@ADDRESS]`, `vrpn:HOST[:PORT]`",
        ),
        (
            justin(&["--source", "dtrack:0", "--recording", "arm_poses"]),
            2,
            "--joints udp:PORT",
        ),
        (
            justin(&[
                "--source",
                "dtrack:0",
                "--recording",
                "head_sweep",
                "--out",
                "a.csv",
                "--hold",
                "0",
            ]),
            2,
            "--hold 0",
        ),
        (
            justin(&[
                "--source",
                "dtrack:0",
                "--recording",
                "head_sweep",
                "--out",
                "a.csv",
                "--at",
                "waist_deg=3",
            ]),
            2,
            "--at: ",
        ),
        (
            justin(&["--source", "dtrack:0", "--recording", "head_sweep"]),
            7,
            "already exists\n  help: continue it with `--append`, or choose another file with",
        ),
        (
            justin(&[
                "--source",
                "dtrack:0",
                "--recording",
                "head_sweep",
                "--out",
                "a.csv",
                "--patience",
                "0.3",
            ]),
            3,
            "no data from the tracker for",
        ),
        (
            justin(&[
                "--source",
                "vrpn:127.0.0.1:1",
                "--recording",
                "head_sweep",
                "--out",
                "a.csv",
            ]),
            3,
            "127.0.0.1:1 cannot be reached",
        ),
    ] {
        let (found, said) = refused(&arguments);
        assert!(
            said.contains(expected) && found == Some(code),
            "{arguments:?}: {found:?}\n{said}"
        );
    }
    assert_eq!(dir.files(""), before);
}

#[test]
fn a_robot_that_sends_none_of_its_joints_is_refused() {
    let dir = Scratch::new().brief("justin");
    for (sends, heard) in [
        (None, "what arrives is: nothing"),
        (Some("J1_deg=20"), "what arrives is: J1"),
        (Some("20.0 30.0"), "what arrives is: found `20.0`"),
    ] {
        let (tracker, robot) = (free_port(), free_port());
        let stop = Arc::new(AtomicBool::new(false));
        let sender = still_body(tracker, 1, stop.clone());
        let (source, joints) = (format!("dtrack:{tracker}"), format!("udp:{robot}"));
        let child = start(
            &dir,
            &[
                "record",
                "robots/justin.yaml",
                "--source",
                &source,
                "--joints",
                &joints,
                "--recording",
                "arm_poses",
                "--map",
                "heT=body_0",
                "--patience",
                "2",
                "--out",
                "a.csv",
            ],
        );
        let stop_sending = stop.clone();
        let of_robot = std::thread::spawn(move || {
            let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
            while !stop_sending.load(Ordering::Relaxed) {
                if let Some(text) = sends {
                    let _ = socket.send_to(text.as_bytes(), ("127.0.0.1", robot));
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        let output = child.wait_with_output().expect("ended");
        stop.store(true, Ordering::Relaxed);
        sender.join().expect("sent");
        of_robot.join().expect("sent");
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(heard), "{said}");
        assert!(!dir.path("a.csv").exists());
    }
}

#[test]
fn a_tracker_that_sends_other_names_is_refused() {
    let dir = Scratch::new().brief("justin");
    let port = free_port();
    let stop = Arc::new(AtomicBool::new(false));
    let sender = still_body(port, 1, stop.clone());
    let source = format!("dtrack:{port}");
    let child = start(
        &dir,
        &[
            "record",
            "robots/justin.yaml",
            "--source",
            &source,
            "--recording",
            "head_sweep",
            "--out",
            "a.csv",
        ],
    );
    let output = child.wait_with_output().expect("ended");
    stop.store(true, Ordering::Relaxed);
    sender.join().expect("sent");
    let said = String::from_utf8(output.stderr).expect("text");
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains(
            "the tracker sends body_0, the profile has haT, heT. Map the names: --map haT=body_0"
        ),
        "{said}"
    );
    assert!(!dir.path("a.csv").exists());
}
