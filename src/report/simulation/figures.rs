//! The paper's three figures from a simulated run, and power-on.

use super::super::axis::{Axis, Interval};
use super::super::figure::{Figure, both};
use super::super::svg::{Frame, Shape, Svg, Swatch};
use super::super::text::significant;
use crate::cosim::path::RealRow;
use crate::cosim::readings::Taken;
use crate::plant::Device;
use crate::simulation::outcome::Outcome;

/// What the equations and figures are of.
const PAPER: &str = "Chen et al. (2004)";
/// Points of a curve.
const CURVE: u32 = 160;

/// All of them, in the order of the page.
pub fn all(outcome: &Outcome) -> Vec<Figure> {
    let tracking = outcome.parts.design.circuit.phase_loop.is_some();
    both(|width| {
        vec![
            drive_mode(outcome, tracking, width),
            against_temperature(outcome, tracking, width),
            bias_against_thermometer(outcome, tracking, width),
            startup(outcome, tracking, width),
        ]
    })
}

fn axis(quantity: &str, unit: &str, values: impl IntoIterator<Item = f64>) -> Axis {
    Axis {
        interval: Interval::of(values).padded(0.06),
        quantity: quantity.to_owned(),
        unit: unit.to_owned(),
    }
}

/// The room that the labels of all frames of a figure need.
fn room(axes: &[&Axis]) -> f64 {
    axes.iter().map(|a| a.room()).fold(0.0, f64::max)
}

fn unlabelled(axis: &Axis) -> Axis {
    Axis {
        quantity: String::new(),
        ..axis.clone()
    }
}

fn chamber(taken: &[Taken]) -> Axis {
    let degc = taken.iter().map(|t| t.moment.temperatures.chamber_degc);
    axis("chamber", "degC", degc)
}

fn curve(x: Interval, of: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    (0..=CURVE)
        .map(|k| x.low + (x.high - x.low) * f64::from(k) / f64::from(CURVE))
        .map(|t| (t, of(t)))
        .collect()
}

/// Markers of both ramps; a long run as two lines.
fn ramps(frame: &mut Frame, taken: &[Taken], at: impl Fn(&Taken) -> (f64, f64)) {
    for (class, shape, heating) in [
        ("heating", Shape::Up, true),
        ("cooling", Shape::Down, false),
    ] {
        let chosen = taken.iter().filter(|t| t.reading.heating == heating);
        let places: Vec<(f64, f64)> = chosen.map(&at).collect();
        if places.len() > 400 {
            frame.line(&format!("{class} line"), &places);
        } else {
            let radius = if places.len() > 100 { 3.2 } else { 5.0 };
            frame.markers(class, shape, radius, &places);
        }
    }
}

/// The ramps that were run.
fn ramps_legend(taken: &[Taken]) -> Vec<(&'static str, Swatch, String)> {
    let ran = |heating: bool| taken.iter().any(|t| t.reading.heating == heating);
    let all = [
        ("heating", Shape::Up, true),
        ("cooling", Shape::Down, false),
    ];
    all.into_iter()
        .filter(|(_, _, heating)| ran(*heating))
        .map(|(class, shape, _)| (class, Swatch::Marker(shape), class.to_owned()))
        .collect()
}

