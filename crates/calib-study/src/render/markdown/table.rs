//! Tables of one line for each scene.

use std::fmt::Write;

use super::page::Page;
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

/// A table of more scenes than this is not on the page.
const LONG: usize = 24;

/// Lines are scenes, columns methods; a method that does not occur in a scene leaves a blank.
pub(super) fn table(out: &mut Page, cells: &[Cell], t: &Table<'_>) {
    table_beside(out, cells, t, &[]);
}

/// The same with columns of the scene itself after the methods'.
pub(super) fn table_beside(out: &mut Page, cells: &[Cell], t: &Table<'_>, beside: &[Beside]) {
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
    if scenes.len() > LONG {
        long(out, (&scenes, &methods), &picked, (t, beside));
        return;
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

/// A long table: its size on the page, its lines beside it.
fn long(
    out: &mut Page,
    (scenes, methods): (&[&Scene], &[&str]),
    picked: &[&Cell],
    (t, beside): (&Table<'_>, &[Beside]),
) {
    for scene in scenes {
        let here: Vec<_> = picked.iter().filter(|c| c.scene == **scene).collect();
        for method in methods {
            if let Some(cell) = here.iter().find(|c| c.method == *method) {
                out.line(t.title, scene, method, (t.shown)(cell));
            }
        }
        for (name, value) in beside {
            if let Some(value) = here.first().and_then(|c| value(c)) {
                out.line(t.title, scene, name, format!("{value:.3}"));
            }
        }
    }
    let file = out.beside().to_owned();
    let methods: Vec<String> = methods.iter().map(|m| format!("`{m}`")).collect();
    let _ = writeln!(
        out,
        "{} scenes, with {}: [{file}]({file}).\n",
        scenes.len(),
        methods.join(", ")
    );
}

/// One line of a table: a scene, the methods' values, and those of the scene itself.
fn line(
    out: &mut Page,
    scene: &Scene,
    picked: &[&Cell],
    methods: &[&str],
    (t, beside): (&Table<'_>, &[Beside]),
) {
    let _ = write!(
        out,
        "| {} | {} | {} | {} | {} |",
        scene.words(),
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
    out: &mut Page,
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
