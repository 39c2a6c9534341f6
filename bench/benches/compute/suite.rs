//! One list of routines, and what can be done with it: time each, or count its instructions.

use core::hint::black_box;

/// What is done with each routine.
pub trait Suite {
    /// `change` on fresh copies of `start`; making the copies is not counted.
    fn in_place<T: Copy>(&mut self, name: &str, start: T, change: impl FnMut(&mut T));

    /// One call of `routine` after the other.
    fn call<R>(&mut self, name: &str, routine: impl FnMut() -> R);
}

/// Writes down the names.
#[derive(Default)]
pub struct Names(pub Vec<String>);

impl Suite for Names {
    fn in_place<T: Copy>(&mut self, name: &str, _start: T, _change: impl FnMut(&mut T)) {
        self.0.push(name.to_owned());
    }

    fn call<R>(&mut self, name: &str, _routine: impl FnMut() -> R) {
        self.0.push(name.to_owned());
    }
}

/// Makes a number of calls of one routine, and none of the others.
pub struct Calls {
    /// The routine.
    pub name: String,
    /// How many calls.
    pub count: u64,
}

impl Suite for Calls {
    fn in_place<T: Copy>(&mut self, name: &str, start: T, mut change: impl FnMut(&mut T)) {
        if name == self.name {
            for _ in 0..self.count {
                let mut fresh = black_box(start);
                change(&mut fresh);
                black_box(&fresh);
            }
        }
    }

    fn call<R>(&mut self, name: &str, mut routine: impl FnMut() -> R) {
        if name == self.name {
            for _ in 0..self.count {
                black_box(routine());
            }
        }
    }
}
