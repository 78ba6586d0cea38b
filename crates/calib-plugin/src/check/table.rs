//! What the tests of a plugin found, and how they tell of it one by one.

use std::fmt;

/// How a test ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// As the contract says.
    Passed,
    /// Otherwise.
    Failed,
    /// It could not be made; the detail says why.
    Skipped,
}

impl Outcome {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Passed, Self::Failed, Self::Skipped];

    /// `ok`, `FAILED` or `skipped`.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAILED",
            Self::Skipped => "skipped",
        }
    }
}

/// One test.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// The plugin, or one of its offers.
    pub subject: String,
    /// What was tested.
    pub test: String,
    /// How it ended.
    pub outcome: Outcome,
    /// Why, when it did not pass.
    pub detail: String,
}

/// All tests of one plugin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Conformance {
    /// Its name, or what was asked for when it did not load.
    pub plugin: String,
    /// In the order they were made.
    pub rows: Vec<Row>,
    /// Whether the plugin ended the program that made the tests.
    pub ended: bool,
}

impl Conformance {
    /// True when nothing failed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.rows.iter().all(|row| row.outcome != Outcome::Failed)
    }

    /// The program's exit code: 0, or 6 when something failed.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        if self.passed() { 0 } else { 6 }
    }
}

impl fmt::Display for Conformance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |of: fn(&Row) -> usize, head: usize| {
            self.rows.iter().map(of).max().unwrap_or(0).max(head)
        };
        let subject = width(|row| row.subject.chars().count(), "offer".len());
        let test = width(|row| row.test.chars().count(), "test".len());
        writeln!(f, "plugin {}", self.plugin)?;
        writeln!(f, "{:subject$}  {:test$}  result", "offer", "test")?;
        for row in &self.rows {
            write!(
                f,
                "{:subject$}  {:test$}  {}",
                row.subject,
                row.test,
                row.outcome.word()
            )?;
            match row.detail.as_str() {
                "" => writeln!(f)?,
                detail => writeln!(f, ": {detail}")?,
            }
        }
        let count = |outcome| {
            self.rows
                .iter()
                .filter(|row| row.outcome == outcome)
                .count()
        };
        let (failed, skipped) = (count(Outcome::Failed), count(Outcome::Skipped));
        write!(
            f,
            "{} passed, {failed} failed, {skipped} skipped",
            count(Outcome::Passed)
        )
    }
}

/// One step of the tests: the program that makes them may be ended by the plugin, and another one wants to know where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Name and version of the plugin, once it is known.
    Named(String),
    /// A test begins.
    Begun {
        /// The plugin, or one of its offers.
        subject: String,
        /// What is tested.
        test: String,
        /// The data of this call; empty where the test has only one.
        case: String,
    },
    /// A test was made.
    Made(Row),
    /// All tests were made.
    Done,
}

impl Conformance {
    /// Of a plugin of which nothing is known yet.
    #[must_use]
    pub fn new(plugin: &str) -> Self {
        Self {
            plugin: plugin.to_owned(),
            rows: Vec::new(),
            ended: false,
        }
    }

    /// Takes a step of the tests that another program makes.
    pub fn take(&mut self, step: &Step) {
        match step {
            Step::Named(plugin) => self.plugin.clone_from(plugin),
            Step::Made(row) => self.rows.push(row.clone()),
            Step::Begun { .. } | Step::Done => {}
        }
    }

    /// The program that makes the tests was ended in this step, by this signal or with this code: the test failed.
    pub fn ended(&mut self, last: Option<&Step>, end: End) {
        let (subject, test, case) = match last {
            Some(Step::Begun {
                subject,
                test,
                case,
            }) => (subject.as_str(), test.as_str(), case.as_str()),
            _ => ("plugin", "ends", ""),
        };
        let place = match case {
            "" => String::new(),
            case => format!("{case}: "),
        };
        self.ended = true;
        self.rows.push(Row {
            subject: subject.to_owned(),
            test: test.to_owned(),
            outcome: Outcome::Failed,
            detail: format!("{place}{end}"),
        });
        self.rows.push(Row {
            subject: subject.to_owned(),
            test: "the rest".to_owned(),
            outcome: Outcome::Skipped,
            detail: "the plugin ended the program".to_owned(),
        });
    }
}

/// How a plugin ended the program that called it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// By a signal.
    Signal(i32),
    /// With this exit code, in the middle of the tests.
    Code(i32),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Number on Linux, name and usual cause of the signals that programs end by. Elsewhere the bus error has another number, and then no cause.
        const SIGNALS: [(i32, &str, &str); 6] = [
            (
                4,
                "SIGILL",
                "built for another processor, or a trap of the compiler after undefined behavior",
            ),
            (
                6,
                "SIGABRT",
                "a failed assertion, an exception that left the plugin, or memory that was freed twice",
            ),
            (7, "SIGBUS", MEMORY),
            (8, "SIGFPE", "an integer divided by zero"),
            (
                9,
                "SIGKILL",
                "more memory than the machine has, and the system ended it",
            ),
            (11, "SIGSEGV", MEMORY),
        ];
        const MEMORY: &str = "a pointer of the input that is NULL because the offer did not declare that it needs it, or an index past the number of samples";
        match self {
            Self::Signal(signal) => {
                write!(f, "ended by signal {signal}")?;
                match SIGNALS.iter().find(|(number, ..)| number == signal) {
                    Some((_, name, cause)) => write!(f, " ({name}); the usual cause: {cause}"),
                    None => Ok(()),
                }
            }
            Self::Code(code) => write!(
                f,
                "ended the program with code {code}; a plugin returns a status, it never calls exit"
            ),
        }
    }
}
