//! A loaded reader: takes streams one by one and refuses the first that breaks the contract.

use std::{
    ffi::{CString, c_char, c_void},
    panic::{AssertUnwindSafe, catch_unwind},
};

use super::{
    call::{Got, across},
    raw::{array, text},
};
use crate::{
    abi,
    answer::Failure,
    call::Call,
    kinds::Reader,
    motion::BodyPose,
    offer::Offer,
    streams::{
        BodyTrack, JointTrack, JointUnit, MarkerSample, MarkerTrack, Source, Streams, Timeline,
        TorqueTrack,
    },
};

/// `read` of the table.
pub(super) type Read = unsafe extern "C" fn(
    *const abi::Call,
    *const abi::Source,
    *const abi::RecordingSink,
) -> abi::Status;

pub(super) struct LoadedReader {
    pub offer: Offer,
    pub read: Read,
    pub recognizes: Option<unsafe extern "C" fn(*const u8, usize) -> i32>,
}

/// The streams so far, or what was wrong with the first bad one.
#[derive(Default)]
struct Intake {
    streams: Streams,
    broken: Option<String>,
}

impl Reader for LoadedReader {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn recognizes(&self, head: &[u8]) -> bool {
        let head = &head[..head.len().min(4096)];
        // SAFETY: the bytes are alive until the function returns.
        self.recognizes
            .is_some_and(|ask| unsafe { ask(head.as_ptr(), head.len()) } != 0)
    }

    fn read(&self, source: &Source<'_>, call: &Call<'_>) -> Result<Streams, Failure> {
        let name = CString::new(source.name.replace('\0', " ")).unwrap_or_default();
        let raw = abi::Source {
            struct_size: abi::size::<abi::Source>(),
            reserved: 0,
            name: name.as_ptr(),
            bytes: source.bytes.as_ptr(),
            size: source.bytes.len(),
        };
        let mut intake = Intake::default();
        let sink = abi::RecordingSink {
            struct_size: abi::size::<abi::RecordingSink>(),
            reserved: 0,
            context: (&raw mut intake).cast(),
            timeline: Some(timeline),
            label: Some(label),
            marker: Some(marker),
            body: Some(body),
            joint: Some(joint),
            torque: Some(torque),
            note: Some(note),
        };
        // SAFETY: all arguments are alive until the function returns.
        let ended = across(call, |call| unsafe {
            (self.read)(call, &raw const raw, &raw const sink)
        });
        let got = match intake.broken {
            Some(problem) => Got::Broken(problem),
            None => Got::One(intake.streams),
        };
        match ended.with(got)? {
            Ok((streams, _)) => Ok(streams),
            Err(_) => Err(Failure::Contract(
                "a reader cannot say `not observable`".into(),
            )),
        }
    }
}

/// Adds to the intake unless it is spoiled already.
///
/// # Safety
/// `context` is the one of `read`, used by this thread only.
unsafe fn add(
    context: *mut c_void,
    what: impl FnOnce(&mut Streams) -> Result<(), String>,
) -> abi::Status {
    // SAFETY: as the caller says.
    let Some(intake) = (unsafe { context.cast::<Intake>().as_mut() }) else {
        return abi::FAILED;
    };
    if intake.broken.is_some() {
        return abi::FAILED;
    }
    // Allocation of an absurd size panics; that must not unwind through the plugin.
    let done = catch_unwind(AssertUnwindSafe(|| what(&mut intake.streams)))
        .unwrap_or_else(|_| Err("a stream cannot be held in memory".into()));
    match done {
        Ok(()) => abi::OK,
        Err(problem) => {
            intake.broken = Some(problem);
            abi::FAILED
        }
    }
}

/// The length of a track against its timeline's.
fn fits(streams: &Streams, what: &str, timeline: usize, count: usize) -> Result<(), String> {
    let Some(known) = streams.timelines.get(timeline) else {
        return Err(format!(
            "{what} refers to timeline {timeline} of {}",
            streams.timelines.len()
        ));
    };
    if known.rows.len() == count {
        return Ok(());
    }
    Err(format!(
        "{what} has {count} samples, its timeline has {}",
        known.rows.len()
    ))
}

