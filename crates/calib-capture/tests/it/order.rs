//! Frames that are missing, late, twice, or of the next day.

use calib_capture::{Arrival, Frame, Order};

fn frame(number: Option<u64>, device: Option<f64>) -> Frame {
    Frame {
        number,
        device,
        ..Frame::default()
    }
}

#[test]
fn missing_late_and_repeated_frames() {
    let mut order = Order::default();
    let mut taken = Vec::new();
    for number in [10, 11, 13, 12, 13, 14, 20] {
        let arrival = order.arrives(&frame(Some(number), Some(number as f64 * 0.01)));
        if let Arrival::InOrder { .. } = arrival {
            taken.push(number);
        }
    }
    assert_eq!(taken, [10, 11, 13, 14, 20]);
    // 12 was counted as missing when 13 came, and came late; 15 to 19 never came.
    assert_eq!((order.taken, order.missing, order.late), (5, 6, 2));
}

#[test]
fn midnight_is_no_restart() {
    let mut order = Order::default();
    let mut times = Vec::new();
    for (number, ts) in [
        (1, 86_399.98),
        (2, 86_399.99),
        (3, 0.0),
        (4, 0.01),
        (5, 86_399.5),
        (6, 0.2),
    ] {
        match order.arrives(&frame(Some(number), Some(ts))) {
            Arrival::InOrder { device } => times.push(device.expect("timed")),
            other => panic!("{number}: {other:?}"),
        }
    }
    assert!(
        (times[2] - 86_400.0).abs() < 1e-9 && (times[5] - 172_800.2).abs() < 1e-9,
        "{times:?}"
    );
    assert!(times.windows(2).all(|w| w[0] < w[1]));
    // Unix times do not wrap: half a day back is a clock that was set.
    let mut order = Order::default();
    order.arrives(&frame(None, Some(1.7e9)));
    assert_eq!(
        order.arrives(&frame(None, Some(1.7e9 - 50_000.0))),
        Arrival::Late
    );
}

#[test]
fn a_tracker_that_starts_over_is_distinguished_from_disorder() {
    let mut order = Order::default();
    order.arrives(&frame(Some(5000), None));
    let arrivals: Vec<Arrival> = (0..60)
        .map(|n| order.arrives(&frame(Some(n), None)))
        .collect();
    assert_eq!(arrivals[48], Arrival::Late);
    assert_eq!(arrivals[49], Arrival::Restarted);
}
