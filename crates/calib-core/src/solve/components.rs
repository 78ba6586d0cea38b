//! Sums over the samples for the noise levels: equations (2) and (3) of [`noise`](crate::solve::noise).

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::model::cache::State;
use crate::model::layout::Model;
use crate::model::parts::Part;
use crate::model::values::Values;
use crate::solve::chunks::{chunked, is_one_chunk};
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::panel::Local;
use crate::solve::rows::{SampleRows, add_block};
use crate::solve::structured::RandomPart;
use crate::solve::turned::Rest;

/// Sums of (2) and (3) over the samples, for the groups that are to be estimated.
pub(crate) struct Sums {
    /// eᵀV⁻¹V_gV⁻¹e
    pub squares: DVector<f64>,
    /// tr(V_g V⁻¹)
    pub traces: DVector<f64>,
    /// tr(V_g V⁻¹ V_h V⁻¹)
    pub products: DMatrix<f64>,
    moments: Vec<Moments>,
}

/// Of a part and every group, JᵀV⁻¹V_gV⁻¹J, and last the same of everything that is not to be estimated; `None`: nothing of the group in the part.
/// Their sum over groups and parts is JᵀV⁻¹J.
struct Moments {
    part: Arc<Part>,
    of: Vec<Option<Local>>,
}

impl Moments {
    /// Space for so many rows of a group, or of what is not to be estimated.
    fn rows(&mut self, group: usize, m: usize) -> &mut [f64] {
        self.local(group).rows(m)
    }

    fn local(&mut self, group: usize) -> &mut Local {
        let part = &self.part;
        self.of[group].get_or_insert_with(|| {
            let most = part.max_rows.max(part.slots.len());
            Local::new(part.columns.len(), most)
        })
    }
}

impl Sums {
    /// Nothing summed yet, for so many groups.
    fn zeros(model: &Model, count: usize) -> Self {
        let of_part = |part: &Arc<Part>| Moments {
            part: Arc::clone(part),
            of: (0..=count).map(|_| None).collect(),
        };
        Self {
            squares: DVector::zeros(count),
            traces: DVector::zeros(count),
            products: DMatrix::zeros(count, count),
            moments: model.parts.iter().map(of_part).collect(),
        }
    }

    /// Rows without a twist: V⁻¹ is the unit matrix, V_g too.
    fn add_rest(&mut self, layout: &Layout, part: usize, rest: &Rest<'_>) {
        let of_none = self.squares.len();
        let place = layout.place[rest.group];
        let local = self.moments[part].local(place.unwrap_or(of_none));
        rest.add_gram(&mut local.h);
        if let Some(g) = place {
            self.squares[g] += rest.cost;
            self.traces[g] += rest.rows as f64;
            self.products[(g, g)] += rest.rows as f64;
        }
    }

    /// Adds the sums over further samples.
    fn add(&mut self, more: Self) {
        self.squares += &more.squares;
        self.traces += &more.traces;
        self.products += &more.products;
        for (moments, more) in self.moments.iter_mut().zip(more.moments) {
            for (sum, more) in moments.of.iter_mut().zip(more.of) {
                match (sum, more) {
                    (Some(sum), Some(more)) => sum.h += more.h,
                    (sum, more) => *sum = sum.take().or(more),
                }
            }
        }
    }

    /// tr(C JᵀV⁻¹V_gV⁻¹J) of every group.
    pub(crate) fn traces_with(&self, c: &DMatrix<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(self.squares.len());
        for moments in &self.moments {
            let columns = &moments.part.columns;
            let own = DMatrix::from_fn(columns.len(), columns.len(), |a, b| {
                c[(columns[a], columns[b])]
            });
            for (x, of_group) in out.iter_mut().zip(&moments.of) {
                *x += of_group.as_ref().map_or(0.0, |local| local.h.dot(&own));
            }
        }
        out
    }

