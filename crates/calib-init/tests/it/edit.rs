//! A profile that is edited: what is new stands in it, and everything else as it was.

use std::collections::BTreeMap;

use calib_init::edit::{Edited, edited};
use calib_init::{About, Fact, File, InitError, Known, Place, Proposal, Request, propose};
use calib_recording::Poses;

use crate::lab::{Design, KINDS, Kind, On, arm, file, recordings, request, text, with_names};

/// A profile of the arm with one body and one recording, in several styles.
fn profiles(body: &str) -> Vec<String> {
    let head = "# Ours.\ncalib: 1\nrobot: {name: lab, urdf: arm.urdf} # the tall one\ntracker: {frame: lab}\n\n";
    let tail = "\n# Agreed with the customer.\nsolve:\n  limits: {held_out_rms_mm: 1} # mm\n";
    let mut all: Vec<String> = [
        format!("bodies:\n  # on the flange\n  hand: {body}\n\nrecordings:\n  old: {{file: old.csv, use: static}} # May\n  # not before noon\n"),
        format!("bodies: {{hand: {body}}}\nrecordings: {{old: {{file: old.csv, use: static}}}}\n"),
        format!("recordings:\n      old:\n          file: old.csv\n\n          # all of it\n          use: static\nbodies: {{\n  hand: {body} # }}\n}}\n"),
    ]
    .map(|middle| format!("{head}{middle}{tail}"))
    .to_vec();
    all.push(all[0].replace('\n', "\r\n"));
    all.push(format!(
        "{head}{tail}bodies:\n  hand: {body}\nrecordings: {{}}"
    ));
    all
}

fn body(kind: Kind, link: &str) -> String {
    match kind {
        Kind::Pose => format!("{{link: {link}, pose: true}}"),
        Kind::Markers(count) => {
            let names: Vec<String> = (1..=count).map(|i| format!("hand_{i}")).collect();
            format!("{{link: {link}, markers: [{}]}}", names.join(", "))
        }
    }
}

/// Files exist, those of `absent` do not.
fn known(profile: &str, absent: &[&str]) -> Known {
    let path = |path: &str| (path.to_owned(), !absent.contains(&path));
    Known::of(&arm(), "lab.yaml", profile, path).unwrap_or_else(|e| panic!("{e}\n{profile}"))
}

fn proposed(known: &Known, files: &[File]) -> Proposal {
    let request = Request {
        known: Some(known.clone()),
        ..request()
    };
    propose(&arm(), &request, files).unwrap_or_else(|e| panic!("{e}"))
}

fn edit(known: &Known, files: &[File]) -> (Proposal, Edited) {
    let proposal = proposed(known, files);
    let done = edited(&arm(), &proposal, known).unwrap_or_else(|e| panic!("{e}"));
    (proposal, done)
}

/// Lines of the old text that are not in the new one in their order, the last bytes of a line apart from its end.
fn lost<'t>(old: &'t str, new: &str) -> Vec<&'t str> {
    let mut rest = new.lines();
    let mut lost = Vec::new();
    for line in old.lines() {
        let mut ahead = rest.clone();
        if ahead.any(|other| other == line) {
            rest = ahead;
        } else {
            lost.push(line);
        }
    }
    lost
}

fn new_files(bodies: &[On], seed: u64) -> Vec<File> {
    let made = recordings(bodies, Design::Random, seed);
    vec![
        file("june", text(&made["poses"])),
        file("july", text(&made["more"])),
    ]
}

fn fact<'p>(
    proposal: &'p Proposal,
    place: &Place,
    which: impl Fn(&About) -> bool,
) -> Option<&'p Fact> {
    let mut facts = proposal.facts.iter();
    facts.find(|fact| fact.place == *place && which(&fact.about))
}

