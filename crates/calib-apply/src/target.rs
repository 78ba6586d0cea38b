//! The file that a result is applied to, with the files that it reads.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use calib_urdf::{
    Companion, Companions, Patched, Reads, RobotModel, UrdfEdit, patch_with, patch_yaml,
    references, source,
};
use nalgebra::Isometry3;

use crate::change::FileChange;
use crate::error::ApplyError;
use crate::kind::Kind;
use crate::result::Calibrated;
use crate::revert::{Recorded, record_of, recorded, reverted};

/// A target as read.
#[derive(Debug, Clone)]
pub struct Target {
    /// Where.
    pub path: PathBuf,
    /// Its text, byte for byte.
    pub text: String,
    /// What it is.
    pub kind: Kind,
    /// What a xacro reads.
    pub companions: Companions,
    /// Paths of `companions.yaml`.
    yaml_paths: Vec<PathBuf>,
}

/// A target's files after the edits.
pub(super) struct PatchedTarget {
    pub files: Vec<(PathBuf, String, Patched)>,
    pub before: BTreeMap<String, Isometry3<f64>>,
    pub adds_frames: bool,
}

/// Files that include each other further than this are a circle.
const MOST_INCLUDED: usize = 200;

impl Target {
    /// Reads a target and, for a xacro, the files that it reads.
    ///
    /// # Errors
    /// [`ApplyError`] when it cannot be read as text, or is not XML. Files around it that are not found are no error here.
    pub fn read(path: &Path, yaml: Option<&Path>) -> Result<Self, ApplyError> {
        let name = path.display().to_string();
        let text = source::read_text(path, &name)?;
        let mut target = Self {
            path: path.to_path_buf(),
            text,
            kind: Kind::Yaml,
            companions: Companions::default(),
            yaml_paths: Vec::new(),
        };
        let is_yaml = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("yaml") || e.eq_ignore_ascii_case("yml"));
        if is_yaml {
            return Ok(target);
        }
        target.kind = if calib_urdf::is_xacro(&target.text, &name)? {
            Kind::Xacro
        } else {
            Kind::Urdf
        };
        if target.kind == Kind::Xacro {
            target.follow(path, &name, yaml)?;
        }
        if let (Some(yaml), true) = (yaml, target.yaml_paths.is_empty()) {
            return Err(ApplyError::YamlUnused {
                target: path.to_path_buf(),
                yaml: yaml.to_path_buf(),
            });
        }
        Ok(target)
    }

    /// Finds the files that a xacro reads, and those that they include.
    fn follow(&mut self, path: &Path, name: &str, yaml: Option<&Path>) -> Result<(), ApplyError> {
        let found = references(&self.text, name)?;
        let loads = found.iter().filter(|r| r.reads == Reads::Yaml).count();
        let mut waiting: Vec<(PathBuf, String)> = Vec::new();
        for reference in found {
            let place = match (reference.reads, yaml) {
                (Reads::Yaml, Some(given))
                    if loads == 1 || given.file_name() == file_name(&reference.argument) =>
                {
                    Some(given.to_path_buf())
                }
                _ => resolve(path, &reference.argument),
            };
            match (reference.reads, place) {
                (Reads::Yaml, Some(place)) => {
                    let shown = place.display().to_string();
                    self.companions.yaml.push(Companion {
                        argument: reference.argument,
                        text: source::read_text(&place, &shown)?,
                        name: shown,
                    });
                    self.yaml_paths.push(place);
                }
                (Reads::Include, Some(place)) => waiting.push((place, reference.argument)),
                (Reads::Include, None) => self.companions.unseen.push(reference.argument),
                // Refused only where a number is looked for in it.
                (Reads::Yaml, None) => {}
            }
        }
        let mut seen: Vec<PathBuf> = Vec::new();
        while let Some((place, argument)) = waiting.pop() {
            let shown = place.display().to_string();
            let text = source::read_text(&place, &shown).ok();
            let inner = text.as_ref().and_then(|text| references(text, &shown).ok());
            let (Some(text), Some(inner)) = (text, inner) else {
                self.companions.unseen.push(argument);
                continue;
            };
            let first = !seen.contains(&place);
            if first && seen.len() < MOST_INCLUDED {
                for reference in inner.into_iter().filter(|r| r.reads == Reads::Include) {
                    match resolve(&place, &reference.argument) {
                        Some(next) => waiting.push((next, reference.argument)),
                        None => self.companions.unseen.push(reference.argument),
                    }
                }
            }
            seen.push(place);
            let known = self
                .companions
                .included
                .iter()
                .any(|c| c.argument == argument);
            if !known {
                self.companions.included.push(Companion {
                    argument,
                    name: shown,
                    text,
                });
            }
        }
        Ok(())
    }

    /// Goes back, in memory, behind a change of several files that was stopped after the first of them.
    ///
    /// # Errors
    /// [`ApplyError`] when a record beside a changed file is damaged.
    pub(super) fn recover(&mut self, notes: &mut Vec<String>) -> Result<(), ApplyError> {
        let yaml = self.yaml_paths.iter().zip(&mut self.companions.yaml);
        let mut files = vec![(&self.path, &mut self.text)];
        files.extend(yaml.map(|(path, companion)| (path, &mut companion.text)));
        let stands: Vec<Recorded> = files.iter().map(|(p, t)| recorded(p, t)).collect();
        if !(stands.contains(&Recorded::Before) && stands.contains(&Recorded::After)) {
            return Ok(());
        }
        for ((path, text), stand) in files.into_iter().zip(stands) {
            if stand == Recorded::After {
                *text = reverted(path, text, &record_of(path, text)?)?;
            }
        }
        notes.push("an earlier change was stopped between two files: it was done again".to_owned());
        Ok(())
    }

    /// The target and the YAMLs that it loads.
    pub(super) fn paths(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.path).chain(&self.yaml_paths)
    }

    /// Goes back, in memory, to the first originals of files that hold an earlier change; whether there was any.
    ///
    /// # Errors
    /// [`ApplyError`] when a record beside a changed file is damaged.
    pub(super) fn go_back(&mut self) -> Result<bool, ApplyError> {
        let yaml = self.yaml_paths.iter().zip(&mut self.companions.yaml);
        let mut files = vec![(&self.path, &mut self.text)];
        files.extend(yaml.map(|(path, companion)| (path, &mut companion.text)));
        let mut any = false;
        for (path, text) in files {
            if recorded(path, text) == Recorded::After {
                *text = reverted(path, text, &record_of(path, text)?)?;
                any = true;
            }
        }
        Ok(any)
    }

    /// Makes the edits; nothing is written.
    pub(super) fn patch(
        &self,
        result: &Calibrated,
        edits: &[UrdfEdit],
    ) -> Result<PatchedTarget, ApplyError> {
        let name = self.path.display().to_string();
        let adds = |e: &UrdfEdit| matches!(e, UrdfEdit::AddFixedFrame { .. });
        let mut patched = match self.kind {
            Kind::Yaml => patch_yaml(&self.text, &name, edits)?,
            Kind::Urdf | Kind::Xacro => patch_with(&self.text, &name, edits, &self.companions)?,
        };
        if calib_urdf::sha256_hex(self.text.as_bytes()) == result.record.original_sha256 {
            // The very file that was calibrated: what `calib run` wrote and checked, byte for byte.
            patched.main = Patched::from_record(&result.urdf_text, &result.record);
        }
        let mut files = vec![(self.path.clone(), self.text.clone(), patched.main)];
        for (index, yaml) in patched.yaml {
            files.push((
                self.yaml_paths[index].clone(),
                self.companions.yaml[index].text.clone(),
                yaml,
            ));
        }
        Ok(PatchedTarget {
            files,
            before: patched.before,
            adds_frames: edits.iter().any(adds),
        })
    }

    /// What the reader should know about this kind of target.
    pub(super) fn add_notes(&self, files: &[FileChange], notes: &mut Vec<String>) {
        if self.kind == Kind::Xacro && !files.is_empty() {
            notes.push(
                "xacro itself was not run: expand the file and compare with `calib diff` before it is used"
                    .to_owned(),
            );
        }
        let has_hash = self
            .text
            .lines()
            .any(|l| l.trim_start().starts_with("hash:"));
        if self.kind == Kind::Yaml && has_hash && !files.is_empty() {
            notes.push(
                "`hash` is kept: it names the arm whose controller this file came from, and the controller's own \
                 numbers did not change"
                    .to_owned(),
            );
        }
    }
}

