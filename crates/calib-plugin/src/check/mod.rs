//! Conformance of a plugin: does it keep the contract on data that it has never seen?
//!
//! ```text
//! loads · describes fast · loads again · golden cases · degenerate data · covariance · same answer twice · eight threads ·
//! stops when cancelled · huge input · memory
//! ```
//!
//! Times are measured only to compare them with a limit; they stand in no result. A call that does not return is left
//! behind in its thread. Libraries are never unloaded, so *loads again* means: opened and described again in the same
//! process, as other parts of a program would do.

mod cases;
mod covariance;
mod effects;
mod labels;
mod memory;
mod motions;
mod subject;
mod table;
mod watch;

use std::{sync::Arc, time::Duration};

use crate::{
    answer::Failure,
    host::{Cancel, Control, Host, LoadedPlugin, PluginError},
    offer::Kind,
};
use cases::Cases;
use covariance::Stated;
pub use labels::reserved_label;
use subject::{Input, Reply, Subject};
pub use table::{Conformance, End, Outcome, Row, Step};

/// Threads of the concurrent test, and calls of each.
const THREADS: (usize, usize) = (8, 20);
/// Times that a plugin is opened again.
const REPEATS: usize = 20;

/// What counts as too slow, and what as huge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// For `describe`. 100 ms: it does no work, and `calib plugins` calls it for every plugin.
    pub describe: Duration,
    /// For one call, the huge one included.
    pub call: Duration,
    /// From the wish to stop to the return. Plugins ask every 50 ms; the rest is for a busy machine.
    pub cancel: Duration,
    /// Samples of a huge motion; readers and writers get sixteen times as many bytes.
    pub huge: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            describe: Duration::from_millis(100),
            call: Duration::from_secs(60),
            cancel: Duration::from_secs(2),
            huge: 200_000,
        }
    }
}

/// The tests that are made, told step by step.
struct Tests<'a> {
    table: Conformance,
    told: &'a mut dyn FnMut(&Step),
}

impl Tests<'_> {
    fn take(&mut self, step: &Step) {
        self.table.take(step);
        (self.told)(step);
    }

    /// A test begins, or one of its calls.
    fn begin(&mut self, subject: &str, test: &str, case: &str) {
        self.take(&Step::Begun {
            subject: subject.to_owned(),
            test: test.to_owned(),
            case: case.to_owned(),
        });
    }

    fn made(&mut self, subject: &str, test: &str, outcome: Outcome, detail: String) {
        self.take(&Step::Made(Row {
            subject: subject.to_owned(),
            test: test.to_owned(),
            outcome,
            detail,
        }));
    }

    fn note(&mut self, subject: &str, test: &str, result: Result<(), String>) {
        match result {
            Ok(()) => self.made(subject, test, Outcome::Passed, String::new()),
            Err(detail) => self.made(subject, test, Outcome::Failed, detail),
        }
    }

    /// Makes a test of one call.
    fn test(&mut self, subject: &str, test: &str, made: impl FnOnce() -> Result<(), String>) {
        self.begin(subject, test, "");
        self.note(subject, test, made());
    }

    fn skip(&mut self, subject: &str, test: &str, why: &str) {
        self.made(subject, test, Outcome::Skipped, why.to_owned());
    }
}

/// Tests a plugin in this process, which a plugin with a fault may end.
#[must_use]
pub fn check(host: &Host, name_or_path: &str, limits: &Limits) -> Conformance {
    check_told(host, name_or_path, limits, &mut |_| ())
}

/// The same, told step by step, so that another process knows where a plugin ended this one.
pub fn check_told(
    host: &Host,
    name_or_path: &str,
    limits: &Limits,
    told: &mut dyn FnMut(&Step),
) -> Conformance {
    let load = || host.load(name_or_path, None);
    checked(Conformance::new(name_or_path), load, limits, told)
}

/// Tests a plugin that is linked into the program.
#[must_use]
pub fn check_adopted(entry: &'static crate::abi::Entry, limits: &Limits) -> Conformance {
    let table = Conformance::new("in the program");
    checked(table, || Host::adopt(entry), limits, &mut |_| ())
}

