//! The widest instructions that this processor has.
//!
//! The daemon is built for every processor of its architecture, and x86-64's common ground is that of 2003. What is
//! compiled a second time for AVX2 takes 15 % fewer instructions. No product is fused into a sum for it (AVX2, not FMA), so
//! that the results are the same bit for bit on every machine.
//!
//! ```
//! use inekf_service::engine::processor::{Processor, Work};
//!
//! /// A sum of squares.
//! struct Norm<'a>(&'a [f64], &'a mut f64);
//!
//! impl Work for Norm<'_> {
//!     #[inline(always)]
//!     fn run(self) {
//!         *self.1 = self.0.iter().map(|x| x * x).sum();
//!     }
//! }
//!
//! let numbers: Vec<f64> = (0..1000).map(|i| f64::from(i).sin()).collect();
//! let (mut wide, mut plain) = (0.0, 0.0);
//! Processor::detect().run(Norm(&numbers, &mut wide));
//! Processor::plain().run(Norm(&numbers, &mut plain));
//! // Bit for bit, whatever the processor.
//! assert_eq!(wide.to_bits(), plain.to_bits());
//! ```

/// What was found out about the processor, once.
///
/// ```
/// use inekf_service::engine::processor::Processor;
///
/// // Asked once, and kept: it does not change.
/// let processor = Processor::detect();
/// assert_eq!(format!("{processor:?}"), format!("{:?}", Processor::detect()));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Processor {
    #[cfg(target_arch = "x86_64")]
    has_avx2: bool,
}

impl Processor {
    /// Asks the processor.
    ///
    /// ```
    /// use inekf_service::engine::processor::{Processor, Work};
    ///
    /// struct Double<'a>(&'a mut f64);
    ///
    /// impl Work for Double<'_> {
    ///     #[inline(always)]
    ///     fn run(self) {
    ///         *self.0 *= 2.0;
    ///     }
    /// }
    ///
    /// let mut number = 21.0;
    /// Processor::detect().run(Double(&mut number));
    /// assert_eq!(number, 42.0);
    /// ```
    #[must_use]
    pub fn detect() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            has_avx2: std::arch::is_x86_feature_detected!("avx2"),
        }
    }

    /// A processor of which nothing is known: only what all have is used.
    ///
    /// ```
    /// use inekf_service::engine::processor::{Processor, Work};
    ///
    /// struct Double<'a>(&'a mut f64);
    ///
    /// impl Work for Double<'_> {
    ///     #[inline(always)]
    ///     fn run(self) {
    ///         *self.0 *= 2.0;
    ///     }
    /// }
    ///
    /// let mut number = 21.0;
    /// Processor::plain().run(Double(&mut number));
    /// assert_eq!(number, 42.0);
    /// ```
    #[must_use]
    pub fn plain() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            has_avx2: false,
        }
    }

    /// Does `work`, which is compiled a second time for the wider instructions.
    ///
    /// ```
    /// use inekf_service::engine::processor::{Processor, Work};
    ///
    /// struct Double<'a>(&'a mut f64);
    ///
    /// impl Work for Double<'_> {
    ///     #[inline(always)]
    ///     fn run(self) {
    ///         *self.0 *= 2.0;
    ///     }
    /// }
    ///
    /// let mut number = 21.0;
    /// Processor::detect().run(Double(&mut number));
    /// assert_eq!(number, 42.0);
    /// ```
    #[inline(always)]
    pub fn run<W: Work>(self, work: W) {
        #[cfg(target_arch = "x86_64")]
        if self.has_avx2 {
            // SAFETY: the processor has said that it has these instructions.
            return unsafe { with_avx2(work) };
        }
        work.run();
    }
}

/// What is compiled for several processors: as much of it as is inlined into [`Work::run`], which has to be
/// `#[inline(always)]` itself.
///
/// ```
/// use inekf_service::engine::processor::{Processor, Work};
///
/// struct Double<'a>(&'a mut f64);
///
/// impl Work for Double<'_> {
///     #[inline(always)]
///     fn run(self) {
///         *self.0 *= 2.0;
///     }
/// }
///
/// let mut number = 21.0;
/// Processor::plain().run(Double(&mut number));
/// assert_eq!(number, 42.0);
/// ```
pub trait Work {
    /// Does it.
    ///
    /// ```
    /// use inekf_service::engine::processor::{Processor, Work};
    ///
    /// struct Double<'a>(&'a mut f64);
    ///
    /// impl Work for Double<'_> {
    ///     #[inline(always)]
    ///     fn run(self) {
    ///         *self.0 *= 2.0;
    ///     }
    /// }
    ///
    /// let mut number = 21.0;
    /// Double(&mut number).run();
    /// assert_eq!(number, 42.0);
    /// ```
    fn run(self);
}

/// Does `work`, compiled for AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<W: Work>(work: W) {
    work.run();
}
