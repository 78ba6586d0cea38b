//! The description of a plugin's offers as C structs, built once from the safe one.

use std::{
    ffi::{CStr, CString, c_char, c_void},
    panic::catch_unwind,
};

use crate::{
    abi,
    effect::EffectTerm,
    offer::{Kind, Offer, Value},
};

/// The function table of one offer.
enum Table {
    Cor(Box<abi::Cor1>),
    Aor(Box<abi::Aor1>),
    Reader(Box<abi::Reader1>),
    Report(Box<abi::Report1>),
    Effect(Box<abi::Effect1>),
}

impl Table {
    fn pointer(&self) -> *const c_void {
        match self {
            Self::Cor(table) => std::ptr::from_ref(&**table).cast(),
            Self::Aor(table) => std::ptr::from_ref(&**table).cast(),
            Self::Reader(table) => std::ptr::from_ref(&**table).cast(),
            Self::Report(table) => std::ptr::from_ref(&**table).cast(),
            Self::Effect(table) => std::ptr::from_ref(&**table).cast(),
        }
    }
}

/// One offer with its table.
pub struct Item {
    offer: Offer,
    table: Table,
}

impl Item {
    /// A center estimator.
    #[must_use]
    pub fn cor(offer: Offer, fit: abi::Fit<abi::CorResult>) -> Self {
        Self {
            offer,
            table: Table::Cor(estimator(fit)),
        }
    }

    /// An axis estimator.
    #[must_use]
    pub fn aor(offer: Offer, fit: abi::Fit<abi::AorResult>) -> Self {
        Self {
            offer,
            table: Table::Aor(estimator(fit)),
        }
    }

    /// A reader.
    #[must_use]
    pub fn reader(
        offer: Offer,
        read: unsafe extern "C" fn(
            *const abi::Call,
            *const abi::Source,
            *const abi::RecordingSink,
        ) -> abi::Status,
        recognizes: unsafe extern "C" fn(*const u8, usize) -> i32,
    ) -> Self {
        let table = abi::Reader1 {
            struct_size: abi::size::<abi::Reader1>(),
            reserved: 0,
            read: Some(read),
            recognizes: Some(recognizes),
        };
        Self {
            offer,
            table: Table::Reader(Box::new(table)),
        }
    }

    /// A report writer.
    #[must_use]
    pub fn report(
        offer: Offer,
        write: unsafe extern "C" fn(
            *const abi::Call,
            *const abi::ReportInput,
            *const abi::FilesSink,
        ) -> abi::Status,
    ) -> Self {
        let table = abi::Report1 {
            struct_size: abi::size::<abi::Report1>(),
            reserved: 0,
            write: Some(write),
        };
        Self {
            offer,
            table: Table::Report(Box::new(table)),
        }
    }

    /// A joint effect.
    #[must_use]
    pub fn effect(offer: Offer, term: EffectTerm, regressors: abi::Regressors) -> Self {
        let table = abi::Effect1 {
            struct_size: abi::size::<abi::Effect1>(),
            depends_on: term.depends_on as i32,
            coefficient: term.coefficient as i32,
            revolute_only: i32::from(term.revolute_only),
            prior_sigma: term.prior_sigma,
            regressors: Some(regressors),
        };
        Self {
            offer,
            table: Table::Effect(Box::new(table)),
        }
    }
}

/// The table of an estimator.
fn estimator<R>(fit: abi::Fit<R>) -> Box<abi::EstimatorTable<R>> {
    Box::new(abi::EstimatorTable {
        struct_size: abi::size::<abi::EstimatorTable<R>>(),
        reserved: 0,
        fit: Some(fit),
    })
}

/// Everything that the C structs point to; made once, never changed, never freed.
pub struct Exported {
    descriptor: Box<abi::Descriptor>,
    items: Vec<Item>,
    // Owners of what the descriptor points to.
    _texts: Vec<CString>,
    _choices: Vec<Vec<*const c_char>>,
    _parameters: Vec<Vec<abi::Parameter>>,
    _offers: Vec<abi::Offer>,
}

// SAFETY: all pointers lead into memory that this struct owns on the heap and nobody changes after `new`.
unsafe impl Send for Exported {}
// SAFETY: as above.
unsafe impl Sync for Exported {}

/// Keeps texts alive while their addresses are handed out: the heap block of a `CString` does not move.
#[derive(Default)]
struct Texts(Vec<CString>);

