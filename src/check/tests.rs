use super::*;
use crate::design::{reader, template};

fn checked(changes: &[(&str, &str)]) -> Check {
    let mut text = template::DEFAULT.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    check(&reader::parse(&text, None).unwrap(), "test", 200_000).unwrap()
}

fn node<'a>(check: &'a Check, name: &str) -> &'a NodeCheck {
    let found = check.nodes.iter().find(|n| n.name == name);
    found.unwrap_or_else(|| panic!("no {name} in {:?}", names(check)))
}

fn names(check: &Check) -> Vec<&str> {
    check.nodes.iter().map(|n| &n.name[..]).collect()
}

fn codes(check: &Check) -> Vec<(&str, &str)> {
    check
        .remarks
        .iter()
        .map(|r| (r.code, &r.node[..]))
        .collect()
}

const PRODUCT: &str =
    "product = { format = \"Q2.22\", rounding = \"half_up\", overflow = \"saturate\" }";

#[test]
fn every_word_of_the_default_is_proved_or_has_its_path() {
    let c = checked(&[]);
    assert!(c.holds, "{:?}", c.reasons);
    let product = node(&c, "circuit.demodulator.product sense_i");
    assert_eq!(product.overflow, Overflows::Impossible);
    // 2^15 * (2^15 - 1), rounded to 22 bits.
    assert_eq!(product.proved, [-4_194_176, 4_194_176]);
    assert!((product.headroom_bits.unwrap() - 1.0).abs() < 1e-4);
    assert_eq!(
        node(&c, "circuit.cordic.width").overflow,
        Overflows::Impossible
    );
    assert_eq!(
        node(&c, "circuit.cordic phase").overflow,
        Overflows::ByDesign
    );
    let bias = node(&c, "compensation.output bias");
    assert_eq!(bias.overflow, Overflows::Possible);
    assert_eq!(bias.path.last().unwrap(), "output column rate");
    assert!(!bias.operands.is_empty() && bias.witness.is_none());
    // Rounded at every sample of a tone: a line of its own, near LSB / sqrt(12).
    let line = node(&c, "circuit.decimator.output sense_i")
        .budget
        .as_ref()
        .unwrap();
    let lsb = line.measured_rms_lsb.unwrap();
    assert!((0.25..0.35).contains(&lsb), "{line:?}");
    let rate = line.rate_rms_dps.unwrap();
    assert!(
        (rate / (lsb * 2048.0 / 4_194_304.0) - 1.0).abs() < 0.1,
        "{line:?}"
    );
    assert!(c.remarks.iter().all(|r| !r.mend.is_empty()));
    assert_eq!(c.costs.len(), 5);
}

#[test]
fn a_vector_that_is_too_narrow_overflows_for_certain_and_says_so() {
    let c = checked(&[("width = 32", "width = 27")]);
    let vector = node(&c, "circuit.cordic.width");
    assert_eq!(vector.overflow, Overflows::Certain, "{vector:?}");
    assert!(vector.witness.as_ref().unwrap().words > 0);
    let seen = vector.seen();
    assert!(
        seen.contains("(x or y of the CORDIC, whose inputs are drive_i "),
        "{seen}"
    );
    assert!(
        !c.holds && c.reasons[0].starts_with("circuit.cordic.width overflows 27 bits"),
        "{:?}",
        c.reasons
    );
    // What it needs is that of a vector that does not wrap.
    assert_eq!(
        vector.proved,
        node(&checked(&[]), "circuit.cordic.width").proved
    );
    assert!(
        c.reasons[0].contains("need 31 bits") && c.reasons[0].contains("write `width = 31`"),
        "{:?}",
        c.reasons
    );
}

#[test]
fn overflows_that_only_follow_from_a_narrow_vector_are_marked_and_no_reasons() {
    let c = checked(&[("width = 32", "width = 26")]);
    let bias = node(&c, "compensation.output bias");
    assert_eq!(bias.overflow, Overflows::Certain, "{bias:?}");
    assert_eq!(bias.follows_from, Some("circuit.cordic.width"));
    assert_eq!(node(&c, "circuit.cordic.width").follows_from, None);
    assert_eq!(c.reasons.len(), 1, "{:?}", c.reasons);
    assert!(
        c.reasons[0].contains("follow from it, and are gone with `width = 31`: compensation."),
        "{:?}",
        c.reasons
    );
    // An overflow that is there without it stays a reason.
    let c = checked(&[
        ("width = 32", "width = 26"),
        (
            "output = { format = \"Q12.12\"",
            "output = { format = \"Q5.12\"",
        ),
    ]);
    assert_eq!(node(&c, "compensation.output bias").follows_from, None);
    assert!(c.reasons.len() > 1, "{:?}", c.reasons);
}

