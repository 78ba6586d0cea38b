//! `calib record`: from the profile to a capture session, and back to the person.

use std::collections::BTreeMap;
use std::io::{BufRead as _, IsTerminal as _};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Instant, SystemTime};

use calib_capture::{
    Address, CaptureError, Guide, JointColumn, JointListener, JointSource, Key, Lines, Plan,
    Screen, Session, Source, SourceError, Survey, Table, Terminal, Unit, WatchedKind, grid,
    map_names, parse_joints, survey,
};
use calib_pipeline::prepare::load;
use calib_pipeline::prepare::load::RobotProfile;
use calib_pipeline::{ExitCode, PipelineError};
use calib_profile::{BodyKind, RecordingSpec};

use crate::arguments::Record;

/// How long the tracker is listened to before the columns are decided, s.
const SURVEY: f64 = 1.0;
/// How near a measured joint must come to its target: 1°, 2 mm.
const NEAR: (f64, f64) = (0.017_453_292_519_943_295, 2e-3);

/// Records.
pub fn run(quiet: bool, options: &Record) -> Result<ExitCode, PipelineError> {
    let robot = load::load_robot(&options.profile)?;
    let mut screen = screen(quiet);
    match record(&robot, options, screen.as_mut()) {
        Ok(code) => Ok(code),
        Err(Stop::Pipeline(error)) => Err(error),
        Err(Stop::Capture(error)) => {
            eprintln!("error: {error}");
            Ok(match error {
                CaptureError::Source(SourceError::Port { .. }) => ExitCode::Usage,
                CaptureError::Source(_) => ExitCode::Data,
                CaptureError::Table(_) => ExitCode::NotWritten,
            })
        }
    }
}

enum Stop {
    Pipeline(PipelineError),
    Capture(CaptureError),
}

impl<E: Into<CaptureError>> From<E> for Stop {
    fn from(error: E) -> Self {
        Stop::Capture(error.into())
    }
}

fn usage(finding: impl Into<String>, remedy: impl Into<String>) -> Stop {
    Stop::Pipeline(PipelineError::Usage {
        finding: finding.into(),
        remedy: remedy.into(),
    })
}

fn screen(quiet: bool) -> Box<dyn Screen> {
    if quiet {
        Box::new(Lines::new(std::io::sink()))
    } else if std::io::stderr().is_terminal() {
        Box::new(Terminal::new(std::io::stderr()))
    } else {
        Box::new(Lines::new(std::io::stderr()))
    }
}

fn record(
    robot: &RobotProfile,
    options: &Record,
    screen: &mut dyn Screen,
) -> Result<ExitCode, Stop> {
    let (name, spec) = choose(robot, options)?;
    let address: Address = options
        .source
        .parse()
        .map_err(|e: calib_capture::BadAddress| usage(e.to_string(), "correct --source"))?;
    let joints: JointSource = options
        .joints
        .parse()
        .map_err(|e: String| usage(format!("--joints: {e}"), "correct --joints"))?;
    let guide_ranges = guide_ranges(robot, spec);
    if guide_ranges.is_empty() && joints == JointSource::Targets {
        return Err(usage(
            format!(
                "recording `{name}` asks for no joint ranges, so there are no poses to guide to and no joint values"
            ),
            "let the robot send its joints (--joints udp:PORT), or give the recording `joints` in the profile",
        ));
    }
    if !options.append && out_path(robot, spec, options).exists() {
        let path = out_path(robot, spec, options).display().to_string();
        return Err(calib_capture::TableError::Exists { path }.into());
    }
    let clock = clock();
    let mut source = Source::open(&address)?;
    let mut listener = listener(joints)?;
    screen.line(&format!(
        "recording `{name}` from {address}; joint values: {}",
        match joints {
            JointSource::Targets =>
                "the poses you are asked for (commanded, not measured)".to_string(),
            JointSource::Udp(port) => format!("from the robot, UDP port {port}"),
        }
    ));
    let heard = survey(
        &mut source,
        &mut listener,
        &clock,
        SURVEY,
        options.patience,
        screen,
    )?;
    let heard = match heard {
        Ok(heard) => heard,
        Err(ended) => {
            screen.line(&format!("ended: {ended}"));
            return Ok(ExitCode::Data);
        }
    };
    let plan = plan(robot, spec, options, joints, &heard, screen)?;
    let path = out_path(robot, spec, options);
    let table = if options.append && path.exists() {
        Table::append(&path, &plan.header())?
    } else {
        Table::create(
            &path,
            &comments(robot, name, &address, joints, &plan),
            &plan.header(),
        )?
    };
    let mut session = Session::new(plan, table);
    let keys = keys();
    let ended = session.record(&mut source, &mut listener, &keys, &clock, screen)?;
    screen.line(&format!("ended: {ended}"));
    session.report(screen);
    println!("{}", path.display());
    Ok(if ended.is_good() {
        ExitCode::Accepted
    } else {
        ExitCode::Data
    })
}

