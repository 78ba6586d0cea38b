//! Which frames come in order, which are missing, and where a day ends.

use crate::Frame;

const HALF_DAY: f64 = 43_200.0;
const DAY: f64 = 86_400.0;
/// That many late frames one after the other are no disorder on the way: the tracker began to count again.
const RESTARTED: u64 = 50;

/// What a frame is in the order of all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrival {
    /// The next one; its device time with the days counted on.
    InOrder {
        /// The device's time, s.
        device: Option<f64>,
    },
    /// It, or a later one, was here before.
    Late,
    /// The device's counter or clock went back for good.
    Restarted,
}

/// Watches counter and clock of a device.
#[derive(Clone, Debug, Default)]
pub struct Order {
    number: Option<u64>,
    device: Option<f64>,
    days: f64,
    /// Frames taken.
    pub taken: u64,
    /// Frames that the device counted and that never came.
    pub missing: u64,
    /// Frames that came late or twice, and were dropped.
    pub late: u64,
    late_in_a_row: u64,
}

impl Order {
    /// Judges the next frame.
    pub fn arrives(&mut self, frame: &Frame) -> Arrival {
        let device = frame.device.map(|t| {
            let t = t + self.days;
            // `ts` of DTrack is counted from midnight (a Unix time is beyond any day).
            match self.device {
                Some(last) if t < last - HALF_DAY && t - self.days < DAY => t + DAY,
                _ => t,
            }
        });
        let late = match (frame.number.zip(self.number), device.zip(self.device)) {
            (Some((number, last)), _) if number <= last => true,
            // Without a counter, equal times are a repetition.
            (None, Some((t, last))) => t <= last,
            (Some(_), Some((t, last))) => t < last,
            _ => false,
        };
        if late {
            self.late += 1;
            self.late_in_a_row += 1;
            return if self.late_in_a_row >= RESTARTED {
                Arrival::Restarted
            } else {
                Arrival::Late
            };
        }
        self.late_in_a_row = 0;
        if let Some((number, last)) = frame.number.zip(self.number) {
            self.missing += number - last - 1;
        }
        if let (Some(t), Some(raw)) = (device, frame.device) {
            self.days = t - raw;
        }
        self.number = frame.number.or(self.number);
        self.device = device.or(self.device);
        self.taken += 1;
        Arrival::InOrder { device }
    }
}
