//! `gyrogen close`: what a measurement says beyond its declared model.

use super::OutputFormat;
use crate::closure::close::{self, Closed};
use crate::closure::search::Effort;
use crate::closure::verdict::{Closure, Verdict};
use crate::error::Result;
use std::io::IsTerminal;
use std::path::PathBuf;

/// From measured data to a named cause, or an honest refusal, and new firmware.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A measured thermal record.
    #[arg(long, required = true)]
    record: Option<PathBuf>,
    /// Design file; the embedded default if left out.
    #[arg(long)]
    design: Option<PathBuf>,
    /// Folder for the results; made if it does not exist.
    #[arg(long, default_value = "gyrogen-close")]
    out: PathBuf,
    /// How the result is printed.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// Runs the command.
///
/// # Errors
/// An unusable design or record (exit 2).
pub fn run(arguments: &Arguments) -> Result<()> {
    let design = super::design(arguments.design.as_deref())?;
    let Some(path) = &arguments.record else {
        return Ok(());
    };
    let mut command = format!("gyrogen close --record {}", path.display());
    if let Some(design) = &arguments.design {
        command += &format!(" --design {}", design.display());
    }
    if std::io::stderr().is_terminal() {
        eprintln!("reading {} ...", path.display());
    }
    let (record, warnings) = crate::record::read_any(path, &design.record)?;
    let closed = close::close(&record, warnings, &design, &command, Effort::default())?;
    let json = super::json(&closed.closure);
    super::make_folder(&arguments.out)?;
    crate::output::write_whole(&arguments.out.join("closure.json"), json.as_bytes())?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    let page = crate::report::closure::html(&closed, &name.to_string_lossy())?;
    crate::output::write_whole(&arguments.out.join("report.html"), page.as_bytes())?;
    match arguments.format {
        OutputFormat::Json => say!("{}", json.trim_end()),
        OutputFormat::Text => print(&closed, &arguments.out),
    }
    for warning in &closed.closure.warnings {
        eprintln!("warning: {} [{}]", warning.message, warning.code);
    }
    Ok(())
}

fn print(closed: &Closed, out: &std::path::Path) {
    let c = &closed.closure;
    if !c.steps.is_empty() {
        let mut table = super::table(&["step", "parameters", "held-out rms", "p", "like it"]);
        for s in &c.steps {
            let parameters: Vec<String> = s
                .parameters
                .iter()
                .map(|(name, v)| {
                    let std = s.parameter_std.get(name).copied().unwrap_or(0.0);
                    if std > 0.0 {
                        format!("{name} = {v:.4} +- {std:.2}")
                    } else {
                        format!("{name} = {v:.4}")
                    }
                })
                .collect();
            table.add_row([
                s.effect.clone(),
                parameters.join("\n"),
                format!("{:.5}", s.heldout_rms),
                format!("{:.1e}", s.p_value),
                s.indistinguishable_from.join("\n"),
            ]);
        }
        say!("{table}");
    }
    say!("{}", sentence(c));
    say!(
        "held-out rms {:.5} -> {:.5} {}, noise floor {:.5}",
        c.before.heldout_rms,
        c.after.heldout_rms,
        c.unit,
        c.noise_floor_rms
    );
    say!("wrote {} ({:.1} s)", out.display(), c.seconds);
}

/// The verdict in a sentence.
fn sentence(c: &Closure) -> String {
    let names: Vec<&str> = c.steps.iter().map(|s| s.effect.as_str()).collect();
    let channel = c.residual_structure.strongest_channel.as_deref();
    let channel = channel.map_or(String::new(), |c| format!(", most of it in {c}"));
    match c.verdict {
        Verdict::Complete => "complete: nothing beyond noise is left".to_owned(),
        Verdict::Explained => format!("explained by {}", names.join(", ")),
        Verdict::PartlyExplained => {
            format!(
                "partly explained by {}; structure is left{channel}",
                names.join(", ")
            )
        }
        Verdict::Unexplained => {
            format!("unexplained: structure is left that no candidate earns{channel}")
        }
    }
}
