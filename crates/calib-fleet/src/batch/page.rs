//! The page of a fleet: its robots as compact data that a script in the page shows, sorts and filters. It needs no other file.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};

use calib_files::GrowingFile;
use calib_report::number;
use serde::Serialize;

use super::row::Robot;
use super::summary::{Summary, word};

/// The page, but for the data.
const TEMPLATE: &str = include_str!("fleet.html");
/// Where the data go.
const DATA: &str = "\"CALIB_FLEET_DATA\"";

/// Texts that many robots share, each once.
#[derive(Debug, Default, Serialize)]
#[serde(transparent)]
struct Words {
    all: Vec<String>,
    #[serde(skip)]
    places: BTreeMap<String, usize>,
}

impl Words {
    fn place(&mut self, text: &str) -> usize {
        if let Some(place) = self.places.get(text) {
            return *place;
        }
        self.places.insert(text.to_owned(), self.all.len());
        self.all.push(text.to_owned());
        self.all.len() - 1
    }
}

/// One robot: name, series, verdict, error, held-out error (mm), joint that changed, its change, probability. Texts but the first are
/// places in the list of words.
#[derive(Debug, Serialize)]
struct Line(
    String,
    usize,
    usize,
    Option<usize>,
    Option<f64>,
    Option<usize>,
    Option<String>,
    Option<f64>,
);

/// A page that is being written: robots as they come, then what is known of all of them.
#[derive(Debug)]
pub(super) struct Page {
    words: Words,
    out: BufWriter<GrowingFile>,
    begun: bool,
}

/// Three digits: what a person compares.
fn rounded(value: f64) -> Option<f64> {
    let text = format!("{value:.2e}");
    text.parse().ok().filter(|v: &f64| v.is_finite())
}

/// What stands before and after the data.
fn around() -> (&'static str, &'static str) {
    TEMPLATE.split_once(DATA).unwrap_or((TEMPLATE, ""))
}

impl Page {
    /// Begins the page.
    pub fn new(file: GrowingFile) -> io::Result<Self> {
        let mut out = BufWriter::new(file);
        let (before, _) = around();
        out.write_all(before.as_bytes())?;
        out.write_all(b"{\"robots\":[")?;
        Ok(Self {
            words: Words::default(),
            out,
            begun: false,
        })
    }

    /// Adds a robot.
    pub fn add(&mut self, robot: &Robot) -> io::Result<()> {
        let words = &mut self.words;
        let most = robot.most_changed();
        let change = |joint: &super::row::JointDrift| {
            number::change(joint.change, Some(joint.sigma), joint.unit)
        };
        let failure = robot.failure.as_ref();
        let line = Line(
            robot.name.clone(),
            words.place(&robot.series),
            words.place(word(robot.verdict)),
            failure.map(|failure| words.place(&failure.id)),
            robot.held_out_rms_m.and_then(|rms| rounded(rms * 1e3)),
            most.map(|joint| words.place(&joint.joint)),
            most.map(change),
            robot.drift.as_ref().and_then(|d| rounded(d.p_value)),
        );
        if self.begun {
            self.out.write_all(b",")?;
        }
        self.begun = true;
        self.out.write_all(json(&line)?.as_bytes())
    }

    /// The rest of the page: the texts that robots share, and the fleet in numbers.
    pub fn end(mut self, summary: &Summary) -> io::Result<GrowingFile> {
        let (words, summary) = (json(&self.words)?, json(summary)?);
        let (_, after) = around();
        for part in [
            "],\"words\":",
            &words,
            ",\"summary\":",
            &summary,
            "}",
            after,
        ] {
            self.out.write_all(part.as_bytes())?;
        }
        self.out
            .into_inner()
            .map_err(io::IntoInnerError::into_error)
    }
}

/// No name can end the element that the data stand in.
fn json(value: &impl Serialize) -> io::Result<String> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}
