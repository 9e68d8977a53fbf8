//! `gyrogen verify`: rebuilds a bundle from its own files alone and runs its vectors.

use super::OutputFormat;
use super::recorded::Recorded;
use crate::error::{Error, Result};
use crate::output::Results;
use crate::timing::{self, Stopwatch};
use crate::verify::bundle::{self, Verification};
use crate::verify::target::Target;
use std::path::PathBuf;

/// Build a firmware bundle anew from its own files alone, run its self-test and its test vectors.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the bundle, as `emit` and `run` write them (`out/firmware/c`).
    bundle: PathBuf,
    /// The processor that the code is built for and runs on.
    #[arg(long, value_enum, default_value = "host")]
    target: Target,
    /// Folder for verify.json; made if it does not exist. The bundle's folder if left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// Runs the command.
///
/// # Errors
/// A folder that holds no bundle, no compiler for the target (exit 2); a difference (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stopwatch::start("building and running");
    let folder = arguments.out.as_ref().unwrap_or(&arguments.bundle);
    let planned = ["verify.json", timing::NAME];
    let mut results = Results::claim(folder, &planned, &recorded.inputs)?;
    let verification = bundle::verify(&arguments.bundle, arguments.target, &recorded.command)?;
    watch.stage("writing");
    let json = super::json(&verification);
    results.write("verify.json", json.as_bytes())?;
    watch.write(&mut results, &verification.design_sha256, &recorded.command)?;
    results.finish()?;
    match arguments.format {
        OutputFormat::Json => say!("{}", json.trim_end()),
        OutputFormat::Text => print(&verification),
    }
    if verification.holds {
        return Ok(());
    }
    Err(Error::Check(reasons(&verification).join("; ")))
}

fn print(v: &Verification) {
    say!("{}", super::comparison_table(&v.functions));
    let selftest = match v.selftest {
        Some(true) => "pass",
        Some(false) => "FAIL",
        None => "none in a bundle of tables alone; its files were compared with the manifest",
    };
    say!("self-test: {selftest}");
    say!("toolchain: {}", v.toolchain);
}

fn reasons(v: &Verification) -> Vec<String> {
    let mut reasons = Vec::new();
    for f in v.functions.iter().filter(|f| f.mismatches > 0) {
        let first = f.first.as_deref().unwrap_or("");
        reasons.push(format!(
            "{} ({}): first difference at {first}",
            f.name, f.language
        ));
    }
    if v.selftest == Some(false) {
        reasons.push("the self-test fails".into());
    }
    if !v.changed_files.is_empty() {
        let files = v.changed_files.join(", ");
        reasons.push(format!("files differ from the manifest: {files}"));
    }
    reasons
}
