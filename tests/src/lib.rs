//! inekf-tests
