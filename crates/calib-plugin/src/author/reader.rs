//! The border of a reader.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::border::{accepted, c_text, guarded, host_text, slice};
use crate::{
    abi,
    answer::Failure,
    kinds::Reader,
    offer::Offer,
    streams::{
        BodyTrack, JointTrack, JointUnit, MarkerSample, MarkerTrack, Source, Streams, Timeline,
        TorqueTrack,
    },
};

/// `read` of `calib_reader_1`.
///
/// # Safety
/// The pointers are the host's, as the contract says.
pub unsafe fn read(
    it: &dyn Reader,
    offer: fn() -> &'static Offer,
    call: *const abi::Call,
    source: *const abi::Source,
    sink: *const abi::RecordingSink,
) -> abi::Status {
    let body = |call: &crate::Call<'_>| {
        // SAFETY: the host's, valid until this function returns.
        let (Some(source), Some(sink)) = (unsafe { (source.as_ref(), sink.as_ref()) }) else {
            return Err(Failure::Failed("the host gave no source or no sink".into()));
        };
        // SAFETY: as above.
        let source = unsafe {
            Source {
                name: host_text(source.name)?,
                bytes: slice(source.bytes, source.size),
            }
        };
        let streams = it.read(&source, call)?;
        // SAFETY: as above; this is the thread of the call.
        unsafe { give(&streams, sink)? };
        Ok((abi::OK, None))
    };
    // SAFETY: the call is the host's.
    unsafe { guarded(offer, call, body) }
}

/// `recognizes` of `calib_reader_1`; a panic counts as no.
///
/// # Safety
/// `head` is null or valid for `size` bytes.
pub unsafe fn recognizes(it: &dyn Reader, head: *const u8, size: usize) -> i32 {
    // SAFETY: null or valid, as the caller says.
    let head = unsafe { slice(head, size) };
    catch_unwind(AssertUnwindSafe(|| it.recognizes(head))).map_or(0, i32::from)
}

/// Hands over all streams.
///
/// # Safety
/// The sink is the host's, and this is the thread of the call.
unsafe fn give(streams: &Streams, sink: &abi::RecordingSink) -> Result<(), Failure> {
    let mut indices = Vec::with_capacity(streams.timelines.len());
    // SAFETY, for all blocks: as the caller says.
    for timeline in &streams.timelines {
        indices.push(unsafe { give_timeline(timeline, sink)? });
    }
    let index = |timeline: usize| {
        indices
            .get(timeline)
            .copied()
            .ok_or_else(|| Failure::Failed(format!("there is no timeline {timeline}")))
    };
    for marker in &streams.markers {
        unsafe { give_marker(marker, index(marker.timeline)?, sink)? };
    }
    for body in &streams.bodies {
        unsafe { give_body(body, index(body.timeline)?, sink)? };
    }
    for joint in &streams.joints {
        unsafe { give_joint(joint, index(joint.timeline)?, sink)? };
    }
    for torque in &streams.torques {
        unsafe { give_torque(torque, index(torque.timeline)?, sink)? };
    }
    for note in &streams.notes {
        let text = c_text(note);
        accepted(
            sink.note
                .map(|add| unsafe { add(sink.context, text.as_ptr()) }),
        )?;
    }
    Ok(())
}

/// Hands over a timeline with its labels; the host's index of it.
///
/// # Safety
/// As [`give`].
unsafe fn give_timeline(timeline: &Timeline, sink: &abi::RecordingSink) -> Result<usize, Failure> {
    let (clock, mut index, count) = (c_text(&timeline.clock), 0, timeline.rows.len());
    if timeline.t_s.as_ref().is_some_and(|t| t.len() != count) {
        return Err(Failure::Failed(
            "a timeline has as many times as rows".into(),
        ));
    }
    let times = timeline.t_s.as_ref().map_or(std::ptr::null(), Vec::as_ptr);
    // SAFETY, for both callbacks: the contract's arguments, alive until the callback returns.
    accepted(sink.timeline.map(|add| unsafe {
        add(
            sink.context,
            clock.as_ptr(),
            timeline.rows.as_ptr(),
            times,
            count,
            &raw mut index,
        )
    }))?;
    for (name, texts) in &timeline.labels {
        let (name, texts) = (
            c_text(name),
            texts.iter().map(|t| c_text(t)).collect::<Vec<_>>(),
        );
        let pointers: Vec<_> = texts.iter().map(|t| t.as_ptr()).collect();
        accepted(sink.label.map(|add| unsafe {
            add(
                sink.context,
                index,
                name.as_ptr(),
                pointers.as_ptr(),
                pointers.len(),
            )
        }))?;
    }
    Ok(index)
}

