//! Tables of one line for each scene.

use std::fmt::Write;

use crate::{
    cell::{Cell, Scene, shortest},
    render::text::{probability, three, three_or_dash, with_error},
};

/// mm or degrees.
pub(super) fn shown(cell: &Cell, value: Option<f64>) -> String {
    three_or_dash(value.map(|v| {
        if cell.quantity.is_angle() {
            v.to_degrees()
        } else {
            v * 1e3
        }
    }))
}

/// Which scenes, which lines, and what stands in the cells of a table.
pub(super) struct Table<'a> {
    pub(super) title: &'a str,
    pub(super) note: &'a str,
    pub(super) picked: &'a dyn Fn(&Cell) -> bool,
    pub(super) shown: &'a dyn Fn(&Cell) -> String,
}

/// A column that belongs to the scene, whatever the method.
pub(super) type Beside = (&'static str, fn(&Cell) -> Option<f64>);

/// Lines are scenes, columns methods; a method that does not occur in a scene leaves a blank.
pub(super) fn table(out: &mut String, cells: &[Cell], t: &Table<'_>) {
    table_beside(out, cells, t, &[]);
}

/// The same with columns of the scene itself after the methods'.
pub(super) fn table_beside(out: &mut String, cells: &[Cell], t: &Table<'_>, beside: &[Beside]) {
    let picked: Vec<&Cell> = cells.iter().filter(|c| (t.picked)(c)).collect();
    let (mut scenes, mut methods): (Vec<&Scene>, Vec<&str>) = (Vec::new(), Vec::new());
    for cell in &picked {
        if !scenes.contains(&&cell.scene) {
            scenes.push(&cell.scene);
        }
        if !methods.contains(&cell.method.as_str()) {
            methods.push(&cell.method);
        }
    }
    if scenes.is_empty() {
        return;
    }
    let _ = writeln!(out, "## {}\n", t.title);
    if !t.note.is_empty() {
        let _ = writeln!(out, "{}\n", t.note);
    }
    let _ = writeln!(
        out,
        "| motion | n | r mm | σ mm | σ ° | {} |",
        methods
            .iter()
            .copied()
            .chain(beside.iter().map(|(name, _)| *name))
            .collect::<Vec<_>>()
            .join(" | ")
    );
    let _ = writeln!(
        out,
        "|---|---|---|---|---|{}",
        "---|".repeat(methods.len() + beside.len())
    );
    for scene in scenes {
        line(out, scene, &picked, &methods, (t, beside));
    }
    out.push('\n');
}

/// One line of a table: a scene, the methods' values, and those of the scene itself.
fn line(
    out: &mut String,
    scene: &Scene,
    picked: &[&Cell],
    methods: &[&str],
    (t, beside): (&Table<'_>, &[Beside]),
) {
    let mut motion = scene.motion.clone();
    if !scene.condition.is_empty() {
        motion = format!("{motion}, {}", scene.condition);
    }
    let _ = write!(
        out,
        "| {motion} | {} | {} | {} | {} |",
        scene.samples,
        shortest(scene.radius_m * 1e3),
        shortest(scene.sigma_t_m * 1e3),
        shortest(scene.sigma_r_rad.to_degrees()),
    );
    for method in methods {
        let found = picked
            .iter()
            .find(|c| c.scene == *scene && c.method == *method);
        let _ = write!(
            out,
            " {} |",
            found.map_or_else(String::new, |c| (t.shown)(c))
        );
    }
    for (_, value) in beside {
        let found = picked.iter().find(|c| c.scene == *scene);
        let value = found.and_then(|c| value(c));
        let _ = write!(
            out,
            " {} |",
            value.map_or_else(|| "—".to_owned(), |v| format!("{v:.3}"))
        );
    }
    out.push('\n');
}

/// Error against its bound.
pub(super) fn against_bound(cell: &Cell) -> String {
    format!("{} / {}", shown(cell, cell.rms), shown(cell, cell.bound))
}

pub(super) fn efficiency(cell: &Cell) -> String {
    let mut text = with_error(cell.efficiency, cell.efficiency_mc);
    if cell.answered < cell.trials {
        let none = cell.trials - cell.answered;
        let _ = write!(text, " ({none} of {} without answer)", cell.trials);
    }
    text
}

/// Counts with the upper end of their interval.
pub(super) fn rates(
    out: &mut String,
    cells: &[Cell],
    title: &str,
    picked: &dyn Fn(&Cell) -> bool,
    count: &dyn Fn(&Cell) -> u64,
) {
    table(
        out,
        cells,
        &Table {
            title,
            note: "Count of trials, and the upper end of the rate's one-sided 95 % interval. Methods and scenes without any are left out where others have some.",
            picked,
            shown: &|c| {
                let (_, high) = probability(count(c), c.trials);
                format!("{} of {} (< {})", count(c), c.trials, three(high))
            },
        },
    );
}
