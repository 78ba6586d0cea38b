//! Small files in the form of each format, and what must be read from them.

use calib_recording::{Filled, MarkerSample, ReadOptions, Recording, RotationForm, read_bytes};
use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

pub fn read(name: &str, bytes: &[u8]) -> Recording {
    read_bytes(name, bytes, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

pub const NEXUS: &str = "\u{feff}Trajectories,,,,,,,\r\n100,,,,,,,\r\n,,Hand:A,,,Hand:B,,\r\nFrame,Sub Frame,X,Y,Z,X,Y,Z\r\n,,mm,mm,mm,mm,mm,mm\r\n11,0,1,2,3,4,5,6\r\n12,0,1.5,2,3,,,\r\n13,0\r\n,,,,,,,\r\nObjects\r\n100\r\n,,Global Angle Tool:Tool,,,,,\r\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\r\n,,rad,rad,rad,mm,mm,mm\r\n11,0,0,0,4.71238898038469,100,200,300\r\n12,0\r\n13,0,0.1,0.2,0.3,1,2,3\r\n";

pub const WORKSTATION: &str = "Title\nDate:\nTime:\nType:\nDescription:,\"\"\nNotes:,\"\"\n\nTRAJECTORIES\n100,Hz\n,LFHD,,,RFHD,,\nField #,X,Y,Z,X,Y,Z\n1,1,2,3,4,5,6\n2,,,,4,5,7\n";

pub fn motive() -> String {
    let header = "Format Version,1.23,Take Name,test,Take Notes,,Capture Frame Rate,100.000000,Export Frame Rate,100.000000,Capture Start Time,2023-11-28 10.27.58.765 DU.,Rotation Type,Quaternion,Length Units,Centimeters,Coordinate Space,Global";
    format!(
        "{header}\r\n\r\n,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body Marker,Rigid Body Marker,Rigid Body Marker,Marker,Marker,Marker\r\n\
         ,Name,Hand,Hand,Hand,Hand,Hand,Hand,Hand,Hand,Hand_1,Hand_1,Hand_1,Hand:Marker1,Hand:Marker1,Hand:Marker1\r\n\
         ,ID,\"A\",\"A\",\"A\",\"A\",\"A\",\"A\",\"A\",\"A\",\"B\",\"B\",\"B\",\"C\",\"C\",\"C\"\r\n\
         ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,Position,Position,Position,Position,Position\r\n\
         Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z,X,Y,Z\r\n\
         0,0.000000,0,0,0.6,0.8,10,20,30,0.001,1,2,3,1.1,2,3\r\n\
         1,0.010000,,,,,,,,,1,2,3,,,\r\n"
    )
}

pub const QTM_3D: &str = "NO_OF_FRAMES\t3\r\nNO_OF_CAMERAS\t8\r\nNO_OF_MARKERS\t2\r\nFREQUENCY\t50\r\nNO_OF_ANALOG\t0\r\nANALOG_FREQUENCY\t0\r\nDESCRIPTION\t--\r\nTIME_STAMP\t2026-01-19, 10:19:43.755\t2063631.96175450\r\nTIME_STAMP\t2026-01-19, 10:20:00.000\t1.5\r\nDATA_INCLUDED\t3D\r\nEVENT\tstart\t1\t0\r\nMARKER_NAMES\tNew 0000\tB\r\nTRAJECTORY_TYPES\tMeasured\tMixed\r\nFrame\tTime\tNew 0000 X\tNew 0000 Y\tNew 0000 Z\tB X\tB Y\tB Z\t\r\n1\t0.00000\t1\t2\t3\t4\t5\t6\r\n2\t0.02000\t0.000\t0.000\t0.000\t4\t5\t7\r\n3\t0.04000\tNULL\t\tNaN\t4\t5\t8\r\n";

pub fn qtm_6d() -> String {
    let r = Rotation3::from_euler_angles(0.1, -0.2, 0.3);
    let rot: Vec<String> = r.matrix().iter().map(|v| format!("{v:.6}")).collect();
    let row = |frame: u32| {
        format!(
            "{frame}\t{:.5}\t100.5\t-200\t300\t5.7\t-11.4\t17.1\t0.5\t{}\t\r\n",
            f64::from(frame - 1) / 100.0,
            rot.join("\t")
        )
    };
    format!(
        "NO_OF_FRAMES\t2\r\nNO_OF_CAMERAS\t8\r\nNO_OF_BODIES\t1\r\nFREQUENCY\t100\r\nDATA_INCLUDED\t6D\r\nBODY_NAMES\tHand body\r\nFrame\tTime\tHand body X\tY\tZ\tRoll\tPitch\tYaw\tResidual\tRot[0]\tRot[1]\tRot[2]\tRot[3]\tRot[4]\tRot[5]\tRot[6]\tRot[7]\tRot[8]\t\r\n{}2\t0.01{}\r\n",
        row(1),
        "\t".repeat(16)
    )
}

pub const DTRACK: &str = "fr 10\r\nts 86399.990000\r\n6dcal 2\r\n6d 2 [0 1.000][100.000 0.000 1200.000 0.0 20.0 0.0][0.939693 0.000000 -0.342020 0.000000 1.000000 0.000000 0.342020 0.000000 0.939693] [1 1.000][1 2 3 0 0 0][1 0 0 0 1 0 0 0 1]\r\n3d 1 [7 1.000][210.730 -90.669 -108.554]\r\ngl 0 \r\n\0fr 11\r\nts 0.010000\r\n6dcal 2\r\n6d 1 [1 1.000][1 2 4 0 0 0][1 0 0 0 1 0 0 0 1]\r\n6df2 1 1 [0 -1.000 8 3][0 0 0][0 0 0 0 0 0 0 0 0][0 0.00 0.00 0.00]\r\n6dmt2 1 1 [0 1.000 4 2.000][1 2 3][1 0 0 0 1 0 0 0 1][0][1e-3 0 0 1e-3 0 1e-3]\r\n\0fr 12\r\nts 0.020000\r\n\0";

pub const TRC: &str = "PathFileType\t4\t(X/Y/Z)\tx.trc\r\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\r\n100\t100\t7\t2\tmm \t100\t1\t2\r\nFrame#\tTime\tA\t\t\tB\t\t\r\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\r\n\r\n5\t-0.01\t1\t2\t3\t\t\t\r\n6\t0.00\t1\t2\t4\t4\t5\t6\r\n";

#[test]
fn nexus_sections_share_their_frames() {
    let recording = read("nexus.csv", NEXUS.as_bytes());
    assert_eq!(
        (recording.meta.format.as_str(), recording.timelines.len()),
        ("vicon_csv", 1)
    );
    assert_eq!(recording.timelines[0].rows, [11, 12, 13]);
    assert_eq!(
        recording.timelines[0].t.as_deref(),
        Some([0.1, 0.11, 0.12].as_slice())
    );
    let poses = recording.poses(Filled::Exclude).expect("one timeline");
    assert_eq!(
        poses.markers["Hand:A"],
        [
            Some(Point3::new(0.001, 0.002, 0.003)),
            Some(Point3::new(0.0015, 0.002, 0.003)),
            None
        ]
    );
    assert_eq!(poses.markers["Hand:B"][1], None);
    // 3π/2 about z, written unwrapped, is −π/2.
    let tool = poses.bodies["Tool"][0].expect("tracked");
    assert!(
        tool.rotation.angle_to(&UnitQuaternion::from_euler_angles(
            0.0,
            0.0,
            -std::f64::consts::FRAC_PI_2
        )) < 1e-12
    );
    assert!(poses.bodies["Tool"][1].is_none());
    let last = poses.bodies["Tool"][2].expect("tracked");
    assert!(
        last.rotation
            .angle_to(&UnitQuaternion::from_scaled_axis(Vector3::new(
                0.1, 0.2, 0.3
            )))
            < 1e-12
    );
}

#[test]
fn vicon_angles_can_be_declared() {
    let options = ReadOptions {
        rotation: Some(RotationForm::EulerXyz),
        ..ReadOptions::default()
    };
    let recording = read_bytes("nexus.csv", NEXUS.as_bytes(), &options).expect("readable");
    let last = recording.bodies[0].tracker_from_body[2].expect("tracked");
    let axis = UnitQuaternion::from_scaled_axis;
    let expected = axis(Vector3::x() * 0.1) * axis(Vector3::y() * 0.2) * axis(Vector3::z() * 0.3);
    assert!(last.rotation.angle_to(&expected) < 1e-12);
    let quaternion = NEXUS
        .replace("RX,RY,RZ,TX", "RX,RY,RZ,RW,TX")
        .replace("rad,rad,rad,", "rad,rad,rad,,")
        .replace("0,0,4.71238898038469,", "0,0,0.6,0.8,")
        .replace("0.1,0.2,0.3,", "1,0,0,0,");
    let recording = read("q.csv", quaternion.as_bytes());
    let first = recording.bodies[0].tracker_from_body[0].expect("tracked");
    assert!((first.rotation.coords - nalgebra::Vector4::new(0.0, 0.0, 0.6, 0.8)).norm() < 1e-12);
}

#[test]
fn the_old_workstation_form() {
    let recording = read("static.csv", WORKSTATION.as_bytes());
    assert_eq!(recording.meta.format, "vicon_csv");
    let poses = recording.poses(Filled::Exclude).expect("one timeline");
    assert_eq!(
        poses.markers["RFHD"][1],
        Some(Point3::new(0.004, 0.005, 0.007))
    );
    assert_eq!(poses.markers["LFHD"][1], None);
}

#[test]
fn motive_bodies_measured_and_computed_markers() {
    let recording = read("take.csv", motive().as_bytes());
    assert_eq!(recording.meta.format, "motive_csv");
    let hand = recording.bodies[0].tracker_from_body[0].expect("tracked");
    assert!((hand.translation.vector - Vector3::new(0.1, 0.2, 0.3)).norm() < 1e-15);
    assert!((hand.rotation.coords - nalgebra::Vector4::new(0.0, 0.0, 0.6, 0.8)).norm() < 1e-12);
    assert!(recording.bodies[0].tracker_from_body[1].is_none());
    assert_eq!(recording.bodies[0].quality, [Some(0.001), None]);
    // The computed marker is left out beside the measured one of its body, whether Motive names them alike or not.
    for text in [motive(), motive().replace("Hand_1", "Hand:Marker1")] {
        let recording = read("take.csv", text.as_bytes());
        let [measured] = recording.markers.as_slice() else {
            panic!("one marker: {:?}", recording.markers)
        };
        assert_eq!(measured.name, "Hand:Marker1");
        assert_eq!(measured.samples[1], MarkerSample::Lost);
        assert!(recording.meta.findings.is_empty());
    }
    // Without a measured one it is read as filled.
    let computed = motive().replace("Marker,Marker,Marker\r\n", "Camera,Camera,Camera\r\n");
    let computed = read("take.csv", computed.as_bytes());
    let computed = &computed.markers[0];
    assert!(matches!(computed.samples[1], MarkerSample::Filled(_)));
    assert_eq!(
        (computed.name.as_str(), computed.body.as_deref()),
        ("Hand_1", Some("Hand"))
    );
    let euler = motive().replace("Rotation Type,Quaternion", "Rotation Type,XYZ");
    let message = read_bytes("take.csv", euler.as_bytes(), &ReadOptions::default())
        .expect_err("Euler")
        .to_string();
    assert!(
        message.contains("export with Rotation Type Quaternion"),
        "{message}"
    );
    let headless = motive()
        .lines()
        .filter(|line| !line.starts_with("Frame"))
        .collect::<Vec<_>>()
        .join("\n");
    assert!(read_bytes("take.csv", headless.as_bytes(), &ReadOptions::default()).is_err());
}

#[test]
fn qualisys_3d_and_6d() {
    let recording = read("a.tsv", QTM_3D.as_bytes());
    assert_eq!(recording.meta.format, "qualisys_tsv");
    let names: Vec<_> = recording
        .markers
        .iter()
        .map(|m| (m.name.as_str(), m.lost()))
        .collect();
    assert_eq!(names, [("New 0000", 2), ("B", 0)]);
    assert!(
        recording.markers[1]
            .samples
            .iter()
            .all(|s| matches!(s, MarkerSample::Filled(_)))
    );
    assert!(
        recording
            .meta
            .findings
            .iter()
            .any(|f| f.id == calib_finding::catalog::ALL_ZERO_TRIPLET && f.rows == [2])
    );
    assert_eq!(
        recording.timelines[0].t.as_deref(),
        Some([0.0, 0.02, 0.04].as_slice())
    );

    let recording = read("b.tsv", qtm_6d().as_bytes());
    let track = &recording.bodies[0].tracker_from_body;
    let pose = track[0].expect("tracked");
    let expected = Rotation3::from_euler_angles(0.1, -0.2, 0.3);
    assert!(pose.rotation.to_rotation_matrix().angle_to(&expected) < 2e-6);
    assert!((pose.translation.vector - Vector3::new(0.1005, -0.2, 0.3)).norm() < 1e-12);
    assert!(track[1].is_none());
    assert_eq!(recording.bodies[0].quality[0], Some(0.5));
}

#[test]
fn a_mirrored_matrix_is_refused() {
    let mirrored = DTRACK.replace("[1 0 0 0 1 0 0 0 1]", "[1 0 0 0 1 0 0 0 -1]");
    let message = read_bytes("a.dtrack", mirrored.as_bytes(), &ReadOptions::default())
        .expect_err("mirrored")
        .to_string();
    assert!(
        message.starts_with(
            "a.dtrack:4: body `body_1`: the matrix is no rotation (determinant -1.0000"
        ),
        "{message}"
    );
}

#[test]
fn dtrack_absence_is_lost_and_midnight_goes_on() {
    let recording = read("a.dtrack", DTRACK.as_bytes());
    let lost: Vec<_> = recording
        .bodies
        .iter()
        .map(|b| {
            (
                b.name.as_str(),
                b.tracker_from_body
                    .iter()
                    .map(Option::is_some)
                    .collect::<Vec<_>>(),
            )
        })
        .collect();
    assert_eq!(
        lost,
        [
            ("body_0", vec![true, false, false]),
            ("body_1", vec![true, true, false]),
            ("flystick_0", vec![false, false, false]),
            ("tool_0", vec![false, true, false]),
        ]
    );
    let t = recording.timelines[0].t.as_ref().expect("timed");
    assert!((t[1] - t[0] - 0.02).abs() < 1e-9 && t[2] > t[1]);
    let pose = recording.bodies[0].tracker_from_body[0].expect("tracked");
    let expected = Matrix3::new(
        0.939693, 0.0, 0.34202, 0.0, 1.0, 0.0, -0.34202, 0.0, 0.939693,
    );
    assert!(
        (pose.rotation.to_rotation_matrix().matrix() - expected)
            .abs()
            .max()
            < 1e-6
    );
    let markers = |text: &str| -> Vec<(String, Vec<bool>)> {
        let seen = |sample: &MarkerSample| matches!(sample, MarkerSample::Measured(_));
        let recording = read("a.dtrack", text.as_bytes());
        let of = |m: &calib_recording::MarkerStream| {
            (m.name.clone(), m.samples.iter().map(seen).collect())
        };
        recording.markers.iter().map(of).collect()
    };
    let frame = |ids: &[u32]| {
        let points: String = ids
            .iter()
            .map(|id| format!(" [{id} 1.000][{id} 2 3]"))
            .collect();
        format!("3d {}{points}\n", ids.len())
    };
    let log = |frames: &[&[u32]]| -> String {
        let frames = frames.iter().enumerate();
        frames
            .map(|(i, ids)| format!("fr {}\nts {i}\n{}", i + 1, frame(ids)))
            .collect()
    };
    // No point is read twice: the only marker, by whatever numbers, is one; of two both have theirs, also where one is hidden.
    assert_eq!(
        markers(&log(&[&[1], &[1], &[4]])),
        [("marker".to_owned(), vec![true; 3])]
    );
    assert_eq!(
        markers(&log(&[&[1, 2], &[1], &[1, 2]])),
        [
            ("marker_1".to_owned(), vec![true; 3]),
            ("marker_2".to_owned(), vec![true, false, true])
        ]
    );
    // A reflection in one of ten frames.
    let mut with_one: Vec<&[u32]> = vec![&[1]; 10];
    with_one[4] = &[1, 9];
    let found = markers(&log(&with_one));
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["marker_1", "marker_9", "marker"]);
    let twice = (0..10).filter(|i| found[0].1[*i] && found[2].1[*i]).count();
    assert_eq!(twice, 0);
}

#[test]
fn trc_with_tabs_and_with_commas() {
    for text in [TRC.to_string(), TRC.replace('\t', ",")] {
        let recording = read("a.trc", text.as_bytes());
        assert_eq!(recording.timelines[0].rows, [5, 6]);
        assert_eq!(
            recording
                .markers
                .iter()
                .map(calib_recording::MarkerStream::lost)
                .collect::<Vec<_>>(),
            [0, 1]
        );
        assert_eq!(
            recording.markers[0].samples[1],
            MarkerSample::Measured(Point3::new(0.001, 0.002, 0.004))
        );
        assert!(
            recording
                .meta
                .findings
                .iter()
                .any(|f| f.id == calib_finding::catalog::FRAME_COUNT_DIFFERS)
        );
    }
}

/// How a C3D file is encoded.
#[derive(Clone, Copy, Debug)]
pub struct Encoding {
    pub processor: u8,
    pub float: bool,
}

pub const ENCODINGS: [Encoding; 6] = [
    Encoding {
        processor: 84,
        float: false,
    },
    Encoding {
        processor: 84,
        float: true,
    },
    Encoding {
        processor: 85,
        float: false,
    },
    Encoding {
        processor: 85,
        float: true,
    },
    Encoding {
        processor: 86,
        float: false,
    },
    Encoding {
        processor: 86,
        float: true,
    },
];

impl Encoding {
    fn u16(self, value: u16) -> [u8; 2] {
        if self.processor == 86 {
            value.to_be_bytes()
        } else {
            value.to_le_bytes()
        }
    }

    fn f32(self, value: f32) -> [u8; 4] {
        match self.processor {
            84 => value.to_le_bytes(),
            86 => value.to_be_bytes(),
            _ => {
                let [a, b, c, d] = if value == 0.0 {
                    [0; 4]
                } else {
                    (value * 4.0).to_be_bytes()
                };
                [b, a, d, c]
            }
        }
    }
}

/// A C3D file: points[frame][marker] in 0.5 mm steps, `w` as given, one analog value per frame.
pub fn c3d(encoding: Encoding, labels: &[&str], points: &[Vec<([i16; 3], i16)>]) -> Vec<u8> {
    let scale = if encoding.float { -0.5f32 } else { 0.5 };
    let mut header = vec![0u8; 512];
    header[0] = 2;
    header[1] = 0x50;
    let count = labels.len() as u16;
    for (word, value) in [
        (2, count),
        (3, 1),
        (4, 3),
        (5, 2 + points.len() as u16),
        (9, 3),
        (10, 1),
    ] {
        header[2 * word - 2..2 * word].copy_from_slice(&encoding.u16(value));
    }
    header[12..16].copy_from_slice(&encoding.f32(scale));
    header[20..24].copy_from_slice(&encoding.f32(50.0));

    let mut parameters = vec![1, 0x50, 1, encoding.processor];
    let mut add = |id: i8, name: &str, body: &[u8], last: bool| {
        parameters.push(name.len() as u8);
        parameters.push(id as u8);
        parameters.extend(name.bytes());
        let link = if last { 0 } else { 2 + body.len() as u16 };
        parameters.extend(encoding.u16(link));
        parameters.extend(body);
    };
    let texts = |texts: &[&str]| {
        let width = texts.iter().map(|t| t.len()).max().unwrap_or(0);
        let mut body = vec![0xff, 2, width as u8, texts.len() as u8];
        texts
            .iter()
            .for_each(|t| body.extend(format!("{t:width$}").bytes()));
        body.push(0);
        body
    };
    let word = |value: u16| [&[2u8, 0], encoding.u16(value).as_slice(), &[0]].concat();
    let float = |value: f32| [&[4u8, 0], encoding.f32(value).as_slice(), &[0]].concat();
    add(-1, "POINT", &[0], false);
    add(1, "USED", &word(count), false);
    add(1, "SCALE", &float(scale), false);
    add(1, "RATE", &float(50.0), false);
    add(1, "UNITS", &texts(&["mm"]), false);
    add(1, "Y_SCREEN", &texts(&["+Z"]), false);
    add(1, "LABELS", &texts(labels), true);
    parameters.resize(512, 0);

    let mut data = Vec::new();
    for frame in points {
        for (xyz, w) in frame {
            for &value in xyz {
                if encoding.float {
                    data.extend(encoding.f32(f32::from(value) * 0.5))
                } else {
                    data.extend(encoding.u16(value as u16))
                }
            }
            if encoding.float {
                data.extend(encoding.f32(f32::from(*w)))
            } else {
                data.extend(encoding.u16(*w as u16))
            }
        }
        if encoding.float {
            data.extend(encoding.f32(1.5))
        } else {
            data.extend(encoding.u16(7))
        }
    }
    data.resize(data.len().div_ceil(512) * 512, 0);
    [header, parameters, data].concat()
}

pub fn small_c3d(encoding: Encoding) -> Vec<u8> {
    let frames = vec![
        vec![([100, -200, 300], 0x0203), ([0, 0, 0], -1)],
        vec![([101, -201, 301], 0x0100), ([7, 8, 9], 0x0001)],
    ];
    c3d(encoding, &["LEFT", "R2"], &frames)
}

#[test]
fn all_six_c3d_encodings_say_the_same() {
    for encoding in ENCODINGS {
        let recording = read("a.c3d", &small_c3d(encoding));
        assert_eq!(recording.meta.format, "c3d", "{encoding:?}");
        assert_eq!(recording.meta.up_axis.as_deref(), Some("+Z"));
        assert_eq!(recording.timelines[0].rows, [3, 4]);
        assert_eq!(
            recording.timelines[0].t.as_deref(),
            Some([0.04, 0.06].as_slice())
        );
        let [left, right] = recording.markers.as_slice() else {
            panic!("{encoding:?}: two markers")
        };
        assert_eq!((left.name.as_str(), right.name.as_str()), ("LEFT", "R2"));
        assert_eq!(
            left.samples[0],
            MarkerSample::Measured(Point3::new(0.05, -0.1, 0.15)),
            "{encoding:?}"
        );
        assert_eq!(
            left.samples[1],
            MarkerSample::Filled(Point3::new(0.0505, -0.1005, 0.1505)),
            "{encoding:?}"
        );
        assert_eq!(right.samples[0], MarkerSample::Lost, "{encoding:?}");
    }
}

#[test]
fn a_c3d_without_residuals_is_measured() {
    let frames = vec![vec![([1, 2, 3], 0)], vec![([4, 5, 6], -1)]];
    let recording = read("a.c3d", &c3d(ENCODINGS[1], &["A"], &frames));
    assert!(matches!(
        recording.markers[0].samples[0],
        MarkerSample::Measured(_)
    ));
    assert_eq!(recording.markers[0].lost(), 1);
}

#[test]
fn a_c3d_that_ends_early_says_how_much_is_missing() {
    let whole = small_c3d(ENCODINGS[0]);
    let message = |bytes: &[u8]| {
        read_bytes("a.c3d", bytes, &ReadOptions::default())
            .expect_err("short")
            .to_string()
    };
    assert!(
        message(&whole[..300]).starts_with("a.c3d: byte 300: the file ends here: 212 more bytes"),
        "{}",
        message(&whole[..300])
    );
    let cut = 1024 + 18;
    assert!(
        message(&whole[..cut]).contains("18 more bytes are needed for 2 frames of 2 points"),
        "{}",
        message(&whole[..cut])
    );
    let mut wrong_endian = whole.clone();
    wrong_endian[512 + 3] = 86;
    assert!(read_bytes("a.c3d", &wrong_endian, &ReadOptions::default()).is_err());
}
