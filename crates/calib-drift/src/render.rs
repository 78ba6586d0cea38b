//! What a person and a program read of a drift.

use std::fmt::Write as _;

use calib_report::{number, printable_line, terminal};

use crate::compare::{Changed, Drift, Undecided};
use crate::error::DriftError;

/// For a terminal of so many columns: the answer first, then what moved and by how much.
#[must_use]
pub fn text(drift: &Drift, columns: usize) -> String {
    let mut out = String::new();
    // Writing to a String does not fail.
    let robot = printable_line(&drift.robot);
    let title = format!("{} → {} · {robot}", drift.old, drift.new);
    out += &terminal::wrapped(&title, columns, "", "  ");
    let significant: Vec<&Changed> = drift.numbers.iter().filter(|n| n.significant).collect();
    let (free, entangled): (Vec<&Changed>, Vec<&Changed>) =
        significant.iter().partition(|n| n.gauge_free);
    out += &headline(drift, &significant, columns);
    out += &warnings(drift, columns);
    out += &terminal::wrapped(
        &format!(
            "all at once: squared distance {:.1}, p {} ({} directions that both recordings see)",
            drift.joint.statistic,
            probability(drift.joint.p_value),
            drift.joint.degrees_of_freedom
        ),
        columns,
        "- ",
        "  ",
    );
    out += &terminal::wrapped(
        &format!(
            "one by one: {} of {} numbers changed (Holm); false-alarm rate {} % for the whole comparison",
            significant.len(),
            drift.numbers.len(),
            number::fixed(100.0 * drift.false_alarms, 0)
        ),
        columns,
        "- ",
        "  ",
    );
    let moved = heading(drift);
    section(&mut out, (moved, columns), &free);
    section(
        &mut out,
        (
            match free.is_empty() {
                true => moved,
                false => "The same in the parameters' own frames",
            },
            columns,
        ),
        &entangled,
    );
    let still: Vec<&Changed> = drift
        .numbers
        .iter()
        .filter(|n| !n.significant && n.gauge_free)
        .collect();
    if drift.changed || !still.is_empty() {
        section(&mut out, (&not_significant(drift), columns), &still);
    }
    let mut list = |what: &str, names: &[String]| {
        if !names.is_empty() {
            out.push('\n');
            out += &terminal::wrapped(&format!("{what}: {}", names.join(", ")), columns, "", "  ");
        }
    };
    list(
        "left open by one of the recordings by more than 1° or 1 cm, too far for the linear comparison",
        &drift.not_credible,
    );
    list("only in the old calibration", &drift.only_old);
    list("only in the new calibration", &drift.only_new);
    list(
        "determined by one of the two recordings only",
        &drift.known_in_one,
    );
    let mut note = |text: String| {
        out.push('\n');
        out += &terminal::wrapped(&text, columns, "", "  ");
    };
    if !drift.same_nominal {
        note(
            "The two calibrations start from different nominal URDFs: only what no choice of frames changes, and effects of joints, are \
             compared."
                .to_owned(),
        );
    }
    if drift.same_nominal && drift.directions_not_credible > 0 {
        note(format!(
            "{} combinations of parameters are not in the test of all at once: the recordings leave them open by more than 1° or 1 cm, \
             too far for the linear comparison.",
            drift.directions_not_credible
        ));
    }
    out += &zeros_not_compared(drift, columns);
    out + &known_in_neither(drift, columns)
}

/// How many parameters neither recording sees.
fn known_in_neither(drift: &Drift, columns: usize) -> String {
    if drift.known_in_neither.is_empty() {
        return String::new();
    }
    let line = format!(
        "{} parameters are conventions or not seen by either recording; what both see of their combinations is in the test of all at once",
        drift.known_in_neither.len()
    );
    format!("\n{}", terminal::wrapped(&line, columns, "", "  "))
}

/// Over the numbers that changed.
fn heading(drift: &Drift) -> &'static str {
    match drift.undecided {
        Some(_) => "What differs",
        None => "What moved",
    }
}

/// The joints whose zeros are not compared; those of the others are angles between their neighbors.
fn zeros_not_compared(drift: &Drift, columns: usize) -> String {
    let is_compared = |joint: &&str| {
        let own = [format!("zero.{joint}"), format!("{joint}.offset")];
        let of_branch = format!("zero.{joint}.");
        let mut names = drift.numbers.iter().map(|n| &n.name);
        names.any(|n| own.contains(n) || n.starts_with(&of_branch))
    };
    let zeros = drift
        .known_in_neither
        .iter()
        .filter_map(|n| n.strip_suffix(".offset"));
    let zeros: Vec<&str> = zeros.filter(|joint| !is_compared(joint)).collect();
    if zeros.is_empty() {
        return String::new();
    }
    let text = format!(
        "Not compared: the zeros of {}, which the recordings do not distinguish from the places of robot, tracker and bodies.",
        zeros.join(", ")
    );
    format!("\n{}", terminal::wrapped(&text, columns, "", "  "))
}

