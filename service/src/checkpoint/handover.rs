//! The newest value of one thread, handed to another without either ever waiting: a triple buffer.
//!
//! Of three slots one belongs to the giver, one to the taker, and one lies between them. To give is to write one's own
//! slot and to exchange it for the one between; to take is to exchange one's own for that one, if it is fresh. Both are
//! a copy and one atomic exchange: no lock, no allocation, no system call. A value that is not taken before the next
//! one is given is lost, as it should be.
//!
//! ```
//! use inekf_service::checkpoint::handover::pair;
//!
//! let (mut giver, mut taker) = pair([0; 3]);
//! let giving = std::thread::spawn(move || giver.give(&[1, 2, 3]));
//! giving.join().expect("it is given");
//! assert_eq!(taker.take(), Some([1, 2, 3]));
//! ```

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Arc;

/// Set in [`Shared::between`] when the slot between has not been taken.
const FRESH: usize = 4;
/// The rest of it: the index of the slot.
const INDEX: usize = 3;

/// The slots, and which of them lies between giver and taker.
#[derive(Debug)]
struct Shared<T> {
    slots: [UnsafeCell<T>; 3],
    between: AtomicUsize,
}

// SAFETY: each slot is touched by the one side only that holds its index. The three indices are handed out once and
// only ever exchanged, by atomic swaps that order what was written before them (`AcqRel`).
unsafe impl<T: Send> Sync for Shared<T> {}

/// The side that gives.
///
/// ```
/// use inekf_service::checkpoint::handover::pair;
///
/// let (mut giver, taker) = pair('a');
/// // It does not mind whether anybody takes.
/// drop(taker);
/// giver.give(&'b');
/// assert!(format!("{giver:?}").starts_with("Giver"));
/// ```
#[derive(Debug)]
pub struct Giver<T> {
    shared: Arc<Shared<T>>,
    own: usize,
}

/// The side that takes.
///
/// ```
/// use inekf_service::checkpoint::handover::pair;
///
/// let (giver, mut taker) = pair('a');
/// // Nor does this one mind whether anybody gives.
/// drop(giver);
/// assert_eq!(taker.take(), None);
/// ```
#[derive(Debug)]
pub struct Taker<T> {
    shared: Arc<Shared<T>>,
    own: usize,
}

/// Both sides of a buffer in which nothing has been given yet; `blank` fills the slots.
///
/// ```
/// use inekf_service::checkpoint::handover::pair;
///
/// let (mut giver, mut taker) = pair(0);
/// assert_eq!(taker.take(), None);
/// giver.give(&1);
/// giver.give(&2);
/// // The newest, once; neither side ever waits.
/// assert_eq!((taker.take(), taker.take()), (Some(2), None));
/// ```
pub fn pair<T: Copy + Send>(blank: T) -> (Giver<T>, Taker<T>) {
    let shared = Arc::new(Shared {
        slots: [blank, blank, blank].map(UnsafeCell::new),
        between: AtomicUsize::new(1),
    });
    let giver = Giver {
        shared: Arc::clone(&shared),
        own: 0,
    };
    (giver, Taker { shared, own: 2 })
}

impl<T: Copy + Send> Giver<T> {
    /// Gives `value`; one that was given before and not taken is lost.
    ///
    /// ```
    /// use inekf_service::checkpoint::handover::pair;
    ///
    /// let (mut giver, mut taker) = pair(0);
    /// giver.give(&1);
    /// giver.give(&2);
    /// assert_eq!(taker.take(), Some(2));
    /// ```
    pub fn give(&mut self, value: &T) {
        // SAFETY: nobody else touches the slot whose index this side holds.
        unsafe { *self.shared.slots[self.own].get() = *value };
        let between = self.shared.between.swap(self.own | FRESH, Ordering::AcqRel);
        self.own = between & INDEX;
    }
}

impl<T: Copy + Send> Taker<T> {
    /// The newest value, if it has not been taken.
    ///
    /// ```
    /// use inekf_service::checkpoint::handover::pair;
    ///
    /// let (mut giver, mut taker) = pair(0);
    /// giver.give(&1);
    /// assert_eq!((taker.take(), taker.take()), (Some(1), None));
    /// ```
    pub fn take(&mut self) -> Option<T> {
        if self.shared.between.load(Ordering::Relaxed) & FRESH == 0 {
            return None;
        }
        let between = self.shared.between.swap(self.own, Ordering::AcqRel);
        self.own = between & INDEX;
        // SAFETY: nobody else touches the slot whose index this side holds.
        Some(unsafe { *self.shared.slots[self.own].get() })
    }
}

#[cfg(test)]
mod tests {
    use super::pair;

    #[test]
    fn what_is_given_is_taken_once_and_the_newest_wins() {
        let (mut giver, mut taker) = pair(0);
        assert_eq!(taker.take(), None);
        giver.give(&1);
        assert_eq!(taker.take(), Some(1));
        assert_eq!(taker.take(), None);
        for value in 2..7 {
            giver.give(&value);
        }
        assert_eq!(taker.take(), Some(6));
        assert_eq!(taker.take(), None);
    }

    #[test]
    fn a_taker_beside_the_giver_never_sees_half_a_value_nor_an_older_one() {
        const LAST: u64 = 200_000;
        let (mut giver, mut taker) = pair([0u64; 64]);
        let giving = std::thread::spawn(move || (1..=LAST).for_each(|n| giver.give(&[n; 64])));
        let mut newest = 0;
        while newest < LAST {
            if let Some(value) = taker.take() {
                assert!(value.iter().all(|&n| n == value[0]), "{value:?}");
                assert!(value[0] > newest);
                newest = value[0];
            }
        }
        giving.join().unwrap();
    }
}
