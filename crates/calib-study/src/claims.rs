//! What the paper says of its simulations, beside what this study measured.

use serde::{Deserialize, Serialize};

use crate::{
    cell::{Cell, Part, Quantity},
    settings::Study,
};

/// A number of this study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// What it is.
    pub what: String,
    /// Its value, in mm or degrees as the claim.
    pub value: f64,
    /// Monte-Carlo standard error, where it is a mean.
    pub mc: Option<f64>,
}

/// A statement of the paper.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Claim {
    /// Where it stands.
    pub place: String,
    /// What it says.
    pub says: String,
    /// The unit of the numbers beside it: `mm`, `deg` or `1`.
    pub unit: String,
    /// What was measured.
    pub measured: Vec<Measured>,
}

/// The claims of a study.
pub(crate) fn claims(study: Study, cells: &[Cell]) -> Vec<Claim> {
    match study {
        Study::Cor => cor(cells),
        Study::Aor => aor(cells),
    }
}

fn claim(place: &str, says: &str, unit: &str, measured: Vec<Measured>) -> Claim {
    Claim {
        place: place.to_owned(),
        says: says.to_owned(),
        unit: unit.to_owned(),
        measured,
    }
}

/// A cell of the paper's hand: radius and σ of positions in mm, σ of orientations in degrees.
fn hand<'a>(
    cells: &'a [Cell],
    method: &str,
    samples: usize,
    [radius_mm, sigma_mm, turn_deg]: [f64; 3],
) -> Option<&'a Cell> {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    cells.iter().find(|c| {
        let s = &c.scene;
        s.part == Part::Grid
            && s.motion == "hand"
            && c.method == method
            && s.samples == samples
            && near(s.radius_m * 1e3, radius_mm)
            && near(s.sigma_t_m * 1e3, sigma_mm)
            && near(s.sigma_r_rad.to_degrees(), turn_deg)
    })
}

/// Mean size of the error, size of the mean error, and the bound, mm.
fn sizes(cell: Option<&Cell>, of: &str) -> Vec<Measured> {
    let Some(cell) = cell else {
        return Vec::new();
    };
    let mut out = Vec::new();
    let mut push = |what: &str, value: Option<f64>, mc: Option<f64>| {
        out.extend(value.map(|v| Measured {
            what: format!("{what}{of}"),
            value: v * 1e3,
            mc: mc.map(|m| m * 1e3),
        }));
    };
    push("mean |e|", cell.mean_abs, None);
    push("|mean e|", cell.bias, cell.bias_mc);
    push("bound (rms)", cell.bound, None);
    out
}

fn cor(cells: &[Cell]) -> Vec<Claim> {
    let mut out = sphere_sizes(cells);
    out.push(hot_spots_agree(cells));
    out.extend(orientation_noise(cells));
    out.push(sfa_is_unstable(cells));
    out
}

/// Errors of SFE for the paper's numbers of poses.
fn sphere_sizes(cells: &[Cell]) -> Vec<Claim> {
    let mut out = Vec::new();
    let mut nine = Vec::new();
    for radius in [100.0, 250.0] {
        let cell = hand(cells, "sfe", 9, [radius, 1.0, 0.0]);
        nine.extend(sizes(cell, &format!(", r {radius} mm")));
    }
    out.push(claim(
        "§3.3",
        "SFE, 9 poses, σ = 1 mm: mean error 0.27 mm",
        "mm",
        nine,
    ));
    let mut real = Vec::new();
    for samples in [63, 16, 9] {
        let cell = hand(cells, "sfe", samples, [100.0, 2.5, 0.0]);
        real.extend(sizes(cell, &format!(", n = {samples}")));
    }
    out.push(claim(
        "§3.3",
        "SFE, σ = 2.5 mm: about 0.2 mm for every number of poses (r 100 mm)",
        "mm",
        real,
    ));
    out.push(claim(
        "§3.3",
        "SFE: the largest error is 1 mm, 16 poses at σ = 5 mm (r 100 mm)",
        "mm",
        sizes(hand(cells, "sfe", 16, [100.0, 5.0, 0.0]), ""),
    ));
    out
}

/// HSE against HSA.
fn hot_spots_agree(cells: &[Cell]) -> Claim {
    let mut gaps = Vec::new();
    let poses = |method: &'static str| {
        cells
            .iter()
            .filter(move |c| c.method == method && c.scene.part == Part::Grid)
    };
    for (hse, hsa) in poses("hse").zip(poses("hsa")) {
        if let (true, Some(a), Some(b)) = (hse.scene == hsa.scene, hse.rms, hsa.rms) {
            gaps.push((a / b - 1.0).abs());
        }
    }
    gaps.sort_by(f64::total_cmp);
    let gap = |what: &str, value: Option<&f64>| {
        value.map(|value| Measured {
            what: what.to_owned(),
            value: *value,
            mc: None,
        })
    };
    claim(
        "§3.3",
        "HSE and HSA yield almost identical results",
        "1",
        [
            gap(
                "relative difference of their rms: median",
                gaps.get(gaps.len() / 2),
            ),
            gap("largest", gaps.last()),
        ]
        .into_iter()
        .flatten()
        .collect(),
    )
}

