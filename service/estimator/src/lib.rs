//! inekf
