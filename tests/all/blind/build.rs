//! The classes: which effects a record gets, how they are put together, and when a draw is good.

use super::catalogue::{self, CATALOGUE, Entry, Need};
use super::covariates::{self, Auxiliary};
use super::dice::{Dice, seed_of};
use super::form::{Form, Plan, Planted, plant};
use super::judge::Bench;
use super::linear::{Span, rms, sum};
use super::noise::{self, Flavour, Noise};
use super::outside::{self, OUTSIDERS, Outsider};
use super::programs::RateProgram;
use super::world::{Protocol, World};
use super::{BlindRecord, Class, Scenario, Truth, sheet, traps};
use crate::rng::Rng;

/// An effect in a sensor's noise has a whitened t of this at least: below, nobody could name it.
const SIGNIFICANT: f64 = 6.0;

/// What is to be planted, and in which experiment.
struct Cast {
    known: Vec<&'static Entry>,
    outsider: Option<&'static Outsider>,
    covariate: bool,
    protocol: Protocol,
}

/// Draws effects and experiment of a scenario.
fn cast(s: &Scenario, rng: &mut Rng) -> Cast {
    let count = match s.class {
        Class::Single | Class::Faint | Class::HiddenChannel => 1,
        Class::Pair => 2,
        Class::Triple => 3,
        _ => 0,
    };
    let count = s.setting.effects.unwrap_or(count);
    let mut known: Vec<&Entry> = s.effects.iter().map(|id| catalogue::of(id)).collect();
    let may_hide = |e: &Entry| e.channel.is_some_and(|c| c != "rate_dps");
    while known.len() < count {
        let e = &CATALOGUE[rng.range(0, CATALOGUE.len() as i64 - 1) as usize];
        let hides = s.class != Class::HiddenChannel || may_hide(e);
        let no_line = s.setting.lines == 0 || e.id != "periodic_pickup";
        if hides && no_line && !known.iter().any(|k| k.id == e.id) {
            known.push(e);
        }
    }
    let outsider = (s.class == Class::Outside).then(|| match s.setting.outsider {
        Some(id) => outside::of(id),
        None => &OUTSIDERS[rng.range(0, OUTSIDERS.len() as i64 - 1) as usize],
    });
    let mut needs: Vec<Need> = known.iter().flat_map(|e| e.needs).copied().collect();
    needs.extend(outsider.iter().flat_map(|o| o.needs));
    if known.iter().any(|e| e.id == "output_saturation") && rng.odds(0.3) {
        // Clipped by its bias alone.
        needs.retain(|n| *n != Need::Rate || known.len() > 1);
    }
    let protocol = match s.class {
        Class::Confounded => {
            let (id, protocol) = traps::confounded(rng);
            known = vec![catalogue::of(id)];
            protocol
        }
        Class::Unexcited => {
            let (id, protocol) = traps::unexcited(rng);
            known = vec![catalogue::of(id)];
            protocol
        }
        Class::HiddenChannel => {
            // With one power-on, time_s is the time since power-on: nothing would be hidden.
            let p = catalogue::protocol(&needs, rng);
            let hides_clock = needs.contains(&Need::Cycles);
            let power_cycles = if hides_clock {
                p.power_cycles.max(2)
            } else {
                p.power_cycles
            };
            Protocol { power_cycles, ..p }
        }
        _ => {
            let p = catalogue::protocol(&needs, rng);
            let creeps = known.iter().any(|e| e.id == "output_deadband") && rng.odds(0.4);
            let rate = if creeps { RateProgram::Creep } else { p.rate };
            Protocol { rate, ..p }
        }
    };
    let protocol = match s.setting.rows {
        Some((least, most)) => Protocol {
            rows: rng.range(least, most) as usize,
            ..protocol
        },
        None => protocol,
    };
    Cast {
        known,
        outsider,
        covariate: s.class == Class::Covariate || s.setting.unrecorded,
        protocol,
    }
}