/// What makes the answer another one than that about the robot.
fn warnings(drift: &Drift, columns: usize) -> String {
    let mut out = String::new();
    if drift.same_recordings {
        out += &terminal::wrapped(
            "Both were made from the same recordings, byte for byte: this compares profiles, not the robot at two times.",
            columns,
            "warning: ",
            "  ",
        );
    }
    if drift.changed || drift.undecided.is_some() {
        for (file, effects) in &drift.lacking {
            let text = format!(
                "the residuals of {file} show an effect that its model lacks ({}). In other postures it looks like a change of the robot. Free it in both profiles and calibrate again before you trust the following lines.",
                effects.join(", ")
            );
            out += &terminal::wrapped(&text, columns, "warning: ", "  ");
        }
    }
    for file in &drift.rejected {
        let text = format!(
            "{file} is of a rejected calibration: what its model does not explain, as a tracker that moved or an effect, looks like a change of the robot. Read its report first."
        );
        out += &terminal::wrapped(&text, columns, "warning: ", "  ");
    }
    out
}

/// The answer.
fn headline(drift: &Drift, significant: &[&Changed], columns: usize) -> String {
    let changed = match (drift.undecided, drift.changed, significant.is_empty()) {
        (Some(why), ..) => {
            let remedy = terminal::wrapped(why.remedy(), columns, "", "  ");
            return format!("{}{remedy}", why.headline());
        }
        (None, false, _) => "NO SIGNIFICANT CHANGE\n",
        (None, true, _) if !drift.lacking.is_empty() => {
            "CHANGED, OR AN EFFECT THAT THE MODEL LACKS\n"
        }
        (None, true, false) => "CHANGED\n",
        (None, true, true) => "CHANGED, and no single number shows where\n",
    };
    changed.to_owned()
}

impl Undecided {
    fn headline(self) -> &'static str {
        match self {
            Self::OtherParameters => "NOT DECIDED: the calibrations estimate other parameters\n",
            Self::NoiseHardlyKnown => "NOT DECIDED: the noise is known from too few data\n",
        }
    }

    /// Why, and what to do.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::OtherParameters => {
                "They differ, but what only one of them estimates is held at its nominal value in the other, and the rest makes up for it. Calibrate \
                 both with the same `solve.free` and the same effects."
            }
            Self::NoiseHardlyKnown => {
                "They differ by more than the noise as it was found explains, but one level of it is so uncertain that chance could. Record more \
                 poses, or state that level in the profile."
            }
        }
    }
}

/// Columns of a name beside its change; a longer one stands above it.
const LEAST: usize = 12;

fn section(out: &mut String, (heading, columns): (&str, usize), rows: &[&Changed]) {
    if rows.is_empty() {
        return;
    }
    out.push('\n');
    *out += &terminal::wrapped(heading, columns, "", "  ");
    // What a change and its weight need; the longest weight needs more.
    let numbers = match rows.iter().all(|r| r.significant) {
        true => 32,
        false => 46,
    };
    let room = columns.saturating_sub(numbers).max(LEAST);
    let width = rows
        .iter()
        .map(|r| r.text.chars().count())
        .max()
        .unwrap_or(0)
        .min(room);
    for row in rows {
        let change = number::change(row.change, Some(row.sigma), row.unit);
        let weight = weight(row);
        if row.text.chars().count() > width {
            *out += &terminal::wrapped(&row.text, columns, "  ", "    ");
            let _ = writeln!(out, "  {:width$}  {change}  {weight}", "");
        } else {
            let _ = writeln!(out, "  {:width$}  {change}  {weight}", row.text);
        }
    }
}

fn not_significant(drift: &Drift) -> String {
    format!(
        "Not significant at the level of {} % (p for the whole list, by Holm)",
        number::fixed(50.0 * drift.false_alarms, 1)
    )
}

/// How much a change means. Few degrees of freedom make one of many σ not significant: the reader must see that.
fn weight(row: &Changed) -> String {
    /// Degrees of freedom below which Student's t has far heavier tails than the normal.
    const FEW: f64 = 10.0;
    let sigmas = (row.change / row.sigma).abs();
    if row.significant {
        return format!("({sigmas:.1} σ)");
    }
    let few = match row.degrees_of_freedom < FEW {
        true => format!(", {:.0} dof", row.degrees_of_freedom),
        false => String::new(),
    };
    format!("({sigmas:.1} σ{few}, p {:.2})", row.p_adjusted)
}

fn probability(p: f64) -> String {
    /// Below this the tail of any distribution is a matter of faith.
    const SMALLEST: f64 = 1e-6;
    if p < SMALLEST {
        format!("< {SMALLEST:e}")
    } else if p < 1e-3 {
        format!("= {p:.1e}")
    } else {
        format!("= {p:.3}")
    }
}

/// For a program: SI, floats with twelve digits.
///
/// # Errors
/// [`DriftError::Unwritable`] when it has no JSON form.
pub fn json(drift: &Drift) -> Result<String, DriftError> {
    rounded(drift)
}

pub(crate) fn rounded<T: serde::Serialize>(of: &T) -> Result<String, DriftError> {
    let exact = calib_report::json::exact_json(of)?;
    match serde_json::from_str(&exact) {
        Ok(value) => Ok(calib_report::json::pretty(&calib_report::json::rounded(
            value,
        ))),
        Err(_) => Ok(exact),
    }
}