/// The recording that is made: the named one, or the only one.
fn choose<'a>(
    robot: &'a RobotProfile,
    options: &'a Record,
) -> Result<(&'a str, &'a RecordingSpec), Stop> {
    let recordings = &robot.profile.recordings;
    let all = || {
        let names: Vec<&str> = recordings.keys().map(String::as_str).collect();
        names.join(", ")
    };
    match &options.recording {
        Some(name) => recordings
            .get_key_value(name)
            .map(|(name, spec)| (name.as_str(), spec))
            .ok_or_else(|| {
                usage(
                    format!("the profile has no recording `{name}`"),
                    format!("it has {}", all()),
                )
            }),
        None if recordings.len() == 1 => recordings
            .iter()
            .next()
            .map(|(name, spec)| (name.as_str(), spec))
            .ok_or_else(|| usage("the profile has no recordings", "add one")),
        None => Err(usage(
            format!("the profile has {} recordings", recordings.len()),
            format!("choose one with --recording: {}", all()),
        )),
    }
}

fn out_path(robot: &RobotProfile, spec: &RecordingSpec, options: &Record) -> PathBuf {
    let own = || robot.folder.join(&spec.file);
    options.out.clone().unwrap_or_else(own)
}

/// Swept joints with unit and range, rad or m.
fn guide_ranges(robot: &RobotProfile, spec: &RecordingSpec) -> Vec<(JointColumn, (f64, f64))> {
    spec.ranges
        .iter()
        .map(|(&id, &range)| {
            let joint = robot.model.joint(id);
            (column(&joint.name, joint.kind.turns(), None), range)
        })
        .collect()
}

fn column(name: &str, turns: bool, fixed: Option<f64>) -> JointColumn {
    JointColumn {
        name: name.to_string(),
        unit: if turns { Unit::Angle } else { Unit::Length },
        fixed,
    }
}

fn listener(joints: JointSource) -> Result<Option<JointListener>, Stop> {
    match joints {
        JointSource::Targets => Ok(None),
        JointSource::Udp(port) => JointListener::open(port)
            .map(Some)
            .map_err(|source| SourceError::Port { port, source }.into()),
    }
}

/// Columns, poses and bodies.
fn plan(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    options: &Record,
    joints: JointSource,
    heard: &Survey,
    screen: &mut dyn Screen,
) -> Result<Plan, Stop> {
    let (guided, ranges): (Vec<JointColumn>, Vec<(f64, f64)>) =
        guide_ranges(robot, spec).into_iter().unzip();
    let poses = options
        .poses
        .unwrap_or(if guided.len() == 1 { 11 } else { 6 });
    let count = poses.checked_pow(guided.len() as u32).unwrap_or(usize::MAX);
    if poses == 0 || count > 100_000 {
        return Err(usage(
            format!("--poses {poses} makes {count} poses"),
            "give from 1 to some dozens for each joint",
        ));
    }
    for (name, value) in [
        ("--hold", options.hold),
        ("--patience", options.patience),
        ("--seconds", options.seconds.unwrap_or(1.0)),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(usage(format!("{name} {value}"), "give seconds above 0"));
        }
    }
    let guide = Guide {
        joints: (0..guided.len()).collect(),
        steps: grid(&ranges, poses),
        ranges,
    };
    let mut columns = guided;
    let fixed = parse_at(robot, &options.at)?;
    for (name, turns, value) in &fixed {
        if columns.iter().any(|c| c.name == *name) {
            return Err(usage(
                format!("--at holds `{name}`, which this recording sweeps"),
                "leave it out",
            ));
        }
        columns.push(column(name, *turns, Some(*value)));
    }
    for name in &heard.joints {
        match robot.model.joint_id(name) {
            Ok(id) if !columns.iter().any(|c| c.name == *name) && !spec.hold.contains_key(&id) => {
                columns.push(column(name, robot.model.joint(id).kind.turns(), None));
            }
            Ok(_) => {}
            Err(unknown) => screen.line(&format!("not recorded: the robot sends {unknown}")),
        }
    }
    let unheard: Vec<&str> = columns
        .iter()
        .filter(|c| c.fixed.is_none() && !heard.joints.contains(&c.name))
        .map(|c| c.name.as_str())
        .collect();
    if joints != JointSource::Targets && !unheard.is_empty() {
        screen.line(&format!(
            "not heard from the robot so far: {}",
            unheard.join(", ")
        ));
    }
    let watched = watched(robot, options, heard, screen)?;
    if !guide.steps.is_empty() {
        screen.line(&format!(
            "{} poses of {}; keys: Enter = I am there, s = leave out, q = end (then Enter)",
            guide.steps.len(),
            guide.shown_ranges(&columns)
        ));
    }
    Ok(Plan {
        columns,
        joints,
        guide,
        watched,
        hold: options.hold,
        near: NEAR,
        all: options.all,
        patience: options.patience,
        longest: options.seconds,
    })
}

