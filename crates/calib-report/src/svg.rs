//! Pictures as SVG: plain paths, colours by CSS class, so that light, dark and print need no second drawing.

use crate::number;
use crate::plots::{Panel, Plot, PlotKind, PlotRow, Series, Strip};
use std::fmt::Write;

/// Width of every picture in user units; text is 12 units high and stays readable at 400 px.
const WIDTH: f64 = 440.0;

/// Colour classes of the values of a map, light to dark.
const STEPS: usize = 5;

/// The picture as an `<svg>` element with title and description.
pub(crate) fn svg(plot: &Plot) -> String {
    let mut body = Body(String::new());
    let height = match &plot.kind {
        PlotKind::Rows { axis, rows } => draw_rows(&mut body, axis, rows),
        PlotKind::Xy {
            x,
            y,
            log_y,
            series,
        } => draw_xy(&mut body, x, y, *log_y, series),
        PlotKind::Strips { rows } => draw_strips(&mut body, rows),
        PlotKind::Map { value, panels } => draw_map(&mut body, value, panels),
    };
    format!(
        "<svg role=\"img\" viewBox=\"0 0 {WIDTH} {height}\" aria-labelledby=\"{id}-t {id}-d\"><title id=\"{id}-t\">{}</title><desc id=\"{id}-d\">{}</desc>{}</svg>",
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

    /// A mark whose shape, not only its colour, says which series it is.
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

/// An axis: values `from..to` onto pixels `at..at + length`; `length` is negative for an upward axis.
struct Scale {
    from: f64,
    to: f64,
    at: f64,
    length: f64,
    log: bool,
}

impl Scale {
    fn new(values: impl Iterator<Item = f64>, at: f64, length: f64, log: bool) -> Self {
        let usable = values.filter(|x| x.is_finite() && (!log || *x > 0.0));
        let (mut from, mut to) = usable
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), x| {
                (from.min(x), to.max(x))
            });
        if from > to {
            (from, to) = (1.0, 1.0);
        }
        if log {
            return Self {
                from: from / 1.3,
                to: to * 1.3,
                at,
                length,
                log,
            };
        }
        if to - from < 1e-12 * to.abs().max(1e-6) {
            let room = if from == 0.0 { 1.0 } else { 0.5 * from.abs() };
            (from, to) = (from - room, to + room);
        }
        let room = 0.04 * (to - from);
        // An axis that starts at zero starts at zero.
        Self {
            from: if from == 0.0 { 0.0 } else { from - room },
            to: if to == 0.0 { 0.0 } else { to + room },
            at,
            length,
            log,
        }
    }

    fn place(&self, x: f64) -> f64 {
        let share = if self.log {
            (x.max(self.from) / self.from).ln() / (self.to / self.from).ln()
        } else {
            (x - self.from) / (self.to - self.from)
        };
        self.at + share.clamp(0.0, 1.0) * self.length
    }

    /// About `count` round numbers and their labels.
    fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        if self.log {
            let (low, high) = (
                self.from.log10().floor() as i32,
                self.to.log10().ceil() as i32,
            );
            let steps: &[f64] = if high - low > 3 {
                &[1.0]
            } else {
                &[1.0, 2.0, 5.0]
            };
            let all = (low..=high).flat_map(|decade| {
                steps
                    .iter()
                    .map(move |step| (step * 10f64.powi(decade), decade))
            });
            return all
                .filter(|(x, _)| (self.from..=self.to).contains(x))
                .map(|(x, decade)| (x, number::fixed(x, (-decade).max(0) as usize)))
                .collect();
        }
        let raw = (self.to - self.from) / count;
        let decade = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .iter()
            .map(|m| m * decade)
            .find(|step| *step >= raw * 0.999)
            .unwrap_or(raw);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let first = (self.from / step).ceil() as i64;
        let last = (self.to / step).floor() as i64;
        (first..=last)
            .map(|i| i as f64 * step)
            .map(|x| (x, number::fixed(x, decimals)))
            .collect()
    }
}

/// Labels keep to a column of this width.
const LABELS: f64 = 140.0;

/// Characters of a label in that column.
const LABEL_CHARS: usize = 20;

/// Numbers in words stand right of the rows.
const TEXTS: f64 = 134.0;

