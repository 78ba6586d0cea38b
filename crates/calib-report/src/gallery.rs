//! A page of plots without a report: a title, lines of text, and the plots.

use crate::plots::Plot;
use crate::svg::{escape, svg};
use std::fmt::Write as _;

/// The page; it needs no other file.
#[must_use]
pub fn page(title: &str, lines: &[String], plots: &[Plot]) -> String {
    let mut body = String::new();
    // Writing to a String does not fail.
    let _ = write!(body, "<h1>{}</h1>\n<ul>\n", escape(title));
    for line in lines {
        let _ = writeln!(body, "<li>{}</li>", escape(line));
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
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n",
        escape(title),
        include_str!("../templates/report.css")
    )
}
