//! The points of an envelope: ends, evenness, corners.

use super::*;

const HOME: [f64; 6] = [0.5, 0.0, 0.0, 0.0, 0.0, 1.0];

fn envelope() -> MotionEnvelope {
    let limits = EnvelopeBounds {
        pose_min: [-0.1, -0.2, 0.0, -1.0, -2.0, -3.0],
        pose_max: [0.3, 0.0, 0.0, 1.0, 1.0, 1.0],
        velocity: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        acceleration: [0.0, 0.1, 0.2, 0.3, 0.4, 0.5],
    };
    MotionEnvelope::new(&HOME, limits)
}

#[test]
fn the_ends_are_the_limits_and_the_rest_is_home() {
    let envelope = envelope();
    let rest = envelope.at(&envelope.rest());
    assert!((rest.x - Vector6::from(HOME)).amax() < 1e-15);
    assert_eq!((rest.xd, rest.xdd), (Vector6::zeros(), Vector6::zeros()));
    assert_eq!(envelope.at(&envelope.corner(0)), rest);
    let high = envelope.at(&EnvelopePoint::repeat(1.0));
    assert_eq!(high.x, Vector6::new(0.8, 0.0, 0.0, 1.0, 1.0, 2.0));
    assert_eq!((high.xd[5], high.xdd[5]), (6.0, 0.5));
    let low = envelope.at(&EnvelopePoint::zeros());
    assert_eq!((low.x[0], low.xd[0], low.xdd[1]), (0.4, -1.0, -0.1));
}

#[test]
fn the_spread_is_even_in_every_pair_of_dimensions() {
    // The first step is 1 / phi.
    let phi = 1.0 / (MotionEnvelope::spread(1)[0] + 0.5);
    assert!((phi.powi(19) - phi - 1.0).abs() < 1e-13, "{phi}");
    const CELLS: usize = 16;
    let count = 1 << 15;
    let points: Vec<_> = (0..count).map(MotionEnvelope::spread).collect();
    assert!(points.iter().all(|u| u.iter().all(|u| (0.0..1.0).contains(u))));
    for (a, b) in (0..DIMENSIONS).flat_map(|a| (0..a).map(move |b| (a, b))) {
        let mut cells = [0_u32; CELLS * CELLS];
        for point in &points {
            let cell = |u: f64| (u * CELLS as f64) as usize;
            cells[cell(point[a]) * CELLS + cell(point[b])] += 1;
        }
        // 128 each. Square roots of primes leave 0 and 398 in some.
        let (least, most) = (cells.iter().min().unwrap(), cells.iter().max().unwrap());
        assert!(*least > 50 && *most < 210, "{a} and {b}: {least} to {most} in a cell");
    }
}

#[test]
fn corners_are_different_and_any_three_extremes_meet_in_every_way() {
    let envelope = envelope();
    let corners: Vec<_> = (0..CORNER_COUNT).map(|k| envelope.corner(k)).collect();
    for (k, corner) in corners.iter().enumerate() {
        assert!(corners.iter().take(k).all(|other| other != corner), "corner {k}");
    }
    let patterns = &corners[1..33];
    for (a, b, c) in (6..DIMENSIONS).flat_map(|a| (6..a).flat_map(move |b| (6..b).map(move |c| (a, b, c)))) {
        for signs in 0..8_u8 {
            let meets =
                |u: &&EnvelopePoint| [u[a], u[b], u[c]] == [0, 1, 2].map(|bit| f64::from((signs >> bit) & 1));
            assert_eq!(patterns.iter().filter(meets).count(), 4, "{a} {b} {c}: {signs:03b}");
        }
    }
}
