//! Cells that hold no plain number.

use super::Rows;
use crate::date_time::date_time;
use crate::error::{Placed, Problem, excerpt};
use crate::table::header::{Column, SlotKind};
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
            Number::Text if self.commas && cell.matches(',').count() == 1 => {
                match number(&cell.replace(',', ".")) {
                    Number::Value(value) => return Ok(value),
                    kind => kind,
                }
            }
            kind => kind,
        };
        if kind == Number::Text && self.layout.slots[slot].kind == SlotKind::Time {
            return self.instant_of_text(line, column, cell);
        }
        if kind == Number::Nan && self.layout.slots[slot].kind == SlotKind::Tracker {
            let rows = self
                .nans
                .entry(self.layout.names[column].clone())
                .or_default();
            rows.push(line);
            return Ok(f64::NAN);
        }
        let expected = if self.commas && cell.contains(['.', '\'', ',']) {
            "a number with a decimal comma and no separators of thousands, as the column map states `decimal_comma: true`"
        } else if cell.contains(',') {
            "a number with a decimal point (a column map can say `decimal_comma: true`)"
        } else {
            "a number, or nothing where the sample was lost (a column map can name a text for that: `columns: {lost: [TEXT]}`)"
        };
        Err((self.at(line, column), not_a_number(cell, kind, expected)))
    }

    /// Whether a number is one with points between thousands, where commas are the decimal signs: `2.428`, and in any case `1.234.567`.
    pub(super) fn has_thousands(&self, slot: usize, cell: &str) -> bool {
        let kind = self.layout.slots[slot].kind;
        if !self.commas || matches!(kind, SlotKind::Time | SlotKind::Counter) {
            return false;
        }
        let mut groups = cell.trim_start_matches(['-', '+']).split('.');
        let digits = |group: &str| group.bytes().all(|b| b.is_ascii_digit());
        let first = groups.next().unwrap_or("");
        let begins = (1..=3).contains(&first.len()) && digits(first) && !first.starts_with('0');
        let rest: Vec<&str> = groups.collect();
        begins && !rest.is_empty() && rest.iter().all(|group| group.len() == 3 && digits(group))
    }

    /// A date with a time of day, in the unit of the column.
    fn instant_of_text(&mut self, line: u64, column: usize, cell: &str) -> Placed<f64> {
        let at = self.at(line, column);
        let found = excerpt(cell, 40);
        let Some(instant) = date_time(cell) else {
            return Err((at, Problem::TimeText { found }));
        };
        let before = match self.dates.get(&column) {
            None if self.timeline.rows.is_empty() => None,
            None => Some("numbers"),
            Some(zoned) if *zoned == instant.zoned => None,
            Some(true) => Some("an offset from UTC"),
            Some(false) => Some("no offset from UTC"),
        };
        if let Some(before) = before {
            return Err((at, Problem::OtherTime { found, before }));
        }
        self.dates.insert(column, instant.zoned);
        let scale = match self.layout.columns[column] {
            Column::Number { scale, .. } => scale,
            _ => 1.0,
        };
        Ok(instant.seconds * scale)
    }
}
