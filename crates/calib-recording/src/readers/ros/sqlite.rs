//! The tables `topics` and `messages` of a rosbag2 SQLite file, read page by page.
//!
//! Of the format (<https://www.sqlite.org/fileformat2.html>) bags need table B-trees, overflow pages and records; a
//! write-ahead log beside the file is not read (a recording that was closed has none).

use super::{Input, Visit, read_exactly};
use crate::error::{At, Placed, Problem};
use std::collections::BTreeMap;
use std::io::SeekFrom;

pub(super) const MAGIC: &[u8] = b"SQLite format 3\0";

const LEAF: u8 = 0x0d;
const INTERIOR: u8 = 0x05;
/// Deeper trees than this do not occur: each level has hundreds of children.
const MAX_DEPTH: usize = 20;

/// A value of a record.
#[derive(Clone, Debug, PartialEq)]
enum Value<'a> {
    Null,
    Integer(i64),
    Real,
    Text(&'a str),
    Blob(&'a [u8]),
}

struct File<'a> {
    input: &'a mut dyn Input,
    page_size: u64,
    /// Bytes of a page that hold content.
    usable: usize,
    pages: u64,
    /// Pages that may still be visited: more than there are is a loop.
    budget: u64,
}

/// Visits every message of the bag with its topic's name and type.
pub(super) fn messages(input: &mut dyn Input, visit: &mut Visit) -> Placed<()> {
    let mut file = File::open(input)?;
    let tables = file.tables()?;
    let (topics, messages) = (tables.table("topics")?, tables.table("messages")?);
    let names = file.topics(topics)?;
    let (topic, time, data) = (
        messages.column("topic_id")?,
        messages.column("timestamp")?,
        messages.column("data")?,
    );
    file.rows(messages.root, &mut |at, _, record| {
        if let (Some(Value::Integer(topic)), Some(Value::Integer(time)), Some(Value::Blob(data))) =
            (record.get(topic), record.get(time), record.get(data))
            && let Some((name, kind)) = names.get(topic)
        {
            visit(at, name, kind, u64::try_from(*time).unwrap_or(0), data)?;
        }
        Ok(())
    })
}

/// A table of the bag.
struct Table {
    /// Its first page.
    root: u64,
    columns: Vec<String>,
}

impl Table {
    /// Where a column stands in the table's records.
    fn column(&self, name: &str) -> Placed<usize> {
        let found = self.columns.iter().position(|column| column == name);
        found.ok_or_else(|| {
            let found = format!("columns {}", self.columns.join(", "));
            let expected = format!("a column `{name}` as rosbag2 writes it");
            (At::File, Problem::Misfit { found, expected })
        })
    }
}

/// The tables of the bag by name.
struct Tables(BTreeMap<String, Table>);

impl Tables {
    fn table(&self, name: &str) -> Placed<&Table> {
        self.0.get(name).ok_or_else(|| {
            let names: Vec<String> = self.0.keys().cloned().collect();
            let found = format!("tables {}", names.join(", "));
            let expected = format!("a table `{name}` as rosbag2 writes it");
            (At::File, Problem::Misfit { found, expected })
        })
    }
}

impl<'a> File<'a> {
    /// Reads the file's header.
    fn open(input: &'a mut dyn Input) -> Placed<Self> {
        let io = |source| (At::File, Problem::Io(source));
        let length = input.seek(SeekFrom::End(0)).map_err(io)?;
        input.seek(SeekFrom::Start(0)).map_err(io)?;
        let header = read_exactly(input, 0, 100, "the header")?;
        let page_size = match u64::from(u16::from_be_bytes([header[16], header[17]])) {
            1 => 65_536,
            size => size,
        };
        let usable = page_size.saturating_sub(u64::from(header[20])) as usize;
        if !page_size.is_power_of_two() || page_size < 512 || usable < 480 {
            let problem = Problem::Unexpected {
                found: page_size.to_string(),
                expected: "a page size of 512 to 65536".into(),
            };
            return Err((At::Byte(16), problem));
        }
        if header[56..60] != [0, 0, 0, 1] && header[56..60] != [0; 4] {
            let problem = Problem::Unsupported {
                what: "a text encoding other than UTF-8".into(),
                remedy: "convert the bag".into(),
            };
            return Err((At::Byte(56), problem));
        }
        let pages = length / page_size;
        Ok(File {
            input,
            page_size,
            usable,
            pages,
            budget: 4 * pages + 16,
        })
    }