/// YAMLs that a xacro loads and that hold a change of ours.
pub(crate) fn changed_yaml(xacro: &Path) -> Vec<PathBuf> {
    let Ok(target) = Target::read(xacro, None) else {
        return Vec::new();
    };
    let yaml = target.yaml_paths.iter().zip(&target.companions.yaml);
    let changed = yaml.filter(|(path, yaml)| recorded(path, &yaml.text) == Recorded::After);
    changed.map(|(path, _)| path.clone()).collect()
}

/// The origins that a file shows.
#[derive(Debug, Clone)]
pub(crate) struct Origins {
    /// What the file is.
    pub kind: Kind,
    /// `parent_link_from_joint` by joint, in the order of the file.
    pub found: Vec<(String, Isometry3<f64>)>,
    /// Joints whose origin xacro computes.
    pub computed: Vec<String>,
}

/// The origins that a URDF, xacro or YAML shows.
///
/// # Errors
/// [`ApplyError`] when the file cannot be read.
pub(crate) fn origins(path: &Path) -> Result<Origins, ApplyError> {
    let target = Target::read(path, None)?;
    let name = path.display().to_string();
    let (found, computed) = match target.kind {
        Kind::Urdf => {
            let model = RobotModel::from_urdf_text(&target.text, &name)?;
            let origins = model
                .joints()
                .iter()
                .map(|j| (j.name.clone(), j.parent_link_from_joint));
            (origins.collect(), Vec::new())
        }
        Kind::Xacro => calib_urdf::xacro_origins(&target.text, &name, &target.companions)?,
        Kind::Yaml => {
            let origins = calib_urdf::yaml_origins(&target.text, &name)?;
            let named = origins
                .into_iter()
                .map(|o| (o.key, o.parent_link_from_joint));
            (named.collect(), Vec::new())
        }
    };
    Ok(Origins {
        kind: target.kind,
        found,
        computed,
    })
}

