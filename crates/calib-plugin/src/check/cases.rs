//! Inputs for each kind, and what must come of them.

use super::{
    effects,
    labels::reserved_label,
    motions::{self, CENTER, DIRECTION, POINT},
    subject::{Input, Reply, Subject, text},
};
use crate::{
    answer::{Answer, AorFit, CorFit},
    motion::{MotionData, Shape},
    offer::Kind,
    streams::Streams,
};

/// Distance from the truth without noise: room for iterative methods, none for wrong ones.
const GOLDEN_M: f64 = 1e-6;
/// A report with every key that machines read.
const REPORT: &[u8] = include_bytes!("report.json");
/// Seed of the changed bytes.
const SEED: u64 = 20_260_101;

type Judge = Box<dyn Fn(&Reply) -> Result<(), String> + Send + Sync>;

pub(super) struct Case {
    pub name: String,
    pub input: Input,
    pub judge: Judge,
}

pub(super) struct Cases {
    pub golden: Vec<Case>,
    pub degenerate: Vec<Case>,
    pub huge: Input,
}

impl Cases {
    pub(super) fn of(subject: &Subject, huge: usize) -> Self {
        match subject.offer.kind {
            Kind::Cor => Self::motions(&subject.offer.shapes, huge, false),
            Kind::Aor => Self::motions(&subject.offer.shapes, huge, true),
            Kind::Reader => Self::reader(&subject.offer.example, huge),
            Kind::Report => Self::report(huge),
            Kind::Effect => Self::effect(huge),
        }
    }

    fn motions(shapes: &[Shape], huge: usize, axis: bool) -> Self {
        let mut out = Self {
            golden: Vec::new(),
            degenerate: Vec::new(),
            huge: Input::Motion(Box::new(MotionData::points(&[]))),
        };
        let moving = |shape: Shape, samples: usize| {
            if axis {
                let mut data = motions::seen(shape, &POINT, &motions::hinge(samples));
                data.angles_rad = motions::angles(samples);
                data
            } else {
                motions::seen(shape, &CENTER, &motions::ball(samples))
            }
        };
        for shape in shapes {
            let name = |what: &str| format!("{}, {what}", shape.word());
            let push = |list: &mut Vec<Case>, what: &str, data: MotionData, judge: Judge| {
                list.push(Case {
                    name: name(what),
                    input: Input::Motion(Box::new(data)),
                    judge,
                });
            };
            push(
                &mut out.golden,
                "36 samples",
                moving(*shape, 36),
                Box::new(near),
            );
            push(
                &mut out.golden,
                "100 samples",
                moving(*shape, 100),
                Box::new(near),
            );
            for (what, data) in [
                ("no sample", motions::lost(*shape, 0)),
                ("all lost", motions::lost(*shape, 20)),
                ("one sample", moving(*shape, 1)),
                ("no motion", {
                    let still = vec![[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]; 20];
                    motions::seen(*shape, &CENTER, &still)
                }),
            ] {
                push(&mut out.degenerate, what, data, Box::new(unanswered));
            }
            if !axis {
                let hinge = motions::seen(*shape, &POINT, &motions::hinge(40));
                push(
                    &mut out.degenerate,
                    "one axis only",
                    hinge,
                    Box::new(unanswered_or_weak),
                );
            }
        }
        if let Some(shape) = shapes.first() {
            let tracks = if shape.is_poses() { 1 } else { 3 };
            out.huge = Input::Motion(Box::new(moving(*shape, huge / tracks)));
        }
        out
    }

    fn reader(example: &[u8], huge: usize) -> Self {
        let bytes = |name: String, bytes: Vec<u8>| Case {
            name,
            input: Input::Bytes(bytes),
            judge: Box::new(|_| Ok(())),
        };
        let mut golden = Vec::new();
        let mut degenerate = vec![
            bytes("an empty file".into(), Vec::new()),
            bytes("zero bytes".into(), vec![0; 100]),
            bytes("one long line".into(), vec![b'1'; 100_000]),
        ];
        if !example.is_empty() {
            golden.push(Case {
                name: "the example".into(),
                input: Input::Bytes(example.to_vec()),
                judge: Box::new(|reply| match reply {
                    Reply::Streams(streams) if streams.is_empty() => Err("no stream".into()),
                    Reply::Streams(streams) => labels_are_texts(streams),
                    other => Err(text(other)),
                }),
            });
            let step = example.len().div_ceil(200);
            for size in (0..example.len()).step_by(step) {
                degenerate.push(bytes(
                    format!("the first {size} bytes"),
                    example[..size].to_vec(),
                ));
            }
            let mut state = SEED;
            for k in 0..200 {
                // Knuth's multiplicative congruence; the high bits are good enough to choose bytes.
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                let mut changed = example.to_vec();
                let place = (state >> 33) as usize % changed.len();
                changed[place] = (state >> 25) as u8;
                degenerate.push(bytes(format!("changed byte {place} (try {k})"), changed));
            }
        }
        // The last line again and again: what a table does, times that stand still included.
        let mut head = if example.is_empty() {
            b"1,2,3\n".to_vec()
        } else {
            example.to_vec()
        };
        let body = head.strip_suffix(b"\n").unwrap_or(&head);
        let last = body
            .iter()
            .rposition(|b| *b == b'\n')
            .map_or(0, |end| end + 1);
        let line = [&body[last..], b"\n"].concat();
        head.extend(
            line.iter()
                .copied()
                .cycle()
                .take((16 * huge).next_multiple_of(line.len())),
        );
        let huge = head;
        Self {
            golden,
            degenerate,
            huge: Input::Bytes(huge),
        }
    }

