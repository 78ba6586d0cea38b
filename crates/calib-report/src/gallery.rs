//! A page of plots without a report: a title, lines of text, the plots, and tables.

use crate::html::marked;
use crate::plots::Plot;
use crate::svg::{escape, svg};
use std::fmt::Write as _;

/// A table of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grid {
    /// Its heading.
    pub title: String,
    /// Headings of the columns.
    pub header: Vec<String>,
    /// As many cells as columns; backticks mark names.
    pub rows: Vec<Vec<String>>,
}

/// The page; it needs no other file. Backticks in the lines mark names and commands.
#[must_use]
pub fn page(title: &str, lines: &[String], plots: &[Plot], tables: &[Grid]) -> String {
    let mut body = String::new();
    // Writing to a String does not fail.
    let _ = write!(body, "<h1>{}</h1>\n<ul>\n", escape(title));
    for line in lines {
        let _ = writeln!(body, "<li>{}</li>", marked(line));
    }
    body += "</ul>\n<div class=\"plots\">\n";
    for plot in plots {
        let _ = writeln!(
            body,
            "<figure><figcaption>{}</figcaption>{}<p class=\"meta\">{}</p></figure>",
            escape(&plot.title),
            svg(plot),
            escape(&plot.description)
        );
    }
    body += "</div>";
    for table in tables {
        let cells = |(begin, end): (&str, &str), cells: &[String]| -> String {
            let cell = |text: &String| format!("{begin}{}{end}", marked(text));
            cells.iter().map(cell).collect()
        };
        let _ = write!(
            body,
            "\n<h2>{}</h2>\n<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"{}\">\n<table>\n<thead><tr>{}</tr></thead>\n<tbody>\n",
            escape(&table.title),
            escape(&table.title),
            cells(("<th scope=\"col\">", "</th>"), &table.header)
        );
        for row in &table.rows {
            let _ = writeln!(body, "<tr>{}</tr>", cells(("<td>", "</td>"), row));
        }
        body += "</tbody>\n</table>\n</div>";
    }
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n",
        escape(title),
        include_str!("../templates/report.css")
    )
}
