//! The profile as text. What the program reads stands in the lines, what a person should know in comments above them.

use calib_profile::edit::{Entry, Value};
use calib_recording::ColumnMap;
use calib_urdf::{RobotModel, doubt};

use crate::entry;
use crate::fact::Place;
use crate::limits;
use crate::proposal::Proposal;
use crate::words;
use crate::yaml;

/// Noise that a simulation assumes where none is known, mm: an optical tracker in a room.
const SIMULATED_MM: f64 = 0.2;

/// The text of the profile.
#[must_use]
pub fn profile(model: &RobotModel, proposal: &Proposal) -> String {
    let mut page = Page {
        model,
        proposal,
        text: String::new(),
    };
    page.head();
    page.bodies();
    page.recordings();
    page.solve();
    if proposal.skeleton.is_some() {
        page.plan();
        page.simulate();
    }
    page.text
}

struct Page<'a> {
    model: &'a RobotModel,
    proposal: &'a Proposal,
    text: String,
}

impl Page<'_> {
    fn line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    fn lines(&mut self, lines: Vec<String>) {
        lines.iter().for_each(|line| self.line(line));
    }

    /// The facts about a part, as comments.
    fn comments(&mut self, indent: &str, place: &Place) {
        let comments = entry::comments(&self.proposal.facts, indent, place);
        comments
            .iter()
            .for_each(|line| self.line(&format!("{indent}{line}")));
    }

    fn comment(&mut self, indent: &str, text: &str) {
        let lines = entry::comment(indent, text);
        lines
            .iter()
            .for_each(|line| self.line(&format!("{indent}{line}")));
    }

    fn head(&mut self) {
        let proposal = self.proposal;
        if let Some(schema) = &proposal.schema {
            self.line(&format!("# yaml-language-server: $schema={schema}"));
        }
        self.comment("", words::HEAD);
        self.line("calib: 1");
        self.comments("", &Place::Robot);
        let (name, urdf) = (yaml::text(&proposal.robot), yaml::text(&proposal.urdf));
        self.line(&format!("robot: {{name: {name}, urdf: {urdf}}}"));
        self.line("");
        self.comments("", &Place::Tracker);
        let mut keys = vec![format!("frame: {}", yaml::text(&self.tracker_frame()))];
        if let Some(sigma) = proposal.noise.marker {
            keys.push(format!(
                "marker_sigma_mm: {}",
                yaml::two_digits(sigma * 1e3)
            ));
        }
        if let Some((position, orientation)) = proposal.noise.body {
            keys.push(format!(
                "body_sigma_mm: {}",
                yaml::two_digits(position * 1e3)
            ));
            let degrees = orientation.to_degrees();
            keys.push(format!("body_sigma_deg: {}", yaml::two_digits(degrees)));
        }
        self.line(&format!("tracker: {{{}}}", keys.join(", ")));
    }

    /// A name that no link and no body has.
    fn tracker_frame(&self) -> String {
        let bodies = || self.proposal.bodies.iter().map(|body| &body.name);
        let taken =
            |name: &String| self.model.link_id(name).is_ok() || bodies().any(|body| body == name);
        let mut name = "tracker".to_owned();
        while taken(&name) {
            name.push_str("_frame");
        }
        name
    }

    fn bodies(&mut self) {
        self.line("");
        self.line("bodies:");
        for body in &self.proposal.bodies {
            let place = Place::Body(body.name.clone());
            self.entry(&place, &body.name, entry::body(self.model, body));
        }
    }

    /// What a part has, after the facts about it.
    fn entry(&mut self, place: &Place, name: &str, value: Value) {
        let entry = Entry {
            comments: entry::comments(&self.proposal.facts, "  ", place),
            key: yaml::text(name),
            value,
        };
        self.lines(entry.lines("  "));
    }

    fn recordings(&mut self) {
        self.line("");
        self.comments("", &Place::Recordings);
        self.line("recordings:");
        let mut known: Vec<(&ColumnMap, String)> = Vec::new();
        let proposal = self.proposal;
        for recording in &proposal.recordings {
            let columns = |map| self.columns(map, &mut known);
            let value = Value::Map {
                anchor: None,
                entries: entry::recording(self.model, recording, columns),
            };
            let place = Place::Recording(recording.name.clone());
            self.entry(&place, &recording.name, value);
        }
    }

    /// A column map, or the name of an equal one above.
    fn columns<'p>(&self, map: &'p ColumnMap, known: &mut Vec<(&'p ColumnMap, String)>) -> Value {
        if let Some((_, name)) = known.iter().find(|(other, _)| *other == map) {
            return Value::Flow(format!("*{name}"));
        }
        let name = match known.len() {
            0 => "columns".to_owned(),
            n => format!("columns_{}", n + 1),
        };
        let all = self.proposal.recordings.iter();
        let maps = all.flat_map(|r| {
            [
                r.table.columns.as_ref(),
                r.log.as_ref().and_then(|l| l.columns.as_ref()),
            ]
        });
        let again = maps.flatten().filter(|other| *other == map).count() > 1;
        known.push((map, name.clone()));
        Value::Map {
            anchor: again.then_some(name),
            entries: yaml::columns(map),
        }
    }

    fn solve(&mut self) {
        self.line("");
        self.line("solve:");
        self.comment("  ", words::FREE);
        self.line("  free: [bodies, tracker, joint_offsets, joint_axes]");
        self.comments("  ", &Place::Limits);
        match limits::of(&self.proposal.noise) {
            Some(limits) => {
                let (rms, most) = (
                    yaml::two_digits(limits.rms * 1e3),
                    yaml::two_digits(limits.most * 1e3),
                );
                self.line(&format!(
                    "  limits: {{held_out_rms_mm: {rms}, held_out_max_mm: {most}}}"
                ));
            }
            None => self.line("  # limits: {held_out_rms_mm: 1}"),
        }
    }

    /// Ranges for joints without limits; the others have those of the URDF.
    fn plan(&mut self) {
        let Some(skeleton) = &self.proposal.skeleton else {
            return;
        };
        let in_degrees = doubt::limits_in_degrees(self.model);
        let open = |(joint, _): &&(_, _)| {
            doubt::range(self.model.joint(*joint)).is_none() || in_degrees.contains(joint)
        };
        let open: Vec<_> = skeleton.random.iter().filter(open).copied().collect();
        if open.is_empty() {
            return;
        }
        self.line("");
        self.line("plan:");
        let ranges = entry::ranges(self.model, &open);
        self.line(&format!("  joints: {ranges}"));
    }

    fn simulate(&mut self) {
        let proposal = self.proposal;
        let Some(skeleton) = &proposal.skeleton else {
            return;
        };
        self.line("");
        self.comments("", &Place::Simulate);
        self.line("simulate:");
        self.line("  seed: 1");
        self.line("  tracker_from_root: {xyz_mm: [2000, 500, 0], rpy_deg: [0, 0, 150]}");
        self.line("  mounts:");
        for body in &proposal.bodies {
            let entry = Entry {
                comments: Vec::new(),
                key: yaml::text(&body.name),
                value: entry::mount(body),
            };
            self.lines(entry.lines("    "));
        }
        self.line("  errors: {joint_offset_deg: 0.3, axis_mm: 0.5, axis_deg: 0.1, mount_mm: 3, mount_deg: 2}");
        let marker = proposal.noise.marker.map_or(SIMULATED_MM, |m| m * 1e3);
        let noise = yaml::two_digits(marker);
        self.line(&format!("  noise: {{marker_mm: {noise}, joint_deg: 0.01}}"));
        self.line("  recordings:");
        if !skeleton.sweep.is_empty() {
            self.line("    sweep:");
            self.line("      grid:");
        }
        for (joint, (low, high)) in &skeleton.sweep {
            let (key, low, high) = (
                entry::key(self.model, *joint),
                entry::value(self.model, *joint, *low),
                entry::value(self.model, *joint, *high),
            );
            self.line(&format!(
                "        - {{joint: {key}, from: {low}, to: {high}, poses: 6}}"
            ));
        }
        let random = entry::ranges(self.model, &skeleton.random);
        for (name, poses) in [("poses", 40), ("checks", 12)] {
            self.line(&format!("    {name}:"));
            self.line(&format!("      random: {random}"));
            self.line(&format!("      poses: {poses}"));
        }
    }
}
