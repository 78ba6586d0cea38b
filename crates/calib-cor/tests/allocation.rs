//! Closed forms and likelihood fits allocate nothing for a sample or a step: the number of allocations does not grow with them.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use calib_cor::{Input, Options, Pose, fit};
use nalgebra::{Point3, Rotation3, Vector3};

struct Counting;

thread_local! {
    static CALLS: Cell<usize> = const { Cell::new(0) };
}

fn counted() {
    // A thread that ends has no counter any more.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
}

// SAFETY: every call is the system allocator's own; only a number is kept beside it.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        counted();
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        counted();
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A ball joint, with a wobble that no estimator explains.
fn poses(n: usize) -> Vec<Option<Pose>> {
    (0..n)
        .map(|k| {
            let k = k as f64;
            let turn = Vector3::new((0.9 * k).sin(), (1.7 * k).cos(), (0.3 * k).sin()) * 0.8;
            let r = Rotation3::from_scaled_axis(turn);
            let wobble = Vector3::new((5.1 * k).sin(), (7.3 * k).sin(), (9.7 * k).cos()) * 1e-3;
            Some(Pose {
                rotation: r.into_inner(),
                translation: r * Vector3::new(0.0, 0.1, 0.02) + wobble,
            })
        })
        .collect()
}

fn calls(id: &str, input: &Input<'_>) -> usize {
    let options = Options::default();
    let before = CALLS.with(Cell::get);
    let outcome = fit(id, input, &options).expect(id);
    let after = CALLS.with(Cell::get);
    assert!(outcome.is_observable(), "{id}: {:?}", outcome.reason());
    after - before
}

#[test]
fn samples_cost_no_allocations() {
    /// A list that doubles as it grows from 100 to 12 800 samples, and one more.
    const DOUBLINGS: usize = 8;
    let (few, many) = (poses(100), poses(12_800));
    let track = |poses: &[Option<Pose>]| {
        vec![
            poses
                .iter()
                .map(|p| p.map(|p| Point3::from(p.translation)))
                .collect::<Vec<_>>(),
        ]
    };
    let (few_points, many_points) = (track(&few), track(&many));
    for id in ["hse", "hsa", "hotspot_ml"] {
        let (a, b) = (
            calls(id, &Input::Poses(&few)),
            calls(id, &Input::Poses(&many)),
        );
        assert_eq!(a, b, "{id}: allocations for 100 and 12 800 poses");
    }
    for id in [
        "sfe",
        "kasa",
        "taubin",
        "hyper",
        "gamage_lasenby",
        "ml_sphere",
    ] {
        let (a, b) = (
            calls(id, &Input::Points(&few_points)),
            calls(id, &Input::Points(&many_points)),
        );
        assert!(
            b <= a + DOUBLINGS,
            "{id}: {a} allocations for 100 points, {b} for 12 800"
        );
    }
}
