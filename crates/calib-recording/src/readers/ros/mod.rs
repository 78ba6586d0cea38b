//! ROS 2 bags, MCAP and SQLite, without ROS: joint states, transforms, poses and the usual motion-capture messages.
//!
//! Both containers are read here as far as bags need them (chunks compressed with LZ4 or Zstandard included), so that no
//! C library and no ROS is needed and every length is checked before memory is taken. Times are the messages' header
//! stamps; where a topic has none (stamp 0) the time of recording is taken, and said. Each topic (each child frame of
//! `/tf`) keeps its own instants.

mod cdr;
mod mcap;
mod messages;
mod sqlite;

use super::common::unique_names;
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{
    JointStream, JointUnit, MarkerSample, MarkerStream, Recording, Timeline, TorqueStream,
};
use calib_finding::{About, Fact, Finding, Subject, catalog};
use messages::Content;
use nalgebra::{Isometry3, Point3};
use std::collections::BTreeMap;

pub(super) const MCAP: Reader = Reader {
    id: "ros2_mcap",
    name: "ROS 2 bag (MCAP)",
    extensions: &["mcap"],
    detect: |head| head.starts_with(mcap::MAGIC),
    read: |input, _options: &ReadOptions| {
        let mut bag = Bag::default();
        mcap::messages(input, &mut |at, topic, kind, time, data| {
            bag.message(at, topic, kind, time, data)
        })?;
        bag.finish()
    },
};

pub(super) const SQLITE: Reader = Reader {
    id: "ros2_sqlite",
    name: "ROS 2 bag (SQLite)",
    extensions: &["db3"],
    detect: |head| head.starts_with(sqlite::MAGIC),
    read: |input, _options: &ReadOptions| {
        let mut bag = Bag::default();
        sqlite::messages(input, &mut |at, topic, kind, time, data| {
            bag.message(at, topic, kind, time, data)
        })?;
        bag.finish()
    },
};

/// What a container calls for each message: place in the file, topic, type, time of recording (ns), CDR bytes.
type Visit<'a> = dyn FnMut(u64, &str, &str, u64, &[u8]) -> Placed<()> + 'a;

/// A table may be this many times larger than its samples, as for long tables.
const MAX_SPARSITY: usize = 1000;
const ALWAYS_ALLOWED: usize = 1 << 20;

/// Streams that share their instants.
#[derive(Default)]
struct Group {
    topic: String,
    stamps: Vec<f64>,
    recorded: Vec<f64>,
    rows: Vec<u64>,
    joints: BTreeMap<String, Vec<Option<f64>>>,
    torques: BTreeMap<String, Vec<Option<f64>>>,
    bodies: BTreeMap<String, Vec<Option<Isometry3<f64>>>>,
    markers: BTreeMap<String, Vec<Option<Point3<f64>>>>,
}

#[derive(Default)]
struct Bag {
    groups: BTreeMap<String, Group>,
    ignored: BTreeMap<String, String>,
    count: u64,
    samples: usize,
    dense: usize,
    /// Body → rows whose quaternion is no rotation.
    broken: BTreeMap<String, Vec<u64>>,
}

impl Bag {
    fn message(
        &mut self,
        at: u64,
        topic: &str,
        kind: &str,
        recorded: u64,
        data: &[u8],
    ) -> Placed<()> {
        let row = self.count;
        self.count += 1;
        let Some(content) = messages::decode(at, topic, kind, data)? else {
            self.ignored
                .entry(topic.to_string())
                .or_insert_with(|| kind.to_string());
            return Ok(());
        };
        let recorded = recorded as f64 * 1e-9;
        for Content {
            group,
            stamp,
            joints,
            torques,
            bodies,
            markers,
        } in content
        {
            let group = self.groups.entry(group).or_insert_with(|| Group {
                topic: topic.to_string(),
                ..Group::default()
            });
            push(&mut group.stamps, stamp);
            push(&mut group.recorded, recorded);
            push(&mut group.rows, row);
            let n = group.rows.len();
            let given = joints.len() + torques.len() + bodies.len() + markers.len();
            let mut padded = given;
            joints
                .into_iter()
                .for_each(|(name, q)| padded += put(&mut group.joints, name, n, q));
            torques
                .into_iter()
                .for_each(|(name, q)| padded += put(&mut group.torques, name, n, q));
            markers
                .into_iter()
                .for_each(|(name, p)| padded += put(&mut group.markers, name, n, p));
            for (name, pose) in bodies {
                if pose.is_err() {
                    self.broken.entry(name.clone()).or_default().push(row);
                }
                padded += put(&mut group.bodies, name, n, pose.ok().flatten());
            }
            self.samples += given;
            self.dense += padded;
            self.not_too_sparse(at)?;
        }
        Ok(())
    }

