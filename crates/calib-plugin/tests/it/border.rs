//! Plugins written in Rust, called across the border and directly.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use calib_plugin::{
    Answer, Aor, AorFit, AxisLine, BodyPose, BodyTrack, Call, Control, Cor, CorFit, Entry, Failure,
    Host, JointTrack, JointUnit, Kind, LoadedPlugin, MarkerSample, MarkerTrack, Motion, MotionData,
    Offer, Parameter, Reader, ReportFile, ReportInput, ReportWriter, Shape, Source, Streams,
    Timeline, TorqueTrack, Value,
};
use proptest::prelude::*;

use crate::bed::{cubes, turning};

/// Answers with numbers made from everything that it is given, so that nothing can be lost on the way.
struct Everything;

fn sum<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().sum()
}

fn fingerprint(motion: &Motion<'_>, call: &Call<'_>) -> Result<f64, Failure> {
    let points: f64 = (0..motion.tracks)
        .flat_map(|k| motion.points(k).enumerate().collect::<Vec<_>>())
        .filter_map(|(s, p)| p.map(|p| (s + 1) as f64 * (p[0] + 2.0 * p[1] + 3.0 * p[2])))
        .sum();
    let poses: f64 = (0..motion.tracks)
        .flat_map(|k| motion.poses(k).flatten().collect::<Vec<_>>())
        .map(|p| sum(p.rotation.as_flattened()) + p.rotation[0][1] + sum(&p.translation_m))
        .sum();
    let rest = motion
        .covariances_m2
        .map_or(0.0, |c| sum(c.as_flattened().as_flattened()))
        + motion.angles_rad.map_or(0.0, sum)
        + motion.center_m.map_or(0.0, |c| sum(&c))
        + motion.towards.map_or(0.0, |c| sum(&c))
        + motion.sigma_t_m.unwrap_or(-1.0)
        + motion.sigma_r_rad.unwrap_or(-2.0)
        + motion.significance
        + motion.seed as f64;
    let parameters = call.number("gain")?
        + call.integer("count")? as f64
        + f64::from(u8::from(call.flag("on")?))
        + call.text("word")?.chars().count() as f64;
    call.progress(0.25, "a quarter");
    Ok(points + poses + rest + parameters)
}

fn described(kind: Kind) -> Offer {
    Offer::new(kind, "everything", "uses every input")
        .takes(&Shape::ALL)
        .with(Parameter::number("gain", 0.5, "a number").between(0.0, 1.0))
        .with(Parameter::integer("count", 3, "a whole number"))
        .with(Parameter::flag("on", true, "a switch"))
        .with(Parameter::text("word", "größe", "a text").one_of(&["größe", "ω"]))
}

impl Cor for Everything {
    fn offer(&self) -> Offer {
        described(Kind::Cor)
    }
    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        let x = fingerprint(motion, call)?;
        if motion.samples == 0 {
            return Ok(Answer::NotObservable(format!("nothing to see at {x}")));
        }
        Ok(Answer::Found(CorFit {
            center_m: [x, -x, 0.1 + 0.2],
            covariance_m2: Some([[2.0, 0.1, 0.2], [0.1, 3.0, 0.3], [0.2, 0.3, 4.0]]),
            body_points_m: (0..motion.tracks)
                .map(|k| [k as f64, x, 1.0 / 3.0])
                .collect(),
            radii_m: (0..motion.tracks).map(|k| 0.1 * k as f64).collect(),
            rms_m: 1e-300,
            used: motion.samples,
            rejected: vec![[motion.tracks - 1, motion.samples - 1]],
            weak: Some("äußerst schwach".into()),
        }))
    }
}

impl Aor for Everything {
    fn offer(&self) -> Offer {
        described(Kind::Aor)
    }
    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<AorFit>, Failure> {
        let x = fingerprint(motion, call)?;
        let line = AxisLine {
            point_m: [x, 1.0, 2.0],
            direction: [0.6, 0.0, -0.8],
        };
        let mut covariance = [[0.0; 6]; 6];
        (0..6).for_each(|i| covariance[i][i] = 1.0 + i as f64);
        Ok(Answer::Found(AorFit {
            line,
            covariance: Some(covariance),
            in_child: Some(AxisLine {
                point_m: [0.0, x, 0.0],
                direction: [0.0, 1.0, 0.0],
            }),
            rms_m: 0.5,
            used: 1,
            rejected: Vec::new(),
            weak: None,
        }))
    }
}

