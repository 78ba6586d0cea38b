//! A plugin's description, copied and checked.

use super::raw::{array, prefix, size_to, sized, text};
use crate::{
    abi,
    motion::Shape,
    offer::{Kind, Offer, Parameter, Value},
    parameters,
};

/// More offers or parameters than this are a broken count.
const MOST: usize = 4096;

/// What a plugin says about itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// `[a-z][a-z0-9_-]*`.
    pub name: String,
    /// The plugin's own version.
    pub version: String,
    /// Who made it.
    pub author: String,
    /// SPDX.
    pub licence: String,
    /// Major and minor of the contract it was built with.
    pub abi: (u32, u32),
    /// What it offers and this program understands.
    pub offers: Vec<Offer>,
    /// What it offers and this program does not understand: one sentence each.
    pub skipped: Vec<String>,
}

/// Reads a description.
///
/// # Errors
/// A text that names what is wrong.
///
/// # Safety
/// `pointer` is null or what `describe` of a plugin returned.
pub(super) unsafe fn read(
    pointer: *const abi::Descriptor,
    abi: (u32, u32),
) -> Result<Description, String> {
    // SAFETY, for all blocks: the contract says that these are structs and texts that live until the process ends; sizes are
    // read first, and arrays are walked by the size of the plugin's own structs.
    let raw: abi::Descriptor = unsafe {
        sized(
            "calib_descriptor",
            pointer.cast(),
            size_to!(abi::Descriptor, offer_count),
        )?
    };
    let mut description = Description {
        name: word("plugin name", unsafe { text("name", raw.name)? }, "_-")?,
        version: unsafe { text("version", raw.version)? },
        author: unsafe { text("author", raw.author)? },
        licence: unsafe { text("licence", raw.licence)? },
        abi,
        offers: Vec::new(),
        skipped: Vec::new(),
    };
    let needed = size_to!(abi::Offer, parameter_count);
    let stride = stride("offer", raw.offer_size, needed, raw.offer_count)?;
    for i in 0..raw.offer_count {
        let place = raw.offers.cast::<u8>().wrapping_add(i * stride);
        let one: abi::Offer = unsafe { prefix("calib_offer", place.cast(), stride, needed)? };
        match unsafe { offer(&one)? } {
            Ok(offer) => {
                let twice = |o: &Offer| o.kind == offer.kind && o.name == offer.name;
                if description.offers.iter().any(twice) {
                    return Err(format!("offers {} `{}` twice", offer.kind.id(), offer.name));
                }
                description.offers.push(offer);
            }
            Err(skipped) => description.skipped.push(skipped),
        }
    }
    Ok(description)
}

fn stride(what: &str, stated: u32, needed: usize, count: usize) -> Result<usize, String> {
    if count > MOST {
        return Err(format!("{count} {what}s, at most {MOST}"));
    }
    let stated = stated as usize;
    if count > 0 && stated < needed {
        return Err(format!("{what}_size is {stated}, needs at least {needed}"));
    }
    Ok(stated)
}

fn word(what: &str, text: String, signs: &str) -> Result<String, String> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || signs.contains(c);
    if text.starts_with(|c: char| c.is_ascii_lowercase()) && text.chars().all(plain) {
        return Ok(text);
    }
    Err(format!("{what} `{text}` is not [a-z][a-z0-9{signs}]*"))
}

/// An offer, or why it is skipped.
///
/// # Safety
/// The texts and arrays are the plugin's.
unsafe fn offer(raw: &abi::Offer) -> Result<Result<Offer, String>, String> {
    // SAFETY, for all blocks: as the caller says.
    let id = unsafe { text("the kind of an offer", raw.kind)? };
    let name = word(
        "offer name",
        unsafe { text("the name of an offer", raw.name)? },
        "_-",
    )?;
    let Some(kind) = Kind::from_id(&id) else {
        return Ok(Err(format!(
            "`{name}` is skipped: this version knows no kind `{id}`"
        )));
    };
    let mut out = Offer::new(kind, &name, &unsafe {
        text("the summary of an offer", raw.summary)?
    });
    out.source = unsafe { text("the source of an offer", raw.source)? };
    // Shapes that a newer plugin takes beside these are not offered to it.
    out.shapes = Shape::ALL
        .into_iter()
        .filter(|shape| raw.shapes & (1 << *shape as u32) != 0)
        .collect();
    if matches!(kind, Kind::Cor | Kind::Aor) && out.shapes.is_empty() {
        return Ok(Err(format!(
            "`{name}` is skipped: it takes none of the data that this version has"
        )));
    }
    out.example = unsafe { array("example", raw.example, raw.example_size)? }.to_vec();
    let needed = size_to!(abi::Parameter, required);
    let stride = stride("parameter", raw.parameter_size, needed, raw.parameter_count)?;
    for i in 0..raw.parameter_count {
        let place = raw.parameters.cast::<u8>().wrapping_add(i * stride);
        let one: abi::Parameter =
            unsafe { prefix("calib_parameter", place.cast(), stride, needed)? };
        match unsafe { parameter(&one) }.map_err(|problem| format!("`{name}`: {problem}"))? {
            Some(parameter) => {
                if out.parameters.iter().any(|p| p.name == parameter.name) {
                    return Err(format!("`{name}` has two parameters `{}`", parameter.name));
                }
                out.parameters.push(parameter);
            }
            None => {
                return Ok(Err(format!(
                    "`{name}` is skipped: this version knows no parameter type {}",
                    one.value.kind
                )));
            }
        }
    }
    Ok(Ok(out))
}

/// A parameter; `None` for one of an unknown type.
///
/// # Safety
/// The texts and arrays are the plugin's.
unsafe fn parameter(raw: &abi::Parameter) -> Result<Option<Parameter>, String> {
    // SAFETY, for all blocks: as the caller says.
    let name = word(
        "parameter name",
        unsafe { text("the name of a parameter", raw.name)? },
        "_",
    )?;
    let value = match raw.value.kind {
        abi::BOOL => Value::Bool(raw.value.flag != 0),
        abi::INTEGER => Value::Integer(raw.value.integer),
        abi::NUMBER => Value::Number(raw.value.number),
        abi::TEXT => {
            Value::Text(unsafe { text(&format!("the value of `{name}`"), raw.value.text)? })
        }
        _ => return Ok(None),
    };
    if raw.choice_count > MOST {
        return Err(format!(
            "`{name}` has {} choices, at most {MOST}",
            raw.choice_count
        ));
    }
    let choices = unsafe { array("choices", raw.choices, raw.choice_count)? }
        .iter()
        .map(|choice| unsafe { text(&format!("a choice of `{name}`"), *choice) })
        .collect::<Result<_, _>>()?;
    let parameter = Parameter {
        summary: unsafe { text(&format!("the summary of `{name}`"), raw.summary)? },
        limits: (raw.minimum < raw.maximum).then_some((raw.minimum, raw.maximum)),
        required: raw.required != 0,
        name,
        value,
        choices,
    };
    // A default must be one that a profile could give.
    parameters::one(&parameter, &parameter.value).map_err(|error| format!("default of {error}"))?;
    Ok(Some(parameter))
}