    /// All tables, from the schema on page 1.
    fn tables(&mut self) -> Placed<Tables> {
        let mut tables = BTreeMap::new();
        self.rows(1, &mut |_, _, record| {
            if let [
                Value::Text("table"),
                Value::Text(name),
                _,
                Value::Integer(root),
                Value::Text(sql),
                ..,
            ] = record
            {
                let table = Table {
                    root: u64::try_from(*root).unwrap_or(0),
                    columns: columns(sql),
                };
                tables.insert(name.to_string(), table);
            }
            Ok(())
        })?;
        Ok(Tables(tables))
    }

    /// Name and type of every topic in CDR, by its number.
    fn topics(&mut self, table: &Table) -> Placed<BTreeMap<i64, (String, String)>> {
        let (name, kind, format) = (
            table.column("name")?,
            table.column("type")?,
            table.column("serialization_format")?,
        );
        let mut topics = BTreeMap::new();
        self.rows(table.root, &mut |_, rowid, record| {
            if let (Some(Value::Text(name)), Some(Value::Text(kind)), Some(Value::Text("cdr"))) =
                (record.get(name), record.get(kind), record.get(format))
            {
                topics.insert(rowid, (name.to_string(), kind.to_string()));
            }
            Ok(())
        })?;
        Ok(topics)
    }
}

/// Column names of a `CREATE TABLE` text.
fn columns(sql: &str) -> Vec<String> {
    let inner = sql.split_once('(').map_or("", |(_, inner)| inner);
    inner
        .split(',')
        .map(|column| {
            column
                .split_whitespace()
                .next()
                .unwrap_or("")
                .trim_matches(['"', '`', '[', ']'])
                .to_string()
        })
        .collect()
}

type Row<'a> = dyn FnMut(u64, i64, &[Value]) -> Placed<()> + 'a;