/// A name, once per kind of stream.
///
/// # Safety
/// `pointer` is null or a text that ends with zero.
unsafe fn name<'a>(
    what: &str,
    pointer: *const c_char,
    mut taken: impl Iterator<Item = &'a String>,
) -> Result<String, String> {
    // SAFETY: as the caller says.
    let name = unsafe { text(&format!("the name of a {what}"), pointer)? };
    if name.trim().is_empty() {
        return Err(format!("a {what} has no name"));
    }
    if taken.any(|other| *other == name) {
        return Err(format!("two {what}s are called `{name}`"));
    }
    Ok(name)
}

fn finite(what: &str, sample: usize, values: &[f64]) -> Result<(), String> {
    match values.iter().find(|v| !v.is_finite()) {
        None => Ok(()),
        Some(value) => Err(format!(
            "{what}, sample {sample}: {value} is marked as measured"
        )),
    }
}

fn mask(what: &str, sample: usize, mask: u8, largest: u8) -> Result<u8, String> {
    if mask <= largest {
        return Ok(mask);
    }
    Err(format!(
        "{what}, sample {sample}: mask is {mask}, at most {largest}"
    ))
}

// SAFETY, for all blocks below: the arguments of the contract, alive until the callback returns; lengths are compared
// with the timeline before anything is read.

unsafe extern "C" fn timeline(
    context: *mut c_void,
    clock: *const c_char,
    rows: *const u64,
    t_s: *const f64,
    count: usize,
    index: *mut usize,
) -> abi::Status {
    unsafe {
        add(context, |streams| {
            if index.is_null() {
                return Err("a timeline without a place for its index".into());
            }
            let rows = array("rows", rows, count)?.to_vec();
            let times = match t_s.is_null() {
                true => None,
                false => Some(array("t_s", t_s, count)?.to_vec()),
            };
            for (i, pair) in times.as_deref().unwrap_or(&[]).windows(2).enumerate() {
                if pair[0] > pair[1] {
                    return Err(format!(
                        "time goes from {} to {} at sample {}",
                        pair[0],
                        pair[1],
                        i + 1
                    ));
                }
            }
            if let Some(times) = &times {
                for (i, t) in times.iter().enumerate() {
                    finite("a time", i, &[*t])?;
                }
            }
            let clock = text("the clock of a timeline", clock)?;
            *index = streams.timelines.len();
            streams.timelines.push(Timeline {
                clock,
                rows,
                t_s: times,
                labels: Vec::new(),
            });
            Ok(())
        })
    }
}

unsafe extern "C" fn label(
    context: *mut c_void,
    timeline: usize,
    label: *const c_char,
    texts: *const *const c_char,
    count: usize,
) -> abi::Status {
    unsafe {
        add(context, |streams| {
            fits(streams, "a label", timeline, count)?;
            let labels = &streams.timelines[timeline].labels;
            let name = name("label", label, labels.iter().map(|(name, _)| name))?;
            let texts = array("texts", texts, count)?
                .iter()
                .map(|t| text(&format!("a text of label `{name}`"), *t))
                .collect::<Result<_, _>>()?;
            streams.timelines[timeline].labels.push((name, texts));
            Ok(())
        })
    }
}

unsafe extern "C" fn marker(
    context: *mut c_void,
    marker: *const c_char,
    timeline: usize,
    points_m: *const f64,
    masks: *const u8,
    count: usize,
) -> abi::Status {
    unsafe {
        add(context, |streams| {
            let name = name("marker", marker, streams.markers.iter().map(|m| &m.name))?;
            let what = format!("marker `{name}`");
            fits(streams, &what, timeline, count)?;
            let points: &[[f64; 3]] = array("points_m", points_m.cast(), count)?;
            let masks = array("mask", masks, count)?;
            let samples = (0..count)
                .map(|i| {
                    Ok(match mask(&what, i, masks[i], abi::FILLED)? {
                        abi::LOST => MarkerSample::Lost,
                        seen => {
                            finite(&what, i, &points[i])?;
                            if seen == abi::FILLED {
                                MarkerSample::Filled(points[i])
                            } else {
                                MarkerSample::Measured(points[i])
                            }
                        }
                    })
                })
                .collect::<Result<_, String>>()?;
            streams.markers.push(MarkerTrack {
                name,
                timeline,
                samples,
            });
            Ok(())
        })
    }
}

