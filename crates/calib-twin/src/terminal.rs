//! The summary on the terminal: at most 24 lines.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use calib_finding::Unit;
use calib_report::number;
use calib_report::terminal::wrapped;

use crate::likeness::LEAST_TRIALS;
use crate::power::Power;
use crate::quantity::Quantity;
use crate::summary::Promise;
use crate::twin::Twin;
use crate::words;

/// Lines of effects at the most.
const EFFECTS: usize = 6;
/// Lines of the whole summary at the most.
const LINES: usize = 24;
/// Width of the names on the left.
const LEFT: usize = 15;

/// The summary of so many columns; `folder`: where the files are.
#[must_use]
pub fn summary(twin: &Twin, folder: &str, columns: usize) -> String {
    let title = format!(
        "Twin of {}: {} trials of this session with known truth",
        twin.robot, twin.trials
    );
    let mut text = wrapped(&title, columns, "", "  ");
    let mut line = |name: &str, said: &str| {
        // A long name keeps a blank behind it.
        let first = format!("{name:<width$} ", width = LEFT - 1);
        text += &wrapped(said, columns, &first, &" ".repeat(LEFT));
    };
    if let Some(said) = resembles(twin) {
        line("resemblance", &said);
    }
    if twin.refused + twin.not_converged > 0 {
        line("without result", &without_result(twin));
    }
    line("promised σ", &kept(twin));
    line("95 % intervals", &intervals(twin));
    for p in twin.promises.iter().filter(|p| is_position(p)).take(2) {
        let said = format!(
            "σ {} promised, {} reached (± {:.0} %)",
            number::sigma(Some(p.promised), p.unit),
            number::sigma(Some(p.reached), p.unit),
            100.0 * p.ratio_sigma / p.ratio
        );
        line(&body_of(p), &said);
    }
    line(
        "false alarms",
        &words::share(twin.false_alarms, twin.trials - twin.refused),
    );
    for (effect, said) in effects(twin) {
        line(&effect, &said);
    }
    if let Some(said) = checked(twin) {
        line("checked", &said);
    }
    for slip in &twin.slips {
        if let (Some(size), Some([low, high])) = (slip.size_m, slip.interval_m) {
            let length = |m: f64| number::sigma(Some(m), Unit::Meter);
            let said = format!(
                "noticed in 80 %: {} ({} to {}, {} trials)",
                length(size),
                length(low),
                length(high),
                slip.tried
            );
            line(&format!("slip of {}", slip.body), &said);
        }
    }
    if let Some(said) = postures(twin) {
        line("postures", &said);
    }
    let mut lines = text.lines().count() + 1;
    for (k, note) in twin.notes.iter().enumerate() {
        let one = wrapped(&words::note(note), columns, "note: ", "      ");
        if lines + one.lines().count() + usize::from(k + 1 < twin.notes.len()) > LINES {
            let _ = writeln!(text, "note: {} more in twin.html", twin.notes.len() - k);
            break;
        }
        lines += one.lines().count();
        text += &one;
    }
    let see = format!("See {folder}/twin.html: what this session can and cannot tell");
    text + &wrapped(&see, columns, "", "  ")
}

fn is_position(p: &Promise) -> bool {
    matches!(p.of, Quantity::Position { .. })
}

fn body_of(p: &Promise) -> String {
    match &p.of {
        Quantity::Position { body } => body.clone(),
        of => words::quantity(of),
    }
}

/// Whether the trials resemble the recording.
pub(crate) fn resembles(twin: &Twin) -> Option<String> {
    let found = twin.resemblance.as_ref()?;
    let Some(p) = found.p_value else {
        return Some(format!(
            "not tested: at least {LEAST_TRIALS} trials are needed"
        ));
    };
    if !found.differs {
        return Some(format!(
            "the trials resemble the recording: {:.0} % of recordings differ as much by chance",
            100.0 * p
        ));
    }
    let worst = found.marks.first().map_or("", |m| words::mark(m.mark));
    Some(format!(
        "THIS TWIN DOES NOT RESEMBLE THE RECORDING: the largest difference is in {worst}. The rest holds for the model, not for this robot"
    ))
}

pub(crate) fn without_result(twin: &Twin) -> String {
    let mut said = Vec::new();
    if twin.refused > 0 {
        said.push(format!(
            "{} refused",
            words::share(twin.refused, twin.trials)
        ));
    }
    if twin.not_converged > 0 {
        said.push(format!(
            "{} did not converge",
            words::share(twin.not_converged, twin.trials)
        ));
    }
    said.join(", ")
}

/// Quantities that the data decide.
pub(crate) fn observed(twin: &Twin) -> Vec<&Promise> {
    twin.promises.iter().filter(|p| p.is_observed()).collect()
}

