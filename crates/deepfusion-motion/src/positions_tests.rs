use super::*;

/// A pseudo-random number between -1 and 1.
fn noise(i: usize) -> f64 {
    let x = (i as f64 * 12.9898).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

/// A drive at 49° north that accelerates from 5 to 15 m/s, brakes and turns; `jitter` is the position noise in metres.
fn drive(jitter: f64) -> (Vec<Fix>, Vec<f64>) {
    let (mut x, mut y, mut heading) = (0.0_f64, 0.0_f64, 0.6_f64);
    let (mut fixes, mut speeds) = (Vec::new(), Vec::new());
    let (sin, cos) = 49_f64.to_radians().sin_cos();
    let w = 1.0 - ECCENTRICITY_2 * sin * sin;
    for tenth in 0..1200 {
        let t = f64::from(tenth) / 10.0;
        let speed = 10.0 + 5.0 * (t / 15.0).sin();
        if tenth % 10 == 0 {
            let (east, north) = (
                x + jitter * noise(tenth as usize),
                y + jitter * noise(7919 + tenth as usize),
            );
            fixes.push(Fix {
                time_s: t,
                latitude_deg: 49.0
                    + (north * w.powf(1.5) / (EQUATOR_M * (1.0 - ECCENTRICITY_2))).to_degrees(),
                longitude_deg: 8.4 + (east * w.sqrt() / (EQUATOR_M * cos)).to_degrees(),
                speed_mps: None,
            });
            speeds.push(speed);
        }
        (x, y) = (
            x + 0.1 * speed * heading.cos(),
            y + 0.1 * speed * heading.sin(),
        );
        heading += 0.1 * 0.15 * (t / 9.0).sin();
    }
    (fixes, speeds)
}

/// Root mean square error of the speeds, and the ratio of the distances.
fn errors(found: &[FixSpeed], truth: &[f64]) -> (f64, f64) {
    let squares = found
        .iter()
        .zip(truth)
        .map(|(f, t)| (f.speed_mps - t).powi(2));
    let ratio = found.iter().map(|f| f.speed_mps).sum::<f64>() / truth.iter().sum::<f64>();
    ((squares.sum::<f64>() / truth.len() as f64).sqrt(), ratio)
}

#[test]
fn a_track_gives_its_turns() {
    for (jitter, most) in [(0.0, 0.02), (1.0, 0.06)] {
        let (fixes, _) = drive(jitter);
        let rates = course_rates(&speeds_of_fixes(&fixes));
        assert_eq!(rates.len(), fixes.len() - 1);
        let squares = rates
            .iter()
            .map(|(t, rate)| (rate - 0.15 * (t / 9.0).sin()).powi(2));
        let rms = (squares.sum::<f64>() / rates.len() as f64).sqrt();
        // The true turns have 0.1 rad/s.
        assert!(rms < most, "{jitter}: {rms}");
    }
}

#[test]
fn a_track_gives_its_speeds() {
    for (jitter, rms, bias) in [(0.0, 0.2, 2e-3), (1.0, 0.5, 6e-3)] {
        let (fixes, truth) = drive(jitter);
        let found = speeds_of_fixes(&fixes);
        assert_eq!(found.len(), truth.len());
        let (error, ratio) = errors(&found, &truth);
        assert!(error < rms, "{jitter}: {error}");
        assert!((ratio - 1.0).abs() < bias, "{jitter}: {ratio}");
        // At least two thirds of the errors are within the stated standard deviation.
        let within = found
            .iter()
            .zip(&truth)
            .filter(|(f, t)| (f.speed_mps - **t).abs() < f.sigma_mps);
        assert!(within.count() * 3 > 2 * truth.len(), "{jitter}");
    }
}

#[test]
fn a_time_that_jumps_ahead_does_not_drop_later_fixes() {
    let (mut fixes, _) = drive(0.3);
    for glitch in [0, 7] {
        let (own, all) = (fixes[glitch].time_s, fixes.len());
        fixes[glitch].time_s = own + 86_400.0;
        assert_eq!(speeds_of_fixes(&fixes).len(), all - 1, "fix {glitch}");
        fixes[glitch].time_s = own;
    }
}

#[test]
fn jumps_of_position_do_not_become_speed() {
    let (mut fixes, truth) = drive(0.3);
    for i in [17, 40, 41, 90] {
        fixes[i].latitude_deg += 4e-4;
    }
    let (error, ratio) = errors(&speeds_of_fixes(&fixes), &truth);
    assert!(error < 0.7 && (ratio - 1.0).abs() < 0.01, "{error} {ratio}");
    // Differences of neighbouring positions give tens of m/s.
    let naive = 4e-4_f64.to_radians() * EQUATOR_M;
    assert!(naive > 40.0);
}

#[test]
fn the_receivers_speed_is_used_and_gaps_split_the_track() {
    let fix = |time_s: f64, speed: f64| Fix {
        time_s,
        latitude_deg: 49.0,
        longitude_deg: 179.999_99,
        speed_mps: Some(speed),
    };
    let fixes = [
        fix(0.0, 3.0),
        fix(1.0, 4.0),
        fix(1.0, 9.0),
        fix(30.0, 5.0),
        fix(f64::NAN, 5.0),
    ];
    let found = speeds_of_fixes(&fixes);
    let speeds: Vec<f64> = found.iter().map(|f| f.speed_mps).collect();
    assert_eq!(
        speeds,
        [3.0, 4.0],
        "a repeated time, a lone fix, and one without a time"
    );
    assert!(speeds_of_fixes(&[]).is_empty());
    let over = |longitude_deg: f64, time_s: f64| Fix {
        longitude_deg,
        speed_mps: None,
        ..fix(time_s, 0.0)
    };
    let found = speeds_of_fixes(&[
        over(179.9999, 0.0),
        over(-179.9999, 1.0),
        over(-179.9997, 2.0),
    ]);
    assert!(
        found.iter().all(|f| (10.0..20.0).contains(&f.speed_mps)),
        "{found:?}"
    );
}

/// Ten seconds of standing, then ten seconds at 10 m/s, one fix a second; `speed_mps` is the speed that the receiver reports for each.
fn stop_and_go(speed_mps: impl Fn(usize) -> Option<f64>) -> Vec<Fix> {
    let fix = |i: usize| Fix {
        time_s: i as f64,
        latitude_deg: 49.0 + i.saturating_sub(10) as f64 * 10.0 / 111_206.0,
        longitude_deg: 8.4,
        speed_mps: speed_mps(i),
    };
    (0..20).map(fix).collect()
}

#[test]
fn a_fix_without_a_speed_does_not_discard_the_others() {
    // An app that writes only speeds above 0, and one fix without a speed in between.
    let fixes = stop_and_go(|i| (i > 10 && i != 15).then_some(10.25));
    let found = speeds_of_fixes(&fixes);
    let times: Vec<f64> = found.iter().map(|f| f.time_s).collect();
    assert!(!times.contains(&15.0), "{times:?}");
    for f in &found {
        let expected = if f.time_s > 10.0 {
            (FixSpeedSource::Receiver, 10.25)
        } else {
            (FixSpeedSource::Standing, 0.0)
        };
        assert_eq!((f.source, f.speed_mps), expected, "{f:?}");
    }
    // According to the smoothed positions, the fixes next to the start are moving.
    assert!(found.len() >= 17, "{times:?}");
}

#[test]
fn few_measured_speeds_are_ignored() {
    let found = speeds_of_fixes(&stop_and_go(|i| (i > 16).then_some(10.25)));
    assert_eq!(found.len(), 20);
    let of_positions = |f: &FixSpeed| f.source == FixSpeedSource::Positions;
    assert!(found.iter().all(of_positions), "{found:?}");
}
