//! The page of a fleet: its robots as compact data that a script in the page shows, sorts and filters. It needs no other file.

use std::collections::BTreeMap;

use calib_report::number;
use serde::Serialize;

use super::error::BatchError;
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

/// The robots of a page.
#[derive(Debug, Default)]
pub(super) struct Page {
    words: Words,
    /// [`Line`]s as they stand in the page, which is a tenth of what they are as values.
    lines: String,
}

/// Three digits: what a person compares.
fn rounded(value: f64) -> Option<f64> {
    let text = format!("{value:.2e}");
    text.parse().ok().filter(|v: &f64| v.is_finite())
}

impl Page {
    pub fn add(&mut self, robot: &Robot) -> Result<(), BatchError> {
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
        if !self.lines.is_empty() {
            self.lines.push(',');
        }
        self.lines += &json(&line)?;
        Ok(())
    }

    /// The page.
    pub fn html(&self, summary: &Summary) -> Result<String, BatchError> {
        let (before, after) = TEMPLATE.split_once(DATA).unwrap_or((TEMPLATE, ""));
        let (words, summary) = (json(&self.words)?, json(summary)?);
        let parts = [
            before,
            "{\"words\":",
            &words,
            ",\"robots\":[",
            &self.lines,
            "],\"summary\":",
            &summary,
            "}",
            after,
        ];
        Ok(parts.concat())
    }
}

/// No name can end the element that the data stand in.
fn json(value: &impl Serialize) -> Result<String, BatchError> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}
