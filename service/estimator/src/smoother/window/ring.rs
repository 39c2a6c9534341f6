//! Items in the order of time, in slots that are used in turn: nothing is moved, and no memory is taken, when one
//! enters or leaves.

use core::ops::{Index, IndexMut};

/// Oldest first; index 0 is the oldest.
#[derive(Clone, Debug)]
pub(super) struct Ring<T> {
    slots: Vec<T>,
    /// The slot of the oldest.
    first: usize,
    len: usize,
}

impl<T: Clone> Ring<T> {
    /// An empty ring of so many slots, which hold `blank` until they are first used.
    pub fn new(blank: &T, slots: usize) -> Self {
        Self {
            slots: vec![blank.clone(); slots],
            first: 0,
            len: 0,
        }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    pub fn clear(&mut self) {
        (self.first, self.len) = (0, 0);
    }

    /// Makes the slot after the newest the newest, with what it held when it was last used. There must be a free one.
    pub fn enter(&mut self) -> &mut T {
        debug_assert!(self.len < self.slots.len());
        self.len += 1;
        let newest = self.slot(self.len - 1);
        &mut self.slots[newest]
    }

    /// The oldest leaves, if there is one.
    pub fn leave(&mut self) {
        if self.len > 0 {
            self.first = self.slot(1);
            self.len -= 1;
        }
    }

    #[inline]
    fn slot(&self, index: usize) -> usize {
        let slot = self.first + index;
        if slot < self.slots.len() {
            slot
        } else {
            slot - self.slots.len()
        }
    }

    pub fn get(&self, index: usize) -> Option<&T> {
        (index < self.len).then(|| &self[index])
    }

    pub fn iter(&self) -> impl ExactSizeIterator<Item = &T> + DoubleEndedIterator {
        (0..self.len).map(|index| &self[index])
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        let (wrapped, oldest) = self.slots.split_at_mut(self.first);
        oldest.iter_mut().chain(wrapped).take(self.len)
    }

    /// The item before `index`, which is not 0, and the one there.
    #[inline]
    pub fn with_previous(&mut self, index: usize) -> (&T, &mut T) {
        let (before, at) = (self.slot(index - 1), self.slot(index));
        if before < at {
            let (front, back) = self.slots.split_at_mut(at);
            (&front[before], &mut back[0])
        } else {
            let (front, back) = self.slots.split_at_mut(before);
            (&back[0], &mut front[at])
        }
    }
}

impl<T: Clone> Index<usize> for Ring<T> {
    type Output = T;

    #[inline]
    fn index(&self, index: usize) -> &T {
        &self.slots[self.slot(index)]
    }
}

impl<T: Clone> IndexMut<usize> for Ring<T> {
    #[inline]
    fn index_mut(&mut self, index: usize) -> &mut T {
        let slot = self.slot(index);
        &mut self.slots[slot]
    }
}

#[cfg(test)]
mod tests {
    use super::Ring;

    #[test]
    fn what_enters_is_found_in_order_wherever_the_ring_begins() {
        let mut ring = Ring::new(&0, 3);
        for item in 1..=9 {
            *ring.enter() = item;
            if item > 2 {
                let oldest_first: Vec<i32> = ring.iter().copied().collect();
                assert_eq!(oldest_first, [item - 2, item - 1, item]);
                assert_eq!(
                    ring.iter_mut().map(|entry| *entry).collect::<Vec<_>>(),
                    oldest_first
                );
                for index in 1..3 {
                    let (before, at) = ring.with_previous(index);
                    assert_eq!(
                        (*before, *at),
                        (oldest_first[index - 1], oldest_first[index])
                    );
                }
                ring.leave();
                assert_eq!(ring.len(), 2);
                assert_eq!((ring.get(0), ring.get(2)), (Some(&(item - 1)), None));
            }
        }
        ring.clear();
        ring.leave();
        assert_eq!(ring.len(), 0);
    }
}
