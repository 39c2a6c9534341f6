//! An observation linearised around one iterate, with the factors that every gain needs.

use nalgebra::{Cholesky, Const, SMatrix, SVector};

use super::belief::Belief;
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
    pub innovation: Cholesky<f64, Const<M>>,
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
            h *= S::to_left(chi);
        }
        if xi.iter().any(|component| *component != 0.0) {
            h *= S::jacobian::<G, D>(xi);
        }
        let p_ht = belief.covariance.times_transposed(&h);
        let innovation = Cholesky::new(h * p_ht + noise)?;
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
        self.h * self.p_ht + self.noise
    }

    /// `z^T S^-1 z`.
    pub fn normalised_square(&self) -> f64 {
        self.residual.dot(&self.innovation.solve(&self.residual))
    }

    /// `ln det S`.
    pub fn log_determinant(&self) -> f64 {
        let root = self.innovation.l_dirty();
        (0..M).map(|m| 2.0 * root[(m, m)].ln()).sum()
    }
}
