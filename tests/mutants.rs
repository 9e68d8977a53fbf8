//! Emitted C with one token damaged, a thousand times over: the bundle's own vectors, checksums and self-test
//! have to notice. What the compiler makes the same instructions of is no damage.
//!
//! `cargo test --release --test mutants -- --ignored --nocapture` takes ten bundles and lists what survives;
//! `GYROGEN_MUTANTS` says how many of each bundle (150), `GYROGEN_MUTANTS_OF` takes those with this in their name.
//! With esbmc, a model checker of C, on the PATH (or named by `GYROGEN_ESBMC`), those are told that are proved equal.

mod mutation;
mod oracle;

use mutation::{Bundle, Fate, Mutant};
use oracle::harness::{binary, setting};
use oracle::rng::Rng;
use oracle::toml_text::Printer;
use oracle::{edges, golden};
use std::path::Path;
use std::process::Command;

const CORRECTION: &str = r#"
name = "corrected"
[correction]
period_s = 10.0
full_scale_dps = 500.0
noise_dps = 2e-3
inputs = [
    { column = "phase_rad", offset = -1.8, scale = 0.4 },
    { column = "supply_v", offset = 3.3, scale = 0.2 },
]
terms = [
    { kind = "product", gain_dps = 109.6, factors = [] },
    { kind = "product", gain_dps = 97.2, factors = [[0, 1]] },
    { kind = "lag", gain_dps = 4.0, input = 0, tau_s = 600.0 },
    { kind = "decay", gain_dps = 0.5, tau_s = 900.0 },
    { kind = "step", gain_dps = 0.3, input = 0, centre = 0.2, gap = 0.1, once = "no" },
    { kind = "product", gain_dps = 0.1, factors = [[1, 1]] },
]
"#;

fn gyrogen(arguments: &[&str], folder: &Path) {
    let output = Command::new(binary())
        .args(arguments)
        .current_dir(folder)
        .output();
    let output = output.expect("the binary under test starts");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Emits a bundle by these arguments and makes it ready.
fn bundle(folder: &Path, name: &str, design: Option<&str>, arguments: &[&str]) -> Bundle {
    let at = folder.join(name);
    std::fs::create_dir_all(at.join("build")).expect("a folder");
    if let Some(design) = design {
        std::fs::write(at.join("design.toml"), design).expect("written");
    }
    gyrogen(arguments, &at);
    let bundle = Bundle::new(at.join("c"), at.join("build"));
    let whole = bundle.whole();
    for check in bundle.checks() {
        assert!(
            bundle.passes(&whole, check),
            "{name}: {check:?} of the undamaged bundle"
        );
    }
    bundle
}

/// At most `most` mutants, spread evenly; of the tables' entries no more than a tenth.
fn chosen(bundle: &Bundle, most: usize) -> Vec<Mutant> {
    let spread = |all: Vec<Mutant>, most: usize| -> Vec<Mutant> {
        let count = all.len();
        let taken = |k: &usize| k * most / count.max(1) != (k + 1) * most / count.max(1);
        let numbered = all
            .into_iter()
            .enumerate()
            .filter(|(k, _)| most >= count || taken(k));
        numbered.map(|(_, mutant)| mutant).collect()
    };
    let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<Mutant> {
        let sources = bundle
            .sources()
            .into_iter()
            .filter(|(name, _)| wanted(name));
        sources
            .flat_map(|(name, text)| mutation::mutants(&name, &text))
            .collect()
    };
    let main = format!("{}.c", bundle.prefix);
    let mut all = spread(of(&|name| name == main), most * 8 / 10);
    all.extend(spread(of(&|name| name.ends_with("_tables.c")), most / 10));
    all.extend(spread(of(&|name| name.ends_with(".h")), most / 10));
    all
}

/// Killed, the same, alive.
fn fates(bundle: &Bundle, mutants: &[Mutant]) -> Vec<Fate> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let share = mutants.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let parts = mutants.chunks(share).enumerate().map(|(part, mutants)| {
            scope.spawn(move || {
                let numbered = mutants.iter().enumerate();
                numbered
                    .map(|(k, m)| bundle.fate(m, part * share + k))
                    .collect::<Vec<Fate>>()
            })
        });
        let parts: Vec<_> = parts.collect();
        parts
            .into_iter()
            .flat_map(|p| p.join().expect("no panic"))
            .collect()
    })
}

