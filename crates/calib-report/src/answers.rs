//! The twelve questions that the first screen answers: words around numbers that the report holds.

use crate::{Clock, HeldOut, Meaning, Noise, Report, Transform, Unit, Verdict, number};

/// A question of the reader and its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// Stable id of the heading, `trust`.
    pub id: &'static str,
    /// The heading.
    pub question: &'static str,
    /// The same in a word or two, for a list of links.
    pub short: &'static str,
    /// One statement a line, the decisive first; plain text, commands between backticks.
    pub lines: Vec<String>,
}

/// How many items of a list stand in an answer; the rest is counted and stands further down.
const SHOWN: usize = 3;

/// Joints of the worst pose in an answer: an arm and a torso.
const JOINTS: usize = 14;

/// The twelve answers, in the order of the first screen.
#[must_use]
pub fn answers(report: &Report) -> Vec<Answer> {
    answers_in(report, "below")
}

/// The same for a place where what is left out stands elsewhere: "… and 3 more {rest}."
pub(crate) fn answers_in(report: &Report, rest: &str) -> Vec<Answer> {
    let short = |items: &[String]| short(items, rest);
    let sentences =
        |items: &[String]| short(&items.iter().map(|i| sentence(i)).collect::<Vec<_>>());
    let answer = |id, question, lines| Answer {
        id,
        question,
        short: short_name(id),
        lines,
    };
    vec![
        answer("trust", "May I trust it?", trust(report, rest)),
        answer(
            "scope",
            "For what?",
            or(
                sentences(&report.scope),
                "The profile states no scope: only for poses like those that were recorded.",
            ),
        ),
        answer(
            "expected-error",
            "What error on a new pose?",
            expected_error(report),
        ),
        answer(
            "worst-pose",
            "Which pose is worst?",
            worst_pose(report, rest),
        ),
        answer("not-known", "What is not known?", not_known(report, rest)),
        answer(
            "next",
            "What do I do next?",
            or(sentences(&report.next_steps), "Nothing is open."),
        ),
        answer("changed", "Which file changed?", changed(report)),
        answer(
            "thrown-out",
            "What was thrown out, and why?",
            thrown_out(report, rest),
        ),
        answer("noise", "How noisy was the tracker?", noise(report, rest)),
        answer("clocks", "Did the clocks agree?", clocks(report, rest)),
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

fn short_name(id: &str) -> &'static str {
    match id {
        "trust" => "Trust",
        "scope" => "Scope",
        "expected-error" => "Error",
        "worst-pose" => "Worst pose",
        "not-known" => "Not known",
        "next" => "Next",
        "changed" => "Files",
        "thrown-out" => "Thrown out",
        "noise" => "Noise",
        "clocks" => "Clocks",
        "undo" => "Undo",
        _ => "Reproduce",
    }
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

fn short(items: &[String], rest: &str) -> Vec<String> {
    let mut lines: Vec<String> = items.iter().take(SHOWN).cloned().collect();
    if items.len() > SHOWN {
        lines.push(format!("… and {} more {rest}.", items.len() - SHOWN));
    }
    lines
}

/// A capital letter in front where a word of prose begins, a full stop at the end.
pub(crate) fn sentence(text: &str) -> String {
    let text = text.trim();
    let first_word = text.split(' ').next().unwrap_or("");
    let prose = !first_word.is_empty()
        && first_word
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b == b'-' || b == b',');
    if prose {
        full_stop(&(text[..1].to_ascii_uppercase() + &text[1..]))
    } else {
        full_stop(text)
    }
}

/// A full stop at the end, where no other sign is.
pub(crate) fn full_stop(text: &str) -> String {
    let text = text.trim();
    if text.ends_with(['.', '!', '?', '…']) {
        text.to_owned()
    } else {
        format!("{text}.")
    }
}

fn trust(report: &Report, rest: &str) -> Vec<String> {
    let verdict = match report.verdict {
        Verdict::Accepted => "Yes: accepted. Every limit was evaluated and met.",
        Verdict::Rejected => "No: rejected.",
        Verdict::NotEvaluated => "Not shown: not evaluated. That is not a pass.",
    };
    std::iter::once(verdict.to_owned())
        .chain(short(
            &report
                .reasons
                .iter()
                .map(|r| sentence(r))
                .collect::<Vec<_>>(),
            rest,
        ))
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
    let over = held_out_of(held_out);
    match (&held_out.expected, &held_out.calibrated) {
        (Some(expected), _) => lines.push(format!(
            "{} rms ({} interval {} to {}): {over}.",
            length(expected.rms_m),
            number::percent(expected.confidence),
            length(expected.low_m),
            length(expected.high_m),
        )),
        (None, Some(calibrated)) => lines.push(format!(
            "{} rms: {over}; too few for an interval.",
            length(calibrated.rms_m),
        )),
        (None, None) => lines.push("Not known: no held-out pose could be predicted.".to_owned()),
    }
    if let Some(angle) = held_out.orientation.and_then(|o| o.calibrated) {
        lines.push(format!(
            "{} rms in orientation.",
            number::plain(angle.rms_rad, Unit::Radian)
        ));
    }
    if let Some(registration) = &held_out.registration_only {
        lines.push(format!(
            "Without calibration, registered only: {} rms.",
            length(registration.rms_m)
        ));
    }
    lines
}

/// "position of the tracked bodies, 298 errors in 150 held-out postures"
pub(crate) fn held_out_of(held_out: &HeldOut) -> String {
    let plural = |n: usize, one: &str| {
        let s = if n == 1 { "" } else { "s" };
        format!("{n} {one}{s}")
    };
    let quantity = if held_out.quantity.is_empty() {
        String::new()
    } else {
        format!("{}, ", held_out.quantity)
    };
    let n = if held_out.postures > 0 && held_out.postures != held_out.n {
        format!(
            "{} in {}",
            plural(held_out.n, "error"),
            plural(held_out.postures, "held-out posture")
        )
    } else {
        plural(held_out.n, "held-out posture")
    };
    quantity + &n
}

fn worst_pose(report: &Report, rest: &str) -> Vec<String> {
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
        .take(JOINTS)
        .map(|joint| format!("{} {}", joint.joint, number::plain(joint.value, joint.unit)))
        .collect();
    let error = number::plain_or_unknown(worst.calibrated_m, Unit::Metre);
    let group = if worst.group.is_empty() {
        String::new()
    } else {
        format!(" ({})", worst.group)
    };
    let angle = worst.calibrated_rad.map_or_else(String::new, |angle| {
        format!(" and {}", number::plain(angle, Unit::Radian))
    });
    let mut lines = vec![format!("{}{group}: {error}{angle}.", worst.label())];
    if !joints.is_empty() {
        let more = match worst.joints.len() - joints.len() {
            0 => ".".to_owned(),
            n => format!(", and {n} more joints {rest}."),
        };
        lines.push(joints.join(", ") + &more);
    }
    lines
}

fn not_known(report: &Report, rest: &str) -> Vec<String> {
    if report.transforms.is_empty() && report.parameters.is_empty() {
        return vec!["Everything: nothing was solved.".to_owned()];
    }
    let of = |meaning: Meaning| {
        report
            .not_observable
            .iter()
            .filter(move |item| item.meaning == meaning)
    };
    let items: Vec<String> = of(Meaning::NotMeasured)
        .map(|item| sentence(&item.in_short()))
        .collect();
    let mut lines = short(&items, rest);
    let open: Vec<&Transform> = report.transforms.iter().filter(|t| !t.observable).collect();
    let directions: usize = open.iter().map(|t| t.unobservable.len()).sum();
    if directions > SHOWN {
        let transforms: Vec<String> = open
            .iter()
            .map(|t| format!("{} of `{}`", t.unobservable.len(), t.name))
            .collect();
        lines.push(format!(
            "Of the six directions of a transform: {}.",
            transforms.join(", ")
        ));
    } else {
        lines.extend(open.iter().flat_map(|t| {
            t.unobservable
                .iter()
                .map(|u| format!("`{}`: {}", t.name, full_stop(&u.text)))
        }));
    }
    let conventions = of(Meaning::Convention).count();
    if conventions > 0 {
        let s = if conventions == 1 { "" } else { "s" };
        lines.push(format!(
            "{conventions} combination{s} of parameters, by convention: no tracked body depends on the choice."
        ));
    }
    or(lines, "Everything that was asked for is observable.")
}

fn changed(report: &Report) -> Vec<String> {
    let mut lines: Vec<String> = report
        .outputs
        .iter()
        .filter_map(|output| {
            output.changes.as_ref().map(|of| {
                format!(
                    "`{}` is new ({}); `{of}` itself is untouched.",
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

fn thrown_out(report: &Report, rest: &str) -> Vec<String> {
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
                "{}{subject}: {} {rows}, {}.",
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
    let mut lines = or(short(&lines, rest), "Nothing.");
    match lost {
        0 => {}
        1 => lines.push("1 sample was lost by the tracker.".to_owned()),
        n => lines.push(format!("{n} samples were lost by the tracker.")),
    }
    lines
}

fn noise(report: &Report, rest: &str) -> Vec<String> {
    // The question is about the tracker; the joints come after it.
    let (joints, tracker): (Vec<&Noise>, Vec<&Noise>) = report
        .noise
        .iter()
        .partition(|noise| noise.group.starts_with("joint"));
    let line = |noise: &&Noise| match noise.sigma {
        Some(sigma) => {
            let stated = noise.stated.map_or_else(String::new, |stated| {
                format!(" (stated: {})", number::sigma(Some(stated), noise.unit))
            });
            format!(
                "{}: σ = {} per component{stated}.",
                capital(&noise.group),
                number::sigma(Some(sigma), noise.unit)
            )
        }
        None if noise.text.is_empty() => format!("{}: not known.", capital(&noise.group)),
        None => format!(
            "{}: not known, {}",
            capital(&noise.group),
            full_stop(&noise.text)
        ),
    };
    let lines: Vec<String> = tracker.iter().chain(&joints).map(line).collect();
    or(short(&lines, rest), "Not estimated.")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn clocks(report: &Report, rest: &str) -> Vec<String> {
    let line = |clock: &Clock| {
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
        // One answer for everything needs no name.
        if clock.recording == "all" {
            sentence(&format!("{}{offset}{text}", capital(verdict)))
        } else {
            sentence(&format!("{}: {verdict}{offset}{text}", clock.recording))
        }
    };
    let lines: Vec<String> = report.clocks.iter().map(line).collect();
    or(
        short(&lines, rest),
        "Not compared: no recording has two clocks.",
    )
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