fn streams() -> Streams {
    let pose = turning()[1];
    Streams {
        timelines: vec![
            Timeline {
                clock: "tracker".into(),
                rows: vec![1, 2],
                t_s: Some(vec![0.0, 0.5]),
                labels: vec![("trial".into(), vec!["a".into(), "ß".into()])],
            },
            Timeline {
                clock: "robot".into(),
                rows: vec![7],
                t_s: None,
                labels: Vec::new(),
            },
        ],
        markers: vec![MarkerTrack {
            name: "tip".into(),
            timeline: 0,
            samples: vec![MarkerSample::Filled([1.0, 2.0, 3.0]), MarkerSample::Lost],
        }],
        bodies: vec![BodyTrack {
            name: "arm".into(),
            timeline: 0,
            samples: vec![None, pose],
        }],
        joints: vec![JointTrack {
            name: "slide".into(),
            timeline: 1,
            unit: JointUnit::Length,
            samples: vec![Some(0.1)],
        }],
        torques: vec![TorqueTrack {
            name: "elbow".into(),
            timeline: 1,
            samples: vec![None],
        }],
        notes: vec!["mm became m".into()],
    }
}

impl Reader for Everything {
    fn offer(&self) -> Offer {
        Offer::new(Kind::Reader, "everything", "streams of every kind").with_example(b"x")
    }
    fn recognizes(&self, head: &[u8]) -> bool {
        head.starts_with(b"x")
    }
    fn read(&self, source: &Source<'_>, _: &Call<'_>) -> Result<Streams, Failure> {
        match source.bytes {
            b"" => Err(Failure::BadInput(format!("{}: line 1: empty", source.name))),
            b"panic" => panic!("a reader that panics"),
            _ => Ok(streams()),
        }
    }
}

impl ReportWriter for Everything {
    fn offer(&self) -> Offer {
        Offer::new(
            Kind::Report,
            "everything",
            "the report and the scene, copied",
        )
    }
    fn write(&self, report: &ReportInput<'_>, _: &Call<'_>) -> Result<Vec<ReportFile>, Failure> {
        let scene = report.scene_json.unwrap_or(b"none").to_vec();
        Ok(vec![
            ReportFile {
                path: "a/report".into(),
                bytes: report.report_json.to_vec(),
            },
            ReportFile {
                path: "scene".into(),
                bytes: scene,
            },
        ])
    }
}

struct Panics;
impl Cor for Panics {
    fn offer(&self) -> Offer {
        Offer::new(Kind::Cor, "panics", "").takes(&[Shape::Points])
    }
    fn fit(&self, motion: &Motion<'_>, _: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        let nothing = &motion.points_m[..0];
        let center_m = nothing[motion.tracks];
        Ok(Answer::NotObservable(format!("{center_m:?}")))
    }
}

struct DescribesBadly;
impl Cor for DescribesBadly {
    fn offer(&self) -> Offer {
        panic!("a description that panics")
    }
    fn fit(&self, _: &Motion<'_>, _: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        Err(Failure::Cancelled)
    }
}

calib_plugin::entry! {
    good: name: "everything", version: "1.2.3", author: "the tests", licence: "MIT",
    cor: [Everything, Panics], aor: [Everything], reader: [Everything], report: [Everything],
}
calib_plugin::entry! {
    bad: name: "bad", version: "0", author: "", licence: "MIT", cor: [DescribesBadly],
}

static GOOD: calib_plugin::abi::Entry = good::ENTRY;
static BAD: calib_plugin::abi::Entry = bad::ENTRY;

fn plugin() -> LoadedPlugin {
    Host::adopt(&GOOD).unwrap()
}

fn none() -> BTreeMap<String, Value> {
    BTreeMap::new()
}

