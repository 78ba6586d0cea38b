//! Parameters that a profile gives, against those that an offer describes.

use std::collections::BTreeMap;

use serde_json::{Map, json};

use crate::offer::{Parameter, Value};

/// Parameters that are not what the offer describes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// No such parameter.
    #[error(
        "unknown parameter `{name}`, expected {}{}",
        expected(known),
        hint(name, known)
    )]
    Unknown {
        /// The one given.
        name: String,
        /// Those there are.
        known: Vec<String>,
    },
    /// Another type.
    #[error("parameter `{name}` must be {needed}, got {got}")]
    Type {
        /// The parameter.
        name: String,
        /// The type in words.
        needed: &'static str,
        /// The value given.
        got: Value,
    },
    /// Out of its limits.
    #[error("parameter `{name}` must be {minimum} to {maximum}, got {got}")]
    Range {
        /// The parameter.
        name: String,
        /// Smallest.
        minimum: f64,
        /// Largest.
        maximum: f64,
        /// The value given.
        got: f64,
    },
    /// Not one of the texts there are.
    #[error("parameter `{name}` must be {}, got `{got}`", expected(choices))]
    Choice {
        /// The parameter.
        name: String,
        /// The texts.
        choices: Vec<String>,
        /// The value given.
        got: String,
    },
    /// NaN or infinity, or a text with a zero byte.
    #[error("parameter `{name}`: {got} cannot be passed")]
    Value {
        /// The parameter.
        name: String,
        /// The value given.
        got: Value,
    },
    /// Not given.
    #[error("parameter `{name}` is missing ({summary}); for example {example}")]
    Missing {
        /// The parameter.
        name: String,
        /// What it is.
        summary: String,
        /// A value that would do.
        example: Value,
    },
}

impl ParameterError {
    /// The parameter that is wrong.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Unknown { name, .. }
            | Self::Type { name, .. }
            | Self::Range { name, .. }
            | Self::Choice { name, .. }
            | Self::Value { name, .. }
            | Self::Missing { name, .. } => name,
        }
    }
}

fn hint(name: &str, known: &[String]) -> String {
    calib_finding::nearest_word(name, known.iter().map(String::as_str))
        .map_or_else(String::new, |near| format!("; did you mean `{near}`?"))
}

fn expected(names: &[String]) -> String {
    if names.is_empty() {
        return "none".into();
    }
    let names: Vec<_> = names.iter().map(|n| format!("`{n}`")).collect();
    if names.len() == 1 {
        names[0].clone()
    } else {
        format!("one of {}", names.join(", "))
    }
}

/// The values of a call, in the order of the parameters: given ones checked, the others by default.
///
/// A whole number is taken where a number is described.
///
/// # Errors
/// [`ParameterError`] for the first thing that is wrong.
pub fn validate(
    parameters: &[Parameter],
    given: &BTreeMap<String, Value>,
) -> Result<Vec<Value>, ParameterError> {
    if let Some(name) = given
        .keys()
        .find(|name| !parameters.iter().any(|p| &p.name == *name))
    {
        return Err(ParameterError::Unknown {
            name: name.clone(),
            known: parameters.iter().map(|p| p.name.clone()).collect(),
        });
    }
    parameters
        .iter()
        .map(|parameter| match given.get(&parameter.name) {
            Some(value) => one(parameter, value),
            None if parameter.required => Err(ParameterError::Missing {
                name: parameter.name.clone(),
                summary: parameter.summary.clone(),
                example: parameter.value.clone(),
            }),
            None => Ok(parameter.value.clone()),
        })
        .collect()
}

/// One value, checked and brought to the parameter's type.
pub(crate) fn one(parameter: &Parameter, given: &Value) -> Result<Value, ParameterError> {
    let name = || parameter.name.clone();
    let value = match (&parameter.value, given) {
        // Up to 2⁵³ a whole number is a number without loss; beyond, nobody writes one for the other.
        (Value::Number(_), Value::Integer(integer)) => Value::Number(*integer as f64),
        (Value::Bool(_), Value::Bool(_))
        | (Value::Integer(_), Value::Integer(_))
        | (Value::Number(_), Value::Number(_))
        | (Value::Text(_), Value::Text(_)) => given.clone(),
        (needed, _) => {
            let needed = needed.type_name();
            return Err(ParameterError::Type {
                name: name(),
                needed,
                got: given.clone(),
            });
        }
    };
    let number = match &value {
        Value::Integer(integer) => Some(*integer as f64),
        Value::Number(number) => Some(*number),
        _ => None,
    };
    if let Some(got) = number {
        if !got.is_finite() {
            return Err(ParameterError::Value {
                name: name(),
                got: value,
            });
        }
        if let Some((minimum, maximum)) = parameter.limits
            && !(minimum..=maximum).contains(&got)
        {
            return Err(ParameterError::Range {
                name: name(),
                minimum,
                maximum,
                got,
            });
        }
    }
    if let Value::Text(text) = &value {
        if text.contains('\0') {
            return Err(ParameterError::Value {
                name: name(),
                got: value,
            });
        }
        if !parameter.choices.is_empty() && !parameter.choices.contains(text) {
            let choices = parameter.choices.clone();
            return Err(ParameterError::Choice {
                name: name(),
                choices,
                got: text.clone(),
            });
        }
    }
    Ok(value)
}

/// The parameters as a JSON Schema (2020-12) of an object.
#[must_use]
pub fn schema(parameters: &[Parameter]) -> serde_json::Value {
    let mut properties = Map::new();
    for parameter in parameters {
        let mut property = Map::new();
        let (word, value) = match &parameter.value {
            Value::Bool(value) => ("boolean", json!(value)),
            Value::Integer(value) => ("integer", json!(value)),
            Value::Number(value) => ("number", json!(value)),
            Value::Text(value) => ("string", json!(value)),
        };
        property.insert("type".into(), json!(word));
        property.insert("description".into(), json!(parameter.summary));
        if let Some((minimum, maximum)) = parameter.limits {
            if minimum.is_finite() {
                property.insert("minimum".into(), json!(minimum));
            }
            if maximum.is_finite() {
                property.insert("maximum".into(), json!(maximum));
            }
        }
        if !parameter.choices.is_empty() {
            property.insert("enum".into(), json!(parameter.choices));
        }
        if parameter.required {
            property.insert("examples".into(), json!([value]));
        } else {
            property.insert("default".into(), value);
        }
        properties.insert(parameter.name.clone(), serde_json::Value::Object(property));
    }
    let required: Vec<_> = parameters
        .iter()
        .filter(|p| p.required)
        .map(|p| &p.name)
        .collect();
    json!({
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

/// Values that were written as text, in the types that the offer describes. A text that is no value of its type, and one of a parameter
/// that there is not, stays a text, which [`validate`] refuses.
#[must_use]
pub fn typed(parameters: &[Parameter], given: &[(String, String)]) -> BTreeMap<String, Value> {
    let value = |name: &str, text: &str| {
        let described = parameters.iter().find(|p| p.name == name)?;
        match described.value {
            Value::Bool(_) => text.parse().ok().map(Value::Bool),
            Value::Integer(_) => text.parse().ok().map(Value::Integer),
            Value::Number(_) => text.parse().ok().map(Value::Number),
            Value::Text(_) => None,
        }
    };
    let typed = given.iter().map(|(name, text)| {
        let value = value(name, text).unwrap_or_else(|| Value::Text(text.clone()));
        (name.clone(), value)
    });
    typed.collect()
}
