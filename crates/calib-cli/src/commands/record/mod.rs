//! `calib record`: from the profile to a capture session.

mod bodies;
pub mod error;
mod plan;
mod planned;
mod rules;

use std::io::{BufRead as _, IsTerminal as _};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Instant, SystemTime};

use calib_capture::{
    Address, CaptureError, JointListener, JointSource, Key, Lines, POSES, Plan, Screen, Session,
    Source, SourceError, Survey, Table, TableError, Terminal, survey,
};
use calib_pipeline::ExitCode;
use calib_pipeline::prepare::load::{RobotProfile, load_robot};
use calib_profile::RecordingSpec;
use calib_recording::renamed_comment;
use clap::Args;

use super::plugin_options::PluginOptions;
use crate::error::CliError;
use crate::terminal::{Console, emit_paths, say_stage};
use bodies::{joints_of, unrecorded};
use error::RecordError;
use plan::{assumed_zero, check_options, plan};
use planned::{Guided, Planned};
use rules::is_continuous;

/// How long the tracker is listened to before the columns are decided, s.
const SURVEY: f64 = 1.0;

/// Arguments of `calib record`.
#[derive(Debug, Args)]
pub struct Record {
    /// The robot's profile
    pub(super) profile: PathBuf,
    /// `dtrack:PORT` (DTrack sends to this port), `dtrack:GROUP:PORT[@ADDRESS]` (multicast; ADDRESS: this computer's, in the
    /// tracker's network), `vrpn:HOST[:PORT]` or `vrpn:DEVICE@HOST[:PORT]`
    #[arg(long)]
    pub(super) source: String,
    /// Recording of the profile; required if it has several
    #[arg(long)]
    pub(super) recording: Option<String>,
    /// `plan.yaml` of `calib plan`: guides to its postures (a recording with `use: validation`: to its held-out ones), and chooses those
    /// to come again from what was recorded
    #[arg(long, conflicts_with = "poses")]
    pub(super) plan: Option<PathBuf>,
    /// Stop where the σ of the tool's position is this, mm [default: what the plan was asked for]
    #[arg(long, requires = "plan")]
    pub(super) sigma_mm: Option<f64>,
    /// The CSV to write, which must not exist [default: the recording's file]
    #[arg(short, long)]
    pub(super) out: Option<PathBuf>,
    /// Append to an existing file
    #[arg(long)]
    pub(super) append: bool,
    /// Source of joint values: `targets` (the requested poses) or `udp:PORT` (the robot sends `name_deg=value`)
    #[arg(long, default_value = "targets")]
    pub(super) joints: String,
    /// Value of a joint that does not move, as `waist_deg=20`
    #[arg(long, value_delimiter = ',')]
    pub(super) at: Vec<String>,
    /// Body or marker of the profile and the tracker's name for it, as `gripM=body_0` [default: `names` of the profile]
    #[arg(long, value_delimiter = ',')]
    pub(super) map: Vec<String>,
    /// Number of values of each swept joint [default: 11 for one joint, 6 for several]
    #[arg(long)]
    pub(super) poses: Option<usize>,
    /// Duration of the recording of each pose, s
    #[arg(long, default_value_t = 1.0)]
    pub(super) hold: f64,
    /// Also write rows while the robot moves
    #[arg(long)]
    pub(super) all: bool,
    /// Stop if no data arrive from the tracker for this long, s
    #[arg(long, default_value_t = 30.0)]
    pub(super) patience: f64,
    /// Stop after this long, s
    #[arg(long)]
    pub(super) seconds: Option<f64>,
    /// Which plugins are loaded, for readers of the recordings that a plan counts on
    #[command(flatten)]
    pub(super) plugins: PluginOptions,
}

/// Records.
pub fn run(console: &Console, options: &Record) -> Result<ExitCode, CliError> {
    let robot = load_robot(&options.profile)?;
    let (ended, path) = record(&robot, options, screen(console).as_mut())?;
    if let Some(path) = path {
        emit_paths(console.json, &[path])?;
    }
    Ok(ended)
}

/// What the operator reads as JSON lines.
struct JsonLines;

impl Screen for JsonLines {
    fn line(&mut self, text: &str) {
        say_stage(text);
    }

    fn status(&mut self, _text: &str, _now: f64) {}
}

fn screen(console: &Console) -> Box<dyn Screen> {
    if console.quiet {
        Box::new(Lines::new(std::io::sink()))
    } else if console.json {
        Box::new(JsonLines)
    } else if std::io::stderr().is_terminal() {
        Box::new(Terminal::new(std::io::stderr()))
    } else {
        Box::new(Lines::new(std::io::stderr()))
    }
}

