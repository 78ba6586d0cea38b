//! One frame as a row of the recording.

use super::hold::Row;
use super::{Session, WatchedKind};
use crate::{Frame, JointListener};
use std::fmt::Write as _;

impl Session<'_> {
    pub(super) fn row(
        &mut self,
        frame: &Frame,
        t: f64,
        host: f64,
        listener: Option<&JointListener>,
    ) -> Row {
        let number = frame.number.unwrap_or(self.order.taken);
        let before = format!("{number},{t:.6},{host:.6}");
        let mut row = String::new();
        for column in 0..self.plan.columns.len() {
            row.push(',');
            if let Some(q) = self.joint(column, host, listener) {
                let _ = write!(row, "{:.6}", self.plan.columns[column].written(q));
                let (low, high) = self.covered[column].unwrap_or((q, q));
                self.covered[column] = Some((low.min(q), high.max(q)));
            }
        }
        for watched in &self.plan.watched {
            match watched.kind {
                WatchedKind::Body => match frame.bodies.get(&watched.from) {
                    Some(pose) => {
                        let p = pose.translation.vector;
                        let q = pose.rotation.coords;
                        let q = if q[3] < 0.0 { -q } else { q };
                        let _ = write!(
                            row,
                            ",{:.7},{:.7},{:.7},{:.9},{:.9},{:.9},{:.9}",
                            p[0], p[1], p[2], q[0], q[1], q[2], q[3]
                        );
                    }
                    None => row.push_str(",,,,,,,"),
                },
                WatchedKind::Marker => match frame.point(&watched.from) {
                    Some(p) => {
                        let _ = write!(row, ",{:.7},{:.7},{:.7}", p[0], p[1], p[2]);
                    }
                    None => row.push_str(",,,"),
                },
            }
        }
        Row { before, after: row }
    }
}
