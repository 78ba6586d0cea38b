//! Files, names and streams that somebody else made: pipes, devices, full disks, closed streams, control characters, plugins of a
//! foreign profile.

use crate::scratch;

use std::process::{Command, Output, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use scratch::Scratch;

/// Runs a line of a shell, in which `calib` is the program, for at most 30 s.
fn shell(dir: &Scratch, line: &str) -> Output {
    let line = format!(
        "calib() {{ '{}' \"$@\"; }}\n{line}",
        env!("CARGO_BIN_EXE_calib")
    );
    let child = Command::new("sh")
        .args(["-c", &line])
        .current_dir(dir.path(""))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("a shell");
    let (send, ended) = mpsc::channel();
    std::thread::spawn(move || send.send(child.wait_with_output()));
    ended
        .recv_timeout(Duration::from_secs(30))
        .unwrap_or_else(|_| panic!("it hangs: {line}"))
        .expect("ended")
}

fn code(dir: &Scratch, line: &str) -> i32 {
    let output = shell(dir, line);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{line}: {said}");
    output.status.code().expect("not ended by a signal")
}

#[cfg(target_os = "linux")]
#[test]
fn lost_output_is_an_error_and_a_lost_reader_is_none() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new().brief("ripley");
    let commands = [
        "calib schema",
        "calib completions bash",
        "calib --help",
        "calib --version",
        "calib help run",
        "calib plugins",
        "calib plugins header",
        "calib check robots/ripley.yaml",
        "calib check robots/ripley.yaml --json",
        "calib diff robots/ripley/r17.urdf robots/ripley/r17.urdf",
        "calib diff robots/ripley/r17.urdf robots/ripley/r17.urdf --format unified",
        "calib fit cor --list",
        "calib convert robots/ripley/checks.csv out.csv",
        "calib simulate robots/ripley.yaml --out sim",
    ];
    for command in commands {
        let unified = command.contains("unified");
        let expected = if unified { 0 } else { 7 };
        assert_eq!(
            code(&dir, &format!("{command} >/dev/full")),
            expected,
            "{command}"
        );
        assert_eq!(
            code(&dir, &format!("{command} >/dev/full 2>/dev/full")),
            expected,
            "{command}"
        );
        // A pipe whose reader is gone.
        let quiet = shell(
            &dir,
            &format!("{{ sleep 0.2; {command}; echo $? >&2; }} | true"),
        );
        assert_eq!(
            String::from_utf8_lossy(&quiet.stderr).lines().last(),
            Some("0"),
            "{command}"
        );
    }
    for closed in ["2>/dev/full", "2>&-", ">&- 2>&-"] {
        assert_eq!(
            code(&dir, &format!("calib check nothing.yaml {closed}")),
            2,
            "{closed}"
        );
        assert_eq!(
            code(&dir, &format!("calib check --wrong {closed}")),
            2,
            "{closed}"
        );
        assert_eq!(
            code(
                &dir,
                &format!("calib convert robots/ripley/checks.csv o.csv {closed}")
            ),
            0,
            "{closed}"
        );
    }
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_and_never_waited_for() {
    let dir = Scratch::new().brief("ripley");
    let made = Command::new("mkfifo").arg(dir.path("pipe")).status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    for special in ["pipe", "/dev/zero", "/dev/null"] {
        for (command, expected) in [
            (format!("calib check {special}"), 2),
            (format!("calib run {special} --out out"), 2),
            (format!("calib convert {special} out.csv"), 3),
            (format!("calib fit cor {special}"), 3),
            (format!("calib diff {special} robots/ripley/r17.urdf"), 2),
            (format!("calib apply robots {special} --in-place"), 3),
            (
                format!("calib apply {special} robots/ripley/r17.urdf --in-place"),
                3,
            ),
            (format!("calib revert {special} --in-place"), 3),
            (format!("calib drift {special} {special}"), 3),
        ] {
            assert_eq!(code(&dir, &command), expected, "{command}");
        }
        // Named by a profile: recording, URDF, mesh.
        let path = if special == "pipe" {
            "../pipe"
        } else {
            special
        };
        let edited = |from: &str, to: &str| {
            let text = dir.read("robots/ripley.yaml");
            assert!(text.contains(from), "{from}");
            std::fs::write(dir.path("robots/x.yaml"), text.replacen(from, to, 1)).expect("a file");
            code(&dir, "calib check robots/x.yaml")
        };
        assert_eq!(edited("ripley/checks.csv", path), 3, "{special}");
        assert_eq!(edited("ripley/r17.urdf", path), 2, "{special}");
    }
    let mesh = "<visual><geometry><mesh filename=\"../pipe.stl\"/></geometry></visual>";
    let dir = dir.edit(
        "robots/ripley/r17.urdf",
        "<link name=\"gripper_tip\"/>",
        &format!("<link name=\"gripper_tip\">{mesh}</link>"),
    );
    let made = Command::new("mkfifo")
        .arg(dir.path("robots/pipe.stl"))
        .status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    assert_eq!(
        code(
            &dir,
            "calib run robots/ripley.yaml --method paper --out out"
        ),
        1
    );
    assert!(!dir.path("out/.calib").exists());
}

#[test]
fn an_error_as_json_has_id_place_and_remedy_on_standard_output() {
    let dir = Scratch::new()
        .brief("ripley")
        .file(
            "bad.yaml",
            "calib: 1\nrobot: {name: r, urdf: r.urdf}\nnothing: 1\n",
        )
        .file(
            "bad.urdf",
            "<robot name=\"r\">\n  <link name=\"a\"/>\n  <joint/>\n</robot>\n",
        )
        .file("bad.csv", "pose,a_rad\n0,1\n1,x\n")
        .file("there.csv", "mine");
    let calls: [(&[&str], i32, &str, Option<u64>); 7] = [
        (&["check", "bad.yaml"], 2, "profile", Some(3)),
        (&["check", "gone.yaml"], 2, "file-not-read", None),
        (
            &["diff", "--format", "json", "bad.urdf", "bad.urdf"],
            2,
            "urdf",
            Some(3),
        ),
        (&["convert", "bad.csv", "out.csv"], 3, "recording", Some(3)),
        (
            &["convert", "robots/ripley/checks.csv", "there.csv"],
            7,
            "file-exists",
            None,
        ),
        (&["revert", "bad.urdf", "--in-place"], 3, "no-record", None),
        (&["convert", "--wrong"], 2, "usage", None),
    ];
    for (arguments, exit, id, line) in calls {
        let all: Vec<&str> = arguments.iter().copied().chain(["--json"]).collect();
        let ran = dir.calib_with(&all).expect(exit);
        assert_eq!(ran.stdout.lines().count(), 1, "{}", ran.stdout);
        let said = ran.json();
        assert_eq!(
            (&said["id"], &said["exit_code"]),
            (&id.into(), &exit.into()),
            "{said}"
        );
        assert!(
            said["error"].as_str().is_some_and(|e| !e.is_empty()),
            "{said}"
        );
        if id != "usage" && id != "no-record" {
            let file = said["place"]["file"].as_str();
            assert!(
                arguments
                    .iter()
                    .any(|a| file == Some(a) || file == Some(&format!("./{a}"))),
                "{said}"
            );
            assert_eq!(said["place"]["line"].as_u64(), line, "{said}");
            assert!(
                said["remedy"].as_str().is_some_and(|e| !e.is_empty()),
                "{said}"
            );
        }
    }
}

#[test]
fn no_control_character_of_a_file_reaches_the_terminal() {
    let evil = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}31m\u{202e}";
    let dir = Scratch::new()
        .brief("ripley")
        .file(&format!("{evil}.csv"), "pose,a_rad\n0,x\n")
        .file("labels.csv", format!("pose,{evil}_rad\n0,x\n"))
        .file(
            "r.urdf",
            format!("<robot name=\"r\"><link name=\"a\"/><link name=\"{evil}\"/></robot>")
                .replace('\u{1b}', "")
                .replace('\u{7}', ""),
        )
        .edit(
            "robots/ripley.yaml",
            "name: ripley",
            &format!("name: \"{}\"", "ripley\\u009b31m\\u202e"),
        );
    let named = format!("{evil}.csv");
    for arguments in [
        vec!["convert", named.as_str(), "out.csv"],
        vec!["convert", "labels.csv", "out.csv"],
        vec!["convert", "labels.csv", "out.csv", "--json"],
        vec!["diff", "r.urdf", "r.urdf"],
        vec!["check", "robots/ripley.yaml"],
        vec!["run", "robots/ripley.yaml", "--out", "out"],
        vec!["fit", "cor", "labels.csv"],
        vec!["study", evil],
    ] {
        let ran = dir.calib_with(&arguments);
        let hidden = |c: char| {
            let plain = matches!(c, '\n' | '\t');
            (c.is_control() && !plain) || ('\u{202a}'..='\u{202e}').contains(&c)
        };
        let shown = ran.stdout + &ran.stderr;
        assert!(!shown.contains(hidden), "{arguments:?}: {shown:?}");
    }
}

