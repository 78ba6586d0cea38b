//! `calib view` as a browser uses it, manual pages as `man` reads them, JSON as a program reads it.

use crate::scratch;

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

use scratch::Scratch;
use serde_json::Value;

/// A server that ends with the test.
struct Served {
    program: Child,
    port: u16,
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

impl Served {
    fn new(dir: &Scratch, arguments: &[&str]) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_calib"))
            .args(arguments)
            .current_dir(dir.path(""))
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut line = String::new();
        let out = program.stdout.take().expect("a pipe");
        BufReader::new(out).read_line(&mut line).expect("a line");
        let url = match serde_json::from_str::<Value>(&line) {
            Ok(told) => told["url"].as_str().expect("a URL").to_owned(),
            Err(_) => line.trim().to_owned(),
        };
        let rest = url
            .strip_prefix("http://127.0.0.1:")
            .expect("this computer only");
        let (port, name) = rest.split_once('/').expect("a page");
        assert_eq!(name, "report.html");
        let port = port.parse().expect("a port");
        Self { program, port }
    }

    /// Status line, head, body.
    fn get(&self, line: &str, host: &str) -> (String, String, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        let host = host.replace("PORT", &self.port.to_string());
        write!(stream, "{line} HTTP/1.1\r\nHost: {host}\r\n\r\n").expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("text");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
        let status = head.lines().next().unwrap_or_default();
        (status.to_owned(), head.to_owned(), body.to_owned())
    }
}

fn results() -> Scratch {
    Scratch::new()
        .file("out/report.html", "<p>page</p>")
        .file("out/report.json", "{}")
        .file("secret.txt", "no")
}

#[test]
fn a_folder_is_served_to_this_computer_and_nothing_else_of_it() {
    let dir = results();
    for arguments in [
        &["view", "out", "--serve"][..],
        // No screen here: served although it was not asked for.
        &["view", "out/report.html", "--json"],
    ] {
        let served = Served::new(&dir, arguments);
        let (status, head, body) = served.get("GET /", "127.0.0.1:PORT");
        assert_eq!(
            (status.as_str(), body.as_str()),
            ("HTTP/1.1 200 OK", "<p>page</p>")
        );
        assert!(
            head.contains("text/html") && head.contains("nosniff"),
            "{head}"
        );
        let (_, head, body) = served.get("HEAD /report.json", "localhost:PORT");
        assert!(
            head.contains("Content-Length: 2") && body.is_empty(),
            "{head}"
        );
        for (line, host, status) in [
            ("GET /../secret.txt", "127.0.0.1:PORT", "404"),
            ("GET /%2e%2e%2fsecret.txt", "127.0.0.1:PORT", "404"),
            ("GET /absent", "127.0.0.1:PORT", "404"),
            ("GET /report.json", "rebound.example:PORT", "403"),
            ("POST /report.json", "127.0.0.1:PORT", "405"),
        ] {
            let (answer, _, body) = served.get(line, host);
            assert!(answer.contains(status), "{line}: {answer}");
            assert!(body.starts_with(status), "{line}: {body}");
        }
    }
}

#[test]
fn what_is_no_report_is_not_shown() {
    let dir = results().file("empty/notes.txt", "");
    for place in ["empty", "absent", "secret.txt", "out/report.json"] {
        let ran = dir.calib(["view", place, "--serve"]).expect(2);
        assert!(ran.stderr.contains("no report to show"), "{}", ran.stderr);
        assert!(ran.stderr.contains("help: name a folder"), "{}", ran.stderr);
    }
    let ran = dir.calib(["view", "empty", "--json"]).expect(2);
    let line: Value = serde_json::from_str(ran.stdout.trim()).expect("a JSON line");
    assert_eq!(line["exit_code"], 2);
}

#[test]
fn every_command_has_a_manual_page() {
    let dir = Scratch::new();
    let ran = dir.calib(["man", "--out", "man", "--json"]).expect(0);
    let written = ran.json()["written"].as_array().expect("paths").len();
    let help = dir.calib(["--help"]).expect(0).stdout;
    let commands = help.lines().skip_while(|l| *l != "Commands:").skip(1);
    let commands = commands
        .take_while(|l| !l.is_empty())
        .filter(|l| !l.starts_with("    "));
    let names: Vec<&str> = commands
        .filter_map(|l| l.split_whitespace().next())
        .collect();
    assert!(names.len() > 15 && written > names.len(), "{names:?}");
    for name in names.iter().filter(|name| **name != "help") {
        let page = dir.read(&format!("man/calib-{name}.1"));
        assert!(
            page.contains(".SH NAME") && page.contains(".SH SYNOPSIS"),
            "{name}"
        );
        assert!(page.contains(".SH OPTIONS"), "{name}");
    }
    let main = dir.calib(["man"]).expect(0).stdout;
    assert_eq!(main, dir.read("man/calib.1"));
    assert!(main.contains("calib\\-run(1)"), "the commands are listed");
}

