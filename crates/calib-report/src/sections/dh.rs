//! The kinematic table and the controller offsets.

use super::{Page, code};
use crate::table::Table;
use crate::words::dh::{ENDS, offsets, table};
use crate::{DhTable, DhValue, Report, Unit, number};

pub(super) fn dh(page: &mut Page, report: &Report) {
    let Some(of) = &report.dh_table else {
        return;
    };
    page.section("kinematic-table", "Kinematic table and controller offsets");
    page.text(table(of));
    page.folded("Denavit–Hartenberg and Hayati parameters", values(of));
    page.text(ENDS);
    page.folded("Base and end of the chain", ends(of));
    page.text(offsets(of));
    page.folded("Controller offsets", controller(of));
}

/// `270.070 ± 0.040 mm`, marked where the data do not determine it.
fn shown(value: &DhValue, text: String) -> String {
    if value.measured {
        text
    } else {
        format!("{text} *")
    }
}

fn symbol(parameter: &str) -> &str {
    match parameter {
        "theta" => "θ",
        "alpha" => "α",
        "beta" => "β",
        other => other,
    }
}

fn values(of: &DhTable) -> Table {
    let mut table = Table::new(&[
        "<behind joint",
        "<parameter",
        ">nominal",
        ">calibrated ± σ",
        ">change",
    ]);
    for row in &of.rows {
        for value in &row.values {
            table.row([
                code(&row.joint),
                symbol(&value.parameter).to_owned(),
                number::rounded_by_sigma(value.nominal, value.sigma, value.unit),
                shown(
                    value,
                    number::with_sigma(value.value, value.sigma, value.unit),
                ),
                number::rounded_by_sigma(value.value - value.nominal, value.sigma, value.unit),
            ]);
        }
    }
    table
}

fn ends(of: &DhTable) -> Table {
    let mut table = Table::new(&["<transform", "<robot", ">x, y, z", ">roll, pitch, yaw"]);
    for (name, both) in [
        ("base to first joint", &of.root_from_first),
        ("last joint to end", &of.last_from_link),
    ] {
        for (robot, pose) in ["nominal", "calibrated"].iter().zip(both) {
            let part = |from: usize, unit| {
                let numbers = pose[from..from + 3].iter();
                let texts = numbers.map(|x| number::fixed_with_unit(*x, unit, 3));
                texts.collect::<Vec<_>>().join(", ")
            };
            let [name, robot] = [name, robot].map(str::to_owned);
            table.row([name, robot, part(0, Unit::Meter), part(3, Unit::Radian)]);
        }
    }
    table
}

fn controller(of: &DhTable) -> Table {
    let mut table = Table::new(&["<joint", ">offset ± σ"]);
    for row in &of.rows {
        let Some(theta) = row.value("theta") else {
            continue;
        };
        let offset = theta.value - theta.nominal;
        let text = number::change(offset, theta.sigma, theta.unit);
        table.row([code(&row.joint), shown(theta, text)]);
    }
    table.row([code(&of.last_joint), number::UNKNOWN.to_owned()]);
    table
}
