//! No call allocates once the model was loaded.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

#[path = "it/common.rs"]
mod common;

use calib_model::{Approach, Model, Options, Place, Under};
use common::{Effects, WARM, posture, rng, robot, with_uncertainty};

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

#[test]
fn no_call_allocates() {
    let mut r = rng(1);
    let file = with_uncertainty(robot(&mut r, 7, false, Effects::All), &mut r);
    let model = Model::new(&file).expect("a model");
    let mut work = model.work();
    let mut approach = Approach::new(&model);
    let q = posture(&mut r, 7);
    let seed: Vec<f64> = q.iter().map(|q| q + 0.1).collect();
    let tool = model.last_link();
    let (mut command, mut jacobian, mut many) = ([0.0; 7], [0.0; 42], [0.0; 12]);
    assert!(CALLS.with(Cell::get) > 0, "the counter counts");
    let before = CALLS.with(Cell::get);
    approach.update(&model, &q).expect("finite");
    let under = Under {
        approach: approach.directions(),
        held: None,
        temperature_c: &WARM[..7],
    };
    model.forward(&q, &under, &mut work).expect("poses");
    let wanted = work.root_from_link(tool);
    model.forward_nominal(&q, &mut work).expect("poses");
    let place = Place::Link(tool);
    model
        .forward_many(&q, place, &under, &mut work, &mut many)
        .expect("poses");
    model
        .jacobian(&q, tool, &under, &mut work, &mut jacobian)
        .expect("a jacobian");
    model
        .sigma(&q, place, &under, &mut work)
        .expect("a covariance");
    model.scope(&q).expect("finite");
    let options = Options::default();
    model
        .correct(&q, tool, &options, &under, &mut work, &mut command)
        .expect("a correction");
    let options = Options::inverse();
    let out = (&mut work, &mut command[..]);
    model
        .ik(&wanted, &seed, tool, &options, &under, out)
        .expect("a position");
    assert_eq!(CALLS.with(Cell::get) - before, 0);
}
