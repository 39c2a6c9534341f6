//! An observation linearised around one iterate, with the factors that every gain needs.

use nalgebra::{SMatrix, SVector};

use super::belief::Belief;
use super::factor::Factor;
use super::side::Side;
use crate::lie::LieGroup;
use crate::model::Observation;

/// `z = H xi + v` around an iterate `chi_i = retract(chi_hat, xi_i)`, v of covariance N.
#[derive(Clone, Copy, Debug)]
pub struct Linearised<G, const D: usize, const M: usize> {
    /// `chi_i`.
    pub chi: G,
    /// `z_i = y - h(chi_i)`.
    pub residual: SVector<f64, M>,
    /// `H_i = H(chi_i) J(xi_i)`, in the error of the belief's side.
    pub h: SMatrix<f64, M, D>,
    /// N.
    pub noise: SMatrix<f64, M, M>,
    /// `P H_i^T`.
    pub p_ht: SMatrix<f64, D, M>,
    /// Cholesky factor of `S_i = H_i P H_i^T + N`.
    pub innovation: Factor<M>,
}

/// Whether a column of H has an entry that is not zero: whether the sensor sees this state.
#[inline(always)]
pub(super) fn sees<const D: usize, const M: usize>(h: &SMatrix<f64, M, D>, state: usize) -> bool {
    (0..M).any(|row| h[(row, state)] != 0.0)
}

/// `H J`, passing over the states that the sensor does not see.
#[inline]
fn times<const D: usize, const M: usize>(
    h: &SMatrix<f64, M, D>,
    j: &SMatrix<f64, D, D>,
) -> SMatrix<f64, M, D> {
    let mut product = SMatrix::<f64, M, D>::zeros();
    for k in (0..D).filter(|k| sees(h, *k)) {
        for column in 0..D {
            let factor = j[(k, column)];
            if factor != 0.0 {
                for row in 0..M {
                    product[(row, column)] += h[(row, k)] * factor;
                }
            }
        }
    }
    product
}

/// `N + H B`, passing over the states that the sensor does not see.
#[inline]
fn sum_of_product<const D: usize, const M: usize>(
    noise: &SMatrix<f64, M, M>,
    h: &SMatrix<f64, M, D>,
    b: &SMatrix<f64, D, M>,
) -> SMatrix<f64, M, M> {
    let mut sum = *noise;
    for k in (0..D).filter(|k| sees(h, *k)) {
        for column in 0..M {
            for row in 0..M {
                sum[(row, column)] += h[(row, k)] * b[(k, column)];
            }
        }
    }
    sum
}

impl<G: LieGroup<D>, const D: usize, const M: usize> Linearised<G, D, M> {
    /// `observation` around `chi`, which lies `xi` away from the mean of `belief`. `None` if the innovation
    /// covariance is not positive definite.
    pub fn at<S, O>(
        belief: &Belief<G, S, D>,
        observation: &O,
        chi: &G,
        xi: &SVector<f64, D>,
        noise: &SMatrix<f64, M, M>,
    ) -> Option<Self>
    where
        S: Side,
        O: Observation<G, D, M>,
    {
        let mut h = observation.left_jacobian(chi);
        if !S::IS_LEFT {
            h = times(&h, &S::to_left(chi));
        }
        if xi.iter().any(|component| *component != 0.0) {
            h = times(&h, &S::jacobian::<G, D>(xi));
        }
        let p_ht = belief.covariance.times_transposed(&h);
        let innovation = Factor::new(&sum_of_product(noise, &h, &p_ht))?;
        Some(Self {
            chi: *chi,
            residual: observation.residual(chi),
            h,
            noise: *noise,
            p_ht,
            innovation,
        })
    }

    /// S, M x M.
    pub fn innovation_covariance(&self) -> SMatrix<f64, M, M> {
        sum_of_product(&self.noise, &self.h, &self.p_ht)
    }

    /// `z^T S^-1 z`.
    pub fn normalised_square(&self) -> f64 {
        self.innovation.normalised_square(&self.residual)
    }

    /// `ln det S`.
    pub fn log_determinant(&self) -> f64 {
        self.innovation.log_determinant()
    }
}
