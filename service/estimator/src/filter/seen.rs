//! Which states a sensor sees: the columns of H that have an entry that is not zero.

use nalgebra::SMatrix;

/// The states seen, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seen<const D: usize> {
    states: [usize; D],
    count: usize,
}

impl<const D: usize> Seen<D> {
    /// By H.
    #[inline]
    pub fn by<const M: usize>(h: &SMatrix<f64, M, D>) -> Self {
        let mut seen = Self {
            states: [0; D],
            count: 0,
        };
        for (state, column) in h.data.0.iter().enumerate() {
            let mut sees = false;
            for entry in column {
                sees |= *entry != 0.0;
            }
            seen.states[seen.count.min(D - 1)] = state;
            seen.count += usize::from(sees);
        }
        seen
    }

    /// The states.
    #[inline]
    pub fn states(&self) -> &[usize] {
        &self.states[..self.count.min(D)]
    }
}
