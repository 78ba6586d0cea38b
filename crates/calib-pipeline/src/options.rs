//! How to run.

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
    /// Load no plugin; a profile that names one fails.
    pub no_plugins: bool,
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
            (self.no_plugins, "--no-plugins"),
        ];
        let given = all.into_iter().filter(|(given, _)| *given);
        given.map(|(_, argument)| argument).collect()
    }
}