/// Fig. 1: amplitude and phase of the drive mode against temperature.
fn drive_mode(outcome: &Outcome, tracking: bool, width: f64) -> Figure {
    let taken = &outcome.parts.run.taken;
    let device = Device::new(&outcome.parts.design.gyro);
    let hz = device.excitation_hz;
    let x = chamber(taken);
    let amplitude = |t: f64| 100.0 * device.drive.response(t, hz).amplitude / device.drive.q;
    let exact = |t: f64| device.drive.response(t, hz).phase_rad.to_degrees();
    let linear = |t: f64| device.drive.linear_phase_rad(t).to_degrees();
    let own = |t: &Taken| {
        let electronics = device.electronics_phase_rad(t.moment.temperatures.electronics_degc);
        let share = if tracking {
            device.electronics.loop_share
        } else {
            1.0
        };
        (t.fixed.phase_rad - share * electronics).to_degrees()
    };
    let place = |t: &Taken, value: f64| (t.moment.temperatures.chamber_degc, value);
    // With the amplitude held, the gain is what the amplitude would have been the inverse of.
    let held = |t: &Taken| 100.0 / t.fixed.agc;
    let amplitudes = curve(x.interval, amplitude);
    let has_loop = outcome.parts.design.circuit.amplitude_loop.is_some();
    let simulated = taken.iter().map(held).filter(|_| has_loop);
    let y1 = axis(
        "amplitude",
        "% of resonance",
        amplitudes.iter().map(|p| p.1).chain(simulated),
    );
    let exacts = curve(x.interval, exact);
    let y2 = axis(
        "phase",
        "deg",
        exacts.iter().map(|p| p.1).chain(taken.iter().map(own)),
    );
    let left = room(&[&y1, &y2]);
    let mut svg = Svg::new(width);
    let mut legend = ramps_legend(taken);
    legend.extend([
        ("fit", Swatch::Line, format!("{PAPER}, eq. 6 and 7")),
        ("bound", Swatch::Line, format!("{PAPER}, eq. 8, linear")),
    ]);
    svg.legend(legend);
    let mut top = svg.frame(200.0, left, unlabelled(&x), y1);
    top.line("fit", &amplitudes);
    if has_loop {
        ramps(&mut top, taken, |t| place(t, held(t)));
    }
    svg.add(&top);
    let mut bottom = svg.frame(240.0, left, x.clone(), y2);
    bottom.line("fit", &exacts);
    bottom.line("bound", &curve(x.interval, linear));
    ramps(&mut bottom, taken, |t| place(t, own(t)));
    svg.add(&bottom);
    let title = "Drive mode: amplitude and phase against temperature";
    let tail = if tracking {
        " The curves are those of a fixed-frequency drive; here the phase loop holds the phase."
    } else {
        ""
    };
    let held = if has_loop {
        "; the amplitude is 1 over the drive gain that holds it"
    } else {
        ""
    };
    svg.figure(title, format!(
            "{PAPER}, fig. 1. Markers: the bit-accurate circuit in closed loop, the electronics' phase taken off{held}.{tail}"
        ))
}

/// Fig. 2: scale factor, bias and thermometer against temperature, both ramps.
fn against_temperature(outcome: &Outcome, tracking: bool, width: f64) -> Figure {
    let taken = &outcome.parts.run.taken;
    let factors = &outcome.parts.scale_factor;
    let x = chamber(taken);
    let percent = |fixed: f64| 100.0 * (fixed - 1.0);
    let y1 = axis(
        "scale factor",
        "% off nominal",
        factors.iter().map(|f| percent(f.fixed)),
    );
    let bias = |t: &Taken| t.fixed.rate_out_dps - t.moment.surroundings.rate_dps;
    let y2 = axis("rate output", "deg/s", taken.iter().map(bias));
    let thermometer = |t: &Taken| {
        if tracking {
            t.fixed.freq_hz
        } else {
            t.fixed.phase_rad
        }
    };
    let (name, unit) = thermometer_name(tracking);
    let y3 = axis(name, unit, taken.iter().map(thermometer));
    let left = room(&[&y1, &y2, &y3]);
    let place = |t: &Taken, value: f64| (t.moment.temperatures.chamber_degc, value);
    let mut svg = Svg::new(width);
    svg.legend(ramps_legend(taken));
    if !factors.is_empty() {
        let mut frame = svg.frame(170.0, left, unlabelled(&x), y1);
        frame.level("zero", 0.0);
        for (class, shape, heating) in [
            ("heating", Shape::Up, true),
            ("cooling", Shape::Down, false),
        ] {
            let chosen = factors.iter().filter(|f| f.heating == heating);
            let places: Vec<_> = chosen.map(|f| (f.chamber_degc, percent(f.fixed))).collect();
            frame.markers(class, shape, 5.0, &places);
        }
        svg.add(&frame);
    }
    let mut frame = svg.frame(170.0, left, unlabelled(&x), y2);
    ramps(&mut frame, taken, |t| place(t, bias(t)));
    svg.add(&frame);
    let mut frame = svg.frame(170.0, left, x.clone(), y3);
    ramps(&mut frame, taken, |t| place(t, thermometer(t)));
    svg.add(&frame);
    let caption = format!("{PAPER}, fig. 2, by the bit-accurate circuit.");
    if factors.is_empty() {
        return svg.figure(format!("Bias and {name} against temperature"), caption);
    }
    svg.figure(
        format!("Scale factor, bias and {name} against temperature, both ramps"),
        format!(
            "{caption} The scale factor is from {} deg/s both ways.",
            significant(outcome.parts.design.thermal_run.scale_rate_dps, 3)
        ),
    )
}

fn thermometer_name(tracking: bool) -> (&'static str, &'static str) {
    if tracking {
        ("drive frequency", "Hz")
    } else {
        ("measured drive phase", "rad")
    }
}