#[test]
fn recordings_are_added_in_every_style_and_nothing_else_changes() {
    for (k, kind) in KINDS.into_iter().enumerate() {
        let files = new_files(&[("hand", "flange", kind)], k as u64 + 1);
        for (style, profile) in profiles(&body(kind, "flange")).iter().enumerate() {
            let known = known(profile, &[]);
            let (proposal, done) = edit(&known, &files);
            let what = format!("{kind:?}, style {style}\n{}", done.text);
            assert_eq!(done.recordings, ["june", "july"], "{what}");
            assert!(
                done.bodies.is_empty() && done.completed.is_empty(),
                "{what}"
            );
            let is_flow = profile.contains("recordings: {");
            let mut lost = lost(profile, &done.text);
            // A mapping in flow style is one line, which became longer.
            lost.retain(|line| !(is_flow && line.starts_with("recordings: {")));
            assert!(lost.is_empty(), "{lost:?}: {what}");
            let comments = |text: &str| text.matches('#').count();
            assert!(comments(&done.text) > comments(profile), "{what}");
            assert_eq!(done.text.contains("\r\n"), profile.contains("\r\n"));
            assert_eq!(
                done.text.matches("\r\n").count(),
                if style == 3 {
                    done.text.matches('\n').count()
                } else {
                    0
                }
            );
            let on = fact(&proposal, &Place::Body("hand".to_owned()), |a| {
                matches!(a, About::LinkOfProfile { .. })
            });
            assert!(on.is_some_and(|fact| !fact.check), "{:?}", proposal.facts);
            // A second time nothing is new.
            let again = self::known(&done.text, &[]);
            let (_, same) = edit(&again, &files);
            assert!(same.is_same() && same.text == done.text, "{what}");
        }
    }
}

#[test]
fn bodies_that_the_profile_lacks_are_added_on_their_links() {
    for kind in KINDS {
        let bodies: [On; 2] = [
            ("hand", "flange", Kind::Markers(4)),
            ("elbow", "link_3", kind),
        ];
        let profile = &profiles(&body(Kind::Markers(4), "flange"))[0];
        let known = known(profile, &[]);
        let (proposal, done) = edit(&known, &new_files(&bodies, 3));
        let [name] = done.bodies.as_slice() else {
            panic!("{kind:?}: {:?}\n{}", done.bodies, done.text);
        };
        let raw = calib_profile::parse(&done.text, "lab.yaml").expect("a profile");
        assert_eq!(raw.bodies[name].link, "link_3", "{kind:?}: {}", done.text);
        assert!(lost(profile, &done.text).is_empty(), "{}", done.text);
        assert_eq!(proposal.bodies[0].name, "hand");
    }
}

/// One joint that turns fits many links, signs and units: the profile says which are right, and nothing is corrected.
#[test]
fn sweeps_of_one_joint_alone_change_nothing_but_the_list() {
    for (k, kind) in KINDS.into_iter().enumerate() {
        let made = recordings(&[("hand", "link_6", kind)], Design::Sweeps, 20 + k as u64);
        let known = known(&profiles(&body(kind, "link_6"))[0], &[]);
        for (name, poses) in &made {
            let (proposal, done) = edit(&known, &[file(&format!("s_{name}"), text(poses))]);
            let what = format!("{kind:?} {name}: {:?}", proposal.facts);
            let wrong = |fact: &&Fact| match &fact.about {
                About::LinkOfProfile { better, .. } => better.is_some(),
                About::Corrected { .. } | About::NotCorrected { .. } | About::Disagrees { .. } => {
                    true
                }
                _ => false,
            };
            let wrong: Vec<&Fact> = proposal.facts.iter().filter(wrong).collect();
            assert!(wrong.is_empty(), "{wrong:?}: {what}");
            let raw = calib_profile::parse(&done.text, "lab.yaml").expect("a profile");
            assert!(
                raw.recordings[&format!("s_{name}")].columns.is_none(),
                "{what}"
            );
        }
    }
}

#[test]
fn a_few_rows_are_too_few_for_any_mistake() {
    let made = recordings(&[("hand", "link_6", Kind::Markers(4))], Design::Random, 31);
    let known = known(&profiles(&body(Kind::Markers(4), "link_6"))[0], &[]);
    let table = text(&made["poses"]);
    let lines: Vec<&str> = table.lines().filter(|l| !l.starts_with('#')).collect();
    for rows in 2..8 {
        let few = file("few", lines[..=rows].join("\n") + "\n");
        let (proposal, done) = edit(&known, &[few]);
        let is_mistake = |fact: &&Fact| {
            matches!(
                fact.about,
                About::Corrected { .. } | About::NotCorrected { .. }
            )
        };
        let mistakes: Vec<&Fact> = proposal.facts.iter().filter(is_mistake).collect();
        assert!(mistakes.is_empty(), "{rows}: {mistakes:?}");
        assert_eq!(done.recordings, ["few"]);
    }
}

