//! Short codes of hypotheses, for the values of findings: `sign(elbow)`, `exchange(elbow, wrist)@sweep`.

use calib_checks::structural::{
    ColumnOrder, Correction, Hypothesis, Length, PoseMistake, QuarterTurns, Scope, Scoped,
    UnitMistake,
};

use nalgebra::Vector3;

use super::layout::Layout;

/// The code of a correction: those of its parts, joined by `+`.
#[must_use]
pub fn of_correction(layout: &Layout<'_>, correction: &Correction) -> String {
    let parts: Vec<String> = correction.iter().map(|s| of(layout, s)).collect();
    parts.join(" + ")
}

/// The code of a hypothesis, with its recordings where they are not all.
#[must_use]
pub fn of(layout: &Layout<'_>, scoped: &Scoped) -> String {
    let code = of_hypothesis(layout, &scoped.hypothesis);
    match scoped.scope {
        Scope::All => code,
        scope => format!("{code}@{}", layout.recordings_in(scope).join("+")),
    }
}

fn of_hypothesis(layout: &Layout<'_>, hypothesis: &Hypothesis) -> String {
    let joint = |j| layout.joint(j);
    match *hypothesis {
        Hypothesis::Sign { joint: j } => format!("sign({})", joint(j)),
        Hypothesis::Exchange { first, second } => {
            format!("exchange({}, {})", joint(first), joint(second))
        }
        Hypothesis::Order { order } => match order {
            ColumnOrder::Reversed(_) => "order(reversed)".to_owned(),
            ColumnOrder::Before(_) => "order(one before)".to_owned(),
            ColumnOrder::After(_) => "order(one after)".to_owned(),
            ColumnOrder::Alphabetical(_) => "order(values by name)".to_owned(),
            ColumnOrder::Robots(_) => "order(names by name)".to_owned(),
            ColumnOrder::Limbs { first, second } => {
                format!(
                    "order({} and behind, {} and behind)",
                    joint(first),
                    joint(second)
                )
            }
        },
        Hypothesis::Unit { joint: j, mistake } => format!("unit({}, {})", joint(j), unit(mistake)),
        Hypothesis::Units { mistake } => format!("unit(all, {})", unit(mistake)),
        Hypothesis::Coupling {
            joint: j,
            source,
            factor,
        } => {
            let unit = layout.unit_of_share(j, source);
            let (scale, suffix) = unit.display();
            let factor = scale * factor;
            format!(
                "coupling({}, {}, {factor:+.3}{suffix})",
                joint(j),
                joint(source)
            )
        }
        Hypothesis::Gain { joint: j, factor } => format!("gain({}, {factor:.4})", joint(j)),
        Hypothesis::Axis { joint: j, along } => {
            format!("axis({}, {})", joint(j), axis(&along.vector()))
        }
        Hypothesis::Offset { joint: j, turns } => {
            let degrees = match turns {
                QuarterTurns::Plus90 => "+90",
                QuarterTurns::Minus90 => "-90",
                QuarterTurns::Half => "180",
            };
            format!("offset({}, {degrees} deg)", joint(j))
        }
        Hypothesis::Zero { joint: j, offset } => {
            let (offset, unit) = layout.shown(j, offset);
            format!("zero({}, {offset:+.2} {unit})", joint(j))
        }
        Hypothesis::Lag { recording, seconds } => {
            let name = &layout.recordings[recording.0].name;
            format!("lag({name}, {:+.1} ms)", 1e3 * seconds)
        }
        Hypothesis::Latency { joint: j, seconds } => {
            format!("latency({}, {:+.1} ms)", joint(j), 1e3 * seconds)
        }
        Hypothesis::LatencyBeyond { joint: j, seconds } => {
            format!("latency({} and beyond, {:+.1} ms)", joint(j), 1e3 * seconds)
        }
        Hypothesis::RowShift { rows } => format!("rows({rows:+})"),
        Hypothesis::MissingColumn { joint: j } => format!("column({})", joint(j)),
        Hypothesis::StoodAt { joint: j, value } => {
            let (value, unit) = layout.shown(j, value);
            format!("stood({}, {value:.0} {unit})", joint(j))
        }
        Hypothesis::WrongLink { body, link } => {
            format!("link({}, {})", layout.body(body), layout.link(link))
        }
        Hypothesis::ExchangedBodies { first, second } => {
            format!("bodies({}, {})", layout.body(first), layout.body(second))
        }
        Hypothesis::TrackerUnit { unit, .. } => format!("unit(tracker, {})", length(unit)),
        Hypothesis::Mirrored => "mirrored(tracker)".to_owned(),
        Hypothesis::TrackerAxes { rotation } => format!("axes(tracker, {rotation})"),
        Hypothesis::TrackerMoved => "moved(tracker)".to_owned(),
        Hypothesis::Remounted { body } => format!("remounted({})", layout.body(body)),
        Hypothesis::Poses { body, mistake } => {
            let body = body.map_or("all", |b| layout.body(b));
            let mistake = match mistake {
                PoseMistake::ScalarFirstReadAsLast => "scalar first",
                PoseMistake::ScalarLastReadAsFirst => "scalar last",
                PoseMistake::Inverse => "inverse",
                PoseMistake::Transposed => "transposed",
            };
            format!("poses({body}, {mistake})")
        }
        _ => "other".to_owned(),
    }
}

/// An axis as a URDF has it, with few digits; −0 is 0.
pub fn axis(axis: &Vector3<f64>) -> String {
    let number = |x: &f64| ((x * 1e6).round() / 1e6 + 0.0).to_string();
    axis.iter().map(number).collect::<Vec<_>>().join(" ")
}

/// A unit of length, as in names of columns.
pub fn length(unit: Length) -> &'static str {
    match unit {
        Length::Meter => "m",
        Length::Centimeter => "cm",
        Length::Millimeter => "mm",
        Length::Micrometer => "um",
        Length::Inch => "in",
        Length::Foot => "ft",
    }
}

/// The unit that the values really have.
fn unit(mistake: UnitMistake) -> &'static str {
    match mistake {
        UnitMistake::DegreesReadAsRadians => "deg",
        UnitMistake::RadiansReadAsDegrees => "rad",
        UnitMistake::Length { unit, .. } => length(unit),
    }
}