fn checked(
    table: Conformance,
    load: impl Fn() -> Result<LoadedPlugin, PluginError>,
    limits: &Limits,
    told: &mut dyn FnMut(&Step),
) -> Conformance {
    let mut tests = Tests { table, told };
    tests.begin("plugin", "loads", "");
    match load() {
        Ok(plugin) => {
            tests.note("plugin", "loads", Ok(()));
            check_loaded(&mut tests, &plugin, load, limits);
        }
        Err(error) => tests.note("plugin", "loads", Err(error.to_string())),
    }
    tests.take(&Step::Done);
    tests.table
}

fn check_loaded(
    table: &mut Tests<'_>,
    plugin: &LoadedPlugin,
    again: impl Fn() -> Result<LoadedPlugin, PluginError>,
    limits: &Limits,
) {
    let name = format!("{} {}", plugin.description.name, plugin.description.version);
    table.take(&Step::Named(name));
    for skipped in &plugin.description.skipped {
        table.skip("plugin", "understood", skipped);
    }
    let described = plugin.described_in <= limits.describe;
    table.note(
        "plugin",
        "describes fast",
        described
            .then_some(())
            .ok_or_else(|| format!("{:?}, at most {:?}", plugin.described_in, limits.describe)),
    );
    let same = |_| match again() {
        Ok(other) if other.description == plugin.description => Ok(()),
        Ok(_) => Err("described itself differently".to_string()),
        Err(error) => Err(error.to_string()),
    };
    table.test("plugin", "loads again", || (0..REPEATS).try_for_each(same));

    for subject in Subject::all(plugin) {
        check_offer(table, &Arc::new(subject), limits);
    }
}

/// All tests of one offer; a call that hangs ends them.
fn check_offer(table: &mut Tests<'_>, subject: &Arc<Subject>, limits: &Limits) {
    let title = subject.title.as_str();
    let cases = Cases::of(subject, limits.huge);

    if check_cases(table, subject, &cases, limits) {
        table.skip(title, "the rest", "a call did not return");
        return;
    }
    let ask = |input: Input| {
        let reply = watch::call(subject, &input, &Cancel::new(), limits.call);
        reply.map_err(|late| late.to_string())?
    };
    if matches!(subject.offer.kind, Kind::Cor | Kind::Aor) {
        let (shapes, axis) = (&subject.offer.shapes, subject.offer.kind == Kind::Aor);
        table.begin(title, "covariance", "");
        match covariance::judge(&ask, shapes, axis, limits.call) {
            Stated::Right => table.note(title, "covariance", Ok(())),
            Stated::Wrong(why) => table.note(title, "covariance", Err(why)),
            Stated::Unknown(why) => table.skip(title, "covariance", &why),
        }
    }
    if subject.offer.kind == Kind::Effect {
        table.test(title, "of one state alone", || effects::alone(&ask));
        table.test(title, "without jumps", || effects::smooth(&ask));
    }
    let Some(usual) = cases
        .golden
        .first()
        .or(cases.degenerate.first())
        .map(|c| c.input.clone())
    else {
        return;
    };
    // Text of the answer with all digits: the same means the same bits.
    let answer = || format!("{:?}", subject.call(&usual, &Control::default()));
    check_repeats(table, title, &answer);

    table.begin(title, "stops when cancelled", "");
    let stopped = stops_when_cancelled(subject, &cases, limits);
    let hangs = stopped.is_err();
    table.note(title, "stops when cancelled", stopped);
    if hangs {
        table.skip(title, "huge input", "the call before it failed");
        table.skip(title, "memory", "the call before it failed");
        return;
    }
    table.test(title, "huge input", || {
        watch::call(subject, &cases.huge, &Cancel::new(), limits.call)
            .map_err(|late| late.to_string())
            .and_then(|reply| reply.map(drop))
    });

    table.begin(title, "memory", "");
    match memory::growth(|| drop(answer())) {
        Ok(result) => table.note(title, "memory", result),
        Err(why) => table.skip(title, "memory", why),
    }
}

