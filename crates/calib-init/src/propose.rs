//! From a URDF and files to a proposal.

use std::collections::BTreeSet;

use calib_recording::{LengthUnit, Poses};
use calib_urdf::{JointId, LinkId, RobotModel, doubt};

use crate::ask::{apply_one, ask, next_correction};
use crate::bodies::{self, Found};
use crate::computed;
use crate::correct;
use crate::corrected;
use crate::error::InitError;
use crate::fact::{About, Fact, Place};
use crate::hold;
use crate::known::Known;
use crate::limits;
use crate::links::Scene;
use crate::proposal::{Body, Noise, Proposal, Recording, Table};
use crate::robot;
use crate::session::{self, Draft};
use crate::source::{File, Source};
use crate::tables;
use crate::turns;
use crate::unfollowed;
use crate::unrecorded;

/// What the caller knows.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Name of the robot; that of the URDF where absent.
    pub name: Option<String>,
    /// The URDF as messages name it.
    pub urdf_shown: String,
    /// The URDF, relative to the profile.
    pub urdf_path: String,
    /// The schema beside the profile, if there is one.
    pub schema: Option<String>,
    /// The link that carries the markers.
    pub markers_on: Option<String>,
    /// Where nothing was recorded: the folder of the recordings to be, relative to the profile.
    pub folder: String,
    /// The profile that is edited; the proposal then has what it lacks, and its bodies.
    pub known: Option<Known>,
}

/// Corrections that are tried one after the other: a table with more mistakes is one to look at.
const CORRECTIONS: usize = 4;

/// The profile of a robot.
///
/// # Errors
/// [`InitError`] where the robot has no moving joint, a file has neither joints nor a log, nothing moves, or clocks cannot be brought together.
pub fn propose(
    model: &RobotModel,
    request: &Request,
    files: &[File],
) -> Result<Proposal, InitError> {
    let tips = robot::tips(model);
    let Some(longest) = tips.first() else {
        return Err(InitError::NothingMoves {
            file: request.urdf_shown.clone(),
        });
    };
    let stated = match &request.markers_on {
        None => None,
        Some(name) => Some(link_of(model, name)?),
    };
    let known = request.known.as_ref();
    let mut proposal = Proposal {
        robot: robot_name(model, request),
        urdf: request.urdf_path.clone(),
        schema: request.schema.clone(),
        noise: Noise::default(),
        bodies: Vec::new(),
        recordings: Vec::new(),
        skeleton: None,
        facts: known.map_or_else(|| of_robot(model), |_| Vec::new()),
    };
    if let Some(known) = known {
        let (files, listed) = known.to_read(model, files);
        if files.is_empty() {
            proposal.facts.extend(listed);
            proposal.facts.extend(known.of_files(&proposal));
            return Ok(proposal);
        }
        let found = with_recordings(model, &files, (stated, Some(known)), longest, &mut proposal);
        found.map_err(|error| beside_listed(error, &listed))?;
        proposal.facts.extend(listed);
        proposal.facts.extend(known.of_files(&proposal));
        let is_new = |body: &Body| !known.has_body(&body.name);
        if let Some(link) = &request.markers_on
            && !proposal.bodies.iter().any(is_new)
        {
            let link = link.clone();
            let place = Place::Recordings;
            proposal
                .facts
                .push(Fact::new(place, About::NoNewBody { link }));
        }
    } else if files.is_empty() {
        let names = (request.folder.as_str(), request.urdf_shown.as_str());
        unrecorded::propose(model, names, stated, longest, &mut proposal)?;
    } else {
        with_recordings(model, files, (stated, None), longest, &mut proposal)?;
    }
    let about = match proposal.noise.marker.or(proposal.noise.body.map(|b| b.0)) {
        Some(sigma) => About::Limits { sigma },
        None => About::NoLimits,
    };
    tables::robot_profile(model, &proposal)?;
    debug_assert_eq!(
        limits::of(&proposal.noise).is_none(),
        about == About::NoLimits
    );
    if known.is_none() {
        proposal.facts.push(Fact::new(Place::Limits, about));
    }
    Ok(proposal)
}

