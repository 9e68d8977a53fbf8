use super::*;

#[test]
fn cubics_are_those_of_the_autopilots() {
    let mut p = Parameters::default();
    for (name, value) in [
        ("TC_G1_X0_2", 0.01),
        ("TC_G1_X1_2", 1e-4),
        ("TC_G1_X3_2", 1e-7),
        ("TC_G1_TREF", 40.0),
        ("TC_G1_TMIN", 10.0),
        ("TC_G1_TMAX", 60.0),
        ("INS_TCAL2_GYR1_X", 123.0),
        ("INS_TCAL2_GYR2_X", -4.0),
        ("INS_TCAL2_TMIN", 0.0),
        ("INS_TCAL2_TMAX", 70.0),
        ("INS_GYR2_CALTEMP", 30.0),
    ] {
        p.set(name, 0, value);
    }
    let px4 = px4_cubic(&p, 1, 2, 0).unwrap();
    let expected = |t: f64| (0.01 + 1e-4 * t + 1e-7 * t * t * t).to_degrees();
    for (degc, t) in [(50.0, 10.0), (80.0, 20.0), (-5.0, -30.0)] {
        assert!((px4.at(degc) - expected(t)).abs() < 1e-12);
    }
    assert!(px4_cubic(&p, 1, 0, 0).is_none() && px4_cubic(&p, 0, 2, 0).is_none());
    let of = ardupilot_cubic(&p, "INS_TCAL2", 2, "X", 0).unwrap();
    let expected = |t: f64| (1e-6 * (123.0 * t - 4.0 * t * t)).to_degrees();
    assert!((of.at(55.0) - expected(20.0)).abs() < 1e-12);
    assert!((of.added_dps - expected(-5.0)).abs() < 1e-12);
}

#[test]
fn only_changes_count_and_say_when() {
    let mut p = Parameters::default();
    for (time, value) in [(5, 0.01), (9, 0.01), (2_000_000, 0.02)] {
        p.set("INS_GYROFFS_Z", time, value);
    }
    p.set("BAT_CAPACITY", 5, 1.0);
    assert_eq!(p.last("BAT_CAPACITY"), None);
    let cuts: Vec<_> = learnt(&p, "INS_GYROFFS_Z", 1.0).collect();
    let [(time, said, step)] = &cuts[..] else {
        panic!("{cuts:?}")
    };
    assert_eq!(*time, 2_000_000);
    assert!(
        said.contains("from 0.01 to 0.02") && said.contains("2.0 s"),
        "{said}"
    );
    assert!((step + 0.01f64.to_degrees()).abs() < 1e-12);
    p.set("TC_G_ENABLE", 7, 0.0);
    p.set("TC_G_ENABLE", 3_000_000, 1.0);
    let on = p.on("TC_G_ENABLE", &[1.0]).unwrap();
    assert!(
        on.contains("TC_G_ENABLE = 1") && on.contains("3.0 s"),
        "{on}"
    );
}
