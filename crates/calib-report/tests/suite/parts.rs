//! A long text in parts, each short enough to review as a snapshot.

/// Lines that a reviewer reads in one snapshot.
const MOST: usize = 195;

/// The text cut before the first line that begins with each of `cuts`, in order; every line is in exactly one part.
pub fn parts(text: &str, cuts: &[&str]) -> Vec<String> {
    let mut parts = vec![String::new()];
    let mut cuts = cuts.iter();
    let mut next = cuts.next();
    for line in text.lines() {
        if next.is_some_and(|cut| line.starts_with(cut)) {
            parts.push(String::new());
            next = cuts.next();
        }
        let part = parts.last_mut().expect("at least one part");
        part.push_str(line);
        part.push('\n');
    }
    assert_eq!(next, None, "a cut that no line begins with");
    for (i, part) in parts.iter().enumerate() {
        let lines = part.lines().count();
        assert!(lines <= MOST, "part {} has {lines} lines: cut it", i + 1);
    }
    parts
}
