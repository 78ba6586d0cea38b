//! Plots as SVG: plain paths, colors by CSS class, so that one drawing serves light, dark and print.

mod kinds;
mod map;
mod matrix;
mod scale;
mod strip;
mod xy;

pub(crate) use strip::strip;

use crate::plots::{Plot, PlotKind};
use std::fmt::Write;
use xy::Labels;

/// Width of every plot in user units; text is 12 units high and stays readable at 400 px.
const WIDTH: f64 = 440.0;

/// Color classes of the values of a map, light to dark.
const STEPS: usize = 5;

/// The plot as an `<svg>` element with title and description, for a page that has the styles.
pub(crate) fn svg(plot: &Plot) -> String {
    element(plot, "", "")
}

/// The plot as an SVG file of its own, with the styles of the report's page.
#[must_use]
pub fn picture(plot: &Plot) -> String {
    let style = include_str!("../templates/report.css");
    let style = format!("<style>\n{}</style>", escape(style));
    element(plot, "xmlns=\"http://www.w3.org/2000/svg\" ", &style) + "\n"
}

/// The element with further attributes, and with what stands before its content.
fn element(plot: &Plot, attributes: &str, style: &str) -> String {
    let mut body = Body(String::new());
    let height = match &plot.kind {
        PlotKind::Rows { axis, rows } => kinds::draw_rows(&mut body, axis, rows),
        PlotKind::Xy {
            x,
            y,
            log_y,
            band,
            series,
        } => xy::draw_xy(&mut body, &Labels { x, y }, *log_y, band.as_ref(), series),
        PlotKind::Bars { x, y, bars, curve } => {
            xy::draw_bars(&mut body, &Labels { x, y }, bars, curve)
        }
        PlotKind::Matrix { value, names, rows } => {
            matrix::draw_matrix(&mut body, value, names, rows)
        }
        PlotKind::Strips { axis, rows } => kinds::draw_strips(&mut body, axis, rows),
        PlotKind::Map { value, panels } => map::draw_map(&mut body, value, panels),
    };
    format!(
        "<svg {attributes}role=\"img\" viewBox=\"0 0 {WIDTH} {height}\" aria-labelledby=\"{id}-t {id}-d\"><title id=\"{id}-t\">{}</title><desc id=\"{id}-d\">{}</desc>{style}{}</svg>",
        escape(&plot.title),
        escape(&plot.description),
        body.0,
        id = plot.id,
    )
}

/// Text inside an element or attribute.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

pub(crate) struct Body(pub(crate) String);

impl Body {
    pub(crate) fn line(&mut self, class: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) {
        let _ = write!(
            self.0,
            "<path class=\"{class}\" d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\"/>"
        );
    }

    pub(crate) fn path(&mut self, class: &str, points: &[[f64; 2]]) {
        let d: Vec<String> = points
            .iter()
            .map(|[x, y]| format!("{x:.1} {y:.1}"))
            .collect();
        let _ = write!(self.0, "<path class=\"{class}\" d=\"M{}\"/>", d.join("L"));
    }

    fn rect(&mut self, class: &str, x: f64, y: f64, width: f64, height: f64) {
        let _ = write!(
            self.0,
            "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{height:.1}\"/>",
            width.max(0.0)
        );
    }

    pub(crate) fn circle(&mut self, class: &str, [x, y]: [f64; 2], r: f64) {
        let _ = write!(
            self.0,
            "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\"/>"
        );
    }

    pub(crate) fn text(&mut self, class: &str, x: f64, y: f64, text: &str) {
        let _ = write!(
            self.0,
            "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>",
            escape(text)
        );
    }

    /// Text that reads upwards, its middle at a place.
    fn upright(&mut self, x: f64, y: f64, text: &str) {
        let _ = write!(
            self.0,
            "<text class=\"label middle\" transform=\"translate({x:.1} {y:.1}) rotate(-90)\">{}</text>",
            escape(text)
        );
    }

