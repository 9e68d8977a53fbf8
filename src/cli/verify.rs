//! `gyrogen verify`: rebuilds a bundle from its own files alone and runs its vectors.

use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::emit::bundle::Part;
use crate::emit::views::Language;
use crate::error::{Error, InputError, Result};
use crate::firmware::files::EmittedFile;
use crate::firmware::manifest::{self, Manifest};
use crate::timing;
use crate::verify::bundle::{self, Against, Verification};
use crate::verify::compare::Compared;
use crate::verify::target::Target;
use std::path::{Path, PathBuf};

/// What is written.
const RESULT: &str = "verify.json";

/// Build a firmware bundle anew from its own files alone, run its self-test and its test vectors. This compiles and
/// runs the bundle's code: do not verify a bundle that you would not build.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the bundle, as `emit`, `run`, `close` and `approx` write them (`out/firmware/c`).
    bundle: PathBuf,
    /// The processor that the code is built for and runs on.
    #[arg(long, value_enum, default_value = "host")]
    target: Target,
    /// The digest that the bundle has to have: SHA-256 of its manifest, as `emit` printed it.
    #[arg(long, value_name = "HEX")]
    digest: Option<String>,
    /// A design file: the bundle has to be what it emits now.
    #[arg(long, value_name = "FILE")]
    design: Option<PathBuf>,
    /// Folder for verify.json; made if it does not exist. The bundle's folder if left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: super::common::Force,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// Runs the command.
///
/// # Errors
/// A folder that holds no bundle, no compiler for the target (exit 2); a difference (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("building and running");
    if let Some(digest) = &arguments.digest {
        let is_digest = digest.len() == 64 && digest.chars().all(|c| c.is_ascii_hexdigit());
        if !is_digest {
            let length = digest.chars().count();
            let what = match length {
                64 => "`--digest` takes hexadecimal digits alone, 0 to 9 and a to f".to_owned(),
                _ => format!(
                    "`--digest` takes 64 hexadecimal digits, and {length} characters were given"
                ),
            };
            return Err(InputError::new(what)
                .help("`gyrogen emit` prints the digest as its last line; it is the SHA-256 of the bundle's manifest.json")
                .into());
        }
    }
    refuse_no_bundle(&arguments.bundle)?;
    let against = Against {
        digest: arguments.digest.clone(),
        design: arguments.design.clone(),
    };
    let folder = arguments.out.as_ref().unwrap_or(&arguments.bundle);
    let planned = [RESULT, timing::NAME];
    for name in planned {
        refuse_link(&folder.join(name))?;
    }
    let mut results = super::common::claim(folder, &planned, &recorded.inputs, arguments.force)?;
    let verification = bundle::verify(
        &arguments.bundle,
        arguments.target,
        &against,
        &of_design,
        &recorded.command,
    )?;
    watch.stage("writing");
    let json = super::json(&verification);
    results.write(RESULT, json.as_bytes())?;
    watch.write(&mut results, &verification.design_sha256, &recorded.command)?;
    results.finish()?;
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => print(&verification, folder),
    }
    if verification.holds {
        return Ok(());
    }
    Err(Error::Check(failure(&verification)))
}

/// A result in a bundle's folder, which may be anybody's, replaces a plain file or nothing.
fn refuse_link(path: &Path) -> Result<()> {
    if path.symlink_metadata().is_ok_and(|found| !found.is_file()) {
        return Err(InputError::new(
            "the result is not written here: this is a link, or no regular file",
        )
        .in_file(path)
        .help("remove it, or name another folder: `--out DIR`")
        .into());
    }
    Ok(())
}

/// What a design emits now for a bundle's part and language, by the bundle's command.
fn of_design(path: &Path, manifest: &Manifest) -> Result<Vec<EmittedFile>> {
    let design = super::design(Some(path))?;
    if ["correction", "conversion"].contains(&manifest.part.as_str()) && design.correction.is_none()
    {
        let what = format!(
            "the bundle is a {}, and this design has no [correction]",
            manifest.part
        );
        return Err(InputError::new(what)
            .in_file(path)
            .help("give the design.toml that `gyrogen close` wrote beside the bundle's folder firmware")
            .into());
    }
    let part = match manifest.part.as_str() {
        "chain" => Part::Chain,
        // A whole chain's part where its thermometer is not the circuit's.
        "compensation" => Part::Compensation,
        "tables" => Part::Tables,
        "correction" => Part::Correction,
        "conversion" => Part::Conversion,
        "all" => Part::All,
        other => {
            return Err(
                InputError::new(format!("no design emits a bundle of the part `{other}`"))
                    .help("leave `--design` out, and hold the bundle against its digest")
                    .into(),
            );
        }
    };
    let language = match manifest.language.as_str() {
        "c" => Language::C,
        _ => Language::Rust,
    };
    super::emit::emitted(&design, part, language, &manifest.command)
}

