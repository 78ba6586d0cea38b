//! How to run.

use calib_plugin::OwnEntries;
use calib_profile::{Method, Profile};

/// How to run.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// Instead of the profile's method.
    pub method: Option<Method>,
    /// Go on although the data checks found errors.
    pub force: bool,
    /// End with the exit code of a verdict that is not a pass where the verdict has warnings.
    pub strict: bool,
    /// Choose what to free by prediction of left-out poses, from what the profile frees outward; implies maximum likelihood.
    pub select: bool,
    /// Which plugins of the profile are loaded.
    pub plugins: Plugins,
    /// Estimators and readers of the calling program.
    pub own: OwnEntries,
}

/// Which plugins of a profile are loaded. The variable `CALIB_NO_PLUGINS`, set to anything, is [`Plugins::Refused`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Plugins {
    /// None; a profile that names one fails.
    Refused,
    /// Those beside the profile, those in plugin folders, and those that the profile pins by their hash.
    #[default]
    Placed,
    /// All that it names.
    Allowed,
}

impl RunOptions {
    /// How the transforms are found.
    pub(crate) fn method(&self, profile: &Profile) -> Method {
        match self.select {
            true => Method::Ml,
            false => self.method.unwrap_or(profile.solve.method),
        }
    }

    /// The same as arguments of `calib run`; the method is added where it is not the profile's.
    pub(crate) fn arguments(&self) -> Vec<&'static str> {
        let all = [
            (self.select, "--select"),
            (self.force, "--force"),
            (self.strict, "--strict"),
            (self.plugins == Plugins::Refused, "--no-plugins"),
            (self.plugins == Plugins::Allowed, "--allow-plugins"),
        ];
        let given = all.into_iter().filter(|(given, _)| *given);
        given.map(|(_, argument)| argument).collect()
    }
}