fn file_name(argument: &str) -> Option<&std::ffi::OsStr> {
    Path::new(argument).file_name()
}

/// The file that a xacro's argument names: relative to the xacro, or in a package around it.
fn resolve(xacro: &Path, argument: &str) -> Option<PathBuf> {
    let folder = xacro.parent().unwrap_or(Path::new(""));
    let in_package = ["$(find ", "$(find-pkg-share "]
        .into_iter()
        .find_map(|open| argument.strip_prefix(open)?.split_once(')'))
        .or_else(|| argument.strip_prefix("package://")?.split_once('/'));
    let Some((package, rest)) = in_package else {
        let plain = !argument.contains("${") && !argument.contains("$(");
        let place = folder.join(argument);
        return (plain && place.is_file()).then_some(place);
    };
    let (package, rest) = (package.trim(), rest.trim_start_matches('/'));
    if rest.contains("${") || rest.contains("$(") {
        return None;
    }
    // The package that the xacro is in, or one beside it.
    let here = if folder == Path::new("") {
        Path::new(".")
    } else {
        folder
    };
    let absolute = here.canonicalize().ok()?;
    let mut up = folder.to_path_buf();
    for ancestor in absolute.ancestors() {
        let named = ancestor.file_name().is_some_and(|n| n == package)
            || source::read_text(&ancestor.join("package.xml"), "")
                .is_ok_and(|xml| xml.contains(&format!("<name>{package}</name>")));
        let place = up.join(rest);
        if named && place.is_file() {
            return Some(place);
        }
        let beside = up.join(package).join(rest);
        if beside.is_file() {
            return Some(beside);
        }
        let inside = up.file_name().is_some();
        if !(inside && up.pop()) {
            up.push("..");
        }
    }
    None
}