#[test]
fn the_text_of_an_offer_crosses_whole() {
    let plugin = plugin();
    let about = &plugin.description;
    assert_eq!(
        (about.name.as_str(), about.version.as_str(), about.abi),
        ("everything", "1.2.3", (1, 0))
    );
    assert_eq!(about.skipped, Vec::<String>::new());
    assert_eq!(about.offers[0], Cor::offer(&Everything));
    assert_eq!(about.offers[2], Aor::offer(&Everything));
    assert_eq!(about.offers[3], Reader::offer(&Everything));
    assert_eq!(about.offers[4], ReportWriter::offer(&Everything));
    assert_eq!(
        plugin.cor("nothing").unwrap_err().to_string(),
        "plugin `everything` offers no center estimator `nothing`; it offers `everything`, `panics`"
    );
}

#[test]
fn panics_stop_at_the_border() {
    let plugin = plugin();
    let bound = plugin.cor("panics").unwrap().with(&none()).unwrap();
    let error = bound.fit(&cubes().view(), &Control::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "plugin `everything`, center estimator `panics`: panicked: \
         index out of bounds: the len is 0 but the index is 2"
    );
    assert_eq!(error.exit_code(), 6);
    let reader = plugin.reader("everything").unwrap().with(&none()).unwrap();
    let error = reader
        .read(
            &Source {
                name: "f",
                bytes: b"panic",
            },
            &Control::default(),
        )
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "plugin `everything`, reader `everything`: panicked: a reader that panics"
    );
    assert_eq!(
        Host::adopt(&BAD).unwrap_err().to_string(),
        "plugin in the program: its description breaks the contract: calib_descriptor is null"
    );
}

#[test]
fn streams_and_files_cross_whole() {
    let plugin = plugin();
    let control = Control::default();
    let entry = plugin.reader("everything").unwrap();
    assert!(entry.recognizes(b"xyz") && !entry.recognizes(b"") && !entry.recognizes(b"yz"));
    let reader = entry.with(&none()).unwrap();
    let read = reader
        .read(
            &Source {
                name: "f",
                bytes: b"x",
            },
            &control,
        )
        .unwrap();
    assert_eq!(read, streams());
    let refused = reader
        .read(
            &Source {
                name: "größe.txt",
                bytes: b"",
            },
            &control,
        )
        .unwrap_err();
    assert_eq!(
        (refused.to_string().as_str(), refused.exit_code()),
        (
            "plugin `everything`, reader `everything`: größe.txt: line 1: empty",
            3
        )
    );

    let writer = plugin.report("everything").unwrap().with(&none()).unwrap();
    let files = writer.write(
        &ReportInput {
            report_json: b"{}",
            scene_json: Some(b"[]"),
        },
        &control,
    );
    let files: Vec<_> = files
        .unwrap()
        .into_iter()
        .map(|f| (f.path, f.bytes))
        .collect();
    assert_eq!(
        files,
        [
            ("a/report".into(), b"{}".to_vec()),
            ("scene".to_string(), b"[]".to_vec())
        ]
    );
    let none = writer
        .write(
            &ReportInput {
                report_json: b"{}",
                scene_json: None,
            },
            &control,
        )
        .unwrap();
    assert_eq!(none[1].bytes, b"none");
}

#[test]
fn progress_and_cancellation_cross() {
    let seen = std::sync::Mutex::new(Vec::new());
    let progress =
        |fraction: f64, text: &str| seen.lock().unwrap().push((fraction, text.to_string()));
    let control = Control {
        progress: Some(&progress),
        ..Control::default()
    };
    let bound = plugin().cor("everything").unwrap().with(&none()).unwrap();
    bound.fit(&cubes().view(), &control).unwrap();
    assert_eq!(*seen.lock().unwrap(), [(0.25, "a quarter".to_string())]);
}

