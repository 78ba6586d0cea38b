//! The twelve questions that the first screen answers: words around numbers that the report holds.

use crate::{Outcome, Report, Unit, Verdict, number};

/// A question of the reader and its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// Stable id of the heading, `trust`.
    pub id: &'static str,
    /// The heading.
    pub question: &'static str,
    /// One statement a line, the decisive first; plain text, commands between backticks.
    pub lines: Vec<String>,
}

/// How many items of a list stand in an answer; the rest is counted and stands further down.
const SHOWN: usize = 3;

/// The twelve answers, in the order of the first screen.
#[must_use]
pub fn answers(report: &Report) -> Vec<Answer> {
    let answer = |id, question, lines| Answer {
        id,
        question,
        lines,
    };
    vec![
        answer("trust", "May I trust it?", trust(report)),
        answer(
            "scope",
            "For what?",
            or(
                short(&report.scope),
                "The profile states no scope: only for poses like those that were recorded.",
            ),
        ),
        answer(
            "expected-error",
            "What error on a new pose?",
            expected_error(report),
        ),
        answer("worst-pose", "Which pose is worst?", worst_pose(report)),
        answer("not-known", "What is not known?", not_known(report)),
        answer(
            "next",
            "What do I do next?",
            or(short(&report.next_steps), "Nothing is open."),
        ),
        answer("changed", "Which file changed?", changed(report)),
        answer(
            "thrown-out",
            "What was thrown out, and why?",
            thrown_out(report),
        ),
        answer("noise", "How noisy was the tracker?", noise(report)),
        answer("clocks", "Did the clocks agree?", clocks(report)),
        answer(
            "undo",
            "How do I undo it?",
            or(
                commands(&report.undo),
                "Nothing to undo: no file of yours was changed.",
            ),
        ),
        answer("reproduce", "How do I reproduce it?", reproduce(report)),
    ]
}

fn or(lines: Vec<String>, otherwise: &str) -> Vec<String> {
    if lines.is_empty() {
        vec![otherwise.to_owned()]
    } else {
        lines
    }
}

/// Commands stand between backticks.
fn commands(commands: &[String]) -> Vec<String> {
    commands
        .iter()
        .map(|command| format!("`{command}`"))
        .collect()
}

fn short(items: &[String]) -> Vec<String> {
    let mut lines: Vec<String> = items.iter().take(SHOWN).cloned().collect();
    if items.len() > SHOWN {
        lines.push(format!("… and {} more below.", items.len() - SHOWN));
    }
    lines
}

fn trust(report: &Report) -> Vec<String> {
    let sentence = match report.verdict {
        Verdict::Accepted => "Yes: accepted. Every limit was evaluated and met.",
        Verdict::Rejected => "No: rejected.",
        Verdict::NotEvaluated => "Not shown: not evaluated. That is not a pass.",
    };
    std::iter::once(sentence.to_owned())
        .chain(short(&report.reasons))
        .collect()
}

fn expected_error(report: &Report) -> Vec<String> {
    let Some(held_out) = &report.verification.held_out else {
        let reason = &report.verification.reason;
        return vec![if reason.is_empty() {
            "Not known: no pose was held out.".to_owned()
        } else {
            format!("Not known: {reason}")
        }];
    };
    let mut lines = Vec::new();
    let length = |m| number::plain(m, Unit::Metre);
    match (&held_out.expected, &held_out.calibrated) {
        (Some(expected), _) => lines.push(format!(
            "{} rms ({} interval {} to {}), {}.",
            length(expected.rms_m),
            number::percent(expected.confidence),
            length(expected.low_m),
            length(expected.high_m),
            held_out_of(&held_out.quantity, held_out.n),
        )),
        (None, Some(calibrated)) => lines.push(format!(
            "{} rms, {}; too few poses for an interval.",
            length(calibrated.rms_m),
            held_out_of(&held_out.quantity, held_out.n)
        )),
        (None, None) => lines.push("Not known: no held-out pose could be predicted.".to_owned()),
    }
    if let Some(registration) = &held_out.registration_only {
        lines.push(format!(
            "Without calibration, registered only: {} rms.",
            length(registration.rms_m)
        ));
    }
    lines
}

fn held_out_of(quantity: &str, n: usize) -> String {
    let poses = if n == 1 { "pose" } else { "poses" };
    if quantity.is_empty() {
        format!("over {n} held-out {poses}")
    } else {
        format!("{quantity} over {n} held-out {poses}")
    }
}

fn worst_pose(report: &Report) -> Vec<String> {
    let worst = report
        .verification
        .held_out
        .as_ref()
        .and_then(|held_out| held_out.worst.as_ref());
    let Some(worst) = worst else {
        return vec!["Not known: no pose was held out.".to_owned()];
    };
    let joints: Vec<String> = worst
        .joints
        .iter()
        .map(|joint| format!("{} {}", joint.joint, number::plain(joint.value, joint.unit)))
        .collect();
    let error = number::plain_or_unknown(worst.calibrated_m, Unit::Metre);
    let group = if worst.group.is_empty() {
        String::new()
    } else {
        format!(" ({})", worst.group)
    };
    let mut lines = vec![format!("{}{group}: {error}.", worst.pose)];
    if !joints.is_empty() {
        lines.push(joints.join(", "));
    }
    lines
}