    fn not_too_sparse(&self, at: u64) -> Placed<()> {
        if self.dense <= ALWAYS_ALLOWED + MAX_SPARSITY * self.samples {
            return Ok(());
        }
        let entities = self
            .groups
            .values()
            .map(|g| g.joints.len() + g.torques.len() + g.bodies.len() + g.markers.len())
            .sum();
        let frames = self
            .groups
            .values()
            .map(|g| g.rows.len())
            .max()
            .unwrap_or(0);
        Err((
            At::Byte(at),
            Problem::TooSparse {
                entities,
                frames,
                samples: self.samples,
            },
        ))
    }

    fn finish(mut self) -> Placed<Recording> {
        let padding: usize = self.groups.values().map(Group::missing).sum();
        self.dense += padding;
        self.not_too_sparse(0)?;
        let mut recording = Recording::default();
        for mut group in std::mem::take(&mut self.groups).into_values() {
            group.complete();
            group.into_streams(&mut recording);
        }
        let meta = &mut recording.meta;
        for (name, rows) in self.broken {
            meta.findings.push(
                Finding::of_kind(catalog::NOT_UNIT_ROTATION, "lost", Subject::body(name))
                    .with("count", Fact::count(rows.len()))
                    .at_rows(rows),
            );
        }
        if !self.ignored.is_empty() {
            let topics: Vec<String> = self
                .ignored
                .iter()
                .map(|(topic, kind)| format!("{topic} ({kind})"))
                .collect();
            if recording.timelines.is_empty() {
                let what = format!(
                    "a bag of {}",
                    crate::error::excerpt(&topics.join(", "), 300)
                );
                let remedy =
                    "record joint states and tf, poses or motion-capture messages".to_string();
                return Err((At::File, Problem::Unsupported { what, remedy }));
            }
            meta.conversions
                .push(format!("topics not read: {}", topics.join(", ")));
        }
        if recording.timelines.is_empty() {
            return Err((At::File, Problem::NoRows));
        }
        if !recording.joints.is_empty() {
            meta.conversions.push("joint positions are rad for revolute and m for prismatic joints: the bag does not say which".to_string());
        }
        let names = unique_names(
            recording.bodies.iter().map(|b| b.name.clone()).collect(),
            About::Body,
            &mut meta.findings,
        );
        recording
            .bodies
            .iter_mut()
            .zip(names)
            .for_each(|(body, name)| body.name = name);
        let names = unique_names(
            recording.markers.iter().map(|m| m.name.clone()).collect(),
            About::Marker,
            &mut meta.findings,
        );
        recording
            .markers
            .iter_mut()
            .zip(names)
            .for_each(|(marker, name)| marker.name = name);
        let names = unique_names(
            recording.joints.iter().map(|j| j.name.clone()).collect(),
            About::Joint,
            &mut meta.findings,
        );
        recording
            .joints
            .iter_mut()
            .zip(names)
            .for_each(|(joint, name)| joint.name = name);
        Ok(recording)
    }
}

/// Sets the value of the newest sample (`n` samples in all); how many lost ones had to be put before it.
fn put<T: Clone>(
    streams: &mut BTreeMap<String, Vec<Option<T>>>,
    name: String,
    n: usize,
    value: Option<T>,
) -> usize {
    let stream = streams.entry(name).or_default();
    let padded = (n - 1).saturating_sub(stream.len());
    stream.resize(n - 1, None);
    push(stream, value);
    padded
}

