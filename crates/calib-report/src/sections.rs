//! The contents of the long report: text, lists and tables that Markdown and HTML share.
//!
//! Text is plain, with one kind of markup: names, paths and keys are between backticks.

mod budget;
mod dh;
mod evidence;
mod robot;
mod selection;
mod verdict;
mod weak;

use crate::table::Table;
use crate::words::prose::code;
use crate::{Report, Unit, number};
use calib_finding::printable;

/// A part of the report under one heading.
#[derive(Debug, Clone)]
pub(crate) struct Section {
    /// Stable id of the heading.
    pub(crate) id: &'static str,
    pub(crate) title: String,
    pub(crate) blocks: Vec<Block>,
}

/// One block of a section.
#[derive(Debug, Clone)]
pub(crate) enum Block {
    Text(String),
    /// Statements, each with its remedy, which may be empty.
    List(Vec<(String, String)>),
    /// A table under its caption; the caption may be empty.
    Table(String, Table),
    /// A table that a page shows on request, under its summary.
    Folded(String, Table),
    /// Language and text.
    Code(&'static str, String),
}

/// All sections; the first is the verdict.
pub(crate) fn sections(report: &Report) -> Vec<Section> {
    let mut page = Page(Vec::new());
    verdict::head(&mut page, report);
    verdict::held_out(&mut page, report);
    verdict::open_ends(&mut page, report);
    selection::choice(&mut page, report);
    robot::changes(&mut page, report);
    robot::transforms(&mut page, report);
    robot::loops(&mut page, report);
    robot::estimators(&mut page, report);
    evidence::data(&mut page, report);
    evidence::residuals(&mut page, report);
    weak::directions(&mut page, report);
    evidence::accuracy(&mut page, report);
    budget::budget(&mut page, report);
    dh::dh(&mut page, report);
    robot::urdf(&mut page, report);
    robot::parameters(&mut page, report);
    evidence::files(&mut page, report);
    page.0
}

struct Page(Vec<Section>);

impl Page {
    fn section(&mut self, id: &'static str, title: impl Into<String>) {
        self.0.push(Section {
            id,
            title: title.into(),
            blocks: Vec::new(),
        });
    }

    fn push(&mut self, block: Block) {
        if let Some(section) = self.0.last_mut() {
            section.blocks.push(block);
        }
    }

    fn text(&mut self, text: impl Into<String>) {
        self.push(Block::Text(text.into()));
    }

    fn list<T: AsRef<str>>(&mut self, items: impl IntoIterator<Item = T>) {
        let items: Vec<_> = items
            .into_iter()
            .map(|item| (item.as_ref().to_owned(), String::new()))
            .collect();
        if !items.is_empty() {
            self.push(Block::List(items));
        }
    }

    fn table(&mut self, caption: &str, table: Table) {
        if !table.is_empty() {
            self.push(Block::Table(
                caption.to_owned(),
                table.without_empty_columns(),
            ));
        }
    }

    fn folded(&mut self, summary: &str, table: Table) {
        if !table.is_empty() {
            self.push(Block::Folded(
                summary.to_owned(),
                table.without_empty_columns(),
            ));
        }
    }

    fn code(&mut self, language: &'static str, text: &str) {
        self.push(Block::Code(
            language,
            printable(text.trim_end_matches('\n')).into_owned(),
        ));
    }
}

fn mm(meters: f64) -> String {
    number::bare(meters, Unit::Meter)
}