    /// A regressor is a function of one state: the same there and back.
    fn effect(huge: usize) -> Self {
        let there = effects::readings();
        let back: Vec<f64> = there.iter().rev().copied().collect();
        let golden = vec![Case {
            name: "the same states there and back".into(),
            input: Input::Readings([there, back].concat()),
            judge: Box::new(|reply| effects::mirrored(effects::regressors(reply)?)),
        }];
        let degenerate =
            [("no sample", Vec::new()), ("one sample", vec![0.3])].map(|(name, q)| Case {
                name: name.into(),
                input: Input::Readings(q),
                judge: Box::new(|reply| effects::regressors(reply).map(drop)),
            });
        let many = (0..huge).map(|k| 1e-5 * k as f64).collect();
        Self {
            golden,
            degenerate: degenerate.into(),
            huge: Input::Readings(many),
        }
    }

    fn report(huge: usize) -> Self {
        let golden = vec![Case {
            name: "a small report".into(),
            input: Input::Bytes(REPORT.to_vec()),
            judge: Box::new(|reply| match reply {
                Reply::Files(files) if files.iter().all(|f| f.bytes.is_empty()) => {
                    Err("all files are empty".into())
                }
                Reply::Files(_) => Ok(()),
                other => Err(text(other)),
            }),
        }];
        let degenerate = [
            ("nothing", &b""[..]),
            ("an empty object", b"{}"),
            ("half a report", &REPORT[..REPORT.len() / 2]),
            ("no text", &[0xff, 0xfe, 0x00]),
        ]
        .map(|(name, bytes)| Case {
            name: name.into(),
            input: Input::Bytes(bytes.to_vec()),
            judge: Box::new(|_| Ok(())),
        });
        // A report with very long notes is a valid one.
        let mut long = b"{\"calib\":1,\"reasons\":[\"".to_vec();
        long.resize(long.len() + 16 * huge, b'x');
        long.extend(b"\"]}");
        Self {
            golden,
            degenerate: degenerate.into(),
            huge: Input::Bytes(long),
        }
    }
}

/// Refuses labels that a table would read as something else.
fn labels_are_texts(streams: &Streams) -> Result<(), String> {
    let mut labels = streams.timelines.iter().flat_map(|t| &t.labels);
    let wrong = labels.find_map(|(name, _)| Some((name, reserved_label(name)?)));
    match wrong {
        None => Ok(()),
        Some((name, what)) => Err(format!(
            "the label `{name}` has a reserved name: tables take it for {what}; name it otherwise, as `trial`"
        )),
    }
}

/// The center that was found.
fn center(reply: &Reply) -> Option<&CorFit> {
    let Reply::Cor(answer) = reply else {
        return None;
    };
    if let Answer::Found(fit) = &**answer {
        Some(fit)
    } else {
        None
    }
}

/// The axis that was found.
fn axis(reply: &Reply) -> Option<&AorFit> {
    let Reply::Aor(answer) = reply else {
        return None;
    };
    if let Answer::Found(fit) = &**answer {
        Some(fit)
    } else {
        None
    }
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

fn near(reply: &Reply) -> Result<(), String> {
    let minus = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| a[i] - b[i]);
    let (what, missed) = if let Some(fit) = center(reply) {
        ("center", norm(minus(fit.center_m, CENTER)))
    } else if let Some(fit) = axis(reply) {
        // Distance of the point from the line, and the sine between the directions.
        let off = norm(cross(minus(fit.line.point_m, POINT), DIRECTION));
        ("axis", off.max(norm(cross(fit.line.direction, DIRECTION))))
    } else {
        return Err(text(reply));
    };
    if missed <= GOLDEN_M {
        return Ok(());
    }
    Err(format!(
        "the {what} is {missed:.1e} off, at most {GOLDEN_M:.0e}"
    ))
}

fn unanswered(reply: &Reply) -> Result<(), String> {
    if center(reply).is_some() || axis(reply).is_some() {
        return Err(text(reply));
    }
    Ok(())
}

fn unanswered_or_weak(reply: &Reply) -> Result<(), String> {
    if center(reply).is_some_and(|fit| fit.weak.is_some()) {
        return Ok(());
    }
    unanswered(reply)
}
