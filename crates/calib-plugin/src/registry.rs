//! One table for each kind, in which built-ins and plugins stand side by side.

use std::{collections::BTreeMap, fmt, path::PathBuf, sync::Arc};

use crate::{
    answer::{Answer, AorFit, CorFit, Failure},
    call::Call,
    effect::{EffectTerm, JointStates},
    host::{Control, Host, LoadedPlugin, PluginError, SearchPath},
    kinds::{Aor, Cor, JointEffect, Reader, ReportWriter},
    motion::{Motion, Shape},
    offer::{Kind, Offer, Value},
    parameters,
    streams::{ReportFile, ReportInput, Source, Streams},
    verify,
};

/// The most bytes of a file that a reader is shown to recognize its format.
const HEAD_BYTES: usize = 4096;

/// Where something comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// Part of the program.
    BuiltIn,
    /// A plugin.
    Plugin {
        /// Its name.
        plugin: String,
        /// Its version.
        version: String,
        /// Its file; `None`: linked into the program.
        path: Option<PathBuf>,
        /// SHA-256 of the file, 64 hexadecimal digits; `None`: linked into the program.
        sha256: Option<String>,
    },
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BuiltIn => f.write_str("built in"),
            Self::Plugin {
                plugin, version, ..
            } => write!(f, "from plugin `{plugin}` {version}"),
        }
    }
}

/// Something that can be called by name.
pub struct Entry<T: ?Sized> {
    offer: Arc<Offer>,
    origin: Arc<Origin>,
    it: Arc<T>,
}

impl<T: ?Sized> Clone for Entry<T> {
    fn clone(&self) -> Self {
        Self {
            offer: self.offer.clone(),
            origin: self.origin.clone(),
            it: self.it.clone(),
        }
    }
}

impl<T: ?Sized> fmt::Debug for Entry<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Entry")
            .field("offer", &self.offer)
            .field("origin", &self.origin)
            .finish()
    }
}

impl Entry<dyn Cor> {
    /// A center estimator from `origin`.
    pub fn cor(it: impl Cor + 'static, origin: Origin) -> Self {
        Self::of(it.offer(), origin, Arc::new(it))
    }

    /// A center estimator of the program.
    pub fn built_in_cor(it: impl Cor + 'static) -> Self {
        Self::cor(it, Origin::BuiltIn)
    }
}

impl Entry<dyn Aor> {
    /// An axis estimator from `origin`.
    pub fn aor(it: impl Aor + 'static, origin: Origin) -> Self {
        Self::of(it.offer(), origin, Arc::new(it))
    }

    /// An axis estimator of the program.
    pub fn built_in_aor(it: impl Aor + 'static) -> Self {
        Self::aor(it, Origin::BuiltIn)
    }
}

impl Entry<dyn Reader> {
    /// A reader from `origin`.
    pub fn reader(it: impl Reader + 'static, origin: Origin) -> Self {
        Self::of(it.offer(), origin, Arc::new(it))
    }

    /// A reader of the program.
    pub fn built_in_reader(it: impl Reader + 'static) -> Self {
        Self::reader(it, Origin::BuiltIn)
    }

    /// True when these first bytes look like its format.
    #[must_use]
    pub fn recognizes(&self, head: &[u8]) -> bool {
        self.it.recognizes(head)
    }
}

impl Entry<dyn ReportWriter> {
    /// A report writer from `origin`.
    pub fn report(it: impl ReportWriter + 'static, origin: Origin) -> Self {
        Self::of(it.offer(), origin, Arc::new(it))
    }

    /// A report writer of the program.
    pub fn built_in_report(it: impl ReportWriter + 'static) -> Self {
        Self::report(it, Origin::BuiltIn)
    }
}

impl Entry<dyn JointEffect> {
    /// A joint effect from `origin`.
    pub fn effect(it: impl JointEffect + 'static, origin: Origin) -> Self {
        Self::of(it.offer(), origin, Arc::new(it))
    }

    /// What is stated of its coefficient.
    #[must_use]
    pub fn term(&self) -> EffectTerm {
        self.it.term()
    }
}

impl<T: ?Sized> Entry<T> {
    fn of(offer: Offer, origin: Origin, it: Arc<T>) -> Self {
        Self {
            offer: Arc::new(offer),
            origin: Arc::new(origin),
            it,
        }
    }

    /// Its description.
    #[must_use]
    pub fn offer(&self) -> &Offer {
        &self.offer
    }

    /// Where it comes from.
    #[must_use]
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// What messages call it: kind, name and plugin.
    #[must_use]
    pub fn title(&self) -> String {
        let Offer { kind, name, .. } = &*self.offer;
        match &*self.origin {
            Origin::BuiltIn => format!("{} `{name}`", kind.word()),
            Origin::Plugin { plugin, .. } => format!("plugin `{plugin}`, {} `{name}`", kind.word()),
        }
    }

