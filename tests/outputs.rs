//! Every output is read by the reference checker of its format. `tests/checkers/install.sh FOLDER` gets the checkers, and
//! `CALIB_CHECKERS` names that folder; without one the checks are counted as skipped.

use std::path::Path;
use std::process::Command;

use crate::scratch::Scratch;

/// Errors that the checker of `format` finds in `file`; `None` where there is no checker here.
pub(crate) fn faults(format: &str, file: &Path) -> Option<Vec<String>> {
    let checker = skipped_tests::checker(format)?;
    let out = Command::new(checker)
        .arg(file)
        .output()
        .expect("a checker that is there starts");
    if out.status.success() {
        return Some(Vec::new());
    }
    let said = [out.stdout, out.stderr].concat();
    let said = String::from_utf8_lossy(&said).into_owned();
    Some(said.lines().map(str::to_owned).collect())
}

/// Gives every link of a URDF that has none a box to see and, with `masses`, an inertia; the box is an STL file.
fn dressed(urdf: &str, masses: bool) -> String {
    let mass = "<inertial><origin xyz=\"0.01 0 0\"/><mass value=\"1.5\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial>";
    let visual = "<visual><geometry><mesh filename=\"part.stl\" scale=\"0.001 0.001 0.001\"/></geometry></visual>";
    let inside = format!("{}{visual}", if masses { mass } else { "" });
    let mut out = String::new();
    for line in urdf.split_inclusive('\n') {
        match line.trim_end().strip_suffix("/>") {
            Some(open) if line.trim_start().starts_with("<link ") => {
                out += &format!("{}>{inside}</link>\n", open.trim_end());
            }
            _ if line.trim_start().starts_with("<link ") && line.trim_end().ends_with('>') => {
                out += &line.replacen('>', &format!(">{inside}"), 1);
            }
            _ => out += line,
        }
    }
    out
}

/// A binary STL of one tetrahedron, 100 mm.
fn tetrahedron() -> Vec<u8> {
    let corners: [[f32; 3]; 4] = [
        [0.0; 3],
        [100.0, 0.0, 0.0],
        [0.0, 100.0, 0.0],
        [0.0, 0.0, 100.0],
    ];
    let mut bytes = vec![b' '; 80];
    bytes.extend(4_u32.to_le_bytes());
    for face in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        bytes.extend([0_u8; 12]);
        for corner in face {
            bytes.extend(corners[corner].iter().flat_map(|x: &f32| x.to_le_bytes()));
        }
        bytes.extend([0_u8; 2]);
    }
    bytes
}

const FORMATS: [&str; 6] = ["urdf", "sdf", "gltf", "mcap", "html", "axe"];