/// Hands over a marker of the host's `timeline`.
///
/// # Safety
/// As [`give`].
unsafe fn give_marker(
    marker: &MarkerTrack,
    timeline: usize,
    sink: &abi::RecordingSink,
) -> Result<(), Failure> {
    let (points, mask): (Vec<[f64; 3]>, Vec<u8>) = marker
        .samples
        .iter()
        .map(|sample| match sample {
            MarkerSample::Lost => ([0.0; 3], abi::LOST),
            MarkerSample::Measured(point) => (*point, abi::MEASURED),
            MarkerSample::Filled(point) => (*point, abi::FILLED),
        })
        .unzip();
    let name = c_text(&marker.name);
    // SAFETY: the contract's arguments, alive until the callback returns.
    accepted(sink.marker.map(|add| unsafe {
        add(
            sink.context,
            name.as_ptr(),
            timeline,
            points.as_ptr().cast(),
            mask.as_ptr(),
            mask.len(),
        )
    }))
}

/// Hands over a body of the host's `timeline`.
///
/// # Safety
/// As [`give`].
unsafe fn give_body(
    body: &BodyTrack,
    timeline: usize,
    sink: &abi::RecordingSink,
) -> Result<(), Failure> {
    let mask: Vec<u8> = body.samples.iter().map(|s| u8::from(s.is_some())).collect();
    let (rotations, translations): (Vec<_>, Vec<_>) = body
        .samples
        .iter()
        .map(|s| s.map_or(([[0.0; 3]; 3], [0.0; 3]), |p| (p.rotation, p.translation_m)))
        .unzip();
    let name = c_text(&body.name);
    // SAFETY: the contract's arguments, alive until the callback returns.
    accepted(sink.body.map(|add| unsafe {
        add(
            sink.context,
            name.as_ptr(),
            timeline,
            rotations.as_ptr().cast(),
            translations.as_ptr().cast(),
            mask.as_ptr(),
            mask.len(),
        )
    }))
}

/// Hands over a joint of the host's `timeline`.
///
/// # Safety
/// As [`give`].
unsafe fn give_joint(
    joint: &JointTrack,
    timeline: usize,
    sink: &abi::RecordingSink,
) -> Result<(), Failure> {
    let (values, mask) = numbers(&joint.samples);
    let name = c_text(&joint.name);
    let unit = match joint.unit {
        JointUnit::Angle => abi::ANGLE,
        JointUnit::Length => abi::LENGTH,
    };
    // SAFETY: the contract's arguments, alive until the callback returns.
    accepted(sink.joint.map(|add| unsafe {
        add(
            sink.context,
            name.as_ptr(),
            timeline,
            unit,
            values.as_ptr(),
            mask.as_ptr(),
            mask.len(),
        )
    }))
}

/// Hands over a torque of the host's `timeline`.
///
/// # Safety
/// As [`give`].
unsafe fn give_torque(
    torque: &TorqueTrack,
    timeline: usize,
    sink: &abi::RecordingSink,
) -> Result<(), Failure> {
    let (values, mask) = numbers(&torque.samples);
    let name = c_text(&torque.name);
    // SAFETY: the contract's arguments, alive until the callback returns.
    accepted(sink.torque.map(|add| unsafe {
        add(
            sink.context,
            name.as_ptr(),
            timeline,
            values.as_ptr(),
            mask.as_ptr(),
            mask.len(),
        )
    }))
}

fn numbers(samples: &[Option<f64>]) -> (Vec<f64>, Vec<u8>) {
    samples
        .iter()
        .map(|s| (s.unwrap_or(0.0), u8::from(s.is_some())))
        .unzip()
}
