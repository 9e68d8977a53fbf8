//! `gyrogen completions` and `gyrogen man`: what a shell and `man` know of the command line, from the same description
//! that parses it.

use super::terminal;
use crate::error::Result;
use crate::output::sealed;
use clap::Command;
use std::path::PathBuf;

/// Print a script that completes commands, options and values in a shell.
#[derive(Debug, clap::Args)]
pub struct Completions {
    /// Of which shell.
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

/// Print the manual page, or write one for each command into a folder.
#[derive(Debug, clap::Args)]
pub struct Man {
    /// Folder for the pages (`gyrogen.1`, `gyrogen-run.1`, ...); the page of `gyrogen` is printed if left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: super::common::Force,
}

/// Prints the script.
///
/// # Errors
/// None: what cannot be printed is told at the end.
pub fn completions(arguments: &Completions, mut parser: Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut parser, "gyrogen", &mut script);
    terminal::give(&String::from_utf8_lossy(&script));
    Ok(())
}

/// Prints the page, or writes the pages.
///
/// # Errors
/// A folder that cannot be written.
pub fn man(arguments: &Man, mut parser: Command) -> Result<()> {
    parser.build();
    let Some(folder) = &arguments.out else {
        terminal::give(&String::from_utf8_lossy(&page(&parser)));
        return Ok(());
    };
    let commands = parser.get_subcommands().filter(|c| c.get_name() != "help");
    let of_commands = commands.map(|command| {
        let name = format!("gyrogen-{}.1", command.get_name());
        (name, page(command))
    });
    let mut pages = vec![("gyrogen.1".to_owned(), page(&parser))];
    pages.extend(of_commands);
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    let mut results = super::common::claim(folder, &names, &[], arguments.force)?;
    for (name, text) in &pages {
        results.write(name, sealed(&String::from_utf8_lossy(text)).as_bytes())?;
    }
    results.finish()?;
    say!("wrote {} pages to {}", pages.len(), folder.display());
    Ok(())
}

/// A page in troff; its writer writes to memory, which does not fail.
fn page(command: &Command) -> Vec<u8> {
    let mut text = Vec::new();
    let named = command.get_display_name().unwrap_or(command.get_name());
    let manual = clap_mangen::Man::new(command.clone()).title(named);
    _ = manual.render(&mut text);
    text
}