fn robot_name(model: &RobotModel, request: &Request) -> String {
    let stated = request
        .name
        .clone()
        .unwrap_or_else(|| model.name().to_owned());
    let clean: String = stated
        .chars()
        .map(|c| {
            if c.is_alphanumeric() || matches!(c, '-' | '_') {
                c
            } else {
                '_'
            }
        })
        .collect();
    match clean.is_empty() {
        true => "robot".to_owned(),
        false => clean,
    }
}

fn of_robot(model: &RobotModel) -> Vec<Fact> {
    let mut facts = vec![Fact::new(Place::Robot, robot::joints(model))];
    let reach = doubt::reach(model);
    if reach > doubt::LARGEST {
        facts.push(Fact::new(Place::Robot, About::TooLarge { reach }));
    }
    facts
}

/// A link by its name; that of a joint is no misspelled one.
fn link_of(model: &RobotModel, name: &str) -> Result<LinkId, InitError> {
    model
        .link_id(name)
        .map_err(|unknown| match model.joint_id(name) {
            Ok(joint) => InitError::JointForLink {
                joint: name.to_owned(),
                link: model.link(model.joint(joint).child).name.clone(),
            },
            Err(_) => InitError::NoSuchLink {
                unknown,
                tips: robot::ends(model),
            },
        })
}

/// All files, each once.
fn read(
    model: &RobotModel,
    files: &[File],
    known: Option<&Known>,
) -> Result<Vec<Source>, InitError> {
    let is_again = |(i, file): &(usize, &File)| files[..*i].iter().any(|o| o.path == file.path);
    if let Some((_, file)) = files.iter().enumerate().find(is_again) {
        return Err(InitError::Twice {
            file: file.shown.clone(),
        });
    }
    let renamed = known.map(|known| known.raw.names.clone());
    let renamed = renamed.unwrap_or_default();
    let read = files.iter().map(|f| Source::read(model, f, &renamed));
    read.collect()
}

