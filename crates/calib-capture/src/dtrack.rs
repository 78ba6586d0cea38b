//! ART DTrack: one UDP datagram of text is one frame, read by the same reader as a log of such datagrams.

use crate::Frame;
use calib_recording::{Error, Filled, ReadOptions, read_bytes};

/// Port that DTrack sends to unless told otherwise.
pub const PORT: u16 = 5000;

/// Largest datagram that UDP can carry.
pub const MAX_DATAGRAM: usize = 65_536;

/// Whether the bytes begin as every DTrack datagram does; anything else on the port is somebody else's.
pub fn is_ours(bytes: &[u8]) -> bool {
    let text = bytes.trim_ascii_start();
    text.strip_prefix(b"fr")
        .is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
}

/// The frames of a datagram: one, or none when it carries nothing but a NUL.
///
/// `device` is what the datagram's `ts` or `ts2` says; `ts` starts over at midnight, which only who has seen the
/// datagram before can know ([`Order`](crate::Order)).
///
/// # Errors
/// The reader's, with the line within the datagram.
pub fn datagram(bytes: &[u8]) -> Result<Vec<Frame>, Error> {
    let options = ReadOptions {
        format: Some("dtrack".to_string()),
        ..ReadOptions::default()
    };
    let recording = read_bytes("datagram", bytes, &options)?;
    let Some(timeline) = recording.timelines.first() else {
        return Ok(Vec::new());
    };
    let frame = |i: usize| Frame {
        number: timeline.rows.get(i).copied(),
        device: timeline.t.as_ref().and_then(|t| t.get(i).copied()),
        bodies: recording
            .bodies
            .iter()
            .filter_map(|body| {
                let pose = body.tracker_from_body.get(i).copied().flatten()?;
                Some((body.name.clone(), pose))
            })
            .collect(),
        markers: recording
            .markers
            .iter()
            .filter(|marker| !marker.unlabeled)
            .filter_map(|marker| {
                let point = marker.samples.get(i)?.point(Filled::Include)?;
                Some((marker.name.clone(), point))
            })
            .collect(),
        // Single markers of DTrack carry a number that another marker may have a second later.
        unlabeled: recording
            .markers
            .iter()
            .filter(|marker| {
                let sample = marker.samples.get(i);
                sample.is_some_and(|sample| sample.point(Filled::Include).is_some())
            })
            .count(),
    };
    Ok((0..timeline.len()).map(frame).collect())
}
