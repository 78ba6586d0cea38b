//! The joints' motions: the paper's ranges, and arcs and sweeps beside them.

use nalgebra::{Unit, UnitQuaternion, Vector3};

/// Rz(β)·Rx(α) over a grid, degrees, `[from, to]` in so many steps each.
pub(crate) fn grid(
    z_deg: [f64; 2],
    nz: usize,
    x_deg: [f64; 2],
    nx: usize,
) -> Vec<UnitQuaternion<f64>> {
    let mut turns = Vec::with_capacity(nz * nx);
    for beta in steps(z_deg[0], z_deg[1], nz) {
        for alpha in steps(x_deg[0], x_deg[1], nx) {
            turns.push(
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), beta)
                    * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), alpha),
            );
        }
    }
    turns
}

/// The joint whose range of motion a grid covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Range {
    /// z −45..135°, x −45..80°.
    Hand,
    /// Pan −90..90°, tilt −20..40°.
    Head,
}

impl Range {
    pub fn word(self) -> &'static str {
        match self {
            Self::Hand => "hand",
            Self::Head => "head",
        }
    }

    /// The paper's counts as grids: 63 = 9 × 7, 16 = 4 × 4, 9 = 3 × 3 (36 = 6 × 6 for frames).
    pub fn turns(self, n: usize) -> Vec<UnitQuaternion<f64>> {
        let (nz, nx) = match n {
            63 => (9, 7),
            36 => (6, 6),
            16 => (4, 4),
            _ => (3, 3),
        };
        match self {
            Self::Hand => grid([-45.0, 135.0], nz, [-45.0, 80.0], nx),
            Self::Head => grid([-90.0, 90.0], nz, [-20.0, 40.0], nx),
        }
    }
}

/// n angles from one to the other, degrees in, rad out.
pub(crate) fn steps(from_deg: f64, to_deg: f64, n: usize) -> impl Iterator<Item = f64> + Clone {
    let step = (to_deg - from_deg) / (n.max(2) - 1) as f64;
    (0..n).map(move |k| (from_deg + step * k as f64).to_radians())
}

/// A sweep of `arc_deg` about one axis in n samples.
pub(crate) fn sweep(axis: Vector3<f64>, arc_deg: f64, n: usize) -> Vec<UnitQuaternion<f64>> {
    let axis = Unit::new_normalize(axis);
    steps(0.0, arc_deg, n)
        .map(|angle| UnitQuaternion::from_axis_angle(&axis, angle))
        .collect()
}
