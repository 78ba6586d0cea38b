//! Fewer rows, evenly spaced.

use super::data::Data;

/// The data that [`explain`](super::explain) scores: at most `most` rows.
#[must_use]
pub fn thin(data: &Data, most: usize) -> Data {
    data.select(&thinned(data, most))
}

/// Evenly spaced rows of every recording. Recordings share the rows; what a short one leaves is for the longer ones.
pub(super) fn thinned(data: &Data, most: usize) -> Vec<usize> {
    if data.readings.len() <= most {
        return (0..data.readings.len()).collect();
    }
    let mut recordings: Vec<Vec<usize>> = vec![Vec::new(); data.recordings()];
    for (i, recording) in data.recording.iter().enumerate() {
        recordings[recording.0].push(i);
    }
    recordings.retain(|rows| !rows.is_empty());
    recordings.sort_by_key(Vec::len);
    let (count, mut left) = (recordings.len(), most);
    let mut kept = Vec::new();
    for (k, rows) in recordings.iter().enumerate() {
        let take = rows.len().min((left / (count - k)).max(1));
        let step = rows.len() as f64 / take as f64;
        kept.extend((0..take).map(|n| rows[(step * (n as f64 + 0.5)) as usize]));
        left = left.saturating_sub(take);
    }
    kept.sort_unstable();
    kept
}
