//! `calib`: finds where a robot's joints are relative to the bodies that an optical tracker sees.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Finds where a robot's joints are relative to the bodies that an optical tracker sees, and makes its kinematic
/// model true.
#[derive(Debug, Parser)]
#[command(name = "calib", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make recordings with known truth for a profile
    Simulate {
        /// The robot's profile
        profile: PathBuf,
        /// Seed of the random numbers; the profile's when not given
        #[arg(long)]
        seed: Option<u64>,
        /// Folder to write to
        #[arg(long)]
        out: PathBuf,
    },
    /// Print the JSON Schema of the profile
    Schema,
}

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code() as u8)
        }
    }
}

fn run(arguments: Arguments) -> Result<ExitCode, calib_pipeline::PipelineError> {
    match arguments.command {
        Command::Simulate { profile, seed, out } => {
            let robot = calib_pipeline::load::load_robot(&profile)?;
            let files = calib_pipeline::simulate::simulate(&robot, seed)?;
            for path in calib_pipeline::write::write_all(&out, &files)? {
                println!("{}", path.display());
            }
        }
        Command::Schema => print!("{}", calib_profile::json_schema()),
    }
    Ok(ExitCode::SUCCESS)
}
