//! Records as files, with the truth beside them, for eyes and other tools.

use super::{BlindRecord, CLASSES, Class, Scenario, Truth, catalogue, make};
use serde_json::{Value, json};
use std::path::Path;

/// The truth as JSON; contributions rounded to nothing.
pub fn truth_json(t: &Truth) -> Value {
    let triple = |v: &[(String, String, f64)]| -> Vec<Value> {
        v.iter()
            .map(|(a, b, r)| json!({"planted": a, "other": b, "correlation": r}))
            .collect()
    };
    let planted: Vec<Value> = t
        .planted
        .iter()
        .zip(&t.ratios)
        .map(|(p, ratio)| {
            let parameters: serde_json::Map<String, Value> = p
                .parameters
                .iter()
                .map(|(k, v)| ((*k).to_owned(), json!(v)))
                .collect();
            json!({"id": p.id, "ratio": ratio, "surviving": p.surviving, "parameters": parameters})
        })
        .collect();
    json!({
        "class": format!("{:?}", t.class),
        "effects": t.effects,
        "planted": planted,
        "alternatives": triple(&t.alternatives),
        "closest": triple(&t.closest),
        "thermometer": t.thermometer,
        "channels": t.channels,
        "hidden": t.hidden,
        "outside_channel": t.outside_channel,
        "nearest": t.nearest,
        "decoys": t.decoys,
        "noise_rms_dps": t.noise_rms,
        "short_term_dps": t.short_term,
        "outliers": t.outlier.iter().filter(|o| **o).count(),
        "dictionary": t.dictionary,
        "attempts": t.attempts,
        "protocol": t.protocol,
        "contribution_dps": t.oracle,
    })
}

/// The bank: `n` of each class; singles go through the catalogue in turn.
pub fn bank(n: u64, first_seed: u64) -> Vec<(String, Scenario)> {
    let mut out = Vec::new();
    for class in CLASSES {
        for k in 0..n {
            let mut s = Scenario::drawn(class, first_seed + k);
            let mut name = format!("{class:?}_{k:03}");
            if matches!(class, Class::Single | Class::Faint) {
                let id = catalogue::CATALOGUE[k as usize % catalogue::CATALOGUE.len()].id;
                s.effects = vec![id];
                name = format!("{class:?}_{k:03}_{id}");
            }
            out.push((name.to_lowercase(), s));
        }
    }
    out
}

/// Writes `n` records of each class to `folder`: `NAME.csv` and `NAME.truth.json`.
pub fn write(folder: &Path, n: u64, first_seed: u64) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    for (name, scenario) in bank(n, first_seed) {
        let BlindRecord { csv, truth } = make(&scenario);
        std::fs::write(folder.join(format!("{name}.csv")), csv)?;
        let text = serde_json::to_string_pretty(&truth_json(&truth))?;
        std::fs::write(folder.join(format!("{name}.truth.json")), text)?;
    }
    Ok(())
}