fn not_known(report: &Report) -> Vec<String> {
    if report.transforms.is_empty() && report.parameters.is_empty() {
        return vec!["Everything: nothing was solved.".to_owned()];
    }
    let of_transforms = report.transforms.iter().flat_map(|transform| {
        transform
            .unobservable
            .iter()
            .map(move |u| format!("{}: {}", transform.name, u.text))
    });
    let of_parameters = report
        .not_observable
        .iter()
        .map(|item| format!("{}: {}", item.subject, item.text));
    or(
        short(&of_transforms.chain(of_parameters).collect::<Vec<_>>()),
        "Everything that was asked for is observable.",
    )
}

fn changed(report: &Report) -> Vec<String> {
    let mut lines: Vec<String> = report
        .outputs
        .iter()
        .filter_map(|output| {
            output.changes.as_ref().map(|of| {
                format!(
                    "{} ({}); {of} itself is untouched.",
                    output.path, output.what
                )
            })
        })
        .collect();
    if lines.is_empty() {
        let written: Vec<&str> = report
            .outputs
            .iter()
            .map(|output| output.path.as_str())
            .collect();
        lines.push(if written.is_empty() {
            "None.".to_owned()
        } else {
            format!("None of yours. Written: {}.", written.join(", "))
        });
    }
    lines
}

fn thrown_out(report: &Report) -> Vec<String> {
    let lines: Vec<String> = report
        .rejected
        .iter()
        .map(|rejected| {
            let subject = if rejected.subject.is_empty() {
                String::new()
            } else {
                format!(" {}", rejected.subject)
            };
            let rows = if rejected.rows.len() == 1 {
                "row"
            } else {
                "rows"
            };
            format!(
                "{}{subject}: {} {rows}, {}",
                rejected.recording,
                rejected.rows.len(),
                rejected.reason
            )
        })
        .collect();
    let lost: usize = report
        .recordings
        .iter()
        .flat_map(|recording| &recording.lost)
        .map(|lost| lost.lost)
        .sum();
    let mut lines = or(short(&lines), "Nothing.");
    if lost > 0 {
        lines.push(format!("{lost} samples were lost by the tracker."));
    }
    lines
}

fn noise(report: &Report) -> Vec<String> {
    let lines: Vec<String> = report
        .noise
        .iter()
        .map(|noise| match noise.sigma {
            Some(sigma) => format!(
                "{}: σ = {} per component.",
                noise.group,
                number::plain(sigma, noise.unit)
            ),
            None => format!(
                "{}: not known{}",
                noise.group,
                if noise.text.is_empty() {
                    ".".to_owned()
                } else {
                    format!(", {}", noise.text)
                }
            ),
        })
        .collect();
    or(short(&lines), "Not estimated.")
}

fn clocks(report: &Report) -> Vec<String> {
    let lines: Vec<String> = report
        .clocks
        .iter()
        .map(|clock| {
            let verdict = match clock.agrees {
                Some(true) => "yes",
                Some(false) => "no",
                None => "not known",
            };
            let offset = clock.offset_s.map_or_else(String::new, |offset| {
                format!(
                    ", {} against {} {}",
                    clock.clock,
                    clock.against,
                    number::change(offset, clock.sigma_s, Unit::Second)
                )
            });
            let text = if clock.text.is_empty() {
                String::new()
            } else {
                format!(": {}", clock.text)
            };
            format!("{}: {verdict}{offset}{text}", clock.recording)
        })
        .collect();
    or(short(&lines), "Not compared: no recording has two clocks.")
}

fn reproduce(report: &Report) -> Vec<String> {
    let mut lines = or(commands(&report.reproduce), "Run the same profile again.");
    let inputs = if report.inputs.len() == 1 {
        "1 input".to_owned()
    } else {
        format!("{} inputs", report.inputs.len())
    };
    lines.push(format!(
        "calib {}, seed {}, {inputs} by SHA-256 below.",
        report.version, report.seed
    ));
    lines
}

/// Sentence of a limit: what, found, allowed.
pub(crate) fn limit_sentence(limit: &crate::Limit) -> String {
    let allowed = number::plain(limit.limit, limit.unit);
    match (limit.outcome, limit.value) {
        (Outcome::NotEvaluated, _) => format!(
            "{} ≤ {allowed}: not evaluated, {}",
            limit.quantity, limit.reason
        ),
        (outcome, value) => format!(
            "{} ≤ {allowed}: {} ({})",
            limit.quantity,
            outcome.word(),
            number::plain_or_unknown(value, limit.unit)
        ),
    }
}
