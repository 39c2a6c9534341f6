//! The system's allocator, counted by thread: for tests of what must not allocate. One file for all of them, in the
//! library's tests and in the daemon's.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

thread_local! {
    /// Allocations and frees of this thread. The harness has threads of its own.
    static CALLS: Cell<u64> = const { Cell::new(0) };
    /// Whether another thread watches this one.
    static IS_WATCHED: Cell<bool> = const { Cell::new(false) };
}

/// Allocations and frees of all watched threads.
static WATCHED_CALLS: AtomicU64 = AtomicU64::new(0);

/// The system's allocator, counted.
struct Counting;

fn count() {
    // While the thread ends the counter may be gone; nobody looks at it any more then.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
    if IS_WATCHED.try_with(Cell::get).unwrap_or(false) {
        WATCHED_CALLS.fetch_add(1, Ordering::SeqCst);
    }
}

// SAFETY: every call goes to the system's allocator with the arguments unchanged; the counter is a plain cell of the
// thread without a destructor, which never allocates.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller keeps the contract of `dealloc`; `pointer` came from the system.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `realloc`; `pointer` came from the system.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// From now on what this thread allocates and frees is seen in [`watched_allocations`].
#[allow(dead_code)] // Most tests look at their own thread only.
pub fn watch_this_thread() {
    IS_WATCHED.set(true);
}

/// Allocations and frees of watched threads so far; from any thread.
#[allow(dead_code)]
pub fn watched_allocations() -> u64 {
    WATCHED_CALLS.load(Ordering::SeqCst)
}

/// Allocations and frees of this thread while `work` runs.
pub fn allocations(work: impl FnOnce()) -> u64 {
    let before = CALLS.get();
    work();
    CALLS.get() - before
}
