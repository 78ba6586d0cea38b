//! The small parts: addresses, joint datagrams, grids, lines of text.

use calib_capture::{
    Address, Lines, Screen, Survey, Terminal, WIDTH, grid, map_names, parse_joints,
};
use calib_capture::{JointListener, WatchedKind};
use std::collections::{BTreeMap, BTreeSet};

#[test]
fn addresses() {
    for (text, shown) in [
        ("dtrack:5001", "dtrack:5001"),
        ("dtrack", "dtrack:5000"),
        ("vrpn:tracker", "vrpn:tracker:3883"),
        ("vrpn:10.0.0.2:3884", "vrpn:10.0.0.2:3884"),
        ("vrpn:Head@tracker:9", "vrpn:Head@tracker:9"),
        ("vrpn:[::1]:9", "vrpn:::1:9"),
        ("vrpn:::1", "vrpn:::1:3883"),
    ] {
        let address: Address = text.parse().expect(text);
        assert_eq!(address.to_string(), shown, "{text}");
    }
    for text in [
        "",
        "vicon:x",
        "dtrack:x",
        "dtrack:70000",
        "vrpn:",
        "vrpn:@h",
        "vrpn:h:x",
    ] {
        let error = text.parse::<Address>().expect_err(text).to_string();
        assert!(error.contains("expected `dtrack:PORT`"), "{error}");
    }
}

#[test]
fn joints_of_a_datagram() {
    let joints = parse_joints(b"waist_deg=90 lift_mm=120,\nelbow_rad=-1e-1\0").expect("joints");
    let expected = [
        ("elbow", -0.1),
        ("lift", 0.12),
        ("waist", std::f64::consts::FRAC_PI_2),
    ];
    assert_eq!(joints, expected.map(|(n, q)| (n.to_string(), q)).into());
    for bad in [
        "",
        "waist=3",
        "waist_deg",
        "waist_deg=x",
        "waist_deg=inf",
        "_deg=1",
        "waist_kg=1",
    ] {
        assert!(parse_joints(bad.as_bytes()).is_err(), "{bad}");
    }
    assert!(parse_joints(b"\xff").is_err());
}

#[test]
fn old_joint_values_say_nothing() {
    let mut listener = JointListener::open(0).expect("a free port");
    listener.datagram(b"waist_deg=10", 100.0);
    listener.datagram(b"hello", 100.1);
    assert_eq!(listener.value("waist", 100.4), Some(10f64.to_radians()));
    assert_eq!(listener.value("waist", 100.6), None);
    assert_eq!(listener.value("elbow", 100.0), None);
    assert_eq!((listener.taken, listener.foreign), (1, 1));
}

#[test]
fn a_grid_goes_back_and_forth() {
    let targets = |ranges: &[(f64, f64)], poses| -> Vec<Vec<f64>> {
        grid(ranges, poses).into_iter().map(|s| s.targets).collect()
    };
    let expected = [
        [0.0, 0.0],
        [0.0, 5.0],
        [0.0, 10.0],
        [1.0, 10.0],
        [1.0, 5.0],
        [1.0, 0.0],
    ];
    let found = targets(&[(0.0, 2.0), (0.0, 10.0)], 3);
    assert_eq!(found[..6], expected.map(|t| t.to_vec()));
    assert_eq!(found.len(), 9);
    // Each neighbor differs in one joint by one step.
    for pair in found.windows(2) {
        let far: f64 = pair[0]
            .iter()
            .zip(&pair[1])
            .map(|(a, b)| (a - b).abs())
            .sum();
        assert!(far == 1.0 || far == 5.0, "{pair:?}");
    }
    assert_eq!(targets(&[(-1.0, 3.0)], 1), [vec![1.0]]);
    assert!(targets(&[], 6).is_empty());
}

#[test]
fn names_are_mapped_or_asked_for() {
    let wanted = [
        ("hand".to_string(), WatchedKind::Body),
        ("head".to_string(), WatchedKind::Body),
    ];
    let names: BTreeSet<String> = ["body_0", "body_1", "head"].map(str::to_string).into();
    let seen = Survey {
        tracker: names.clone(),
        bodies: names,
        ..Survey::default()
    };
    let map = |pairs: &[(&str, &str)]| -> BTreeMap<String, String> {
        pairs
            .iter()
            .map(|(a, b)| (a.to_string(), b.to_string()))
            .collect()
    };
    let watched = map_names(&wanted, &map(&[("hand", "body_1")]), &seen).expect("mapped");
    let names: Vec<_> = watched
        .iter()
        .map(|w| (w.name.as_str(), w.from.as_str()))
        .collect();
    assert_eq!(names, [("hand", "body_1"), ("head", "head")]);
    let none = map_names(&wanted[..1], &map(&[]), &seen).expect_err("unmapped");
    assert_eq!(
        none,
        "the tracker sends body_0, body_1, head, the profile has hand. Map the names: --map hand=body_0\n  help: the names are case-sensitive"
    );
    // What has no name to map is not asked to be mapped.
    let marker = [("m1".to_string(), WatchedKind::Marker)];
    for (heard, wanted, said) in [
        (&seen, &marker[..], "`pose: true` in place of `markers`"),
        (
            &Survey::default(),
            &wanted[..1],
            "sees no body and no marker",
        ),
        (
            &Survey {
                unnamed: 3,
                ..Survey::default()
            },
            &wanted[..1],
            "3 single markers without names",
        ),
        (
            &Survey {
                tracker: ["m1".to_string()].into(),
                ..Survey::default()
            },
            &wanted[..1],
            "`markers: [NAMES]` in place of `pose: true`",
        ),
    ] {
        let said_so = map_names(wanted, &map(&[]), heard).expect_err("unmapped");
        assert!(
            said_so.contains(said) && !said_so.contains("--map"),
            "{said_so}"
        );
    }
    let stranger = map_names(&wanted, &map(&[("arm", "body_0")]), &seen).expect_err("stranger");
    assert!(stranger.contains("`arm`"), "{stranger}");
    let twice = map_names(&wanted, &map(&[("hand", "head")]), &seen).expect_err("twice");
    assert!(twice.contains("`head` is mapped to"), "{twice}");
}

#[test]
fn no_line_is_wider_than_a_terminal() {
    let long = format!("  pose: {}", "word ".repeat(60));
    let mut plain = Vec::new();
    Lines::new(&mut plain).line(&long);
    let plain = String::from_utf8(plain).expect("text");
    assert!(plain.lines().count() > 3);
    assert!(plain.lines().all(|line| line.chars().count() <= WIDTH));
    assert!(
        plain
            .lines()
            .skip(1)
            .all(|line| line.starts_with("    word"))
    );

    let mut bytes = Vec::new();
    let mut terminal = Terminal::new(&mut bytes);
    terminal.status(&"·".repeat(200), 0.0);
    terminal.status("too soon", 0.05);
    terminal.line("done");
    let text = String::from_utf8(bytes).expect("text");
    assert_eq!(text.matches('·').count(), WIDTH - 1);
    assert!(
        !text.contains("too soon") && text.ends_with("\r\u{1b}[Kdone\n"),
        "{text:?}"
    );
}

#[test]
fn a_file_gets_the_status_seldom() {
    let mut plain = Vec::new();
    let mut lines = Lines::new(&mut plain);
    for i in 0..200 {
        lines.status(&format!("status {i}"), f64::from(i) * 0.1);
    }
    let text = String::from_utf8(plain).expect("text");
    assert_eq!(text, "status 50\nstatus 100\nstatus 150\n");
}
