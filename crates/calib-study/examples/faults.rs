//! A part of the matrix of faults: `cargo run --release --example faults -- CASES SEED FAULT…`, faults as the JSON has them.

use calib_study::faults::{FaultOptions, csv, markdown, run_faults};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let cases = words.next().map_or(Ok(1), |n| n.parse())?;
    let seed = words.next().map_or(Ok(1), |n| n.parse())?;
    let only = words
        .map(|word| serde_json::from_value(word.into()))
        .collect::<Result<_, _>>()?;
    let options = FaultOptions {
        cases,
        seed,
        only,
        ..FaultOptions::default()
    };
    let result = run_faults(&options, &|_, _| {})?;
    println!("{}\n{}", csv(&result), markdown(&result));
    Ok(())
}
