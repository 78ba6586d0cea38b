//! What is offered: kind, name, and the parameters with their types, defaults and limits.

/// The kinds of version 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Center of rotation.
    Cor,
    /// Axis of rotation.
    Aor,
    /// Recordings from files.
    Reader,
    /// Files from a report.
    Report,
    /// An effect of a joint.
    Effect,
}

impl Kind {
    /// All, in the order they are listed in.
    pub const ALL: [Self; 5] = [
        Self::Cor,
        Self::Aor,
        Self::Reader,
        Self::Report,
        Self::Effect,
    ];

    /// The id with its revision.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::Cor => "calib.cor/1",
            Self::Aor => "calib.aor/1",
            Self::Reader => "calib.reader/1",
            Self::Report => "calib.report/1",
            Self::Effect => "calib.effect/1",
        }
    }

    /// The kind with this id.
    #[must_use]
    pub fn from_id(id: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.id() == id)
    }

    /// What a person calls it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Cor => "center estimator",
            Self::Aor => "axis estimator",
            Self::Reader => "reader",
            Self::Report => "report writer",
            Self::Effect => "joint effect",
        }
    }
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Yes or no.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A finite number.
    Number(f64),
    /// A text.
    Text(String),
}

impl Value {
    /// The word for its type.
    #[must_use]
    pub const fn type_name(&self) -> &'static str {
        match self {
            Self::Bool(_) => "true or false",
            Self::Integer(_) => "a whole number",
            Self::Number(_) => "a number",
            Self::Text(_) => "a text",
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Number(value) => write!(f, "{value}"),
            Self::Text(value) => write!(f, "`{value}`"),
        }
    }
}

/// One parameter of an offer. Its type is the type of its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `[a-z][a-z0-9_]*`, with its unit: `gate_mm`.
    pub name: String,
    /// One line.
    pub summary: String,
    /// The default; of a required parameter: an example, used by the conformance check.
    pub value: Value,
    /// Smallest and largest number, both included.
    pub limits: Option<(f64, f64)>,
    /// The texts there are; empty: any.
    pub choices: Vec<String>,
    /// The profile must give it.
    pub required: bool,
}

impl Parameter {
    /// A parameter that may be left out.
    #[must_use]
    pub fn new(name: &str, default: Value, summary: &str) -> Self {
        Self {
            name: name.to_string(),
            summary: summary.to_string(),
            value: default,
            limits: None,
            choices: Vec::new(),
            required: false,
        }
    }

    /// A number that may be left out.
    #[must_use]
    pub fn number(name: &str, default: f64, summary: &str) -> Self {
        Self::new(name, Value::Number(default), summary)
    }

    /// A whole number that may be left out.
    #[must_use]
    pub fn integer(name: &str, default: i64, summary: &str) -> Self {
        Self::new(name, Value::Integer(default), summary)
    }

    /// A switch that may be left out.
    #[must_use]
    pub fn flag(name: &str, default: bool, summary: &str) -> Self {
        Self::new(name, Value::Bool(default), summary)
    }

    /// A text that may be left out.
    #[must_use]
    pub fn text(name: &str, default: &str, summary: &str) -> Self {
        Self::new(name, Value::Text(default.to_string()), summary)
    }

    /// Numbers from `minimum` to `maximum` only, both included.
    #[must_use]
    pub fn between(mut self, minimum: f64, maximum: f64) -> Self {
        self.limits = Some((minimum, maximum));
        self
    }

    /// One of these texts only.
    #[must_use]
    pub fn one_of(mut self, choices: &[&str]) -> Self {
        self.choices = choices.iter().map(ToString::to_string).collect();
        self
    }

    /// The profile must give it; the value is an example.
    #[must_use]
    pub fn required(mut self) -> Self {
        self.required = true;
        self
    }
}

/// One estimator, reader, report writer or joint effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Offer {
    /// What it is.
    pub kind: Kind,
    /// `[a-z][a-z0-9_-]*`: how a profile names it.
    pub name: String,
    /// One line.
    pub summary: String,
    /// Publication or document; may be empty.
    pub source: String,
    /// The data an estimator takes; empty for all other kinds.
    pub shapes: Vec<crate::motion::Shape>,
    /// Its parameters, in the order of the values in a call.
    pub parameters: Vec<Parameter>,
    /// Readers: a small valid input for the default parameters.
    pub example: Vec<u8>,
}

impl Offer {
    /// An offer without parameters.
    #[must_use]
    pub fn new(kind: Kind, name: &str, summary: &str) -> Self {
        Self {
            kind,
            name: name.to_string(),
            summary: summary.to_string(),
            source: String::new(),
            shapes: Vec::new(),
            parameters: Vec::new(),
            example: Vec::new(),
        }
    }

    /// Where the method is described.
    #[must_use]
    pub fn from_source(mut self, source: &str) -> Self {
        self.source = source.to_string();
        self
    }

    /// The data an estimator takes.
    #[must_use]
    pub fn takes(mut self, shapes: &[crate::motion::Shape]) -> Self {
        self.shapes = shapes.to_vec();
        self
    }

    /// One more parameter.
    #[must_use]
    pub fn with(mut self, parameter: Parameter) -> Self {
        self.parameters.push(parameter);
        self
    }

    /// A small valid input of a reader.
    #[must_use]
    pub fn with_example(mut self, example: &[u8]) -> Self {
        self.example = example.to_vec();
        self
    }
}
