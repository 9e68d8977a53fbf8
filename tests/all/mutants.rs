//! Emitted C with one token damaged, a thousand times over: the bundle's own vectors, checksums and self-test
//! have to notice. What the compiler makes the same instructions of is no damage.
//!
//! `cargo test --release --test all -- --ignored --nocapture mutants::` takes ten bundles and lists what survives;
//! `GYROGEN_MUTANTS` says how many of each bundle (150), `GYROGEN_MUTANTS_OF` takes those with this in their name.
//! With esbmc, a model checker of C, on the PATH (or named by `GYROGEN_ESBMC`), those are told that are proved equal.
//! Harness and model checker have so many seconds of processor time, so that a busy machine does not decide.

use crate::common::command::{good, run};
use crate::mutation::{Answer, Bundle, Fate, Mutant, mutants};
use crate::oracle::harness::{binary, setting};
use crate::oracle::toml_text::Printer;
use crate::oracle::{edges, golden};
use crate::rng::Rng;
use std::path::Path;

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

/// Emits a bundle by these arguments and makes it ready.
fn bundle(folder: &Path, name: &str, design: Option<&str>, arguments: &[&str]) -> Bundle {
    let at = folder.join(name);
    std::fs::create_dir_all(at.join("build")).expect("a folder");
    if let Some(design) = design {
        std::fs::write(at.join("design.toml"), design).expect("written");
    }
    good(&run(&binary(), arguments, &at));
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
            .flat_map(|(name, text)| mutants(&name, &text))
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

fn default_bundle(folder: &Path) -> Bundle {
    let arguments = ["emit", "--lang", "c", "--out", "c"];
    bundle(folder, "default", None, &arguments)
}

/// A damaged line of the bundle's main source: the first with `line` in it after `function`.
fn damaged(bundle: &Bundle, function: &str, line: &str, after: &str) -> Mutant {
    let file = format!("{}.c", bundle.prefix);
    let text = std::fs::read_to_string(bundle.folder.join(&file)).expect("a source");
    let lines: Vec<&str> = text.lines().collect();
    let head = lines
        .iter()
        .position(|l| l.contains(function))
        .expect("the function");
    let inside = lines
        .iter()
        .skip(head)
        .position(|l| l.contains(line))
        .expect("the line");
    Mutant {
        file,
        line: head + inside,
        before: lines[head + inside].to_owned(),
        after: after.to_owned(),
    }
}

fn check(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// Each output of each function, made nothing, is noticed by the function's vectors and by the start-up self-test.
#[test]
fn every_output_is_compared_by_vectors_and_by_the_self_test() {
    let folder = tempfile::tempdir().expect("a folder");
    let bundle = default_bundle(folder.path());
    let functions = bundle.checks().iter().filter(|check| check.len() == 2);
    let functions: Vec<&str> = functions.map(|check| check[1].as_str()).collect();
    let text = std::fs::read_to_string(bundle.folder.join("gyro.c")).expect("a source");
    let (mut function, mut outputs) = (String::new(), 0);
    for (line, before) in text.lines().enumerate() {
        if let Some((head, _)) = before.split_once('(').filter(|_| !before.starts_with(' ')) {
            function = head
                .rsplit([' ', '*'])
                .next()
                .unwrap_or("")
                .replace("gyro_", "");
        }
        let code = before.trim();
        let after = match code.split_once(" = ") {
            Some((target, _)) if target.starts_with("out.") => format!("{target} = 0;"),
            _ if code.starts_with("return ") && code != "return out;" => "return 0;".to_owned(),
            _ => continue,
        };
        if !functions.contains(&function.as_str()) {
            continue;
        }
        let (file, before) = ("gyro.c".to_owned(), before.to_owned());
        let mutant = Mutant {
            file,
            line,
            before,
            after,
        };
        for checks in [check(&["check", &function]), check(&["selftest"])] {
            let noticed = bundle.noticed_by(&mutant, line, std::slice::from_ref(&checks));
            assert_eq!(noticed.len(), 1, "{function}: {mutant:?} passes {checks:?}");
        }
        outputs += 1;
    }
    assert!(outputs >= 16, "{outputs} outputs were found");
}

/// The NCO's vectors alone notice each entry of its table that is off by one.
#[test]
fn the_table_of_the_nco_is_swept_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let bundle = default_bundle(folder.path());
    let read = "const int32_t sine = ";
    for (k, address) in (0..4096).step_by(91).chain([4095]).enumerate() {
        let after = format!(
            "    const int32_t sine = (int32_t)gyro_sine_0[address] + (address == {address}U);"
        );
        let mutant = damaged(&bundle, "gyro_nco(", read, &after);
        let noticed = bundle.noticed_by(&mutant, k, &[check(&["check", "nco"])]);
        assert_eq!(noticed.len(), 1, "entry {address}");
    }
}

/// What happens late, and what is left at the very end, only the long run can see; and one input of 2^24 of the bias
/// only the run of all inputs.
#[test]
fn the_long_run_and_the_run_of_all_inputs_see_what_vectors_do_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let bundle = default_bundle(folder.path());
    let names = [
        ["check", "chain"],
        ["check", "bias"],
        ["check", "long"],
        ["check", "every"],
    ];
    let checks = names.map(|words| check(&words));
    let call = "    const gyro_nco_out_t c0 = gyro_nco(&s->nco);";
    let late = |sample: u32, change: &str| {
        let count = "static uint32_t n = 0U;\n    n = n + 1U;";
        let after = format!("    {count}\n    if (n == {sample}U) {{ {change} }}\n{call}");
        damaged(&bundle, "gyro_sample(", call, &after)
    };
    let one = damaged(
        &bundle,
        "gyro_bias(",
        "    return bias;",
        "    return bias + (thermometer == -1234567);",
    );
    // The last sample's phase is in no row, but in the state that is left.
    let cases = [
        (
            late(500_000, "s->cic_drive_i.integrator[0] += 40000U;"),
            &checks[2],
        ),
        (late(1_000_000, "s->nco.phase += 1U;"), &checks[2]),
        (one, &checks[3]),
    ];
    for (k, (mutant, due)) in cases.iter().enumerate() {
        let noticed = bundle.noticed_by(mutant, k, &checks);
        assert_eq!(noticed, [(*due).clone()], "{mutant:?}");
    }
}

