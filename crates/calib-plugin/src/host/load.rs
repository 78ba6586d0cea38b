//! Opening a library and making its offers callable.

use std::{
    ffi::{CString, c_void},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use super::{
    describe::{self, Description},
    effect::{self, LoadedEffect},
    error::{PluginError, chain},
    estimator::Loaded,
    pin,
    raw::{prefix, size_to, sized},
    reader::LoadedReader,
    report::LoadedReport,
    search::{Found, SearchPath},
};
use crate::{
    abi,
    kinds::{Aor, Cor, JointEffect, Reader, ReportWriter},
    offer::{Kind, Offer},
    registry::{Entry, Origin},
};

/// Loads plugins, if that is allowed.
#[derive(Debug, Clone)]
pub struct Host {
    search: SearchPath,
    enabled: bool,
    /// Whether a file is loaded that lies elsewhere than on the search path and has no pin.
    foreign: bool,
}

/// A plugin whose offers can be called. It stays in memory until the process ends.
#[derive(Debug, Clone)]
pub struct LoadedPlugin {
    /// What it says about itself, and what of that is skipped.
    pub description: Description,
    /// Its file, as it was found; `None` for one that is linked into the program.
    pub path: Option<PathBuf>,
    /// SHA-256 of the file, 64 hexadecimal digits; `None` for one that is linked into the program.
    pub sha256: Option<String>,
    /// How long `describe` took.
    pub described_in: Duration,
    cor: Vec<Entry<dyn Cor>>,
    aor: Vec<Entry<dyn Aor>>,
    reader: Vec<Entry<dyn Reader>>,
    report: Vec<Entry<dyn ReportWriter>>,
    effect: Vec<Entry<dyn JointEffect>>,
}

impl Host {
    /// `enabled`: false for `--no-plugins`; then every [`Host::load`] is an error.
    #[must_use]
    pub fn new(search: SearchPath, enabled: bool) -> Self {
        Self {
            search,
            enabled,
            foreign: true,
        }
    }

    /// Refuses a plugin that lies neither beside the profile nor in a plugin folder and that no hash pins.
    #[must_use]
    pub fn without_foreign(mut self) -> Self {
        self.foreign = false;
        self
    }

    /// Library files in the plugin folders; none is opened.
    #[must_use]
    pub fn discover(&self) -> Vec<Found> {
        self.search.discover()
    }

    /// Loads a plugin by name or path. `sha256`: the file must have this hash (`sha256:` before it is allowed).
    ///
    /// # Errors
    /// [`PluginError`] that says what was found and what was needed.
    pub fn load(
        &self,
        name_or_path: &str,
        sha256: Option<&str>,
    ) -> Result<LoadedPlugin, PluginError> {
        if !self.enabled {
            return Err(PluginError::Disabled {
                name: name_or_path.to_string(),
            });
        }
        let path = self.search.find(name_or_path)?;
        let found = pin::sha256(&path)?;
        match sha256 {
            Some(pin) => pin::check(name_or_path, &path, &found, pin)?,
            None if self.foreign || self.search.holds(&path) => {}
            None => {
                return Err(PluginError::Foreign {
                    name: name_or_path.to_string(),
                    path: path.display().to_string(),
                });
            }
        }
        open(&path, found)
    }

    /// A plugin that is linked into the program, from [`entry!`](crate::entry).
    ///
    /// # Errors
    /// As [`Host::load`].
    pub fn adopt(entry: &'static abi::Entry) -> Result<LoadedPlugin, PluginError> {
        // SAFETY: the entry is a constant of this program.
        unsafe { from_entry(entry, None, None) }
    }
}

fn open(path: &Path, sha256: String) -> Result<LoadedPlugin, PluginError> {
    let shown = path.display().to_string();
    // The loader of a static program gives no reason that a person could use.
    if cfg!(all(target_env = "musl", target_feature = "crt-static")) {
        return Err(PluginError::StaticProgram { path: shown });
    }
    // An absolute path, because the system's loader searches elsewhere for a bare file name.
    let file = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    // SAFETY: runs the library's initializers. It is code that the user named; what they do is in the trust model.
    let library = unsafe { libloading::Library::new(file.as_os_str()) }.map_err(|error| {
        PluginError::Open {
            path: shown.clone(),
            reason: chain(&error),
        }
    })?;
    // SAFETY: only the address is taken; nothing is read through it before the version has been.
    let symbol = unsafe { library.get::<*const abi::Entry>(abi::SYMBOL) }.map(|symbol| *symbol);
    // Never unloaded: statics, threads and the description of the plugin may be in use until the process ends.
    std::mem::forget(library);
    let entry = symbol.map_err(|error| PluginError::NoEntry {
        path: shown,
        symbol: abi::SYMBOL,
        reason: chain(&error),
    })?;
    // SAFETY: the symbol of the contract, in a library that stays in memory.
    unsafe { from_entry(entry, Some(path), Some(sha256)) }
}

/// A loaded plugin with all its offers.
///
/// # Safety
/// `entry` is null or an entry of the contract that lives until the process ends.
unsafe fn from_entry(
    entry: *const abi::Entry,
    path: Option<&Path>,
    sha256: Option<String>,
) -> Result<LoadedPlugin, PluginError> {
    let shown = path.map_or("in the program".to_string(), |path| {
        path.display().to_string()
    });
    let broken = |problem| PluginError::Description {
        path: shown.clone(),
        problem,
    };
    // SAFETY, for all blocks: as the caller says. The version stands first in every version of the contract.
    let [major, minor, size]: [u32; 3] =
        unsafe { prefix("calib_plugin_entry", entry.cast(), 12, 12) }.map_err(broken)?;
    if major != abi::MAJOR {
        return Err(PluginError::Abi {
            path: shown,
            found: (major, minor),
            needed: abi::MAJOR,
        });
    }
    let raw: abi::Entry = unsafe {
        prefix(
            "calib_plugin_entry",
            entry.cast(),
            size as usize,
            size_to!(abi::Entry, find),
        )
    }
    .map_err(broken)?;
    let (Some(describe), Some(find)) = (raw.describe, raw.find) else {
        return Err(broken(
            "calib_plugin_entry lacks describe() or find()".to_string(),
        ));
    };
    let start = Instant::now();
    let descriptor = unsafe { describe() };
    let described_in = start.elapsed();
    let description = unsafe { describe::read(descriptor, (major, minor)) }.map_err(broken)?;

    let mut plugin = LoadedPlugin {
        description,
        path: path.map(Path::to_path_buf),
        sha256,
        described_in,
        cor: Vec::new(),
        aor: Vec::new(),
        reader: Vec::new(),
        report: Vec::new(),
        effect: Vec::new(),
    };
    for offer in plugin.description.offers.clone() {
        // Kind and name were texts of the plugin, without zero bytes.
        let kind = CString::new(offer.kind.id()).unwrap_or_default();
        let name = CString::new(offer.name.as_str()).unwrap_or_default();
        let found: *const c_void = unsafe { find(kind.as_ptr(), name.as_ptr()) };
        unsafe { plugin.take(offer, found) }.map_err(broken)?;
    }
    Ok(plugin)
}

impl LoadedPlugin {
    /// Adds an offer from its function table; the error is the problem of the table.
    ///
    /// # Safety
    /// `found` is null or the table of the offer's kind, which lives until the process ends.
    unsafe fn take(&mut self, offer: Offer, found: *const c_void) -> Result<(), String> {
        let origin = Origin::Plugin {
            plugin: self.description.name.clone(),
            version: self.description.version.clone(),
            path: self.path.clone(),
            sha256: self.sha256.clone(),
        };
        let what = format!("{} `{}`", offer.kind.id(), offer.name);
        let table = |problem: String| format!("the table of {what}: {problem}");
        let missing = |function: &str| format!("the table of {what} lacks {function}()");
        // SAFETY, for all blocks: as the caller says.
        match offer.kind {
            Kind::Cor => {
                let raw: abi::Cor1 =
                    unsafe { sized("calib_cor_1", found, size_to!(abi::Cor1, fit)) }
                        .map_err(table)?;
                let fit = raw.fit.ok_or_else(|| missing("fit"))?;
                self.cor.push(Entry::cor(Loaded { offer, fit }, origin));
            }
            Kind::Aor => {
                let raw: abi::Aor1 =
                    unsafe { sized("calib_aor_1", found, size_to!(abi::Aor1, fit)) }
                        .map_err(table)?;
                let fit = raw.fit.ok_or_else(|| missing("fit"))?;
                self.aor.push(Entry::aor(Loaded { offer, fit }, origin));
            }
            Kind::Reader => {
                let raw: abi::Reader1 =
                    unsafe { sized("calib_reader_1", found, size_to!(abi::Reader1, read)) }
                        .map_err(table)?;
                let read = raw.read.ok_or_else(|| missing("read"))?;
                let recognizes = raw.recognizes;
                let it = LoadedReader {
                    offer,
                    read,
                    recognizes,
                };
                self.reader.push(Entry::reader(it, origin));
            }
            Kind::Report => {
                let raw: abi::Report1 =
                    unsafe { sized("calib_report_1", found, size_to!(abi::Report1, write)) }
                        .map_err(table)?;
                let write = raw.write.ok_or_else(|| missing("write"))?;
                self.report
                    .push(Entry::report(LoadedReport { offer, write }, origin));
            }
            Kind::Effect => {
                let raw: abi::Effect1 =
                    unsafe { sized("calib_effect_1", found, size_to!(abi::Effect1, regressors)) }
                        .map_err(table)?;
                let it = LoadedEffect {
                    offer,
                    term: effect::term(&raw).map_err(table)?,
                    regressors: raw.regressors.ok_or_else(|| missing("regressors"))?,
                };
                self.effect.push(Entry::effect(it, origin));
            }
        }
        Ok(())
    }

    /// Its center estimators.
    #[must_use]
    pub fn cors(&self) -> &[Entry<dyn Cor>] {
        &self.cor
    }

    /// Its axis estimators.
    #[must_use]
    pub fn aors(&self) -> &[Entry<dyn Aor>] {
        &self.aor
    }

    /// Its readers.
    #[must_use]
    pub fn readers(&self) -> &[Entry<dyn Reader>] {
        &self.reader
    }

    /// Its report writers.
    #[must_use]
    pub fn reports(&self) -> &[Entry<dyn ReportWriter>] {
        &self.report
    }

    /// Its joint effects.
    #[must_use]
    pub fn effects(&self) -> &[Entry<dyn JointEffect>] {
        &self.effect
    }

    /// The center estimator of this name.
    ///
    /// # Errors
    /// [`PluginError::NotOffered`].
    pub fn cor(&self, name: &str) -> Result<&Entry<dyn Cor>, PluginError> {
        self.cor
            .iter()
            .find(|e| e.offer().name == name)
            .ok_or_else(|| self.none(Kind::Cor, name))
    }

    /// The axis estimator of this name.
    ///
    /// # Errors
    /// [`PluginError::NotOffered`].
    pub fn aor(&self, name: &str) -> Result<&Entry<dyn Aor>, PluginError> {
        self.aor
            .iter()
            .find(|e| e.offer().name == name)
            .ok_or_else(|| self.none(Kind::Aor, name))
    }

    /// The reader of this name.
    ///
    /// # Errors
    /// [`PluginError::NotOffered`].
    pub fn reader(&self, name: &str) -> Result<&Entry<dyn Reader>, PluginError> {
        self.reader
            .iter()
            .find(|e| e.offer().name == name)
            .ok_or_else(|| self.none(Kind::Reader, name))
    }

    /// The report writer of this name.
    ///
    /// # Errors
    /// [`PluginError::NotOffered`].
    pub fn report(&self, name: &str) -> Result<&Entry<dyn ReportWriter>, PluginError> {
        self.report
            .iter()
            .find(|e| e.offer().name == name)
            .ok_or_else(|| self.none(Kind::Report, name))
    }

    /// The joint effect of this name.
    ///
    /// # Errors
    /// [`PluginError::NotOffered`].
    pub fn effect(&self, name: &str) -> Result<&Entry<dyn JointEffect>, PluginError> {
        self.effect
            .iter()
            .find(|e| e.offer().name == name)
            .ok_or_else(|| self.none(Kind::Effect, name))
    }

    fn none(&self, kind: Kind, name: &str) -> PluginError {
        let of_kind = |offer: &&Offer| offer.kind == kind;
        PluginError::NotOffered {
            plugin: self.description.name.clone(),
            kind,
            name: name.to_string(),
            known: self
                .description
                .offers
                .iter()
                .filter(of_kind)
                .map(|o| o.name.clone())
                .collect(),
        }
    }
}
