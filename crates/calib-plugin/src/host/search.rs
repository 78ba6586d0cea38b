//! Where a plugin is looked for, and under which file names.

use std::{
    env::consts::{DLL_EXTENSION, DLL_PREFIX, DLL_SUFFIX},
    path::{Path, PathBuf},
};

use super::PluginError;

/// The variable with folders of plugins, separated like `PATH`.
const VARIABLE: &str = "CALIB_PLUGIN_PATH";

/// Where plugins are looked for, in this order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SearchPath {
    /// The profile's folder: paths are relative to it, and names are sought in its `plugins/`.
    pub profile: Option<PathBuf>,
    /// Folders of `CALIB_PLUGIN_PATH`.
    pub environment: Vec<PathBuf>,
    /// The installation's plugin folder.
    pub installation: Option<PathBuf>,
}

/// A library file in a plugin folder. It has not been opened and need not be a plugin.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Found {
    /// The name to load it by.
    pub name: String,
    /// Where it is.
    pub path: PathBuf,
}

impl SearchPath {
    /// `CALIB_PLUGIN_PATH` and the installation (`../lib/calib/plugins` or `plugins` beside the program), and the
    /// profile's folder where there is one.
    #[must_use]
    pub fn from_environment(profile: Option<&Path>) -> Self {
        let environment = std::env::var_os(VARIABLE)
            .map(|value| {
                std::env::split_paths(&value)
                    .filter(|p| !p.as_os_str().is_empty())
                    .collect()
            })
            .unwrap_or_default();
        let installation = std::env::current_exe().ok().and_then(|program| {
            let folder = program.parent()?;
            let lib = folder
                .parent()
                .map(|prefix| prefix.join("lib").join("calib").join("plugins"));
            lib.into_iter()
                .chain([folder.join("plugins")])
                .find(|p| p.is_dir())
        });
        Self {
            profile: profile.map(Path::to_path_buf),
            environment,
            installation,
        }
    }

    /// The folders in which names are sought.
    #[must_use]
    pub fn folders(&self) -> Vec<PathBuf> {
        let beside = self.profile.as_ref().map(|folder| folder.join("plugins"));
        beside
            .into_iter()
            .chain(self.environment.iter().cloned())
            .chain(self.installation.iter().cloned())
            .collect()
    }

    /// Whether a file lies below the profile's folder or a plugin folder, with all links followed.
    #[must_use]
    pub fn holds(&self, path: &Path) -> bool {
        let Ok(path) = path.canonicalize() else {
            return false;
        };
        let current = PathBuf::from(".");
        let beside = self.profile.iter().map(|folder| {
            let is_current = folder.as_os_str().is_empty();
            if is_current { &current } else { folder }
        });
        let folders = beside.chain(&self.environment).chain(&self.installation);
        folders
            .filter_map(|folder| folder.canonicalize().ok())
            .any(|folder| path.starts_with(folder))
    }

    /// The file of a plugin: a path (it has a separator or the ending of a library) or a name.
    ///
    /// # Errors
    /// [`PluginError::NotFound`] with every file that was looked for.
    pub fn find(&self, name_or_path: &str) -> Result<PathBuf, PluginError> {
        let candidates = self.candidates(name_or_path);
        if let Some(path) = candidates.iter().find(|path| path.is_file()) {
            return Ok(path.clone());
        }
        Err(PluginError::NotFound {
            name: name_or_path.to_string(),
            looked: candidates
                .iter()
                .map(|path| path.display().to_string())
                .collect(),
            known: self
                .discover()
                .into_iter()
                .map(|found| found.name)
                .collect(),
        })
    }

    fn candidates(&self, name_or_path: &str) -> Vec<PathBuf> {
        let path = Path::new(name_or_path);
        let is_path = name_or_path.contains(['/', std::path::MAIN_SEPARATOR])
            || path.extension().is_some_and(|e| e == DLL_EXTENSION);
        if is_path {
            // An absolute path stays what it is.
            let path = self
                .profile
                .as_ref()
                .map_or(path.to_path_buf(), |folder| folder.join(path));
            return vec![path];
        }
        let mut names = vec![file_name(name_or_path)];
        // Cargo writes `my-plugin` as `libmy_plugin.so`.
        let underscored = file_name(&name_or_path.replace('-', "_"));
        if !names.contains(&underscored) {
            names.push(underscored);
        }
        if !DLL_PREFIX.is_empty() {
            names.push(format!("{name_or_path}{DLL_SUFFIX}"));
        }
        self.folders()
            .iter()
            .flat_map(|folder| names.iter().map(move |name| folder.join(name)))
            .collect()
    }

    /// The library files in all folders, by name; none is opened. Where two have one name, the first folder's is the one
    /// that would be loaded.
    #[must_use]
    pub fn discover(&self) -> Vec<Found> {
        let mut found: Vec<Found> = Vec::new();
        for folder in self.folders() {
            let Ok(entries) = std::fs::read_dir(&folder) else {
                continue;
            };
            let mut here: Vec<Found> = entries
                .flatten()
                .filter_map(|entry| {
                    let file = entry.file_name();
                    let stem = file.to_str()?.strip_suffix(DLL_SUFFIX)?;
                    let name = stem.strip_prefix(DLL_PREFIX).unwrap_or(stem).to_string();
                    Some(Found {
                        name,
                        path: entry.path(),
                    })
                })
                .collect();
            here.sort();
            for one in here {
                if !found.iter().any(|f| f.name == one.name) {
                    found.push(one);
                }
            }
        }
        found
    }
}

/// The platform's file name of a library.
fn file_name(name: &str) -> String {
    format!("{DLL_PREFIX}{name}{DLL_SUFFIX}")
}