/// Records; how it ended, and the file.
fn record(
    robot: &RobotProfile,
    options: &Record,
    screen: &mut dyn Screen,
) -> Result<(ExitCode, Option<PathBuf>), CliError> {
    let (name, spec) = choose(robot, options)?;
    let address: Address = options.source.parse().map_err(RecordError::Source)?;
    let joints: JointSource = options.joints.parse().map_err(RecordError::Joints)?;
    // Joint values come from the poses that are asked for, from the robot, or from its own log.
    let asks = options.plan.is_some() || !spec.ranges.is_empty() && !is_continuous(spec);
    let logs = is_continuous(spec) && spec.robot_log.is_some();
    if !asks && !logs && joints == JointSource::Targets {
        let recording = name.to_owned();
        return Err(RecordError::NoJoints { recording }.into());
    }
    if !options.append && out_path(robot, spec, options).exists() {
        let path = out_path(robot, spec, options).display().to_string();
        return Err(CaptureError::from(TableError::Exists { path }).into());
    }
    if let Some(sigma) = options.sigma_mm.filter(|s| !(*s > 0.0 && s.is_finite())) {
        return Err(CliError::NotASigma { sigma });
    }
    check_options(robot, spec, options)?;
    let planned = match &options.plan {
        Some(path) => Some(Planned::read(path, robot, (name, spec), options)?),
        None => None,
    };
    let follow = planned.as_ref().map(Planned::follow).transpose()?;
    let clock = clock();
    let mut source = Source::open(&address).map_err(CaptureError::from)?;
    let mut listener = listener(joints)?;
    let values = match joints {
        JointSource::Targets if logs => "in the robot's own log".to_string(),
        JointSource::Targets => "the requested poses (commanded, not measured)".to_string(),
        JointSource::Udp(port) => format!("from the robot, UDP port {port}"),
    };
    screen.line(&format!(
        "recording `{name}` from {address}; joint values: {values}"
    ));
    let seconds = options.seconds.unwrap_or(f64::INFINITY);
    let patience = seconds.min(options.patience);
    // Without poses to guide to, the columns of the joints are those that the robot sends now.
    let from_robot = matches!(joints, JointSource::Udp(_)) && !asks;
    let times = (SURVEY, patience);
    let heard = survey(
        &mut source,
        &mut listener,
        &clock,
        times,
        from_robot,
        screen,
    )?;
    let heard = match heard {
        Ok(heard) => heard,
        Err(ended) => {
            screen.line(&format!("ended: {ended}"));
            return Ok((ExitCode::Data, None));
        }
    };
    if let (Some(planned), JointSource::Udp(_)) = (&planned, joints) {
        planned.is_heard(&heard)?;
    }
    let asked = (spec, planned.as_ref());
    let plan = plan(robot, asked, options, (joints, &heard), screen)?;
    if from_robot {
        some_joint_is_sent(robot, &plan, &heard, listener.as_ref())?;
    }
    let path = out_path(robot, spec, options);
    let table = table(robot, (name, spec), options, (&address, joints), &plan)?;
    // Bodies that the tracker does not send tell nothing, whatever the plan says.
    let missing = unrecorded(robot, &plan.watched);
    let fewer = planned.as_ref().filter(|_| !missing.is_empty());
    let fewer = fewer.map(|planned| planned.without(missing));
    let follow = match &fewer {
        Some(fewer) => Some(fewer.follow()?),
        None => follow,
    };
    let guided = follow.zip(planned.as_ref());
    let guided = guided.map(|(follow, planned)| Guided::new(follow, &plan, (planned, &table)));
    let mut session = Session::new(plan, table);
    if let Some((guided, planned)) = guided.zip(planned.as_ref()) {
        let reached = planned.begins(&guided, spec, screen)?;
        if reached {
            return Ok((ExitCode::Accepted, Some(path)));
        }
        session = session.following(Box::new(guided));
    }
    let (keys, clock) = (keys(), clock);
    let ended = session.record(&mut source, &mut listener, &keys, &clock, screen)?;
    screen.line(&format!("ended: {ended}"));
    session.report(screen);
    let code = if ended.is_good() {
        ExitCode::Accepted
    } else {
        ExitCode::Data
    };
    Ok((code, Some(path)))
}

