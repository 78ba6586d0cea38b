//! Three tenths of the poses are somewhere else.
//!
//! Each trial draws a clean recording, moves exactly 30 % of its poses by up to the reach in every coordinate, and asks: the robust
//! estimators with all samples, the plain estimator with the clean recording (the reference), and the plain estimator
//! with the moved ones (what happens without protection). Where outliers hide, one who knows
//! everything about them but which ones they are says what is possible ([`super::mixture`]). With seven tenths left, 1/√0.7 = 1.20 is what perfect
//! knowledge of them gives on average; with few poses, which ones are lost matters.

use calib_cor::{EstimatorInfo, Input, Options, Pose, estimators};
use nalgebra::{Point3, Vector3};

use super::{
    method::{Gets, record},
    mixture::Mixture,
    poses::{Ball, CENTER},
};
use crate::{
    cell::{Quantity, Scene},
    experiment::Experiment,
    motion::Range,
    noise::Noise,
    tally::{Row, Tally},
};

/// Part of the poses that are somewhere else.
const SHARE: f64 = 0.3;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Sees {
    Clean,
    /// Only the poses that were not moved: perfect knowledge.
    Left,
    Moved,
}

/// Name, estimator, which recording, and whether the noise is stated: the plain estimator with the clean recording, with the inliers
/// and with everything; the robust ones with everything.
fn ways(gets: Gets) -> Vec<(String, &'static str, Sees, bool)> {
    let (plain, data) = match gets {
        Gets::Points => ("ml_sphere", "points"),
        Gets::Poses => ("hotspot_ml", "poses"),
    };
    let mut ways = vec![
        (format!("{plain}, clean"), plain, Sees::Clean, false),
        (format!("{plain}, inliers"), plain, Sees::Left, false),
        (plain.to_owned(), plain, Sees::Moved, false),
    ];
    for robust in ["robust", "consensus"] {
        let name = format!("{robust}, {data}");
        ways.push((name.clone(), robust, Sees::Moved, false));
        ways.push((format!("{name}, σ known"), robust, Sees::Moved, true));
    }
    ways
}

struct Use {
    info: &'static EstimatorInfo,
    gets: Gets,
    sees: Sees,
    known: bool,
}

pub(crate) struct OutlierScene {
    scene: Scene,
    ball: Ball,
    reach: f64,
    uses: Vec<Use>,
    rows: Vec<Row>,
    /// Where outliers hide among the points: the best that could be done, in the last row.
    oracle: Option<Mixture>,
}

impl OutlierScene {
    pub fn new(scene: Scene, reach: f64) -> Self {
        let ball = Ball::new(Range::Hand.turns(scene.samples), &scene);
        let (mut uses, mut rows) = (Vec::new(), Vec::new());
        let all = [Gets::Points, Gets::Poses]
            .into_iter()
            .flat_map(|gets| ways(gets).into_iter().map(move |way| (gets, way)));
        for (gets, (name, id, sees, known)) in all {
            if let Some(info) = estimators().iter().find(|e| e.id == id) {
                rows.push(Row {
                    method: name,
                    estimator: info.id.to_owned(),
                    from_plugin: false,
                    quantity: Quantity::Center,
                    // The bound of the clean recording; with outliers nobody reaches it.
                    bound: ball.bound(gets),
                    control: None,
                });
                uses.push(Use {
                    info,
                    gets,
                    sees,
                    known,
                });
            }
        }
        let oracle = (reach < scene.radius_m).then(|| {
            rows.push(Row {
                method: "known mixture, points".to_owned(),
                estimator: "known_mixture".to_owned(),
                from_plugin: false,
                quantity: Quantity::Center,
                bound: ball.bound(Gets::Points),
                control: None,
            });
            Mixture::new(&ball.arms(), scene.sigma_t_m, SHARE, reach)
        });
        Self {
            oracle,
            scene: Scene {
                condition: format!("30 % outliers, ±{} mm", reach * 1e3),
                ..scene
            },
            ball,
            reach,
            uses,
            rows,
        }
    }
}

impl Experiment for OutlierScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Consensus is a hundred times slower than a plain fit.
    fn trials(&self, base: u64) -> u64 {
        base.div_ceil(2)
    }

    fn trial(&self, _: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        let draw = self.ball.draw(noise);
        let n = draw.poses.len();
        let mut moved = draw.poses.clone();
        let mut left = draw.poses.clone();
        let mut to_move = (SHARE * n as f64 + 1e-9) as usize;
        while to_move > 0 {
            let k = noise.below(n);
            if left[k].take().is_some()
                && let Some(pose) = moved[k].as_mut()
            {
                pose.translation += Vector3::from_fn(|_, _| self.reach * noise.between(-1.0, 1.0));
                to_move -= 1;
            }
        }
        if let (Some(oracle), Some(tally)) = (&self.oracle, tallies.last_mut()) {
            let points: Vec<_> = moved.iter().flatten().map(|p| p.translation).collect();
            let found = oracle.center(&points, &CENTER, self.scene.radius_m);
            tally.error(true, found - CENTER, 0.0, None);
        }
        for (one, tally) in self.uses.iter().zip(tallies) {
            let poses = match one.sees {
                Sees::Clean => &draw.poses,
                Sees::Left => &left,
                Sees::Moved => &moved,
            };
            let options = match (one.known, one.gets) {
                (false, _) => Options::default(),
                (true, Gets::Poses) => self.ball.options(true),
                (true, Gets::Points) => Options {
                    sigma_r: None,
                    ..self.ball.options(true)
                },
            };
            match one.gets {
                Gets::Poses => record(
                    one.info,
                    &Input::Poses(poses),
                    &options,
                    (CENTER, None),
                    tally,
                ),
                Gets::Points => {
                    let tracks = [origins(poses)];
                    record(
                        one.info,
                        &Input::Points(&tracks),
                        &options,
                        (CENTER, None),
                        tally,
                    );
                }
            }
        }
    }
}

fn origins(poses: &[Option<Pose>]) -> Vec<Option<Point3<f64>>> {
    poses
        .iter()
        .map(|p| p.map(|p| Point3::from(p.translation)))
        .collect()
}