fn draw_rows(body: &mut Body, axis: &str, rows: &[PlotRow]) -> f64 {
    const ROW: f64 = 24.0;
    let values = rows
        .iter()
        .flat_map(|row| {
            [
                row.bar,
                row.mark,
                row.tick,
                row.whisker.map(|w| w[0]),
                row.whisker.map(|w| w[1]),
            ]
        })
        .flatten();
    let scale = Scale::new(values.chain([0.0]), LABELS, WIDTH - LABELS - TEXTS, false);
    let bottom = 6.0 + ROW * rows.len() as f64;
    for (x, label) in scale.ticks(3.0) {
        let at = scale.place(x);
        body.line("grid", [at, 4.0], [at, bottom]);
        body.text("tick middle", at, bottom + 14.0, &label);
    }
    let zero = scale.place(0.0);
    body.line("axis", [zero, 2.0], [zero, bottom + 2.0]);
    body.text(
        "label middle",
        LABELS + 0.5 * (WIDTH - LABELS - TEXTS),
        bottom + 30.0,
        axis,
    );
    for (i, row) in rows.iter().enumerate() {
        let y = 6.0 + ROW * (i as f64 + 0.5);
        body.text(
            "label end",
            LABELS - 8.0,
            y + 4.0,
            &crate::table::clip(&row.label, LABEL_CHARS),
        );
        if let Some(bar) = row.bar {
            let at = scale.place(bar);
            body.rect(
                &format!("bar s{}", row.style),
                zero.min(at),
                y - 6.0,
                (at - zero).abs(),
                12.0,
            );
        }
        if let Some([from, to]) = row.whisker {
            body.line("whisker", [scale.place(from), y], [scale.place(to), y]);
        }
        if let Some(tick) = row.tick {
            let at = scale.place(tick);
            body.line("whisker", [at, y - 5.0], [at, y + 5.0]);
        }
        if let Some(mark) = row.mark {
            body.mark(row.style, [scale.place(mark), y]);
        }
        body.text(
            "number",
            WIDTH - TEXTS + 6.0,
            y + 4.0,
            &crate::table::clip(&row.text, 20),
        );
    }
    bottom + 36.0
}

fn draw_xy(body: &mut Body, x_label: &str, y_label: &str, log_y: bool, series: &[Series]) -> f64 {
    const TOP: f64 = 28.0;
    const LEFT: f64 = 50.0;
    const HEIGHT: f64 = 168.0;
    let points = || series.iter().flat_map(|series| &series.points);
    let x = Scale::new(points().map(|p| p[0]), LEFT, WIDTH - LEFT - 8.0, false);
    let y = Scale::new(points().map(|p| p[1]), TOP + HEIGHT, -HEIGHT, log_y);
    for (at, label) in y.ticks(4.0) {
        body.line("grid", [LEFT, y.place(at)], [WIDTH - 8.0, y.place(at)]);
        body.text("tick end", LEFT - 6.0, y.place(at) + 4.0, &label);
    }
    for (at, label) in x.ticks(5.0) {
        body.line("grid", [x.place(at), TOP], [x.place(at), TOP + HEIGHT]);
        body.text("tick middle", x.place(at), TOP + HEIGHT + 15.0, &label);
    }
    if !log_y && y.from < 0.0 && y.to > 0.0 {
        body.line("axis", [LEFT, y.place(0.0)], [WIDTH - 8.0, y.place(0.0)]);
    }
    body.text(
        "label middle",
        LEFT + 0.5 * (WIDTH - LEFT),
        TOP + HEIGHT + 32.0,
        x_label,
    );
    let mut legend = LEFT;
    for series in series {
        if series.line {
            body.line(
                &format!("line s{}", series.style),
                [legend, 10.0],
                [legend + 14.0, 10.0],
            );
        } else {
            body.mark(series.style, [legend + 7.0, 10.0]);
        }
        body.text("tick", legend + 18.0, 14.0, &series.name);
        legend += 34.0 + 6.4 * series.name.chars().count() as f64;
    }
    body.text("tick end", WIDTH - 8.0, 14.0, y_label);
    for series in series {
        let places: Vec<[f64; 2]> = series
            .points
            .iter()
            .filter(|p| p[0].is_finite() && p[1].is_finite())
            .map(|p| [x.place(p[0]), y.place(p[1])])
            .collect();
        if series.line && places.len() > 1 {
            body.path(&format!("line s{}", series.style), &places);
        } else {
            for place in places {
                body.mark(series.style, place);
            }
        }
    }
    TOP + HEIGHT + 40.0
}