pub(crate) fn kept(twin: &Twin) -> String {
    let of = observed(twin);
    let kept = of.iter().filter(|p| p.is_kept()).count();
    let least = of.iter().map(|p| p.ratio).fold(f64::INFINITY, f64::min);
    let most = of.iter().map(|p| p.ratio).fold(0.0, f64::max);
    let broken: Vec<&&Promise> = of.iter().filter(|p| p.is_broken()).collect();
    if of.is_empty() {
        return "no stated quantity is determined by the data".to_owned();
    }
    let mut said = format!(
        "over reached σ: {least:.2} to {most:.2} for the {} quantities that the data determine; within 15 %: {kept}",
        of.len()
    );
    if let Some(worst) = broken.first() {
        said += &format!(
            "; {} further off than chance explains (`{}`: {:.2})",
            broken.len(),
            words::quantity(&worst.of),
            worst.ratio
        );
    }
    said
}

pub(crate) fn intervals(twin: &Twin) -> String {
    let of = observed(twin);
    let n = of.len().max(1) as f64;
    let mean = of.iter().map(|p| p.coverage).sum::<f64>() / n;
    let biased = of.iter().filter(|p| p.is_biased()).count();
    format!(
        "contain the truth in {:.1} %; {}",
        100.0 * mean,
        match biased {
            0 => "no significant bias".to_owned(),
            1 => "one quantity is significantly biased".to_owned(),
            n => format!("{n} quantities are significantly biased"),
        }
    )
}

/// Per effect the sizes that are noticed in 80 %, smallest and largest.
fn effects(twin: &Twin) -> Vec<(String, String)> {
    let mut of: BTreeMap<&str, Vec<&Power>> = BTreeMap::new();
    for power in &twin.powers {
        of.entry(&power.effect).or_default().push(power);
    }
    let more = of.len().saturating_sub(EFFECTS);
    let mut said: Vec<(String, String)> = of
        .into_iter()
        .take(EFFECTS)
        .map(|(effect, powers)| (effect.replace('_', " "), sizes(&powers)))
        .collect();
    if more > 0
        && let Some(last) = said.last_mut()
    {
        last.1 += &format!("; {more} effects more in twin.html");
    }
    said
}

fn sizes(powers: &[&Power]) -> String {
    let mut sized: Vec<(&Power, f64)> = powers
        .iter()
        .filter_map(|p| Some((*p, p.size()?)))
        .collect();
    sized.sort_by(|a, b| a.1.total_cmp(&b.1));
    let one = |(power, size): &(&Power, f64)| {
        format!(
            "{} ({})",
            words::size(Some(*size), power.unit),
            words::of_power(power)
        )
    };
    match (sized.first(), sized.last()) {
        (Some(least), Some(most)) if sized.len() > 1 => {
            format!("noticed in 80 %: {} to {}", one(least), one(most))
        }
        (Some(only), _) => format!("noticed in 80 %: {}", one(only)),
        _ => "no size is noticed".to_owned(),
    }
}

/// What the trials with effects say.
pub(crate) fn checked(twin: &Twin) -> Option<String> {
    let sum = |of: &dyn Fn(&Power) -> u32| twin.powers.iter().map(of).sum::<u32>();
    let (tried, named, noticed) = (sum(&|p| p.tried), sum(&|p| p.named), sum(&|p| p.noticed));
    (tried > 0).then(|| {
        let by = match twin.size_factor {
            Some([factor, low, high]) => format!(
                "; the sizes are those of the tests times {factor:.2} ({low:.2} to {high:.2})"
            ),
            None => "; too few to correct the sizes".to_owned(),
        };
        format!("of {tried} trials with an effect of about that size, {noticed} noticed something and {named} named it{by}")
    })
}

/// The curve in a line.
pub(crate) fn postures(twin: &Twin) -> Option<String> {
    let curve = twin.curve.as_ref()?;
    let length = |m: Option<f64>| number::sigma(m, Unit::Meter);
    let at = |n: usize| {
        let point = curve.points.iter().find(|p| p.postures == n);
        point.and_then(|p| p.sigma_m)
    };
    let n = curve.postures;
    let mut said = format!(
        "σ of {}: {} with the {n} of the session, {} with four times as many",
        curve.body,
        length(at(n)),
        length(at(4 * n))
    );
    if let Some(asked) = curve.asked_m {
        said += &match curve.needed {
            Some(needed) => format!("; {} needs {needed} like them", length(Some(asked))),
            None => format!(
                "; {} is not reached with sixteen times as many",
                length(Some(asked))
            ),
        };
    }
    Some(said)
}

/// One line: for `--quiet`.
#[must_use]
pub fn line(twin: &Twin) -> String {
    let like = match twin.resemblance.as_ref().map(|r| (r.p_value, r.differs)) {
        None => "of a session not recorded yet",
        Some((None, _)) => "resemblance not tested",
        Some((Some(_), true)) => "does not resemble the recording",
        Some((Some(_), false)) => "resembles the recording",
    };
    let of = observed(twin);
    let kept = of.iter().filter(|p| p.is_kept()).count();
    format!(
        "{}: {like}; σ within 15 % in {kept} of {}\n",
        twin.robot,
        of.len()
    )
}