/// Noise of a class, in units of its white part.
fn flavour(class: Class, rng: &mut Rng) -> Flavour {
    match class {
        Class::None if rng.odds(0.5) => Flavour::Pink(rng.between(0.3, 1.2)),
        Class::NoiseOnly if rng.odds(0.5) => Flavour::Pink(rng.spread(2.0, 12.0)),
        Class::NoiseOnly => Flavour::Walk(rng.spread(8.0, 50.0)),
        Class::None => Flavour::White,
        _ if rng.odds(0.4) => Flavour::Pink(rng.between(0.2, 0.6)),
        _ => Flavour::White,
    }
}

/// Size of an effect over the short-term noise.
fn ratio(s: &Scenario, rng: &mut Rng) -> f64 {
    s.ratio.unwrap_or_else(|| match s.class {
        Class::Faint => rng.between(0.5, 1.5),
        Class::Pair | Class::Triple => rng.spread(1.5, 10.0),
        Class::Outside | Class::Confounded => rng.spread(2.0, 15.0),
        _ => rng.spread(1.5, 20.0),
    })
}

/// The noise of the record's rows.
struct RowNoise {
    /// All but outliers; deg/s.
    values: Vec<f64>,
    /// Short-term size, deg/s, lines left out.
    short_term: f64,
    /// Rows with a spike of the sensor's own.
    spike: Vec<bool>,
    /// Amplitudes of the lines, deg/s.
    lines: Vec<f64>,
}

/// The noise of the class, or what the scenario has in its place. A repeated row has its own white noise.
fn noise_of(s: &Scenario, w: &World, flavour: Flavour, rng: &mut Rng) -> RowNoise {
    let made = s.setting.noise.as_ref();
    let made = made.map(|n| n.make(w.protocol.rows, w.sigma_dps, rng));
    let spike = made.as_ref().map(|m| m.spike.clone());
    let spike = spike.map_or(vec![false; w.len()], |all| {
        w.grid.iter().map(|k| all[*k]).collect()
    });
    let noise = match made {
        Some(m) => Noise {
            short_term: w.sigma_dps,
            slow: m.values.clone(),
            values: m.values,
        },
        None => noise::make(w.protocol.rows, w.sigma_dps, flavour, rng),
    };
    let mut last = usize::MAX;
    let values = w
        .grid
        .iter()
        .map(|k| {
            let again = *k == last;
            last = *k;
            if again {
                noise.slow[*k] + w.sigma_dps * rng.gauss()
            } else {
                noise.values[*k]
            }
        })
        .collect();
    let lines: Vec<(f64, f64)> = (0..s.setting.lines)
        .map(|_| {
            let size = noise.short_term * rng.spread(0.5, 4.0);
            (size, w.protocol.row_s / rng.between(0.03, 0.47))
        })
        .collect();
    let with_lines = lines.iter().fold(values, |v: Vec<f64>, (size, period_s)| {
        let sine = w.sine(*period_s, rng.unit());
        v.iter().zip(sine).map(|(v, x)| v + size * x).collect()
    });
    RowNoise {
        values: with_lines,
        short_term: noise.short_term,
        spike,
        lines: lines.iter().map(|l| l.0).collect(),
    }
}

/// Plans in the order in which they act: what moves the thermometer first, what clips the total last.
fn plans(c: &Cast, w: &World, rng: &mut Rng) -> Option<(Vec<Plan>, Option<Auxiliary>)> {
    let mut out = Vec::new();
    for e in &c.known {
        out.push((e.draw)(w, rng)?);
    }
    out.extend(c.outsider.map(|o| (o.draw)(w, rng)));
    let mut column = None;
    if c.covariate {
        let (auxiliary, plan) = covariates::cause(w, rng);
        column = Some(auxiliary);
        out.push(plan);
    }
    out.sort_by_key(|p| match p.form {
        Form::Pull(_) => 0,
        Form::Linear(_) | Form::Tuned(_) => 1,
        Form::Clip(_) => 2,
    });
    Some((out, column))
}

/// Bias at the reading, and contributions: the error without noise.
fn clean(w: &World, planted: &[Planted]) -> Vec<f64> {
    let bias: Vec<f64> = w.reading().iter().map(|p| w.bias_at(*p)).collect();
    planted.iter().fold(bias, |a, p| sum(&a, &p.contribution))
}