fn draw_strips(body: &mut Body, rows: &[Strip]) -> f64 {
    const ROW: f64 = 34.0;
    let width = WIDTH - LABELS - 10.0;
    for (i, row) in rows.iter().enumerate() {
        let y = 4.0 + ROW * i as f64;
        body.text(
            "label end",
            LABELS - 8.0,
            y + 12.0,
            &crate::table::clip(&row.label, LABEL_CHARS),
        );
        let cell = width / row.counts.len().max(1) as f64;
        let most = row.counts.iter().copied().max().unwrap_or(0).max(1);
        for (bin, count) in row.counts.iter().enumerate() {
            // Five shades; one sample is already the first.
            let shade = (count * STEPS as u64).div_ceil(most);
            body.rect(
                &format!("cell v{shade}"),
                LABELS + bin as f64 * cell,
                y,
                cell,
                16.0,
            );
        }
        body.text("tick", LABELS, y + 28.0, &row.from);
        body.text("tick end", LABELS + width, y + 28.0, &row.to);
    }
    8.0 + ROW * rows.len() as f64
}

fn draw_map(body: &mut Body, value: &str, panels: &[Panel]) -> f64 {
    const SIDE: f64 = 172.0;
    let values = || {
        panels
            .iter()
            .flat_map(|panel| panel.points.iter().map(|p| p[2]))
    };
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    let shade = |v: f64| {
        if high > low {
            (1 + ((v - low) / (high - low) * STEPS as f64) as usize).min(STEPS)
        } else {
            1
        }
    };
    for (i, panel) in panels.iter().enumerate() {
        let left = 38.0 + i as f64 * (SIDE + 50.0);
        // One scale for both axes: a workspace that is round looks round.
        let span = |k: usize| {
            let (a, b) = panel
                .points
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                    (a.min(p[k]), b.max(p[k]))
                });
            if a <= b {
                (0.5 * (a + b), b - a)
            } else {
                (0.0, 1.0)
            }
        };
        let (middle_x, width) = span(0);
        let (middle_y, height) = span(1);
        let half = 0.5 * width.max(height).max(1e-3);
        let x = Scale::new(
            [middle_x - half, middle_x + half].into_iter(),
            left,
            SIDE,
            false,
        );
        let y = Scale::new(
            [middle_y - half, middle_y + half].into_iter(),
            8.0 + SIDE,
            -SIDE,
            false,
        );
        for (at, label) in x.ticks(4.0) {
            body.line("grid", [x.place(at), 8.0], [x.place(at), 8.0 + SIDE]);
            body.text("tick middle", x.place(at), SIDE + 23.0, &label);
        }
        for (at, label) in y.ticks(4.0) {
            body.line("grid", [left, y.place(at)], [left + SIDE, y.place(at)]);
            body.text("tick end", left - 5.0, y.place(at) + 4.0, &label);
        }
        body.text(
            "label middle",
            left + 0.5 * SIDE,
            SIDE + 39.0,
            &format!("{} over {}", panel.y, panel.x),
        );
        for point in &panel.points {
            body.circle(
                &format!("place v{}", shade(point[2])),
                [x.place(point[0]), y.place(point[1])],
                3.0,
            );
        }
    }
    let y = SIDE + 52.0;
    body.text(
        "tick end",
        150.0,
        y + 10.0,
        &format!("{value} {}", number::fixed(low, 3)),
    );
    for step in 1..=STEPS {
        body.rect(
            &format!("cell v{step}"),
            156.0 + 24.0 * (step - 1) as f64,
            y,
            24.0,
            12.0,
        );
    }
    body.text(
        "tick",
        162.0 + 24.0 * STEPS as f64,
        y + 10.0,
        &number::fixed(high, 3),
    );
    y + 20.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_inside_and_not_too_many() {
        for (from, to) in [
            (0.0, 1.0),
            (-3.7, 12.2),
            (1e-6, 3e-6),
            (-1e5, 1e5),
            (5.0, 5.0),
            (0.0, 0.0),
        ] {
            let scale = Scale::new([from, to].into_iter(), 0.0, 100.0, false);
            let ticks = scale.ticks(4.0);
            assert!((1..=9).contains(&ticks.len()), "{from} {to}: {ticks:?}");
            for (x, label) in ticks {
                assert!((0.0..=100.0).contains(&scale.place(x)));
                assert!(
                    (label.parse::<f64>().expect("a number") - x).abs() <= 1e-9 * x.abs().max(1e-9),
                    "{label} {x}"
                );
            }
        }
    }

    #[test]
    fn a_logarithmic_axis_survives_zero_and_nothing() {
        let scale = Scale::new([0.0, 0.5, 40.0].into_iter(), 0.0, 100.0, true);
        assert_eq!(scale.place(0.0), 0.0);
        assert!(scale.ticks(4.0).iter().any(|tick| tick.1 == "10"));
        let empty = Scale::new(std::iter::empty(), 0.0, 100.0, true);
        assert!(empty.place(1.0).is_finite());
    }

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
                series: vec![xy],
            },
            PlotKind::Strips {
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
}
