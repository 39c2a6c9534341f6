//! Vectors of three and 3 x 3 blocks in the machine's registers: what products of covariances are made of.
//!
//! A [`Quad`] is four numbers that are added and multiplied at once, of which vectors of three use the first three.
//! Every 64-bit machine has the instructions for two at a time, and the compiler does not find them in plain loops
//! over odd numbers of rows; so they are named here. No sum is reordered and no product fused: the results are those
//! of the plain loops, on every machine.

use core::ops::{Add, Mul, Sub};

use nalgebra::{Matrix3, Vector3};
use wide::{f64x2, f64x4};

use crate::lie::SO3;

/// Two numbers that are worked on at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair(f64x2);

impl Pair {
    #[inline(always)]
    pub fn new(first: f64, second: f64) -> Self {
        Self(f64x2::new([first, second]))
    }

    /// The same number twice.
    #[inline(always)]
    pub fn splat(number: f64) -> Self {
        Self(f64x2::splat(number))
    }

    /// Two entries of `column`, from `row` on.
    #[inline(always)]
    pub fn load<const D: usize>(column: &[f64; D], row: usize) -> Self {
        Self::new(column[row], column[row + 1])
    }

    /// Puts them into `column` from `row` on.
    #[inline(always)]
    pub fn store<const D: usize>(self, column: &mut [f64; D], row: usize) {
        [column[row], column[row + 1]] = self.entries();
    }

    /// The numbers.
    #[inline(always)]
    pub fn entries(self) -> [f64; 2] {
        self.0.to_array()
    }

    /// The first numbers of two pairs, and their second ones.
    #[inline(always)]
    pub fn transposed(self, other: Self) -> [Self; 2] {
        let ([a, b], [c, d]) = (self.entries(), other.entries());
        [Self::new(a, c), Self::new(b, d)]
    }
}

impl Add for Pair {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Pair {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Pair {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

/// Four numbers that are worked on at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quad(f64x4);

impl PartialEq for Quad {
    fn eq(&self, other: &Self) -> bool {
        self.entries() == other.entries()
    }
}

impl Quad {
    /// A vector of three.
    #[inline(always)]
    pub fn triple(x: f64, y: f64, z: f64) -> Self {
        Self(f64x4::new([x, y, z, 0.0]))
    }

    /// The vector of three.
    #[inline(always)]
    pub fn entries(self) -> [f64; 3] {
        let [x, y, z, _] = self.0.to_array();
        [x, y, z]
    }

    /// `(y, z, x)`; what follows has no meaning.
    #[inline(always)]
    fn turned(self) -> Self {
        let [x, y, z, _] = self.0.to_array();
        Self(f64x4::new([y, z, x, y]))
    }

    /// The vector product of two vectors of three, of which `turned` is the first with its entries turned.
    #[inline(always)]
    fn cross_turned(self, turned: Self, other: Self) -> Self {
        (self * other.turned() - turned * other).turned()
    }
}

impl From<&Vector3<f64>> for Quad {
    #[inline(always)]
    fn from(vector: &Vector3<f64>) -> Self {
        Self::triple(vector.x, vector.y, vector.z)
    }
}

impl Add for Quad {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Quad {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Quad {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Mul<f64> for Quad {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        Self(self.0 * f64x4::splat(factor))
    }
}

/// A 3 x 3 matrix by columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Block([Quad; 3]);

// Written out: closures, and what iterates over arrays, are not always inlined into a function of this size.
impl Block {
    /// The matrix with these columns.
    #[inline(always)]
    pub fn from_columns(columns: [[f64; 3]; 3]) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = columns;
        Self([
            Quad::triple(a, b, c),
            Quad::triple(d, e, f),
            Quad::triple(g, h, i),
        ])
    }

    /// No entry but zero.
    #[inline(always)]
    pub fn zeros() -> Self {
        Self::from_columns([[0.0; 3]; 3])
    }

    /// `factor I`.
    #[inline(always)]
    pub fn diagonal(factor: f64) -> Self {
        Self::from_columns([[factor, 0.0, 0.0], [0.0, factor, 0.0], [0.0, 0.0, factor]])
    }

    /// The matrix of a rotation.
    #[inline(always)]
    pub fn rotation(rotation: &SO3) -> Self {
        Self::from_columns(rotation.matrix().data.0)
    }

    /// The entries by columns.
    #[inline(always)]
    pub fn entries(self) -> [[f64; 3]; 3] {
        let [x, y, z] = self.0;
        [x.entries(), y.entries(), z.entries()]
    }

    /// `M^T`.
    #[inline(always)]
    pub fn transpose(self) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.entries();
        Self::from_columns([[a, d, g], [b, e, h], [c, f, i]])
    }

    /// `factor M`.
    #[inline(always)]
    pub fn scaled(self, factor: f64) -> Self {
        let [x, y, z] = self.0;
        Self([x * factor, y * factor, z * factor])
    }

    /// `M a`.
    #[inline(always)]
    fn times_quad(self, a: Quad) -> Quad {
        let [x, y, z] = self.0;
        let [a, b, c] = a.entries();
        (x * a + y * b) + z * c
    }

    /// `M a`.
    #[inline(always)]
    pub fn apply(self, a: &Vector3<f64>) -> Vector3<f64> {
        let [x, y, z] = self.times_quad(Quad::from(a)).entries();
        Vector3::new(x, y, z)
    }

    /// `M X`.
    #[inline(always)]
    pub fn times(self, x: Self) -> Self {
        let [x, y, z] = x.0;
        Self([self.times_quad(x), self.times_quad(y), self.times_quad(z)])
    }

    /// `M X^T`.
    #[inline(always)]
    pub fn times_transposed(self, x: Self) -> Self {
        self.times(x.transpose())
    }

    /// `hat(c) X`.
    #[inline(always)]
    pub fn crossed_by(self, c: Quad) -> Self {
        let turned = c.turned();
        let [x, y, z] = self.0;
        Self([
            c.cross_turned(turned, x),
            c.cross_turned(turned, y),
            c.cross_turned(turned, z),
        ])
    }
}

impl From<Block> for Matrix3<f64> {
    fn from(block: Block) -> Self {
        Self::from(block.entries())
    }
}

impl Add for Block {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a + x, b + y, c + z])
    }
}