#[test]
fn programs_read_json_from_every_command() {
    let dir = Scratch::new();
    let read = |arguments: &[&str]| dir.calib_with(arguments).expect(0).json();
    let listed = read(&["plugins", "--json"]);
    assert!(
        listed["calib.cor/1"]
            .as_array()
            .is_some_and(|rows| rows.len() > 5),
        "{listed}"
    );
    assert!(listed["plugins"].is_array() && listed["calib.cor/1"][0]["summary"].is_string());
    let header = read(&["plugins", "header", "--json"]);
    assert!(
        header["header"]
            .as_str()
            .is_some_and(|text| text.contains("calib_plugin"))
    );
    let script = read(&["completions", "bash", "--json"]);
    assert_eq!(script["shell"], "bash");
    assert!(
        script["script"]
            .as_str()
            .is_some_and(|text| text.contains("complete"))
    );
    let created = read(&["plugins", "new", "mine", "--json"]);
    assert_eq!(created["written"][0], "./mine");
    let page = read(&["man", "--json"]);
    assert_eq!(page["name"], "calib.1");

    let checked = dir
        .calib(["plugins", "check", "absent", "--json"])
        .expect(6);
    assert_eq!(checked.json()["passed"], false);
    assert_eq!(checked.json()["tests"][0]["outcome"], "FAILED");
    assert_eq!(checked.json()["exit_code"], 6);
    assert!(checked.json()["error"].is_string() && checked.json()["remedy"].is_string());

    let refused = dir.calib(["record", "absent.yaml", "--source", "dtrack:1", "--json"]);
    assert_eq!(refused.code, 2);
    let line: Value = serde_json::from_str(refused.stdout.trim()).expect("a JSON line");
    assert!(
        line["error"].is_string() && line["remedy"].is_string(),
        "{line}"
    );
}

/// Tables, other formats and remarks are JSON too, and an error has its place and its remedy.
#[test]
fn texts_and_remarks_are_json_where_json_is_asked_for() {
    let done = scratch::finished("ripley", "ml");
    let out = done.dir.path("out").display().to_string();
    let model = format!("{out}/ripley.calibrated.model.json");
    let table = done.dir.path("robots/ripley/checks.csv");
    let table = table.display().to_string();
    let urdf = done
        .dir
        .path("robots/ripley/r17.urdf")
        .display()
        .to_string();
    let dir = Scratch::new()
        .file("few.csv", "waist_deg\n0\n1\n")
        .file("there.csv", "");
    let lines = |text: &str| {
        let all = text.lines().map(serde_json::from_str::<Value>);
        assert!(all.into_iter().all(|line| line.is_ok()), "{text}");
    };
    for (arguments, key) in [
        (
            &["diff", &urdf, &format!("{out}/ripley.calibrated.urdf")][..],
            "joints",
        ),
        (&["predict", &model, "few.csv"], "text"),
        (&["predict", &model, "few.csv", "--out", "p.csv"], "written"),
        (&["correct", &model, &table], "text"),
        (
            &["export", &model, "--to", "urdf", "--region", "few.csv"],
            "text",
        ),
        (
            &["export", &model, "--to", "urdf", "--out", "e.urdf"],
            "written",
        ),
        (&["convert", "few.csv", "c.csv"], "written"),
    ] {
        let ran = dir.calib_with(&[&["--json"], arguments].concat());
        assert!(
            ran.json().get(key).is_some(),
            "{arguments:?}: {}",
            ran.stdout
        );
        lines(&ran.stderr);
    }
    for arguments in [
        &["view", "absent"][..],
        &["fit", "cor", "absent.csv"],
        &["apply", "absent", "x.urdf", "--diff"],
        &["revert", "absent.urdf", "--in-place"],
    ] {
        let ran = dir.calib_with(&[&["--json"], arguments].concat());
        let file = ran.json()["place"]["file"].to_string();
        assert!(file.contains("absent"), "{}", ran.stdout);
        assert!(ran.json()["remedy"].is_string(), "{}", ran.stdout);
    }
    let wrong = dir.calib(["--json", "frobnicate"]).expect(2);
    assert!(wrong.json()["remedy"].is_string(), "{}", wrong.stdout);
    let profile = done.dir.path("robots/ripley.yaml").display().to_string();
    let record = ["--json", "record", &profile, "--recording", "checks"];
    let rest = [
        "--source",
        "dtrack:24993",
        "--joints",
        "udp:24994",
        "--out",
        "there.csv",
    ];
    let ran = dir.calib_with(&[&record[..], &rest].concat()).expect(7);
    assert_eq!(ran.json()["place"]["file"], "there.csv", "{}", ran.stdout);
    assert!(ran.json()["remedy"].is_string(), "{}", ran.stdout);
}

#[test]
fn the_progress_of_a_study_is_json_lines() {
    let dir = Scratch::new().brief("ripley");
    let two = ["study", "ripley", "--trials", "2", "--recorded", "1"];
    let ran = dir.calib_with(&[&two[..], &["--out", "out", "--json"]].concat());
    let ran = ran.expect(0);
    assert!(ran.json()["results"].is_array());
    let lines: Vec<Value> = (ran.stderr.lines())
        .map(|line| serde_json::from_str(line).expect("a JSON line"))
        .collect();
    let progress: Vec<u64> = (lines.iter())
        .filter(|line| line["progress"] == "robots" && line["of"] == 2)
        .filter_map(|line| line["done"].as_u64())
        .collect();
    assert_eq!(progress, [1, 2], "{lines:?}");
    let written = lines
        .iter()
        .filter(|line| line["written"].is_array())
        .count();
    // The table, the data, the page, the figure, and the list of them.
    assert_eq!(written, 5, "{lines:?}");
}
