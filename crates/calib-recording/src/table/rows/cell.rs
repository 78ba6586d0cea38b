//! Cells that hold no plain number.

use super::Rows;
use crate::error::Placed;
use crate::table::header::SlotKind;
use crate::text::{Number, not_a_number, number};

impl Rows<'_> {
    /// A cell that is no plain number: a lost code, `nan`, a decimal comma, or an error.
    pub(super) fn unusual(
        &mut self,
        line: u64,
        column: usize,
        slot: usize,
        cell: &str,
        kind: Number,
    ) -> Placed<f64> {
        let kind = match kind {
            Number::Text
                if self
                    .map
                    .is_some_and(|map| map.lost.iter().any(|code| code == cell)) =>
            {
                return Ok(f64::NAN);
            }
            Number::Text
                if self.map.is_some_and(|map| map.decimal_comma)
                    && cell.matches(',').count() == 1 =>
            {
                match number(&cell.replace(',', ".")) {
                    Number::Value(value) => return Ok(value),
                    kind => kind,
                }
            }
            kind => kind,
        };
        if kind == Number::Nan && self.layout.slots[slot].kind == SlotKind::Tracker {
            let rows = self
                .nans
                .entry(self.layout.names[column].clone())
                .or_default();
            rows.push(line);
            return Ok(f64::NAN);
        }
        let expected = if cell.contains(',') {
            "a number with a decimal point (a column map can say `decimal_comma: true`)"
        } else {
            "a number, or nothing where the sample was lost (a column map can name a text for that: `columns: {lost: [TEXT]}`)"
        };
        Err((self.at(line, column), not_a_number(cell, kind, expected)))
    }
}
