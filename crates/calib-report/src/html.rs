//! `report.html`: one file that opens from disk, without network, in light and dark, on paper and by keyboard.
//!
//! The first screen has the verdict, one large number with what it is made of, the warnings, the next command and a picture of
//! the worst pose; short answers to the reader's questions ([`crate::answers`]), the 3-D view and the sections of the Markdown
//! report follow, with the plots of [`crate::plots`]. A content security policy forbids the page to load anything.

use crate::plots::{Plot, plots};
use crate::sections::{Block, sections};
use crate::svg::{escape, strip, svg};
use crate::table::{Align, Table};
use crate::words::diagnosis::{apply, diagnosis, nominal_urdf};
use crate::words::headline::{self, headline, limit};
use crate::words::remarks::remarks;
use crate::words::scope::{not_for, valid_for};
use crate::{Effect, Report, ReportError, Verdict, View3d, answers};
use askama::Template;

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    report: &'a Report,
    css: &'static str,
    script: &'static str,
    verdict_class: &'static str,
    verdict_mark: &'static str,
    head: HeadPart,
    answers: Vec<AnswerPart>,
    view: Option<ViewPart>,
    sections: Vec<SectionPart>,
}

/// The first screen.
struct HeadPart {
    identification: String,
    number: headline::Headline,
    parts: Markup,
    strip: Option<Markup>,
    use_for: Vec<Markup>,
    not_for: Option<Markup>,
    bounds: Vec<Markup>,
    diagnosis: Option<[Markup; 2]>,
    remarks: Vec<RemarkPart>,
    next: Option<Markup>,
    worst: String,
}

struct RemarkPart {
    word: &'static str,
    rejects: bool,
    text: Markup,
    remedy: Markup,
    place: &'static str,
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
    Folded {
        summary: Markup,
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

/// HTML of a text whose backticks mark names and commands.
pub(crate) fn marked(text: &str) -> String {
    Markup::from_text(text).0
}

/// The page. The view is thinned to a size that suits a page ([`View3d::thinned`]).
///
/// # Errors
/// [`ReportError::Html`] when the template fails, [`ReportError::Json`] when the view has no JSON form.
pub fn html(report: &Report, view: Option<&View3d>) -> Result<String, ReportError> {
    let worst = report.verification.held_out.as_ref();
    let worst = worst.and_then(|held_out| held_out.worst.as_ref());
    let view = view
        .map(|view| match worst {
            Some(worst) => view.clone().beginning_with(&worst.pose).thinned(),
            None => view.thinned(),
        })
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
    let sections = section_parts(report);
    let page = Page {
        head: head_part(report, &sections),
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
        sections,
    };
    page.render()
        .map_err(|source| ReportError::Html(source.to_string()))
}

fn head_part(report: &Report, sections: &[SectionPart]) -> HeadPart {
    let steps = headline::steps(report);
    let strip = (steps.len() > 1).then(|| Markup(strip(&steps, limit(report).map(|l| l.limit))));
    let number = headline(report);
    let [interval, limit] = [&number.interval, &number.limit];
    let bounds = [interval, limit].into_iter().filter(|t| !t.is_empty());
    let bounds = bounds.map(|text| Markup::from_text(text)).collect();
    let has = |id: &str| sections.iter().any(|section| section.id == id);
    let remarks = remarks(report).into_iter();
    let texts = |words: [String; 2]| words.map(|words| Markup::from_text(&words));
    let urdf = nominal_urdf(report).and_then(|path| std::path::Path::new(path).file_name());
    let command =
        urdf.and_then(|urdf| apply(report, ".", &format!("/path/to/{}", urdf.to_string_lossy())));
    let worst = report.verification.held_out.as_ref();
    let worst = worst.and_then(|held_out| held_out.worst.as_ref());
    HeadPart {
        identification: headline::identification(report),
        parts: Markup::from_text(&number.parts.join(" · ")),
        number,
        strip,
        use_for: valid_for(report)
            .iter()
            .map(|s| Markup::from_text(s))
            .collect(),
        not_for: not_for(report).map(|excluded| Markup::from_text(&excluded)),
        bounds,
        diagnosis: diagnosis(report).map(texts),
        remarks: remarks
            .map(|remark| RemarkPart {
                rejects: remark.effect == Effect::Rejects,
                word: match remark.effect {
                    Effect::Rejects => "Rejected",
                    Effect::LeavesOpen => "Open",
                    Effect::Warns | Effect::Supports => "Warning",
                },
                text: Markup::from_text(&remark.text),
                remedy: Markup::from_text(&remark.remedy),
                place: if has(remark.place) {
                    remark.place
                } else {
                    "verdict"
                },
            })
            .collect(),
        next: command.map(|c| Markup::from_text(&format!("In the folder of the results: `{c}`"))),
        worst: worst.and_then(headline::largest).unwrap_or_default(),
    }
}

fn section_parts(report: &Report) -> Vec<SectionPart> {
    let plots = plots(report);
    let plots_of = |id: &str| {
        let own: Vec<_> = plots.iter().filter(|plot| plot.section == id).collect();
        let part = |(i, plot): (usize, &&Plot)| PlotPart {
            id: plot.id.clone(),
            title: plot.title.clone(),
            // Plots of a kind share one caption.
            description: match own.get(i + 1) {
                Some(next) if next.description == plot.description => String::new(),
                _ => plot.description.clone(),
            },
            svg: Markup(svg(plot)),
        };
        own.iter().enumerate().map(part).collect()
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
            let (heads, rows) = cells(&table);
            BlockPart::Table {
                label: if caption.is_empty() {
                    title.to_owned()
                } else {
                    caption.replace('`', "")
                },
                caption: Markup::from_text(caption.trim_end_matches(':')),
                heads,
                rows,
            }
        }
        Block::Folded(summary, table) => {
            let (heads, rows) = cells(&table);
            BlockPart::Folded {
                summary: Markup::from_text(&summary),
                heads,
                rows,
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

/// Heads and rows of a table.
fn cells(table: &Table) -> (Vec<Cell>, Vec<Vec<Cell>>) {
    let class = |align: Align| if align == Align::Right { "n" } else { "" };
    let cell = |(text, align): (&String, Align)| Cell {
        class: class(align),
        text: Markup::from_text(text),
    };
    let heads = table.heads().iter();
    let aligns: Vec<Align> = heads.clone().map(|head| head.1).collect();
    let row = |texts: &Vec<String>| texts.iter().zip(aligns.clone()).map(cell).collect();
    (
        heads.map(|(text, align)| cell((text, *align))).collect(),
        table.rows().iter().map(row).collect(),
    )
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