/// All contributions together.
fn contributions(planted: &[Planted], rows: usize) -> Vec<f64> {
    planted
        .iter()
        .fold(vec![0.0; rows], |a, p| sum(&a, &p.contribution))
}

/// An effect that the experiment does not show: as large as it may be without showing.
fn hide(w: &World, entry: &Entry, short_term: f64, rng: &mut Rng) -> Planted {
    let unit = match (entry.draw)(w, rng).map(|p| p.form) {
        Some(Form::Linear(unit)) => unit,
        _ => vec![0.0; w.len()],
    };
    let shown = rms(&Span::declared(&w.reading()).residual(&unit)).max(1e-300);
    let k = (20.0 * short_term / rms(&unit).max(1e-300)).min(0.1 * short_term / shown);
    let contribution: Vec<f64> = unit.iter().map(|u| k * u).collect();
    Planted {
        id: entry.id.to_owned(),
        orthogonal_rms: rms(&Span::declared(&w.reading()).residual(&contribution)),
        contribution,
        surviving: 0.0,
        parameters: vec![("gain", k)],
    }
}

/// One draw; None where it does not suit.
pub fn attempt(s: &Scenario, attempt: u64) -> Option<BlindRecord> {
    let mut rng = Rng::new(seed_of(&[s.seed, s.class as u64, attempt]));
    let c = cast(s, &mut rng);
    let mut w = World::run(c.protocol, &mut rng);
    let flavour = flavour(s.class, &mut rng);
    let made = noise_of(s, &w, flavour, &mut rng);
    let (noise, short_term) = (made.values, made.short_term);
    let mut planted: Vec<Planted> = Vec::new();
    let mut cause = None;
    if s.class == Class::Unexcited {
        planted.push(hide(&w, c.known[0], short_term, &mut rng));
    } else {
        let (plans, column) = plans(&c, &w, &mut rng)?;
        cause = column;
        for plan in plans {
            let before = sum(&clean(&w, &planted), &w.rate_dps);
            let (target, sign) = (short_term * ratio(s, &mut rng), rng.sign());
            planted.push(plant(&mut w, plan, target, sign, &before)?);
        }
    }
    // A later pull moves the projection of earlier contributions.
    let declared = Span::declared(&w.reading());
    for p in &mut planted {
        p.orthogonal_rms = rms(&declared.residual(&p.contribution));
    }
    if let Some(n) = &s.setting.noise {
        let t = |p: &Planted| n.significance(&declared.residual(&p.contribution), short_term);
        if planted.iter().any(|p| t(p) < SIGNIFICANT) {
            return None;
        }
    }
    let cause = cause.filter(|_| !s.setting.unrecorded);
    let auxiliaries = auxiliary_columns(s.class, &w, cause, &mut rng);
    let (channels, hidden) = channels(s.class, &c, &w, &mut rng);
    let nearest = c.outsider.map_or(&[][..], |o| o.nearest);
    let bench = Bench {
        class: s.class,
        w: &w,
        short_term,
        nearest,
        channels: &channels,
        auxiliaries: &auxiliaries,
    };
    let judged = bench.judge(&planted)?;
    let dictionary = bench.best(&sum(&noise, &contributions(&planted, w.len())));
    let (output, noise, mut outlier) = output(&w, &planted, noise, short_term, &mut rng);
    outlier
        .iter_mut()
        .zip(&made.spike)
        .for_each(|(o, s)| *o |= s);
    let truth = Truth {
        class: s.class,
        effects: named(s.class, &planted),
        alternatives: judged.0,
        closest: judged.1,
        oracle: planted.iter().map(|p| p.contribution.clone()).collect(),
        reading: w.reading(),
        thermometer: w.protocol.thermometer,
        clean_dps: clean(&w, &planted),
        noise_rms: rms(&noise
            .iter()
            .zip(&outlier)
            .filter(|(_, o)| !**o)
            .map(|(n, _)| *n)
            .collect::<Vec<_>>()),
        noise_dps: noise,
        outlier,
        short_term,
        ratios: planted
            .iter()
            .map(|p| p.orthogonal_rms / short_term)
            .collect(),
        lines: made.lines.iter().map(|a| a / short_term).collect(),
        hidden,
        outside_channel: c
            .outsider
            .and_then(|o| o.channel)
            .filter(|n| channels.contains(n)),
        nearest: nearest.to_vec(),
        decoys: auxiliaries
            .iter()
            .map(|a| a.name)
            .filter(|n| !planted.iter().any(|p| p.id.ends_with(n)))
            .collect(),
        dictionary,
        attempts: attempt,
        protocol: format!("{:?} {flavour:?}", w.protocol),
        planted,
        channels: channels.clone(),
    };
    let csv = sheet::csv(&w, &channels, &auxiliaries, &output, &mut rng);
    Some(BlindRecord { csv, truth })
}

