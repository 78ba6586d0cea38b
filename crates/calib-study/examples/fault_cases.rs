//! Runs single cases of the study of faults again: `cargo run --release --example fault_cases -- SEED [REPORTS] < cases.jsonl`.
//! Lines as in the state file of the study (`cell`, `number`); each gives one line of what becomes of it now. With a folder
//! REPORTS, the report of each case is written there, or what stopped it.

use std::io::BufRead;

use calib_study::faults::{Cell, report_of};

#[derive(serde::Deserialize)]
struct Case {
    cell: Cell,
    number: u64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let seed = words.next().map_or(Ok(1), |n| n.parse())?;
    let reports = words.next();
    for (i, line) in std::io::stdin().lock().lines().enumerate() {
        let case: Case = serde_json::from_str(&line?)?;
        let (result, report) = report_of(case.cell, case.number, seed);
        println!("{}", serde_json::to_string(&result)?);
        if let Some(folder) = &reports {
            let text = match report {
                Ok(report) => calib_report::json::report_json(&report)?,
                Err(stopped) => stopped,
            };
            std::fs::write(format!("{folder}/{i}.json"), text)?;
        }
    }
    Ok(())
}