/// Runs `robots/<robot>.yaml` and has the files of these formats checked.
fn check(dir: &Scratch, robot: &str, formats: &[&str]) {
    let ran = dir.calib(["run", &format!("robots/{robot}.yaml"), "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let mut found = Vec::new();
    for format in formats {
        let file = match *format {
            "urdf" => format!("{robot}.calibrated.urdf"),
            "gltf" => format!("{robot}.scene.glb"),
            "html" | "axe" => "report.html".to_owned(),
            other => format!("{robot}.scene.{other}"),
        };
        let path = dir.path(&format!("out/{file}"));
        let faults = faults(format, &path).unwrap_or_default();
        found.extend(faults.iter().map(|fault| format!("{file}: {fault}")));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// A report is sent by mail, bytes.
const LARGEST_PAGE: u64 = 1_500_000;

/// A4 pages of the printed report.
const SHEETS: usize = 9;

/// The pages that a browser prints; `None` where there is no browser here.
fn sheets(dir: &Scratch, page: &Path) -> Option<usize> {
    let pdf = dir.path("report.pdf");
    let flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--no-pdf-header-footer",
    ];
    let known = ["chromium", "chromium-browser", "google-chrome"];
    let printed = known.iter().find_map(|browser| {
        let mut command = Command::new(browser);
        command
            .args(flags)
            .arg(format!("--user-data-dir={}", dir.path("browser").display()))
            .arg(format!("--print-to-pdf={}", pdf.display()))
            .arg(format!("file://{}", page.display()));
        command.output().ok()
    })?;
    assert!(printed.status.success(), "{printed:?}");
    let bytes = std::fs::read(pdf).expect("a PDF file");
    let text = String::from_utf8_lossy(&bytes).into_owned();
    Some(text.matches("/Type /Page\n").count())
}

#[test]
fn the_outputs_of_the_shipped_robots_pass() {
    for robot in ["ripley", "justin"] {
        let dir = Scratch::new().robot(robot);
        check(&dir, robot, &FORMATS);
        let page = dir.path("out/report.html");
        let size = page.metadata().expect("a report").len();
        assert!(size <= LARGEST_PAGE, "{robot}: {size} bytes");
        if robot == "ripley" {
            match sheets(&dir, &page) {
                Some(count) => assert!((1..=SHEETS).contains(&count), "{count} pages"),
                None => skipped_tests::skip(skipped_tests::NO_BROWSER),
            }
        }
    }
}

/// With masses the robot is included in the SDF world, without it stands there as frames; meshes go into the GLB file.
#[test]
fn the_outputs_of_a_robot_with_meshes_pass() {
    for masses in [true, false] {
        let dir = Scratch::new().brief("ripley");
        let urdf = std::fs::read_to_string(dir.path("robots/ripley/r17.urdf")).expect("a URDF");
        let dir = dir
            .file("robots/ripley/r17.urdf", dressed(&urdf, masses))
            .file("robots/ripley/part.stl", tetrahedron());
        // Masses change the robot and the world only.
        let formats = if masses { &FORMATS[..] } else { &FORMATS[..2] };
        check(&dir, "ripley", formats);
        let sdf = std::fs::read_to_string(dir.path("out/ripley.scene.sdf")).expect("an SDF world");
        assert_eq!(sdf.contains("<include>"), masses);
    }
}

/// The checkers do find errors: a test that calls none would pass with anything.
#[test]
fn what_is_wrong_is_found() {
    let dir = Scratch::new()
        .file("bad.urdf", "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/></robot>")
        .file("bad.sdf", "<sdf version=\"1.9\"><world name=\"w\"><frame name=\"a\" attached_to=\"b\"/></world></sdf>")
        .file("bad.glb", "glTF")
        .file("bad.mcap", "MCAP")
        .file("bad.html", "<!DOCTYPE html><html lang=\"en\"><head><title>t</title></head><body><img src=\"a\"></body></html>");
    let bad = [
        ("urdf", "bad.urdf"),
        ("sdf", "bad.sdf"),
        ("gltf", "bad.glb"),
        ("mcap", "bad.mcap"),
        ("html", "bad.html"),
        ("axe", "bad.html"),
    ];
    for (format, file) in bad {
        if let Some(faults) = faults(format, &dir.path(file)) {
            assert!(!faults.is_empty(), "{file} passed");
        }
    }
}

/// A measurement in the place of a simulated recording is not simulated away, though the list of the folder has its name.
#[test]
fn a_measured_recording_is_not_simulated_away() {
    let dir = Scratch::new().brief("ripley");
    let simulate = ["simulate", "robots/ripley.yaml", "--out", "new"];
    dir.calib(simulate).expect(0);
    dir.calib(simulate).expect(0);
    let measured = "# calib record: robot ripley\nt_s,waist_deg\n0,1\n";
    let dir = dir.file("new/checks.csv", measured);
    let before = dir.files("new");
    let ran = dir.calib(simulate).expect(7);
    let said = "checks.csv is not the file any more that this program wrote there";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    assert!(dir.files("new") == before, "something was written");
    dir.without("new/checks.csv").calib(simulate).expect(0);
}

/// A table of postures without a column of every joint is taken with zeros, and that is said.
#[test]
fn joints_that_a_region_leaves_out_are_named() {
    let done = crate::scratch::finished("ripley", "ml");
    let folder = done.dir.path("out").display().to_string();
    let dir = Scratch::new().file("few.csv", "waist_deg\n0\n10\n20\n30\n");
    let model = format!("{folder}/ripley.calibrated.model.json");
    let export = ["export", &model, "--to", "urdf-best", "--region", "few.csv"];
    let ran = dir.calib_with(&export);
    let said = "joints without a column count as 0: shoulder, ";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
}