/// What a right answer names.
fn named(class: Class, planted: &[Planted]) -> Vec<String> {
    match class {
        Class::Outside | Class::HiddenChannel | Class::Unexcited => Vec::new(),
        _ => planted.iter().map(|p| p.id.clone()).collect(),
    }
}

/// The cause, if it is a column, among decoys; a few decoys in a quarter of all other records.
fn auxiliary_columns(
    class: Class,
    w: &World,
    cause: Option<Auxiliary>,
    rng: &mut Rng,
) -> Vec<Auxiliary> {
    let count = match class {
        Class::Covariate => rng.range(1, 5),
        _ if rng.odds(0.25) => rng.range(1, 3),
        _ => 0,
    };
    let mut all = covariates::decoys(w, count as usize, cause.as_ref(), rng);
    all.extend(cause);
    rng.shuffle(&mut all);
    all
}

/// The record's channels, and the one that is withheld.
fn channels(
    class: Class,
    c: &Cast,
    w: &World,
    rng: &mut Rng,
) -> (Vec<&'static str>, Option<&'static str>) {
    let mut wanted: Vec<&'static str> = c.known.iter().filter_map(|e| e.channel).collect();
    wanted.extend(c.outsider.and_then(|o| o.channel));
    if class == Class::Confounded {
        // The rival's channel has to be there.
        wanted.extend(["agc", "supply_v", "accel_g", "quad_dps"]);
    }
    let mut all = catalogue::channels(w, &wanted, rng);
    let hidden = match class {
        Class::HiddenChannel => c.known.first().and_then(|e| e.channel),
        _ => None,
    };
    all.retain(|name| Some(*name) != hidden);
    (all, hidden)
}

/// `rate_out_dps`, the noise in it, and which rows are outliers. Where the output clips, half of the devices clip
/// their noise as well.
fn output(
    w: &World,
    planted: &[Planted],
    noise: Vec<f64>,
    short_term: f64,
    rng: &mut Rng,
) -> (Vec<f64>, Vec<f64>, Vec<bool>) {
    let total = sum(&clean(w, planted), &w.rate_dps);
    let clip = planted.iter().find(|p| p.id == "output_saturation");
    let mut noisy = sum(&total, &noise);
    if let Some(p) = clip
        && rng.odds(0.5)
    {
        let get = |name: &str| p.parameters.iter().find(|q| q.0 == name).map(|q| q.1);
        let (low, high) = (
            get("lower_dps").unwrap_or(f64::NEG_INFINITY),
            get("upper_dps").unwrap_or(f64::INFINITY),
        );
        let before = sum(
            &sum(&total, &noise),
            &p.contribution.iter().map(|c| -c).collect::<Vec<_>>(),
        );
        noisy = before.iter().map(|x| x.clamp(low, high)).collect();
    }
    let share = if rng.odds(0.3) {
        rng.between(0.002, 0.02)
    } else {
        0.0
    };
    let outlier = noise::outliers(&mut noisy, short_term, share, rng);
    let added = noisy.iter().zip(&total).map(|(a, b)| a - b).collect();
    (noisy, added, outlier)
}