/// Tells the outcome; gives how many were killed and how many live.
fn told(name: &str, bundle: &Bundle, most: usize) -> (usize, usize) {
    let mutants = chosen(bundle, most);
    let fates = fates(bundle, &mutants);
    let count = |is: &dyn Fn(&Fate) -> bool| fates.iter().filter(|f| is(f)).count();
    let killed = count(&|f| *f == Fate::Killed);
    let alive = count(&|f| matches!(f, Fate::Alive(_)));
    println!(
        "{name}: {} mutants, {killed} killed, {} in exhausted functions, {} the same instructions, {} proved equal, \
         {alive} alive",
        mutants.len(),
        count(&|f| *f == Fate::Exhausted),
        count(&|f| *f == Fate::SameInstructions),
        count(&|f| *f == Fate::Proved),
    );
    for (mutant, fate) in mutants.iter().zip(&fates) {
        let Fate::Alive(answer) = fate else { continue };
        let (before, after) = (mutant.before.trim(), mutant.after.trim());
        println!(
            "  {}:{}: {before}\n    -> {after}\n    {answer:?}",
            mutant.file,
            mutant.line + 1
        );
    }
    (killed, alive)
}

#[test]
fn damage_to_the_default_firmware_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let default = bundle(
        folder.path(),
        "default",
        None,
        &["emit", "--lang", "c", "--out", "c"],
    );
    let (killed, alive) = told("default", &default, 40);
    assert!(
        alive * 50 <= killed,
        "{alive} of {} mutants live",
        killed + alive
    );
}

#[test]
#[ignore = "1500 mutants in ten bundles, each compiled and run: a quarter of an hour"]
fn damage_to_ten_firmwares_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let most = setting("GYROGEN_MUTANTS", 150) as usize;
    let emit = ["emit", "design.toml", "--lang", "c", "--out", "c"];
    let mut bundles = vec![
        (
            "default".to_owned(),
            bundle(at, "default", None, &["emit", "--lang", "c", "--out", "c"]),
        ),
        (
            "golden".to_owned(),
            bundle(
                at,
                "golden",
                Some(&Printer::plain().print(&golden::design())),
                &emit,
            ),
        ),
        (
            "correction".to_owned(),
            bundle(at, "correction", Some(CORRECTION), &emit),
        ),
    ];
    let approx = [
        "--input", "Q1.15", "--output", "Q1.15", "--name", "f", "--out", ".",
    ];
    for (name, function) in [
        (
            "atan",
            &[
                "--function",
                "atan(x)/(2*pi)",
                "--domain=0,1",
                "--degree",
                "5",
                "--coefficients",
                "Q1.15",
            ][..],
        ),
        (
            "sine",
            &[
                "--function",
                "sin(pi*x/2)",
                "--domain=-1,1",
                "--bound",
                "1e-4",
                "--form",
                "auto",
            ],
        ),
    ] {
        let arguments = [&["approx"], function, &approx].concat();
        bundles.push((name.to_owned(), bundle(at, name, None, &arguments)));
    }
    let mut seed = setting("GYROGEN_SEED", 20_261_127);
    while bundles.len() < 10 {
        let text = Printer::plain().print(&edges::design(&mut Rng::new(seed)));
        let name = format!("random {seed}");
        bundles.push((
            name.clone(),
            bundle(at, &name.replace(' ', "_"), Some(&text), &emit),
        ));
        seed += 1;
    }
    let wanted = std::env::var("GYROGEN_MUTANTS_OF").unwrap_or_default();
    let outcomes = bundles
        .iter()
        .filter(|(name, _)| name.contains(&wanted))
        .map(|(name, bundle)| told(name, bundle, most));
    let (killed, alive) = outcomes.fold((0, 0), |(k, a), (killed, alive)| (k + killed, a + alive));
    let share = 100.0 * killed as f64 / (killed + alive) as f64;
    println!("all: {killed} killed, {alive} alive: {share:.2} % of what is no equal code");
    assert!(share >= 98.0, "{share:.2} %");
}