    /// H of the sums and the prior; without gradient and cost.
    pub(crate) fn normal_equations(&self, model: &Model, values: &Values) -> NormalEquations {
        let n = model.free();
        let mut system = NormalEquations::new(n);
        for moments in &self.moments {
            let columns = &moments.part.columns;
            for local in moments.of.iter().flatten() {
                for (a, &row) in columns.iter().enumerate() {
                    let to = &mut system.h[row * n..(row + 1) * n];
                    for (b, &column) in columns.iter().enumerate().skip(a) {
                        to[column] += local.h[(a, b)];
                    }
                }
            }
        }
        add_prior(model, values, &mut system);
        system
    }
}

/// Group of every row of a sample, in the order of its rows.
fn row_groups(model: &Model, rows: &SampleRows, out: &mut Vec<usize>) {
    out.clear();
    out.resize(rows.m, 0);
    for block in &rows.turned {
        out[block.first..block.first + 6].fill(block.group);
    }
    for &(o, first, _) in &rows.blocks {
        add_block(model, o, |i, j, group, _| {
            if i == j {
                out[first + i] = group;
            }
        });
    }
}

/// Where each row and random effect is counted.
struct Layout {
    /// Group → its place among those that are to be estimated.
    place: Vec<Option<usize>>,
    /// Of every part: its random effects of every estimated group, and last those of none.
    slots: Vec<Vec<Vec<usize>>>,
}

impl Layout {
    fn new(model: &Model, groups: &[usize]) -> Self {
        let place: Vec<Option<usize>> = (0..model.problem.groups.len())
            .map(|g| groups.iter().position(|h| *h == g))
            .collect();
        let slots = model.parts.iter().map(|part| {
            let mut slots = vec![Vec::new(); groups.len() + 1];
            for (k, &slot) in part.slots.iter().enumerate() {
                let at = model.slots[slot].group.and_then(|g| place[g]);
                slots[at.unwrap_or(groups.len())].push(k);
            }
            slots
        });
        let slots = slots.collect();
        Self { place, slots }
    }
}

/// One sample: what V⁻¹ makes of e, J and U, in block-whitened rows (D = L_D L_Dᵀ).
struct Weighed {
    m: usize,
    k: usize,
    n: usize,
    /// Place of every row's group.
    place: Vec<Option<usize>>,
    /// V⁻¹, m × m
    p: Vec<f64>,
    /// V⁻¹ e
    e: Vec<f64>,
    /// V⁻¹ J, m × n
    j: Vec<f64>,
    /// U, m × k
    u: Vec<f64>,
    /// V⁻¹ U
    pu: Vec<f64>,
    /// Uᵀ V⁻¹ U, k × k
    upu: Vec<f64>,
}

impl Weighed {
    /// Of the sample that `rows` holds, whitened by its blocks.
    fn new(model: &Model, layout: &Layout, rows: &SampleRows, random: &RandomPart) -> Self {
        let (m, n, k) = (rows.m, rows.n, rows.k);
        let mut groups = Vec::new();
        row_groups(model, rows, &mut groups);
        let p = random.weight();
        let mut e = rows.r[..m].to_vec();
        random.weigh(&mut e);
        let mut j = vec![0.0; m * n];
        random.weigh_rows(&rows.j[..m * n], n, &mut j);
        let u = rows.g[..m * k].to_vec();
        let mut pu = vec![0.0; m * k];
        random.weigh_rows(&u, k, &mut pu);
        let mut upu = vec![0.0; k * k];
        for i in 0..m {
            for a in 0..k {
                let ua = u[i * k + a];
                if ua != 0.0 {
                    for b in 0..k {
                        upu[a * k + b] += ua * pu[i * k + b];
                    }
                }
            }
        }
        Self {
            m,
            k,
            n,
            place: groups.iter().map(|g| layout.place[*g]).collect(),
            p,
            e,
            j,
            u,
            pu,
            upu,
        }
    }

    /// Measurement noise: V_g = E_g/θ_g with E_g the unit matrix on the group's rows.
    fn add_rows(&self, part: usize, sums: &mut Sums) {
        let (m, n) = (self.m, self.n);
        let rest = sums.squares.len();
        for i in 0..m {
            sums.moments[part]
                .rows(self.place[i].unwrap_or(rest), 1)
                .copy_from_slice(&self.j[i * n..(i + 1) * n]);
            let Some(g) = self.place[i] else { continue };
            sums.squares[g] += self.e[i] * self.e[i];
            sums.traces[g] += self.p[i * m + i];
            for j in 0..m {
                if let Some(h) = self.place[j] {
                    sums.products[(g, h)] += self.p[i * m + j] * self.p[i * m + j];
                }
            }
        }
    }