/// The golden and the degenerate cases; whether a call did not return.
fn check_cases(
    table: &mut Tests<'_>,
    subject: &Arc<Subject>,
    cases: &Cases,
    limits: &Limits,
) -> bool {
    let mut hangs = false;
    for (test, list) in [
        ("golden cases", &cases.golden),
        ("degenerate data", &cases.degenerate),
    ] {
        if list.is_empty() {
            table.skip(&subject.title, test, "a reader without an example");
            continue;
        }
        let result = list.iter().try_for_each(|case| {
            table.begin(&subject.title, test, &case.name);
            let said = watch::call(subject, &case.input, &Cancel::new(), limits.call)
                .map_err(|late| late.to_string());
            hangs |= said.is_err();
            said.and_then(|reply| (case.judge)(&reply?))
                .map_err(|problem| format!("{}: {problem}", case.name))
        });
        table.note(&subject.title, test, result);
    }
    hangs
}

/// Where two answers begin to differ: an array of regressors fills a screen.
fn difference(first: &str, second: &str) -> String {
    /// Characters that are shown of each.
    const SHOWN: usize = 120;
    let mut both = first.chars().zip(second.chars());
    let place = both.position(|(a, b)| a != b).unwrap_or(0);
    let from = place.saturating_sub(SHOWN / 3);
    let part = |text: &str| -> String { text.chars().skip(from).take(SHOWN).collect() };
    let before = if from > 0 { "…" } else { "" };
    format!(
        "first {before}{}, then {before}{}",
        part(first),
        part(second)
    )
}

/// The same call gives the same answer, one after the other and in eight threads at once.
fn check_repeats(table: &mut Tests<'_>, title: &str, answer: &(impl Fn() -> String + Sync)) {
    table.begin(title, "same answer twice", "");
    let first = answer();
    let same = |second: String| {
        if second == first {
            Ok(())
        } else {
            Err(difference(&first, &second))
        }
    };
    table.note(
        title,
        "same answer twice",
        (0..3).try_for_each(|_| same(answer())),
    );

    table.begin(title, "eight threads", "");
    let (threads, calls) = THREADS;
    let answers: Vec<String> = std::thread::scope(|scope| {
        let one = || (0..calls).map(|_| answer()).collect::<Vec<_>>();
        let running: Vec<_> = (0..threads).map(|_| scope.spawn(one)).collect();
        running
            .into_iter()
            .flat_map(|thread| {
                thread
                    .join()
                    .unwrap_or_else(|_| vec!["a panic".to_string()])
            })
            .collect()
    });
    table.note(
        title,
        "eight threads",
        answers.into_iter().try_for_each(same),
    );
}

/// A call on huge input returns in time, both cancelled from the start and cancelled while it works.
fn stops_when_cancelled(
    subject: &Arc<Subject>,
    cases: &Cases,
    limits: &Limits,
) -> Result<(), String> {
    let cancelled = Cancel::new();
    cancelled.cancel();
    watch::call(subject, &cases.huge, &cancelled, limits.cancel)
        .and_then(|_| {
            let cancel = Cancel::new();
            let later = cancel.clone();
            std::thread::spawn(move || {
                std::thread::sleep(Duration::from_millis(20));
                later.cancel();
            });
            watch::call(
                subject,
                &cases.huge,
                &cancel,
                limits.cancel + Duration::from_millis(20),
            )
        })
        .map_err(|late| late.to_string())
        .and_then(|reply| reply.map(drop))
}

/// A reply, or the fault of a plugin; a refusal with a reason is a reply.
fn judged(reply: Result<Reply, PluginError>) -> Result<Reply, String> {
    match reply {
        Err(PluginError::Call {
            failure: failure @ (Failure::Contract(_) | Failure::Panicked(_)),
            ..
        }) => Err(failure.to_string()),
        Err(error) => Ok(Reply::Refused(error.to_string())),
        Ok(reply) => Ok(reply),
    }
}
