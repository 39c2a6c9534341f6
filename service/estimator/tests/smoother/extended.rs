//! Numbers of 32 digits, as the sum of two doubles (Dekker), and what little linear algebra the oracles need.

use std::ops::{Add, Div, Index, IndexMut, Mul, Neg, Sub};

/// `high + low`, with `|low|` at most half a unit in the last place of `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extended {
    high: f64,
    low: f64,
}

/// `a + b` without loss.
fn exact_sum(a: f64, b: f64) -> Extended {
    let high = a + b;
    let from_b = high - a;
    let low = (a - (high - from_b)) + (b - from_b);
    Extended { high, low }
}

impl From<f64> for Extended {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl From<Extended> for f64 {
    fn from(value: Extended) -> Self {
        value.high + value.low
    }
}

impl Neg for Extended {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Add for Extended {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let high = exact_sum(self.high, other.high);
        let low = exact_sum(self.low, other.low);
        let first = exact_sum(high.high, high.low + low.high);
        exact_sum(first.high, first.low + low.low)
    }
}

impl Sub for Extended {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Extended {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let high = self.high * other.high;
        let low = self.high.mul_add(other.high, -high);
        exact_sum(high, low + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Extended {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = Self::from(self.high / other.high);
        let rest = self - first * other;
        let second = Self::from(rest.high / other.high);
        let rest = rest - second * other;
        first + second + Self::from(rest.high / other.high)
    }
}

/// A matrix of such numbers.
#[derive(Clone, Debug)]
pub struct Table {
    rows: usize,
    columns: usize,
    entries: Vec<Extended>,
}

impl Index<(usize, usize)> for Table {
    type Output = Extended;

    fn index(&self, (row, column): (usize, usize)) -> &Extended {
        &self.entries[row * self.columns + column]
    }
}

impl IndexMut<(usize, usize)> for Table {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut Extended {
        &mut self.entries[row * self.columns + column]
    }
}

impl Table {
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self::from_fn(rows, columns, |_, _| 0.0.into())
    }

    fn from_fn(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> Extended) -> Self {
        let entry = &entry;
        let entries = (0..rows).flat_map(|row| (0..columns).map(move |column| entry(row, column)));
        Self {
            rows,
            columns,
            entries: entries.collect(),
        }
    }

    pub fn transpose(&self) -> Self {
        Self::from_fn(self.columns, self.rows, |row, column| self[(column, row)])
    }

    pub fn negated(&self) -> Self {
        Self::from_fn(self.rows, self.columns, |row, column| -self[(row, column)])
    }

    pub fn plus(&self, other: &Self) -> Self {
        Self::from_fn(self.rows, self.columns, |row, column| {
            self[(row, column)] + other[(row, column)]
        })
    }

    pub fn times(&self, other: &Self) -> Self {
        assert_eq!(self.columns, other.rows);
        Self::from_fn(self.rows, other.columns, |row, column| {
            (0..self.columns).fold(0.0.into(), |sum, k| {
                sum + self[(row, k)] * other[(k, column)]
            })
        })
    }

    /// `self^-1 right`, by elimination with row pivoting.
    pub fn solve(&self, right: &Self) -> Self {
        let (mut a, mut x) = (self.clone(), right.clone());
        let n = self.rows;
        for k in 0..n {
            let pivot = (k..n)
                .max_by(|i, j| a[(*i, k)].high.abs().total_cmp(&a[(*j, k)].high.abs()))
                .expect("a row");
            for column in 0..n {
                a.entries.swap(k * n + column, pivot * n + column);
            }
            for column in 0..x.columns {
                let width = x.columns;
                x.entries.swap(k * width + column, pivot * width + column);
            }
            for row in 0..n {
                if row == k {
                    continue;
                }
                let factor = a[(row, k)] / a[(k, k)];
                for column in k..n {
                    a[(row, column)] = a[(row, column)] - factor * a[(k, column)];
                }
                for column in 0..x.columns {
                    x[(row, column)] = x[(row, column)] - factor * x[(k, column)];
                }
            }
        }
        Self::from_fn(n, x.columns, |row, column| x[(row, column)] / a[(row, row)])
    }
}