impl File<'_> {
    fn page(&mut self, number: u64) -> Placed<Vec<u8>> {
        if number == 0 || number > self.pages || self.budget == 0 {
            let found = if self.budget == 0 {
                "pages that refer to each other".to_string()
            } else {
                format!("page {number}")
            };
            let problem = Problem::Misfit {
                found,
                expected: format!("pages 1 to {}", self.pages),
            };
            return Err((
                At::Byte(number.saturating_sub(1).min(self.pages) * self.page_size),
                problem,
            ));
        }
        self.budget -= 1;
        let at = (number - 1) * self.page_size;
        self.input
            .seek(SeekFrom::Start(at))
            .map_err(|source| (At::Byte(at), Problem::Io(source)))?;
        read_exactly(self.input, at, self.page_size, "a page")
    }

    /// Every row of the table whose B-tree begins at page `root`, in order of rowid.
    fn rows(&mut self, root: u64, row: &mut Row) -> Placed<()> {
        self.tree(root, 0, row)
    }

    fn tree(&mut self, number: u64, depth: usize, row: &mut Row) -> Placed<()> {
        let page = self.page(number)?;
        let at = (number - 1) * self.page_size;
        let start = if number == 1 { 100 } else { 0 };
        let broken = |what: &str| {
            (
                At::Byte(at),
                Problem::Misfit {
                    found: what.to_string(),
                    expected: "a table's B-tree page".to_string(),
                },
            )
        };
        let kind = page[start];
        let cells = usize::from(u16::from_be_bytes([page[start + 3], page[start + 4]]));
        if depth > MAX_DEPTH {
            return Err(broken("a tree that is too deep"));
        }
        let header = match kind {
            LEAF => 8,
            INTERIOR => 12,
            _ => return Err(broken(&format!("a page of type {kind:#04x}"))),
        };
        for i in 0..cells {
            let pointer = start + header + 2 * i;
            let cell = page
                .get(pointer..pointer + 2)
                .map(|b| usize::from(u16::from_be_bytes([b[0], b[1]])));
            let cell = cell
                .and_then(|cell| page.get(cell..))
                .ok_or_else(|| broken("a cell outside its page"))?;
            if kind == INTERIOR {
                let child = cell
                    .get(..4)
                    .ok_or_else(|| broken("a cell outside its page"))?;
                self.tree(
                    u64::from(u32::from_be_bytes([child[0], child[1], child[2], child[3]])),
                    depth + 1,
                    row,
                )?;
            } else {
                self.leaf_cell(at, cell, row)?;
            }
        }
        if kind == INTERIOR {
            let right = u32::from_be_bytes([
                page[start + 8],
                page[start + 9],
                page[start + 10],
                page[start + 11],
            ]);
            self.tree(u64::from(right), depth + 1, row)?;
        }
        Ok(())
    }

    fn leaf_cell(&mut self, at: u64, cell: &[u8], row: &mut Row) -> Placed<()> {
        let broken = |what: &str| {
            (
                At::Byte(at),
                Problem::Misfit {
                    found: what.to_string(),
                    expected: "a row of a table".to_string(),
                },
            )
        };
        let (size, used) = varint(cell).ok_or_else(|| broken("a cell cut short"))?;
        let (rowid, used_more) = varint(&cell[used..]).ok_or_else(|| broken("a cell cut short"))?;
        let rest = &cell[used + used_more..];
        let size = usize::try_from(size).map_err(|_| broken("a row of impossible size"))?;
        if size as u64 > self.pages * self.page_size {
            return Err(broken("a row larger than the file"));
        }
        // How much of a row stands in its page: section 1.6 of the format.
        let (most, least) = (self.usable - 35, (self.usable - 12) * 32 / 255 - 23);
        let local = if size <= most {
            size
        } else {
            let fitting = least + (size - least) % (self.usable - 4);
            if fitting <= most { fitting } else { least }
        };
        let mut payload = rest
            .get(..local)
            .ok_or_else(|| broken("a row cut short"))?
            .to_vec();
        if local < size {
            let next = rest
                .get(local..local + 4)
                .ok_or_else(|| broken("a row cut short"))?;
            let mut next = u64::from(u32::from_be_bytes([next[0], next[1], next[2], next[3]]));
            while payload.len() < size {
                let page = self.page(next)?;
                let take = (size - payload.len()).min(self.usable - 4);
                payload.extend_from_slice(&page[4..4 + take]);
                next = u64::from(u32::from_be_bytes([page[0], page[1], page[2], page[3]]));
            }
        }
        let values = record(&payload).ok_or_else(|| broken("a record cut short"))?;
        row(at, rowid as i64, &values)
    }
}

/// A variable-length integer and its bytes.
fn varint(bytes: &[u8]) -> Option<(u64, usize)> {
    let mut value = 0u64;
    for (i, &b) in bytes.iter().take(9).enumerate() {
        if i == 8 {
            return Some((value << 8 | u64::from(b), 9));
        }
        value = value << 7 | u64::from(b & 0x7f);
        if b & 0x80 == 0 {
            return Some((value, i + 1));
        }
    }
    None
}

/// The values of a record.
fn record(payload: &[u8]) -> Option<Vec<Value<'_>>> {
    let (header_size, mut used) = varint(payload)?;
    let header_size = usize::try_from(header_size).ok()?;
    let mut content = payload.get(header_size..)?;
    let mut values = Vec::new();
    while used < header_size {
        let (kind, more) = varint(payload.get(used..header_size)?)?;
        used += more;
        let size = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind as usize,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            _ => usize::try_from((kind - 12) / 2).ok()?,
        };
        let (bytes, rest) = content.split_at_checked(size)?;
        content = rest;
        values.push(match kind {
            0 => Value::Null,
            8 => Value::Integer(0),
            9 => Value::Integer(1),
            7 => Value::Real,
            1..=6 => {
                let negative = bytes.first().is_some_and(|b| b & 0x80 != 0);
                Value::Integer(
                    bytes
                        .iter()
                        .fold(if negative { -1 } else { 0 }, |n, &b| n << 8 | i64::from(b)),
                )
            }
            _ if kind % 2 == 0 => Value::Blob(bytes),
            _ => Value::Text(std::str::from_utf8(bytes).ok()?),
        });
    }
    Some(values)
}