/// The file that the rows go to: a new one, or the one that is continued.
fn table(
    robot: &RobotProfile,
    (name, spec): (&str, &RecordingSpec),
    options: &Record,
    (address, joints): (&Address, JointSource),
    plan: &Plan,
) -> Result<Table, CaptureError> {
    let path = out_path(robot, spec, options);
    let planned = options.plan.is_some();
    let table = if options.append && path.exists() {
        let poses = poses(plan, planned);
        Table::append(&path, &plan.header(), poses.as_deref())
    } else {
        let comments = comments(robot, (name, spec), address, joints, plan);
        let poses = poses(plan, planned).map(|poses| format!("{POSES}{poses}"));
        let comments: Vec<String> = comments.into_iter().chain(poses).collect();
        Table::create(&path, &comments, &plan.header())
    };
    Ok(table?)
}

/// The robot sends its joints, it was said: without any, every joint would count as 0.
fn some_joint_is_sent(
    robot: &RobotProfile,
    plan: &Plan,
    heard: &Survey,
    listener: Option<&JointListener>,
) -> Result<(), RecordError> {
    let mut columns = plan.columns.iter();
    if columns.any(|c| c.fixed.is_none() && heard.joints.contains(&c.name)) {
        return Ok(());
    }
    let joints = joints_of(robot, &plan.watched).into_iter();
    Err(RecordError::JointsNotSent {
        heard: listener.map_or_else(|| "nothing".to_owned(), JointListener::heard),
        known: joints
            .map(|id| robot.model.joint(id).name.clone())
            .collect(),
    })
}

/// What the file says of its poses: another list is another recording.
fn poses(plan: &Plan, planned: bool) -> Option<String> {
    let of_plan = || "those of a plan".to_owned();
    let of_guide = plan.guide.poses(&plan.columns);
    if planned { Some(of_plan()) } else { of_guide }
}

/// The recording that is made: the named one, or the only one.
fn choose<'a>(
    robot: &'a RobotProfile,
    options: &'a Record,
) -> Result<(&'a str, &'a RecordingSpec), RecordError> {
    let recordings = &robot.profile.recordings;
    let known = || recordings.keys().cloned().collect();
    let found = match &options.recording {
        Some(wanted) => {
            recordings
                .get_key_value(wanted)
                .ok_or_else(|| RecordError::UnknownRecording {
                    wanted: wanted.clone(),
                    known: known(),
                })?
        }
        None if recordings.len() > 1 => {
            return Err(RecordError::WhichRecording { known: known() });
        }
        None => recordings.iter().next().ok_or(RecordError::NoRecordings)?,
    };
    Ok((found.0.as_str(), found.1))
}

fn out_path(robot: &RobotProfile, spec: &RecordingSpec, options: &Record) -> PathBuf {
    let own = || robot.folder.join(&spec.file);
    options.out.clone().unwrap_or_else(own)
}

fn listener(joints: JointSource) -> Result<Option<JointListener>, CaptureError> {
    match joints {
        JointSource::Targets => Ok(None),
        JointSource::Udp(port) => JointListener::open(port)
            .map(Some)
            .map_err(|source| SourceError::Port { port, source }.into()),
    }
}

fn comments(
    robot: &RobotProfile,
    (name, spec): (&str, &RecordingSpec),
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
    let zero = assumed_zero(robot, spec, &plan.columns, &plan.watched);
    if !zero.is_empty() {
        comments.push(format!("joints taken as 0: {}", zero.join(", ")));
    }
    comments.push(match joints {
        JointSource::Targets if plan.continuous => "joints: in the robot's own log".to_string(),
        JointSource::Targets => "joints: the requested poses; commanded, not measured".to_string(),
        JointSource::Udp(_) => {
            "joints: as the robot sent them, the last value not older than 0.5 s".to_string()
        }
    });
    for watched in plan.watched.iter().filter(|w| w.name != w.from) {
        comments.push(renamed_comment(&watched.name, &watched.from));
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

/// Lines of standard input as keys, and the interrupt of the terminal.
fn keys() -> Receiver<Key> {
    let (send, receive) = channel();
    let interrupts = send.clone();
    // Where another part of the program listens already, an interrupt stops the program as it always did.
    let _ = ctrlc::set_handler(move || {
        let _ = interrupts.send(Key::Interrupt);
    });
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            let Ok(line) = line else { break };
            let key = match line.trim() {
                "" => Key::There,
                "s" => Key::Skip,
                "n" => Key::Instead,
                "r" => Key::Repeat,
                "k" => Key::Keep,
                "q" => Key::Quit,
                _ => continue,
            };
            if send.send(key).is_err() {
                return;
            }
        }
        let _ = send.send(Key::Closed);
    });
    receive
}