/// Fig. 3: bias against the thermometer with the fit, and what the compensated chain leaves.
fn bias_against_thermometer(outcome: &Outcome, tracking: bool, width: f64) -> Figure {
    let taken = &outcome.parts.run.taken;
    let thermometer = |t: &Taken| {
        if tracking {
            t.fixed.freq_hz
        } else {
            t.fixed.phase_rad
        }
    };
    let (name, unit) = thermometer_name(tracking);
    let x = axis(name, unit, taken.iter().map(thermometer));
    let bias = |t: &Taken| t.fixed.rate_out_dps - t.moment.surroundings.rate_dps;
    let fit = outcome.parts.calibrated.as_ref().map(|(_, c)| &c.fit);
    let fitted: Vec<(f64, f64)> =
        fit.map_or(Vec::new(), |fit| curve(x.interval, |t| fit.bias_dps(t)));
    let heights = taken.iter().map(bias).chain(fitted.iter().map(|p| p.1));
    let y1 = axis("rate output", "deg/s", heights);
    let after = outcome.parts.after.as_deref().unwrap_or(&[]);
    let y2 = axis(
        "compensated rate",
        "deg/s",
        after.iter().map(|t| t.fixed.rate_dps).chain([0.0]),
    );
    let left = room(&[&y1, &y2]);
    let mut svg = Svg::new(width);
    let mut legend = ramps_legend(taken);
    if let Some(fit) = fit {
        let text = format!("fitted polynomial, order {}", fit.order);
        legend.push(("fit", Swatch::Line, text));
    }
    svg.legend(legend);
    let upper = if after.is_empty() {
        x.clone()
    } else {
        unlabelled(&x)
    };
    let mut frame = svg.frame(260.0, left, upper, y1);
    ramps(&mut frame, taken, |t| (thermometer(t), bias(t)));
    frame.line("fit", &fitted);
    svg.add(&frame);
    if !after.is_empty() {
        let mut frame = svg.frame(200.0, left, x.clone(), y2);
        frame.level("zero", 0.0);
        ramps(&mut frame, after, |t| (thermometer(t), t.fixed.rate_dps));
        svg.add(&frame);
    }
    if after.is_empty() {
        return svg.figure(format!("Bias against {name}"), format!("{PAPER}, fig. 3."));
    }
    svg.figure(
        format!("Bias against {name}, and what the compensation leaves"),
        format!(
            "{PAPER}, fig. 3. Below: the compensated rate of the bit-accurate chain, with the fit's coefficients in their formats."
        ),
    )
}

/// Power-on: amplitude, phase and, with a phase loop, frequency over time.
fn startup(outcome: &Outcome, tracking: bool, width: f64) -> Figure {
    let s = &outcome.parts.startup;
    let whole = s.rows.len();
    // Until everything has settled, and half as long again.
    let settled = [s.amplitude_s, s.phase_s, s.lock_s];
    let latest = settled.into_iter().flatten().fold(0.05, f64::max);
    let count = ((1.5 * latest * s.rows_per_s) as usize).clamp(2, whole.max(2));
    let step = count.div_ceil(2000).max(1);
    let series = |of: &dyn Fn(&RealRow) -> f64| -> Vec<(f64, f64)> {
        let rows = s.rows.iter().take(count).enumerate().step_by(step);
        rows.map(|(k, row)| (1e3 * (k + 1) as f64 / s.rows_per_s, of(row)))
            .collect()
    };
    let end = s.rows.last().map_or(1.0, |r| r.magnitude);
    let mut all = vec![
        ("amplitude", "%", series(&|r| 100.0 * r.magnitude / end)),
        ("phase", "deg", series(&|r| r.phase_rad.to_degrees())),
        ("drive gain", "1", series(&|r| r.gain)),
    ];
    if tracking {
        all.push(("frequency", "Hz", series(&|r| r.freq_hz)));
    }
    let axes: Vec<Axis> = all
        .iter()
        .map(|(name, unit, points)| axis(name, unit, points.iter().map(|p| p.1)))
        .collect();
    let left = axes.iter().map(Axis::room).fold(0.0, f64::max);
    let last = all.len() - 1;
    let mut svg = Svg::new(width);
    for (k, ((_, _, points), y)) in all.iter().zip(axes).enumerate() {
        let x = axis("time since power-on", "ms", points.iter().map(|p| p.0));
        let x = if k == last { x } else { unlabelled(&x) };
        let mut frame = svg.frame(130.0, left, x, y);
        frame.line("fixed", points);
        svg.add(&frame);
    }
    let title = "Power-on: from no motion to the settled loops";
    svg.figure(title, format!(
            "At {} degC, without noise, bit-accurate, row by row; the amplitude is in percent of where it ends. The slowest time constant of the linearised loops is {} ms.",
            significant(s.chamber_degc, 3),
            significant(1e3 * s.predicted_time_constant_s, 3)
        ))
}
