//! Memory over a long drive.

use deepfusion_geometry::Se3;
use deepfusion_perception::{Perception, PerceptionConfig, Stamp};
use deepfusion_sim::{SimConfig, Simulation};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering};

/// Counts the bytes allocated.
struct Counting;

static HELD: AtomicIsize = AtomicIsize::new(0);

// SAFETY: every call is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HELD.fetch_add(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller's contract is the same.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller's contract is the same.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Ten thousand frames of a street that is driven again and again, with tracks that start and end.
#[test]
fn ten_thousand_frames_need_no_more_memory_than_a_thousand() {
    let simulation = Simulation::new(&SimConfig {
        seed: 5,
        frames: 24,
        width: 160,
        height: 48,
        moving_cars: 6,
        ..SimConfig::default()
    })
    .unwrap();
    let k = simulation.intrinsics();
    let frames: Vec<_> = (0..24).map(|i| simulation.frame(i)).collect();
    let mut perception = Perception::new(PerceptionConfig {
        parking_rows: true,
        ..PerceptionConfig::default()
    });
    let mut look = |number: usize| {
        let frame = &frames[number % frames.len()];
        let stamp = Stamp {
            time_s: number as f64 * 0.1,
            world_from_cam: Se3::identity(),
        };
        let seen = perception.detect(&frame.depth, &k, Some(stamp)).unwrap();
        seen.targets.iter().map(|t| t.id).max()
    };
    for number in 0..1_000 {
        look(number);
    }
    let held = HELD.load(Ordering::Relaxed);
    let mut last = None;
    for number in 1_000..10_000 {
        last = look(number).or(last);
    }
    let grown = HELD.load(Ordering::Relaxed) - held;
    // Tracks start and end, each some hundred bytes; leaking one per frame would be megabytes.
    assert!(grown.abs() < 100_000, "{grown} bytes");
    assert!(last > Some(1_000), "tracks were started: {last:?}");
}