    /// Whether it takes data of this shape.
    ///
    /// # Errors
    /// [`PluginError::Shape`] with the shapes that it takes.
    pub fn takes(&self, shape: Shape) -> Result<(), PluginError> {
        if self.offer.shapes.contains(&shape) {
            return Ok(());
        }
        Err(PluginError::Shape {
            of: self.title(),
            takes: self.offer.shapes.iter().map(|shape| shape.word()).collect(),
            got: shape.word(),
        })
    }

    /// Ready to be called, with these parameters.
    ///
    /// # Errors
    /// [`PluginError::Parameter`] when they are not what the offer describes.
    pub fn with(&self, given: &BTreeMap<String, Value>) -> Result<Bound<T>, PluginError> {
        let values = parameters::validate(&self.offer.parameters, given).map_err(|problem| {
            PluginError::Parameter {
                of: self.title(),
                problem,
            }
        })?;
        Ok(Bound {
            entry: self.clone(),
            values,
        })
    }
}

/// Something that can be called, with its parameters.
pub struct Bound<T: ?Sized> {
    entry: Entry<T>,
    values: Vec<Value>,
}

impl<T: ?Sized> Bound<T> {
    /// What it is.
    #[must_use]
    pub fn entry(&self) -> &Entry<T> {
        &self.entry
    }

    /// The values of all parameters, in their order.
    #[must_use]
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    fn call<R>(
        &self,
        control: &Control<'_>,
        body: impl FnOnce(&T, &Call<'_>) -> Result<R, Failure>,
    ) -> Result<R, PluginError> {
        let cancelled = || control.cancel.is_some_and(crate::Cancel::is_cancelled);
        let progress = |fraction: f64, text: &str| {
            if let Some(tell) = control.progress {
                tell(fraction, text);
            }
        };
        let call = Call::new(
            &self.entry.offer.parameters,
            &self.values,
            &cancelled,
            &progress,
        );
        body(&self.entry.it, &call).map_err(|failure| PluginError::Call {
            of: self.entry.title(),
            failure,
        })
    }

    fn takes(&self, motion: &Motion<'_>) -> Result<(), PluginError> {
        self.entry.takes(motion.shape)
    }
}

impl Bound<dyn Cor> {
    /// Finds the center.
    ///
    /// # Errors
    /// [`PluginError`]: data that it does not take or that break the contract, failures, and results that break it.
    pub fn fit(
        &self,
        motion: &Motion<'_>,
        control: &Control<'_>,
    ) -> Result<Answer<CorFit>, PluginError> {
        self.takes(motion)?;
        self.call(control, |it, call| {
            // Built-ins too: what one refuses the other must not answer.
            verify::motion(motion).map_err(Failure::BadInput)?;
            let answer = it.fit(motion, call)?;
            if let Answer::Found(fit) = &answer {
                verify::cor(fit, motion).map_err(Failure::Contract)?;
            }
            Ok(answer)
        })
    }
}

impl Bound<dyn Aor> {
    /// Finds the axis.
    ///
    /// # Errors
    /// [`PluginError`]: data that it does not take or that break the contract, failures, and results that break it.
    pub fn fit(
        &self,
        motion: &Motion<'_>,
        control: &Control<'_>,
    ) -> Result<Answer<AorFit>, PluginError> {
        self.takes(motion)?;
        self.call(control, |it, call| {
            verify::motion(motion).map_err(Failure::BadInput)?;
            let answer = it.fit(motion, call)?;
            if let Answer::Found(fit) = &answer {
                verify::aor(fit, motion).map_err(Failure::Contract)?;
            }
            Ok(answer)
        })
    }
}

impl Bound<dyn Reader> {
    /// Reads a file.
    ///
    /// # Errors
    /// [`PluginError`]: input that it refuses, failures, and streams that break the contract.
    pub fn read(&self, source: &Source<'_>, control: &Control<'_>) -> Result<Streams, PluginError> {
        self.call(control, |it, call| it.read(source, call))
    }
}

impl Bound<dyn ReportWriter> {
    /// Makes files, all with plain relative paths; writes none.
    ///
    /// # Errors
    /// [`PluginError`]: failures, and files that break the contract.
    pub fn write(
        &self,
        report: &ReportInput<'_>,
        control: &Control<'_>,
    ) -> Result<Vec<ReportFile>, PluginError> {
        self.call(control, |it, call| {
            let files = it.write(report, call)?;
            verify::files(&files).map_err(Failure::Contract)?;
            Ok(files)
        })
    }
}

impl Bound<dyn JointEffect> {
    /// The regressor at each state, all finite.
    ///
    /// # Errors
    /// [`PluginError`]: failures, and regressors that break the contract.
    pub fn regressors(
        &self,
        states: &JointStates<'_>,
        control: &Control<'_>,
    ) -> Result<Vec<f64>, PluginError> {
        self.call(control, |it, call| {
            verify::states(states).map_err(Failure::BadInput)?;
            let values = it.regressors(states, call)?;
            verify::regressors(&values, states.samples()).map_err(Failure::Contract)?;
            Ok(values)
        })
    }
}

/// All of one kind, by name.
pub struct Registry<T: ?Sized> {
    kind: Kind,
    entries: BTreeMap<String, Entry<T>>,
}

impl<T: ?Sized> Registry<T> {
    fn new(kind: Kind) -> Self {
        Self {
            kind,
            entries: BTreeMap::new(),
        }
    }