#[test]
fn a_profile_with_hidden_characters_has_their_line() {
    for (key, named) in [
        ("name: ripley", r#"name: "x\e[8mHIDE""#),
        ("name: ripley", r#"name: "x\nFAKE LINE""#),
        ("frame: vicon", r#"frame: "\e[31mred""#),
        ("  linkM: ", "  \"link\\tM\": "),
    ] {
        let dir = Scratch::new().brief("ripley");
        let dir = dir.edit("robots/ripley.yaml", key, named);
        for command in ["check", "run", "plan", "twin", "simulate"] {
            let profile = [command, "robots/ripley.yaml", "--color", "always"];
            let ran = dir.calib_with(&[&profile[..], &["--out", "new"]].concat()[..]);
            let ran = match command {
                "check" => dir.calib_with(&profile),
                _ => ran,
            };
            let ran = ran.expect(2);
            assert!(ran.stderr.contains("robots/ripley.yaml:"), "{}", ran.stderr);
            assert!(ran.stderr.contains("this text has "), "{}", ran.stderr);
            assert!(!(ran.stdout + &ran.stderr).contains('\u{1b}'));
        }
        assert!(!dir.path("new").exists());
    }
}

#[test]
fn commands_to_copy_are_quoted_for_the_shell() {
    let dir = Scratch::new().brief("ripley");
    for out in ["a b", "c; touch stolen", "it's", "-x"] {
        let stated = format!("--out={out}");
        let ran = dir.calib(["run", "robots/ripley.yaml", &stated]).expect(0);
        let words = ran.words();
        let (_, next) = words.split_once("Next: ").expect("a command");
        let (command, _) = next.split_once(" ACCEPTED").expect("the verdict");
        let shown = shell(&dir, command);
        assert!(shown.status.success(), "{command}: {shown:?}");
        assert!(!dir.path("stolen").exists());
    }
    let profile = "my robots/ripley.yaml";
    std::fs::rename(dir.path("robots"), dir.path("my robots")).expect("renamed");
    let text = dir.read(profile);
    let dir = dir.edit(profile, "held_out_rms_mm: 1.5", "held_out_rms_mm: 0.0001");
    let ran = dir.calib(["run", profile, "--out", "new"]).expect(1);
    assert!(
        ran.words().contains("calib run 'my robots/ripley.yaml'"),
        "{}",
        ran.stdout
    );
    let dir = dir.file(profile, text);
    let again = dir.calib(["run", profile, "--out", "new"]).expect(0);
    assert!(
        again.stdout.contains("Next: calib apply new "),
        "{}",
        again.stdout
    );
}

#[test]
fn more_poses_than_a_computer_holds_are_refused_at_their_line() {
    for (from, to) in [
        ("poses: 40", "poses: 4000000000"),
        ("to: 160, poses: 31", "to: 160, poses: 99999999"),
    ] {
        let dir = Scratch::new().robot("ripley");
        let dir = dir.edit("robots/ripley.yaml", from, to);
        let ran = dir.calib(["simulate", "robots/ripley.yaml", "--out", "new"]);
        let ran = ran.expect(2);
        assert!(ran.stderr.contains("poses are asked for"), "{}", ran.stderr);
        assert!(
            ran.stderr.contains("robots/ripley.yaml:1"),
            "{}",
            ran.stderr
        );
        assert!(!dir.path("new").exists());
    }
}

#[test]
fn names_that_cannot_be_files_are_found_before_the_fit() {
    let dir = Scratch::new().brief("ripley");
    let text = dir.read("robots/ripley.yaml");
    // Without names of its own for the files.
    let (head, rest) = text.split_once("\noutputs:").expect("outputs");
    let (_, tail) = rest.split_once("\nsimulate:").expect("simulate");
    let text = format!("{head}\nsimulate:{tail}\n");
    let check = |text: String| {
        std::fs::write(dir.path("robots/x.yaml"), text).expect("a file");
        let ran = dir.calib(["check", "robots/x.yaml"]).expect(2);
        let said = ["no file can be named", "this text has "];
        assert!(
            said.iter().any(|said| ran.stderr.contains(said)),
            "{}",
            ran.stderr
        );
    };
    let long = "x".repeat(201);
    for name in ["a/b", "\"..\"", &long, "\"a\\nb\"", "nul"] {
        check(text.replacen("name: ripley", &format!("name: {name}"), 1));
    }
    for name in ["nul.urdf", "calib.manifest", "a\\u001b.urdf", ""] {
        check(format!("{text}outputs: {{urdf: \"{name}\"}}\n"));
    }
}

#[test]
fn a_plugin_elsewhere_needs_a_pin_or_leave() {
    // No library: what is asked is whether it would be opened, which fails in another way.
    let dir = Scratch::new()
        .brief("ripley")
        .file("elsewhere/x.so", "not a library")
        .file("robots/plugins/x.so", "not a library");
    let profile = dir.read("robots/ripley.yaml");
    let check = |plugin: &str, arguments: &[&str], variables: &[(&str, &str)]| {
        let text = format!("{profile}\nplugins:\n  x: {{{plugin}}}\n");
        std::fs::write(dir.path("robots/x.yaml"), text).expect("a file");
        let all: Vec<&str> = ["check", "robots/x.yaml"]
            .iter()
            .chain(arguments)
            .copied()
            .collect();
        dir.calib_in(&all, variables).expect(6).stderr
    };
    let (far, near) = ("path: ../elsewhere/x.so", "path: plugins/x.so");
    let refused = "neither beside the profile nor in a plugin folder";
    let off = "plugins are switched off";
    assert!(check(far, &[], &[]).contains(refused));
    assert!(check(far, &["--no-plugins"], &[]).contains(off));
    assert!(check(near, &["--no-plugins"], &[]).contains(off));
    assert!(check(near, &["--allow-plugins"], &[("CALIB_NO_PLUGINS", "1")]).contains(off));
    for opened in [
        check(near, &[], &[]),
        check(far, &["--allow-plugins"], &[]),
        check("", &[], &[]),
    ] {
        assert!(
            !opened.contains(refused) && !opened.contains(off),
            "{opened}"
        );
    }
    let pinned = format!("{far}, sha256: {}", "0".repeat(64));
    assert!(check(&pinned, &[], &[]).contains("the profile pins"));
    let folder = dir.path("elsewhere").display().to_string();
    assert!(!check(far, &[], &[("CALIB_PLUGIN_PATH", &folder)]).contains(refused));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(
            dir.path("elsewhere/x.so"),
            dir.path("robots/plugins/link.so"),
        )
        .expect("a link");
        assert!(check("path: plugins/link.so", &[], &[]).contains(refused));
    }
}
