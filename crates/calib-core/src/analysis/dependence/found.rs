//! A memory of the noise that residuals show.

/// Which rows have the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MemoryOf {
    /// All.
    All,
    /// Positions of bodies that are measured as poses; their orientations have none.
    Positions,
    /// Their orientations; the positions have none.
    Orientations,
    /// Everything that a frame measures from, which moves as one: a stand or the air, not a marker. It is found where the scatter of the joints has
    /// taken it up, too.
    Together,
}

/// Memory of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Dependence {
    /// Which rows have it.
    pub of: MemoryOf,
    /// Correlation of successive samples that the residuals of the fit show.
    pub lag_one: f64,
    /// That correlation over its standard deviation for noise without memory.
    pub z: f64,
    /// ρ: how much of the memory is left after one sample more.
    pub decay: f64,
    /// c: part of the noise that has a memory; of [`MemoryOf::Together`] in units of the first noise level.
    pub share: f64,
    /// What c is multiplied by to be a correlation.
    pub(super) correlated: f64,
    /// κ: variance of the noise over what the fit found.
    pub level: f64,
}

impl Dependence {
    /// Variance of a sum over many samples, over what it is without memory.
    #[must_use]
    pub fn of_sums(&self) -> f64 {
        let share = (self.share * self.correlated).min(1.0);
        self.level * (1.0 + 2.0 * share * self.decay / (1.0 - self.decay))
    }

    /// Whether noise without memory shows so much less often than once in a thousand fits.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        /// One-sided normal quantile of 0.999…
        const Z: f64 = 3.09;
        /// …and of 0.9995, for each of two parts.
        const Z_OF_PART: f64 = 3.29;
        match self.of {
            MemoryOf::All => self.z > Z,
            _ => self.z > Z_OF_PART,
        }
    }
}