/// A mistake of all recordings stands above the first new entry, to be checked.
#[test]
fn corrections_are_marked_in_the_file() {
    let made = recordings(&[("hand", "link_6", Kind::Markers(4))], Design::Random, 32);
    let known = known(&profiles(&body(Kind::Markers(4), "link_6"))[0], &[]);
    let turned = |poses: &Poses| {
        crate::lab::with_cells(&text(poses), |column, cell| {
            match (column, cell.parse::<f64>()) {
                ("joint_2_deg", Ok(q)) => (-q).to_string(),
                _ => cell.to_owned(),
            }
        })
    };
    let files = [
        file("june", turned(&made["poses"])),
        file("july", turned(&made["more"])),
    ];
    let (_, done) = edit(&known, &files);
    let raw = calib_profile::parse(&done.text, "lab.yaml").expect("a profile");
    for name in ["june", "july"] {
        let columns = raw.recordings[name].columns.as_ref().expect("corrected");
        assert_eq!(columns.reversed, ["joint_2"], "{}", done.text);
    }
    assert!(
        done.text
            .contains("# CHECK: Joint `joint_2` counts against the axis"),
        "{}",
        done.text
    );
}

#[test]
fn joints_without_a_column_stand_where_the_profile_holds_them() {
    let made = recordings(&[("hand", "link_6", Kind::Markers(4))], Design::Sweeps, 33);
    // Joint 1 stands at 20° in this sweep.
    let table = text(&made["turn_3"]);
    let without: String = table
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let at = table
                .lines()
                .find(|l| !l.starts_with('#'))
                .expect("a header")
                .split(',')
                .position(|c| c == "joint_1_deg")
                .expect("there");
            let kept: Vec<&str> = cells
                .iter()
                .enumerate()
                .filter(|(i, _)| *i != at)
                .map(|(_, c)| *c)
                .collect();
            kept.join(",") + "\n"
        })
        .collect();
    let profile = profiles(&body(Kind::Markers(4), "link_6"))[0]
        .replace("use: static}", "use: static, hold: {joint_1_deg: 20.125}}");
    let (proposal, done) = edit(&known(&profile, &[]), &[file("turn", without)]);
    assert!(
        done.text.contains("hold: {joint_1_deg: 20.125}\n"),
        "{}",
        done.text
    );
    let held = proposal
        .facts
        .iter()
        .find(|f| matches!(f.about, About::HeldAsElsewhere { .. }));
    assert!(held.is_some_and(|fact| fact.check));
}

/// A simulation needs a mount for every body: a new body gets an invented one.
#[test]
fn bodies_are_added_to_profiles_that_simulate() {
    let bodies: [On; 2] = [
        ("hand", "flange", Kind::Markers(4)),
        ("elbow", "link_3", Kind::Markers(3)),
    ];
    let profile = profiles(&body(Kind::Markers(4), "flange"))[0].clone()
        + "simulate:\n  seed: 1\n  tracker_from_root: {}\n  mounts: {hand: {markers_mm: {hand_1: [0, 0, 0], hand_2: [9, 0, 0], hand_3: [0, 9, 0], hand_4: [0, 0, 9]}}}\n  recordings: {old: {random: {joint_1_deg: [0, 9]}, poses: 9}}\n";
    let (_, done) = edit(&known(&profile, &[]), &new_files(&bodies, 34));
    let raw = calib_profile::parse(&done.text, "lab.yaml").expect("a profile");
    let mounts = &raw.simulate.as_ref().expect("there").mounts;
    assert_eq!(mounts.len(), 2, "{}", done.text);
    assert!(
        done.facts
            .iter()
            .any(|fact| fact.about == About::InventedMount)
    );
}

#[test]
fn the_link_of_the_profile_stands_and_what_contradicts_it_is_said() {
    let made = recordings(&[("hand", "link_6", Kind::Markers(4))], Design::Sweeps, 4);
    let one = [file("turn", text(&made["turn_2"]))];
    let all: Vec<File> = made
        .iter()
        .map(|(name, poses)| file(name, text(poses)))
        .collect();
    let hand = Place::Body("hand".to_owned());
    let better = |proposal: &Proposal| -> Option<String> {
        let of = fact(proposal, &hand, |about| {
            matches!(about, About::LinkOfProfile { .. })
        })?;
        match &of.about {
            About::LinkOfProfile { better, .. } => better.as_ref().map(|rival| rival.link.clone()),
            _ => None,
        }
    };
    for (link, files, found) in [
        // One joint that turns does not distinguish the links after it.
        ("link_6", &one[..], None),
        ("link_6", &all[..], None),
        ("link_2", &all[..], Some("link_6")),
    ] {
        let profile = &profiles(&body(Kind::Markers(4), link))[0];
        let known = known(profile, &[]);
        let (proposal, done) = edit(&known, files);
        assert_eq!(
            better(&proposal).as_deref(),
            found,
            "{link}: {:?}",
            proposal.facts
        );
        let raw = calib_profile::parse(&done.text, "lab.yaml").expect("a profile");
        assert_eq!(raw.bodies["hand"].link, link);
        assert_eq!(done.recordings.len(), files.len());
    }
}

