//! Joint effects that plugins compute, through the program: found, predicted with, and never left out in silence.

use std::process::Command;

use calib_model::file::RobotModelFile;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use serde_json::Value;

use crate::effects::{Effect, MARKER, PROFILE, laboratory, number, parameter};
use crate::scratch::{Scratch, root};

/// Third harmonic of joint 2, rad.
const WAVE: f64 = 0.003;

const WAVY: Effect = |joint, _, _, q| {
    if joint == 2 {
        WAVE * (3.0 * q).sin()
    } else {
        0.0
    }
};

/// The profile with an effect of joint 2.
fn with_effect(plugins: &str, effect: &str) -> String {
    let joint = format!("  joints: {{j2: {{effects: {{{effect}}}}}}}\n");
    let profile = PROFILE.replace("solve:\n", &format!("solve:\n{joint}"));
    profile.replace("recordings:\n", &format!("{plugins}recordings:\n"))
}

/// Builds a plugin in C beside the profile; `None` without a compiler.
fn built(dir: &Scratch, source: &std::path::Path, name: &str, define: &str) -> Option<()> {
    let suffix = std::env::consts::DLL_SUFFIX;
    std::fs::create_dir_all(dir.path("plugins")).expect("a folder");
    let status = Command::new("cc")
        .args(["-std=c11", "-O1", "-fPIC", "-shared", define, "-I"])
        .arg(root().join("crates/calib-plugin/include"))
        .arg(source)
        .args(["-lm", "-o"])
        .arg(dir.path(&format!("plugins/lib{name}{suffix}")))
        .status();
    let Ok(status) = status else {
        skipped_tests::skip("no C compiler");
        return None;
    };
    assert!(status.success(), "{name} does not compile");
    Some(())
}

/// A laboratory whose joint 2 has the effect, with the plugin of a new project.
fn wavy() -> Option<Scratch> {
    let profile = with_effect("plugins: {waves: {}}\n", "waves: {order: 3}");
    let dir = laboratory(&profile, 0.0, WAVY);
    let new = ["plugins", "new", "waves", "--kind", "effect", "--lang", "c"];
    dir.calib(new).expect(0);
    built(&dir, &dir.path("waves/plugin.c"), "waves", "-DNDEBUG")?;
    Some(dir)
}