impl Group {
    fn lengths(&self) -> impl Iterator<Item = usize> + '_ {
        let scalars = self
            .joints
            .values()
            .chain(self.torques.values())
            .map(Vec::len);
        scalars
            .chain(self.bodies.values().map(Vec::len))
            .chain(self.markers.values().map(Vec::len))
    }

    fn missing(&self) -> usize {
        self.lengths().map(|length| self.rows.len() - length).sum()
    }

    fn complete(&mut self) {
        let n = self.rows.len();
        self.joints
            .values_mut()
            .chain(self.torques.values_mut())
            .for_each(|stream| stream.resize(n, None));
        self.bodies
            .values_mut()
            .for_each(|stream| stream.resize(n, None));
        self.markers
            .values_mut()
            .for_each(|stream| stream.resize(n, None));
    }

    fn into_streams(self, out: &mut Recording) {
        let stamped = self.stamps.iter().all(|&stamp| stamp > 0.0);
        let (times, clock) = if stamped {
            (self.stamps, format!("header stamps of {}", self.topic))
        } else {
            out.meta.conversions.push(format!(
                "{}: no header stamps, time of recording taken",
                self.topic
            ));
            (self.recorded, "bag recorder".to_string())
        };
        // Messages arrive in another order than they were stamped, now and then.
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        let moved: Vec<u64> = (0..order.len())
            .filter(|&i| order[i] != i)
            .map(|i| self.rows[i])
            .collect();
        if !moved.is_empty() {
            out.meta.findings.push(
                Finding::of_kind(
                    catalog::ROWS_OUT_OF_ORDER,
                    "sorted",
                    Subject::column(&self.topic),
                )
                .with("count", Fact::count(moved.len()))
                .at_rows(moved),
            );
        }
        /// What is in order already is not copied.
        fn sorted<T: Clone>(values: Vec<T>, order: &[usize]) -> Vec<T> {
            if order.iter().enumerate().all(|(i, &from)| i == from) {
                return values;
            }
            order
                .iter()
                .filter_map(|&i| values.get(i).cloned())
                .collect()
        }
        let timeline = out.timelines.len();
        out.timelines.push(Timeline {
            clock,
            rows: sorted(self.rows, &order),
            t: Some(sorted(times, &order)),
            ..Timeline::default()
        });
        for (name, q) in self.joints {
            out.joints.push(JointStream {
                name,
                timeline,
                unit: JointUnit::Angle,
                q: sorted(q, &order),
            });
        }
        for (name, torque) in self.torques {
            out.torques.push(TorqueStream {
                name,
                timeline,
                torque: sorted(torque, &order),
            });
        }
        for (name, track) in self.bodies {
            let mut stream = super::common::body_stream(&name);
            stream.timeline = timeline;
            stream.tracker_from_body = sorted(track, &order);
            out.bodies.push(stream);
        }
        for (name, points) in self.markers {
            let samples = sorted(points, &order)
                .into_iter()
                .map(|p| p.map_or(MarkerSample::Lost, MarkerSample::Measured));
            out.markers.push(MarkerStream {
                name,
                body: None,
                unlabeled: false,
                timeline,
                samples: samples.collect(),
            });
        }
    }
}

/// Reads exactly `length` bytes, growing as they come.
fn read_exactly(input: &mut dyn Input, at: u64, length: u64, what: &str) -> Placed<Vec<u8>> {
    use std::io::Read;
    let mut bytes = Vec::new();
    let read = input
        .take(length)
        .read_to_end(&mut bytes)
        .map_err(|source| (At::Byte(at), Problem::Io(source)))? as u64;
    if read < length {
        return Err((
            At::Byte(at + read),
            Problem::Truncated {
                what: what.to_string(),
                needed: length - read,
            },
        ));
    }
    Ok(bytes)
}