fn any_motion() -> impl Strategy<Value = MotionData> {
    let point = || prop::option::weighted(0.8, prop::array::uniform3(-10.0..10.0_f64));
    let track = || prop::collection::vec(point(), 0..6);
    let points = prop::collection::vec(track(), 1..4).prop_map(|t| MotionData::points(&t));
    let pose = || {
        (point(), 0.0..6.0_f64).prop_map(|(t, angle)| {
            let (s, c) = angle.sin_cos();
            t.map(|translation_m| BodyPose {
                rotation: [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
                translation_m,
            })
        })
    };
    let poses = prop::collection::vec((pose(), pose()), 0..6).prop_map(|pairs| {
        let (a, b): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
        MotionData::two_bodies(&a, &b)
    });
    let extra = (
        prop::option::of(0.001..0.1_f64),
        prop::option::of(prop::array::uniform3(-1.0..1.0_f64)),
        any::<bool>(),
    );
    (prop_oneof![points, poses], extra, 0..1000_u64).prop_map(
        |(mut data, (sigma, center, angles), seed)| {
            (data.sigma_t_m, data.center_m, data.seed) = (sigma, center, seed);
            data.towards = center.map(|c| [c[1], c[2], c[0]]);
            let samples = data.view().samples;
            if angles {
                data.angles_rad = (0..samples).map(|i| 0.1 * i as f64).collect();
                data.covariances_m2 = vec![[[1e-6; 3]; 3]; data.view().seen.len()];
            }
            data
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(5), ..ProptestConfig::with_cases(200) })]

    /// A plugin and the same code as a built-in give the same bits, not only 10⁻¹².
    #[test]
    fn built_in_and_plugin_agree(data in any_motion(), gain in 0.0..1.0_f64, count in -9..9_i64, on: bool) {
        let given = BTreeMap::from([
            ("gain".to_string(), Value::Number(gain)),
            ("count".to_string(), Value::Integer(count)),
            ("on".to_string(), Value::Bool(on)),
        ]);
        let control = Control::default();
        let text = |answer: Result<String, calib_plugin::PluginError>| {
            answer.map_err(|e| e.to_string().replace("plugin `everything`, ", ""))
        };
        let loaded = plugin().cor("everything").unwrap().with(&given).unwrap();
        let built_in = Entry::built_in_cor(Everything).with(&given).unwrap();
        prop_assert_eq!(
            text(loaded.fit(&data.view(), &control).map(|a| format!("{a:?}"))),
            text(built_in.fit(&data.view(), &control).map(|a| format!("{a:?}")))
        );
        let loaded = plugin().aor("everything").unwrap().with(&given).unwrap();
        let built_in = Entry::built_in_aor(Everything).with(&given).unwrap();
        prop_assert_eq!(
            text(loaded.fit(&data.view(), &control).map(|a| format!("{a:?}"))),
            text(built_in.fit(&data.view(), &control).map(|a| format!("{a:?}")))
        );
    }
}

/// Nothing but the call itself.
struct Nothing;
impl Cor for Nothing {
    fn offer(&self) -> Offer {
        Offer::new(Kind::Cor, "nothing", "")
            .takes(&[Shape::Points])
            .with(Parameter::number("gain", 1.0, ""))
    }
    fn fit(&self, motion: &Motion<'_>, _: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        Ok(Answer::Found(CorFit {
            center_m: motion.points_m[0],
            covariance_m2: None,
            body_points_m: Vec::new(),
            radii_m: Vec::new(),
            rms_m: 0.0,
            used: 1,
            rejected: Vec::new(),
            weak: None,
        }))
    }
}
calib_plugin::entry! {
    fast: name: "fast", version: "0", author: "", licence: "MIT", cor: [Nothing],
}
static FAST: calib_plugin::abi::Entry = fast::ENTRY;

#[test]
#[ignore = "a time: beside other work a call takes longer"]
fn the_border_costs_less_than_a_microsecond() {
    let control = Control::default();
    let plugin = Host::adopt(&FAST).unwrap();
    let loaded = plugin.cor("nothing").unwrap().with(&none()).unwrap();
    let built_in = Entry::built_in_cor(Nothing).with(&none()).unwrap();
    for samples in [8, 1000] {
        let track = (0..samples)
            .map(|i| Some([f64::from(i), 0.0, 0.0]))
            .collect();
        let data = MotionData::points(&[track]);
        let motion = data.view();
        // The quickest of many batches: what the machine does besides only makes batches slower.
        let quickest = |bound: &calib_plugin::Bound<dyn Cor>| -> Duration {
            let batch = || {
                let start = Instant::now();
                for _ in 0..200 {
                    std::hint::black_box(bound.fit(std::hint::black_box(&motion), &control))
                        .unwrap();
                }
                start.elapsed() / 200
            };
            (0..200).map(|_| batch()).min().unwrap()
        };
        let cost = quickest(&loaded).saturating_sub(quickest(&built_in));
        println!("border: {cost:?} a call of {samples} samples");
        assert!(cost < Duration::from_micros(1), "{cost:?}");
    }
}