    /// Adds one.
    ///
    /// # Errors
    /// [`PluginError::Taken`] when the name is in use, [`PluginError::WrongKind`] when it describes itself as another kind.
    pub fn register(&mut self, entry: Entry<T>) -> Result<(), PluginError> {
        let name = entry.offer.name.clone();
        if entry.offer.kind != self.kind {
            let (found, needed) = (entry.offer.kind.id(), self.kind.id());
            return Err(PluginError::WrongKind {
                name,
                found,
                needed,
            });
        }
        if let Some(other) = self.entries.get(&name) {
            return Err(PluginError::Taken {
                kind: self.kind,
                name,
                first: other.origin.to_string(),
                second: entry.origin.to_string(),
            });
        }
        self.entries.insert(name, entry);
        Ok(())
    }

    /// The one of this name.
    ///
    /// # Errors
    /// [`PluginError::Unknown`] with the names there are.
    pub fn get(&self, name: &str) -> Result<&Entry<T>, PluginError> {
        self.entries.get(name).ok_or_else(|| PluginError::Unknown {
            kind: self.kind,
            name: name.to_string(),
            known: self.entries.keys().cloned().collect(),
        })
    }

    /// All, by name.
    pub fn iter(&self) -> impl Iterator<Item = &Entry<T>> {
        self.entries.values()
    }
}

impl Registry<dyn Reader> {
    /// The first reader of a plugin, by name, that recognizes these first bytes; built-in readers are not asked.
    #[must_use]
    pub fn recognizing(&self, bytes: &[u8]) -> Option<&Entry<dyn Reader>> {
        let head = &bytes[..bytes.len().min(HEAD_BYTES)];
        self.iter()
            .filter(|e| *e.origin() != Origin::BuiltIn)
            .find(|e| e.recognizes(head))
    }
}

/// The registries of all kinds.
pub struct Tables {
    /// Center estimators.
    pub cor: Registry<dyn Cor>,
    /// Axis estimators.
    pub aor: Registry<dyn Aor>,
    /// Readers.
    pub reader: Registry<dyn Reader>,
    /// Report writers.
    pub report: Registry<dyn ReportWriter>,
    /// Joint effects.
    pub effect: Registry<dyn JointEffect>,
}

impl Default for Tables {
    fn default() -> Self {
        Self {
            cor: Registry::new(Kind::Cor),
            aor: Registry::new(Kind::Aor),
            reader: Registry::new(Kind::Reader),
            report: Registry::new(Kind::Report),
            effect: Registry::new(Kind::Effect),
        }
    }
}

impl Tables {
    /// Adds everything that a plugin offers.
    ///
    /// # Errors
    /// [`PluginError::Taken`]; what stood before it in the plugin stays registered.
    pub fn add(&mut self, plugin: &LoadedPlugin) -> Result<(), PluginError> {
        plugin
            .cors()
            .iter()
            .try_for_each(|entry| self.cor.register(entry.clone()))?;
        plugin
            .aors()
            .iter()
            .try_for_each(|entry| self.aor.register(entry.clone()))?;
        plugin
            .readers()
            .iter()
            .try_for_each(|entry| self.reader.register(entry.clone()))?;
        plugin
            .reports()
            .iter()
            .try_for_each(|entry| self.report.register(entry.clone()))?;
        plugin
            .effects()
            .iter()
            .try_for_each(|entry| self.effect.register(entry.clone()))
    }

    /// Adds what the plugins of these names or paths offer, as a user names them. None is loaded where `CALIB_NO_PLUGINS` is set.
    ///
    /// # Errors
    /// [`PluginError`] for plugins that are not found, not loaded or switched off, and for names that are taken.
    pub fn add_named(&mut self, plugins: &[String]) -> Result<(), PluginError> {
        let refused = std::env::var_os("CALIB_NO_PLUGINS").is_some_and(|set| !set.is_empty());
        let host = Host::new(SearchPath::from_environment(None), !refused);
        plugins
            .iter()
            .try_for_each(|plugin| self.add(&host.load(plugin, None)?))
    }

    /// Description and origin of everything, by kind and name.
    #[must_use]
    pub fn list(&self) -> Vec<(&Offer, &Origin)> {
        let mut list: Vec<(&Offer, &Origin)> = Vec::new();
        list.extend(self.cor.iter().map(|e| (e.offer(), e.origin())));
        list.extend(self.aor.iter().map(|e| (e.offer(), e.origin())));
        list.extend(self.reader.iter().map(|e| (e.offer(), e.origin())));
        list.extend(self.report.iter().map(|e| (e.offer(), e.origin())));
        list.extend(self.effect.iter().map(|e| (e.offer(), e.origin())));
        list
    }
}