/// Everything from the files.
fn with_recordings(
    model: &RobotModel,
    files: &[File],
    (stated, known): (Option<LinkId>, Option<&Known>),
    longest: &robot::Tip,
    proposal: &mut Proposal,
) -> Result<(), InitError> {
    let others = known.map(Known::others).unwrap_or_default();
    let mut sources = read(model, files, known)?;
    let (mut drafts, mut of_files) = session::drafts(model, &sources, &others)?;
    let (mut found, mut of_bodies, mut fixed) = all_bodies(model, &sources, known);
    let files = shown(&sources);
    if found.is_empty() {
        return Err(InitError::NothingSeen { files });
    }
    bodies::without_left_out(model, &mut sources, &of_bodies)?;
    let start = stated.unwrap_or_else(|| last_recorded(model, &sources).unwrap_or(longest.link));
    proposal.bodies = on_link(&found, start, &fixed);
    proposal.recordings = recordings(&drafts, &sources);
    of_files.extend(tables::far_clocks(model, proposal, &mut drafts, &sources)?);
    let mut poses = tables(model, proposal, &drafts, &sources, &found)?;
    if stated.is_none() && fixed.len() < found.len() {
        something_moves(model, &poses, &sources, longest)?;
    }
    let mut again = |read: &[Source]| tables(model, proposal, &drafts, read, &found);
    let mut turns = turns::by_motion(model, &sources, &found, &poses, &mut again)?;
    if let Some(read) = turns.sources.take() {
        sources = read;
        poses = again(&sources)?;
    }
    let mut corrections = Vec::new();
    let scene = Scene::new(model, &found, &poses);
    let lengths = of_lengths(&drafts, &sources);
    if let Some((scoped, residuals)) = lengths.and_then(|unit| scene.tracker_unit(unit)) {
        let (fact, new) = apply_one(model, &sources, &drafts, &[], &scoped, (residuals, &[]))?;
        corrections.push(fact);
        if let Some(new) = new {
            sources = new;
            (found, of_bodies, fixed) = all_bodies(model, &sources, known);
            poses = tables(model, proposal, &drafts, &sources, &found)?;
        }
    }
    let seen = (sources.as_mut_slice(), poses.as_slice());
    let names = known.map(Known::names_of_bodies).unwrap_or_default();
    let facts = (&mut of_bodies, of_files.as_mut_slice());
    let fewer = rigid_and_measured(model, &names, seen, &mut found, facts, &fixed)?;
    proposal.bodies = on_link(&found, start, &fixed);
    if fewer {
        poses = tables(model, proposal, &drafts, &sources, &found)?;
    }
    let mut of_links = Vec::new();
    for _ in 0..=CORRECTIONS {
        let scene = Scene::new(model, &found, &poses);
        let asked = ask(&scene, stated, &fixed);
        for (body, link) in &asked.assigned.on {
            proposal.bodies[*body].link = *link;
        }
        of_links = asked.facts(&scene, stated, &fixed);
        of_links.extend(unfollowed::fact(&scene, &asked.assigned.on, &asked.stated));
        let next = next_correction(&scene, &sources, &drafts, &asked.assigned)?;
        corrections.extend(next.facts);
        let Some(new) = next.sources.filter(|_| corrections.len() <= CORRECTIONS) else {
            break;
        };
        sources = new;
        poses = tables(model, proposal, &drafts, &sources, &found)?;
    }
    corrected::without_guesses(&mut of_files, &mut corrections);
    without_a_word(model, &proposal.bodies, &fixed, &mut of_links);
    let mut of_uses = session::uses(model, &mut drafts, &poses, &others);
    proposal.recordings = recordings(&drafts, &sources);
    let held = known.map(|known| known.held().clone()).unwrap_or_default();
    let missing = hold::missing(model, proposal, &poses, &held);
    if corrections.iter().any(corrected::is_correction) {
        corrected::noise(&mut of_bodies, bodies::bodies(model, &sources, &names).1);
    }
    proposal.noise = Noise::of(&of_bodies);
    if let Some(known) = known {
        of_bodies = known.of_noise(of_bodies);
        of_uses = known.of_uses(model, (&drafts, &poses), of_uses);
    }
    proposal.facts.extend(
        [
            of_files,
            of_uses,
            turns.of(&found),
            of_bodies,
            of_links,
            missing,
            corrections,
        ]
        .concat(),
    );
    Ok(())
}

/// A joint moves in some recording.
fn something_moves(
    model: &RobotModel,
    poses: &[Poses],
    sources: &[Source],
    longest: &robot::Tip,
) -> Result<(), InitError> {
    if poses.iter().any(|p| !session::moved(model, p).is_empty()) {
        return Ok(());
    }
    Err(InitError::NoMotion {
        files: shown(sources),
        tip: model.link(longest.link).name.clone(),
    })
}

/// The files as their messages name them.
fn shown(sources: &[Source]) -> Vec<String> {
    sources.iter().map(|s| s.file.shown.clone()).collect()
}

/// The poses of the files as they are read now, which the proposal then states.
fn tables(
    model: &RobotModel,
    proposal: &mut Proposal,
    drafts: &[Draft],
    sources: &[Source],
    found: &[Found],
) -> Result<Vec<Poses>, InitError> {
    proposal.recordings = recordings(drafts, sources);
    tables::tables(model, proposal, drafts, sources, found)
}

/// An error of files that were given beside recordings of the profile, which were not read, says so.
fn beside_listed(error: InitError, listed: &[Fact]) -> InitError {
    let name = |fact: &Fact| match &fact.place {
        Place::Recording(name) => Some(name.clone()),
        _ => None,
    };
    match error {
        InitError::NothingTracked { file, .. } | InitError::NoJoints { file, .. }
            if !listed.is_empty() =>
        {
            InitError::BesideListed {
                file,
                recordings: listed.iter().filter_map(name).collect(),
            }
        }
        other => other,
    }
}

