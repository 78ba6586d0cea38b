//! A page of plots without a report: a title, lines of text, the plots, and tables.

use crate::html::marked;
use crate::plots::Plot;
use crate::svg::{escape, svg};
use crate::{ReportError, View3d};
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
    assembled(title, &body(title, lines, "", plots, tables), None)
}

/// The page with a 3-D view after the lines; a view without a pose is left out.
///
/// # Errors
/// [`ReportError::Json`] when the view has no JSON form.
pub fn page_with_view(
    title: &str,
    lines: &[String],
    view: &View3d,
    plots: &[Plot],
    tables: &[Grid],
) -> Result<String, ReportError> {
    let view = view.thinned();
    if view.poses.is_empty() {
        return Ok(page(title, lines, plots, tables));
    }
    let part = section(&view)?;
    let body = body(title, lines, &part, plots, tables);
    let script = include_str!("../templates/view3d.js");
    Ok(assembled(title, &body, Some(script)))
}

/// The view with its controls, as the script expects them, and a picture for readers without scripts.
fn section(view: &View3d) -> Result<String, ReportError> {
    Ok(format!(
        "<section class=\"wide\" aria-labelledby=\"view\">\n<h2 id=\"view\">3-D view</h2>\n<figure id=\"still\">{}<figcaption class=\"meta\">First pose. The 3-D view needs JavaScript.</figcaption></figure>\n<div id=\"live\" hidden>\n<canvas id=\"canvas\" tabindex=\"0\" role=\"application\" aria-label=\"3-D view of the robot\" aria-describedby=\"view-help view-status\"></canvas>\n<div class=\"controls\">\n<label>Pose <input id=\"pose\" type=\"range\" min=\"0\" max=\"{}\" value=\"0\" step=\"1\" aria-describedby=\"view-status\"></label>\n<span hidden><label for=\"factor\">σ ×</label> <output id=\"factor-text\" for=\"factor\">1</output> <input id=\"factor\" type=\"range\" min=\"0\" max=\"3\" step=\"0.05\" data-start=\"1\"></span>\n<fieldset id=\"layers\"><legend>Show</legend></fieldset>\n<button id=\"reset\" type=\"button\">Reset view</button>\n</div>\n<p id=\"view-status\" role=\"status\"></p>\n<p id=\"view-help\" class=\"meta\">Drag to rotate, scroll to zoom, Shift-drag to pan; click a marker for its name. Keys: arrows rotate, Shift and arrows pan, + and − zoom, 0 resets, Page Up and Page Down change the pose, m goes from marker to marker.</p>\n</div>\n<script type=\"application/json\" id=\"view-data\">{}</script>\n</section>\n",
        view.still(),
        view.poses.len() - 1,
        view.embedded()?
    ))
}

fn body(title: &str, lines: &[String], view: &str, plots: &[Plot], tables: &[Grid]) -> String {
    let mut body = String::new();
    // Writing to a String does not fail.
    let _ = write!(body, "<h1>{}</h1>\n<ul>\n", escape(title));
    for line in lines {
        let _ = writeln!(body, "<li>{}</li>", marked(line));
    }
    let _ = write!(body, "</ul>\n{view}<div class=\"plots\">\n");
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
    body
}

fn assembled(title: &str, body: &str, script: Option<&str>) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n{}</body>\n</html>\n",
        escape(title),
        include_str!("../templates/report.css"),
        script.map_or_else(String::new, |s| format!("<script>\n{s}\n</script>\n"))
    )
}
