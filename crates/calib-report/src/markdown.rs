//! `report.md`: verdict and scope first, then the numbers; readable in a terminal and in a pull request.

use crate::Report;
use crate::sections::{Block, sections};
use crate::table::markup_free;

/// The report as GitHub Markdown; its tables are aligned, so that it can be read as text.
#[must_use]
pub fn markdown(report: &Report) -> String {
    let mut text = String::new();
    for (i, section) in sections(report).iter().enumerate() {
        let mark = if i == 0 { "#" } else { "\n##" };
        text += &format!("{mark} {}\n", markup_free(&section.title));
        for block in &section.blocks {
            text.push('\n');
            text += &markdown_of(block);
        }
    }
    text
}

fn markdown_of(block: &Block) -> String {
    match block {
        Block::Text(text) => markup_free(text) + "\n",
        Block::List(items) => items
            .iter()
            .map(|(text, remedy)| {
                let remedy = if remedy.is_empty() {
                    String::new()
                } else {
                    format!("  *What to do:* {}\n", markup_free(remedy))
                };
                format!("- {}\n{remedy}", markup_free(text))
            })
            .collect(),
        Block::Table(caption, table) if caption.is_empty() => table.markdown(),
        Block::Table(caption, table) | Block::Folded(caption, table) => {
            format!("{}\n\n{}", markup_free(caption), table.markdown())
        }
        Block::Code(language, text) => {
            // A fence longer than any run of backticks in the text.
            let longest = text.split(|c| c != '`').map(str::len).max().unwrap_or(0);
            let fence = "`".repeat(longest.max(2) + 1);
            format!("{fence}{language}\n{text}\n{fence}\n")
        }
    }
}