/// Refuses what holds no manifest, and names the bundles that stand below it, or the one that a file is of.
fn refuse_no_bundle(folder: &Path) -> Result<()> {
    // A link or a pipe of that name is for the reader to refuse.
    if folder.join(manifest::NAME).symlink_metadata().is_ok() {
        return Ok(());
    }
    if matches!(folder.try_exists(), Ok(false)) {
        return Err(no_such_folder(folder).into());
    }
    let (what, bundles) = match folder.is_file() {
        true => (
            "this is a file, and `verify` takes the folder of a bundle".to_owned(),
            bundle_of(folder).into_iter().collect(),
        ),
        false => (
            format!("no bundle is here: there is no {}", manifest::NAME),
            bundles_below(folder),
        ),
    };
    let named: Vec<String> = bundles.iter().map(|b| b.display().to_string()).collect();
    let help = match named.is_empty() {
        true => {
            "give the folder of sources that `emit`, `run`, `close` or `approx` wrote".to_owned()
        }
        false => format!("did you mean the folder {}?", named.join(" or ")),
    };
    Err(InputError::new(what).in_file(folder).help(help).into())
}

/// The error for a folder that is not there.
fn no_such_folder(folder: &Path) -> InputError {
    let help = match crate::input::similar(folder).filter(|other| other.is_dir()) {
        Some(other) => format!("did you mean {}?", other.display()),
        None => "check the path: `verify` takes the folder of sources that `emit`, `run`, `close` or `approx` wrote"
            .to_owned(),
    };
    InputError::new("this folder does not exist")
        .in_file(folder)
        .help(help)
}

/// The bundles in the folders of results that lie below a folder.
fn bundles_below(folder: &Path) -> Vec<PathBuf> {
    let below = ["c", "rust", "firmware/c", "firmware/rust"].map(|name| folder.join(name));
    let is_bundle = |at: &PathBuf| at.join(manifest::NAME).is_file();
    below.into_iter().filter(is_bundle).collect()
}

/// The folder of the bundle that a file lies in: the nearest one above it with a manifest.
fn bundle_of(file: &Path) -> Option<PathBuf> {
    /// A bundle's files lie at most so deep in it, as `src/bin/harness.rs`.
    const DEPTH: usize = 3;
    let above = file.ancestors().skip(1).take(DEPTH);
    let named = above.map(|at| match at == Path::new("") {
        true => Path::new("."),
        false => at,
    });
    let mut bundles = named.filter(|at| at.join(manifest::NAME).is_file());
    bundles.next().map(Path::to_path_buf)
}

/// Says what was found, and where the result is that `folder` has.
fn print(v: &Verification, folder: &Path) {
    if !v.functions.is_empty() {
        super::terminal::show(&super::comparison_table(&v.functions));
    }
    let selftest = match (v.selftest, v.not_built) {
        (Some(true), _) => "pass".to_owned(),
        (Some(false), _) => "FAIL".to_owned(),
        (None, Some(why)) => format!("not run: {why}"),
        (None, None) => {
            "none in a bundle of tables alone; its files were compared with the manifest".to_owned()
        }
    };
    say!("self-test: {selftest}");
    // Where nothing was built, that was said.
    if v.not_built.is_none() {
        say!("toolchain: {}", v.toolchain);
    }
    say!("digest: {}", v.digest);
    say!("wrote {}", folder.join(RESULT).display());
    // Why it does not is the error's to say.
    say!(
        "verdict: {}",
        if v.holds { "holds" } else { "does not hold" }
    );
}

/// What was found wrong and what to do, a line each.
fn failure(v: &Verification) -> String {
    let help = remedy(v).map(|remedy| format!("help: {remedy}"));
    let said: Vec<String> = reasons(v).into_iter().chain(help).collect();
    said.join("\n  ")
}

/// What was found wrong, the likeliest cause of the others first.
fn reasons(v: &Verification) -> Vec<String> {
    let mut reasons = Vec::new();
    let (line_ends, edited): (Vec<&str>, Vec<&str>) = v
        .changed_files
        .iter()
        .map(String::as_str)
        .partition(|file| v.other_line_ends.iter().any(|other| other == file));
    if !edited.is_empty() {
        let files = edited.join(", ");
        reasons.push(format!("files differ from the manifest: {files}"));
    }
    if !line_ends.is_empty() {
        let files = line_ends.join(", ");
        reasons.push(format!(
            "files differ from the manifest in their line ends alone (CR LF for LF): {files}"
        ));
    }
    let differing = v.functions.iter().filter(|f| f.mismatches > 0);
    reasons.extend(differing.map(Compared::sentence));
    if v.selftest == Some(false) {
        reasons.push("the self-test fails".into());
    }
    reasons.extend(v.problems.iter().cloned());
    reasons
}

/// What to do about what was found; `None` where the code itself differs.
fn remedy(v: &Verification) -> Option<String> {
    if v.is_another {
        return Some(
            "the files are those of the manifest: give the digest or the design of this very bundle, or write it again from that \
             design"
                .to_owned(),
        );
    }
    if v.changed_files.is_empty() && v.problems.is_empty() {
        return None;
    }
    let foreign = match v.has_foreign {
        true => "move files of your own out of the folder; where the bundle's files changed, ",
        false => "",
    };
    let git = match v.other_line_ends.is_empty() {
        true => "",
        false => {
            "keep git from changing line ends: `* -text` in .gitattributes, and check the files out anew; or "
        }
    };
    Some(format!(
        "{foreign}{git}write the bundle again with the command that made it, `{}`, and its --out (`--force` replaces edited files)",
        v.made_by
    ))
}
