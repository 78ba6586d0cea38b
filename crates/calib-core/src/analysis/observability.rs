//! What the data cannot determine, as data: which parameters change together, and why. Words are made by the renderer.

use std::ops::Range;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use crate::analysis::gauge::{Axes, Gauge, Place, classify, places};
use crate::analysis::information::Information;
use crate::graph::ids::{EdgeId, ParameterId};
use crate::model::layout::Model;
use crate::model::null_space::{TERM, sparse_basis};
use crate::model::path::Step;
use crate::model::values::Values;

/// Share of one parameter in a direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Term {
    /// Parameter of the problem.
    pub parameter: ParameterId,
    /// Its change, in its unit, when the first term changes by one of its scales (1°, 1 cm or prior σ).
    pub amount: f64,
}

/// A direction in the space of parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Direction {
    /// Parameters that change together, largest share first.
    pub terms: Vec<Term>,
    /// σ along it if the data alone decided, divided by the prior σ; `None`: infinite, the direction is not
    /// observable.
    pub sigma_ratio: Option<f64>,
    /// Its family.
    pub gauge: Gauge,
}

/// Result of the analysis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Observability {
    /// Directions that the data see.
    pub rank: usize,
    /// Not observable: no measurement changes along them.
    pub null: Vec<Direction>,
    /// Joints that did not move, held at nominal.
    pub unmoved: Vec<EdgeId>,
}

impl Observability {
    /// Number of directions that the data do not see.
    #[must_use]
    pub fn nullity(&self) -> usize {
        self.null.len()
    }
}

/// A direction with a singular value below this has a data-only σ larger than the prior's.
const WEAK: f64 = 1.0;

/// Shares of a direction are distinguished to one part in this many: far above rounding, far below anything that is printed.
const ALIKE: f64 = 1e6;

/// Null space (sparse where it can be) of a solved model.
pub(crate) fn observe(model: &Model, values: &Values, information: &Information) -> Observability {
    let named = Named::new(model, values, information);
    let null = information.null_space();
    let basis = if null.ncols() == 0 {
        Vec::new()
    } else {
        sparse_basis(null, &blocks(model, &named.places))
    };
    Observability {
        rank: information.rank,
        null: basis.iter().map(|v| named.direction(v, None)).collect(),
        unmoved: model.unmoved().to_vec(),
    }
}

/// Which of [`Information::directions`] are weakly identifiable: the last that the data see.
pub(crate) fn weak(information: &Information) -> Range<usize> {
    let values = information.singular_values().iter();
    let strong = values.take_while(|s| **s >= WEAK).count();
    strong.min(information.rank)..information.rank
}

/// These directions in terms of the parameters.
pub(crate) fn directions(
    model: &Model,
    values: &Values,
    information: &Information,
    of: Range<usize>,
) -> Vec<Direction> {
    let named = Named::new(model, values, information);
    let direction = |i: usize| {
        let v = information.directions().column(i).into_owned();
        named.direction(&v, Some(1.0 / information.singular_values()[i]))
    };
    of.map(direction).collect()
}

/// What directions are named by.
struct Named<'a> {
    model: &'a Model,
    information: &'a Information,
    places: Vec<Place>,
    axes: Axes,
}

impl<'a> Named<'a> {
    fn new(model: &'a Model, values: &Values, information: &'a Information) -> Self {
        Self {
            model,
            information,
            places: places(model),
            axes: Axes::new(model, values),
        }
    }

    fn direction(&self, v: &DVector<f64>, sigma_ratio: Option<f64>) -> Direction {
        let (columns, terms) = terms(self.model, self.information, v);
        Direction {
            terms,
            sigma_ratio,
            gauge: classify(self.model, &self.places, &self.axes, &columns),
        }
    }
}

/// Columns that belong to one place, in the order in which the longest path meets the places.
fn blocks(model: &Model, places: &[Place]) -> Vec<Vec<usize>> {
    let mut blocks: Vec<(Place, Vec<usize>)> = Vec::new();
    for (c, place) in places.iter().enumerate() {
        match blocks.iter_mut().find(|(p, _)| p == place) {
            Some((_, columns)) => columns.push(c),
            None => blocks.push((*place, vec![c])),
        }
    }
    let order = chain_order(model);
    blocks.sort_by_key(|(p, columns)| (order_of(*p, &order), columns[0]));
    blocks.into_iter().map(|(_, c)| c).collect()
}

/// Edges in the order in which the longest path meets them.
fn chain_order(model: &Model) -> Vec<usize> {
    let mut order = Vec::new();
    let mut paths: Vec<_> = model.paths.iter().collect();
    paths.sort_by_key(|p| std::cmp::Reverse(p.steps.len()));
    for path in paths {
        for step in &path.steps {
            if let Step::Unknown { edge, .. } | Step::Joint { edge, .. } = step
                && !order.contains(edge)
            {
                order.push(*edge);
            }
        }
    }
    order
}

fn order_of(place: Place, order: &[usize]) -> usize {
    match place {
        Place::Pose(e) | Place::Effects(e) => {
            order.iter().position(|o| *o == e).unwrap_or(order.len())
        }
        Place::Points(_) => order.len() + 1,
        Place::Loose(_) => order.len() + 2,
    }
}

/// Columns and terms of a direction, largest share first; shares that are rounding are left out.
fn terms(model: &Model, information: &Information, v: &DVector<f64>) -> (Vec<usize>, Vec<Term>) {
    let largest = v.amax();
    let mut columns: Vec<usize> = (0..v.len())
        .filter(|&c| v[c].abs() > TERM * largest)
        .collect();
    // Shares that differ by rounding only are in the order of the columns, whatever the last bits of the data.
    let share = |c: usize| (v[c].abs() / largest * ALIKE).round();
    columns.sort_by(|&a, &b| share(b).total_cmp(&share(a)).then(a.cmp(&b)));
    let lead = columns.first().map_or(1.0, |&c| v[c]);
    // amount_c = s_c v_c / v_lead, s the scales of the parameters
    let terms = columns.iter().map(|&c| Term {
        parameter: ParameterId::of(model.columns[c]),
        amount: v[c] / lead * information.scale[c],
    });
    (columns.clone(), terms.collect())
}