#[test]
fn damage_to_the_default_firmware_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let default = default_bundle(folder.path());
    let (killed, alive) = told("default", &default, 40);
    assert!(
        alive * 50 <= killed,
        "{alive} of {} mutants live",
        killed + alive
    );
}

/// Ten bundles, by name: a folder for each, its design, the arguments that emit it.
fn ten_bundles() -> Vec<(String, Option<String>, Vec<&'static str>)> {
    let emit = vec!["emit", "design.toml", "--lang", "c", "--out", "c"];
    let golden = Printer::plain().print(&golden::design());
    let approx = |arguments: &[&'static str]| {
        let words = [
            "--input", "Q1.15", "--output", "Q1.15", "--name", "f", "--out", ".",
        ];
        [&["approx"], arguments, &words].concat()
    };
    let arctangent = [
        "--function",
        "atan(x)/(2*pi)",
        "--domain=0,1",
        "--degree",
        "5",
    ];
    let arctangent = approx(&[&arctangent[..], &["--coefficients", "Q1.15"]].concat());
    let sine = [
        "--function",
        "sin(pi*x/2)",
        "--domain=-1,1",
        "--bound",
        "1e-4",
        "--form",
        "auto",
    ];
    let mut bundles = vec![
        (
            "default".to_owned(),
            None,
            vec!["emit", "--lang", "c", "--out", "c"],
        ),
        ("golden".to_owned(), Some(golden), emit.clone()),
        (
            "correction".to_owned(),
            Some(CORRECTION.to_owned()),
            emit.clone(),
        ),
        ("atan".to_owned(), None, arctangent),
        ("sine".to_owned(), None, approx(&sine)),
    ];
    let mut seed = setting("GYROGEN_SEED", 20_261_127);
    while bundles.len() < 10 {
        let text = Printer::plain().print(&edges::design(&mut Rng::new(seed)));
        bundles.push((format!("random {seed}"), Some(text), emit.clone()));
        seed += 1;
    }
    let wanted = std::env::var("GYROGEN_MUTANTS_OF").unwrap_or_default();
    bundles.retain(|(name, ..)| name.contains(&wanted));
    bundles
}

#[test]
#[ignore = "1500 mutants in ten bundles, each compiled and run: an hour of processor time"]
fn damage_to_ten_firmwares_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let most = setting("GYROGEN_MUTANTS", 150) as usize;
    let (mut killed, mut alive) = (0, 0);
    for (name, design, arguments) in ten_bundles() {
        let at = name.replace(' ', "_");
        let bundle = bundle(folder.path(), &at, design.as_deref(), &arguments);
        let (k, a) = told(&name, &bundle, most);
        (killed, alive) = (killed + k, alive + a);
    }
    let share = 100.0 * killed as f64 / (killed + alive) as f64;
    println!("all: {killed} killed, {alive} alive: {share:.2} % of what is no equal code");
    assert!(share >= 98.0, "{share:.2} %");
}

/// The control of the proofs: what the vectors tell from the function is never proved to be the same.
#[test]
#[ignore = "asks a model checker fifty times; needs one"]
fn nothing_that_vectors_notice_is_proved_equal() {
    let folder = tempfile::tempdir().expect("a folder");
    let bundles = ten_bundles();
    let each = setting("GYROGEN_CONTROLS", 50) as usize / bundles.len();
    let mut asked = 0;
    for (name, design, arguments) in bundles {
        let at = name.replace(' ', "_");
        let bundle = bundle(folder.path(), &at, design.as_deref(), &arguments);
        assert!(bundle.has_prover(), "a model checker: GYROGEN_ESBMC");
        let mutants = chosen(&bundle, 3 * each);
        let noticed = mutants
            .iter()
            .enumerate()
            .filter(|(k, m)| bundle.is_noticed(m, *k));
        for (k, mutant) in noticed.take(each) {
            let answer = bundle.asked(mutant, k);
            let (before, after) = (mutant.before.trim(), mutant.after.trim());
            assert_ne!(answer, Answer::Equal, "{name}: {before} -> {after}");
            asked += 1;
        }
    }
    println!("{asked} mutants that vectors notice: none is proved equal");
    assert!(asked > 0);
}
