//! Names of the tracker in place of the profile's: `names` of a profile and `--map` hold as they are stated, or are refused.

use crate::scratch::{Finished, Scratch, finished};

const PROFILE: &str = "robots/ripley.yaml";
const EXCHANGE: &str = "names: {gripM_1: gripM_2, gripM_2: gripM_1}\nrecordings:\n";

/// Ripley with two markers exchanged in all recordings, as a tracker that labels them so would write them.
fn exchanged() -> Scratch {
    let mut dir = Scratch::new().brief("ripley");
    for file in ["base_sweep", "wrist_sweep", "arm_poses", "checks"] {
        let path = format!("robots/ripley/{file}.csv");
        let text = dir.read(&path);
        let text = text
            .replace("gripM_1.", "gripM_0.")
            .replace("gripM_2.", "gripM_1.")
            .replace("gripM_0.", "gripM_2.");
        dir = dir.file(&path, text);
    }
    dir
}

#[test]
fn exchanged_names_are_exchanged_back() {
    let fit = |dir: &Scratch| {
        let ran = dir.calib(["run", PROFILE, "--out", "out", "--json"]);
        ran.expect(0).json()["fit"].to_string()
    };
    let as_stated = fit(&Scratch::new().brief("ripley"));
    let dir = exchanged();
    assert_ne!(fit(&dir), as_stated, "nothing was exchanged");
    let dir = dir.edit(PROFILE, "recordings:\n", EXCHANGE);
    assert_eq!(fit(&dir), as_stated);
    let said = dir.json("out/report.json").to_string();
    assert!(said.contains("`gripM_1` is the tracker's `gripM_2`"));

    // A recording that was written with the profile's names is not exchanged once more.
    let path = "robots/ripley/checks.csv";
    let ran = dir.calib([
        "convert",
        path,
        "checks.csv",
        "--map",
        "gripM_1=gripM_2,gripM_2=gripM_1",
    ]);
    ran.expect(0);
    let converted = dir.read("checks.csv");
    assert!(converted.contains("# gripM_1 is the tracker's gripM_2\n"));
    assert_eq!(fit(&dir.file(path, converted)), as_stated);
}

#[test]
fn a_name_that_is_taken_or_in_no_recording_is_said() {
    let dir = Scratch::new().brief("ripley");
    let one = "names: {gripM_1: gripM_2}\nrecordings:\n";
    let dir = dir.edit(PROFILE, "recordings:\n", one);
    let ran = dir.calib(["check", PROFILE]).expect(3);
    let taken = "`gripM_2` is to be called `gripM_1`, and the recording has another `gripM_1`";
    assert!(ran.stderr.contains(taken), "{}", ran.stderr);
    let dir = dir.edit(PROFILE, "gripM_1: gripM_2", "gripM_1: zzz");
    let ran = dir.calib(["check", PROFILE, "--json"]).expect(0);
    assert!(ran.stdout.contains("tracker-name-unused"), "{}", ran.stdout);
    let Finished { report, .. } = finished("ripley", "ml");
    assert!(!report.to_string().contains("tracker-name-unused"));
}

#[test]
fn a_map_is_applied_as_it_is_stated_or_refused() {
    let table = "t_s,M.x_m,M.y_m,M.z_m,N.x_m,N.y_m,N.z_m\n0,1,2,3,4,5,6\n";
    let dir = Scratch::new().file("log.csv", table);
    let convert = |out: &str, map: &[&str]| {
        let maps = map.iter().flat_map(|pair| ["--map", pair]);
        let all: Vec<&str> = ["convert", "log.csv", out]
            .into_iter()
            .chain(maps)
            .collect();
        dir.calib_with(&all)
    };
    convert("new.csv", &["M=N", "N=M"]).expect(0);
    let written = dir.read("new.csv");
    let rows: Vec<&str> = written.lines().filter(|l| !l.starts_with('#')).collect();
    let (header, row) = (rows[0], rows[1]);
    let at = |name: &str| {
        let place = header.split(',').position(|n| n == name).expect("a column");
        row.split(',').nth(place).expect("a cell").to_owned()
    };
    assert_eq!([at("M.x_m"), at("N.x_m")], ["4", "1"], "{written}");
    convert("chain.csv", &["A=M", "M=N"]).expect(0);
    for (map, code, said) in [
        (
            &["M=N"][..],
            3,
            "`N` is to be called `M`, and the recording has another `M`",
        ),
        (&["A=zz"], 3, "no body and no marker is called `zz`"),
        (&["A="], 2, "--map `A=`"),
        (&["=M"], 2, "--map `=M`"),
        (&["A=M", "B=M"], 2, "`M` is mapped twice"),
        (&["A=M", "A=N"], 2, "`A` is mapped twice"),
    ] {
        let ran = convert("refused.csv", map).expect(code);
        assert!(ran.stderr.contains(said), "{map:?}: {}", ran.stderr);
        assert!(ran.stderr.contains("\n  help: "), "{}", ran.stderr);
        assert!(!dir.path("refused.csv").exists(), "{map:?}");
    }
}