impl Texts {
    fn keep(&mut self, text: &str) -> *const c_char {
        let text = super::border::c_text(text);
        let pointer = text.as_ptr();
        self.0.push(text);
        pointer
    }
}

impl Exported {
    /// The C form of a description: `[name, version, author, licence]` and the offers.
    #[must_use]
    pub fn new(about: [&str; 4], items: Vec<Item>) -> Self {
        let mut texts = Texts::default();
        let mut choices = Vec::new();
        let mut parameters: Vec<Vec<abi::Parameter>> = Vec::new();
        let mut offers = Vec::new();
        for Item { offer, .. } in &items {
            let list = offer
                .parameters
                .iter()
                .map(|parameter| {
                    let list: Vec<_> = parameter.choices.iter().map(|c| texts.keep(c)).collect();
                    let (minimum, maximum) = parameter.limits.unwrap_or((0.0, 0.0));
                    let out = abi::Parameter {
                        name: texts.keep(&parameter.name),
                        summary: texts.keep(&parameter.summary),
                        value: value(&parameter.value, &mut texts),
                        minimum,
                        maximum,
                        choices: if list.is_empty() {
                            std::ptr::null()
                        } else {
                            list.as_ptr()
                        },
                        choice_count: list.len(),
                        required: i32::from(parameter.required),
                        reserved: 0,
                    };
                    choices.push(list);
                    out
                })
                .collect::<Vec<_>>();
            parameters.push(list);
            let parameters = &parameters[parameters.len() - 1];
            offers.push(abi::Offer {
                kind: texts.keep(offer.kind.id()),
                name: texts.keep(&offer.name),
                summary: texts.keep(&offer.summary),
                source: texts.keep(&offer.source),
                shapes: offer
                    .shapes
                    .iter()
                    .fold(0, |bits, shape| bits | 1 << *shape as u32),
                parameter_size: abi::size::<abi::Parameter>(),
                parameters: parameters.as_ptr(),
                parameter_count: parameters.len(),
                example: offer.example.as_ptr(),
                example_size: offer.example.len(),
            });
        }
        let [name, version, author, licence] = about.map(|text| texts.keep(text));
        let descriptor = Box::new(abi::Descriptor {
            struct_size: abi::size::<abi::Descriptor>(),
            offer_size: abi::size::<abi::Offer>(),
            name,
            version,
            author,
            licence,
            offers: offers.as_ptr(),
            offer_count: offers.len(),
        });
        Self {
            descriptor,
            items,
            _texts: texts.0,
            _choices: choices,
            _parameters: parameters,
            _offers: offers,
        }
    }
}

fn value(value: &Value, texts: &mut Texts) -> abi::Value {
    let mut out = abi::Value {
        kind: 0,
        flag: 0,
        integer: 0,
        number: 0.0,
        text: std::ptr::null(),
    };
    match value {
        Value::Bool(flag) => (out.kind, out.flag) = (abi::BOOL, i32::from(*flag)),
        Value::Integer(integer) => (out.kind, out.integer) = (abi::INTEGER, *integer),
        Value::Number(number) => (out.kind, out.number) = (abi::NUMBER, *number),
        Value::Text(text) => (out.kind, out.text) = (abi::TEXT, texts.keep(text)),
    }
    out
}

/// `describe` of the contract; null when an author's `offer` panicked.
pub fn describe(exported: fn() -> &'static Exported) -> *const abi::Descriptor {
    catch_unwind(|| std::ptr::from_ref(&*exported().descriptor)).unwrap_or(std::ptr::null())
}

/// `find` of the contract.
///
/// # Safety
/// `kind` and `name` are null or texts that end with zero.
#[must_use]
pub unsafe fn find(
    exported: fn() -> &'static Exported,
    kind: *const c_char,
    name: *const c_char,
) -> *const c_void {
    if kind.is_null() || name.is_null() {
        return std::ptr::null();
    }
    // SAFETY: not null, and the caller says that they end with zero.
    let (kind, name) = unsafe { (CStr::from_ptr(kind), CStr::from_ptr(name)) };
    catch_unwind(|| {
        let kind = Kind::from_id(kind.to_str().ok()?)?;
        let name = name.to_str().ok()?;
        let item = exported()
            .items
            .iter()
            .find(|i| i.offer.kind == kind && i.offer.name == name)?;
        Some(item.table.pointer())
    })
    .ok()
    .flatten()
    .unwrap_or(std::ptr::null())
}
