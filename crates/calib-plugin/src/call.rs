//! What every call is given beside its data: values of parameters, cancellation, progress.

use crate::{
    answer::Failure,
    offer::{Parameter, Value},
};

/// One call.
#[derive(Clone, Copy)]
pub struct Call<'a> {
    parameters: &'a [Parameter],
    values: &'a [Value],
    cancelled: &'a (dyn Fn() -> bool + Sync),
    progress: &'a (dyn Fn(f64, &str) + Sync),
}

impl<'a> Call<'a> {
    /// A call with these values, one for each parameter.
    #[must_use]
    pub fn new(
        parameters: &'a [Parameter],
        values: &'a [Value],
        cancelled: &'a (dyn Fn() -> bool + Sync),
        progress: &'a (dyn Fn(f64, &str) + Sync),
    ) -> Self {
        Self {
            parameters,
            values,
            cancelled,
            progress,
        }
    }

    /// A call with these values that nobody cancels or watches: for an author's tests.
    #[must_use]
    pub fn quiet(parameters: &'a [Parameter], values: &'a [Value]) -> Self {
        Self::new(parameters, values, &|| false, &|_, _| {})
    }

    /// The values, in the order of the parameters.
    #[must_use]
    pub fn values(&self) -> &'a [Value] {
        self.values
    }

    /// Stops a computation that nobody waits for any more: `call.keep_going()?` at least every 50 ms.
    ///
    /// # Errors
    /// [`Failure::Cancelled`].
    pub fn keep_going(&self) -> Result<(), Failure> {
        if (self.cancelled)() {
            Err(Failure::Cancelled)
        } else {
            Ok(())
        }
    }

    /// How far, 0 to 1, and at what.
    pub fn progress(&self, fraction: f64, text: &str) {
        (self.progress)(fraction, text);
    }

    /// The value of a number.
    ///
    /// # Errors
    /// [`Failure::BadParameter`] when no such number is described.
    pub fn number(&self, name: &str) -> Result<f64, Failure> {
        match self.value(name)? {
            Value::Number(value) => Ok(*value),
            other => Err(wrong(name, "a number", other)),
        }
    }

    /// The value of a whole number.
    ///
    /// # Errors
    /// [`Failure::BadParameter`] when no such whole number is described.
    pub fn integer(&self, name: &str) -> Result<i64, Failure> {
        match self.value(name)? {
            Value::Integer(value) => Ok(*value),
            other => Err(wrong(name, "a whole number", other)),
        }
    }

    /// The value of a switch.
    ///
    /// # Errors
    /// [`Failure::BadParameter`] when no such switch is described.
    pub fn flag(&self, name: &str) -> Result<bool, Failure> {
        match self.value(name)? {
            Value::Bool(value) => Ok(*value),
            other => Err(wrong(name, "true or false", other)),
        }
    }

    /// The value of a text.
    ///
    /// # Errors
    /// [`Failure::BadParameter`] when no such text is described.
    pub fn text(&self, name: &str) -> Result<&'a str, Failure> {
        match self.value(name)? {
            Value::Text(value) => Ok(value),
            other => Err(wrong(name, "a text", other)),
        }
    }

    fn value(&self, name: &str) -> Result<&'a Value, Failure> {
        self.parameters
            .iter()
            .zip(self.values)
            .find_map(|(parameter, value)| (parameter.name == name).then_some(value))
            .ok_or_else(|| Failure::BadParameter(format!("there is no parameter `{name}`")))
    }
}

fn wrong(name: &str, wanted: &str, got: &Value) -> Failure {
    Failure::BadParameter(format!(
        "parameter `{name}` is {}, not {wanted}",
        got.type_name()
    ))
}
