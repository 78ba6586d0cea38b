//! What a person should know about recordings, robots and results before trusting a calibration.
//!
//! A [`Finding`] is data: an [`Id`] from the [`catalog`], a [`Severity`], a [`Subject`], the rows it is about, and
//! named values with units ([`Facts`]). The code that makes a finding writes no sentences. The catalog holds the
//! sentence and the remedy of every id; [`Finding::text`] and [`Finding::remedy`] fill the values in:
//!
//! ```
//! use calib_finding::{Fact, Finding, Severity, Subject, catalog};
//!
//! let finding = Finding::new(catalog::BODY_NOT_RIGID, Subject::body("hand").in_recording("sweep"))
//!     .with("marker", Fact::name("hand_2"))
//!     .with("distance", Fact::meters(0.0042))
//!     .with("limit", Fact::meters(0.003));
//! assert_eq!(finding.id.as_str(), "body-not-rigid");
//! assert_eq!(finding.severity, Severity::Warning);
//! assert_eq!(finding.subject.to_string(), "sweep: hand");
//! assert_eq!(finding.text(), "Marker `hand_2` moves on its body by 4.2 mm (limit 3 mm).");
//! ```
//!
//! Programs compare ids, subjects and facts, never texts. In JSON a finding has the keys `id`, `severity`, `subject`,
//! `rows`, `text`, `remedy`, `facts` and `about` (the typed subject).
//!
//! The crate also has the one [`Unit`] of numbers whose kind is only known at run time, [`number`] for their digits, [`nearest_word`] for
//! remedies of the form *did you mean*, and [`printable`] for what goes to a terminal.

pub mod catalog;
mod fact;
mod finding;
mod nearest;
pub mod number;
mod printable;
mod shell;
mod subject;
mod template;
mod unit;

pub use catalog::Id;
pub use fact::{Fact, Facts};
pub use finding::{Finding, Severity};
pub use nearest::nearest_word;
pub use printable::{STYLES, cell, from_cell, printable, printable_in_color, printable_line};
pub use shell::{shell_path, shell_word};
pub use subject::{About, Subject};
pub use unit::Unit;