/// `waist_deg=20` as (joint, turns, SI).
fn parse_at(robot: &RobotProfile, at: &[String]) -> Result<Vec<(String, bool, f64)>, Stop> {
    let mut fixed = Vec::new();
    for text in at {
        let remedy = "write a joint with its unit: --at waist_deg=20";
        let joints =
            parse_joints(text.as_bytes()).map_err(|e| usage(format!("--at: {e}"), remedy))?;
        for (name, value) in joints {
            let id = robot
                .model
                .joint_id(&name)
                .map_err(|e| usage(format!("--at: {e}"), remedy))?;
            let turns = robot.model.joint(id).kind.turns();
            let unit = text.split('=').next().unwrap_or("");
            if turns != (unit.ends_with("_deg") || unit.ends_with("_rad")) {
                let kind = robot.model.joint(id).kind.name();
                return Err(usage(format!("--at `{text}`: `{name}` is {kind}"), remedy));
            }
            fixed.push((name, turns, value));
        }
    }
    Ok(fixed)
}

fn watched(
    robot: &RobotProfile,
    options: &Record,
    heard: &Survey,
    screen: &mut dyn Screen,
) -> Result<Vec<calib_capture::Watched>, Stop> {
    let mut wanted = Vec::new();
    for (body, spec) in &robot.profile.bodies {
        match &spec.kind {
            BodyKind::Pose => wanted.push((body.clone(), WatchedKind::Body)),
            BodyKind::Markers { names, .. } => {
                wanted.extend(names.iter().map(|n| (n.clone(), WatchedKind::Marker)));
            }
        }
    }
    let mut given = BTreeMap::new();
    for text in &options.map {
        let Some((name, from)) = text.split_once('=') else {
            return Err(usage(
                format!("--map `{text}`"),
                "write the profile's name and the tracker's: --map gripM=body_0",
            ));
        };
        given.insert(name.to_string(), from.to_string());
    }
    let watched = map_names(&wanted, &given, &heard.tracker)
        .map_err(|finding| usage(finding, "the names are case sensitive"))?;
    let unseen: Vec<&str> = watched
        .iter()
        .filter(|w| !heard.tracker.contains(&w.from))
        .map(|w| w.name.as_str())
        .collect();
    if !unseen.is_empty() {
        screen.line(&format!("not seen so far: {}", unseen.join(", ")));
    }
    let left: Vec<&str> = wanted
        .iter()
        .map(|(name, _)| name.as_str())
        .filter(|name| !watched.iter().any(|w| w.name == *name))
        .collect();
    if !left.is_empty() {
        screen.line(&format!("no column for {} (--map)", left.join(", ")));
    }
    let names: Vec<String> = watched
        .iter()
        .map(|w| {
            if w.name == w.from {
                w.name.clone()
            } else {
                format!("{} ({})", w.name, w.from)
            }
        })
        .collect();
    screen.line(&format!("recorded: {}", names.join(", ")));
    Ok(watched)
}

fn comments(
    robot: &RobotProfile,
    name: &str,
    address: &Address,
    joints: JointSource,
    plan: &Plan,
) -> Vec<String> {
    let kind = match address {
        Address::Dtrack { .. } => "dtrack",
        Address::Vrpn { .. } => "vrpn",
    };
    let mut comments = vec![
        format!(
            "calib record: robot {}, recording {name}, source {kind}",
            robot.profile.robot
        ),
        "t_s: the tracker's clock; host_s: this computer's clock when the frame arrived, s since 1970".to_string(),
        "hold: the pose, counted from 1".to_string(),
    ];
    comments.push(match joints {
        JointSource::Targets => {
            "joints: the poses the person was asked for; commanded, not measured".to_string()
        }
        JointSource::Udp(_) => {
            "joints: as the robot sent them, the last value not older than 0.5 s".to_string()
        }
    });
    for watched in plan.watched.iter().filter(|w| w.name != w.from) {
        comments.push(format!(
            "{} is the tracker's {}",
            watched.name, watched.from
        ));
    }
    comments
}

/// Seconds since 1970; never falls, whatever happens to the computer's date.
fn clock() -> impl Fn() -> f64 {
    let began = Instant::now();
    let offset = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0.0, |since| since.as_secs_f64());
    move || offset + began.elapsed().as_secs_f64()
}

/// Lines of standard input as keys; the channel closes when it ends.
fn keys() -> Receiver<Key> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            let Ok(line) = line else { return };
            let key = match line.trim() {
                "" => Key::There,
                "s" => Key::Skip,
                "q" => Key::Quit,
                _ => continue,
            };
            if send.send(key).is_err() {
                return;
            }
        }
    });
    receive
}
