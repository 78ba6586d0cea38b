//! Runs a study: `cargo run --release -p calib-study --example run -- cor 1500 results/study`.
//!
//! What `calib study` does, without the rest of the program: trials and folder as arguments, progress on standard error.

use std::{
    path::PathBuf,
    sync::atomic::{AtomicU64, Ordering},
};

use calib_study::{Study, StudyOptions, run, write};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let study = match words.next().as_deref() {
        Some("cor") => Study::Cor,
        Some("aor") => Study::Aor,
        other => return Err(format!("expected cor or aor, got {other:?}").into()),
    };
    let trials = words
        .next()
        .map_or(Ok(StudyOptions::default().trials), |w| w.parse())?;
    let out = words.next().map(PathBuf::from);
    let options = StudyOptions {
        trials,
        out: out.clone(),
        resume: true,
        ..StudyOptions::default()
    };
    let shown = AtomicU64::new(0);
    let progress = |done: u64, total: u64| {
        let percent = 100 * done / total.max(1);
        if shown.fetch_max(percent, Ordering::Relaxed) < percent {
            eprint!("\r{percent} %");
        }
    };
    let result = run(study, &options, &progress)?;
    eprintln!("\r{} estimates", result.fits);
    if let Some(folder) = out {
        for path in write(&result, &folder)? {
            println!("{}", path.display());
        }
    }
    Ok(())
}
