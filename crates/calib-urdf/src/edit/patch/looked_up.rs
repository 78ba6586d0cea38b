//! Numbers that xacro looks up: replaced where they are written, if nothing else reads them there.

use super::attribute::Site;
use super::patcher::Patcher;
use crate::edit::change::Change;
use crate::edit::decimal::{Splice, decimal, same_number};
use crate::edit::error::{EditError, SharedValue};
use crate::error::Place;
use crate::xacro::value::{Cell, Leaf, Unwritable, cells, readers};
use roxmltree::Node;
use std::ops::Range;

impl Patcher<'_, '_> {
    /// [`Self::set_numbers`] where xacro computes the attribute by nothing but look-ups; `raw` are the value's bytes.
    pub(super) fn set_looked_up<const N: usize>(
        &mut self,
        site: &Site<'_, '_, '_>,
        raw: Range<usize>,
        new: impl FnOnce([f64; N]) -> [f64; N],
    ) -> Result<(), EditError> {
        let cells = cells::<N>(&self.context, raw.clone(), site.element, site.call)
            .map_err(|why| self.unwritable(why, site, raw.clone()))?;
        let wanted = new(std::array::from_fn(|i| cells[i].value));
        for (cell, wanted) in cells.iter().zip(wanted) {
            if !same_number(cell.value, wanted) {
                let in_call = |call: Node<'_, '_>| {
                    cell.yaml.is_none() && call.range().contains(&cell.range.start)
                };
                if !site.call.is_none_or(in_call) {
                    return Err(self.one_text(site));
                }
                self.set_cell(site, raw.start, cell, wanted)?;
            }
        }
        Ok(())
    }

    /// Replaces one number, in the xacro or in the YAML that it loads.
    fn set_cell(
        &mut self,
        site: &Site<'_, '_, '_>,
        offset: usize,
        cell: &Cell,
        wanted: f64,
    ) -> Result<(), EditError> {
        let mut attribute = site.attribute();
        if let Some(leaf) = &cell.from {
            self.check_unshared(site, offset, cell, leaf)?;
            attribute = format!("{attribute} ({})", leaf.name(self.context.companions));
        }
        let text = match cell.yaml {
            None => self.context.text,
            Some(file) => &self.context.companions.yaml[file].text,
        };
        let change = Change {
            line: Place::of_byte(text, cell.range.start).line,
            joint: site.joint.to_owned(),
            attribute,
            old: text[cell.range.clone()].to_owned(),
            new: decimal(wanted),
        };
        let splice = Splice {
            range: cell.range.clone(),
            new: decimal(wanted),
        };
        match cell.yaml {
            Some(file) => self.in_yaml.push((file, change, splice)),
            None => {
                self.changes.push(change);
                self.splices.push(splice);
            }
        }
        Ok(())
    }

    /// Refuses a value that something else reads too.
    fn check_unshared(
        &self,
        site: &Site<'_, '_, '_>,
        offset: usize,
        cell: &Cell,
        leaf: &Leaf,
    ) -> Result<(), EditError> {
        let readers = readers(&self.context, leaf);
        if readers.is_one() {
            return Ok(());
        }
        let name = leaf.bare_name();
        Err(EditError::XacroShared {
            file: self.file.to_owned(),
            place: self.place(offset),
            joint: site.joint.to_owned(),
            value: Box::new(match cell.yaml {
                Some(file) => SharedValue::Yaml {
                    keys: name,
                    file: self.context.companions.yaml[file].name.clone(),
                },
                None => SharedValue::Property { name },
            }),
            lines: readers.lines.into(),
            included: readers.included.into(),
        })
    }

    fn unwritable(&self, why: Unwritable, site: &Site<'_, '_, '_>, raw: Range<usize>) -> EditError {
        let file = self.file.to_owned();
        let joint = site.joint.to_owned();
        let place = self.place(raw.start);
        match why {
            Unwritable::Computed => EditError::XacroExpression {
                file,
                place,
                joint,
                attribute: site.name.to_owned(),
                found: self.context.text[raw].to_owned(),
            },
            Unwritable::NotGiven { name, call } => EditError::XacroNotGiven {
                file,
                place: self.place(call),
                joint,
                parameter: name,
            },
            Unwritable::SharedParameter { name, lines } => EditError::XacroShared {
                file,
                place,
                joint,
                value: Box::new(SharedValue::Parameter { name }),
                lines: lines.into(),
                included: Vec::new().into(),
            },
            Unwritable::NotFound(argument) => EditError::XacroYamlNotFound {
                file,
                place,
                joint,
                argument,
            },
            Unwritable::NoYaml(error) => *error,
            Unwritable::BadYaml {
                file: yaml,
                offset,
                keys,
                fault,
            } => {
                let yaml = &self.context.companions.yaml[yaml];
                EditError::YamlValue {
                    file: yaml.name.clone(),
                    place: Place::of_byte(&yaml.text, offset),
                    joint,
                    keys,
                    fault,
                }
            }
        }
    }
}
