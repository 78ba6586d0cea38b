//! The fields of a line: words, numbers and blocks in brackets.

use super::super::common::unexpected;
use crate::error::Placed;
use crate::text::{Number, number};

/// A line's fields, one after the other.
pub(super) struct Fields<'a> {
    pub line: u64,
    pub rest: &'a str,
}

impl<'a> Fields<'a> {
    pub(super) fn word(&mut self) -> Option<&'a str> {
        let rest = self.rest.trim_start();
        let end = rest
            .find(|c: char| c.is_ascii_whitespace() || c == '[')
            .unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    pub(super) fn value(&mut self, what: &str) -> Placed<f64> {
        let word = self.word().unwrap_or("");
        match number(word) {
            Number::Value(value) => Ok(value),
            _ => unexpected(self.line, word, what),
        }
    }

    /// A whole number, ≥ 0.
    pub(super) fn count(&mut self, what: &str) -> Placed<u64> {
        let word = self.word().unwrap_or("");
        word.parse().or_else(|_| unexpected(self.line, word, what))
    }

    /// The numbers of the next `[…]`.
    pub(super) fn block(&mut self, what: &str) -> Placed<Vec<f64>> {
        let rest = self.rest.trim_start();
        let inner = rest.strip_prefix('[').and_then(|rest| rest.split_once(']'));
        let Some((inner, rest)) = inner else {
            return unexpected(self.line, rest, &format!("`[{what}]`"));
        };
        self.rest = rest;
        let mut numbers = Vec::new();
        for word in inner.split_ascii_whitespace() {
            match number(word) {
                Number::Value(value) => numbers.push(value),
                _ => return unexpected(self.line, word, &format!("a number of `[{what}]`")),
            }
        }
        Ok(numbers)
    }
}
