//! The `simulate` section.

use calib_finding::nearest_word;

use super::names::MarkerList;
use super::*;
use crate::profile::{Error3, Protocol, SimErrors, SimMount, SimNoise, Simulation, Steps};
use crate::raw::{RawNoiseTimes, RawProtocol, RawSimErrors, RawSimulate, RawSteps};

impl Checker<'_> {
    pub(super) fn simulation(&mut self, raw: &RawSimulate) -> Simulation {
        let mounts = self.mounts(raw);
        let (fixed, compliance) = self.exact_errors(&raw.errors);
        if !(0.0..1.0).contains(&raw.noise.occluded) && !self.named_already(raw.noise.occluded) {
            self.problem(
                &["simulate", "noise", "occluded"],
                format!("{} is not a fraction of lost samples", raw.noise.occluded),
                "give a number from 0 to below 1",
            );
        }
        let mut recordings = BTreeMap::new();
        for (name, protocol) in &raw.recordings {
            self.known(
                "recording",
                &["simulate", "recordings", name],
                name,
                self.raw.recordings.keys(),
            );
            recordings.insert(name.clone(), self.protocol(name, protocol));
        }
        Simulation {
            seed: raw.seed,
            tracker_from_root: pose(&raw.tracker_from_root),
            mounts,
            errors: SimErrors {
                joint_offset: raw.errors.joint_offset_deg * DEG,
                axis: Error3 {
                    position: raw.errors.axis_mm * MM,
                    angle: raw.errors.axis_deg * DEG,
                },
                mount: Error3 {
                    position: raw.errors.mount_mm * MM,
                    angle: raw.errors.mount_deg * DEG,
                },
                fixed,
                compliance,
            },
            noise: SimNoise {
                marker: raw.noise.marker_mm * MM,
                body: Error3 {
                    position: raw.noise.body_mm * MM,
                    angle: raw.noise.body_deg * DEG,
                },
                marker_sight: raw.noise.marker_sight_mm.map(|s| s * MM),
                body_sight: raw.noise.body_sight_mm.map(|s| s * MM),
                body_sight_rad: raw.noise.body_sight_deg.map(|s| s * DEG),
                joint: raw.noise.joint_deg * DEG,
                occluded: raw.noise.occluded,
            },
            recordings,
        }
    }

    /// The nominal mounts; every body needs one.
    fn mounts(&mut self, raw: &RawSimulate) -> BTreeMap<String, SimMount> {
        let mut mounts = BTreeMap::new();
        for (name, mount) in &raw.mounts {
            let path = ["simulate", "mounts", name];
            self.known("body", &path, name, self.raw.bodies.keys());
            self.marker_places(
                &["simulate", "mounts", name, "markers_mm"],
                name,
                &mount.markers_mm,
                MarkerList::Simulated,
            );
            let rigid = pose(&crate::raw::RawPose {
                xyz_mm: mount.xyz_mm,
                rpy_deg: mount.rpy_deg,
            });
            let markers = mount
                .markers_mm
                .iter()
                .map(|(m, p)| (m.clone(), Point3::from(Vector3::from(*p) * MM)))
                .collect();
            mounts.insert(
                name.clone(),
                SimMount {
                    link_from_body: rigid,
                    markers,
                },
            );
        }
        let bodies = &self.raw.bodies;
        let without = || bodies.keys().filter(|name| !raw.mounts.contains_key(*name));
        // A mount whose body nobody knows is the mount of the body that it almost names.
        let strangers = raw.mounts.keys().filter(|name| !bodies.contains_key(*name));
        let meant: BTreeSet<&str> = strangers
            .filter_map(|name| nearest_word(name, without().map(String::as_str)))
            .collect();
        for name in without().filter(|name| !meant.contains(name.as_str())) {
            self.key_problem(
                &["simulate", "mounts"],
                format!("body `{name}` has no simulated mount"),
                format!("add `{name}: {{xyz_mm: […], rpy_deg: […]}}`"),
            );
        }
        mounts
    }

    /// Differences that are stated exactly: origins of fixed joints, and compliances.
    fn exact_errors(
        &mut self,
        raw: &RawSimErrors,
    ) -> (BTreeMap<JointId, Isometry3<f64>>, BTreeMap<JointId, f64>) {
        let mut fixed: BTreeMap<JointId, Isometry3<f64>> = BTreeMap::new();
        for (joint, change) in &raw.fixed {
            if let Some(id) = self.joint(&["simulate", "errors", "fixed", joint], joint) {
                fixed.insert(id, pose(change));
            }
        }
        let mut compliance = BTreeMap::new();
        for (joint, value) in &raw.compliance_deg_per_nm {
            if let Some(id) = self.joint(
                &["simulate", "errors", "compliance_deg_per_nm", joint],
                joint,
            ) {
                compliance.insert(id, value * DEG);
            }
        }
        (fixed, compliance)
    }

    fn grid(&mut self, name: &str, raw: &[RawSteps]) -> Vec<(JointId, Steps)> {
        let mut grid = Vec::new();
        for (i, steps) in raw.iter().enumerate() {
            let path = [
                "simulate",
                "recordings",
                name,
                "grid",
                &i.to_string(),
                "joint",
            ];
            if let Some((joint, factor)) = self.joint_key(&path, &steps.joint) {
                self.within_limits(
                    &path,
                    joint,
                    steps.from.min(steps.to) * factor,
                    steps.from.max(steps.to) * factor,
                );
                grid.push((
                    joint,
                    Steps {
                        from: steps.from * factor,
                        to: steps.to * factor,
                        poses: steps.poses,
                    },
                ));
            }
            if steps.poses == 0 {
                self.problem(&path, "a grid of no poses", "give `poses: 1` or more");
            }
        }
        grid
    }

    fn random(
        &mut self,
        name: &str,
        raw: &BTreeMap<String, [f64; 2]>,
    ) -> BTreeMap<JointId, (f64, f64)> {
        let mut random = BTreeMap::new();
        for (key, range) in raw {
            let path = ["simulate", "recordings", name, "random", key];
            if let Some((joint, factor)) = self.joint_key(&path, key) {
                let (low, high) = (
                    range[0].min(range[1]) * factor,
                    range[0].max(range[1]) * factor,
                );
                self.within_limits(&path, joint, low, high);
                random.insert(joint, (low, high));
            }
        }
        random
    }

    /// One factor per value of `repeat_at`, or a single one without.
    fn noise_times(&mut self, name: &str, raw: &RawProtocol) -> Vec<f64> {
        const KEY: &str = "tracker_noise_times";
        let at = ["simulate", "recordings", name, KEY];
        let groups = raw.repeat_at.values().next().map(Vec::len);
        match &raw.tracker_noise_times {
            None => vec![1.0; groups.unwrap_or(1)],
            Some(RawNoiseTimes::Everywhere(times)) => {
                self.above_zero(&at, *times);
                vec![*times; groups.unwrap_or(1)]
            }
            Some(RawNoiseTimes::Each(each)) => {
                for (i, times) in each.iter().enumerate() {
                    let at = ["simulate", "recordings", name, KEY, &i.to_string()];
                    self.above_zero(&at, *times);
                }
                match groups {
                    None => self.problem(
                        &at,
                        "a list of factors, but no `repeat_at` whose values they belong to",
                        "give one number for the whole recording, or add `repeat_at`",
                    ),
                    Some(groups) if groups != each.len() => self.problem(
                        &at,
                        format!("{} factors for {groups} values of `repeat_at`", each.len()),
                        format!("give {groups} numbers, or one for all"),
                    ),
                    Some(_) => {}
                }
                each.clone()
            }
        }
    }

    /// A recording that fits into the memory of a computer.
    fn not_too_many(&mut self, name: &str, raw: &RawProtocol) {
        /// Their table has some hundred megabytes.
        const MOST: usize = 1_000_000;
        let repeated = raw.repeat_at.values().next().map_or(1, Vec::len);
        let grid = raw.grid.iter().map(|steps| steps.poses);
        let grid = grid.fold(repeated, usize::saturating_mul);
        let random = raw.poses.saturating_mul(repeated);
        for (key, is_given, count) in [
            ("grid", !raw.grid.is_empty(), grid),
            ("poses", !raw.random.is_empty(), random),
        ] {
            if is_given && count > MOST {
                self.key_problem(
                    &["simulate", "recordings", name, key],
                    format!("{count} poses are asked for"),
                    format!("simulate {MOST} or fewer in a recording"),
                );
            }
        }
    }

    pub(super) fn protocol(&mut self, name: &str, raw: &RawProtocol) -> Protocol {
        let at = |key: &'static str| ["simulate", "recordings", name, key];
        let grid = self.grid(name, &raw.grid);
        let random = self.random(name, &raw.random);
        if raw.random.is_empty() != (raw.poses == 0) {
            self.problem(
                &at("poses"),
                "`random` and `poses` belong together",
                "give both or neither",
            );
        }
        if raw.grid.is_empty() == raw.random.is_empty() {
            self.key_problem(
                &["simulate", "recordings", name],
                "a protocol is either a grid or random poses",
                "give `grid` or `random`, not both",
            );
        }
        self.not_too_many(name, raw);
        let mut repeat_at = None;
        for (key, values) in &raw.repeat_at {
            if let Some((joint, factor)) =
                self.joint_key(&["simulate", "recordings", name, "repeat_at", key], key)
            {
                repeat_at = Some((joint, values.iter().map(|v| v * factor).collect()));
            }
        }
        if raw.repeat_at.len() > 1 {
            self.problem(
                &at("repeat_at"),
                "poses repeat at the values of one joint",
                "name one joint",
            );
        }
        for (i, body) in raw.bodies.iter().flatten().enumerate() {
            let path = ["simulate", "recordings", name, "bodies", &i.to_string()];
            self.known("body", &path, body, self.raw.bodies.keys());
        }
        Protocol {
            grid,
            random,
            poses: raw.poses,
            repeat_at,
            tracker_noise_times: self.noise_times(name, raw),
            hold: self.joint_values(&at("hold"), &raw.hold),
            bodies: raw
                .bodies
                .clone()
                .unwrap_or_else(|| self.raw.bodies.keys().cloned().collect()),
        }
    }
}
