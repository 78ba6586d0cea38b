//! Measurements whose errors at a sample depend on each other, and what they depend on.
//!
//! V_s is block-diagonal over the measurements that share no random effect: two arms on one torso that stands still, a body on the base beside one
//! on the tool. Sums over the rows of a part need its columns and random effects only.

use std::ops::Range;

use crate::graph::problem::Problem;
use crate::model::path::CompiledPath;

/// Some measurements, and the columns and random effects that they depend on.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// Whether each measurement of the problem belongs to it.
    has: Vec<bool>,
    /// Column of the part → column of the model, ascending.
    pub columns: Vec<usize>,
    /// Random effect of the part → slot of the model, ascending.
    pub slots: Vec<usize>,
    /// Column of the model → column of the part; its length where it has none.
    place: Vec<usize>,
    /// Per measurement of the problem: the part's columns of the columns of its path.
    path_columns: Vec<Vec<usize>>,
    /// Per measurement of the problem: the part's random effects of those of its path.
    path_slots: Vec<Vec<usize>>,
    /// Largest number of rows in one sample.
    pub max_rows: usize,
}

/// What the parts of a model are made from.
pub(crate) struct Laid<'a> {
    pub problem: &'a Problem,
    pub column_of: &'a [Option<usize>],
    pub paths: &'a [CompiledPath],
    /// Per measurement: (sample, observations).
    pub of_measurement: &'a [Vec<(usize, Range<usize>)>],
    /// Number of columns and of random effects.
    pub sizes: (usize, usize),
}

impl Laid<'_> {
    /// All measurements with all columns and random effects of the model, in their order.
    pub(crate) fn whole(&self) -> Part {
        let all = vec![true; self.paths.len()];
        self.part(
            all,
            (0..self.sizes.0).collect(),
            (0..self.sizes.1).collect(),
        )
    }

    /// The parts of the model, by their first measurement.
    pub(crate) fn parts(&self) -> Vec<Part> {
        let count = self.paths.len();
        // Of each measurement the first one that it hangs together with.
        let mut first: Vec<usize> = (0..count).collect();
        for slot in 0..self.sizes.1 {
            let sharing = (0..count).filter(|&m| self.paths[m].slots.contains(&slot));
            let together: Vec<usize> = sharing.map(|m| first[m]).collect();
            if let Some(&least) = together.iter().min() {
                for of in &mut first {
                    if together.contains(of) {
                        *of = least;
                    }
                }
            }
        }
        (0..count)
            .filter(|&m| first[m] == m)
            .map(|m| {
                let has: Vec<bool> = first.iter().map(|of| *of == m).collect();
                let (mut columns, mut slots) = (Vec::new(), Vec::new());
                for own in (0..count).filter(|&own| has[own]) {
                    columns.extend(&self.paths[own].columns);
                    columns.extend(self.point_columns(own));
                    slots.extend(&self.paths[own].slots);
                }
                for list in [&mut columns, &mut slots] {
                    list.sort_unstable();
                    list.dedup();
                }
                self.part(has, columns, slots)
            })
            .collect()
    }

    /// Columns of the unknown coordinates of the points that a measurement measures.
    fn point_columns(&self, measurement: usize) -> Vec<usize> {
        let kind = self.problem.measurements[measurement].kind.of();
        let points = kind.points().into_iter();
        let ids = points.filter_map(|p| self.problem.points[p.index()].parameters);
        ids.flatten()
            .filter_map(|id| self.column_of[id.index()])
            .collect()
    }

    fn part(&self, has: Vec<bool>, columns: Vec<usize>, slots: Vec<usize>) -> Part {
        let inverse = |list: &[usize], count: usize| {
            let mut place = vec![list.len(); count];
            for (own, &global) in list.iter().enumerate() {
                place[global] = own;
            }
            place
        };
        let place = inverse(&columns, self.sizes.0);
        let slot_place = inverse(&slots, self.sizes.1);
        let of = |list: fn(&CompiledPath) -> &[usize], place: &[usize]| -> Vec<Vec<usize>> {
            let paths = self.paths.iter().enumerate();
            let own = |(m, path)| match has[m] {
                true => list(path).iter().map(|&global| place[global]).collect(),
                false => Vec::new(),
            };
            paths.map(own).collect()
        };
        let mut rows = vec![0; self.problem.samples];
        for (m, seen) in self
            .of_measurement
            .iter()
            .enumerate()
            .filter(|(m, _)| has[*m])
        {
            let each = self.problem.measurements[m].kind.of().rows();
            for (sample, observations) in seen {
                rows[*sample] += each * observations.len();
            }
        }
        Part {
            path_columns: of(|path| &path.columns, &place),
            path_slots: of(|path| &path.slots, &slot_place),
            max_rows: rows.into_iter().max().unwrap_or(0),
            has,
            columns,
            slots,
            place,
        }
    }
}

impl Part {
    /// Whether a measurement belongs to it.
    pub(crate) fn has(&self, measurement: usize) -> bool {
        self.has[measurement]
    }

    /// The part's column of one of the model that it depends on.
    pub(crate) fn column(&self, of_model: usize) -> usize {
        self.place[of_model]
    }

    /// The part's columns of the path of one of its measurements, in the order of the path.
    pub(crate) fn path_columns(&self, measurement: usize) -> &[usize] {
        &self.path_columns[measurement]
    }

    /// The part's random effects of the path of one of its measurements, in the order of the path.
    pub(crate) fn path_slots(&self, measurement: usize) -> &[usize] {
        &self.path_slots[measurement]
    }
}