#[test]
fn entries_that_cannot_be_read_are_completed_and_files_that_are_not_there_replaced() {
    let made = recordings(&[("hand", "flange", Kind::Markers(3))], Design::Random, 5);
    let foreign = |poses: &Poses| {
        with_names(&text(poses), |name| {
            name.replace("joint_", "A")
                .replace("_deg", "")
                .replace("hand_", "Hand:P")
                .replace(".x_mm", " X")
                .replace(".y_mm", " Y")
                .replace(".z_mm", " Z")
        })
    };
    let bodies =
        "bodies:\n  hand: {link: flange, markers: [\"Hand:P1\", \"Hand:P2\", \"Hand:P3\"]}\n";
    let head = "calib: 1\nrobot: {name: lab, urdf: arm.urdf}\ntracker: {frame: lab}\n";
    for old in [
        "  old: {file: old.csv, use: static} # May\n",
        "  old: # May\n    file: old.csv\n    # all\n    use: static\n",
    ] {
        let profile = format!(
            "{head}{bodies}recordings:\n{old}  checks: {{file: \"checks.csv\", use: validation}}\n# end\n"
        );
        let known = known(&profile, &["checks.csv"]);
        let mut checks = file("checks", foreign(&made["more"]));
        checks.path = "day1/checks.csv".to_owned();
        let files = [file("old", foreign(&made["poses"])), checks];
        let (proposal, done) = edit(&known, &files);
        assert_eq!(done.completed, ["old", "checks"], "{}", done.text);
        assert!(done.recordings.is_empty(), "{}", done.text);
        let raw = calib_profile::parse(&done.text, "lab.yaml").expect("a profile");
        assert!(
            raw.recordings.values().all(|r| r.columns.is_some()),
            "{}",
            done.text
        );
        assert_eq!(raw.recordings["checks"].file, "day1/checks.csv");
        assert!(done.text.contains("# May") && done.text.contains("# end"));
        assert!(
            done.text
                .contains("# CHECK: The file of this recording, `checks.csv`"),
            "{}",
            done.text
        );
        let replaced = fact(&proposal, &Place::Recording("checks".to_owned()), |a| {
            matches!(a, About::Replaced { .. })
        });
        assert!(replaced.is_some());
        // Now both say how they are read: nobody reads them again.
        let again = self::known(&done.text, &[]);
        let unreadable = [file("old", "no table"), file("other", "x")];
        let (proposal, same) = edit(&again, &unreadable[..1]);
        assert!(same.is_same() && same.text == done.text);
        let listed = fact(&proposal, &Place::Recording("old".to_owned()), |a| {
            *a == About::Listed
        });
        assert!(listed.is_some());
    }
}

#[test]
fn what_the_recordings_have_more_or_less_than_the_profile_is_said() {
    let made = recordings(&[("hand", "flange", Kind::Markers(4))], Design::Random, 6);
    let files = [file("june", text(&made["poses"]))];
    let hand = Place::Body("hand".to_owned());
    // A marker more.
    let known = known(&profiles(&body(Kind::Markers(3), "flange"))[0], &[]);
    let (proposal, done) = edit(&known, &files);
    let more = fact(&proposal, &hand, |a| {
        *a == About::MoreMarkers {
            markers: vec!["hand_4".to_owned()],
        }
    });
    assert!(more.is_some_and(|fact| fact.check), "{:?}", proposal.facts);
    assert!(done.bodies.is_empty());
    // Other names of the tracker: not seen, unless the profile has them.
    let renamed = |name: &str| name.replace("hand_", "H");
    let files = [file("june", with_names(&text(&made["poses"]), renamed))];
    let profile = &profiles(&body(Kind::Markers(4), "flange"))[0];
    let (proposal, done) = edit(&self::known(profile, &[]), &files);
    let not_seen = fact(&proposal, &hand, |a| {
        matches!(a, About::NotSeen { none_is: true, .. })
    });
    assert!(
        not_seen.is_some_and(|fact| fact.check),
        "{:?}",
        proposal.facts
    );
    assert_eq!(done.bodies.len(), 1);
    let names = "names: {hand_1: H1, hand_2: H2, hand_3: H3, hand_4: H4}\n";
    let (proposal, done) = edit(&self::known(&format!("{profile}{names}"), &[]), &files);
    assert!(done.bodies.is_empty(), "{}", done.text);
    assert!(fact(&proposal, &hand, |a| matches!(a, About::NotSeen { .. })).is_none());
    // The noise that is stated, and other noise.
    for (stated, check) in [("0.2", false), ("0.9", true)] {
        let profile = profile.replace(
            "{frame: lab}",
            &format!("{{frame: lab, marker_sigma_mm: {stated}}}"),
        );
        let files = [file("june", text(&made["poses"]))];
        let (proposal, _) = edit(&self::known(&profile, &[]), &files);
        let sigma = fact(&proposal, &Place::Tracker, |a| {
            matches!(a, About::StatedSigma { .. })
        });
        assert_eq!(
            sigma.map(|fact| fact.check),
            Some(check),
            "{:?}",
            proposal.facts
        );
    }
}

