//! A page, and its long tables beside it.

use std::fmt::{self, Write};

use csv::WriterBuilder;

use crate::cell::{Scene, shortest};

/// Columns of the long tables. Lengths in mm and angles in deg, values as the page would show them.
const HEADER: [&str; 8] = [
    "table",
    "motion",
    "samples",
    "radius_mm",
    "sigma_mm",
    "sigma_deg",
    "method",
    "value",
];

/// Markdown for people, and the lines of tables that are too long for it.
#[derive(Default)]
pub(super) struct Page {
    text: String,
    lines: Vec<[String; 8]>,
    /// Name of the file with the long tables.
    beside: String,
}

impl Write for Page {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.text.write_str(text)
    }
}

impl Page {
    pub(super) fn new(beside: String) -> Self {
        Self {
            beside,
            ..Self::default()
        }
    }

    pub(super) fn push(&mut self, c: char) {
        self.text.push(c);
    }

    /// Where the long tables are.
    pub(super) fn beside(&self) -> &str {
        &self.beside
    }

    /// A value of a long table.
    pub(super) fn line(&mut self, table: &str, scene: &Scene, method: &str, value: String) {
        self.lines.push([
            table.to_owned(),
            scene.words(),
            scene.samples.to_string(),
            shortest(scene.radius_m * 1e3),
            shortest(scene.sigma_t_m * 1e3),
            shortest(scene.sigma_r_rad.to_degrees()),
            method.to_owned(),
            value,
        ]);
    }

    pub(super) fn text(self) -> String {
        self.text
    }

    pub(super) fn csv(self) -> String {
        let mut writer = WriterBuilder::new().from_writer(Vec::new());
        // Neither memory nor rows of one length can fail.
        let _ = writer.write_record(HEADER);
        for line in self.lines {
            let _ = writer.write_record(line);
        }
        let bytes = writer.into_inner().unwrap_or_default();
        String::from_utf8(bytes).unwrap_or_default()
    }
}