#[test]
fn a_setpoint_that_no_magnitude_reaches_does_not_hold() {
    let c = checked(&[("\nsetpoint_raw = 1048576", "\nsetpoint_raw = 100000000")]);
    assert!(!c.holds);
    let [reason] = &c.reasons[..] else {
        panic!("{:?}", c.reasons)
    };
    assert!(
        reason.contains("is 100000000, above the largest magnitude, 5931461 (proved)"),
        "{reason}"
    );
    let magnitude = node(&c, "circuit.cordic.gain_bits");
    assert_eq!(magnitude.proved[1], 5_931_461);
}

#[test]
fn a_vector_that_may_wrap_is_told_its_width_and_line() {
    let c = checked(&[("width = 32", "width = 29")]);
    assert!(c.holds, "{:?}", c.reasons);
    let remark = c.remarks.iter().find(|r| r.code == "wrap_possible");
    let mend = &remark.expect("a remark").mend;
    assert!(
        mend.starts_with("in the embedded default design, line ")
            && mend.ends_with(", write `width = 31`"),
        "{mend}"
    );
}

#[test]
fn biased_rounding_is_named_with_its_bias_and_mend() {
    let to = "product = { format = \"Q2.12\", rounding = \"floor\", overflow = \"saturate\" }";
    let c = checked(&[(PRODUCT, to)]);
    let code = ("biased_rounding", "circuit.demodulator.product sense_i");
    assert!(codes(&c).contains(&code), "{:?}", codes(&c));
    let line = node(&c, code.1).budget.as_ref().unwrap();
    // Half an LSB of Q2.12 in 2048 deg/s: measured as -0.313 deg/s with the drive's share.
    let mean = line.rate_mean_dps.unwrap();
    assert!((-0.30..-0.2).contains(&mean), "{mean}");
    let c = checked(&[]);
    assert!(
        codes(&c).iter().all(|(code, _)| *code != "biased_rounding"),
        "{:?}",
        codes(&c)
    );
}

#[test]
fn idle_bits_and_a_coarse_output_are_named() {
    let c = checked(&[
        (PRODUCT, "product = \"Q4.20\""),
        (
            "output = { format = \"Q12.12\"",
            "output = { format = \"Q12.1\"",
        ),
    ]);
    let product = ("idle_bits", "circuit.demodulator.product drive_q");
    assert!(codes(&c).contains(&product), "{:?}", codes(&c));
    let remark = c.remarks.iter().find(|r| r.node == product.1).unwrap();
    assert_eq!(remark.mend, "make it Q1.20, which holds every value");
    assert!(
        codes(&c).contains(&("output_hides_fit", "compensation.output")),
        "{:?}",
        codes(&c)
    );
}

#[test]
fn a_full_scale_that_is_off_by_two_is_named_as_run_names_it() {
    let c = checked(&[(
        "rate_full_scale_dps = 2048.0",
        "rate_full_scale_dps = 1024.0",
    )]);
    let found = c.remarks.iter().find(|r| r.code == "scale_factor");
    let remark = found.expect("a remark");
    assert!(
        remark.message.contains("come out 0.5000 times as large"),
        "{}",
        remark.message
    );
    assert_eq!(remark.mend, "set compensation.rate_full_scale_dps = 2048.0");
    let c = checked(&[]);
    assert!(codes(&c).iter().all(|(code, _)| *code != "scale_factor"));
}

#[test]
fn an_excitation_beside_the_resonance_is_named_as_run_names_it() {
    let c = checked(&[("drive_frequency_hz = 1750.0", "drive_frequency_hz = 1800.0")]);
    let found = c
        .remarks
        .iter()
        .find(|r| r.code == "excitation_off_resonance");
    let remark = found.expect("a remark");
    assert!(
        remark.message.contains("the NCO runs at 1750.000 Hz"),
        "{}",
        remark.message
    );
    let c = checked(&[]);
    assert!(
        codes(&c)
            .iter()
            .all(|(code, _)| *code != "excitation_off_resonance")
    );
}

#[test]
fn a_detuned_coarse_table_has_spurs_in_band() {
    let c = checked(&[
        ("tuning_word = 134217728", "tuning_word = 134230000"),
        ("table_address_bits = 12", "table_address_bits = 6"),
    ]);
    assert!(
        codes(&c).iter().any(|(code, _)| *code == "spurs_in_band"),
        "{:?}",
        codes(&c)
    );
    let c = checked(&[]);
    assert!(
        codes(&c).iter().all(|(code, _)| *code != "spurs_in_band"),
        "{:?}",
        codes(&c)
    );
}

