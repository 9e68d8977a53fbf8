use super::*;
use crate::design::template::default_design;

fn profile(text: &str) -> Profile {
    parse(text.as_bytes(), Path::new("p.csv")).expect("a profile")
}

#[test]
fn between_corners_it_is_linear_and_after_the_last_constant() {
    let p = profile("time_s,chamber_degc,rate_dps\n0,20,0\n10,30,100\n10,40,0\n");
    assert_eq!(p.at(5.0).chamber_degc, 25.0);
    assert_eq!(p.at(5.0).rate_dps, 50.0);
    assert_eq!(p.at(10.0).chamber_degc, 40.0);
    assert_eq!(p.at(99.0).chamber_degc, 40.0);
    assert_eq!(p.at(-1.0).chamber_degc, 20.0);
    assert_eq!(p.at(5.0).supply_v, NOMINAL_SUPPLY_V);
    assert_eq!(p.corners_between(0.0, 10.0).len(), 0);
    assert_eq!(p.corners_between(-1.0, 11.0).len(), 3);
    assert_eq!(p.has, [true, false, false]);
}

#[test]
fn the_default_run_dwells_29_times_and_turns_once() {
    let run = default_design().expect("the default").thermal_run;
    let (profile, readings) = Profile::of_run(&run, 1.0);
    assert_eq!(readings.len(), 29 * 3);
    assert_eq!(readings.iter().filter(|r| r.heating).count(), 15 * 3);
    // Every reading is in its dwell's last part, 900 s after the ramp's end.
    for (k, (degc, _)) in dwells(&run).iter().enumerate() {
        assert_eq!(profile.at(readings[3 * k].time_s).chamber_degc, *degc);
        assert_eq!(
            profile.at(readings[3 * k].time_s - 899.9).chamber_degc,
            *degc
        );
    }
    assert_eq!(readings[0].time_s, 900.0);
    assert_eq!(readings[3].time_s, 900.0 + 30.0 + 300.0 + 900.0);
}

#[test]
fn even_readings_know_the_direction() {
    let p = profile("time_s,chamber_degc\n0,20\n10,30\n20,30\n30,20\n");
    let r = p.even_readings(7);
    let directions: Vec<bool> = r.iter().map(|r| r.heating).collect();
    assert_eq!(directions, [true, true, true, true, true, false, false]);
    assert_eq!(r[6].time_s, 30.0);
}

#[test]
fn what_is_no_profile_is_refused_with_its_place() {
    for (text, words) in [
        ("time_s,chamber\n0,1\n", "p.csv:1:1"),
        ("time_s,chamber_degc\n0,20\n5,warm\n", "p.csv:3:3"),
        ("time_s,chamber_degc\n0,20\n5,nan\n", "p.csv:3:3"),
        ("time_s,chamber_degc\n5,20\n0,20\n", "p.csv:3:1"),
        ("time_s,chamber_degc\n0,-300\n", "p.csv:2:1"),
        ("time_s,chamber_degc\n0,20,7\n", "p.csv:2:1"),
        ("time_s,chamber_degc\n0,25\n0,30\n", "p.csv:3:1"),
        (
            "time_s,chamber_degc\n7,25\n",
            "lasts no time: time_s is 7 in",
        ),
        ("time_s,chamber_degc\n", "p.csv:1:1"),
        ("", "p.csv:1:1"),
    ] {
        let e = parse(text.as_bytes(), Path::new("p.csv")).expect_err(text);
        assert!(e.to_string().contains(words), "{text:?}: {e}");
    }
}

#[test]
fn a_temperature_that_no_gyro_works_at_has_its_line() {
    let of = |degc: f64| profile(&format!("time_s,chamber_degc\n0,25\n600,{degc}\n900,20\n"));
    assert_eq!(of(900.0).beyond(), Some((900.0, Some(3))));
    assert_eq!(of(-101.0).beyond(), Some((-101.0, Some(3))));
    assert_eq!(of(125.0).beyond(), None);
    assert_eq!(Profile::constant(300.0).beyond(), Some((300.0, None)));
}

#[test]
fn a_missing_column_is_told_with_those_that_are_there() {
    let error = parse(b"seconds,chamber_degc\n0,20\n", Path::new("oven.csv")).unwrap_err();
    let text = error.to_string();
    for part in [
        "oven.csv:1:1",
        "the profile has no column time_s",
        "the file has: seconds, chamber_degc",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