    /// Random effects: V_u = u uᵀ/θ_u summed over the columns u of the group.
    fn add_effects(&self, layout: &Layout, part: usize, sums: &mut Sums) {
        let (m, k) = (self.m, self.k);
        let rest = sums.squares.len();
        let of_part = &layout.slots[part];
        for (g, slots) in of_part.iter().enumerate() {
            for &a in slots {
                let along = self.moment_along(a, sums.moments[part].rows(g, 1));
                if g == rest {
                    continue;
                }
                sums.squares[g] += along * along;
                sums.traces[g] += self.upu[a * k + a];
                for (h, others) in of_part[..rest].iter().enumerate() {
                    for &b in others {
                        sums.products[(g, h)] += self.upu[a * k + b] * self.upu[a * k + b];
                    }
                }
                for i in 0..m {
                    if let Some(h) = self.place[i] {
                        let x = self.pu[i * k + a] * self.pu[i * k + a];
                        sums.products[(g, h)] += x;
                        sums.products[(h, g)] += x;
                    }
                }
            }
        }
    }

    /// uᵀ V⁻¹ J of one random effect, written to `row`; returns uᵀ V⁻¹ e.
    fn moment_along(&self, a: usize, row: &mut [f64]) -> f64 {
        let (k, n) = (self.k, self.n);
        let mut along = 0.0;
        row.fill(0.0);
        for i in 0..self.m {
            let ua = self.u[i * k + a];
            if ua != 0.0 {
                along += ua * self.e[i];
                let j = &self.j[i * n..(i + 1) * n];
                row.iter_mut().zip(j).for_each(|(x, j)| *x += ua * j);
            }
        }
        along
    }
}

/// One pass over the samples; `None` when the model cannot be evaluated. V⁻¹ is the weighing of
/// [`structured`](crate::solve::structured), equation (3).
pub(crate) fn sums(
    objective: Objective,
    values: &Values,
    groups: &[usize],
    work: &mut Workspace,
) -> Option<Sums> {
    let model = objective.model;
    let count = model.problem.samples;
    work.cache.update(&model.problem, values);
    let cache = &work.cache;
    let pass = Pass {
        objective,
        layout: &Layout::new(model, groups),
        at: State::new(&model.problem, cache, values),
    };
    if is_one_chunk(count) {
        return pass.sums(0..count, groups.len());
    }
    let mut all = Sums::zeros(model, groups.len());
    let of = |samples: Range<usize>| pass.sums(samples, groups.len());
    chunked(count, of, |sums| all.add(sums))?;
    Some(all)
}

/// Where the sums are wanted.
struct Pass<'a> {
    objective: Objective<'a>,
    layout: &'a Layout,
    at: State<'a>,
}

impl Pass<'_> {
    /// Over some samples, for `count` groups.
    fn sums(&self, samples: Range<usize>, count: usize) -> Option<Sums> {
        let Objective {
            model,
            weights,
            theta,
        } = self.objective;
        let mut sums = Sums::zeros(model, count);
        for (p, part) in model.parts.iter().enumerate() {
            let (mut rows, mut random) = (SampleRows::of(model, part), RandomPart::default());
            for sample in samples.clone() {
                rows.fill_turned(model, self.at, (weights, theta), sample, |rest| {
                    sums.add_rest(self.layout, p, rest);
                });
                if rows.m == 0 {
                    continue;
                }
                rows.whiten_blocks(model, weights, theta, true)?;
                rows.random_part(&mut random)?;
                let weighed = Weighed::new(model, self.layout, &rows, &random);
                weighed.add_rows(p, &mut sums);
                weighed.add_effects(self.layout, p, &mut sums);
            }
            let moments = sums.moments[p].of.iter_mut().flatten();
            moments.for_each(Local::multiply);
        }
        Some(sums)
    }
}