    /// A mark whose shape, not only its color, identifies the series.
    fn mark(&mut self, series: usize, [x, y]: [f64; 2]) {
        let class = format!("mark s{series}");
        match series {
            0 => self.circle(&class, [x, y], 3.0),
            1 => self.rect(&class, x - 2.7, y - 2.7, 5.4, 5.4),
            2 => self.path(
                &class,
                &[
                    [x, y - 4.0],
                    [x + 4.0, y],
                    [x, y + 4.0],
                    [x - 4.0, y],
                    [x, y - 4.0],
                ],
            ),
            _ => self.path(
                &class,
                &[
                    [x, y - 3.8],
                    [x + 3.6, y + 2.6],
                    [x - 3.6, y + 2.6],
                    [x, y - 3.8],
                ],
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plots::{Band, Panel, PlotRow, Series, Strip};

    #[test]
    fn names_cannot_leave_the_picture() {
        let rows = vec![PlotRow {
            label: "<script>\"&".into(),
            bar: Some(1.0),
            ..PlotRow::default()
        }];
        let plot = Plot {
            id: "p".into(),
            section: "data",
            title: "<b>".into(),
            description: "&".into(),
            kind: PlotKind::Rows {
                axis: "mm".into(),
                rows,
            },
        };
        let text = svg(&plot);
        assert!(!text.contains("<script>") && !text.contains("<b>"));
        roxmltree::Document::parse(&text).expect("well-formed");
    }

    #[test]
    fn every_number_of_a_picture_is_finite() {
        let row = PlotRow {
            bar: Some(f64::NAN),
            mark: Some(f64::INFINITY),
            ..PlotRow::default()
        };
        let xy = Series {
            name: "a".into(),
            style: 0,
            line: true,
            points: vec![[f64::NAN, 1.0], [0.0, 0.0]],
        };
        let kinds = [
            PlotKind::Rows {
                axis: String::new(),
                rows: vec![row],
            },
            PlotKind::Xy {
                x: String::new(),
                y: String::new(),
                log_y: true,
                band: Some(Band {
                    name: String::new(),
                    points: vec![[f64::NAN, 0.0, 1.0], [0.0, 1.0, f64::INFINITY]],
                }),
                series: vec![xy.clone()],
            },
            PlotKind::Bars {
                x: String::new(),
                y: String::new(),
                bars: vec![[f64::NAN, 0.0, 1.0], [0.0, 0.0, 0.0]],
                curve: xy,
            },
            PlotKind::Matrix {
                value: String::new(),
                names: vec!["a".into(), "b".into()],
                rows: vec![vec![], vec![f64::NAN]],
            },
            PlotKind::Strips {
                axis: String::new(),
                rows: vec![Strip {
                    label: String::new(),
                    from: String::new(),
                    to: String::new(),
                    counts: vec![0, 0],
                }],
            },
            PlotKind::Map {
                value: String::new(),
                panels: vec![Panel {
                    x: String::new(),
                    y: String::new(),
                    points: vec![],
                }],
            },
        ];
        for kind in kinds {
            let plot = Plot {
                id: "p".into(),
                section: "data",
                title: String::new(),
                description: String::new(),
                kind,
            };
            let text = svg(&plot);
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        }
    }

    /// Texts of a class in a picture.
    fn texts(svg: &str, class: &str) -> Vec<String> {
        let document = roxmltree::Document::parse(svg).expect("well-formed");
        let of_class = |n: &roxmltree::Node<'_, '_>| {
            n.attribute("class")
                .is_some_and(|c| c.split(' ').any(|c| c == class))
        };
        let found = document.descendants().filter(of_class);
        found.filter_map(|n| n.text().map(str::to_owned)).collect()
    }

    #[test]
    fn both_axes_have_a_title_and_at_least_two_labeled_ticks_at_any_size_of_the_data() {
        for exponent in -9..6 {
            for from in [0.0, 1.0, -3.3, 0.97] {
                for width in [1e-6, 0.03, 1.0, 7.7] {
                    let at = |t: f64| (from + width * t) * 10f64.powi(exponent);
                    for log_y in [false, true] {
                        let scale =
                            scale::Scale::new([at(0.0), at(1.0)].into_iter(), 0.0, 100.0, log_y);
                        for count in [3.0, 4.0, 5.0] {
                            let ticks = scale.ticks(count);
                            assert!(
                                ticks.len() >= 2,
                                "{from} {width} {exponent} {log_y}: {ticks:?}"
                            );
                            let mut labels: Vec<_> = ticks.iter().map(|t| &t.1).collect();
                            labels.dedup();
                            assert_eq!(labels.len(), ticks.len(), "{labels:?}");
                        }
                    }
                }
            }
        }
        let series = Series {
            name: "a".into(),
            style: 0,
            line: true,
            points: vec![[0.0, 1.0], [2.0, 3.0]],
        };
        let plot = Plot {
            id: "p".into(),
            section: "data",
            title: String::new(),
            description: String::new(),
            kind: PlotKind::Xy {
                x: "angle [deg]".into(),
                y: "residual [mm]".into(),
                log_y: false,
                band: None,
                series: vec![series],
            },
        };
        let text = svg(&plot);
        assert_eq!(texts(&text, "label"), ["angle [deg]", "residual [mm]"]);
        assert!(
            texts(&text, "tick").len() >= 5,
            "two for each axis and the legend"
        );
    }
}
