//! What the calling program brings itself, for one call: estimators and readers that stand in no file.

use crate::{
    host::PluginError,
    kinds::{Aor, Cor, Reader},
    registry::{Entry, Tables},
};

/// Estimators and readers of the calling program, registered beside the built-in ones for one run.
#[derive(Debug, Clone, Default)]
pub struct OwnEntries {
    /// Center estimators.
    pub cor: Vec<Entry<dyn Cor>>,
    /// Axis estimators.
    pub aor: Vec<Entry<dyn Aor>>,
    /// Readers.
    pub reader: Vec<Entry<dyn Reader>>,
}

impl OwnEntries {
    /// None at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cor.is_empty() && self.aor.is_empty() && self.reader.is_empty()
    }
}

impl Tables {
    /// Adds what the calling program brings.
    ///
    /// # Errors
    /// [`PluginError::Taken`]; what stood before it stays registered.
    pub fn add_own(&mut self, own: &OwnEntries) -> Result<(), PluginError> {
        let (cor, aor, reader) = (own.cor.iter(), own.aor.iter(), own.reader.iter());
        cor.cloned().try_for_each(|e| self.cor.register(e))?;
        aor.cloned().try_for_each(|e| self.aor.register(e))?;
        reader.cloned().try_for_each(|e| self.reader.register(e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Answer, ByFn, Call, CorFit, Failure, Kind, Motion, Offer, Origin};

    fn entry(name: &str, origin: Origin) -> Entry<dyn Cor> {
        let never = |_: &Motion<'_>, _: &Call<'_>| {
            Ok::<Answer<CorFit>, Failure>(Answer::NotObservable("it never answers".into()))
        };
        Entry::cor(ByFn::new(Offer::new(Kind::Cor, name, ""), never), origin)
    }

    #[test]
    fn own_estimators_stand_beside_the_others_and_take_no_name() {
        let mut tables = Tables::default();
        let built_in = entry("mean", Origin::BuiltIn);
        assert!(tables.cor.register(built_in.clone()).is_ok());
        let mut own = OwnEntries::default();
        assert!(own.is_empty());
        own.cor.push(entry("median", Origin::BuiltIn));
        assert!(!own.is_empty() && tables.add_own(&own).is_ok());
        assert!(tables.cor.get("median").is_ok());
        own.cor = vec![built_in];
        let taken = tables.add_own(&own);
        assert!(matches!(taken, Err(PluginError::Taken { name, .. }) if name == "mean"));
    }
}
