//! Sums of whole columns: what the products of covariances are made of.
//!
//! Two rows at a time, written out: that is what every 64-bit machine does in one instruction, and the compiler
//! does not find it in a plain loop over an odd number of rows. No sum is reordered, so that the results do not
//! depend on the machine.

/// A column of D rows.
pub(crate) type Column<const D: usize> = [f64; D];

/// The first ROWS rows (at most all) of `base + sum_n factors_n columns_n`, summed in this order; zero in the other rows of the
/// result.
#[inline(always)]
pub(crate) fn combined<
    const ROWS: usize,
    const B: usize,
    const D: usize,
    const R: usize,
    const N: usize,
>(
    base: &Column<B>,
    factors: [f64; N],
    columns: [&Column<D>; N],
) -> Column<R> {
    let mut sum = [0.0; R];
    for pair in 0..ROWS.min(D) / 2 {
        let row = 2 * pair;
        let mut entries = [base[row], base[row + 1]];
        for n in 0..N {
            entries[0] += factors[n] * columns[n][row];
            entries[1] += factors[n] * columns[n][row + 1];
        }
        sum[row] = entries[0];
        sum[row + 1] = entries[1];
    }
    if ROWS.min(D) % 2 == 1 {
        let row = ROWS.min(D) - 1;
        let mut entry = base[row];
        for n in 0..N {
            entry += factors[n] * columns[n][row];
        }
        sum[row] = entry;
    }
    sum
}
