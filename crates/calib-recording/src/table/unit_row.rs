//! A row of units below the header: `s,deg,deg,mm,mm,mm` or `[s],[deg]`.
//!
//! It states the units of columns whose names state none, and may not contradict those that do. A row is one when a cell is a unit, no cell is a
//! number, and at most half of the cells with text are something else: such a row cannot be data.

use super::header::is_text_column;
use super::stated_unit::{StatedUnit, UnitRow, without_brackets};
use crate::column_map::ColumnMap;
use crate::error::{At, Placed, Problem, excerpt};
use crate::text::{Number, number};

/// The units that a row below the header states, or the first column whose cell is none; `None` where the row is not one of units. `label`: texts
/// stand in the column of this name, beside those that hold texts by our own rules.
pub fn unit_row<'a>(
    names: &[String],
    cells: impl Iterator<Item = &'a str>,
    label: impl Fn(&String) -> bool,
) -> Option<Result<Vec<Option<StatedUnit>>, usize>> {
    let (mut units, mut known, mut unknown) = (Vec::new(), 0, Vec::new());
    let text = |i: usize| {
        let name = names.get(i);
        name.is_none_or(|name| is_text_column(name) || label(name))
    };
    for (i, cell) in cells.enumerate() {
        units.push(None);
        let word = without_brackets(cell);
        if text(i) || matches!(word, "" | "-" | "–" | "#") {
            continue;
        }
        if number(word) != Number::Text && number(word) != Number::Empty {
            return None;
        }
        units[i] = StatedUnit::from_text(cell);
        match units[i] {
            Some(StatedUnit::Other) => {}
            Some(_) => known += 1,
            None => unknown.push(i),
        }
    }
    match unknown.first() {
        _ if known == 0 || unknown.len() > known => None,
        Some(first) => Some(Err(*first)),
        None => Some(Ok(units)),
    }
}

/// The row below the header when it states units.
pub(super) fn read<'a>(
    line: u64,
    cells: impl Iterator<Item = &'a str> + Clone,
    names: &[String],
    map: Option<&ColumnMap>,
) -> Placed<Option<UnitRow>> {
    let label = |name: &String| {
        map.is_some_and(|map| {
            let long = map.long.as_ref();
            map.labels.contains(name) || long.is_some_and(|long| long.name == *name)
        })
    };
    // A text that means a lost sample is no unit.
    let lost = |cell: &str| map.is_some_and(|map| map.lost.iter().any(|text| text == cell));
    if cells.clone().any(lost) {
        return Ok(None);
    }
    match unit_row(names, cells.clone(), label) {
        None => Ok(None),
        Some(Ok(mut units)) => {
            units.resize(names.len(), None);
            Ok(Some(UnitRow { line, units }))
        }
        Some(Err(i)) => {
            let column = names.get(i).filter(|name| !name.is_empty());
            let column = column.cloned().unwrap_or_else(|| format!("#{}", i + 1));
            let found = excerpt(cells.clone().nth(i).unwrap_or_default(), 40);
            Err((At::Cell { line, column }, Problem::UnknownUnit { found }))
        }
    }
}