/// What orientation noise does to hot spots and to spheres.
fn orientation_noise(cells: &[Cell]) -> Vec<Claim> {
    let mut out = Vec::new();
    let rms = |method: &str, turn: f64, radius: f64| {
        let cell = hand(cells, method, 63, [radius, 1.0, turn])?;
        Some(Measured {
            what: format!("rms {method}, {turn}°, n = 63, σ 1 mm, r {radius} mm"),
            value: cell.rms? * 1e3,
            mc: cell.rms_mc.map(|m| m * 1e3),
        })
    };
    out.push(claim(
        "§3.3",
        "hot spot: the higher the rotational error, the higher the CoR error",
        "mm",
        [0.0, 1.0, 5.0]
            .into_iter()
            .flat_map(|turn| {
                [
                    rms("hse", turn, 100.0),
                    rms("hotspot_ml, σ known", turn, 100.0),
                ]
            })
            .flatten()
            .collect(),
    ));
    out.push(claim(
        "§3.3",
        "SFE is not affected by rotational errors",
        "mm",
        [0.0, 1.0, 5.0]
            .into_iter()
            .filter_map(|turn| rms("sfe", turn, 100.0))
            .collect(),
    ));
    out
}

/// SFA beside SFE.
fn sfa_is_unstable(cells: &[Cell]) -> Claim {
    let mut unstable = Vec::new();
    for samples in [63, 16, 9] {
        for method in ["sfe", "sfa"] {
            if let Some(cell) = hand(cells, method, samples, [100.0, 2.5, 0.0])
                && let Some(value) = cell.rms
            {
                unstable.push(Measured {
                    what: format!("rms {method}, n = {samples}, σ 2.5 mm"),
                    value: value * 1e3,
                    mc: cell.rms_mc.map(|m| m * 1e3),
                });
            }
        }
    }
    claim(
        "§3.3",
        "SFA is very unstable (here: on centered, scaled data)",
        "mm",
        unstable,
    )
}

fn aor(cells: &[Cell]) -> Vec<Claim> {
    let mut out = Vec::new();
    for (motion, largest, mean) in [
        ("hand z", "0.009 rad (0.5°)", "0.2°"),
        ("hand x", "0.012 rad (printed 0.6°, is 0.69°)", "0.4°"),
    ] {
        for radius_mm in [100.0, 250.0] {
            let here: Vec<&Cell> = cells
                .iter()
                .filter(|c| {
                    c.scene.part == Part::Grid
                        && c.scene.motion == motion
                        && c.quantity == Quantity::Direction
                        && c.method == "planar_radial_gn"
                        && (c.scene.radius_m * 1e3 - radius_mm).abs() < 1e-9
                })
                .collect();
            let measure = |name: &str, of: &dyn Fn(&Cell) -> Option<f64>| {
                let values: Vec<f64> = here.iter().filter_map(|c| of(c)).collect();
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                let largest = values.iter().copied().fold(0.0, f64::max);
                let number = |what: &str, value: f64| Measured {
                    what: format!("{what} {name}"),
                    value: value.to_degrees(),
                    mc: None,
                };
                if values.is_empty() {
                    Vec::new()
                } else {
                    vec![
                        number("mean over the nine cells of", mean),
                        number("largest", largest),
                    ]
                }
            };
            let mut measured = measure("mean |e|", &|c| c.mean_abs);
            measured.extend(measure("|mean e|", &|c| c.bias));
            measured.extend(measure("bound (rms)", &|c| c.bound));
            out.push(claim(
                "§4",
                &format!(
                    "{motion}: largest error {largest}, mean {mean}, over 19, 10 and 6 poses and three noise levels (r {radius_mm} mm)"
                ),
                "deg",
                measured,
            ));
        }
    }
    let frame = |method: &str| -> Vec<Measured> {
        cells
            .iter()
            .filter(|c| c.method == method && c.quantity == Quantity::Turn)
            .take(1)
            .filter_map(|c| {
                Some(Measured {
                    what: format!("rms {method}, σ 1 mm, 0.5°"),
                    value: c.rms?.to_degrees(),
                    mc: c.rms_mc.map(f64::to_degrees),
                })
            })
            .collect()
    };
    out.push(claim(
        "§5.2",
        "Algorithm 1 averages the distal axes as they stand in the tracker's frame",
        "deg",
        [
            "algorithm1, as printed, in the tracker",
            "algorithm1, turned back, in the tracker",
            "frame_ml, in the tracker",
        ]
        .into_iter()
        .flat_map(frame)
        .collect(),
    ));
    out
}
