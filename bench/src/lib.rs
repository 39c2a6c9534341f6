//! inekf-bench
