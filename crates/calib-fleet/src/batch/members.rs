//! Which robots a fleet has: a YAML list, or a pattern of profiles.

use std::path::{Path, PathBuf};

use calib_files::{check_name, folder_of, input};
use serde::Deserialize;

use super::error::{BatchError, FleetFault};

/// One robot of a fleet. All of them are in memory for as long as the batch runs: each text takes what it is long, and no more.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Unique in the fleet; the name of its folder of results.
    pub name: Box<str>,
    /// Robots of one series are compared; none: the robot's name in its profile.
    pub series: Option<Box<str>>,
    /// Its profile.
    pub profile: Box<Path>,
    /// Results of its last calibration.
    pub earlier: Option<Box<Path>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFleet {
    calib_fleet: u32,
    robots: Vec<RawMember>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMember {
    profile: String,
    name: Option<String>,
    series: Option<String>,
    earlier: Option<String>,
}

/// Robots of a fleet are listed by a program; anything larger is another kind of file.
const LARGEST: u64 = 1 << 28;

/// The robots of a fleet in their order. `earlier`: the folder of an earlier batch, for robots whose own is not stated.
///
/// # Errors
/// [`BatchError`] for a file that is not a list of robots, a pattern without a profile, and names that no folder can have or that two
/// robots have.
pub fn members(fleet: &str, earlier: Option<&Path>) -> Result<Vec<Member>, BatchError> {
    let is_pattern = fleet.contains(['*', '?']) && !Path::new(fleet).exists();
    let mut members = match is_pattern {
        true => of_pattern(fleet)?,
        false => of_list(fleet)?,
    };
    let failed = |fault| BatchError::fleet(fleet, fault);
    for member in &members {
        check_name(&member.name).map_err(|_| failed(FleetFault::Name(member.name.to_string())))?;
    }
    if let Some([first, second]) = same_folder(&members) {
        return Err(failed(FleetFault::SameName {
            name: second.name.to_string(),
            profiles: [first, second].map(|member| member.profile.to_path_buf()),
        }));
    }
    if members.is_empty() {
        return Err(failed(FleetFault::Empty));
    }
    if let Some(folder) = earlier.filter(|folder| !folder.join(super::ROBOTS).is_dir()) {
        let folder = folder.display().to_string();
        return Err(BatchError::fleet(&folder, FleetFault::NoBatch));
    }
    for member in &mut members {
        let last = earlier.map(|folder| folder.join(super::ROBOTS).join(&*member.name));
        // A robot that failed then has a folder without a report: it is named among those that cannot be compared.
        let there = |folder: &PathBuf| folder.is_dir();
        let last = last.filter(there).map(PathBuf::into_boxed_path);
        member.earlier = member.earlier.take().or(last);
    }
    Ok(members)
}

/// The first robot whose folder is that of an earlier one, where file systems ignore case, and that one before it. Names are compared in place: copies of
/// all of them would stay in the memory of a batch.
fn same_folder(members: &[Member]) -> Option<[&Member; 2]> {
    let folder = |k: usize| members[k].name.chars().flat_map(char::to_lowercase);
    let mut order: Vec<usize> = (0..members.len()).collect();
    order.sort_by(|&a, &b| folder(a).cmp(folder(b)));
    let same = order.windows(2).filter_map(|pair| match pair {
        &[first, second] if folder(first).eq(folder(second)) => Some([first, second]),
        _ => None,
    });
    let first = same.min_by_key(|[_, second]| *second)?;
    Some(first.map(|k| &members[k]))
}

fn of_list(fleet: &str) -> Result<Vec<Member>, BatchError> {
    let failed = |fault| BatchError::fleet(fleet, fault);
    let path = Path::new(fleet);
    let text = input::read_text(path, LARGEST).map_err(|e| failed(FleetFault::Unreadable(e)))?;
    let raw: RawFleet = serde_saphyr::from_str(&text)
        .map_err(|error| failed(FleetFault::NotAList(error.to_string())))?;
    if raw.calib_fleet != 1 {
        return Err(failed(FleetFault::Version(raw.calib_fleet)));
    }
    let folder = folder_of(path);
    let member = |raw: RawMember| {
        let profile = joined(folder, &raw.profile);
        Member {
            name: raw.name.unwrap_or_else(|| stem(&profile)).into(),
            series: raw.series.map(String::into_boxed_str),
            earlier: raw.earlier.map(|earlier| joined(folder, &earlier).into()),
            profile: profile.into(),
        }
    };
    Ok(raw.robots.into_iter().map(member).collect())
}

/// Relative to the list; without `./` before it.
fn joined(folder: &Path, path: &str) -> PathBuf {
    match folder == Path::new(".") {
        true => PathBuf::from(path),
        false => folder.join(path),
    }
}

fn stem(profile: &Path) -> String {
    let stem = profile.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// Profiles are called by their names, or by those of their folders where all have the same.
fn of_pattern(pattern: &str) -> Result<Vec<Member>, BatchError> {
    let profiles = matching(Path::new(pattern));
    let first = profiles.first().map(|p| stem(p));
    let one_name = profiles.len() > 1 && profiles.iter().all(|p| Some(stem(p)) == first);
    let name = |profile: &Path| match one_name {
        true => stem_of_folder(profile),
        false => stem(profile),
    };
    let member = |profile: PathBuf| Member {
        name: name(&profile).into(),
        series: None,
        profile: profile.into(),
        earlier: None,
    };
    Ok(profiles.into_iter().map(member).collect())
}

fn stem_of_folder(profile: &Path) -> String {
    let folder = folder_of(profile).file_name().unwrap_or_default();
    folder.to_string_lossy().into_owned()
}

/// Files whose path matches, in the order of their paths: `*` and `?` stand for characters of one name.
fn matching(pattern: &Path) -> Vec<PathBuf> {
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        let text = part.as_os_str().to_string_lossy();
        if !text.contains(['*', '?']) {
            found.iter_mut().for_each(|path| path.push(part));
            continue;
        }
        let below = |folder: &PathBuf| {
            let here = match folder.as_os_str().is_empty() {
                true => Path::new("."),
                false => folder,
            };
            let names = std::fs::read_dir(here).into_iter().flatten().flatten();
            let names = names.map(|entry| entry.file_name());
            let mut names: Vec<_> = names
                .filter(|name| matches(text.as_bytes(), name.to_string_lossy().as_bytes()))
                .collect();
            names.sort();
            let paths = names.into_iter().map(|name| folder.join(name));
            paths.collect::<Vec<_>>()
        };
        found = found.iter().flat_map(below).collect();
    }
    found.retain(|path| path.is_file());
    found
}

/// Whether a name matches; a hidden file only where the pattern begins with a point.
fn matches(pattern: &[u8], name: &[u8]) -> bool {
    if name.first() == Some(&b'.') && pattern.first() != Some(&b'.') {
        return false;
    }
    // Where the last `*` was, and up to where it has taken the name.
    let (mut p, mut n) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some(b'*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(c) if *c == b'?' || *c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => {
                let Some((at, taken)) = star else {
                    return false;
                };
                star = Some((at, taken + 1));
                p = at + 1;
                n = taken + 1;
            }
        }
    }
    pattern[p..].iter().all(|c| *c == b'*')
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn patterns_match_names() {
        let yes = [
            ("*", "a"),
            ("*.yaml", "r2.yaml"),
            ("r?.y*l", "r2.yaml"),
            ("a*b*c", "aXbYbc"),
            ("", ""),
        ];
        let no = [
            ("*", ".a"),
            ("*.yaml", "r2.yml"),
            ("r?", "r"),
            ("a*b", "abc"),
            ("", "a"),
        ];
        for (pattern, name) in yes {
            assert!(
                matches(pattern.as_bytes(), name.as_bytes()),
                "{pattern} {name}"
            );
        }
        for (pattern, name) in no {
            assert!(
                !matches(pattern.as_bytes(), name.as_bytes()),
                "{pattern} {name}"
            );
        }
    }
}