#[test]
fn uses_follow_from_what_the_profile_has() {
    let made = recordings(&[("hand", "flange", Kind::Markers(4))], Design::Random, 7);
    let of = |names: [&str; 2]| -> Vec<File> {
        vec![
            file(names[0], text(&made["poses"])),
            file(names[1], text(&made["more"])),
        ]
    };
    let uses = |profile: &str, files: &[File]| -> BTreeMap<String, String> {
        let (_, done) = edit(&known(profile, &["later.csv"]), files);
        let raw = calib_profile::parse(&done.text, "lab.yaml").expect("a profile");
        let of = |(name, r): (&String, &calib_profile::raw::RawRecording)| {
            (name.clone(), format!("{:?}", r.usage))
        };
        raw.recordings.iter().map(of).collect()
    };
    let profile = &profiles(&body(Kind::Markers(4), "flange"))[1];
    let held = profile.replace(
        "recordings: {",
        "recordings: {v: {file: v.csv, use: validation}, ",
    );
    let later = profile.replace(
        "recordings: {",
        "recordings: {v: {file: later.csv, use: validation}, ",
    );
    // A check alone is one, since the profile has poses to fit.
    let checks = uses(
        profile,
        &of(["june", "july"])[..0]
            .iter()
            .chain(&[file("checks", text(&made["more"]))])
            .cloned()
            .collect::<Vec<_>>(),
    );
    assert_eq!(checks["checks"], "Validation");
    // The smallest is held out where nothing is.
    assert_eq!(uses(profile, &of(["june", "july"]))["july"], "Validation");
    assert_eq!(uses(&later, &of(["june", "july"]))["july"], "Validation");
    assert_eq!(uses(&held, &of(["june", "july"]))["july"], "Static");
}

#[test]
fn profiles_that_cannot_be_edited_are_refused() {
    let broken = "calib: 1\nrobot: {name: lab, urdf: arm.urdf}\ntracker: {frame: lab}\nbodies:\n  hand: {link: nowhere, markers: [a]}\nrecordings:\n  r: {file: a.csv, use: static}\n";
    let error =
        Known::of(&arm(), "lab.yaml", broken, |p| (p.to_owned(), true)).expect_err("no link");
    assert!(error.to_string().contains("nowhere"), "{error}");
    // What others repeat by its anchor cannot be changed for itself alone: the lines to add are said.
    let made = recordings(&[("hand", "flange", Kind::Markers(3))], Design::Random, 8);
    let profile = format!(
        "calib: 1\nrobot: {{name: lab, urdf: arm.urdf}}\ntracker: {{frame: lab}}\nbodies:\n  hand: {}\nrecordings:\n  june: &june {{file: june.csv, use: static}}\n  again: *june\n",
        body(Kind::Markers(3), "flange")
    );
    let known = known(&profile, &[]);
    let foreign = with_names(&text(&made["poses"]), |name| {
        name.replace("joint_", "A").replace("_deg", "")
    });
    let proposal = proposed(&known, &[file("june", foreign)]);
    match edited(&arm(), &proposal, &known) {
        Err(InitError::NotInserted { section, lines, .. }) => {
            // One file of two entries: the first by name is meant.
            assert!(section.starts_with("recordings."), "{section}");
            assert!(lines.iter().any(|l| l.contains("columns:")), "{lines:?}");
        }
        other => panic!("{other:?}"),
    }
}
