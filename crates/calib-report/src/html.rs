//! `report.html`: one file that opens from disk, without network, in light and dark, on paper and by keyboard.
//!
//! The first screen answers twelve questions ([`crate::answers`]), or links to the answers where it is too small; the 3-D view and the sections of the Markdown report follow,
//! with the plots of [`crate::plots`]. A content security policy forbids the page to load anything.

use crate::plots::plots;
use crate::sections::{Block, sections};
use crate::svg::{escape, svg};
use crate::table::Align;
use crate::{Report, ReportError, Verdict, View3d, answers};
use askama::Template;

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    report: &'a Report,
    css: &'static str,
    script: &'static str,
    verdict_class: &'static str,
    verdict_mark: &'static str,
    answers: Vec<AnswerPart>,
    view: Option<ViewPart>,
    sections: Vec<SectionPart>,
}

struct AnswerPart {
    id: &'static str,
    question: &'static str,
    short: &'static str,
    lines: Vec<Markup>,
}

struct ViewPart {
    data: String,
    still: String,
    poses: usize,
    magnification: f64,
}

struct SectionPart {
    id: &'static str,
    title: String,
    blocks: Vec<BlockPart>,
    plots: Vec<PlotPart>,
}

enum BlockPart {
    Text(Markup),
    List(Vec<(Markup, Option<Markup>)>),
    Table {
        label: String,
        caption: Markup,
        heads: Vec<Cell>,
        rows: Vec<Vec<Cell>>,
    },
    Diff(Vec<(&'static str, String)>),
    Code(String),
}

struct Cell {
    class: &'static str,
    text: Markup,
}

struct PlotPart {
    id: String,
    title: String,
    description: String,
    svg: Markup,
}

/// Escaped HTML.
struct Markup(String);

impl Markup {
    /// Text whose backticks mark names and commands.
    fn from_text(text: &str) -> Self {
        // A number and its unit stay on one line.
        let text = &[" mm", " ms", " %", " ± "]
            .iter()
            .fold(text.to_owned(), |text, unit| {
                text.replace(unit, &unit.replace(' ', "\u{a0}"))
            });
        let parts: Vec<&str> = text.split('`').collect();
        // An odd number of backticks marks nothing.
        if parts.len().is_multiple_of(2) {
            return Self(escape(text));
        }
        let part = |(i, part): (usize, &&str)| {
            if i % 2 == 1 {
                format!("<code>{}</code>", escape(part))
            } else {
                escape(part)
            }
        };
        Self(parts.iter().enumerate().map(part).collect())
    }
}

/// The page. The view is thinned to a size that suits a page ([`View3d::thinned`]).
///
/// # Errors
/// [`ReportError::Html`] when the template fails, [`ReportError::Json`] when the view has no JSON form.
pub fn html(report: &Report, view: Option<&View3d>) -> Result<String, ReportError> {
    let view = view
        .map(View3d::thinned)
        .filter(|view| !view.poses.is_empty() || !view.clouds.is_empty());
    let view = view.map(|view| {
        let part = |data| ViewPart {
            data,
            still: view.still(),
            poses: view.poses.len(),
            magnification: view.magnification,
        };
        view.embedded().map(part)
    });
    let (verdict_class, verdict_mark) = match report.verdict {
        Verdict::Accepted => ("accepted", "✓"),
        Verdict::AcceptedWithWarnings => ("warned", "!"),
        Verdict::Rejected => ("rejected", "✗"),
        Verdict::NotEvaluated => ("open", "?"),
    };
    let page = Page {
        report,
        css: include_str!("../templates/report.css"),
        script: include_str!("../templates/view3d.js"),
        verdict_class,
        verdict_mark,
        answers: answers(report)
            .into_iter()
            .map(|answer| AnswerPart {
                id: answer.id,
                question: answer.question,
                short: answer.short,
                lines: answer
                    .lines
                    .iter()
                    .map(|line| Markup::from_text(line))
                    .collect(),
            })
            .collect(),
        view: view.transpose()?,
        sections: section_parts(report),
    };
    page.render()
        .map_err(|source| ReportError::Html(source.to_string()))
}

fn section_parts(report: &Report) -> Vec<SectionPart> {
    let plots = plots(report);
    let plots_of = |id: &str| {
        plots
            .iter()
            .filter(|plot| plot.section == id)
            .map(|plot| PlotPart {
                id: plot.id.clone(),
                title: plot.title.clone(),
                description: plot.description.clone(),
                svg: Markup(svg(plot)),
            })
            .collect()
    };
    let part = |(i, section): (usize, crate::sections::Section)| {
        let title = if i == 0 {
            "Verdict and limits".to_owned()
        } else {
            section.title
        };
        SectionPart {
            id: section.id,
            blocks: section
                .blocks
                .into_iter()
                .map(|block| block_part(block, &title))
                .collect(),
            plots: plots_of(section.id),
            title,
        }
    };
    sections(report).into_iter().enumerate().map(part).collect()
}

fn block_part(block: Block, title: &str) -> BlockPart {
    match block {
        Block::Text(text) => BlockPart::Text(Markup::from_text(&text)),
        Block::List(items) => {
            let remedy = |remedy: String| (!remedy.is_empty()).then(|| Markup::from_text(&remedy));
            BlockPart::List(
                items
                    .into_iter()
                    .map(|(text, todo)| (Markup::from_text(&text), remedy(todo)))
                    .collect(),
            )
        }
        Block::Table(caption, table) => {
            let class = |align: Align| if align == Align::Right { "n" } else { "" };
            let aligns: Vec<Align> = table.heads().iter().map(|head| head.1).collect();
            let row = |cells: &Vec<String>| {
                cells
                    .iter()
                    .zip(&aligns)
                    .map(|(text, align)| Cell {
                        class: class(*align),
                        text: Markup::from_text(text),
                    })
                    .collect()
            };
            BlockPart::Table {
                label: if caption.is_empty() {
                    title.to_owned()
                } else {
                    caption.replace('`', "")
                },
                caption: Markup::from_text(caption.trim_end_matches(':')),
                heads: table
                    .heads()
                    .iter()
                    .map(|(text, align)| Cell {
                        class: class(*align),
                        text: Markup::from_text(text),
                    })
                    .collect(),
                rows: table.rows().iter().map(row).collect(),
            }
        }
        Block::Code("diff", text) => {
            let class = |line: &str| match line.as_bytes().first() {
                Some(b'+') => "add",
                Some(b'-') => "del",
                _ => "ctx",
            };
            BlockPart::Diff(
                text.lines()
                    .map(|line| (class(line), line.to_owned()))
                    .collect(),
            )
        }
        Block::Code(_, text) => BlockPart::Code(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backticks_are_code_and_everything_else_is_escaped() {
        assert_eq!(
            Markup::from_text("a `b<c` & d").0,
            "a <code>b&lt;c</code> &amp; d"
        );
        assert_eq!(Markup::from_text("one ` alone").0, "one ` alone");
    }
}
