//! Centers of rotation with the least *sum of distances*, where others take the least sum of squares.
//!
//! ```text
//! poses    min over p, o      Σ_i ‖R_i p + t_i − o‖                     convex: one minimum, no start      (1)
//! points   min over m, r_k    Σ_k Σ_i | ‖x_ki − m‖ − r_k |              the better end of two starts       (2)
//! ```
//!
//! A far sample pulls with the same force as a near one, so single wrong samples do not move the center, and there is
//! no gate, no noise level and no random choice to tune in (1). The price is efficiency: with normal noise and no
//! outliers the standard deviation of (2) is √(π/2) ≈ 1.25 times that of least squares, of (1) about 1.06 times.
//!
//! Both are solved by iteratively reweighted least squares with weights `1/√(d² + ε²)` (Weiszfeld 1937). What it does
//! not protect against: outliers that agree with each other, and more than about a third of them.
//!
//! Lengths m, angles rad.

mod lines;
mod pivot;
mod sphere;

use calib_plugin::{
    Answer, Call, Cor, CorFit, Failure, Kind, Motion, Offer, Parameter, Shape, export,
};

/// The estimator.
#[derive(Debug, Clone, Copy)]
pub struct GeometricMedian;

impl Cor for GeometricMedian {
    fn offer(&self) -> Offer {
        Offer::new(
            Kind::Cor,
            "geometric_median",
            "center with the least sum of distances; withstands wrong samples",
        )
        .from_source("Weiszfeld 1937; Ehrig et al. 2006 for the least-squares form")
        .takes(&[
            Shape::Points,
            Shape::Markers,
            Shape::Poses,
            Shape::TwoBodies,
        ])
        .with(
            Parameter::integer(
                "iterations",
                500,
                "most reweighting steps before the answer is called weak",
            )
            .between(1.0, 1e6),
        )
        .with(
            Parameter::integer(
                "subsets",
                300,
                "points: spheres through four samples that give the first start",
            )
            .between(10.0, 1e6),
        )
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        match motion.shape {
            Shape::Points | Shape::Markers => sphere::fit(motion, call),
            Shape::Poses | Shape::TwoBodies => pivot::fit(motion, call),
        }
    }
}

export! {
    name: "geometric-median",
    version: env!("CARGO_PKG_VERSION"),
    author: "the calib authors",
    licence: env!("CARGO_PKG_LICENSE"),
    cor: [GeometricMedian],
}