/// Bodies of which nothing shows the link say so.
fn without_a_word(
    model: &RobotModel,
    bodies: &[Body],
    fixed: &[(usize, LinkId)],
    of_links: &mut Vec<Fact>,
) {
    for (i, body) in bodies.iter().enumerate() {
        let place = Place::Body(body.name.clone());
        if of_links.iter().any(|fact| fact.place == place) {
            continue;
        }
        let link = model.link(body.link).name.clone();
        let about = match fixed.iter().any(|(b, _)| *b == i) {
            true => About::LinkOfProfile {
                link,
                rms: None,
                better: None,
            },
            false => About::LinkUnknown { link },
        };
        of_links.push(Fact::new(place, about));
    }
}

/// The bodies of all files, those of a profile that is edited first, with their links.
fn all_bodies(
    model: &RobotModel,
    sources: &[Source],
    known: Option<&Known>,
) -> (Vec<Found>, Vec<Fact>, Vec<(usize, LinkId)>) {
    let names = known.map(Known::names_of_bodies).unwrap_or_default();
    let (mut found, mut facts) = bodies::bodies(model, sources, &names);
    let fixed = known.map_or_else(Vec::new, |known| {
        known.merge(sources, &mut found, &mut facts)
    });
    (found, facts, fixed)
}

/// The unit of length that all tracked files are read in.
fn of_lengths(drafts: &[Draft], sources: &[Source]) -> Option<LengthUnit> {
    let mut units = drafts
        .iter()
        .map(|d| correct::lengths_of(&sources[d.source]));
    let first = units.next()??;
    units.all(|unit| unit == Some(first)).then_some(first)
}

/// The last link that recorded joints move.
fn last_recorded(model: &RobotModel, sources: &[Source]) -> Option<LinkId> {
    let names = sources
        .iter()
        .flat_map(|s| &s.recording.joints)
        .map(|j| j.name.as_str());
    let joints: Vec<JointId> = names.filter_map(|n| model.joint_id(n).ok()).collect();
    let child = |j: &JointId| model.joint(*j).child;
    let last = joints
        .iter()
        .max_by_key(|j| robot::movers(model, child(j)).len())?;
    Some(robot::group(model, child(last)))
}

fn on_link(found: &[Found], link: LinkId, fixed: &[(usize, LinkId)]) -> Vec<Body> {
    let on = |(i, body): (usize, &Found)| Body {
        name: body.name.clone(),
        markers: body.markers.clone(),
        link: fixed
            .iter()
            .find(|(b, _)| *b == i)
            .map_or(link, |(_, link)| *link),
    };
    found.iter().enumerate().map(on).collect()
}

fn recordings(drafts: &[Draft], sources: &[Source]) -> Vec<Recording> {
    let table = |i: usize| Table {
        path: sources[i].file.path.clone(),
        columns: sources[i].columns.clone(),
    };
    let of = |draft: &Draft| Recording {
        name: draft.name.clone(),
        table: table(draft.source),
        log: draft.log.map(table),
        stream: draft.stream,
        max_offset: draft.max_offset,
        usage: draft.usage.clone(),
        hold: Vec::new(),
    };
    drafts.iter().map(of).collect()
}

/// Bodies of two markers that are not one, apart, and without those that a controller computed; whether there are any of those.
fn rigid_and_measured(
    model: &RobotModel,
    names: &BTreeSet<String>,
    (sources, poses): (&mut [Source], &[Poses]),
    found: &mut Vec<Found>,
    (of_bodies, of_files): (&mut Vec<Fact>, &mut [Fact]),
    fixed: &[(usize, LinkId)],
) -> Result<bool, InitError> {
    let mut apart = Scene::new(model, found, poses).not_rigid();
    apart.retain(|body| *body >= fixed.len());
    *found = bodies::split(model, std::mem::take(found), of_bodies, &apart, names);
    let noise = Noise::of(of_bodies).marker;
    let computed = computed::computed(
        &Scene::new(model, found, poses),
        sources,
        fixed.len(),
        noise,
    );
    let any = !computed.is_empty();
    if any {
        computed::leave_out(computed, found, of_bodies, of_files);
        bodies::without_left_out(model, sources, of_bodies)?;
    }
    Ok(any)
}
