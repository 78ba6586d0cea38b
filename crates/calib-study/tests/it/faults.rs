//! The matrix of faults: a small part with fixed seeds, and what must hold of any part of it.

use calib_report::verdict::ReasonId;
use calib_study::faults::{
    Body, CaseResult, Class, Design, Errors, Fault, FaultOptions, FaultResult, Outcome, csv,
    markdown, run_faults,
};

fn part(only: &[Fault], cases: u64) -> FaultResult {
    let options = FaultOptions {
        cases,
        only: only.to_vec(),
        ..FaultOptions::default()
    };
    run_faults(&options, &|_, _| {}).expect("a study")
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads_nor_on_an_interruption() {
    // Of few cells.
    let only = vec![Fault::Sign];
    let folder = tempfile::tempdir().expect("a folder");
    let options = |threads, out: Option<&std::path::Path>| FaultOptions {
        cases: 1,
        only: only.clone(),
        threads: Some(threads),
        out: out.map(Into::into),
        resume: true,
        ..FaultOptions::default()
    };
    let one = run_faults(&options(1, None), &|_, _| {}).expect("a study");
    let two = run_faults(&options(2, Some(folder.path())), &|_, _| {}).expect("a study");
    assert_eq!(one, two);
    let state = folder.path().join("faults.state.jsonl");
    let whole = std::fs::read_to_string(&state).expect("a state file");
    // Three finished cases and a line that was cut off.
    let mut cut: String = whole.lines().take(4).map(|l| format!("{l}\n")).collect();
    cut += "{\"cell\":";
    std::fs::write(&state, cut).expect("writable");
    let resumed = run_faults(&options(2, Some(folder.path())), &|_, _| {}).expect("a study");
    assert_eq!(one, resumed);
    assert_eq!(
        std::fs::read_to_string(&state).expect("a state file"),
        whole
    );
}

#[test]
fn good_data_are_accepted_and_never_wrong_without_a_warning() {
    if !skipped_tests::thorough() {
        return;
    }
    let mut result = part(&[Fault::None], 1);
    // Six poses do not determine a robot: what is refused there is refused with reason.
    result.results.retain(|r| r.cell.design != Design::Six);
    let of = |what: &dyn Fn(&CaseResult) -> bool| result.results.iter().filter(|r| what(r)).count();
    assert_eq!(of(&|r| r.cell.fault.class() == Class::Clean), 100);
    assert_eq!(of(&CaseResult::confidently_wrong), 0);
    // Ten poses of a 6-DoF body: the uncertainty of the fit is too small in 1 of 40 (book, limits of the study).
    assert!(of(&|r| r.outcome == Outcome::Wrong) <= 1);
    assert!(of(&CaseResult::false_refusal) <= 4);
    assert!(of(&CaseResult::false_warning) <= 4);
}

#[test]
fn a_fault_is_never_accepted_as_a_wrong_result() {
    // One case of every cell of the discrete faults that recordings of every design can have.
    let result = part(
        &[
            Fault::Sign,
            Fault::Exchange,
            Fault::JointUnit,
            Fault::WrongLink,
        ],
        1,
    );
    let wrong: Vec<_> = result
        .results
        .iter()
        .filter(|r| r.outcome == Outcome::Wrong)
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(result.results.len() >= 45, "{}", result.results.len());
}

/// 40 mm and 5°, in every design with two recordings and with every body: one cause, named, or named beside what is not distinguishable.
#[test]
fn a_tracker_or_a_body_that_moved_before_the_last_recording_is_named() {
    if !skipped_tests::thorough() {
        return;
    }
    let result = part(&[Fault::TrackerMoved, Fault::Remounted], 1);
    let unnamed: Vec<_> = result
        .results
        .iter()
        .filter(|r| r.cell.errors != Errors::Huge && r.outcome != Outcome::Named)
        .collect();
    assert!(unnamed.is_empty(), "{unnamed:#?}");
    assert!(result.results.len() >= 50, "{}", result.results.len());
}

/// Half a percent to five percent of the samples are off by 10 to 100 mm. Six poses do not determine a robot.
#[test]
fn gross_samples_are_called_by_their_name() {
    if !skipped_tests::thorough() {
        return;
    }
    let result = part(&[Fault::Outliers], 1);
    let enough = result
        .results
        .iter()
        .filter(|r| r.cell.design != Design::Six);
    let enough: Vec<&CaseResult> = enough.collect();
    let with = |id: &str| enough.iter().filter(|r| r.findings.contains(id)).count();
    assert_eq!(enough.len(), 100);
    assert!(with("unsettled-rows") <= 1, "{}", with("unsettled-rows"));
    for id in ["body-flip", "tracker-moved", "body-remounted", "clock-lag"] {
        assert_eq!(with(id), 0, "{id}");
    }
    let against = |id: ReasonId| enough.iter().filter(|r| r.reasons.contains(&id)).count();
    assert_eq!(against(ReasonId::WorseThanRegistration), 0);
    assert_eq!(against(ReasonId::OrientationOff), 0);
}

/// Where a test that knows the fault would name it, the program does, from 20 poses on.
#[test]
fn effects_and_changes_that_the_recordings_show_are_named() {
    if !skipped_tests::thorough() {
        return;
    }
    let result = part(&[Fault::Compliance, Fault::Bump], 1);
    let shown = |r: &&CaseResult| r.evidence.zip(r.needed).is_some_and(|(e, n)| e >= n);
    let many = [Design::Random, Design::Both, Design::Stream];
    let shown: Vec<&CaseResult> = result.results.iter().filter(shown).collect();
    let of_many = shown.iter().filter(|r| many.contains(&r.cell.design));
    let of_many: Vec<&&CaseResult> = of_many.collect();
    assert!(of_many.len() >= 24, "{}", of_many.len());
    let unnamed: Vec<_> = of_many.iter().filter(|r| !r.named).collect();
    assert!(unnamed.len() <= 1, "{unnamed:#?}");
    // Ten poses leave changes and effects to be taken for noise of the joints.
    let of_few = shown.iter().filter(|r| r.cell.design == Design::Few);
    let of_few: Vec<&&CaseResult> = of_few.collect();
    let named = of_few.iter().filter(|r| r.named).count();
    assert!(
        2 * named >= of_few.len() && named >= 3,
        "{named} of {}",
        of_few.len()
    );
    // Six poses show next to nothing, and never as much as forty.
    let evidence = |design: Design| -> f64 {
        let own = result.results.iter().filter(|r| r.cell.design == design);
        own.filter_map(|r| r.evidence).sum()
    };
    assert!(evidence(Design::Random) > 2.0 * evidence(Design::Six));
    let six = shown
        .iter()
        .filter(|r| r.cell.design == Design::Six)
        .count();
    assert!(six <= 4, "{six}");
}

/// 3° and 20 mm off, as the profile says: what would raise a residual of decimeters is named all the same.
#[test]
fn mistakes_in_one_recording_are_named_on_a_robot_that_is_far_off() {
    if !skipped_tests::thorough() {
        return;
    }
    let result = part(&[Fault::SignInOne, Fault::ExchangeInOne], 1);
    let far = result.results.iter();
    let far: Vec<&CaseResult> = far
        .filter(|r| r.cell.errors == Errors::Huge && r.cell.design != Design::Six)
        .filter(|r| r.moved_m.is_some_and(|moved| moved > 0.03))
        .collect();
    assert!(far.len() >= 10, "{}", far.len());
    let unnamed: Vec<_> = far.iter().filter(|r| !r.named).collect();
    assert!(unnamed.len() <= 2, "{unnamed:#?}");
}

/// Six poses of one marker, and robots that are 3° and 20 mm off: what is not named is judged by its likelihood.
#[test]
fn mistakes_of_few_poses_and_of_robots_that_are_far_off_are_named() {
    if !skipped_tests::thorough() {
        return;
    }
    let result = part(&[Fault::Exchange, Fault::WrongLink], 2);
    let seen = |r: &&CaseResult| r.moved_m.is_some_and(|moved| moved > 2e-5);
    let asked = |r: &&CaseResult| {
        let six_of_one = r.cell.design == Design::Six && r.cell.body == Body::One;
        six_of_one || r.cell.errors == Errors::Huge
    };
    let asked: Vec<&CaseResult> = result.results.iter().filter(seen).filter(asked).collect();
    let unnamed: Vec<_> = asked.iter().filter(|r| !r.named).collect();
    assert!(asked.len() >= 30, "{}", asked.len());
    assert!(10 * unnamed.len() <= asked.len(), "{unnamed:#?}");
    assert!(unnamed.iter().all(|r| r.odds.is_some()), "{unnamed:#?}");
}

#[test]
fn tables_count_every_case_once() {
    let result = part(&[Fault::HeldOutCopies], 1);
    assert_eq!(csv(&result).lines().count(), 1 + result.results.len());
    let text = markdown(&result);
    let counted = format!(
        "{} cases with a fault, 0 without; seed 1.",
        result.results.len()
    );
    assert!(text.contains(&counted), "{text}");
    let headings = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|l| l.starts_with('#'));
        lines.map(str::to_owned).collect()
    };
    let page = include_str!("../../../../book/src/studies/faults.md");
    assert_eq!(
        headings(page),
        headings(&text),
        "`just studies` regenerates the page"
    );
}

/// One error for each of ten poses is as good as any smooth effect of the reading.
#[test]
fn few_poses_of_an_eccentric_gear_are_not_called_scatter() {
    if !skipped_tests::thorough() {
        return;
    }
    let options = FaultOptions {
        cases: 3,
        seed: 137,
        only: vec![Fault::Eccentricity],
        ..FaultOptions::default()
    };
    let found = run_faults(&options, &|_, _| {}).expect("a study").results;
    let few = |r: &&CaseResult| [Design::Few, Design::Six].contains(&r.cell.design);
    for case in found.iter().filter(few) {
        let scatters = case.findings.contains("joint-scatters");
        assert!(!scatters, "{:?} {}", case.cell, case.number);
    }
    let named = found.iter().filter(|r| r.outcome == Outcome::Named);
    assert!(named.count() >= 60, "of {}", found.len());
}
