//! ROS 2 bags made here: messages in CDR, containers MCAP (plain, LZ4, Zstandard) and SQLite.

use crate::fixtures::read;
use calib_finding::{Subject, catalog};
use calib_recording::{ReadOptions, read_bytes};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::io::Write;

/// CDR, little endian.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn put(&mut self, bytes: &[u8]) -> &mut Self {
        self.0
            .resize(self.0.len().next_multiple_of(bytes.len().max(1)), 0);
        self.0.extend(bytes);
        self
    }

    fn u32(&mut self, value: u32) -> &mut Self {
        self.put(&value.to_le_bytes())
    }

    fn f64s(&mut self, values: &[f64]) -> &mut Self {
        values.iter().for_each(|v| {
            self.put(&v.to_le_bytes());
        });
        self
    }

    fn text(&mut self, text: &str) -> &mut Self {
        self.u32(text.len() as u32 + 1);
        self.0.extend(text.bytes());
        self.0.push(0);
        self
    }

    fn header(&mut self, seconds: u32) -> &mut Self {
        self.u32(seconds).u32(500_000_000).text("world")
    }

    fn message(&self) -> Vec<u8> {
        [&[0, 1, 0, 0], self.0.as_slice()].concat()
    }
}

struct Message {
    topic: &'static str,
    kind: &'static str,
    time: u64,
    data: Vec<u8>,
}