/// The default with requirements: a 12-bit product, so that there is something to see.
fn required(requirements: &str) -> Check {
    let text = template::DEFAULT.replacen(PRODUCT, "product = \"Q2.12\"", 1);
    let text = text.replacen(
        "#[requirements]",
        &format!("[requirements]\n{requirements}"),
        1,
    );
    check(&reader::parse(&text, None).unwrap(), "test", 20_000).unwrap()
}

fn requirement<'a>(check: &'a Check, name: &str) -> &'a requirements::Requirement {
    check.requirements.iter().find(|r| r.name == name).unwrap()
}

#[test]
fn requirements_are_each_met_or_not_with_what_mends_them() {
    let c = required(
        "drift_dps = 1.0\nnoise_dps_rthz = 3e-4\nbandwidth_hz = 100.0\ncycles_per_row = 9e3\n",
    );
    assert_eq!(c.confidence.unwrap().intervals, 2);
    let noise = requirement(&c, "noise_dps_rthz");
    assert!(!noise.met && noise.obtained > 3e-4, "{noise:?}");
    let mend = noise.mend.as_ref().unwrap();
    assert!(
        mend.starts_with("`circuit.demodulator.product` of 1"),
        "{mend}"
    );
    for name in ["drift_dps", "bandwidth_hz", "cycles_per_row"] {
        let r = requirement(&c, name);
        assert!(r.met && r.mend.is_none(), "{r:?}");
    }
    // Cycles are a processor's: of the FPGA there is no such line.
    assert_eq!(c.requirements.len(), 4);
    assert!(!c.holds);
    assert_eq!(c.reasons.len(), 1);
    assert!(
        c.reasons[0].contains("noise_dps_rthz <= 3e-4 is not met"),
        "{:?}",
        c.reasons
    );
    assert_eq!(checked(&[]).requirements, []);
}

#[test]
fn a_figure_that_only_seems_to_be_within_its_limit_does_not_meet_it() {
    let limit = |value: f64| format!("noise_dps_rthz = {value:e}\n");
    let found = requirement(&required(&limit(1.0)), "noise_dps_rthz").clone();
    let [_, high] = found.bounds.unwrap();
    assert!(found.met && high > found.obtained * 1.01, "{found:?}");
    let between = required(&limit(0.5 * (found.obtained + high)));
    let r = requirement(&between, "noise_dps_rthz");
    assert!(
        !r.met && r.failure().unwrap().contains("is not shown to be met: "),
        "{r:?}"
    );
    assert!(r.obtained < r.limit && r.margin() < 0.0, "{r:?}");
    assert!(requirement(&required(&limit(1.001 * high)), "noise_dps_rthz").met);
}

#[test]
fn a_limit_on_what_has_a_sign_is_said_to_be_on_its_magnitude() {
    let c = required("bias_dps = 1e-9\nnoise_dps_rthz = 1.0\nbandwidth_hz = 100.0\n");
    let bias = requirement(&c, "bias_dps");
    assert_eq!(bias.limited(), "|bias_dps|");
    let why = bias.failure().unwrap();
    assert!(
        why.starts_with("requirement |bias_dps| <= 1e-9 is not met: it is ")
            && why.contains("What would mend it: no single word length is enough. "),
        "{why}"
    );
    let noise = requirement(&c, "noise_dps_rthz");
    assert_eq!(noise.limited(), "noise_dps_rthz");
    // Of the bound where there is one, and of the least that is asked from below.
    let most = noise.bounds.unwrap()[1];
    assert!((noise.margin() - (1.0 - most)).abs() < 1e-12, "{noise:?}");
    let bandwidth = requirement(&c, "bandwidth_hz");
    assert!((bandwidth.margin() - (bandwidth.obtained / 100.0 - 1.0)).abs() < 1e-12);
}

#[test]
fn costs_and_bandwidth_that_are_too_much_name_the_word_or_the_ratio() {
    let c = required("bandwidth_hz = 600.0\nrom_bytes = 5000.0\n");
    let ratio = requirement(&c, "bandwidth_hz").mend.clone().unwrap();
    // 458.6 Hz at a ratio of 32.
    assert!(
        ratio.starts_with("`circuit.decimator.ratio = 24`"),
        "{ratio}"
    );
    let roms: Vec<_> = c
        .requirements
        .iter()
        .filter(|r| r.name == "rom_bytes")
        .collect();
    assert_eq!(roms.len(), 2, "{roms:?}");
    for rom in roms {
        let mend = rom.mend.as_ref().unwrap();
        assert!(
            mend.starts_with("`circuit.nco.table_address_bits` of 11"),
            "{mend}"
        );
    }
}