unsafe extern "C" fn body(
    context: *mut c_void,
    body: *const c_char,
    timeline: usize,
    rotations: *const f64,
    translations_m: *const f64,
    masks: *const u8,
    count: usize,
) -> abi::Status {
    unsafe {
        add(context, |streams| {
            let name = name("body", body, streams.bodies.iter().map(|b| &b.name))?;
            let what = format!("body `{name}`");
            fits(streams, &what, timeline, count)?;
            let rotations: &[[[f64; 3]; 3]] = array("rotations", rotations.cast(), count)?;
            let translations: &[[f64; 3]] = array("translations_m", translations_m.cast(), count)?;
            let masks = array("mask", masks, count)?;
            let samples = (0..count)
                .map(|i| {
                    if mask(&what, i, masks[i], abi::MEASURED)? == abi::LOST {
                        return Ok(None);
                    }
                    finite(&what, i, &translations[i])?;
                    crate::verify::rotation(&format!("{what}, sample {i}:"), &rotations[i])?;
                    Ok(Some(BodyPose {
                        rotation: rotations[i],
                        translation_m: translations[i],
                    }))
                })
                .collect::<Result<_, String>>()?;
            streams.bodies.push(BodyTrack {
                name,
                timeline,
                samples,
            });
            Ok(())
        })
    }
}

/// # Safety
/// `values` and `masks` are null or valid for `count` values.
unsafe fn numbers(
    what: &str,
    values: *const f64,
    masks: *const u8,
    count: usize,
) -> Result<Vec<Option<f64>>, String> {
    // SAFETY: as the caller says.
    let (values, masks) = unsafe {
        (
            array("values", values, count)?,
            array("mask", masks, count)?,
        )
    };
    (0..count)
        .map(|i| {
            if mask(what, i, masks[i], abi::MEASURED)? == abi::LOST {
                return Ok(None);
            }
            finite(what, i, &values[i..=i])?;
            Ok(Some(values[i]))
        })
        .collect()
}

unsafe extern "C" fn joint(
    context: *mut c_void,
    joint: *const c_char,
    timeline: usize,
    unit: i32,
    values: *const f64,
    masks: *const u8,
    count: usize,
) -> abi::Status {
    unsafe {
        add(context, |streams| {
            let name = name("joint", joint, streams.joints.iter().map(|j| &j.name))?;
            let what = format!("joint `{name}`");
            fits(streams, &what, timeline, count)?;
            let unit = match unit {
                abi::ANGLE => JointUnit::Angle,
                abi::LENGTH => JointUnit::Length,
                other => return Err(format!("{what} has unknown unit {other}")),
            };
            let samples = numbers(&what, values, masks, count)?;
            streams.joints.push(JointTrack {
                name,
                timeline,
                unit,
                samples,
            });
            Ok(())
        })
    }
}

unsafe extern "C" fn torque(
    context: *mut c_void,
    joint: *const c_char,
    timeline: usize,
    values: *const f64,
    masks: *const u8,
    count: usize,
) -> abi::Status {
    unsafe {
        add(context, |streams| {
            let name = name("torque", joint, streams.torques.iter().map(|t| &t.name))?;
            let what = format!("torque `{name}`");
            fits(streams, &what, timeline, count)?;
            let samples = numbers(&what, values, masks, count)?;
            streams.torques.push(TorqueTrack {
                name,
                timeline,
                samples,
            });
            Ok(())
        })
    }
}

unsafe extern "C" fn note(context: *mut c_void, note: *const c_char) -> abi::Status {
    unsafe {
        add(context, |streams| {
            let note = text("a note", note)?;
            streams.notes.push(note);
            Ok(())
        })
    }
}