fn messages() -> Vec<Message> {
    let joint_state = |seconds: u32, q: f64| {
        let mut cdr = Cdr::default();
        cdr.header(seconds)
            .u32(2)
            .text("elbow")
            .text("wrist")
            .u32(2)
            .f64s(&[q, -q])
            .u32(0)
            .u32(2)
            .f64s(&[1.0, f64::NAN]);
        Message {
            topic: "/joint_states",
            kind: "sensor_msgs/msg/JointState",
            time: u64::from(seconds) * 1_000_000_000,
            data: cdr.message(),
        }
    };
    let tf = |seconds: u32, children: &[&str]| {
        let mut cdr = Cdr::default();
        cdr.u32(children.len() as u32);
        for child in children {
            cdr.header(seconds)
                .text(child)
                .f64s(&[1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8]);
        }
        Message {
            topic: "/tf",
            kind: "tf2_msgs/msg/TFMessage",
            time: 7,
            data: cdr.message(),
        }
    };
    let pose = |seconds: u32, q: [f64; 4]| {
        let mut cdr = Cdr::default();
        cdr.header(seconds).f64s(&[0.1, 0.2, 0.3]).f64s(&q);
        Message {
            topic: "/vrpn_client_node/hand/pose",
            kind: "geometry_msgs/msg/PoseStamped",
            time: 9_000_000_000 + u64::from(seconds),
            data: cdr.message(),
        }
    };
    let rigid = |seen: bool| {
        let mut cdr = Cdr::default();
        let x = if seen { 0.5 } else { f64::NAN };
        cdr.header(3).u32(77).u32(1).text("tool").u32(1);
        cdr.put(&[1]).u32(4).text("").f64s(&[x, x, x]);
        cdr.f64s(&[x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        Message {
            topic: "/rigid_bodies",
            kind: "mocap4r2_msgs/msg/RigidBodies",
            time: 5,
            data: cdr.message(),
        }
    };
    let named = {
        let mut cdr = Cdr::default();
        cdr.header(4)
            .u32(2)
            .text("a")
            .f64s(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
            .text("b")
            .f64s(&[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0]);
        Message {
            topic: "/poses",
            kind: "motion_capture_tracking_interfaces/msg/NamedPoseArray",
            time: 6,
            data: cdr.message(),
        }
    };
    let image = Message {
        topic: "/camera",
        kind: "sensor_msgs/msg/Image",
        time: 1,
        data: vec![0; 2000],
    };
    vec![
        joint_state(10, 0.5),
        tf(10, &["base", "hand"]),
        pose(0, [0.0, 0.0, 0.0, 1.0]),
        image,
        joint_state(12, 0.7),
        tf(11, &["hand"]),
        pose(0, [0.0; 4]),
        rigid(true),
        rigid(false),
        joint_state(11, 0.6),
        named,
    ]
}

pub fn mcap(compression: &str) -> Vec<u8> {
    let record = |kind: u8, content: &[u8]| {
        [
            &[kind],
            (content.len() as u64).to_le_bytes().as_slice(),
            content,
        ]
        .concat()
    };
    let text = |text: &str| {
        [
            (text.len() as u32).to_le_bytes().as_slice(),
            text.as_bytes(),
        ]
        .concat()
    };
    let mut records = Vec::new();
    let messages = messages();
    let mut topics: Vec<(&str, &str)> = messages.iter().map(|m| (m.topic, m.kind)).collect();
    topics.sort_unstable();
    topics.dedup();
    for (i, (topic, kind)) in topics.iter().enumerate() {
        let id = (i as u16 + 1).to_le_bytes();
        records.extend(record(
            3,
            &[
                &id,
                text(kind).as_slice(),
                &text("ros2msg"),
                &0u32.to_le_bytes(),
            ]
            .concat(),
        ));
        records.extend(record(
            4,
            &[
                &id,
                id.as_slice(),
                &text(topic),
                &text("cdr"),
                &0u32.to_le_bytes(),
            ]
            .concat(),
        ));
    }
    for message in &messages {
        let id = topics
            .iter()
            .position(|t| t.0 == message.topic)
            .expect("listed") as u16
            + 1;
        let time = message.time.to_le_bytes();
        records.extend(record(
            5,
            &[
                &id.to_le_bytes(),
                [0; 4].as_slice(),
                &time,
                &time,
                &message.data,
            ]
            .concat(),
        ));
    }
    let mut file = b"\x89MCAP0\r\n".to_vec();
    file.extend(record(1, &[text("ros2"), text("test")].concat()));
    if compression == "none" {
        file.extend(records);
    } else {
        let packed = match compression {
            "lz4" => {
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                encoder.write_all(&records).expect("in memory");
                encoder.finish().expect("in memory")
            }
            "zstd" => ruzstd::encoding::compress_to_vec(
                records.as_slice(),
                ruzstd::encoding::CompressionLevel::Fastest,
            ),
            _ => records.clone(),
        };
        let sizes = [0u64, 0, records.len() as u64]
            .map(u64::to_le_bytes)
            .concat();
        file.extend(record(
            6,
            &[
                sizes.as_slice(),
                &[0; 4],
                &text(compression),
                &(packed.len() as u64).to_le_bytes(),
                &packed,
            ]
            .concat(),
        ));
    }
    file.extend(record(15, &[0; 4]));
    file.extend(record(2, &[0; 20]));
    file.extend(b"\x89MCAP0\r\n");
    file
}

fn varint(value: u64) -> Vec<u8> {
    let mut bytes = vec![(value & 0x7f) as u8];
    let mut rest = value >> 7;
    while rest > 0 {
        bytes.insert(0, (rest & 0x7f) as u8 | 0x80);
        rest >>= 7;
    }
    bytes
}

enum Value<'a> {
    Null,
    Integer(i64),
    Text(&'a str),
    Blob(&'a [u8]),
}

fn sqlite_record(values: &[Value]) -> Vec<u8> {
    let (mut kinds, mut content) = (Vec::new(), Vec::new());
    for value in values {
        match value {
            Value::Null => kinds.extend(varint(0)),
            Value::Integer(0) => kinds.extend(varint(8)),
            Value::Integer(n) => {
                kinds.extend(varint(6));
                content.extend(n.to_be_bytes());
            }
            Value::Text(text) => {
                kinds.extend(varint(13 + 2 * text.len() as u64));
                content.extend(text.bytes());
            }
            Value::Blob(blob) => {
                kinds.extend(varint(12 + 2 * blob.len() as u64));
                content.extend(*blob);
            }
        }
    }
    [varint(kinds.len() as u64 + 1), kinds, content].concat()
}

const PAGE: usize = 512;

/// A leaf page of these records; what does not fit into it goes to overflow pages.
fn leaf(records: &[(u64, Vec<u8>)], start: usize, pages: &mut Vec<Vec<u8>>, own: usize) {
    let (mut end, mut pointers) = (PAGE, Vec::new());
    let mut page = vec![0u8; PAGE];
    for (rowid, record) in records {
        let mut cell = [varint(record.len() as u64), varint(*rowid)].concat();
        let (most, least) = (PAGE - 35, (PAGE - 12) * 32 / 255 - 23);
        if record.len() <= most {
            cell.extend(record);
        } else {
            let fitting = least + (record.len() - least) % (PAGE - 4);
            let local = if fitting <= most { fitting } else { least };
            cell.extend(&record[..local]);
            let chunks: Vec<&[u8]> = record[local..].chunks(PAGE - 4).collect();
            cell.extend((pages.len() as u32 + 1).to_be_bytes());
            for (i, chunk) in chunks.iter().enumerate() {
                let next = if i + 1 < chunks.len() {
                    pages.len() as u32 + 2
                } else {
                    0
                };
                let mut overflow = [&next.to_be_bytes(), *chunk].concat();
                overflow.resize(PAGE, 0);
                pages.push(overflow);
            }
        }
        end -= cell.len();
        page[end..end + cell.len()].copy_from_slice(&cell);
        pointers.push(end as u16);
    }
    page[start] = 0x0d;
    page[start + 3..start + 5].copy_from_slice(&(records.len() as u16).to_be_bytes());
    for (i, pointer) in pointers.iter().enumerate() {
        page[start + 8 + 2 * i..start + 10 + 2 * i].copy_from_slice(&pointer.to_be_bytes());
    }
    pages[own] = page;
}

/// A bag as SQLite: page 1 schema, 2 topics (interior over 4 and 5), 3 messages (interior, one leaf per message).
pub fn sqlite() -> Vec<u8> {
    let messages = messages();
    let mut topics: Vec<(&str, &str)> = messages.iter().map(|m| (m.topic, m.kind)).collect();
    topics.sort_unstable();
    topics.dedup();
    let mut pages = vec![vec![0u8; PAGE]; 5 + messages.len()];
    let schema = |name: &str, root: i64, sql: &str| {
        sqlite_record(&[
            Value::Text("table"),
            Value::Text(name),
            Value::Text(name),
            Value::Integer(root),
            Value::Text(sql),
        ])
    };
    let schemas = [
        (
            1,
            schema(
                "topics",
                2,
                "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT,type TEXT,serialization_format TEXT)",
            ),
        ),
        (
            2,
            schema(
                "messages",
                3,
                "CREATE TABLE messages(\n id INTEGER PRIMARY KEY,\n topic_id INTEGER,timestamp INTEGER,data BLOB)",
            ),
        ),
    ];
    leaf(&schemas, 100, &mut pages, 0);
    let topic_rows: Vec<(u64, Vec<u8>)> = topics
        .iter()
        .enumerate()
        .map(|(i, (name, kind))| {
            (
                i as u64 + 1,
                sqlite_record(&[
                    Value::Null,
                    Value::Text(name),
                    Value::Text(kind),
                    Value::Text("cdr"),
                ]),
            )
        })
        .collect();
    leaf(&topic_rows[..3], 0, &mut pages, 3);
    leaf(&topic_rows[3..], 0, &mut pages, 4);
    let interior = |children: &[usize]| {
        let mut page = vec![0u8; PAGE];
        let (last, others) = children.split_last().expect("a child");
        page[0] = 5;
        page[3..5].copy_from_slice(&(others.len() as u16).to_be_bytes());
        page[8..12].copy_from_slice(&(*last as u32 + 1).to_be_bytes());
        for (i, child) in others.iter().enumerate() {
            let at = PAGE - 5 * (i + 1);
            page[at..at + 4].copy_from_slice(&(*child as u32 + 1).to_be_bytes());
            page[at + 4] = i as u8;
            page[12 + 2 * i..14 + 2 * i].copy_from_slice(&(at as u16).to_be_bytes());
        }
        page
    };
    pages[1] = interior(&[3, 4]);
    for (i, message) in messages.iter().enumerate() {
        let topic = topics
            .iter()
            .position(|t| t.0 == message.topic)
            .expect("listed") as i64
            + 1;
        let row = sqlite_record(&[
            Value::Null,
            Value::Integer(topic),
            Value::Integer(message.time as i64),
            Value::Blob(&message.data),
        ]);
        leaf(&[(i as u64 + 1, row)], 0, &mut pages, 5 + i);
    }
    pages[2] = interior(&(5..5 + messages.len()).collect::<Vec<_>>());
    let mut header = b"SQLite format 3\0".to_vec();
    header.resize(100, 0);
    header[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
    header[59] = 1;
    pages[0][..100].copy_from_slice(&header);
    pages.concat()
}

#[test]
fn a_bag_is_read_from_every_container() {
    let reference = read("a.mcap", &mcap("none"));
    for (what, bytes) in [
        ("chunk", mcap("")),
        ("lz4", mcap("lz4")),
        ("zstd", mcap("zstd")),
        ("sqlite", sqlite()),
    ] {
        let other = read("a", &bytes);
        assert_eq!(other.timelines, reference.timelines, "{what}");
        assert_eq!(
            (&other.joints, &other.torques, &other.bodies, &other.markers),
            (
                &reference.joints,
                &reference.torques,
                &reference.bodies,
                &reference.markers
            ),
            "{what}"
        );
    }
    let stream = |name: &str| {
        reference
            .bodies
            .iter()
            .find(|b| b.name == name)
            .unwrap_or_else(|| panic!("{name}"))
    };
    // Joint states are sorted by their stamps.
    let elbow = reference
        .joints
        .iter()
        .find(|j| j.name == "elbow")
        .expect("read");
    assert_eq!(elbow.q, [Some(0.5), Some(0.6), Some(0.7)]);
    assert_eq!(
        reference.timelines[elbow.timeline].t.as_deref(),
        Some([10.5, 11.5, 12.5].as_slice())
    );
    assert_eq!(
        reference
            .torques
            .iter()
            .map(|t| t.torque[0])
            .collect::<Vec<_>>(),
        [Some(1.0), None]
    );
    // Each child of /tf has its own instants.
    assert_eq!(stream("base").tracker_from_body.len(), 1);
    let hand = stream("hand#2")
        .tracker_from_body
        .iter()
        .chain(&stream("hand").tracker_from_body)
        .flatten()
        .count();
    assert_eq!(hand, 3);
    let rotation = stream("base").tracker_from_body[0]
        .expect("tracked")
        .rotation;
    assert!(
        rotation.angle_to(&UnitQuaternion::from_scaled_axis(
            Vector3::z() * 2.0 * 0.6f64.asin()
        )) < 1e-12
    );
    // The lost pose is all zeros; the stamps are half a second, so they count.
    assert_eq!(
        stream("tool")
            .tracker_from_body
            .iter()
            .map(Option::is_some)
            .collect::<Vec<_>>(),
        [true, false]
    );
    let marker = reference
        .markers
        .iter()
        .find(|m| m.name == "tool:marker_4")
        .expect("read");
    assert_eq!(
        (marker.lost(), marker.samples[0]),
        (
            1,
            calib_recording::MarkerSample::Measured(Point3::new(0.5, 0.5, 0.5))
        )
    );
    assert!(
        reference
            .meta
            .findings
            .iter()
            .any(|f| f.id == catalog::NOT_UNIT_ROTATION && f.subject == Subject::body("b"))
    );
    assert!(
        reference
            .meta
            .conversions
            .iter()
            .any(|c| c.contains("/camera"))
    );
}

#[test]
fn bags_that_were_not_closed_or_lie_about_sizes() {
    let error = |bytes: &[u8]| {
        read_bytes("a.mcap", bytes, &ReadOptions::default())
            .expect_err("bad")
            .to_string()
    };
    let whole = mcap("none");
    assert!(
        error(&whole[..whole.len() - 60]).contains("the recording was not closed")
            || error(&whole[..whole.len() - 60]).contains("more bytes"),
        "{}",
        error(&whole[..whole.len() - 60])
    );
    let mut lies = mcap("zstd");
    let chunk = lies.windows(4).position(|w| w == b"zstd").expect("a chunk") - 4 - 4 - 8;
    lies[chunk..chunk + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(
        error(&lies).contains("that says it grows to"),
        "{}",
        error(&lies)
    );
    let mut looped = sqlite();
    // The interior page of the messages points to itself.
    looped[2 * PAGE + 8..2 * PAGE + 12].copy_from_slice(&3u32.to_be_bytes());
    assert!(
        error(&looped).starts_with("a.mcap: byte"),
        "{}",
        error(&looped)
    );
}