/// Errors of the predicted markers of the hand at the rows of a table, m.
fn prediction_errors(model: &RobotModelFile, predicted: &str, recorded: &str) -> Vec<f64> {
    let rows = |text: &str| -> Vec<std::collections::BTreeMap<String, f64>> {
        let mut lines = text.lines().filter(|l| !l.starts_with('#'));
        let head: Vec<&str> = lines.next().expect("a heading").split(',').collect();
        let row = |line: &str| {
            let cells = line.split(',').map(|c| c.parse().unwrap_or(f64::NAN));
            head.iter().map(ToString::to_string).zip(cells).collect()
        };
        lines.map(row).collect()
    };
    let markers = &model.bodies["hand"].markers_m;
    let mut out = Vec::new();
    for (at, seen) in rows(predicted).iter().zip(rows(recorded)) {
        let v = |name: &str| at[&format!("l3.{name}")];
        let q = Quaternion::new(v("qw"), v("qx"), v("qy"), v("qz"));
        let pose = Isometry3::from_parts(
            Translation3::new(v("x_m"), v("y_m"), v("z_m")),
            UnitQuaternion::from_quaternion(q),
        );
        for (name, place) in markers {
            let there = pose * Point3::from(*place);
            let mm = |axis: &str| seen[&format!("{name}_{axis}_mm")] * 1e-3;
            out.push((there - Point3::new(mm("x"), mm("y"), mm("z"))).norm());
        }
    }
    out
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn an_effect_of_a_plugin_is_found_and_predicted_with() {
    let Some(dir) = wavy() else { return };
    dir.calib(["check", "arm.yaml"]).expect(0);
    // The closed forms estimate no effects: left out, it would count as estimated.
    let closed = ["run", "arm.yaml", "--method", "paper", "--out", "closed"];
    let said = dir.calib(closed).expect(2).stderr;
    assert!(said.contains("estimates no joint effects"), "{said}");
    dir.calib(["run", "arm.yaml", "--out", "out"]).expect(0);
    let report = dir.json("out/report.json");
    let p = parameter(&report, "j2.waves").expect("freed");
    let (value, sigma) = (number(&p["value"]), number(&p["sigma"]));
    assert!((value - WAVE).abs() < 4.0 * sigma && sigma < 2e-4, "{p}");
    assert_eq!(
        (&p["unit"], &p["kind"]),
        (&"rad".into(), &"plugin_effect".into()),
        "{p}"
    );
    let held_out = number(&report["verification"]["held_out"]["calibrated"]["rms_m"]);
    assert!(held_out < 2.0 * MARKER, "{held_out}");
    // Whose code it was.
    let components = report["components"].as_array().expect("a list");
    let of_plugin = components.iter().find(|c| c["kind"] == "calib.effect/1");
    let of_plugin = of_plugin.expect("the plugin");
    assert_eq!(of_plugin["plugin"]["name"], "waves", "{of_plugin}");
    assert_eq!(
        of_plugin["used_for"],
        Value::from(vec!["j2"]),
        "{of_plugin}"
    );
    let yaml = dir.read("out/arm.calibrated.calibration.yaml");
    assert!(yaml.contains("plugin_effects:\n      waves: "), "{yaml}");

    // Without the plugin no command evaluates the robot; with it, its predictions are right.
    let file = "out/arm.calibrated.model.json";
    let text = dir.read(file);
    let model = RobotModelFile::from_json(text.as_bytes()).expect("a model file");
    let ask = [
        "predict",
        file,
        "arm/checks.csv",
        "--of",
        "l3",
        "--in",
        "tracker",
    ];
    for refused in [dir.calib(ask), dir.calib(["export", file, "--to", "dh"])] {
        let named = refused.stderr.contains("by the plugin `waves` 0.1.0");
        assert!(
            refused.code == 3 && named,
            "{} {}",
            refused.code,
            refused.stderr
        );
    }
    let library = format!("plugins/libwaves{}", std::env::consts::DLL_SUFFIX);
    let with = [&ask[..], &["--plugin", &library]].concat();
    let predicted = dir.calib_with(&with).expect(0).stdout;
    let recorded = dir.read("arm/checks.csv");
    let errors = rms(&prediction_errors(&model, &predicted, &recorded));
    assert!(errors < 2.5 * MARKER, "{errors}");
    // Another build of the plugin is not the one that the coefficient belongs to.
    let source = dir.path("waves/plugin.c");
    built(&dir, &source, "waves", "-g3").expect("a compiler");
    let other = dir.calib_with(&with).expect(2).stderr;
    assert!(
        other.contains("was found with the plugin `waves` 0.1.0 (sha256"),
        "{other}"
    );
}

#[test]
fn without_the_plugin_the_run_says_which_one_is_missing() {
    let effect = "third: {}";
    let named = with_effect("plugins: {waves: {}}\n", effect);
    let dir = laboratory(&named, 0.0, WAVY);
    let absent = dir
        .calib(["run", "arm.yaml", "--out", "out"])
        .expect(6)
        .stderr;
    assert!(absent.contains("plugin `waves` was not found"), "{absent}");
    let unnamed = dir.file("unnamed.yaml", with_effect("", effect));
    let unknown = unnamed
        .calib(["run", "unnamed.yaml", "--out", "out"])
        .expect(2)
        .stderr;
    let says = "joint `j2`: no joint effect is called `third`";
    assert!(unknown.contains(says), "{unknown}");

    // What a plugin refuses or gets wrong ends the run with its name, and nothing is written.
    let source = root().join("crates/calib-plugin/tests/c/effect.c");
    for (define, effect, code, says) in [
        (
            "-DFAILS_AT_LARGE",
            effect,
            6,
            "plugin `waves`, joint effect `third`: no table beyond 1 rad",
        ),
        ("-DALL_NAN", effect, 6, "regressors[0] is NaN"),
        (
            "-DON_MOTOR",
            effect,
            2,
            "not for the joint `j2`: it depends on the motor's angle",
        ),
        (
            "-DBUILT_IN",
            "gain: {}",
            2,
            "an effect of the program has this name",
        ),
    ] {
        if built(&unnamed, &source, "waves", define).is_none() {
            return;
        }
        let profile = with_effect("plugins: {waves: {}}\n", effect);
        std::fs::write(unnamed.path("arm.yaml"), profile).expect("a file");
        for command in ["check", "run"] {
            let ran = unnamed.calib([command, "arm.yaml"]);
            assert_eq!(ran.code, code, "{define} {command}: {}", ran.stderr);
            assert!(ran.stderr.contains(says), "{define}: {}", ran.stderr);
        }
    }
    assert!(unnamed.files("out").is_empty());
}
